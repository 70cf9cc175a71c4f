"""Bodies that turn about axles: closed forms, independent programs, methods side by side, orders, books, refusals."""

import nets
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar
from scipy.spatial.transform import Rotation
from scipy.special import ellipj, ellipk

import refweb
from refweb.dynamics.integrators.central_difference import CentralDifference

G, MASS, ARM, RADIUS = 9.81, 2.0, 0.4, 0.1
INERTIA = (0.11, 0.13, 0.07)
MOMENT = 0.13 + MASS * ARM**2
"""Of `ROD` about its axle [kg m²]."""
ROD = dict(
    name="rod", shape="box", size=[0.1, 0.2, 0.6], mass=MASS, inertia=list(INERTIA), position=[3.0, 0.3, 0.0],
    axle={"point": [3.0, -1.0, ARM], "direction": [0.0, 2.0, 0.0]},
)  # fmt: skip
WEB = {"kind": "inline", "points": [[0, 0, 0], [1, 0, 0], [2, 0, 0]], "lines": [[0, 1], [1, 2]], "supports": [0, 2]}
SOFT = dict(law="linear", modulus=1e6, area=1e-6, density=1000.0)


def solved(method, *observe, **tables):
    """Run of a scene by a method of `nets.METHODS`, or statics, which looks at quantities of a body."""
    kind = {"kind": "static"} if method is None else {"kind": "dynamic", **nets.METHODS[method]}
    solve = kind | tables.pop("solve", {})
    name = tables["body"][-1]["name"]
    observe = [o if isinstance(o, dict) else {"name": o, "quantity": o, "body": name} for o in observe]
    scene = {"web": WEB, "cable": SOFT, **tables, "observe": [*tables.pop("observe", []), *observe], "solve": solve}
    return refweb.run(refweb.Scene.from_dict(scene))


def pendulum(method, omega=3.0, duration=0.5, **solve):
    looked = {"name": "pull", "quantity": "support_force", "body": "rod", "component": "z", "reduce": "max"}
    return solved(
        method, "axle_angle", looked, gravity={"acceleration": [0.0, 0.0, -G]},
        body=[ROD | {"angular_velocity": [0.0, omega, 0.0]}], solve={"duration": duration, **solve},
    )  # fmt: skip


def angle_of_pendulum(t, omega):
    """Angle of a physical pendulum that passes its lowest place with ω: sin(θ/2) = k sn(ω₀ t, k), 2 ω₀ k = ω."""
    rate = np.sqrt(MASS * G * ARM / MOMENT)
    k = omega / (2.0 * rate)
    return 2.0 * np.arcsin(k * ellipj(rate * t, k * k)[0])


@pytest.mark.ordinary("adams", "order *", "central-difference")
@pytest.mark.parametrize("method", nets.METHODS)
def test_body_on_an_axle_is_a_physical_pendulum(method):
    """Its angle, and the pull m g + m ω² l at the lowest place, within ±; the balance of energy closes."""
    result = pendulum(method)
    angle, pull = result.results["axle_angle"], result.results["pull"]
    assert abs(angle.value - angle_of_pendulum(0.5, 3.0)) <= angle.error < 1e-3
    assert pull.value == pytest.approx(MASS * (G + 9.0 * ARM), rel=1e-4)
    assert result.solver["energy_drift"] < 1e-4


@pytest.mark.parametrize(
    "load", ["weight", {}, {"factor": [[0.0, 0.0], [1e-3, 1.0]]}], ids=["weight", "load", "rising"]
)
@pytest.mark.parametrize("method", ["central-difference", "order 4"])
def test_pendulum_beside_its_equilibrium(load, method, angle=1e-9):
    """The angle is a₀ cos(ω t), though its energy is less than the rounding of the work of the load."""
    body = ROD | {"position": [3.0 - ARM * angle, 0.3, 0.0]}
    rate, held = np.sqrt(MASS * G * ARM / MOMENT), WEB | {"supports": [0, 1, 2]}
    tables = {"web": held, "gravity": {"acceleration": [0.0, 0.0, -G]}}
    if load != "weight":
        points = [[0, 0, 0], [1, 0, 0], [3.0 - ARM * angle, 0.3, 0.0]]
        web = {"kind": "inline", "points": points, "lines": [[0, 1], [1, 2]], "natural_length": 4.0, "supports": [0]}
        body, rate = ROD | {"position": [3.0, 0.3, ARM]}, np.sqrt(MASS * G * ARM / INERTIA[1])
        pull = {"node": 2, "force": [0.0, 0.0, -MASS * G]} | load
        tables = {
            "web": web,
            "cable": SOFT | {"law": "tension-only", "modulus": 1.0, "density": 1.0},
            "load": [pull],
            "attach": [{"body": "rod", "node": 2}],
        }
    result = solved(method, "axle_angle", body=[body], solve={"duration": 0.5, "step_size": 1e-3}, **tables)
    turned = angle * (1.0 - np.cos(rate * 0.5))
    assert result.results["axle_angle"].value == pytest.approx(-turned, rel=5e-3)  # a ramp of 1 ms, steps of 1 ms


def test_period_of_the_pendulum():
    """4 K(k)/ω₀, after which it is back where it was, by order 6; 0.7 of the way to the top."""
    rate = np.sqrt(MASS * G * ARM / MOMENT)
    omega = 2.0 * rate * np.sin(0.35 * np.pi)
    period = 4.0 * ellipk(np.sin(0.35 * np.pi) ** 2) / rate
    result = pendulum("order 6", omega, period, step_size=2e-3)
    assert result.results["axle_angle"].value == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    "method, order, steps", [("central-difference", 2, (4e-3, 2e-3)), ("order 4", 4, (2e-2, 1e-2))]
)
def test_orders_hold_about_an_axle(method, order, steps):
    exact = angle_of_pendulum(0.5, 3.0)
    errors = [abs(pendulum(method, step_size=h).results["axle_angle"].value - exact) for h in steps]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.3)


WHEEL = dict(name="wheel", shape="cylinder", radius=0.2, length=0.1, axis=[1.0, 2.0, 2.0], mass=3.0,
             inertia=[0.03, 0.03, 0.05], position=[0.0, 4.0, 0.0])  # fmt: skip
TORQUE = [[0.0, 0.0], [0.2, 0.6], [0.5, -0.3]]


@pytest.mark.ordinary("ida", "adams", "order *", "central-difference")
@pytest.mark.parametrize("method", nets.METHODS)
def test_torque_turns_a_wheel(method):
    """I dω/dt = M(t) by pieces: the angle is a cubic, the work ½ I ω²; moments across the axle turn nothing."""
    body = WHEEL | {"angular_velocity": [1.0, 2.0, 2.0], "axle": {"direction": [1.0, 2.0, 2.0], "torque": TORQUE}}
    result = solved(method, "axle_angle", body=[body], solve={"duration": 0.6}, output={"interval": 0.1})
    found = result.history
    exact = solve_ivp(
        lambda t, y: [y[1], np.interp(t, *np.transpose(TORQUE)) / 0.05], (0.0, 0.6), [0.0, 3.0],
        t_eval=found["time"], rtol=1e-11, atol=1e-12, max_step=1e-3,
    ).y  # fmt: skip
    tolerance = {"central-difference": 1e-3, "bdf": 1e-4, "ida": 1e-4}.get(method, 1e-6)  # rows of few steps
    np.testing.assert_allclose(found["axle_angle"], exact[0], rtol=0, atol=tolerance * exact[0].max())
    worked = 0.5 * 0.05 * (exact[1] ** 2 - 9.0)
    np.testing.assert_allclose(found["work"], worked, rtol=0, atol=tolerance * np.abs(worked).max())


@pytest.mark.ordinary("central-difference", "adams")
@pytest.mark.parametrize("method", nets.METHODS)
def test_an_axle_bears_what_a_body_gives_across_it(method):
    """A box about a skew axle off its centre by 0.7 N m: the moment is J α n + ω² n × J n − 0.7 n, J about the axle."""
    n, arm = np.array([1.0, 2.0, 2.0]) / 3.0, np.array([0.2, -0.2, 0.1])  # at right angles
    axle = {"point": [0.0, 4.0, 0.0], "direction": n.tolist(), "torque": 0.7}
    body = ROD | {"position": (arm + [0.0, 4.0, 0.0]).tolist(), "axle": axle}
    looked = [
        {"name": name, "quantity": quantity, "body": "rod"}
        for name, quantity in (("moment", "support_moment"), ("angle", "axle_angle"), ("rate", "angular_velocity"))
    ]
    found = solved(method, *looked, body=[body], solve={"duration": 0.3}).results
    J = np.diag(INERTIA) + MASS * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    alpha = 0.7 / (n @ J @ n)
    rate = alpha * 0.3
    exact = J @ n * alpha + rate**2 * np.cross(n, J @ n) - 0.7 * n  # of the axes of the body, as all sizes are
    tolerance = 1e-4 if method in ("bdf", "ida") else 1e-8
    assert found["rate"].value == pytest.approx(rate, rel=tolerance)
    assert found["moment"].value == pytest.approx(np.linalg.norm(exact), rel=2 * tolerance)


@pytest.mark.parametrize("arm", [(0.0, 0.0, 0.0), (0.2, -0.2, 0.1)])
def test_angular_momentum_about_a_skew_axle(arm):
    """About its centre it is R I n ω, which is not along the axle; R turns by α t²/2 and ω is α t."""
    n, arm, end = np.array([1.0, 2.0, 2.0]) / 3.0, np.array(arm), 0.9
    axle = {"point": [0.0, 4.0, 0.0], "direction": n.tolist(), "torque": 0.7}
    body = ROD | {"position": (arm + [0.0, 4.0, 0.0]).tolist(), "axle": axle}
    looked = [
        {"name": f"{quantity} {c}", "quantity": quantity, "body": "rod", "component": c}
        for quantity in ("angular_momentum", "total_angular_momentum") for c in "xyz"
    ]  # fmt: skip
    solution = solved("order 4", *looked, body=[body], solve={"duration": end})
    alpha = 0.7 / (n @ np.diag(INERTIA) @ n + MASS * (arm @ arm))
    expected = Rotation.from_rotvec(0.5 * alpha * end**2 * n).apply(np.array(INERTIA) * n * alpha * end)
    found = [solution.results[f"angular_momentum {c}"].value for c in "xyz"]
    np.testing.assert_allclose(found, expected, rtol=1e-7)
    if not arm.any():  # the centre rests, and the web as well, so that the sum has no other part
        every = [solution.results[f"total_angular_momentum {c}"].value for c in "xyz"]
        np.testing.assert_allclose(every, expected, rtol=1e-7)
    state = solution.state
    for name, value in zip((f"angular_momentum {c}" for c in "xyz"), expected, strict=True):
        observe = next(o for o in solution.scene.observe if o.name == name)
        assert observe.value(state)[0] == pytest.approx(value, rel=1e-7)


def test_angular_momentum_of_a_moved_body_is_refused():
    looked = {"name": "it", "quantity": "angular_momentum", "body": "rod"}
    body = {key: value for key, value in ROD.items() if key not in ("mass", "inertia", "axle")}
    motion = [{"body": "rod", "rotation": [[0, 0, 0, 0], [1, 0.3, 0.5, 0]]}]
    with pytest.raises(refweb.errors.InputError, match='"rod" is turned by .* has no inertia'):
        solved("order 4", looked, body=[body], motion=motion, solve={"duration": 0.1})


def test_a_number_is_a_torque_that_stays():
    body = WHEEL | {"axle": {"direction": [1.0, 2.0, 2.0], "torque": 0.7}}
    found = solved("order 4", "axle_angle", body=[body], solve={"duration": 0.5}).results
    assert found["axle_angle"].value == pytest.approx(0.5 * 0.7 / 0.05 * 0.25, rel=1e-12)


def gate(method, **solve):
    """A gate off its axle, held by a line at its corner, the mass of whose end is the gate's."""
    return solved(
        method, "axle_angle", {"name": "tension", "quantity": "tension", "line": 0},
        web={"kind": "inline", "points": [[1.0, 0.0, 0.3], [2.5, 0.4, 0.8]], "lines": [[0, 1]], "supports": [1]},
        cable=dict(law="linear", modulus=2e8, area=1e-6, density=1e4, prestrain=0.02),
        body=[dict(name="gate", shape="box", size=[1.0, 0.1, 0.6], mass=MASS, inertia=list(INERTIA),
                   position=[0.5, 0.0, 0.0], axle={"point": [0.0, 0.0, 0.0], "direction": [0.0, 0.0, 1.0]},
                   angular_velocity=[0.0, 0.0, -0.5])],
        attach=[{"body": "gate", "node": 0}], solve={"duration": 0.4, **solve},
    )  # fmt: skip


def gate_by_itself():
    """Angle and tension of `gate` at 0.4 s: I θ'' = (r × T)_z of one spring, by DOP853."""
    anchor, corner = np.array([2.5, 0.4, 0.8]), np.array([1.0, 0.0, 0.3])
    chord = np.linalg.norm(anchor - corner)
    natural = chord / 1.02
    knot = 0.5 * 1e4 * 1e-6 * natural
    moment = INERTIA[2] + MASS * 0.25 + knot * 1.0

    def pull(angle):
        c, s = np.cos(angle), np.sin(angle)
        place = np.array([c * corner[0], s * corner[0], corner[2]])
        away = anchor - place
        tension = 200.0 * (np.linalg.norm(away) / natural - 1.0)
        force = tension * away / np.linalg.norm(away)
        return tension, place[0] * force[1] - place[1] * force[0]

    result = solve_ivp(
        lambda t, y: [y[1], pull(y[0])[1] / moment], (0.0, 0.4), [0.0, -0.5], method="DOP853", rtol=1e-12, atol=1e-13
    )
    return result.y[0, -1], pull(result.y[0, -1])[0]


@pytest.mark.ordinary("central-difference", "order 4", "order 6", "adams")
@pytest.mark.parametrize("method", nets.METHODS)
def test_attached_node_turns_a_gate(method):
    angle, tension = gate_by_itself()
    found = gate(method).results
    assert abs(found["axle_angle"].value - angle) <= max(1.5 * found["axle_angle"].error, 1e-9)
    assert abs(found["tension"].value - tension) <= max(1.5 * found["tension"].error, 1e-7)


def test_axle_in_turning_axes():
    """In a frame that turns by Ω, a body on an axle along Ω at the distance R swings: I θ'' = −m Ω² R l sin θ."""
    omega, far, swing = 2.0, 3.0, 1.2
    body = dict(name="flap", shape="box", size=[0.6, 0.2, 0.1], mass=MASS, inertia=[0.07, 0.11, 0.13],
                position=[far + ARM, 0.0, 0.0], angular_velocity=[0.0, 0.0, swing],
                axle={"point": [far, 0.0, 0.0], "direction": [0.0, 0.0, 1.0]})  # fmt: skip
    web = WEB | {"points": [[0, 0, 1], [1, 0, 1], [2, 0, 1]]}
    found = solved("central-difference", "axle_angle", web=web, body=[body],
                   frame={"angular_velocity": [0.0, 0.0, omega]}, solve={"duration": 1, "step_size": 2e-4})  # fmt: skip
    exact = solve_ivp(
        lambda t, y: [y[1], -MASS * omega**2 * far * ARM * np.sin(y[0]) / MOMENT],
        (0.0, 1.0),
        [0.0, swing],
        rtol=1e-11,
        atol=1e-13,
    ).y[0, -1]
    angle = found.results["axle_angle"]
    assert abs(angle.value - exact) <= angle.error < 1e-5


PADDLE = dict(name="paddle", shape="box", size=[0.4, 0.2, 0.2], rounding=0.05, mass=0.05, position=[1.1, 0.0, 0.115],
              axle={"point": [0.8, 0.0, 0.115], "direction": [0.0, 1.0, 0.0]},
              angular_velocity=[0.0, 3.0, 0.0])  # fmt: skip


def paddle(method, **more):
    return solved(
        method, "axle_angle", {"name": "lost", "quantity": "dissipated_energy"}, body=[PADDLE],
        web={"kind": "inline", "points": [[0, -0.5, 0], [0.7, -0.2, 0], [1.2, 0.1, 0], [2, 0, 0]],
             "lines": [[0, 1], [1, 2], [2, 3]]}, supports={"nodes": [0, 3]},
        cable=dict(law="linear", modulus=1e8, area=1e-6, density=1e4),
        contact={"stiffness": 1e4, "friction": 0.3}, solve={"duration": 0.03, **more},
    )  # fmt: skip


@pytest.mark.slow
def test_contact_with_friction_turns_a_body_on_an_axle():
    """A paddle off its axle that strikes a line: central differences and CVODE agree within their ±."""
    first, second = paddle("central-difference").results, paddle("bdf").results
    assert first["lost"].value > 1e-5
    for name in first:
        one, other = first[name], second[name]
        assert abs(one.value - other.value) <= 2.0 * (one.error + other.error), name


def test_atwood():
    """Two masses on a rope that sticks to a pulley: (m₁ − m₂) g/(m₁ + m₂ + I/r²). Chords stand out by 0.9 % of r, and
    the masses swing on the rope by 2 % of their velocity; without the pulley they would have 1.6 times of it."""
    first, second, moment, r, pieces, end = 1.0, 0.8, 0.01, RADIUS, 12, 0.1
    out = r / np.cos(0.5 * np.pi / pieces)
    arc = [[-out * np.cos(a), 0.0, out * np.sin(a)] for a in np.linspace(0.0, np.pi, pieces + 1)]
    points = [[-out, 0.0, -0.2], [-out, 0.0, -0.1], *arc, [out, 0.0, -0.1], [out, 0.0, -0.2]]
    last = len(points) - 1
    pulley = dict(name="pulley", shape="cylinder", radius=r, length=0.1, axis=[0.0, 1.0, 0.0], mass=2.0,
                  inertia=[0.01, 0.01, moment], position=[0.0, 0.0, 0.0],
                  axle={"direction": [0.0, 1.0, 0.0]})  # fmt: skip
    speeds = [{"name": "w", "quantity": "angular_velocity", "body": "pulley", "component": "y"},
              {"name": "v", "quantity": "velocity", "node": 0, "component": "z"}]  # fmt: skip
    found = solved(
        "central-difference", *speeds,
        web={"kind": "inline", "points": points, "lines": [[i, i + 1] for i in range(last)], "supports": []},
        cable=dict(law="tension-only", modulus=2e10, area=1e-6, density=1000.0), body=[pulley],
        gravity={"acceleration": [0.0, 0.0, -G]}, contact={"stiffness": 2e5, "friction": 0.5},
        point_mass=[{"node": 0, "mass": first}, {"node": last, "mass": second}],
        solve={"duration": end}, accuracy={"error": "none"},
    ).results  # fmt: skip
    rate = (first - second) / (first + second + moment / r**2) * G
    assert found["w"].value == pytest.approx(-rate * end / r, rel=1e-2)
    assert found["v"].value == pytest.approx(-rate * end, rel=2e-2)


@pytest.mark.parametrize("mass", [1e-3, 0.05, 10.0])
def test_bound_bounds_a_body_off_its_axle(mass):
    """2/ω of nodes and angle, by differences of the forces, is never below the bound."""
    scene = dict(web=WEB, cable=SOFT, body=[PADDLE | {"mass": mass}], contact={"stiffness": 1e4})
    system = refweb.Scene.from_dict(scene | {"solve": {"kind": "dynamic", "duration": 1.0}}).build()
    (body,), node = system.net.bodies, 1

    def place(y):
        x = np.zeros((system.rows, 3))
        x[node], half = y[:3], 0.5 * y[3]
        x[body.turn, 0], x[body.spin] = np.cos(half) - 1.0, np.sin(half) * body.axle.direction
        system.drive(0.0, x)
        return x

    def force(y):
        f = system.force(0.0, place(y))
        return np.append(f[node], body.axle.direction @ f[body.spin])

    y, h = np.array([0.0, 0.0, 0.02, 0.05]), 1e-7
    K = np.array([(force(y - h * e) - force(y + h * e)) / (2.0 * h) for e in np.eye(4)])
    square = np.linalg.eigvals(K / np.append(np.full(3, system.net.mass[node]), body.moment)[:, None]).real.max()
    bound = CentralDifference(system).bound(place(y), reach=0.0)
    assert 0.05 < bound * np.sqrt(square) / 2.0 <= 1.0 + 1e-6


NO = dict(name="it", radius=0.1, mass=1.0, position=[0.0, 0.0, 2.0])
REFUSED = [
    ({"axle": {"point": [0, 0, 0]}}, r"axle.* direction is missing"),
    ({"axle": {"direction": [0, 0, 0]}}, r"axle.* direction = \[.*\] must not be zero"),
    ({"axle": {"direction": [0, 0, 1], "tork": 1.0}}, r'axle.*"?tork"?.*torque'),
    ({"axle": {"direction": [0, 0, 1], "torque": [[1.0, 0.0], [0.0, 1.0]]}}, r"torque\[1\]\[0\] = 0.0 must be > 1"),
    ({"axle": {"direction": [0, 0, 1], "torque": "much"}}, r"torque = .*much.* must be a number"),
    ({"axle": {"direction": [0, 0, 1]}, "fixed": True, "mass": None}, r"axle = .* has no meaning where fixed = true"),
    ({"axle": {"direction": [0, 0, 1]}, "velocity": [1, 0, 0]}, r"velocity = .* must be zero with axle"),
    ({"axle": {"direction": [0, 0, 1]}, "angular_velocity": [0, 1, 1]}, r"angular_velocity = .* must be along axle"),
    ({"axle": {"direction": [0, 0, 1]}, "shape": "ring", "normal": [0, 0, 1]}, r"has no meaning for shape = .ring."),
    ({"axle": {"direction": [0, 0, 1]}, "mass": None}, r"mass is missing: a free body needs mass"),
]  # fmt: skip


@pytest.mark.parametrize("given, message", REFUSED)
def test_what_does_not_turn_is_refused(given, message):
    body = {key: value for key, value in (NO | given).items() if value is not None}
    with pytest.raises(refweb.InputError, match=message):
        refweb.Scene.from_dict(
            dict(web=WEB, cable=SOFT, body=[body], solve={"kind": "dynamic", "duration": 0.1})
        ).build()


def flap(seed):
    """A box that turns about a skew axle, off it or on it, with a torque, on two ropes; and a program of its energy."""
    rng = np.random.default_rng(seed)
    direction, point = rng.normal(size=3), 0.3 * rng.normal(size=3) * (seed % 2)
    direction /= np.linalg.norm(direction)
    ends, tops = 0.3 * rng.normal(size=(2, 3)), rng.normal(size=(2, 3)) + [0.0, 0.0, 2.0]
    length, torque = 0.9 * np.linalg.norm(tops - ends, axis=1), float(rng.normal())
    axle = {"point": point.tolist(), "direction": direction.tolist(), "torque": [[0.0, 0.0], [1.0, torque]]}
    tables = dict(
        web={"kind": "inline", "points": [*tops.tolist(), *ends.tolist()], "lines": [[0, 2], [1, 3]]},
        supports={"nodes": [0, 1]}, cable=dict(law="tension-only", modulus=1e6, area=1e-4, density=1000.0),
        gravity={"acceleration": [0.0, 0.0, -G]}, attach=[{"body": "flap", "node": [2, 3]}],
        body=[{"name": "flap", "shape": "box", "size": [0.4, 0.3, 0.2], "mass": 2.0, "position": [0, 0, 0],
               "axle": axle}],
    )  # fmt: skip
    tables["web"]["natural_length"] = length.tolist()

    def energy(angle, torque=torque):
        turn = Rotation.from_rotvec(angle * direction)
        places = point + turn.apply(np.vstack([ends, np.zeros(3)]) - point)
        stretch = np.maximum(np.linalg.norm(places[:2] - tops, axis=1) - length, 0.0)
        weight = G * (0.5 * 1000.0 * 1e-4 * length @ places[:2, 2] + 2.0 * places[2, 2])
        return 0.5 * (100.0 / length) @ stretch**2 + weight - torque * angle

    return tables, energy


@pytest.mark.parametrize("seed", nets.some([0, 1, 2, 3, 4, 5], 2))
def test_equilibrium_about_an_axle(seed):
    """The angle is where a program of one's own has the least energy nearby; and so with half of the torque."""
    tables, energy = flap(seed)
    looked = (
        {"name": name, "quantity": quantity, "body": "flap"}
        for name, quantity in (("angle", "axle_angle"), ("moment", "support_moment"))
    )
    found = solved(None, *looked, **tables, solve={"load_steps": [0.5, 1.0]})
    for step, angle in zip((0.5, 1.0), found.history["angle"], strict=True):
        torque = step * tables["body"][0]["axle"]["torque"][1][1]
        least = minimize_scalar(energy, bounds=(angle - 0.2, angle + 0.2), args=(torque,), options={"xatol": 1e-9})
        assert least.x == pytest.approx(angle, abs=1e-6)  # roots of rounding in the energy
    assert found.solver["residual"] < 1e-9 and found.solver["smallest_pivot"] == 1
    state, (body,) = found.state, found.state.system.net.bodies
    weight = [0.0, 0.0, -G * (2.0 + 0.05 * sum(tables["web"]["natural_length"]))]  # with that of the ends of the ropes
    ropes, base = state.position[:2] - state.position[2:4], state.position[body.base]
    pulls = found.tension[:, None] * ropes / np.linalg.norm(ropes, axis=1)[:, None]
    moment = np.cross(state.position[2:4] - base, pulls).sum(axis=0) + np.cross(state.position[body.row] - base, weight)
    across = np.linalg.norm(np.cross(body.axle.direction, moment))
    assert found.results["moment"].value == pytest.approx(across, rel=1e-7)


def test_a_pendulum_at_rest_hangs_below_its_axle():
    """Nothing but its weight turns it, by a quarter, and the axle bears that."""
    arm = dict(
        name="arm", radius=0.1, mass=3.0, position=[0.5, 0, 0], axle={"point": [0, 0, 0], "direction": [0, 1, 0]}
    )
    found = solved(
        None, {"name": "angle", "quantity": "axle_angle", "body": "arm"},
        {"name": "held", "quantity": "support_force", "body": "arm", "component": "z"},
        web=WEB, cable=SOFT, body=[arm], gravity={"acceleration": [0.0, 0.0, -G]},
    ).results  # fmt: skip
    assert found["angle"].value == pytest.approx(0.5 * np.pi, abs=1e-8)
    assert found["held"].value == pytest.approx(3.0 * G, rel=1e-12)


def test_a_step_of_newton_moves_no_point_of_a_body_by_more_than_half_its_thickness():
    """The farthest point of a rod on an axle is its arm and its extent away; only contact limits how far it moves."""
    touching = {"web": WEB, "cable": SOFT, "body": [ROD], "contact": {"stiffness": 1e3}, "solve": {"kind": "static"}}
    touching["gravity"] = {"acceleration": [0.0, 0.0, -G]}
    system = refweb.Scene.from_dict(touching).build()
    (rod,), step = system.net.bodies, np.zeros((system.rows, 3))
    step[rod.spin] = (0.0, 1.5, 0.0)
    share = system.largest_share(step.ravel()[system.free])
    assert share * 1.5 * (ARM + rod.extent) == pytest.approx(0.5 * rod.thickness, rel=1e-12)
    assert rod.extent == pytest.approx(0.5 * np.hypot(0.1, np.hypot(0.2, 0.6)), rel=0.1)  # of a box with round edges
    free = refweb.Scene.from_dict({key: table for key, table in touching.items() if key != "contact"}).build()
    alone = np.zeros((free.rows, 3))
    alone[free.net.bodies[0].spin] = (0.0, 0.01, 0.0)
    assert free.largest_share(alone.ravel()[free.free]) == 1.0


@pytest.mark.slow
def test_a_flap_that_falls_onto_a_rope():
    """It rests there, and does not step over the rope to hang; the other rest is told of.

    Closed form: the rope slides along the flap until its two sides lie across it, at the distance s from the axle. They
    touch the round of R at R tan φ from the middle, where T tan φ = (1 − R tan φ/l) P balances, and push by 2 P cos φ.
    Contact of 1e9 N/m, of which a share 4 R tan φ/l is felt so near an end, gives way by 1e-6 m.
    """
    radius, rope = 0.05, np.array([0.8, -0.06])
    body = {"name": "flap", "shape": "capsule", "radius": radius, "length": 1.0, "axis": [1, 0, 0], "mass": 2.0}
    body |= {"position": [0.5, 0.0, 0.0], "axle": {"point": [0, 0, 0], "direction": [0, 1, 0]}}
    web = {"kind": "inline", "points": [[rope[0], y, rope[1]] for y in (-1, 1)], "lines": [[0, 1]], "supports": [0, 1]}
    solution = solved(
        None, {"name": "angle", "quantity": "axle_angle", "body": "flap"},
        {"name": "tension", "quantity": "tension", "select": "max"},
        web=web, body=[body], gravity={"acceleration": [0.0, 0.0, -10.0]}, contact={"stiffness": 1e9},
        cable={"law": "tension-only", "modulus": 1e9, "area": 1e-6, "density": 0, "subdivide": 2, "prestrain": 1e-3},
    )  # fmt: skip

    def rest(angle):
        reach = rope @ [np.cos(angle), -np.sin(angle)]
        above = rope @ [np.sin(angle), np.cos(angle)]
        side = brentq(lambda side: np.tan(side) - radius / np.cos(side) - above, 0.0, 1.0)
        tension = 1e3 * (1.001 / np.cos(side) - 1.0)
        push = tension * np.tan(side) / (1.0 - radius * np.sin(side))
        return 20.0 * 0.5 * np.cos(angle) - 2.0 * push * np.cos(side) * reach, tension

    angle = brentq(lambda angle: rest(angle)[0], 0.1, 1.0)
    assert solution.results["angle"].value == pytest.approx(angle, rel=1e-5)
    assert solution.results["tension"].value == pytest.approx(rest(angle)[1], rel=1e-5)
    assert solution.solver["smallest_pivot"] == 1
    assert any('"flap" rests by contact, and its axle lets it rest elsewhere' in text for text in solution.warnings)


def test_a_torque_that_nothing_balances_is_refused():
    body = NO | {"axle": {"direction": [0, 0, 1], "torque": 0.5}}
    with pytest.raises(refweb.SolverError, match='"it" is turned by its torque of 0.5 N m at step 1, and nothing'):
        solved(None, "axle_angle", body=[body])
    tables, _ = flap(0)
    with pytest.raises(refweb.InputError, match='"relaxation" must be "newton" with body "flap", which turns about'):
        solved(None, "axle_angle", **tables, solve={"method": "relaxation"})


def test_a_torque_above_what_the_web_can_balance_is_told():
    """A rope from the rim of a wheel: its moment EA (l/L − 1) dl/dφ has a maximum over the angle φ."""
    wheel = {
        "name": "wheel", "shape": "cylinder", "radius": 0.1, "length": 0.4, "axis": [0, 0, 1], "mass": 1.0,
        "position": [1, 0, 0],
    }  # fmt: skip
    angle = np.linspace(0.0, np.pi, 2001)
    rim = np.array([1.0 + 0.1 * np.sin(angle), 0.1 * np.cos(angle)])
    stretch = np.linalg.norm(rim, axis=0) / np.hypot(1.0, 0.1) - 1.0
    most = (1e3 * np.maximum(stretch, 0.0) * np.abs(np.gradient(np.linalg.norm(rim, axis=0), angle))).max()

    def run(torque):
        return refweb.run(
            refweb.Scene.from_dict(
                {
                    "web": {"kind": "inline", "points": [[0, 0, 0], [1, 0.1, 0]], "lines": [[0, 1]], "supports": [0]},
                    "cable": {"law": "tension-only", "modulus": 1e8, "area": 1e-5, "density": 0.0},
                    "body": [wheel | {"axle": {"direction": [0, 0, 1], "torque": -torque}}],
                    "attach": [{"body": "wheel", "node": 1}],
                    "solve": {"kind": "static"},
                }
            )
        )

    assert run(0.9 * most).tension[0] > 0.0
    with pytest.raises(refweb.SolverError, match='"wheel" turns on about its axle by its torque .* lower the torque'):
        run(3.0 * most)


def test_modes_hold_a_body_on_an_axle_and_say_so():
    """A heavy rope beside it vibrates as it does alone."""

    def scene(body):
        return refweb.Scene(
            web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0, 1]),
            cable=refweb.Cable(law="linear", modulus=1e7, area=1e-5, density=1000.0, prestrain=1e-2, subdivide=4),
            effects=body,
            solve=refweb.Static(),
        )

    axle = {"point": [0.0, 5.0, 0.0], "direction": [1.0, 0.0, 0.0]}
    flap = refweb.Body(name="flap", shape="box", size=(0.2, 0.2, 0.2), mass=1.0, position=(0.0, 5.0, 0.3), axle=axle)
    alone, beside = (
        refweb.modes(scene(body).replace(solve=refweb.Dynamic(duration=1.0)), number=2) for body in ([], [flap])
    )
    np.testing.assert_allclose(beside.frequency, alone.frequency, rtol=1e-9)
    assert any("touch nothing are held" in text and "flap" in text for text in beside.warnings)


def test_a_flap_swings_about_its_equilibrium():
    """ω² of one mode is the second derivative of the energy of a program of one's own over I; a run there stays."""
    tables, energy = flap(1)
    axle = tables["body"][0]["axle"]
    axle["torque"] = [[0.0, axle["torque"][1][1]]]
    looked = {"name": "angle", "quantity": "axle_angle", "body": "flap"}
    angle, h = solved(None, looked, **tables).results["angle"].value, 1e-4
    second = (energy(angle + h) - 2.0 * energy(angle) + energy(angle - h)) / h**2
    solve = {"kind": "dynamic", "start": "equilibrium", "duration": 0.2}
    scene = refweb.Scene.from_dict({**tables, "solve": solve, "observe": [looked]})
    (body,) = scene.build().net.bodies
    modes = refweb.modes(scene, 1)
    assert (2.0 * np.pi * modes.frequency[0]) ** 2 == pytest.approx(second / body.moment, rel=1e-5)  # h² and rounding
    history = refweb.run(scene).history
    np.testing.assert_allclose(history["angle"], angle, rtol=0, atol=1e-9)
