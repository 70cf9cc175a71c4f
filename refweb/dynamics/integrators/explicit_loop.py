"""The compiled loop of explicit dynamics: kicks and drifts, peaks, history rows."""

from __future__ import annotations

import math

import numpy as np

from ...kernels import kernel
from ...net.net import LENGTH
from ...results.probes import PLACE
from .energy_book import CLOSING, book_energies
from .events import crosses, ended_by
from .extremes import quadratic_peak
from .integrator import MAX_STEPS_PER_ROW
from .step_bound import step_bound

BREATH = 10_000_000
"""Steps times cells after which a compiled loop returns, some tenths of a second."""
LOOKS = 4
"""Number of parts of a step of higher order at whose ends peaks are looked for."""


@kernel()
def set_lengths(t, lengths, reeled, reeled_lines, line_drives, line_cells, line_data, lines):
    """Give the elements ``reeled`` their natural lengths at time t; ``lengths`` are those that the drives multiply."""
    reeled_lines[:, LENGTH] = lengths
    for i in range(len(line_drives)):
        line_drives[i](t, reeled_lines, line_cells[i], line_data[i])
    for c in range(reeled.size):
        lines[reeled[c], LENGTH] = reeled_lines[c, LENGTH]


@kernel()
def interpolate(s, h, old, x, v, inverse, f, here, speed):
    """Write position and velocity at the share s of a step from ``old`` (position, velocity, acceleration)."""
    r = 1.0 - s
    way, more = s**3 * (10.0 - 15.0 * s + 6.0 * s * s), 30.0 * s * s * r * r
    b0, b1 = s * r**3 * (1.0 + 3.0 * s), -(s**3) * r * (4.0 - 3.0 * s)
    c0, c1 = 0.5 * s * s * r**3, 0.5 * s**3 * r * r
    db0, db1 = r * r * (1.0 - 3.0 * s) * (1.0 + 5.0 * s), -s * s * (2.0 - 3.0 * s) * (6.0 - 5.0 * s)
    dc0, dc1 = 0.5 * s * r * r * (2.0 - 5.0 * s), 0.5 * s * s * r * (3.0 - 5.0 * s)
    for q in range(x.shape[0]):
        for k in range(3):
            far, v0, v1 = x[q, k] - old[0, q, k], h * old[1, q, k], h * v[q, k]
            a0, a1 = h * h * old[2, q, k], h * h * inverse[q, k] * f[q, k]
            here[q, k] = old[0, q, k] + way * far + b0 * v0 + b1 * v1 + c0 * a0 + c1 * a1
            speed[q, k] = (more * far + db0 * v0 + db1 * v1 + dc0 * a0 + dc1 * a1) / h


@kernel()
def advance(
    count, first_step, power, pull,
    h, t, kicks, drifts, x, v, f, mass, inverse, held, driven, working, powers, still, viscous,
    kernels, cells, data, outs, drives, drive_cells, drive_data, drive_outs, lengths, reeled, reeled_lines,
    line_drives, line_cells, line_data, reeled_cells, by_length,
    probes, probe_rows, probe_data, signs, followed, extremes, book, impulse,
    energies, energy_outs, watch, total, events,
):  # fmt: skip
    """``count`` steps of size h, behind the first ``first_step`` of a row from time t.

    It writes x, v, f, peaks, the book of work and the supports' impulse. ``power`` and ``pull``, the power of each
    family and ∂E/∂L of each length that changes, pass from one part of a row to the next.

    A step is a kick, a drift and a kick of h times ``kicks`` and ``drifts``; more of them are a method of higher order,
    for forces that follow from displacement alone. Such steps are long: between their ends peaks, if any are followed,
    are looked for on the polynomial of degree 5 through position, velocity and acceleration, and between what is seen
    there on parabolas.

    Forces that depend on velocity see that at the end of the step, which the second kick, thereby implicit, is iterated
    for: kick and kick stay adjoint to each other, and the method of order 2. The iteration contracts with ½ h C/m, and
    ends at rounding; friction that has grown may take more than 30 rounds, and what 100 leave shows in the energy book.

    Returns the steps taken: fewer than asked for where an event ends the run.
    """
    peaks, times, places = extremes.values, extremes.times, extremes.places
    flat_x, flat_v, flat_f, flat_inverse = x.reshape(-1), v.reshape(-1), f.reshape(-1), inverse.reshape(-1)
    rows, where = x.shape[0], np.zeros(2, dtype=np.int64)
    first, first_cells, first_data, lines = kernels[0], cells[0], data[0], outs[0]
    before, reaction, motion = np.empty((driven.size, 7)), np.zeros(3), len(kernels)
    half, was = np.empty((rows if viscous.size else 0, 3)), np.empty(lengths.size)
    more = drifts.size - 1
    looks = LOOKS if more and followed.size + watch.shape[0] else 0
    old, inner = np.empty((3, rows if looks else 0, 3)), np.empty((3, rows if looks else 0, 3))
    inner_lines = np.empty_like(lines) if looks else lines
    kick, drift, last_kick = kicks[more] * h, drifts[more] * h, kicks[more + 1] * h
    unused = np.zeros((rows if powers.shape[0] or viscous.size else 0, 3))
    flat_half, flat_unused = half.reshape(-1), unused.reshape(-1)
    for n in range(powers.shape[0] if first_step == 0 else 0):
        i, column = powers[n, 0], powers[n, 1]
        kernels[i](t, x, v, unused, cells[i], data[i], outs[i])
        power[i] = outs[i][:, column].sum()
    if lengths.size and first_step == 0:
        by_length[0](t, x, reeled_cells, reeled_lines, pull[0])
    for s in range(held.size):
        reaction[held[s] % 3] -= f[held[s] // 3, held[s] % 3]
    for step in range(1, count + 1):
        now = t + (first_step + step) * h
        if looks:
            old[0], old[1], old[2] = x, v, inverse * f
        for n in range(more):
            for k in range(3):
                impulse[k] += kicks[n] * h * reaction[k]
                reaction[k] = 0.0
            for q in range(3 * rows):
                speed = flat_v[q] + kicks[n] * h * flat_inverse[q] * flat_f[q]
                flat_v[q] = speed
                flat_x[q] += drifts[n] * h * speed
                flat_f[q] = 0.0
            first(now, x, v, f, first_cells, first_data, lines)
            for i in still:
                kernels[i](now, x, v, f, cells[i], data[i], outs[i])
            for s in range(held.size):
                reaction[held[s] % 3] -= f[held[s] // 3, held[s] % 3]
        for d in range(driven.size):
            r = driven[d]
            before[d, 6] = 0.5 * mass[r] * (v[r, 0] ** 2 + v[r, 1] ** 2 + v[r, 2] ** 2)
            for k in range(3):
                before[d, k], before[d, 3 + k] = x[r, k], f[r, k]
        for q in range(3 * rows):
            speed = flat_v[q] + kick * flat_inverse[q] * flat_f[q]
            flat_v[q] = speed
            flat_x[q] += drift * speed
            flat_f[q] = 0.0
        for i in range(len(drives)):
            drives[i](now, x, v, f, drive_cells[i], drive_data[i], drive_outs[i])
        if lengths.size:
            was[:] = reeled_lines[:, LENGTH]
            set_lengths(now, lengths, reeled, reeled_lines, line_drives, line_cells, line_data, first_data)
            by_length[0](now, x, reeled_cells, reeled_lines, pull[1])
            for c in range(lengths.size):
                book[motion] += 0.5 * (pull[0, c] + pull[1, c]) * (reeled_lines[c, LENGTH] - was[c])
            pull[0] = pull[1]
        first(now, x, v, f, first_cells, first_data, lines)
        for i in still:
            kernels[i](now, x, v, f, cells[i], data[i], outs[i])
        if viscous.size:
            half[:] = v
            share, before_that = 1.0, math.inf
            for _ in range(100):
                unused[:] = 0.0
                for i in viscous:
                    kernels[i](now, x, v, unused, cells[i], data[i], outs[i])
                change = fastest = 0.0
                for q in range(3 * rows):
                    speed = flat_half[q] + 0.5 * h * flat_inverse[q] * (flat_f[q] + flat_unused[q])
                    change, fastest = max(change, abs(speed - flat_v[q])), max(fastest, abs(speed))
                    flat_v[q] = speed if share == 1.0 else flat_v[q] + share * (speed - flat_v[q])
                if not change > 1e-14 * fastest:
                    break
                if change > 0.75 * before_that and share > 0.02:  # friction that has grown since the last bound
                    share *= 0.5
                before_that = change
            for q in range(3 * rows):
                flat_f[q] += flat_unused[q]
        else:
            for q in range(3 * rows):
                flat_v[q] += last_kick * flat_inverse[q] * flat_f[q]
        for n in range(powers.shape[0]):
            i, column = powers[n, 0], powers[n, 1]
            if powers[n, 2] == 0:  # the power at the full step: the forces above see the velocity at its middle
                kernels[i](now, x, v, unused, cells[i], data[i], outs[i])
            gained = outs[i][:, column].sum()
            book[i] += 0.5 * h * (power[i] + gained)
            power[i] = gained
        for d in range(driven.size):
            r = driven[d]
            book[motion] += 0.5 * mass[r] * (v[r, 0] ** 2 + v[r, 1] ** 2 + v[r, 2] ** 2) - before[d, 6]
            for k in range(3):
                book[motion] -= 0.5 * (before[d, 3 + k] + f[r, k]) * (x[r, k] - before[d, k])
        for k in range(3):
            impulse[k] += kick * reaction[k]
            reaction[k] = 0.0
        for s in range(held.size):
            reaction[held[s] % 3] -= f[held[s] // 3, held[s] % 3]
        for k in range(3):
            impulse[k] += last_kick * reaction[k]
        for n in range(1, looks):
            here = now - h + h * n / looks
            interpolate(n / looks, h, old, x, v, inverse, f, inner[0], inner[1])
            inner[2] = 0.0
            first(here, inner[0], inner[1], inner[2], first_cells, first_data, inner_lines)
            for i in still:
                kernels[i](here, inner[0], inner[1], inner[2], cells[i], data[i], outs[i])
            for i in followed:
                value = probes[i](
                    here, inner[0], inner[1], inner[2], inner_lines, probe_rows[i], probe_data[i], where
                )  # fmt: skip
                if signs[i] * value > signs[i] * peaks[i]:
                    where[1] = PLACE
                    probes[i](here, inner[0], inner[1], inner[2], inner_lines, probe_rows[i], probe_data[i], where)
                    peaks[i], times[i], places[i], where[1] = value, here, where[0], 0
                quadratic_peak(extremes, i, here, value, signs[i])
            if watch.shape[0]:
                book_energies(
                    here, inner[0], inner[1], mass, cells, data, energies, energy_outs, book, working, total
                )  # fmt: skip
                for j in range(watch.shape[0]):
                    value, i = np.dot(watch[j], total), len(probes) + j
                    if signs[i] * value > signs[i] * peaks[i]:
                        peaks[i], times[i] = value, here
                    quadratic_peak(extremes, i, here, value, signs[i])
        for i in followed:
            value = probes[i](now, x, v, f, lines, probe_rows[i], probe_data[i], where)
            if signs[i] * value > signs[i] * peaks[i]:
                where[1] = PLACE
                probes[i](now, x, v, f, lines, probe_rows[i], probe_data[i], where)
                peaks[i], times[i], places[i], where[1] = value, now, where[0], 0
            if more:
                quadratic_peak(extremes, i, now, value, signs[i])
        if watch.shape[0]:
            book_energies(now, x, v, mass, cells, data, energies, energy_outs, book, working, total)
            for j in range(watch.shape[0]):
                value, i = np.dot(watch[j], total), len(probes) + j
                if signs[i] * value > signs[i] * peaks[i]:
                    peaks[i], times[i] = value, now
                if more:
                    quadratic_peak(extremes, i, now, value, signs[i])
        ended = False
        for e in range(events.shape[0]):
            event = events[e]
            if event.time == math.inf:
                i = event.slot
                if i < len(probes):
                    value = probes[i](now, x, v, f, lines, probe_rows[i], probe_data[i], where)
                else:
                    value = np.dot(watch[i - len(probes)], total)
                if crosses(event, value):
                    event.time, event.width = now, h
                    ended = ended or event.stop > 0
        if ended:
            return step
    return count


@kernel()
def rows_ahead(
    ends, breath, part, power, pull, safety, least, step_size, finer, limit, kicks, drifts,
    state, x, v, f, back, linear, mass, inverse, free, held, driven, working, powers, still, viscous,
    kernels, cells, data, outs, energies, energy_outs, bounds, dampings, drives,
    drive_cells, drive_data, drive_outs, lengths, reeled, reeled_lines, line_drives, line_cells, line_data,
    reeled_cells, by_length, corners, probes, probe_rows, probe_data, signs, followed, extremes, book, impulse,
    watch, events, history,
):  # fmt: skip
    """Advance to each time of ``ends`` and write a row of ``history`` there.

    ``state`` is (time, steps, step size, energy at the start, largest energy, worst drift, drift at the last row over
    the largest energy). Returns the rows that are done: fewer than asked for where a number is not finite, or the drift
    is above ``limit`` and does not fall (`CLOSING`); then ``back`` holds x, v and f at the row before; −1 where a row
    takes more than `MAX_STEPS_PER_ROW` steps. A row takes ``least`` steps at least, so that a smaller ``safety`` makes
    them shorter there as well where rows are. Where an event ends the run, that row is the last, and its time that of
    the event. After ``breath`` steps it returns as well, so that an interruption is felt; ``part`` then holds the steps
    taken of a row and the steps of it, and is (0, ...) between rows.

    ``corners`` are the times at which a factor of natural lengths has a corner, increasing, then ∞ for the end of a row
    if there are such factors, then −∞ for its start. The step of a row is safe at all of them: in between a length is a
    product of positive linear functions of time, and stiffness, which goes with its inverse, is largest at an end.
    """
    where, rates = np.zeros(2, dtype=np.int64), np.empty(x.shape[0])
    total, stopped, left = np.zeros(len(energies) + 3), events.shape[0] > 0 and ended_by(events), breath
    for n in range(ends.size):
        interval, begun = ends[n] - state[0], part[0]
        if lengths.size and not begun:
            set_lengths(state[0], lengths, reeled, reeled_lines, line_drives, line_cells, line_data, data[0])
        changing = corners.size > 2 and corners[0] < ends[n] and corners[-3] > state[0]
        if interval > 0.0 and not begun:
            back[0], back[1], back[2] = x, v, f
            speed = push = 0.0
            for r in range(linear):
                speed = max(speed, v[r, 0] ** 2 + v[r, 1] ** 2 + v[r, 2] ** 2)
                a0, a1, a2 = inverse[r, 0] * f[r, 0], inverse[r, 1] * f[r, 1], inverse[r, 2] * f[r, 2]
                push = max(push, a0 * a0 + a1 * a1 + a2 * a2)
            if step_size > 0.0:
                steps = interval / step_size
            else:
                fastest = 2.0 * (math.sqrt(speed) + 0.5 * interval * math.sqrt(push))  # of two rows towards each other
                reach = 2.0 * interval * fastest
                limit_now = math.inf
                for corner in corners:
                    if changing and (state[0] < corner < ends[n] or corner == math.inf) or corner == -math.inf:
                        if changing:
                            now = min(max(corner, state[0]), ends[n])
                            set_lengths(
                                now, lengths, reeled, reeled_lines, line_drives, line_cells, line_data, data[0]
                            )  # fmt: skip
                        bound = step_bound(
                            reach, fastest, x, mass, free, rates, bounds, viscous, dampings, cells, data
                        )  # fmt: skip
                        limit_now = min(limit_now, bound)
                steps = interval / (safety * limit_now)
            if steps > MAX_STEPS_PER_ROW:
                state[2] = interval / steps
                return -1
            count = max(int(math.ceil(max(steps, least) * (1.0 - 1e-9))), 1)
            if finer > 1.0:
                count = int(math.ceil(finer * count))
            part[1] = count
        if interval > 0.0:
            h = total[-1] = interval / part[1]
            acting = lengths if changing else lengths[:0]
            count = min(part[1] - begun, max(left, 1))
            taken = advance(
                count, begun, power, pull, h, state[0], kicks, drifts, x, v, f, mass, inverse, held, driven, working,
                powers, still, viscous, kernels, cells, data, outs, drives, drive_cells, drive_data, drive_outs, acting,
                reeled, reeled_lines, line_drives, line_cells, line_data, reeled_cells, by_length,
                probes, probe_rows, probe_data, signs, followed, extremes, book, impulse,
                energies, energy_outs, watch, total, events,
            )  # fmt: skip
            stopped = events.shape[0] > 0 and ended_by(events)
            state[1], state[2], left = state[1] + taken, h, left - taken
            part[0] = begun + taken
            if part[0] < part[1] and not stopped:
                return n
            state[0] = state[0] + part[0] * h if part[0] < part[1] else ends[n]
            part[0] = 0
        row, at = history[n], 1
        row[0] = state[0]
        for i in range(len(probes)):
            row[at] = probes[i](state[0], x, v, f, outs[0], probe_rows[i], probe_data[i], where)
            at += 1
        book_energies(state[0], x, v, mass, cells, data, energies, energy_outs, book, working, total)
        total[-1] = state[2]
        stored = np.abs(total[:-2]).sum()
        energy = total[:-2].sum()
        for i in range(working.size):
            if working[i] > 0:
                stored -= abs(total[i])
                energy -= total[i]
        row[at : at + total.size] = total
        at += total.size
        for k in range(3):
            row[at + k], row[at + 3 + k] = 0.0, impulse[k]
            for r in range(linear):
                if inverse[r, k] > 0.0:
                    row[at + k] += mass[r] * v[r, k]
        state[4] = max(state[4], stored)
        drift = abs(energy - total[total.size - 2] - state[3])
        state[5] = max(state[5], drift)
        if not math.isfinite(drift):
            return n
        if state[4] > 0.0:
            share, before = drift / state[4], state[6]
            state[6] = share
            if share > limit and share > CLOSING * before:
                return n
        if stopped:
            return n + 1
    return ends.size
