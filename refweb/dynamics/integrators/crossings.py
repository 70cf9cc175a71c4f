"""The first lines and bodies of a run that may have passed through each other, with the times."""

from __future__ import annotations

import math

import numpy as np

from ...kernels import kernel

APART, BESIDE, THROUGH, PAIRS = 0, 1, 2, 3
"""Rows of the array of crossings: lines that push each other, neighbours along the net, a line at the middle of a body,
and two bodies, by their rows, of which one is at the middle of the other."""


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
