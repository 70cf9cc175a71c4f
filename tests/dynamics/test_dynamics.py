"""Explicit dynamics: order, what is conserved, the book of work, observables, rows and files, refusals."""

import copy
import csv
import itertools
import json
import re
import threading
from dataclasses import replace
from types import SimpleNamespace
from xml.etree import ElementTree

import meshio
import nets
import numpy as np
import pytest
from scipy.integrate import DOP853

import refweb
from refweb.__main__ import main
from refweb.dynamics import schedule, simulation
from refweb.dynamics.history import Watch
from refweb.dynamics.integrators import central_difference
from refweb.dynamics.integrators.central_difference import CentralDifference, EnergyDriftError
from refweb.dynamics.integrators.integrator import History
from refweb.errors import SolverError
from refweb.results.state import State

MODULUS, AREA, DENSITY = 7e7, 1e-4, 200.0
SOUND = np.sqrt(MODULUS / DENSITY)
ROUND_OFF = 1e-12
"""Of sums over a thousand steps: each rounds to 1e-16, and a thousand of them, all of one sign, make 1e-13."""


def cable(**changes):
    return refweb.Cable(**{**dict(law="tension-only", modulus=MODULUS, area=AREA, density=DENSITY), **changes})


def window(mesh="square", side=0.2, size=4):
    return refweb.Window(mesh=mesh, rows=size, columns=size, side=side)


def taut_system(effects=(), law="tension-only"):
    """A web whose lines are strained by 5 % and stay taut, away from every kink."""
    return nets.system(window().web(), cable(prestrain=0.05, law=law), effects, quasi_static=False)


def free_system(mesh="hexagon", effects=(), **changes):
    """A web without supports."""
    web = window(mesh).web()
    return nets.system(web, cable(**changes), effects, False, np.zeros((len(web.points), 3), dtype=bool))


def bump(system):
    """Velocities of a smooth hit [m/s]."""
    x, y, _ = system.net.points.T / 0.4
    shape = np.where(system.supported[:, 2], 0.0, np.exp(-3.0 * (x**2 + y**2)))
    return shape[:, None] * [2.0, -1.0, 5.0]


def exact(system, v, end):
    """Displacement and velocity at a time, by an explicit method of order 8 at a tolerance of 1e-12."""
    free, mass = system.free, np.repeat(system.net.mass, 3)[system.free]

    def rate(t, y):
        x = np.zeros((system.rows, 3))
        x.ravel()[free] = y[: len(free)]
        return np.concatenate([y[len(free) :], system.force(t, x).ravel()[free] / mass])

    method = DOP853(rate, 0.0, np.concatenate([np.zeros(len(free)), v.ravel()[free]]), end, rtol=1e-12, atol=1e-13)
    while method.status == "running":
        method.step()
    return method.y[: len(free)], method.y[len(free) :]


def slope(errors, steps):
    return np.polyfit(np.log(steps), np.log(errors), 1)[0]


def run_at(system, safety, ends, v=None, **options):
    solver = CentralDifference(system, safety=safety, **options)
    run = solver.start(v=v)
    return run, solver.advance(run, ends)


SAFETIES = (0.2, 0.1, 0.05, 0.025)


@pytest.mark.parametrize("law", ["tension-only", "linear"])
def test_order_two(law):
    """Position and velocity converge with the square of the step; a fit over a factor of 8 in step has it to 2 %."""
    system, end = taut_system(law=law), 0.01
    v = bump(system)
    x_end, v_end = exact(system, v, end)
    errors = []
    for safety in SAFETIES:
        run, _ = run_at(system, safety, [end], v)
        free = system.free
        assert State(system, end, run.x).tension.min() > 0.0
        error = np.abs(run.x.ravel()[free] - x_end).max(), np.abs(run.v.ravel()[free] - v_end).max()
        errors.append([run.nsteps, *error])
    nsteps, position, velocity = np.array(errors).T
    # The next term of the error is (ωh)² ≤ (2 · 0.2)² of this one in the coarsest step and tilts the fit by half of it.
    assert abs(slope(position, 1.0 / nsteps) - 2.0) < 0.1
    assert abs(slope(velocity, 1.0 / nsteps) - 2.0) < 0.1


def test_drift_is_of_second_order():
    system, ends = taut_system(), np.linspace(0.0, 0.02, 201)
    runs = [run_at(system, safety, ends, bump(system))[0] for safety in SAFETIES]
    drift, nsteps = np.array([[run.drift, run.nsteps] for run in runs]).T
    assert drift[-1] < 1e-5 and abs(slope(drift, 1.0 / nsteps) - 2.0) < 0.1


def test_time_reversal():
    """The method is its own inverse: with the velocities turned it goes back to where it started."""
    system, end, h = taut_system(), 0.02, 0.02 / 200
    solver = CentralDifference(system, step_size=h * (1 + 1e-12))
    run = solver.start(v=bump(system))
    solver.advance(run, [end])
    back = solver.start(run.x, -run.v)
    solver.advance(back, [end])
    assert run.nsteps == back.nsteps == 200 and np.abs(run.x).max() > 1e-3
    np.testing.assert_allclose(back.x, 0.0, atol=ROUND_OFF * np.abs(run.x).max())
    np.testing.assert_allclose(back.v, -bump(system), atol=ROUND_OFF * np.abs(bump(system)).max())


@pytest.mark.parametrize("mesh", ["triangle", "square", "hexagon"])
def test_momentum_and_angular_momentum_of_a_free_web(mesh):
    """A web that drifts, spins and is stretched: lines go slack and taut, and neither changes."""
    system = free_system(mesh)
    points, mass = system.net.points, system.net.mass[:, None]
    solver = CentralDifference(system, safety=0.1)
    v = np.cross([1.0, -2.0, 20.0], 1.05 * points) + [0.3, -0.2, 0.5]
    run = solver.start(0.05 * points, v)
    position, lines = points + run.x, np.abs(run.force).max()
    momentum, turning = (mass * v).sum(axis=0), np.cross(position, mass * v).sum(axis=0)
    for end in np.linspace(0.01, 0.1, 10):
        solver.advance(run, [end])
        parts = mass * run.v
        np.testing.assert_allclose(parts.sum(axis=0), momentum, atol=ROUND_OFF * np.abs(mass * v).sum())
        parts = np.cross(points + run.x, parts)
        np.testing.assert_allclose(parts.sum(axis=0), turning, atol=ROUND_OFF * np.abs(parts).sum())
    assert run.nsteps > 500 and lines > 1.0 and State(system, run.time, run.x).slack.any()


def test_free_fall():
    """A web without tension falls by ½gt², exactly as the method integrates a parabola, and keeps its energy."""
    gravity = np.array([0.5, 0.0, -9.81])
    system = free_system("square", [refweb.Gravity(acceleration=gravity)])
    run, rows = run_at(system, 0.5, np.linspace(0.0, 0.1, 11))
    np.testing.assert_allclose(run.x, np.tile(0.5 * gravity * 0.1**2, (system.rows, 1)), rtol=0, atol=1e-12 * 0.05)
    np.testing.assert_allclose(run.v, np.tile(gravity * 0.1, (system.rows, 1)), rtol=0, atol=1e-12)
    kinetic = 0.5 * system.net.mass.sum() * (gravity @ gravity) * 0.1**2
    np.testing.assert_allclose(rows.energies[-1, -1], kinetic, rtol=1e-12)
    np.testing.assert_allclose(rows.energies.sum(axis=1), 0.0, atol=1e-12 * kinetic)
    assert run.drift < 1e-12


def slack_pair(effects):
    """Two nodes of 2 kg on a massless line so slack that it never acts."""
    web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], natural_length=100.0).web()
    effects = [refweb.PointMass(node="all", mass=2.0), *effects]
    return nets.system(web, cable(density=0.0), effects, False, np.zeros((2, 3), dtype=bool))


def test_work_of_a_load():
    """A constant force F has done F²t²/2m, a force growing as t/T F²t⁴/8mT², by trapezia to the square of the step."""
    force, end = np.array([1.0, 2.0, -2.0]), 0.5
    run, _ = run_at(slack_pair([refweb.Load(node=1, force=force)]), 0.5, [0.25, end])
    np.testing.assert_allclose(run.work.sum(), 9.0 * end**2 / 4.0, rtol=1e-12)
    np.testing.assert_allclose(run.x[1], 0.5 * force / 2.0 * end**2, rtol=1e-12)
    system = slack_pair([refweb.Load(node=1, force=force, factor=[(0.0, 0.0), (2.0, 1.0)])])
    errors, counts = [], (20, 40, 80)
    for count in counts:
        run, _ = run_at(system, 0.5, [end], step_size=end / count)
        assert run.nsteps == count
        errors.append(abs(run.work.sum() - 9.0 * end**4 / (8 * 2.0 * 2.0**2)))
    assert abs(slope(errors, 1.0 / np.array(counts)) - 2.0) < 0.02


MOTION = [(0.0, 0.0, 0.0, 0.0), (0.0051, 0.0, 0.0, 0.01), (0.0113, 0.002, 0.0, -0.01)]


@pytest.mark.parametrize(
    "effect",
    [
        refweb.Motion(node=0, displacement=MOTION),
        refweb.Load(node="centre", force=(1.0, 2.0, 30.0), factor=[(0.0, 0.0), (0.0051, 1.0), (0.0113, -1.0)]),
    ],
)
def test_work_closes_the_book_to_second_order(effect):
    """Also where the prescribed velocity jumps in the middle of a step, by which the book errs once by O(h²)."""
    system, ends = taut_system([effect]), np.linspace(0.0, 0.02, 101)
    runs = [run_at(system, safety, ends)[0] for safety in SAFETIES]
    work, drift, nsteps = np.array([[run.work.sum(), run.drift, run.nsteps] for run in runs]).T
    assert abs(work).min() > 1e-3 and drift[0] < 1e-5 and abs(slope(drift, 1.0 / nsteps) - 2.0) < 0.1


def test_prescribed_motion_is_followed():
    system = taut_system([refweb.Motion(node=0, displacement=MOTION)])
    solver = CentralDifference(system)
    run = solver.start()
    table = np.array(MOTION)
    for end in (0.002, 0.0051, 0.008, 0.02):
        solver.advance(run, [end])
        expected = [np.interp(end, table[:, 0], column) for column in table.T[1:]]
        np.testing.assert_allclose(run.x[0], expected, rtol=0, atol=1e-15)
        assert not run.x[system.net.web.rim[1:]].any()
    assert not run.v[0].any()


# Rows and resumed runs


def impact_system(**changes):
    """Gravity, a load, prescribed motion, a ball: all that a run's state has to remember."""
    effects = [
        refweb.Gravity(acceleration=(0.0, 0.0, -9.81)),
        refweb.Load(node="centre", force=(0.0, 1.0, 2.0), factor=[(0.0, 1.0), (0.01, 2.0)]),
        refweb.Motion(node=0, displacement=MOTION),
        *ball(**changes),
    ]
    return scene(effects=effects).build()


def ball(stiffness=1e5, **changes):
    given = dict(name="ball", radius=0.1, mass=1.0, position=(0.01, 0.02, -0.105), velocity=(0.0, 0.5, 1.0))
    return refweb.Body(**{**given, **changes}), refweb.Contact(stiffness=stiffness)


def observed():
    return (
        refweb.Observe(name="deflection", quantity="displacement", reduce="max"),
        refweb.Observe(name="tension", quantity="tension", reduce="max"),
        refweb.Observe(name="energy", quantity="total_energy", reduce="max"),
    )


def scene(duration=0.02, interval=1e-3, frames=5, error="none", **changes):
    """A square web hit by a ball."""
    solve = {key: changes.pop(key) for key in ("safety", "step_size") if key in changes}
    given = dict(
        web=window(),
        cable=cable(),
        effects=ball(),
        solve=refweb.Dynamic(duration=duration, **solve),
        output=refweb.Output(interval=interval, frames=frames),
        accuracy=refweb.Accuracy(error=error),
        observe=observed(),
    )
    return refweb.Scene(**{**given, **changes})


def everything(run):
    return list(run.arrays().values())


@pytest.fixture(scope="module")
def whole():
    """(solver, times, run, rows) of one undisturbed run."""
    solver, times = full_solver(), np.linspace(0.0, 0.02, 21)
    run = solver.start()
    return times, run, solver.advance(run, times).values


def full_solver():
    system = impact_system()
    return simulation.Simulation(scene(), system, refweb.Solution(scene())).integrator


@pytest.mark.parametrize("sizes", [[1] * 21, [2, 3, 5, 11], [20, 1]])
def test_blocks_of_rows_do_not_matter(whole, sizes):
    """One after another, or many in one call: the same history bit for bit."""
    times, run, rows = whole
    solver = full_solver()
    other = solver.start()
    parts = [solver.advance(other, part).values for part in np.split(times, np.cumsum(sizes)[:-1])]
    np.testing.assert_array_equal(np.vstack(parts), rows)
    for a, b in zip(everything(run), everything(other), strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_run_is_its_whole_state(whole):
    """A copy goes on as the run itself does, in a solver of its own and beside another run in the same solver."""
    times, run, rows = whole
    solver = full_solver()
    first = solver.start()
    solver.advance(first, times[:9])
    second, third = copy.deepcopy(first), copy.deepcopy(first)
    parts = []
    for end in times[9:]:
        solver.advance(first, [end])
        parts.append(solver.advance(second, [end]).values)
        solver.advance(solver.start(), [5e-4])
    np.testing.assert_array_equal(np.vstack(parts), rows[9:])
    np.testing.assert_array_equal(full_solver().advance(third, times[9:]).values, rows[9:])
    for other in (first, second, third):
        for a, b in zip(everything(run), everything(other), strict=True):
            np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("duration, interval, last", [(0.01, 3e-3, 4), (0.01, 0.01, 1), (0.7, 0.1, 7)])
def test_rows_are_multiples_of_the_interval_and_the_end(duration, interval, last):
    times = schedule.row_times(scene(duration, interval))
    np.testing.assert_allclose(times[:-1], interval * np.arange(last), rtol=1e-15)
    assert times[-1] == duration and len(times) == last + 1


@pytest.mark.ordinary("central-difference", "ida")
@pytest.mark.parametrize("method", ["central-difference", "cvode", "ida"])
def test_momentum_is_that_of_what_is_free(method):
    """Σ m v of nodes that are neither held nor driven, whose masses here are those of two half lines each.

    A chain is drawn by one end: the driven node has the largest velocity, and half a line of mass that is not counted.
    """
    drawn = refweb.Motion(node=3, displacement=[(0.0, 0.0, 0.0, 0.0), (1.0, 2.0, 0.0, 1.0)])
    solution = refweb.run(
        refweb.Scene(
            web=refweb.SingleCable(start=(0, 0, 0), end=(0.3, 0, 0), elements=3),
            cable=cable(law="linear", prestrain=0.01),
            effects=[drawn],
            supports=refweb.Supports(nodes=[0]),
            solve=refweb.Dynamic(duration=5e-3, method=method),
            output=refweb.Output(interval=1e-3, frames=1),
            accuracy=refweb.Accuracy(error="none"),
        )
    )
    node = DENSITY * AREA * 0.1 / 1.01
    expected = np.array([node * state.v[1:3].sum(axis=0) for _, state in solution.frames])
    found = np.column_stack([solution.history[f"momentum_{axis}"] for axis in "xyz"])
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13 * node)
    assert np.abs(found[-1]).max() > 1e-2 * node


# Observables


def choices(system):
    """Observables of every quantity and selection that the scene has, without their reduction."""
    nodal = [dict(node="centre"), dict(node=[1, 5, 9]), dict(), dict(body="ball")]
    for quantity in ("displacement", "position", "velocity", "reaction"):
        for selection in nodal:
            yield from (dict(quantity=quantity, component=k, **selection) for k in (None, "x", "y", "z"))
    for quantity in ("tension", "stress", "strain"):
        yield from (dict(quantity=quantity, **selection) for selection in (dict(), dict(line=7)))
    for quantity in ("kinetic", "strain", "potential", "contact", "total"):
        yield dict(quantity=f"{quantity}_energy")
    yield from (dict(quantity="work"), dict(quantity="slack_fraction"), dict(quantity="step_size"))


@pytest.fixture(scope="module")
def followed():
    """(observables, run with a row and a frame at every step, the same run with a row every 20 steps)."""
    system = impact_system(velocity=(0.0, 0.5, 8.0))
    observe = [
        refweb.Observe(name=f"{i} {reduce}", reduce=reduce, **given)
        for i, given in enumerate(choices(system))
        for reduce in ("max", "min", "final")
    ]
    effects = [e.effect if hasattr(e, "effect") else e for e in system.effects][1:]
    h = 1e-4
    fine = scene(interval=h, frames=1, step_size=h, effects=effects, observe=observe)
    return observe, refweb.run(fine), refweb.run(fine.replace(output=refweb.Output(interval=20 * h)))


STIFFNESS, RADIUS = 1e5, 0.1
"""Of the contact [N/m] and of the ball [m]."""


def pushed(state):
    """Depth of the ball in each line [m], and its push on all [N]: a penalty at the nearest point of each."""
    net, web = state.system.net, state.system.net.web
    place = net.points + state.x
    start, end, centre = place[web.lines[:, 0]], place[web.lines[:, 1]], place[len(web.points)]
    along = end - start
    share = np.clip(((centre - start) * along).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
    away = start + share[:, None] * along - centre
    distance = np.linalg.norm(away, axis=1)
    depth = np.maximum(RADIUS - distance, 0.0)
    return depth, STIFFNESS * (depth / distance) @ away


def recomputed(observe, state):
    """The value of an observable from positions and velocities of a state, or None."""
    net, web = state.system.net, state.system.net.web
    if observe.quantity in ("displacement", "position", "velocity"):
        values = {"displacement": state.x, "position": net.points + state.x, "velocity": state.v}[observe.quantity]
        if observe.body is not None:
            values = values[len(web.points) :]
        else:
            values = values[: len(web.points)] if observe.node is None else values[web.find(observe.node)]
        values = np.linalg.norm(values, axis=1) if observe.component is None else values[:, observe.component]
        return values.max()
    if observe.quantity in ("tension", "stress", "strain"):
        ends = (net.points + state.x)[web.lines]
        strain = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / web.natural_length - 1.0
        values = {"strain": strain, "stress": MODULUS * np.maximum(strain, 0.0)}.get(observe.quantity)
        values = MODULUS * AREA * np.maximum(strain, 0.0) if values is None else values
        return values.max() if observe.line is None else values[observe.line]
    if observe.quantity == "kinetic_energy":
        return 0.5 * np.sum(net.mass[:, None] * state.v**2)
    if observe.quantity in ("work", "step_size"):
        return None
    if observe.quantity == "contact_energy":
        return 0.5 * STIFFNESS * (pushed(state)[0] ** 2).sum()
    if observe.quantity == "reaction" and observe.body is not None:
        push = pushed(state)[1]
        return np.linalg.norm(push) if observe.component is None else -push[observe.component]
    if observe.quantity == "total_energy":
        book = state.energies
        return sum(book[f"{name}_energy"] for name in ("strain", "potential", "contact")) + 0.5 * np.sum(
            net.mass[:, None] * state.v**2
        )
    return observe.value(state).value


def test_observables_at_every_row(followed):
    """Columns are what positions and velocities of the frames say; the ball touches, several lines at a time."""
    observe, fine, _ = followed
    states = [state for _, state in fine.frames]
    assert len(states) == len(fine.history["time"]) == 201
    touched = np.array([(pushed(state)[0] > 0.0).sum() for state in states])
    assert (touched > 0).sum() > 20 and (touched == 0).sum() > 20 and touched.max() > 1
    for o in observe[::3]:
        values = [recomputed(o, state) for state in states]
        if None not in values:
            column = fine.history[o.name]
            # A strain of 1e-3 is found here from lengths that are rounded to 1e-16: 1e-13 of itself, and as much of EA.
            scale = {"tension": MODULUS * AREA, "stress": MODULUS, "reaction": MODULUS * AREA}.get(o.quantity, 1.0)
            np.testing.assert_allclose(column, values, rtol=1e-9, atol=1e-13 * scale, err_msg=str(o))


def between_steps(column):
    """What a peak may be above the steps beside it: an eighth of a second difference, twice that at kinks."""
    return 0.25 * np.abs(np.diff(column, 2)).max()


def test_reductions_see_every_step(followed):
    """Largest and smallest of all steps, or of the motion between two; when and where; the last is that of the row."""
    observe, fine, coarse = followed
    times, states = fine.history["time"], [state for _, state in fine.frames]
    at_steps = between = 0
    for o in observe:
        column, result = fine.history[o.name], fine.results[o.name]
        first = 1 if o.quantity == "step_size" else 0  # no step leads to the first row
        pick = {"max": np.argmax, "min": np.argmin, "final": lambda a: len(a) - 1}[o.reduce](column[first:]) + first
        sign = {"max": 1.0, "min": -1.0, "final": 0.0}[o.reduce]
        if result.value == column[pick]:
            assert result.time == times[pick], o
            near, rtol, atol, at_steps = [pick], 1e-9, 0.0, at_steps + 1
        else:
            atol = between_steps(column[first:])
            assert 0.0 < sign * (result.value - column[pick]) <= atol, o
            near, rtol = np.flatnonzero(np.abs(times - result.time) < 1e-4), 0.0
            assert len(near) == 2 and max(sign * column[near]) >= sign * column[pick] - atol, o
            between += 1
        single = o.quantity in ("reaction", "slack_fraction") or o.quantity.endswith("_energy")
        if single or o.body is not None or o.quantity in ("work", "step_size"):
            continue
        if o.quantity in ("tension", "stress", "strain"):
            there = replace(o, line=result.where)
            assert o.line is None or result.where == o.line
        else:
            there = replace(o, node=result.where)
            assert o.node is None or result.where in fine.state.system.net.web.find(o.node)
        scale = {"tension": MODULUS * AREA, "stress": MODULUS}.get(o.quantity, 1.0)
        off = min(abs(recomputed(there, states[n]) - result.value) for n in near)
        # At a step by rounding; between two by no more than values change from one to the other.
        change = np.abs(np.diff(column)).max() if len(near) > 1 else 0.0
        assert off <= max(rtol * abs(result.value), 1e-13 * scale, atol + change), o
    assert at_steps > 60 and between > 20


def test_peaks_between_rows(followed):
    """With a row every 20 steps the extremes are those of the steps and between them, above what the rows show."""
    observe, fine, coarse = followed
    above = 0
    for o in observe:
        if o.quantity == "step_size":
            continue
        sign = {"max": 1.0, "min": -1.0, "final": 0.0}[o.reduce]
        value, column = coarse.results[o.name].value, coarse.history[o.name]
        # The steps are the same up to the rounding of times, which a smooth motion of 200 steps hardly amplifies.
        every = fine.history[o.name]
        rounding = 1e-8 * max(np.abs(every).max(), 1e-9)
        if sign:
            assert -rounding <= sign * value - (sign * every).max() <= between_steps(every) + rounding, o
        else:
            assert abs(value - every[-1]) <= rounding, o
        assert (sign * value >= sign * column).all()
        above += (sign * value > sign * column).all() and sign != 0.0
    assert above > 40


def test_step_size_follows_contact():
    """The step shrinks when the ball comes within reach of the web: seen by the largest and the smallest step."""
    observe = [refweb.Observe(name=r, quantity="step_size", reduce=r) for r in ("max", "min", "final")]
    effects = ball(1e7, position=(0.0, 0.0, -0.12), velocity=(0.0, 0.0, 1.0))
    solution = refweb.run(scene(0.04, effects=effects, observe=observe))
    steps = solution.history["min"][1:]
    largest, smallest = solution.results["max"], solution.results["min"]
    assert (largest.value, smallest.value) == (steps.max(), steps.min()) and smallest.value < 0.2 * largest.value
    # Without contact the web allows L/c, of which half is taken, less what rows need to be met.
    assert 0.9 * 0.5 * 0.2 / SOUND < largest.value <= 0.5 * 0.2 / SOUND


def test_default_observables_are_peaks():
    solution = refweb.run(scene(observe=()))
    assert list(solution.results) == ["deflection", "max_stress", "max_tension"]
    for name, result in solution.results.items():
        assert result.value >= solution.history[name].max() > 0.0 and 0.0 < result.time <= 0.02


# Errors


def test_errors_do_not_change_the_run():
    """The twin runs beside the run, whose results and history are those without it."""
    with_twin, plain = refweb.run(scene(error="twin")), refweb.run(scene())
    for name, result in with_twin.results.items():
        assert plain.results[name][:1] == result[:1] and plain.results[name][2:11] == result[2:11]
        assert plain.results[name].error is None and result.error > 0.0
    for name, column in plain.history.items():
        np.testing.assert_array_equal(with_twin.history[name], column)


def test_errors_are_the_difference_to_a_finer_run():
    """Of 10 steps to a row the twin makes 15, more than √2 times as many, as a run by hand does."""
    solution, by_hand = refweb.run(scene(error="twin", step_size=1e-4)), refweb.run(scene(step_size=1e-3 / 15))
    assert (solution.solver["nsteps"], by_hand.solver["nsteps"]) == (200, 300)
    for name, result in solution.results.items():
        times = solution.history["time"]
        apart, means = solution.history[name] - by_hand.history[name], []
        for begin, end in ((0.5, 1.0), (0.25, 0.5), (0.125, 0.25), (0.0, 0.125)):
            near = (times >= begin * result.time) & (times <= end * result.time)
            means.append(np.sqrt((apart[near] ** 2).mean()) if near.any() else 0.0)
        difference = max(abs(result.value - by_hand.results[name].value), *means)
        # With errors a h² and a (2h/3)² the first is their difference over 1 − 4/9; ± is three times that.
        np.testing.assert_allclose(result.error, 3.0 * difference / (1.0 - 4.0 / 9.0), rtol=1e-9)


def test_errors_cover_the_truth_on_a_smooth_motion():
    """On a taut web the ± is the distance to the limit of small steps; a run at a tenth of the step stands for it."""
    effects = [refweb.Velocity(node="all", value=(0.0, 0.0, 1.0))]
    observe = [refweb.Observe(name="z", quantity="displacement", node="centre", component="z")]
    taut = dict(effects=effects, observe=observe, cable=cable(prestrain=0.05))
    value, error = refweb.run(scene(error="twin", **taut)).results["z"][:2]
    true = refweb.run(scene(safety=0.05, **taut)).results["z"].value
    # The run that stands for the limit errs itself by 1 %, and the next order of the error is (ωh)² ≤ 1/4 at most.
    # Where the difference is small at the end, its mean before counts, in a vibration at most some four times that.
    assert 0.75 < error / 3.0 / abs(value - true) < 4.0


@pytest.mark.parametrize("interval", [2e-4, 5e-4, 1.2e-3, 2.1e-3, 1e-2])
def test_errors_cover_the_truth_where_rows_are_about_as_long_as_steps(interval):
    """Two masses on a spring, ω = √(k/μ): the twin takes other steps however few there are in a row.

    The step bound times the safety is 1e-3 s, the rows ask for 1 to 10 steps.
    """
    k, masses = 1e4, (2.0, 1.0)
    mu = masses[0] * masses[1] / sum(masses)
    omega, speed = np.sqrt(k / mu), 0.1
    spring = refweb.Scene(
        web=refweb.SingleCable(start=(0, 0, 0), end=(1, 0, 0), elements=1),
        cable=refweb.Cable(law="linear", modulus=1e8, area=1e-4, density=0.0),
        effects=[
            refweb.PointMass(node=0, mass=masses[0]),
            refweb.PointMass(node=1, mass=masses[1]),
            refweb.Velocity(node=1, value=(speed, 0, 0)),
        ],
        supports=refweb.Supports(nodes=[]),
        solve=refweb.Dynamic(duration=0.2, safety=0.07),
        output=refweb.Output(interval=interval),
        observe=[refweb.Observe(name="x", quantity="displacement", node=1, component="x")],
    )
    value, error = refweb.run(spring).results["x"][:2]
    exact = speed * mu / masses[1] * np.sin(omega * 0.2) / omega + masses[1] / sum(masses) * speed * 0.2
    assert 0.0 < abs(value - exact) <= error


def test_a_twin_that_fails_is_said(monkeypatch):
    def advance(self, course, times, own=CentralDifference.advance):
        if self.finer > 1.0:
            raise refweb.SolverError("no twin today")
        return own(self, course, times)

    monkeypatch.setattr(CentralDifference, "advance", advance)
    solution = refweb.run(scene(error="twin"))
    assert all(result.error is None for result in solution.results.values())
    assert solution.status == "solved" and any("no twin today" in text for text in solution.warnings)


# Files


def read_json(folder):
    return json.loads((folder / "run.json").read_text(encoding="utf-8"))


def read_history(folder):
    with open(folder / "history.csv", encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    return header, np.array(rows, dtype=float)


def listed(folder):
    root = ElementTree.parse(folder / "web.pvd").getroot()
    return [(float(entry.get("timestep")), entry.get("file")) for entry in root.iter("DataSet")]


@pytest.mark.parametrize("error", ["none", "twin"])
def test_two_runs_write_the_same_bytes(tmp_path, error):
    for name in "ab":
        refweb.run(scene(error=error), out=tmp_path / name)
    assert not read_json(tmp_path / "a")["warnings"]
    for path in sorted((tmp_path / "a").rglob("*")):
        if path.suffix in (".csv", ".vtu", ".pvd"):
            other = tmp_path / "b" / path.relative_to(tmp_path / "a")
            assert path.read_bytes() == other.read_bytes(), path.name
    results = [read_json(tmp_path / name)["results"] for name in "ab"]
    assert results[0] == results[1] and (results[0]["tension"]["error"] is None) == (error == "none")


def test_folder_and_memory_agree(tmp_path):
    written, kept = refweb.run(scene(), out=tmp_path / "out"), refweb.run(scene())
    header, rows = read_history(tmp_path / "out")
    assert header == kept.columns == written.columns
    np.testing.assert_array_equal(rows, np.column_stack(list(kept.history.values())))
    assert written.results == kept.results
    for (number, state), (time, name) in zip(kept.frames, listed(tmp_path / "out")[::2], strict=True):
        mesh = meshio.read(tmp_path / "out" / name)
        assert name == f"frames/web_{number:06d}.vtu" and time == state.time
        np.testing.assert_array_equal(mesh.points, state.position[: len(mesh.points)])
        np.testing.assert_array_equal(mesh.point_data["velocity"], state.v[: len(mesh.points)])


def test_memory_does_not_grow_with_duration(tmp_path, monkeypatch):
    """A run with a folder keeps one state and no row, however long it lasts; its history is read from the folder."""
    followers = []

    class Noted(simulation.Simulation):
        def __init__(self, *arguments):
            super().__init__(*arguments)
            followers.append(self)

    monkeypatch.setattr(simulation, "Simulation", Noted)
    for name, duration in (("short", 0.01), ("long", 0.08)):
        solution = refweb.run(scene(duration, 1e-3, 2), out=tmp_path / name)
        assert len(read_history(tmp_path / name)[1]) == round(duration / 1e-3) + 1
        assert solution.frames == [] and solution.table is None and len(followers.pop().rows) == 1
        assert len(solution.history["time"]) == round(duration / 1e-3) + 1
        assert read_json(tmp_path / name)["results"]["deflection"]["value"] == solution.results["deflection"].value


def test_interrupted(tmp_path, monkeypatch, capsys):
    """Ctrl-C after a few blocks: status 130, a folder marked so whose files open, no thread left behind."""
    calls = []

    def advance(self, course, times, own=CentralDifference.advance):
        if threading.current_thread() is threading.main_thread():
            calls.append(len(times))
            if len(calls) > 8:
                raise KeyboardInterrupt
        return own(self, course, times)

    monkeypatch.setattr(CentralDifference, "advance", advance)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(refweb.Scene, "load", lambda source: scene(0.5, 1e-4, 3, error="twin"))
    assert main(["run", "any.toml", "--out", "out"]) == 130
    assert "refweb: interrupted: refweb resume out continues it\n" in capsys.readouterr().err
    folder = tmp_path / "out"
    summary, (_, history) = read_json(folder), read_history(folder)
    assert summary["status"] == "interrupted" and summary["message"] == f"interrupted after t = {history[-1, 0]:.6g} s"
    assert len(history) == sum(calls[:-1]) and (np.diff(history[:, 0]) > 0).all()
    frames = listed(folder)
    assert len(frames) >= 4
    assert {name for _, name in frames} == {f"frames/{path.name}" for path in (folder / "frames").iterdir()}
    for time, name in frames:
        assert np.isfinite(meshio.read(folder / name).points).all() and time <= history[-1, 0]
    assert np.load(folder / "checkpoint.npz")["time"] == frames[-1][0]
    assert threading.active_count() == 1


# The book of energies


def drift_at(safety):
    return refweb.run(scene(0.05, safety=safety)).solver["energy_drift"]


def test_an_open_book_is_repeated_with_half_the_step(tmp_path, monkeypatch):
    """With a limit between the drifts at half and a quarter of the bound the run that counts is the second one."""
    drifts = drift_at(0.5), drift_at(0.25)
    assert drifts[1] < 0.5 * drifts[0]
    monkeypatch.setattr(central_difference, "DRIFT", np.sqrt(drifts[0] * drifts[1]))
    kept, written = refweb.run(scene(0.05)), refweb.run(scene(0.05, error="twin"), out=tmp_path / "out")
    expected = refweb.run(scene(0.05, safety=0.25))
    for solution in (kept, written):
        found = {name: result._replace(error=None)[:11] for name, result in solution.results.items()}
        assert found == {name: result[:11] for name, result in expected.results.items()}
        (warning,) = solution.warnings
        assert "energy drift" in warning and warning.endswith("repeated with safety = 0.25")
        assert solution.solver == expected.solver
    header, rows = read_history(tmp_path / "out")
    np.testing.assert_array_equal(rows, np.column_stack(list(expected.history.values())))
    np.testing.assert_array_equal(np.column_stack(list(kept.history.values())), rows)
    assert [number for number, _ in kept.frames] == [number for number, _ in expected.frames]
    assert read_json(tmp_path / "out")["warnings"] == written.warnings
    names = [name for _, name in listed(tmp_path / "out")]
    assert len(names) == 2 * len(expected.frames)
    assert sorted(names) == sorted(f"frames/{path.name}" for path in (tmp_path / "out" / "frames").iterdir())


def test_a_book_that_stays_open_fails(tmp_path, monkeypatch, capsys):
    """After the third run; what was computed is kept, and the message says with what, where and when."""
    monkeypatch.setattr(central_difference, "DRIFT", 1e-9)
    monkeypatch.setattr(refweb.Scene, "load", lambda source: scene(0.05, error="twin"))
    assert main(["run", "any.toml", "--out", str(tmp_path / "out")]) == 1
    summary = read_json(tmp_path / "out")
    assert summary["status"] == "failed" and summary["results"] == {}
    assert summary["message"] in capsys.readouterr().err
    found = re.search(
        r"energy drift \S+ of the largest energy between t = (\S+) and (\S+) s, limit 1e-09: energy came in with "
        r"(elasticity|contact) at line \d+; use a smaller safety than 0.125",
        summary["message"],
    )
    before, after = float(found[1]), float(found[2])
    np.testing.assert_allclose(after - before, 1e-3, rtol=1e-9)
    again = [text.rpartition("; ")[2] for text in summary["warnings"]]
    assert again == ["repeated with safety = 0.25", "repeated with safety = 0.125"]
    assert read_history(tmp_path / "out")[1][-1, 0] <= after
    assert threading.active_count() == 1


def test_a_drift_names_the_table_whose_corner_is_on_the_way(monkeypatch):
    """Not the rotation of the box, which could turn and does not."""
    monkeypatch.setattr(central_difference, "DRIFT", 1e-6)
    box = {"name": "box", "shape": "box", "size": [0.1, 0.1, 0.1], "mass": 1e-3, "position": [0, 3, 0]}
    jump = {"body": "box", "force": [1, 0, 0], "factor": [[0, 0], [5.5e-3, 0], [5.6e-3, 1]]}
    given = refweb.Scene.from_dict(
        {
            "web": {"kind": "inline", "points": [[0, 0, 0], [1, 0, 0]], "lines": [[0, 1]], "supports": [0, 1]},
            "cable": {"law": "linear", "modulus": 1e6, "area": 1e-6, "density": 1000.0},
            "body": [box | {"velocity": [1, 0, 0]}],
            "load": [jump],
            "solve": {"kind": "dynamic", "duration": 0.02, "step_size": 1e-3},
            "accuracy": {"error": "none"},
        }
    )
    with pytest.raises(EnergyDriftError, match="energy came in with a corner of the table of load;"):
        refweb.run(given)


def test_a_fixed_step_is_never_halved(monkeypatch):
    monkeypatch.setattr(central_difference, "DRIFT", 1e-9)
    steps = []

    class Noted(CentralDifference):
        def __init__(self, *arguments, **named):
            steps.append(named["step_size"])
            super().__init__(*arguments, **named)

    monkeypatch.setattr(central_difference, "CentralDifference", Noted)
    with pytest.raises(EnergyDriftError, match="use a smaller step_size than 0.0001"):
        refweb.run(scene(step_size=1e-4))
    assert steps == [1e-4]


@pytest.mark.parametrize("method", ["central-difference", "cvode", "ida"])
def test_a_load_that_rises_on_a_web_at_rest(method):
    """Books of the first rows are open against next to no energy, and close: u = F/kT (t − sin(ωt)/ω)."""
    rise, force, mass = 0.05, 20.0, 2.0
    rising = refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0]),
        cable=refweb.Cable(law="linear", modulus=MODULUS, area=AREA, density=0.0),
        effects=[
            refweb.PointMass(node=1, mass=mass),
            refweb.Load(node=1, force=(force, 0, 0), factor=[(0.0, 0.0), (rise, 1.0)]),
        ],
        solve=refweb.Dynamic(duration=rise, method=method),
        observe=[refweb.Observe(name="u", quantity="displacement", node=1, component="x")],
    )
    stiff = MODULUS * AREA
    rate = np.sqrt(stiff / mass)
    solution = refweb.run(rising)
    exact = force / (stiff * rise) * (rise - np.sin(rate * rise) / rate)
    assert solution.warnings == [] and solution.solver["energy_drift"] < 1e-3
    assert abs(solution.results["u"].value - exact) <= solution.results["u"].error < 1e-2 * exact


def test_where_rows_are_shorter_than_steps_safety_divides_rows():
    """A run repeated with half the safety takes twice the steps, so that an open book has a chance."""
    counts = []
    for safety in (0.5, 0.25, 0.125):
        solution = refweb.run(scene(duration=1e-3, interval=1e-5, safety=safety))
        counts.append(solution.solver["nsteps"])
    assert counts == [100, 200, 400]


def test_step_above_the_bound_is_refused(tmp_path):
    """The bound of a square web is L/c, to which contact adds: five lines' stiffnesses and that of the contact."""
    plain = scene(effects=[refweb.Velocity(node="centre", value=(0, 0, 1))])
    limit = 0.2 / SOUND
    with pytest.raises(refweb.InputError, match=rf"step_size = 0\.0003\d* must be ≤ {limit:.6g} \[s\]"):
        refweb.run(plain.replace(solve=refweb.Dynamic(duration=0.01, step_size=1.01 * limit)), out=tmp_path / "out")
    assert not (tmp_path / "out").exists()
    steps = refweb.run(plain.replace(solve=refweb.Dynamic(duration=0.01, step_size=0.99 * limit))).history
    assert len(steps["time"]) == 11
    with pytest.raises(refweb.InputError, match="the bound of stability"):
        refweb.run(scene(step_size=0.99 * limit))


def test_too_many_steps_are_refused():
    with pytest.raises(
        refweb.InputError, match=r"step_size = 1e-30 must be ≥ 1e-11 \[s\]: a row takes at most 1e[+]08"
    ):
        refweb.run(scene(step_size=1e-30))
    stiff = refweb.Cable(law="linear", modulus=1e30, area=AREA, density=DENSITY)
    with pytest.raises(refweb.SolverError, match=r"at t = 0 s is \S+ s, more than 1e[+]08 steps to the next row"):
        refweb.run(scene().replace(cable=stiff))


def test_blow_up_names_node_line_and_time(monkeypatch):
    """Above the bound a linear web grows step by step until numbers end: who is first, and when."""
    system = taut_system(law="linear")
    h = 1.5 * CentralDifference(system).bound()
    monkeypatch.setattr(CentralDifference, "bound", lambda self: np.inf)
    with pytest.raises(refweb.SolverError) as caught, np.errstate(all="ignore"):
        run_at(system, 0.5, [1000 * h], bump(system), step_size=h * (1 + 1e-12))
    pattern = r"number not finite at node (\d+), line (\d+), t = (\S+) s: use a smaller \S+"
    found = re.fullmatch(pattern, str(caught.value))
    node, line, time = int(found[1]), int(found[2]), float(found[3])
    x, v = np.zeros((system.rows, 3)), bump(system)
    inverse = np.where(system.supported, 0.0, 1.0 / system.net.mass[:, None])
    f = system.force(0.0, x)
    with np.errstate(all="ignore"):
        for step in range(1, 1001):
            v = v + 0.5 * h * inverse * f
            x = x + h * v
            f = system.force(step * h, x)
            v = v + 0.5 * h * inverse * f
            wrong = ~np.isfinite(x + v + f).all(axis=1)
            if wrong.any():
                break
    np.testing.assert_allclose(time, step * h, rtol=1e-5)  # as many digits as the message has
    assert wrong[node] and node in system.net.web.lines[line]


# What is refused


def refused(match, tmp_path, **changes):
    with pytest.raises(refweb.InputError, match=match):
        refweb.run(scene(**changes), out=tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


def test_massless_node(tmp_path):
    rim = set(window().web().rim)
    bare = min(set(range(len(window().web().points))) - rim)
    refused(f"node {bare} has no mass, which central-difference needs", tmp_path, cable=cable(density=0.0))
    heavy = [refweb.PointMass(node=[n for n in range(bare + 3)], mass=1.0), *ball()]
    bare = min(set(range(bare + 3, 21)) - rim)
    refused(f"node {bare} has no mass", tmp_path, cable=cable(density=0.0), effects=heavy)


def test_velocities_in_statics(tmp_path):
    static = dict(solve=refweb.Static(), output=refweb.Output(), accuracy=None)
    refused(r"\[\[body\]\] 1 velocity = .* has no meaning in statics: leave it out", tmp_path, **static)
    still = [refweb.Velocity(node="all", value=(0, 0, 1))]
    refused(r"\[\[velocity\]\] 1 a velocity cannot be used in statics", tmp_path, effects=still, **static)


def test_contact_and_bodies(tmp_path):
    one, contact = ball()
    refused(r"\[contact\] there is no \[\[body\]\]", tmp_path, effects=[contact])
    refused(r'\[\[body\]\] 2 name = "ball" is listed twice', tmp_path, effects=[one, one, contact])
    unknown = [refweb.Observe(name="a", quantity="velocity", body="bal")]
    refused('body = "bal" is not a body, did you mean "ball"', tmp_path, observe=unknown)
    refused("the scene has no .*body", tmp_path, observe=unknown, effects=())
    for name in ("web", "Web", "a/b", "", " "):
        with pytest.raises(refweb.InputError, match="name"):
            ball(name=name)
    for wrong in (dict(mass=None), dict(fixed=True), dict(radius=0.0), dict(mass=-1.0)):
        with pytest.raises(refweb.InputError, match="mass|velocity|radius"):
            ball(**wrong)


def test_velocity_of_a_supported_node(tmp_path):
    rim = int(window().web().rim[0])
    for node in (rim, [10, rim], "rim"):
        effects = [refweb.Velocity(node=node, value=(0.0, 0.0, 1.0))]
        refused(r"\[\[velocity\]\] 1 node = \d+ is supported along z", tmp_path, effects=effects)
    moved = refweb.Motion(node=10, displacement=[(0.0, 0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 1.0)])
    effects = [refweb.Velocity(node=10, value=(0.0, 0.0, 1.0)), moved]
    refused("node = 10 is supported along z", tmp_path, effects=effects)
    partly = [refweb.Supports(nodes=10, components=["x"])]
    solution = refweb.run(scene(effects=[refweb.Velocity(node=10, value=(0, 0, 1))], support=partly))
    assert solution.status == "solved" and not solution.state.x[10, 0]


def test_all_are_those_that_are_free():
    solution = refweb.run(scene(effects=[refweb.Velocity(node="all", value=(0.0, 0.0, 1.0))]))
    _, start = solution.frames[0]
    web = solution.state.system.net.web
    np.testing.assert_array_equal(start.v[:, 2], ~np.isin(np.arange(len(web.points)), web.rim))


def test_a_body_without_contact_passes_with_a_warning():
    solution = refweb.run(scene(effects=ball()[:1]))
    (warning,) = solution.warnings
    assert "no [contact]" in warning and solution.results["deflection"].value == 0.0
    assert "contact_energy" not in solution.history


@pytest.mark.parametrize("speed", [1e3, 7e3])
def test_a_fast_body_does_not_pass_between_two_steps(speed):
    """Its largest contact force is that of a tenth of the steps, within ±; through soft contact it is seen to go."""
    web, bar = refweb.Window(mesh="square", rows=10, columns=10, side=0.1), cable(law="tension-only")
    ball = refweb.Body(name="ball", radius=0.12, mass=0.5, position=(0, 0, 0.2), velocity=(0, 0, -speed))
    force = refweb.Observe(name="force", quantity="reaction", body="ball", reduce="max")
    hit = refweb.Scene(
        web=web,
        cable=bar,
        effects=[ball, refweb.Contact(stiffness=200.0 * speed**2)],
        solve=refweb.Dynamic(duration=0.4 / speed),
        observe=[force],
    )
    with pytest.raises(refweb.SolverError, match='passes the core of a body: .* in body "ball"'):
        refweb.run(hit.replace(effects=[ball, refweb.Contact(stiffness=1e5)]))
    value, error = refweb.run(hit).results["force"][:2]
    fine = hit.replace(solve=refweb.Dynamic(duration=0.4 / speed, safety=0.05), accuracy=refweb.Accuracy(error="none"))
    true = refweb.run(fine).results["force"].value
    assert true > 1e3 and abs(value - true) <= max(error, 0.02 * true)


def test_what_is_not_at_rest_before_the_start_is_said():
    """A body in the web and a node moved away at t = 0 store energy that nothing put there."""
    ball = refweb.Body(name="ball", radius=0.1, mass=1.0, position=(0.0, 0.0, 0.05))
    inside = refweb.run(scene(effects=[ball, refweb.Contact(stiffness=10.0)]))
    assert any("overlaps the web at the start" in text for text in inside.warnings)
    motion = refweb.Motion(node="centre", displacement=[(0.0, 0.0, 0.0, 1e-3), (1.0, 0.0, 0.0, 1e-3)])
    moved = refweb.run(scene(effects=[motion]))
    assert any("[[motion]] has moved node" in text for text in moved.warnings)


def test_histories_do_not_depend_on_the_clock(monkeypatch):
    """Blocks of rows are sized by the clock: one that stands, runs or stutters gives the same bits, and so any rows."""
    damped = scene(interval=2e-4, effects=[*ball(), refweb.Damping(time=1e-5, rate=3.0)])
    histories = []
    for ticks in ([0.0], [1.0], [0.0, 0.3, 0.0, 0.0, 1.0]):
        clock = itertools.accumulate(itertools.cycle(ticks))
        monkeypatch.setattr(schedule, "time", SimpleNamespace(perf_counter=lambda clock=clock: next(clock)))
        histories.append(refweb.run(damped).history)
    for other in histories[1:]:
        for name, column in histories[0].items():
            np.testing.assert_array_equal(other[name], column, err_msg=name)
    system = damped.build()
    watch = Watch(damped, system)
    some = History.empty(100, len(watch.probes), system.terms)
    some.values[:] = np.random.default_rng(0).normal(size=some.values.shape)
    for first, last in ((0, 1), (1, 4), (4, 100)):
        np.testing.assert_array_equal(watch.table(some[first:last]), watch.table(some)[first:last])


def test_a_drift_is_laid_to_what_leaves_energy_open(monkeypatch):
    """A ball hits line 1 in some five steps, while line 0, far away and soft, takes up ten times that energy."""
    monkeypatch.setattr(central_difference, "DRIFT", 1e-9)
    web = refweb.Inline(
        points=[(0, 9, 0), (1, 9, 0), (-0.5, 0, 0), (0, 0, 0), (0.5, 0, 0)],
        lines=[(0, 1), (2, 3), (3, 4)],
        supports=[0, 2, 3, 4],
    )
    cable = refweb.Cable(law="tension-only", modulus=1e7, area=1e-6, density=1e5)
    ball = refweb.Body(name="ball", radius=0.1, mass=0.01, position=(-0.2, 0, 0.1005), velocity=(0, 0, -1.0))
    scene = refweb.Scene(
        web=web,
        cable=cable,
        effects=[ball, refweb.Contact(stiffness=1e3), refweb.Velocity(node=1, value=(15.0, 0, 0))],
        solve=refweb.Dynamic(duration=8e-3),
        output=refweb.Output(interval=8e-3),
        accuracy=refweb.Accuracy(error="none"),
    )
    with pytest.raises(SolverError, match=r"energy came in with contact at line 1; use a smaller safety"):
        refweb.run(scene, progress=False)


def test_a_drift_of_a_damped_body_that_tumbles_is_not_laid_to_a_line():
    """The line never moves; in 5 steps for each turn the product of torque and rate is far from its integral."""
    web = refweb.Inline(points=[(0, 0, 0), (1, 0, 0), (2, 0, 0)], lines=[(0, 1), (1, 2)], supports=[0, 2])
    turning = dict(inertia=(1.0, 2.0, 3.0), angular_velocity=(30.0, 10.0, 30.0))
    ball = refweb.Body(name="ball", radius=0.1, mass=1.0, position=(0, 0, 3.0), **turning)
    scene = refweb.Scene(
        web=web,
        cable=refweb.Cable(law="linear", modulus=1e4, area=1e-6, density=1e5),
        effects=[ball, refweb.Damping(bodies=20.0)],
        solve=refweb.Dynamic(duration=0.4, step_size=0.04),
        output=refweb.Output(interval=0.04),
        accuracy=refweb.Accuracy(error="none"),
    )
    with pytest.raises(SolverError, match=r'came in with the rotation of body "ball" or damping; use a smaller step'):
        refweb.run(scene, progress=False)
