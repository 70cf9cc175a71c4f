"""Bodies that a thread runs over: spheres, cylinders and rings, and how it lies on them in the web's position.

May change: `INSIDE`, `EVEN` and the formulas in `Around.wrap` and `winding_length`, which must give the same length as
the kernels of `winding`. Must stay: keys and docstring of `Around` (scene format and help; after a change write
``validation/REFERENCE.md`` anew), fields of `Wrap`, numbers in `KINDS` and of `STRAIGHT`, `SPHERE` and `CYLINDER`,
which kernels of `winding` read, and `steady`, `check_route` and `refuse_free`, which `winding`, `thread` and
`system.static_system` call. Tests: ``tests/effects/test_around.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..errors import InputError
from ..messages import quote
from ..tables import Several, Table, integer, table, text, vector

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ..net.net import Net
    from ..net.rigid_body import RigidBody

STRAIGHT, SPHERE, CYLINDER = 0, 1, 2
"""Kinds of segments."""
KINDS = {"Sphere": SPHERE, "Cylinder": CYLINDER, "Ring": CYLINDER}
"""Shapes that a thread may run over."""
INSIDE = 1e-6
"""Depth of a node in a body that counts as rounding, over its radius."""
EVEN = 1e-9
"""Sine of an angle that counts as rounding."""


@table
class Around(Table):
    """A body that a thread runs over between two nodes, without friction.

    The thread lies on the surface along its shortest line, and leaves it where it does not touch. A cylinder or a ring
    counts as endless along its axis; on a sphere the thread goes the short way. The body is pressed by the thread. It
    may be fixed, moved, or on an axle; in dynamics a sphere or a ring may be free. The axis of a cylinder keeps its
    direction. Nodes of the thread begin outside of the body, and nothing keeps one off that is pulled into it. Mass of
    the thread stays at its nodes, and pictures draw it straight from node to node.

    Each end of what runs over a cylinder stays within half a turn about the axis of where it is in the web, or, on a
    body that turns about its axle, of where this takes it: so all turns are counted, and a thread that has left the
    body comes back to it on the side on which it left.

    Parameters
    ----------
    body : str
        Name of the body. In the ``nodes`` of the thread it stands between two nodes.
    side : sequence of 3 float, optional
        Direction from the axis of a cylinder or a ring to the middle of what lies on it. A sphere has none.
    turns : int
        Full turns in addition, on a cylinder or a ring.

    Raises
    ------
    InputError
        For a body that there is not or is of another shape, a node inside of it, a side that is missing, along the axis
        or across the thread, and a side or turns on a sphere.

    Examples
    --------
        [[thread]]
        name = "rope"
        nodes = [0, "pulley", 8]
        around = [{ body = "pulley", side = [0.0, 0.0, -1.0], turns = 2 }]
        modulus = 1e9
        area = 1e-5
        density = 970.0
    """

    body: str = text(limit=80)
    side: Several = vector(default=None)
    turns: int = integer(default=0, at_least=0)

    def wrap(self, net: Net, segment: int, first: int, second: int) -> Wrap:
        """The thread from one node to another as it lies on the body in the web's position."""
        body = net.body_of(self.body, "around.body")
        name, centre = type(body.shape).__name__, net.points[body.row]
        if name not in KINDS:
            raise InputError(
                f"around.body = {quote(self.body)} is a {name.lower()}, must be a sphere, a cylinder or a ring: let a "
                "chain of lines touch it by [contact]"
            )
        shape: Any = body.shape
        ends, axes, radius = net.points[[first, second]] - centre, body.axes, shape.radius
        across = ends - np.outer(ends @ axes[2], axes[2]) if KINDS[name] == CYLINDER else ends
        for node, away in zip((first, second), np.linalg.norm(across, axis=1), strict=True):
            if away < radius * (1.0 - INSIDE):
                raise InputError(
                    f"node {node} is {away:g} m from the middle of body {quote(self.body)}, must be ≥ its radius of "
                    f"{radius:g} m"
                )
        azimuths = np.arctan2(across @ axes[1], across @ axes[0])
        if KINDS[name] == SPHERE:
            if self.side is not None or self.turns:
                key = "turns" if self.side is None else "side"
                raise InputError(f"around.{key} has no meaning on a sphere, which takes the short way: leave it out")
            angle = 0.0
        else:
            angle = self._angle(azimuths, axes)
        length = winding_length(KINDS[name], ends, radius, axes[2], angle)
        return Wrap(self.body, segment, np.array([*azimuths, angle]), length)

    def _angle(self, azimuths, axes):
        """Signed angle by which the thread goes around the axis from its first end to its second."""
        if self.side is None:
            raise InputError(
                "around.side is missing: give the direction from the axis of the body to the middle of what lies on "
                "it, such as side = [0, 0, 1]"
            )
        toward = axes[:2] @ self.side
        if np.hypot(*toward) <= EVEN * np.linalg.norm(self.side):
            raise InputError(f"around.side = {quote(self.side)} must not be along the axis of the body")
        angle = (azimuths[1] - azimuths[0]) % (2.0 * math.pi)
        share = math.cos(azimuths[0] + 0.5 * angle - math.atan2(toward[1], toward[0]))
        if abs(share) <= EVEN:
            raise InputError(f"around.side = {quote(self.side)} is across the thread: turn it to where the thread lies")
        angle = angle if share > 0.0 else angle - 2.0 * math.pi
        return angle + math.copysign(2.0 * math.pi * self.turns, angle)


class Wrap(NamedTuple):
    """A segment of a thread on a body, in the web's position.

    Attributes
    ----------
    body : str
        Name of the body.
    segment : int
        Number of the segment.
    angles : ndarray, shape (3,)
        Azimuths of its two nodes about the third axis of the body, and the angle between them along the thread [rad].
    length : float
        Length from node to node [m].
    """

    body: str
    segment: int
    angles: NDArray[np.float64]
    length: float


def check_route(listed: Sequence[int | str], around: Sequence[Around], closed: bool) -> None:
    """Refuse bodies of a thread that do not stand between two nodes of its list, or are given twice."""
    names = [over.body for over in around]
    if isinstance(listed, str):
        raise InputError(f"nodes = {quote(listed)} must be a list, in which the bodies of around stand between nodes")
    for i, name in enumerate(names):
        if name in names[:i]:
            raise InputError(f"around[{i}].body = {quote(name)} is listed twice: one table is of all its places")
        if name not in listed:
            raise InputError(f"around[{i}].body = {quote(name)} is not in nodes: put it between two nodes there")
    for i, name in enumerate(listed):
        last = i + 1 == len(listed)
        if name in names and (i == 0 or last and not closed or not last and listed[i + 1] in names):
            raise InputError(f"nodes[{i}] = {quote(name)} is a body, which stands between two nodes: put a node there")


def winding_length(
    kind: int, ends: NDArray[np.float64], radius: float, axis: NDArray[np.float64], angle: float
) -> float:
    """Length of the shortest line on a body from end to end [m]; ``ends (2, 3)`` are from its middle."""
    up = ends @ axis if kind == CYLINDER else np.zeros(2)
    across = ends - np.outer(up, axis)
    far = np.linalg.norm(across, axis=1)
    if kind == SPHERE:
        angle = math.atan2(float(np.linalg.norm(np.cross(*ends))), float(ends[0] @ ends[1]))
    lies = abs(angle) - float(np.arccos(np.minimum(radius / far, 1.0)).sum())
    if lies <= 0.0:
        return float(np.linalg.norm(ends[1] - ends[0]))
    tangents = float(np.sqrt(np.maximum(far**2 - radius**2, 0.0)).sum())
    return math.hypot(tangents + radius * lies, up[1] - up[0])


def steady(net: Net, name: str) -> tuple[RigidBody, NDArray[np.float64]]:
    """(The body of a name, vector from its base to the middle of its shape [m]), which keeps its axis and this vector.

    A body whose axis turns, or whose middle is not its centre of mass, is refused.
    """
    body = net.body_of(name)
    given: Any = body.shape
    shape, axis = type(given).__name__.lower(), body.axes[2]
    off = net.points[body.row] + body.offset @ body.axes - net.points[body.base]
    aside = off - (off @ body.axle.direction) * body.axle.direction if body.axle else off
    if np.linalg.norm(aside) > EVEN * given.radius:
        why = "an axle beside its middle" if body.axle else "nodes whose mass moves its centre of mass"
        raise InputError(f"around.body = {quote(name)} has {why}, which a thread over it does not take")
    if KINDS[type(body.shape).__name__] == CYLINDER and not body.fixed and not body.shape.planar:
        along = body.axle is not None and np.linalg.norm(np.cross(body.axle.direction, axis)) <= EVEN
        if body.turns and not along:
            direction = [round(number, 6) for number in axis.tolist()]
            raise InputError(
                f"around.body = {quote(name)} is a {shape} that turns; the axis under a thread keeps its direction: "
                f'give axle = {{ direction = {direction} }}, or take shape = "ring" or "sphere"'
            )
    return body, off


def refuse_free(net: Net) -> None:
    """Refuse free bodies that threads run over, which statics does not place."""
    for thread in net.threads:
        for wrap in thread.wraps:
            body = net.body_of(wrap.body)
            if not (body.prescribed or body.axle):
                raise InputError(
                    f'body {quote(wrap.body)} is free, and statics does not place a free body under a thread, "'
                    f'{thread.name}": give it an axle, move it by [[motion]], or use [solve] kind = "dynamic" with '
                    'start = "web"'
                )
