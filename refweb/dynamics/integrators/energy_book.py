"""The book of energies: what came in as work has to be there as energy, or the run is refused.

A flag of success is not believed: at every history row ``|ΔE − work|`` is held against the largest energy of the run.
"""

from __future__ import annotations

from ...errors import OpenBook
from ...kernels import ENERGY, kernel

DRIFT = 1e-2
"""Largest energy drift of a run whose result is returned, over the largest energy of the whole run."""
CLOSING = 0.9
"""Factor by which a drift above `DRIFT` has to fall from row to row, over the largest energy until then, for the run to
go on: where a load rises from zero on a web at rest, the first rows hold a few steps' errors against next to nothing.
"""


def refuse_open(course, limit, remedy):
    """Refuse a whole run whose energy drift exceeds a limit; `OpenBook`."""
    if not course.drift <= limit:
        raise OpenBook(f"energy drift {course.drift:.3g} of the largest energy of the run, limit {limit:g}: {remedy}")


@kernel()
def book_energies(t, x, v, mass, cells, data, energies, energy_outs, book, working, total):
    """Write the energy of each family, the kinetic energy and the work to ``total``; its last place stays.

    ``book`` holds the work of each family and, last, that of all motion; ``working`` says of each family whether that
    counts as work (1), or as its energy, which is lost (−1), or neither (0).
    """
    count = len(energies)
    total[count], total[count + 1] = 0.0, book[count]
    for i in range(count):
        energies[i](t, x, cells[i], data[i], energy_outs[i])
        total[i] = energy_outs[i].sum()
        if working[i] > 0:
            total[count + 1] += book[i]
        elif working[i] < 0:
            total[i] = -book[i]
    for r in range(x.shape[0]):
        total[count] += 0.5 * mass[r] * (v[r, 0] ** 2 + v[r, 1] ** 2 + v[r, 2] ** 2)


@kernel(ENERGY)
def no_energy(t, x, cells, data, out):
    out[:] = 0.0
