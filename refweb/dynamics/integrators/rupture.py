"""Any integrator with lines that break: it stops where the first breaks, and goes on as a new one of the torn system.

A line breaks where the largest tension over its limit, or strain over its limit, passes 1: an event that ends the run.
CVODE, IDA and other observed methods find its moment on what they know within their step. Explicit steps only see that
it has passed: they are taken again from before, to where it does, by Brent's method on the length of the last step or
two. So nothing has to be taken back from the books, extremes and means, and the error of the moment is that of the
motion.

May change: `FINE` and how the moment is sought. `TOGETHER` decides which elements break at once, and so results. Must
stay: `Rupturing` passes on attributes that it lacks from ``inner``, so that it stands for any integrator; the last
event is that of breaks, as `history.Watch` orders events; keys ``broken_…`` of checkpoints. `registry.Method` makes it,
`studies.trials` by `with_breaks`. Tests: ``tests/effects/test_rupture.py``, ``test_plastic.py``.
"""

from __future__ import annotations

import numpy as np

from ...effects.base import STRAIN
from ...errors import InputError
from ...results.probes import breaking, line, line_of, share_of_limits, slack_fraction
from ...system.broken_lines import Breaks, tear, torn
from .events import Event, ended_by
from .extremes import begin_anew
from .integrator import History

TOGETHER = 1e-9
"""Share of the largest tension over its limit within which elements break together."""
FINE = 1e-9
"""Error of a moment over the size of a step."""


class Rupturing:
    """An integrator of a system whose elements break.

    Parameters
    ----------
    make : callable
        Makes the integrator of a system, probes, sums and events.
    system : refweb.system.system.System
        With a `refweb.effects.base.BreakLimits`.
    probes, sums, events : sequence
        Monitors. If elements break by tension, the last event is that the largest tension over its limit passes 1; it
        ends the run.

    Attributes
    ----------
    inner : refweb.dynamics.integrators.integrator.Integrator
        That of the system as it is torn now.

    Raises
    ------
    InputError
        For nodes without mass that are free to move.
    """

    def __init__(self, make, system, probes=(), sums=(), events=()):
        self._probes, self._rest = probes, (sums, events)
        self._make, self._intact, self._weakness = make, system, system.weakness
        self._report = None
        self.inner = self._of(system)
        places = system.rows - system.net.internal
        bare = np.flatnonzero((system.net.mass <= 0.0)[:places] & ~system.supported.all(axis=1)[:places])
        if len(bare):
            raise InputError(
                f"[rupture] needs mass at every node that moves: {system.row_name(bare[0])} has none, and would jump "
                "where a line at it breaks; give density > 0 or a [[point_mass]]"
            )

    def __getattr__(self, name):
        return getattr(self.inner, name)

    @property
    def on_progress(self):
        """Report progress as `refweb.dynamics.integrators.integrator.Integrator` does."""
        return self.inner.on_progress

    @on_progress.setter
    def on_progress(self, call):
        self._report = self.inner.on_progress = call

    def _of(self, system):
        """The integrator of a system."""
        broken = system.net.broken
        inner = self._make(system, [unstrained(probe, broken) for probe in self._probes], *self._rest)
        if self._report is not None:
            inner.on_progress = self._report
        return inner

    def coarser_by(self, spans):
        """Ask for more steps: a larger error changes the order of breaks, after which no ± is known."""
        return None

    def refined(self, by=None):
        """Make the integrator of the system without breaks, with another error."""
        return Rupturing(lambda *parts: self._make(*parts).refined(by), self._intact, self._probes, *self._rest)

    def start(self, x=None, v=None):
        """The course at t = 0, where all breaks that is above its limit."""
        self.inner = self._of(self._intact)
        course = self.inner.start(x, v)
        course.breaks = Breaks()
        over = np.flatnonzero((self._shares(course) >= 1.0) | self._yielded(course))
        holds = self._holding(np.append(self._intact.net.broken, over))
        now = [element for time, element in self._weakness.times if time <= 0.0 and holds(element)]
        if len(over) or now:
            self._break(course, np.union1d(over, now).astype(np.int64))
        return course

    def save(self, course):
        """The course as arrays by name, with what has broken."""
        return self.inner.save(course) | {f"broken_{name}": array for name, array in course.breaks._asdict().items()}

    def load(self, arrays):
        """The course of a checkpoint."""
        arrays = dict(arrays)
        breaks = Breaks(*(arrays.pop(f"broken_{name}") for name in Breaks._fields))
        system = self._intact
        if len(breaks.elements):
            system = torn(system, breaks.elements, breaks.energies)
        self.inner = self._of(system)
        course = self.inner.load(arrays)
        course.breaks = breaks
        return course

    def advance(self, course, times):
        """Take a course to each of some times, see `refweb.dynamics.integrators.integrator.Integrator.advance`."""
        ahead, parts = np.atleast_1d(np.asarray(times, dtype=float)), []
        while len(ahead):
            due = self._due(course, ahead[-1])
            targets = ahead if due is None else np.append(ahead[ahead < due[0]], due[0])
            kept = self._kept(course)
            rows = self.inner.advance(course, targets)
            if self._torn_now(course):
                rows, elements, width = self._located(course, kept, targets, rows)
            elif due is not None and course.time == due[0] and not course.stopped:
                elements, width = np.array([due[1]]), 0.0
            else:
                parts.append(rows)
                break
            parts.append(rows[:-1])
            ahead = ahead[len(rows) - 1 :]
            self._break(course, elements, width)
        return _joined(parts)

    def _due(self, course, until):
        """The next (time, element) of those that break at a time, None where none does until then."""
        holds = self._holding(self.inner.system.net.broken)
        for time, element in self._weakness.times:
            if course.time <= time <= until and holds(element):
                return time, element
        return None

    def _holding(self, broken):
        """Function that tells if the line of an element has no element that is ``broken``."""
        line = self._intact.net.line
        gone = set(line[broken])
        return lambda element: line[element] not in gone

    def _torn_now(self, course):
        """Tell if the event of a break, and no other, has ended the run."""
        watched = self._weakness.watched and len(course.events) > 0
        return watched and course.events[-1]["time"] < np.inf and not ended_by(course.events[:-1])

    def _shares(self, course):
        """Shares of the limits of elements, see `refweb.effects.base.BreakLimits.shares`."""
        return self._weakness.shares(self.inner.system.forces(course.time, course.x, course.v).per_cell)

    def _yielded(self, course):
        """Tell of elements if their plastic strain is above their limit, of lines that are slack as well."""
        system, strains = self.inner.system, self._weakness.strains
        if strains is None:
            return np.zeros(len(self._weakness.limits), dtype=bool)
        from ...effects.plastic import plastic_strain, strain_at

        net, intact = system.at(course.time).net, self._intact.net.line_data.ea > 0.0
        with np.errstate(invalid="ignore"):  # of broken elements
            return intact & (strain_at(net, plastic_strain(net, course.x).max(axis=1)) >= strains)

    def _kept(self, course):
        """A course as arrays of its own."""
        return {name: np.array(array) for name, array in self.inner.save(course).items()}

    def _again(self, kept, breaks, watching=False):
        """The course that was kept; unless ``watching`` no break ends it."""
        arrays = {name: np.array(array) for name, array in kept.items()}
        event = arrays["events"][-1]
        event["time"], event["stop"], event["side"] = np.inf if watching else 0.0, watching, -1.0
        course = self.inner.load(arrays)
        course.breaks = breaks
        return course

    def _located(self, course, kept, targets, rows):
        """(Rows, elements, width) of a break: the course is where it happens, to `FINE` of a step or less than that."""
        event, slot = course.events[-1], course.events[-1]["slot"]
        end, width = float(event["time"]), float(event["width"])
        if width > 0.0:
            begin, since = float(kept["time"]), end - width
            reached = course.breaks
            while True:
                since = max(since, begin)
                before = self._again(kept, reached)
                first = self.inner.advance(before, np.append(targets[targets < since], since))
                if since == begin or first.probes[-1, slot] < 1.0:
                    break
                since -= 2.0 * (end - since)
            start = self._kept(before)

            def over(t):
                located = self._again(start, reached)
                return float(self.inner.advance(located, [t]).probes[-1, slot]) - 1.0

            below = float(first.probes[-1, slot]) - 1.0
            until = next((t for t in end + width * np.arange(3) if over(t) >= 0.0), None)
            if until is not None and below < 0.0:
                from scipy.optimize import brentq

                moment = brentq(lambda t: over(t) if t > since else below, since, until, xtol=FINE * width)
                located = self._again(start, reached)
                last = self.inner.advance(located, np.append(targets[(targets >= since) & (targets < moment)], moment))
                _accept(course, located)
                rows, width = _joined([first[:-1], last]), 0.0
            else:  # its step is taken again, and it only grazes: it has passed, and when is known to a step
                restored = self._again(self._kept(course), reached)
                _accept(course, restored)
        shares = self._shares(course)
        return rows, np.flatnonzero(shares >= (1.0 - TOGETHER) * shares.max()), width

    def _break(self, course, elements, width=0.0):
        """Break elements of a course, and go on with the integrator of what is left."""
        system, t, v = self.inner.system, course.time, course.v
        course.x[:] = x = system.taken_on(t, course.x)
        left, energies = tear(system, t, x, v, elements)
        places = system.net.points[system.net.cells[elements]] + x[system.net.cells[elements]]
        count = len(elements)
        more = elements, np.full(count, t), energies, places.mean(axis=1), np.full(count, width)
        breaks, arrays = course.breaks.and_then(*more), self._kept(course)
        if "force" in arrays:
            arrays["force"] = left.force(t, x, v)
        self.inner = self._of(left)
        if self._weakness.watched and len(course.events):
            _accept(course, self._again(arrays, breaks, watching=True))
        else:
            _accept(course, self.inner.load(arrays))
            course.breaks = breaks
        begin_anew(course.extremes)


def with_breaks(make, system, probes):
    """The `Rupturing` of a system with some probes and what breaks need; ``make`` is of a system, probes and events."""
    weakness, events = system.weakness, []
    if weakness.watched:
        events = [Event(len(probes), 1.0, True, stop=True)]
        probes = [*probes, share_of_limits(system)]
    return Rupturing(make, system, probes, (), events)


def unstrained(probe, broken):
    """A probe to which broken elements have no strain, also between steps, where the law alone shows what they have."""
    if not len(broken):
        return probe
    data = np.array(probe.data, dtype=float)
    if probe.kernel is breaking or (probe.kernel in (line, line_of) and probe.rows[0] == STRAIN):
        data[broken] = 0.0
    elif probe.kernel is slack_fraction:
        data[broken] = np.inf
    return probe._replace(data=data)


def _accept(course, accepted):
    """Copy all fields of the accepted state to ``course``."""
    course.__dict__.update(accepted.__dict__)


def _joined(parts):
    """Rows of several histories as one."""
    return History(parts[0].names, np.concatenate([part.values for part in parts]), parts[0].probed)
