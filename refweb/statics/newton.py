"""Static equilibrium by Newton's method on the potential energy, from any start.

The tangent of a flat tensionless net is singular, and load stepping or a diagonal shift starts from nothing. Here the
Newton matrix is K + τ G, where G is the geometric stiffness of a *unit tension in every line*: a fictitious prestress τ
that leaves as the iteration converges. It resists relative motion, not motion, so that the first step already has the
shape of a loaded membrane. On the square web of 1677 nodes under 1 N the shift τG takes 7 or 8 factorizations from
flat for every smoothing from 1e-2 to 0, where a shift of the diagonal takes 15 or 16. A line search on the energy makes
every step a descent. Lines under compression make K indefinite: K itself is used where its shifted pivots are positive,
its positive semidefinite part where they are not. In a frame that turns τ grows instead until they are: there the part
that is left out would be most of K. Forces without a potential have an LU and a search of their own, see
`refweb.statics.follower_loads`.

An equilibrium exists unless the net can be carried off, a part of it without support in a direction in which the forces
on it do not balance, or turns too fast, see `refweb.statics.critical_speed`. `check_supported` looks before anything is
solved.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..errors import InputError, SolverError
from ..net.net import AXIAL_STIFFNESS, G0
from ..net.tension_laws import LINEAR, TENSION_ONLY
from ..system.factorization import Factor

TOLERANCE = 1e-10
"""Residual at which Newton stops; `LIMIT` is what it may end at when rounding allows no further step."""
LIMIT = 1e-9
PATIENCE = 3000
"""Largest number of factorizations of the smooth law where the central path has led to nothing."""
SOFTEST = 1e-2
"""Load over EA of the first net of those that grow stiffer."""


class NotFound(SolverError):
    """An equilibrium exists but the iteration did not reach it; ``stats`` tells what it spent."""

    def __init__(self, message, stats):
        super().__init__(message)
        self.stats = stats


@dataclass(eq=False)
class Equilibrium:
    """One state of statics.

    Attributes
    ----------
    step : float
        Load step.
    x : ndarray, shape (rows, 3)
        Displacement of every row [m].
    tension : ndarray, shape (cells,)
        Tension of every element [N].
    force : ndarray, shape (rows, 3)
        Resultant force on every row [N]; at a support the negative of the reaction.
    stats : dict
        ``nsteps`` iterations, ``nfev`` force and energy evaluations, ``njev`` tangents, ``nlu`` factorizations,
        ``residual`` [1], ``smallest_pivot`` (its sign, None where not asked for).
    certificate : refweb.statics.duality_bound.Certificate, optional
        Bounds on energy and tension, for the tension-only law.
    deviations : ndarray, shape (k, rows, 3), optional
        Displacements by which x may be off [m]: the first what is left of the residual, the others what the rounding of
        forces may come to; None where the tangent is singular.
    """

    step: float
    x: np.ndarray
    tension: np.ndarray
    force: np.ndarray
    stats: dict = field(default_factory=dict)
    certificate: object = None
    deviations: object = None


def check_supported(system, t):
    """Refuse a load that no support carries, a frame that turns too fast, and links."""
    if system.constraints:
        raise InputError('[[link]] needs kind = "dynamic" and method = "ida": statics does not hold lengths')
    outer = system.outer_force(t)
    for rows, axis in system.loose:
        resultant = np.sum(outer[rows, axis])
        if abs(resultant) > 1e-12 * np.abs(outer[rows]).sum() > 0:
            first = ", ".join(map(str, rows[:4])) + (", ..." if len(rows) > 4 else "")
            remedy = "support one of them"
            if system.turns:
                remedy += ", or move the web so that its centre of mass is on the axis of [frame]"
            raise SolverError(
                f"no equilibrium: a mechanism of {len(rows)} nodes ({first}) is carried off along {'xyz'[axis]} by "
                f"{resultant:.4g} N at step {t:g}, with no support in that direction: {remedy}"
            )
    if system.turns:
        from .critical_speed import check_speed

        check_speed(system, t)


def force_scale(system, t, x, tension):
    """What residuals are measured against [N]: the largest of nodal load, weight and contact, and of tension.

    At least 1/`LIMIT` of what rounding of the displacements makes of EA, which is more than those where a net is slack
    under loads below 1e-7 EA.
    """
    stiffness = system.net.line_data[:, AXIAL_STIFFNESS] / system.net.natural_length
    rounding = np.finfo(float).eps * stiffness.max() * np.abs(x).max()
    outer = [f for f in system.families if f.cells is not system.net.cells]
    loads = [np.linalg.norm(system.force_of(f, t, x), axis=1).max() for f in outer]
    return max([*loads, np.abs(tension).max(initial=0.0), rounding / LIMIT])


def residual(system, force, scale):
    """Largest force on a free node over the scale [1]."""
    free = np.where(system.supported, 0.0, force)
    return np.linalg.norm(free, axis=1).max(initial=0.0) / scale if scale else 0.0


class Newton:
    """Energy-globalised Newton iteration on one system; keeps pattern and factorization between load steps."""

    def __init__(self, system, progress=None):
        self.system = system
        self.progress = progress or (lambda text: None)
        net = system.net
        unit = np.einsum("q,qa,qb->ab", net.weights, net.gradients, net.gradients)
        blocks = np.kron(unit, np.eye(3))[None] / net.natural_length[:, None, None]
        self.geometric = system.assemble_lines(blocks)
        self.stiffest = (net.line_data[:, AXIAL_STIFFNESS] / net.natural_length).max()
        self.axial = net.line_data[:, AXIAL_STIFFNESS].max()
        self.follows, self.turns, self.drifting = not system.conservative, system.turns, 0
        if self.follows:
            from .follower_loads import Lu

            self.factor = Lu(system.pattern)
        else:
            self.factor = Factor(system.pattern)
        if self.turns:
            from .critical_speed import drifting

            self.drifting = drifting(system)
        number = np.full(3 * system.rows, -1)
        number[system.free] = np.arange(len(system.free))
        held = np.concatenate([[], *(number[3 * rows + axis] for rows, axis in system.loose)]).astype(int)
        self.loose = system.pattern.diagonal[held]  # places that hold what floats, whose loads balance
        self.scale = 0.0

    def _matrix(self, t, x, shift, definite):
        values = self.system.stiffness(t, x, definite=definite)
        values += shift * self.geometric
        values[self.loose] += 1e-10 * self.stiffest
        return values

    def _step(self, t, x, r, shift, compressed, stats):
        """Newton step of the shifted tangent, and the shift that it took."""
        definite = False
        for _ in range(60):
            self.factor.update(self._matrix(t, x, shift, definite))
            stats["njev"] += 1
            stats["nlu"] += 1
            if compressed and not definite and self.factor.negative_pivots():
                definite = True
                continue
            p = self.factor.solve(r)
            if self._descends(r, p):
                return p, shift
            shift = max(4.0 * shift, 1e-12 * self.axial)
        raise NotFound(f"singular tangent at step {t:g}: no shift up to {shift:.3g} N makes it definite", stats)

    def _descends(self, r, p):
        """Whether p is a step to take: one that exists, leads down, and, in a frame that turns, from no saddle."""
        if p is None or self.follows:
            return p is not None
        return r @ p > 0.0 and not (self.turns and self.factor.negative_pivots() > self.drifting)

    def smallest_pivot(self, t, x, stats):
        """Sign of the smallest pivot of K: −1 for a saddle, 0 where K is singular to rounding, 1 for a minimum."""
        tiny = 1e-12 * self.axial
        for shift, sign in ((-tiny, 1), (tiny, 0)):
            self.factor.update(self._matrix(t, x, shift, False))
            stats["nlu"] += 1
            if self.factor.negative_pivots() <= self.drifting:
                return sign
        return -1

    def deviations(self, state):
        """`Equilibrium.deviations`: what the tangent makes of the residual and of rounding, of either sign at random.

        Rounding of a line's ends and of its tension leaves a force of machine precision times T + k |x| at its nodes.
        """
        system, net, sign = self.system, self.system.net, state.stats.get("smallest_pivot")
        if sign is None:
            self.factor.update(self._matrix(state.step, state.x, 1e-12 * self.axial, False))
            state.stats["nlu"] += 1
        stiffness = net.line_data[:, AXIAL_STIFFNESS] / net.natural_length
        moved = np.linalg.norm(state.x, axis=1)[net.cells].max(axis=1)
        size = np.zeros(system.rows)
        np.add.at(size, net.cells, np.finfo(float).eps * (np.abs(state.tension) + stiffness * moved)[:, None])
        signs = np.random.default_rng(0).choice((-1.0, 1.0), (3, len(system.free)))
        forces = [state.force.ravel()[system.free], *(signs * np.repeat(size, 3)[system.free])]
        found = np.zeros((len(forces), system.rows, 3))
        for deviation, force in zip(found, forces, strict=True):
            if sign == 0 or (p := self.factor.solve(force)) is None:
                return None
            deviation.ravel()[system.free] = p
        return found

    def solve(self, t, x, warm=False, most=200):
        """Equilibrium at load step t from the displacement x.

        Parameters
        ----------
        t : float
            Load step.
        x : ndarray, shape (rows, 3)
            Start [m].
        warm : bool
            Whether x is near an equilibrium, as after a load step: the first prestress τ is then 1e-4 of the one that
            (load/EA)^(2/3) EA suggests, the tension scale of a flat net.
        most : int
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
        x = x.copy()
        system.drive(t, x)
        stats = dict(nsteps=0, nfev=1, njev=0, nlu=0)
        force, out = system.forces(t, x)
        tension = out[0][:, 0].copy()
        scale = max(self.scale, force_scale(system, t, x, tension))
        shift = self.axial * min(max((scale / self.axial) ** (2 / 3), 1e-9), 1e-2) * (1e-4 if warm else 1.0)
        energy, best = system.energy(t, x), np.inf
        while True:
            r = force.ravel()[system.free]
            scale = max(self.scale, force_scale(system, t, x, tension))
            error = residual(system, force, scale)
            if not np.isfinite(error):
                raise SolverError(f"non-finite force at step {t:g}, node {np.argmax(~np.isfinite(force).all(axis=1))}")
            if error <= TOLERANCE or (error <= LIMIT and error > 0.5 * best):
                break
            best = min(best, error)
            if stats["nlu"] >= most:
                node = np.linalg.norm(np.where(system.supported, 0, force), axis=1).argmax()
                raise NotFound(
                    f"no equilibrium found at step {t:g} in {most} factorizations: residual {error:.2e} at node "
                    f"{node}, limit {LIMIT:g}; raise the load in smaller load_steps, use a larger smoothing, or "
                    'method = "relaxation"',
                    stats,
                )
            compressed = bool((tension < 0.0).any()) and not (self.follows or self.turns)
            p, shift = self._step(t, x, r, shift, compressed, stats)
            if self.follows:
                from .follower_loads import search

                x, shift = search(system, self.factor, t, x, p, shift, stats)
            else:
                x, energy, shift = self._search(t, x, p, r @ p, energy, shift, stats)
            force, out = system.forces(t, x)
            tension = out[0][:, 0].copy()
            stats["nsteps"] += 1
            stats["nfev"] += 1
            self.progress(f"step {t:g}, residual {error:.0e}")
        if stats["nlu"]:
            x, force, tension, error = self._polished(t, x, force, tension, error, scale, stats)
        stats["residual"] = float(error)
        self.scale = max(self.scale, force_scale(system, t, x, tension))
        return Equilibrium(t, x, tension, force, stats)

    def _polished(self, t, x, force, tension, error, scale, stats):
        """One more step with the factorization at hand, kept where it lowers the residual."""
        system, y = self.system, x.copy()
        p = self.factor.solve(force.ravel()[system.free])
        if p is not None:
            y.ravel()[system.free] += p
            new_force, out = system.forces(t, y)
            stats["nfev"] += 1
            new_error = residual(system, new_force, scale)
            if new_error < error:
                return y, new_force, out[0][:, 0].copy(), new_error
        return x, force, tension, error

    def _search(self, t, x, p, slope, energy, shift, stats):
        """Line search along p: on the energy, or on its slope once energy differences drown in rounding."""
        system, a = self.system, 1.0
        y = x.copy()
        flat, drowned = y.ravel(), 0.5 * slope < 1e-9 * abs(energy)
        start = x.ravel()[system.free]
        for _ in range(40):
            flat[system.free] = start + a * p
            trial = system.energy(t, y)
            stats["nfev"] += 1
            if drowned:
                here = system.force(t, y).ravel()[system.free] @ p
                if here >= -0.9 * slope:
                    break
                a *= 0.5
                continue
            rise = trial - energy + a * slope
            if trial <= energy - 1e-4 * a * slope:
                break
            a *= min(max(0.5 * a * slope / rise, 0.1), 0.5) if np.isfinite(rise) else 0.1
        if a < 1.0:
            return y, trial, 4.0 * shift
        good = drowned or energy - trial > 0.25 * 0.5 * slope
        return y, trial, 0.1 * shift if good else shift


def _add(stats, other):
    for key in ("nsteps", "nfev", "njev", "nlu"):
        stats[key] += other.get(key, 0)
    return stats


def _by_interior_point(newton, t, x, spent):
    """Equilibrium from the central path; the nearer its end, the better Newton's start."""
    from .interior_point import InteriorPoint

    inner = InteriorPoint(newton.system, t, x, newton.loose)
    for tolerance in (1e-7, 1e-11, 1e-16):
        start = inner.follow(tolerance)
        try:
            state = newton.solve(t, start, warm=True, most=15 if tolerance > 1e-16 else 200)
        except NotFound as error:
            _add(spent, error.stats)
            if tolerance == 1e-16:
                raise
        else:
            break
    _add(spent, {"nsteps": inner.nlu, "njev": inner.nlu, "nlu": inner.nlu})
    return state


def _by_stiffening(newton, t, x, spent):
    """Equilibrium from those of softer nets, in which no line snaps taut; slack parts turn far under tiny loads."""
    system, data = newton.system, newton.system.net.line_data
    own, load = data[:, AXIAL_STIFFNESS].copy(), np.abs(system.outer_force(t)).max()
    softer = SOFTEST * newton.axial / load if load > 0.0 else 1.0
    try:
        while softer > 1.0:
            data[:, AXIAL_STIFFNESS] = own / softer
            state = Newton(system, newton.progress).solve(t, x)
            _add(spent, state.stats)
            x, softer = state.x, softer / 10.0
    finally:
        data[:, AXIAL_STIFFNESS] = own
    return newton.solve(t, x, warm=True)


def _by_patience(newton, t, x):
    """Equilibrium of the smooth law by many small steps; where none is found, the message says how slack lines push."""
    try:
        return newton.solve(t, x, most=PATIENCE)
    except NotFound as error:
        data = newton.system.net.line_data
        push = f"{(data[:, AXIAL_STIFFNESS] * data[:, G0]).max():.3g} N"
        text = f'{error}, or law = "tension-only": slack lines push with up to {push}'
        raise NotFound(text, error.stats) from None


def solve(system, load_steps, progress=None):
    """Equilibria at load steps, one after another, each from the one before.

    Where Newton's method finds none from the last state, the interior point of `refweb.statics.interior_point` leads
    there if all loads are dead; then a series of softer nets, for the tension-only law, or many small steps, for the
    smooth one.

    Parameters
    ----------
    system : refweb.system.system.System
        With a net whose ``quasi_static`` is True.
    load_steps : sequence of float
        Values of t.
    progress : callable, optional
        Called with a line of text after each iteration.

    Yields
    ------
    Equilibrium

    Raises
    ------
    SolverError
        Where there is no equilibrium, or none is found; the states before have been yielded.
    """
    system = system.at_rest()
    system.prepare(load_steps[0])
    newton, x = Newton(system, progress), np.zeros((system.rows, 3))
    for k, t in enumerate(load_steps):
        spent = dict(nsteps=0, nfev=0, njev=0, nlu=0)
        path = system.net.law.number != LINEAR and system.dead
        convex = system.net.law.number == TENSION_ONLY and not newton.turns
        try:
            state = newton.solve(t, x, warm=k > 0, most=25 if path else 400)
        except NotFound as error:
            if not path:
                raise
            _add(spent, error.stats)
            try:
                state = _by_interior_point(newton, t, x, spent)
            except NotFound:
                if convex:
                    state = _by_stiffening(newton, t, x, spent)
                else:  # slack lines that push fold up, one after another
                    state = _by_patience(newton, t, x)
        if not (convex or newton.follows):
            state.stats["smallest_pivot"] = newton.smallest_pivot(t, state.x, state.stats)
        _add(state.stats, spent)
        state.deviations = newton.deviations(state)
        if system.convex:
            from ..statics import duality_bound as certificate

            state.certificate = certificate.certify(system, state, newton.factor)
        x = state.x
        yield state
