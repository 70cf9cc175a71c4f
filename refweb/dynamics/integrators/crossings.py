"""The first lines of a run that may have passed through each other, or through a body: when, and which."""

from __future__ import annotations

import math

import numpy as np

from ...kernels import kernel

APART, BESIDE, THROUGH = 0, 1, 2
"""Rows of what has met: lines that push each other, neighbours along the net, and a line and the middle of a body."""


def none_met():
    """Nothing has met: times [s] and four rows each, shape (3, 5)."""
    return np.tile([np.inf, -1.0, -1.0, -1.0, -1.0], (3, 1))


@kernel()
def note_met(which, time, met, crossings):
    """Note the first two lines that have met."""
    if not crossings[which, 0] < math.inf:
        crossings[which, 0] = time
        for n in range(4):
            crossings[which, 1 + n] = met[n]
