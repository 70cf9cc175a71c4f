"""The probe of the end of a thread that is farthest from where its turns about a cylinder are counted.

`dynamics.history` takes it among its warnings; the number that it writes to ``where`` is that of the end in
`refweb.effects.half_turns.ends_of`, so that both have one order.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..effects.half_turns import ends_of, turns_of
from ..kernels import kernel
from .probes import PROBE, Probe

if TYPE_CHECKING:
    from ..net.net import Net


@kernel(PROBE)
def farthest(t, x, v, f, lines, rows, data, where):
    """Largest distance of an end from where turns are counted; ``rows`` are those of each `End`, ``data`` numbers."""
    largest = -1.0
    for n in range(data.shape[0]):
        turns = abs(turns_of(x, rows[3 * n], rows[3 * n + 1], rows[3 * n + 2], data[n]))
        if turns > largest:
            largest, where[0] = turns, n
    return largest


def probe_of(net: Net) -> Probe | None:
    """Probe of the `farthest` end; None without one."""
    ends = ends_of(net)
    if not ends:
        return None
    return Probe(farthest, [row for end in ends for row in end.rows], np.array([end.numbers for end in ends]), sign=1.0)
