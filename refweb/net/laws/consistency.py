"""Consistency of a law of another package: its energy is the integral of its stress, its tangent the slope of that.

The slope is at most EA, and the stress of a law with ``convex = True`` does not fall.

Over a short interval of strain, the rise of the energy over that of strain lies between the smallest and the largest
stress of the interval, and the rise of the stress between the smallest and the largest tangent. This holds at kinks
too, so that the smoothness of a law does not matter. The intervals have no gaps up to the largest strain.

May change: private functions, `STRAINS`, as long as the intervals have no gaps, `HALF_WIDTH`, `TOLERANCE`, `ROUNDING`,
`PARTS`, `MOST` and texts of errors: all decide only which laws of other packages are refused. Must stay:
`refuse_inconsistent`, which `net.discretisation` calls for laws that refweb does not ship. Tests:
``tests/how_to/test_law.py``.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...errors import InputError
from .law import evaluate

HALF_WIDTH = 1e-3
"""Half of the interval of strain over the distance of its middle from the slackness."""
STRAINS = (-0.1, -1e-3, *np.geomspace(1e-5, 0.5, 1 + int(np.log(0.5 / 1e-5) / (1.99 * HALF_WIDTH))))
"""Strains beyond the slackness at which laws are compared."""
TOLERANCE = 1e-3
"""Part of a stress or tangent by which a rise may be outside; that of EA ε and EA is added 1e-6 times for rounding."""
ROUNDING = 1e-6
PARTS = 8
"""Parts of an interval at whose ends stress and tangent are evaluated."""
MOST = 4
"""Number of lines that are looked at, of different numbers."""
KINDS = (
    ("energy_density", "stress", "rises by {:.6g} N per strain, and stress is {:.6g} N"),
    ("stress", "tangent", "rises by {:.6g} N per strain, and tangent is {:.6g} N"),
)


def refuse_inconsistent(law, lines, numbers):
    """Refuse a law whose energy is not the integral of its stress, or whose tangent is not the slope of that.

    As well one whose tangent is above EA or that has no number at a strain, and a stress that falls where the law says
    that it is convex. ``lines`` is the `refweb.net.laws.line_data.LineData` of elements of this law, and ``numbers`` is
    the line of each. The `InputError` has the law, a line, a strain and both numbers.
    """
    read = np.column_stack([lines[name] for name in ("ea", "slackness", "smoothing", *law.columns)])
    for first in np.sort(np.unique(read, axis=0, return_index=True)[1])[:MOST]:
        _compare(law, lines[[first]], int(numbers[first]))


def _compare(law, line, number):
    """Compare rises and slopes of one line."""
    offset, ea = np.array(STRAINS), float(line.ea[0])
    width = HALF_WIDTH * np.abs(offset)
    strain = (line.slackness[0] + offset + width * np.linspace(-1.0, 1.0, PARTS + 1)[:, None]).ravel()
    every = line[np.zeros(len(strain), dtype=int)]
    title = f'law = "{law.name}" of line {number}:'
    with np.errstate(all="ignore"):
        values = {
            name: _of_kernel(law, name, strain, every, title).reshape(PARTS + 1, -1)
            for name in ("energy_density", "stress", "tangent")
        }
        for name, value in values.items():  # a law may end at a strain, without numbers beyond
            known: Any = np.isfinite(value).all(axis=0)
            for at in np.flatnonzero(~known[: np.flatnonzero(known).max(initial=-1)])[:1]:
                raise InputError(
                    f"{title} at a strain of {line.slackness[0] + offset[at]:g} {name} is no finite number"
                )
        low = rise = allowed = np.zeros(0)  # of the last kind behind the loop
        for (above, below, words), scale in zip(KINDS, (ea * np.abs(offset), ea), strict=True):
            rise = (values[above][-1] - values[above][0]) / (2.0 * width)
            low, high = values[below].min(axis=0), values[below].max(axis=0)
            allowed = TOLERANCE * np.maximum(np.abs(low), np.abs(high)) + ROUNDING * scale
            off = (rise < low - allowed) | (rise > high + allowed)
            for at in np.flatnonzero(off)[:1]:
                middle = values[below][PARTS // 2, at]
                raise InputError(
                    f"{title} at a strain of {line.slackness[0] + offset[at]:g} {above} "
                    f"{words.format(rise[at], middle)}: make {above} the integral of {below}"
                )
        for at in np.flatnonzero(low > ea * (1.0 + TOLERANCE))[:1]:
            raise InputError(
                f"{title} at a strain of {line.slackness[0] + offset[at]:g} tangent is {low[at]:.6g} N, must be at "
                f"most EA = {ea:g} N: raise the modulus, and let stress be a smaller part of it"
            )
        for at in np.flatnonzero(rise < -allowed)[:1] if law.convex else ():
            raise InputError(
                f"{title} at a strain of {line.slackness[0] + offset[at]:g} stress falls, by {-rise[at]:.6g} N per "
                "strain, and convex = True says that it rises: leave out convex"
            )


def _of_kernel(law, name, strain, lines, title):
    """A kernel of a law at the strain of each line, shape (lines,); refuses one that cannot be compiled."""
    from numba.core.errors import NumbaError

    try:
        return evaluate(getattr(law, name), strain, lines, law.columns)
    except NumbaError as error:
        reason = str(error).strip().splitlines()
        raise InputError(
            f"{title} {name} cannot be compiled, it must return a number of (strain, line): {' '.join(reason[-1:])}"
        ) from None
