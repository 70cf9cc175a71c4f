"""The pieces of an explicit step: kick and drift, forces, and the last kick where forces depend on velocity.

May change: `ROUNDS`, `SWEEPS` and limits of iterations, which trade cost for the error of the kick. Must stay: kernels
are called by `explicit_loop` and `dense_output` with these arguments; names in ``apart`` are keys of `features`; fields
of `Model` and `Running` stand in `records`. Another order of sums changes last bits of results.
`dynamics.responses.between` repeats `interpolate_kicks`. Must stay as well: all names that `explicit_loop` and
`dense_output` import. Tests: ``tests/dynamics/test_dynamics.py``, ``tests/effects/test_contact_losses.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ...effects.contact_solver import commit, forget, gauss_seidel, warm_start
from ...effects.natural_lengths import set_growth
from ...effects.sliding_material import BEHIND, impulse
from ...kernels import (
    ContactTable,
    Cube,
    ForceTable,
    IndexTable,
    Matrix,
    MatrixTable,
    PartTable,
    copy_rows,
    kernel,
    sum_of,
)
from ...net.rotation import RigidRotations, add_forces_to_bodies, advance_rotation, note_turns, update_attached_nodes
from .ccd import largest_of
from .contacts import feel
from .energy_balance import act, kinetic_of
from .implicit_contacts import detect_all

if TYPE_CHECKING:
    from .records import ForceTerms, Model, Running

ROUNDS = 100
"""Largest number of rounds in which velocities at the end of a step are found."""
SWEEPS = 8
"""Largest number of sweeps over contacts in a step, which goes on where that before it came to. Where slip is resolved,
the eighth changes velocities by 1e-10 of the fastest, and by 1e-6 in a first step."""
STALLED, STILL = 0.5, 0.95
"""Change of a sweep, over that of the sweep before, at which sweeps end; the same after `SWEEPS` rounds if other
forces, which are iterated as well, converge slowly. The friction forces of a line that sticks at several points are not
unique, and hundreds of sweeps do not determine them: two successive sweeps differ by a few hundredths. The remaining
changes only move the creep below the slip velocity, and the energy balance closes without further sweeps."""
SETTLED = 1e-12
"""Change of velocities, over the fastest and over what other forces give, at which sweeps over contacts end."""


@kernel(leaf=True, forceinline=True)
def kick_and_drift(kick, drift, inverse, x, v, f):
    """v ← v + kick f/m, x ← x + drift v, and no force, for all components in a row."""
    for q in range(x.size):
        speed = v[q] + kick * inverse[q] * f[q]
        v[q] = speed
        x[q] += drift * speed
        f[q] = 0.0


@kernel(leaf=True, forceinline=True)
def join_kicks(before, kick, drift, inverse, x, v, f):
    """Make the last kick of a step, and then what `kick_and_drift` does, with one look at each component.

    To go on with the forces of a few blocks of lines, while their nodes are in the nearest cache, takes longer: 1.1
    times among 3120 lines, and 1.3 times among 79 600.
    """
    for q in range(x.size):
        speed = v[q] + before * inverse[q] * f[q]
        speed = speed + kick * inverse[q] * f[q]
        v[q] = speed
        x[q] += drift * speed
        f[q] = 0.0


@kernel(leaf=True, forceinline=True)
def move(before, kick, drift, inverse, flat_x, flat_v, flat_f, x, v, turns):
    """Kick and drift as `kick_and_drift` does, where bodies may turn, or `join_kicks` with a kick ``before``."""
    if before > 0.0:
        join_kicks(before, kick, drift, inverse, flat_x, flat_v, flat_f)
        return
    if turns.moment.size:
        note_turns(x, turns)
    kick_and_drift(kick, drift, inverse, flat_x, flat_v, flat_f)
    if turns.moment.size:
        advance_rotation(drift, v, x, turns)


@kernel(leaf=True, forceinline=True)
def last_kick(kick, inverse, v, f):
    """v ← v + kick f/m, for all components in a row."""
    for q in range(v.size):
        v[q] += kick * inverse[q] * f[q]


@kernel(leaf=True, forceinline=True)
def plain_kick(waits, kick, inverse, flat_v, flat_f, x, v, turns):
    """Kick as `last_kick` does, where bodies may carry nodes, unless it ``waits`` for the next step."""
    if not waits:
        last_kick(kick, inverse, flat_v, flat_f)
        update_attached_nodes(x, v, turns)


@kernel(forceinline=True)
def add_forces(t, x, v, f, lines, first, still, forces, cells, data, outs):
    """Add the force of the lines, and of all terms that follow from displacement and time, to f."""
    first[0](t, x, v, f, first[1], first[2], lines)
    for i in still:
        forces[i](t, x, v, f, cells[i], data[i], outs[i])


@kernel(leaf=True, forceinline=True)
def set_reaction(fixed, f, reaction):
    """Write the force of the supports on the net, which takes that on them away, to ``reaction``; f in a row.

    Most supports hold all components of a row, which follow each other.
    """
    r0 = r1 = r2 = 0.0
    n = 0
    while n < fixed.size:
        q = np.uint64(fixed[n])
        axis = q % np.uint64(3)
        if axis == 0 and n + 2 < fixed.size and fixed[n + 2] == fixed[n] + 2:
            r0, r1, r2 = r0 - f[q], r1 - f[q + np.uint64(1)], r2 - f[q + np.uint64(2)]
            n += 3
        else:
            r0 -= f[q] if axis == 0 else 0.0
            r1 -= f[q] if axis == 1 else 0.0
            r2 -= f[q] if axis == 2 else 0.0
            n += 1
    reaction[0], reaction[1], reaction[2] = r0, r1, r2


@kernel(leaf=True, forceinline=True)
def give_impulse(time, reaction, impulse):
    """Add the impulse of a force over a time."""
    for k in range(3):
        impulse[k] += time * reaction[k]


@kernel(leaf=True, forceinline=True)
def give_reaction(before, behind, fixed, f, reaction, impulse):
    """Add the impulse of the supports in two kicks, a time ahead of a drift and one behind it; f in a row."""
    give_impulse(before, reaction, impulse)
    set_reaction(fixed, f, reaction)
    give_impulse(behind, reaction, impulse)


@kernel(leaf=True, apart=("viscous",))
def viscous_kick(
    t: float,
    h: float,
    x: Matrix,
    v: Matrix,
    f: Matrix,
    inverse: Matrix,
    half: Matrix,
    extra: Matrix,
    terms: ForceTerms,
    turns: RigidRotations,
) -> None:
    """v ← v(half) + ½h (f + f_v(v))/m, iterated for v, and add f_v to f.

    Forces that depend on velocity see that at the end of the step; the kick, thereby implicit, stays adjoint to the
    first one, and the method of order 2. The iteration contracts with ½ h C/m, and ends at rounding; what `ROUNDS`
    leave shows in the energy book.
    """
    copy_rows(v, half)
    flat_half, flat_extra, flat_inverse = half.reshape(-1), extra.reshape(-1), inverse.reshape(-1)
    flat_v, flat_f = v.reshape(-1), f.reshape(-1)
    share, before_that = 1.0, math.inf
    for _ in range(ROUNDS):
        extra[:] = 0.0
        update_attached_nodes(x, v, turns)
        for i in terms.viscous:
            act(i, t, x, v, extra, terms)
        add_forces_to_bodies(x, extra, turns)
        change = fastest = 0.0
        for q in range(flat_v.size):
            speed = flat_half[q] + 0.5 * h * flat_inverse[q] * (flat_f[q] + flat_extra[q])
            fastest = max(fastest, abs(speed))
            if flat_inverse[q] > 0.0:  # nodes that bodies carry go with these, and would never come to rest
                change = max(change, abs(speed - flat_v[q]))
                flat_v[q] = speed if share == 1.0 else flat_v[q] + share * (speed - flat_v[q])
        if not change > 1e-14 * fastest:
            break
        if change > 0.75 * before_that and share > 0.02:  # damping that has grown since the last bound
            share *= 0.5
        before_that = change
    for q in range(flat_v.size):
        flat_f[q] += flat_extra[q]
    update_attached_nodes(x, v, turns)


@kernel(apart=("rubbing",))
def contact_kick(
    number: int,
    t: float,
    h: float,
    x: Matrix,
    v: Matrix,
    f: Matrix,
    inverse: Matrix,
    half: Matrix,
    extra: Matrix,
    space: ContactTable,
    parts_space: PartTable,
    model: Model,
) -> None:
    """Kick as `viscous_kick` does, with losses of contact that are solved for: they need no bound.

    Other forces that depend on velocity are iterated with them. The step is that of a ``number`` of its row, of which
    the first begins without a memory of another. The power of each loss is written; ``space`` and ``parts_space`` hold
    the contacts.
    """
    terms, implicit, turns = model.terms, model.implicit_contacts, model.inertia.turns
    forces, cells, data, outs, viscous = terms.forces, terms.cells, terms.data, terms.outs, terms.viscous
    ends = np.zeros(implicit.terms.size, dtype=np.int64)
    contacts, parts = detect_all(h, x, v, inverse, model, space, parts_space, ends)
    count, begin = ends[-1], 0
    flat_half, flat_extra, flat_inverse = half.reshape(-1), extra.reshape(-1), inverse.reshape(-1)
    flat_v, flat_f = v.reshape(-1), f.reshape(-1)
    fastest = 0.0
    if count or viscous.size:
        fastest = largest_of(0.0, flat_v, flat_f, flat_inverse, 1.0)
        fastest = max(fastest, largest_of(h, flat_v, flat_f, flat_inverse, 0.0))
    if viscous.size:
        copy_rows(v, half)
        extra[:] = 0.0
    for m in range(ends.size):
        if number == 1:
            forget(implicit.memories[m])
        warm_start(number, implicit.memories[m], f, contacts, parts, begin, ends[m])
        begin = ends[m]
    change, stalled, patience = math.inf, STALLED, 1 if number > 1 else SWEEPS
    if viscous.size:
        stalled, patience = STILL, SWEEPS
    for n in range(ROUNDS if viscous.size else SWEEPS if count else 0):
        before = change
        if viscous.size:
            for q in range(flat_f.size):
                flat_f[q] -= flat_extra[q]
            extra[:] = 0.0
            update_attached_nodes(x, v, turns)
            for i in viscous:
                forces[i](t, x, v, extra, cells[i], data[i], outs[i])
            add_forces_to_bodies(x, extra, turns)
            for q in range(flat_f.size):
                flat_f[q] += flat_extra[q]
        change = gauss_seidel(h, n, f, inverse, contacts, parts, count, implicit.laws)
        if viscous.size:
            for q in range(flat_v.size):
                if flat_inverse[q] > 0.0:
                    speed = flat_half[q] + 0.5 * h * flat_inverse[q] * flat_f[q]
                    change, flat_v[q] = max(change, abs(speed - flat_v[q])), speed
        if not change > SETTLED * fastest or (n >= patience and change > stalled * before):
            break
    if viscous.size:
        copy_rows(half, v)
    last_kick(0.5 * h, flat_inverse, flat_v, flat_f)
    update_attached_nodes(x, v, turns)
    begin = 0
    for m in range(implicit.terms.size):
        commit(number, implicit.memories[m], v, contacts, parts, begin, ends[m], outs[implicit.terms[m]])
        begin = ends[m]


@kernel(apart=("driven",))
def move_supports(
    t: float,
    h: float,
    x: Matrix,
    v: Matrix,
    f: Matrix,
    aside: Matrix,
    kernels: ForceTable,
    cells: IndexTable,
    data: MatrixTable,
    outs: MatrixTable,
) -> None:
    """Write prescribed positions at the end of a step, and velocities in it: at its end they may jump."""
    for i in range(len(kernels)):
        kernels[i](t, x, v, f, cells[i], data[i], outs[i])
        kernels[i](t - 0.5 * h, aside, v, f, cells[i], data[i], outs[i])


@kernel()
def renew_forces(t, model, running):
    """Write the forces of all terms at time t, and what bodies feel."""
    terms = model.terms
    running.f[:] = 0.0
    for i in range(len(terms.forces)):
        act(i, t, running.x, running.v, running.f, terms)
    add_forces_to_bodies(running.x, running.f, model.inertia.turns)
    feel(model.contacts, terms)


@kernel(apart=("sliding",))
def change_sliding(t: float, model: Model, running: Running) -> bool:
    """Give nodes the impulses of material whose sliding changes at a corner; whether any does.

    The gain of kinetic energy is work of the reel, and the impulse on what is free is one from outside.
    """
    terms, turns, mass, inverse = model.terms, model.inertia.turns, model.inertia.mass, model.inertia.inverse
    x, v, push = running.x, running.v, np.zeros(running.x.shape)
    for i in model.lengths.masses.sliding:
        impulse(t, x, v, push, terms.cells[i], terms.data[i], terms.outs[i])
    if not push.any():
        return False
    add_forces_to_bodies(x, push, turns)
    before = kinetic_of(x, v, mass, turns)
    for r in range(x.shape[0]):
        for k in range(3):
            if r < model.inertia.linear and inverse[r, k] > 0.0:
                running.ledger.pushed[k] += push[r, k]
            v[r, k] += inverse[r, k] * push[r, k]
    update_attached_nodes(x, v, turns)
    running.work[running.work.size - 1] += kinetic_of(x, v, mass, turns) - before
    renew_forces(BEHIND * t, model, running)
    return True


@kernel(apart=("driven",))
def turn_supports(t: float, model: Model, running: Running) -> bool:
    """Write prescribed velocities behind a corner at time t, and forces that follow from velocity; whether any jumps.

    The gain of kinetic energy of the supports is work of their motion; history rows show the state after the corner.
    """
    driven, mass, terms, motions = model.inertia.driven, model.inertia.mass, model.terms, model.motions
    x, v, f = running.x, running.v, running.f
    was, turned = np.empty((driven.size, 3)), False
    for d in range(driven.size):
        for k in range(3):
            was[d, k] = v[driven[d], k]
    for i in range(len(motions.kernels)):
        motions.kernels[i](t, x, v, f, motions.cells[i], motions.data[i], motions.outs[i])
    for d in range(driven.size):
        for k in range(3):
            now = v[driven[d], k]
            running.work[running.work.size - 1] += 0.5 * mass[driven[d]] * (now + was[d, k]) * (now - was[d, k])
            turned = turned or now != was[d, k]
    if model.lengths.growth >= 0:
        set_growth(t, model.lengths, terms.data[0])
        turned = True
    update_attached_nodes(x, v, model.inertia.turns)
    if turned and terms.viscous.size + model.implicit_contacts.terms.size:
        renew_forces(t, model, running)
        for i in model.implicit_contacts.terms:
            running.power[i] = sum_of(terms.outs[i][:, 0])
        for n in range(terms.powers.shape[0] if model.lengths.growth >= 0 else 0):
            running.power[terms.powers[n, 0]] = sum_of(terms.outs[terms.powers[n, 0]][:, terms.powers[n, 1]])
    return turned


@kernel(leaf=True, apart=("looks",))
def note_state(x: Matrix, v: Matrix, f: Matrix, inverse: Matrix, old: Cube) -> None:
    """Write position, velocity and acceleration, of which a long step begins."""
    for r in range(x.shape[0]):
        for k in range(3):
            old[0, r, k], old[1, r, k], old[2, r, k] = x[r, k], v[r, k], inverse[r, k] * f[r, k]


@kernel(forceinline=True)
def interpolate(s, h, old, x, v, inverse, f, state, speed):
    """Write position and velocity at the share s of a step from ``old`` (position, velocity, acceleration).

    They lie on the polynomial of degree 5 through these at either end.
    """
    r = 1.0 - s
    weight, more = s**3 * (10.0 - 15.0 * s + 6.0 * s * s), 30.0 * s * s * r * r
    b0, b1 = s * r**3 * (1.0 + 3.0 * s), -(s**3) * r * (4.0 - 3.0 * s)
    c0, c1 = 0.5 * s * s * r**3, 0.5 * s**3 * r * r
    db0, db1 = r * r * (1.0 - 3.0 * s) * (1.0 + 5.0 * s), -s * s * (2.0 - 3.0 * s) * (6.0 - 5.0 * s)
    dc0, dc1 = 0.5 * s * r * r * (2.0 - 5.0 * s), 0.5 * s * s * r * (3.0 - 5.0 * s)
    for q in range(x.shape[0]):
        for k in range(3):
            far, v0, v1 = x[q, k] - old[0, q, k], h * old[1, q, k], h * v[q, k]
            a0, a1 = h * h * old[2, q, k], h * h * inverse[q, k] * f[q, k]
            state[q, k] = old[0, q, k] + weight * far + b0 * v0 + b1 * v1 + c0 * a0 + c1 * a1
            speed[q, k] = (more * far + db0 * v0 + db1 * v1 + dc0 * a0 + dc1 * a1) / h


@kernel(forceinline=True)
def interpolate_kicks(s, h, old, x, v, inverse, f, state, speed):
    """Interpolate a kick, a drift and a kick, see `interpolate`.

    Velocities at its ends are no rates of positions there, but of order 2 off. So positions lie on the cubic through
    those at either end with the accelerations there, and velocities on that through velocities and accelerations.
    """
    r = 1.0 - s
    bend0, bend1 = h * h * s * r * (1.0 + r) / 6.0, h * h * s * r * (1.0 + s) / 6.0
    weight, rate0, rate1 = s * s * (3.0 - 2.0 * s), h * s * r * r, -h * s * s * r
    for q in range(x.shape[0]):
        for k in range(3):
            a0, a1 = old[2, q, k], inverse[q, k] * f[q, k]
            state[q, k] = old[0, q, k] + s * (x[q, k] - old[0, q, k]) - bend0 * a0 - bend1 * a1
            speed[q, k] = old[1, q, k] + weight * (v[q, k] - old[1, q, k]) + rate0 * a0 + rate1 * a1
