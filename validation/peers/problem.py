"""A cable net as arrays, which every program is given: no program of another is needed to read it."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields

import numpy as np


@dataclass(frozen=True)
class Problem:
    """A net of lines that carry tension only, T = EA max(0, l/L − 1), and what is done to it.

    Parameters
    ----------
    points : ndarray
        Positions of nodes in the plan of the net, shape (n, 3) [m].
    lines : ndarray
        Nodes of each line, shape (c, 2).
    natural : ndarray
        Natural lengths, shape (c,) [m].
    supports : ndarray
        Nodes that do not move, shape (s,).
    ea : float
        Axial stiffness [N].
    density : float
        Mass of lines per length [kg/m]; half of a line's mass is at each of its nodes.
    node : int
        The node that is loaded or thrown.
    loads : ndarray
        Forces along z at that node, one after another, shape (k,) [N].
    mass, speed : float
        A point mass there [kg], and its velocity along z at first [m/s].
    duration : float
        End of the motion [s].
    draws : ndarray
        Velocities in place of that one, one motion each, shape (k,) [m/s].
    dish : float
        Depth of a bowl that a program begins its search from [m]; 0 is flat.
    folded : ndarray
        Positions at the start of a motion, where they are not those of the plan, shape (n, 3) [m].
    weights : ndarray
        Point masses at nodes, shape (n,) [kg].
    thrown : ndarray
        Velocities of nodes at first, in place of that of one node, shape (n, 3) [m/s].
    ball : int
        Node that is the centre of a free ball; −1 without.
    ball_radius, ball_stiffness : float
        Distance from its centre at which lines touch it [m], and the push over the depth [N/m], see
        `validation.peers.contact`.
    line_radius, line_stiffness : float
        Radius of lines for each other [m], and stiffness of their contact [N/m]; 0 is no contact.
    """

    points: np.ndarray
    lines: np.ndarray
    natural: np.ndarray
    supports: np.ndarray
    ea: float
    density: float
    node: int
    loads: np.ndarray = ()
    mass: float = 0.0
    speed: float = 0.0
    duration: float = 0.0
    draws: np.ndarray = ()
    dish: float = 0.0
    folded: np.ndarray = ()
    weights: np.ndarray = ()
    thrown: np.ndarray = ()
    ball: int = -1
    ball_radius: float = 0.0
    ball_stiffness: float = 0.0
    line_radius: float = 0.0
    line_stiffness: float = 0.0

    @classmethod
    def load(cls, path):
        """The problem of a file."""
        with np.load(path) as stored:
            return cls(
                **{f.name: stored[f.name] if stored[f.name].ndim else stored[f.name].item() for f in fields(cls)}
            )

    def save(self, path):
        """Write the problem to a file."""
        np.savez(path, **asdict(self))

    @property
    def free(self):
        """Whether each node can move, shape (n,)."""
        free = np.ones(len(self.points), dtype=bool)
        free[self.supports] = False
        return free

    @property
    def point_masses(self):
        """Masses at nodes beside those of lines [kg], shape (n,)."""
        masses = np.zeros(len(self.points))
        masses[self.node] = self.mass
        return masses + self.weights if len(self.weights) else masses

    @property
    def masses(self):
        """Mass of each node [kg], shape (n,): halves of its lines, and point masses."""
        halves = np.repeat(0.5 * self.density * self.natural, 2)
        return np.bincount(self.lines.ravel(), halves, len(self.points)) + self.point_masses

    @property
    def velocities(self):
        """Velocities of nodes at first, shape (n, 3) [m/s]."""
        if len(self.thrown):
            return self.thrown.copy()
        velocities = np.zeros_like(self.points)
        velocities[self.node, 2] = self.speed
        return velocities

    @property
    def start(self):
        """Positions that a motion, or a search for an equilibrium, begins with, shape (n, 3) [m].

        Those of a search are a paraboloid within the rim.
        """
        if len(self.folded):
            return self.folded.copy()
        middle = self.points[self.node, :2]
        distance = np.linalg.norm(self.points[:, :2] - middle, axis=1)
        height = self.dish * (1.0 - (distance / distance.max()) ** 2)
        return self.points + np.where(self.free, height, 0.0)[:, None] * [0.0, 0.0, 1.0]

    def tensions(self, positions):
        """Tension of each line [N] at positions of the nodes, shape (c,)."""
        across = positions[self.lines[:, 1]] - positions[self.lines[:, 0]]
        return self.ea * np.maximum(0.0, np.linalg.norm(across, axis=1) / self.natural - 1.0)

    def forces(self, positions):
        """Force of the lines on each node [N], shape (n, 3)."""
        across = positions[self.lines[:, 1]] - positions[self.lines[:, 0]]
        length = np.linalg.norm(across, axis=1)
        pull = (self.ea * np.maximum(0.0, 1.0 / self.natural - 1.0 / length))[:, None] * across
        ends, count = self.lines.T, len(positions)
        return np.column_stack(
            [np.bincount(ends[0], pull[:, k], count) - np.bincount(ends[1], pull[:, k], count) for k in range(3)]
        )
