"""Natural lengths that change: a mass lifted in closed form, slack that is reeled in, steps, books and frames."""

import copy

import meshio
import nets
import numpy as np
import pytest
from scipy.integrate import DOP853
from scipy.optimize import brentq
from scipy.special import jv, yv

import refweb
from refweb.dynamics.initial_state import equilibrium
from refweb.dynamics.integrators.central_difference import CentralDifference
from refweb.dynamics.integrators.cvode import Cvode
from refweb.dynamics.integrators.events import Event
from refweb.dynamics.integrators.ida import Ida
from refweb.errors import InputError
from refweb.results import probes
from refweb.results.state import State
from refweb.statics import dynamic_relaxation as relaxation
from refweb.statics import load_steps

AXIAL, GRAVITY, LENGTH, SPEED = 1e3, 9.81, 1.0, 0.2
"""EA of a massless line [N], g [m/s²], the line's natural length [m] and how fast it is reeled in [m/s]."""
REELED = [(0.0, 1.0), (1.0, 0.8)]
SAFETIES = (0.2, 0.1, 0.05, 0.025)


def slope(errors, steps):
    return np.polyfit(np.log(steps), np.log(errors), 1)[0]


class Lift:
    """1 kg on a line of natural length L = L₀ − ct: l'' = g − κ(l/L − 1), κ = EA/m.

    With s = L(t) that is c² l'' + κ l/s = g + κ, whose solution is (1 + g/κ) s, the equilibrium at each length, and a
    vibration √s (A J₁(z) + B Y₁(z)), z = 2√(κs)/c.
    """

    def __init__(self, length, gravity=GRAVITY, start=None):
        self.length, self.gravity = length, gravity
        vibration, steady = self._parts(0.0)
        self._amplitudes = np.zeros(2)
        self._amplitudes = np.linalg.solve(vibration, (start or (steady[0], 0.0)) - steady)

    def _parts(self, t):
        s, half = self.length - SPEED * t, SPEED / (2.0 * np.sqrt(AXIAL))
        z, turn = 2.0 * np.sqrt(AXIAL * s) / SPEED, -np.sqrt(AXIAL / s)  # √s = half z, (z J₁)' = z J₀
        vibration = half * z * np.array([[jv(1, z), yv(1, z)], [turn * jv(0, z), turn * yv(0, z)]])
        return vibration, (1.0 + self.gravity / AXIAL) * np.array([s, -SPEED])

    def __call__(self, t):
        """Length and its rate."""
        vibration, steady = self._parts(t)
        return vibration @ self._amplitudes + steady

    def energy(self, t):
        """Kinetic energy, that of the line and that of the weight, which is zero at 1 m [J]."""
        (length, rate), natural = self(t), self.length - SPEED * t
        return 0.5 * rate**2 + 0.5 * AXIAL / natural * (length - natural) ** 2 - self.gravity * (length - 1.0)


def hung(effects, law="linear", gravity=GRAVITY, natural_length=LENGTH, quasi_static=False, **cable):
    """1 kg, 1 m below a support."""
    web = refweb.Inline(points=[[0, 0, 0], [0, 0, -1]], lines=[[0, 1]], natural_length=natural_length, supports=[0])
    own = refweb.Cable(law=law, modulus=1e4 * AXIAL, area=1e-4, density=0.0, **cable)
    weight = [refweb.Gravity(acceleration=(0.0, 0.0, -gravity))] if gravity else []
    return nets.system(web.web(), own, [refweb.PointMass(node=1, mass=1.0), *weight, *effects], quasi_static)


def reel(factor, lines="all"):
    return refweb.Reel(lines=lines, factor=factor)


# A mass that is lifted


@pytest.mark.parametrize("law", ["linear", "tension-only"])
def test_a_lift_converges_to_its_closed_form(law):
    """From the equilibrium at t = 0, taut all along: position, speed, work of the reel and book, of second order."""
    lift, system, errors = Lift(LENGTH), hung([reel(REELED)], law), []
    found = equilibrium(system)
    np.testing.assert_allclose(found.x[1, 2], -GRAVITY / AXIAL, rtol=1e-9)  # the residual of statics
    work = lift.energy(1.0) - lift.energy(0.0)
    assert work > 0.9 * GRAVITY * SPEED  # most of it lifts
    for safety in SAFETIES:
        solver = CentralDifference(system, safety=safety)
        run = solver.start(found.x)
        rows = solver.advance(run, [0.5, 1.0])
        assert rows.work[-1] == run.work[-1]
        length, rate = lift(1.0)
        error = abs(1.0 - run.x[1, 2] - length), abs(-run.v[1, 2] - rate), abs(run.work[-1] - work)
        errors.append([run.nsteps, *error, run.drift])
    # ωh is at most 2·0.2: the next term of the error is (ωh)² of this one in the coarsest step and tilts the fit.
    nsteps, *errors = np.array(errors).T
    for error in errors:
        assert abs(slope(error, 1.0 / nsteps) - 2.0) < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("solver", nets.some([Cvode, Ida], 2))
def test_a_lift_by_sundials(solver):
    """Errors of a method of order 2 go with rtol to the power 2/3, by 21 over two decades; half is asked for."""
    lift, system, errors = Lift(LENGTH), hung([reel(REELED)]), []
    work = lift.energy(1.0) - lift.energy(0.0)
    start = equilibrium(system).x
    for rtol in (1e-5, 1e-7):
        one = solver(system, rtol=rtol)
        run = one.start(start)
        one.advance(run, np.linspace(0.0, 1.0, 11))
        length, rate = lift(1.0)
        errors.append([abs(1.0 - run.x[1, 2] - length), abs(-run.v[1, 2] - rate), abs(run.work[-1] - work), run.drift])
    coarse, fine = np.array(errors)
    assert (coarse > 10.0 * fine).all()
    amplitude = SPEED / np.sqrt(AXIAL)  # of the vibration, 6 mm
    assert fine[0] < 1e-3 * amplitude and fine[1] < 1e-3 * SPEED and fine[2] < 1e-4 * work


@pytest.mark.parametrize("law", nets.LAWS)
@pytest.mark.parametrize("solver", [load_steps.solve, relaxation.solve])
def test_a_lift_in_load_steps(solver, law):
    """Whatever the order of the steps, the stretch is that of the weight, by element order 2 as well."""
    for cable in ({}, dict(order=2, subdivide=3)):
        own = {"smooth": dict(slackness=0.0, smoothing=1e-9)}.get(law, {})
        system = hung([reel(REELED)], law, quasi_static=True, **cable, **own)
        for found in solver(system, (0.0, 1.0, 0.4, 7.0, 0.0)):
            natural = LENGTH * (1.0 - SPEED * min(found.step, 1.0))
            # The smooth law is short of the tension EAη, and residuals are 1e-9 of the weight.
            stretched = natural * (1.0 + GRAVITY / AXIAL)
            np.testing.assert_allclose(1.0 - found.x[1, 2], stretched, rtol=0, atol=1e-8)
            np.testing.assert_allclose(found.tension, GRAVITY, rtol=1e-9)
            state = State(system, found.step, found.x)
            system.at(0.3), system.force(0.3, found.x)  # as whoever looked at another time in between
            np.testing.assert_allclose(state.strain, GRAVITY / AXIAL, rtol=0, atol=2e-9)
            if found.duality_bound is not None:
                np.testing.assert_allclose(found.tension, GRAVITY, rtol=0, atol=found.duality_bound.tension.max())


def test_slack_is_reeled_in_until_the_line_snaps_taut():
    """Nothing moves before; then a vibration, until the line is slack again and the mass flies on by itself."""
    natural = 1.1
    taut = (natural - 1.0) / SPEED
    lift = Lift(1.0, gravity=0.0, start=(1.0, 0.0))
    ahead = 1.5 * np.pi / np.sqrt(AXIAL)  # of the half period that it is taut
    slack = brentq(lambda t: lift(t)[0] - (1.0 - SPEED * t), 0.01 * ahead, ahead)
    speed = lift(slack)[1]
    assert speed < -1.9 * SPEED  # thrown back as by a wall that comes at c
    system = hung([reel([(0.0, 1.0), (1.0, 1.0 - SPEED / natural)])], "tension-only", 0.0, natural)
    end, errors = taut + slack + 0.1, []
    place = lift(slack)[0] + speed * 0.1
    event = [Event(0, 0.0, rising=True)]
    probe = [probes.Probe(probes.line, [1, 0, 1], np.ones((1, 1)))]
    for safety in SAFETIES:
        solver = CentralDifference(system, probe, events=event, safety=safety)
        run = solver.start()
        solver.advance(run, [0.99 * taut])
        assert not run.x.any() and not run.work.any()
        solver.advance(run, [end])
        step = run.step
        assert abs(run.events["time"][0] - taut) <= step
        errors.append([step, abs(1.0 - run.x[1, 2] - place), abs(-run.v[1, 2] - speed), run.drift])
    steps, *errors = np.array(errors).T
    # No order at the kinks, whose places in a step are as they come: each of the two errs by ½ κ h² of what is passed.
    for error, size in zip(errors, (1.0, 1.0, 1.0), strict=True):
        assert (error <= 5.0 * AXIAL * steps**2 * size).all() and error[-1] < 2e-2


# Nets


def taut_net(law, *effects, **changes):
    web = refweb.Window(mesh="square", rows=4, columns=4, side=0.2).web()
    own = {"smooth": dict(slackness=1e-3, smoothing=1e-3)}.get(law, {})
    cable = refweb.Cable(law=law, modulus=7e7, area=1e-4, density=200.0, prestrain=0.05, **own, **changes)
    return nets.system(web, cable, effects, quasi_static=False)


BOTH = [
    refweb.Reel(lines=[0, 3, 7], factor=[(0.0, 1.0), (0.02, 0.96)]),
    refweb.Temperature(expansion=-2e-5, change=[(0.0, 100.0), (0.02, 600.0)]),
]


@pytest.mark.parametrize("law", nets.LAWS)
def test_order_two_and_the_book(law):
    """A reel and a temperature at once, against an explicit method of order 8; the book closes with the same order."""
    system, end = taut_net(law, *BOTH), 0.02
    free, mass = system.free, np.repeat(system.net.mass, 3)[system.free]

    def rate(t, y):
        x = np.zeros((system.rows, 3))
        x.ravel()[free] = y[: len(free)]
        return np.concatenate([y[len(free) :], system.force(t, x).ravel()[free] / mass])

    method = DOP853(rate, 0.0, np.zeros(2 * len(free)), end, rtol=1e-11, atol=1e-12)
    while method.status == "running":
        method.step()
    errors = []
    for safety in SAFETIES:
        solver = CentralDifference(system, safety=safety)
        run = solver.start()
        solver.advance(run, np.linspace(0.0, end, 21))
        assert abs(run.work[-1]) > 1.0  # J
        difference = np.concatenate([run.x.ravel()[free], run.v.ravel()[free]]) - method.y
        errors.append([run.nsteps, np.linalg.norm(difference), run.drift])
    nsteps, error, drift = np.array(errors).T
    # Of a hundred vibrations those near the bound tilt the fit by (ωh)²/2 of their share.
    assert abs(slope(error, 1.0 / nsteps) - 2.0) < 0.15 and abs(slope(drift, 1.0 / nsteps) - 2.0) < 0.15


@pytest.mark.slow
def test_the_book_of_sundials_closes():
    """With lengths that are products of two linear factors; the drift falls with rtol."""
    system, drifts = taut_net("linear", *BOTH), []
    for rtol in (1e-5, 1e-7):
        solver = Cvode(system, rtol=rtol)
        run = solver.start()
        solver.advance(run, np.linspace(0.0, 0.02, 5))
        drifts.append(run.drift)
    assert drifts[1] < 0.1 * drifts[0] < 1e-3


@pytest.mark.slow
def test_methods_agree():
    """A slack net under its weight whose outer lines are reeled in, by two methods: within the sum of their ±."""
    scene = refweb.Scene(
        web=refweb.Layers(mesh="square", layers=2, cell_area=0.04),
        cable=refweb.Cable(law="smooth", modulus=1e6, area=1e-4, density=500.0, smoothing=1e-3, prestrain=-0.01),
        effects=[refweb.Gravity(acceleration=(0.0, 0.0, -9.81)), reel([(0.0, 1.0), (0.1, 0.9)], "rim")],
        supports=refweb.Supports(nodes="corners"),
        solve=refweb.Dynamic(duration=0.1, start="equilibrium", safety=0.05),
        output=refweb.Output(interval=0.01),
        observe=[
            refweb.Observe(name="centre", quantity="displacement", node="centre", component="z"),
            refweb.Observe(name="done", quantity="work"),
        ],
    )
    explicit = refweb.run(scene)
    implicit = refweb.run(scene.replace(solve=refweb.Dynamic(duration=0.1, start="equilibrium", method="cvode")))
    assert explicit.results["done"].value > 0.0
    for name, result in explicit.results.items():
        other = implicit.results[name]
        assert abs(result.value - other.value) <= result.error + other.error < 0.02 * abs(result.value)


# Steps, runs and frames


def test_a_step_is_safe_for_the_shortest_length_of_its_row():
    """A line that is short in the middle of a row only asks for small steps in all of it; it stays slack here."""
    least, table = 0.04, [(0.0, 1.0), (0.04, 0.04), (0.08, 1.0)]
    system = hung([reel(table)], "tension-only", 0.0, natural_length=100.0)
    # Row sums of a line that is held at one end: 2 EA/L.
    safe = 2.0 / np.sqrt(2.0 * AXIAL / (100.0 * least))
    np.testing.assert_allclose(CentralDifference(system).bound(), safe, rtol=1e-14)
    for end, rows in ((0.1, 1), (0.04, 1), (0.12, 7)):
        solver, share = CentralDifference(system, safety=0.01), 0.01 * safe / np.sqrt(least)
        run = solver.start()
        for time in np.linspace(0.0, end, rows + 1)[1:]:
            begin = max(run.time, *(corner for corner in (0.0, 0.04, 0.08) if corner < time))  # of the last steps
            largest = share * np.sqrt(np.interp([begin, time], *np.transpose(table)).min())
            width = time - begin
            solver.advance(run, [time])
            # Steps divide a row, from corner to corner: the largest that do, but for rounding, and 0.5/0.01 at least.
            np.testing.assert_allclose(width / run.step, max(np.ceil(width / largest), 50), rtol=1e-12)
    with pytest.raises(InputError, match="step_size = .* must be ≤"):
        CentralDifference(system, step_size=1.01 * safe)
    CentralDifference(system, step_size=0.99 * safe)


def test_a_run_is_the_same_however_it_is_cut():
    """Row by row, in one call, or resumed in a solver made after a look at another time: the same bit for bit."""
    times, rows = np.linspace(0.0, 0.02, 21), []
    system = taut_net("tension-only", *BOTH)
    whole = CentralDifference(system)
    rows.append(whole.advance(whole.start(), times).values)
    one, run = CentralDifference(system), None
    run = one.start()
    rows.append(np.vstack([one.advance(run, [t]).values for t in times]))
    run = one.start()
    first = one.advance(run, times[:7]).values
    system.at(0.013), system.force(0.013, run.x)
    for begin in (6, 7):  # from the time that it is at, and from the next
        other = CentralDifference(system)
        rows.append(np.vstack([first[:begin], other.advance(copy.deepcopy(run), times[begin:]).values]))
    for found in rows[1:]:
        np.testing.assert_array_equal(found, rows[0])


def test_a_reel_that_waits():
    """Before a table begins to change, and after it has, lengths cost no update: nothing moves, all is bit for bit."""
    web = refweb.Window(mesh="square", rows=2, columns=2, side=0.2).web()
    cable, still = refweb.Cable(law="linear", modulus=7e7, area=1e-4, density=200.0), []
    for factor in ([(0.01, 1.0), (0.02, 0.9)], [(5.0, 1.0)]):
        system = nets.system(web, cable, [reel(factor, [0])], False)
        solver = CentralDifference(system)
        run = solver.start()
        solver.advance(run, [0.005, 0.01])
        still.append(run.x.any() or run.v.any() or run.force.any() or run.work.any())
        solver.advance(run, [0.015])
    assert still == [False, False] and not run.x.any()


@pytest.mark.parametrize("kind", ["static", "dynamic"])
def test_frames_hold_the_lengths_of_their_time(tmp_path, kind):
    """Lines divided in two, reeled by different tables; the web's length is that as built."""
    solves = {"static": refweb.Static(load_steps=[0.0, 0.5, 2.0]), "dynamic": refweb.Dynamic(duration=0.02)}
    scene = refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0], [1, 1, 0]], lines=[[0, 1], [1, 2]], supports=[0, 2]),
        cable=refweb.Cable(law="linear", modulus=7e7, area=1e-4, density=200.0, subdivide=2),
        effects=[reel([(0.0, 0.9), (1.0, 0.5)], 0), reel([(0.01, 1.0), (0.02, 0.99)], [1])],
        solve=solves[kind],
        output=refweb.Output(interval=0.01, frames=1) if kind == "dynamic" else refweb.Output(),
    )
    solution = refweb.run(scene, out=tmp_path / "out")
    assert solution.web["cable_length"] == 2.0
    times = {"static": (0.0, 0.5, 2.0), "dynamic": (0.0, 0.01, 0.02)}[kind]
    for number, time in enumerate(times):
        mesh = meshio.read(tmp_path / "out" / "frames" / f"web_{number:06d}.vtu")
        data = {name: values[0] for name, values in mesh.cell_data.items()}
        factors = np.interp(time, [0, 1], [0.9, 0.5]), np.interp(time, [0.01, 0.02], [1.0, 0.99])
        np.testing.assert_allclose(data["natural_length"], np.repeat(factors, 2) / 2, rtol=1e-15)
        chord = mesh.points[mesh.cells[0].data]
        stretched = np.linalg.norm(chord[:, 1] - chord[:, 0], axis=1) / data["natural_length"]
        np.testing.assert_allclose(data["strain"], stretched - 1.0, atol=4e-16 / 0.2)
        np.testing.assert_allclose(data["tension"], 7e3 * data["strain"], rtol=1e-12, atol=7e3 * 1e-15)
    state = solution.frames[-1][1] if solution.frames else solution.state
    np.testing.assert_allclose(state.strain, data["strain"].reshape(2, 2).max(axis=1), atol=4e-16 / 0.2)


# Which lines


def test_lines_are_selected():
    web = refweb.Layers(mesh="square", layers=2, cell_area=1.0).web()
    rim = web.find_lines("rim")
    outer = np.abs(web.points[web.lines]).max(axis=2).min(axis=1)
    np.testing.assert_array_equal(rim, np.flatnonzero(outer == outer.max()))
    assert len(rim) == 12 and list(web.find_lines("all")) == list(range(len(web.lines)))
    assert list(web.find_lines([3, 1, "rim", 3])) == sorted({1, 3, *rim})
    skew = nets.skew_web()
    assert list(skew.find_lines("tie")) == [6, 7] and list(skew.find_lines(["edge", 8])) == [1, 3, 8]
    for selection, message in (
        (99, "lines = 99 must be 0 … 8"),
        (["edge", -1], r"lines\[1\] = -1 must be a whole number ≥ 0|≥ 0"),
        ("edgy", 'lines = "edgy" names no line, did you mean "edge"'),
        ("rim", "no line of this web joins two nodes of its rim"),
    ):
        with pytest.raises(InputError, match=message):
            skew.find_lines(selection)


@pytest.mark.parametrize("solver", ["newton", "relaxation"])
def test_factors_multiply(solver):
    """Three reels of one line between fixed ends: T = EA(d/(L f g h) − 1), at every load step."""
    tables = [(0.0, 1.0), (2.0, 0.8)], [(1.0, 1.0), (2.0, 1.1)], [(0.0, 0.9)]
    scene = refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0], [2, 0, 0]], lines=[[0, 1], [1, 2]], supports=[0, 1]),
        cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-4, density=200.0),
        effects=[reel(table, 0) for table in tables],
        solve=refweb.Static(load_steps=[0.0, 1.0, 1.5, 2.0], method=solver),
    )
    history = refweb.run(scene).history
    for step, tension in zip(history["step"], history["max_tension"], strict=True):
        factor = np.prod([np.interp(step, *np.transpose(table)) for table in tables])
        np.testing.assert_allclose(tension, 7e3 * (1.0 / factor - 1.0), rtol=1e-14)


def given(**changes):
    return {
        "web": {"kind": "window", "mesh": "square", "rows": 4, "columns": 4, "side": 0.2},
        "cable": {"law": "linear", "modulus": 7e7, "area": 1e-4, "density": 200.0},
        "solve": {"kind": "static"},
        "reel": [{"lines": [0, 2], "factor": [[0.0, 1.0], [1.0, 0.5]]}],
        **changes,
    }


def test_a_scene_is_read_and_written():
    scene = refweb.Scene.from_dict(given())
    assert scene.effects == (refweb.Reel(lines=(0, 2), factor=[(0.0, 1.0), (1.0, 0.5)]),)
    text = scene.to_dict()
    assert text["reel"] == [{**given()["reel"][0], "mass": "stays"}] and refweb.Scene.from_dict(text).to_dict() == text


@pytest.mark.parametrize(
    "table, message",
    [
        ({"lines": 0}, r"\[\[reel\]\] 1 factor is missing"),
        ({"factor": REELED}, r"\[\[reel\]\] 1 lines is missing"),
        ({"lines": [], "factor": REELED}, r"lines = \[\] must be at least one line"),
        ({"lines": 1.5, "factor": REELED}, "lines = 1.5 must be a line number or a name"),
        ({"lines": 0, "factor": [[0.0, 1.0], [1.0, 0.0]]}, r"\[\[reel\]\] 1 factor\[1\]\[1\] = 0 must be > 0"),
        ({"lines": 0, "factor": [[1.0, 1.0], [1.0, 0.5]]}, r"factor\[1\]\[0\] = 1.0 must be > 1"),
        ({"lines": "centre", "factor": REELED}, r'\[\[reel\]\] 1 lines = "centre"'),
        ({"lines": [0, 10**6], "factor": REELED}, r"\[\[reel\]\] 1 lines\[1\] = 1000000 must be 0 … 23"),
    ],
)
def test_refusals(table, message):
    with pytest.raises(InputError, match=message):
        refweb.Scene.from_dict(given(reel=[table])).build()
