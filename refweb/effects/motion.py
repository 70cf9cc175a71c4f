"""Prescribed motion: nodes and bodies whose displacement, and rotation, are functions of time.

May change: `ALONG` and messages. Must stay: keys and docstring of `Motion` (scene format and help; after a change write
``validation/REFERENCE.md`` anew); rows of `ROW` numbers, which `rotations_over_time` writes and the compiled `turn`
reads by position; that kernels write x and v, and no force; cells and shape of the data for another rate, as
`dynamics.commands` writes over it. Tests: ``tests/effects/test_moved_bodies.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..kernels import FORCE, kernel
from ..messages import quote
from ..net.quaternions import of_vector, product
from ..tables import Several, Table, nodes, rows, table, text
from .base import PrescribedMotion, column
from .time_tables import flattened, interpolate

if TYPE_CHECKING:
    from ..net.net import Net

ROW = 9
"""Numbers of a row of rotations: its time, quaternion, angular velocity behind it, and angle about the axle."""
ALONG = 1e-9
"""Share of a rotation that may be across the axle: the last digits of what was typed."""


@kernel(FORCE)
def drive(t, x, v, f, cells, data, out):
    for c in range(cells.shape[0]):
        for i in range(3):
            x[cells[c, 0], i], v[cells[c, 0], i] = interpolate(t, data[c], 0, 4, 1 + i)


@kernel(FORCE)
def turn(t, x, v, f, cells, data, out):
    """Write the two rows of rotation of a body, see `refweb.net.rotation`, which are the two cells."""
    numbers, spin, second = data[0], cells[0, 0], cells[1, 0]
    at = 0
    while at + ROW < numbers.size and t >= numbers[at + ROW]:
        at += ROW
    passed, w, a, b, c = max(t - numbers[at], 0.0), numbers[at + 1], numbers[at + 2], numbers[at + 3], numbers[at + 4]
    o0, o1, o2 = numbers[at + 5], numbers[at + 6], numbers[at + 7]
    if t < numbers[0]:
        o0 = o1 = o2 = 0.0
    speed = np.sqrt(o0 * o0 + o1 * o1 + o2 * o2)
    p, share = np.cos(0.5 * speed * passed), np.sin(0.5 * speed * passed) / speed if speed > 0.0 else 0.0
    q, r, s = share * o0, share * o1, share * o2
    x[second, 0], x[second, 1] = p * w - q * a - r * b - s * c - 1.0, numbers[at + 8]
    x[spin, 0], x[spin, 1] = p * a + q * w + r * c - s * b, p * b + r * w + s * a - q * c
    x[spin, 2] = p * c + s * w + q * b - r * a
    v[spin, 0], v[spin, 1], v[spin, 2] = o0, o1, o2
    x[second, 1] += passed * (data[1, 0] * o0 + data[1, 1] * o1 + data[1, 2] * o2)


@table
class Motion(Table):
    """Prescribed displacement of nodes, which become supports, or displacement and rotation of a body.

    The force and the moment that the motion of a body takes are ``support_force`` and ``support_moment`` of
    ``[[observe]]``; its work is that of ``work``. Such a body has no mass.

    Parameters
    ----------
    node : int, str or list, optional
        Nodes, by number or name.
    body : str, optional
        Name of a body, in place of nodes.
    displacement : sequence of (t, x, y, z), optional
        Displacement from the web's position, or the body's [m]; linear in between, end values held. In statics t is
        the load step.
    rotation : sequence of (t, x, y, z), optional
        Rotation of a body from its orientation: about the direction of the vector, by its size [rad]. It goes through
        the axle of the body, or else through its position. Between two rows the angular velocity is constant; full
        turns are those by which the vectors differ. End values are held.

    Raises
    ------
    InputError
        For a table without rows, rows that are not four finite numbers, and times that do not increase; without
        nodes and body, with both, and for a rotation of nodes; from ``extend``, for a body that there is not, that is
        fixed, has mass, or does not turn so; from ``on``, for a node that the web does not have.

    Examples
    --------
        [[motion]]
        node = [0, 1]
        displacement = [[0.0, 0.0, 0.0, 0.0], [1.0, -0.2, 0.0, 0.0]]

        [[motion]]
        body = "drum"
        rotation = [[0.0, 0.0, 0.0, 0.0], [10.0, 0.0, 31.4, 0.0]]
    """

    several = True

    node: Several = nodes(default=None)
    body: str | None = text(default=None, limit=80)
    displacement: Several = rows(4, default=None, unit="m", increasing=True)
    rotation: Several = rows(4, default=None, unit="rad", increasing=True)

    def check(self) -> None:
        """Refuse what moves nothing, or two things at once."""
        if self.node is None and self.body is None:
            raise InputError("node is missing: give node = ... or body = ...")
        if self.body is not None and self.node is not None:
            raise InputError(f"node = {quote(self.node)} and body = {quote(self.body)} exclude each other: give one")
        if self.body is None and self.rotation is not None:
            raise InputError(f"rotation = {quote(self.rotation)} has no meaning for nodes: it turns a body")
        if self.displacement is None and self.rotation is None:
            also = "" if self.body is None else " or rotation = [[t, x, y, z], ...]"
            raise InputError(f"displacement is missing: give displacement = [[t, x, y, z], ...]{also}")

    def extend(self, net: Net) -> Net:
        """The net whose body is turned."""
        if self.body is None:
            return net
        body = net.body_of(self.body)
        if body.fixed:
            raise InputError(f"body = {quote(self.body)} has fixed = true, which holds it: leave that out")
        if not body.moved:
            raise InputError(
                f"body = {quote(self.body)} has a mass of {net.mass[body.row]:g} kg and moves by what acts on it, but "
                "a body that is moved needs none: leave out its mass and density"
            )
        if self.rotation is None:
            return net
        if body.shape.planar or not body.shape.free:
            name = type(body.shape).__name__.lower()
            raise InputError(f"rotation = {quote(self.rotation)} has no meaning for a {name}: give displacement alone")
        if body.axle:
            self._refuse_across(body.axle)
        return net.with_turning(body)

    def _refuse_across(self, axle):
        """Refuse a rotation that is not about the axle, and a torque besides."""
        if axle.torque:
            raise InputError(
                f"body = {quote(self.body)} has axle.torque, which a motion leaves nothing to: leave out one of them"
            )
        vectors = np.array(self.rotation)[:, 1:]
        if np.abs(np.cross(vectors, axle.direction)).max() > ALONG * np.abs(vectors).max():
            direction = [round(number, 6) for number in axle.direction.tolist()]
            raise InputError(
                f"rotation = {quote(self.rotation)} must be along axle.direction = {direction}: give multiples of it"
            )

    def on(self, net: Net) -> PrescribedMotion | list[PrescribedMotion]:
        """The driven rows."""
        if self.body is None:
            return self._shift(net.find(self.node))
        body = net.body_of(self.body)
        return [self._shift([body.base]), *([] if body.turn is None else [self._turn(body)])]

    def _shift(self, driven):
        table = self.displacement or ((0.0, 0.0, 0.0, 0.0),)
        data = np.tile(flattened(table), (len(driven), 1))
        return PrescribedMotion(cells=column(driven), data=data, kernel=drive, times=tuple(row[0] for row in table))

    def _turn(self, body):
        table = np.array(self.rotation or ((0.0, 0.0, 0.0, 0.0),))
        direction = body.axle.direction if body.axle else np.zeros(3)
        numbers = rotations_over_time(table, direction).ravel()
        along = np.zeros_like(numbers)
        along[:3] = direction
        times = tuple(table[:, 0].tolist())
        return PrescribedMotion(column([body.spin, body.turn]), np.array([numbers, along]), turn, times)


def rotations_over_time(table, direction):
    """Rows that `turn` reads, shape (rows, ROW), of rotation vectors over time (rows, 4).

    The angular velocity between two rows is that of the shorter way from one rotation to the next and, about the same
    axis, of as many full turns more as bring it nearest to the difference of the vectors.
    """
    numbers = np.zeros((len(table), ROW))
    q = of_vector(table[0, 1:])
    for n, (t, *vector) in enumerate(table):
        numbers[n, 0], numbers[n, 1:5], numbers[n, 8] = t, q, direction @ vector
        if n + 1 == len(table):
            break
        change = table[n + 1, 1:] - vector
        w, *along = product(of_vector(table[n + 1, 1:]), q * [1.0, -1.0, -1.0, -1.0])
        size = np.linalg.norm(along)
        axis = np.array(along) / size if size > 1e-12 else change / (np.linalg.norm(change) or 1.0)
        angle = 2.0 * np.arctan2(size, w)
        angle += 2.0 * np.pi * np.round((change @ axis - angle) / (2.0 * np.pi))
        numbers[n, 5:8] = angle / (table[n + 1, 0] - t) * axis
        q = product(np.array([np.cos(0.5 * angle), *np.sin(0.5 * angle) * axis]), q)
    return numbers
