"""Static equilibrium by Newton's method on the potential energy, from any start.

The tangent of a flat net without tension is singular. Here the Newton matrix is K + τ G, where G is the geometric
stiffness of a *unit tension in every line*. The fictitious prestress τ vanishes as the iteration converges. G resists
relative motion alone, so that the first step already has the shape of a loaded membrane. On the square web of 1677
nodes under 1 N, the shift τG takes 7 or 8 factorizations from flat for every smoothing from 1e-2 to 0. A shift of the
diagonal takes 15 or 16. A line search on the energy makes every step a descent. Lines under compression make K
indefinite. If the shifted pivots of K are not all positive, its positive semidefinite part is used instead. In a
rotating frame τ grows until they are positive, because the positive semidefinite part would omit most of K.

A step turns lines, which stretches them by the square of the angle. Lines are stiff, so that this stretch dominates
their tensions after the step, and a tangent with these tensions is far from that of the equilibrium. Therefore, if all
lines are tension-only, the geometric stiffness uses the tensions to first order in the step, T + k δl (Magisano,
Leonetti and Garcea, Comput. Methods Appl. Mech. Eng. 313, 2017, doi:10.1016/j.cma.2016.10.023). Forces and energies use
the actual tensions, so that the equilibria are the same. A hexagon web of 40 000 cells takes 14 steps from flat in this
way, and 45 steps without.

A bar that is slightly slack has no stiffness. A step may stretch it by hundreds of times its slack, and the line search
then cuts the step to a few hundredths. Therefore, in a start from flat, slack bars get the stiffness of a smooth law,
which decreases with the residual. The first load step of triangle webs with 30 150, 120 300 and 270 450 unknowns takes
8, 10 and 11 factorizations with this stiffness, and 11, 14 and 15 without. Webs of squares and hexagons have hardly any
slack bars and take equally many.

Free bodies turn by rotation vectors, see `refweb.system.resting_bodies`. A step turns none by more than `MOST_TURN` of
`refweb.system.system`, in contact moves none by more than half its thickness, and τ does not fall where it is cut so;
it grows until pivots are positive, as in a frame that turns. Of 100 boxes on 2 to 5 random ropes, half of them slack,
all are solved, with 29 factorizations in the middle and 141 at most. With the positive semidefinite part in place of a
larger τ one takes 399: it has next to no stiffness about an axis about which a box turns at no cost.

Bars that buckle lead past saddles of the energy. The positive semidefinite part leads towards a saddle as well as away
from it, at a few per cent of the residual a step. Where steps are so slow, the web also moves along the direction of
the negative eigenvalue next to 0 of the tangent. Of 18 cases of a triangle web of bars whose boundary moves in, all end
at a minimum; without this move 5 end at no equilibrium in 400 factorizations, and 2 at a saddle.

A factorization that is near enough is used again, by conjugate gradients with the matrix of the step, see
`refweb.system.conjugate_gradients`: of webs of 40 000 cells five load steps with their error bounds take 12
factorizations by rslab (squares, 118 803 unknowns), 13 (triangles) and 22 (hexagons), by SuperLU, whose solutions cost
less beside them, 10, 13 and 20. One load on squares takes 7. In units of one factorization by SuperLU, one load costs
10 by SuperLU, 6 by `refweb.system.multifrontal` and 4 by rslab. By fronts that is 2.4 for 7 factorizations with their
order, 2.4 for solutions and 1 for pattern, tangents, searches and bounds. Five loads cost 18, 15 and 9, with 190
solutions. Forces without a potential have an unsymmetric tangent, its LU and a search of their own, see
`refweb.statics.residual_search`.

May change: constants and the choice of steps: they change numbers of factorizations, and results within the residual.
Must stay: `solve` accepts a state by the residual of `equilibrium` alone; public attributes and methods of `Newton`,
which `load_steps`, `lowest`, `interior_point`, `shared_push`, `smoothing_error` and `adjoint` use; keys of ``stats``.
Tests: ``tests/statics/test_reused_factorization.py``, ``test_statics.py``.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..system import conjugate_gradients
from ..system.factorization import Factor, Lu
from .bars import Bars
from .energy_search import EnergySearch
from .equilibrium import LIMIT, TOLERANCE, Equilibrium, NotFound, check_supported, force_scale, residual
from .floating import NullSpace

SMALL = 1000
"""Number of unknowns below which every step has a new factorization, since it costs little."""
NEAR = 0.1
"""Residual up to which the factorization of a tangent may be used again in the next steps."""
SETTLED = 1e-3
"""Residual below which tangents use the actual tensions and τ is proportional to the residual: the last steps then
converge quadratically."""
LENT, FADES = 0.1, 3.0
"""η of the stiffness of slack bars in a start from flat, over the mean strain of taut bars. It decreases with the
second factor times the residual, where this product is below 1."""
CLOSE, END = 1e-4, 1e-14
"""Least relative tolerance of conjugate gradients in a step; residual that the last step aims at."""
LONGEST = 5_000_000
"""Largest number of coordinates in a path."""
ROUGH = 0.03
"""Relative tolerance of conjugate gradients for deviations, which are estimates."""


class Ahead(NamedTuple):
    """Tension of every bar in a tangent [N], and η of the stiffness of slack bars over the mean strain of taut bars."""

    tension: np.ndarray
    lent: float


class Iterate(NamedTuple):
    """Displacement [m] and force [N] of every row, both of shape (rows, 3), and tension of every element [N]."""

    x: np.ndarray
    force: np.ndarray
    tension: np.ndarray


class Newton:
    """Globalised Newton iteration on one system; keeps pattern, factorization and scale between load steps.

    Parameters
    ----------
    system : refweb.system.system.System
        With a net whose ``quasi_static`` is True.
    progress : callable, optional
        Called with a line of text after each iteration.
    first : float, optional
        Load step whose natural lengths set prestress and scales; by default the natural lengths as built.

    Attributes
    ----------
    follows : bool
        True if there are forces without a potential, or struts of form finding, whose potential has no minimum.
    turns : bool
        True if centrifugal forces act; ``drifting`` is the number of negative pivots that they bring to an equilibrium.
    grows : bool
        True if τ grows until the tangent is definite: where centrifugal forces act, and where bodies are free.
    anchors : ndarray of int
        Indices of diagonal entries that anchor parts without support, on which the loads balance.
    scale : float
        Largest force of the equilibria so far [N].
    path : list of ndarray
        Displacements of all iterates since `start_path` [m], where bodies that are free may touch the web; empty if
        they are larger than `LONGEST` numbers.
    """

    def __init__(self, system, progress=None, first=None):
        self.system, self._per_cell, self._blocks = system, system.per_cell(), system.blocks()
        self.progress = progress or (lambda text: None)
        first_system = system if first is None else system.at(first)
        net = first_system.net
        self.geometric = first_system.across_lines(np.ones(len(net.cells)))
        self.stiffest = (net.axial / net.natural_length).max()
        self.axial = net.axial.max()
        struts = (net.forming & (net.line_data.ea < 0.0)).any()
        self.follows, self.turns, self.drifting = bool(struts) or not system.conservative, bool(system.rotating), 0
        self.grows = self.turns or bool(system.resting)
        self.factor = (Lu if self.follows else Factor)(system.pattern)
        if self.turns:
            from .critical_speed import drifting

            self.drifting = drifting(system)
        anchors = np.concatenate([np.zeros(0, dtype=int), *(part.unknowns for part in system.unsupported_parts)])
        self.anchors = system.pattern.diagonal[anchors]
        self.scale = 0.0
        self.start_path()

    def start_path(self, path=()):
        """Forget the iterates so far, or begin with those of a ``path``."""
        self.path = list(path)
        self._followed = self.system.contact and bool(self.system.resting)

    def _follow(self, x):
        """Add an iterate to the path."""
        if self._followed:
            self.path.append(x)
            if len(self.path) * x.size > LONGEST:
                self.path, self._followed = [], False

    def solve(self, t, x, warm=False, limit=200):
        """Equilibrium at load step t from the displacement x.

        Parameters
        ----------
        t : float
            Load step.
        x : ndarray, shape (rows, 3)
            Start [m].
        warm : bool
            True if x is near an equilibrium, as after a load step. The first prestress τ is then 1e-4 of the tension
            scale of a flat net, (load/EA)^(2/3) EA.
        limit : int
            Largest number of factorizations.

        Returns
        -------
        Equilibrium

        Raises
        ------
        SolverError
            Where there is no equilibrium, or none is found.
        """
        system = self.system
        check_supported(system, t)
        x, net = x.copy(), system.at(t).net
        system.drive(t, x)
        stats: dict = dict(nsteps=0, nfev=0, njev=0, nlu=0)
        iterate, search = self._evaluated(t, x, stats), self._search(t, x)
        self._follow(x)
        scale, best, last, made = self._scale(t, iterate), np.inf, np.inf, np.inf
        shift = self.axial * min(max((scale / self.axial) ** (2 / 3), 1e-9), 1e-2) * (1e-4 if warm else 1.0)
        ahead = None
        while True:
            scale = self._scale(t, iterate)
            error = residual(system, iterate.force, scale)
            if not np.isfinite(error):
                node = np.argmax(~np.isfinite(iterate.force).all(axis=1))
                raise NotFound(
                    f"non-finite force at step {t:g}, node {node}: Newton's method went too far; raise the load in "
                    'smaller load_steps, or method = "relaxation"',
                    stats,
                )
            if error <= TOLERANCE or (error <= LIMIT and error > 0.5 * best):
                break
            best = min(best, error)
            if max(stats["nlu"], stats["nsteps"]) >= limit:
                raise self._not_found(t, iterate, error, limit, stats)
            if error < SETTLED:
                shift = max(shift * error / SETTLED, min(shift, 1e-12 * self.axial))
            r = iterate.force.ravel()[system.free]
            if ahead is not None and not warm:
                ahead = ahead._replace(lent=LENT * min(1.0, FADES * error))
            again, lower = error < 0.5 * last and (warm or made <= NEAR), None
            p = self._step_by_factor_at_hand(t, iterate, r, shift, error, stats, ahead) if again else None
            if p is None:
                slow = 0.5 * last < error < SETTLED
                (p, shift, lower), made = self._step(t, iterate, r, shift, stats, ahead, slow), error
            x, shift = search.along(p, iterate.x, r, shift, stats)
            if lower is not None:
                x = search.down(lower, x, r, stats)
            if system.convex and error > SETTLED and iterate.tension.any():
                ahead = self._tension_ahead(net, iterate.x, x, p, ahead)
            else:
                ahead = None
            iterate, last = self._evaluated(t, x, stats), error
            self._follow(x)
            stats["nsteps"] += 1
            self.progress(f"step {t:g}, residual {error:.0e}")
        if stats["nsteps"]:
            iterate = self._polished(t, iterate, shift, error, scale, stats)
            error = residual(system, iterate.force, scale)
        stats["residual"] = float(error)
        self.scale = self._scale(t, iterate)
        return Equilibrium(t, iterate.x, iterate.tension, iterate.force, stats)

    def _evaluated(self, t, x, stats):
        """The `Iterate` at x."""
        force, per_cell = self.system.forces(t, x, per_cell=self._per_cell)
        stats["nfev"] += 1
        return Iterate(x, force, per_cell.tension.copy())

    def _scale(self, t, iterate):
        """Scale of the residual at an `Iterate` [N]."""
        return max(self.scale, force_scale(self.system, t, iterate.x, iterate.tension))

    def _search(self, t, x) -> Any:
        if not self.follows:
            return EnergySearch(self.system, t, x)
        from .residual_search import ResidualSearch

        return ResidualSearch(self.system, self.factor, t)

    def _matrix(self, t, x, shift, definite, ahead=None):
        values = self.system.stiffness(t, x, definite=definite, blocks=self._blocks)
        values += shift * self.geometric
        if ahead is not None:
            bars = Bars(self.system.at(t).net, x)
            values += self.system.assemble_lines(bars.besides(ahead.tension, bars.lent(ahead.lent)))
        values[self.anchors] += 1e-10 * self.stiffest
        return values

    def _factorize(self, values, shift):
        """Factorize; the factorization can be used again where it has a shift."""
        self.factor.update(values, None if self.system.pattern.size < SMALL else shift)

    def _tension_ahead(self, net, x, y, p, before):
        """The `Ahead` of the bars after a part of the step p from x to y, to first order; no tension is negative.

        ``before`` is the `Ahead` of the tangent of the step, None where that used the tensions at x.
        """
        bars, all_rows = Bars(net, x), self.system.rows_of(p)
        before = bars.tension if before is None else before.tension
        share = (y - x).ravel()[self.system.free] @ p / (p @ p)
        return Ahead(before + share * (bars.ahead(all_rows) - before), 0.0)

    def _step(self, t, iterate, r, shift, stats, ahead, slow):
        """Newton step of the shifted tangent, and the shift that it took.

        Where steps are ``slow`` and the tangent has negative pivots, also a direction of negative curvature, else None.
        """
        compressed = bool((iterate.tension < 0.0).any()) and not (self.follows or self.grows)
        definite, lower = False, None
        for _ in range(60):
            values = self._matrix(t, iterate.x, shift, definite, ahead)
            self._factorize(values, None if definite else shift)
            stats["njev"] += 1
            stats["nlu"] += 1
            if compressed and not definite and self.factor.negative_pivots():
                definite = True
                lower = self._negative_curvature(values, r) if slow and r.size > 2 else None
                continue
            p = self.factor.solve(r)
            if self._descends(r, p):
                return p, shift, lower
            shift = max(4.0 * shift, 1e-12 * self.axial)
        row = self.system.sizes(np.where(self.system.supported, 0, iterate.force)).argmax()
        along = "xyz"[np.abs(iterate.force[row]).argmax()]
        raise NotFound(
            f"singular tangent at step {t:g}: the largest force that nothing balances is on "
            f"{self.system.row_name(row)}, {np.abs(iterate.force[row]).max():.4g} N along {along}: balance the loads, "
            "add a support, or start nearer",
            stats,
            iterate.x,
        )

    def _step_by_factor_at_hand(self, t, iterate, r, shift, error, stats, ahead):
        """Newton step by the factorization of an earlier tangent; None if that takes long or leads uphill."""
        if not self._can_use_again(iterate.tension):
            return None
        stats["njev"] += 1
        values = self._matrix(t, iterate.x, shift, False, ahead)
        change = self._by_factor_at_hand(values, r, np.clip(error, CLOSE, NEAR))
        return change.y if change.enough and r @ change.y > 0.0 else None

    def _can_use_again(self, tension):
        """Tell if a tangent is at hand, and that of lines in tension, without follower or centrifugal forces."""
        return self.factor.shift is not None and not (self.follows or self.grows or (tension < 0.0).any())

    def _by_factor_at_hand(self, values, b, tolerance):
        """Solutions with the matrix of ``values``, shape (n,) or (n, k), by conjugate gradients."""
        times = self.system.pattern.matrix(values).__matmul__
        return conjugate_gradients.solve(times, self.factor.precondition, b, tolerance, self.factor.solutions)

    def _negative_curvature(self, values, r):
        """Direction of the negative eigenvalue next to 0 of a factorized matrix, None where it is not found."""
        from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

        matrix = self.system.pattern.matrix(values)
        inverse = LinearOperator(matrix.shape, matvec=self.factor.precondition)
        try:
            value, d = eigsh(matrix, 1, sigma=0.0, which="SA", OPinv=inverse, v0=r, tol=1e-2)
        except ArpackError:
            return None
        return d[:, 0] if value[0] < 0.0 else None

    def _descends(self, r, p):
        """Tell if p is a step to take: one that exists, leads down, and, with `grows`, by a definite tangent."""
        if p is None or self.follows:
            return p is not None
        return r @ p > 0.0 and not (self.grows and self.factor.negative_pivots() > self.drifting)

    def _polished(self, t, iterate, shift, error, scale, stats):
        """Take one more step with the last factorization; keep it where it lowers the residual."""
        r = iterate.force.ravel()[self.system.free]
        if self._can_use_again(iterate.tension):
            p = self._by_factor_at_hand(
                self._matrix(t, iterate.x, shift, False), r, np.clip(END / error, CLOSE, NEAR)
            ).y
        else:
            p = self.factor.solve(r)
        if p is None:
            return iterate
        next_iterate = self._evaluated(t, self.system.moved(iterate.x, self.system.rows_of(p)), stats)
        return next_iterate if residual(self.system, next_iterate.force, scale) < error else iterate

    def _remedy(self):
        """Remedy for a load step without an equilibrium, in words."""
        net = self.system.net
        if net.law_is("plastic").any():
            return "above the limit load of lines that yield there is none: lower the loads, or raise yield_stress"
        smoothing = " use a larger smoothing," if net.law_is("smoothed").any() else ""
        contact = " a smaller stiffness of [contact]," if self.system.contact else ""
        return f'raise the load in smaller load_steps,{smoothing}{contact} or use method = "relaxation"'

    def _not_found(self, t, iterate, error, limit, stats):
        row = self.system.sizes(np.where(self.system.supported, 0, iterate.force)).argmax()
        at = self.system.row_name(row)
        return NotFound(
            f"no equilibrium found at step {t:g} in {limit} factorizations: residual {error:.2e} at {at}, limit "
            f"{LIMIT:g}; {self._remedy()}",
            stats,
            iterate.x,
        )

    @property
    def _tiny(self):
        """Tension of all lines and threads that counts as none [N]."""
        return 1e-12 * max([self.axial, *(float(thread.line.axial[0]) for thread in self.system.net.threads)])

    def factorize_at(self, state):
        """Factorize K at an equilibrium, plus a negligible stiffness."""
        self._factorize(self._matrix(state.step, state.x, self._tiny, False), self._tiny)
        state.stats["nlu"] += 1

    def smallest_pivot(self, t, x, stats):
        """Sign of the smallest pivot of K: −1 for a saddle, 0 where K is singular to rounding, 1 for a minimum."""
        for shift, sign in ((-self._tiny, 1), (self._tiny, 0)):
            self._factorize(self._matrix(t, x, shift, False), shift)
            stats["nlu"] += 1
            if self.factor.negative_pivots() <= self.drifting:
                return sign
        return -1

    def deviations(self, state):
        """`Equilibrium.deviations`: displacements under the residual and under rounding errors of random sign.

        Rounding of a line's ends and of its tension leaves a force of machine precision times T + k |x| at its nodes.
        Moves without stiffness are left out; they follow from the duality bound or, without one, from the null space of
        the tangent. So is slip that turns back over a ring with friction, which resists it.
        """
        system, asked = self.system, self.follows or state.stats.get("smallest_pivot") is not None
        if not asked and (by_factor := self._deviations_by_factor_at_hand(state)) is not None:
            return by_factor
        if not asked:
            self.factorize_at(state)
        solve = self.factor.solve
        if (state.stability is None or state.stability.loose) and len(system.free):
            null = NullSpace(self.factor, self._tiny * system.pattern.matrix(self.geometric))
            if not system.convex:
                state.floating = null.floating(system, state.x)
            if state.floating is not None or any(any(thread.friction) for thread in system.net.threads):
                solve = null.solve
        deviations = [solve(force) for force in self.disturbing(state)]
        return None if any(p is None for p in deviations) else np.array([system.rows_of(p) for p in deviations])

    def _deviations_by_factor_at_hand(self, state):
        """Deviations by the last factorization, if the duality bound proves that no part floats; else None."""
        if state.duality_bound is None or state.floating is not None or not self._can_use_again(state.tension):
            return None
        forces = np.column_stack(self.disturbing(state))
        deviation = self._by_factor_at_hand(self._matrix(state.step, state.x, self._tiny, False), forces, ROUGH)
        if not deviation.enough:
            return None
        return np.array([self.system.rows_of(p) for p in deviation.y.T])

    def disturbing(self, state):
        """Forces on the unknowns [N]: the residual, and three times the rounding errors with random signs."""
        system, net = self.system, self.system.net
        stiffness = net.axial / system.natural_length(state.step)
        moved = np.linalg.norm(state.x, axis=1)[net.cells].max(axis=1)
        size = np.zeros(system.rows)
        np.add.at(size, net.cells, np.finfo(float).eps * (np.abs(state.tension) + stiffness * moved)[:, None])
        for number, thread in system.threads.items():
            far = np.linalg.norm(state.x[thread.rows], axis=1).max()
            tension = system.forces(state.step, state.x).per_cell[number][0, 0]
            strained = abs(tension) + thread.stiffness * far
            np.add.at(size, thread.rows, np.finfo(float).eps * strained)
        forces = np.zeros((3, system.rows, 3))
        forces.reshape(3, -1)[:, system.free] = np.random.default_rng(0).choice((-1.0, 1.0), (3, len(system.free)))
        forces *= size[:, None]
        for force in forces if system.carriers else ():
            signs = np.random.default_rng(1).choice((-1.0, 1.0), (np.count_nonzero(system.carried), 3))
            force[system.carried] = signs * size[system.carried, None]
            system.carriers.add_forces_to_bodies(state.x, force)
        return [force.ravel()[system.free] for force in (state.force, *forces)]
