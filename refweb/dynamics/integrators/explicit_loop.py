"""The compiled loop of explicit dynamics: steps of kicks and drifts, and history rows.

Its parts are beside their equations: `refweb.dynamics.integrators.step` moves rows, ``energy_balance`` sums work,
``extremes`` and ``events`` monitor, and ``step_bound`` finds the critical time step. Kernels that every step and every
row of a plain scene calls count no references to arrays, see `refweb.kernels.kernel`: counting would take a third of
the time of a cable of 100 elements.

May change: `BREATH`. Must stay: the order of calls in `run_steps`, which is the method; the numbers that `advance_rows`
returns (`HELD`, −1, rows), which `CentralDifference.advance` reads; a kernel with ``apart`` is called only where
`features` has its names, else the run ends. Another order of sums changes last bits of results: then a run that goes
on, one with lists of near lines and the undisturbed one must still be equal bit for bit
(``tests/dynamics/integrators/test_nearby.py``). Must stay as well: `begin`, which `central_difference` imports. Tests:
``tests/dynamics/test_dynamics.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ...compiled.rows import record_at
from ...effects.base import BLOCK_OUT, UNKNOWN
from ...effects.sliding_material import BEHIND
from ...kernels import Integers, Matrix, Vector, copy_rows, kernel
from ...net.rotation import add_forces_to_bodies
from ...net.rotation_bounds import fastest_point, hardest_push
from .averages import average
from .ccd import LEAST, REPORT, SHORTER, check_last_drift, collides, reject_drift, reject_step
from .contacts import feel
from .dense_output import look_again, look_at_books, look_behind, look_inside
from .energy_balance import (
    act,
    begin_powers,
    book_energies,
    book_kick,
    book_motion,
    book_potential,
    book_powers,
    change_lines,
    drifts_away,
    note_motion,
    relax,
    set_lines,
    write_length_force,
)
from .events import ended_by, note_events
from .extremes import follow, look_with_places
from .integrator import MAX_STEPS_PER_ROW, SAME
from .momentum_balance import add_half_steps, push_on, set_push
from .neighbour_list import reach_all, show_near, update_neighbours
from .rows import energies_now, write_row
from .step import (
    add_forces,
    change_sliding,
    contact_kick,
    give_impulse,
    give_reaction,
    move,
    move_supports,
    note_state,
    plain_kick,
    set_reaction,
    turn_supports,
    viscous_kick,
)
from .step_bound import EARLY, SPAN, safe_step, step_by_pairs
from .vector_spread import spread_of
from .workspace import Workspace

if TYPE_CHECKING:
    from .extremes import Extremes
    from .monitors import Observed
    from .records import Model, Running, Scheme

HELD = -2
"""Return value of the loop if lines would pass with any step."""
BREATH = 10_000_000
"""Steps times cells after which a compiled loop returns: some tenths of a second."""


@kernel(apart=("stages",))
def inner_stages(
    now: float, h: float, scheme: Scheme, model: Model, running: Running, reaction: Vector, push: Vector, extra: Matrix
) -> bool:
    """All kicks and drifts of a step of higher order but the last drift, with work and the impulses of forces.

    Time advances with the drifts; in the potential of the energy balance it advances with the kicks. A step in which
    lines would pass is not begun; the return value tells.
    """
    if reject_step(now - h, h, model, running):
        return False
    terms, inverse, fixed = model.terms, model.inertia.inverse, model.inertia.fixed
    turns = model.inertia.turns
    x, v, f, first = running.x, running.v, running.f, (terms.of_lines[0], terms.elements, terms.numbers)
    forces, cells, data, outs = terms.forces, terms.cells, terms.data, terms.outs
    drifted = kicked = now - h
    for n in range(scheme.drifts.size - 1):
        kick, drift = scheme.kicks[n] * h, scheme.drifts[n] * h
        drifted, kicked = drifted + drift, kicked + kick
        give_impulse(kick, reaction, running.impulse)
        give_impulse(kick, push, running.ledger.pushed)
        book_kick(kick, model.inertia.driven, v, f, running.work)
        book_potential(1.0, kicked, x, terms, running.work)
        if model.ccd.checks.size:
            collides(now - h, kick, drift, REPORT, model, running)
        move(0.0, kick, drift, inverse.reshape(-1), x.reshape(-1), v.reshape(-1), f.reshape(-1), x, v, turns)
        book_potential(-1.0, kicked, x, terms, running.work)
        add_forces(drifted, x, v, f, outs[0], first, terms.still, forces, cells, data, outs)
        add_forces_to_bodies(x, f, turns)
        set_reaction(fixed, f.reshape(-1), reaction)
        if model.outside.pushing.size:
            set_push(drifted, x, v, model.outside, terms, extra, push)
    book_potential(1.0, now - scheme.kicks[scheme.drifts.size] * h, x, terms, running.work)
    return True


@kernel(leaf=True, forceinline=True)
def begin_forces(t, changing, extra, reaction, push, model, running):
    """Write powers, force of supports and push from outside at the time t that steps begin at."""
    set_reaction(model.inertia.fixed, running.f.reshape(-1), reaction)
    if model.relaxing.terms.size:
        relax(0.0, running.x, model, running.work)
    if model.terms.powers.shape[0] or changing or model.outside.pushing.size:
        begin_more(t, changing, extra, push, model, running)


@kernel(apart=("booked",))
def begin_more(t: float, changing: bool, extra: Matrix, push: Vector, model: Model, running: Running) -> None:
    """Write powers, forces of natural lengths and push from outside."""
    x, v, terms, outside = running.x, running.v, model.terms, model.outside
    if running.clock[0].begun == 0:
        t *= BEHIND if model.lengths.masses.sliding.size else 1.0
        lossy, again = model.implicit_contacts.terms, running.clock[0].nsteps > 0
        begin_powers(t, x, v, extra, terms, lossy, again, running.power)
    if changing:
        write_length_force(t, x, model.lengths, terms.cells[0], terms.data[0], running.length_force[0])
    if outside.pushing.size:
        set_push(t, x, v, outside, terms, extra, push)


@kernel(leaf=True)
def joins_kicks(model, observed, running):
    """Tell if steps are kicks and drifts alone, and nothing follows that reads velocities at the end of each."""
    terms, simple = model.terms, True
    for i in observed.followed:
        simple = simple and observed.plain[i, 0] > 0
    forces = terms.viscous.size + terms.powers.shape[0] + model.outside.pushing.size + model.relaxing.terms.size
    observed_more = observed.sums.shape[0] + observed.windows.slots.size + running.events.size
    return simple and not model.implicit_contacts.terms.size + model.inertia.turns.moment.size + forces + observed_more


@kernel(leaf=True)
def shows_blocks(model, observed, running):
    """Tell if nothing that follows from step to step reads more of the lines than the largest of their blocks.

    Then the largest of all steps so far begins anew: no extreme is below one that follows. The last step of a call
    shows all lines, for history rows and all that is read between calls.
    """
    blocks, more = model.terms.blocks, model.terms.viscous.size + model.terms.powers.shape[0] + observed.each_line
    more += model.implicit_contacts.terms.size + observed.sums.shape[0] + observed.windows.slots.size
    if not blocks.shape[0] or more + running.events.size:
        return False
    highest = record_at(BLOCK_OUT, blocks, blocks.shape[0] - 1, 0)
    highest.tension = highest.strain = -math.inf
    for n in range(blocks.shape[0] - 1):
        record_at(BLOCK_OUT, blocks, n, 0).rest = UNKNOWN
    return True


@kernel(leaf=True, apart=())
def run_steps(
    count: int, h: float, changing: bool, scheme: Scheme, model: Model, observed: Observed, running: Running,
    space: Workspace,
) -> int:  # fmt: skip
    """Take ``count`` steps of size h, fewer where an event ends the run or lines would pass, and return how many."""
    where, known, before, total = space.where, space.known, space.before, space.total
    push, reaction = space.push, space.reaction
    clock, terms, motions, nearby = running.clock[0], model.terms, model.motions, model.nearby
    mass, inverse, fixed, driven = model.inertia.mass, model.inertia.inverse, model.inertia.fixed, model.inertia.driven
    x, v, f, work, impulse, power = running.x, running.v, running.f, running.work, running.impulse, running.power
    viscous, powers, extra, half = terms.viscous, terms.powers, space.extra, space.half
    flat_x, flat_v, flat_f, flat_inverse = x.reshape(-1), v.reshape(-1), f.reshape(-1), inverse.reshape(-1)
    lines, first, numbers = terms.outs[0], terms.of_lines[0], terms.numbers
    near, events, averaged = nearby.terms.size > 0, running.events, observed.windows.slots.size > 0
    pushing, rubbing = model.outside.pushing.size > 0, model.implicit_contacts.terms
    extremes, turns, stages = running.extremes, model.inertia.turns, scheme.drifts.size - 1
    kick, drift, last = scheme.kicks[stages] * h, scheme.drifts[stages] * h, scheme.kicks[stages + 1] * h
    sums, bits = observed.sums, flat_v[: 3 * model.inertia.linear * (near and not stages)].view(np.int64)
    watched, fresh = observed.followed.size + sums.shape[0] > 0, int(clock.nsteps + clock.begun == 0)
    looks, begun, planned = watched and fresh > 0 or (watched or averaged) and stages > 0, clock.begun, clock.planned
    checked, moves = model.ccd.checks.size > 0, driven.size + len(motions.kernels) > 0
    joins, waits = not (changing or near or stages or checked or moves) and joins_kicks(model, observed, running), False
    few = not (changing or stages or checked) and shows_blocks(model, observed, running)
    begin_forces(clock.time + begun * h, changing and begun == 0, extra, reaction, push, model, running)
    for step in range(1, count + 1):
        now = clock.time + (begun + step) * h
        if looks:
            note_state(x, v, f, inverse, space.inside.before)
        if stages and not inner_stages(now, h, scheme, model, running, reaction, push, extra):
            return step - 1
        if checked and reject_drift(now - h, kick, drift, stages, model, running):
            return step - 1
        note_motion(driven, mass, x, v, f, before)
        move(last if waits else 0.0, kick, drift, flat_inverse, flat_x, flat_v, flat_f, x, v, turns)
        if stages:
            book_potential(-1.0, now - last, x, terms, work)
        if moves:
            move_supports(now, h, x, v, f, space.aside, motions.kernels, motions.cells, motions.data, motions.outs)
        change_lines(changing, now, h, model, space.was, running)
        if near:
            update_neighbours(drift, x, v, bits, before, model)
            check_last_drift(now - h, model, running)
        out = terms.blocks if few and not looks and step < count else lines
        first(now, x, v, f, terms.elements, numbers, out)
        for i in terms.still:
            act(i, now, x, v, f, terms)
        if near:
            show_near(nearby, terms)
        add_forces_to_bodies(x, f, turns)
        waits = joins and not looks and step < count
        if rubbing.size:
            contact_kick(begun + step, now, h, x, v, f, inverse, half, extra, running.contacts, running.parts, model)
        elif viscous.size:
            viscous_kick(now, h, x, v, f, inverse, half, extra, terms, turns)
        else:
            plain_kick(waits, last, flat_inverse, flat_v, flat_f, x, v, turns)
        feel(model.contacts, terms)
        if pushing:
            push_on(now, kick, last, x, v, model.outside, terms, extra, push, running.ledger.pushed)
        if powers.shape[0] and not stages:
            book_powers(now, h, x, v, extra, power, work, terms)
        book_motion(kick, last, driven, mass, v, f, before, work)
        give_reaction(kick, last, fixed, flat_f, reaction, impulse)
        if looks:
            look_inside(now, h, step == fresh, stages == 0, space.inside, where, total, model, observed, running)
        ending = begun + step == planned or math.isnan(extremes.looked[0])
        turned = follow(now, ending, x, v, f, out, known, where, observed, extremes)
        if sums.shape[0]:
            turned = look_at_books(now, x, v, total, extremes, ending, model, observed, running) or turned
        if turned or watched and step == fresh:
            plain_kick(not waits, last, flat_inverse, flat_v, flat_f, x, v, turns)
            waits = False
            looks = look_again(now, h, step == fresh, stages > 0, space.inside, total, model, observed, running)
        if averaged:
            average(now, x, v, f, lines, where, stages > 0, observed, running.averages, extremes)
        if events.size and note_events(now, h, x, v, f, lines, events, where, observed, total):
            return step
    return count


@kernel(leaf=True)
def steps_until(end, changing, scheme, model, running):
    """Number of steps that the bound, or the step size, asks for until ``end``, not yet rounded."""
    interval, time = end - running.clock[0].time, running.clock[0].time
    if scheme.step_size > 0.0:
        return interval / scheme.step_size
    v, f, inverse, speed, push = running.v, running.f, model.inertia.inverse, 0.0, 0.0
    for r in range(model.inertia.linear):
        speed = max(speed, v[r, 0] ** 2 + v[r, 1] ** 2 + v[r, 2] ** 2)
        a0, a1, a2 = inverse[r, 0] * f[r, 0], inverse[r, 1] * f[r, 1], inverse[r, 2] * f[r, 2]
        push = max(push, a0 * a0 + a1 * a1 + a2 * a2)
    turns, hardest, spread = model.inertia.turns, math.sqrt(push), 0.0
    if turns.moment.size:
        speed = max(speed, fastest_point(running.x, v, turns) ** 2)
        push = max(push, hardest_push(running.x, f, inverse, turns) ** 2)
    fastest = 2.0 * (math.sqrt(speed) + 0.5 * interval * math.sqrt(push))  # of two rows towards each other
    if model.nearby.at.shape[0]:
        spread = spread_of(v[: model.inertia.linear])
        fastest = min(fastest, spread + interval * math.sqrt(push))
    reach = 2.0 * interval * fastest
    reach_all(reach, running.x, model.nearby, model.terms)
    if not model.nearby.at.shape[0]:
        return interval / (scheme.safety * safe_step(time, end, changing, reach, fastest, running.x, f, model))
    early = EARLY / SPAN * scheme.span
    bound = step_by_pairs(time, end, early, changing, reach, fastest, spread, hardest, model, running)
    return interval / (scheme.safety * bound)


@kernel(leaf=True, apart=())
def plan(end: float, changing: bool, scheme: Scheme, model: Model, running: Running) -> bool:
    """Begin the way to ``end``: note the state there, and plan its steps; whether they are few enough."""
    clock, before, span = running.clock[0], running.before, end - running.clock[0].time
    copy_rows(running.x, before[0])
    copy_rows(running.v, before[1])
    copy_rows(running.f, before[2])
    steps = steps_until(end, changing, scheme, model, running)
    clock.stable = span / steps if steps > 0.0 else span
    if clock.cut > 0.0:
        steps = max(steps, span / clock.cut)
    if steps > MAX_STEPS_PER_ROW:
        clock.step = span / steps
        return False
    clock.planned = max(int(math.ceil(max(steps, scheme.least_steps) * (1.0 - 1e-9))), 1)
    if scheme.finer != 1.0:
        clock.planned = int(math.ceil(scheme.finer * clock.planned))
    return True


@kernel(leaf=True)
def end_of_steps(corners, time, row):
    """The next corner of a table behind a time, not beyond ``row``; either is met within rounding."""
    first, behind = 0, corners.size
    while first < behind:
        middle = (first + behind) // 2
        if corners[middle] > time * (1.0 + SAME):
            behind = middle
        else:
            first = middle + 1
    return corners[first] if first < corners.size and corners[first] < row * (1.0 - SAME) else row


@kernel(leaf=True)
def end_of_span(time, end, span):
    """The end of the next of equal spans to ``end``, none longer than ``span``; ``end`` where that is 0."""
    if not span > 0.0:
        return end
    parts = math.ceil((end - time) / span * (1.0 - 1e-9))
    return time + (end - time) / parts if parts > 1.0 else end


@kernel(apart=())
def advance_rows(
    times: Vector,
    breath: int,
    limit: float,
    scheme: Scheme,
    model: Model,
    observed: Observed,
    running: Running,
    space: Workspace,
    history: Matrix,
) -> int:
    """Advance to each of some times, and write a row of ``history`` there.

    Equal steps lead to each time, or to each corner of a table before it.

    Returns the number of finished rows. It is smaller than requested if a number is not finite, or if the drift is
    above ``limit`` and does not fall; then ``before`` has x, v and f at the last corner or row, of the time ``since``.
    It is −1 if a row takes more than `MAX_STEPS_PER_ROW` steps from there. If an event ends the run, its row is the
    last, with the time of the event. The loop also returns after ``breath`` steps, so that a run can be interrupted;
    the next call continues in that row. Behind the last step of a span it returns as well, before the next is planned,
    so that `refweb.dynamics.integrators.tangent.Steps` sees each step. It returns `HELD` if a step is cut too far, see
    `refweb.dynamics.integrators.ccd`.
    """
    clock, events, lengths, left = running.clock[0], running.events, model.lengths, breath
    total, stopped = space.total, ended_by(events)
    for n in range(times.size):
        if not clock.begun:
            set_lines(clock.time, running.x, model)
        while clock.time < times[n] and not stopped:
            corner, begun = end_of_steps(model.corners, clock.time, times[n]), clock.begun
            end = end_of_span(clock.time, corner, scheme.span)
            changing = lengths.corners.size > 2 and lengths.corners[0] < end and lengths.corners[-3] > clock.time
            if not begun:
                clock.since = clock.time
                if not plan(end, changing, scheme, model, running):
                    return -1
            clock.step = total[-1] = (end - clock.time) / clock.planned
            halved = 0.25 * clock.step**2 if model.outside.damped.size else 0.0
            if halved > 0.0 and not begun:
                add_half_steps(-halved, model.outside, model.inertia.inverse, running.f, running.ledger.pushed)
            count = min(clock.planned - begun, max(left, 1))
            taken = run_steps(count, clock.step, changing, scheme, model, observed, running, space) if count else 0
            stopped, left = ended_by(events), left - taken
            clock.nsteps += taken
            clock.begun = begun + taken
            if clock.rejected:
                clock.rejected, clock.cut = 0, SHORTER * clock.step
                if clock.cut < LEAST * clock.stable:
                    return HELD
            elif not stopped and (clock.begun < clock.planned or left <= 0 and end < corner):
                return n
            else:
                clock.cut = 0.0
            clock.time = end if clock.begun == clock.planned else clock.time + clock.begun * clock.step
            clock.begun = 0
            if halved > 0.0:
                add_half_steps(halved, model.outside, model.inertia.inverse, running.f, running.ledger.pushed)
            if (model.inertia.driven.size or lengths.growth >= 0) and turn_supports(clock.time, model, running):
                look_behind(model, observed, running, space)
            if lengths.masses.sliding.size and change_sliding(clock.time, model, running):
                look_behind(model, observed, running, space)
            if clock.time == corner < times[n]:  # what is stored at a corner may be gone again at the row
                largest = energies_now(model, running, total)[1]
                if not math.isfinite(largest):
                    break
                clock.largest = max(clock.largest, largest)
        energy, stored = write_row(history[n], model, observed, running, total, space.where, space.momenta)
        if drifts_away(clock, energy, stored, total[-2], limit):
            return n
        if stopped:
            return n + 1
    return times.size


@kernel(apart=())
def begin(
    x: Matrix,
    v: Matrix,
    f: Matrix,
    where: Integers,
    model: Model,
    observed: Observed,
    extremes: Extremes,
    work: Vector,
    total: Vector,
) -> None:
    """Write forces, values of probes with their places, and energies at t = 0."""
    terms = model.terms
    set_lines(0.0, x, model)
    for i in range(len(terms.forces)):
        terms.forces[i](0.0, x, v, f, terms.cells[i], terms.data[i], terms.outs[i])
    add_forces_to_bodies(x, f, model.inertia.turns)
    feel(model.contacts, terms)
    look_with_places(0.0, x, v, f, terms.outs[0], where, observed, extremes.values, extremes.places)
    book_energies(
        0.0, x, v, model.inertia.mass, model.inertia.turns, terms.cells, terms.data, terms.energies,
        terms.stored, work, terms.working, total,
    )  # fmt: skip
