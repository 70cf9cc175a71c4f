"""Winches: the end of a thread or line on a drum, which hauls material in and pays it out.

A closed thread with a winch is one that begins and ends at the drum: one end is tied to it, the other wound on it.

A winch is one more ring of its thread, behind which is any amount of material. Its slip in a step follows with those of
the other rings, see `refweb.effects.thread_slips`: it hauls in up to a tension, pays out from a tension
on, and stays between the two, all that beside what its speed asks for and within its largest speed. That of a winch of
constant power has a rate of its own, see `refweb.effects.winch_power`.

Numbers of a winch: the tensions up to which it hauls in and from which it pays out [N], its largest speed beside the
one that is asked for [m/s], 1 in statics, where time does not pass, the number of rows of its table of speeds, and
these rows, of time [s] and speed [m/s]; in dynamics those of a constant power behind them.

A line on a winch is in `refweb.effects.wound_lines`.

May change: private functions and messages. Must stay: keys and docstring of `Winch` (scene format and help; after a
change write ``validation/REFERENCE.md`` anew); the order of the numbers above, which `thread_slips`, `winch_power`,
`wound_lines` and `wound_mass` read by position; `writes` and `commanded`, with which `dynamics.commands` sets new
values in a run. Tests: ``tests/effects/test_winch.py``, ``tests/effects/test_wound_lines.py``.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ..errors import InputError
from ..messages import nearest, quote
from ..tables import Several, Table, choice, nodes, real, real_or_rows, table, text

if TYPE_CHECKING:
    from ..net.net import Net
    from ..system.system import System


@table
class Winch(Table):
    """A winch at an end of a thread or line, or at a node of a closed thread: it hauls material in and pays it out.

    ``speed``, ``tension`` or ``power`` says how. Energy that the winch takes from the web is ``winch_energy``: heat of
    a brake is positive, work of a motor negative. For lines whose natural lengths change in proportion see
    ``[[reel]]``. A ``slip`` of the thread whose ``ring`` is the node of the drum is the length that has gone over it.
    Explicit steps are of order 1 where a winch with ``tension`` at its ``speed_limit`` turns round, and of order 2
    else.

    Each line of ``lines`` has a winch of these numbers at one of its ends; which of them makes a difference to
    ``mass = "follows"`` alone. It stays a line, with its tension, strain, drag and contact with bodies. Lines on
    brakes take up the energy of what the web catches. A line on a winch is one element, has a law that does not
    push or yield, does not break, and its natural length changes by the winch alone. Explicit steps are shorter by
    up to a factor of √2 where it is the stiffest.

    A closed thread, such as a drawstring, is tied to the drum and wound on it from one side. Its segments and rings
    count from the drum: the first segment leaves it, and the last ring is the drum again. With friction the tension
    falls along the thread from the side that is wound. To wind both sides, take two threads from the drum to a node
    across, and a winch for each.

    Parameters
    ----------
    thread : str, optional
        Name of the thread. It has one winch.
    lines : int, str or list, optional
        In place of it lines, by number or group (see `refweb.net.groups`), or "all"; each has a winch.
    end : {"first", "last"}, optional
        End of an open thread at the drum: its first node or its last. Of a closed thread the side that is wound: the
        segment behind the drum, by default, or with "last" the one before it.
    at : int or str, optional
        Node of a closed thread that is the drum, by number or name, where the thread passes it first; by default the
        first node of the thread.
    speed : float or list of (t, speed), optional
        Speed [m/s] at which material is hauled in, negative to pay out; or a table, linear between the times and
        constant before and after them. In statics the winch stays as it is at the start.
    limit : float, optional
        Tension at which a winch with ``speed`` slips and pays out [N], as a brake does. A brake alone is a winch of
        ``speed = 0``.
    tension : float, optional
        Tension that the winch holds [N], at any speed up to ``speed_limit``; at 0 it takes slack in, and one below 0
        that is set during a run counts as 0. In statics it holds it whatever length of thread that takes; with
        ``start = "equilibrium"`` as well, but for one with a ``speed_limit``, which begins as the web is.
    power : float, optional
        Power that the web gets [W], without the strain energy of what is wound; negative to pay out. The speed is power
        over T + T²/(2 EA) of the tension T, up to ``speed_limit``. A load that sinks at a constant power goes faster
        and faster, up to the limit. In statics, and with ``start = "equilibrium"``, the winch stays as it is.
    speed_limit : float, optional
        Largest speed with ``tension`` or ``power`` [m/s], in and out; by default none. With ``tension`` the tension is
        lower or higher at it. ``power`` needs one, since a slack thread has no tension.
    mass : {"stays", "follows"}
        "stays": nodes keep their mass. "follows": each segment, or line, has the mass of its natural length. Material
        leaves and comes through the drum, at the velocity of the drum's node, with its momentum and its energy, which
        counts as ``work``; over each ring of a thread it goes at the velocity of the ring. The weight of what comes is
        ``work`` as well: energies by place are those of the masses at t = 0. Point masses and bodies keep theirs, a
        body with the share of nodes on it. The inertia of material that slides along the thread is left out; where
        lines turn about a drum or ring that is free to move, angular momentum is not kept, and a run says so.
    drum : int, str or list, optional
        Nodes at the drums of ``lines``, with ``mass = "follows"``: one end of each. By default the one that is
        supported, moved or on a body.

    Raises
    ------
    InputError
        For none or both of ``thread`` and ``lines``, none or several of ``speed``, ``tension`` and ``power``, a
        ``limit`` without ``speed``, a ``speed_limit`` with it, ``power`` without one, ``end`` or ``at`` of lines, and a
        ``drum`` of a thread or without ``mass = "follows"``.
        From ``extend``, for a thread that the scene does not have, that is open and has no ``end``, or has ``at``, that
        does not run through ``at``, and for a thread or line that has a winch already, a law that pushes, nodes in one
        point or no more material for a speed; for a line of several elements, that is broken, or yields; for a
        consistent mass that is to follow. From ``on``, for a line whose natural length changes otherwise.

    Examples
    --------
        [[winch]]
        thread = "rope"
        end = "last"
        tension = 50.0

        [[winch]]
        lines = "rim"
        tension = 20.0
    """

    several = True
    either: ClassVar[tuple[tuple[str, ...], ...]] = (
        *(
            (kind, *keys)
            for kind in ("thread", "lines")
            for keys in (("speed",), ("tension",), ("power", "speed_limit"))
        ),
    )

    thread: str | None = text(default=None, limit=80)
    lines: Several = nodes(default=None, what="line")
    end: str | None = choice("first", "last", default=None)
    at: Several = nodes(default=None)
    speed: Any = real_or_rows(default=None, unit="m/s")
    limit: float | None = real(default=None, above=0.0, unit="N")
    tension: float | None = real(default=None, at_least=0.0, unit="N")
    power: float | None = real(default=None, unit="W")
    speed_limit: float | None = real(default=None, above=0.0, unit="m/s")
    mass: str = choice("stays", "follows", default="stays")
    drum: Several = nodes(default=None)

    def check(self) -> None:
        """Refuse none or several ways to wind, and keys that have no meaning or are missing."""
        if (self.thread is None) == (self.lines is None):
            both = f"thread = {quote(self.thread)} and lines = {quote(self.lines)} exclude each other: give a winch for"
            raise InputError(f"{both} each" if self.thread else "thread and lines are missing: give one of them")
        for key in ("end", "at") if self.lines is not None else ():
            if (value := getattr(self, key)) is not None:
                raise InputError(f"{key} = {quote(value)} is of threads, and this winch has lines: leave it out")
        if self.drum is not None and (self.lines is None or self.mass == "stays"):
            why = "where the winch has a thread" if self.lines is None else 'where mass = "stays"'
            raise InputError(f"drum = {quote(self.drum)} has no meaning {why}: leave it out")
        given = [name for name in ("speed", "tension", "power") if getattr(self, name) is not None]
        if len(given) != 1:
            raise InputError(
                f"{' and '.join(given)} exclude each other: give one of them"
                if given
                else "speed, tension and power are missing: give one"
            )
        if self.limit is not None and self.speed is None:
            raise InputError(f"limit = {self.limit:g} has no meaning with {given[0]}: it needs speed")
        if self.speed_limit is not None and self.speed is not None:
            raise InputError(f"speed_limit = {self.speed_limit:g} has no meaning with speed: leave it out")
        if self.power is not None and self.speed_limit is None:
            raise InputError(
                f"speed_limit is missing: with power = {self.power:g} a slack thread would be wound at any speed"
            )

    def extend(self, net: Net) -> Net:
        """The net whose thread or lines have the winch."""
        changed = self._on_thread(net) if self.lines is None else self._on_lines(net)
        if self.mass == "stays":
            return changed
        from .wound_mass import WoundFlow

        if net.consistent_minus_lumped is not None:
            raise InputError('mass = "follows" needs [solve] mass = "lumped", not "consistent": leave that out')
        lines = np.zeros(0, dtype=np.int64) if self.lines is None else net.web.find_lines(self.lines)
        drums = None if self.drum is None else net.web.find(self.drum, "drum")
        powered = self.power is not None and not net.quasi_static
        return replace(changed, flows=(*changed.flows, WoundFlow(self.thread, lines, drums, powered)))

    def _on_thread(self, net):
        """The net whose thread has the winch."""
        names = [thread.name for thread in net.threads]
        if self.thread not in names:
            hint = nearest(self.thread, names) if names else "the scene has no [[thread]]"
            raise InputError(f"thread = {quote(self.thread)} is not a thread, {hint}")
        number = names.index(self.thread)
        thread = net.threads[number]
        for refused, why in (
            (thread.winch, "has a winch already"),
            (thread.wraps, "runs over a body, and takes no winch: let the body turn about an axle"),
            (not thread.distances.all(), "has neighbours in one point: with a winch move them apart"),
            (
                thread.line.law.pushes,
                f'has law = "{thread.line.law.name}", which pushes: take "tension-only" or "table"',
            ),
        ):
            if refused:
                raise InputError(f"thread = {quote(self.thread)} {why}")
        if net.end < math.inf and not net.quasi_static:
            self._refuse_empty(thread.title, thread.natural_length, net.end)
        thread = self._opened(thread, net.web)
        friction = thread.friction or (0.0,) * (len(thread.distances) - 1)
        wound = thread._replace(winch=self.numbers(net.quasi_static), at_last=self.end == "last", friction=friction)
        return replace(net, threads=(*net.threads[:number], wound, *net.threads[number + 1 :]))

    def _on_lines(self, net):
        """The net whose lines have the winch."""
        lines = net.web.find_lines(self.lines)
        if net.subdivide > 1 or net.order > 1:
            key, value = ("subdivide", net.subdivide) if net.subdivide > 1 else ("order", net.order)
            raise InputError(
                f"lines = {quote(self.lines)}: a line on a winch is one straight element, and [cable] {key} = {value}: "
                "leave it out, or give a [[thread]] in place of the line"
            )
        wound, broken = [net.line[elements] for elements, _ in net.wound], np.asarray(net.web.broken, dtype=np.int64)
        for line in lines.tolist():  # whose element has the same number
            law = net.laws[net.law_index[line]]
            for refused, why in (
                (any(line in others for others in wound), "has a winch already"),
                (line in broken, "is broken"),
                (net.line_data.distance[line] == 0.0, "has its ends in one point: move them apart"),
                (
                    law.pushes or law.bar or law.forming or law.plastic,
                    f'has law = "{law.name}": on a winch it takes "tension-only" or "table"',
                ),
            ):
                if refused:
                    raise InputError(f"line {line} {why}")
        if net.end < math.inf and not net.quasi_static:
            shortest = lines[net.natural_length[lines].argmin()]
            self._refuse_empty(f"line {shortest}", float(net.natural_length[shortest]), net.end)
        return replace(net, wound=(*net.wound, (lines, self)))

    def _opened(self, thread, web):
        """The thread as an open one, from the drum to the drum where it is closed."""
        if not thread.closed:
            if self.at is not None:
                raise InputError(f"at = {quote(self.at)} is of closed threads, and {thread.title} is open: give end")
            if self.end is None:
                raise InputError(f'end is missing: {thread.title} is open, give "first" or "last"')
            return thread
        start = 0
        if self.at is not None:
            passes = np.flatnonzero(thread.rows[:-1] == web.find_one(self.at, "at"))
            if not len(passes):
                raise InputError(f"at = {quote(self.at)} must be a node of {thread.title}, such as {thread.rows[0]}")
            start = int(passes[0])
        rows = np.roll(thread.rows[:-1], -start)
        return thread._replace(
            rows=np.append(rows, rows[:1]),
            vectors=np.roll(thread.vectors, -start, axis=0),
            distances=np.roll(thread.distances, -start),
            friction=(thread.friction[start:] + thread.friction[:start])[:-1],
            closed=False,
        )

    @property
    def speeds(self) -> tuple[tuple[float, float], ...]:
        """Rows of time [s] and speed [m/s]."""
        return self.speed if isinstance(self.speed, tuple) else ((0.0, self.speed or 0.0),)

    def _refuse_empty(self, title, length, end):
        """Refuse speeds that haul in all of a natural length [m] until the end of a run [s]."""
        times, speeds = np.array(self.speeds).T
        at = np.unique(np.clip([0.0, end, *times], 0.0, end))
        for before, behind in zip(times[:-1], times[1:], strict=True):  # where a speed passes through zero
            first, second = np.interp([before, behind], times, speeds)
            if first > 0.0 > second:
                at = np.append(at, np.clip(before + (behind - before) * first / (first - second), 0.0, end))
        at = np.unique(at)
        speed = np.interp(at, times, speeds)
        hauled = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(at) * (speed[1:] + speed[:-1]))])
        if self.limit is None and hauled.max() >= length:
            raise InputError(
                f"speed hauls in {hauled.max():.4g} m until t = {at[hauled.argmax()]:.4g} s, must be below the natural "
                f"length of {title}, {length:.4g} m"
            )

    def numbers(self, quasi_static: bool) -> tuple[float, ...]:
        """Numbers of the winch, in the order that the docstring of this module gives."""
        if self.tension is not None:
            holds = self.tension, self.tension
        else:
            holds = -math.inf, math.inf if self.limit is None else self.limit
        largest = 0.0 if self.limit is None and self.tension is None else self.speed_limit or math.inf
        speeds = self.speeds
        flat = [value for row in speeds for value in row]
        if self.power is not None and not quasi_static:
            flat += [self.power, self.speed_limit]
        return (*holds, largest, float(quasi_static), float(len(speeds)), *flat)

    def commanded(self, key: str, value: float) -> Winch:
        """The winch with another number from now on, in place of a table as well; a tension below 0 is 0.

        Raises
        ------
        InputError
            For a key that the winch does not have in the scene.
        """
        given = getattr(self, key)
        if given is None:
            keys = " or ".join(key for key in ("speed", "limit", "tension", "power") if getattr(self, key) is not None)
            raise InputError(f"{key} is not a key of this winch in the scene, which has {keys}")
        value = max(float(value), 0.0) if key == "tension" else float(value)
        of_table = [(t, value) for t, _ in given] if isinstance(given, tuple) else value
        return replace(self, **{key: of_table})

    def writes(self, system: System) -> list[Any]:
        """(Array, part of it, numbers of this winch) of the thread or lines in a system."""
        net, numbers = system.net, self.numbers(system.net.quasi_static)
        lines, others = None if self.lines is None else net.web.find_lines(self.lines), []
        if self.mass == "follows":
            from .wound_mass import write_numbers as write_to_mass

            others = write_to_mass(system, self.thread, lines, numbers)
        if lines is not None:
            from .wound_lines import write_numbers

            if net.factors or system.weakness is not None:
                raise InputError(
                    "a winch on lines has its numbers from the scene alone beside [[reel]], [temperature] and lines "
                    "that break: take a [[thread]] of two nodes"
                )
            return [*write_numbers(net, lines, numbers), *others]
        number = next(number for number, thread in system.threads.items() if thread.name == self.thread)
        array: Any = system.terms[number].data
        return [(array, np.s_[:, -len(numbers) :], numbers), *others]

    def settled(self, net: Net, x: Any) -> Any:
        """Displacement of all rows as a run begins from, None as it is given, with what lines have wound."""
        if x is None or not self._leads(net):
            return x
        from .wound_lines import settled

        return settled(net, x)

    def _leads(self, net):
        """Tell if this is the first winch on lines, whose terms are those of all."""
        return self.lines is not None and net.wound[0][1] == self

    def on(self, net: Net) -> list[Any]:
        """Terms of all lines on winches, of the first of these; those of a thread are its own."""
        if not self._leads(net):
            return []
        from .wound_lines import terms

        return terms(net)
