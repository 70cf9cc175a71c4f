"""Winches: the end of a thread on a drum, which hauls material in and pays it out.

A closed thread with a winch is one that begins and ends at the drum: one end is tied to it, the other wound on it.

A winch is one more ring of its thread, behind which is any amount of material. Its slip in a step follows with those of
the other rings, see `refweb.effects.thread_slips`: it hauls in up to a tension, pays out from a tension
on, and stays between the two, all that beside what its speed asks for and within its largest speed. That of a winch of
constant power has a rate of its own, see `refweb.effects.winch_power`.

Numbers of a winch: the tensions up to which it hauls in and from which it pays out [N], its largest speed beside the
one that is asked for [m/s], 1 in statics, where time does not pass, the number of rows of its table of speeds, and
these rows, of time [s] and speed [m/s]; in dynamics those of a constant power behind them.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..accepted import accepts, any_of
from ..errors import InputError
from ..messages import nearest, quote
from ..tables import Several, Table, checked, choice, field, nodes, real, rows, table, text

if TYPE_CHECKING:
    from ..net.net import Net
    from ..system.system import System

_speed, _speeds = real(unit="m/s"), rows(2, increasing=True, unit="m/s")


@accepts(any_of(_speed.metadata["read"].accepts, _speeds.metadata["read"].accepts))
def _one_or_table(name, value):
    """Read a speed, or a table of (t, speed)."""
    listed = hasattr(value, "tolist") or isinstance(value, (list, tuple))
    return checked(name, value, _speeds if listed else _speed)


@table
class Winch(Table):
    """A winch at an end of a thread, or at a node of a closed one, its drum: it hauls material in and pays it out.

    ``speed``, ``tension`` or ``power`` says how. A line on a winch is a thread of two nodes. Energy that the winch
    takes from the web is ``winch_energy``: heat of a brake is positive, work of a motor negative. Mass of the thread
    stays at its nodes. For lines whose mass follows, or many of which change alike, see ``[[reel]]``. A ``slip`` whose
    ``ring`` is the node of the drum is the length that has gone over it. Explicit steps are of order 1 where a winch
    with ``tension`` at its ``speed_limit`` turns round, and of order 2 else.

    A closed thread, such as a drawstring, is tied to the drum and wound on it from one side. Its segments and rings
    count from the drum: the first segment leaves it, and the last ring is the drum again. With friction the tension
    falls along the thread from the side that is wound. To wind both sides, take two threads from the drum to a node
    across, and a winch for each.

    Parameters
    ----------
    thread : str
        Name of the thread. It has one winch.
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
        Tension that the winch holds [N], at any speed up to ``speed_limit``; at 0 it takes slack in. In statics it
        holds it whatever length of thread that takes; with ``start = "equilibrium"`` as well, but for one with a
        ``speed_limit``, which begins as the web is.
    power : float, optional
        Power that the web gets [W], without the strain energy of what is wound; negative to pay out. The speed is power
        over tension, up to ``speed_limit``. A load that sinks at a constant power goes faster and faster, up to the
        limit. In statics, and with ``start = "equilibrium"``, the winch stays as it is.
    speed_limit : float, optional
        Largest speed with ``tension`` or ``power`` [m/s], in and out; by default none. With ``tension`` the tension is
        lower or higher at it. ``power`` needs one, since a slack thread has no tension.

    Raises
    ------
    InputError
        For none or several of ``speed``, ``tension`` and ``power``, a ``limit`` without ``speed``, a ``speed_limit``
        with it, and ``power`` without one.
        From ``extend``, for a thread that the scene does not have, that is open and has no ``end``, or has ``at``, that
        does not run through ``at``, has a winch already, a law that pushes, neighbours in one point or no more material
        for a speed.

    Examples
    --------
        [[winch]]
        thread = "rope"
        end = "last"
        tension = 50.0
        speed_limit = 2.0
    """

    several = True
    either = ("speed",), ("tension",), ("power", "speed_limit")

    thread: str = text(limit=80)
    end: str | None = choice("first", "last", default=None)
    at: Several = nodes(default=None)
    speed: Any = field(_one_or_table, default=None, unit="m/s")
    limit: float | None = real(default=None, above=0.0, unit="N")
    tension: float | None = real(default=None, at_least=0.0, unit="N")
    power: float | None = real(default=None, unit="W")
    speed_limit: float | None = real(default=None, above=0.0, unit="m/s")

    def check(self) -> None:
        """Refuse none or several ways to wind, and limits that have no meaning or are missing."""
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
            self._refuse_empty(thread, net.end)
        thread = self._opened(thread, net.web)
        friction = thread.friction or (0.0,) * (len(thread.distances) - 1)
        wound = thread._replace(winch=self._numbers(net.quasi_static), at_last=self.end == "last", friction=friction)
        return replace(net, threads=(*net.threads[:number], wound, *net.threads[number + 1 :]))

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
            drums = web.find(self.at, "at")
            if len(drums) != 1:
                raise InputError(f"at = {quote(self.at)} is {len(drums)} nodes, must be one")
            passes = np.flatnonzero(thread.rows[:-1] == drums[0])
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

    def _speeds(self):
        """Rows of time [s] and speed [m/s]."""
        return self.speed if isinstance(self.speed, tuple) else ((0.0, self.speed or 0.0),)

    def _refuse_empty(self, thread, end):
        """Refuse speeds that haul in all material of a thread until the end of a run [s]."""
        times, speeds = np.array(self._speeds()).T
        at = np.unique(np.clip([0.0, end, *times], 0.0, end))
        for before, behind in zip(times[:-1], times[1:], strict=True):  # where a speed passes through zero
            first, second = np.interp([before, behind], times, speeds)
            if first > 0.0 > second:
                at = np.append(at, np.clip(before + (behind - before) * first / (first - second), 0.0, end))
        at = np.unique(at)
        speed = np.interp(at, times, speeds)
        hauled = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(at) * (speed[1:] + speed[:-1]))])
        if self.limit is None and hauled.max() >= thread.natural_length:
            raise InputError(
                f"speed hauls in {hauled.max():.4g} m until t = {at[hauled.argmax()]:.4g} s, must be below the natural "
                f"length of {thread.title}, {thread.natural_length:.4g} m"
            )

    def _numbers(self, quasi_static):
        """Its numbers, see the module."""
        if self.tension is not None:
            holds = self.tension, self.tension
        else:
            holds = -math.inf, math.inf if self.limit is None else self.limit
        largest = 0.0 if self.limit is None and self.tension is None else self.speed_limit or math.inf
        speeds = self._speeds()
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
        value = max(value, 0.0) if key == "tension" else value
        of_table = [(t, value) for t, _ in given] if isinstance(given, tuple) else value
        return replace(self, **{key: of_table})

    def writes(self, system: System) -> list[Any]:
        """(Array, numbers) of the thread in a system, with the numbers of this winch."""
        number = next(number for number, thread in system.threads.items() if thread.name == self.thread)
        array, numbers = system.terms[number].data, self._numbers(system.net.quasi_static)
        return [(array, np.append(array[:, : -len(numbers)], [numbers], axis=1))]

    def on(self, net: Net) -> list[Any]:
        """No term: its thread has them."""
        return []
