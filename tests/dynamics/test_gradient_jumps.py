"""Gradients of dynamics across jumps of forces: damped lines that snap taut, and corners of prescribed motion."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import refweb
from refweb.errors import InputError
from refweb.reference.paths import with_value

MODULUS, AREA, TIME, SPEED, START, END = 1e7, 1e-4, 5e-3, 2.0, 0.9, 0.09
PATHS = {
    "mass": "point_mass.0.mass",
    "speed": "velocity.0.value.0",
    "modulus": "cable.modulus",
    "time": "damping.time",
    "length": "web.natural_length",
    "start": "web.points.1.0",
}
TAUT = dict(mass=1.0, speed=SPEED, modulus=MODULUS, time=TIME, length=1.0, start=START)


def observe(name, quantity, **keys):
    """An observable of node 1 along x, or of the line."""
    of = {} if quantity == "tension" else dict(node=1, component="x")
    return refweb.Observe(name=name, quantity=quantity, **of, **keys)


def flight(step, effects=(), start=START, time=TIME, **cable):
    """A mass of 1 kg that flies at 2 m/s until its damped line of 1 m, with EA/L = 1000 N/m, is taut."""
    given = dict(law="tension-only", modulus=MODULUS, area=AREA, density=0.0) | cable
    return refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [start, 0, 0]], lines=[[0, 1]], supports=[0], natural_length=1.0),
        cable=refweb.Cable(**given),
        effects=(
            refweb.PointMass(node=[1], mass=1.0),
            refweb.Velocity(node=[1], value=(SPEED, 0.0, 0.0)),
            refweb.Damping(time=time),
            *effects,
        ),
        observe=[
            observe("x", "position"),
            observe("v", "velocity"),
            observe("pull", "tension"),
            observe("top", "tension", reduce="max"),
        ],
        solve=refweb.Dynamic(duration=END, step_size=step),
        output=refweb.Output(interval=2e-3),
    )


def oscillation(mass, speed, modulus, time, length, start, end=END):
    """Position, velocity and tension at the end: after a flight the line is a spring and a dashpot."""
    stiffness, passed = modulus * AREA / length, end - (length - start) / speed
    decay = 0.5 * stiffness * time / mass
    turn = np.sqrt(stiffness / mass - decay**2)
    u = speed * np.exp(-decay * passed) * np.sin(turn * passed) / turn
    v = speed * np.exp(-decay * passed) * np.cos(turn * passed) - decay * u
    return {"x": length + u, "v": v, "pull": stiffness * (u + time * v)}


def by_complex_step(function, numbers):
    """Derivatives of what a function returns by name, by each of its numbers."""
    moved = {key: function(**{**numbers, key: value + 1e-30j}) for key, value in numbers.items()}
    return {key: {name: part.imag / 1e-30 for name, part in parts.items()} for key, parts in moved.items()}


@pytest.mark.ordinary("in a step")
@pytest.mark.parametrize("start", [START, START + 3.7e-5], ids=["at a step", "in a step"])
def test_a_damped_line_that_snaps_taut(start):
    """The damping force jumps at a time that changes with the number, and with it the derivatives of velocities."""
    solution, exact = (
        refweb.run(flight(2e-4, start=start), progress=False),
        by_complex_step(oscillation, TAUT | dict(start=start)),
    )
    solution.gradients.follow(PATHS.values())
    for key, path in PATHS.items():
        for name in ("x", "v", "pull") if start > START else ("x", "v"):  # a row at the snap has either tension
            value = exact[key][name]
            gradient = solution.gradient(name, path)
            assert abs(float(gradient) - value) <= gradient.error[0], (name, path)
        assert solution.gradient("x", path).error[0] < 0.3 * abs(exact[key]["x"]), path


@pytest.mark.ordinary("table")
@pytest.mark.parametrize(
    "cable",
    [
        dict(law="smooth", slackness=0.0, smoothing=1e-9),
        dict(law="table", modulus=None, stress=[(0.0, 0.0), (0.5, 0.5 * MODULUS)]),
    ],
    ids=["smooth", "table"],
)
def test_laws_that_snap_taut(cable):
    """A passage of slope within a step, and the first point of a curve, are as the corner of a tension-only line."""
    start = START + 3.7e-5
    solution = refweb.run(flight(2e-4, start=start, **cable), progress=False)
    exact = by_complex_step(oscillation, TAUT | dict(start=start))
    for key in ("speed", "start"):
        gradient = solution.gradient("x", PATHS[key])
        assert abs(float(gradient) - exact[key]["x"]) <= gradient.error[0] < 0.3 * abs(exact[key]["x"])


def test_a_passage_that_steps_resolve():
    """A smooth law with a passage of 5 steps has no jump: the derivative is that of the steps, to their order."""
    scene, step = flight(4e-4, law="smooth", slackness=0.0, smoothing=1e-3), 1e-6
    low, high = (
        refweb.run(refweb.Scene.from_dict(with_value(scene.to_dict(), PATHS["start"], START + s)), progress=False)
        for s in (-step, step)
    )
    wanted = (high.results["x"].value - low.results["x"].value) / (2.0 * step)
    gradient = refweb.run(scene, progress=False).gradient("x", PATHS["start"])
    assert float(gradient) == pytest.approx(wanted, rel=1e-6)


def test_a_snap_at_a_history_row():
    """Tension and its derivative are those of either side in run and refinement there: other rows are named."""
    scene = flight(2e-4)
    solve = replace(scene.solve, duration=0.12)
    scene = scene.replace(solve=solve, output=refweb.Output(interval=1e-3))
    with pytest.raises(
        InputError, match=r"at the history row of 0.05 s, .* use \[output\] interval = 0.0011 in place of 0.001"
    ):
        refweb.run(scene, progress=False).gradient("pull", PATHS["start"])
    solution = refweb.run(scene.replace(output=refweb.Output(interval=1.1e-3)), progress=False)
    gradient, step = solution.gradient("pull", PATHS["start"]), 1e-6
    low, high = (oscillation(**TAUT | dict(start=START + s * step), end=0.12)["pull"] for s in (-1.0, 1.0))
    assert abs(float(gradient) - (high - low) / (2.0 * step)) <= gradient.error[0] < 0.1 * abs(float(gradient))


def soft_snap(speed, time, start, gravity=5.0, end=0.03):
    """A mass thrown up at a slack line snaps it taut near the top of its flight and falls back, beside scipy."""
    taut = (speed - np.sqrt(speed**2 - 2.0 * gravity * (1.0 - start))) / gravity
    stiffness = MODULUS * AREA

    def slack(t, y):
        return y[0] + time * y[1]

    slack.terminal, slack.direction = True, -1
    found = solve_ivp(
        lambda t, y: [y[1], -gravity - stiffness * (y[0] + time * y[1])],
        (taut, end), [0.0, speed - gravity * taut], "DOP853", rtol=1e-12, atol=1e-15, events=slack,
    )  # fmt: skip
    left, (u, v) = end - found.t[-1], found.y[:, -1]
    return {"x": 1.0 + u + v * left - 0.5 * gravity * left**2, "v": v - gravity * left}


@pytest.mark.parametrize("phase", [1.27, 1.6, 1.88])
def test_run_and_refinement_that_agree_by_chance(phase):
    """A soft snap lies alike in the steps of both runs; ± is what a snap a step later changes, and so is sound."""
    numbers = dict(speed=np.sqrt(0.0632**2 + 1e-2), time=TIME, start=0.999 + phase * 2e-4 * 0.0632)
    scene = flight(2e-4, (refweb.Gravity(acceleration=(-5.0, 0.0, 0.0)),), numbers["start"])
    mass, _, *effects = scene.effects
    scene = scene.replace(
        effects=[mass, refweb.Velocity(node=[1], value=(numbers["speed"], 0.0, 0.0)), *effects],
        observe=scene.observe[:2],
        solve=replace(scene.solve, duration=0.03),
        output=refweb.Output(interval=3e-3),
    )
    solution = refweb.run(scene, progress=False)
    solution.gradients.follow(PATHS[key] for key in numbers)
    for key, value in numbers.items():
        step = 1e-6 if key == "start" else 1e-4 * value
        low, high = (soft_snap(**{**numbers, key: value + s * step}) for s in (-1.0, 1.0))
        for name in low:
            gradient, exact = solution.gradient(name, PATHS[key]), (high[name] - low[name]) / (2.0 * step)
            assert abs(float(gradient) - exact) <= gradient.error[0] < 0.1 * abs(exact), (name, key)


def test_the_largest_tension_is_that_of_the_snap():
    """With much damping it is EA/L τ v at the instant at which the line is taut, v² = v0² + 2 F (L − x0)/m."""
    load, numbers = refweb.Load(node=[1], force=(3.0, 0.0, 0.0)), TAUT | dict(time=0.08, force=3.0)
    numbers["start"] = START + 7.1e-6

    def snap(mass, speed, modulus, time, length, start, force):
        return {"top": modulus * AREA / length * time * np.sqrt(speed**2 + 2.0 * force * (length - start) / mass)}

    solution = refweb.run(flight(2e-4, (load,), numbers["start"], numbers["time"]), progress=False)
    result, exact = solution.results["top"], by_complex_step(snap, numbers)
    assert result.value == pytest.approx(snap(**numbers)["top"], rel=0.01)  # the run has order 1 here
    solution.gradients.follow([*PATHS.values(), "load.0.force.0"])
    for key, path in (PATHS | {"force": "load.0.force.0"}).items():
        gradient = solution.gradient("top", path)
        assert abs(float(gradient) - exact[key]["top"]) <= gradient.error[0] < 2.0 * abs(exact[key]["top"]), path


def between_slack_lines(mass, speed, time, length):
    """Motion of a mass between two slack damped lines, by scipy with events: it snaps one taut, then the other."""
    stiffness, end = MODULUS * AREA / length, 0.4

    def pull(u, rate):
        return max(stiffness * (u + time * rate), 0.0) if u > 0.0 else 0.0

    def rate(t, y):
        return [y[1], (pull(-1.0 - length + 2.0 - y[0], -y[1]) - pull(1.0 + y[0] - length, y[1])) / mass]

    at, y, bounds = 0.0, [0.0, speed], [lambda t, y: 1.0 + y[0] - length, lambda t, y: 1.0 - y[0] - length]
    while at < end:  # to the next instant at which a line comes to its natural length
        for bound in bounds:
            bound.terminal = True
        found = solve_ivp(rate, (at, end), y, "DOP853", rtol=1e-12, atol=1e-13, events=bounds, max_step=1e-2)
        at, y = found.t[-1], found.y[:, -1] + [1e-13 * np.sign(found.y[1, -1]), 0.0]
    return {"x": y[0], "v": y[1]}


@pytest.mark.slow
def test_one_line_after_the_other():
    """A mass snaps one line taut, is thrown back and snaps the other: beside scipy with events, within ±."""
    numbers = dict(mass=1.0, speed=SPEED, time=2e-3, length=1.05)
    scene = flight(2e-4, time=numbers["time"])
    web = refweb.Inline(
        points=[[-1, 0, 0], [0, 0, 0], [1, 0, 0]], lines=[[0, 1], [1, 2]], supports=[0, 2], natural_length=1.05
    )
    scene = scene.replace(web=web, solve=replace(scene.solve, duration=0.4), observe=scene.observe[:2])
    solution = refweb.run(scene, progress=False)
    for key, value in numbers.items():
        step = 1e-4 * value
        low, high = (between_slack_lines(**{**numbers, key: value + s * step}) for s in (-1.0, 1.0))
        for name in low:
            gradient, exact = solution.gradient(name, PATHS[key]), (high[name] - low[name]) / (2.0 * step)
            assert abs(float(gradient) - exact) <= gradient.error[0], (name, key)
            if name == "x":
                assert gradient.error[0] < 0.1 * max(abs(exact), solution.results["x"].value / value), key


@pytest.mark.slow
def test_a_line_at_its_natural_length_that_snaps_taut_at_the_start():
    """It is damped from the start, or later, as a length rises or falls: refused; the speed changes no time."""
    solution = refweb.run(flight(2e-4, start=1.0), progress=False)
    gradient, exact = solution.gradient("x", PATHS["speed"]), by_complex_step(oscillation, TAUT | dict(start=1.0))
    assert abs(float(gradient) - exact["speed"]["x"]) <= gradient.error[0] < 1e-4
    for key in ("length", "start"):
        with pytest.raises(InputError, match="at 0 s line 0 is neither slack nor taut, and its damping force jumps; a"):
            solution.gradient("x", PATHS[key])


def at_rest(effect):
    """A mass at rest at 0.9 m on a damped line of 1 m that a table makes just taut in 50 ms."""
    scene = flight(2e-4, (effect,))
    return scene.replace(effects=[scene.effects[0], *scene.effects[2:]])


PULLED = [(0.0, 0.0, 0.0, 0.0), (0.05, -0.1, 0.0, 0.0)]
JUST_TAUT = {
    "pulled": refweb.Motion(node=[0], displacement=[*PULLED, (0.2, -0.1, 0.0, 0.0)]),
    "reeled": refweb.Reel(lines=[0], factor=[(0.0, 1.0), (0.05, 0.9), (0.2, 0.9)]),
}


@pytest.mark.ordinary("pulled")
@pytest.mark.parametrize("effect", JUST_TAUT.values(), ids=JUST_TAUT)
def test_a_line_that_is_just_taut_from_a_corner_on(effect):
    """A shorter line pulls the mass before the corner, and a longer one never does: refused; EA changes no time."""
    scene = at_rest(effect)
    solution = refweb.run(scene.replace(solve=replace(scene.solve, duration=0.06)), progress=False)
    solution.gradients.follow(PATHS[key] for key in ("start", "length", "modulus"))
    for name, key in (("x", "start"), ("top", "start"), ("x", "length")):
        with pytest.raises(InputError, match="at 0.05 s line 0 is neither slack nor taut, and its damping force jumps"):
            solution.gradient(name, PATHS[key])
    gradient = solution.gradient("x", PATHS["modulus"])
    assert abs(float(gradient)) <= gradient.error[0] < 1e-3 / MODULUS


def test_a_line_that_snaps_taut_at_a_corner():
    """Its end is pulled on at half the speed: beside its end, which moves on evenly, the mass is on a dashpot."""
    effect = refweb.Motion(node=[0], displacement=[*PULLED, (0.15, -0.2, 0.0, 0.0)])
    solution = refweb.run(at_rest(effect), progress=False)
    exact = by_complex_step(oscillation, TAUT | dict(speed=1.0, start=START + 0.05))  # 50 ms of flight at 1 m/s
    for key in ("start", "length"):
        gradient = solution.gradient("x", PATHS[key])
        assert abs(float(gradient) - exact[key]["x"]) <= gradient.error[0] < 0.1, key


@pytest.mark.slow
def test_a_contact_with_losses_begins_without_a_jump():
    """A ball that meets what is fixed at v: m z'' = k δ max(1 + d δ', 0), whose force begins at 0, beside scipy."""
    numbers = {"body.0.position.2": 0.11, "body.0.velocity.2": -2.0, "contact.damping": 0.3}

    def end_of(place, speed, damping):
        def rate(t, y):
            depth = max(0.1 - y[0], 0.0)
            return [y[1], 2e3 * depth * max(1.0 - damping * y[1], 0.0) / 0.5]

        return solve_ivp(rate, (0.0, 0.02), [place, speed], "DOP853", rtol=1e-11, atol=1e-13, max_step=1e-4).y[0, -1]

    scene = refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0, 1]),
        cable=refweb.Cable(law="linear", modulus=1e9, area=1e-6, density=1000.0),
        effects=(
            refweb.Body(
                name="ball", shape="sphere", radius=0.1, mass=0.5, position=(0.5, 0, 0.11), velocity=(0, 0, -2)
            ),
            refweb.Contact(stiffness=2e3, damping=0.3),
        ),
        observe=[refweb.Observe(name="z", quantity="position", body="ball", component="z")],
        solve=refweb.Dynamic(duration=0.02, step_size=2e-5),
    )
    solution = refweb.run(scene, progress=False)
    for n, (path, value) in enumerate(numbers.items()):
        step = 1e-3 * value
        low, high = (end_of(*(p + s * step * (k == n) for k, p in enumerate(numbers.values()))) for s in (-1.0, 1.0))
        gradient, exact = solution.gradient("z", path), (high - low) / (2.0 * step)
        assert abs(float(gradient) - exact) <= gradient.error[0] + 1e-5 * abs(exact) < 0.02 * abs(exact), path


def moved(rows, duration, **keys):
    """A mass on a damped bar whose end is moved by a table."""
    return refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0], natural_length=0.9),
        cable=refweb.Cable(law="linear", modulus=1e6, area=1e-4, density=0.0),
        effects=(
            refweb.PointMass(node=[1], mass=1.0),
            refweb.Damping(time=1e-2),
            refweb.Motion(node=[0], displacement=rows),
        ),
        observe=[
            observe("pull", "tension", **keys),
            observe("v", "velocity"),
            refweb.Observe(name="end", quantity="velocity", node=0),
        ],
        solve=refweb.Dynamic(duration=duration, step_size=5e-4),
        output=refweb.Output(interval=0.01),
    )


CORNERS = {
    "at the end": ([(0.0, 0.0, 0.0, 0.0), (0.2, -0.1, 0.0, 0.0)], 0.2, {}),
    "before it": ([(0.0, 0.0, 0.0, 0.0), (0.02, -0.02, 0.0, 0.0)], 0.05, dict(reduce="max")),
    "behind it": ([(0.0, 0.0, 0.0, 0.0), (0.005, 0.005, 0.0, 0.0)], 0.02, dict(reduce="max")),
}


@pytest.mark.parametrize(("rows", "duration", "keys"), CORNERS.values(), ids=CORNERS)
def test_corners_of_prescribed_motion(rows, duration, keys):
    """Results and derivatives are of the same side of a corner: a bar is linear in what its end is moved by.

    A run with a larger displacement has the value plus the derivative times the difference, to rounding.
    """
    path, scene = "motion.0.displacement.1.1", moved(rows, duration, **keys)
    solution, step = refweb.run(scene, progress=False), 1e-3 * rows[1][1]
    assert not keys or solution.results["pull"].time == pytest.approx(rows[1][0], rel=1e-6)
    again = refweb.run(
        refweb.Scene.from_dict(with_value(scene.to_dict(), path, rows[1][1] + step), scene.folder), progress=False
    )
    for name in ("pull", "v"):
        gained = again.results[name].value - solution.results[name].value
        assert float(solution.gradient(name, path)) == pytest.approx(gained / step, rel=1e-7)
    assert solution.results["end"].value == 0.0 == float(solution.gradient("end", path))  # it is held behind it


@pytest.mark.slow
def test_a_corner_of_a_natural_length():
    """A bar that is reeled in until 20 ms is damped until then: largest tension and derivative are before it."""
    scene = moved([(0.0, 0.0, 0.0, 0.0)], 0.05, reduce="max")
    reel = refweb.Reel(lines=[0], factor=[(0.0, 1.0), (0.02, 0.98)])
    scene = scene.replace(effects=(*scene.effects[:2], reel), observe=[scene.observe[0]])
    scene = scene.replace(web=replace(scene.web, points=[[0, 0, 0], [1, 0, 0]]))
    solution, step = refweb.run(scene, progress=False), 1e-5
    assert solution.results["pull"].time == pytest.approx(0.02, rel=1e-4)
    for path, at in (("damping.time", 1e-2), ("reel.0.factor.1.1", 0.98)):
        low, high = (
            refweb.run(refweb.Scene.from_dict(with_value(scene.to_dict(), path, at * (1.0 + s * step))), progress=False)
            for s in (-1.0, 1.0)
        )
        wanted = (high.results["pull"].value - low.results["pull"].value) / (2.0 * step * at)
        gradient = solution.gradient("pull", path)
        assert float(gradient) == pytest.approx(wanted, rel=1e-3), path  # the peak is on a polynomial of the last step


def test_a_least_speed_that_is_kept():
    """A mass at rest on a slack line, pushed or pulled: least speeds of 0 and v0 have derivatives of 0 and −1.

    A push makes the line taut, and the mass turns back at T/4; which of the times counts is not told at rest.
    """
    scene = flight(1e-3, start=1.0)
    rest = refweb.Velocity(node=[1], value=(0.0, 0.0, 0.0))
    least = refweb.Observe(name="least", quantity="velocity", node=1, reduce="min")
    scene = scene.replace(effects=(scene.effects[0], rest), observe=[least])
    solution = refweb.run(scene, progress=False)
    with pytest.raises(InputError, match='"least" by velocity.0.value.0: it keeps 0 m/s for a time, in which its der'):
        solution.gradient("least", PATHS["speed"])


def test_a_refusal_names_smaller_steps():
    """A mass on a damped string that snaps taut: with long steps a derivative has no digit, with short ones it does."""
    scene = flight(None)
    scene = scene.replace(
        web=refweb.Inline(points=[[0, 0, 0], [0.3, 0, -1.0]], lines=[[0, 1]], supports=[0], natural_length=1.5),
        cable=replace(scene.cable, modulus=1e6, area=1e-3),
        effects=(
            scene.effects[0],
            refweb.Velocity(node=[1], value=(0.5, 0.0, 1.0)),
            refweb.Damping(time=1e-3, rate=0.1),
            refweb.Gravity(acceleration=(0.0, 0.0, -9.81)),
        ),
        observe=[refweb.Observe(name="energy", quantity="total_energy")],
        solve=refweb.Dynamic(duration=0.9),
        output=refweb.Output(interval=0.01),
    )
    with pytest.raises(
        InputError, match=r"with these steps: use \[solve\] safety = 0.05 or less in place of 0.5; where"
    ):
        refweb.run(scene, progress=False).gradient("energy", PATHS["length"])
