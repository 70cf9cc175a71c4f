"""Equilibria: their states, the residual by which they are judged, and loads that have none.

An equilibrium exists unless the net can be carried off, a part of it without support in a direction in which the forces
on it do not balance, or turns too fast, see `refweb.statics.critical_speed`. `check_supported` looks before anything is
solved.

May change: words of messages, `UNBALANCED`, `WITH_A_WAY_AROUND`. Must stay: fields of `Equilibrium` and `Stability`,
which statics, studies and `results.observables` read by name; keys of ``stats``, which `simulation` copies into
``run.json`` by `results.solution.SOLVER`. `TOLERANCE`, `LIMIT` and `force_scale` change digits of all statics. Must
stay as well: all names that `shared_push`, `load_steps` and other files import. Tests:
``tests/statics/test_statics.py``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..errors import InputError, SolverError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ..system.system import System
    from .duality_bound import DualityBound
    from .floating import Floating

TOLERANCE = 1e-10
"""Residual at which an iteration stops; `LIMIT` is what it may end at when rounding allows no further step."""
LIMIT = 1e-9
UNBALANCED = 0.5
"""Share of a torque that is left where an iteration has ended from which on the web cannot balance it."""
WITH_A_WAY_AROUND = 25
"""Largest number of factorizations of Newton's method where an interior point can take over."""


class NotFound(SolverError):
    """An equilibrium exists but the iteration did not reach it; ``stats`` tells what it spent, ``x`` where it ended."""

    def __init__(self, message, stats, x=None):
        super().__init__(message)
        self.stats, self.x = stats, x


class Stability(NamedTuple):
    """Stability of an equilibrium, as far as it is known.

    Attributes
    ----------
    sign : {-1, 0, 1, None}
        −1 if the tangent has negative stiffness or a disturbance grows, 0 if some direction has no stiffness to
        rounding, 1 if the equilibrium is stable, None if that is not decided.
    why : str
        Reason in words: the cause of the instability for −1, the missing information for None.
    gyroscopic : bool
        True if only Coriolis forces make the equilibrium stable; damping in the frame would end this.
    loose : bool
        True if some direction may have no stiffness.
    """

    sign: int | None
    why: str = ""
    gyroscopic: bool = False
    loose: bool = False


@dataclass(eq=False)
class Equilibrium:
    """Equilibrium of one load step.

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
        ``residual`` [1], ``smallest_pivot``, the sign of `stability`.
    stability : Stability, optional
        Stability; None where the energy is convex, so that the equilibrium is stable.
    may_turn_over : bool
        True if there may be other equilibria because lines can push, see `refweb.statics.snap_through`.
    contact_shares : ndarray, optional
        Shares of elements in the push of spheres, see `refweb.statics.shared_push`; None where none share.
    path : sequence of ndarray
        Displacements of all rows on the way from the load step before [m], each near the next; empty where they are not
        kept.
    duality_bound : refweb.statics.duality_bound.DualityBound, optional
        Bounds of energy and tension, for the tension-only law.
    deviations : ndarray, shape (k, rows, 3), optional
        Possible errors of x [m]: the first from the residual, the others from the rounding of forces. Moves without
        stiffness are left out. None where there is no tangent.
    floating : refweb.statics.floating.Floating, optional
        Components that may move without stiffness; None where there are none, or where that is not known.
    """

    step: float
    x: NDArray[np.float64]
    tension: NDArray[np.float64]
    force: NDArray[np.float64]
    stats: dict[str, Any] = field(default_factory=dict)
    duality_bound: DualityBound | None = None
    deviations: NDArray[np.float64] | None = None
    floating: Floating | None = None
    stability: Stability | None = None
    may_turn_over: bool = False
    contact_shares: NDArray[np.float64] | None = None
    path: Sequence[NDArray[np.float64]] = ()

    def system_of(self, system: System) -> System:
        """The system whose forces balance: the one that is given, or where elements share a push with these shares."""
        if self.contact_shares is None:
            return system
        from ..system.contact_shares import with_shares

        return with_shares(system, self.contact_shares)


def add_spent(stats, more):
    """Add the counts of another iteration to ``stats``."""
    for key in ("nsteps", "nfev", "njev", "nlu"):
        stats[key] += more.get(key, 0)


def add_proofs(system, state, factor=None):
    """Add to an `Equilibrium` the bounds that duality proves, and the parts that float.

    ``factor`` is a `refweb.system.factorization.Factor` that is used again.
    """
    if system.bounded:
        from .duality_bound import duality_bound

        state.duality_bound = duality_bound(system, state, factor)
    if system.convex:
        from .floating import between_slack_lines

        state.floating = between_slack_lines(system, state)
    elif system.net.law_is("plastic").any():
        from .monotone_loading import add_bounds

        add_bounds(system, state, factor)


def check_supported(system, t):
    """Refuse a load that no support carries, a frame that rotates too fast, and links."""
    if system.constraints:
        raise InputError('[[link]] needs kind = "dynamic" and method = "ida": statics does not hold lengths')
    if carried := carried_off(system, t, system.unsupported_parts):
        if system.rotating:
            kind = system.rotating[0].name
            balanced = {"frame": "the axis", "orbit": "the track"}[kind]
            carried += f", or move the web so that its centre of mass is on {balanced} of [{kind}]"
        raise SolverError(f"no equilibrium: {carried}")
    _check_torques(system, t)
    if system.rotating:
        from .critical_speed import check_speed

        check_speed(system, t)


def _torque_on(body, t):
    """Torque about the axle of a body at a load step [N m]."""
    return float(np.interp(t, *np.transpose(body.axle.torque))) if body.axle and body.axle.torque else 0.0


def turned_on(system, t, x):
    """Text on a body whose torque the web does not balance at x, None without one."""
    force = system.forces(t, x).force
    for body in system.resting:
        torque = _torque_on(body, t)
        left = float(body.axle.direction @ force[body.spin]) if torque else 0.0
        if left * torque > UNBALANCED * torque**2:
            return (
                f'body "{body.name}" turns on about its axle by its torque of {torque:.4g} N m, of which the web '
                f"balances {100.0 * max(1.0 - left / torque, 0.0):.2g} % where it has come to: lower the torque, or "
                "tie the body to more of the web or farther from its axle by [[attach]]"
            )
    return None


def _check_torques(system, t):
    """Refuse a torque on a body that nothing else turns about its axle."""
    for body in system.resting:
        torque = _torque_on(body, t)
        if torque and not (body.carried or body.pivot is not None or system.contact):
            raise SolverError(
                f'no equilibrium: body "{body.name}" is turned by its torque of {torque:.4g} N m at step {t:g}, and '
                "nothing holds it: tie it to the web by [[attach]], or leave out the torque"
            )


def carried_off(system, t, parts):
    """Text that names a part on which the outer forces do not balance, and the remedy; None where they balance."""
    outer = system.outer_force(t)
    for rows, axis, _ in parts:
        resultant = np.sum(outer[rows, axis])
        if abs(resultant) > 1e-12 * np.abs(outer[rows]).sum() > 0:
            if len(rows) == 1 and rows[0] >= system.net.nodes:
                name = system.row_name(rows[0])
                return (
                    f"{name} is carried off along {'xyz'[axis]} by {resultant:.4g} N at step {t:g}, and nothing holds "
                    "it: tie it to the web by [[attach]], let it touch the web, or fixed = true"
                )
            first = ", ".join(map(str, rows[:4])) + (", ..." if len(rows) > 4 else "")
            return (
                f"a mechanism of {len(rows)} nodes ({first}) is carried off along {'xyz'[axis]} by {resultant:.4g} N "
                f"at step {t:g}, with no support in that direction: support one of them"
            )
    return None


def refuse_half_turns(system, t, x, before):
    """`refweb.effects.half_turns.refuse_half_turns` of a system with threads over bodies."""
    if not any(thread.wraps for thread in system.net.threads):
        return []
    from ..effects.half_turns import refuse_half_turns

    return refuse_half_turns(system, t, x, before)


def with_reason(system, t, error, remedy="", tangents=True):
    """The error with what it may come from: rings together, two contacts alike, or parts that nothing else holds.

    ``remedy`` is another one for two contacts alike; ``tangents`` is True for Newton's method.
    """
    from ..system.unsupported_parts import find_parts
    from .contact_kinks import kink_remark

    if (system.net.threads or system.net.wound) and error.x is not None:
        from .thread_reasons import reason_of

        if (reason := reason_of(system, t, error.x, tangents)) is not None:
            return NotFound(f"no equilibrium found at step {t:g}: {reason}", error.stats)
    if system.contact and error.x is not None and (kink := kink_remark(system, error.x, remedy)) is not None:
        return NotFound(f"no equilibrium found at step {t:g}: {kink}", error.stats)
    if error.x is not None and (turned := turned_on(system, t, error.x)) is not None:
        return NotFound(f"no equilibrium found at step {t:g}: {turned}", error.stats)
    if error.x is not None and (body := gone(system, error.x)) is not None:
        return NotFound(
            f'no equilibrium found at step {t:g}: body "{body.name}" leaves the web, through a mesh or over its rim, '
            "and nothing else holds it: start on the side of the web on which it can rest, take a finer mesh or a "
            "wider web, or tie it to the web by [[attach]]",
            error.stats,
        )
    carried = carried_off(system, t, find_parts(system, touching=False))
    if carried is None:
        return error
    return NotFound(f"{error}; while it touches nothing, {carried}, or start where it touches", error.stats)


def gone(system, x):
    """The first free body that touches nothing and is farther from all nodes than the web is wide; None if none is."""
    position = system.net.points + x
    web = position[: system.net.nodes]
    for body in system.resting if system.contact else []:
        apart = np.linalg.norm(web - position[body.row], axis=1).min(initial=np.inf)
        if body.carried or body.axle or apart < body.thickness + np.linalg.norm(np.ptp(web, axis=0)):
            continue
        if not any(system.force_of(term, 1.0, x)[body.row].any() for term in system.terms if term.contact.felt):
            return body
    return None


def force_scale(system, t, x, tension):
    """Scale of residuals [N]: the largest of nodal load, weight and contact, and of tension.

    The scale is at least 1/`LIMIT` times the force that rounding of the displacements causes. That is the largest of
    all where a net is slack under loads below 1e-7 EA.
    """
    stiffness = system.net.axial / system.natural_length(t)
    rounding = np.finfo(float).eps * stiffness.max() * np.abs(x).max()
    outer = [f for f in system.terms if not f.over_lines]
    loads = [system.sizes(system.force_of(f, t, x)).max() for f in outer]
    return max([*loads, np.abs(tension).max(initial=0.0), rounding / LIMIT])


def residual(system, force, scale):
    """Largest force on a free node or body over the scale [1]."""
    free = np.where(system.supported, 0.0, force)
    return system.sizes(free).max(initial=0.0) / scale if scale else 0.0
