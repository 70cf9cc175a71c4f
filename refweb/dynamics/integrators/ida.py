"""Implicit dynamics by IDA of SUNDIALS, in residual form: with nodes without mass, and with rigid links.

The unknowns are displacements x, velocities v of rows with mass, and two multipliers λ, μ of each link:

    x' − v + Gᵀμ = 0        M v' − f(t, x, v) + Gᵀλ = 0        g(x) = 0        G v = 0,        G = ∂g/∂x

In this form of Gear, Gupta and Leimkuhler [1]_ links are of index 2: lengths and their rates are both among the
equations, and μ is 0 up to the error of a step. The error test leaves the multipliers out. The states of a step satisfy
g = 0 and G v = 0 to about rtol, for runs of any length. Observables use the nearest state that satisfies both to
rounding, with the forces of links there.

A node without mass has no velocity among the unknowns: its equation is 0 = f, of index 1, and its velocity is x'. A
formulation of index 2, with v and x' − v = 0, takes equally many steps for the same error. A node that no line holds
ends the run.

A step solves J z = r with J = ∂F/∂y + c ∂F/∂y'. Eliminating displacements leaves, where there are no links,

    (M + C/c + K/c²) z_v = (r_v − K r_x/c)/c,    z_x = (r_x + z_v)/c

for every node alike, with r_x = 0 for one without mass. Where no body turns and no mass changes, the same without K is

    (M + C/c + K/c²) (r_x + z_v) = r_v/c + M r_x + C r_x/c.

May change: private methods, and `UNTESTED`, upwards. Must stay: unknowns stand in the order x, v, λ, μ, also for
`system.links`; arguments of `residual`, `set_up`, `precondition`, `jacobian_times` and `jacobian`, by which sksundae
calls them; the Jacobian is the derivative of `residual`; ``kind`` "bdf" of its `Variant`, which "cvode-bdf" has as
well: `studies.references` takes methods of other kinds as independent; `constraint_drift`, which stands in checkpoints
by name and in ``run.json``. Keys of ``[solve]`` are those of `registry.INTEGRATORS`. Tests:
``tests/dynamics/integrators/test_ida.py``.

References
----------
.. [1] C. W. Gear, B. Leimkuhler, G. K. Gupta, "Automatic integration of Euler-Lagrange equations with constraints",
   J. Comput. Appl. Math. 12–13 (1985) 77–90, doi:10.1016/0377-0427(85)90008-1.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...errors import InputError, SolverError
from .integrator import Variant
from .step_observer import ObservedState, Stopped
from .sundials import Sundials, Symmetric
from .tolerances import scales

UNTESTED = 1e30
"""Absolute tolerance of multipliers, which takes them out of the error test."""


@dataclass(eq=False, kw_only=True)
class LinkedCourse(ObservedState):
    """State of a run with links.

    Attributes
    ----------
    constraint_drift : ndarray, shape (2,)
        Largest relative error of a length, and largest rate of one [m/s], at the ends of steps.
    """

    constraint_drift: np.ndarray = field(default_factory=lambda: np.zeros(2))


class Ida(Sundials):
    """IDA on one system.

    Parameters
    ----------
    system, probes, sums, events, rtol, atol_position, atol_velocity
        See `refweb.dynamics.integrators.step_observer.StepObserver`.
    max_order : int
        Highest order of the BDF, 1 to 5; those above 2 are unstable near the frequencies of a net.
    linear_solver : {"auto", "block", "sparse", "dense"}
        Solver of linear systems, see `refweb.dynamics.integrators.sundials.LINEAR_SOLVERS`; "auto" chooses by size.
        Links need "sparse" or "dense".

    Raises
    ------
    InputError
        For links that hold nothing or too much, or a choice that does not fit.
    """

    method = "ida"
    variants = {"ida": Variant(kind="bdf")}
    takes_massless = takes_links = restarts = True
    course_type = LinkedCourse

    def __init__(self, system, *observed, max_order=2, linear_solver="auto", **tolerances):
        super().__init__(system, *observed, **tolerances)
        self.max_order = self.order = max_order
        mass = np.repeat(system.net.mass, 3)[system.free]
        self._heavy, self._bare = np.flatnonzero(mass > 0.0), np.flatnonzero(mass <= 0.0)
        weightless = np.setdiff1d(self._bare, self._inner)
        self._M = system.pattern.matrix(system.mass.values)
        self._massless = self._links = None
        if len(weightless):
            from .massless_nodes import Massless

            self._massless = Massless(system, weightless)
        if system.constraints:
            self._links = system.links
        self._count = len(self._links) if self._links else 0
        if linear_solver == "fixed-point":
            raise InputError(
                '[solve] linear_solver = "fixed-point" must be one of "auto", "block", "sparse", "dense" with ida'
            )
        if self._links and linear_solver == "block":
            raise InputError('[solve] linear_solver = "block" must be "sparse" or "dense" with [[link]]')
        self._choose(linear_solver, *(("sparse", ", and links") if self._links else ("block",)))
        self._adrift = 0.0, None

    def _set_masses(self, mass):
        self._M.data[self.system.pattern.diagonal] = mass

    def _times_mass(self, v):
        if self.system.net.consistent_minus_lumped is not None:
            return self._M @ v
        return self._M.data[self.system.pattern.diagonal] * v

    # The residual

    def _parts(self, y):
        """y, or y', as its displacements, velocities, λ and μ."""
        n, m = self.unknowns, self.unknowns + len(self._heavy)
        return y[:n], y[n:m], y[m : m + self._count], y[m + self._count :]

    def _velocity(self, y, yp):
        """Velocity of every unknown displacement [m/s]."""
        v = self._parts(yp)[0].copy()
        v[self._heavy], v[self._inner] = self._parts(y)[1], 0.0
        return v

    def _of_all(self, values):
        """Expand values of the unknowns with mass to all unknown displacements, with 0 elsewhere."""
        expanded = np.zeros(self.unknowns)
        expanded[self._heavy] = values
        return expanded

    def _rows(self, t, y, yp):
        """Displacement and velocity of all rows at a state of the unknowns."""
        return self.state(t, self._parts(y)[0], self._velocity(y, yp))

    def residual(self, t, y, yp, r):
        """Write F(t, y, y'), which is 0 along a motion."""
        n, heavy, bare = self.unknowns, self._heavy, self._bare
        x, v = self._rows(t, y, yp)
        force = self.force_at(t, x, v)
        rate, (_, stored, multipliers, corrections) = self._parts(yp)[0], self._parts(y)
        if self._links:
            pairs = self._links.pairs
            force = force - pairs.pull(x, multipliers).ravel()[self.system.free]
            rate = rate + pairs.pull(x, corrections).ravel()[self.system.free]
            r[n + len(heavy) :] = np.concatenate([pairs.excess(x), pairs.speed(x, v)])
        slope = np.zeros(n)
        slope[heavy] = self._parts(yp)[1]
        balance = self._times_mass(slope) - force
        if len(inner := self._inner):
            balance[inner] += self.system.resistance(t) * rate[inner]
        moved = stored
        if self.rotations:
            moved = self._of_all(stored)
            self.rotations.set_rates(x, v, moved)
            moved = moved[heavy]
        r[heavy], r[bare], r[n : n + len(heavy)] = rate[heavy] - moved, balance[bare], balance[heavy]

    def _tangent(self, t, y, yp):
        """Values of K, and of C or None, at a state."""
        self.stats["njev"] += 1
        x, v = self._rows(t, y, yp)
        self._at_state = t, x, v
        if self.rotations:
            self.rotations.linearize(x, v)
        K, C = self.tangents(t, x, v)
        if self._massless:
            self._adrift = t, self._massless.adrift(K)
        return K, C

    # Block elimination

    def set_up(self, t, y, yp, res, c):
        """Factorize M + C/c + K/c²."""
        system = self.system
        K, C = self._tangent(t, y, yp)
        self._K, self._C = system.pattern.matrix(K), None if C is None else system.pattern.matrix(C)
        self._factored = c
        rest = self._M.data if C is None else self._M.data + C / c
        if self.rotations:
            self.rotations.begin(1.0 / c)
            K = self.rotations.eliminated(system.pattern, K)

        def definite():
            values = rest + system.stiffness(*self._at_state, definite=True, blocks=self._blocks) / c**2
            values[system.pattern.diagonal[self._bare]] += np.abs(K).max() / c**2
            return values

        self._factorize(rest + K / c**2, definite, self._adrift[1] is None)

    def precondition(self, t, y, yp, res, r, z, c, delta):
        """Solve J z = r with the factors of `set_up`, J = ∂F/∂y + c ∂F/∂y'."""
        if self._inverts(z, c == self._factored and self._true):
            return
        n, heavy, bare, c = self.unknowns, self._heavy, self._bare, self._factored
        first, second = r[:n].copy(), np.empty(n)
        first[bare], second[bare], second[heavy] = 0.0, r[bare], r[n:]
        if self.rotations or self.system.net.flows:
            first = self.rotations.before(first) if self.rotations else first
            velocity = self._factor.apply((second - self._K @ first / c) / c)
            carried = self.rotations.carried(velocity) if self.rotations else velocity
            z[:n], z[n:] = (first + carried) / c, velocity[heavy]
            return
        push = second / c + self._times_mass(first)
        if self._C is not None:
            push += self._C @ first / c
        moved = self._factor.apply(push)
        z[:n], z[n:] = moved / c, (moved - first)[heavy]

    def jacobian_times(self, t, y, yp, res, u, Ju, c):
        """Write J u, J that of the last `set_up`."""
        if self._multiplied(u):
            return
        n, heavy, bare = self.unknowns, self._heavy, self._bare
        velocity, slope = c * u[:n], np.zeros(n)
        velocity[heavy], slope[heavy] = u[n:], c * u[n:]
        balance = self._times_mass(slope) + self._K @ u[:n]
        if self._C is not None:
            balance += self._C @ velocity
        moved = self.rotations.product(u[:n], self._of_all(u[n:]))[heavy] if self.rotations else u[n:]
        Ju[heavy], Ju[bare], Ju[n:] = c * u[heavy] - moved, balance[bare], balance[heavy]

    # The whole Jacobian

    def _whole_pattern(self):
        """Rows and columns of what `jacobian` writes."""
        n, heavy, pattern = self.unknowns, self._heavy, self.system.pattern
        column = np.repeat(np.arange(n), np.diff(pattern.indptr))
        at = np.arange(n)  # row of M v' − f, and column of v; without mass that of x, whose rate v is
        at[heavy] = n + np.arange(len(heavy))
        self._slid = ~np.isin(column, heavy)
        parts = [(heavy, heavy), (heavy, at[heavy]), (at[pattern.indices], column), (at[pattern.indices], at[column])]
        self._unit = np.full(len(heavy), -1.0)
        if self.rotations:
            self._unit[np.searchsorted(heavy, self.rotations.places)] = 0.0
            (first, second), (slow, fast) = self.rotations.pattern()
            parts += [(first, second), (slow, at[fast])]
        if self._links:
            parts += self._links.places(heavy, at[heavy], n + len(heavy))
        return (np.concatenate(side) for side in zip(*parts, strict=True))

    def jacobian(self, t, y, yp, res, c, J):
        """Write J = ∂F/∂y + c ∂F/∂y' to a dense matrix, or to the values of a sparse one."""
        K, C = self._tangent(t, y, yp)
        slope = c * self._M.data
        if C is not None:
            slope += np.where(self._slid, c, 1.0) * C
        parts = [np.full(len(self._heavy), c), self._unit, K, slope]
        if self.rotations:
            parts += [-self.rotations.X.ravel(), -self.rotations.V.ravel()]
        if self._links:
            parts += self._links.values(*self._at_state[1:], self._parts(y)[2])
        self._write(J, np.concatenate(parts))

    def linear_options(self):
        """Options of SUNDIALS for the linear solver."""
        from sksundae.ida import IDAJacTimes, IDAPrecond

        if self.linear_solver != "block":
            rows, columns = self._whole_pattern()
            return self._full_matrix(rows, columns, self.unknowns + len(self._heavy) + 2 * self._count)
        self._symmetric = Symmetric(self.system.pattern)
        precond, times = IDAPrecond(self.set_up, self.precondition), IDAJacTimes(None, self.jacobian_times)
        return dict(linsolver="gmres", krylov_dim=10, precond=precond, jactimes=times)

    # Consistent initial conditions

    def start(self, x=None, v=None):
        """The `IntegratorState` at t = 0.

        Nodes without mass are moved to their equilibrium among all others. Parts of velocities that would stretch links
        are removed with the least kinetic energy.
        """
        system = self.system
        x = np.zeros((system.rows, 3)) if x is None else x.copy()
        v = system.initial_velocity() if v is None else v.copy()
        v[system.supported] = 0.0
        system.drive(0.0, x, v)
        if self._links:
            self._links.refuse_stretched(x)
            self._links.hold(x, v)
        if self._massless:
            self._massless.settle(x, v, *scales(system))
        return super().start(x, v)

    def _enter(self, course):
        self._drift = course.constraint_drift  # written to at the end of each step
        super()._enter(course)

    def _made(self, **options):
        from sksundae.ida import IDA

        n, heavy, links = self.unknowns, len(self._heavy), 2 * self._count
        position, velocity = self.tolerance()
        return IDA(
            self.residual,
            atol=np.concatenate([position, velocity[self._heavy], np.full(links, UNTESTED)]),
            algebraic_idx=np.concatenate([np.setdiff1d(self._bare, self._inner), n + heavy + np.arange(links)])
            .astype(int)
            .tolist(),
            **options,
        )

    def _initial(self, t, x, v):
        heavy, rest = self._heavy, np.zeros(self._count)
        rows = self._rows(t, np.concatenate([x, v[heavy]]), np.concatenate([v, v[heavy]]))
        system = self.system.at(t, rows[0]) if self.system.net.flows else self.system
        force = self.system.force(t, *rows)
        if system is not self.system:
            force += self.system.material_flow.force(t, *rows)
        slope = multipliers = np.zeros(0)
        if self._links:
            slope, multipliers = self._links.start(*rows, force)
        elif len(heavy):
            slope = system.mass.moved_by(force).ravel()[system.free[heavy]]
        rate = v.copy()
        if self.rotations:
            self.rotations.set_rates(*rows, rate)
        if len(inner := self._inner):
            rate[inner] = force.ravel()[self.system.free[inner]] / self.system.resistance(t)
        return np.concatenate([x, v[heavy], multipliers, rest]), np.concatenate([rate, slope, rest, rest])

    # A solver's steps

    def _one_step(self, stop, end):
        try:
            reached = super()._one_step(stop, end)
        except Stopped:
            self._refuse_adrift()
            raise
        if self._massless or self._links:
            self._inspect(reached, self._end.y, self._end.yp)
        return reached

    def _inspect(self, t, y, yp):
        """Check the end of a step: positions of nodes without mass, and errors of the lengths of links."""
        x, v = self._rows(t, y, yp)
        if self._links:
            self._drift[:] = np.maximum(self._drift, self._links.drift(x, v))
        if self._massless:
            tension = self.system.forces(t, x, v).per_cell.tension[self._massless.around]
            if self._adrift[1] or not tension.min() > 0.0:
                self._tangent(t, y, yp)
            self._refuse_adrift()

    def _refuse_adrift(self):
        t, name = self._adrift
        if name:
            from .massless_nodes import REMEDY

            raise SolverError(
                f"{name} has lost its position by t = {t:.6g} s: it has no mass, and no tension holds it any more; "
                f"{REMEDY}"
            ) from None

    def spent(self, course):
        """Statistics of a run, and the `constraint_drift` of its steps: of lengths [1], and of their rates [m/s]."""
        drift = {"constraint_drift": course.constraint_drift.tolist()} if self._links else {}
        return {**super().spent(course), **drift}

    def hold(self, x, v):
        """Move a state to the nearest one with the lengths of the links."""
        super().hold(x, v)
        if self._links:
            self._links.hold(x, v)

    def interpolated(self, t):
        """Unknown displacements and velocities at a time within the last step."""
        values = self._solution(t)
        return self._parts(values.y)[0], self._velocity(values.y, values.yp)
