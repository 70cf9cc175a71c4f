"""Threads: lines of one material that run through a list of nodes in order, and slide there.

With friction at the nodes see `refweb.effects.thread_friction`. Without, as follows.

One tension rules a whole thread. With the lengths l_s of its segments, its natural length L and a unit vector t_s along
each segment, from its first node to its second,

    strain            ε = (Σ l_s − L)/L
    force on node a   T (t_a − t_(a−1)), of the segment behind it and the one before it
    stiffness         (dT/dε/L) g⊗g + Σ (T/l_s) (I − t_s⊗t_s) of each segment,      g = ∂(Σ l_s)/∂x

The energy L ∫T dε is convex in the positions where that of the law is, and T is not negative. The first part of the
stiffness couples every node with every other: of n nodes the matrix has a dense block of 9 n² numbers.

A segment that gets short turns fast: T/l_s has no bound. The bound of explicit steps takes T and l_s as they are at
each row of the history.

May change: private functions, messages, and how the kernels are written. Must stay: the name "thread" of the terms,
which `statics.gradients.KNOWN` and `studies.modes` have; keys and docstring of `Thread` (scene format and help; after a
change write ``validation/REFERENCE.md`` anew); `OF_CABLE`, which are keys of `refweb.Cable`; the first four numbers of
``out`` (tension, stress, strain, length), `net.threads.COLUMNS`, which observables read; columns of data from ``width``
on, which `net.threads` writes and `thread_segments` reads. Tests: ``tests/effects/test_thread.py``.
"""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ..accepted import accepts, any_of, array
from ..compiled.rows import record_at
from ..errors import InputError
from ..kernels import BOUND, FORCE, STIFFNESS, kernel
from ..messages import quote
from ..net.law_keys import EITHER, points
from ..net.materials import MATERIALS
from ..net.threads import COLUMNS, TAUT, ThreadLine
from ..registry import LAWS
from ..tables import Several, Table, boolean, checked, choice, field, nodes, numbers_by_name, real, table, text
from .base import Balance, CellElements, ForceTerm, Tangent
from .line_kernels import line_at
from .thread_segments import add_across, energy_kernel, segment_kernel

if TYPE_CHECKING:
    from ..net.net import Net

OF_CABLE = ("law", "material", "modulus", "area", "density", "slackness", "smoothing", "stress", "tension")
OF_CABLE += ("parameters", "prestrain")
"""Keys that mean what they mean in ``[cable]``."""


def _around_table():
    from .around import Around

    return Around


@accepts(lambda: array(_around_table(), 1))
def _around(name, value):
    """Read the tables of bodies that a thread runs over."""
    if not isinstance(value, (list, tuple)) or not value:
        raise InputError(f'{name} = {quote(value)} must be a list of tables such as [{{ body = "drum" }}]')
    kind = _around_table()
    return tuple(v if isinstance(v, kind) else kind.read(f"{name}[{i}]", v) for i, v in enumerate(value))


@functools.cache
def kernels(law, record, width):
    """Force, energy, stiffness and bound kernels.

    Parameters
    ----------
    law : type
        Law of the thread.
    record : numpy.dtype
        Numbers of a line that it reads.
    width : int
        Columns of a cell ahead of 1/A and of the vector and distance of each segment in the web's position.
    """
    stress, tangent, segment = law.stress, law.tangent, segment_kernel(width)

    @kernel()
    def strain_of(x, cells, data, c):
        line = line_at(data, c)
        longer = line.distance - line.natural_length
        for s in range(cells.shape[1] - 1):
            longer += segment(x, cells, data, c, s)[5]
        return longer / line.natural_length

    @kernel(FORCE)
    def force(t, x, v, f, cells, data, out):
        for c in range(cells.shape[0]):
            line, strain = record_at(record, data, c, 0), strain_of(x, cells, data, c)
            tension = stress(strain, line)
            for s in range(cells.shape[1] - 1):
                p0, p1, p2, inverse, _, _ = segment(x, cells, data, c, s)
                i, j, scale = cells[c, s], cells[c, s + 1], tension * inverse
                f[i, 0] += scale * p0
                f[i, 1] += scale * p1
                f[i, 2] += scale * p2
                f[j, 0] -= scale * p0
                f[j, 1] -= scale * p1
                f[j, 2] -= scale * p2
            out[c, 0], out[c, 1], out[c, 2] = tension, tension * data[c, width], strain
            out[c, 3] = line.natural_length * (1.0 + strain)

    @kernel(STIFFNESS)
    def stiffness(t, x, v, blocks, cells, data, definite):
        size = 3 * cells.shape[1]
        g = np.empty(size)
        for c in range(cells.shape[0]):
            line, strain = record_at(record, data, c, 0), strain_of(x, cells, data, c)
            along, tension = tangent(strain, line) / line.natural_length, stress(strain, line)
            if definite and tension < 0.0:
                tension = 0.0
            for i in range(size):
                g[i] = 0.0
            for s in range(cells.shape[1] - 1):
                p0, p1, p2, inverse, _, _ = segment(x, cells, data, c, s)
                p = (p0 * inverse, p1 * inverse, p2 * inverse)
                for k in range(3):
                    g[3 * s + k] -= p[k]
                    g[3 * s + 3 + k] += p[k]
            for i in range(size):
                for j in range(size):
                    blocks[c, i, j] = along * g[i] * g[j]
            for s in range(cells.shape[1] - 1):
                p0, p1, p2, inverse, _, _ = segment(x, cells, data, c, s)
                p = (p0 * inverse, p1 * inverse, p2 * inverse)
                add_across(blocks, c, s, p, tension * inverse)

    @kernel(BOUND)
    def bound(reach, speed, x, mass, rates, cells, data):
        # Parts of g are 1 at most for each end of a segment, and 2 of each segment together.
        for c in range(cells.shape[0]):
            line, segments = record_at(record, data, c, 0), cells.shape[1] - 1
            along = 2.0 * segments * abs(line.ea) / line.natural_length
            tension = abs(stress(strain_of(x, cells, data, c), line))
            for s in range(segments):
                inverse, distance = segment(x, cells, data, c, s)[3], data[c, width + 4 + 4 * s]
                soon = TAUT * abs(line.ea) / max(distance, TAUT * line.natural_length)
                across = 2.0 * max(tension * inverse, soon)
                rates[cells[c, s]] += along + across
                rates[cells[c, s + 1]] += along + across

    return force, energy_kernel(law, record, strain_of), stiffness, bound


_number = real(at_least=0.0)
_coefficient = _number.metadata["read"].accepts


@accepts(any_of(_coefficient, array(_coefficient, 1)))
def _coefficients(name, value):
    """Read a number ≥ 0, or a list of such."""
    value = value.tolist() if hasattr(value, "tolist") else value
    if not isinstance(value, (list, tuple)):
        return checked(name, value, _number)
    if not value:
        raise InputError(f"{name} = [] must be a number for each ring, or one for all")
    return tuple(checked(f"{name}[{i}]", coefficient, _number) for i, coefficient in enumerate(value))


@table
class Thread(Table):
    """A thread of one material through a list of nodes, its rings, on which it slides, with friction or without.

    A drawstring, a rope over pulleys or a line with rings on it. Without ``friction`` one tension rules all of it, by
    the sum of the distances of neighbours in the list. With it each segment has a tension and a share of the material
    of its own, at first in proportion to the distances. Material goes over a ring when the tension on one side is
    above e^(μθ) times that on the other, θ the angle by which the thread turns there, as on a capstan. Energy that is
    lost so is ``dissipated_energy``. Statics finds what slips between load steps as if each ring went one way.

    Nodes may be free, supported, moved, or on a body by ``[[attach]]``. A thread may pass a node several times, as a
    tackle does. It touches the bodies of ``around`` alone, and no lines, and does not break; where it may touch others,
    let a chain of lines do so by ``[contact]``. Rings that nothing keeps apart slide together; statics finds no
    equilibrium there, where the thread has no direction.

    Its mass is shared by its nodes, half of each segment to either end as it lies in the web's position, and stays
    there: material that slides through a ring brings no mass along. With a ``[[winch]]`` whose ``mass`` is
    "follows" it does. Where the mass of a segment counts between its nodes, use lines. Explicit steps are as short
    as with lines of the same material from node to node; in matrices a thread of n nodes is a dense block of 9 n²
    numbers. In statics bounds of errors are proven as with lines alone, if threads have the law of tension alone
    and run over no body. Reels, heat, material damping and ``[rupture]`` are of lines alone: to pull a thread in,
    move its end, or take a ``[[winch]]``.

    Parameters
    ----------
    name : str
        Name of the thread, for observables.
    nodes : list or str
        Two nodes or more in the order of the thread, by number or name; or one name of several nodes, in the order of
        the name, of a closed thread counterclockwise around their middle. Names of ``around`` are bodies.
    closed : bool
        True if the thread runs on from its last node to the first.
    length : float, optional
        Natural length [m]; by default the sum of the distances over 1 + ``prestrain``.
    prestrain : float
        Strain in the web's position [1], > −1; negative is slack.
    around : list of tables, optional
        Bodies that the thread runs over between two nodes, ``[{ body = ..., side = ..., turns = ... }]``.
    friction : float or list of float, optional
        Friction coefficient μ of the rings [1], ≥ 0: one for all, or one for each in the order of ``nodes``, without
        the ends of an open thread. A large one, 1e3, ties the thread to the ring. The thread has shares of segments,
        and an observable ``slip``, also where it is 0. Not beside ``around``.
    law : {"tension-only", "smooth", "table"}
        Tension law, as in ``[cable]``; or that of another package, unless it is one of bars or of form finding, or
        yields. With ``friction`` one that does not push: not "smooth".
    material, modulus, area, density, slackness, smoothing, stress, tension, parameters
        As in ``[cable]``.

    Raises
    ------
    InputError
        For fewer than two nodes, a node that follows itself, ``length`` beside ``prestrain``, a law of bars, of form
        finding or that yields, one that pushes beside ``friction``, and what ``[cable]`` refuses. From ``extend``, for
        a name that is listed twice, one that is not one node of the web, nodes that are all in one point, and with
        ``friction`` for another number of coefficients than of rings, and for neighbours in one point.

    Examples
    --------
        [[thread]]
        name = "rope"
        nodes = [0, "centre", 1]
        modulus = 1e9
        area = 1e-5
        density = 970.0
    """

    several = True
    either: ClassVar[tuple[tuple[str, ...], ...]] = EITHER

    name: str = text(limit=80)
    nodes: Several = nodes()
    closed: bool = boolean(default=False)
    length: float | None = real(default=None, above=0.0, unit="m")
    prestrain: float = real(default=0.0, above=-1, unit="1")
    around: Any = field(_around, default=None)
    friction: Any = field(_coefficients, default=None, unit="1")
    law: str = choice(LAWS, default="tension-only")
    material: str | None = choice(*MATERIALS, default=None)
    modulus: Any = real(default=None, above=0, unit="Pa")
    area: float = real(above=0, unit="m²")
    density: Any = real(default=None, at_least=0, unit="kg/m³")
    slackness: float | None = real(default=None, at_least=0, unit="1")
    smoothing: float | None = real(default=None, at_least=0, unit="1")
    stress: Any = points(unit="Pa")
    tension: Any = points(unit="N")
    parameters: dict[str, Any] | None = numbers_by_name()

    def check(self) -> None:
        """Refuse fewer than two nodes, a node that follows itself, two lengths, and what a cable refuses."""
        from ..net.tension_laws import law_of

        if isinstance(self.nodes, int) or (isinstance(self.nodes, tuple) and len(self.nodes) < 2):
            raise InputError(f"nodes = {quote(self.nodes)} must be a list of two nodes or more, or a name of several")
        if isinstance(self.nodes, tuple):
            self._refuse_repeated(self.nodes)
        if self.around:
            from .around import check_route

            check_route(self.nodes, self.around, self.closed)
        if self.length is not None and self.prestrain != 0.0:
            raise InputError(
                f"length = {self.length:g} and prestrain = {self.prestrain:g} both say what the natural length is: "
                "leave one of them out"
            )
        law = law_of(self.law)
        if law.bar or law.forming or law.plastic:
            why = "is one of bars, which push" if law.bar else "is for form finding" if law.forming else "yields"
            raise InputError(f'law = "{self.law}" {why}: a thread takes "tension-only", "smooth" or "table"')
        if self.friction is not None and self.around:
            raise InputError("friction and around exclude each other: bodies of a thread have no friction yet")
        if self.friction is not None and law.pushes:
            raise InputError(f'law = "{self.law}" pushes: with friction a thread takes "tension-only" or "table"')
        self._cable()

    def _refuse_repeated(self, listed):
        """Refuse neighbours that are one node."""
        ends = [*listed, listed[0]] if self.closed else listed
        for i, (first, second) in enumerate(zip(ends[:-1], ends[1:], strict=True)):
            if first == second:
                why = "closes to itself: leave out the last" if i + 1 == len(listed) else "follows itself"
                raise InputError(f"nodes[{i}] = {quote(first)} {why}")

    def _cable(self):
        """The `refweb.Cable` with the material and the law of the thread."""
        from ..net.cable import Cable

        return Cable(**{key: getattr(self, key) for key in OF_CABLE})

    def extend(self, net: Net) -> Net:
        """The net with the thread and its mass."""
        from ..net.threads import thread_line

        if any(thread.name == self.name for thread in net.threads):
            raise InputError(f"name = {quote(self.name)} is listed twice: names of threads are unique")
        rows, over = self._rows(net.web)
        wraps = tuple(around.wrap(net, at, rows[at], rows[at + 1]) for at, around in over)
        thread = thread_line(self.name, net.web.points[rows], rows, self._cable(), self.length, wraps)
        thread = thread._replace(closed=self.closed, friction=self._friction(thread))
        mass = net.mass.copy()
        np.add.at(mass, rows[:-1], 0.5 * thread.masses)
        np.add.at(mass, rows[1:], 0.5 * thread.masses)
        return replace(net, mass=mass, threads=(*net.threads, thread), kept=(*net.kept, *thread.line.kept))

    def _friction(self, thread):
        """Coefficient of each ring in the order of segments, see `refweb.net.threads.ThreadLine`."""
        given, rings = self.friction, len(thread.distances) - (not self.closed)
        if given is None:
            return ()
        if isinstance(given, tuple) and len(given) != rings:
            raise InputError(
                f"friction has {len(given)} numbers, must have {rings}, one for each ring, or be one number"
            )
        for first, second in thread.segments[thread.distances == 0.0][:1]:
            raise InputError(
                f"nodes {first} and {second} follow each other in one point: with friction move them apart"
            )
        by_ring = given if isinstance(given, tuple) else (given,) * rings
        return by_ring[1:] + by_ring[:1] if self.closed else by_ring

    def _rows(self, web):
        """(Numbers of its nodes in order, the first again at the end if it is closed, int32, `Around` by segment)."""
        bodies, over = {around.body: around for around in self.around or ()}, []
        if isinstance(self.nodes, str):
            rows = (web.find_around if self.closed else web.find)(self.nodes).tolist()
            if len(rows) < 2:
                raise InputError(f"nodes = {quote(self.nodes)} is {len(rows)} node, must be two or more")
        else:
            rows = []
            for i, node in enumerate(self.nodes):
                if node in bodies:
                    over.append((len(rows) - 1, bodies[node]))
                else:
                    rows.append(web.find_one(node, f"nodes[{i}]"))
        self._refuse_repeated(rows)
        return np.array([*rows, rows[0]] if self.closed else rows, dtype=np.int32), over

    def add_internal(self, net: Net) -> Net:
        """The net with rows for the slips at rings with friction."""
        if not net.thread_of(self.name).rings:
            return net
        from .thread_friction import with_slips

        return with_slips(net, self.name)

    def settled(self, net: Net, x: Any) -> Any:
        """Displacement of all rows as a run begins from, None as it is given, with slips at rings with friction."""
        thread = net.thread_of(self.name)
        if x is None or not thread.rings:
            return x
        from .thread_friction import settled

        return settled(thread, net, x)

    def on(self, net: Net) -> ForceTerm | list[ForceTerm]:
        """The terms of one cell; ``out`` of the first is tension, stress, strain and length.

        With friction tensions of segments and slips of rings follow these.
        """
        thread = net.thread_of(self.name)
        if thread.wraps:
            from .winding import term

            return term(net, thread)
        if not thread.rings:
            return _term(thread)
        from .thread_friction import terms

        if not thread.powered:
            return terms(thread)
        from .winch_power import with_power

        return with_power(thread, terms(thread))


def _term(thread: ThreadLine):
    """The term of a thread."""
    line = thread.line
    force, energy, stiffness, bound = kernels(line.law, line.law_record, line.line_data.matrix.shape[1])
    return ForceTerm(
        name="thread",
        cells=thread.rows[None, :],
        data=thread.numbers[None, :],
        force=force,
        energy=energy,
        tangent=Tangent(stiffness, bound, across=thread.across),
        balance=Balance("strain_energy", internal=True),
        elements=CellElements(observed=COLUMNS),
    )
