"""Effects: forces on a net, one file an effect; no effect knows another, a global matrix or a solver.

How to write an effect
----------------------
An effect is a table of the scene, a frozen value whose ``on(net)`` says which rows it couples, and the kernels that add
its forces; `refweb.effects.base` has what else it may be. It may stand in a package of yours, a script or a notebook
cell. A whole file, ``my_webs/current.py``::

    '''The magnetic force on lines that carry a current, I dl × B.'''

    import numpy as np

    from refweb.effects.base import Balance, ForceTerm, Tangent
    from refweb.effects.vectors import cross
    from refweb.errors import InputError
    from refweb.kernels import BOUND, FORCE, STIFFNESS, kernel
    from refweb.tables import Several, Table, nodes, real, table, vector


    @kernel(FORCE)
    def force(t, x, v, f, cells, data, out):
        for c in range(len(cells)):
            i, j, line, field = cells[c, 0], cells[c, 1], data[c, :3], data[c, 3:]
            chord = (line[0] + x[j, 0] - x[i, 0], line[1] + x[j, 1] - x[i, 1], line[2] + x[j, 2] - x[i, 2])
            push = cross(chord, (0.5 * field[0], 0.5 * field[1], 0.5 * field[2]))
            power = 0.0
            for k in range(3):
                f[i, k] += push[k]
                f[j, k] += push[k]
                power += push[k] * (v[i, k] + v[j, k])
            out[c, 0] = power


    @kernel(STIFFNESS)
    def stiffness(t, x, v, blocks, cells, data, definite):
        unit, half = np.eye(3), 0.0 if definite else 0.5
        for c in range(len(cells)):
            for k in range(3):
                slope = half * np.cross(unit[k], data[c, 3:])
                for node in range(2):
                    blocks[c, 3 * node : 3 * node + 3, k] = slope
                    blocks[c, 3 * node : 3 * node + 3, 3 + k] = -slope


    @kernel(BOUND)
    def bound(reach, speed, x, mass, rates, cells, data):
        for c in range(len(cells)):
            for row in cells[c]:
                rates[row] += np.abs(data[c, 3:]).sum()


    @table
    class Current(Table):
        '''A current from the first node of lines to their second, in a uniform field.'''

        several = True
        lines: object = nodes(what="line")
        current: float = real(unit="A")
        field: Several = vector(unit="T")

        def on(self, net):
            if net.order > 1:
                raise InputError(f"[cable] order = {net.order} must be 1: a current runs straight from node to node")
            elements = np.flatnonzero(np.isin(net.line, net.web.find_lines(self.lines)))
            reference = net.line_data.reference[elements]
            data = np.hstack([reference, np.tile(self.current * np.array(self.field), (len(elements), 1))])
            tangent, balance = Tangent(stiffness, bound, symmetric=False), Balance("work", power=0)
            return ForceTerm("current", net.cells[elements], data, force, balance, tangent=tangent)

An entry point makes it known to scenes, messages, help and all methods; in ``pyproject.toml`` of your package::

    [project.entry-points."refweb.effects"]
    current = "my_webs.current:Current"

In a script or a notebook ``refweb.register("effect", "current", Current)`` does the same.

A scene may have several of it, as tables of a list; without the line ``several`` it has one, ``[current]``::

    [[current]]
    lines = "all"
    current = 20.0
    field = [0.0, 0.0, 0.5]

Kernels of forces work with numbers and tuples: an array that is made in a loop takes fifty times as long as the
computation with it. ``x`` in a kernel is the displacement of all rows, and ``net.points`` are their reference
positions. ``cells`` are the rows that each cell couples, of type int32, and ``data`` its numbers, of type float64. A
kernel adds to ``f`` and to ``rates``. It must write all of ``blocks`` and ``out``, which contain old values before.
Signatures are in `refweb.kernels`. Compiled kernels do not check indices: Python runs those of your effect on some
cells before a run, and reads their source, and refuses a column that an array does not have.

``net.web.find(self.node)`` finds nodes, and ``net.web.find_lines(self.lines)`` finds lines. For "all", ``net.find``
also finds the nodes that order and subdivision add. `refweb.effects.base.column` makes cells of one row each. A field
reads and checks its value, as ``real(above=0.0, unit="N/m")`` does; the others are in `refweb.tables`.

A force with a potential has ``energy=energy`` and ``Balance("spring_energy")`` instead of a power: that name heads a
column of ``history.csv`` and counts in the total energy. It is observed once it has a
`refweb.results.observables.balances.Booked` that is registered as an observable. Bounds keep explicit steps
stable, not accurate: something stiff may need a smaller ``safety``. ``definite`` asks for a part of the stiffness that
is positive semidefinite, such as none.

The momentum balance integrates the force of an effect along the steps, which only checks that a method applies its
forces. With ``impulse=impulse`` of `Balance`, a kernel of ∫F dt, it also finds impulses that steps miss. Forces that
are ``internal`` do not count.

A load with a factor over time is made by `refweb.effects.outer_load`; what changes natural lengths, by
`refweb.effects.natural_lengths`; rows, mass and columns of numbers of the lines are added by ``extend(net)``, which
returns another net. The docstring of the class is its page in ``refweb help``.

An effect that refweb ships is a line in `refweb.registry.EFFECTS` instead. ``tests/test_contract.py`` holds forces
against energies and stiffness against forces for every effect and asks for numbers of it, ``tests/reference`` for an
``Examples`` section of its docstring.
"""

# This docstring is a page of the site and of `refweb help own-effect`. May change: the prose. Must stay: the first
# sentence, which tests/test_architecture.py compares, and the three code blocks in their order (module, entry point,
# scene), which tests/how_to/test_effect.py and tests/test_plugins.py take from it and run.
