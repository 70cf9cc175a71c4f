"""The system of statics: bodies that wait are fixed, and forces that need velocity are left out.

May change: `NEAR`, private functions, the text of the refusal. Must stay: `at_rest` changes a copy, never the given
system, and returns the system itself where nothing differs. It drops cached properties of `System` by name: a new one
that depends on supports or terms belongs in its list. Must stay as well: `refuse_broken`, which `build` imports;
`waiting`, which `dynamics.simulation`, `statics.body_penetration` and `studies.mode_remarks` import. Tests:
``tests/dynamics/test_starts.py``, ``test_bodies_come_to_rest.py``.
"""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np

from ..errors import InputError

NEAR = 1e-6
"""Distance up to which a body counts as touching a line, over its thickness."""


def at_rest(system):
    """A copy without forces that need velocity, with `waiting` bodies fixed and untouched; or the system itself.

    Bodies that tables move are in their positions by the tables.

    Raises
    ------
    InputError
        For a line that is broken, and a free body that a thread runs over.
    """
    refuse_broken(system.net)
    if any(thread.wraps for thread in system.net.threads):
        from ..effects.around import refuse_free

        refuse_free(system.net)
    free = [body for body in system.net.bodies if not body.prescribed]
    if (system.net.quasi_static or not free) and all(term.timing.at_rest for term in system.terms):
        return system
    absent = waiting(system)
    rows_held = [body.row for body in absent]
    _ = system.library  # both say what factorizes for either
    rest = copy.copy(system)
    for kept in ("pattern", "unsupported_parts", "mass", "links", "carriers"):
        rest.__dict__.pop(kept, None)
    rest.supported = system.supported.copy()
    rest.supported[system.rows - system.net.spins :] = True
    rest.supported[rows_held] = True
    rest.supported[[body.spin for body in free if body.turn is not None and body.row not in rows_held]] = False
    rest.angles, rest.terms = system.turning, []
    without = [row for body in absent for row in (body.row, body.spin, body.turn) if row is not None]
    for term in system.terms:
        if not term.timing.at_rest:
            continue
        felt = ~np.isin(term.cells, without).any(axis=1)
        if felt.all():
            rest.terms.append(term)
        elif felt.any():
            rest.terms.append(replace(term, cells=term.cells[felt], data=term.data[felt]))
    rest.arrange()
    return rest


def waiting(system):
    """Free bodies that take no part in the equilibrium from which dynamics starts, a list.

    Those that move at the start, and those at rest that carry no nodes and touch nothing; in statics none.
    """
    if system.net.quasi_static:
        return []
    free = [body for body in system.net.bodies if not body.prescribed]
    return [b for b in free if any(b.velocity) or any(b.angular_velocity) or not (b.carried or _touches(system, b))]


def _touches(system, body):
    """Tell if a body touches a line in its start position."""
    start = np.zeros((system.rows, 3))
    system.drive(0.0, start)
    for term in system.terms:
        if term.contact.with_lines and term.energy is not None:
            of_it = term.cells[:, term.contact.felt[0]] == body.row
            for step in NEAR * body.thickness * np.vstack([np.eye(3), -np.eye(3)]):
                x = start.copy()
                x[body.row] += step
                if system.energy_of(term, 0.0, x)[of_it].any():
                    return True
    return False


def refuse_broken(net):
    """Refuse a net with broken lines, which statics does not take."""
    if len(net.broken):
        raise InputError(
            f"line {net.line[net.broken[0]]} is broken, and statics takes no broken lines: use [solve] "
            'kind = "dynamic" and start = "web", or leave the line out of the web'
        )
