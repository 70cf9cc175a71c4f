"""Threads of a net: lines through several nodes, with one tension.

May change: `NEAR`, which decides when rings count as together; `TAUT` upwards, by which explicit steps are shorter.
Must stay: fields and properties of `ThreadLine`, which `effects.thread` makes and effects, `results.observables` and
`statics` read by name; the order in ``numbers`` (record, 1/A, then four columns for each segment), which
`effects.thread_segments` reads; `COLUMNS`, the first numbers that a thread observes; `thread_line`, which
`effects.thread` imports; `coincident_nodes`, which `dynamics.simulation` and `statics.thread_reasons` import. Tests:
``tests/effects/test_thread.py``, ``tests/effects/test_thread_friction.py``.
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
    closed : bool
        True if it runs on from its last segment to the first.
    friction : tuple of float
        Friction coefficient of each ring [1]: of the node between segments r and r + 1, in a closed thread last of that
        between the last segment and the first; empty without friction.
    first : int
        First row of the numbers of its rings, see `refweb.effects.thread_friction`; −1 without friction.
    winch : tuple of float
        Numbers of a winch at an end, see `refweb.effects.winch`; empty without one.
    at_last : bool
        True if the winch is at its last node.
    """

    name: str
    rows: NDArray[np.int32]
    vectors: NDArray[np.float64]
    distances: NDArray[np.float64]
    line: Net
    wraps: tuple[Any, ...] = ()
    closed: bool = False
    friction: tuple[float, ...] = ()
    first: int = -1
    winch: tuple[float, ...] = ()
    at_last: bool = False

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
    def numbers(self) -> NDArray[np.float64]:
        """Numbers of its cell: of the line, 1/A, and the vector and distance of each segment, shape (columns,)."""
        segments = np.column_stack([self.vectors, self.distances])
        return np.concatenate([self.line.line_data.matrix[0], 1.0 / self.line.area, segments.ravel()])

    @property
    def ends(self) -> int:
        """Kind of its ends: 0 if both are at nodes, 1 if they are one, 2 with a winch at the first, 3 at the last."""
        return int(self.closed) if not self.winch else 3 if self.at_last else 2

    @property
    def rings(self) -> int:
        """Number of its rings with friction, and of its winch."""
        return len(self.friction) + bool(self.winch)

    @property
    def corners(self) -> tuple[float, ...]:
        """Times at which the speed of its winch has a corner [s]."""
        return self.winch[5 : 5 + 2 * int(self.winch[4]) : 2] if self.winch else ()

    @property
    def powered(self) -> bool:
        """True if its winch has a constant power, and its slip is an unknown."""
        return bool(self.winch) and len(self.winch) > 5 + 2 * int(self.winch[4])

    @property
    def unknowns(self) -> NDArray[np.int64]:
        """Components of the slip of a winch of constant power, and of the energy that it has taken, shape (2,)."""
        return 3 * self.first + np.array([self.rings - 1, 2 * self.rings + 2], dtype=np.int64)

    @property
    def rows_of_slips(self) -> int:
        """Number of rows of the numbers of its rings."""
        return -(-(2 * self.rings + 1 + 2 * bool(self.winch)) // 3) if self.rings else 0

    def slips(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Length that has gone over each ring with friction [m] in displacements of all rows, shape (rings,)."""
        return x[self.first : self.first + self.rows_of_slips].ravel()[: self.rings]

    def wound_until(self, x: NDArray[np.float64]) -> float:
        """Time until which its winch has wound [s], in displacements of all rows."""
        return float(x[self.first : self.first + self.rows_of_slips].ravel()[2 * self.rings + 1])

    def rewind(self, x: NDArray[np.float64]) -> None:
        """Let the time of its winch begin at 0 in displacements of all rows, where it has one."""
        if self.winch:
            x[self.first : self.first + self.rows_of_slips].reshape(-1)[2 * self.rings + 1] = 0.0

    def natural_lengths(self, slips: NDArray[np.float64]) -> NDArray[np.float64]:
        """Natural length of each segment [m], shape (segments,), by the slips of its rings."""
        over = np.append(slips, 0.0)[: len(self.distances)]
        gained = np.roll(over, 1) - over
        if self.winch and self.at_last:
            gained[0] -= over[-1]
        elif self.winch:
            gained[-1] += over[-1]
        return self.natural_length * self.distances / self.distances.sum() + gained

    def tensions(self, observed: NDArray[np.float64]) -> NDArray[np.float64]:
        """Tension of each segment [N], shape (segments,), by what its force observes."""
        count = len(self.distances)
        return observed[COLUMNS : COLUMNS + count] if self.rings else np.full(count, observed[0])

    @property
    def segments(self) -> NDArray[np.int32]:
        """Nodes of each segment, shape (segments, 2)."""
        return np.column_stack([self.rows[:-1], self.rows[1:]])

    @property
    def across(self) -> NDArray[np.float64]:
        """Stiffness across itself by a unit tension, in the web's position [1/m].

        Of shape (1, 3 rows, 3 rows), the rows those of its nodes and then of the bodies of ``wraps``: a segment on a
        body goes from either end to this.
        """
        inverse = 1.0 / np.maximum(self.distances, 1e-3 * self.distances.mean())
        over = {wrap.segment: len(self.rows) + n for n, wrap in enumerate(self.wraps)}
        chain = np.zeros((len(self.rows) + len(self.wraps),) * 2)
        for s, stiffness in enumerate(inverse):
            for i, j in ((s, over[s]), (over[s], s + 1)) if s in over else ((s, s + 1),):
                chain[[i, j], [i, j]] += stiffness
                chain[[i, j], [j, i]] -= stiffness
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

    All nodes in one point are refused, and what the cable refuses.
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
