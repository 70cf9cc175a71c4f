"""Observables between nodes: their distance, and perimeter and area of the mouth of a net.

May change: private functions; how sums are written: the kernels `distance`, `perimeter` and `area` serve `of` as well.
Must stay: class docstrings (help; after a change write ``validation/REFERENCE.md`` anew), class names in
`registry.OBSERVABLES`, `MouthArea`, which `commands.doubts` uses, and `Between`, which `statics.responses`
differentiates. Tests: ``tests/results/test_distances.py``, ``tests/results/test_observable_contract.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ...errors import InputError
from ...kernels import kernel
from ...messages import nearest
from ..probes import PROBE, Probe, component_of
from .observable import ANY, NOT_NEGATIVE, Observable, Value

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...system.system import System
    from ..state import State


class Between(Observable):
    """A length or an area that follows from the positions of some rows."""

    unit = "m"

    def rows(self, system: System) -> NDArray[np.int64]:
        """The rows, in their order, shape (k,)."""
        raise NotImplementedError

    def on(self, system: System) -> None:
        """Refuse nodes and bodies that the system does not have."""
        self.rows(system)

    def _number_of(self, system, name):
        """Row of a body."""
        if not isinstance(name, str):
            raise InputError(f'body names {len(name)} bodies: quantity = "{self.observe.quantity}" needs one')
        names = [body.name for body in system.net.bodies]
        if name not in names:
            hint = nearest(name, names) if names else "the scene has no [[body]]"
            raise InputError(f'body = "{name}" is not a body, {hint}')
        return system.net.bodies[names.index(name)].row

    def bounds(self, system: System | None) -> tuple[float, float]:
        """Bounds of the value: a length or an area is not negative, but its component may be."""
        return NOT_NEGATIVE if self.observe.component is None else ANY

    def of(self, state: State) -> Value:
        """Value by the kernel of its probe."""
        return Value(self.probe(state.system).at(state, state.x), None)


class Distance(Between):
    """Distance of two nodes, of a node and the centre of a body, or of two bodies, ``body`` and ``to``."""

    keys: tuple[str, ...] = ("node", "body", "to")

    def rows(self, system: System) -> NDArray[np.int64]:
        """Rows of both ends."""
        observe, numbers = self.observe, []
        if observe.node is not None:
            numbers += system.net.find(observe.node).tolist()
        numbers += [self._number_of(system, name) for name in (observe.body, observe.to) if name is not None]
        if len(numbers) != 2:
            raise InputError(
                f'quantity = "distance" is of {len(numbers)} places, must be 2: node = [i, j], a node and to = a body, '
                "or a body and to = another"
            )
        return np.array(numbers)

    def probe(self, system: System) -> Probe:
        """Make the probe of x and the reference position."""
        rows = self.rows(system)
        return Probe(distance, rows, system.net.points[rows])


class Mouth(Between):
    """Polygon of nodes around a mouth, see `Web.find_around`; the last is followed by the first."""

    keys: tuple[str, ...] = ("node",)

    def rows(self, system: System) -> NDArray[np.int64]:
        """Rows of the nodes around the mouth."""
        numbers = np.zeros(0, np.int64) if self.observe.node is None else system.net.web.find_around(self.observe.node)
        if len(numbers) < 3:
            raise InputError(
                f'quantity = "{self.observe.quantity}" is of {len(numbers)} nodes, must be at least 3: name those of '
                "the mouth in their order around, node = [i, j, k, ...]"
            )
        return numbers


class MouthPerimeter(Mouth):
    """Sum of the distances from node to node, and from the last to the first."""

    def probe(self, system: System) -> Probe:
        """Make the probe of x and the reference position."""
        rows = self.rows(system)
        return Probe(perimeter, rows, system.net.points[rows])


class MouthArea(Mouth):
    """Size of the area vector ½ Σ pᵢ × pᵢ₊₁ of the closed polygon, or a component of it.

    Listed nodes are taken in their order. Nodes of one name are sorted by angle around their middle in the web. The
    size is the area of a mouth in a plane, else its largest projected area. A component is the projected area along an
    axis, positive if the nodes run counterclockwise.
    """

    unit = "m²"
    keys: tuple[str, ...] = ("node", "component")

    def probe(self, system: System) -> Probe:
        """Make the probe of x and the reference position."""
        rows = self.rows(system)
        return Probe(area, [self.component, *rows], system.net.points[rows])


@kernel()
def _apart(x, data, i, j, m, n):
    """Distance of rows i and j, whose reference positions are rows m and n of data."""
    a, b = x[j, 0] - x[i, 0] + data[n, 0] - data[m, 0], x[j, 1] - x[i, 1] + data[n, 1] - data[m, 1]
    c = x[j, 2] - x[i, 2] + data[n, 2] - data[m, 2]
    return math.sqrt(a * a + b * b + c * c)


@kernel(PROBE)
def distance(t, x, v, f, lines, rows, data, where):
    """Distance of two rows."""
    return _apart(x, data, rows[0], rows[1], 0, 1)


@kernel(PROBE)
def perimeter(t, x, v, f, lines, rows, data, where):
    """Length of the closed polygon of rows."""
    total = 0.0
    for n in range(rows.size):
        m = n - 1 if n > 0 else rows.size - 1
        total += _apart(x, data, rows[m], rows[n], m, n)
    return total


@kernel(PROBE)
def area(t, x, v, f, lines, rows, data, where):
    """Area vector of the closed polygon, as a fan from its first node; ``rows`` is (component, row, row, ...)."""
    a0 = a1 = a2 = p0 = p1 = p2 = 0.0
    first = rows[1]
    for n in range(1, data.shape[0]):
        row = rows[1 + n]
        q0 = x[row, 0] - x[first, 0] + data[n, 0] - data[0, 0]
        q1 = x[row, 1] - x[first, 1] + data[n, 1] - data[0, 1]
        q2 = x[row, 2] - x[first, 2] + data[n, 2] - data[0, 2]
        a0, a1, a2 = a0 + p1 * q2 - p2 * q1, a1 + p2 * q0 - p0 * q2, a2 + p0 * q1 - p1 * q0
        p0, p1, p2 = q0, q1, q2
    return 0.5 * component_of(rows[0], a0, a1, a2)
