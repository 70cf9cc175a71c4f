"""Implicit and variable-order dynamics by CVODE of SUNDIALS: x' = v, M v' = f(t, x, v).

Steps and orders follow from the error, for displacements and velocities alike. These are wave problems: BDF of orders 3
to 5 is unstable near the imaginary axis, where the frequencies of a net lie, so that BDF is limited to order 2; Adams
methods are the choice for many digits.

An implicit step solves (I − γJ) z = r with J = [[0, I], [−M⁻¹K, −M⁻¹C]]. Eliminating displacements leaves

    (M + γC + γ²K) z_v = M r_v − γK r_x,    z_x = r_x + γ z_v,

a matrix of half the size, symmetric unless an effect says otherwise, and definite once the negative part of K is left
out. `LINEAR_SOLVERS` says how each choice solves that.
"""

from __future__ import annotations

import numpy as np

from ...errors import InputError
from ...system.factorization import Factor
from .step_observer import Implicit, _Stopped, refuse_massless

LINEAR_SOLVERS = {
    "block": "GMRES with the true Jacobian, preconditioned by the block elimination",
    "sparse": "SuperLU_MT on the whole Jacobian, values in its fixed pattern",
    "dense": "LU of the whole Jacobian",
    "fixed-point": "none: corrector iterations only, for steps that an explicit method could take",
}
DENSE = 80
"""Unknown displacements up to which a dense factorization is the fastest."""
SHORT = 1.0
"""γω of a step up to which corrector iterations are cheaper without any factorization."""
STILL = 1e-3
"""Displacement by accelerations within a step, over the tolerance, below which nothing has to be solved for."""
RENEWED = 50
"""Evaluations of forces after which ω is looked at anew."""


class Cvode(Implicit):
    """CVODE on one system.

    Parameters
    ----------
    system, probes, watch, events, rtol, atol_position, atol_velocity
        See `refweb.dynamics.integrators.step_observer.Implicit`.
    family : {"bdf", "adams"}
        Kind of multistep method.
    max_order : int, optional
        Highest order, by default 2 for BDF and 12 for Adams.
    linear_solver : {"auto", "block", "sparse", "dense", "fixed-point"}
        How linear systems are solved, see `LINEAR_SOLVERS`; "auto" is "dense" for at most `DENSE` unknowns, else
        "block", with a factorization only where a step is longer than corrector iterations alone can take.

    Attributes
    ----------
    choice : str
        Which linear solver is used and why.

    Raises
    ------
    InputError
        For a free node without mass, or a choice that does not fit.
    """

    method = "cvode"

    def __init__(self, system, *observed, family="bdf", max_order=None, linear_solver="auto", **tolerances):
        refuse_massless(system, self.method)
        if system.constraints:
            raise InputError('[[link]] needs method = "ida": cvode does not hold lengths')
        super().__init__(system, *observed, **tolerances)
        self.family = family
        self.max_order = max_order or {"bdf": 2, "adams": 12}[family]
        self.linear_solver, self.choice = self._chosen(linear_solver)
        free = system.free
        self._consistent = system.net.spread is not None
        if self._consistent and self.linear_solver == "sparse":
            raise InputError(
                '[solve] linear_solver = "sparse" must be "block" or "dense" with mass = "consistent": the inverse of '
                "the mass matrix has no pattern"
            )
        self._mass = np.repeat(system.net.mass, 3)[free]
        self._gamma = self._product = None
        self._exact = self._plain = False
        self._sparing = linear_solver == "auto" and self.linear_solver == "block" and not self._consistent
        self._set_up_at, self._due = None, 0
        if self._consistent:
            self._mass_values = system.mass()
            self._mass_matrix = system.pattern.matrix(self._mass_values)
            self._mass_factor = _Symmetric(system.pattern)
            self._mass_factor.update(self._mass_values)

    def _chosen(self, name):
        if name != "auto":
            return name, f"{name}, as asked for: {LINEAR_SOLVERS[name]}"
        if self.unknowns <= DENSE:
            return "dense", f"dense, for {self.unknowns} unknowns, at most {DENSE}: {LINEAR_SOLVERS['dense']}"
        choice = f"block, for {self.unknowns} unknowns, more than {DENSE}: {LINEAR_SOLVERS['block']}"
        if self.system.net.spread is None:
            choice += f"; none where a step is short, γω ≤ {SHORT:g}"
        return "block", choice

    def _times_mass(self, v):
        return self._mass_matrix @ v if self._consistent else self._mass * v

    def _over_mass(self, f):
        return self._mass_factor.apply(f) if self._consistent else f / self._mass

    def _state(self, t, y):
        """All rows at a state of the unknowns."""
        system, n = self.system, self.unknowns
        x, v = self._reference.copy(), np.zeros((system.rows, 3))
        x.ravel()[system.free], v.ravel()[system.free] = y[:n], y[n:]
        system.drive(t, x, v)
        return x, v

    def _right_side(self, t, y, yp):
        n = self.unknowns
        self.stats["nfev"] += 1
        rows = self.system.force(t, *self._state(t, y))
        force = rows.ravel()[self.system.free]
        if self._wrong is None and not np.isfinite(force.sum()):
            self._wrong = t, rows
        yp[:n] = y[n:]
        yp[n:] = self._over_mass(force)

    def _tangent(self, t, y):
        """Values of K, and of C or None, at a state."""
        self.stats["njev"] += 1
        x, v = self._state(t, y)
        self._at_state = t, x, v
        return self.system.stiffness(t, x, v), self.system.damping(t, x, v)

    # Block elimination

    def _set_up(self, t, y, yp, jok, jnew, gamma):
        """Factorize M + γC + γ²K; K and C are kept where CVODE allows."""
        may = self._sparing and not (self._plain and t == self._set_up_at)  # else iterations have not converged
        known, self._still = self._gamma is not None, may and self._nothing_moves(yp, gamma)
        self._plain = known and may and self._short(gamma)
        jnew[0] = 0
        if not known or not jok and not (self._plain and self.stats["nfev"] < self._due):
            self._stiffness, self._damping = self._tangent(t, y)
            self._K = self.system.pattern.matrix(self._stiffness)
            self._C = None if self._damping is None else self.system.pattern.matrix(self._damping)
            self._due = self.stats["nfev"] + RENEWED
            self._plain = may and self._short(gamma)
            jnew[0] = 0 if self._plain else 1  # a set-up that factorizes is still to be had
        self._gamma, self._set_up_at = gamma, t
        if not self._plain:
            self._factorize(gamma)

    def _nothing_moves(self, yp, gamma):
        """Whether all that accelerations change within a step is far below the tolerance, as before a first contact."""
        return gamma * gamma * np.abs(yp[self.unknowns :]).max(initial=0.0) <= STILL * self.atol_position

    def _short(self, gamma):
        """Whether corrector iterations converge well without a matrix, by a bound on γ|J| where anything moves."""
        if self._still:
            return True

        def largest(values):
            return (np.add.reduceat(np.abs(values), self.system.pattern.indptr[:-1]) / self._mass).max()

        damped = 0.0 if self._damping is None else largest(self._damping)
        return gamma * (damped + np.sqrt(largest(self._stiffness))) <= SHORT

    def _factorize(self, gamma):
        system = self.system
        values = gamma * gamma * self._stiffness
        if self._damping is not None:
            values += gamma * self._damping
        if self._consistent:
            values += self._mass_values
        else:
            values[system.pattern.diagonal] += self._mass
        self._factor = self._factor_of(values, gamma)

    def _factor_of(self, values, gamma):
        system, self._true = self.system, True
        self.stats["nlu"] += 1
        if not system.symmetric:
            return _Unsymmetric(system.pattern, values)
        factor = self._symmetric
        factor.update(values)
        if factor.negative_pivots():
            self.stats["nlu"] += 1
            self._true = False
            values += gamma * gamma * (system.stiffness(*self._at_state, definite=True) - self._stiffness)
            factor.update(values)
        return factor

    def _precondition(self, t, y, yp, r, z, gamma, delta, side):
        if self._plain:
            z[:] = r
            return
        n, self._exact = self.unknowns, gamma == self._gamma and self._true
        if self._product is not None and self._exact:
            z[:] = self._product  # r is (I − γJ) of it, and this inverts just that
            self._product = None
            return
        self._product = None
        z[n:] = self._factor.apply(self._times_mass(r[n:]) - self._gamma * (self._K @ r[:n]))
        z[:n] = r[:n] + self._gamma * z[n:]

    def _jacobian_times(self, t, y, yp, u, Ju):
        if self._plain:
            Ju[:] = 0.0
            return
        n, self._product = self.unknowns, u.copy()
        if self._exact:
            return  # what it would be, the preconditioner takes away again
        pull = self._K @ u[:n]
        if self._C is not None:
            pull += self._C @ u[n:]
        Ju[:n] = u[n:]
        Ju[n:] = -self._over_mass(pull)

    # The whole Jacobian

    def _whole_pattern(self):
        """CSC pattern of J, diagonal included, and where −M⁻¹K and −M⁻¹C stand in its values."""
        from scipy.sparse import csc_matrix

        pattern, n = self.system.pattern, self.unknowns
        column = np.repeat(np.arange(n), np.diff(pattern.indptr))
        eye = np.arange(n)
        rows = [n + pattern.indices, eye, eye, n + pattern.indices]
        cols = [column, eye, n + eye, n + column]
        rows, cols = np.concatenate(rows).astype(np.int64), np.concatenate(cols).astype(np.int64)
        order = np.lexsort((rows, cols))
        place = np.empty(len(order), dtype=np.int64)
        place[order] = np.arange(len(order))
        sizes = np.cumsum([len(pattern.indices), n, n])
        self._places = np.split(place, sizes)
        indptr = np.searchsorted(cols[order], np.arange(2 * n + 1)).astype(np.int32)
        parts = (np.ones(len(order)), rows[order].astype(np.int32), indptr)
        self._heavy = self._mass[pattern.indices]
        return csc_matrix(parts, shape=(2 * n, 2 * n))

    def _sparse_jacobian(self, t, y, yp, J):
        K, C = self._tangent(t, y)
        self.stats["nlu"] += 1
        stiff, own, unit, damped = self._places
        J[stiff], J[own], J[unit] = -K / self._heavy, 0.0, 1.0
        J[damped] = 0.0 if C is None else -C / self._heavy

    def _dense_jacobian(self, t, y, yp, J):
        K, C = self._tangent(t, y)
        self.stats["nlu"] += 1
        n, matrix = self.unknowns, self.system.pattern.matrix
        J[:] = 0.0
        J[np.arange(n), n + np.arange(n)] = 1.0
        for block, values in ((J[n:, :n], K), (J[n:, n:], C)):
            if values is not None:
                full = matrix(values).toarray()
                block[:] = -(
                    np.linalg.solve(self._mass_matrix.toarray(), full)
                    if self._consistent
                    else full / self._mass[:, None]
                )

    def _options(self):
        from sksundae.cvode import CVODEJacTimes, CVODEPrecond

        if self.linear_solver == "dense":
            return dict(linsolver="dense", jacfn=self._dense_jacobian)
        if self.linear_solver == "sparse":
            return dict(linsolver="sparse", sparsity=self._whole_pattern(), jacfn=self._sparse_jacobian)
        if self.linear_solver == "block":
            self._symmetric = _Symmetric(self.system.pattern)
            precond = CVODEPrecond(self._set_up, self._precondition)
            times = CVODEJacTimes(None, self._jacobian_times)
            return dict(linsolver="gmres", krylov_dim=10, precond=precond, jactimes=times)

        def nothing(t, y, yp, u, Ju):
            Ju[:] = 0.0

        return dict(linsolver="gmres", krylov_dim=1, jactimes=CVODEJacTimes(None, nothing))

    # A solver's steps

    def _begin(self, t, x, v):
        from sksundae.cvode import CVODE

        n = self.unknowns
        tolerance = np.repeat([self.atol_position, self.atol_velocity], n)

        def right_side(t, y, yp):
            self._right_side(t, y, yp)

        self._solver = CVODE(
            right_side,
            method={"bdf": "BDF", "adams": "Adams"}[self.family],
            max_order=self.max_order,
            rtol=self.rtol,
            atol=tolerance,
            max_num_steps=10_000_000,
            **self._options(),
        )
        self._check(self._solver.init_step(t, np.concatenate([x, v])))

    def _advance(self, stop, end):
        return float(self._check(self._solver.step(end, "onestep", float(stop) if np.isfinite(stop) else None)).t)

    def _interpolated(self, t):
        y = self._check(self._solver.step(t, "normal", None)).y
        return y[: self.unknowns], y[self.unknowns :]

    def _check(self, result):
        if result.status < 0:
            raise _Stopped(result.message)
        return result


class _Symmetric(Factor):
    """LDLᵀ solved once and not refined, for preconditioners and for the mass matrix, whose condition is small."""

    def apply(self, b):
        return self._solver.solve(b)


class _Unsymmetric:
    """LU as a preconditioner, where an effect makes the tangent unsymmetric."""

    def __init__(self, pattern, values):
        from scipy.sparse.linalg import splu

        self._lu = splu(pattern.matrix(values), permc_spec="MMD_AT_PLUS_A")

    def apply(self, b):
        return self._lu.solve(b)
