"""The numbers a run is asked for, a file for those that are alike: their value at an instant, and their probe.

How to write an observable
--------------------------
An observable is a class with two faces that say the same: ``of(state)``, its value in a `refweb.results.state.State`,
which statics asks for at every load step, and ``probe(system)``, a compiled kernel that dynamics calls in every step.
What it may say besides is in `refweb.results.observables.observable.Observable`. A whole file,
``refweb/results/observables/moment_of_inertia.py``::

    '''The moment of inertia of a net's nodes about an axis through the origin.'''

    import numpy as np

    from refweb.kernels import kernel
    from refweb.results.observables.observable import Observable, Value
    from refweb.results.probes import MAGNITUDE, PROBE, Probe


    class MomentOfInertia(Observable):
        '''About the axis ``component``; without one, about the origin.'''

        unit = "kg m²"
        keys = ("component",)

        def of(self, state):
            net = state.system.net
            squares = state.position[: net.nodes] ** 2
            if self.observe.component is not None:
                squares[:, self.observe.component] = 0.0
            return Value(float(net.mass[: net.nodes] @ squares.sum(axis=1)), None)

        def probe(self, system):
            net, component = system.net, self.observe.component
            data = np.column_stack([net.mass, net.points])[: net.nodes]
            return Probe(inertia, [MAGNITUDE if component is None else component], data)


    @kernel(PROBE)
    def inertia(t, x, v, f, lines, rows, data, where):
        '''Σ m r² over the rows of data, mass and reference position of each node.'''
        total = 0.0
        for n in range(data.shape[0]):
            for k in range(3):
                if k != rows[0]:
                    total += data[n, 0] * (data[n, 1 + k] + x[n, k]) ** 2
        return total

A line in `refweb.registry.OBSERVABLES` makes it known to scenes, messages and both kinds of runs::

    "moment_of_inertia": "refweb.results.observables.moment_of_inertia:MomentOfInertia",

A scene then asks for it as for any other::

    [[observe]]
    name = "inertia"
    quantity = "moment_of_inertia"
    component = "z"
    reduce = "max"

``x`` in a kernel is the displacement of all rows, ``v`` their velocity, ``f`` the whole force on them; ``lines`` holds
tension and strain of each element. A quantity that stands at a node or line gives ``of`` a place and says in ``place``
what its probe's is; `refweb.results.observables.nodal` and `refweb.results.observables.line` do, and what is a sum of
energies is a `refweb.results.observables.book.Booked`. ``tests/results/test_observable_contract.py`` holds both faces
of all against each other, in random states.
"""
