"""Hard hits of bodies that turn in space: on an edge, on a corner, along an edge, flat and fast, and long rest."""

import numpy as np
import pytest

import refweb
from refweb.dynamics.integrators.central_difference import CentralDifference

SIDE, ROUND, SPEED, MASS = 0.2, 0.01, 2.0, 1.0
ON_EDGE = [[1.0, 0.0, 1.0], [0.0, 1.0, 0.0]]
ON_CORNER = [[2.0**0.5, 0.0, 1.0], [-1.0, 3.0**0.5, 2.0**0.5]]
"""The first two axes of a cube that stands on an edge along y, and on a corner."""


def onto(axes, low, lines, k=1e7, **solve):
    """A cube that comes down on lines that both ends hold, its lowest point 1 mm above them."""
    points = [point for line in lines for point in line]
    pairs = [[2 * i, 2 * i + 1] for i in range(len(lines))]
    cube = dict(name="cube", shape="box", size=[SIDE] * 3, rounding=ROUND, mass=MASS, axes=axes)
    time = 2e-3 + 5.0 / np.sqrt(k)
    return refweb.Scene.from_dict(
        {
            "web": {"kind": "inline", "points": points, "lines": pairs, "supports": list(range(len(points)))},
            "cable": {"law": "linear", "modulus": 1e6, "area": 1e-4, "density": 1.0},
            "body": [{**cube, "position": [0.0, 0.0, low + 1e-3], "velocity": [0.0, 0.0, -SPEED]}],
            "contact": {"stiffness": k},
            "solve": {"kind": "dynamic", "duration": time, "safety": 0.1, **solve},
            "output": {"interval": time / 2.0, "frames": 1},
            "accuracy": {"error": "none"},
        }
    )


EDGE = np.sqrt(2.0) * (0.5 * SIDE - ROUND) + ROUND
CORNER = np.sqrt(3.0) * (0.5 * SIDE - ROUND) + ROUND
"""From the centre to a rounded edge, and to a rounded corner."""
CASES = {
    "an edge across a line": (ON_EDGE, EDGE, [[[-1, 0, 0], [1, 0, 0]]]),
    "a line along an edge": (ON_EDGE, EDGE, [[[0, -1, 0], [0, 1, 0]]]),
    "a corner on a line": (ON_CORNER, CORNER, [[[-1, 0, 0], [1, 0, 0]]]),
    "a corner on two lines": (ON_CORNER, CORNER, [[[-1, 0, 0], [1, 0, 0]], [[0, -1, 0], [0, 1, 0]]]),
}


@pytest.mark.parametrize("name", CASES)
def test_central_hits_throw_back_without_a_turn(name):
    """The push passes the centre by symmetry: the cube goes back as it came, and gains no spin but of rounding.

    A corner is a part of a sphere, whose lowest point is below the centre.
    """
    solution = refweb.run(onto(*CASES[name]))
    state, (body,) = solution.state, solution.state.system.net.bodies
    assert solution.history["contact_energy"].max() > 0.0 or solution.solver["nsteps"] > 100
    assert state.v[body.row, 2] == pytest.approx(SPEED, rel=1e-4)  # its book closes to that
    assert solution.solver["energy_drift"] < 1e-4 and solution.solver["momentum_drift"] < 1e-12
    assert np.abs(body.turning(state.x, state.v)).max() < 1e-6 * SPEED / SIDE


@pytest.mark.parametrize("name", ["an edge across a line", "a corner on a line"])
def test_methods_agree_on_them(name):
    """Off the centre by 1 cm, so that the cube turns: explicit steps of two sizes and CVODE."""
    axes, low, lines = CASES[name]
    moved = [[[x, y + 0.01, z] for x, y, z in line] for line in lines]
    runs = [dict(safety=0.1), dict(safety=0.025), dict(method="cvode", family="adams", rtol=1e-8)]
    runs[2]["safety"] = None
    found = []
    for keys in runs:
        scene = onto(axes, low, moved, k=1e5)
        given = {key: value for key, value in keys.items() if value is not None}
        found.append(refweb.run(scene.replace(solve=refweb.Dynamic(duration=scene.solve.duration, **given))).state)
    body = found[0].system.net.bodies[0]
    assert np.abs(body.turning(found[1].x, found[1].v)).max() > 0.1
    np.testing.assert_allclose(found[1].v, found[0].v, rtol=0, atol=2e-3)
    np.testing.assert_allclose(found[2].v, found[1].v, rtol=0, atol=2e-3)


def plate(axes, low, **tables):
    """A plate of 10 mm that meets a net at 50 m/s, with the stiffness that refweb chooses."""
    own = dict(name="plate", shape="box", size=[0.4, 0.4, 0.01], rounding=0.004, mass=0.5, axes=axes)
    own |= dict(position=[0.01, 0.02, low + 1e-3], velocity=[0.0, 0.0, -50.0], angular_velocity=[1.0, -2.0, 3.0])
    return refweb.Scene.from_dict(
        {
            "web": {"kind": "window", "mesh": "square", "rows": 8, "columns": 8, "side": 0.15},
            "cable": {"law": "tension-only", "modulus": 1e9, "area": 1e-6, "density": 1000.0},
            "supports": {"nodes": []},
            "body": [own],
            "contact": {},
            "solve": {"kind": "dynamic", "duration": 5e-3},
            "output": {"interval": 5e-4, "frames": 2},
            "accuracy": {"error": "none"},
        }
        | tables
    )


@pytest.mark.parametrize("name", ["flat", "on its edge"])
def test_a_thin_plate_at_50_metres_a_second(name):
    """Books close, and no line is on the other side of the plate than it began; or the run is refused by name."""
    axes, low = {"flat": ([[1, 0, 0], [0, 1, 0]], 0.005), "on its edge": ([[1, 0, 0], [0, 0, 1]], 0.2)}[name]
    solution = refweb.run(plate(axes, low))
    state, (body,) = solution.state, solution.state.system.net.bodies
    assert solution.solver["energy_drift"] < 1e-2 and solution.solver["momentum_drift"] < 1e-9
    assert solution.bodies["plate"]["overlap"] < 0.5 * body.thickness
    assert solution.bodies["plate"]["overlap"] > 0.0
    if name == "flat":
        net = state.system.net
        beside = net.points[: net.nodes] - net.points[body.row]
        local = (state.position[: net.nodes] - state.position[body.row]) @ (body.axes @ body.rotation(state.x).T).T
        below = (np.abs(beside[:, :2]) < 0.19).all(axis=1)  # others wrap around its edges
        over = below & (np.abs(local[:, :2]) < 0.19).all(axis=1)
        assert over.any() and (local[over, 2] < 0.0).all()


@pytest.mark.slow
def test_no_energy_creeps_into_a_body_at_rest_on_a_net(tmp_path):
    """A box that losses have brought to rest in a net, then 1e5 steps with friction, and without any losses.

    Friction holds it. Without it a box in a bowl of lines is not stable: it begins to slide and tilt, and what it gains
    of kinetic energy it loses of the others, within errors that fall with the square of the step and do not grow.
    """
    box = dict(name="box", shape="box", size=[0.3, 0.25, 0.2], rounding=0.02, mass=1.0, position=[0.0, 0.0, 0.09])
    tables = {
        "web": {"kind": "window", "mesh": "square", "rows": 5, "columns": 5, "side": 0.15},
        "cable": {"law": "linear", "modulus": 1e7, "area": 1e-5, "density": 1000.0},
        "gravity": {"acceleration": [0.0, 0.0, -9.81]},
        "body": [box],
        "contact": {"stiffness": 2e3},
        "accuracy": {"error": "none"},
    }
    losses = {"damping": {"time": 2e-3, "rate": 30.0}, "contact": {"stiffness": 2e3, "damping": 5.0, "friction": 0.3}}
    solve = {"kind": "dynamic", "duration": 6.0}
    first = {**tables, **losses, "solve": solve, "output": {"interval": 0.1, "frames": 1}}
    at_rest = refweb.run(refweb.Scene.from_dict(first), tmp_path / "rest")
    assert at_rest.history["kinetic_energy"][-1] < 1e-8
    bound = CentralDifference(refweb.Scene.from_dict({**tables, "solve": solve}).build()).bound()
    worst = []
    for share, contact in ((0.5, {}), (0.25, {}), (0.5, {"friction": 0.3})):
        step, count = share * bound, round(0.5 / share * 1e5)
        own = {"kind": "dynamic", "duration": count * step, "step_size": step, "start": str(tmp_path / "rest")}
        given = {**tables, "contact": {"stiffness": 2e3, **contact}, "solve": own}
        solution = refweb.run(refweb.Scene.from_dict({**given, "output": {"interval": 1e3 * step, "frames": 1}}))
        assert solution.solver["nsteps"] >= 1e5 - 1
        history = solution.history
        off = np.abs(np.asarray(history["total_energy"]) - history["total_energy"][0])
        kinetic = np.asarray(history["kinetic_energy"])
        if contact:
            assert kinetic.max() < 1e-8 and off.max() < 1e-8
        else:
            worst.append(off.max())
            half = len(off) // 2
            assert kinetic.max() > 1e-4 and off.max() < 1e-5 * kinetic.max()
            assert off[half:].max() < 4.0 * off[:half].max() + 1e-9
    assert worst[1] < 0.5 * worst[0]
