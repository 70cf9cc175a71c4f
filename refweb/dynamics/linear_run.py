"""Run of central differences with its derivatives by numbers of a scene: at some times, and at peaks of results.

The state of the last three steps stays, so that the derivatives at a peak between them are known. `gradients` follows
a method and its step refinement by one `LinearRun` each, and reads the attributes.

May change: private functions. Must stay: attributes and arguments of `LinearRun` and `follow`, which `gradients` uses.
Tests: ``tests/dynamics/test_dynamic_gradients.py``, ``tests/dynamics/test_gradient_jumps.py``.
"""

from __future__ import annotations

import numpy as np

from ..results.observables.observe import SIGN
from ..results.state import State
from .integrators.tangent import BESIDE, Steps, Tangent
from .kinks import kinks_of, text_of
from .peaks import Peak, Peaks
from .responses import Instant, Margins, Slopes, between, rates_of, slopes_of, step_of, value_of


class LinearRun:
    """Run of a method with its derivatives.

    Parameters
    ----------
    integrator : refweb.dynamics.integrators.central_difference.CentralDifference
        The method.
    motion : tuple
        (x, v) of its start.
    numbers : sequence of refweb.dynamics.parameters.Parameter
        The numbers p.
    observed : sequence of refweb.Observe
        Observables of an instant.
    results, errors : dict
        `refweb.Result` of each in this run, and ± of each, by name.

    Attributes
    ----------
    times : list of float
        Times of the rows [s].
    rows : dict of str to list of ndarray, shape (p,)
        Derivatives by name at these times.
    peaks, samples : dict of str to list of refweb.dynamics.peaks.Peak
        Peaks of each result, and values of those that are reduced over time at the times of the rows.
    kinks : dict of int to (float, str)
        Time [s] from which on the motion has no derivative, and text of this kink, by the index of a number.
    snapped : float
        Time of the first line that snaps taut with a jump of its damping force [s], infinite if none does.
    at_snaps : set of float
        Times of rows at an end of a step in which a line does.
    """

    def __init__(self, integrator, motion, numbers, observed, results, errors):
        self._integrator, self._numbers, self._observed = integrator, numbers, observed
        self._results, self._errors = results, errors
        self._steps = Steps(integrator, motion)
        course = self._steps.course
        self._tangent = Tangent(integrator, numbers, 0.0, course.x, course.v, course.force)
        self._reduced = [o for o in observed if SIGN[o.reduce]]
        self._searches = {
            o.name: Peaks(SIGN[o.reduce], results[o.name].value - SIGN[o.reduce] * errors[o.name])
            for o in self._reduced
        }
        self.times, self.rows = [], {o.name: [] for o in observed}
        self.peaks, self.samples = {o.name: [] for o in observed}, {o.name: [] for o in self._reduced}
        self.kinks = self._tangent.snaps.kinks if self._tangent.snaps else {}
        self.snapped, self.at_snaps, self._delays = np.inf, set(), np.zeros((len(numbers), 0))

    def follow(self, times, sampled):
        """Follow the run to each of some times, and take a row at each time of a set; return itself."""
        self._sampled, self._trail, self._kinked, self._end = sampled, [], [], times[-1]
        self._waiting = sorted({*sampled, *(result.time for result in self._results.values())})
        self._add_instant(0.0, 0.0)
        self._steps.follow(times, self._step)
        for time in self._waiting:  # that of the end, but for rounding
            self._record(time, *self._trail[-1])
        for o in self._reduced:
            self._add_beside(o, self._searches[o.name].end(), self._last())
        return self

    def _step(self, t, h, corner):
        course = self._steps.course
        self._tangent.step(t, h, course.x, course.v, course.force, corner)
        if self._tangent.snaps:
            self._delays = self._tangent.snaps.delays
        self._add_instant(t, h)
        if self._delays.size:
            self.snapped = min(self.snapped, t)
            self.at_snaps.update(time for time in self.times[-2:] if time >= t - (1.0 + BESIDE) * h)

    def _add_instant(self, t, h):
        """Take the state at the end t of a step h, and at a corner of a table that before it as well."""
        now, before = (t, self._instant()), self._tangent.before
        at_corner = now if before is None else (t - BESIDE * h, Instant(now[1].x, *before))
        self._trail = [*self._trail[-2:], (at_corner, now)]
        due = t == 0.0
        while self._waiting and self._waiting[0] <= t:
            time = self._waiting.pop(0)
            self._record(time, *self._at(time))
            due = due or time in self._sampled
        self._find_kinks(due)
        for o in self._reduced:
            value = self._value(o, *self._counting(o, *self._trail[-1]))
            self._add_beside(o, self._searches[o.name].step(t, value), h)

    def _value(self, o, t, instant):
        return value_of(o, State(self._integrator.system, t, instant.x, instant.v))

    def _counting(self, o, before, now):
        """Time and instant of a result: behind a corner, of one reduced over time those whose value is the larger."""
        if before is now or not SIGN[o.reduce]:
            return now
        return max(now, before, key=lambda pair: SIGN[o.reduce] * self._value(o, *pair))

    def _find_kinks(self, due):
        """Note kinks at the ends of two steps, the first of which is the start or follows a row."""
        system, before = self._integrator.system, self._kinked
        if not (due or before):
            return
        now = kinks_of(system, self._numbers, *self._trail[-1][1])
        for n, kinks in enumerate(now if before else ()):
            for kink in sorted(kinks & before[n])[:1]:
                since = self._trail[-2][1][0]
                self.kinks.setdefault(n, (since, f"at {since:.4g} s {text_of(system, kink)}, and stays so"))
        self._kinked = now if due and any(now) else []

    def _instant(self):
        course, tangent = self._steps.course, self._tangent
        inverse = self._integrator.model.inertia.inverse
        return Instant(course.x, course.v, inverse * course.force, tangent.x, tangent.v, tangent.a).copied()

    def _at(self, time):
        """Pairs of time and instant before and behind a time of the last two steps, apart at a corner of a table.

        In a step in which a line snaps taut they are those at its end.
        """
        steps = [behind[0] for _, behind in self._trail]
        if time == steps[-1] or self._delays.size and time > steps[-2]:
            return self._trail[-1]
        first = 0 if time <= steps[1] else len(steps) - 2
        (_, (t0, start)), ((_, end), (t1, _)) = self._trail[first : first + 2]
        if time == t1:
            return self._trail[first + 1]
        return [(time, between((time - t0) / (t1 - t0), t1 - t0, start, end))] * 2

    def _rates(self, observed, at, instant):
        return rates_of(observed, self._numbers, self._integrator.system, at, instant)

    def _record(self, time, before, now):
        """Take rows and peaks at a time, with pairs of time and instant before and behind it."""
        behind, sampled = self._rates(self._observed, *now), time in self._sampled
        if sampled:
            self.times.append(time)
        for o in self._observed:
            name, pair = o.name, self._counting(o, before, now)
            rates = behind[name] if pair is now else self._rates([o], *pair)[name]
            if sampled:
                self.rows[name].append(slopes_of(o, rates, 0.0).value)
            if time == self._results[name].time:
                self.peaks[name].append(self._peak(o, time, rates, *pair))
            elif sampled and name in self.samples:
                self.samples[name].append(_peak(o, time, rates, 0.0))

    def _add_beside(self, o, time, h):
        """Add a peak at a time, if there is one, beside that of the result."""
        if time is not None and abs(time - self._results[o.name].time) > 2.0 * h:
            pair = self._counting(o, *self._at(time))
            self.peaks[o.name].append(self._peak(o, time, self._rates([o], *pair)[o.name], *pair))

    def _margins(self, time):
        """The `Margins` of a time: two steps to each side, within the run."""
        reach = 2.0 * self._last()
        return Margins(min(time, reach), min(self._end - time, reach), reach)

    def _last(self):
        """Size of the last step [s]."""
        steps = [behind[0] for _, behind in self._trail[-2:]]
        return steps[1] - steps[0] if len(steps) > 1 else self._integrator.step

    def _peak(self, o, time, rates, at, instant):
        """The `Peak` of a result, which moves with a line that snaps taut where the value falls behind this."""
        peak = _peak(o, time, rates, self._errors[o.name], self._margins(time))
        system, s = self._integrator.system, step_of(self._integrator.system, instant.v, instant.v, instant.a)
        if not (self._delays.size and SIGN[o.reduce] and s and time > self._trail[-2][1][0]):
            return peak
        moved = State(system, at, instant.x + s * instant.v, instant.v + s * instant.a)
        rate = (value_of(o, moved) - self._value(o, at, instant)) / s
        if SIGN[o.reduce] * rate >= 0.0:
            return peak
        low, high = self._delays.min(axis=1), self._delays.max(axis=1)
        move, apart = 0.5 * rate * (low + high), 0.5 * abs(rate) * (high - low)
        value, left, spread = peak.slopes
        return peak._replace(slopes=Slopes(value + move, left + move, spread + apart))


def _peak(observe, time, rates, error, margins=None):
    """The `Peak` of `refweb.dynamics.responses.Rates`."""
    return Peak(time, observe.observable.selected(rates.values)[0], slopes_of(observe, rates, error, margins))
