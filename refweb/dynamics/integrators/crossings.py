"""The first lines and bodies of a run that may have passed through each other: when, and which."""

from __future__ import annotations

import math

import numpy as np

from ...kernels import kernel

APART, BESIDE, THROUGH, PAIRS = 0, 1, 2, 3
"""Rows of what has met: lines that push each other, neighbours along the net, a line and the middle of a body, and two
bodies, by their rows, that have come to the middle of one of them."""


def none_met():
    """Nothing has met: times [s] and four rows each, shape (4, 5)."""
    return np.tile([np.inf, -1.0, -1.0, -1.0, -1.0], (4, 1))


@kernel()
def note_met(which, time, met, crossings):
    """Note the first two lines that have met."""
    if not crossings[which, 0] < math.inf:
        crossings[which, 0] = time
        for n in range(4):
            crossings[which, 1 + n] = met[n]
