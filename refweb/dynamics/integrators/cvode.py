"""Implicit and variable-order dynamics by CVODE of SUNDIALS: x' = v, M v' = f(t, x, v).

Steps and orders follow from the error of displacements and velocities. BDF of orders 3 to 5 is unstable near the
imaginary axis, where the frequencies of a net lie. Therefore BDF is limited to order 2, and Adams methods are the
choice for many digits.

An implicit step solves (I − γJ) z = r with J = [[0, I], [−M⁻¹K, −M⁻¹C]]. Eliminating displacements leaves

    (M + γC + γ²K) z_v = M r_v − γK r_x,    z_x = r_x + γ z_v,

a matrix of half the size. It is symmetric unless an effect is not, and definite without the negative part of K. Where
no body turns, no mass changes and there are no internal variables, the same without a product with K is

    (M + γC + γ²K) z_x = M (r_x + γ r_v) + γC r_x,    z_v = (z_x − r_x)/γ.

A run of 464 steps of BDF on the square web of 3120 lines, 0.44 s, takes 0.08 s for 580 solutions, 0.05 s for 27
factorizations with their order and 23 tangents, 0.04 s for forces, 0.11 s within SUNDIALS, and 0.09 s for what is
observed in the middle and at the end of each step. The last factors are kept where CVODE asks for them anew and nothing
has changed, a third of all times.

Corrector iterations take the tangent of an earlier state, and where lines go taut or slack they may diverge, with
corrections three times as large in each; this run takes up to twice as long with rtol = 3.5e-4 to 5e-4 as with 3e-4.
Tangents of iterates take failures away, but one costs 1.4 ms with its factorization, a solution 0.15 ms and a step
without either 0.6 ms. With rtol = 3e-4, a tangent of each iterate takes 340 steps and 2.7 times as long, of all
iterates but the first 325 and 2 times, of the third and later ones 326 and 1.4 times. In steps that are tried again
alone 327 steps take as long. Over rtol = 2e-4 to 1e-3 that takes 0.9 times as long, with errors of 1 to 2.5 times the
size; by Adams methods it takes as long, with the same errors. GMRES with the earlier factors and the true tangent needs
4 to 6 iterations in place of one.

May change: `SHORT`, `STILL`, `SUDDEN`, `FAR`, `ATTEMPTS` and `RENEWED`, which change cost and digits within the
tolerance. Must stay: arguments of `set_up`, `precondition`, `jacobian_times`, `jacobian` and `right_side`, by which
sksundae calls them; `precondition` uses the factors of the last `set_up` with another γ or tangent; the Jacobian is the
derivative of `right_side`. Keys of ``[solve]`` are those of `registry.INTEGRATORS`. Must stay as well: public names of
`Cvode`, which other files use. Tests: ``tests/dynamics/integrators/test_cvode.py``.
"""

from __future__ import annotations

import numpy as np

from ...errors import InputError
from .integrator import Variant
from .sundials import Sundials, Symmetric

SHORT = 1.0
"""γω of a step up to which corrector iterations are cheaper without any factorization."""
STILL = 1e-3
"""Displacement by accelerations within a step, over the tolerance, below which nothing moves: no system is solved."""
SUDDEN, FAR, ATTEMPTS = 1e3, 1e4, 6
"""Growth of the largest acceleration from rest to the next set-up that shows a first contact, displacement by it within
the step over the tolerance, and how often a long step into it is tried without a matrix: iterations do not converge,
and the step becomes a quarter as long at once. A step with the matrix of its length converges, has too large an error,
and is shortened as well. That displacement is 7e3 to 1e11 tolerances in first contacts of balls with nets, and up to
540 where a flat net begins to move by itself, whose steps must stay long."""
RENEWED = 50
"""Evaluations of forces after which ω is estimated again."""


class Cvode(Sundials):
    """CVODE on one system.

    Parameters
    ----------
    system, probes, sums, events, rtol, atol_position, atol_velocity
        See `refweb.dynamics.integrators.step_observer.StepObserver`.
    family : {"bdf", "adams"}
        Kind of multistep method.
    max_order : int, optional
        Highest order, by default 2 for BDF and 12 for Adams.
    linear_solver : {"auto", "block", "sparse", "dense", "fixed-point"}
        Solver of linear systems, see `refweb.dynamics.integrators.sundials.LINEAR_SOLVERS`. "auto" is "dense" for few
        unknowns, else "block", with a factorization only if a step is too long for corrector iterations alone.

    Raises
    ------
    InputError
        For a free node without mass, or a choice that does not fit.
    """

    method = "cvode"
    variants = {
        "cvode-bdf": Variant({"family": "bdf"}, kind="bdf"),
        "cvode-adams": Variant({"family": "adams"}, (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)),
    }

    def __init__(self, system, *observed, family="bdf", max_order=None, linear_solver="auto", **tolerances):
        super().__init__(system, *observed, **tolerances)
        self.family = family
        self.max_order = self.order = max_order or {"bdf": 2, "adams": 12}[family]
        self.restarts = family == "adams"
        self._choose(linear_solver, "block")
        self._consistent = system.net.consistent_minus_lumped is not None
        if self._consistent and self.linear_solver == "sparse":
            raise InputError(
                '[solve] linear_solver = "sparse" must be "block" or "dense" with mass = "consistent": the inverse of '
                "the mass matrix has no pattern"
            )
        self._mass = np.repeat(system.net.mass, 3)[system.free]
        self._mass[self._inner] = 1.0  # internal variables follow from forces, and have no velocity that changes
        self._sparing = (
            linear_solver == "auto"
            and self.linear_solver == "block"
            and not (self._consistent or self.rotations or len(self._inner))
        )
        if self._sparing:
            self.choice += f"; none where a step is short, γω ≤ {SHORT:g}"
        self._gamma, self._plain, self._set_up_at, self._due = None, False, None, 0
        self._rest, self._tried = np.inf, 0  # largest acceleration at the last set-up at rest, and attempts since then
        self._factored = None  # γ of the factors, None where these are of another tangent
        self._fastest = None  # bound on |J| of the tangent [1/s], None where it is not known yet
        if self._consistent:
            self._mass_values = system.mass.values.copy()
            self._mass_values[system.pattern.diagonal[self._inner]] = 1.0  # of what has no velocity
            self._mass_matrix = system.pattern.matrix(self._mass_values)
            self._mass_factor = Symmetric(system.pattern)
            self._mass_factor.update(self._mass_values)

    def _set_masses(self, mass):
        self._mass = mass
        self._mass[self._inner] = 1.0

    def _times_mass(self, v):
        return self._mass_matrix @ v if self._consistent else self._mass * v

    def _over_mass(self, f):
        return self._mass_factor.apply(f) if self._consistent else f / self._mass

    def right_side(self, t, y, yp):
        """Write y' = f(t, y), velocities and accelerations of the unknowns."""
        n = self.unknowns
        x, v = self.state(t, y[:n], y[n:])
        force = self.force_at(t, x, v)
        yp[:n] = y[n:]
        if self.rotations:
            self.rotations.set_rates(x, v, yp[:n])
        if len(inner := self._inner):
            yp[inner] = force[inner] / self.system.resistance(t)
            force[inner] = 0.0
        yp[n:] = self._over_mass(force)

    def _tangent(self, t, y):
        """Values of K, and of C or None, at a state."""
        self.stats["njev"] += 1
        x, v = self.state(t, y[: self.unknowns], y[self.unknowns :])
        self._at_state = t, x, v
        if len(self._inner):
            self._resistance = self.system.resistance(t)
        if self.rotations:
            self.rotations.linearize(x, v)
        return self.tangents(t, x, v)

    # Block elimination

    def set_up(self, t, y, yp, jok, jnew, gamma):
        """Factorize M + γC + γ²K; K and C are kept where CVODE allows."""
        may = self._sparing and not (self._plain and t == self._set_up_at)  # else iterations have not converged
        largest = np.abs(yp[self.unknowns :]).max(initial=0.0) if may else np.inf
        known, moved, tolerance = self._gamma is not None, gamma * gamma * largest, self.atol_position
        self._still = moved <= STILL * tolerance
        self._plain = known and may and self._short(gamma)
        jnew[0] = 0
        if self._still:
            self._rest, self._tried = largest, 0
        elif (
            self._tried < ATTEMPTS
            and may
            and not self._plain
            and moved > FAR * tolerance
            and largest > SUDDEN * self._rest
        ):
            self._tried += 1
            self._gamma, self._set_up_at, self._plain, jnew[0] = gamma, t, True, 1  # the step is shortened at once
            return
        if not known or not jok and not (self._plain and self.stats["nfev"] < self._due):
            self._stiffness, self._damping = self._tangent(t, y)
            self._factored = self._fastest = None
            self._K = self.system.pattern.matrix(self._stiffness)
            self._C = None if self._damping is None else self.system.pattern.matrix(self._damping)
            self._due = self.stats["nfev"] + RENEWED
            self._plain = may and self._short(gamma)
            jnew[0] = 0 if self._plain else 1  # a set-up that factorizes is still to be had
        self._gamma, self._set_up_at = gamma, t
        if not self._plain and gamma != self._factored:  # CVODE asks every 20 steps, whatever has changed
            self._factorize_step(gamma)
            self._factored = None if self.system.net.flows else gamma

    def _short(self, gamma):
        """Tell if nothing moves, or corrector iterations converge well without a matrix, by a bound on γ|J|."""
        if self._still:
            return True

        def largest(values):
            return (np.add.reduceat(np.abs(values), self.system.pattern.indptr[:-1]) / self._mass).max()

        if self._fastest is None or self.system.net.flows:
            damped = 0.0 if self._damping is None else largest(self._damping)
            self._fastest = damped + np.sqrt(largest(self._stiffness))
        return gamma * self._fastest <= SHORT

    def _factorize_step(self, gamma):
        system = self.system
        values = gamma * gamma * self._stiffness
        if self.rotations:
            self.rotations.begin(gamma)
            values = self.rotations.eliminated(system.pattern, values)
        if self._damping is not None:
            values += gamma * self._damping
        if self._consistent:
            values += self._mass_values
        else:
            values[system.pattern.diagonal] += self._mass
        values[system.pattern.diagonal[self._inner]] -= 1.0

        def definite():
            return values + gamma * gamma * (
                system.stiffness(*self._at_state, definite=True, blocks=self._blocks) - self._stiffness
            )

        self._factorize(values, definite)

    def precondition(self, t, y, yp, r, z, gamma, delta, side):
        """Solve (I − γJ) z = r with the factors of `set_up`."""
        if self._plain:
            z[:] = r
            return
        if self._inverts(z, gamma == self._gamma and self._true):
            return
        n, rotations, gamma = self.unknowns, self.rotations, self._gamma
        if not (rotations or len(self._inner) or self.system.net.flows):
            push = self._times_mass(r[:n] + gamma * r[n:])
            if self._C is not None:
                push += gamma * (self._C @ r[:n])
            z[:n] = moved = self._factor.apply(push)
            z[n:] = (moved - r[:n]) / gamma
            return
        first, inner, push = rotations.before(r[:n]) if rotations else r[:n], self._inner, r[n:].copy()
        push[inner] = 0.0
        z[n:] = self._factor.apply(self._times_mass(push) - gamma * (self._K @ first))
        z[:n] = first + gamma * (rotations.carried(z[n:]) if rotations else z[n:])
        z[n + inner] = r[n + inner]

    def jacobian_times(self, t, y, yp, u, Ju):
        """Write J u, J that of the last `set_up`."""
        if self._plain:
            Ju[:] = 0.0
            return
        if self._multiplied(u):
            return
        n, pull = self.unknowns, self._K @ u[: self.unknowns]
        rates = pull[self._inner]
        if self._C is not None:
            pull += self._C @ u[n:]
        pull[self._inner] = 0.0
        Ju[:n] = self.rotations.product(u[:n], u[n:]) if self.rotations else u[n:]
        Ju[n:] = -self._over_mass(pull)
        if len(self._inner):
            Ju[self._inner] = -rates / self._resistance

    # The whole Jacobian

    def _whole_pattern(self):
        """Rows and columns of −M⁻¹K, of the diagonal, of the unit matrix and of −M⁻¹C, for a lumped mass."""
        pattern, n = self.system.pattern, self.unknowns
        row, column, at = pattern.indices, np.repeat(np.arange(n), np.diff(pattern.indptr)), np.arange(n)
        self._force_rows, self._unit = row, np.ones(n)
        self._unit[self._inner] = 0.0
        self._of_inner, below = np.isin(row, self._inner), n + row
        if len(self._inner):
            below = np.where(self._of_inner, row, below)
            self._which = np.searchsorted(self._inner, row[self._of_inner])
        rows, columns = [below, at, at, n + row], [column, at, n + at, n + column]
        if self.rotations:
            self._unit[self.rotations.places] = 0.0
            (first, second), (slow, fast) = self.rotations.pattern()
            rows, columns = [*rows, first, slow], [*columns, second, n + fast]
        return np.concatenate(rows), np.concatenate(columns)

    def jacobian(self, t, y, yp, J):
        """Write J = ∂f/∂y to a dense matrix, or to the values of a sparse one."""
        n, (K, C) = self.unknowns, self._tangent(t, y)
        if not self._consistent:
            heavy = self._mass[self._force_rows]
            damped = np.zeros(K.shape) if C is None else -C / heavy
            if len(self._inner):
                heavy[self._of_inner] = self._resistance[self._which]
                damped[self._of_inner] = 0.0
            parts = [-K / heavy, np.zeros(n), self._unit, damped]
            if self.rotations:
                parts += [self.rotations.X.ravel(), self.rotations.V.ravel()]
            self._write(J, np.concatenate(parts))
            return
        self.stats["nlu"] += 1
        mass, matrix = self._mass_matrix.toarray(), self.system.pattern.matrix
        J[:] = 0.0
        J[np.arange(n), n + np.arange(n)] = 1.0
        J[n:, :n] = -np.linalg.solve(mass, matrix(K).toarray())
        if C is not None:
            J[n:, n:] = -np.linalg.solve(mass, matrix(C).toarray())
        if len(inner := self._inner):
            J[inner] = 0.0
            J[inner, :n] = -matrix(K).toarray()[inner] / self._resistance[:, None]
            J[n + inner] = 0.0
        if self.rotations:
            (first, second), (slow, fast) = self.rotations.pattern()
            J[self.rotations.places.ravel(), n + self.rotations.places.ravel()] = 0.0
            J[first, second], J[slow, n + fast] = self.rotations.X.ravel(), self.rotations.V.ravel()

    def linear_options(self):
        """Options of SUNDIALS for the linear solver."""
        from sksundae.cvode import CVODEJacTimes, CVODEPrecond

        if self.linear_solver in ("dense", "sparse"):
            return self._full_matrix(*self._whole_pattern(), 2 * self.unknowns)
        if self.linear_solver == "block":
            self._symmetric, self._factored = Symmetric(self.system.pattern), None
            precond = CVODEPrecond(self.set_up, self.precondition)
            times = CVODEJacTimes(None, self.jacobian_times)
            return dict(linsolver="gmres", krylov_dim=10, precond=precond, jactimes=times)

        def nothing(t, y, yp, u, Ju):
            Ju[:] = 0.0

        return dict(linsolver="gmres", krylov_dim=1, jactimes=CVODEJacTimes(None, nothing))

    # A solver's steps

    def _made(self, **options):
        from sksundae.cvode import CVODE

        def right_side(t, y, yp):
            self.right_side(t, y, yp)

        tolerance = np.concatenate(self.tolerance())
        return CVODE(right_side, method={"bdf": "BDF", "adams": "Adams"}[self.family], atol=tolerance, **options)

    def _initial(self, t, x, v):
        return (np.concatenate([x, v]),)

    def interpolated(self, t):
        """Unknown displacements and velocities at a time within the last step."""
        y = self._solution(t).y
        return y[: self.unknowns], y[self.unknowns :]
