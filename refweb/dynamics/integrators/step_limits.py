"""Limits of a step: the next corner of a table, and the distance to a passage through bodies or lines.

`step_observer` makes them; ``position`` is that of `passages`. May change: how distances are bounded. Must stay: a
limit may be too near and never too far, else a step passes over a corner of a table or through a body; `stop` and
`at_corner`, which `step_observer` calls before each step; `passages`, which `step_observer` takes as a monitor;
`TRAVEL`, which `studies.dop853` imports from here; `StepLimits`, which `step_observer` imports. Tests:
``tests/dynamics/integrators/test_step_observer.py``.
"""

from __future__ import annotations

import math

import numpy as np

from ...kernels import kernel
from .integrator import SAME
from .passages import TRAVEL, Passages


class StepLimits:
    """The limits of steps of one system.

    Parameters
    ----------
    system : refweb.system.system.System
        Its tables of time, and its bodies.
    rotations : refweb.dynamics.integrators.rotations.Rotations, optional
        Bodies that turn.
    position : callable, optional
        As in `refweb.dynamics.integrators.passages.Passages`.

    Attributes
    ----------
    passages : refweb.dynamics.integrators.passages.Passages
        Lines and bodies that push each other.
    """

    def __init__(self, system, rotations=None, position=None):
        self.passages = Passages(system, position)
        self._rotations = rotations
        self._net, self._moving = system.net, system.rows - system.net.spins
        self._corners = system.corners
        bodies = system.net.bodies
        self._thickness = min((body.thickness for body in bodies), default=np.inf)
        self._outreach = np.array([body.extent for body in bodies])
        self._rows = np.array([body.row for body in bodies], dtype=np.int64)

    def at_corner(self, t):
        """Tell if a table has a corner at a time [s]."""
        at = np.searchsorted(self._corners, t * (1.0 - SAME))
        return at < len(self._corners) and bool(self._corners[at] <= t * (1.0 + SAME))

    def stop(self, t, x, v, end):
        """Time that a step from a state must not pass, on the way to ``end`` [s]; infinite where nothing limits it."""
        ahead = np.searchsorted(self._corners, t * (1.0 + SAME), side="right")
        stop = self._corners[ahead] if ahead < len(self._corners) else np.inf
        if np.isfinite(self._thickness):
            speed, gap = speed_and_gap(
                self._net.points, x, v[: self._moving], self._net.nodes, self._rows, self._outreach
            )
            if self._rotations:
                speed = max(speed, self._rotations.speed(x, v))
            speed, path = 2.0 * speed, max(TRAVEL * self._thickness, 0.5 * gap)
            stop = min(stop, t + path / speed) if speed > 0.0 else stop
        stop = min(stop, t + self.passages.soon(x, v))
        return t + SAME * end if stop - t < SAME * end else stop


@kernel()
def speed_and_gap(points, x, v, nodes, rows, outreach):
    """Largest speed of rows [m/s], and at most the least distance between a body and a node [m].

    The distance is that of a box around the nodes and balls around the bodies at ``rows``, which reach out so far.
    """
    fastest = 0.0
    for r in range(v.shape[0]):
        fastest = max(fastest, v[r, 0] ** 2 + v[r, 1] ** 2 + v[r, 2] ** 2)
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for n in range(nodes):
        for k in range(3):
            coordinate = points[n, k] + x[n, k]
            low[k], high[k] = min(low[k], coordinate), max(high[k], coordinate)
    gap = np.inf
    for b, row in enumerate(rows):
        apart = 0.0
        for k in range(3):
            coordinate = points[row, k] + x[row, k]
            apart += max(low[k] - coordinate, coordinate - high[k], 0.0) ** 2
        gap = min(gap, math.sqrt(apart) - outreach[b])
    return math.sqrt(fastest), gap
