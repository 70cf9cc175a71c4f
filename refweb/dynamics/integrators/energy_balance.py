"""Energy balance: work must equal the change of energy, or the run is refused.

It is independent of the method: at every history row ``|ΔE − work|`` is compared with the largest energy of the run.

May change: `CLOSING` and words of messages. Must stay: ``total`` is (energy of each term, kinetic energy, work, step
size) and ``work`` ends with that of motion: `rows`, `simpson_balance` and `History` count on both. With `DRIFT` changes
its value in words in ``validation/how_it_works.py``, which ``tests/test_readme.py`` compares. Kernels are called by
`explicit_loop`, `step`, `dense_output`, `rows` and `simpson_balance`, which follow their arguments; another order of
sums changes last bits of work. Must stay as well: all names that `explicit_loop`, `simpson_balance` and other files
import. Tests: ``tests/dynamics/test_impact.py``, ``tests/dynamics/test_corners.py``, ``tests/effects/test_axles.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ...compiled.rows import record_at
from ...effects.base import LAST_STRAIN, POWER, SNAPPED, STRAIN
from ...effects.line_kernels import LINE, line_at
from ...effects.mass_flow import exchange_by_slips, exchange_masses, set_masses_by_slips
from ...effects.natural_lengths import NaturalLengths, set_growth, set_lengths_by_blocks
from ...errors import EnergyDriftError
from ...kernels import (
    ENERGY,
    EnergyTable,
    IndexTable,
    Indices,
    Integers,
    Matrix,
    MatrixTable,
    Vector,
    VectorTable,
    among,
    kernel,
    sum_of,
)
from ...net.rotation import RigidRotations, more_kinetic

if TYPE_CHECKING:
    from .records import ForceTerms, Model, Running

DRIFT = 1e-2
"""Largest energy drift of a run whose result is returned, over the largest energy of the whole run."""
CLOSING = 0.9
"""Factor by which a relative drift above `DRIFT` must fall from row to row, or the run ends. It may be above at first:
if a load rises from zero on a web at rest, the first rows compare the errors of a few steps with nearly zero energy.
"""


def least_energy(system, turns):
    """Least energy with which a drift is compared [J]: what a few roundings change, over `DRIFT`.

    A web at rest whose lines have exactly their natural length has only energies by rounding. Where supports or natural
    lengths move, the forces of such strains do work on the way, which counts as one of the length of each line. Nodes
    that turn with a body, and its centre beside an axle, have displacements with the rounding of their arms. The work
    of outer forces on them has that rounding too: of a pendulum near its equilibrium it is all that changes.
    """
    lines, rounding = system.net.line_data, 8.0 * np.finfo(float).eps
    strains = float(0.5 * (lines.ea * lines.natural_length).sum() * rounding ** (1 if system.works else 2))
    return (strains + rounding * _work_of_arms(system, turns)) / DRIFT


def _work_of_arms(system, turns):
    """Largest sum of outer forces on rows that bodies carry, each times its arm [J], at any corner of their tables."""
    rows, arms = turns.carried[:, 0], np.linalg.norm(turns.arms, axis=1)
    if not rows.size:
        return 0.0
    times = {0.0, *system.corners.tolist()}
    return max(float(arms @ np.linalg.norm(system.outer_force(t)[rows], axis=1)) for t in times)


def own_energies(total, system):
    """Sum of the energies in ``total`` that are no potential of work [J], and the same without regard to sign.

    The energy of a term beside the law of lines, which yield takes away, counts with its sign.
    """
    stored, beside = np.append(system.working <= 0, True), [f.elements.adds_tension for f in system.terms]
    sizes = np.where([*beside, False], total[:-2], np.abs(total[:-2]))
    return total[:-2][stored].sum(), sizes[stored].sum()


def refuse_open(course, limit, remedy):
    """Refuse a whole run whose energy drift exceeds a limit; `EnergyDriftError`."""
    if not course.drift <= limit:
        drift = f"energy drift {course.drift:.3g} of the largest energy of the run"
        raise EnergyDriftError(f"{drift}, limit {limit:g}: {remedy}", course.drift)


@kernel()
def kinetic_of(x, v, mass, turns):
    """Kinetic energy of all rows [J]."""
    total = 0.0
    for r in range(x.shape[0]):
        total += 0.5 * mass[r] * (v[r, 0] ** 2 + v[r, 1] ** 2 + v[r, 2] ** 2)
    if turns.moment.size:
        total += more_kinetic(x, v, turns)
    return total


@kernel(leaf=True, apart=())
def book_energies(
    t: float,
    x: Matrix,
    v: Matrix,
    mass: Vector,
    turns: RigidRotations,
    cells: IndexTable,
    data: MatrixTable,
    energies: EnergyTable,
    energy_outs: VectorTable,
    book: Vector,
    working: Integers,
    total: Vector,
) -> None:
    """Write the energy of each term, the kinetic energy and the work to ``total``; its last place stays.

    ``book`` has the work of each term and, last, that of all motion. ``working`` is 1 for a term whose power counts as
    work, −1 if its power is energy lost, else 0.
    """
    count = len(energies)
    total[count + 1] = book[count]
    for i in range(count):
        energies[i](t, x, cells[i], data[i], energy_outs[i])
        total[i] = sum_of(energy_outs[i])
        if working[i] > 0:
            total[count + 1] += book[i]
        elif working[i] < 0:
            total[i] = -book[i]
    total[count] = kinetic_of(x, v, mass, turns)


@kernel(ENERGY)
def no_energy(t, x, cells, data, out):
    out[:] = 0.0


@kernel(forceinline=True)
def begin_powers(t, x, v, extra, terms, solved, known, power):
    """Write the power of each term with a power [W]; if it is ``known``, without terms that kicks solve."""
    for n in range(terms.powers.shape[0]):
        i, column = terms.powers[n, 0], terms.powers[n, 1]
        if known and among(solved, i):
            continue
        terms.forces[i](t, x, v, extra, terms.cells[i], terms.data[i], terms.outs[i])
        power[i] = sum_of(terms.outs[i][:, column])
        if terms.powers[n, 2] > 1:
            note_snaps(0.0, terms.data[i], terms.outs[i])


@kernel(leaf=True, forceinline=True)
def act(i, t, x, v, f, terms):
    """Add the force of a term, by its number, to f."""
    cells, data, out = terms.cells[i], terms.data[i], terms.outs[i]
    terms.forces[i](t, x, v, f, cells, data, out)


@kernel(leaf=True, apart=("powers",))
def book_powers(
    t: float, h: float, x: Matrix, v: Matrix, extra: Matrix, power: Vector, work: Vector, terms: ForceTerms
) -> None:
    """Add the work of a step by the trapezoidal rule, from powers at its ends; ``extra`` is space for forces.

    Terms that depend on velocity, and those of `push_on`, have written their power already.
    """
    powers = terms.powers
    for n in range(powers.shape[0]):
        i, column = powers[n, 0], powers[n, 1]
        if powers[n, 2] == 0:  # the power at the full step: the force of the step saw the velocity at its middle
            act(i, t, x, v, extra, terms)
        gained = sum_of(terms.outs[i][:, column])
        work[i] += 0.5 * h * (power[i] + gained)
        power[i] = gained
        if powers[n, 2] > 1:
            note_snaps(h, terms.data[i], terms.outs[i])


@kernel(leaf=True, apart=("snaps",))
def note_snaps(h: float, data: Matrix, out: Matrix) -> None:
    """Note strains, and of lines that snap taut in a step h the square of the energy that this leaves in doubt.

    The damping force, which jumps there, acts in half of the step, whatever the share of the step behind the jump. The
    error is up to half of the power times the step, of either sign, and the mean of its square over all shares a
    twelfth of the square of that product.
    """
    for c in range(out.shape[0]):
        slackness = line_at(data, c).slackness
        if out[c, LAST_STRAIN] <= slackness < out[c, STRAIN]:
            out[c, SNAPPED] += (h * out[c, POWER]) ** 2 / 12.0
        out[c, LAST_STRAIN] = out[c, STRAIN]


@kernel(apart=("stages",))
def book_potential(sign: float, t: float, x: Matrix, terms: ForceTerms, work: Vector) -> None:
    """Add the potential at time t of each term that is booked, times a sign, to its work [J].

    With + before a drift of a step of higher order and − after it, this is the work of dead loads. Such a potential is
    linear in time between corners of tables. Time is a coordinate that advances with the drifts, while t advances with
    the kicks here, which omits the momentum of this coordinate. The balance closes as that of a scene without loads: to
    the order of the method, without a growing drift.
    """
    for n in range(terms.powers.shape[0]):
        i = terms.powers[n, 0]
        terms.energies[i](t, x, terms.cells[i], terms.data[i], terms.stored[i])
        work[i] += sign * sum_of(terms.stored[i])


@kernel(leaf=True)
def own_energy(total, working):
    """Sum of the energies in ``total`` that are no potential of work, and of the kinetic energy [J]."""
    energy = 0.0
    for i in range(working.size):
        if working[i] <= 0:
            energy += total[i]
    return energy + total[working.size]


@kernel(leaf=True, forceinline=True)
def note_motion(driven, mass, x, v, f, before):
    """Record position, force and kinetic energy of rows with prescribed motion before a step."""
    for d in range(driven.size):
        r = driven[d]
        before[d, 6] = 0.5 * mass[r] * (v[r, 0] ** 2 + v[r, 1] ** 2 + v[r, 2] ** 2)
        for k in range(3):
            before[d, k], before[d, 3 + k] = x[r, k], f[r, k]


@kernel(leaf=True, forceinline=True)
def book_motion(kick, last, driven, mass, v, f, before, work):
    """Add the work of prescribed motion in a drift between two kicks: what the kinetic energy gained and forces took.

    Velocities are those of the drift; of a rotation the force is the moment, and its velocity the angular one.
    """
    for d in range(driven.size):
        r, taken = driven[d], 0.0
        for k in range(3):
            taken += (kick * before[d, 3 + k] + last * f[r, k]) * v[r, k]
        gained = 0.5 * mass[r] * (v[r, 0] ** 2 + v[r, 1] ** 2 + v[r, 2] ** 2) - before[d, 6]
        work[work.size - 1] += gained - taken


@kernel(leaf=True, forceinline=True)
def book_kick(kick, driven, v, f, work):
    """Add the work of prescribed motion at constant velocities, of the forces in a kick."""
    for d in range(driven.size):
        r = driven[d]
        work[work.size - 1] -= kick * (f[r, 0] * v[r, 0] + f[r, 1] * v[r, 1] + f[r, 2] * v[r, 2])


@kernel(leaf=True, apart=("lengths",))
def write_length_force(
    t: float, x: Matrix, lengths: NaturalLengths, cells: Indices, lines: Matrix, out: Vector
) -> None:
    """Write ∂E/∂L of each natural length that changes [N]."""
    begin = 0
    for n in range(lengths.runs.shape[0]):
        first, last = lengths.runs[n, 0], lengths.runs[n, 1]
        end = begin + last - first
        lengths.by_length[0](t, x, cells[first:last], lines[first:last], out[begin:end])
        begin = end


@kernel(leaf=True, apart=("relaxing",))
def relax(h: float, x: Matrix, model: Model, work: Vector) -> None:
    """Take internal variables to the end of a step h, and note what they dissipate; for h = 0 note strains alone."""
    relaxing, terms = model.relaxing, model.terms
    for n in range(relaxing.terms.size):
        i, lost = relaxing.terms[n], relaxing.lost[n]
        relaxing.kernels[n](h, x, terms.cells[i], terms.data[i], relaxing.before[n], lost)
        work[i] -= sum_of(lost)


@kernel(leaf=True, apart=("lengths",))
def change_lengths(t: float, h: float, model: Model, was: Vector, running: Running) -> None:
    """Set natural lengths at the end t of a step, and add the work of that, ½ (∂E/∂L + ∂E/∂L) ΔL.

    Masses that follow them change as well.
    """
    lengths, cells, lines = model.lengths, model.terms.cells[0], model.terms.data[0]
    x, length_force, work = running.x, running.length_force, running.work
    if lengths.masses.rows.size:
        exchange_masses(t, running.v, lengths.masses, work, running.ledger.pushed)
    for c in range(was.size):
        was[c] = record_at(LINE, lines, lengths.elements[c], 0).natural_length
    set_lengths_by_blocks(t, lengths, lines, model.terms.natural, model.terms.numbers)
    if lengths.growth >= 0:
        set_growth(t - 0.5 * h, lengths, lines)
    if model.relaxing.terms.size:
        relax(h, x, model, work)
    write_length_force(t, x, lengths, cells, lines, length_force[1])
    for c in range(was.size):
        change = record_at(LINE, lines, lengths.elements[c], 0).natural_length - was[c]
        work[work.size - 1] += 0.5 * (length_force[0, c] + length_force[1, c]) * change
        length_force[0, c] = length_force[1, c]


@kernel(forceinline=True)
def set_lines(t, x, model):
    """Set natural lengths at time t, and masses by the slips of x, where any change."""
    if model.lengths.elements.size:
        set_lengths_by_blocks(t, model.lengths, model.terms.data[0], model.terms.natural, model.terms.numbers)
    if model.lengths.masses.slips.size:
        set_masses_by_slips(t, x, model.lengths.masses)


@kernel(forceinline=True)
def change_lines(changing, t, h, model, was, running):
    """Set natural lengths, internal variables and masses by slips at time t, a step h later, where any change."""
    if changing:
        change_lengths(t, h, model, was, running)
    elif model.relaxing.terms.size:
        relax(h, running.x, model, running.work)
    masses = model.lengths.masses
    if masses.slips.size:
        exchange_by_slips(t, h, running.x, running.v, masses, running.work, running.ledger.pushed)


@kernel(leaf=True)
def drifts_away(clock, energy, stored, work, limit):
    """Record energy, largest energy and drift of a row; return True if the run must end.

    It must end if a number is not finite, or if the drift exceeds ``limit`` and does not fall, see `CLOSING`.
    """
    clock.largest = max(clock.largest, stored)
    drift = abs(energy - work - clock.energy)
    clock.worst = max(clock.worst, drift)
    if not math.isfinite(drift):
        return True
    if clock.nsteps == 0 or not clock.largest > clock.least_energy:
        return False
    share, before = drift / clock.largest, clock.share
    clock.share = share
    return share > limit and share > CLOSING * before
