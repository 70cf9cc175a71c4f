"""Equilibria at load steps, each from the one before, by Newton's method, else by other methods.

Where Newton's method fails and all loads are dead, `refweb.statics.interior_point` leads near an equilibrium. If
Newton's method does not converge from there either, a series of softer nets follows for the tension-only law without
rotation. Otherwise Newton's method gets many more iterations. With bars, or with loads that are not dead, only Newton's
method is used.

May change: constants, and which method is tried next: the residual decides what counts as an equilibrium. `FAR` decides
which states are refused that satisfy it but have run away, of form finding, lines that yield and winches: a smaller one
refuses more. Must stay: arguments of `solve`, which `registry.STATICS` names and `dynamics.initial_state`, `studies`
and `rupture` call too; each `Equilibrium` is yielded with its bounds, stability and ``deviations`` set, and before the
next is solved. Tests: ``tests/statics/test_statics.py``.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..system.static_system import at_rest
from .equilibrium import WITH_A_WAY_AROUND, NotFound, add_proofs, add_spent, refuse_half_turns, with_reason
from .newton import Newton

MOST = 400
"""Largest number of factorizations from the last state, where the interior-point method cannot be used."""
SHARING = 60
"""Largest number of factorizations from the last state where elements of a line may share the push of a sphere."""
PATIENCE = 3000
"""Largest number of factorizations of the smooth law after the interior-point method has failed."""
FAR = 1e4
"""Way of a node over the size of the web from which lines of form finding, or that yield, or winches do not hold it."""
SOFTEST = 1e-2
"""Load over EA of the first net in a series of nets of growing stiffness."""


def solve(system, load_steps, progress=None):
    """Equilibria at load steps, one after another, each from the one before.

    Parameters
    ----------
    system : refweb.system.system.System
        With a net whose ``quasi_static`` is True.
    load_steps : sequence of float
        Values of t.
    progress : callable, optional
        Called with a line of text after each iteration.

    Yields
    ------
    refweb.statics.equilibrium.Equilibrium

    Raises
    ------
    SolverError
        If there is no equilibrium, or none is found; the load steps before have been yielded.
    """
    full_system, system = system, at_rest(system)
    newton, push, states, turns = Newton(system, progress, load_steps[0]), None, [], []
    for t in load_steps:
        x, error = _start(system, t, states), None
        solver, shared = newton, bool(states) and states[-1].contact_shares is not None
        newton.start_path()
        try:
            state: Any = None if shared else _equilibrium(newton, t, x, warm=bool(states))
        except NotFound as not_found:
            if not _may_share(system):
                raise with_reason(system, t, not_found) from None
            shared, error = True, not_found
        if shared:
            if push is None:
                from .shared_push import SharedPush

                push = SharedPush(newton, load_steps[0])
            solver, state = push.newton, push.equilibrium(t, x, error)
        _refuse_far(system, t, state)
        turns = refuse_half_turns(system, t, state.x, turns)
        add_proofs(system, state, newton.factor)
        if newton.follows:
            solver.factorize_at(state)
        if not system.convex:
            from .stability import ask

            ask(full_system, solver.system, state, solver.factor if newton.follows else None)
            if state.stability.sign == 1 and system.dead and (system.net.forming & system.net.law_is("convex")).all():
                state.stats["above_lowest"] = 0.0  # a quadratic potential has one minimum
        state.deviations, state.path = solver.deviations(state), solver.path
        state.x = system.taken_on(t, state.x)
        states = [*states[-1:], state]
        yield state


def _refuse_far(system, t, state):
    """Refuse a state that has run away, since forces that do not grow with length balance no load, however far."""
    net = system.net
    wound = len(net.winches) > 0
    if not (wound or net.forming.any() or net.law_is("plastic").any()):
        return
    size = float(np.ptp(net.points, axis=0).max() + net.natural_length.max())
    distance = np.linalg.norm(state.x[: net.nodes], axis=1)
    if distance.max() > FAR * size:
        reason, remedy = "as forces that do not grow with the length of lines cannot carry the loads", "pretension"
        if wound:
            reason, remedy = "as a winch that pays out cannot carry the loads", "tension or limit of [[winch]]"
        elif not net.forming.any():
            reason, remedy = "as lines that yield cannot carry loads above the limit load", "yield_stress or hardening"
        node = distance.argmax()
        raise NotFound(
            f"no equilibrium at load step {t:g}: node {node} goes further than {FAR:g} times the size of the web along "
            f"{'xyz'[np.abs(state.x[node]).argmax()]}, {reason}: lower these, or raise {remedy}",
            state.stats,
        )


def _start(system, t, states):
    """Start of a load step: zero, the last displacement, or an extrapolation where no line pushes."""
    if not states:
        return np.zeros((system.rows, 3))
    if not system.dead or any((state.tension < 0.0).any() for state in states):
        return states[-1].x
    from .predictor import predicted

    return predicted(system, t, states)


def _equilibrium(newton, t, x, warm):
    """Equilibrium from the last state, or by another method."""
    net, spent = newton.system.net, dict(nsteps=0, nfev=0, njev=0, nlu=0)
    path = newton.system.dead and not (net.law_is("bar") | net.forming).any()
    pulling = not net.law_is("pushes").any()
    convex = pulling and not newton.turns
    try:
        limit = WITH_A_WAY_AROUND if path else SHARING if _may_share(newton.system) else MOST
        state = newton.solve(t, x, warm=warm, limit=limit)
    except NotFound as error:
        if not path:
            raise
        add_spent(spent, error.stats)
        try:
            from .interior_point import by_interior_point

            state = by_interior_point(newton, t, x)
        except NotFound as error:
            add_spent(spent, error.stats)
            if convex:
                state = _by_stiffening(newton, t, x, spent)
            else:  # slack lines that push fold up, one after another
                state = _by_patience(newton, t, x)
    if newton.system.dead and not pulling:
        from .lowest import lowest

        state = lowest(newton, state)
    if not (newton.system.convex or newton.follows):
        state.stats["smallest_pivot"] = newton.smallest_pivot(t, state.x, state.stats)
    add_spent(state.stats, spent)
    return state


def _may_share(system):
    """Tell if elements of a line may share the push of a sphere."""
    return system.contact and system.net.subdivide > 1 and any(body.shape.once for body in system.net.bodies)


def _by_stiffening(newton, t, x, spent):
    """Equilibrium from those of softer nets, in which no line snaps taut; slack parts move far under tiny loads."""
    system, load = newton.system, np.abs(newton.system.outer_force(t)).max()
    softer = SOFTEST * newton.axial / load if load > 0.0 else 1.0
    while softer > 1.0:
        numbers = system.net.line_data.copy()
        numbers.ea /= softer
        state = Newton(system.with_line_data(numbers), newton.progress, t).solve(t, x)
        add_spent(spent, state.stats)
        x, softer = state.x, softer / 10.0
    return newton.solve(t, x, warm=True)


def _by_patience(newton, t, x):
    """Equilibrium of the smooth law by many iterations; an error says with which force slack lines push."""
    try:
        return newton.solve(t, x, limit=PATIENCE)
    except NotFound as error:
        net = newton.system.net
        floors = [law.floor(net.line_data[net.law_index == number]).max() for number, law in enumerate(net.laws)]
        text = f'{error}, or law = "tension-only": slack lines push with up to {max(floors):.3g} N'
        raise NotFound(text, error.stats) from None
