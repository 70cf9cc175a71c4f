"""Gradients of dynamics: closed forms, Taylor remainders, variational equations, ± that covers, refusals."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

import refweb
from refweb.__main__ import main
from refweb.dynamics.integrators.tangent import mean_decay
from refweb.errors import InputError
from refweb.reference.paths import with_value

POINTS = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.4, 0.45, 0], [0.6, 0.55, 0]]
LINES = [[0, 4], [3, 4], [1, 5], [2, 5], [4, 5]]
PRESSED = (
    refweb.Body(
        name="ball", shape="sphere", radius=0.3, mass=0.5, position=(0.5, 0.5, 0.28), velocity=(0.1, 0.2, -0.5)
    ),
    refweb.Contact(stiffness=300.0),
    refweb.Gravity(acceleration=(0.0, 0.0, -30.0)),
)
"""A ball that presses on the middle of the net from the start on."""
OBSERVE = [
    refweb.Observe(name="moved", quantity="displacement", node=4),
    refweb.Observe(name="speed", quantity="velocity", node=5, component="z"),
    refweb.Observe(name="place", quantity="position", node=5, component="x"),
    refweb.Observe(name="tension", quantity="tension", line=0),
    refweb.Observe(name="stress", quantity="stress", line=3),
    refweb.Observe(name="strain", quantity="strain", line=2),
    refweb.Observe(name="reaction", quantity="reaction", node=[0, 1], component="z"),
    refweb.Observe(name="apart", quantity="distance", node=[4, 5]),
    refweb.Observe(name="moving", quantity="kinetic_energy"),
    refweb.Observe(name="stored", quantity="strain_energy"),
]
LAWS = {
    "tension-only": {},
    "smooth": dict(slackness=1e-3, smoothing=2e-3),
    "linear": {},
    "table": dict(modulus=None, stress=[(0.0, 0.0), (0.02, 4e4), (0.1, 4e5)]),
}


def net(law="tension-only", effects=(), observe=(), cable=None, **solve):
    """Two nodes of a plane net in tension that swing for 0.1 s, by steps of one size."""
    given = dict(law=law, modulus=4e6, area=1e-5, density=500.0, prestrain=0.05, subdivide=2)
    given |= LAWS[law] | (cable or {})
    masses = refweb.PointMass(node=[4, 5], mass=0.1), refweb.Velocity(node=[4], value=(0.4, -0.3, 0.8))
    return refweb.Scene(
        web=refweb.Inline(points=POINTS, lines=LINES, supports=[0, 1, 2, 3]),
        cable=refweb.Cable(**given),
        effects=(*masses, *effects),
        observe=[*OBSERVE, *observe],
        solve=refweb.Dynamic(**{"duration": 0.1, "step_size": 2e-4, **solve}),
        output=refweb.Output(interval=2e-3),
        accuracy=refweb.Accuracy(error="none"),
    )


def again(scene, path, number):
    """The solution with another number at a path."""
    return refweb.run(refweb.Scene.from_dict(with_value(scene.to_dict(), path, number), scene.folder), progress=False)


CASES = [  # law, effects, paths
    ("tension-only", (), ["cable.modulus", "cable.area", "cable.prestrain", "web.points.4.1", "velocity.0.value.2"]),
    ("smooth", (), ["cable.density", "cable.smoothing", "point_mass.0.mass"]),
    ("linear", (refweb.Damping(time=2e-3),), ["damping.time", "cable.modulus", "cable.density"]),
    ("table", (refweb.Load(node=[5], force=(0.0, 1.0, 2.0)),), ["load.0.force.2", "cable.area", "cable.prestrain"]),
    ("smooth", PRESSED, ["body.0.mass", "body.0.velocity.1", "contact.stiffness"]),
    (
        "tension-only",
        (refweb.Drag(density=1000.0, normal=2.0, tangential=0.1, diameter=0.02),),
        ["drag.normal", "cable.area"],
    ),
    ("linear", (refweb.Frame(angular_velocity=(0.0, 0.0, 3.0)),), ["frame.angular_velocity.2", "point_mass.0.mass"]),
    (
        "linear",
        (refweb.Motion(node=[0], displacement=[(0.0, 0.0, 0.0, 0.0), (0.07, 0.0, 0.02, -0.05)]),),
        ["motion.0.displacement.1.3"],
    ),
    ("linear", (refweb.Reel(lines=[0], factor=[(0.0, 1.0), (0.2, 0.97)]),), ["reel.0.factor.1.1", "cable.area"]),
]


@pytest.mark.ordinary(
    "tension-only-cable.modulus",
    "table-load.0.force.2",
    "tension-only-drag.normal",
    "linear-motion.0.displacement.1.3",
    "linear-reel.0.factor.1.1",
)
@pytest.mark.parametrize(("law", "effects", "paths"), CASES, ids=[f"{law}-{paths[0]}" for law, _, paths in CASES])
def test_taylor_remainders(law, effects, paths):
    """|J(p + h) − J(p) − h dJ/dp| falls as h² of each result: the slope is 2 unless rounding is left."""
    observe = (
        [refweb.Observe(name="height", quantity="position", body="ball", component="z")] if effects == PRESSED else []
    )
    scene = net(law, effects, observe)
    solution = refweb.run(scene, progress=False)
    solution.gradients.follow(paths)
    for path in paths:
        gradients = {name: solution.gradient(name, path) for name in solution.results}
        number = gradients["moved"].number
        left = {name: [] for name in gradients}
        for step in (4e-4, 2e-4):
            step *= abs(number) or 0.1
            changed = again(scene, path, number + step).results
            for name, gradient in gradients.items():
                value = solution.results[name].value
                left[name].append(abs(changed[name].value - value - step * float(gradient)))
        for name, (wide, narrow) in left.items():
            small = 3e-12 * max(abs(solution.results[name].value), 1e-3)  # rounding of 500 steps, in both runs
            small += 1e-8 * step * abs(float(gradients[name]))  # that of differences of data and of values
            assert narrow < small or 1.8 < np.log2(wide / narrow) < 2.3, (path, name, wide, narrow)


def spring(mass=0.5, speed=0.3, duration=1.3, **solve):
    """A mass on one line with a stiffness of 10 N/m, which it pulls at the start."""
    return refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0]),
        cable=refweb.Cable(law="linear", modulus=1e6, area=1e-5, density=0.0),
        effects=(refweb.PointMass(node=[1], mass=mass), refweb.Velocity(node=[1], value=(speed, 0.0, 0.0))),
        observe=[
            refweb.Observe(name="x", quantity="displacement", node=1, component="x"),
            refweb.Observe(name="top", quantity="tension", reduce="max"),
            refweb.Observe(name="energy", quantity="total_energy"),
        ],
        solve=refweb.Dynamic(duration=duration, **solve),
        output=refweb.Output(interval=0.02),
    )


def test_oscillator():
    """x = v0 sin(ωt)/ω: its derivatives by k, m and v0, and those of the largest tension v0 √(km), lie within ±."""
    k, m, v, t = 10.0, 0.5, 0.3, 1.3
    w = np.sqrt(k / m)
    by_w = v * (t * np.cos(w * t) / w - np.sin(w * t) / w**2)
    exact = {
        ("x", "cable.modulus"): by_w * 0.5 * w / k * 1e-5,
        ("x", "point_mass.0.mass"): -by_w * 0.5 * w / m,
        ("x", "velocity.0.value.0"): np.sin(w * t) / w,
        ("top", "cable.modulus"): 0.5 * v * np.sqrt(m / k) * 1e-5,
        ("top", "velocity.0.value.0"): np.sqrt(k * m),
        ("top", "point_mass.0.mass"): 0.5 * v * np.sqrt(k / m),
        ("energy", "velocity.0.value.0"): m * v,
        ("energy", "cable.modulus"): 0.0,
    }
    coarse, fine = (refweb.run(spring(step_size=step), progress=False) for step in (4e-3, 2e-3))
    for (result, path), value in exact.items():
        off = []
        for solution in (coarse, fine):
            gradient = solution.gradient(result, path)
            off.append(abs(float(gradient) - value))
            assert off[-1] <= gradient.error[0], (result, path)
        if result == "x":  # the method has order 2
            assert 3.5 < off[0] / off[1] < 4.5
    assert coarse.gradient("top", "cable.modulus").unit == "N per Pa"


def test_a_start_at_equilibrium():
    """A mass that hangs on a spring and is struck: z = −m g/k + v0 sin(ωt)/ω, with the change of its rest."""
    scene = refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [0, 0, -1]], lines=[[0, 1]], supports=[0]),
        cable=refweb.Cable(law="tension-only", modulus=1e6, area=1e-5, density=0.0),
        effects=(
            refweb.PointMass(node=[1], mass=0.05),
            refweb.Gravity(acceleration=(0.0, 0.0, -9.81)),
            refweb.Velocity(node=[1], value=(0.0, 0.0, -0.1)),
        ),
        observe=[refweb.Observe(name="z", quantity="displacement", node=1, component="z")],
        solve=refweb.Dynamic(duration=0.5, step_size=1e-3, start="equilibrium"),
        output=refweb.Output(interval=0.01),
    )
    solution = refweb.run(scene, progress=False)
    k, m, g, v, t = 10.0, 0.05, 9.81, -0.1, 0.5
    w = np.sqrt(k / m)
    by_w = v * (t * np.cos(w * t) / w - np.sin(w * t) / w**2)
    exact = {
        "cable.modulus": 1e-5 * (m * g / k**2 + by_w * 0.5 * w / k),
        "point_mass.0.mass": -g / k - by_w * 0.5 * w / m,
        "gravity.acceleration.2": m / k,
        "velocity.0.value.2": np.sin(w * t) / w,
    }
    for path, value in exact.items():
        gradient = solution.gradient("z", path)
        assert abs(float(gradient) - value) <= gradient.error[0] <= 0.01 * abs(value), path


def test_a_ball_that_falls_on_one_spring():
    """A ball that meets what is fixed has the largest force v √(km): derivatives F/v, F/2m and F/2k."""
    scene = refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0, 1]),
        cable=refweb.Cable(law="linear", modulus=1e9, area=1e-6, density=1000.0),
        effects=(
            refweb.Body(
                name="ball", shape="sphere", radius=0.1, mass=0.5, position=(0.5, 0, 0.11), velocity=(0, 0, -2)
            ),
            refweb.Contact(stiffness=1e3),
        ),
        observe=[refweb.Observe(name="force", quantity="reaction", body="ball", reduce="max")],
        solve=refweb.Dynamic(duration=0.05, safety=0.02),
        output=refweb.Output(interval=2e-3),
    )
    solution = refweb.run(scene, progress=False)
    force = solution.results["force"]
    for path, share in (("body.0.velocity.2", 1.0), ("body.0.mass", 0.5), ("contact.stiffness", 0.5)):
        gradient = solution.gradient("force", path)
        exact = share * force.value / gradient.number
        assert abs(float(gradient) - exact) <= gradient.error[0] + abs(exact) * force.error / force.value
        assert gradient.error[0] < 0.05 * abs(exact)


def test_a_stiffness_that_refweb_chose():
    """It goes as the energy of the ball, m v²/2, and does not know the tension of the line: a note says so.

    The derivative is that at this stiffness k, with the largest force v √(km) on what is fixed.
    """
    ball = refweb.Body(name="ball", shape="sphere", radius=0.1, mass=0.5, position=(0.5, 0, 0.11), velocity=(0, 0, -2))
    scene = refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0, 1]),
        cable=refweb.Cable(law="linear", modulus=1e9, area=1e-6, density=1000.0),
        effects=(ball, refweb.Contact()),
        observe=[refweb.Observe(name="force", quantity="reaction", body="ball", reduce="max")],
        solve=refweb.Dynamic(duration=0.01, safety=0.02),
        output=refweb.Output(interval=1e-3),
    )
    solution = refweb.run(scene, progress=False)
    force, gradient = solution.results["force"].value, solution.gradient("force", "body.0.mass")
    assert abs(float(gradient) - 0.5 * force / 0.5) <= gradient.error[0] < 0.05 * force
    (note,) = gradient.notes
    k = solution.scene.contact.law_of(ball)[0]
    assert note.startswith(f'stiffness = {k:g} of the contact of body "ball" is one that refweb chose by this number')
    assert not solution.gradient("force", "cable.density").notes
    given = refweb.run(scene.replace(effects=(ball, refweb.Contact(stiffness=k))), progress=False)
    again = given.gradient("force", "body.0.mass")
    assert not again.notes and float(again) == float(gradient)


def on_a_rail(duration, step, contact, velocity, height, observe):
    """A ball on one line whose ends are held, under gravity."""
    return refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [3, 0, 0]], lines=[[0, 1]], supports=[0, 1]),
        cable=refweb.Cable(law="linear", modulus=1e9, area=1e-6, density=1000.0),
        effects=(
            refweb.Body(
                name="ball", shape="sphere", radius=0.1, mass=0.5, position=(0.5, 0, height), velocity=velocity
            ),
            contact,
            refweb.Gravity(acceleration=(0.0, 0.0, -9.81)),
        ),
        observe=[
            refweb.Observe(
                name="place" if len(observe) == 1 else axis, quantity="position", body="ball", component=axis
            )
            for axis in observe
        ],
        solve=refweb.Dynamic(duration=duration, step_size=step),
        output=refweb.Output(interval=5e-3),
    )


@pytest.mark.ordinary("sliding")
@pytest.mark.parametrize("duration", [0.1, 0.4], ids=["sliding", "rolling"])
def test_friction(duration):
    """A ball slides until it rolls: x'' = −μ g q, slip u' = −μ g (1 + m a²/I) q, q = u/√(u² + v_s²), as in scipy."""
    friction, speed, slow, g, stiffness = 0.2, 1.0, 0.05, 9.81, 1e5
    lever = 0.1 - 0.5 * g / stiffness
    faster = 1.0 + lever**2 / (0.4 * 0.1**2)

    def rate(t, y):
        """x, v, u, and their derivatives by μ and by the first speed."""
        x, v, u, *moves = y
        parts = []
        for du, by in ((0.0, 0.0), (moves[2], 1.0), (moves[5], 0.0)):
            slip, rub = u + 1e-30j * du, friction + 1e-30j * by
            parts.append(-rub * g * slip / np.sqrt(slip**2 + slow**2))
        slopes = [v, parts[0].real, faster * parts[0].real]
        for n in (1, 2):
            change = parts[n].imag / 1e-30
            slopes += [moves[3 * n - 2], change, faster * change]
        return slopes

    start = [0.0, speed, speed, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0]
    end = solve_ivp(rate, (0.0, duration), start, method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
    if duration == 0.1:  # with no slip velocity −½ g t² and t
        assert end[3] == pytest.approx(-0.5 * g * duration**2, rel=0.01) and end[6] == pytest.approx(duration, rel=0.01)
    off = []
    for step in (8e-4, 4e-4):
        contact = refweb.Contact(stiffness=stiffness, friction=friction, slip_velocity=slow)
        solution = refweb.run(on_a_rail(duration, step, contact, (speed, 0.0, 0.0), lever, "x"), progress=False)
        solution.gradients.follow(["contact.friction", "body.0.velocity.0"])
        off.append([])
        for path, exact in (("contact.friction", end[3]), ("body.0.velocity.0", end[6])):
            gradient = solution.gradient("place", path)
            off[-1].append(abs(float(gradient) - exact))
            assert off[-1][-1] <= gradient.error[0] + 1e-8
    assert 3.0 < np.linalg.norm(off[0]) / np.linalg.norm(off[1]) < 5.0


def test_a_flight_before_a_rubbing_contact():
    """A ball with friction and damping of contact flies 1 cm before it touches: no cell acts, and x = x0 + v t."""
    contact = refweb.Contact(stiffness=1e4, friction=0.3, damping=0.1)
    solution = refweb.run(on_a_rail(0.02, 2e-4, contact, (0.5, 0.0, -0.6), 0.11, "xz"), progress=False)
    flying = refweb.run(on_a_rail(0.01, 2e-4, contact, (0.5, 0.0, -0.6), 0.11, "xz"), progress=False)
    assert float(flying.gradient("x", "body.0.velocity.0")) == pytest.approx(0.01, rel=1e-6)
    assert float(flying.gradient("z", "body.0.velocity.2")) == pytest.approx(0.01, rel=1e-6)
    gradient, step = solution.gradient("z", "body.0.velocity.2"), 1e-4
    scene = on_a_rail(0.02, 2e-4, contact, (0.5, 0.0, -0.6), 0.11, "xz")
    ends = [again(scene, "body.0.velocity.2", -0.6 + sign * step).results["z"].value for sign in (-1, 1)]
    assert abs((ends[1] - ends[0]) / (2.0 * step) - float(gradient)) <= gradient.error[0]


def test_damping_of_contact():
    """A ball that falls on m z'' = k δ max(1 + d δ', 0) − m g, beside its variational equation in scipy: order 2."""
    k, d, m, g, end = 2e3, 0.3, 0.5, 9.81, 0.06

    def rate(t, y):
        """z, z' and their derivatives by d; the ball starts in touch and stays there."""
        (z, v), moves = y[:2], y[2:]

        def force(z, v, d):
            return k * (0.1 - z) * (1.0 - d * v) / m - g

        change = force(z + 1e-30j * moves[0], v + 1e-30j * moves[1], d + 1e-30j).imag / 1e-30
        return [v, force(z, v, d), moves[1], change]

    exact = solve_ivp(rate, (0.0, end), [0.1 - 1e-9, -0.5, 0.0, 0.0], rtol=1e-10, atol=1e-13).y[:, -1]
    assert exact[0] < 0.1
    off = []
    for step in (4e-4, 2e-4):
        contact = refweb.Contact(stiffness=k, damping=d)
        solution = refweb.run(on_a_rail(end, step, contact, (0.0, 0.0, -0.5), 0.1 - 1e-9, "z"), progress=False)
        gradient = solution.gradient("place", "contact.damping")
        off.append(abs(float(gradient) - exact[2]))
        assert off[-1] <= gradient.error[0]
    assert 3.0 < off[0] / off[1] < 5.0


@pytest.mark.slow
def test_variational_equations():
    """Two masses in space on damped lines under gravity, beside their variational equations in scipy: order 2."""
    points, lines = np.array([[0.0, 0, 0], [1, 0, 0], [1.6, 0.5, 0]]), [(0, 1), (1, 2)]
    lengths = [np.linalg.norm(points[j] - points[i]) for i, j in lines]
    ea, tau, m, start = 40.0, 2e-3, np.array([0.3, 0.2]), [0.2, 0.5, -0.3]

    def force(x, v, ea):
        pulls, at, speed = np.zeros((3, 3), dtype=complex), points + 0j, np.zeros((3, 3), dtype=complex)
        at[1:], speed[1:] = at[1:] + x.reshape(2, 3), v.reshape(2, 3)
        for (i, j), length in zip(lines, lengths, strict=True):
            d = at[j] - at[i]
            size = np.sqrt((d * d).sum())
            rate = (d * (speed[j] - speed[i])).sum() / size / length
            pull = ea * (size / length - 1.0 + tau * rate) * d / size
            pulls[i], pulls[j] = pulls[i] + pull, pulls[j] - pull
        return ((pulls[1:] + m[:, None] * [0.0, 0.0, -9.81]) / m[:, None]).ravel()

    def rate(t, y):
        """x, v and δx, δv by EA and by the first speed; the directions are those of a complex step."""
        x, v, *moves = y.reshape(6, 6)
        parts = [v, force(x, v, ea).real]
        for (dx, dv), by in zip((moves[:2], moves[2:]), (1.0, 0.0), strict=True):
            parts += [dv, force(x + 1e-30j * dx, v + 1e-30j * dv, ea + 1e-30j * by).imag / 1e-30]
        return np.concatenate(parts)

    y = np.zeros((6, 6))
    y[1, 3:], y[5, 3] = start, 1.0
    end = solve_ivp(rate, (0.0, 0.6), y.ravel(), method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1].reshape(6, 6)
    scene = refweb.Scene(
        web=refweb.Inline(points=points.tolist(), lines=lines, supports=[0]),
        cable=refweb.Cable(law="linear", modulus=ea / 1e-4, area=1e-4, density=0.0),
        effects=(
            *(refweb.PointMass(node=[n + 1], mass=float(m[n])) for n in range(2)),
            refweb.Velocity(node=[2], value=tuple(start)),
            refweb.Gravity(acceleration=(0.0, 0.0, -9.81)),
            refweb.Damping(time=tau),
        ),
        observe=[
            refweb.Observe(name=f"{quantity} {axis}", quantity=quantity, node=2, component=axis)
            for quantity in ("displacement", "velocity")
            for axis in "xyz"
        ],
        solve=refweb.Dynamic(duration=0.6, step_size=1e-3),
        output=refweb.Output(interval=0.02),
    )
    off = []
    for step in (8e-4, 4e-4):
        solution = refweb.run(scene.replace(solve=replace(scene.solve, step_size=step)), progress=False)
        solution.gradients.follow(["cable.area", "velocity.0.value.0"])
        off.append([])
        for row, name in enumerate(("displacement", "velocity")):
            for k, axis in enumerate("xyz"):
                for first, path, scale in ((2, "cable.area", ea / 1e-4), (4, "velocity.0.value.0", 1.0)):
                    gradient, exact = solution.gradient(f"{name} {axis}", path), scale * end[first + row, 3 + k]
                    off[-1].append(abs(float(gradient) - exact) / scale)
                    assert abs(float(gradient) - exact) <= gradient.error[0]
    assert 3.5 < np.linalg.norm(off[0]) / np.linalg.norm(off[1]) < 4.5


def test_one_sided_where_lines_share_the_largest_value():
    """A mass between two equal lines that falls straight: moved to a side, one line or the other is the tighter."""
    scene = refweb.Scene(
        web=refweb.Inline(points=[[-1, 0, 0], [1, 0, 0], [0, 0, 0]], lines=[[0, 2], [1, 2]], supports=[0, 1]),
        cable=refweb.Cable(law="tension-only", modulus=1e6, area=1e-6, density=1000.0),
        effects=(
            refweb.PointMass(node=[2], mass=0.1),
            refweb.Velocity(node=[2], value=(0.0, 0.0, -1.0)),
            refweb.Load(node=[2], force=(0.0, 0.0, -1.0)),
        ),
        observe=[refweb.Observe(name="top", quantity="tension", reduce="max")],
        solve=refweb.Dynamic(duration=0.5, safety=0.1),
        output=refweb.Output(interval=5e-3),
    )
    solution = refweb.run(scene, progress=False)
    aside, down = solution.gradient("top", "load.0.force.0"), solution.gradient("top", "load.0.force.2")
    assert down.left is None and float(down) < 0.0
    assert float(aside) > 0.0 and aside.left[0] == pytest.approx(-float(aside))  # by symmetry
    gained = again(scene, "load.0.force.0", 1e-4).results["top"].value - solution.results["top"].value
    assert gained == pytest.approx(1e-4 * float(aside), rel=0.02)  # the second order of a large sag


@pytest.mark.slow
def test_a_ring_that_slides_on_a_thread():
    """On an ellipse with the half axes 1 and b = 0.8 m from φ = 0.5 on, v²/2 = b g (1 − cos φ) − p sin φ at its lowest.

    By the force p aside v has −sin φ/v, by gravity v/(2 g); the height has no derivative but by the stretch of the
    thread, which is some 1e-5 of the pull.
    """
    solution, phi, g = refweb.run(refweb.Scene.load("ring-on-thread"), progress=False), 0.5, 9.81
    v = np.sqrt(2.0 * 0.8 * g * (1.0 - np.cos(phi)))
    for path, exact in (("gravity.acceleration.0", -np.sin(phi) / v), ("gravity.acceleration.2", -0.5 * v / g)):
        speed, lowest = solution.gradient("speed", path), solution.gradient("lowest", path)
        assert abs(float(speed) - exact) <= speed.error[0] + 1e-5 and speed.error[0] < 1e-3 * abs(exact)
        assert abs(float(lowest)) <= lowest.error[0] + 1e-5 < 1e-4


def pushed_spring(step_size, *effects):
    """The oscillator of two largest excursions, and a load of p t/0.4 up to 0.4 s and of p behind, with p = 0."""
    load = refweb.Load(node=[1], force=(0.0, 0.0, 0.0), factor=[(0.0, 0.0), (0.4, 1.0)])
    scene = spring(duration=2.2, step_size=step_size)
    observe = refweb.Observe(name="far", quantity="displacement", node=1, component="x", reduce="max")
    return scene.replace(effects=(*scene.effects, load, *effects), observe=[observe])


def changes_of_peaks():
    """Derivatives of x at its two peaks, sin(ωt) = 1, by the size of the load of `pushed_spring`."""
    w = np.sqrt(20.0)
    first, second = 0.5 * np.pi / w, 2.5 * np.pi / w
    ramp = (first - np.sin(w * first) / w) / (0.4 * 10.0)
    return ramp, (1.0 - (np.sin(w * second) - np.sin(w * (second - 0.4))) / (0.4 * w)) / 10.0


def test_one_sided_where_two_peaks_are_equal():
    """Without damping each peak is the largest: a load that rises takes the one that it moves more, else the other."""
    gradient = refweb.run(pushed_spring(1e-3), progress=False).gradient("far", "load.0.force.0")
    low, high = sorted(changes_of_peaks())
    assert abs(float(gradient) - high) <= gradient.error[0] < 1e-3 * high
    assert abs(gradient.left[0] - low) <= gradient.error[0]


def test_peaks_that_are_not_told_apart():
    """With damping the first peak is larger by 7e-5, within ± of long steps: ± of its derivative has the second."""
    solution = refweb.run(pushed_spring(1e-2, refweb.Damping(rate=1e-4)), progress=False)
    gradient, result = solution.gradient("far", "load.0.force.0"), solution.results["far"]
    assert 7e-5 * result.value < result.error < 2e-3 * result.value
    first, second = changes_of_peaks()
    assert gradient.left is None and abs(float(gradient) - first) < 0.02 * first
    assert abs(second - float(gradient)) <= 1.02 * gradient.error[0]


def between_two_lines(velocity, duration=1.0):
    """A mass between two lines of 1 m and 1 N, of groups a and b, whose small motion across them has ω = 2/s."""
    return refweb.Scene(
        web=refweb.Inline(
            points=[[-1, 0, 0], [0, 0, 0], [1, 0, 0]],
            lines=[[0, 1], [1, 2]],
            supports=[0, 2],
            groups={"a": [0], "b": [1]},
        ),
        cable=refweb.Cable(
            law="linear", modulus=1e6, area=1e-4, density=0.0, prestrain=0.01, groups={"a": refweb.Group(area=1e-4)}
        ),
        effects=(refweb.PointMass(node=[1], mass=0.5), refweb.Velocity(node=[1], value=velocity)),
        observe=[
            refweb.Observe(name="stress", quantity="stress", reduce="max"),
            refweb.Observe(name="moved", quantity="displacement", node=1),
            refweb.Observe(name="speed", quantity="velocity", node=1),
            refweb.Observe(name="farthest", quantity="displacement", node=1, reduce="max"),
            refweb.Observe(name="aside", quantity="displacement", node=1, component="y", reduce="max"),
            refweb.Observe(name="across", quantity="displacement", node=[1], component="y", select="abs"),
        ],
        solve=refweb.Dynamic(duration=duration, step_size=1e-3),
        output=refweb.Output(interval=0.01),
    )


@pytest.mark.slow
def test_sizes_that_are_0():
    """At rest |x| and |v| have the derivatives ± sin(ωt)/ω and ± cos(ωt); a largest value of 0 all along is refused."""
    solution = refweb.run(between_two_lines((0.0, 0.0, 0.0)), progress=False)
    exact = {"moved": np.sin(2.0) / 2.0, "speed": -np.cos(2.0), "across": np.sin(2.0) / 2.0}
    for name, value in exact.items():
        gradient = solution.gradient(name, "velocity.0.value.1")
        assert abs(float(gradient) - value) <= gradient.error[0] < 1e-4 and gradient.left[0] == -float(gradient)
    for name in ("farthest", "aside"):
        with pytest.raises(InputError, match=f'"{name}" by velocity.0.value.1: it keeps 0 m for a time, in which its'):
            solution.gradient(name, "velocity.0.value.1")
    for name, path in (("stress", "velocity.0.value.1"), ("farthest", "point_mass.0.mass")):  # of order 2, and none
        gradient = solution.gradient(name, path)
        assert float(gradient) == gradient.error[0] == 0.0


def test_where_two_lines_change_places():
    """The largest tension of the looser of two lines is where both are equal, whose time changes with the number.

    Beside it is the same in scipy, to 1e-12, by central differences.
    """
    scene = between_two_lines((0.3, 0.1, 0.0))
    loosest = refweb.Observe(name="loosest", quantity="tension", select="min", reduce="max")
    load = refweb.Load(node=[1], force=(0.0, 0.0, 0.0))
    scene = scene.replace(observe=[loosest], effects=(*scene.effects, load))
    ends, length = np.array([[-1.0, 0, 0], [1, 0, 0]]), 1.0 / 1.01

    def tensions(x, area):
        pulls = ends - x
        lengths = np.linalg.norm(pulls, axis=1)
        return np.array([1e6 * area, 100.0]) * (lengths / length - 1.0), pulls / lengths[:, None]

    def loosest_of(area, speed, force):
        def rate(t, y):
            tension, to = tensions(y[:3], area)
            return [*y[3:], *((tension[:, None] * to).sum(axis=0) + [force, 0.0, 0.0]) / 0.5]

        start = [0.0, 0.0, 0.0, 0.3, speed, 0.0]
        motion = solve_ivp(rate, (0.0, 1.0), start, "DOP853", rtol=1e-12, atol=1e-13, dense_output=True).sol
        apart = lambda t: np.subtract(*tensions(motion(t)[:3], area)[0])  # noqa: E731
        return tensions(motion(brentq(apart, 0.75, 0.81))[:3], area)[0].min()

    solution, at = refweb.run(scene, progress=False), (1e-4, 0.1, 0.0)
    assert abs(solution.results["loosest"].value - loosest_of(*at)) <= solution.results["loosest"].error
    steps = {"cable.groups.a.area": 1e-8, "velocity.0.value.1": 1e-4, "load.0.force.0": 1e-4}
    for n, (path, step) in enumerate(steps.items()):
        low, high = (loosest_of(*(p + s * step * (k == n) for k, p in enumerate(at))) for s in (-1.0, 1.0))
        gradient, exact = solution.gradient("loosest", path), (high - low) / (2.0 * step)
        assert abs(float(gradient) - exact) <= gradient.error[0] < 0.3 * abs(exact) and gradient.left is None


def test_sizes_that_pass_0():
    """A swing turns back: its least speed is 0 for any speed, and a load across leaves |sin(ωt)/(mω)| of it."""
    observe = [
        refweb.Observe(name="speed", quantity="velocity", node=1, reduce="min"),
        refweb.Observe(name="along", quantity="velocity", node=[1], component="y", select="abs", reduce="min"),
    ]
    scene = between_two_lines((0.0, 0.1, 0.0))
    load = refweb.Load(node=[1], force=(0.0, 0.0, 0.0))
    solution = refweb.run(scene.replace(observe=observe, effects=(*scene.effects, load)), progress=False)
    turn = solution.results["speed"].time
    for name in ("speed", "along"):
        assert abs(float(solution.gradient(name, "velocity.0.value.1"))) < 1e-9
    gradient = solution.gradient("speed", "load.0.force.2")  # by z, of which ω = 2/s as by y, but for the large sag
    exact = abs(np.sin(2.0 * turn))
    assert float(gradient) == pytest.approx(exact, rel=0.15) and gradient.left[0] == pytest.approx(-float(gradient))


def test_a_motion_that_stays_at_a_kink():
    """Lines at rest without strain, and a ball that just touches: a push and a pull move them otherwise, with no sign.

    By prestrain the tension at the start is EA for a number that rises, and 0 for one that falls.
    """
    slack = replace(between_two_lines((0.0, 0.0, 0.0)).cable, law="tension-only", prestrain=0.0)
    first = refweb.Observe(name="first", quantity="tension", reduce="max")
    last = refweb.Observe(name="last", quantity="tension")
    scene = between_two_lines((0.0, 0.0, 0.0)).replace(cable=slack, observe=[first, last])
    solution = refweb.run(scene, progress=False)
    gradient = solution.gradient("first", "cable.prestrain")
    assert float(gradient) == pytest.approx(100.0, rel=1e-6) and abs(gradient.left[0]) < 1e-9
    for path in ("velocity.0.value.0", "cable.prestrain"):
        with pytest.raises(InputError, match=f'"last" by {path}: at 0.* s line 0 is neither slack nor taut'):
            solution.gradient("last", path)
    assert float(solution.gradient("last", "velocity.0.value.1")) == 0.0  # across, of order 2

    scene = on_a_rail(0.02, 2e-4, refweb.Contact(stiffness=1e3), (0.0, 0.0, 0.0), 0.1, "z")
    solution = refweb.run(scene.replace(effects=scene.effects[:2]), progress=False)
    with pytest.raises(InputError, match='by body.0.velocity.2: at .* s body "ball" just touches, and stays so'):
        solution.gradient("place", "body.0.velocity.2")


def test_run_and_step_refinement_of_different_peaks():
    """Peaks of two equal lines, of which the run takes one and its step refinement another: sides by differences."""
    scene, step = between_two_lines((0.0, 0.0, 0.3), duration=2.2), 1e-8
    solution = refweb.run(scene, progress=False)
    gradient = solution.gradient("stress", "cable.groups.a.area")
    value = solution.results["stress"].value
    ends = [again(scene, "cable.groups.a.area", 1e-4 + s * step).results["stress"].value for s in (-1.0, 1.0)]
    assert float(gradient) == pytest.approx((ends[1] - value) / step, rel=0.01)
    assert gradient.left[0] == pytest.approx((value - ends[0]) / step, rel=0.01)


def chain(duration):
    """Three masses on soft lines that whirl about each other, which is chaotic."""
    return refweb.Scene(
        web=refweb.Inline(points=[[n, 0, 0] for n in range(4)], lines=[[n, n + 1] for n in range(3)], supports=[0]),
        cable=refweb.Cable(law="linear", modulus=1e6, area=2e-4, density=0.0),
        effects=(
            refweb.PointMass(node=[1, 2, 3], mass=1.0),
            refweb.Gravity(acceleration=(0.0, 0.0, -9.81)),
        ),
        observe=[
            refweb.Observe(name="x", quantity="position", node=3, component="x"),
        ],
        solve=refweb.Dynamic(duration=duration, safety=0.5),
        output=refweb.Output(interval=0.05),
        accuracy=refweb.Accuracy(error="none"),
    )


def test_beyond_the_horizon():
    """A chaotic motion has no gradient at its end; the refusal names the time behind which there is none."""
    solution = refweb.run(chain(20.0), progress=False)
    horizon = solution.gradients.horizon("x")
    assert 4.0 < horizon < 16.0
    with pytest.raises(InputError, match=rf'"x": its time, 20 s, is behind the horizon, {horizon:.4g} s, '):
        solution.gradient("x", "gravity.acceleration.2")
    before = refweb.run(chain(2.0), progress=False)
    assert before.gradients.horizon("x") == np.inf
    gradient, step = before.gradient("x", "gravity.acceleration.2"), 1e-4
    ends = [again(chain(2.0), "gravity.acceleration.2", -9.81 + sign * step).results["x"].value for sign in (-1, 1)]
    assert abs((ends[1] - ends[0]) / (2.0 * step) - float(gradient)) <= min(
        gradient.error[0], 1e-5 * abs(float(gradient))
    )


@pytest.mark.slow
def test_slack_lines_are_chaotic():
    """A ball on slack lines has a height with digits, and a gradient without: it is refused from its horizon on."""

    def pushed(duration):
        cable = dict(prestrain=-0.01, subdivide=4, modulus=4e7)
        scene = net(effects=PRESSED, cable=cable, step_size=None, safety=0.4, duration=duration)
        height = refweb.Observe(name="height", quantity="position", body="ball", component="z")
        return refweb.run(scene.replace(observe=[height], accuracy=refweb.Accuracy()), progress=False)

    whole = pushed(0.3)
    assert whole.results["height"].error < 0.01  # of a way of some tenths of a metre
    with pytest.raises(InputError, match=r"derivative of height by cable.area .* behind the horizon, (0\.[\d]+) s, it"):
        whole.gradient("height", "cable.area")
    gradient = pushed(0.02).gradient("height", "body.0.velocity.2")
    assert 0.015 < float(gradient) < 0.02  # of free flight it is 0.02


REFUSED = [
    (
        dict(solve=dict(method="cvode", step_size=None)),
        'method = "cvode": gradients of dynamics follow the steps of central',
    ),
    (
        dict(cable=dict(strength=1e9), effects=(refweb.Rupture(),)),
        "take no .rupture.: vary the number by refweb sweep, .*; they take lines",
    ),
    (dict(cable=dict(viscous=refweb.Viscous(arms=[[0.2, 0.1]]))), "take no lines or threads with a memory"),
]


@pytest.mark.parametrize(("keys", "text"), REFUSED, ids=[text[:30] for _, text in REFUSED])
def test_refused(keys, text):
    """What has no derivative is refused by name, with the list of what gradients take."""
    keys = dict(keys)
    solution = refweb.run(net(duration=4e-3, **keys.pop("solve", {}), **keys), progress=False)
    with pytest.raises(InputError, match=text):
        solution.gradient("moved", "cable.area")


def test_wrong_names(tmp_path):
    """Results, paths and entries that there are not; means and sums over steps; times at which steps end."""
    load = refweb.Load(node=[4], force=(1.0, 0.0, 0.0), factor=[(0.0, 0.0), (0.003, 1.0)])
    more = [
        refweb.Observe(name="mean", quantity="velocity", average=1e-3),
        refweb.Observe(name="given", quantity="work"),
        refweb.Observe(name="slack", quantity="slack_fraction"),
    ]
    solution = refweb.run(net(effects=(load,), observe=more, duration=6e-3), progress=False)
    for result, path, by, text in (
        (None, "cable.area", None, "result = None must be the name of a result: moved, speed"),
        ("moved", 3, None, "path = 3 must be the path of a number: "),
        ("mouved", "cable.area", None, 'result "mouved" is none of this scene, did you mean "moved"'),
        ("moved", "cable.aera", None, 'path "cable.aera" is no number of this scene, did you mean "cable.area"'),
        ("moved", "cable.area", "line", 'by = "line" is of statics'),
        ("mean", "cable.area", None, "means over a window have none"),
        ("given", "cable.area", None, 'quantity = "work" have none'),
        ("slack", "cable.area", None, 'quantity = "slack_fraction" have none'),
        ("moved", "solve.duration", None, "is no number of the motion"),
        ("moved", "load.0.factor.1.0", None, "is a time of a table, at which steps end, and has no gradient: vary"),
        ("moved", "cable.subdivide", None, "cannot be changed to both sides"),
    ):
        with pytest.raises(InputError, match=text):
            solution.gradient(result, path, by)


def test_command(tmp_path, capsys):
    """The table of all numbers, JSON of one, and refusals, at the command line."""
    import tomli_w

    path = tmp_path / "scene.toml"
    path.write_text(tomli_w.dumps(spring(duration=0.2).to_dict()), encoding="utf-8")
    assert main(["gradient", str(path), "--of", "top"]) in (0, None)
    shown = capsys.readouterr().out
    assert "gradient of top" in shown and "velocity.0.value.0" in shown and "cable.modulus" in shown
    assert main(["gradient", str(path), "--of", "x", "--path", "velocity.0.value.0", "--json"]) in (0, None)
    (entry,) = json.loads(capsys.readouterr().out)
    w = np.sqrt(20.0)
    assert abs(entry["value"][0] - np.sin(0.2 * w) / w) <= entry["error"][0]
    assert main(["gradient", str(path), "--by", "line"]) == 2
    assert 'need [solve] kind = "static"' in capsys.readouterr().err


@pytest.mark.slow
def test_errors_cover():
    """± holds the gradient of a run of a fifth of the steps in 97 % of impacts on nets, damped and not."""
    draw, inside, count = np.random.default_rng(5), 0, 0
    paths = ["cable.area", "body.0.mass", "body.0.velocity.2", "contact.stiffness", "cable.prestrain"]
    for number in range(10):
        ball = refweb.Body(
            name="ball",
            shape="sphere",
            radius=0.15,
            mass=float(draw.uniform(0.2, 1.0)),
            position=(*draw.uniform(0.4, 0.6, 2).tolist(), 0.16),
            velocity=(*draw.uniform(-0.2, 0.2, 2).tolist(), float(draw.uniform(-2.0, -0.5))),
        )
        effects = [ball, refweb.Contact(stiffness=float(draw.uniform(300.0, 900.0)))]
        effects += [refweb.Damping(time=2e-3)] if number % 2 else []
        scene = net(("tension-only", "smooth", "linear")[number % 3], effects, step_size=None, safety=0.3)
        scene = scene.replace(observe=[*scene.observe, refweb.Observe(name="force", quantity="reaction", body="ball")])
        fine = scene.replace(solve=replace(scene.solve, safety=0.06))
        pair = [refweb.run(changed, progress=False) for changed in (scene, fine)]
        for solution in pair:
            solution.gradients.follow(paths)
        for path in paths:
            for name in pair[0].results:
                first, last = (solution.gradient(name, path) for solution in pair)
                inside += abs(float(first) - float(last)) <= first.error[0]
                count += 1
    assert count > 300 and inside >= 0.97 * count


@pytest.mark.parametrize("size", [1e-9, 1e-2, 1.0, 40.0])
def test_mean_decay_of_a_matrix(size):
    """φ(Z) = Z⁻¹ (1 − e⁻ᶻ) by scipy's exponential, and by its series where Z is too small for that."""
    Z = np.random.default_rng(0).standard_normal((5, 5))
    Z = size * (Z @ Z.T + Z - Z.T) / np.linalg.norm(Z @ Z.T)
    expected = np.linalg.solve(Z, np.eye(5) - expm(-Z)) if size > 1e-6 else np.eye(5) - 0.5 * Z
    # Z⁻¹ magnifies the rounding of 1 − e⁻ᶻ by the condition of Z.
    np.testing.assert_allclose(mean_decay(Z), expected, rtol=0, atol=1e-14 * np.linalg.cond(Z))
