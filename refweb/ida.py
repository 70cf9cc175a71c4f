"""Implicit dynamics by IDA of SUNDIALS, in residual form: with massless nodes and rigid links.

The unknowns are displacements x, velocities v of what has mass, and two multipliers λ, μ of each link:

    x' − v + Gᵀμ = 0        M v' − f(t, x, v) + Gᵀλ = 0        g(x) = 0        G v = 0,        G = ∂g/∂x

In this form of Gear, Gupta and Leimkuhler [1]_ links are of index 2 and do not drift: lengths and their rates are both
among the equations, and μ is 0 but for the error of a step. The error test leaves the multipliers out.

A node without mass has no velocity among the unknowns: its equation is 0 = f, of index 1, and its velocity is x'.
MASSLESS_STUDY

A step solves J z = r with J = ∂F/∂y + c ∂F/∂y'. Eliminating displacements leaves, where there are no links,

    (M + C/c + K/c²) z_v = (r_v − K r_x/c)/c,    z_x = (r_x + z_v)/c

for every node alike, with r_x = 0 for one without mass.

References
----------
.. [1] C. W. Gear, B. Leimkuhler, G. K. Gupta, "Automatic integration of Euler-Lagrange equations with constraints",
   J. Comput. Appl. Math. 12–13 (1985) 77–90, doi:10.1016/0377-0427(85)90008-1.
"""

from __future__ import annotations

import numpy as np

from .cvode import DENSE, LINEAR_SOLVERS, _Symmetric, _Unsymmetric
from .effects import Constraint
from .errors import SolverError
from .implicit import Implicit, _Stopped, scales
from .inputs import InputError

UNTESTED = 1e30
"""Absolute tolerance of multipliers, which takes them out of the error test."""
WEAK = 1e-12
"""Share of the largest entry on the diagonal that a pivot has to exceed."""
STRETCH = 1e-6
"""Largest relative error of a link's length in the state that a run is to start from."""


class Ida(Implicit):
    """IDA on one system.

    Parameters
    ----------
    system, probes, watch, events, rtol, atol_position, atol_velocity
        See `refweb.implicit.Implicit`.
    max_order : int
        Highest order of the BDF, 1 to 5; those above 2 are unstable near the frequencies of a net.
    linear_solver : {"auto", "block", "sparse", "dense"}
        How linear systems are solved, see `refweb.cvode.LINEAR_SOLVERS`; "auto" chooses by size. Links need "sparse"
        or "dense".

    Attributes
    ----------
    choice : str
        Which linear solver is used and why.

    Raises
    ------
    InputError
        For links that hold nothing or too much, or a choice that does not fit.
    """

    method = "ida"

    def __init__(self, system, *observed, max_order=2, linear_solver="auto", **tolerances):
        super().__init__(system, *observed, **tolerances)
        self.max_order = max_order
        mass = np.repeat(system.net.mass, 3)[system.free]
        self._heavy, self._bare = np.flatnonzero(mass > 0.0), np.flatnonzero(mass <= 0.0)
        self._M = system.pattern.matrix(system.mass())
        self._massless = _Massless(system.pattern, self._bare) if len(self._bare) else None
        self._links = _Links(system, self._heavy, self._M) if system.constraints else None
        self._count = len(self._links.pairs.cells) if self._links else 0
        self.linear_solver, self.choice = self._chosen(linear_solver)
        self._product = self._adrift = None

    def _chosen(self, name):
        if name == "block" and self._links:
            raise InputError('[solve] linear_solver = "block" must be "sparse" or "dense" with [[link]]')
        if name != "auto":
            return name, f"{name}, as asked for: {LINEAR_SOLVERS[name]}"
        name = "dense" if self.unknowns <= DENSE else "sparse" if self._links else "block"
        size = f"{self.unknowns} unknowns, {'at most' if name == 'dense' else 'more than'} {DENSE}"
        return name, f"{name}, for {size}{', and links' if self._links else ''}: {LINEAR_SOLVERS[name]}"

    # The residual

    def _parts(self, y):
        """y, or y', as its displacements, velocities, λ and μ."""
        n, m = self.unknowns, self.unknowns + len(self._heavy)
        return y[:n], y[n:m], y[m : m + self._count], y[m + self._count :]

    def _velocity(self, y, yp):
        """Velocity of every unknown displacement [m/s]."""
        v = self._parts(yp)[0].copy()
        v[self._heavy] = self._parts(y)[1]
        return v

    def _state(self, t, y, yp):
        """All rows at a state of the unknowns."""
        system = self.system
        x, v = self._reference.copy(), np.zeros((system.rows, 3))
        x.ravel()[system.free], v.ravel()[system.free] = self._parts(y)[0], self._velocity(y, yp)
        system.drive(t, x, v)
        return x, v

    def _residual(self, t, y, yp, r):
        self.stats["nfev"] += 1
        x, v = self._state(t, y, yp)
        n, heavy, bare = self.unknowns, self._heavy, self._bare
        force = self.system.force(t, x, v)
        rate, (_, own, multipliers, corrections) = self._parts(yp)[0], self._parts(y)
        if self._links:
            pairs = self._links.pairs
            force -= pairs.pull(x, multipliers)
            rate = rate + pairs.pull(x, corrections).ravel()[self.system.free]
            r[n + len(heavy) :] = np.concatenate([pairs.excess(x), pairs.speed(x, v)])
        slope = np.zeros(n)
        slope[heavy] = self._parts(yp)[1]
        balance = self._M @ slope - force.ravel()[self.system.free]
        r[heavy], r[bare], r[n : n + len(heavy)] = rate[heavy] - own, balance[bare], balance[heavy]

    def _tangent(self, t, y, yp):
        """Values of K, and of C or None, at a state."""
        self.stats["njev"] += 1
        x, v = self._state(t, y, yp)
        self._at_state = t, x, v
        K = self.system.stiffness(t, x, v)
        if self._massless:
            weak = self._massless.weak(K)
            self._adrift = None if weak is None else (t, self.system.row_name(self.system.free[weak] // 3))
        return K, self.system.damping(t, x, v)

    # Block elimination

    def _set_up(self, t, y, yp, res, c):
        """Factorize M + C/c + K/c²."""
        system = self.system
        K, C = self._tangent(t, y, yp)
        self._K, self._C = system.pattern.matrix(K), None if C is None else system.pattern.matrix(C)
        self._factored, self._true = c, self._adrift is None
        rest = self._M.data if C is None else self._M.data + C / c
        self.stats["nlu"] += 1
        if not system.symmetric:
            self._factor = _Unsymmetric(system.pattern, rest + K / c**2)
            return
        if self._true:
            self._factor.update(rest + K / c**2)
            self._true = not self._factor.negative_pivots()
        if not self._true:
            self.stats["nlu"] += 1
            values = rest + system.stiffness(*self._at_state, definite=True) / c**2
            values[system.pattern.diagonal[self._bare]] += np.abs(K).max() / c**2
            self._factor.update(values)

    def _precondition(self, t, y, yp, res, r, z, c, delta):
        n, heavy, bare = self.unknowns, self._heavy, self._bare
        if self._product is not None and c == self._factored and self._true:
            z[:] = self._product  # r is J times it, and this inverts just that
            self._product = None
            return
        self._product, c = None, self._factored
        first, second = r[:n].copy(), np.empty(n)
        first[bare], second[bare], second[heavy] = 0.0, r[bare], r[n:]
        velocity = self._factor.apply((second - self._K @ first / c) / c)
        z[:n], z[n:] = (first + velocity) / c, velocity[heavy]

    def _jacobian_times(self, t, y, yp, res, u, Ju, c):
        n, heavy, bare = self.unknowns, self._heavy, self._bare
        self._product = u.copy()
        velocity, slope = c * u[:n], np.zeros(n)
        velocity[heavy], slope[heavy] = u[n:], c * u[n:]
        balance = self._M @ slope + self._K @ u[:n]
        if self._C is not None:
            balance += self._C @ velocity
        Ju[heavy], Ju[bare], Ju[n:] = c * u[heavy] - u[n:], balance[bare], balance[heavy]

    # The whole Jacobian

    def _places(self):
        """Rows and columns of what `_values` holds; where a place stands several times the values add up."""
        n, heavy, pattern = self.unknowns, self._heavy, self.system.pattern
        column = np.repeat(np.arange(n), np.diff(pattern.indptr))
        at = np.arange(n)  # row of M v' − f, and column of v; without mass that of x, whose rate v is
        at[heavy] = n + np.arange(len(heavy))
        self._slid = ~np.isin(column, heavy)
        parts = [(heavy, heavy), (heavy, at[heavy]), (at[pattern.indices], column), (at[pattern.indices], at[column])]
        if self._links:
            parts += self._links.places(heavy, at[heavy], n + len(heavy))
        return (np.concatenate(side) for side in zip(*parts, strict=True))

    def _values(self, t, y, yp, c):
        K, C = self._tangent(t, y, yp)
        self.stats["nlu"] += 1
        slope = c * self._M.data
        if C is not None:
            slope += np.where(self._slid, c, 1.0) * C
        parts = [np.full(len(self._heavy), c), np.full(len(self._heavy), -1.0), K, slope]
        if self._links:
            parts += self._links.values(*self._at_state[1:], self._parts(y)[2])
        return np.concatenate(parts)

    def _options(self):
        from sksundae.ida import IDAJacTimes, IDAPrecond

        if self.linear_solver == "block":
            self._factor = _Symmetric(self.system.pattern)
            precond, times = IDAPrecond(self._set_up, self._precondition), IDAJacTimes(None, self._jacobian_times)
            return dict(linsolver="gmres", krylov_dim=10, precond=precond, jactimes=times)
        (rows, columns), size = self._places(), self.unknowns + len(self._heavy) + 2 * self._count
        if self.linear_solver == "dense":
            place, shape = rows * size + columns, (size, size)
            options = dict(linsolver="dense")
        else:
            from scipy.sparse import csc_matrix

            keys, place = np.unique(columns * size + rows, return_inverse=True)
            shape = keys.shape
            indptr = np.searchsorted(keys, size * np.arange(size + 1)).astype(np.int32)
            pattern = csc_matrix((np.ones(shape), (keys % size).astype(np.int32), indptr), shape=(size, size))
            options = dict(linsolver="sparse", sparsity=pattern)

        def jacobian(t, y, yp, res, c, J):
            J[:] = np.bincount(place, self._values(t, y, yp, c), J.size).reshape(shape)

        return dict(**options, jacfn=jacobian)

    # Consistent initial conditions

    def start(self, x=None, v=None):
        """The `Course` at t = 0.

        Nodes without mass are moved to their equilibrium among all others, and what would stretch links is taken out
        of the velocities with the least kinetic energy.
        """
        system = self.system
        x = np.zeros((system.rows, 3)) if x is None else x.copy()
        v = system.initial_velocity() if v is None else v.copy()
        v[system.supported] = 0.0
        system.drive(0.0, x, v)
        if self._massless:
            self._settle(x, v)
        if self._links:
            self._links.hold(x, v)
        run = super().start(x, v)
        run.constraint_drift = np.zeros(2)
        return run

    def _settle(self, x, v):
        """Write positions and velocities of the nodes without mass into x and v."""
        system, massless, at = self.system, self._massless, self.system.free[self._bare]
        near, fast = scales(system)
        force = system.force(0.0, x, v).ravel()[at]
        for _ in range(50):
            if (weak := massless.weak(system.stiffness(0.0, x, v))) is not None:
                raise InputError(
                    f"{system.row_name(system.free[weak] // 3)} has no position at t = 0: it has no mass, and no "
                    "tension holds it; give density > 0, a [[point_mass]] or a prestrain"
                )
            step, y = massless.solve(force), x.copy()
            for _ in range(30):
                y.ravel()[at] = x.ravel()[at] + step
                found = system.force(0.0, y, v).ravel()[at]
                if np.linalg.norm(found) < np.linalg.norm(force) or np.abs(step).max() < 1e-9 * near:
                    break
                step *= 0.5
            x[:], force = y, found
            if np.abs(step).max() < 1e-7 * near:
                break
        else:
            node = system.row_name(at[np.abs(force).argmax()] // 3)
            raise SolverError(
                f"no equilibrium of nodes without mass at t = 0: a force of {abs(force).max():.3g} N at {node}"
            )
        h = 1e-4 * near / max(np.abs(v).max(), fast)
        now, soon, later = (self._ahead(k * h, x, v).ravel()[at] for k in range(3))
        massless.weak(system.stiffness(0.0, x, v))
        v.ravel()[at] = massless.solve((4.0 * soon - 3.0 * now - later) / (2.0 * h))

    def _ahead(self, h, x, v):
        """Forces a time h later, when all that has mass has moved on with its velocity."""
        y, at = x + h * v, self.system.free[self._bare]
        y.ravel()[at] = x.ravel()[at]
        self.system.drive(h, y)
        return self.system.force(h, y, v)

    def _begin(self, t, x, v):
        from scipy.sparse.linalg import splu
        from sksundae.ida import IDA

        n, heavy, count = self.unknowns, self._heavy, self._count
        rows = self._state(t, np.concatenate([x, v[heavy]]), np.concatenate([v, v[heavy]]))
        force = self.system.force(t, *rows).ravel()[self.system.free][heavy]
        if self._links:
            slope, multipliers = self._links.solve(rows[0], force, -self._links.pairs.turning(rows[1]))
        else:
            slope, multipliers = splu(self._M[heavy][:, heavy].tocsc()).solve(force), np.zeros(0)
        algebraic = np.concatenate([self._bare, n + len(heavy) + np.arange(2 * count)])
        self._solver = IDA(
            self._residual,
            max_order=self.max_order,
            rtol=self.rtol,
            atol=np.repeat([self.atol_position, self.atol_velocity, UNTESTED], [n, len(heavy), 2 * count]),
            algebraic_idx=algebraic.astype(int).tolist(),
            max_num_steps=10_000_000,
            **self._options(),
        )
        y = np.concatenate([x, v[heavy], multipliers, np.zeros(count)])
        self._check(self._solver.init_step(t, y, np.concatenate([v, slope, np.zeros(2 * count)])))

    # A solver's steps

    def _advance(self, stop, last):
        try:
            found = self._check(self._solver.step(last, "onestep", float(stop) if np.isfinite(stop) else None))
        except _Stopped:
            if self._adrift is None:
                raise
            self._lost()
        if self._massless:
            self._tangent(found.t, found.y, found.yp)
            if self._adrift:
                self._lost()
        return float(found.t)

    def _lost(self):
        t, name = self._adrift
        raise SolverError(
            f"{name} has lost its position at t = {t:.6g} s: it has no mass, and no tension holds it any more; give "
            "density > 0, a [[point_mass]] or more prestrain"
        ) from None

    def _interpolated(self, t):
        found = self._check(self._solver.step(t, "normal", None))
        return self._parts(found.y)[0], self._velocity(found.y, found.yp)

    def _check(self, result):
        if result.status < 0:
            raise _Stopped(result.message)
        return result


def _weak(solver):
    """Index of the first pivot of an LDLᵀ factorization that is not positive, None if all are."""
    _, pivots, order = solver.factors()
    bad = np.flatnonzero(~(pivots > 0.0))
    return int(order[bad[0]]) if len(bad) else None


class _Massless:
    """The block of the tangent that belongs to nodes without mass, its diagonal lowered by `WEAK`."""

    def __init__(self, pattern, bare):
        number = np.full(pattern.size, -1)
        number[bare] = np.arange(len(bare))
        row, col = number[pattern.indices], number[np.repeat(np.arange(pattern.size), np.diff(pattern.indptr))]
        self._bare, self._upper = bare, np.flatnonzero((row >= 0) & (row <= col))
        self._diagonal = np.flatnonzero((row == col)[self._upper])
        indptr = np.searchsorted(col[self._upper], np.arange(len(bare) + 1))
        self._structure = row[self._upper].astype(np.int32), indptr.astype(np.int32)
        self._solver = None

    def weak(self, K):
        """Factorize; an unknown that nothing holds, None if all are held."""
        from qdldl import Solver
        from scipy.sparse import csc_matrix

        values = K[self._upper]
        values[self._diagonal] -= WEAK * np.abs(values[self._diagonal]).max()
        self._matrix = csc_matrix((values, *self._structure))
        if self._solver is None:
            self._solver = Solver(self._matrix, upper=True)
        else:
            self._solver.update(self._matrix, upper=True)
        found = _weak(self._solver)
        return None if found is None else self._bare[found]

    def solve(self, b):
        """Solution of the block as it was factorized."""
        return self._solver.solve(b)


class _Links:
    """All links of a system, and the equations M a + Gᵀλ = f, G a = b that hold them, in what has mass and is free.

    Attributes
    ----------
    pairs : refweb.effects.Constraint
        The links, one after another.
    """

    def __init__(self, system, heavy, M):
        given = system.constraints
        cells, data = (np.vstack([getattr(one, name) for one in given]) for name in ("cells", "data"))
        self.pairs = Constraint(cells=cells, data=data)
        table = np.repeat(np.arange(len(given)), [len(one.cells) for one in given]) + 1
        self._names = [f"[[link]] {i} of nodes {a} and {b}" for i, (a, b) in zip(table, cells, strict=True)]
        self._refuse(system)
        self._M, self._at = M[heavy][:, heavy].tocsc(), system.free[heavy]
        number = np.full(3 * system.rows, -1)
        number[self._at] = np.arange(len(heavy))
        unknown = number[3 * cells[:, :, None] + np.arange(3)]  # of (link, end, axis)
        moving = unknown >= 0
        self._link, end, self._axis = np.nonzero(moving)
        self._unknown, self._sign = unknown[moving], 2.0 * end - 1.0
        other = np.full(unknown.shape, -1)
        other[moving] = np.arange(len(self._link))
        self._other = other[:, ::-1][moving]
        self._both = np.flatnonzero(self._other >= 0)
        self._refuse_redundant(np.zeros((system.rows, 3)))

    def _refuse(self, system):
        free = ~system.supported
        driven = np.concatenate([[], *(d.cells[:, 0] for d in system.drives)])
        for name, pair in zip(self._names, self.pairs.cells, strict=True):
            if not free[pair].any():
                raise InputError(f"{name}: both are supported, so that it holds nothing: leave it out")
            for node in pair[np.isin(pair, driven)]:
                raise InputError(
                    f"{name}: node {node} moves by [[motion]], whose jumps of velocity no rigid link can follow: link "
                    "to a free node, tied to it by a line"
                )
            for node in pair[(system.net.mass[pair] <= 0.0) & free[pair].any(axis=1)]:
                raise InputError(f"{name}: node {node} has no mass: give density > 0 or a [[point_mass]]")

    def _refuse_redundant(self, x):
        from qdldl import Solver
        from scipy.sparse import csc_matrix, eye_array, triu

        G = self._gradient(x)
        coupling = G @ (G / self._M.diagonal()).T
        coupling = coupling - WEAK * abs(coupling).max() * eye_array(len(self._names))
        if (weak := _weak(Solver(csc_matrix(triu(coupling)), upper=True))) is not None:
            raise InputError(
                f"{self._names[weak]}: the other links and the supports hold that distance already, so that its force is "
                "not determined: leave it out"
            )

    def _gradient(self, x):
        from scipy.sparse import csr_array

        parts = (self._entries(x), (self._link, self._unknown))
        return csr_array(parts, shape=(len(self._names), len(self._at)))

    def _entries(self, x):
        """∂g/∂x of the ends that move."""
        return self._sign * self.pairs.direction(x)[self._link, self._axis]

    def places(self, position, velocity, first):
        """Rows and columns of what links add to J; λ and μ stand from column ``first`` on."""
        x, v, force = position[self._unknown], velocity[self._unknown], first + self._link
        rate, both = force + len(self._names), self._both
        own, across = (v, x), (v[both], x[self._other[both]])
        return [(v, force), own, across, (x, rate), (force, x), (rate, v), (rate, x)]

    def values(self, x, v, multipliers):
        """Values of what links add to J."""
        G, length = self._entries(x), self.pairs.length[self._link]
        turn = multipliers[self._link] / length
        rate = self._sign * self.pairs.between(v)[self._link, self._axis] / length
        return [G, turn, -turn[self._both], G, G, G, rate]

    def solve(self, x, f, b):
        """a and λ of M a + Gᵀλ = f, G a = b."""
        from scipy.sparse import block_array
        from scipy.sparse.linalg import splu

        G = self._gradient(x)
        found = splu(block_array([[self._M, G.T], [G, None]], format="csc")).solve(np.concatenate([f, b]))
        return found[: len(f)], found[len(f) :]

    def hold(self, x, v):
        """Move x and v to the nearest state that keeps the lengths, as mass weighs distance."""
        none = np.zeros(len(self._at))
        off = self.pairs.excess(x) / self.pairs.length
        worst = int(np.abs(off).argmax())
        if not abs(off[worst]) < STRETCH:
            raise InputError(f"{self._names[worst]}: the start has it stretched by {off[worst]:.3g} of its length")
        for _ in range(2):
            x.ravel()[self._at] += self.solve(x, none, -self.pairs.excess(x))[0]
        v.ravel()[self._at] += self.solve(x, none, -self.pairs.speed(x, v))[0]
