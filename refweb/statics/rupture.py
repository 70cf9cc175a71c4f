"""Refusal of equilibria with a broken line, with the load step of the first break.

The state after a break depends on the motion of the web; that is dynamics. Brent's method finds the load step of the
break. It searches equilibria between the last load step without a break and the first with one.

May change: `FINE` and `TRIALS`, which change digits of a message alone, and its words. Must stay: arguments of
`refuse_break`, which `statics.simulation` calls after each load step, and that every break up to that step is refused.
Tests: ``tests/effects/test_rupture.py``.
"""

from __future__ import annotations

from ..errors import SolverError

FINE = 1e-6
"""Error of the load step of a break, over the load step at which it was found."""
TRIALS = 30
"""Largest number of equilibria in the search for a break."""


def shares(system, equilibrium):
    """Shares of the limits of elements, see `BreakLimits.shares`, in a `refweb.statics.equilibrium.Equilibrium`."""
    return system.weakness.shares(system.forces(equilibrium.step, equilibrium.x).per_cell)


def refuse_break(system, solve, equilibrium, before):
    """Refuse an equilibrium in which a line is broken.

    Parameters
    ----------
    system : refweb.system.system.System
        System with a `refweb.effects.base.BreakLimits`.
    solve : callable
        The method of statics, see `refweb.registry.STATICS`.
    equilibrium : refweb.statics.equilibrium.Equilibrium
        The equilibrium.
    before : float
        A load step at which no line breaks, 0 where none is known.

    Raises
    ------
    SolverError
        With the load step and the line of the first break.
    """
    net, due = system.net, [(t, element) for t, element in system.weakness.times if t <= equilibrium.step]
    utilisation = shares(system, equilibrium)
    step, reached = equilibrium.step, equilibrium
    if utilisation.max() >= 1.0:
        step, reached = _first(system, solve, equilibrium, before)
    elif not due:
        return
    element = int(shares(system, reached).argmax())
    if due and due[0][0] <= step:
        step, element = due[0]
        why = "as [rupture] at says"
    else:
        why = _reason(system, reached, element)
    raise SolverError(
        f"line {net.line[element]} would break at load step {step:.6g}, {why}: what comes then depends on the motion; "
        'use kind = "dynamic", or load steps below that'
    )


def _first(system, solve, equilibrium, before):
    """(Load step, equilibrium) of the first break, or those of ``equilibrium`` if none before it is found."""
    known = [equilibrium]

    def over(step):
        known[0] = next(iter(solve(system, [step], None))) if step != equilibrium.step else equilibrium
        return float(shares(system, known[0]).max()) - 1.0

    try:
        if equilibrium.step > before and over(before) < 0.0:
            from scipy.optimize import brentq

            step = brentq(over, before, equilibrium.step, xtol=FINE * abs(equilibrium.step), maxiter=TRIALS)
            return step, known[0]
    except (SolverError, RuntimeError):  # nothing to be found between: what is known is the load step itself
        known[0] = equilibrium
    return known[0].step, known[0]


def _reason(system, equilibrium, element):
    """Words for the limit at which an element breaks in an equilibrium."""
    net, weakness = system.net, system.weakness
    per_cell = system.forces(equilibrium.step, equilibrium.x).per_cell
    by_tension = per_cell.tension[element] / weakness.limits[element]
    if by_tension < weakness.shares(per_cell)[element]:
        return "where its plastic strain reaches that of [rupture] plastic_strain"
    return f"where its stress reaches its strength of {net.strength[element]:.6g} Pa"
