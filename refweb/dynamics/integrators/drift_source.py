"""Source of an energy drift: the cell whose change of energy differs most from the work of its forces.

A kick, a drift and a kick change the kinetic energy by ½ (f₀ + f₁)·Δx of all forces at both ends of the drift, up to a
part that two successive steps cancel. Therefore the drift of a cell in a step is ΔE + ½ (f₀ + f₁)·Δx with its forces f
= −∂E/∂x. A cell that gains energy by the work of others has no drift. If no cell has a part in a drift, its source is a
corner of a table, a rotation of a body or a force that depends on velocity.

`central_difference`, `step_observer` and `simpson_balance` call it, for the text of an error. May change: all of it but
the names `described_source` and `suspects`; no result depends on it. Tests: ``tests/results/test_results.py``,
``tests/dynamics/test_dynamics.py``.
"""

from __future__ import annotations

import numpy as np

SHARE = 1e-3
"""Part of a drift over which an energy is differentiated, with an error of its square."""
MOST = 3e7
"""Largest number of cells times steps that are evaluated: the last steps of a row."""
PART = 0.1
"""Part of the mean drift of the steps below which a cell is not the source."""


def described_source(system, places, drift):
    """Name of the source of a drift, as text.

    Parameters
    ----------
    system : refweb.system.system.System
        The system.
    places : list of (float, ndarray of shape (rows, 3))
        Time [s] and displacement [m] at the ends of steps in turn, the last at the end of the drift.
    drift : float
        Drift from t = 0 to the last time [J].
    """
    (term, cell), largest, since = _source_of(system, places)
    others = _further_sources(system, places)
    if others and largest < PART * abs(drift) * (1.0 - since / places[-1][0]):
        return f"energy came in with {' or '.join(others)}"
    return f"energy came in with {term.name} at {_name_of(system, term, cell)}"


def _further_sources(system, places):
    """Sources beside cells, as a list: corners of tables on the way, bodies that turned, forces by velocity."""
    (begin, before), (end, after) = places[0], places[-1]
    corners = [
        f"a corner of the table of {term.name}"
        for term in system.terms
        if any(begin <= t <= end for t in term.timing.times)
    ]
    turned = [
        f'the rotation of body "{body.name}"'
        for body in system.net.bodies
        if body.turn is not None and not np.array_equal(before[[body.spin, body.turn]], after[[body.spin, body.turn]])
    ]
    damped = [term.name for term in system.terms if term.velocity.damping is not None]
    return list(dict.fromkeys([*corners, *turned, *damped]))


def _source_of(system, places):
    """(Term, number of its cell) with the largest drift, this drift [J], and the time of the first step [s]."""
    terms = [f for f in system.terms if f.energy is not None and f.balance.column != "work"]
    cells = sum(len(term.cells) for term in terms)
    steps = list(zip(places, places[1:], strict=False))[-max(int(MOST / max(cells, 1)), 1) :]
    largest, source = -1.0, (system.terms[0], 0)
    for term in terms:
        left = np.zeros(len(term.cells))
        for (t0, x0), (t1, x1) in steps:
            path = SHARE * (x1 - x0)
            left += system.energy_of(term, t1, x1) - system.energy_of(term, t0, x0)
            for t, x in ((t0, x0), (t1, x1)):
                rise = system.energy_of(term, t, x + path) - system.energy_of(term, t, x - path)
                left -= 0.25 / SHARE * rise
        if len(left) and np.abs(left).max() > largest:
            cell = int(np.abs(left).argmax())
            largest, source = abs(left[cell]), (term, cell)
    return source, largest, steps[0][0][0] if steps else places[-1][0]


def suspects(system):
    """Further cause of a drift: effects of users, whose energy or power no test of refweb holds against forces."""
    names, kinds = {}, {}
    for effect, parts in system.acting:
        if type(getattr(effect, "effect", effect)).__module__.startswith("refweb."):
            continue
        for part in parts:
            energy, balance = getattr(part, "energy", None), getattr(part, "balance", None)
            for kind, value in (("energy", energy), ("power", getattr(balance, "power", None))):
                if value is not None:
                    names[f'"{part.name}"'] = kinds[kind] = None
    if not names:
        return ""
    plural = "s" * (len(names) > 1)
    return f", or see if the {' and the '.join(kinds)} of effect{plural} {', '.join(names)} is that of its force"


def _name_of(system, term, cell):
    """Name of the item that a cell of a term belongs to."""
    if term.contact.pairs:
        return " and ".join(f'body "{body.name}"' for body in term.contact.pairs[cell])
    if term.over_lines or term.elements.numbers is not None:
        lines = system.net.line[np.atleast_1d(cell if term.over_lines else term.elements.numbers[cell])].tolist()
        return f"line {lines[0]}" if len(lines) == 1 else f"lines {lines[0]} and {lines[1]}"
    if term.cells.shape[1] > 1:
        return f"line {system.net.line[np.isin(system.net.cells, term.cells[cell]).sum(axis=1).argmax()]}"
    return system.row_name(term.cells[cell, 0])
