"""Stability of equilibria: check if a small disturbance grows.

With K = −∂f/∂x, C = −∂f/∂v and the mass M, small disturbances u satisfy

    M u'' + C u' + K u = 0,        u = φ exp(s t),        (s² M + s C + K) φ = 0,

and the equilibrium is unstable if some s has a positive real part.

If K is symmetric and no frame rotates, this is so if K has a negative eigenvalue, for all M and losses; the signs of
the pivots of LDLᵀ tell. Follower loads and wind have no potential, and their K is not symmetric:

- divergence: a real negative eigenvalue of K φ = λ M φ. There is one wherever the determinant of K is negative, and
  none where the symmetric part S = (K + Kᵀ)/2 is positive definite (Bendixson).
- flutter: a pair of complex λ, of which one square root has a positive real part. C may prevent it [1]_.

In a rotating frame, Coriolis forces may stabilise an equilibrium whose K is indefinite. Damping in the frame ends this.

Up to `DENSE` unknowns all s are found. Of more unknowns only the slowest s are found, by Arnoldi iteration on K⁻¹ with
a fixed seed; the answer says that the others are not known. Let S be positive definite and A = (K − Kᵀ)/2. Then nothing
grows if C is symmetric and

    C > α M,        α = ‖S^(−1/2) A M^(−1/2)‖,

since both roots of s² + c s + k + i a have negative real parts where c > 0 and c² k > a². Drag in wind satisfies this
if the wind is slower than transverse waves of the lines.

Unknowns without mass follow the others; forces that depend on their velocity are left out. If no unknown has mass, all
get the same mass, and flutter is not checked: the parity of the number of divergent modes depends on no mass. Rounding
errors of eigenvalues follow from their condition numbers; parts within these errors count as zero. Lines between slack
and taut count as taut. If the web would be unstable with these lines slack, its stability is not decided.

May change: words of reasons (`PIVOT`, `EIGENVALUE`), `DENSE`, private methods. The other constants are limits of
rounding: larger ones leave more undecided, smaller ones may be wrong. Must stay: `ask`, which `load_steps` and
`simulation` call; the sign, which stands in ``run.json`` as ``smallest_pivot``, is 1 only if stability is certain, and
None where it is not decided. `remarks` puts reasons into findings. Tests: ``tests/statics/test_stability.py``.

References
----------
.. [1] V. V. Bolotin, "Nonconservative Problems of the Theory of Elastic Stability", Pergamon 1963, chapter 1.
"""

from __future__ import annotations

import contextlib
from functools import cached_property

import numpy as np

from ..system.factorization import Factor, Lu, negative_pivots
from .equilibrium import Stability

TINY = 1e-12
"""Tension of all lines over EA whose stiffness counts as zero in the sign of the smallest pivot."""
HELD = 1e-10
"""Stiffness that anchors parts without support, over the largest EA/L."""
DENSE = 100
"""Unknowns up to which all s are found."""
KINK = 1e-12
"""Strain within which a tension-only line counts as between slack and taut."""
ROUNDING = 64.0 * np.finfo(float).eps
"""Error of a matrix over its norm."""
PIVOT, EIGENVALUE = "a pivot of its tangent is negative", "an eigenvalue of its tangent is negative"
"""Reasons for a sign of −1."""
NO_RATE = 1e-9
"""Imaginary part of s over its size up to which it counts as zero."""
OPEN = 1e3
"""λ of the slowest vibration, over `TINY` times that of the fastest, up to which it may have no stiffness."""


def ask(system, rest, state, solver=None):
    """Set the stability of an equilibrium, and whether there may be other equilibria.

    Parameters
    ----------
    system, rest : refweb.system.system.System
        The whole system, and the system of statics, see `refweb.system.static_system`.
    state : Equilibrium
        The equilibrium; the sign of its smallest pivot is not computed again if it is in its stats.
    solver : refweb.system.factorization.Lu, optional
        Factorization of the tangent if that is not symmetric.
    """
    sign = state.stats.get("smallest_pivot")
    if sign is None or (sign == -1 and rest.rotating):
        state.stability = Question(system, rest, state).answer(solver)
    else:
        state.stability = by_pivot(sign)
    _ask_of_kinks(system, rest, state)
    state.stats["smallest_pivot"] = state.stability.sign
    if rest.net.law_is("bar").any():
        from .snap_through import may_turn_over

        state.may_turn_over = may_turn_over(rest, state)


def _ask_of_kinks(system, rest, state):
    """Leave the stability undecided if it depends on lines between slack and taut, which count as taut."""
    rest = rest.at(state.step)
    net, numbers = rest.net, rest.net.line_data.copy()
    strain = np.linalg.norm(net.bar_vectors(state.x), axis=1) / net.bar_lengths - 1.0
    kinks = abs(strain - net.per_bar(net.slackness)).reshape(len(net.cells), -1).min(axis=1)
    kinked = ~(net.law_is("smoothed") | net.law_is("bar") | net.forming) & (kinks <= KINK)
    if state.stability.sign not in (0, 1) or not kinked.any():
        return
    numbers.natural_length[kinked] *= 1.0 + 4.0 * KINK
    if Question(system, rest.with_line_data(numbers), state).answer().sign == -1:
        why = f"{np.count_nonzero(kinked)} elements are between slack and taut, and slack they would not hold it"
        state.stability = Stability(None, why, loose=True)


def by_pivot(sign):
    """The `Stability` by the sign of the smallest pivot of a symmetric tangent."""
    return Stability(sign, PIVOT if sign == -1 else "", loose=sign < 1)


class Question:
    """Analysis of the stability of an equilibrium; matrices are assembled when they are needed.

    Parameters
    ----------
    system : refweb.system.system.System
        The whole system, with forces that depend on velocity.
    rest : refweb.system.system.System
        The system of statics, see `refweb.system.static_system`.
    state : refweb.statics.equilibrium.Equilibrium
        The equilibrium.
    """

    def __init__(self, system, rest, state):
        self.system, self.rest, self.state, self.t, self.x = system, rest, state, state.step, state.x
        self._drifting, self._factor = 0, Factor(rest.pattern)
        if rest.rotating:
            from .critical_speed import drifting

            self._drifting = drifting(rest)

    def answer(self, solver=None):
        """The `refweb.statics.equilibrium.Stability`.

        ``solver`` is the `refweb.system.factorization.Lu` of K, if there is one already.
        """
        if not len(self.rest.free):
            return Stability(1)
        if not (self.rest.symmetric or self._symmetric):
            return self._unsymmetric(solver)
        if self.definite == -1 and self.rest.rotating:
            return self._in_frame(PIVOT)._replace(loose=True)
        return by_pivot(self.definite)

    @cached_property
    def _parts(self):
        """Values of K, of S and of A in the pattern."""
        values = self.rest.stiffness(self.t, self.x)
        across = self.rest.pattern.matrix(values).T.tocsc().data  # of a pattern that is symmetric
        return values, 0.5 * (values + across), 0.5 * (values - across)

    @property
    def _symmetric(self):
        """Tell if K is symmetric up to rounding."""
        values, _, skew = self._parts
        return abs(skew).max(initial=0.0) <= ROUNDING * abs(values).max(initial=0.0)

    @cached_property
    def _ridge(self):
        """Values of a stiffness that counts as zero, in the pattern."""
        rest, net = self.rest, self.rest.at(self.t).net
        axial = net.axial / net.natural_length
        ridge = TINY * rest.at(self.t).across_lines(net.axial)
        for part in rest.unsupported_parts:  # which no pivot is to be 0 for
            ridge[rest.pattern.diagonal[part.unknowns]] += HELD * axial.max()
        return ridge

    @cached_property
    def definite(self):
        """Sign of the smallest pivot of S: −1, 0 where it is 0 to rounding, 1."""
        for shift, sign in ((-1.0, 1), (1.0, 0)):
            self._factor.update(self._parts[1] + shift * self._ridge)
            if self._factor.negative_pivots() <= self._drifting:
                return sign
        return -1

    # Matrices of the unknowns with mass

    def _massive(self):
        """Mask of the unknowns with mass, shape (n,)."""
        return self.rest.mass_at(self.x)[self.rest.pattern.diagonal] > 0.0

    def _velocity(self):
        """C of the unknowns, a sparse matrix; None where no force depends on velocity."""
        values = self.system.damping(self.t, self.x, np.zeros_like(self.x))
        if values is None or not values.any():
            return None
        of = np.searchsorted(self.system.free, self.rest.free)
        C = self.system.pattern.matrix(values)[of][:, of].tocsc()
        return C @ self.rest.carriers.momenta(self.rest, self.x) if self.rest.angles else C

    def _reduced(self):
        """Dense K and C of unknowns with mass, scaled by roots of mass; True if unknowns without mass are stable."""
        import scipy.linalg

        heavy, K, C = self._massive(), self.rest.pattern.matrix(self._parts[0]).toarray(), self._velocity()
        if not heavy.any():
            return K, None, False
        inner = K[~heavy][:, ~heavy]
        block, stands = K[heavy][:, heavy], True
        if inner.size:
            try:
                block = block - K[heavy][:, ~heavy] @ np.linalg.solve(inner, K[~heavy][:, heavy])
                stands = not _negative(*_eigenvalues(inner)).any()
            except np.linalg.LinAlgError:
                stands = False
        M = self.rest.pattern.matrix(self.rest.mass_at(self.x))[heavy][:, heavy].toarray()
        root = scipy.linalg.cholesky(M, lower=True)

        def scaled(matrix):
            half = scipy.linalg.solve_triangular(root, matrix, lower=True)
            return scipy.linalg.solve_triangular(root, half.T, lower=True).T

        return scaled(block), None if C is None else scaled(C.toarray()[heavy][:, heavy]), stands

    # Answers

    def _in_frame(self, what):
        """Stability in a rotating frame whose K is indefinite; ``what`` is the reason in words."""
        if len(self.rest.free) > DENSE:
            slow = self._slowest(self._lu, self._velocity())
            grows = slow is not None and slow.grows.any()
            return Stability(-1, what if grows else f"{what}; whether Coriolis forces hold the web is not decided")
        K, C, _ = self._reduced()
        growth = _growth(K, C)
        return Stability(-1, what) if growth > 0.0 else Stability(-1, what, gyroscopic=True)

    def _unsymmetric(self, solver):
        """Stability with a K that is not symmetric."""
        if len(self.rest.free) > DENSE:
            return self._of_many(solver)
        K, C, stands = self._reduced()
        values, off = _eigenvalues(K)
        loose = not (stands and (abs(values) > off).all())
        negative = 0 if self.definite >= 0 else int(_negative(values, off).sum())
        if negative > self._drifting:
            turned = bool(self.rest.rotating) and C is not None and not negative % 2
            return (self._in_frame(EIGENVALUE) if turned else Stability(-1, EIGENVALUE))._replace(loose=loose)
        if self.definite < 0 and not stands:
            return Stability(None, "nodes without mass may not be held by their lines", loose=True)
        if self._massive().any() and (growth := _growth(K, C)) > 0.0:
            return Stability(-1, _flutter(growth), loose=loose)
        return Stability(0 if loose else 1, loose=loose)

    def _of_many(self, solver):
        """Stability with more unknowns than `DENSE`, of which not all s are found."""
        M, C = self.rest.pattern.matrix(self.rest.mass_at(self.x)), self._velocity()
        if not self._massive().any() and self.definite >= 0:
            return by_pivot(self.definite)
        if C is not None and self.definite == 1 and self._damps(C, M):
            return Stability(1)
        solver = solver or self._lu
        slow = self._slowest(solver, C)
        if slow is None:
            return Stability(None, "its slowest vibrations are not found", loose=True)
        loose = not self._massive().all() or abs(slow.s).min() ** 2 <= OPEN * TINY * self._fastest(M)
        turns = abs(slow.s.imag) > NO_RATE * abs(slow.s)
        if (slow.grows & ~turns).any():
            return Stability(-1, EIGENVALUE, loose=loose)
        if slow.grows.any() and self._massive().any():
            return Stability(-1, _flutter(slow.s.real[slow.grows].max()), loose=loose)
        if solver.sign_of_determinant() < 0 and self.definite < 0:
            return Stability(-1, EIGENVALUE, loose=loose)
        if not slow.more and self.definite == 1:
            return Stability(1)
        text = f"the {len(slow.s)} slowest of its vibrations do not grow, the others are too many to be asked"
        return Stability(None, text, loose=loose)

    @property
    def _lu(self):
        """LU of K plus a stiffness that counts as zero."""
        solver = Lu(self.rest.pattern)
        solver.update(self._parts[0] + self._ridge)
        return solver

    def _slowest(self, solver, C):
        """The `refweb.statics.slowest_vibrations.Slowest`; None where they are not found."""
        from scipy.sparse import eye_array
        from scipy.sparse.linalg import ArpackError

        from .slowest_vibrations import slowest

        if solver.singular:
            return None
        with contextlib.suppress(ArpackError):
            if self._massive().any():
                return slowest(solver, self.rest.pattern.matrix(self.rest.mass_at(self.x)), C)
            return slowest(solver, eye_array(len(self.rest.free), format="csr"))
        return None

    def _fastest(self, M):
        """A bound on all |λ|, if all unknowns have mass [1/s²]."""
        return (abs(self.rest.pattern.matrix(self._parts[0])).sum(axis=1) / M.diagonal()).max()

    def _damps(self, C, M):
        """Tell if C is symmetric and above α M, so that nothing grows; False unless all unknowns have lumped mass."""
        if C is None or abs(C - C.T).max() > ROUNDING * abs(C).max():
            return False
        if not self._massive().all() or self.rest.net.consistent_minus_lumped is not None:
            return False
        from scipy.sparse import triu

        from .slowest_vibrations import coupling

        alpha = coupling(self._factor.precondition, self.rest.pattern.matrix(self._parts[2]), M)
        return negative_pivots(triu(C - alpha * M, format="csc"), self.rest.library) == 0


def _flutter(growth):
    """Text for a vibration that grows."""
    return f"flutter: a vibration grows, by {growth:.2g} 1/s"


def _eigenvalues(A):
    """Eigenvalues of a matrix, and the rounding error of each to first order."""
    import scipy.linalg

    eigenvalues, before, behind = scipy.linalg.eig(A, left=True, right=True)
    overlap = abs((before.conj() * behind).sum(axis=0))  # of unit vectors: 1 over the condition number
    epsilon = np.finfo(float).eps
    return eigenvalues, ROUNDING * np.linalg.norm(A) / np.maximum(overlap, epsilon)


def _negative(eigenvalues, off):
    """Mask of the eigenvalues that are real and negative."""
    return (eigenvalues.real < -off) & (abs(eigenvalues.imag) <= off)


def _growth(K, C):
    """Largest real part of s [1/s] for unit masses; 0 if none is positive beyond rounding."""
    values, off = _eigenvalues(K)
    if C is None:
        complex_ = abs(values.imag) > off
        grows = complex_ | (values.real < -off)
        return float(abs(np.sqrt(-values[grows] + 0j).real).max(initial=0.0))
    scale = np.sqrt(np.linalg.norm(K)) + np.linalg.norm(C)
    if scale == 0.0:
        return 0.0
    size = len(K)
    values, off = _eigenvalues(np.block([[np.zeros_like(K), np.eye(size)], [-K / scale**2, -C / scale]]))
    return scale * float(values.real[values.real > off].max(initial=0.0))
