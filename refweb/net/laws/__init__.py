"""Tension laws of lines: stress, tangent and energy over strain; they know nothing of nets.

How to write a law
------------------
A law is a class of small kernels: tension, its slope and its integral over the strain of a line, and what else
`refweb.net.laws.law.TensionLaw` lists. It may stand in a package of yours, a script or a notebook cell. A whole file,
``my_webs/limited.py``::

    '''Lines whose tension tends to a limit, as that of a line that slips through a brake does.'''

    import math

    from refweb.kernels import kernel
    from refweb.net.laws.law import TensionLaw
    from refweb.tables import Table, real, table


    @table
    class Limited(TensionLaw, Table):
        '''σ = E ε/√(1 + (ε/a)²) of a taut line, which tends to E a, and 0 of a slack one.

        Parameters
        ----------
        limit_strain : float
            a [1], > 0.
        '''

        name = "limited"
        convex = True
        limit_strain: float = real(above=0, unit="1")

        @kernel()
        def stress(strain, line):
            if strain <= 0.0:
                return 0.0
            share = strain / line.limit_strain
            return line.ea * strain / math.sqrt(1.0 + share * share)

        @kernel()
        def tangent(strain, line):
            if strain < 0.0:
                return 0.0
            share = strain / line.limit_strain
            return line.ea * (1.0 + share * share) ** -1.5

        @kernel()
        def curvature(strain, line):
            if strain < 0.0:
                return 0.0
            share = strain / line.limit_strain
            return -3.0 * line.ea * share / line.limit_strain * (1.0 + share * share) ** -2.5

        @kernel()
        def energy_density(strain, line):
            if strain <= 0.0:
                return 0.0
            share = strain / line.limit_strain
            return line.ea * strain * strain / (1.0 + math.sqrt(1.0 + share * share))

An entry point makes it known to scenes, messages, help and all methods; in ``pyproject.toml`` of your package::

    [project.entry-points."refweb.laws"]
    limited = "my_webs.limited:Limited"

In a script or a notebook ``refweb.register("law", "limited", Limited)`` does the same. The fields of the class are
numbers that a scene gives as ``parameters``, and groups may have others::

    [cable]
    law = "limited"
    modulus = 7e7
    area = 1e-4
    density = 200.0
    parameters = { limit_strain = 0.01 }

``line`` has the numbers of a line by name: ``line.ea``, its modulus times its area, the fields of the class, and
``line.slackness``, the strain up to which it is slack, 0 unless ``numbers`` of the class gives another. Kernels return
tensions [N], in proportion to ``line.ea``: a line that breaks has 0 there. Two rules keep explicit steps stable and
proofs right: tension does not fall where strain rises, and its slope is at most ``line.ea``, so that ``modulus`` is the
steepest slope. At a kink the tangent is that of the taut side. Formulas that subtract nearly equal numbers lose digits:
nets often have strains of 1e-9.

Where a scene is built, laws of other packages are compared with themselves at strains from 1e-5 to 0.5: energy must
be the integral of stress, and tangent its slope, to a part in a thousand. A tangent above ``line.ea`` is refused, and
stress that falls where ``convex`` says that it rises. A law may end at a strain: beyond it, it returns nan.

``convex = True`` says that tension is 0 up to a strain ≥ 0 and rises from there on. Errors of statics are then proven,
with the strain at a tension that ``strain_of`` finds by bisection, or by a formula where the class has one. A law of
lines that push says ``pushes = True``, and one of bars, which never go slack, ``bar = True`` as well. Damping pushes no
line with more than ``above_floor``; its tangent is exact where there is a ``curvature``.

A law that refweb ships is a line in `refweb.registry.LAWS` instead, and may have keys of its own in ``[cable]``.
"""

# This docstring is a page of the site and of `refweb help own-law`. May change: the prose. Must stay: the first
# sentence, which tests/test_architecture.py compares, and the code blocks in their order, which
# tests/how_to/test_law.py runs.
