"""Collision checks of a system, a table for all methods, and the first lines and bodies of a run that have met.

Rows move in straight lines: in a drift of an explicit step, see `refweb.dynamics.integrators.ccd`, or between times at
which the dense output of a step is known, see `refweb.dynamics.integrators.passages`.

`ccd` and `passages` call `checks_of` and `note_met`. May change: the order of checks within `checks_of`. Must stay:
numbers of kinds, which are rows of ``crossings`` in checkpoints and index it in `simulation`, `history`, `passages` and
`ccd`; the columns time and four rows. A new kind needs a number at the end and a row in `none_met`. Must stay as well:
all names that `ccd`, `dynamics.simulation` and other files import. Tests: ``tests/effects/test_passage.py``,
``test_between_bodies.py``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ...kernels import kernel

APART, BESIDE, THROUGH, PAIRS = 0, 1, 2, 3
"""Kinds of checks, and rows of the array of crossings: lines that push each other, neighbours along the net, a line at
the middle of a body, and two bodies, by their rows, of which one is at the middle of the other."""


class Check(NamedTuple):
    """Check of cells that may meet.

    Attributes
    ----------
    kind, term : int
        `APART`, `BESIDE`, `THROUGH` or `PAIRS`, and the number of the term.
    kernel : kernel
        Tells if any cell meets, of signature `refweb.kernels.MEETS`; for `PAIRS` the force that writes their depths.
    cells, data : ndarray
        Rows of each cell and its numbers.
    limit, factor : float
        Depth below which none meets [m], and largest depth over what the term shows, infinite where not known.
    """

    kind: int
    term: int
    kernel: Callable
    cells: np.ndarray
    data: np.ndarray
    limit: float = 0.0
    factor: float = 1.0


def checks_of(system):
    """List of the checks of a system, each a `Check`."""
    checks = []
    for i, term in enumerate(system.terms):
        cells, lines, passing = (term.cells, term.data), term.contact.crossing, term.contact.passing
        if lines is not None:
            checks.append(Check(APART, i, lines.meets, *cells, lines.touch))
            checks.append(Check(BESIDE, i, lines.meets, lines.rows, lines.data))
        if passing is not None:
            from ...effects.contact.line_body_ccd import limits_of

            checks.append(Check(THROUGH, i, passing, *cells, *limits_of(term, system.net.bodies)))
        if term.contact.pairs:
            checks.append(Check(PAIRS, i, term.force, *cells))
    return checks


def none_met():
    """Array without crossings: times [s] and four rows each, shape (4, 5)."""
    return np.tile([np.inf, -1.0, -1.0, -1.0, -1.0], (4, 1))


@kernel()
def note_met(which, time, met, crossings):
    """Record the first crossing of a kind."""
    if not crossings[which, 0] < math.inf:
        crossings[which, 0] = time
        for n in range(4):
            crossings[which, 1 + n] = met[n]
