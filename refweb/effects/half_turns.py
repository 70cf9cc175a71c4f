"""Half turns of threads about cylinders: how far ends are from where `winding` counts their turns.

The azimuth of an end is within half a turn of that in the web's position, so an end that goes farther would change the
length by a whole turn. `statics` refuses an equilibrium near there, and dynamics names it beside an energy drift.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..errors import SolverError
from .around import CYLINDER, body_of
from .winding import segments_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..net.net import Net
    from ..system.system import System

MOST = 0.45
"""Turns from where they are counted up to which an equilibrium is taken."""
REMEDY = (
    "as turns are counted up to half a turn from the web: let the body turn about an axle with that end on it, move "
    "the end less, or start from a web in which it is nearer, with around.turns"
)


def half_turns(net: Net, x: NDArray[np.float64]) -> list[tuple[str, int, int, float]]:
    """(Name of the body, its base, node, turns from where they are counted) of each end on a cylinder.

    Parameters
    ----------
    net : refweb.net.net.Net
        The net.
    x : ndarray, shape (rows, 3)
        Displacement of every row [m].
    """
    ends = []
    for thread in net.threads:
        segments = segments_of(net, thread)[0] if thread.wraps else None
        for wrap in thread.wraps:
            body, segment = body_of(net, wrap.body), segments[wrap.segment]
            if segment["kind"] != CYLINDER:
                continue
            for n, key in enumerate(("first", "second")):
                row, turn, near = int(thread.rows[wrap.segment + n]), int(segment["turns"][n]), segment["angles"][n]
                near += segment["sense"] * x[turn, 1] if turn >= 0 else 0.0
                across = body.axes @ (segment[key] + x[row] - x[body.base])
                apart = math.remainder(math.atan2(across[1], across[0]) - near, 2.0 * math.pi)
                ends.append((wrap.body, body.base, row, apart / (2.0 * math.pi)))
    return ends


def refuse_half_turns(system: System, t: float, x: NDArray[np.float64], before: list[float]) -> list[float]:
    """Refuse an equilibrium in which an end is about half a turn from where turns are counted; these turns of all ends.

    Parameters
    ----------
    system : refweb.system.system.System
        The system.
    t : float
        Load step.
    x : ndarray, shape (rows, 3)
        Displacement of every row [m].
    before : list of float
        The turns that this returned at the load step before, or empty.

    Raises
    ------
    SolverError
        For such an end, and one that goes by more than half a turn in a load step, or, where a table moves it or the
        body, by more than a quarter.
    """
    ends = half_turns(system.net, x)
    driven = {int(row) for drive in system.drives for row in drive.cells[:, 0]}
    for (name, base, node, turns), last in zip(ends, before or [0.0] * len(ends), strict=True):
        about = f'node {node} goes about body "{name}"'
        if abs(turns) > MOST:
            raise SolverError(f"step {t:g}: {about} by {turns:.2f} of a turn, limit {MOST:g}, {REMEDY}")
        if abs(turns - last) > (0.25 if {base, node} & driven else 0.5):
            raise SolverError(
                f"step {t:g}: {about} from {last:.2f} to {turns:.2f} of a turn in one load step, by which way is "
                "open: use more load_steps"
            )
    return [turns for *_, turns in ends]


def half_turn_remark(net: Net, x: NDArray[np.float64]) -> str:
    """Text that names an end far from where turns are counted, which may cause an energy drift; "" without one."""
    name, _, node, turns = max(half_turns(net, x), key=lambda end: abs(end[3]), default=("", 0, 0, 0.0))
    if abs(turns) < 0.25:
        return ""
    return (
        f'; node {node} is {turns:.2f} of a turn about body "{name}" from where it was in the web, and its thread may '
        f"have jumped, {REMEDY}"
    )
