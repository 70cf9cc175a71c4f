"""How far a step may go: to the next corner of a table, and not so far that a body passes through something."""

from __future__ import annotations

import numpy as np

from .integrator import SAME

TRAVEL = 0.2
"""Largest share of a body's thickness that anything may move in a step, so that nothing passes through; where bodies
are further away, half of that distance."""


class StepLimits:
    """The limits of steps of one system.

    Parameters
    ----------
    system : refweb.system.system.System
        Its tables of time, and its bodies.
    rotations : refweb.dynamics.integrators.rotations.Rotations, optional
        Bodies that turn.
    """

    def __init__(self, system, rotations=None):
        self._rotations = rotations
        self._net, self._moving = system.net, system.rows - system.net.spins
        self._corners = system.corners
        bodies = system.net.bodies
        self._thickness = min((body.thickness for body in bodies), default=np.inf)
        self._outreach = np.array([body.extent for body in bodies])

    def at_corner(self, t):
        """Whether a table has a corner at a time [s]."""
        at = np.searchsorted(self._corners, t * (1.0 - SAME))
        return at < len(self._corners) and bool(self._corners[at] <= t * (1.0 + SAME))

    def stop(self, t, x, v, end):
        """Time that a step from a state must not pass, on the way to ``end`` [s]; infinite where nothing limits it."""
        ahead = np.searchsorted(self._corners, t * (1.0 + SAME), side="right")
        stop = self._corners[ahead] if ahead < len(self._corners) else np.inf
        if np.isfinite(self._thickness):
            speed = 2.0 * np.sqrt((v[: self._moving] ** 2).sum(axis=1).max())
            if self._rotations:
                speed = max(speed, 2.0 * self._rotations.speed(v))
            way = max(TRAVEL * self._thickness, 0.5 * self._gap(x))
            stop = min(stop, t + way / speed) if speed > 0.0 else stop
        return t + SAME * end if stop - t < SAME * end else stop

    def _gap(self, x):
        """At most the least distance between a body and a node [m]: that of balls around and a box around."""
        net = self._net
        place = net.points + x
        low, high = place[: net.nodes].min(axis=0), place[: net.nodes].max(axis=0)
        middles = place[[body.row for body in net.bodies]]
        apart = np.maximum(np.maximum(low - middles, middles - high), 0.0)
        return (np.linalg.norm(apart, axis=1) - self._outreach).min()
