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

from .integrator import SAME
from .passages import TRAVEL, Passages

GROWTH = 10.0
"""Largest size of a step over that of the last one, as SUNDIALS allows it behind a first step."""


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

    def stop(self, t, x, v, end, step=0.0):
        """Time that a step from a state must not pass, on the way to ``end`` [s]; infinite where nothing limits it.

        Distances from bodies are left out where `GROWTH` times the last ``step`` [s] passes through no body: to find
        them takes 0.1 ms in hexagon-impact.
        """
        ahead = np.searchsorted(self._corners, t * (1.0 + SAME), side="right")
        stop = self._corners[ahead] if ahead < len(self._corners) else np.inf
        if np.isfinite(self._thickness):
            moving = v[: self._moving]
            speed = math.sqrt(np.einsum("ij,ij->i", moving, moving).max())
            if self._rotations:
                speed = max(speed, self._rotations.speed(x, v))
            speed, path = 2.0 * speed, TRAVEL * self._thickness
            if path < GROWTH * step * speed or not step > 0.0:
                path = max(path, 0.5 * self._gap(x))
            stop = min(stop, t + path / speed) if speed > 0.0 else stop
        stop = min(stop, t + self.passages.soon(x, v))
        return t + SAME * end if stop - t < SAME * end else stop

    def _gap(self, x):
        """At most the least distance between a body and a node [m]: of balls around bodies and a box around nodes."""
        points, count = self._net.points, self._net.nodes
        nodes = np.ascontiguousarray((points[:count] + x[:count]).T)  # along its rows numpy finds the least sooner
        centres = points[self._rows] + x[self._rows]
        beside = np.maximum(np.maximum(nodes.min(axis=1) - centres, centres - nodes.max(axis=1)), 0.0)
        return float((np.linalg.norm(beside, axis=1) - self._outreach).min())
