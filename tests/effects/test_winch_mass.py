"""Mass that follows winches, of threads over rings and of lines, against the variable-mass equations by scipy."""

import nets
import numpy as np
import pytest
import threads
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from threads import EA, G

import refweb
from refweb.effects.wound_mass import WoundTerm
from refweb.errors import InputError

DENSE, RING, MASS, STRAIN = 0.8, 0.3, 0.5, 5e-3
"""ρA [kg/m], masses of ring and load [kg], and the strain at the start [1]: densities and masses are alike."""
SKEW = [[0, 0, 0], [1.0, 0, 0.4], [1.6, 0.2, -0.5]]
FLYING = [[0.5, 0.2, 0.3], [0.4, 0.3, -0.6]]
HUNG = [[0, 0, 0], [1.0, 0, 0], [1.0, 0, -1.0]]
STEPS = {
    "central-difference": {"step_size": 1e-4},
    "adams": {"method": "cvode", "family": "adams", "rtol": 1e-8},
    "bdf": {"method": "cvode", "rtol": 1e-7},
    "ida": {"method": "ida", "rtol": 1e-6, "duration": 0.1},
}
SEEN = [
    {"name": f"{what}{node}{axis}", "quantity": what, "node": node, "component": axis}
    for what in ("position", "velocity")
    for node in (1, 2)
    for axis in "xyz"
]


def scene(winch, solve, points=SKEW, velocities=FLYING, strain=STRAIN, end=0.2, **tables):
    """A load on a rope from a drum over a ring, which is free where it has a velocity."""
    free = velocities[0] is not None
    nodes = [0, 1, 2] if winch.get("end", "first") == "first" else [2, 1, 0]
    given = {
        "winch": [{"thread": "rope", "end": "first", "mass": "follows", **winch}],
        "accuracy": {"error": "none"},
        "gravity": {"acceleration": [0.0, 0.0, -G]},
        "velocity": [{"node": n, "value": v} for n, v in enumerate(velocities, 1) if v is not None],
        "observe": SEEN,
        "output": {"interval": 0.02},
    }
    rope = {"nodes": nodes, "prestrain": strain, "density": DENSE / 1e-5}
    solve = {"kind": "dynamic", "duration": end, **solve}
    masses = {1: RING, 2: MASS} if free else {2: MASS}
    return threads.scene(points, [0] if free else [0, 1], rope, solve, masses, **{**given, **tables})


def by_scipy(times, winch, points=SKEW, velocities=FLYING, strain=STRAIN):
    """Positions and velocities of ring and load, by DOP853; the thread stays taut.

    The node of the drum aside, m v' = F + ½ρA L' (v_d − v) at the ring and, of the second segment, at the load.
    """
    points, free = np.array(points, dtype=float), velocities[0] is not None
    built = np.linalg.norm(np.diff(points, axis=0), axis=1).sum() / (1.0 + strain)

    def rate(t, y):
        x, v = np.vstack([points[:1], y[:6].reshape(2, 3)]), np.vstack([np.zeros(3), y[6:12].reshape(2, 3)])
        away = np.diff(x, axis=0)
        lengths = np.linalg.norm(away, axis=1)
        along = away / lengths[:, None]
        grow, total = (np.diff(v, axis=0) * along).sum(axis=1), lengths.sum()
        natural = total / (1.0 + winch["tension"] / EA) if "tension" in winch else y[12]
        e = total / natural - 1.0
        assert e > 0.0
        if "tension" in winch:
            natural_rate = grow.sum() / (1.0 + e)
        elif "power" in winch:
            natural_rate = -winch["power"] / (EA * (e + 0.5 * e**2))
        else:
            natural_rate = -winch["speed"]
        share = lengths[1] / total
        of_load = share * natural_rate + natural * (grow[1] - share * grow.sum()) / total
        mass = np.array([RING + 0.5 * DENSE * natural, MASS + 0.5 * DENSE * share * natural])
        force = EA * e * np.array([along[1] - along[0], -along[1]])
        force[:, 2] -= mass * G
        force[0] -= 0.5 * DENSE * natural_rate * v[1]
        force[1] += 0.5 * DENSE * of_load * (v[1] - v[2])
        change = force / mass[:, None]
        if not free:
            change[0] = 0.0
        return np.concatenate([y[6:12], change.ravel(), [natural_rate]])

    start = [np.zeros(3) if v is None else v for v in velocities]
    y = np.concatenate([points[1:].ravel(), *start, [built]])
    return solve_ivp(rate, (0.0, times[-1]), y, "DOP853", times, rtol=1e-10, atol=1e-12, max_step=1e-3).y[:12]


def off(history, truth):
    """Largest errors of positions [m] and of velocities [m/s]."""
    errors = np.abs(np.array([history[seen["name"]] for seen in SEEN]) - truth)
    return errors[:6].max(), errors[6:].max()


TENSION, POWER = {"tension": EA * STRAIN}, {"power": 20.0, "speed_limit": 50.0}
LOWERED = {"points": HUNG, "velocities": [None, [0.1, 0.2, -0.4]], "strain": (MASS + 0.5 * DENSE) * G / EA}


@pytest.mark.ordinary("central-difference-winch0-more0", "bdf-winch7-more7")
@pytest.mark.parametrize(
    "method, winch, more",
    [
        ("central-difference", TENSION, {}),
        ("adams", {**TENSION, "end": "last"}, {}),
        ("ida", TENSION, {}),
        ("central-difference", {**POWER, "end": "last"}, {}),
        ("ida", POWER, {}),
        ("central-difference", {"speed": -0.4}, LOWERED),
        ("adams", {"speed": -0.4, "end": "last"}, LOWERED),
        ("bdf", {"speed": -0.4}, LOWERED),
    ],
)
def test_a_load_over_a_ring(method, winch, more):
    """As by scipy; explicit steps close the balance of momentum to rounding, others as their tolerance."""
    run = refweb.run(scene(winch, STEPS[method], **more))
    place, speed = off(run.history, by_scipy(run.history["time"], winch, **more))
    assert place < 2e-5 and speed < 2e-3  # of 0.1 m and 1 m/s; without the mass that comes 3e-2 m
    assert run.solver["energy_drift"] < 1e-3
    assert run.solver["momentum_drift"] < (1e-12 if method == "central-difference" else 1e-4)
    assert np.abs(run.history["work"]).max() > 4e-3  # of what comes through the drum


def test_explicit_steps_are_of_order_two():
    errors = []
    for count in (500, 2000):
        run = refweb.run(scene(TENSION, {"step_size": 0.2 / count}))
        errors.append([*off(run.history, by_scipy(run.history["time"], TENSION)), run.solver["energy_drift"]])
    assert (np.log(np.array(errors[0]) / errors[1]) / np.log(4.0)).min() > 1.9


def total_of(run, mass):
    """Mass of the state at the end, by the output of VTU files [kg]."""
    state = run.state
    return state.system.at(state.time, state.x).net.mass.sum() - mass


def test_it_is_resumed_bit_for_bit_and_frames_have_the_mass_of_their_time(tmp_path):
    winch = {"speed": -0.4}
    whole, resumed = nets.whole_and_resumed(scene(winch, STEPS["central-difference"], **LOWERED), tmp_path)
    for name, values in whole.history.items():
        np.testing.assert_array_equal(resumed.history[name], values, err_msg=name)
    length = 2.0 / (1.0 + LOWERED["strain"]) + 0.4 * 0.2
    assert total_of(whole, MASS) == pytest.approx(DENSE * length, rel=1e-12)
    refweb.run(scene(winch, STEPS["central-difference"], end=0.1, **LOWERED), tmp_path / "first")
    further = scene(winch, {"step_size": 1e-4, "start": str(tmp_path / "first")}, end=0.1, **LOWERED)
    assert total_of(refweb.run(further), MASS) == pytest.approx(DENSE * length, rel=1e-12)


def test_it_is_the_same_in_axes_that_turn():
    """Seen from axes that turn by Ω about the drum: places, and closed balances of energy and momentum."""
    omega, none = np.array([0.3, -0.4, 1.2]), {"gravity": []}
    back = Rotation.from_rotvec(-0.2 * omega)
    turning = [np.subtract(v, np.cross(omega, x)).tolist() for v, x in zip(FLYING, SKEW[1:], strict=True)]
    errors = []
    for steps in ({"step_size": 2e-4}, {"step_size": 1e-4}, STEPS["adams"]):
        still = refweb.run(scene(TENSION, steps, **none))
        tables = {"frame": {"angular_velocity": omega.tolist()}}
        run = refweb.run(scene(TENSION, steps, velocities=turning, **none, **tables))
        expected = back.apply(still.positions[1:3])
        errors.append(np.abs(expected - run.positions[1:3]).max())
        assert run.solver["energy_drift"] < 1e-4 and run.solver["momentum_drift"] < 1e-4
    assert errors[1] < 0.3 * errors[0] < 1e-5 and errors[2] < 1e-6  # of order 2


def test_tangents_of_what_has_come():
    """Forces of gravity and of turning axes on it: tangents by differences, and powers that are those of the forces."""
    given = scene(TENSION, {}, frame={"angular_velocity": [0.3, -0.4, 1.2]})
    system = given.build()
    terms = [term for term in system.terms if isinstance(term, WoundTerm)]
    assert [term.name for term in terms] == ["gravity", "frame", "frame"]
    rng, h = np.random.default_rng(5), 1e-6
    x, v, step = (0.1 * rng.normal(size=(system.rows, 3)) for _ in range(3))
    for rows in (x, v, step):
        rows[system.net.nodes :] = 0.0
    nodes = terms[0].cells[0]
    for term in terms:
        places, velocities = term.tangent.stiffness, term.velocity.damping
        for kernel, moved in ((places, (1.0, 0.0)), (velocities, (0.0, 1.0))):
            sides = [
                system.force_of(term, 0.1, x + s * h * moved[0] * step, v + s * h * moved[1] * step)
                for s in (1.0, -1.0)
            ]
            change, block = (sides[0] - sides[1])[nodes].ravel() / (2.0 * h), np.zeros((1, 9, 9))
            if kernel is not None:
                kernel(0.1, x, v, block, term.cells, term.data, False)
            if kernel is not None or moved[1]:
                np.testing.assert_allclose(-block[0] @ step[nodes].ravel(), change, rtol=0, atol=1e-6)
        if places is not None:
            out, force = np.zeros((1, 2)), np.zeros_like(x)
            term.force(0.1, x, v, force, term.cells, term.data, out)
            assert out[0, 0] == pytest.approx((force * v).sum(), rel=1e-12)
            assert np.abs(force).max() > 1e-2
        else:
            assert abs((system.force_of(term, 0.1, x, v) * v).sum()) < 1e-12


def test_statics_with_the_weight_that_has_come():
    """A rope at a tension between two supports sags until three nodes carry the weight that its length has.

    Its middle hangs in a ring without mass, and its ends are halves of segments: W = 2 T sin α, W = M g + ½ρA L g.
    """
    pull = 12.0
    points = [[0, 0, 0], [1.0, 0, -0.4], [2.0, 0, 0]]
    given = {
        "winch": [{"thread": "rope", "end": "first", "mass": "follows", "tension": pull}],
        "gravity": {"acceleration": [0.0, 0.0, -G]},
        "observe": [{"name": "z", "quantity": "position", "node": 1, "component": "z"}],
    }
    rope = {"nodes": [0, 1, 2], "density": DENSE / 1e-5}
    run = refweb.run(threads.scene(points, [0, 2], rope, {"kind": "static"}, {1: 0.2}, **given))

    def excess(depth):
        length = np.hypot(1.0, depth)
        weight = (0.2 + 0.5 * DENSE * 2.0 * length / (1.0 + pull / EA)) * G
        return 2.0 * pull * depth / length - weight

    depth = brentq(excess, 0.1, 1.0)
    assert -run.results["z"].value == pytest.approx(depth, rel=1e-7)


LINE = [[0, 0, 0], [0, 0, -3.0]]
CABLE = {"law": "tension-only", "modulus": 1e10, "area": 1e-5, "density": DENSE / 1e-5}


def on_line(solve, mass=2.0, **tables):
    """A load on a line of 3 m, which its weight stretches; no step of it is slack."""
    weight = (mass + 1.5 * DENSE) * G
    given = {
        "web": {"kind": "inline", "points": LINE, "lines": [[0, 1]]},
        "supports": {"nodes": [0]},
        "cable": {**CABLE, "prestrain": weight / 1e5},
        "gravity": {"acceleration": [0.0, 0.0, -G]},
        "point_mass": [{"node": 1, "mass": mass}],
        "velocity": [{"node": 1, "value": [0.1, 0.0, 0.8]}],
        "observe": [{"name": "z", "quantity": "position", "node": 1, "component": "z"}],
        "output": {"interval": 0.05},
        "accuracy": {"error": "none"},
        "solve": {"kind": "dynamic", "duration": 0.4, **solve},
    }
    return refweb.Scene.from_dict({name: value for name, value in {**given, **tables}.items() if value is not None})


@pytest.mark.ordinary("central-difference")
@pytest.mark.parametrize("method", ["central-difference", "adams", "ida"])
def test_a_line_at_a_speed_is_one_on_a_reel(method):
    """A reel that changes the natural length at the same rate, with mass that follows: in equal steps to rounding.

    A winch leaves out the velocity at which material slides. That of the reel begins at once, and takes ¼ρA L'·3 m from
    the momentum of the load, which is given beside.
    """
    natural = 3.0 / (1.0 + (2.0 + 1.5 * DENSE) * G / 1e5)
    reel = [{"lines": [0], "factor": [[0.0, 1.0], [1.0, 1.0 - 0.8 / natural]], "mass": "follows"}]
    slid = 0.25 * DENSE * 0.8 * 3.0 / (2.0 + 0.5 * DENSE * natural)
    thrown = [{"node": 1, "value": [0.1, 0.0, 0.8 + slid]}]
    wound, reeled = (
        refweb.run(on_line(STEPS[method], **tables)).history
        for tables in (
            {"winch": [{"lines": 0, "speed": 0.8, "mass": "follows"}]},
            {"reel": reel, "velocity": thrown},
        )
    )
    np.testing.assert_allclose(wound["z"], reeled["z"], rtol=0, atol=1e-10 if method == "central-difference" else 1e-7)
    work = wound["work"] - wound["winch_energy"]
    np.testing.assert_allclose(work, reeled["work"], atol=2e-5 if method == "central-difference" else 1e-3)


@pytest.mark.ordinary("winch1")
@pytest.mark.parametrize(
    "winch", [{"tension": 30.0}, {"power": 40.0, "speed_limit": 9.0}, {"speed": 0.1, "limit": 40.0}]
)
def test_a_line_is_a_thread_of_two_nodes(winch):
    rope = {"name": "rope", "nodes": [0, 1], **CABLE, "prestrain": (2.0 + 1.5 * DENSE) * G / 1e5}
    far = {"web": {"kind": "inline", "points": [*LINE, *threads.FAR], "lines": [[2, 3]]}}
    far |= {"supports": {"nodes": [0, 2, 3]}, "thread": [rope]}
    kinds = ({"lines": 0, "drum": 0}, {}), ({"thread": "rope", "end": "first"}, far)
    line, thread = (
        refweb.run(on_line({"step_size": 1e-4}, winch=[{**of, **winch, "mass": "follows"}], **tables)).history
        for of, tables in kinds
    )
    for name in ("z", "kinetic_energy", "strain_energy", "winch_energy", "work"):
        changes = [history[name] - history[name][0] for history in (line, thread)]  # beside what a line far away has
        np.testing.assert_allclose(*changes, rtol=0, atol=1e-9, err_msg=name)


@pytest.mark.parametrize("of", ["lines", "thread"])
def test_commands(of):
    """All terms of a tension that is set have the numbers of one of the scene, and balances stay closed."""
    winch, tables = {"lines": 0, "mass": "follows"}, {}
    if of == "thread":
        rope = {"name": "rope", "nodes": [0, 1], **CABLE}
        tables = {"web": {"kind": "inline", "points": [*LINE, *threads.FAR], "lines": [[2, 3]]}}
        tables |= {"supports": {"nodes": [0, 2, 3]}, "thread": [rope]}
        winch = {"thread": "rope", "end": "first", "mass": "follows"}
    run, other = (
        refweb.start(on_line({"step_size": 1e-4}, winch=[{**winch, "tension": tension}], **tables))
        for tension in (30.0, 20.0)
    )
    run.set("winch.0.tension", 20.0)
    run.advance(0.1)
    assert run.finish().solver["energy_drift"] < 1e-4
    numbers = ([term.data for term in one.state.system.terms if term.data is not None] for one in (run, other))
    for one, expected in zip(*numbers, strict=True):
        np.testing.assert_array_equal(one, expected)


@pytest.mark.parametrize("method", ["central-difference", "adams"])
def test_what_material_brings_is_work_where_nothing_else_does_any(method):
    """A line whose end goes with it: what it has taken up of energy is work and that of the winch."""
    given = {"gravity": None, "observe": [{"name": "brought", "quantity": "work"}]}
    run = refweb.run(on_line(STEPS[method], winch=[{"lines": 0, "speed": 0.8, "mass": "follows"}], **given))
    history, change = run.history, {name: values - values[0] for name, values in run.history.items()}
    assert np.abs(change["work"]).max() > 1e-3
    np.testing.assert_array_equal(history["brought"], history["work"])
    closing = change["total_energy"] - change["work"]
    np.testing.assert_allclose(closing, 0.0, atol=1e-4 * np.abs(history["total_energy"]).max())


def test_gravity_leaves_what_a_winch_was_told():
    """Also where both are set at one row: the weight of what has come has the numbers of both."""
    tables = {"web": {"kind": "inline", "points": [*LINE, *threads.FAR], "lines": [[2, 3]]}}
    tables |= {"supports": {"nodes": [0, 2, 3]}, "thread": [{"name": "rope", "nodes": [0, 1], **CABLE}]}
    of, weight = {"thread": "rope", "end": "first", "mass": "follows"}, [0.0, 0.0, -2.0]
    run = refweb.start(on_line({"step_size": 1e-4}, winch=[{**of, "speed": 0.1}], **tables))
    other = on_line({}, winch=[{**of, "speed": 0.4}], **{**tables, "gravity": {"acceleration": weight}})
    run.set("winch.0.speed", 0.4)
    run.set("gravity.acceleration", weight)
    run.advance()
    numbers = [[term.data for term in system.terms if isinstance(term, WoundTerm)] for system in
               (run.state.system, other.build())]  # fmt: skip
    np.testing.assert_array_equal(*numbers)


@pytest.mark.parametrize(
    "winch, tables, message",
    [
        ({"mass": "stay"}, {}, 'did you mean "stays"'),
        ({"drum": 0, "mass": "stays"}, {}, r'drum = 0 has no meaning where mass = "stays": leave it out'),
        ({}, {"supports": {"nodes": [0, 1]}}, r'\[\[winch\]\] mass = "follows": 2 ends of line 0 are supported'),
        ({"drum": [0, 1]}, {}, "2 ends of line 0 are of drum, must be one: name the node at the drum of each line"),
        ({}, {"supports": None}, "0 ends of line 0 are supported, moved or on a body, must be one"),
        ({}, {"solve": {"kind": "dynamic", "duration": 1.0, "method": "cvode", "mass": "consistent"}}, '"lumped"'),
        ({}, {"damping": {"rate": 1.0}}, r"rate = 1 takes masses that stay: leave it out, or \[\[winch\]\] mass"),
        ({}, {"reel": [{"lines": 0, "factor": [[0.0, 1.0]], "mass": "follows"}]}, r"line 0 is on a \[\[winch\]\]"),
    ],
)
def test_refused(winch, tables, message):
    with pytest.raises(InputError, match=message):
        on_line(**{"solve": {}, **tables}, winch=[{"lines": 0, "speed": 0.0, "mass": "follows", **winch}]).build()


def test_a_thread_takes_no_drum():
    with pytest.raises(InputError, match="drum = 0 has no meaning where the winch has a thread"):
        scene({"speed": 0.0, "drum": 0}, {})


def test_beside_a_reel_and_on_a_body():
    """A load on a thread from a drum on a body of 1e12 kg, and on a line that a reel pays out, both with their mass.

    Explicit steps and Adams' method agree, balances close, and the mass is that of both lengths, without what is on
    the body.
    """
    given = {
        "web": {"kind": "inline", "points": [[0, 0, 0], [0.6, 0.1, -1.0], [1.4, 0, 0.2]], "lines": [[1, 2]]},
        "supports": {"nodes": [2]},
        "cable": {**CABLE, "modulus": 1e9},
        "body": [{"name": "ship", "radius": 0.05, "mass": 1e12, "position": [-0.1, 0.0, 0.0]}],
        "attach": [{"body": "ship", "node": 0}],
        "thread": [{"name": "rope", "nodes": [0, 1], **CABLE, "modulus": 1e9}],
        "winch": [{"thread": "rope", "end": "first", "tension": 30.0, "mass": "follows"}],
        "reel": [{"lines": [0], "factor": [[0.0, 1.0], [0.4, 1.3]], "mass": "follows"}],
        "point_mass": [{"node": 1, "mass": MASS}],
        "velocity": [{"node": 1, "value": [0.2, -0.3, -0.5]}],
        "observe": [{"name": axis, "quantity": "position", "node": 1, "component": axis} for axis in "xyz"],
        "accuracy": {"error": "none"},
    }
    runs = []
    for keys in ({"step_size": 1e-4}, {"method": "cvode", "family": "adams", "rtol": 1e-8}):
        solve = {"kind": "dynamic", "duration": 0.2, **keys}
        run = refweb.run(refweb.Scene.from_dict({**given, "solve": solve}))
        assert run.solver["momentum_drift"] < 1e-6
        runs.append(np.array([run.results[axis].value for axis in "xyz"]))
    np.testing.assert_allclose(*runs, rtol=0, atol=2e-5)
    state = run.state
    mass = state.system.at(state.time, state.x).net.mass[1]
    length = np.linalg.norm(state.position[1] - state.position[0]) / (1.0 + 30.0 / 1e4)
    built = np.linalg.norm([0.8, -0.1, 1.2])
    assert mass == pytest.approx(MASS + 0.5 * DENSE * (length + 1.15 * built), rel=1e-6)


def test_both_ends_of_a_thread_are_alike():
    """A load on a thread that is wound at its last end moves as on the same thread from its other end."""
    found = []
    for nodes, end in (([0, 1, 2], "first"), ([2, 1, 0], "last")):
        given = {
            "web": {"kind": "inline", "points": [[0, 0, 0], [0.7, 0.1, -0.2], [0.9, 0, -1.0]], "lines": [[0, 1]]},
            "supports": {"nodes": [0, 1]},
            "cable": CABLE,
            "thread": [{"name": "rope", "nodes": nodes, **CABLE}],
            "winch": [{"thread": "rope", "end": end, "tension": 30.0, "mass": "follows"}],
            "point_mass": [{"node": 2, "mass": MASS}],
            "gravity": {"acceleration": [0.0, 0.0, -9.81]},
            "observe": [{"name": axis, "quantity": "position", "node": 2, "component": axis} for axis in "xyz"],
            "accuracy": {"error": "none"},
            "solve": {"kind": "dynamic", "duration": 0.2, "step_size": 1e-4},
        }
        run = refweb.run(refweb.Scene.from_dict(given))
        state = run.state
        masses = state.system.at(state.time, state.x).net.mass[:3]
        found.append([*(run.results[axis].value for axis in "xyz"), *masses, run.solver["momentum_drift"]])
    np.testing.assert_allclose(found[1][:-1], found[0][:-1], rtol=1e-9)
    assert max(found[0][-1], found[1][-1]) < 1e-9


@pytest.mark.slow
def test_a_drawstring_of_a_free_net():
    """A closed thread that rubs at its rings and slips on a winch at one of them: methods agree, balances close."""
    corners = [[0, 0, 0], [1, 0, 0.1], [1, 1, 0], [0, 1, -0.1]]
    lines = {"law": "tension-only", "modulus": 1e8, "area": 1e-5}
    given = {
        "web": {"kind": "inline", "points": [*corners, [0.5, 0.5, 0.6]], "lines": [[n, 4] for n in range(4)]},
        "supports": {"nodes": []},
        "cable": {**lines, "density": 1e4},
        "thread": [{"name": "string", "nodes": [0, 1, 2, 3], "closed": True, "friction": 0.2, **lines, "density": 5e4}],
        "winch": [{"thread": "string", "speed": [[0.0, 0.0], [0.1, 2.0]], "limit": 20.0, "mass": "follows"}],
        "point_mass": [{"node": [0, 1, 2, 3], "mass": 0.2}],
        "velocity": [{"node": 4, "value": [0.3, -0.2, 0.5]}],
        "accuracy": {"error": "none"},
    }
    ends = []
    for keys in ({"step_size": 1e-4}, {"method": "cvode", "family": "adams", "rtol": 1e-8}):
        run = refweb.run(refweb.Scene.from_dict({**given, "solve": {"kind": "dynamic", "duration": 0.3, **keys}}))
        state = run.state
        assert run.solver["momentum_drift"] < 1e-6
        ends.append(np.column_stack([state.position[:5], state.system.at(state.time, state.x).net.mass[:5]]))
    np.testing.assert_allclose(*ends, rtol=0, atol=1e-5)
    (thread,), net = state.system.net.threads, state.system.net
    string = thread.natural_lengths(thread.slips(state.x)).sum()
    assert string < 0.95 * thread.natural_length
    assert ends[1][:, 3].sum() == pytest.approx(0.8 + 0.1 * net.natural_length.sum() + 0.5 * string, rel=1e-12)
