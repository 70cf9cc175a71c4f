"""Primal–dual interior-point method: equilibria in which many lines go slack, or lines differ much in stiffness.

Newton's method on the energy is slow on a slack net, since each step makes another group of lines taut. The equilibrium
of tension-only lines under dead loads is a cone program. With the extension z of a line, its vector d = B (X + u) and k
= EA/L it reads

    min Σ ½ k z² − f·u,    (L + z, d) in the second-order cone,

and its multipliers are the tension k z and the force on the line. The solver follows the central path by Mehrotra's
predictor and corrector with the scaling of Nesterov and Todd (Andersen, Roos and Terlaky, *Math. Program.* 95 (2003)
249–277, doi:10.1007/s10107-002-0349-3). Its convergence hardly depends on the stiffnesses. The extension and the
multipliers of each line are eliminated. This leaves a positive definite 3 × 3 block in the pattern of the tangent, and
an iteration takes one factorization. The eliminated terms are written as sums of one sign, and the change of
multipliers by W⁻¹ c, to which it is close. In this form the iteration ends at a gap of 1e-14; it stalls at 1e-6 with p
= W c instead, and at 1e-7 with differences of eliminated terms. Nets of 16 to 64 nodes with stiffnesses from 1 : 1 to 1
: 1e6 take 20 to 25 factorizations to 1e-7. A central path in strains, g of taut and w of slack lines with g w = η²,
takes 17 where all lines are alike. It does not converge where stiffnesses are 1 : 1e6.

Lines with a curve count as straight ones of its largest slope here: they go slack in nearly the same places, and from
there Newton's method finds the equilibrium.

May change: all but `by_interior_point`, which `load_steps` and `lowest` call: points of the central path only start
Newton's method, whose residual decides, so that constants change numbers of factorizations. Must stay: counts of all
iterations are added to ``stats``. Tests: ``tests/statics/test_stiffness_ratios.py``.
"""

from __future__ import annotations

import numpy as np

from ..system.factorization import Factor
from .equilibrium import NotFound, add_spent

CENTRED = 0.99
"""Largest step over the step to the surface of the cone."""
FAR = 1e3
"""Residual over the best residual so far at which the iteration ends as diverged."""
SHORT = 0.3
"""Length of a step below which a step without corrector is tried."""
NEAREST = 1e-100
"""Least distance of vectors [m] or [N] from the surface of the cone; below it they lie on the surface by rounding."""


NEARER = 1e-7, 1e-11, 1e-16
"""Distances from the end of the central path at which Newton's method is started, in turn."""


def by_interior_point(newton, t, x):
    """Equilibrium by Newton's method from points of the central path, each nearer to its end than the one before.

    Parameters
    ----------
    newton : refweb.statics.newton.Newton
        Newton's method of a system under dead loads.
    t : float
        Load step.
    x : ndarray, shape (rows, 3)
        Start [m], supports in place.

    Returns
    -------
    refweb.statics.equilibrium.Equilibrium
        Equilibrium with the counts of all iterations in its stats.

    Raises
    ------
    refweb.statics.equilibrium.NotFound
        If Newton's method does not converge from the nearest point either; its stats have the counts of all iterations.
    """
    inner, spent = InteriorPoint(newton.system, t, x, newton.anchors), dict(nsteps=0, nfev=0, njev=0, nlu=0)
    nearer = NEARER if inner.loaded else NEARER[-1:]  # without load all that is left is too much
    for tolerance in nearer:
        start, last = inner.follow(tolerance), tolerance == nearer[-1]
        try:
            state = newton.solve(t, start, warm=True, limit=200 if last else 15)
        except NotFound as error:
            add_spent(spent, error.stats)
            if last:
                error.stats = spent
                raise
        else:
            break
    add_spent(spent, {"nsteps": inner.nlu, "njev": inner.nlu, "nlu": inner.nlu})
    add_spent(state.stats, spent)
    return state


class InteriorPoint:
    """Central path of a net at a load step; its lines are the bars of `Net.bars`.

    Parameters
    ----------
    system : refweb.system.system.System
        With dead loads.
    t : float
        Load step.
    x : ndarray, shape (rows, 3)
        Start [m], supports in place.
    anchors : ndarray of int
        Indices of diagonal entries that are anchored, see `refweb.statics.newton.Newton`.

    Attributes
    ----------
    loaded : bool
        True if a load acts on a free row.
    nlu : int
        Number of factorizations so far.
    """

    def __init__(self, system, t, x, anchors):
        self.system, self.x, self.anchors = system, x.copy(), anchors
        net = system.at(t).net
        self._bars, self._reference = net.bars, net.points
        self._ends = net.weights[:, None] * net.gradients
        self._stiffness = net.per_bar(net.line_data.ea) / net.bar_lengths
        self._natural = net.bar_lengths * (1.0 + net.per_bar(net.slackness))
        outer = (system.force_of(f, t, x) for f in system.terms if not f.balance.internal)
        self._outer = sum(outer, np.zeros((system.rows, 3)))
        load = np.abs(self._outer.ravel()[system.free]).max(initial=0.0)
        self.loaded, self._load = bool(load > 0.0), max(load, np.finfo(float).tiny)
        self._factor, self.nlu = Factor(system.pattern), 0
        self._begin()

    def _begin(self):
        """Set a start inside of the cones: each tension is that of the taut line, at least the largest load."""
        line = self._lines()
        reach = np.linalg.norm(line, axis=1)
        taut = self._stiffness * np.maximum(reach - self._natural, 0.0)
        pull = np.maximum(taut, self._load)
        self._z = np.maximum(pull / self._stiffness, 1.1 * reach - self._natural)
        self._s = np.column_stack([self._natural + self._z, line])
        share = 0.5 * pull / np.maximum(self._natural + self._z, reach)
        self._y = np.column_stack([pull, -share[:, None] * line])

    def _lines(self):
        return self._bars @ (self._reference + self.x)

    def follow(self, tolerance, limit=80):
        """Iterate until the residuals and the gap are below ``tolerance``; return the displacement.

        ``limit`` bounds the iterations of this call. The best displacement so far is returned where they run out or
        diverge.
        """
        best, nearest = np.inf, self._arrange()
        with np.errstate(all="ignore"):  # where rounding has come to the surface, steps may lead anywhere
            for _ in range(limit):
                worst = self._worst()
                if worst < best:
                    best, nearest = worst, self._arrange()
                if worst < tolerance or not worst < FAR * best or not self._go_on():
                    break
        self.x, self._z, self._s, self._y = nearest
        return self.x.copy()

    def _arrange(self):
        return tuple(value.copy() for value in (self.x, self._z, self._s, self._y))

    def _open(self):
        """Residuals of the equations: force at rows [N], tension of bars [N], cone vectors [m]."""
        force = self._outer + self._bars.T @ self._y[:, 1:]
        pull = self._y[:, 0] - self._stiffness * self._z
        return force, pull, np.column_stack([self._natural + self._z, self._lines()]) - self._s

    def _worst(self):
        """Largest residual, or the gap, over loads, lengths and energies [1]."""
        force, pull, apart = self._open()
        scale = max(self._load, self._y[:, 0].max())
        gap = (self._s * self._y).sum()
        energy = (self._natural * self._y[:, 0]).sum()
        return max(
            np.abs(force.ravel()[self.system.free]).max(initial=0.0) / scale,
            np.abs(pull).max() / scale,
            (np.abs(apart).max(axis=1) / self._natural).max(),
            gap / energy,
        )

    def _go_on(self):
        """Iterate once; return True if there was an iteration."""
        if min(_size(self._s).min(), _size(self._y).min()) < NEAREST:
            return False
        scaling = _Scaling(self._s, self._y)
        kept = _Eliminated(scaling, self._stiffness)
        self._factorize(kept.blocks())
        still = self._open()
        mean = (self._s * self._y).sum() / len(self._s)
        shift = -_product(scaling.point, scaling.point)
        step = self._step(scaling, kept, still, shift)
        if step is None:
            return False
        ahead = min(_longest(self._s, step[2]), _longest(self._y, step[3]))
        second = _product(scaling.divide(step[2]), scaling.multiply(step[3]))
        # Where the corrector leads out of the cones at once, towards their middle, without it.
        for share, corrector in (((1.0 - ahead) ** 3, second), (1.0, 0.0)):
            aim = shift - corrector
            aim[:, 0] += share * mean
            step = self._step(scaling, kept, [(1.0 - share) * term for term in still], aim) or step
            length = min(1.0, CENTRED * min(_longest(self._s, step[2], np.inf), _longest(self._y, step[3], np.inf)))
            if length > SHORT:
                break
        if not all(np.isfinite(change).all() for change in step):
            return False
        for value, change in zip((self.x, self._z, self._s, self._y), step, strict=True):
            value += length * change
        return length > 1e-6

    def _factorize(self, blocks):
        """Factorize the matrix of displacements that remains when extensions are eliminated."""
        values = self.system.assemble_lines(self._by_cell(blocks))
        stiffest = values[self.system.pattern.diagonal].max(initial=0.0)
        values[self.anchors] += 1e-10 * stiffest
        values[self.system.pattern.diagonal] += 1e-15 * stiffest
        self._factor.update(values)
        self.nlu += 1

    def _by_cell(self, blocks):
        """Stiffness of each cell from one (3, 3) block per bar."""
        nodes, points = self._ends.shape[1], self._ends.shape[0]
        unit = np.einsum("qa,qb->qab", self._ends, self._ends)
        blocks_all = np.einsum("qab,cqij->caibj", unit, blocks.reshape(-1, points, 3, 3))
        return blocks_all.reshape(-1, 3 * nodes, 3 * nodes)

    def _step(self, scaling, kept, still, shift):
        """Changes of displacement, extension, cone vectors and multipliers; None where the factor breaks down."""
        force, pull, apart = still
        # W⁻¹ ds + W dy = λ \ shift, and ds is the change of (L + z, d) and what they are apart.
        aim = scaling.divide(scaling.solve(shift) - scaling.divide(apart))
        tension = pull + aim[:, 0]
        right = aim[:, 1:] + kept.lifted(tension)
        y = self._factor.solve((force + self._bars.T @ right).ravel()[self.system.free])
        if y is None:
            return None
        move = self.system.rows_of(y)
        turn = self._bars @ move
        longer = kept.extension(tension, turn)
        pulls = np.column_stack([self._stiffness * longer - pull, right - kept.across(turn)])
        return move, longer, np.column_stack([longer, turn]) + apart, pulls


class _Eliminated:
    """Terms of W⁻² = a (2 ŵ ŵᵀ − J), ŵ = (w₀, −w), of a line with eliminated extension, in sums of one sign.

    With k of the line, the pivot of the extension is k − a + 2 a w₀². The block is a across the line, and a (k (2 w₀² −
    1) + a)/(k + a (2 w₀² − 1)) along it, unit vector t = w/|w|.
    """

    def __init__(self, scaling, stiffness):
        self._stiffness, self._first, self._rest = stiffness, scaling.w[:, 0], scaling.w[:, 1:]
        self._across = scaling.ratio**-2
        twice = self._first**2 + (self._rest**2).sum(axis=1)  # 2 w₀² − 1
        self._pivot = stiffness + self._across * twice
        self._along = self._across * (stiffness * twice + self._across) / self._pivot
        size = np.linalg.norm(self._rest, axis=1)
        self._unit = self._rest / np.where(size > 0.0, size, 1.0)[:, None]
        self._lift = 2.0 * self._across * self._first

    def blocks(self):
        """Blocks of the displacements, shape (lines, 3, 3)."""
        along = (self._along - self._across)[:, None, None] * self._unit[:, :, None] * self._unit[:, None, :]
        return along + self._across[:, None, None] * np.eye(3)

    def across(self, vectors):
        """The blocks times vectors."""
        along = ((self._along - self._across) * (self._unit * vectors).sum(axis=1))[:, None] * self._unit
        return along + self._across[:, None] * vectors

    def lifted(self, tension):
        """Force on each line that its tension causes through the eliminated extension."""
        return (tension * self._lift / self._pivot)[:, None] * self._rest

    def extension(self, tension, turn):
        """Change of the extension."""
        return (tension + self._lift * (self._rest * turn).sum(axis=1)) / self._pivot


class _Scaling:
    """The scaling W of Nesterov and Todd between cone vectors s and y: W y = W⁻¹ s, the scaled ``point``."""

    def __init__(self, s, y):
        size, weight = _size(s), _size(y)
        first, second = s / size[:, None], y / weight[:, None]
        between = np.sqrt(0.5 * (1.0 + np.maximum((first * second).sum(axis=1), 1.0)))
        self.w = (first + second * [1.0, -1.0, -1.0, -1.0]) / (2.0 * between)[:, None]
        self.w[:, 0] = np.sqrt(1.0 + (self.w[:, 1:] ** 2).sum(axis=1))
        self.ratio = np.sqrt(size / weight)
        self.point = self.multiply(y)

    def multiply(self, vectors, sign=1.0):
        """W v; with a sign of −1 the same for the mirrored w, which is W⁻¹ v."""
        first, rest = self.w[:, 0], sign * self.w[:, 1:]
        along = (rest * vectors[:, 1:]).sum(axis=1)
        head = first * vectors[:, 0] + along
        tail = vectors[:, 1:] + (vectors[:, 0] + along / (1.0 + first))[:, None] * rest
        factor = self.ratio if sign > 0.0 else 1.0 / self.ratio
        return factor[:, None] * np.column_stack([head, tail])

    def divide(self, vectors):
        """W⁻¹ v."""
        return self.multiply(vectors, -1.0)

    def solve(self, vectors):
        """c with λ ∘ c = v, λ the scaled point."""
        head, tail = self.point[:, 0], self.point[:, 1:]
        along = (tail * vectors[:, 1:]).sum(axis=1)
        first = (head * vectors[:, 0] - along) / _size(self.point) ** 2
        return np.column_stack([first, (vectors[:, 1:] - first[:, None] * tail) / head[:, None]])


def _size(vectors):
    """√(v₀² − |v|²) of vectors within the cone."""
    rest = np.linalg.norm(vectors[:, 1:], axis=1)
    return np.sqrt(np.maximum((vectors[:, 0] - rest) * (vectors[:, 0] + rest), np.finfo(float).tiny))


def _product(a, b):
    """Jordan's product u ∘ v of the second-order cone."""
    head = (a * b).sum(axis=1)
    return np.column_stack([head, a[:, :1] * b[:, 1:] + b[:, :1] * a[:, 1:]])


def _longest(vectors, change, limit=1.0):
    """Largest step, at most ``limit``, that leaves all vectors in their cones."""
    a = change[:, 0] ** 2 - (change[:, 1:] ** 2).sum(axis=1)
    b = vectors[:, 0] * change[:, 0] - (vectors[:, 1:] * change[:, 1:]).sum(axis=1)
    c = _size(vectors) ** 2
    root = np.sqrt(np.maximum(b * b - a * c, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        hit = c / (root - b)  # of a τ² + 2 b τ + c = 0 the smaller positive root
    hit = hit[(root > b) & ((b < 0.0) | (a < 0.0)) & (b * b >= a * c)]
    return float(min(limit, hit.min(initial=np.inf)))
