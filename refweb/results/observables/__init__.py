"""The numbers a run is asked for, a file for those that are alike: their value at an instant, and their probe.

How to write an observable
--------------------------
An observable has two faces that say the same: ``of(state)``, its value in a `refweb.results.state.State`, and
``probe(system)``, a kernel that dynamics calls in every step. A whole file, ``my_webs/moment_of_inertia.py``::

    import numpy as np

    from refweb.kernels import kernel
    from refweb.results.observables.observable import Observable, Value
    from refweb.results.probes import PROBE, Probe


    class MomentOfInertia(Observable):
        '''Moment of inertia of the nodes about the axis ``component`` through the origin; without one, about it.'''

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

An entry point of your package makes it known to scenes, messages, statics and dynamics; in a script or a notebook
``refweb.register("observable", "moment_of_inertia", MomentOfInertia)`` does the same::

    [project.entry-points."refweb.observables"]
    moment_of_inertia = "my_webs.moment_of_inertia:MomentOfInertia"

A scene asks for it in ``[[observe]]``, with the keys it takes::

    observe = [{ name = "inertia", quantity = "moment_of_inertia", component = "z", reduce = "max" }]

`refweb.results.observables.observable` says what it may have besides, `refweb.results.probes` what a kernel sees, and
`refweb.net.net.Net` what there is: element c joins the rows ``net.cells[c, :2]``, ends first, and belongs to the line
``net.line[c]``. A quantity at a node or a line gives its ``Value`` that position, as those in ``nodal.py`` and
``line.py`` do; in dynamics its probe writes a row or an element to ``where[0]`` where ``where[1]`` is ``PLACE``, and
``position(system, at)`` makes a node or a line of it. ``on(system)`` refuses a node or a line that the net does not
have. A sum of energies has weights in place of a probe, as in ``balances.py``. One that refweb ships is a line in
`refweb.registry.OBSERVABLES`; ``tests/results/test_observable_contract.py`` holds the two faces of each against each
other.
"""

# This docstring is a page of the site and of `refweb help own-observable`. May change: the prose. Must stay: the first
# sentence, which tests/test_architecture.py compares, and its code, which tests/how_to/test_observable.py runs.
