"""Looks of the compiled loop that no plain step has: at the motion between steps, and at the book of energies.

The motion in a step of higher order is the polynomial of degree 5 through position, velocity and acceleration at its
ends. Of a kick, a drift and a kick the state before is that of the step taken back, which costs an evaluation of
forces: nothing is kept for it in all the steps that have no peak.

May change: `SAME_PEAK` and `BEHIND`, which decide how often is looked, and how a state within is found, of the order of
the method. Must stay: `LOOKS` equals `averages.PARTS`; a look inside of a step overwrites natural lengths and what
terms show, so that it ends with `show_again`: without it bits of the run change. Must follow: names in ``apart`` are
those of `features`; `explicit_loop` calls the kernels, `workspace` has `Inside`. Must stay as well: `look_again`,
`look_at_books`, `look_behind` and `look_inside`, which `explicit_loop` imports. Tests:
``tests/dynamics/test_peaks.py``, ``test_averages.py``.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numba import types

from ...kernels import (
    MATRIX,
    Arrays,
    Cube,
    Integers,
    Matrix,
    MatrixTable,
    Record,
    Vector,
    among,
    copy_rows,
    inner,
    kernel,
)
from ...net.rotation import add_forces_to_bodies, advance_rotation, note_turns, turns_within
from .averages import PARTS, look_for_means
from .contacts import feel
from .energy_balance import book_energies, own_energy, set_lines
from .extremes import (
    EDGE,
    Extremes,
    begin_anew,
    correct_within,
    correction,
    inspect,
    look_at,
    look_at_sums,
    time_of_top,
    update_extreme,
)
from .neighbour_list import show_near
from .step import interpolate, interpolate_kicks, note_state

if TYPE_CHECKING:
    from .monitors import Observed
    from .records import Model, Running
    from .workspace import Workspace

FourfoldArray = Annotated[np.ndarray, types.Array(types.float64, 4, "C")]
LOOKS = PARTS
"""Number of parts of a step of higher order at whose ends peaks are looked for."""
SAME_PEAK = 1e-3
"""Share of a step within which peaks of two observables are looked at at once."""
BEHIND = 0.51
"""Share of a step by which its motion is taken to go on before its start, where a peak about that is looked for."""


class Inside(Record):
    """Space to look at the inside of a step with.

    Attributes
    ----------
    before, state : ndarray, shape (3, rows, 3)
        Position, velocity and acceleration at its start; position, velocity and force at a place within.
    ends : ndarray, shape (3, 3, rows, 3)
        Position, velocity and force at the ends of the last steps.
    lines : ndarray, shape (cells, columns)
        Output of the terms over lines there.
    alone : refweb.dynamics.integrators.extremes.Extremes
        Those of the run, with looks of their own.
    where : ndarray of int, shape (2,)
        Space for the place of a value.
    total : ndarray, shape (terms + 3,)
        Space for energies.
    losses : table
        Space for what terms show whose kicks are solved for.
    """

    before: Cube
    state: Cube
    ends: FourfoldArray
    lines: Matrix
    alone: Extremes
    where: Integers
    total: Vector
    losses: MatrixTable

    @classmethod
    def of(cls, rows, lines, extremes, sums, losses):
        """Space for a number of rows, what lines show, the extremes of a run, a number of energies, and ``losses``."""
        space = np.empty((5, 3, rows, 3))
        alone = replace(extremes, recent=np.empty_like(extremes.recent), looked=np.empty_like(extremes.looked))
        more = np.zeros(2, dtype=np.int64), np.empty(sums), Arrays(MATRIX, losses)
        return cls(space[0], space[1], space[2:], np.empty_like(lines), alone, *more)


@kernel(apart=("books",))
def look_at_books(
    t: float,
    x: Matrix,
    v: Matrix,
    total: Vector,
    extremes: Extremes,
    ending: bool,
    model: Model,
    observed: Observed,
    running: Running,
) -> bool:
    """Look for extremes of energies at the end of a step."""
    terms = model.terms
    book_energies(
        t, x, v, model.inertia.mass, model.inertia.turns, terms.cells, terms.data, terms.energies,
        terms.stored, running.work, terms.working, total,
    )  # fmt: skip
    return look_at_sums(t, total, observed, extremes, ending)


@kernel(apart=("books",))
def book_within(
    t: float, now: float, x: Matrix, v: Matrix, smooth: bool, total: Vector, model: Model, running: Running
) -> None:
    """Write energies at a state ahead of the last one.

    Work there is that until ``now`` less what they still gain, where the motion is ``smooth``; else it stays: in a
    kick, a drift and a kick, energies between have an error of their own where something touches.
    """
    terms, mass, turns, last = model.terms, model.inertia.mass, model.inertia.turns, 0.0
    cells, data = terms.cells, terms.data
    energies, stored, working = terms.energies, terms.stored, terms.working
    if smooth and terms.powers.shape[0]:
        book_energies(
            now, running.x, running.v, mass, turns, cells, data, energies, stored, running.work, working, total
        )  # fmt: skip
        last = own_energy(total, working)
    book_energies(t, x, v, mass, turns, cells, data, energies, stored, running.work, working, total)
    if smooth and terms.powers.shape[0]:
        total[-2] -= last - own_energy(total, working)


@kernel(apart=("looks",))
def forces_at(t: float, x: Matrix, v: Matrix, f: Matrix, lines: Matrix, model: Model) -> None:
    """Write all forces at a state and a time to f, and what lines show; natural lengths become those of that time."""
    terms, motions = model.terms, model.motions
    forces, cells, data, outs = terms.forces, terms.cells, terms.data, terms.outs
    for i in range(len(motions.kernels)):
        motions.kernels[i](t, x, v, f, motions.cells[i], motions.data[i], motions.outs[i])
    set_lines(t, x, model)
    f[:] = 0.0
    forces[0](t, x, v, f, cells[0], data[0], lines)
    for some in (terms.still, terms.viscous):
        for i in some:
            forces[i](t, x, v, f, cells[i], data[i], lines if among(terms.beside, i) else outs[i])
    for i in model.implicit_contacts.terms:
        forces[i](t, x, v, f, cells[i], data[i], outs[i])
    add_forces_to_bodies(x, f, model.inertia.turns)
    if model.nearby.terms.size:
        show_near(model.nearby, terms)
    feel(model.contacts, terms)


@kernel(apart=("watched", "kicks"))
def step_back(t: float, h: float, end: Cube, start: Cube, lines: Matrix, model: Model) -> None:
    """Take a kick, a drift and a kick of size h back, from a state ``end`` to that at time t.

    Forces that follow from velocity see that of the middle of the step.
    """
    inverse = model.inertia.inverse
    for r in range(inverse.shape[0]):
        for k in range(3):
            start[1, r, k] = end[1, r, k] - 0.5 * h * inverse[r, k] * end[2, r, k]
            start[0, r, k] = end[0, r, k] - h * start[1, r, k]
    if model.inertia.turns.moment.size:
        note_turns(end[0], model.inertia.turns)
        advance_rotation(-h, start[1], start[0], model.inertia.turns)
    forces_at(t, start[0], start[1], start[2], lines, model)
    for r in range(inverse.shape[0]):
        for k in range(3):
            start[1, r, k] -= 0.5 * h * inverse[r, k] * start[2, r, k]


@kernel(apart=("looks",))
def state_within(
    t: float, now: float, h: float, x: Matrix, v: Matrix, f: Matrix, smooth: bool, inside: Inside, model: Model
) -> None:
    """Write the state at a time in a step of size h that ends ``now`` at x, v, f, and what lines show.

    The step is of a higher order, and its motion ``smooth``, or a kick, a drift and a kick.
    """
    state, inverse, share = inside.state, model.inertia.inverse, 1.0 - (now - t) / h
    if smooth:
        interpolate(share, h, inside.before, x, v, inverse, f, state[0], state[1])
    else:
        interpolate_kicks(share, h, inside.before, x, v, inverse, f, state[0], state[1])
    if model.inertia.turns.moment.size:
        turns_within(share, h, inside.before, x, v, model.inertia.turns, state[0], state[1])
    forces_at(t, state[0], state[1], state[2], inside.lines, model)


@kernel(apart=("looks", "rubbing"))
def exchange_losses(keeps: bool, inside: Inside, model: Model) -> None:
    """Keep what terms show whose kicks are solved for, which forces at other states write over, or show it again."""
    for m in range(model.implicit_contacts.terms.size):
        values = model.terms.outs[model.implicit_contacts.terms[m]]
        if inside.losses[m].shape[0] != values.shape[0]:  # pairs that are listed are as many as they happen to be
            inside.losses[m] = np.empty(values.shape)
        kept = inside.losses[m]
        for c in range(values.shape[0]):
            for k in range(values.shape[1]):
                if keeps:
                    kept[c, k] = values[c, k]
                else:
                    values[c, k] = kept[c, k]


@kernel(apart=("looks",))
def show_again(now: float, inside: Inside, model: Model, observed: Observed, running: Running) -> None:
    """Write natural lengths, and what terms show that probes read, of the end of a step over that of its inside.

    Losses that kicks are solved for are those of the step, see `exchange_losses`.
    """
    terms = model.terms
    set_lines(now, running.x, model)
    for i in observed.terms:
        if not among(model.implicit_contacts.terms, i):
            terms.forces[i](
                now, running.x, running.v, inside.state[2], terms.cells[i], terms.data[i], terms.outs[i]
            )  # fmt: skip
    if model.implicit_contacts.terms.size:
        exchange_losses(False, inside, model)
    if model.nearby.terms.size:
        show_near(model.nearby, terms)
    feel(model.contacts, terms)


@kernel(apart=("watched",))
def take_peak(
    t: float,
    now: float,
    smooth: bool,
    inside: Inside,
    total: Vector,
    extremes: Extremes,
    model: Model,
    observed: Observed,
    running: Running,
) -> None:
    """Take over what exceeds its extreme at a state between the last three looks, which ``inside`` holds."""
    (x, v, f), lines, where = (inside.state[0], inside.state[1], inside.state[2]), inside.lines, inside.where
    signs = observed.signs
    for i in observed.followed:
        value = look_at(i, t, x, v, f, lines, observed, where)
        if signs[i] * value > signs[i] * extremes.values[i]:
            update_extreme(i, value, t, x, v, f, lines, observed, where, extremes)
            extremes.corrections[i] = correction(extremes, i, signs[i], t, value, smooth)
    if observed.sums.shape[0]:
        first, energies = len(observed.probes), inside.total  # events are to see that of the step
        for i in range(total.size):
            energies[i] = total[i]
        book_within(t, now, x, v, smooth, energies, model, running)
        for i in range(first, signs.size):
            value = inner(observed.sums[i - first], energies)
            if signs[i] * value > signs[i] * extremes.values[i]:
                extremes.values[i], extremes.times[i] = value, t
                extremes.corrections[i] = correction(extremes, i, signs[i], t, value, smooth)


@kernel(apart=("watched",))
def look_at_tops(
    now: float,
    h: float,
    smooth: bool,
    inside: Inside,
    total: Vector,
    extremes: Extremes,
    model: Model,
    observed: Observed,
    running: Running,
) -> None:
    """Look where parabolas turn back, in a step that ends ``now`` and is looked at inside, or a little before."""
    last = -math.inf
    for i in range(observed.signs.size):
        t = time_of_top(extremes, i, observed.signs[i])
        if abs(t - last) > SAME_PEAK * h:  # never of not a number
            state_within(t, now, h, running.x, running.v, running.f, smooth, inside, model)
            take_peak(t, now, True, inside, total, extremes, model, observed, running)
            last = t


@kernel(apart=("watched", "kicks"))
def refine_extremes(inside: Inside, total: Vector, model: Model, observed: Observed, running: Running) -> None:
    """Look where parabolas turn back, in the last two steps."""
    extremes, last = running.extremes, -math.inf
    if model.implicit_contacts.terms.size:
        exchange_losses(True, inside, model)
    before, at, now = extremes.looked[0], extremes.looked[1], extremes.looked[2]
    inverse, ends = model.inertia.inverse, inside.ends
    for i in range(observed.signs.size):
        t = time_of_top(extremes, i, observed.signs[i])
        if abs(t - last) > SAME_PEAK * (now - at):
            if last == -math.inf:
                copy_rows(running.x, ends[0, 0])
                copy_rows(running.v, ends[0, 1])
                copy_rows(running.f, ends[0, 2])
                step_back(at, now - at, ends[0], ends[1], inside.lines, model)
            n, begin, end = 0, at, now
            if at - t > BEHIND * (now - at):
                n, begin, end = 1, before, at
                step_back(before, at - before, ends[1], ends[2], inside.lines, model)
            note_state(ends[n + 1, 0], ends[n + 1, 1], ends[n + 1, 2], inverse, inside.before)
            state_within(t, end, end - begin, ends[n, 0], ends[n, 1], ends[n, 2], False, inside, model)
            take_peak(t, now, False, inside, total, extremes, model, observed, running)
            last = t
    if last > -math.inf:
        show_again(now, inside, model, observed, running)


@kernel(apart=("looks",))
def look_inside(
    now: float,
    h: float,
    fresh: bool,
    alone: bool,
    inside: Inside,
    where: Integers,
    total: Vector,
    model: Model,
    observed: Observed,
    running: Running,
) -> None:
    """Look for extremes at `LOOKS` places of a step that ends ``now``, but its end.

    Of a ``fresh`` step it looks at an `EDGE` from its start as well, and from its end where the step is looked at
    ``alone``: where no other is, its inside is no look ahead of the next one.
    """
    known_extremes, x, v = running.extremes, inside.state[0], inside.state[1]
    extremes = inside.alone if alone else known_extremes
    if model.implicit_contacts.terms.size:
        exchange_losses(True, inside, model)
    if alone:
        copy_rows(known_extremes.recent, extremes.recent)
        for k in range(3):
            extremes.looked[k] = known_extremes.looked[k]
    for n in range(0 if fresh else 1, LOOKS + 1 if alone else LOOKS):
        t = now - h + h * (EDGE if n == 0 else n / LOOKS if n < LOOKS else 1.0 - EDGE)
        state_within(t, now, h, running.x, running.v, running.f, not alone, inside, model)
        turned = inspect(t, x, v, inside.state[2], inside.lines, where, observed, extremes, fresh)
        if n > 0 and not alone and observed.windows.slots.size:
            look_for_means(n, t, x, v, inside.state[2], inside.lines, where, observed, running.averages)
        if observed.sums.shape[0]:
            book_within(t, now, x, v, not alone, total, model, running)
            turned = look_at_sums(t, total, observed, extremes, fresh) or turned
        if turned:
            look_at_tops(now, h, not alone, inside, total, extremes, model, observed, running)
    show_again(now, inside, model, observed, running)


@kernel(apart=("jumping",))
def look_behind(model: Model, observed: Observed, running: Running, workspace: Workspace) -> None:
    """Look for extremes behind a corner of motion or of a reel, where velocities have jumped."""
    now, lines, where, total = running.clock[0].time, model.terms.outs[0], workspace.where, workspace.total
    x, v, f, extremes = running.x, running.v, running.f, running.extremes
    begin_anew(extremes)
    if observed.followed.size + observed.windows.slots.size:
        inspect(now, x, v, f, lines, where, observed, extremes, False)
    if observed.windows.slots.size:
        look_for_means(0, now, x, v, f, lines, where, observed, running.averages)
    if observed.sums.shape[0]:
        look_at_books(now, x, v, total, extremes, False, model, observed, running)
    begin_anew(extremes)


@kernel(apart=("watched",))
def look_again(
    now: float,
    h: float,
    fresh: bool,
    smooth: bool,
    inside: Inside,
    total: Vector,
    model: Model,
    observed: Observed,
    running: Running,
) -> bool:
    """Look for extremes where values turn back near the end of a step; whether steps that follow are looked at inside.

    Extremes inside of a ``fresh`` step of order 2 become corrections.
    """
    if smooth:
        look_at_tops(now, h, True, inside, total, running.extremes, model, observed, running)
        show_again(now, inside, model, observed, running)
    elif fresh:
        correct_within(running.extremes, observed.signs)
    else:
        refine_extremes(inside, total, model, observed, running)
    return smooth
