"""Half turns of threads about cylinders: how far ends are from where `winding` counts their turns.

May change: `MOST`, up to ½, and messages. Must stay: the order of the three ``rows`` and of the ``numbers`` of `End`,
which the compiled `turns_of` and `dynamics.half_turns.farthest` read by position; `ends_of`, `turns_of`, `MOST` and
`REMEDY`, which `dynamics.half_turns` uses, and `refuse_half_turns`, which `statics.equilibrium` calls. Tests:
``tests/effects/test_around.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..errors import SolverError
from ..kernels import kernel
from .around import CYLINDER
from .winding import segments_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..net.net import Net
    from ..system.system import System

MOST = 0.45
"""Turns from where they are counted up to which an equilibrium is taken, and a run has no warning."""
REMEDY = (
    "as turns are counted up to half a turn from the web: let the body turn about an axle with that end on it, move "
    "the end less, or start from a web in which it is nearer, with around.turns"
)


class End(NamedTuple):
    """An end of a segment on a cylinder.

    Attributes
    ----------
    body : str
        Name of the body.
    rows : tuple of 3 int
        Rows of the node, of the base of the body, and of its angle about its axle, −1 where this does not count.
    numbers : ndarray, shape (11,)
        Vector from the middle of the body in the web's position [m], first and second axis of the body, azimuth from
        which turns are counted [rad], and the sense of the axle.
    """

    body: str
    rows: tuple[int, int, int]
    numbers: NDArray[np.float64]


def ends_of(net: Net) -> list[End]:
    """Ends of all segments of threads that are on cylinders."""
    ends = []
    for thread in net.threads:
        segments: Any = segments_of(net, thread)[0] if thread.wraps else None
        for wrap in thread.wraps:
            body, segment = net.body_of(wrap.body), segments[wrap.segment]
            for n, key in enumerate(("first", "second") if segment["kind"] == CYLINDER else ()):
                rows = int(thread.rows[wrap.segment + n]), body.base, int(segment["turns"][n])
                numbers = [*segment[key], *segment["axes"][:6], segment["angles"][n], segment["sense"]]
                ends.append(End(wrap.body, rows, np.array(numbers)))
    return ends


@kernel()
def turns_of(x, node, base, turn, numbers):
    """Turns of an `End` from where they are counted, from −½ to ½."""
    near, first, second = numbers[9], 0.0, 0.0
    if turn >= 0:
        near += numbers[10] * x[turn, 1]
    for k in range(3):
        away = numbers[k] + x[node, k] - x[base, k]
        first, second = first + away * numbers[3 + k], second + away * numbers[6 + k]
    apart = (math.atan2(second, first) - near) / (2.0 * math.pi)
    return apart - round(apart)


def refuse_half_turns(system: System, t: float, x: NDArray[np.float64], before: list[float]) -> list[float]:
    """Refuse an equilibrium in which an end is about half a turn from where turns are counted; these turns of all ends.

    ``x`` are displacements [m], shape (rows, 3), at load step ``t``; ``before`` are the turns that this returned at the
    load step before, or empty.

    Raises
    ------
    SolverError
        For such an end, and one that goes by more than half a turn in a load step, or, where a table moves it or the
        body, by more than a quarter.
    """
    ends = ends_of(system.net)
    driven, now = {int(row) for drive in system.drives for row in drive.cells[:, 0]}, []
    for end, last in zip(ends, before or [0.0] * len(ends), strict=True):
        turns, (node, base, _) = turns_of(x, *end.rows, end.numbers), end.rows
        now.append(turns)
        about = f'node {node} goes about body "{end.body}"'
        if abs(turns) > MOST:
            raise SolverError(f"step {t:g}: {about} by {turns:.2f} of a turn, limit {MOST:g}, {REMEDY}")
        if abs(turns - last) > (0.25 if {base, node} & driven else 0.5):
            raise SolverError(
                f"step {t:g}: {about} from {last:.2f} to {turns:.2f} of a turn in one load step, by which way is "
                "open: use more load_steps"
            )
    return now
