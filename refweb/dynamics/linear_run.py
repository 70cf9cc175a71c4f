"""Run of central differences with its derivatives by numbers of a scene: at some times, and at peaks of results.

The state of the last three steps stays, so that the derivatives at a peak between them are known. `gradients` follows
a method and its step refinement by one `LinearRun` each, and reads the attributes.
"""

from __future__ import annotations

from ..results.observables.observe import SIGN
from ..results.state import State
from .integrators.tangent import Steps, Tangent
from .kinks import kinks_of, text_of
from .peaks import Peak, Peaks
from .responses import Instant, Margins, between, rates_of, slopes_of, value_of


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
        Time [s] and text of the first kink at which the motion stays, by the index of a number.
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
        self.kinks = {}

    def follow(self, times, sampled):
        """Follow the run to each of some times, and take a row at each time of a set; return itself."""
        self._sampled, self._trail, self._kinked, self._end = sampled, [], [], times[-1]
        self._waiting = sorted({*sampled, *(result.time for result in self._results.values())})
        self._add_instant(0.0, 0.0)
        self._steps.follow(times, self._step)
        for time in self._waiting:  # that of the end, but for rounding
            self._record(time, self._trail[-1][1])
        for o in self._reduced:
            self._add_beside(o, self._searches[o.name].end(), self._trail[-1][0] - self._trail[-2][0])
        return self

    def _step(self, t, h):
        course = self._steps.course
        self._tangent.step(t, h, course.x, course.v, course.force)
        self._add_instant(t, h)

    def _add_instant(self, t, h):
        """Take the state at the end t of a step h."""
        self._trail = [*self._trail[-2:], (t, self._instant())]
        due = t == 0.0
        while self._waiting and self._waiting[0] <= t:
            time = self._waiting.pop(0)
            self._record(time, self._at(time))
            due = due or time in self._sampled
        self._find_kinks(due)
        state = State(self._integrator.system, t, self._trail[-1][1].x, self._trail[-1][1].v)
        for o in self._reduced:
            self._add_beside(o, self._searches[o.name].step(t, value_of(o, state)), h)

    def _find_kinks(self, due):
        """Note kinks at the ends of two steps, the first of which is the start or follows a row."""
        system, before = self._integrator.system, self._kinked
        if not (due or before):
            return
        now = kinks_of(system, self._numbers, *self._trail[-1])
        for n, kinks in enumerate(now if before else ()):
            for kink in sorted(kinks & before[n])[:1]:
                self.kinks.setdefault(n, (self._trail[-2][0], text_of(system, kink)))
        self._kinked = now if due and any(now) else []

    def _instant(self):
        course, tangent = self._steps.course, self._tangent
        inverse = self._integrator.model.inertia.inverse
        return Instant(course.x, course.v, inverse * course.force, tangent.x, tangent.v, tangent.a).copied()

    def _at(self, time):
        """The instant at a time of the last two steps."""
        if time == self._trail[-1][0]:
            return self._trail[-1][1]
        (t0, before), (t1, now) = self._trail[:2] if time <= self._trail[1][0] else self._trail[-2:]
        return now if time == t1 else between((time - t0) / (t1 - t0), t1 - t0, before, now)

    def _record(self, time, instant):
        """Take rows and peaks at a time."""
        rates = rates_of(self._observed, self._numbers, self._integrator.system, time, instant)
        if time in self._sampled:
            self.times.append(time)
        for o in self._observed:
            name = o.name
            if time in self._sampled:
                self.rows[name].append(slopes_of(o, rates[name], 0.0).value)
            if time == self._results[name].time:
                self.peaks[name].append(_peak(o, time, rates[name], self._errors[name], self._margins(time)))
            elif time in self._sampled and name in self.samples:
                self.samples[name].append(_peak(o, time, rates[name], 0.0))

    def _add_beside(self, o, time, h):
        """Add a peak at a time, if there is one, beside that of the result."""
        if time is not None and abs(time - self._results[o.name].time) > 2.0 * h:
            rates = rates_of([o], self._numbers, self._integrator.system, time, self._at(time))[o.name]
            self.peaks[o.name].append(_peak(o, time, rates, self._errors[o.name], self._margins(time)))

    def _margins(self, time):
        """The `Margins` of a time: two steps to each side, within the run."""
        reach = 2.0 * (self._trail[-1][0] - self._trail[-2][0]) if len(self._trail) > 1 else self._integrator.step
        return Margins(min(time, reach), min(self._end - time, reach), reach)


def _peak(observe, time, rates, error, margins=None):
    """The `Peak` of `refweb.dynamics.responses.Rates`."""
    return Peak(time, observe.observable.selected(rates.values)[0], slopes_of(observe, rates, error, margins))
