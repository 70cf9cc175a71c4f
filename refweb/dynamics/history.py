"""Monitors of a scene, and the conversion of their `History` to rows of ``history.csv`` and results.

Observables of a state are probes. Those of energies, work and step size are weighted sums of the integrator's balances.
After the probes of observables follow those for warnings, and those for events without an observable.

May change: private functions. Must stay: probes stand in the order of observables, warnings and events, since results
are found by number; the break of lines is the last event, as `integrators.rupture` expects; columns of `table`, the
format of ``history.csv``, and of `compared`, which `twin_error`, `divergence` and `gradients` read by position; keys of
`breaks`, which stand in ``run.json``. `SPREAD` widens ± of all dynamic results; `AT_REST` and `REST_SHARE` are defaults
of ``[[event]]``, which `settings.Event` says in words. Must stay as well: `Watch` with its public names, which
`controllers` and `simulation` import. Tests: ``tests/dynamics/test_dynamics.py``.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..effects.base import SNAPPED, STRAIN, pairs_of
from ..results import probes
from ..results.columns import FIRST, components, dynamic_energies, vectors
from ..results.observables.balances import weights
from ..results.observables.observe import SIGN, Observe
from ..results.solution import Result
from ..results.state import State, margin_of
from ..results.strength import Utilisation
from ..results.units import readable
from .integrators.crossings import PAIRS
from .integrators.events import Event
from .integrators.integrator import History, Sum

SPREAD = 3.0
"""± of a result over its error if the method has its order."""


def _probes_of_warnings(system, followed, step_size):
    """Probes for warnings and refusals by name; their largest values count.

    They follow a scale of each element times its tension or its strain, and the depth of lines in each body.
    ``followed`` are probes that exist in any case: if one of them is the largest tension, which belongs to the largest
    strain, strains need no further probe. The speed of bodies is followed if the ``step_size`` is given [s].
    """
    net, tension, scales = system.net, system.tension_column, {}
    if net.law_is("smoothed").any():
        scales["stress"] = tension, 1.0 / net.area
    if np.isfinite(net.strength).any():
        scales["utilisation"] = tension, 1.0 / (net.area * net.strength)
        if _shares_differ(net):
            scales["margin"] = tension, 1.0 / (net.area * net.allowed)
    tell = [scale for _, scale in scales.values()]
    if not any(_tells_strain(system, scale) for scale in (*tell, *(p.data[:, 0] for p in followed if _of_tension(p)))):
        scales["strain"] = STRAIN, np.ones(len(net.cells))
    if net.curve_scale is not None:
        scales["curve"] = STRAIN, net.curve_scale
    by_name = {
        name: probes.Probe(probes.line, [column, 0, len(scale)], scale[:, None], 1)
        for name, (column, scale) in scales.items()
    }
    if system.threads:
        from ..results.observables.thread import of_cell

        none = np.zeros((0, 0))
        by_name |= {t.title: probes.Probe(of_cell, [2], none, sign=1.0, term=i) for i, t in system.threads.items()}
    if system.weakness is not None and system.weakness.strains is not None:
        by_name["break"] = probes.share_of_limits(system)
    if system.orbit_radius is not None:
        places = system.net.points[: system.rows - system.net.spins].copy()
        by_name["distance"] = probes.Probe(probes.displacement, [probes.MAGNITUDE, 0, len(places)], places, 1.0)
    if system.contact:
        from ..results.observables.overlap import probe_of

        by_name |= {("overlap", body.name): probe_of(system, body)._replace(sign=1.0) for body in net.bodies}
    for i in (i for i, term in enumerate(system.terms) if term.contact.crossing is not None):
        cells = len(system.terms[i].cells)
        by_name["lines"] = probes.Probe(probes.deepest, [0, cells], np.zeros((1, 1)), sign=1.0, term=i)
    if any(thread.wraps for thread in net.threads):
        from .half_turns import probe_of as probe_of_turns

        by_name |= {"half turns": probe} if (probe := probe_of_turns(net)) is not None else {}
    if any(term.velocity.jumps for term in system.terms):
        by_name["snaps"] = probes.Probe(probes.root_of_sum, [SNAPPED], np.zeros((0, 0)))
    if pairs_of(system):
        from ..results.observables.overlap import probe_of_speed, probes_between

        by_name |= probes_between(system)
        if step_size is not None:
            by_name["body speed"] = probe_of_speed(system)
    return by_name


def _correction(extremes, at, relative):
    """Lower limit of ± of an extreme value by its number, see `Watch.corrections`."""
    return max(float(extremes.corrections[at]), SPREAD * relative * abs(float(extremes.values[at])))


def _shares_differ(net):
    """Tell if the smallest margin of safety and the largest utilisation may be those of different lines."""
    return net.allowed_share is not None and np.ptp(net.allowed_share[np.isfinite(net.strength)]) > 0.0


def _of_tension(probe):
    """Tell if a probe follows the largest of all tensions, each times a scale, and not a mean."""
    every = probe.kernel is probes.line and list(probe.rows[1:]) == [0, len(probe.data)]
    return every and probe.rows[0] != STRAIN and probe.sign > 0.0 and not probe.average


def _tells_strain(system, scale):
    """Tell if the largest tension times a scale is always that of the element with the largest strain."""
    net, lines = system.net, [term for term in system.terms if term.over_lines]
    if len(net.laws) > 1 or len(scale) != len(net.cells) or len(lines) > 1:  # tension of damping tells of no strain
        return False
    columns = (net.line_data[name] for name in ("slackness", "smoothing", "g0", "r0", *net.law.columns))
    return all(_equal(values) for values in (scale * net.line_data.ea, *columns))


def _equal(values):
    """Tell if all values are equal within rounding."""
    low, high = values.min(), values.max()
    return bool(low == high or high - low <= 1e-12 * abs(values[0]))


AT_REST, REST_SHARE = 1e-6, 0.01
"""Share of the largest kinetic energy at which a scene is at rest, and how long it is to stay so, over the duration."""


def _event_of(event, system, duration):
    """(probe, event) of an event of a scene, the probe None where it is an observable's; its slot is not known yet."""
    if event.kind == "contact":
        from ..results.observables.overlap import probe_of_touch

        named = {body.name: body for body in system.net.bodies}
        touch = probe_of_touch(system, named.get(event.body), named.get(event.with_))
        return touch, Event(-1, 0.0, True, event.stop, at_once=True)
    if event.kind == "taut" and event.thread is not None:
        (thread,) = (thread for thread in system.net.threads if thread.name == event.thread)
        probe = Observe(name="_", quantity="strain", thread=event.thread).probe(system)
        return probe, Event(-1, float(thread.line.slackness[0]), True, event.stop)
    if event.kind == "taut":
        probe = Observe(name="_", quantity="strain", line=event.line).probe(system)
        return probe, Event(-1, float(system.net.slackness[probe.rows[1]]), True, event.stop)
    if event.kind == "rest":
        during = REST_SHARE * duration if event.during is None else event.during
        return None, Event(-1, AT_REST if event.share is None else event.share, stop=event.stop, during=during)
    return None, Event(-1, event.value, False, event.stop)


class Watch:
    """Monitors of a scene, and the results that follow from them.

    Parameters
    ----------
    scene : refweb.Scene
        Scene with observables and events.
    system : refweb.system.system.System
        The system.

    Attributes
    ----------
    observables : list
        Observables of the scene.
    probes : list of refweb.results.probes.Probe
        Probes of observables, of warnings and of events, in this order.
    sums : list of refweb.dynamics.integrators.integrator.Sum
        Sums of observables that are followed in every step.
    events : list of refweb.dynamics.integrators.events.Event
        Events in the order of the scene; the last is the break of a line, if lines break by stress.
    columns : list of str
        Names of the columns of ``history.csv``, with units.
    """

    def __init__(self, scene, system):
        self.system, self.observables = system, scene.observables
        self._probed = [o for o in self.observables if not o.observable.booked]
        awaited = {event.observe for event in scene.event}
        booked = [o for o in self.observables if o.observable.booked]
        self._followed = [o for o in booked if o.reduce != "final" or o.name in awaited]
        self.probes = [o.probe(system) for o in self._probed]
        self._warned = _probes_of_warnings(system, self.probes, scene.solve.step_size)
        self.probes += self._warned.values()
        self.sums = [Sum(o.observable.weights(system), SIGN[o.reduce]) for o in self._followed]
        self.events = self._add_events(scene.event, scene.solve.duration)
        used = self._of_warning("utilisation" if self._of_warning("break") is None else "break")
        if system.weakness is not None and used is not None:
            self.events.append(Event(used, 1.0, True, stop=True))
        energies, of_momentum = dynamic_energies(system), vectors(system)
        self.columns = [FIRST["dynamic"], *(f"{o.name} [{o.unit}]" for o in self.observables)]
        self.columns += [f"{name} [J]" for name in energies]
        self.columns += [f"{name} [N s]" for name in components(of_momentum)]
        self._vectors = len(of_momentum)
        self._weights = self._weights_of_columns(energies)
        balance = {"total_energy [J]": 1.0, "dissipated_energy [J]": 1.0, "work [J]": -1.0}
        self._booked = [i for i, column in enumerate(self.columns) if column in balance]
        self._signs = np.array([balance[self.columns[i]] for i in self._booked])

    def _add_events(self, events, duration):
        """The scene's events as `Event`; probes of those that no observable tells come behind the others."""
        slots = {o.name: i for i, o in enumerate(self._probed)}
        made = [_event_of(event, self.system, duration) for event in events]
        for event, (probe, _) in zip(events, made, strict=True):
            if probe is not None:
                slots[event] = len(self.probes)
                self.probes.append(probe)
        slots |= {o.name: len(self.probes) + i for i, o in enumerate(self._followed)}
        if any(event.kind == "rest" for event in events):
            slots[None] = len(self.probes) + len(self.sums)
            self.sums.append(Sum(weights(self.system, "kinetic_energy")))
        return [
            event_row._replace(slot=slots[event.observe if probe is None else event])
            for event, (probe, event_row) in zip(events, made, strict=True)
        ]

    def _weights_of_columns(self, energies):
        """Weights of the columns of a `History` in each column of ``history.csv``, shape (columns there, columns)."""
        unit = History.empty(0, len(self.probes), self.system.terms)
        unit = History(unit.names, np.eye(len(unit.names)), unit.probed)
        columns = [unit.time]
        for o in self.observables:
            if o in self._probed:
                columns.append(unit.probes[:, self._probed.index(o)])
            else:
                columns.append(unit.sums @ o.observable.weights(self.system))
        columns += [unit.sums @ weights(self.system, name) for name in energies]
        vectors = unit.momentum, unit.impulse, unit.outer_impulse
        return np.column_stack([*columns, *vectors[: self._vectors]])

    def table(self, history):
        """Rows of a `History` as rows of ``history.csv``, shape (rows, columns).

        Each row is summed in the same order for any number of rows, unlike in a product of matrices.
        """
        return (history.values[:, :, None] * self._weights).sum(axis=1)

    def compared(self, table):
        """Columns of ``history.csv`` by which a run and its step refinement are compared.

        These are time, observables in their order, and energy less work [J]. The latter is constant, so that its error
        is known in each run.
        """
        observed = table[:, : 1 + len(self.observables)]
        return np.column_stack([observed, (table[:, self._booked] * self._signs).sum(axis=1)])

    def results(self, course, last):
        """Results by name, without errors; ``last`` is the last row of ``history.csv``."""
        results, extremes, unfilled = {}, course.extremes, self.unfilled(course)
        neglected = self._neglected(course)
        state = self.state(course)
        for i, o in enumerate(self.observables):
            value, when, where = float(last[1 + i]), course.time, None
            slot = self._slot(o)
            if slot is not None and o.reduce != "final":
                if o.name not in unfilled:
                    value, when = float(extremes.values[slot]), float(extremes.times[slot])
            if o in self._probed and o.average is None:
                final = o.reduce == "final"
                where = (
                    o.value(state).where if final else o.observable.position(self.system, int(extremes.places[slot]))
                )
            at = None if where is None else o.observable.at
            left_out = None if neglected is None else abs(value) * neglected
            results[o.name] = Result(value, None, o.unit, when, where, neglected=left_out, at=at)
        return results

    def progress(self, course, tables):
        """The largest or smallest value so far of the first result that is one, in words, a list of one text.

        Without such a result it is the value of the first one in the last row of ``tables``.
        """
        for o in self.observables:
            slot = self._slot(o)
            if slot is not None and o.reduce != "final" and np.isfinite(value := course.extremes.values[slot]):
                return [f"{'largest' if o.reduce == 'max' else 'smallest'} {o.name} {readable(value, None, o.unit)}"]
        first = self.observables[0]
        return [f"{first.name} {readable(tables[-1][-1, 1], None, first.unit)}"] if tables else []

    def state(self, course):
        """The `refweb.results.state.State` of a course."""
        system, breaks = self.system, course.breaks
        if breaks is not None and len(breaks.elements):
            from ..system.broken_lines import torn

            system = torn(system, breaks.elements, breaks.energies)
        return State(system, course.time, course.x, course.v)

    def breaks(self, course):
        """The breaks of a course, for ``run.json``."""
        net, broken = self.system.net, course.breaks
        return [
            {
                "line": int(net.line[element]),
                "element": int(element),
                "time": float(time),
                "error": None,
                "place": position.tolist(),
                "energy": float(energy),
            }
            for element, time, energy, position, _ in zip(*broken, strict=True)
        ]

    def _neglected(self, course):
        """Largest distance from the origin of an orbit over its radius [1], None without one."""
        at = self._of_warning("distance")
        return None if at is None else float(course.extremes.values[at]) / self.system.orbit_radius

    def unfilled(self, course):
        """Names of observables without a largest or smallest mean, since the run ended before a window was full."""
        values = course.extremes.values
        extreme = [o for o in self._probed if o.average is not None and o.reduce != "final"]
        return [o.name for o in extreme if np.isinf(values[self._slot(o)])]

    def corrections(self, course, relative=0.0, absolute=None):
        """Lower limits of ± of results, by name of the observable.

        They are the differences of extremes from the values at steps, and the errors of the integrals of means. A
        method with a ``relative`` tolerance finds an extreme at an instant no better than that. A method with
        ``absolute`` tolerances, by unit, finds displacements and velocities no better than these, such as the small
        motions of a web at rest. A closer agreement of run and step refinement is chance. Work and
        lost energy, integrals along the steps, are known no better than to the error of the energy balance: run and
        step refinement may take the same steps.
        """
        absolute = absolute or {}
        limits = {o.name: SPREAD * absolute.get(o.unit, 0.0) for o in self.observables}
        for o in self.observables:
            if o.reduce != "final":
                limits[o.name] = max(limits[o.name], _correction(course.extremes, self._slot(o), relative))
            elif o.average is not None:
                limits[o.name] = max(limits[o.name], float(course.extremes.corrections[self._slot(o)]))
            if o.observable.booked and (o.observable.weights(self.system) @ self._integrated):
                limits[o.name] = max(limits[o.name], course.worst)
        return limits

    @cached_property
    def _integrated(self):
        """1 for each energy that is integrated along the steps, in the order of `weights`."""
        system, changing = self.system, bool(self.system.net.factors)
        path = [
            term.balance.power is not None and not term.dead or changing and term.balance.column == "plastic_energy"
            for term in system.terms
        ]
        work = system.works or any(np.array(path) & (system.working > 0))
        return np.array([*path, False, work, False], dtype=float)

    def drifts(self, course, twin, time):
        """Difference of positions of bodies, by observable, from different velocities in a run and its refinement.

        It is the difference of velocities times half of ``time`` [s]. Only positions of bodies count: nodes vibrate,
        and differences of their velocities change sign in less time.
        """
        rows = {body.name: body.row for body in self.system.net.bodies}
        placed = {o.name: o for o in self.observables if o.body is not None and o.unit == "m"}
        distances = {}
        for name, o in placed.items():
            named = (o.body,) if isinstance(o.body, str) else o.body
            apart = (course.v - twin.v)[[rows[body] for body in named]]
            along = np.linalg.norm(apart, axis=1) if o.component is None else np.abs(apart[:, o.component])
            distances[name] = 0.5 * time * float(along.max())
        return distances

    def _slot(self, observable):
        """Number of the probe or, after all probes, of the sum of an observable; None if it is not followed."""
        if observable in self._probed:
            return self._probed.index(observable)
        return len(self.probes) + self._followed.index(observable) if observable in self._followed else None

    def largest_stress(self, course):
        """Largest stress of all steps [Pa], None if no warning needs it."""
        at = self._of_warning("stress")
        return None if at is None else float(course.extremes.values[at])

    def utilisation(self, course):
        """The `Utilisation` of all steps, without its error; None where no line has a strength."""
        at = self._of_warning("utilisation")
        if at is None:
            return None
        return Utilisation(float(course.extremes.values[at]), int(self.system.net.line[course.extremes.places[at]]))

    def margin(self, course):
        """Smallest margin of safety of all steps, see `margin_of`; None where no line has a strength."""
        net, extremes, at = self.system.net, course.extremes, self._of_warning("margin")
        share = None if at is not None else net.allowed_share
        if at is None and (at := self._of_warning("utilisation")) is None:
            return None
        element, used = int(extremes.places[at]), float(extremes.values[at])
        return margin_of(net, element, used if share is None else used / float(share[element]), extremes.times[at])

    @property
    def _shares(self):
        """Names of the followed ratios of stress over its limits, with the numbers of the probes."""
        return {name: at for name in ("utilisation", "margin") if (at := self._of_warning(name)) is not None}

    def shares(self, course):
        """Largest stress over strength and, if its line may differ, over the allowed stress: results by name.

        They have no errors. The dict is empty if no line has a strength.
        """
        values, times, places = course.extremes.values, course.extremes.times, course.extremes.places
        lines = self.system.net.line
        return {
            name: Result(float(values[at]), None, "1", float(times[at]), int(lines[places[at]]), at="line")
            for name, at in self._shares.items()
        }

    def shares_of(self, history):
        """Stress over its limits in the rows of a `History`, in the order of `shares`, shape (rows, shares).

        Where damped lines may snap taut, two more columns have the energy of terms and motion, and what snaps have left
        in doubt of it so far [J].
        """
        shares, at = history.probes[:, list(self._shares.values())], self._of_warning("snaps")
        if at is None:
            return shares
        kept = np.append(self.system.working == 0, True)
        return np.column_stack([shares, history.energies[:, kept].sum(axis=1), history.probes[:, at]])

    def share_corrections(self, course, relative=0.0):
        """Lower limits of ± of `shares`, by name, see `corrections`."""
        return {name: _correction(course.extremes, at, relative) for name, at in self._shares.items()}

    def strain(self, course):
        """Largest strain of all steps [1] and its line."""
        net, values, places = self.system.net, course.extremes.values, course.extremes.places
        if (at := self._of_warning("strain")) is not None:
            return float(values[at]), int(net.line[places[at]])
        follows = (_of_tension(p) and _tells_strain(self.system, p.data[:, 0]) for p in self.probes)
        at = next(i for i, yes in enumerate(follows) if yes)
        cell = int(places[at])
        tension, line = values[[at]] / self.probes[at].data[cell, 0], net.line_data[[cell]]
        return float(net.law.strain_of(tension, line)[0]) if tension > 0.0 else 0.0, int(net.line[cell])

    def share_of_curve(self, course):
        """Largest strain over the last one of a curve in all steps [1], and its element; None without a curve."""
        if (at := self._of_warning("curve")) is None:
            return None
        return float(course.extremes.values[at]), int(course.extremes.places[at])

    def strains_of_threads(self, course):
        """Pairs of a thread and its largest strain in all steps [1], a list."""
        values = course.extremes.values
        return [(t, float(values[self._of_warning(t.title)])) for t in self.system.threads.values()]

    def half_turns(self, course, drifts=False):
        """Text on the end of a thread that goes about half a turn round a cylinder, or "", see `half_turn_remark`."""
        if (at := self._of_warning("half turns")) is None:
            return ""
        from .half_turns import half_turn_remark

        turns, number, time = (getattr(course.extremes, name)[at] for name in ("values", "places", "times"))
        return half_turn_remark(self.system.net, float(turns), int(number), float(time), drifts)

    def overlap_of_lines(self, course):
        """(Deepest overlap of lines in all steps [m], its time [s], its cell), None where lines do not touch lines."""
        if (at := self._of_warning("lines")) is None:
            return None
        extremes = course.extremes
        return float(extremes.values[at]), float(extremes.times[at]), int(extremes.places[at])

    def note_overlaps(self, course, overlaps):
        """Record the deepest contact of each body in `refweb.effects.contact.overlap.Overlaps`."""
        extremes = course.extremes
        for i, body in enumerate(self.system.net.bodies):
            at = self._of_warning(("overlap", body.name))
            value, index = float(extremes.values[at]), int(extremes.places[at])
            if value > 0.0:
                overlaps.record(i, value, float(extremes.times[at]), int(self.system.net.line[index]))

        if overlaps.pairs is not None:
            for i in range(len(overlaps.pairs.deepest)):
                at = self._of_warning(("between", i))
                overlaps.pairs.record(i, float(extremes.values[at]), float(extremes.times[at]))

    def note_way(self, course, pairs, integrator):
        """Record crossings, or bounds of the approach in a step, in ``pairs``, a `PairOverlaps`."""
        if integrator.knob != "safety":
            pairs.note_met(course.crossings[PAIRS])
        elif integrator.step_size is None:
            pairs.note_way(safety=integrator.safety * integrator.stretch)
        else:
            speed = float(course.extremes.values[self._of_warning("body speed")])
            pairs.note_way(step=integrator.step_size, speed=speed)

    def _of_warning(self, name):
        """Number of the probe of a warning, None if there is none."""
        return len(self._probed) + list(self._warned).index(name) if name in self._warned else None
