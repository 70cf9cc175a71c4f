"""Which contacts are of which body: ranges of rows of what all families of contact with bodies observe.

Each cell shows how deep it is and the force on the body that it touches, where bodies touch each other that on the
second of them. The force of contact on a body is the sum over its rows, and nothing else is; see `force_on`.
"""

from __future__ import annotations

import numpy as np

from ..effects.base import FELT
from ..kernels import kernel


class ContactRows:
    """Ranges of rows, (first, last + 1), by the row of a body.

    Parameters
    ----------
    families : sequence of refweb.effects.base.Family
        Those of a system.
    """

    def __init__(self, families):
        self._acting, self._lines, self._pairs, begin = {}, {}, {}, 0
        for family in families:
            if not family.felt:
                continue
            rows = [family.cells[:, column] for column in family.felt]
            for sign, own in zip((1, -1), rows, strict=False):
                for body in np.unique(own).tolist():
                    ranges = _ranges(begin + np.flatnonzero(own == body))
                    self._acting.setdefault(body, []).extend((first, last, sign) for first, last in ranges)
                    if family.energy is not None and len(rows) == 1:
                        self._lines.setdefault(body, []).extend(ranges)
            if family.energy is not None and len(rows) == 2:
                for n, pair in enumerate(zip(*(own.tolist() for own in rows), strict=True)):
                    self._pairs[frozenset(pair)] = begin + n
            begin += len(family.cells)

    def acting_on(self, body):
        """Of all contacts of a body, with the sign of its part of their forces: int, shape (ranges, 3)."""
        return np.array(self._acting.get(body.row, []), dtype=np.int64).reshape(-1, 3)

    def lines_on(self, body):
        """Of the depths of all lines in a body, in the order of elements: (first, last + 1)."""
        ((first, last),) = self._lines[body.row]
        return first, last

    def with_web(self, bodies):
        """Of the depths of lines in some bodies, a list of (first, last + 1)."""
        return [ranges for body in bodies for ranges in self._lines.get(body.row, [])]

    def between(self, one, others):
        """Of the depths of a body in some others, a list of (first, last + 1)."""
        found = [self._pairs.get(frozenset((one.row, other.row))) for other in others if other.row != one.row]
        return [(row, row + 1) for row in found if row is not None]


def _ranges(rows):
    """Rows in increasing order as a list of (first, last + 1)."""
    parts = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
    return [(int(part[0]), int(part[-1]) + 1) for part in parts if len(part)]


@kernel(leaf=True)
def force_on(contact, ranges, begin):
    """Sum of the forces of contacts on a body [N].

    ``ranges`` is (first, last + 1, sign, first, ...) from ``begin`` on. Two sums at once take half of the time of one.
    """
    a0 = a1 = a2 = b0 = b1 = b2 = 0.0
    for n in range(begin, ranges.size, 3):
        first, last, sign = ranges[n], ranges[n + 1], float(ranges[n + 2])
        for r in range(first, last - 1, 2):
            a0, b0 = a0 + sign * contact[r, FELT], b0 + sign * contact[r + 1, FELT]
            a1, b1 = a1 + sign * contact[r, FELT + 1], b1 + sign * contact[r + 1, FELT + 1]
            a2, b2 = a2 + sign * contact[r, FELT + 2], b2 + sign * contact[r + 1, FELT + 2]
        if (last - first) % 2:
            a0 += sign * contact[last - 1, FELT]
            a1 += sign * contact[last - 1, FELT + 1]
            a2 += sign * contact[last - 1, FELT + 2]
    return a0 + b0, a1 + b1, a2 + b2
