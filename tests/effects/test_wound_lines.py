"""Lines on winches: closed forms, threads of two nodes on the same winches, reels, statics and the balances."""

import nets
import numpy as np
import pytest
import threads
from threads import FAR, G

import refweb
from refweb.effects.wound_lines import SLIP, numbers_in

EA, MASS = 1e5, 2.0
CABLE = {"law": "tension-only", "modulus": 1e10, "area": 1e-5, "density": 0.0}
HANGING = [[0, 0, 0], [0, 0, -3.0]]
METHODS = {
    "central-difference": {"step_size": 1e-4},
    "bdf": {"method": "cvode", "rtol": 1e-7},
    "adams": {"method": "cvode", "family": "adams", "rtol": 1e-8},
    "ida": {"method": "ida", "rtol": 1e-7},
}
TENSION, BRAKE = {"tension": 30.0, "speed_limit": 1.2}, {"speed": 0.0, "limit": 50.0}
SPEEDS = {"speed": [[0.0, 0.0], [0.1, 0.6], [0.3, -0.4]]}


def scene(points, lines, supports, winch, solve, **tables):
    """A scene of lines, those of ``winch`` on it."""
    given = {
        "web": {"kind": "inline", "points": points, "lines": lines},
        "supports": {"nodes": supports},
        "cable": CABLE,
        "winch": winch if isinstance(winch, list) else [winch],
        "accuracy": {"error": "none"},
        "solve": solve,
    }
    return refweb.Scene.from_dict({name: value for name, value in {**given, **tables}.items() if value != []})


def hanging(winch, solve, start=0.0, pull=0.0, thread=False, **tables):
    """A mass on 3 m of line below a winch, at a velocity and a tension at the start; or on a ``thread``."""
    on = {"thread": "rope"} if thread else {"line": 0}
    given = {
        "point_mass": [{"node": 1, "mass": MASS}],
        "gravity": {"acceleration": [0.0, 0.0, -G]},
        "velocity": [{"node": 1, "value": [0.0, 0.0, start]}] if start else [],
        "output": {"interval": 0.05},
        "observe": [
            {"name": "z", "quantity": "displacement", "node": 1, "component": "z"},
            {"name": "pull", "quantity": "tension", **on},
            {"name": "largest", "quantity": "tension", "reduce": "max", **on},
        ],
    }
    solve = {"kind": "dynamic", "duration": 0.4, **solve}
    if thread:
        rope = {"nodes": [0, 1], "modulus": 1e10, "prestrain": pull / EA}
        winch = {"thread": "rope", "end": "first", **winch}
        given |= {"accuracy": {"error": "none"}, "winch": [winch]}
        return threads.scene(HANGING, [0], rope, solve, **{**given, **tables})
    given["cable"] = {**CABLE, "prestrain": pull / EA}
    winches = [{"lines": 0, **winch}] if winch else []
    return scene(HANGING, [[0, 1]], [0], winches, solve, **{**given, **tables})


def closed(history, size):
    """The balance of energy with what the winch has taken."""
    np.testing.assert_allclose(history["total_energy"], history["total_energy"][0], atol=size)


POWER = {"power": 30.0, "speed_limit": 20.0}
HAULED, SLIPPED, TURNED = (TENSION, 0.0, 30.0), (BRAKE, -1.5, 0.0), (SPEEDS, 0.0, MASS * G)
LIFTED = (POWER, 0.0, MASS * G)


@pytest.mark.ordinary("central-difference-winch1--1.5-0.0", "central-difference-winch3-0.0-19.62")
@pytest.mark.parametrize(
    "method, winch, start, pull",
    [
        *(("central-difference", *case) for case in (HAULED, SLIPPED, TURNED, LIFTED)),
        ("bdf", *HAULED),
        ("ida", *SLIPPED),
        ("adams", *TURNED),
    ],
)
def test_a_line_is_a_thread_of_two_nodes(method, winch, start, pull):
    """The same motion, tension and energies, to rounding in equal steps and to what steps that are chosen allow."""
    exact = method == "central-difference"
    solve = METHODS[method] | ({} if exact else {"duration": 0.25})
    line, thread = (refweb.run(hanging(winch, solve, start, pull, on)).history for on in (False, True))
    for name in ("z", "winch_energy", "kinetic_energy", "strain_energy"):
        size = np.abs(thread["z" if name == "z" else "kinetic_energy"]).max()
        np.testing.assert_allclose(line[name], thread[name], atol=size * (1e-9 if exact else 1e-3), err_msg=name)
    np.testing.assert_allclose(line["pull"], thread["pull"], atol=1e-6 if exact else 0.05 * thread["pull"].max())
    closed(line, 5e-3)


@pytest.mark.ordinary("central-difference", "adams")
@pytest.mark.parametrize("method", METHODS)
def test_a_lift_at_a_power(method):
    """The load gets P t in all; as fast as the weight allows, P/(m g), it is at t(v) in closed form.

    Of a line that does not stretch m v' = P/v − m g; the line here differs by its stretch.
    """
    power, weight = POWER["power"], MASS * G
    history = refweb.run(hanging(POWER, METHODS[method], pull=weight)).history
    last = power / weight
    speeds = np.linspace(0.0, (1.0 - 1e-9) * last, 100_001)
    times = -speeds / G - last / G * np.log1p(-speeds / last)
    ways = np.append(0.0, np.cumsum(0.5 * np.diff(times) * (speeds[1:] + speeds[:-1])))
    rise = np.interp(history["time"], times, ways)
    np.testing.assert_allclose(history["z"][3:], rise[3:], atol=2.0 * weight * 3.0 / EA)
    np.testing.assert_allclose(history["winch_energy"], -power * history["time"], rtol=1e-9, atol=1e-9)
    closed(history, 1e-4)


def test_powers_of_several_lines_beside_a_thread():
    """Loads apart from each other move as each would alone, on unknowns of lines and of a thread."""
    x = np.arange(3.0)
    points = [[at, 0.0, z] for at in x for z in (0.0, -3.0)]
    lines = [[0, 1], [2, 3]]
    tables = {
        "cable": {**CABLE, "prestrain": MASS * G / EA},
        "gravity": {"acceleration": [0.0, 0.0, -G]},
        "point_mass": [{"node": [1, 3, 5], "mass": MASS}],
        "thread": [{"name": "rope", "nodes": [4, 5], **CABLE, "prestrain": MASS * G / EA}],
        "observe": [{"name": f"z{n}", "quantity": "displacement", "node": n, "component": "z"} for n in (1, 3, 5)],
        "output": {"interval": 0.01},
    }
    winches = [
        {"thread": "rope", "end": "first", **POWER},
        {"lines": [1], "power": 10.0, "speed_limit": 1.0},
        {"lines": [0], **POWER},
    ]
    solve = {"duration": 0.05, **METHODS["adams"]}
    together = refweb.run(scene(points, lines, [0, 2, 4], winches, {"kind": "dynamic", **solve}, **tables)).history
    alone = {"duration": 0.05, **METHODS["central-difference"]}
    for name, winch in (("z1", POWER), ("z3", {"power": 10.0, "speed_limit": 1.0})):
        one = refweb.run(hanging(winch, alone, pull=MASS * G, output={"interval": 0.01})).history["z"]
        np.testing.assert_allclose(together[name], one, atol=1e-6)
    np.testing.assert_allclose(together["z1"], together["z5"], atol=1e-9)


@pytest.mark.ordinary("central-difference")
@pytest.mark.parametrize("method", ["central-difference", "ida"])
def test_constant_tension(method):
    """m a = T − m g until the speed limit; behind it the load rises at this, and swings about it."""
    history = refweb.run(hanging(TENSION, METHODS[method], pull=30.0)).history
    rise, time = 30.0 / MASS - G, history["time"]
    fast = 1.2 * (1.0 + 30.0 / EA)  # of the load, while the tension stays
    before = time < fast / rise
    assert 3 < before.sum() < len(time)
    np.testing.assert_allclose(history["z"][before], 0.5 * rise * time[before] ** 2, atol=2e-5)
    np.testing.assert_allclose(history["pull"][before], 30.0, rtol=2e-3)
    at = fast / rise
    swing = 3.0 * MASS * rise / EA  # by the change of the tension to the weight
    there = 0.5 * rise * at**2 + fast * (time[~before] - at)
    np.testing.assert_allclose(history["z"][~before], there, atol=2.0 * swing + 1e-4)
    hauled = history["z"][before] / (1.0 + 30.0 / EA)
    given = 30.0 * (1.0 + 30.0 / EA) - 0.5 * 30.0**2 / EA  # Y = T (1 + ε) − W
    np.testing.assert_allclose(history["winch_energy"][before], -given * hauled, rtol=1e-3, atol=1e-5)


@pytest.mark.parametrize("method", ["central-difference", "bdf", "adams"])
def test_brake(method):
    """A load comes to rest m v²/2F further, at a deceleration F/m, and half an elastic stretch."""
    force, speed = BRAKE["limit"], 1.5
    run = refweb.run(hanging(BRAKE, METHODS[method], -speed, gravity=[], output={"interval": 0.01}))
    energy, stretch, history = 0.5 * MASS * speed**2, force * 3.0 / EA, run.history
    assert run.results["largest"].value == pytest.approx(force, rel=1e-6)
    assert history["z"].min() == pytest.approx(-(energy / force + 0.5 * stretch), rel=1e-3)
    slips = (history["time"] > 0.005) & (history["time"] < 0.06)
    np.testing.assert_allclose(np.diff(history["z"][slips], 2) / 0.01**2, force / MASS, rtol=1e-3)
    given = force * (1.0 + force / EA) - 0.5 * force**2 / EA  # Y = T (1 + ε) − W
    paid = (energy / force - 0.5 * stretch) / (1.0 + force / EA)
    assert history["winch_energy"][-1] == pytest.approx(given * paid, rel=1e-3)
    closed(history, 2e-3 * energy)


@pytest.mark.parametrize("method", ["central-difference", "adams"])
def test_speed_is_a_reel(method):
    """The same as a reel that changes the natural length at this constant speed, which its factor follows exactly."""
    weight, speed = MASS * G, 0.8
    natural = 3.0 / (1.0 + weight / EA)
    reel = [{"lines": [0], "factor": [[0.0, 1.0], [1.0, 1.0 - speed / natural]]}]
    wound, reeled = (
        refweb.run(hanging(winch, METHODS[method], pull=weight, **tables)).history
        for winch, tables in (({"speed": speed}, {}), (None, {"reel": reel}))
    )
    exact = method == "central-difference"
    np.testing.assert_allclose(wound["z"], reeled["z"], atol=1e-10 if exact else 1e-5)
    np.testing.assert_allclose(-wound["winch_energy"], reeled["work"], atol=1e-3 * np.abs(reeled["work"]).max())
    np.testing.assert_allclose(wound["strain_energy"], reeled["strain_energy"], atol=1e-8 if exact else 1e-4)


def test_methods_agree_within_their_errors():
    """Values at the end by three methods differ by no more than their errors together."""
    keys = {"central-difference": {}, "adams": {"method": "cvode", "family": "adams"}, "ida": {"method": "ida"}}
    runs = [refweb.run(hanging(TENSION, {**solve, "duration": 0.2}, accuracy=[])).results for solve in keys.values()]
    for name in ("z", "pull"):
        for first in runs:
            for second in runs:
                apart = abs(first[name].value - second[name].value)
                assert apart <= first[name].error + second[name].error + 1e-12 * abs(first[name].value)


def test_order_of_explicit_steps():
    """Order 2 of positions and of the balance, of a load that swings on a brake that slips and holds."""
    points, given = [[0, 0, 0], [0.6, 0.2, -0.9]], {"output": {"interval": 0.05}}
    given |= {"gravity": {"acceleration": [0.0, 0.0, -G]}, "point_mass": [{"node": 1, "mass": 0.3}]}
    given |= {"velocity": [{"node": 1, "value": [0.3, 0.2, -1.0]}], "cable": {**CABLE, "modulus": 1e8}}
    given |= {"observe": [{"name": "z", "quantity": "displacement", "node": 1, "component": "z"}]}

    def history(solve):
        solve = {"kind": "dynamic", "duration": 0.3, **solve}
        return refweb.run(
            scene(points, [[0, 1]], [0], {"lines": 0, "speed": 0.0, "limit": 5.0}, solve, **given)
        ).history

    exact, errors = history({"method": "cvode", "family": "adams", "rtol": 1e-9}), []
    for count in (750, 12000):
        found = history({"step_size": 0.3 / count})
        energy = found["total_energy"]
        errors.append([np.abs(found["z"] - exact["z"]).max(), np.abs(energy - energy[0]).max()])
    assert (np.log(np.array(errors[0]) / errors[1]) / np.log(16.0)).min() > 1.7
    assert np.ptp(exact["winch_energy"]) > 0.01


V = [[-1.0, 0, 0], [1.0, 0, 0], [0.0, 0.0, -1.0]]


@pytest.mark.parametrize("winch", [{"tension": 60.0}, {"speed": 0.0, "limit": 60.0}])
def test_statics_at_a_tension(winch):
    """A load between two lines: 2 T sin α = W at a tension, and where brakes slip; a step below that they hold."""
    weights = [40.0, 90.0]
    run = refweb.run(
        scene(
            V,
            [[0, 2], [1, 2]],
            [0, 1],
            {"lines": "all", **winch},
            {"kind": "static", "load_steps": [0.0, weights[0] / 90.0, 1.0] if "speed" in winch else [1.0]},
            load=[{"node": 2, "force": [0.0, 0.0, -weights[1]]}],
            observe=[
                {"name": "pull", "quantity": "tension", "line": 1},
                {"name": "strain", "quantity": "strain", "line": 0},
            ],
        )
    )
    for name, value in (("pull", 60.0), ("strain", 60.0 / EA)):  # to rounding, which ± has
        assert abs(run.results[name].value - value) <= run.results[name].error < 1e-6
    depth = np.tan(np.arcsin(weights[1] / 120.0))
    assert run.positions[2][2] == pytest.approx(-depth, rel=1e-7)
    finding = next(finding for finding in run.findings if finding.code == "not-proven")
    assert finding.text.startswith("lines are on a winch: ± are estimates for these load steps")
    if "speed" in winch:
        z, pull = run.history["pull"][1], run.history["pull"][0]
        assert pull == pytest.approx(0.0, abs=1e-6)
        sine = np.sqrt(0.5)  # as built, but for the stretch
        assert z == pytest.approx(weights[0] / 2.0 / sine, rel=2e-3)
        assert run.history["winch_energy"][1] == 0.0 < run.history["winch_energy"][2]


@pytest.mark.parametrize("winch", [{"tension": 10.0}, {"speed": 0.0, "limit": 10.0}])
def test_a_load_that_no_winch_carries(winch):
    """A weight above the tension of a winch has no equilibrium; modes take no winch."""
    given = scene(
        HANGING, [[0, 1]], [0], {"lines": 0, **winch}, {"kind": "static"}, load=[{"node": 1, "force": [0, 0, -10.1]}]
    )
    with pytest.raises(refweb.SolverError, match=r"node 1 goes further .* along z, .* raise tension or limit"):
        refweb.run(given)
    with pytest.raises(refweb.InputError, match=r"and no \[\[winch\]\]: leave them out"):
        refweb.modes(given)


@pytest.mark.slow  # in vain, by Newton's method across the drum
def test_a_load_that_a_winch_pulls_in():
    """A weight below the tension of a winch has no equilibrium but at the drum."""
    given = scene(
        HANGING, [[0, 1]], [0], {"lines": 0, "tension": 10.0}, {"kind": "static"},
        load=[{"node": 1, "force": [0, 0, -6.0]}],
    )  # fmt: skip
    with pytest.raises(refweb.SolverError, match="a winch pulls in all that is not held|come together"):
        refweb.run(given)


@pytest.mark.ordinary("central-difference")
@pytest.mark.parametrize("method", ["central-difference", "bdf"])
def test_a_run_goes_on(tmp_path, method):
    """A run that was stopped and resumed is the same, bit for bit, and one from its folder goes on like one run."""
    given = hanging(TENSION, METHODS[method])
    whole, resumed = nets.whole_and_resumed(given, tmp_path)
    for name, values in whole.history.items():
        np.testing.assert_array_equal(resumed.history[name], values, err_msg=name)
    refweb.run(hanging(TENSION, {**METHODS[method], "duration": 0.2}), tmp_path / "first")
    from_there = {**METHODS[method], "duration": 0.2, "start": str(tmp_path / "first")}
    further = refweb.run(hanging(TENSION, from_there)).history
    for name in ("kinetic_energy", "winch_energy"):
        assert further[name][-1] == pytest.approx(whole.history[name][-1], rel=2e-3)


@pytest.mark.ordinary("bdf")
@pytest.mark.parametrize("method", METHODS)
def test_a_winch_at_its_limit_loses_no_time_from_a_folder(tmp_path, method):
    """It hauls 0.1 m/s while the tension is below its own: 0.04 m in 0.4 s, whether in one run or in two."""
    winch, solve = {"tension": 300.0, "speed_limit": 0.1}, {**METHODS[method], "duration": 0.2}
    refweb.run(hanging(winch, solve, pull=MASS * G), tmp_path / "first")
    state = refweb.run(hanging(winch, {**solve, "start": str(tmp_path / "first")}, pull=MASS * G)).state
    assert abs(numbers_in(state.system.net, state.x)[0, SLIP]) == pytest.approx(0.04, rel=1e-9)


def test_from_equilibrium():
    """A brake that slips in the equilibrium at the start carries on from there: the load stays."""
    given = scene(
        V, [[0, 2], [1, 2]], [0, 1], {"lines": "all", "tension": 60.0},
        {"kind": "dynamic", "duration": 0.05, "start": "equilibrium"}, gravity={"acceleration": [0.0, 0.0, -G]},
        point_mass=[{"node": 2, "mass": 6.0}], output={"interval": 0.01},
        observe=[{"name": "z", "quantity": "position", "node": 2, "component": "z"}],
    )  # fmt: skip
    history = refweb.run(given).history
    np.testing.assert_allclose(history["z"], -np.tan(np.arcsin(6.0 * G / 120.0)), rtol=1e-6)
    closed(history, 1e-6)


def test_winches_of_groups():
    """Two winches of their own on lines beside one without, and beside a thread with friction and a winch.

    Loads that hang apart from each other move as each would alone.
    """
    x = np.arange(4.0)
    points = [[at, 0.0, z] for at in x for z in (0.0, -3.0)]
    lines = [[0, 1], [2, 3], [4, 5]]
    tables = {
        "web": {"kind": "inline", "points": points, "lines": lines, "groups": {"brakes": [0], "hoists": [2]}},
        "velocity": [{"node": [1, 3, 5, 7], "value": [0.0, 0.0, -1.0]}],
        "point_mass": [{"node": [1, 3, 5, 7], "mass": MASS}],
        "thread": [{"name": "rope", "nodes": [6, 7], "modulus": 1e10, "area": 1e-5, "density": 0.0}],
        "observe": [{"name": f"z{n}", "quantity": "displacement", "node": n, "component": "z"} for n in (1, 3, 5, 7)],
        "output": {"interval": 0.01},
    }
    winches = [
        {"thread": "rope", "end": "first", **BRAKE},
        {"lines": "brakes", **BRAKE},
        {"lines": ["hoists"], **SPEEDS, "limit": 40.0},
    ]
    solve = {"kind": "dynamic", "duration": 0.1, "step_size": 1e-4}
    together = refweb.run(scene(points, lines, [0, 2, 4, 6], winches, solve, **tables)).history
    np.testing.assert_array_equal(together["z1"], together["z7"])
    closed(together, 1e-3)
    alone = dict(start=-1.0, gravity=[], output={"interval": 0.01})
    solve = {"step_size": 1e-4, "duration": 0.1}
    for name, winch in (("z1", BRAKE), ("z5", {**SPEEDS, "limit": 40.0}), ("z3", None)):
        one = refweb.run(hanging(winch, solve, **alone)).history["z"]
        np.testing.assert_allclose(together[name], one, atol=1e-12)


def test_a_net_on_brakes():
    """A ball is caught by a net whose ties slip: none pulls harder, and the brakes take the energy that they should."""
    limit, window = 15.0, refweb.Window(mesh="square", rows=4, columns=4, side=0.5)
    web = window.web()
    ties = np.flatnonzero(np.isin(web.lines, web.rim).any(axis=1)).tolist()
    given = refweb.Scene(
        web=window,
        cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-4, density=200.0),
        effects=[
            refweb.Body(name="ball", radius=0.15, mass=1.0, position=(0, 0, -0.16), velocity=(0, 0, 3.0)),
            refweb.Contact(stiffness=1e4),
            refweb.Winch(lines=ties, speed=0.0, limit=limit),
        ],
        solve=refweb.Dynamic(duration=0.1, step_size=5e-5),
        observe=[refweb.Observe(name="pull", quantity="tension", line=ties, select="max", reduce="max")],
        output=refweb.Output(interval=0.01),
        accuracy=refweb.Accuracy(error="none"),
    )
    run = refweb.run(given)
    assert run.results["pull"].value == pytest.approx(limit, rel=1e-9)
    assert run.history["winch_energy"][-1] > 0.1 * run.history["kinetic_energy"][0]
    assert (np.diff(run.history["winch_energy"]) > -1e-9).all()
    closed(run.history, 1e-4 * run.history["kinetic_energy"][0])
    # A line that has paid out is longer than its tension stretches it.
    state, lines = run.state, run.state.system.net
    np.testing.assert_allclose(state.element_tension, lines.axial * np.maximum(state.element_strain, 0.0), atol=1e-9)
    distance = np.linalg.norm(np.diff((lines.points + state.x)[lines.cells], axis=1)[:, 0], axis=1)
    assert (distance / lines.natural_length - 1.0).max() > 2.0 * state.element_strain.max()


def test_commands():
    """Speeds and tensions that are set act as those of a thread do; balances stay closed."""
    for winch, key, value in (({"speed": 0.2, "limit": 60.0}, "speed", -0.3), ({"tension": 30.0}, "tension", 10.0)):
        runs = [refweb.start(hanging(winch, {"step_size": 1e-4}, 0.0, MASS * G, on)) for on in (False, True)]
        for run in runs:
            run.advance(0.2)
            run.set(f"winch.0.{key}", value)
            run.advance(0.2)
        line, thread = (run.history for run in runs)
        np.testing.assert_allclose(line["z"], thread["z"], atol=1e-9)
        rise = np.diff(line["z"])
        assert rise[-1] < rise[3]
        closed(line, 2e-3)
    run = refweb.start(hanging(BRAKE, {"step_size": 1e-4}))
    with pytest.raises(refweb.InputError, match="tension is not a key of this winch in the scene, which has speed or"):
        run.set("winch.0.tension", 1.0)


def test_commands_to_two_winches_and_the_runs_of_their_errors():
    """Lengths are integrals of the speeds that are set, also where both are set at once; later runs begin as the first.

    One winch has a table, whose numbers are more than those of the other.
    """
    points, table = [*HANGING, [5, 0, 0], [5, 0, -3.0]], [[0.0, 0.0], [0.1, 0.0], [0.2, 0.0]]
    given = scene(
        points, [[0, 1], [2, 3]], [0, 2], [{"lines": 0, "speed": 0.0}, {"lines": 1, "speed": table}],
        {"kind": "dynamic", "duration": 0.4}, point_mass=[{"node": node, "mass": MASS} for node in (1, 3)],
        observe=[{"name": f"z{n}", "quantity": "position", "node": n, "component": "z"} for n in (1, 3)],
        cable={**CABLE, "modulus": 1e8}, accuracy={"digits": 3}, output={"interval": 0.05},
    )  # fmt: skip
    run, speeds = refweb.start(given), np.array([[0.5, 0.3], [0.2, 0.6]])
    run.advance(0.1)
    for both, dt in zip(speeds, (0.1, 0.2), strict=True):
        for n, speed in enumerate(both):
            run.set(f"winch.{n}.speed", speed)
        run.advance(dt)
    wound = numbers_in(run.state.system.net, run.state.x)[:, SLIP]
    np.testing.assert_allclose(wound, np.array([0.1, 0.2]) @ speeds, rtol=1e-9)
    solution = run.finish()
    for name, result in solution.results.items():
        # The run that was stepped has twice the steps, and is off from this one by three times its error, as ± is.
        assert result.value == pytest.approx(run.observe(name), abs=1.5 * result.error)
        assert result.error < 1e-3
        np.testing.assert_array_equal(
            solution.history[name][:3], run.history[name][:3]
        )  # nothing has moved until 0.1 s
    np.testing.assert_allclose(numbers_in(solution.state.system.net, solution.state.x)[:, SLIP], wound, rtol=1e-9)


def test_commands_beside_a_reel():
    points = [*HANGING, *FAR]
    reel = [{"lines": [1], "factor": [[0.0, 1.0], [1.0, 1.1]]}]
    given = scene(
        points, [[0, 1], [2, 3]], [0, 2, 3], {"lines": [0], **BRAKE}, {"kind": "dynamic", "duration": 0.1}, reel=reel,
        point_mass=[{"node": 1, "mass": MASS}],
    )  # fmt: skip
    with pytest.raises(refweb.InputError, match=r"a winch on lines has its numbers from the scene alone beside"):
        refweb.start(given).set("winch.0.limit", 1.0)


@pytest.mark.parametrize(
    "winch, tables, text",
    [
        ({"thread": "rope"}, {}, r'thread = "rope" and lines = \[0\] exclude each other: give a winch for each'),
        ({"lines": None}, {}, r"thread and lines are missing: give one of them"),
        ({"end": "first"}, {}, r'end = "first" is of threads, and this winch has lines: leave it out'),
        ({"at": 1}, {}, r"at = 1 is of threads"),
        ({"speed": None, "power": 1.0}, {}, r"speed_limit is missing: with power = 1 a slack thread would be wound"),
        ({"lines": "rim"}, {}, r'lines = "rim"'),
        ({"lines": [3]}, {}, r"lines\[0\] = 3"),
        ({"speed": 4.0}, {}, r"hauls in 4 m until t = 1 s, must be below the natural length of line 0, 3 m"),
        ({}, {"cable": {**CABLE, "law": "smooth"}}, r'line 0 has law = "smooth": on a winch it takes'),
        ({}, {"cable": {**CABLE, "law": "elastic-plastic", "yield_stress": 1e6}}, r'has law = "elastic-plastic"'),
        ({}, {"cable": {**CABLE, "subdivide": 2}}, r"is one straight element, and \[cable\] subdivide = 2"),
        ({}, {"cable": {**CABLE, "order": 2}}, r"is one straight element, and \[cable\] order = 2"),
        ({}, {"cable": {**CABLE, "viscous": {"arms": [[1e8, 0.1]]}}}, r"cannot stand beside \[cable.viscous\]"),
        ({}, {"damping": {"time": 0.1}}, r"cannot stand beside lines on a \[\[winch\]\]: damp with rate"),
        ({}, {"reel": [{"lines": [0], "factor": [[0.0, 1.0]]}]}, r"line 0 is on a \[\[winch\]\], and its natural"),
        ({}, {"temperature": {"expansion": 1e-5, "change": 9.0}}, r"line 0 is on a \[\[winch\]\], and its natural"),
        ({}, {"rupture": {"strength": 1e9}}, r"line 0 is on a \[\[winch\]\] and does not break"),
        ({}, {"rupture": {"at": [[0, 0.5]]}}, r"line 0 is on a \[\[winch\]\] and does not break"),
        ({}, {"self_contact": {"radius": 0.01}}, r"radius = 0.01 needs natural lengths ahead, which a \[\[winch\]\]"),
    ],
)  # fmt: skip
def test_refused(winch, tables, text):
    keys = {key: value for key, value in {"lines": [0], "speed": 0.0, **winch}.items() if value is not None}
    with pytest.raises(refweb.InputError, match=text):
        solve = {"kind": "dynamic", "duration": 1.0}
        masses = [{"node": 1, "mass": MASS}]
        scene(HANGING, [[0, 1]], [0], keys, solve, point_mass=masses, **tables).build()


def test_a_line_has_one_winch():
    winches = [{"lines": [0], "tension": 1.0}, {"lines": "all", "speed": 0.0}]
    with pytest.raises(refweb.InputError, match="line 0 has a winch already"):
        scene(HANGING, [[0, 1]], [0], winches, {"kind": "static"}).build()
