"""Half turns of threads about cylinders in a run: the farthest end in every step, and the text that names it.

An end that goes by more than half a turn changes the length of its thread by a turn, see `refweb.effects.half_turns`.
Where the thread is taut energy tells of that; where it is slack nothing else does.

May change: `DOUBT` and words of the text. Must stay: the signature of the kernel `farthest`, `results.probes.PROBE`,
since the compiled loop calls it by address; `probe_of` and `half_turn_remark`, which `history` calls; turns are counted
as in `effects.half_turns`. Tests: ``tests/effects/test_around.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..effects.half_turns import MOST, REMEDY, ends_of, turns_of
from ..kernels import kernel
from ..results.probes import PROBE, Probe

if TYPE_CHECKING:
    from ..net.net import Net

DOUBT = 0.25
"""Turns from which on an energy drift may come of them."""


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


def half_turn_remark(net: Net, turns: float, number: int, t: float, drifts: bool) -> str:
    """Text that names the `farthest` end of a run, by its turns, its number and the time [s]; "" for few turns.

    ``drifts`` is True beside an energy drift, which it may be the cause of.
    """
    if turns < (DOUBT if drifts else MOST):
        return ""
    end = ends_of(net)[number]
    return (
        f'node {end.rows[0]} comes to {turns:.2f} of a turn about body "{end.body}" from where it was in the web, at '
        f"t = {t:.6g} s, and its thread may have gained or lost a turn there, {REMEDY}"
    )
