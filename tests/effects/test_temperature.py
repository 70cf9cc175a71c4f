"""Thermal strain: heated bars and a heated catenary in closed form, groups, tables over load steps and over time."""

import nets
import numpy as np
import pytest
from scipy.optimize import brentq

import refweb
from refweb.dynamics.integrators.central_difference import CentralDifference
from refweb.errors import InputError
from refweb.net.tension_laws import Law

AXIAL = 7e3
CABLE = dict(modulus=7e7, area=1e-4, density=200.0)
EPS = np.finfo(float).eps


def scene(web, temperature, effects=(), law="tension-only", solve=None, **cable):
    return refweb.Scene(
        web=web,
        cable=refweb.Cable(law=law, **{**CABLE, **cable}),
        effects=[temperature, *effects],
        solve=solve or refweb.Static(),
    )


# Bars between fixed ends

TABLE = [(0.0, 0.0), (1.0, -400.0), (3.0, 800.0)]


@pytest.mark.parametrize("method", ["newton", "relaxation"])
@pytest.mark.parametrize("law", nets.LAWS)
def test_a_heated_bar(law, method):
    """T = A σ(d/(L(1 + αΔT)) − 1), whatever the state of the bar; of elements of order 2 as well."""
    web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], natural_length=0.99, supports=[0, 1])
    heat = refweb.Temperature(expansion=2e-5, change=TABLE)
    own = {key: value for key, value in nets.LAWS[law].items() if key != "law"}
    solve = refweb.Static(load_steps=[0.0, 0.5, 1.0, 2.0, 9.0, 0.25], method=method)
    for order in (1, 2):
        history = refweb.run(scene(web, heat, law=law, solve=solve, order=order, **own)).history
        change = np.interp(history["step"], *np.transpose(TABLE))
        strain = 1.0 / (0.99 * (1.0 + 2e-5 * change)) - 1.0
        assert strain.min() < -1e-3 and strain.max() > 1e-2
        expected = Law(law).stress(strain, 7e7, own.get("slackness", 0.0), own.get("smoothing", 0.0)) * 1e-4
        # The length rounds to an ulp, the strain by as much.
        np.testing.assert_allclose(history["max_tension"], expected, rtol=0, atol=4.0 * EPS * AXIAL)


def test_bars_in_a_row_by_group():
    """Three groups, of which one has its own expansion, one its own change: Σ L(1 + αΔT)(1 + T/EA) = d."""
    web = refweb.Inline(
        points=[[0, 0, 0], [1, 0, 0], [1.5, 0, 0], [3.5, 0, 0]],
        lines=[[0, 1], [1, 2], [2, 3]],
        supports=[0, 3],
        groups=["", "aramid", "shaded"],
    )
    natural, axial = np.array([1.0, 0.5, 2.0]), np.array([AXIAL, AXIAL, 2 * AXIAL])
    heat = refweb.Temperature(
        expansion=1e-5,
        change=-50.0,
        groups={"aramid": dict(expansion=-4e-6), "shaded": dict(change=[(0.0, -50.0), (2.0, -150.0)])},
    )
    groups = {"shaded": dict(area=2e-4)}
    solution = refweb.run(scene(web, heat, groups=groups, solve=refweb.Static(load_steps=[0, 1, 5])))
    for step, tension in zip(solution.history["step"], solution.history["max_tension"], strict=True):
        factor = 1.0 + np.array([-5e-4, 2e-4, 1e-5 * np.interp(step, [0, 2], [-50, -150])])
        expected = (natural.sum() - (natural * factor).sum()) / (natural * factor / axial).sum()
        # Equilibrium is found to 1e-9, lengths of 2 m round to 4e-16 m, which EA/L makes a force.
        np.testing.assert_allclose(tension, expected, rtol=1e-9, atol=10 * EPS * AXIAL)
    np.testing.assert_allclose(solution.tension, expected, rtol=1e-9)


@pytest.mark.parametrize("order", [1, 2])
def test_a_heated_catenary(order):
    """The elastic catenary of the heated length and the weight of the cold one; sags of 2p order in the elements.

    With H the force across, W the weight and S the natural length, half of the span is HS/2EA + (HS/W) asinh(W/2H), the
    sag WS/8EA + (S/W)(√(H² + W²/4) − H).
    """
    span, cold, heat = 1.0, 1.02, refweb.Temperature(expansion=1e-4, change=1000.0)
    length, weight = 1.1 * cold, 9.81 * 2e4 * 1e-4 * cold

    def across(H):
        return H * length / (2 * AXIAL) + H * length / weight * np.arcsinh(weight / (2 * H)) - span / 2

    H = brentq(across, 1e-3 * weight, 1e3 * weight, xtol=1e-15 * weight, rtol=4 * EPS)
    sag = weight * length / (8 * AXIAL) + length / weight * (np.hypot(H, weight / 2) - H)
    assert sag > 0.2
    errors, counts = [], np.array([16, 24, 32, 48])
    for count in counts:
        web = refweb.SingleCable(start=(-0.5, 0, 0), end=(0.5, 0, 0), elements=int(count), length=cold)
        gravity = refweb.Gravity(acceleration=(0.0, 0.0, -9.81))
        solution = refweb.run(scene(web, heat, [gravity], density=2e4, order=order))
        errors.append(abs(sag + solution.positions[count // 2, 2]))
        np.testing.assert_allclose(solution.reaction[:, 2].sum(), weight, rtol=1e-9)
    order_found = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    # The next term is (1/count)² of this one, times a number of order one.
    assert abs(order_found - 2 * order) < 0.1


# Time

HEAT = refweb.Temperature(expansion=1e-4, change=[(0.0, 0.0), (0.006, -300.0), (0.01, 100.0)])
SAME = refweb.Reel(lines="all", factor=[(0.0, 1.0), (0.006, 1.0 - 0.03), (0.01, 1.0 + 0.01)])


def moving(effect, web=None, **solve):
    observe = [
        refweb.Observe(name="tension", quantity="tension", reduce="max"),
        refweb.Observe(name="speed", quantity="velocity"),
        refweb.Observe(name="done", quantity="work"),
    ]
    found = scene(web or nets.skew_web(), effect, law="linear", solve=refweb.Dynamic(duration=0.015, **solve))
    return found.replace(observe=observe, output=refweb.Output(interval=1e-3))


@pytest.mark.ordinary("central-difference")
@pytest.mark.parametrize("method", nets.some(["central-difference", "cvode", "ida"], 2))
def test_heat_is_a_reel_of_every_line(method):
    """The same factor of natural length by either effect, for every method; methods agree within the sum of their ±."""
    solve = dict(safety=0.02) if method == "central-difference" else dict(method=method, rtol=1e-6)
    heated, reeled = refweb.run(moving(HEAT, **solve)), refweb.run(moving(SAME, **solve))
    reference = refweb.run(moving(HEAT, method="cvode", family="adams", rtol=1e-9))
    assert heated.solver["energy_drift"] < 1e-4 and heated.results["tension"].value > 0.02 * AXIAL
    for name, result in heated.results.items():
        # 1 + α ΔT rounds otherwise than the factor in the table.
        np.testing.assert_allclose(reeled.results[name].value, result.value, rtol=1e-9)
        other = reference.results[name]
        assert abs(result.value - other.value) <= result.error + other.error < 0.05 * abs(result.value)


@pytest.mark.parametrize("law", nets.LAWS)
def test_the_book_closes_to_second_order(law):
    """Through slack and taut, with corners of the table in the middle of steps."""
    web = refweb.Window(mesh="square", rows=4, columns=4, side=0.2).web()
    own = {key: value for key, value in nets.LAWS[law].items() if key != "law"}
    heat = refweb.Temperature(expansion=1e-4, change=[(0.0, -300.0), (0.0051, -400.0), (0.0113, -250.0)])
    system = nets.system(web, refweb.Cable(law=law, **CABLE, **own), [heat], quasi_static=False)
    drifts, counts = [], []
    for safety in (0.2, 0.1, 0.05, 0.025):
        solver = CentralDifference(system, safety=safety)
        run = solver.start()
        solver.advance(run, np.linspace(0.0, 0.02, 21))
        assert abs(run.work[-1]) > 0.1
        drifts.append(run.drift)
        counts.append(run.nsteps)
    assert drifts[-1] < 1e-5 and abs(np.polyfit(np.log(counts), np.log(drifts), 1)[0] + 2.0) < 0.1


def test_a_constant_change_costs_no_work():
    """Lengths that stay as they are at t = 0: an equilibrium stays, and the work is exactly zero."""
    heat = refweb.Temperature(expansion=1e-5, change=-500.0)
    web = refweb.Window(mesh="hexagon", rows=5, columns=4, side=0.2)
    solution = refweb.run(moving(heat, web, start="equilibrium"))
    assert solution.results["done"].value == 0.0
    # ε = 1/(1 − 0.005) − 1 in every line of a regular net whose ends are fixed.
    np.testing.assert_allclose(solution.results["tension"].value, AXIAL * (1.0 / 0.995 - 1.0), rtol=1e-9)
    assert solution.results["speed"].value < 1e-6


# Scenes


def test_a_scene_is_read_and_written():
    given = {
        "web": {"kind": "inline", "points": [[0, 0, 0], [1, 0, 0]], "lines": [[0, 1]], "supports": [0, 1]},
        "cable": {"law": "linear", "modulus": 7e7, "area": 1e-4, "density": 200.0},
        "solve": {"kind": "static"},
        "temperature": {"expansion": 1e-5, "change": [[0, 0], [1, 20]], "groups": {"": {"change": 3.0}}},
    }
    found = refweb.Scene.from_dict(given)
    assert found.effects[0].change == ((0.0, 0.0), (1.0, 20.0)) and found.effects[0].groups[""].expansion is None
    text = found.to_dict()
    assert text["temperature"] == given["temperature"] and refweb.Scene.from_dict(text).to_dict() == text


@pytest.mark.parametrize(
    "table, message",
    [
        (dict(expansion=1e-5), r"\[temperature\] change is missing: give change = ... \[K\]"),
        (dict(change=1.0), r"\[temperature\] expansion is missing: give expansion = ... \[1/K\]"),
        (dict(expansion="hot", change=1.0), 'expansion = "hot" must be a number'),
        (dict(expansion=1e-5, change="hot"), 'change = "hot" must be a number'),
        (dict(expansion=1e-5, change=[[0.0, 1.0], [0.0, 2.0]]), r"change\[1\]\[0\] = 0.0 must be > 0"),
        (dict(expansion=1e-2, change=-100.0), r"\[temperature\] 1 \+ expansion × change = 0 must be > 0"),
        (dict(expansion=1e-2, change=[[0.0, 0.0], [1.0, -300.0]]), "1 \\+ expansion × change = -2 must be > 0"),
        (dict(expansion=0.0, change=-2.0, groups={"edge": {"expansion": 1.0}}), "groups.edge 1 .* = -1 must be > 0"),
        (
            dict(expansion=0.0, change=1.0, groups={"edges": {}}),
            r'groups "edges" is not a group of lines, did .*edge',
        ),
        (dict(expansion=0.0, change=1.0, groups={"edge": {"modulus": 1.0}}), "groups.edge modulus = 1.0: unknown key"),
        (
            dict(expansion=0.0, change=1.0, groups=3),
            "groups = 3 must be a table of groups",
        ),
    ],
)
def test_refusals(table, message):
    with pytest.raises(InputError, match=message):
        refweb.Temperature.read("[temperature]", table).extend(nets.skew_net())
