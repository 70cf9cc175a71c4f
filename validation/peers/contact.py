"""Contact of lines with a ball and with each other, as forces in NumPy.

A line pushes a ball with k (R − d) at its point that is nearest to the centre, at the distance d. Two lines of radius r
whose centre lines cross at the distance h push each other apart with

    K h (4 r² − h²)^(3/2)/(√27 r³)

times the mean of their stretches, length over natural length, shared out to their nodes as by a lever. Near a node, at
the share s of a line of length l, each has W(s l) of it, W(y) = S(y/2r) − S((y − l)/2r), with S(x) = ½ + ¾ x − ¼ x³
from 0 at −1 to 1 at 1, so that lines that continue each other have the whole together. Lines with a common node do not
push each other.
"""

from __future__ import annotations

import numpy as np

SKIN = 0.02
"""Distance within which pairs are searched in advance [m]."""


class Contacts:
    """Contact forces of a `Problem`, with pairs of lines that are near each other kept until nodes have moved on."""

    def __init__(self, problem):
        self.problem, self.searched, self.pairs = problem, None, None

    def search(self, x):
        """Pairs of lines that may touch before a node has moved by half the `SKIN`."""
        from scipy.spatial import cKDTree  # which not every program brings

        ends = x[self.problem.lines]
        half = 0.5 * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).max()
        reach = 2.0 * (half + self.problem.line_radius) + SKIN
        pairs = cKDTree(ends.mean(axis=1)).query_pairs(reach, output_type="ndarray")
        first, second = self.problem.lines[pairs[:, 0]], self.problem.lines[pairs[:, 1]]
        common = (first[:, :, None] == second[:, None, :]).any(axis=(1, 2))
        self.searched, self.pairs = x.copy(), pairs[~common]

    def forces(self, x):
        """Contact forces on nodes, shape (n, 3) [N]."""
        f = np.zeros_like(x)
        if self.problem.ball >= 0:
            push_ball(self.problem, x, f)
        if self.problem.line_stiffness:
            if self.searched is None or np.abs(x - self.searched).max() > 0.25 * SKIN:
                self.search(x)
            push_lines(self.problem, x, self.pairs, f)
        return f


def push_ball(problem, x, f):
    """Add the push of lines and the ball."""
    i, j = problem.lines.T
    along, to = x[j] - x[i], x[problem.ball] - x[i]
    s = np.clip((to * along).sum(axis=1) / (along * along).sum(axis=1), 0.0, 1.0)
    away = s[:, None] * along - to
    distance = np.linalg.norm(away, axis=1)
    near = np.flatnonzero(distance < problem.ball_radius)
    push = (problem.ball_stiffness * (problem.ball_radius / distance[near] - 1.0))[:, None] * away[near]
    np.add.at(f, i[near], (1.0 - s[near])[:, None] * push)
    np.add.at(f, j[near], s[near][:, None] * push)
    f[problem.ball] -= push.sum(axis=0)


def push_lines(problem, x, pairs, f):
    """Add the push of lines on each other."""
    (i, j), (k, m) = problem.lines[pairs[:, 0]].T, problem.lines[pairs[:, 1]].T
    u, w, p = x[j] - x[i], x[m] - x[k], x[i] - x[k]
    normal = np.cross(u, w)
    square, touch = (normal * normal).sum(axis=1), 2.0 * problem.line_radius
    off = (p * normal).sum(axis=1)
    near = np.flatnonzero(off * off < touch**2 * square)
    if not len(near):
        return
    pairs, i, j, k, m, u, w, p, normal = (one[near] for one in (pairs, i, j, k, m, u, w, p, normal))
    square, off = square[near], off[near]
    s, t = (np.cross(w, p) * normal).sum(axis=1) / square, (np.cross(u, p) * normal).sum(axis=1) / square
    long, wide = np.linalg.norm(u, axis=1), np.linalg.norm(w, axis=1)
    share = window(s, long, touch) * window(t, wide, touch)
    share *= 0.5 * (long / problem.natural[pairs[:, 0]] + wide / problem.natural[pairs[:, 1]])
    high = np.abs(off) / np.sqrt(square)
    push = problem.line_stiffness * high * (touch**2 - high**2) ** 1.5 / (np.sqrt(27.0) * problem.line_radius**3)
    push = (share * push * np.sign(off) / np.sqrt(square))[:, None] * normal
    for nodes, part in ((i, 1.0 - s), (j, s), (k, t - 1.0), (m, -t)):
        np.add.at(f, nodes, part[:, None] * push)


def window(s, length, touch):
    """W of lines of a length at the shares s."""
    near, far = (np.clip(y / touch, -1.0, 1.0) for y in (s * length, (s - 1.0) * length))
    return (0.75 * near - 0.25 * near**3) - (0.75 * far - 0.25 * far**3)
