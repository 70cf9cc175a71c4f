"""Momentum balance: impulses of external forces must equal the change of momentum, or the run is refused.

At every history row the momentum of free nodes and bodies is compared with that at the start plus the impulses of
supports and of all other external forces. Dead loads and gravity have impulses in closed form, independent of the
steps: their factors are piecewise linear, with an exact antiderivative. Damping in proportion to mass has −rate Σ m Δx.
Therefore the balance finds a load that steps have omitted or applied twice. Follower loads and the inertia forces of a
rotating frame have no such formula. They are *integrated along the steps* with the weights of the method, as are the
forces of supports and of fixed bodies: there the balance only checks the method with its forces. The momentum of mass
that follows a reel is that which the steps bring.

The angular momentum about the centre of mass, with that of rotating bodies, has a balance as well, if there is no
support and all forces are internal or have no moment about it, such as gravity. A ring keeps its plane, which takes
moments: with rings only the part along their normal counts, and none if their normals differ. Friction of lines that do
not roll leaves moments to their torsion; with such friction there is no balance of angular momentum.

Central differences and splittings close the balance to rounding: each kick applies exactly its forces, and the
trapezoidal rule of the kicks is exact for linear factors. Damping uses the mean of the velocities at the ends of steps,
while positions move by those in their middles. With equal steps h the sums differ by ¼ h² (a(end) − a(start)) with
accelerations a, which the balance includes. Methods with tolerances satisfy their equations within these, and the
impulse of supports is that of Simpson's rule: they close the balance within `allowed`.

The book does not see what gives no impulse to all of the web, though it moves parts of it: natural lengths that reels
and temperature change, pressure inside of a closed line. Nor does it see [[motion]], whose impulse is that of supports.

May change: private functions. Must stay: fields of `MomentumBalance`, which checkpoints keep; the paragraph above on
what the book does not see, which a test reads; `CLOSURE`, `ROUNDINGS` and `allowed`, by which runs are refused. An
effect from outside brings `Balance.impulse`, or is integrated along the steps. Kernels are called by `explicit_loop`,
`rows` and `simpson_balance`, which follow their arguments. Must stay as well: all names that `simpson_balance`,
`explicit_loop` and other files import; public names of `Outside`, which other files use. Tests:
``tests/dynamics/test_momentum_balance.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Self

import numpy as np

from ...errors import EnergyDriftError
from ...kernels import (
    IMPULSE,
    INDICES,
    MATRIX,
    Arrays,
    Functions,
    ImpulseTable,
    IndexTable,
    Integers,
    Matrix,
    MatrixTable,
    Record,
    Vector,
    kernel,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...system.system import System
    from .records import ForceTerms

CLOSURE = 1e-6
"""Largest momentum that an explicit run may miss, over the largest of the run.

It is that of 1e4 roundings of 1e-16 in each of 1e6 steps if all have one sign. A web whose momentum is below this share
of what its stiffness makes of roundings is at rest. A larger value would miss more, a smaller one refuse long runs."""
ROUNDINGS = 8.0 * np.finfo(float).eps
"""Force that each line may have too much by rounding, over its EA."""


def allowed(rtol):
    """Largest share of its momentum that a method of order 2 with a relative tolerance may miss.

    Its errors go with the tolerance to the power 2/3, and momentum is a sum of velocities, whose errors mostly cancel.
    """
    return max(CLOSURE, rtol ** (2.0 / 3.0))


class MomentumBalance(Record):
    """Momentum balance of a run.

    Attributes
    ----------
    first : ndarray, shape (2, 3)
        Momentum [N s], and angular momentum along the axes of `Outside.axes` [N m s], at the start.
    given : ndarray, shape (3,)
        Values of the formulas of impulses at the start [N s].
    pushed : ndarray, shape (3,)
        Impulse of forces that are integrated along the steps [N s].
    left, largest : ndarray, shape (2,)
        Of momentum [N s] and angular momentum [N m s], over all rows: the largest that is left when all is subtracted
        that is known to have come in, and the largest that parts of the system have, whatever their direction.
    """

    first: Matrix
    given: Vector
    pushed: Vector
    left: Vector
    largest: Vector

    @classmethod
    def empty(cls) -> Self:
        """Make the balance of a run that has not begun."""
        return cls(np.zeros((2, 3)), np.zeros(3), np.zeros(3), np.zeros(2), np.zeros(2))

    @property
    def drifts(self) -> NDArray[np.float64]:
        """Residual over the largest value, of momentum and of angular momentum [1]; 0 where there is none."""
        return np.divide(self.left, self.largest, out=np.zeros(2), where=self.largest > 0.0)


class Outside(Record):
    """External forces, as the momentum balance needs them.

    Attributes
    ----------
    impulses, cells, data : table
        Kernel of the impulse of each term that has one, and its numbers.
    damped : ndarray of int
        Those of them that depend on velocity.
    pushing : ndarray of int
        Terms that are integrated along the steps.
    places : ndarray, shape (linear rows, 3)
        Reference positions [m], about their mean.
    mass : ndarray, shape (linear rows,)
        Lumped mass [kg].
    inverse_reach : ndarray, shape (rows of rotation,)
        Momentum of the parts of a body over its angular momentum, at least [1/m].
    axes : ndarray, shape (axes, 3)
        Unit vectors along which angular momentum is kept.
    rounding : float
        Force that roundings are worth [N].
    """

    impulses: ImpulseTable
    cells: IndexTable
    data: MatrixTable
    damped: Integers
    pushing: Integers
    places: Matrix
    mass: Vector
    inverse_reach: Vector
    axes: Matrix
    rounding: float

    @classmethod
    def of(cls, system: System) -> Self:
        """Make the record of a system."""
        net, linear = system.net, system.rows - system.net.spins
        outer = [(i, term) for i, term in enumerate(system.terms) if not term.balance.internal]
        known = [term for _, term in outer if term.balance.impulse is not None]
        damped = [i for i, term in enumerate(known) if term.velocity.damping is not None]
        return cls(
            impulses=Functions(IMPULSE, [term.balance.impulse for term in known]),
            cells=Arrays(INDICES, [term.cells for term in known]),
            data=Arrays(MATRIX, [term.data for term in known]),
            damped=np.array(damped, dtype=np.int64),
            pushing=np.array(pushing_terms(system.terms), dtype=np.int64),
            places=net.points[:linear] - net.points[:linear].mean(axis=0),
            mass=net.mass[:linear],
            inverse_reach=_inverse_reach(net),
            axes=kept_axes(system),
            rounding=float(ROUNDINGS * net.line_data.ea.sum()),
        )


def pushing_terms(terms):
    """Numbers of the terms whose force is integrated along the steps."""
    return [i for i, term in enumerate(terms) if not term.balance.internal and term.balance.impulse is None]


def _inverse_reach(net):
    """Inverse distance from the centre of a body to its furthest part, by row of rotation [1/m]."""
    inverse_reach = np.zeros(net.spins)
    for body in net.bodies:
        if body.spin is not None:
            furthest = max([body.extent, *np.linalg.norm(body.points, axis=1)])
            inverse_reach[body.spin - (len(net.points) - net.spins)] = 1.0 / furthest
    return inverse_reach


def kept_axes(system):
    """Unit vectors along which the angular momentum about the centre of mass is kept, shape (axes, 3)."""
    kept = all(f.balance.moment_free or (f.balance.internal and not f.balance.twists) for f in system.terms)
    if system.fixed.any() or system.net.flows or not kept:
        return np.zeros((0, 3))
    normals = np.array([body.axes[2] for body in system.net.bodies if body.shape.planar]).reshape(-1, 3)
    if not len(normals):
        return np.eye(3)
    return normals[:1] if np.abs(np.cross(normals, normals[0])).max() <= ROUNDINGS else np.zeros((0, 3))


@kernel(leaf=True, apart=())
def impulse_until(t: float, x: Matrix, outside: Outside, total: Vector) -> None:
    """Write the impulse of all that has a formula, but for a constant, to ``total (3,)``."""
    total[:] = 0.0
    for i in range(len(outside.impulses)):
        outside.impulses[i](t, x, outside.cells[i], outside.data[i], total)


@kernel(apart=("damped",))
def add_half_steps(by: float, outside: Outside, inverse: Matrix, f: Matrix, pushed: Vector) -> None:
    """Add the impulse of damping over displacements of ``by`` times the accelerations."""
    ahead, total = np.empty_like(f), np.zeros(3)
    for r in range(f.shape[0]):
        for k in range(3):
            ahead[r, k] = by * inverse[r, k] * f[r, k]
    for i in outside.damped:
        outside.impulses[i](0.0, ahead, outside.cells[i], outside.data[i], total)
    for k in range(3):
        pushed[k] += total[k]


@kernel(apart=("pushing",))
def set_push(t: float, x: Matrix, v: Matrix, outside: Outside, terms: ForceTerms, extra: Matrix, push: Vector) -> None:
    """Write the force of what is integrated along the steps to ``push (3,)``; ``extra`` takes that on every row."""
    extra[:], push[:] = 0.0, 0.0
    for i in outside.pushing:
        terms.forces[i](t, x, v, extra, terms.cells[i], terms.data[i], terms.outs[i])
    for r in range(outside.mass.size):
        for k in range(3):
            push[k] += extra[r, k]


@kernel(apart=("pushing",))
def push_on(
    t: float,
    before: float,
    behind: float,
    x: Matrix,
    v: Matrix,
    outside: Outside,
    terms: ForceTerms,
    extra: Matrix,
    push: Vector,
    pushed: Vector,
) -> None:
    """Integrate over two kicks: a time with the push ahead of a drift, and one with that behind it, at time t."""
    for k in range(3):
        pushed[k] += before * push[k]
    set_push(t, x, v, outside, terms, extra, push)
    for k in range(3):
        pushed[k] += behind * push[k]


@kernel(apart=("angular",))
def turning(x: Matrix, p: Matrix, outside: Outside, turned: Vector) -> tuple[float, float]:
    """Write the angular momentum about the centre of mass along the axes; the sum of its parts' sizes [N m s].

    The part of momenta ``p`` that moves with the centre of mass is left out, since it adds nothing to the sum.
    """
    places, mass, axes = outside.places, outside.mass, outside.axes
    total, size, far = 0.0, 0.0, 0.0
    centre, momentum, arm, relative = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3)
    for r in range(mass.size):
        total += mass[r]
        for k in range(3):
            centre[k] += mass[r] * (places[r, k] + x[r, k])
            momentum[k] += p[r, k]
    turned[:] = 0.0
    for r in range(p.shape[0]):
        if r < mass.size:
            for k in range(3):
                arm[k] = places[r, k] + x[r, k] - centre[k] / total
                relative[k] = p[r, k] - mass[r] / total * momentum[k]
            a0 = arm[1] * relative[2] - arm[2] * relative[1]
            a1 = arm[2] * relative[0] - arm[0] * relative[2]
            a2 = arm[0] * relative[1] - arm[1] * relative[0]
            reach = math.sqrt(arm[0] ** 2 + arm[1] ** 2 + arm[2] ** 2)
            far = max(far, reach)
            size += reach * math.sqrt(relative[0] ** 2 + relative[1] ** 2 + relative[2] ** 2)
        else:
            a0, a1, a2 = p[r, 0], p[r, 1], p[r, 2]
            size += math.sqrt(a0 * a0 + a1 * a1 + a2 * a2)
        for n in range(axes.shape[0]):
            turned[n] += axes[n, 0] * a0 + axes[n, 1] * a1 + axes[n, 2] * a2
    return size, far


@kernel(apart=())
def open_balance(x: Matrix, p: Matrix, outside: Outside, ledger: MomentumBalance) -> None:
    """Note momentum, angular momentum and impulses at t = 0; ``p`` is M v of all rows that are free."""
    impulse_until(0.0, x, outside, ledger.given)
    for r in range(outside.mass.size):
        for k in range(3):
            ledger.first[0, k] += p[r, k]
    if outside.axes.shape[0]:
        turning(x, p, outside, ledger.first[1])


@kernel(apart=())
def note_momentum(
    t: float,
    x: Matrix,
    p: Matrix,
    support: Vector,
    outside: Outside,
    ledger: MomentumBalance,
    floor: float,
    row: Vector,
) -> None:
    """Hold the momenta ``p`` of a row against the book, and write momentum and impulses to ``row (9,)``.

    ``support`` is the impulse of the supports, ``floor`` the momentum that a drift is held against at least.
    """
    size = floor + outside.rounding * t / CLOSURE
    moving = size
    for k in range(3):
        row[k] = 0.0
    impulse_until(t, x, outside, row[6:])
    for r in range(outside.mass.size):
        for k in range(3):
            row[k] += p[r, k]
            moving += abs(p[r, k])
    for r in range(outside.inverse_reach.size):
        for k in range(3):
            moving += outside.inverse_reach[r] * abs(p[outside.mass.size + r, k])
    left = 0.0
    for k in range(3):
        row[3 + k] = support[k]
        row[6 + k] += ledger.pushed[k] - ledger.given[k]
        moving += abs(row[3 + k]) + abs(row[6 + k])
        left = max(left, abs(row[k] - ledger.first[0, k] - row[3 + k] - row[6 + k]))
    ledger.left[0], ledger.largest[0] = max(ledger.left[0], left), max(ledger.largest[0], moving)
    if outside.axes.shape[0]:
        note_turning(x, p, outside, ledger, size)


@kernel(apart=("angular",))
def note_turning(x: Matrix, p: Matrix, outside: Outside, ledger: MomentumBalance, size: float) -> None:
    """Hold the angular momentum of momenta ``p`` against the book, and a drift against that of ``size`` at least."""
    now, left = np.zeros(3), 0.0
    total, far = turning(x, p, outside, now)
    for n in range(outside.axes.shape[0]):
        left = max(left, abs(now[n] - ledger.first[1, n]))
    ledger.left[1], ledger.largest[1] = max(ledger.left[1], left), max(ledger.largest[1], total + far * size)


def refuse_open_momentum(course, limit, remedy):
    """Refuse a whole run whose momentum or angular momentum drifts by more than a limit; `EnergyDriftError`."""
    for name, drift in zip(("momentum", "angular momentum"), course.ledger.drifts.tolist(), strict=True):
        if not drift <= limit:
            raise EnergyDriftError(
                f"{name} drift {drift:.3g} of the largest {name} of the run, limit {limit:g}: what supports and loads "
                f"gave does not add up to it; {remedy}",
                drift,
            )
