"""History rows of the compiled loop: probes, energies, momentum and impulses at an instant.

May change: nothing but names inside of kernels. Must stay: the order of a row, that of `integrator.History`, which
`step_observer` writes as well: change all three together. `explicit_loop` calls `energies_now` and `write_row`,
`measurements` calls `write_probes`, with these arguments. Tests: ``tests/dynamics/test_dynamics.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...kernels import Integers, Matrix, Vector, among, kernel
from .averages import write_means
from .energy_balance import book_energies, own_energy
from .extremes import look_at
from .momentum_balance import note_momentum

if TYPE_CHECKING:
    from .averages import Averages
    from .extremes import Extremes
    from .monitors import Observed
    from .records import Model, Running


@kernel(leaf=True, apart=())
def energies_now(model: Model, running: Running, total: Vector) -> tuple[float, float]:
    """Write all energies to ``total``; their sum but for work, and that without regard to sign [J]."""
    clock, terms = running.clock[0], model.terms
    book_energies(
        clock.time, running.x, running.v, model.inertia.mass, model.inertia.turns, terms.cells, terms.data,
        terms.energies, terms.stored, running.work, terms.working, total,
    )  # fmt: skip
    stored = 0.0
    for i in range(total.size - 2):
        if i >= terms.working.size or terms.working[i] <= 0:
            stored += total[i] if among(terms.beside, i) else abs(total[i])
    return own_energy(total, terms.working), stored


@kernel(leaf=True, apart=())
def write_probes(
    row: Vector,
    t: float,
    x: Matrix,
    v: Matrix,
    f: Matrix,
    lines: Matrix,
    where: Integers,
    observed: Observed,
    averages: Averages,
    extremes: Extremes,
) -> None:
    """Write time and probes, means where these have a window."""
    row[0] = t
    for i in range(len(observed.probes)):
        row[1 + i] = look_at(i, t, x, v, f, lines, observed, where)
    if observed.windows.slots.size:
        write_means(row, observed.windows, averages, extremes)


@kernel(leaf=True, apart=())
def write_row(
    row: Vector, model: Model, observed: Observed, running: Running, total: Vector, where: Integers, p: Matrix
) -> tuple[float, float]:
    """Write time, probes, energies, work, step size, momentum and impulses; hold momentum against these.

    Returns the energy, and the sum of all energies without regard to sign [J]. There is room for a place and for
    momenta.
    """
    clock, terms, inertia, v = running.clock[0], model.terms, model.inertia, running.v
    at, extremes = 1 + len(observed.probes), running.extremes
    write_probes(
        row, clock.time, running.x, v, running.f, terms.outs[0], where, observed, running.averages, extremes
    )  # fmt: skip
    energy, stored = energies_now(model, running, total)
    total[-1] = clock.step
    for i in range(total.size):
        row[at] = total[i]
        at += 1
    for r in range(v.shape[0]):
        for k in range(3):
            p[r, k] = inertia.mass[r] * v[r, k] if inertia.inverse[r, k] > 0.0 else 0.0
    note_momentum(clock.time, running.x, p, running.impulse, model.outside, running.ledger, 0.0, row[at:])
    return energy, stored
