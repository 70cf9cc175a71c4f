"""Consistency of a law of another package: its energy is the integral of its stress, its tangent the slope of that.

Over a short interval of strain, the rise of the energy over that of strain lies between the smallest and the largest
stress of the interval, and the rise of the stress between the smallest and the largest tangent. This holds at kinks
too, so that the smoothness of a law does not matter.

`net.discretisation` asks it for laws of other packages alone; strains and the tolerance are free.
"""

from __future__ import annotations

import numpy as np

from ...errors import InputError
from .law import evaluate

STRAINS = (-0.1, -1e-3, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 0.5)
"""Strains beyond the slackness at which laws are compared."""
HALF_WIDTH = 1e-3
"""Half of the interval of strain over the distance of its middle from the slackness."""
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

    Parameters
    ----------
    law : type
        The law, see `refweb.net.laws.law.TensionLaw`.
    lines : refweb.net.laws.line_data.LineData
        Numbers of elements of this law.
    numbers : ndarray of int, shape (elements,)
        Line of each.

    Raises
    ------
    InputError
        With the law, a line, a strain and both numbers.
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
    with np.errstate(all="ignore"):
        values = {
            name: evaluate(getattr(law, name), strain, every, law.columns).reshape(PARTS + 1, -1)
            for name in ("energy_density", "stress", "tangent")
        }
        for (above, below, words), scale in zip(KINDS, (ea * np.abs(offset), ea), strict=True):
            rise = (values[above][-1] - values[above][0]) / (2.0 * width)
            low, high = values[below].min(axis=0), values[below].max(axis=0)
            allowed = TOLERANCE * np.maximum(np.abs(low), np.abs(high)) + ROUNDING * scale
            off = (rise < low - allowed) | (rise > high + allowed)
            for at in np.flatnonzero(off)[:1]:
                middle = values[below][PARTS // 2, at]
                raise InputError(
                    f'law = "{law.name}" of line {number}: at a strain of {line.slackness[0] + offset[at]:g} {above} '
                    f"{words.format(rise[at], middle)}: make {above} the integral of {below}"
                )
