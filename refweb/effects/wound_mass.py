"""Mass that follows winches: each segment of a thread, and each line, has the mass of its natural length.

A segment of the natural length L has the mass ρA L, half of it at either node. Material that goes over a ring leaves
the segment before it for that behind it, at the velocity of the ring; over a drum it comes from outside or goes there.
The equations are those of `refweb.effects.mass_flow`, where v_d is the velocity of the ring or the drum. Masses follow
from slips δ, which follow from positions, and so do the rates of both:

    m' = Σ ±½ρA δ',    δ' = ∂δ/∂x·v + ∂δ/∂t

An explicit step brings Δm in the middle of its drift, one half in the order of the rings and one against it. The
exchange at each ring alone is solved exactly, so that the step is of order 2.

Forces of gravity and of rotating axes on the mass that is added are terms of their own, which do work.

Numbers of a cell are those of `refweb.effects.thread_slips`; at their end stand those of `FIELD`, and `NODE` for each
node.

May change: how the kernels are written. Must stay: fields of `FIELD` and `NODE`, which kernels read by name; the
equations, which are those of `mass_flow`; fields of `Passages`, by which the explicit loop and `system.material_flow`
exchange mass; `write_numbers` and `WoundFlow`, which `winch` uses, and ``of_field``, by which `dynamics.commands`
writes columns; public names of `WoundFlow`, which other files use. Tests: ``tests/effects/test_winch_mass.py``.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..compiled.rows import matrix_of, record_at, width_of
from ..errors import InputError
from ..kernels import BOUND, FORCE, STIFFNESS, kernel
from .base import Balance, ForceTerm, Tangent, Timing, VelocityForce
from .line_kernels import internal_number
from .mass_flow import Passages
from .thread_friction import LEAST, kernels
from .thread_slips import SAME, SEGMENT, layout_kernels, return_mapping
from .time_tables import interpolate
from .vectors import cross

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..net.net import Net
    from ..system.system import System

FIELD = np.dtype([("acceleration", float, (3,)), ("pull", float, (3, 3)), ("speed", float, (3,))])
"""An acceleration [m/s²], and G [1/s²] and Ω [rad/s] of `refweb.effects.turning_axes`."""
NODE = np.dtype([("share", float), ("point", float, (3,))])
"""½ρA of a node, 0 where a body carries it [kg/m], and its position in the web [m]."""
OF_FIELD, OF_NODE = width_of(FIELD), width_of(NODE)


class WoundFlow(NamedTuple):
    """Mass that follows a winch.

    Attributes
    ----------
    thread : str or None
        Name of its thread; None for lines.
    lines : ndarray of int, shape (k,)
        Lines of the web, of one element each; none for a thread.
    drums : ndarray of int, or None
        Nodes of drums of lines; None for the one end of each that is supported, moved or on a body.
    powered : bool
        True for a winch of constant power, whose slip has a rate.
    """

    thread: str | None
    lines: np.ndarray
    drums: np.ndarray | None
    powered: bool
    wound = True

    def _numbers(self, net):
        """(Cells, ½ρA of each cell [kg/m], law, dtype and width of `refweb.effects.thread_friction.kernels`)."""
        if self.thread is None:
            from .wound_lines import FIRST

            given, at = net, self.lines
            cells, width = net.cells[at], net.line_data.column(FIRST)
        else:
            thread = net.thread_of(self.thread)
            given, at = thread.line, [0]
            cells, width = thread.rows[None, :], given.line_data.matrix.shape[1]
        return cells, 0.5 * given.element_mass[at] / given.natural_length[at], (given.law, given.law_record, width)

    def data_in(self, system: System) -> NDArray[np.float64]:
        """Numbers of its cells at present, shape (cells, columns)."""
        if self.thread is None:
            return system.net.line_data.matrix[self.lines]
        data: Any = next(system.terms[n].data for n, thread in system.threads.items() if thread.name == self.thread)
        return data

    def passing(self, net: Net) -> tuple[Any, NDArray[np.int32], int]:
        """(Kernel of slips and their rates, cells, rings of each)."""
        cells, _, kind = self._numbers(net)
        return passing_kernel(*kind, self.powered), cells, cells.shape[1] - 1

    def passages(self, system: System) -> Passages:
        """The `Passages`; of nodes that a body carries the mass stays.

        Raises
        ------
        InputError
            For lines of which not one end is that of a drum.
        """
        net = system.net
        cells, shares, _ = self._numbers(net)
        if self.thread is None:
            from .wound_lines import FIRST

            rows, drums, signs = cells, self._drums(system), -np.ones(cells.shape)
            slips = 3 * net.line_data.matrix[self.lines, net.line_data.column(FIRST) + 5].astype(int)
        else:
            thread = net.thread_of(self.thread)
            nodes = thread.rows
            ends = nodes[-2:] if thread.at_last else nodes[:2]
            rows = np.vstack([np.column_stack([nodes[:-2], nodes[2:]]), ends])
            drums = np.append(nodes[1:-1], nodes[-1 if thread.at_last else 0])
            signs = np.tile([-1.0, 1.0], (len(rows), 1))
            signs[-1] = -1.0 if thread.at_last else 1.0
            slips = 3 * thread.first + np.arange(len(rows))
        return Passages(drums, slips, rows, signs * shares[:, None] * moving(net)[rows])

    def _drums(self, system):
        """Node of the drum of each line."""
        ends = system.net.cells[self.lines]
        supported = system.supported.all(axis=1)
        at = supported[ends] if self.drums is None else np.isin(ends, self.drums)
        counts = at.sum(axis=1)
        for n in np.flatnonzero(counts != 1)[:1]:
            why = "supported, moved or on a body" if self.drums is None else "of drum"
            raise InputError(
                f'mass = "follows": {counts[n]} ends of line {self.lines[n]} are {why}, must be one: name the node at '
                "the drum of each line, drum = ..."
            )
        return ends[np.arange(len(ends)), at.argmax(axis=1)]

    def weight(self, net: Net, acceleration: Any) -> ForceTerm:
        """The term of a uniform acceleration [m/s²] on what is added."""
        return self._term(net, "gravity", acceleration, np.zeros((3, 3)), None, True)

    def turning(self, net: Net, frame: Any, pull: Any, name: str) -> list[ForceTerm]:
        """The two terms of rotating axes on it, see `refweb.effects.turning_axes.force_terms`."""
        return [self._term(net, name, np.zeros(3), pull, frame, of_place) for of_place in (True, False)]

    def _term(self, net, name, acceleration, pull, frame, of_place):
        """A term of what depends on places, or on velocities, of the mass that is added."""
        cells, shares, kind = self._numbers(net)
        if self.thread is None:
            numbers = net.line_data.matrix[self.lines]
        else:
            from .thread_friction import numbers_of

            numbers = numbers_of(net.thread_of(self.thread))
        field, nodes = np.zeros(len(cells), FIELD), np.zeros(cells.shape, NODE)
        field["acceleration"], field["pull"] = acceleration, pull
        field["speed"] = 0.0 if frame is None else frame.angular_velocity
        nodes["share"], nodes["point"] = shares[:, None] * moving(net)[cells], net.points[cells]
        of_nodes = matrix_of(nodes.ravel()).reshape(len(cells), -1)
        force, stiffness, bound, coriolis, damping, damping_bound = field_kernels(*kind)
        given: dict[str, Any] = dict(name=name, cells=cells, data=np.hstack([numbers, matrix_of(field), of_nodes]))
        given |= {"flow": self} | ({} if frame is None else {"frame": frame})
        if of_place:
            balance = Balance("work", power=0, moment_free=frame is None)
            return WoundTerm(force=force, tangent=Tangent(stiffness, bound, symmetric=False), balance=balance, **given)
        velocity = VelocityForce(damping, damping_bound)
        return WoundTerm(
            force=coriolis,
            tangent=Tangent(symmetric=False),
            velocity=velocity,
            timing=Timing(at_rest=False),
            balance=Balance("work"),
            **given,
        )


@dataclass(frozen=True, eq=False)
class WoundTerm(ForceTerm):
    """A term of the mass of a `WoundFlow`, whose numbers begin with those of its thread or lines."""

    flow: Any = None

    @property
    def of_field(self) -> tuple[slice, slice]:
        """The part of the data that is no number of the winch."""
        return np.s_[:, -OF_FIELD - OF_NODE * self.cells.shape[1] :]


def moving(net: Net) -> NDArray[np.float64]:
    """1 for each row that no body carries, and 0 for the others, shape (rows,)."""
    free = np.ones(len(net.points))
    free[[node for body in net.bodies for node in body.carried]] = 0.0
    return free


def write_numbers(system: System, thread: str | None, lines: Any, numbers: tuple[float, ...]) -> list[Any]:
    """(Array, part of it, ``numbers``) of terms of the mass of a winch on a thread or on lines."""
    writes = []
    for term in system.terms:
        if not isinstance(term, WoundTerm) or term.flow.thread != thread:
            continue
        if thread is None and not np.array_equal(term.flow.lines, lines):
            continue
        end = term.of_field[1].start
        if thread is None:
            from .wound_lines import FIRST, NUMBERS

            end = system.net.line_data.column(FIRST) + NUMBERS + len(numbers)
        writes.append((term.data, np.s_[:, end - len(numbers) : end], numbers))
    return writes


@functools.cache
def passing_kernel(law, record, width, powered):
    """The kernel (signature `refweb.kernels.FORCE`) of slips and their rates, which stand in ``out (cells, 2 rings)``.

    Parameters are those of `refweb.effects.thread.kernels`, and whether the winch is one of constant power.
    """
    find_slips, acting = return_mapping(law, record, width), kernels(law, record, width)
    slip_slopes, pulled_over, (first_of, rings_of, _) = acting.slip_slopes, acting.pulled_over, layout_kernels(width)
    if powered:
        from .winch_power import rate_kernel

        rate_at = rate_kernel(width)

        @kernel()
        def given_rate(t, cells, data, c, w):
            """(Rate at which a winch hauls in, its largest beside that)."""
            return rate_at(pulled_over(data, c, w), cells, data, c)[0], math.inf
    else:

        @kernel()
        def given_rate(t, cells, data, c, w):
            column = first_of(cells) + 1 + rings_of(cells, data, c)
            if data[c, column + 3] > 0.0:
                return 0.0, math.inf
            return interpolate(t, data[c], column + 4, 2, 1)[0], data[c, column + 2]

    @kernel(FORCE)
    def passing(t, x, v, f, cells, data, out):
        count, size = cells.shape[1] - 1, 3 * cells.shape[1]
        w, a, b = np.empty(count, SEGMENT), np.zeros((count, count)), np.zeros((count, size + 1))
        for c in range(cells.shape[0]):
            later = t
            if 0.0 < data[c, first_of(cells) + 3 + rings_of(cells, data, c)] < math.inf:  # it needs time to wind
                until = internal_number(x, int(data[c, first_of(cells)]), 2 * count + 1)
                later = max(t, until * (1.0 + 4.0 * SAME) + LEAST)
            last = find_slips(later, x, cells, data, c, w) - 1
            slip_slopes(x, cells, data, c, w, last + 1, a, b)
            speed, limit = given_rate(t, cells, data, c, w)
            speed *= w[0].tail - w[0].head
            given = speed + (math.copysign(limit, w[last].direction) if abs(w[last].direction) == 2.0 else 0.0)
            for r in range(count):
                rate = b[r, size] * given
                for m in range(size):
                    rate += b[r, m] * v[cells[c, m // 3], m % 3]
                if r == last and abs(w[r].direction) == 1.0 and abs(rate - speed) > limit > 0.0:
                    rate = speed + math.copysign(limit, rate - speed)
                out[c, r], out[c, count + r] = w[r].slip, rate

    return passing


@functools.cache
def field_kernels(law, record, width):
    """Force, stiffness and bound of what depends on places, and force, damping and bound of what does on velocity.

    Parameters are those of `refweb.effects.thread.kernels`.
    """
    find_slips, slip_slopes = return_mapping(law, record, width), kernels(law, record, width).slip_slopes

    @kernel()
    def field_of(cells, data, c):
        return record_at(FIELD, data, c, data.shape[1] - OF_NODE * cells.shape[1] - OF_FIELD)

    @kernel()
    def node_of(cells, data, c, n):
        return record_at(NODE, data, c, data.shape[1] - OF_NODE * (cells.shape[1] - n))

    @kernel()
    def changes(w, r, n):
        """Change of the length at node n by the slip of ring r: of the segments at either side, as numbers of them."""
        last = len(w) - 1
        if r < last:
            return -1.0 if n == r else 1.0 if n == r + 2 else 0.0
        if w[0].head > 0.0:
            return 1.0 if n <= 1 else 0.0
        return -1.0 if n >= last else 0.0

    @kernel()
    def add_lengths(w, lengths):
        """Write what each node has gained, of the length of its segments."""
        for n in range(lengths.size):
            lengths[n] = 0.0
            for r in range(len(w)):
                lengths[n] += changes(w, r, n) * w[r].slip

    @kernel()
    def acceleration_at(x, cells, data, c, n):
        """Acceleration of the field at a node [m/s²]."""
        field, node, row = field_of(cells, data, c), node_of(cells, data, c, n), cells[c, n]
        p, q = field.pull, node.point
        r0, r1, r2 = q[0] + x[row, 0], q[1] + x[row, 1], q[2] + x[row, 2]
        g = field.acceleration
        return (
            g[0] + p[0, 0] * r0 + p[0, 1] * r1 + p[0, 2] * r2,
            g[1] + p[1, 0] * r0 + p[1, 1] * r1 + p[1, 2] * r2,
            g[2] + p[2, 0] * r0 + p[2, 1] * r1 + p[2, 2] * r2,
        )

    @kernel(FORCE)
    def force(t, x, v, f, cells, data, out):
        w, lengths = np.empty(cells.shape[1] - 1, SEGMENT), np.empty(cells.shape[1])
        for c in range(cells.shape[0]):
            find_slips(t, x, cells, data, c, w)
            add_lengths(w, lengths)
            out[c, 0] = 0.0
            for n in range(lengths.size):
                m, g, row = (
                    node_of(cells, data, c, n).share * lengths[n],
                    acceleration_at(x, cells, data, c, n),
                    cells[c, n],
                )
                for i in range(3):
                    f[row, i] += m * g[i]
                    out[c, 0] += m * g[i] * v[row, i]

    @kernel(STIFFNESS)
    def stiffness(t, x, v, blocks, cells, data, definite):
        count, size = cells.shape[1] - 1, 3 * cells.shape[1]
        w, a, b, lengths = (
            np.empty(count, SEGMENT),
            np.zeros((count, count)),
            np.zeros((count, size + 1)),
            np.empty(count + 1),
        )
        for c in range(cells.shape[0]):
            blocks[c] = 0.0
            if definite:
                continue
            rings, pull = find_slips(t, x, cells, data, c, w), field_of(cells, data, c).pull
            add_lengths(w, lengths)
            slip_slopes(x, cells, data, c, w, rings, a, b)
            for n in range(count + 1):
                share, g = node_of(cells, data, c, n).share, acceleration_at(x, cells, data, c, n)
                for i in range(3):
                    for j in range(3):
                        blocks[c, 3 * n + i, 3 * n + j] -= share * lengths[n] * pull[i, j]
                    for r in range(rings):
                        for m in range(size):
                            blocks[c, 3 * n + i, m] -= share * changes(w, r, n) * g[i] * b[r, m]

    @kernel(BOUND)
    def bound(reach, speed, x, mass, rates, cells, data):
        for c in range(cells.shape[0]):
            pull = field_of(cells, data, c).pull
            for n in range(cells.shape[1]):
                for i in range(3):
                    for j in range(3):
                        rates[cells[c, n]] += mass[cells[c, n]] * abs(pull[i, j])

    @kernel(FORCE)
    def coriolis(t, x, v, f, cells, data, out):
        w, lengths = np.empty(cells.shape[1] - 1, SEGMENT), np.empty(cells.shape[1])
        for c in range(cells.shape[0]):
            find_slips(t, x, cells, data, c, w)
            add_lengths(w, lengths)
            s = field_of(cells, data, c).speed
            for n in range(lengths.size):
                m, row = 2.0 * node_of(cells, data, c, n).share * lengths[n], cells[c, n]
                q = cross((s[0], s[1], s[2]), (v[row, 0], v[row, 1], v[row, 2]))
                for i in range(3):
                    f[row, i] -= m * q[i]

    @kernel(STIFFNESS)
    def damping(t, x, v, blocks, cells, data, definite):
        w, lengths = np.empty(cells.shape[1] - 1, SEGMENT), np.empty(cells.shape[1])
        for c in range(cells.shape[0]):
            blocks[c] = 0.0
            if definite:
                continue
            find_slips(t, x, cells, data, c, w)
            add_lengths(w, lengths)
            s = field_of(cells, data, c).speed
            for n in range(lengths.size):
                m = 2.0 * node_of(cells, data, c, n).share * lengths[n]
                for i in range(3):
                    j, k = (i + 1) % 3, (i + 2) % 3
                    blocks[c, 3 * n + j, 3 * n + k] -= m * s[i]
                    blocks[c, 3 * n + k, 3 * n + j] += m * s[i]

    @kernel(BOUND)
    def damping_bound(reach, speed, x, mass, rates, cells, data):
        for c in range(cells.shape[0]):
            s = field_of(cells, data, c).speed
            largest = math.sqrt(2.0 * (s[0] ** 2 + s[1] ** 2 + s[2] ** 2))  # of row sums of Ω ×
            for n in range(cells.shape[1]):
                rates[cells[c, n]] += 2.0 * largest * mass[cells[c, n]]

    return force, stiffness, bound, coriolis, damping, damping_bound
