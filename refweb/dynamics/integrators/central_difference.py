"""Explicit dynamics: central differences as kick, drift, kick, in one compiled loop.

    v ← v + ½h f/m,   x ← x + h v,   f ← f(t + h, x),   v ← v + ½h f/m

The loop calls the kernels of all effects through tables, and it finds peaks at and between steps; Python gets history
rows only. The critical time step is 2/√(max row sum of M⁻¹K), by Gershgorin's bound on the largest frequency. K has the
taut stiffness of all lines, and the contact stiffness of the lines that a body can reach within the row.

With smaller steps a slack chain in contact can still gain energy by many orders, and look plausible afterwards.
Therefore the energy balance is checked at every row: the run ends if ``|ΔE − work|`` is above `DRIFT` of the largest
energy.

May change: words of messages and private methods for them (``_name_…``, `_way_out`, `_remedy`). Must stay: public
names, those of `integrator.Integrator`; class attributes ``kicks``, ``drifts``, ``stretch`` and `_keys`, which
`splitting` sets. `Scheme` and `Running` get fields by position, so that `records` and this file change together;
`SHARED` is the first part of `CLOCK`. `budget.steps_with_twin` repeats `TWIN_STEPS` as √2. A run that goes on from a
checkpoint has the bits of one that does not. Must stay as well: `CentralDifference`, which `splitting` imports. Tests:
``tests/dynamics/test_dynamics.py``.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from ...compiled.kernel import prepare
from ...effects.base import SNAPPED
from ...errors import EnergyDriftError, InputError, IntegrationError, SolverError
from ...kernels import CONTACT, CONTACTS, PART, PARTS, Arrays
from .ccd import reset_checks
from .crossings import THROUGH
from .dense_output import LOOKS
from .energy_balance import DRIFT, least_energy, own_energies, refuse_open
from .events import event_rows
from .explicit_loop import BREATH, HELD, advance_rows, begin, run_steps
from .explicit_state import ExplicitState
from .extremes import Extremes
from .features import features
from .integrator import MAX_STEPS_PER_ROW, History, Integrator, Variant
from .momentum_balance import CLOSURE, MomentumBalance, open_balance, refuse_open_momentum
from .monitors import Observed, begin_monitors
from .neighbour_list import forget, look_at_all
from .records import CLOCK, Model, Running, Scheme
from .step_bound import SPAN, safe_step
from .workspace import Workspace

TWIN_STEPS = math.sqrt(2.0)
"""Ratio of the steps of a run and of its step-refinement run: with a method of order 2 that of their errors is 2."""
FEWER, STABLE, FEWEST, SHORT = 1.5, 0.8, 8, 0.1
"""Steps of a run over those of a coarser step-refinement run; largest step of that over the bound of stability; least
number of steps of the run in a span, and largest share of the time that spans of fewer steps may have."""
SHARED = tuple(CLOCK.names or ())[: (CLOCK.names or ()).index("least_energy")]
"""Numbers that a course and the loop's clock have in common."""


class CentralDifference(Integrator):
    """Central differences on one system.

    Parameters
    ----------
    system : refweb.system.system.System
        Of order 1, with lumped mass.
    probes : sequence of refweb.results.probes.Probe
        Probes to evaluate in every row and, with a sign, in every step.
    sums : sequence of refweb.dynamics.integrators.integrator.Sum
        Sums of energies to evaluate in every row and, with a sign, in every step.
    events : sequence of refweb.dynamics.integrators.events.Event
        Events whose time is found to the size of a step.
    safety : float
        Share of the step bound, 0 < safety ≤ 1.
    step_size : float, optional
        A fixed step instead [s], at most the bound.
    finer : float
        Factor on the number of steps in each row.

    Attributes
    ----------
    model : refweb.dynamics.integrators.records.Model
        The system as the compiled loop sees it.
    breath : int, optional
        Number of steps after which the loop returns for ``on_progress``; by default some tenths of a second.

    Raises
    ------
    InputError
        For curved elements, a consistent mass, links, a free row without mass, or a step above the bound.
    """

    method, order, stretch = "central-difference", 2, 1.0
    knob, retry, beside, follows_lines = "safety", 0.5, True, True
    on_progress, breath = staticmethod(lambda t: None), None
    variants = {"central-difference": Variant(kind="splitting")}
    kicks, drifts = np.array([0.5, 0.5]), np.array([1.0])

    def __init__(self, system, probes=(), sums=(), events=(), safety=0.5, step_size=None, finer=1.0):
        self.system, self.safety, self.step_size, self.finer = system, safety, step_size, finer
        self.observed = tuple(probes), tuple(sums), tuple(events)
        net, free = system.net, ~system.supported
        free[system.rows - net.internal :] = False
        if net.order > 1:
            raise InputError(
                f"[cable] order = {net.order} must be 1 with {self.method}: its bound of stability is that of straight "
                f"elements; use subdivide = {net.order * net.subdivide}, which has the "
                'same nodes, or method = "cvode"'
            )
        if net.consistent_minus_lumped is not None:
            raise InputError(
                f'[solve] mass = "consistent" must be "lumped" with {self.method}: an explicit step divides each '
                'force by one mass, and a matrix would have to be solved; use method = "cvode"'
            )
        if system.constraints:
            raise InputError(f'[[link]] needs method = "ida": {self.method} does not hold lengths')
        bare = np.flatnonzero((net.mass <= 0.0) & free.any(axis=1))
        if len(bare):
            raise InputError(
                f"node {bare[0]} has no mass, which {self.method} needs: give density > 0 or a [[point_mass]]"
            )
        self._outs = outs = tuple(system.per_cell())
        first = finer == 1.0  # passages of the first run are what a solution tells
        self.model, jump = Model.of(system, outs, first), any(term.velocity.jumps for term in system.terms)
        self._snapped = outs[0][:, SNAPPED] if jump else np.zeros(0)
        self._observed = Observed.of(probes, sums, len(outs), outs, self.model.contacts)
        self._contacts = Arrays(CONTACTS, [np.empty(0, dtype=CONTACT)]), Arrays(PARTS, [np.empty(0, dtype=PART)])
        self._events, self._least_energy = event_rows(events), least_energy(system, self.model.inertia.turns)
        self._taken, self._prepared = None, False
        self._kept: Any = ()
        self._history = History.empty(0, len(probes), system.terms)
        if step_size is not None and step_size > (limit := self.stretch * self.bound()):
            raise InputError(f"[solve] step_size = {step_size:g} must be ≤ {limit:.6g} [s], the bound of stability")

    def prepare(self):
        """Compile what the run calls, see `refweb.dynamics.integrators.integrator.Integrator`."""
        if not self._prepared:
            model, observed = self.model, self._observed
            called = [advance_rows, begin, open_balance, safe_step, reset_checks]
            called += [*model.all_kernels(), *observed.all_kernels()]
            prepare(called, features(self._scheme, model, observed, self._events))
            self._prepared = True

    def bound(self, x=None, reach=np.inf):
        """Largest stable step [s] at displacement x, with what bodies can touch within ``reach`` [m], at any time."""
        model = self.model if self._prepared else self._bounded
        rest = np.zeros((self.system.rows, 3))
        x = rest if x is None else x
        return safe_step.call(0.0, np.inf, len(model.lengths.elements) > 0, float(reach), 0.0, x, rest, model)

    @cached_property
    def _bounded(self):
        """The model; with the kernels of bounds alone if others are not loaded, for a scene that does not run."""
        model, terms = self.model, self.model.terms
        if not all(item.loaded for item in model.all_kernels()):
            bare = model.without_kernels()
            model = replace(bare, terms=replace(bare.terms, bounds=terms.bounds, dampings=terms.dampings))
        prepare([safe_step, *model.all_kernels()], features(self._scheme, self.model, self._observed, self._events))
        return model

    def steps_in(self, spans):
        """Number of steps in each of some spans of time [s] that a row or a corner ends, by the bound of the start."""
        step = self.step_size or self.safety * self.stretch * self.bound()
        return np.ceil(
            self.finer * np.ceil(np.maximum(np.asarray(spans) / step, self._scheme.least_steps) * (1.0 - 1e-9))
        )

    def evaluations(self, duration):
        """Evaluations of forces that a duration [s] takes, by the bound of its start and by corners of tables."""
        step = self.step_size or self.safety * self.stretch * self.bound()
        corners = np.searchsorted(self.system.corners, duration)
        return len(self.drifts) * self.finer * max(duration / step, float(corners))

    def spent(self, course):
        """Statistics of a course, for ``run.json``.

        Only evaluations of forces that depend on displacement count: other forces are evaluated more often in a step.
        The evaluations inside of the first step do not count.
        """
        looks = self._observed.followed, self._observed.sums, self._observed.windows.slots
        follows = any(len(rows) for rows in looks)  # and evaluates forces where it looks
        per_step = len(self.drifts) + (LOOKS - 1 if follows and len(self.drifts) > 1 else 0)
        return dict(nfev=per_step * course.nsteps + 1, njev=0, nlu=0)

    def start(self, x=None, v=None):
        """The `ExplicitState` at t = 0, see `refweb.dynamics.integrators.integrator.Integrator.start`."""
        self.prepare()
        system, self._taken, self._snapped[...] = self.system, None, 0.0
        force = np.zeros((system.rows, 3))
        x = np.zeros_like(force) if x is None else np.array(x, dtype=float, order="C")
        v = system.initial_velocity() if v is None else np.array(v, dtype=float, order="C")
        v[system.supported] = 0.0
        system.drive(0.0, x, v)
        x = system.taken_on(0.0, x)
        if system.net.flows:
            v = system.material_flow.velocity_behind(0.0, x, v)
        extremes = Extremes.at_start(np.zeros(len(self._observed.signs)))
        work, total = np.zeros(len(system.terms) + 1), np.zeros(len(system.terms) + 3)
        where = np.zeros(2, dtype=np.int64)
        begin.call(x, v, force, where, self.model, self._observed, extremes, work, total)
        monitors = begin_monitors(self._observed, extremes, total, self._events)
        energy, stored = own_energies(total, system)
        ledger = MomentumBalance.empty()
        mass = self.model.inertia.mass[:, None]
        open_balance.call(x, mass * np.where(system.supported, 0.0, v), self.model.outside, ledger)
        return ExplicitState(
            time=0.0,
            x=x,
            v=v,
            work=work,
            ledger=ledger,
            energy=energy,
            largest=max(stored, self._least_energy),
            force=force,
            power=np.zeros(len(system.terms)),
            **monitors,
        )

    def save(self, course: ExplicitState):
        """The `ExplicitState` as arrays by name, for a checkpoint."""
        course.snapped = self._snapped.copy()
        return course.arrays()

    def load(self, arrays):
        """The `ExplicitState` of a checkpoint; terms show what they do there."""
        self.prepare()
        course, self._taken = ExplicitState.of_arrays(arrays), None
        self.system.forces(course.time, course.x, course.v, self._outs)
        self._snapped[...] = course.snapped if course.snapped.size else 0.0
        return course

    def renew(self, course: ExplicitState, change):
        """Go on with forces that have changed, see `refweb.dynamics.integrators.integrator.Integrator.renew`."""
        course.force += change

    @property
    def step(self) -> float:
        """Size of the last step of the course that it advances [s]."""
        return self._kept[1].clock[0]["step"].item()

    @property
    def _keys(self) -> dict:
        return dict(safety=self.safety, step_size=self.step_size)

    def refined(self, by=None):
        """The method with ``by`` times the steps, by default `TWIN_STEPS`."""
        finer = self.finer * (TWIN_STEPS if by is None else by)
        return type(self)(self.system, *self.observed, **self._keys, finer=finer)

    def coarser_by(self, spans):
        """Factor 1/`FEWER` on the steps where many lines may touch lines, see `integrator.Integrator`.

        None elsewhere, and if these steps were above `STABLE` of the bound, or if spans of fewer than `FEWEST` steps
        take more than `SHORT` of the time: of 2 steps 1/`FEWER` are 2 again.

        Lines in contact move chaotically. Two runs are soon two samples of one motion, and a coarser run is as good a
        sample as a finer one, for half of the steps. Of 210 results of 42 nets that are thrown into folds none is off
        by more than ± by a coarser run, and 3 by a finer one, with a ± half as wide in the median. Elsewhere a finer
        run says more: of 8364 results of 697 random impacts 40 are off by more than ± by a run of 1/√2 of the steps
        whose difference counts once, and 19 by a finer run, whose difference counts twice. With a factor of 1.25 more
        it is 21, ± is wider by a third in the median, and five times as wide for the mean stress of a web that a ball
        hits.
        """
        if not len(self.model.nearby.at):
            return None
        spans, safety = np.asarray(spans), self.safety
        if self.step_size:
            safety = self.step_size / (self.stretch * self.bound())
        short = spans[self.steps_in(spans) < FEWEST].sum()
        return 1.0 / FEWER if FEWER * safety <= STABLE and short <= SHORT * spans.sum() else None

    def error_share(self, course, compared):
        """Error of the finer of two runs over that of the other, see `refweb.dynamics.integrators.integrator`.

        It follows from the actual numbers of steps, with order 2: peaks, contact and slack lines reduce higher orders.
        The error of a run is its difference from a coarser one, not twice that, where motion is regular; as two samples
        of a chaotic motion differ, whichever has more steps, the larger factor counts in both cases.
        """
        if not compared.nsteps:
            return 0.5
        ratio = (course.nsteps / course.time / (compared.nsteps / compared.time)) ** 2
        return min(ratio, 1.0 / ratio)

    def next_knob(self, share):
        """Factor on the safety for errors that are ``share`` times what they may be."""
        return min(max(0.8 * share ** (-1.0 / self.order), 0.125), 0.5)

    @cached_property
    def _scheme(self):
        least_steps, step = 1.0 if self.step_size else 0.5 / self.safety, self.step_size or 0.0
        numbers = (self.safety * self.stretch, least_steps, step, self.finer, 0.0)
        return Scheme(self.kicks, self.drifts, *map(float, numbers))

    @cached_property
    def _planned(self):
        """The scheme of a run: where lines touch lines, steps are planned for spans that may be shorter than rows."""
        if self.step_size or not len(self.model.nearby.at):
            return self._scheme
        return replace(self._scheme, span=SPAN * self.safety * self.stretch * self.bound(reach=0.0))

    def _records(self, course):
        """(`Running`, `Workspace`) of a course; those of the last one where it has the same arrays."""
        state = (course.x, course.v, course.force, course.before, course.work, course.impulse, course.ledger)
        written = *state, course.extremes, course.events, course.averages, course.power, course.crossings
        if not self._kept or any(array is not known for array, known in zip(written, self._kept[0], strict=True)):
            lengths = np.zeros((2, len(self.model.lengths.elements)))
            carried = course.power, lengths, course.crossings, *self._contacts
            running = Running(np.zeros(1, dtype=CLOCK), *written[:-2], *carried)
            self._kept = written, running, Workspace.of(self.model, running)
        _, running, workspace = self._kept
        clock = running.clock
        known = *(getattr(course, name) for name in SHARED), self._least_energy
        clock[0] = *known, *(0,) * (len(clock.dtype) - len(known))
        running.length_force[...] = 0.0
        return running, workspace

    def advance(self, course: ExplicitState, times):
        """Take a course to each of some times; equal steps lead to each.

        See `refweb.dynamics.integrators.integrator.Integrator.advance`; a `SolverError` for a number that is not finite
        names node, line and time.
        """
        times = np.atleast_1d(np.asarray(times, dtype=float))
        history = self._history.like(len(times))
        work = len(self.drifts) * sum(len(term.cells) for term in self.system.terms)
        done, breath = 0, self.breath or max(BREATH // max(work, 1), 1)
        running, workspace = self._records(course)
        records = self._planned, self.model, self._observed, running, workspace
        clock = running.clock
        if len(self.model.ccd.checks):
            reset_checks.call(self.model.ccd)
        if self._taken != (id(course), course.nsteps):
            forget(self.model, course.nsteps > 0)
        try:
            while True:
                more = advance_rows.call(times[done:], breath, DRIFT, *records, history.values[done:])
                now = clock[0]
                if more == HELD:
                    self._refuse_passing(course, now)
                if more < 0:
                    raise IntegrationError(
                        f"the step at t = {now['time']:.6g} s is {now['step']:.3g} s, more than {MAX_STEPS_PER_ROW:g} "
                        f"steps to the next row: {self._way_out(course.x, float(now['step']))}"
                    )
                done += more
                if not now["begun"]:
                    break
                self.on_progress(now["time"] + now["begun"] * now["step"])
        except BaseException:
            if clock["begun"]:  # back to the last row or corner
                course.x[:], course.v[:], course.force[:] = course.before
            raise
        finally:
            look_at_all(self.system, self.model)
            self._taken = id(course), int(clock[0]["nsteps"])
            nearby = self.model.nearby
            followed = len(nearby.terms) and len(self.drifts) == 1 and not self.system.carried.any()
            course.longest = max(course.longest, float(nearby.skin[0]["longest"]) if followed else math.inf)
            nearby.skin["longest"] = 0.0
            for name, value in zip(SHARED, clock[0].item(), strict=False):
                setattr(course, name, value)
        if done and course.stopped and history.time[done - 1] == course.time:
            return history[:done]
        if done < len(times):
            since = float(clock[0]["since"])
            if not np.isfinite(history.values[done]).all():
                self._name_blow_up(course, since, running)
            self._name_drift(course, since, running)
        return history

    def _way_out(self, x, step):
        """Remedy for too short a step [s]; velocities are its cause if the step at rest would be over twice as long."""
        if self.bound(x) * self.safety * self.stretch > 2.0 * step:
            reason = "nothing may pass through a body in one, at the speeds there are"
            return f"{reason}; use a thicker body, slower ones or less damping"
        return "ask for shorter rows, or lower the stiffness, damping or friction that asks for the step"

    def _again(self, course, before, running):
        """Function that takes steps from ``before`` [s] again: ``after(state, begun, count)``.

        It returns the state (3, rows, 3) that is ``count`` steps after the state of ``begun`` steps.
        """
        running.clock["time"] = before
        model = replace(self.model, nearby=self.model.nearby.without())  # its lists hold for steps in a row

        def after(state, begun, count):
            state, running.clock["begun"] = state.copy(), begun
            copy = replace(running, x=state[0], v=state[1], f=state[2], events=course.events[:0])
            changing, workspace = self.model.lengths.elements.size > 0, Workspace.of(model, copy)
            run_steps.call(count, float(course.step), changing, self._scheme, model, self._observed, copy, workspace)
            return state

        return after

    def _name_blow_up(self, course, before, running):
        """Take the steps from ``before`` [s] again and name the first number that is not finite."""
        net, planned, after = self.system.net, int(running.clock[0]["planned"]), self._again(course, before, running)
        sound, done, ahead = course.before.copy(), 0, planned
        if np.isfinite(after(sound, 0, planned)).all():
            raise IntegrationError(f"energy not finite at t = {course.time:.6g} s: use a smaller safety")
        while ahead > 1:  # what is not finite stays so: the first step that leads there is between done and ahead of it
            half = ahead // 2
            state = after(sound, done, half)
            if np.isfinite(state).all():
                sound, done, ahead = state, done + half, ahead - half
            else:
                ahead = half
        wrong = ~np.isfinite(after(sound, done, 1)).all(axis=(0, 2))
        row = int(wrong.argmax())
        name = self.system.row_name(row)
        lines = net.line[(net.cells == row).any(axis=1)]
        name += f", line {lines[0]}," if len(lines) else ""
        t = before + (done + 1) * course.step
        raise IntegrationError(f"number not finite at {name} t = {t:.6g} s: use a smaller safety")

    def _refuse_passing(self, course, now):
        """Refuse lines that would pass through lines or bodies in any step that is not far below the critical one."""
        met = self.model.ccd.met
        if met[4] == THROUGH:
            from ...effects.contact.penetration import would_pass

            reason = would_pass(self.system, met)
        else:
            from ...effects.self_contact.penetration import would_pass

            reason = would_pass(self.system, course.v, met[:4])
        at = now["time"] + now["begun"] * now["step"]
        raise SolverError(
            f"at t = {at:.6g} s, in a step of {now['cut']:.3g} s where {now['stable']:.3g} is stable, {reason}"
        )

    def _name_drift(self, course, before, running):
        """Name the source of an energy drift, by the steps from ``before`` [s] on."""
        from .drift_source import described_source, suspects

        system, after, state = self.system, self._again(course, before, running), course.before.copy()
        places = [(before, state[0])]
        for n in range(round((course.time - before) / course.step) if course.step > 0.0 else 0):
            state = after(state, n, 1)
            places.append((before + (n + 1) * course.step, state[0]))
        source = described_source(system, places, course.drift * course.largest)
        raise EnergyDriftError(
            f"energy drift {course.drift:.3g} of the largest energy between t = {before:.6g} and {course.time:.6g} s, "
            f"limit {DRIFT:g}: {source}; {self._remedy}"
            f"{suspects(system)}",
            course.drift,
        )

    @property
    def _remedy(self):
        step = self.step_size
        return f"use a smaller step_size than {step:g}" if step else f"use a smaller safety than {self.safety:g}"

    def refuse_drift(self, course):
        """Refuse a whole run whose energy drift exceeds `DRIFT`, or that of momentum `CLOSURE`; `EnergyDriftError`."""
        refuse_open(course, DRIFT, self._remedy)
        refuse_open_momentum(course, CLOSURE, self._remedy)
