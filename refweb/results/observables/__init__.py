"""The numbers a run is asked for, a file for those that are alike: their value at an instant, and their probe.

How to write an observable
--------------------------
An observable has two methods that give the same value: ``of(state)`` computes it in a `refweb.results.state.State`, and
``probe(system)`` returns a kernel that dynamics calls in every step. A whole file, ``moment_of_inertia.py`` in this
folder::

    '''Moment of inertia of a net's nodes about the axis ``component`` through the origin; without one, about it.'''

    import numpy as np

    from refweb.kernels import kernel
    from refweb.results.observables.observable import Observable, Value
    from refweb.results.probes import PROBE, Probe


    class MomentOfInertia(Observable):
        unit, keys = "kg m²", ("component",)

        def of(self, state):
            net = state.system.net
            squares = state.position[: net.nodes, self.across()] ** 2
            return Value(float(net.mass[: net.nodes] @ squares.sum(axis=1)), None)

        def probe(self, system):
            net = system.net
            return Probe(inertia, self.across(), np.column_stack([net.mass, net.points])[: net.nodes])

        def across(self):
            return [axis for axis in range(3) if axis != self.observe.component]


    @kernel(PROBE)
    def inertia(t, x, v, f, lines, rows, data, where):
        total = 0.0
        for n in range(data.shape[0]):
            for k in rows:
                total += data[n, 0] * (data[n, 1 + k] + x[n, k]) ** 2
        return total

A line in `refweb.registry.OBSERVABLES` makes it known to scenes, messages, statics and dynamics::

    "moment_of_inertia": "refweb.results.observables.moment_of_inertia:MomentOfInertia",

A scene asks for it in ``[[observe]]``, with the keys it takes::

    observe = [{ name = "inertia", quantity = "moment_of_inertia", component = "z", reduce = "max" }]

`refweb.results.observables.observable` describes further attributes and methods, `refweb.results.probes` the arguments
of a kernel, and `refweb.net.net.Net` the data of the net. Element c joins the rows ``net.cells[c, :2]``, ends first,
and belongs to the line ``net.line[c]``. The ``Value`` of an observable may have the number of a node or a line, as in
``nodal.py`` and ``line.py``. In dynamics its probe writes a row or an element to ``where[0]`` if ``where[1]`` is
``PLACE``, and ``position(system, at)`` converts it to a node or a line. ``on(system)`` refuses a node or a line that
the net does not have. A sum of energies has weights in place of a probe, as in ``balances.py``.
``tests/results/test_observable_contract.py`` compares the two methods of each observable.
"""
