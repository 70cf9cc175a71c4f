"""Winches at the ends of threads: closed forms of tension, brake and power, reels of lines, and the balances."""

from types import SimpleNamespace

import nets
import numpy as np
import pytest
import threads
from nets import METHODS
from scipy.integrate import solve_ivp
from threads import FAR, G

import refweb
from refweb.statics.residual_search import ResidualSearch

EA = 1e5
ROPE = {"modulus": 1e10}
ARMS = {"arms": [[1e8, 0.01], [2e8, 0.3]]}
STEPS = {name: keys for name, keys in METHODS.items() if keys.get("method") != "explicit"}
TIGHT = {
    "central-difference": {"step_size": 1e-4},
    "bdf": {"rtol": 1e-7},
    "adams": {"rtol": 1e-8},
    "ida": {"rtol": 1e-7},
}


def scene(points, supports, winch, solve, masses=(), rope=None, **tables):
    """A scene of points, some of them supported, with a thread, a winch at an end of it, and point masses by node."""
    given = {"winch": [{"thread": "rope", **winch}], "accuracy": {"error": "none"}, **tables}
    return threads.scene(points, supports, {**ROPE, **(rope or {})}, solve, masses, **given)


def lifted(*given, **tables):
    """History of a scene of `lifted_scene`."""
    return refweb.run(lifted_scene(*given, **tables)).history


def lifted_scene(winch, solve, start=0.0, pull=0.0, gravity=G, **tables):
    """A mass of 2 kg on 3 m of rope below a winch, at a velocity and a tension at the start."""
    at_first = winch.get("end", "first") == "first"
    seen = [{"name": "z", "quantity": "displacement", "node": 1, "component": "z"}]
    seen += [{"name": "u", "quantity": "velocity", "node": 1, "component": "z"}]
    seen += [{"name": "pull", "quantity": "tension", "thread": "rope"}]
    seen += [{"name": "wound", "quantity": "slip", "thread": "rope", "ring": 0 if at_first else 1}]
    given = {
        "gravity": {"acceleration": [0.0, 0.0, -gravity]} if gravity else [],
        "velocity": [{"node": 1, "value": [0.0, 0.0, start]}] if start else [],
        "observe": seen,
        "output": {"interval": 0.05},
    }
    rope = {"nodes": [0, 1] if at_first else [1, 0], "prestrain": pull / EA}
    points = [[0, 0, 0], [0, 0, -3.0]]
    solve = {"kind": "dynamic", "duration": 0.4, **solve}
    return scene(points, [0], {"end": "first", **winch}, solve, {1: 2.0}, rope, **{**given, **tables})


def closed(history, size):
    """The balance of energy with what the winch has taken."""
    energy = history["total_energy"] + history["dissipated_energy"]
    np.testing.assert_allclose(energy, energy[0], atol=size)


@pytest.mark.ordinary("central-difference-first", "central-difference-last", "bdf-last", "adams-first")
@pytest.mark.parametrize("end", ["first", "last"])
@pytest.mark.parametrize("method", STEPS)
def test_constant_tension(method, end):
    """m a = T − m g until the speed limit v; behind it the rope is hauled in at v, and the load swings about that."""
    pull, limit = 30.0, 1.2
    solve = {**STEPS[method], **TIGHT[method]}
    history = lifted({"tension": pull, "speed_limit": limit, "end": end}, solve, pull=pull)
    rise, time = pull / 2.0 - G, history["time"]
    fast = limit * (1.0 + pull / EA)  # of the load, while the tension stays
    before = time < fast / rise
    assert 3 < before.sum() < len(time)
    np.testing.assert_allclose(history["z"][before], 0.5 * rise * time[before] ** 2, atol=2e-5)
    np.testing.assert_allclose(history["pull"][before], pull, rtol=2e-3)
    at = fast / rise
    swing = 3.0 * 2.0 * rise / EA  # of the load, by the change of the tension to its weight
    np.testing.assert_allclose(
        history["z"][~before], 0.5 * rise * at**2 + fast * (time[~before] - at), atol=2.0 * swing + 1e-4
    )
    sign = 1.0 if end == "last" else -1.0
    hauled = sign * history["wound"]
    assert hauled[-1] == pytest.approx(history["z"][-1] / (1.0 + pull / EA), abs=3.0 * swing)
    np.testing.assert_allclose(history["winch_energy"][before], -pull * hauled[before], rtol=1e-3, atol=1e-6)
    closed(history, 2e-3)


@pytest.mark.parametrize("method", STEPS)
def test_brake(method):
    """A load at v comes to rest m v²/2F and half an elastic stretch further; its energy is in brake and rope."""
    force, speed = 50.0, 1.5
    top = {"name": "low", "quantity": "displacement", "node": 1, "component": "z", "reduce": "min"}
    run_keys = {**STEPS[method], **TIGHT[method]}
    points, rope = [[0, 0, 0], [0, 0, -3.0]], {"nodes": [0, 1]}
    run = refweb.run(
        scene(
            points,
            [0],
            {"end": "first", "speed": 0.0, "limit": force},
            {"kind": "dynamic", "duration": 0.1, **run_keys},
            {1: 2.0},
            rope,
            velocity=[{"node": 1, "value": [0.0, 0.0, -speed]}],
            observe=[top, {"name": "wound", "quantity": "slip", "thread": "rope", "ring": 0}],
            output={"interval": 0.05},
        )
    )
    energy, stretch = 0.5 * 2.0 * speed**2, force * 3.0 / EA
    assert run.results["low"].value == pytest.approx(-(energy / force + 0.5 * stretch), rel=2e-4)
    paid = run.results["wound"].value
    assert paid == pytest.approx((energy / force - 0.5 * stretch) / (1.0 + force / EA), rel=2e-3)
    taken = paid * (force * (1.0 + force / EA) - 0.5 * force**2 / EA)  # Y = T (1 + ε) − W
    assert run.history["winch_energy"][-1] == pytest.approx(taken, rel=1e-3)
    closed(run.history, 2e-3 * energy)


SPEEDS = [[0.0, 0.0], [0.1, 0.6], [0.3, -0.4]]


@pytest.mark.ordinary("central-difference")
@pytest.mark.parametrize("method", ["central-difference", "adams"])
def test_speed_is_a_reel(method):
    """The same as a line whose natural length a reel changes by the integral of these speeds."""
    solve = {**STEPS[method], **TIGHT[method]}
    weight = 2.0 * G
    history = lifted({"speed": SPEEDS}, solve, pull=weight)
    times = np.linspace(0.0, 0.4, 201)
    speeds = np.interp(times, *np.transpose(SPEEDS))
    hauled = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(times) * (speeds[1:] + speeds[:-1]))])
    natural = 3.0 / (1.0 + weight / EA)
    factor = [[t, 1.0 - by / natural] for t, by in zip(times.tolist(), hauled.tolist(), strict=True)]
    tables = {
        "web": {"kind": "inline", "points": [[0, 0, 0], [0, 0, -3.0]], "lines": [[0, 1]]},
        "supports": {"nodes": [0]},
        "cable": {"law": "tension-only", "modulus": 1e10, "area": 1e-5, "density": 0.0, "prestrain": weight / EA},
        "reel": [{"lines": [0], "factor": factor}],
        "gravity": {"acceleration": [0.0, 0.0, -G]},
        "point_mass": [{"node": 1, "mass": 2.0}],
        "observe": [{"name": "z", "quantity": "displacement", "node": 1, "component": "z"}],
        "output": {"interval": 0.05},
        "accuracy": {"error": "none"},
        "solve": {"kind": "dynamic", "duration": 0.4, **solve},
    }
    exact = refweb.run(refweb.Scene.from_dict(tables)).history
    np.testing.assert_allclose(history["z"], exact["z"], atol=2e-5)  # the factor is linear between its 200 points
    assert -history["wound"][-1] == pytest.approx(hauled[-1], rel=1e-9)
    np.testing.assert_allclose(-history["winch_energy"], exact["work"], atol=2e-3 * np.abs(exact["work"]).max())
    closed(history, 5e-3)


@pytest.mark.parametrize("method, end, friction", [("central-difference", "last", 0.2), ("bdf", None, 0.0)])
def test_closed_thread_hoists_by_two_strands(method, end, friction):
    """m a = T (1 + e^(−μπ)) − m g of a load in the bight of a closed thread, and twice its way is wound."""
    pull, first = 25.0, end != "last"
    seen = [{"name": f"t{s}", "quantity": "tension", "thread": "rope", "segment": s} for s in (0, 1)]
    seen += [{"name": "z", "quantity": "displacement", "node": 1, "component": "z"}]
    seen += [{"name": "wound", "quantity": "slip", "thread": "rope", "ring": 0 if first else 2}]
    history = refweb.run(
        scene(
            [[0, 0, 0], [0, 0, -3.0]],
            [0],
            {"at": 0, "tension": pull} | ({"end": end} if end else {}),
            {"kind": "dynamic", "duration": 0.4, **STEPS[method], **TIGHT[method]},
            {1: 2.0},
            {"nodes": [1, 0], "closed": True, "friction": friction, "prestrain": pull / EA},
            gravity={"acceleration": [0.0, 0.0, -G]},
            observe=seen,
            output={"interval": 0.05},
        )
    ).history
    back = pull * np.exp(-friction * np.pi)
    np.testing.assert_allclose(history["t0" if first else "t1"], pull, rtol=2e-3)
    np.testing.assert_allclose(history["t1" if first else "t0"][1:], back, rtol=2e-3)
    # With friction the other strand gets to its tension in the first row, by which the load has a velocity from there.
    rise = np.diff(history["z"][1:], 2) / 0.05**2
    np.testing.assert_allclose(rise, (pull + back) / 2.0 - G, rtol=2e-3)
    hauled = history["wound"] * (-1.0 if first else 1.0)
    assert hauled[-1] == pytest.approx(2.0 * history["z"][-1] * (1.0 - pull / EA), abs=2e-3)
    np.testing.assert_allclose(history["winch_energy"], -pull * hauled, rtol=2e-3, atol=1e-3)
    closed(history, 2e-3)


def test_closed_thread_is_one_from_the_drum_to_the_drum():
    """The same, digit for digit, as an open thread that begins and ends at the drum, rings with their friction."""
    angle = 0.4 * np.pi * np.arange(5)
    points = np.column_stack([np.cos(angle), np.sin(angle), 0.1 * angle]).tolist()
    loop = {"nodes": [3, 4, 0, 1, 2], "closed": True, "friction": [0.3, 0.4, 0.0, 0.1, 0.2]}
    from_drum = {"nodes": [1, 2, 3, 4, 0, 1], "friction": [0.2, 0.3, 0.4, 0.0]}
    histories = [
        refweb.run(
            scene(
                points,
                [],
                {"speed": 1.0, "limit": 50.0} | winch,
                {"kind": "dynamic", "duration": 0.02},
                dict.fromkeys(range(5), 0.05),
                rope,
                web={"kind": "inline", "points": [*points, *FAR], "lines": [[5, 6]], "names": {"drum": 1}},
                observe=[{"name": "mouth", "quantity": "mouth_area", "node": [0, 1, 2, 3, 4]}],
                output={"interval": 0.002},
            )
        ).history
        for rope, winch in ((loop, {"at": "drum"}), (from_drum, {"end": "first"}))
    ]
    for name in ("mouth", "winch_energy", "dissipated_energy", "kinetic_energy"):
        np.testing.assert_array_equal(histories[0][name], histories[1][name])
    assert histories[0]["dissipated_energy"][-1] > 0.0 and histories[0]["mouth"][-1] < histories[0]["mouth"][0]


@pytest.mark.parametrize("friction", [0.0, 0.2])
def test_statics_at_a_tension(friction):
    """A heavy ring between a support and a winch: 2 T sin α = W; with friction the support has T e^(−μθ) or more."""
    pull, weight = 60.0, 40.0
    run = refweb.run(
        scene(
            [[0, 0, 0], [2.0, 0, 0], [1.0, 0.0, -1.2]],
            [0, 1],
            {"end": "last", "tension": pull},
            {"kind": "static", "load_steps": [0.5, 1.0]},
            rope={"nodes": [0, 2, 1], "friction": friction},
            load=[{"node": 2, "force": [0.0, 0.0, -weight]}],
            observe=[{"name": f"t{s}", "quantity": "tension", "thread": "rope", "segment": s} for s in (0, 1)],
        )
    )
    first, second = (run.results[name].value for name in ("t0", "t1"))
    assert second == pytest.approx(pull, rel=1e-9)
    place = run.positions[2]
    u, v = -place, np.array([2.0, 0.0, 0.0]) - place
    angle = np.pi - np.arccos(u @ v / np.linalg.norm(u) / np.linalg.norm(v))
    assert np.exp(-friction * angle) * (1.0 - 1e-9) <= first / pull <= np.exp(friction * angle) * (1.0 + 1e-9)
    balance = first * u / np.linalg.norm(u) + second * v / np.linalg.norm(v)
    np.testing.assert_allclose(balance, [0.0, 0.0, weight], atol=1e-6)
    if not friction:
        assert place[2] == pytest.approx(-np.tan(np.arcsin(weight / (2.0 * pull))), rel=1e-8)


@pytest.mark.parametrize("winch", [{"tension": 10.0}, {"speed": 0.0, "limit": 10.0}])
def test_a_load_that_no_winch_carries(winch):
    """A weight above the tension of a winch has no equilibrium."""
    given = scene(
        [[0, 0, 0], [0, 0, -3.0]], [0], {"end": "first", **winch}, {"kind": "static"}, rope={"nodes": [0, 1]},
        load=[{"node": 1, "force": [0.0, 0.0, -10.1]}],
    )  # fmt: skip
    with pytest.raises(refweb.SolverError, match=r"node 1 goes further .* along z, .* raise tension or limit"):
        refweb.run(given)


def test_a_load_that_a_winch_pulls_in():
    """A weight below the tension of a winch has no equilibrium but at the drum."""
    given = scene(
        [[0, 0, 0], [0, 0, -3.0]], [0], {"end": "first", "tension": 10.0}, {"kind": "static"}, rope={"nodes": [0, 1]},
        load=[{"node": 1, "force": [0.0, 0.0, -6.0]}],
    )  # fmt: skip
    with pytest.raises(refweb.SolverError, match="a winch pulls in all that is not held|come together"):
        refweb.run(given)
    with pytest.raises(refweb.InputError, match=r"modes take no friction of \[\[thread\]\] above 0, and no"):
        refweb.modes(given)


def test_a_step_is_cut_where_nothing_follows_it():
    """Newton's method with forces without a potential takes half of a step whose end has no finite next step."""
    system = SimpleNamespace(
        free=slice(None), largest_share=lambda p: 1.0, moved=np.add, force=lambda t, x: x, rows_of=lambda p: p
    )
    factor = SimpleNamespace(solve=lambda force: None if force[0] > 0.6 else 0.1 * force)
    stats = {"nfev": 0}
    x, shift = ResidualSearch(system, factor, 1.0).along(np.ones(1), np.zeros(1), np.ones(1), 1.0, stats)
    assert (x[0], shift, stats["nfev"]) == (0.5, 4.0, 2)


def test_speed_in_statics():
    """A winch with a speed is at its starting length: W = EA (l/L − 1)."""
    run = refweb.run(
        scene(
            [[0, 0, 0], [0, 0, -3.0]],
            [0],
            {"end": "first", "speed": 0.7},
            {"kind": "static"},
            rope={"nodes": [0, 1]},
            load=[{"node": 1, "force": [0.0, 0.0, -40.0]}],
        )
    )
    assert run.positions[1][2] == pytest.approx(-3.0 * (1.0 + 40.0 / EA), rel=1e-9)


@pytest.mark.ordinary("central-difference")
@pytest.mark.parametrize("method", ["central-difference", "bdf"])
def test_a_run_goes_on(tmp_path, method):
    """A winch at a constant tension goes on from a folder as it would have without a stop."""
    solve, keys = {**STEPS[method], **TIGHT[method]}, {"end": "first", "tension": 30.0, "speed_limit": 0.8}
    whole = lifted(keys, solve)
    seen = [{"name": "z", "quantity": "displacement", "node": 1, "component": "z"}]
    seen += [{"name": "wound", "quantity": "slip", "thread": "rope", "ring": 0}]
    given = {"gravity": {"acceleration": [0.0, 0.0, -G]}, "observe": seen, "output": {"interval": 0.05}}
    parts = [([[0, 0, 0], [0, 0, -3.0]], [0], keys), ({1: 2.0}, {"nodes": [0, 1]})]
    refweb.run(scene(*parts[0], {"kind": "dynamic", "duration": 0.2, **solve}, *parts[1], **given), tmp_path / "first")
    from_there = {"kind": "dynamic", "duration": 0.2, "start": str(tmp_path / "first"), **solve}
    run = refweb.run(scene(*parts[0], from_there, *parts[1], **given))
    for name in ("z", "wound", "winch_energy"):
        assert run.history[name][-1] == pytest.approx(whole[name][-1], rel=2e-3)


def hoisted(times, power, limit, pull):
    """(Height, length hauled in, work) of `lifted` by a winch of constant power, by DOP853 on elastic rope and load."""
    natural = 3.0 / (1.0 + pull / EA)

    def rate(t, y):
        strain = max((3.0 - y[0]) / (natural - y[2]) - 1.0, 0.0)
        given = EA * (strain + 0.5 * strain**2)  # Y = T (1 + ε) − W
        speed = np.sign(power) * min(abs(power) / given if given > 0.0 else np.inf, limit)
        return [y[1], EA * strain / 2.0 - G, speed, given * speed]

    found = solve_ivp(rate, (0.0, times[-1]), np.zeros(4), "DOP853", times, rtol=1e-10, atol=1e-12, max_step=2e-4)
    return found.y[[0, 2, 3]]


@pytest.mark.ordinary("central-difference")
@pytest.mark.parametrize("method", STEPS)
def test_power(method):
    """The load rises as by an independent solver, and gets P t; in the end its speed is nearly P/(m g)."""
    power, weight, solve = 30.0, 2.0 * G, {**STEPS[method], **TIGHT[method]}
    history = lifted({"power": power, "speed_limit": 20.0}, solve, pull=weight)
    height, hauled, work = hoisted(history["time"], power, 20.0, weight)
    np.testing.assert_allclose(history["z"], height, atol=1e-6)
    np.testing.assert_allclose(-history["wound"], hauled, atol=1e-6)
    np.testing.assert_allclose(work, power * history["time"], rtol=1e-9)  # never at the limit
    np.testing.assert_allclose(history["winch_energy"], -work, rtol=1e-9, atol=1e-9)
    # Of a rope that does not stretch m v' = P/v − m g, t(v) in closed form; the rope differs by its stretch.
    last = power / weight
    speeds = np.linspace(0.0, (1.0 - 1e-9) * last, 100_001)
    times = -speeds / G - last / G * np.log1p(-speeds / last)
    ways = np.append(0.0, np.cumsum(0.5 * np.diff(times) * (speeds[1:] + speeds[:-1])))
    rise = np.interp(history["time"], times, ways)
    np.testing.assert_allclose(history["z"][3:], rise[3:], atol=2.0 * weight * 3.0 / EA)
    closed(history, 1e-4)


@pytest.mark.parametrize(
    "method, end", [("central-difference", "first"), ("central-difference", "last"), ("adams", "last")]
)
def test_power_up_to_a_speed(method, end):
    """A slack rope is wound at the speed limit, as is one whose load takes less than the power."""
    power, limit, solve = 30.0, 1.0, {**STEPS[method], **TIGHT[method]}
    history = lifted({"power": power, "speed_limit": limit, "end": end}, solve)
    height, hauled, work = hoisted(history["time"], power, limit, 0.0)
    np.testing.assert_allclose(history["z"], height, atol=1e-5)
    np.testing.assert_allclose(history["wound"] * (1.0 if end == "last" else -1.0), hauled, atol=1e-5)
    np.testing.assert_allclose(history["winch_energy"], -work, atol=1e-4)
    assert work[-1] < 0.75 * power * 0.4  # by the limit
    closed(history, 1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("linear_solver", ["dense", "block"])
@pytest.mark.parametrize("method", ["cvode", "ida"])
def test_power_beside_arms(method, linear_solver):
    """Unknowns of viscous lines, here at rest, stand beside those of a winch, and change nothing of it."""
    cable = {"law": "tension-only", "modulus": 1e9, "area": 1e-5, "density": 0.0}
    solve = {"method": method, "linear_solver": linear_solver, "rtol": 1e-7, "duration": 0.1}
    history = lifted({"power": 30.0, "speed_limit": 20.0}, solve, pull=2.0 * G, cable=cable | {"viscous": ARMS})
    height, hauled, work = hoisted(history["time"], 30.0, 20.0, 2.0 * G)
    np.testing.assert_allclose(history["z"], height, atol=1e-6)
    np.testing.assert_allclose(-history["wound"], hauled, atol=1e-6)
    np.testing.assert_allclose(history["winch_energy"], -work, rtol=1e-9, atol=1e-9)


def test_paying_out_at_a_power():
    """A load that sinks at the speed limit gives the winch its weight times that, below the power."""
    limit, weight = 1.4, 2.0 * G
    history = lifted({"power": -30.0, "speed_limit": limit}, {"step_size": 1e-4}, pull=weight, start=-limit)
    np.testing.assert_allclose(history["wound"], limit * history["time"], atol=1e-9)
    given = weight * (1.0 + 0.5 * weight / EA)  # Y
    np.testing.assert_allclose(history["winch_energy"], given * limit * history["time"], rtol=1e-3)
    closed(history, 1e-3)


@pytest.mark.slow
def test_power_over_a_ring():
    """Explicit steps are of order 2; with friction methods agree, and the ring takes heat of the power."""
    seen = [{"name": "z", "quantity": "displacement", "node": 2, "component": "z"}]
    seen += [{"name": "wound", "quantity": "slip", "thread": "rope", "ring": 0}]
    given = {"gravity": {"acceleration": [0.0, 0.0, -G]}, "observe": seen, "output": {"interval": 0.02}}

    def history(friction, solve):
        found = refweb.run(
            scene(
                [[0, 0, 0], [1.0, 0.0, 0.4], [1.6, 0.2, -0.5]], [0, 1],
                {"end": "first", "power": 4.0, "speed_limit": 5.0}, {"kind": "dynamic", "duration": 0.2, **solve},
                {2: 0.3}, {"nodes": [0, 1, 2], "friction": friction, "modulus": 1e8, "prestrain": 5e-3}, **given,
            )
        ).history  # fmt: skip
        closed(found, 1e-3)
        assert found["winch_energy"][-1] == pytest.approx(-4.0 * 0.2, rel=1e-9)
        return found

    def off(one, exact):
        return [np.abs(one[name] - exact[name]).max() for name in ("z", "wound")]

    by_cvode = {"method": "cvode", "family": "adams", "rtol": 1e-9}
    exact = history(0.0, by_cvode)
    errors = [off(history(0.0, {"step_size": 0.2 / count}), exact) for count in (500, 2000)]
    assert (np.log(np.array(errors[0]) / errors[1]) / np.log(4.0)).min() > 1.9
    exact = history(0.2, by_cvode)
    assert max(off(history(0.2, {"step_size": 1e-4}), exact)) < 1e-6  # of 0.17 m
    assert max(off(history(0.2, {"method": "ida", "rtol": 1e-7}), exact)) < 1e-5
    assert exact["dissipated_energy"][-1] > 0.1


@pytest.mark.ordinary("central-difference")
@pytest.mark.parametrize("method", ["central-difference", "bdf"])
def test_power_goes_on(tmp_path, method):
    """A run that was stopped and resumed is the same, bit for bit, and one from its folder goes on like one run."""
    keys = {"power": 30.0, "speed_limit": 2.0}
    given = lifted_scene(keys, {**STEPS[method], **TIGHT[method]})
    whole, resumed = nets.whole_and_resumed(given, tmp_path)
    for name, values in whole.history.items():
        np.testing.assert_array_equal(resumed.history[name], values, err_msg=name)
    stepped = refweb.start(given)
    for _ in range(3):
        stepped.advance(0.1)
    np.testing.assert_array_equal(stepped.history["z"], whole.history["z"][:7])


@pytest.mark.parametrize("method", ["central-difference", "bdf"])
def test_no_tension(method):
    """A winch that holds 0 N lets a load fly: it takes in the slack of a rise, and pays it out again."""
    history = lifted({"tension": 0.0}, {**STEPS[method], **TIGHT[method]}, start=2.0)
    height = 2.0 * history["time"] - 0.5 * G * history["time"] ** 2
    np.testing.assert_allclose(history["z"], height, atol=2e-6)
    np.testing.assert_allclose(-history["wound"], height, atol=2e-6)
    assert np.abs(history["pull"]).max() < 1e-9 and np.abs(history["winch_energy"]).max() < 1e-9


def test_commands():
    """A winch whose power or speed is set goes on like one with a table; balances stay closed; others are refused."""
    solve = {"step_size": 1e-4}
    table = lifted({"speed": [[0.0, 0.2], [0.2, 0.2], [0.2 + 1e-9, -0.3]]}, solve, pull=2.0 * G)
    for speed in (0.2, [[0.0, 0.2], [1.0, 0.2]]):
        run = refweb.start(lifted_scene({"speed": speed}, solve, pull=2.0 * G))
        run.advance(0.2)
        run.set("winch.0.speed", -0.3)
        run.advance(0.2)
        np.testing.assert_allclose(run.history["z"], table["z"], atol=1e-8)
        closed(run.history, 1e-3)
    for keys in (solve, {"method": "cvode", "family": "adams", "rtol": 1e-8}):
        run = refweb.start(lifted_scene({"power": 20.0, "speed_limit": 9.0}, keys, pull=2.0 * G))
        run.advance(0.2)
        run.set("winch.0.power", 40.0)
        run.advance(0.2)
        taken = run.history["winch_energy"]
        assert taken[-1] == pytest.approx(-0.2 * 20.0 - 0.2 * 40.0, rel=1e-9)
        closed(run.history, 1e-3)
    run = refweb.start(lifted_scene({"power": 20.0, "speed_limit": 9.0}, solve, pull=2.0 * G))
    for path, value, text in (
        ("winch.0.tension", 3.0, "tension is not a key of this winch in the scene, which has power"),
        ("winch.0.power", "much", "must be a finite number"),
        ("winch.0.end", 3.0, '"end" is not a key of \\[winch\\] that a command may set'),
        ("winch.0.speed_limit", 3.0, "a command may set, known: power"),
    ):
        with pytest.raises(refweb.InputError, match=text):
            run.set(path, value)


def test_controlled_tension():
    """A control that sets the tension of a winch brings a load to a height and keeps it there."""
    control = {
        "name": "hoist", "law": "pid", "parameters": {"proportional": 60.0, "derivative": 25.0, "integral": 60.0},
        "period": 0.01, "sets": "winch.0.tension", "measures": ["z"], "rates": ["u"], "target": 0.2,
    }  # fmt: skip
    given = {"control": [control], "output": {"interval": 0.01}}
    solve = {"step_size": 1e-4, "duration": 4.0}
    history = lifted({"tension": 2.0 * G}, solve, pull=2.0 * G, **given)
    assert history["z"][-1] == pytest.approx(0.2, abs=5e-3)
    closed(history, 1e-2)


def test_controlled_speed_and_a_tension_that_is_not_below_zero():
    """A constant speed of a scene is set, w' = k (w* − w) of the length that goes out; a tension below 0 is 0."""
    control = {
        "name": "hoist", "law": "pid", "parameters": {"proportional": -5.0}, "period": 0.01, "sets": "winch.0.speed",
        "measures": ["wound"], "target": -0.1,
    }  # fmt: skip
    given, solve = {"control": [control], "output": {"interval": 0.01}}, {"step_size": 1e-4}
    history = lifted({"speed": 0.0}, solve, pull=2.0 * G, **given)
    rows = np.arange(len(history["wound"]))
    np.testing.assert_allclose(history["wound"], -0.1 * (1.0 - 0.95**rows), atol=1e-12)
    control |= {"sets": "winch.0.tension", "parameters": {"proportional": 1.0, "integral": 1e6}, "target": -9.0}
    solution = refweb.run(lifted_scene({"tension": 2.0 * G}, {**solve, "duration": 0.05}, pull=2.0 * G, **given))
    assert solution.history["pull"][-1] == pytest.approx(0.0, abs=1e-9) and solution.controls[0]["largest"] == 0.0


def test_power_in_statics():
    """It stays as it is: W = EA (l/L − 1)."""
    run = refweb.run(
        scene(
            [[0, 0, 0], [0, 0, -3.0]], [0], {"end": "first", "power": 30.0, "speed_limit": 1.0}, {"kind": "static"},
            rope={"nodes": [0, 1]}, load=[{"node": 1, "force": [0.0, 0.0, -40.0]}],
        )
    )  # fmt: skip
    assert run.positions[1][2] == pytest.approx(-3.0 * (1.0 + 40.0 / EA), rel=1e-9)


def test_order_of_explicit_steps():
    """A winch and friction at a ring at once: order 2, and 1 of positions where a winch at its limit turns round."""
    points, masses = [[0, 0, 0], [1.0, 0.0, 0.4], [1.6, 0.2, -0.5]], {2: 0.3}
    given = {
        "gravity": {"acceleration": [0.0, 0.0, -G]},
        "velocity": [{"node": 2, "value": [0.3, 0.2, -1.0]}],
        "observe": [{"name": "z", "quantity": "displacement", "node": 2, "component": "z"}],
        "output": {"interval": 0.05},
    }
    rope = {"nodes": [0, 1, 2], "friction": 0.2, "modulus": 1e8}
    for winch, order in (
        ({"speed": 0.0, "limit": 5.0}, 2.0),
        ({"tension": 5.0}, 2.0),
        ({"tension": 5.0, "speed_limit": 0.3}, 1.0),
    ):
        parts = points, [0, 1], {"end": "first", **winch}

        def history(solve, parts=parts):
            return refweb.run(
                scene(*parts, {"kind": "dynamic", "duration": 0.3, **solve}, masses, rope, **given)
            ).history

        exact, errors = history({"method": "cvode", "family": "adams", "rtol": 1e-9}), []
        for count in (750, 3000, 12000):
            found = history({"step_size": 0.3 / count})
            energy = found["total_energy"] + found["dissipated_energy"]
            errors.append([np.abs(found["z"] - exact["z"]).max(), np.abs(energy - energy[0]).max()])
        slopes = np.log(np.array(errors[0]) / errors[2]) / np.log(16.0)
        assert slopes[0] > 0.85 * order and slopes[1] > 1.7
        assert np.ptp(exact["winch_energy"]) > 0.01


@pytest.mark.parametrize(
    "winch, text",
    [
        ({}, r"speed, tension and power are missing: give one"),
        ({"power": 1.0}, r"speed_limit is missing: with power = 1 a slack thread would be wound at any speed"),
        ({"power": 1.0, "speed_limit": 1.0, "limit": 2.0}, r"limit = 2 has no meaning with power: it needs speed"),
        ({"speed": 1.0, "tension": 1.0}, r"speed and tension exclude each other"),
        ({"tension": 1.0, "limit": 2.0}, r"limit = 2 has no meaning with tension"),
        ({"speed": 1.0, "speed_limit": 2.0}, r"speed_limit = 2 has no meaning with speed"),
        ({"speed": [[0.0, 1.0], [0.0, 2.0]]}, r"speed\[1\]\[0\] = 0.0 must be > 0"),
        ({"speed": 3.0}, r'hauls in 3 m until t = 1 s, must be below the natural length of thread "rope", 2 m'),
        ({"speed": 1.0, "thread": "rop"}, r'thread = "rop" is not a thread, did you mean "rope"'),
        ({"speed": 1.0, "end": "middle"}, r'end = "middle" must be one of "first", "last"'),
    ],
)
def test_refused(winch, text):
    with pytest.raises(refweb.InputError, match=text):
        scene(
            [[0, 0, 0], [1, 0, 0], [2, 0, 0]],
            [0, 2],
            {"end": "first", **winch},
            {"kind": "dynamic", "duration": 1.0},
            {1: 1.0},
            {"nodes": [0, 1, 2]},
        ).build()


@pytest.mark.parametrize(
    "rope, winch, text",
    [
        ({"law": "smooth", "smoothing": 1e-3}, {"end": "first"}, r"which pushes"),
        ({}, {}, r'end is missing: thread "rope" is open, give "first" or "last"'),
        ({}, {"end": "first", "at": 0}, r'at = 0 is of closed threads, and thread "rope" is open: give end'),
        ({"closed": True}, {"at": 3}, r'at = 3 must be a node of thread "rope", such as 0'),
        ({"closed": True}, {"at": [0, 1]}, r"at = \[0, 1\] is 2 nodes, must be one"),
        ({"closed": True}, {"at": "dum"}, r'at = "dum" names no node'),
    ],
)
def test_refused_threads(rope, winch, text):
    with pytest.raises(refweb.InputError, match=text):
        scene(
            [[0, 0, 0], [1, 0, 0], [2, 0, 1]],
            [0, 2],
            {"speed": 0.0, **winch},
            {"kind": "static"},
            rope={"nodes": [0, 1, 2], **rope},
        ).build()


def test_shipped_scene():
    """The net closes behind the debris: its rim ends beyond it, drawn together, and the balances are kept."""
    given, at_drum = refweb.Scene.load("closing-net"), {"quantity": "tension", "thread": "drawstring", "segment": 0}
    observe = *given.observe, refweb.Observe(name="at_drum", **at_drum, reduce="max")
    run = refweb.run(given.replace(accuracy=refweb.Accuracy(error="none"), observe=observe))
    assert run.status == "solved" and run.solver["energy_drift"] < 5e-3
    assert [finding.code for finding in run.findings] == ["left-out"]  # the thread, of max_tension
    web, history, start = run.state.system.net.web, run.history, run.history["kinetic_energy"][0]
    mass = 200.0 * 1e-4 * web.natural_length.sum() + 4 * 0.25
    # Pairs of forces cancel; what is left is the rounding of 6000 steps.
    np.testing.assert_allclose(history["momentum_z"], 4.0 * mass, rtol=1e-9)
    closed(history, 5e-3 * start)
    assert history["winch_energy"][-1] < -0.5 * start and history["dissipated_energy"][-1] > 0.1 * start
    assert run.results["at_drum"].value <= 30.0 * (1.0 + 1e-9)  # the limit
    assert run.results["pull"].value <= 30.0 * np.exp(0.1 * 4.0 * np.pi)  # once round, and half a turn at each ring
    rim, debris = run.positions[web.rim], run.state.position[-1]
    assert rim[:, 2].min() > debris[2] + 0.3  # its radius
    # The net is 1.9 m wide: a mouth of half of that is closed by more than the winch takes in.
    assert np.ptp(rim[:, :2], axis=0).max() < 0.5 * 1.9 and run.results["debris_speed"].value > 0.0


def jumping(winch, prestrain, on="thread", mass=1e6, **tables):
    """A mass too heavy to move on a taut rope of 2 m and 1 kN, whose winch has a tension of its own."""
    rope = {"law": "tension-only", "modulus": 1e8, "area": 1e-5, "density": 0.0}
    given = {
        "web": {"kind": "inline", "points": [[0, 0, 0], [0, 0, -2.0]], "lines": [[0, 1]], "supports": [0]},
        "cable": {**rope, "prestrain": prestrain},
        "winch": [{"lines": 0, **winch}],
        "point_mass": [{"node": 1, "mass": mass}],
        "observe": [{"name": "held", "quantity": "strain_energy"}],
        "output": {"interval": 0.01},
        "solve": {"kind": "dynamic", "duration": 0.02},
        **tables,
    }
    if on == "thread":
        given["web"] |= {"points": [[0, 0, 0], [0, 0, -2.0], [5, 0, 0], [6, 0, 0]], "lines": [[2, 3]]}
        given["web"]["supports"] = [0, 2, 3]
        given["cable"] = rope
        given["thread"] = [{"name": "rope", "nodes": [0, 1], **rope, "prestrain": prestrain}]
        given["winch"] = [{"thread": "rope", "end": "first", **winch}]
    return refweb.Scene.from_dict(given)


@pytest.mark.parametrize("on", ["thread", "lines"])
@pytest.mark.parametrize("winch", [{"tension": 10.0}, {"tension": 200.0}, {"speed": 0.0, "limit": 10.0}])
def test_energy_of_a_winch_that_starts_at_another_tension(winch, on):
    """It takes at once what the strain energy ½ EA ε² L loses, of ε = 0.1 and L = 2/1.1 m at the start."""
    found = {name: values[-1] for name, values in refweb.run(jumping(winch, 0.1, on)).history.items()}
    held = 0.5 * 1e3 * 0.1**2 * 2.0 / 1.1
    left = found["strain_energy"] + found["kinetic_energy"]
    assert found["winch_energy"] == pytest.approx(held - left, rel=1e-6)


@pytest.mark.parametrize("first, then, prestrain", [(10.0, 100.0, 0.01), (1.0, 150.0, 1e-3), (100.0, 5.0, 0.1)])
def test_energy_closes_where_a_tension_is_set(first, then, prestrain):
    run = refweb.start(jumping({"tension": first}, prestrain))
    run.advance()
    run.set("winch.0.tension", then)
    run.advance()
    history = run.finish().history
    held = history["strain_energy"]
    assert history["winch_energy"][-1] == pytest.approx(held[0] - held[-1], rel=1e-6)
    size = np.abs(history["winch_energy"]).max()
    np.testing.assert_allclose(history["total_energy"], history["total_energy"][0], atol=1e-6 * size)


def test_a_limit_may_be_controlled():
    """A limit is above 0, also where it is tried."""
    control = [{"name": "c", "law": "pid", "parameters": {"proportional": 1.0}, "period": 0.01, "target": 50.0,
                "sets": "winch.0.limit", "measures": ["held"]}]  # fmt: skip
    history = refweb.run(jumping({"speed": 0.1, "limit": 200.0}, 0.01, mass=2.0, control=control)).history
    assert np.isfinite(history["winch_energy"]).all()
