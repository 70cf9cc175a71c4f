"""Threads of a net: lines through several nodes, with one tension.

`effects.thread` makes the `ThreadLine`; results and statics read its properties by name.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from . import discretisation
from .web import Web

if TYPE_CHECKING:
    from .cable import Cable
    from .net import Net

COLUMNS = 4
"""Numbers that the force observes: tension [N], stress [Pa], strain [1] and length [m]."""
TAUT = 0.01
"""Strain up to which bounds of steps hold for tensions that are not there yet."""
NEAR = 1e-3
"""Distance of rings that have come together, over the length of their thread."""


class ThreadLine(NamedTuple):
    """A thread through nodes of a net.

    Attributes
    ----------
    name : str
        Its name.
    rows : ndarray of int32, shape (nodes,)
        Its nodes in order; those of a closed thread end with the first.
    vectors, distances : ndarray, shape (segments, 3) and (segments,)
        Vectors from node to node in the web's position, and their magnitudes [m].
    line : refweb.net.net.Net
        The same material as one line from end to end of the sum of the distances, which has its law and numbers.
    wraps : tuple of refweb.effects.around.Wrap
        Segments on bodies; their ``distances`` are along these.
    """

    name: str
    rows: NDArray[np.int32]
    vectors: NDArray[np.float64]
    distances: NDArray[np.float64]
    line: Net
    wraps: tuple[Any, ...] = ()

    @property
    def title(self) -> str:
        """Its name in messages."""
        return f'thread "{self.name}"'

    @property
    def natural_length(self) -> float:
        """Natural length [m]."""
        return float(self.line.natural_length[0])

    @property
    def stiffness(self) -> float:
        """Largest stiffness EA/L [N/m]."""
        return float(self.line.axial[0]) / self.natural_length

    @property
    def masses(self) -> NDArray[np.float64]:
        """Mass of each segment by its share of the distances [kg], shape (segments,)."""
        return self.line.element_mass[0] * self.distances / self.distances.sum()

    @property
    def segments(self) -> NDArray[np.int32]:
        """Nodes of each segment, shape (segments, 2)."""
        return np.column_stack([self.rows[:-1], self.rows[1:]])

    @property
    def across(self) -> NDArray[np.float64]:
        """Stiffness across itself by a unit tension, in the web's position [1/m], shape (1, 3 nodes, 3 nodes)."""
        number = np.arange(len(self.distances))
        inverse = 1.0 / np.maximum(self.distances, 1e-3 * self.distances.mean())
        chain = np.zeros((len(self.rows), len(self.rows)))
        for i, j, sign in ((0, 0, 1.0), (1, 1, 1.0), (0, 1, -1.0), (1, 0, -1.0)):
            chain[number + i, number + j] += sign * inverse
        return np.asarray(np.kron(chain, np.eye(3))[None], dtype=np.float64)


def thread_line(
    name: str,
    places: NDArray[np.float64],
    rows: NDArray[np.int32],
    cable: Cable,
    length: float | None = None,
    wraps: tuple[Any, ...] = (),
) -> ThreadLine:
    """The `ThreadLine` of a cable through nodes at some places [m], shape (nodes, 3), and over bodies by `wraps`.

    Raises
    ------
    InputError
        If all nodes are in one point, and for what the cable refuses.
    """
    vectors = np.diff(places, axis=0)
    distances = np.linalg.norm(vectors, axis=1)
    for wrap in wraps:
        distances[wrap.segment] = wrap.length
    total = float(distances.sum())
    if total == 0.0:
        raise InputError(f"nodes: all {len(rows)} are in one point, a thread needs a length")
    ends = [[0.0, 0.0, 0.0], [total, 0.0, 0.0]]
    web = Web(ends, [[0, 1]], None if length is None else [length])
    return ThreadLine(name, rows, vectors, distances, discretisation.build(web, cable, explicit=True), wraps)


def coincident_nodes(net: Net, x: NDArray[np.float64], supported: NDArray[np.bool_]) -> str | None:
    """Text that names nodes that have come together on a thread, which pulls them so; None where none have.

    ``x`` are displacements [m], shape (rows, 3), and ``supported`` is True for components that do not move.
    """
    for thread in net.threads:
        apart = np.linalg.norm(np.diff((net.points + x)[thread.rows], axis=0), axis=1)
        free = ~supported[thread.segments].all(axis=(1, 2))
        for first, second in thread.segments[(apart < NEAR * thread.natural_length) & free][:1]:
            return (
                f'nodes {first} and {second} come together on thread "{thread.name}", which has no direction there: '
                "keep them apart by a line or a load, make them one node"
            )
    return None
