"""Primal–dual interior point: equilibria in which many lines go slack.

Where a net is slack, Newton's method on the energy meets one group of lines after another that snaps taut under its
step. With g the taut strain of a line (T = EA g) and w its slack, the law is the complementarity

    ε(x) = g − w,   g ≥ 0,   w ≥ 0,   g w = 0,

and with g w = η² it is the smooth law of the same η: smoothing is the central path. Here g and w are unknowns of their
own. The Newton matrix is Σ (EA/L) g/(g + w) t⊗t + (EA g/l)(I − t⊗t), positive definite all along; steps are
Mehrotra's predictor and corrector on one factorization. Square, triangle and hexagon webs of 20 × 20 cells, 5 % too
long, under a centre load or their weight, take 12 to 20 factorizations; Newton through decades of smoothing takes 45 to
250 and fails on some.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..effects.elasticity import strains
from ..net.net import AXIAL_STIFFNESS, LENGTH
from ..system.factorization import Factor


class Point(NamedTuple):
    """What the lines are at a displacement, and how far from an equilibrium.

    ``length`` [m] and unit ``direction`` of each line, ``mismatch`` ε(x) − g + w, ``force`` on every row [N], and the
    ``product`` g w.
    """

    length: np.ndarray
    direction: np.ndarray
    mismatch: np.ndarray
    force: np.ndarray
    product: np.ndarray


class Step(NamedTuple):
    """Changes of displacement [m], of g (``taut``) and of w (``slack``), and the largest move of a line over it."""

    move: np.ndarray
    taut: np.ndarray
    slack: np.ndarray
    turn: float


class InteriorPoint:
    """One load step of a net, followed along the central path; the lines of it are the bars of `Net.bars`.

    Parameters
    ----------
    system : refweb.system.system.System
        With dead loads.
    t : float
        Load step.
    x : ndarray, shape (rows, 3)
        Start [m], supports in place.
    anchors : ndarray of int
        Places of the pattern's diagonal to hold, see `refweb.statics.newton.Newton`.
    """

    def __init__(self, system, t, x, anchors):
        self.system, self.x, self.anchors = system, x.copy(), anchors
        self._net, points = system.at(t).net, len(system.net.weights)
        net = self._net
        self.bars = net.bars
        self.axial = np.repeat(net.line_data[:, AXIAL_STIFFNESS], points)
        self.natural = np.tile(net.weights, len(net.cells)) * np.repeat(net.line_data[:, LENGTH], points)
        self._ends = net.weights[:, None] * net.gradients
        self.outer = sum(system.force_of(f, t, x) for f in system.families if not f.internal)
        self.load = np.abs(self.outer).max()
        self.factor, self.nlu = Factor(system.pattern), 0
        strain = self._strain()
        start = min(max((self.load / self.axial.max()) ** (2 / 3), 1e-12), 1e-1)
        self.g = np.maximum(strain, 0.0) + start
        self.w = np.maximum(self.g - strain, start)
        self._blocked = False

    def _strain(self):
        net = self._net
        return (strains(net, self.x) - net.slackness[:, None]).ravel()

    def _resultant(self, g, direction):
        """Force on every row of the tensions EA g."""
        return -(self.bars.T @ ((self.axial * g)[:, None] * direction))

    def _factorize(self, direction, length):
        """Factorize the Newton matrix, each time it is asked for one stiffer across the elements."""
        along = self.axial / self.natural * self.g / (self.g + self.w)
        ridge = 0.0
        for _ in range(20):
            across = self.axial * np.maximum(self.g, ridge) / length
            block = (along - across)[:, None, None] * direction[:, :, None] * direction[:, None, :]
            block += across[:, None, None] * np.eye(3)
            values = self.system.assemble_lines(self._by_cell(block))
            values[self.anchors] += 1e-10 * np.max(self.axial / self.natural)
            self.factor.update(values)
            self.nlu += 1
            yield
            ridge = max(10.0 * ridge, 1e-10 * self.g.max())

    def _by_cell(self, blocks):
        """Stiffness of each cell from one (3, 3) block per bar."""
        nodes, points = self._ends.shape[1], self._ends.shape[0]
        unit = np.einsum("qa,qb->qab", self._ends, self._ends)
        whole = np.einsum("qab,cqij->caibj", unit, blocks.reshape(-1, points, 3, 3))
        return whole.reshape(-1, 3 * nodes, 3 * nodes)

    def follow(self, tolerance, most=80):
        """Go on until residual, strain mismatch and complementarity are below ``tolerance``; return the displacement.

        ``most`` bounds the iterations of this call; where they run out the last displacement is returned.
        """
        for _ in range(most):
            here = self._point()
            if self._worst(here) < tolerance:
                break
            step = self._predictor(here)
            if step is None:
                break
            a, mean = self._length(step, 1.0), here.product.mean()
            ahead = ((self.g + a * step.taut) * (self.w + a * step.slack)).mean()
            centring = 10.0 if self._blocked else min(max((ahead / mean) ** 3, 1e-4), 0.8)
            step = self._step(here, centring * mean - a * a * step.taut * step.slack) or step
            a = self._length(step, 0.95)
            self._blocked = a < 0.2
            self.x += a * step.move
            self.g += a * step.taut
            self.w += a * step.slack
        return self.x

    def _point(self):
        """The `Point` of the last displacement."""
        line = self.bars @ (self.system.net.points + self.x)
        length = np.maximum(np.linalg.norm(line, axis=1), 1e-3 * self.natural)
        direction = line / length[:, None]
        mismatch = self.w - self.g + self._strain()
        return Point(length, direction, mismatch, self.outer + self._resultant(self.g, direction), self.g * self.w)

    def _worst(self, here):
        """Largest of residual, strain mismatch and complementarity [1]."""
        scale = max(self.load, (self.axial * self.g).max())
        return max(
            np.abs(here.force.ravel()[self.system.free]).max(initial=0.0) / scale,
            np.abs(here.mismatch).max(),
            here.product.max() / max(self.g.max() ** 2, np.finfo(float).tiny),
        )

    def _predictor(self, here):
        """Step towards g w = 0, by the first matrix that gives one; None where none does."""
        for _ in self._factorize(here.direction, here.length):
            step = self._step(here, 0.0)
            if step is not None:
                return step
        return None

    def _step(self, here, target):
        """The `Step` towards g w = ``target``, by the factorization at hand; None where there is none."""
        fixed = (target - here.product + self.g * here.mismatch) / (self.g + self.w)
        y = self.factor.solve((here.force + self._resultant(fixed, here.direction)).ravel()[self.system.free])
        if y is None:
            return None
        move = np.zeros((self.system.rows, 3))
        move.ravel()[self.system.free] = y
        turn = self.bars @ move
        stretch = np.einsum("ci,ci->c", here.direction, turn) / self.natural
        taut = fixed + self.g / (self.g + self.w) * stretch
        return Step(move, taut, taut - stretch - here.mismatch, (np.linalg.norm(turn, axis=1) / self.natural).max())

    def _length(self, step, share):
        """Step length that keeps g and w positive and no line moving by more than its length."""
        a = min(1.0, 1.0 / step.turn) if step.turn > 0.0 else 1.0
        for value, change in ((self.g, step.taut), (self.w, step.slack)):
            down = change < 0.0
            if down.any():
                a = min(a, share * (value[down] / -change[down]).min())
        return a
