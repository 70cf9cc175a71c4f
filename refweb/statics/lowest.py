"""Check if an equilibrium has the lowest energy; search a lower one where that is not proven.

Let the tension of a law rise with the strain ε and be 0 at ε = 0. Then its energy W(ε) is at least W(max(ε, 0)), which
is convex in the positions. Under dead loads, an equilibrium in which no line pushes minimises that convex potential.
Hence it also minimises the potential of the law: this is proven without computation. Where lines push, Newton's method
is tried from another start: the equilibrium of the same net without smoothing, whose energy is convex. Its line forces
s balance the loads. As in `refweb.statics.duality_bound`, they bound the energy of a state x above the lowest by

    Σ L (W(ε) + |s| (1 + ε_s) − W(ε_s)) − s·d,

a sum of terms that are never negative, with T(ε_s) = |s| and the vector d of a line. Nearly all of this bound is the
energy of the lines that push.

May change: `NOTHING` and `SURE`, and where the second start begins. Must stay: keys ``above_lowest``, ``starts`` and
``unsure`` of ``stats``, which `remarks`, `results.summary_text` and ``run.json`` read; ``above_lowest`` is an upper
bound, or None; `_above`, `_forces` and `_without_smoothing`, which a test calls. Tests:
``tests/statics/test_lowest.py``, which calls private functions too.
"""

from __future__ import annotations

import numpy as np

from ..effects.elasticity import strains
from ..errors import SolverError
from ..net.laws.law import evaluate
from ..net.laws.smooth import Smooth
from .equilibrium import WITH_A_WAY_AROUND, NotFound, add_spent

NOTHING = 1e-9
"""Energy, over that of lines and loads, up to which it counts as zero."""
SURE = 1e-3
"""Bound of the energy above the lowest, over that of lines and loads, from which a finding reports it."""


def lowest(newton, state):
    """The lowest known equilibrium, with ``above_lowest`` [J] and ``starts`` in its stats.

    Parameters
    ----------
    newton : refweb.statics.newton.Newton
        Newton's method of a system under dead loads.
    state : refweb.statics.equilibrium.Equilibrium
        The equilibrium that it has found.

    Returns
    -------
    refweb.statics.equilibrium.Equilibrium
        Its ``above_lowest`` bounds the energy above the lowest: 0 where it is proven to be the lowest, None without a
        bound. Its ``starts`` are the energies [J] of the equilibria from two starts, where a second start was tried.
    """
    system = newton.system
    pushes = bool((state.tension < 0.0).any())
    state.stats["above_lowest"] = None if pushes else 0.0
    if not pushes or not system.net.law_is("cone").all():
        return state
    try:
        plain = _without_smoothing(newton, state)
    except SolverError:
        return state
    add_spent(state.stats, plain.stats)
    forces = _forces(system, plain)
    above, none = _above(system, state, forces), NOTHING * _scale(system, state)
    if above > none:
        try:
            start_state = newton.solve(state.step, plain.x, warm=True)
        except SolverError as error:
            start_state, spent = state, getattr(error, "stats", {})
        else:
            spent = start_state.stats
        starts = [system.energy(state.step, equilibrium_.x) for equilibrium_ in (state, start_state)]
        if starts[1] < starts[0] - none:
            state, above, spent = start_state, _above(system, start_state, forces), state.stats
        add_spent(state.stats, spent)
        state.stats["starts"] = starts
    state.stats |= {"above_lowest": above, "unsure": above > SURE * _scale(system, state)}
    return state


def _without_smoothing(newton, state):
    """The equilibrium of the same net at η = 0, by Newton's method, else by the interior-point method."""
    numbers = newton.system.net.line_data.copy()
    numbers.smoothing[:] = numbers.g0[:] = 0.0
    numbers.r0[:] = np.abs(numbers.slackness)
    plain, t = type(newton)(newton.system.with_line_data(numbers), newton.progress, state.step), state.step
    try:
        return plain.solve(t, state.x, limit=WITH_A_WAY_AROUND)
    except NotFound as error:
        from .interior_point import by_interior_point

        smooth_free = by_interior_point(plain, t, state.x)
        add_spent(smooth_free.stats, error.stats)
        return smooth_free


def _forces(system, plain):
    """Forces of the bars in an equilibrium at η = 0, vectors [N] of shape (bars, 3)."""
    net = system.at(plain.step).net
    strain = strains(net, plain.x).ravel()
    axial, slackness = net.per_bar(net.line_data.ea), net.per_bar(net.slackness)
    line = net.bar_vectors(plain.x)
    length = np.linalg.norm(line, axis=1)
    tension = axial * np.maximum(strain - slackness, 0.0)
    return (tension / np.where(length > 0.0, length, 1.0))[:, None] * line


def _above(system, state, forces):
    """Bound of the energy of a state above the lowest one [J], by forces that balance the loads."""
    net = system.at(state.step).net
    lines = net.line_data
    axial, slackness, smoothing, g0 = map(net.per_bar, (lines.ea, lines.slackness, lines.smoothing, lines.g0))
    size = np.linalg.norm(forces, axis=1)
    g = size / axial + g0  # = (s + √(s² + 4η²))/2 at s = ε − ε0, so that s = g − η²/g
    dual_energy = np.where(size > 0.0, slackness + g - smoothing**2 / np.where(g > 0.0, g, 1.0), 0.0)
    bars = lines[net.per_bar(np.arange(len(lines)))]
    energy, energy_of_forces = (  # without smoothing the law is that of lines that only pull
        evaluate(Smooth.energy_density, strain, bars) for strain in (strains(net, state.x).ravel(), dual_energy)
    )
    along = (forces * net.bar_vectors(state.x)).sum(axis=1)
    above = float((net.bar_lengths * (energy - energy_of_forces + size * (1.0 + dual_energy)) - along).sum())
    return float(max(above, 0.0)) + 2.0 * np.finfo(float).eps * float(np.abs(along).sum())


def _scale(system, state):
    """Energy of the lines and of the loads [J], without signs."""
    return sum(float(np.abs(system.energy_of(f, state.step, state.x)).sum()) for f in system.terms)
