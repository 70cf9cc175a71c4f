"""Memory that a scene takes, estimated before anything large is made.

Measured on webs of 760 to 2 million lines, beside some 200 MB of libraries: statics 4 to 5 kB for each element up to
80 000, factors included, which grow a little faster, 6.4 kB of 750 000 in hexagons and 6.2 kB of 2 million in squares;
explicit steps below 1 kB.

May change: constants, which are measured and decide only what is refused. Must stay: functions and units [byte], which
`build`, `runner`, `effects.self_contact`, `net.mesh_readers` and `net.boundary` use; the estimate comes before anything
large is made. Must stay as well: ``what`` of `check` is a plural; all names that `build`, `runner` and other files
import. Tests: ``tests/net/test_bad_files.py`` and ``tests/results/test_frames.py``, which quote messages.
"""

from __future__ import annotations

import os
import sys

from .errors import InputError

BYTES_EXPLICIT, BYTES_IMPLICIT, BYTES_PER_BODY = 1e3, 6.5e3, 3e2
"""Bytes for each element of order 1: of explicit methods and of others, and for each body that it may touch."""
BYTES_PER_ROW, NUMBERS_PER_ROW = 24, 24
"""Bytes of a number of a history row, of the run and of its twin and while they are put together; and how many numbers
a row has besides the observables."""
READING = 10.0
"""Memory to read a mesh file, over its size."""


def available():
    """Memory that is available [bytes]: of the system, and to this process."""
    size = float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE") if hasattr(os, "sysconf") else float("inf")
    try:
        with open("/proc/meminfo", encoding="ascii") as lines:
            size = next(1024.0 * int(line.split()[1]) for line in lines if line.startswith("MemAvailable"))
    except (OSError, StopIteration):
        pass
    if sys.platform != "win32":
        import resource

        limit = resource.getrlimit(resource.RLIMIT_AS)[0]
        size = size if limit == resource.RLIM_INFINITY else min(size, float(limit))
    return size


def check(needed, what):
    """Refuse ``what`` needs more memory [bytes] than is available."""
    if needed > (size := available()):
        free = f"must be ≤ {size / 1e9:.3g} GB, which is free"
        raise InputError(f"{what} need about {needed / 1e9:.3g} GB of memory, {free}")


def needed(elements, order, explicit, bodies):
    """Memory for a run [bytes].

    Parameters
    ----------
    elements, order : int
        Number of elements and their order.
    explicit : bool
        True for explicit methods, which need no matrices.
    bodies : int
        Number of bodies that the web may touch.
    """
    each = BYTES_EXPLICIT if explicit else BYTES_IMPLICIT * (0.5 * (order + 1)) ** 2
    return elements * (each + BYTES_PER_BODY * bodies)


def of_states(count, rows, elements, read):
    """Memory of states that are kept [bytes].

    Parameters
    ----------
    count, rows, elements : int
        Number of states, and of the rows and elements of each.
    read : bool
        True if results of each state were evaluated, which it then keeps: positions, forces, and tension, stress and
        strain of elements. Else it has displacements and velocities alone.
    """
    return count * (48.0 * rows + (48.0 * rows + 40.0 * elements if read else 0.0))
