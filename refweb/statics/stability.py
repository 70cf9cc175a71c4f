"""Whether an equilibrium is stable: whether a small disturbance of it grows by itself.

With K = −∂f/∂x, C = −∂f/∂v and the mass M, disturbances are those of

    M u'' + C u' + K u = 0,        u = φ exp(s t),        (s² M + s C + K) φ = 0,

and the equilibrium is left by itself where some s has a positive real part.

Where K is symmetric and no frame turns, that is where K has a negative eigenvalue, whatever M and losses are: the signs
of the pivots of LDLᵀ say so. Follower loads and wind have no potential, and their K is not symmetric:

- divergence: a real negative eigenvalue of K φ = λ M φ. There is one wherever the determinant of K is negative, and
  none where the symmetric part S = (K + Kᵀ)/2 is positive definite (Bendixson).
- flutter: a pair of complex λ, of which one square root has a positive real part. C may hold it [1]_.

In a frame that turns Coriolis forces may hold what K does not, as long as nothing damps motion in the frame.

Of up to `DENSE` unknowns with mass all s are found. Of more, the slowest are, by Arnoldi iteration on K⁻¹, whose start
has a fixed seed. What is left is bounded with S positive definite and A = (K − Kᵀ)/2:

    α = ‖S^(−1/2) A M^(−1/2)‖,        Re s ≤ α/2 for symmetric C ≥ 0,        Re s < 0 for symmetric C > α M,

the latter as all roots of s² + c s + k + i a lie to the left where c > 0 and c² k > a².

Unknowns without mass follow the others; forces that depend on their velocity are left out. Eigenvalues have errors from
rounding, by their condition numbers: what is within these counts as none.

References
----------
.. [1] V. V. Bolotin, "Nonconservative Problems of the Theory of Elastic Stability", Pergamon 1963, chapter 1.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.linalg
from scipy.sparse import triu

from ..net.net import AXIAL_STIFFNESS
from ..system.factorization import Factor, Lu, negative_pivots
from .critical_speed import drifting

TINY = 1e-12
"""Tension of all lines over EA by which the smallest pivot is moved, that of a direction without stiffness."""
DENSE = 150
"""Unknowns with mass up to which all s are found."""
ROUNDING = 64.0 * np.finfo(float).eps
"""Error of a matrix over its norm."""
NO_RATE = 1e-9
"""Rate of growth over that of the slowest vibration that counts as none."""

class Stability(NamedTuple):
    """What is known of the stability of an equilibrium.

    Attributes
    ----------
    sign : {-1, 0, 1, None}
        −1 where K has what drives the web away or a disturbance grows, 0 where some direction has no stiffness to
        rounding, 1 where the equilibrium is stable, None where that is not decided.
    why : str
        Of −1 what drives it away, of None what is missing, in words.
    held : bool
        Whether Coriolis forces hold what K does not, as long as nothing damps motion in the frame.
    """

    sign: int | None
    why: str = ""
    held: bool = False


PIVOT = "a pivot of its tangent is negative"
EIGENVALUE = "an eigenvalue of its tangent is negative"
STABLE = Stability(1)


def ask(system, rest, state, solver=None):
    """Write the `Stability` of an equilibrium to it, and whether it may have others; see `stability`."""
    from .other_side import may_turn_over

    state.stability = stability(system, rest, state, solver)
    if not rest.convex:
        state.stats["smallest_pivot"] = state.stability.sign
    state.may_turn_over = may_turn_over(rest, state)


def stability(system, rest, state, solver=None):
    """The `Stability` of an equilibrium.

    Parameters
    ----------
    system : refweb.system.system.System
        With all that acts, also what depends on velocity alone.
    rest : refweb.system.system.System
        As statics sees it, see `refweb.system.at_rest`.
    state : refweb.statics.equilibrium.Equilibrium
        Where it is; ``smallest_pivot`` in its stats, where it stands there, is not asked for again.
    solver : refweb.system.factorization.Lu, optional
        Of the tangent there, but for rounding.
    """
    if not len(rest.free) or (rest.convex and not rest.rotating):
        return STABLE
    question = Question(system, rest, state.step, state.x)
    if question.symmetric:
        sign = state.stats.get("smallest_pivot")
        sign = question.smallest_pivot() if sign is None else sign
        if sign != -1 or not rest.rotating:
            return Stability(sign, PIVOT if sign == -1 else "")
        return question.in_frame(PIVOT)
    return question.unsymmetric(solver)


class Question:
    """K, M and C at an equilibrium.

    Parameters
    ----------
    system, rest : refweb.system.system.System
        As in `stability`.
    t : float
        Load step, or time.
    x : ndarray, shape (rows, 3)
        Displacement [m].
    """

    def __init__(self, system, rest, t, x):
        self.system, self.rest, self.t, self.x = system, rest, t, x
        self._values = rest.stiffness(t, x)
        self.K = rest.pattern.matrix(self._values)
        across = self.K.T.tocsc()
        across.sort_indices()
        self._half = 0.5 * (self._values + across.data)  # of a pattern that is symmetric
        self._skew = 0.5 * (self._values - across.data)
        self.symmetric = abs(self._skew).max(initial=0.0) <= ROUNDING * abs(self._values).max(initial=0.0)
        net = rest.at(t).net
        axial = net.line_data[:, AXIAL_STIFFNESS] / net.natural_length
        self._ridge = TINY * rest.assemble_lines(net.unit_tension * axial[:, None, None])
        for part in rest.unsupported_parts:  # which no pivot is to be 0 for
            self._ridge[rest.pattern.diagonal[part.unknowns]] += 1e-10 * axial.max()
        self._drifting = drifting(rest) if rest.rotating else 0
        self._factor = Factor(rest.pattern)

    def smallest_pivot(self):
        """Sign of the smallest pivot of S: −1, 0 where it is 0 to rounding, 1."""
        for shift, sign in ((-1.0, 1), (1.0, 0)):
            self._factor.update(self._half + shift * self._ridge)
            if self._factor.negative_pivots() <= self._drifting:
                return sign
        return -1

    # Matrices of the unknowns with mass

    def _massive(self):
        """Which unknowns have mass, shape (n,)."""
        return self.rest.mass.values[self.rest.pattern.diagonal] > 0.0

    def _velocity(self):
        """C of the unknowns, a sparse matrix; None where no force depends on velocity."""
        values = self.system.damping(self.t, self.x, np.zeros_like(self.x))
        if values is None or not values.any():
            return None
        of = np.searchsorted(self.system.free, self.rest.free)
        return self.system.pattern.matrix(values)[of][:, of].tocsc()

    def _reduced(self):
        """K and C of the unknowns with mass, over the roots of that, dense; and whether those without stand by
        themselves."""
        heavy, K, C = self._massive(), self.K.toarray(), self._velocity()
        if not heavy.any():
            return K, None, False
        inner = K[~heavy][:, ~heavy]
        own, stands = K[heavy][:, heavy], True
        if inner.size:
            try:
                own = own - K[heavy][:, ~heavy] @ np.linalg.solve(inner, K[~heavy][:, heavy])
                stands = not _negative(*_eigenvalues(inner)).any()
            except np.linalg.LinAlgError:
                stands = False
        M = self.rest.pattern.matrix(self.rest.mass.values)[heavy][:, heavy].toarray()
        root = scipy.linalg.cholesky(M, lower=True)

        def scaled(matrix):
            half = scipy.linalg.solve_triangular(root, matrix, lower=True)
            return scipy.linalg.solve_triangular(root, half.T, lower=True).T

        return scaled(own), None if C is None else scaled(C.toarray()[heavy][:, heavy]), stands

    # Answers

    def in_frame(self, what):
        """Of a K that does not hold the web in a frame that turns."""
        if self._massive().sum() > DENSE:
            return Stability(-1, f"{what}; Coriolis forces are not taken into account")
        K, C, _ = self._reduced()
        growth = _growth(K, C)
        return Stability(-1, what) if growth > 0.0 else Stability(-1, what, held=True)

    def unsymmetric(self, solver):
        """Of a K that is not symmetric."""
        definite = self.smallest_pivot()
        massive = int(self._massive().sum())
        if massive > DENSE:
            return self._of_many(definite, solver)
        K, C, stands = self._reduced()
        found, off = _eigenvalues(K)
        negative = 0 if definite >= 0 else int(_negative(found, off).sum())
        if negative > self._drifting:
            turned = bool(self.rest.rotating) and C is not None
            return self.in_frame(EIGENVALUE) if turned and not negative % 2 else Stability(-1, EIGENVALUE)
        if not massive:
            if definite < 0 and not stands:
                return Stability(None, "nothing that moves has mass")
            return Stability(definite)
        if not stands and definite < 0:
            return Stability(None, "nodes without mass are not held by their lines alone")
        if (growth := _growth(K, C)) > 0.0:
            return Stability(-1, _flutter(growth))
        return Stability(1 if (abs(found) > off).all() else 0)

    def _of_many(self, definite, solver):
        """The same of more unknowns than have all their s found: of the slowest ones, and by bounds on the others."""
        from scipy.sparse.linalg import ArpackError

        from .slowest_vibrations import coupling, slowest

        if solver is None:
            solver = Lu(self.rest.pattern)
            solver.update(self._values + self._ridge)
        if (sign := solver.sign_of_determinant()) < 0 and definite < 0:
            return Stability(-1, EIGENVALUE)
        if not sign:
            return Stability(None, "its tangent is singular to rounding")
        M, C = self.rest.pattern.matrix(self.rest.mass.values), self._velocity()
        try:
            slow = slowest(solver, M, C)
        except ArpackError as error:
            return Stability(None, f"its slowest vibrations are not found ({error})")
        if slow.grows.any():
            grown = slow.s[slow.grows]
            turns = (abs(grown.imag) > NO_RATE * abs(grown)).all()
            return Stability(-1, _flutter(grown.real.max()) if turns else EIGENVALUE)
        rest = f"the {len(slow.s)} slowest of its vibrations do not grow"
        if definite < 1 or not self._bounded(C):
            return Stability(None, f"{rest}, the others are too many to be asked")
        alpha = coupling(self._factor.precondition, self.rest.pattern.matrix(self._skew), M)
        if self._damps(C, alpha, M) or 0.5 * alpha <= NO_RATE * abs(slow.s).min():
            return STABLE
        return Stability(None, f"{rest}, and no other one by more than {0.5 * alpha:.2g} 1/s")

    def _bounded(self, C):
        """Whether bounds on the growth of all vibrations hold: of lumped mass, which nothing lacks, and symmetric C."""
        passive = C is None or abs(C - C.T).max() <= ROUNDING * abs(C).max()
        return passive and self._massive().all() and self.rest.net.consistent_minus_lumped is None

    def _damps(self, C, alpha, M):
        """Whether C > α M, so that nothing grows."""
        return C is not None and negative_pivots(triu(C - alpha * M, format="csc"), self.rest.library) == 0


def _flutter(growth):
    """What a vibration that grows is called."""
    return f"flutter: a vibration grows, by {growth:.2g} 1/s"


def _eigenvalues(A):
    """Eigenvalues of a matrix, and what rounding may make of each, to first order."""
    found, before, behind = scipy.linalg.eig(A, left=True, right=True)
    overlap = abs((before.conj() * behind).sum(axis=0))  # of unit vectors: 1 over the condition number
    least = np.finfo(float).eps
    return found, ROUNDING * np.linalg.norm(A) / np.maximum(overlap, least)


def _negative(found, off):
    """Which eigenvalues are real and negative."""
    return (found.real < -off) & (abs(found.imag) <= off)


def _growth(K, C):
    """Largest real part of s [1/s], of unit masses; 0 where none is positive beyond rounding."""
    found, off = _eigenvalues(K)
    if C is None:
        complex_ = abs(found.imag) > off
        grows = complex_ | (found.real < -off)
        return float(abs(np.sqrt(-found[grows] + 0j).real).max(initial=0.0))
    scale = np.sqrt(np.linalg.norm(K)) + np.linalg.norm(C)
    if scale == 0.0:
        return 0.0
    size = len(K)
    found, off = _eigenvalues(np.block([[np.zeros_like(K), np.eye(size)], [-K / scale**2, -C / scale]]))
    return scale * float(found.real[found.real > off].max(initial=0.0))
