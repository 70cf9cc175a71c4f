"""Sizing: closed-form optima from several starts, conditions of an optimum, catalogues, ±, resume and wrong input.

Two bars to a loaded point, of which the least mass is a formula with finite strains, are solved in milliseconds.
"""

import concurrent.futures
import itertools
import json
import math
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import tomli_w
from scipy.optimize import brentq, minimize

import refweb
from refweb.__main__ import main
from refweb.pictures.sizing import front
from refweb.sizing.case import Task
from refweb.sizing.formulas import Criterion
from refweb.sizing.sqp import minimise
from refweb.sweeps.case import Outcome
from refweb.sweeps.expressions import Interval

HALF, LOAD, MODULUS, DENSITY, LIMIT = 1.0, 1000.0, 7e10, 1500.0, 1e8
BARS = {
    "title": "Two bars",
    "web": {
        "kind": "inline",
        "points": [[-HALF, 0, 0], [0, 0, -0.6], [HALF, 0, 0]],
        "lines": [[0, 1], [1, 2]],
        "supports": [0, 2],
    },
    "cable": {"law": "linear", "modulus": MODULUS, "area": 1e-5, "density": DENSITY},
    "load": [{"node": 1, "force": [0.0, 0.0, -LOAD]}],
    "solve": {"kind": "static"},
}
AREA = {"from": 1e-7, "to": 1e-3, "spacing": "log"}
STRONG = {"strong": "max_stress < 1e8"}


class Here(concurrent.futures.Executor):
    """Runs what it is given in this process, and counts it."""

    def __init__(self):
        self.ran = []

    def submit(self, fn, /, job):
        self.ran.append(job.key)
        future = concurrent.futures.Future()
        future.set_result(self.outcome(fn, job))
        return future

    def outcome(self, fn, job):
        return fn(job)


class MadeUp(Here):
    """Says without a solver what comes of a design: x is its area over 1e-5, of a sphere's error, and y its load."""

    error = 0.0

    def outcome(self, fn, job):
        x, y = job.given["cable"]["area"] / 1e-5, job.given["load"][0]["force"][2]
        cells = {"status": "solved", "message": ""}
        for name, value in {"max_stress": x, "deflection": abs(x - y), "max_tension": y}.items():
            cells |= {f"{name} [1]": value, f"{name} ±": self.error}
        return Outcome(job.key, cells)


def write(folder, tables=BARS, **keys):
    """A requirements file and its scene in a folder; its path."""
    (folder / "bars.toml").write_text(tomli_w.dumps(tables))
    given = {"scene": "bars.toml", "minimise": "cable_mass", "parameters": {"cable.area": AREA}, "requirements": STRONG}
    given = {key: value for key, value in (given | keys).items() if value is not None}
    (folder / "needed.toml").write_text(tomli_w.dumps(given))
    return folder / "needed.toml"


def sized(folder, executor=None, **keys):
    return refweb.size(write(folder, trade_off=False, **keys), executor=executor or Here(), progress=False)


# Closed forms


@pytest.mark.slow
@pytest.mark.parametrize("start", [-0.25, -1.4, pytest.param(-2.6, marks=pytest.mark.slow)])
def test_two_bars_of_least_mass(start, tmp_path):
    """Bars that carry P at stress σ have the mass ρ P b/(σ (1 + ε) sin φ cos φ), least at φ = 45° as they hang.

    The limit is met to 1e-9 of it, so that mass and area are met to 1e-8. The height is that without strain.
    """
    height = {"paths": ["web.points.1.2"], "from": -3.0, "to": -0.2, "start": start}
    found = sized(tmp_path, parameters={"cable.area": AREA, "height": height}, starts=1)
    stretched = 1.0 + LIMIT / MODULUS
    assert found.status == "solved" and found.method == "gradients" and not found.notes
    assert found.objective["value"] == pytest.approx(2.0 * DENSITY * LOAD * HALF / LIMIT / stretched, rel=1e-8)
    assert found.values["cable.area"] == pytest.approx(LOAD / math.sqrt(2.0) / LIMIT, rel=1e-8)
    assert found.values["height"] == pytest.approx(-math.sqrt(2.0 * (HALF / stretched) ** 2 - HALF**2), rel=1e-8)
    (strong,) = found.requirements
    assert strong["holds"] and strong["governs"] and 0.0 < strong["least"] < 1e-8
    # mass goes as 1/(σ + σ²/E)
    costs = 0.01 * found.objective["value"] * (2.0 - 1.0 / stretched)
    assert strong["costs"] == pytest.approx(costs, rel=1e-7)
    assert found.optimality["residual"] < 1e-9 and not found.optimality["at_bound"]


@pytest.mark.parametrize("start", [4e-3, *(pytest.param(d, marks=pytest.mark.slow) for d in (1.5e-3, 1.5e-2))])
def test_a_cable_under_a_point_load_that_may_sink(start, tmp_path):
    """A straight cable sinks by d under P where E A ε 2 d/l = P; its stress does not govern."""
    scene = {**BARS, "web": {**BARS["web"], "points": [[-HALF, 0, 0], [0, 0, 0], [HALF, 0, 0]]}}
    scene["cable"] = {**BARS["cable"], "law": "tension-only", "strength": 4e9, "safety_factor": 2.0}
    wanted = {"stiff": "deflection < 0.05 and deflection > 0.01", "strong": "margin > 0.1"}
    thick = {"cable.diameter": {"from": 1e-3, "to": 2e-2, "start": start}}
    found = sized(tmp_path, tables=scene, requirements=wanted, parameters=thick, starts=1)
    length = math.hypot(HALF, 0.05)
    area = LOAD * length / (2.0 * 0.05 * MODULUS * (length / HALF - 1.0))
    stiff, strong = found.requirements
    # ± of a deflection by the tension-only law is the root of a gap of rounding
    assert 0.25 * math.pi * found.values["cable.diameter"] ** 2 == pytest.approx(area, rel=1e-8 + 4.0 * stiff["most"])
    assert stiff["governs"] and not strong["governs"] and strong["costs"] == 0.0
    stress = MODULUS * (length / HALF - 1.0)
    assert strong["least"] == pytest.approx((4e9 / 2.0 / stress - 1.0 - 0.1) / 0.1, rel=1e-6)
    assert stiff["costs"] > 0.0 and found.optimality["residual"] < 1e-6


def arm_stress(omega, radius=2.0, count=4, modulus=1e9, density=1000.0):
    """Stress at the root of an elastic arm of nodes that turns: T_k − T_(k+1) = m_k ω² r_k, linear in r."""
    h = radius / count
    matrix, right = np.zeros((count, count)), np.zeros(count)
    for k in range(count):
        stiff, mass = modulus / h, density * h * (0.5 if k == count - 1 else 1.0)
        matrix[k, k] += stiff - mass * omega**2
        if k:
            matrix[k, k - 1] -= stiff
        if k < count - 1:
            matrix[k, k] += stiff
            matrix[k, k + 1] -= stiff
            right[k] += modulus - modulus
        else:
            right[k] += modulus
    return modulus * (np.linalg.solve(matrix, right)[0] / h - 1.0)


@pytest.mark.ordinary("1.0", "5.0")
@pytest.mark.parametrize("start", [1.0, 5.0, 9.0])
def test_a_spinning_arm_as_fast_as_its_root_bears(start, tmp_path):
    """The stress of a stiff arm is ρ ω² R²/2, of lumped masses too; of an elastic one a linear system says it."""
    assert arm_stress(1.0, modulus=1e15) == pytest.approx(0.5 * 1000.0 * 1.0 * 2.0**2, rel=1e-3)
    scene = {
        "web": {"kind": "cable", "start": [0, 0, 0], "end": [2.0, 0, 0], "elements": 4},
        "cable": {"law": "linear", "modulus": 1e9, "area": 1e-5, "density": 1000.0},
        "supports": {"nodes": [0]},
        "frame": {"angular_velocity": [0.0, 0.0, 1.0]},
        "solve": {"kind": "static"},
    }
    omega = {"paths": ["frame.angular_velocity.2"], "from": 0.5, "to": 10.0, "start": start}
    keys = {"minimise": "-omega", "parameters": {"omega": omega}, "requirements": {"strong": "max_stress < 5e4"}}
    found = sized(tmp_path, tables=scene, starts=1, **keys)
    exact = brentq(lambda omega: arm_stress(omega) - 5e4, 1.0, 9.9, xtol=1e-14)
    assert exact == pytest.approx(math.sqrt(2.0 * 5e4 / 1000.0) / 2.0, rel=1e-3)
    assert found.values["omega"] == pytest.approx(exact, rel=1e-8) and found.optimality["residual"] < 1e-9


CHAIN = {
    **BARS,
    "web": {
        "kind": "inline",
        "points": [[0, 0, 0], [0, 0, -1], [0, 0, -2]],
        "lines": [[0, 1], [1, 2]],
        "supports": [0],
        "groups": {"upper": [0]},
    },
    "cable": {**BARS["cable"], "groups": {"upper": {"area": 1e-5}}},
    "load": [{"node": n, "force": [0.0, 0.0, -LOAD]} for n in (1, 2)],
}


@pytest.mark.ordinary("1e-05")
@pytest.mark.parametrize("start", [1e-5, 3e-5])
def test_where_two_lines_share_the_largest_stress(start, tmp_path):
    """A chain of two lines with a load at each node is least where both have the stress of the limit.

    The largest stress has a kink there. The limit is met to 1e-9 of it; sizes go as its inverse.
    """
    areas = {n: {"paths": [p], **AREA} for n, p in {"upper": "cable.groups.upper.area", "lower": "cable.area"}.items()}
    areas["upper"]["start"] = start
    found = sized(tmp_path, tables=CHAIN, parameters=areas, starts=1)
    assert found.status == "solved" and found.optimality["residual"] < 1e-9
    assert found.values["upper"] == pytest.approx(2.0 * LOAD / LIMIT, rel=1e-8)
    assert found.values["lower"] == pytest.approx(LOAD / LIMIT, rel=1e-8)
    (strong,) = found.requirements
    assert strong["governs"] and strong["costs"] == pytest.approx(0.01 * found.objective["value"], rel=1e-7)


LINES_APART = {
    **BARS,
    "web": {
        "kind": "inline",
        "points": [[0, 0, 0], [0, 0, -1], [1, 0, 0], [1, 0, -1]],
        "lines": [[0, 1], [2, 3]],
        "supports": [0, 2],
        "groups": {"upper": [0]},
    },
    "cable": CHAIN["cable"],
    "load": [{"node": 1, "force": [0.0, 0.0, -2.0 * LOAD]}, {"node": 3, "force": [0.0, 0.0, -LOAD]}],
}
"""Two lines that hang apart, of which one carries twice the load: of stresses and deflections as the chain."""


@pytest.mark.ordinary("max_stress-100000000.0")
@pytest.mark.parametrize("objective, unit", [("max_stress", LIMIT), ("-margin", None), ("deflection", LIMIT / MODULUS)])
def test_where_lines_and_nodes_share_an_objective(objective, unit, tmp_path):
    """Of a mass 3 ρ P/σ at most, the least of the largest stress is σ, of the largest deflection σ/E.

    The mass that counts is that of the natural lengths of 1 m.
    """
    areas = {n: {"paths": [p], **AREA} for n, p in {"first": "cable.groups.upper.area", "second": "cable.area"}.items()}
    areas["first"]["start"] = 3e-5
    tables = {**LINES_APART, "cable": {**LINES_APART["cable"], "strength": 3.0 * LIMIT}}
    keys = {"minimise": objective, "requirements": {"light": f"cable_mass < {3.0 * DENSITY * LOAD / LIMIT!r}"}}
    found = sized(tmp_path, tables=tables, parameters=areas, starts=1, **keys)
    assert found.status == "solved" and found.optimality["residual"] < 1e-8
    least = -2.0 if unit is None else unit  # a margin of 3 σ/σ − 1
    assert found.objective["value"] == pytest.approx(least, rel=1e-8)
    assert found.values["first"] == pytest.approx(2.0 * LOAD / LIMIT, rel=1e-7)
    (light,) = found.requirements  # stresses go as the inverse of the mass
    costs = 0.01 * (3.0 if unit is None else least)
    assert light["governs"] and light["costs"] == pytest.approx(costs, rel=1e-6)


@pytest.mark.ordinary("deflection < 0.0014285714285714286")
@pytest.mark.parametrize(
    "condition", ["margin > 2", "utilisation < 0.3333333333333333", f"deflection < {LIMIT / MODULUS!r}"]
)
def test_where_lines_and_nodes_share_a_limit(condition, tmp_path):
    """The least mass that has the stress σ of a limit in both lines, as where they share the largest stress."""
    areas = {n: {"paths": [p], **AREA} for n, p in {"first": "cable.groups.upper.area", "second": "cable.area"}.items()}
    tables = {**LINES_APART, "cable": {**LINES_APART["cable"], "strength": 3.0 * LIMIT}}
    found = sized(tmp_path, tables=tables, parameters=areas, starts=1, requirements={"strong": condition})
    assert found.status == "solved" and found.optimality["residual"] < 1e-8
    assert found.values["first"] == pytest.approx(2.0 * LOAD / LIMIT, rel=1e-8)
    assert found.values["second"] == pytest.approx(LOAD / LIMIT, rel=1e-8)


def test_at_a_bound(tmp_path):
    """Mass falls with the area until its bound, where no requirement governs; the bound has the multiplier."""
    found = sized(tmp_path, parameters={"cable.area": {"from": 2e-5, "to": 1e-4}}, starts=1)
    assert found.values == {"cable.area": 2e-5} and not found.requirements[0]["governs"]
    assert list(found.optimality["at_bound"]) == ["cable.area"] and found.optimality["residual"] < 1e-12
    (gain,) = found.optimality["at_bound"].values()
    assert gain == pytest.approx(found.objective["value"] * (1e-4 - 2e-5) / 2e-5, rel=1e-9)  # mass over the fraction


def test_all_numbers_at_a_bound(tmp_path):
    """Mass falls with the area, and does not know a force: both bounds are named, the second with a multiplier of 0."""
    force = {"paths": ["load.0.force.0"], "from": 0.0, "to": 100.0, "start": 0.0}
    parameters = {"force": force, "cable.area": {"from": 2e-5, "to": 1e-4}}
    at_bound = sized(tmp_path, parameters=parameters, starts=1).optimality["at_bound"]
    assert at_bound["force"] == 0.0 < at_bound["cable.area"] and len(at_bound) == 2


@pytest.mark.slow
def test_where_no_design_meets_the_requirements(tmp_path, capsys):
    """At the largest area the stress is nearest to its limit; the text says by how much it fails."""
    path = write(tmp_path, parameters={"cable.area": {"from": 1e-7, "to": 2e-6}}, starts=1)
    assert main(["size", str(path), "--out", str(tmp_path / "s")]) == 1
    printed = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert "infeasible" in printed and "no design within bounds meets all requirements" in printed
    stress = refweb.run(refweb.Scene.from_dict({**BARS, "cable": {**BARS["cable"], "area": 2e-6}})).results[
        "max_stress"
    ]
    assert f"strong, max_stress < 1e8, fails by {100.0 * (stress.value / 1e8 - 1.0):.3g} % of its limit" in printed
    assert json.loads((tmp_path / "s" / "run.json").read_text())["values"]["cable.area"] == pytest.approx(2e-6)


@pytest.mark.slow
def test_a_search_that_ends_early_confirms_nothing(tmp_path, capsys):
    """After one run the stress is far below its limit: nothing governs, no cost is known, and the status says so."""
    path = write(tmp_path, parameters={"cable.area": {**AREA, "start": 1e-4}}, starts=1, runs=1, trade_off=False)
    assert main(["size", str(path), "--out", str(tmp_path / "s")]) == 0
    assert "a better design may exist" in " ".join(capsys.readouterr().out.replace("│", " ").split())
    found = json.loads((tmp_path / "s" / "run.json").read_text())
    (strong,) = found["requirements"]
    assert found["status"] == "unconfirmed" and strong["holds"] and strong["least"] > 0.5
    assert not strong["governs"] and strong["costs"] is None


# Options


def test_a_catalogue_with_a_choice_and_whole_numbers(tmp_path):
    """The least mass of all that bear the load, by hand; density and area come from one row."""
    (tmp_path / "lines.csv").write_text("name,diameter,density\nthin,0.002,1000\nmiddle,0.003,3000\nthick,0.004,1500\n")
    keys = {
        "parameters": {
            "line": {"catalogue": "lines.csv"},
            "height": {"paths": ["web.points.1.2"], "values": [-0.5, -1.0]},
            "parts": {"paths": ["cable.subdivide"], "from": 1, "to": 2, "whole": True},
        }
    }
    here = Here()
    found = sized(tmp_path, here, **keys)
    assert found.method == "enumeration" and len(here.ran) == 12 == len(found.designs)
    expected = {}
    for name, diameter, density in (("thin", 2e-3, 1000.0), ("middle", 3e-3, 3000.0), ("thick", 4e-3, 1500.0)):
        for height in (0.5, 1.0):
            area, length = 0.25 * math.pi * diameter**2, math.hypot(1.0, height)
            if 0.5 * LOAD * length / height / area < LIMIT:
                expected[2.0 * density * area * length] = (name, -height)
    name, height = expected[min(expected)]
    assert (found.values["line"], found.values["height"]) == (name, height)
    assert found.objective["value"] == pytest.approx(min(expected), rel=1e-12)


def test_one_of_two_scenes_with_numbers_between_bounds(tmp_path):
    """Each choice has its least design; the lighter one of two heights is that of 45°."""
    for name, height in (("low", -0.3), ("right", -1.0)):
        points = [[-HALF, 0, 0], [0, 0, height], [HALF, 0, 0]]
        (tmp_path / f"{name}.toml").write_text(tomli_w.dumps({**BARS, "web": {**BARS["web"], "points": points}}))
    found = sized(tmp_path, scene=["low.toml", "right.toml"], starts=1)
    assert found.values["scene"] == "right" and found.requirements[0]["governs"]
    assert found.scene.web.points[1][2] == -1.0


# Searches, of made-up results


@pytest.mark.ordinary("direct")
@pytest.mark.parametrize("method", ["evolution", "direct"])
def test_searches_come_near(method, tmp_path):
    """x is least where x ≥ 2, within what a search of a few hundred designs can say."""
    keys = {"minimise": "max_stress", "requirements": {"enough": "max_stress >= 2"}, "method": method, "runs": 400}
    found = sized(tmp_path, MadeUp(), parameters={"cable.area": {"from": 1e-5, "to": 9e-5}}, **keys)
    assert found.status == "solved" and 2.0 <= found.objective["value"] < 2.02
    assert all(d["holds"] == (d["objective"] >= 2.0) for d in found.designs)


def test_evolution_takes_options_and_ends_with_its_runs(tmp_path):
    here = MadeUp()
    parameters = {"cable.area": {"from": 1e-5, "to": 9e-5}, "load.0.force.2": [1.0, 2.0, 3.0]}
    keys = {"minimise": "max_stress + 10 * max_tension", "requirements": {"near": "deflection < 0.1"}}
    found = sized(tmp_path, here, parameters=parameters, method="evolution", runs=150, **keys)
    assert len(here.ran) == len(set(here.ran)) <= 150 and found.status == "solved"
    assert found.values["load.0.force.2"] == 1.0 and abs(found.values["cable.area"] - 1e-5) < 1.1e-6


def test_undecided_designs_count_as_not_meeting(tmp_path):
    """With ± of 0.5 only a stress of 2.5 and less holds below 3: 3 is undecided, and the note says so."""
    executor = MadeUp()
    executor.error = 0.5
    keys = {"minimise": "-max_stress", "requirements": {"below": "max_stress < 3"}, "method": "enumeration"}
    found = sized(tmp_path, executor, parameters={"cable.area": [1e-5, 2e-5, 2.75e-5, 3.25e-5, 4e-5]}, **keys)
    assert found.values["cable.area"] == 2e-5 and [d["holds"] for d in found.designs] == [True, True, None, None, False]
    assert len(found.notes) == 1 and found.notes[0].startswith("2 lesser designs are not decided within ±")


def test_designs_that_are_as_good_within_their_error(tmp_path):
    """1 ± 0.5 and 1.5 ± 0.5 have no order; 3 ± 0.5 is larger than both."""
    executor = MadeUp()
    executor.error = 0.5
    keys = {"requirements": {"above": "max_stress > 0"}, "parameters": {"cable.area": [1e-5, 1.5e-5, 3e-5]}}
    found = sized(tmp_path, executor, minimise="max_stress", **keys)
    assert found.status == "solved" and found.values["cable.area"] == 1e-5
    assert found.notes == ["1 other design is as good within ± of max_stress: their order is not decided"]


def test_where_nothing_is_decided_and_where_the_minimum_has_no_value(tmp_path):
    """A stress of 3 ± 0.5 may be below 3: the status says so. The root of −1 is no size that designs are ordered by."""
    executor = MadeUp()
    executor.error = 0.5
    keys = {"requirements": {"below": "max_stress < 3"}, "parameters": {"cable.area": [3e-5, 4e-5]}}
    found = sized(tmp_path, executor, minimise="max_stress", **keys)
    assert found.status == "undecided" and found.message.endswith("a run with a smaller ± decides it")
    with pytest.raises(refweb.SolverError, match="has no finite value"):
        sized(tmp_path, MadeUp(), minimise="sqrt(2 - max_stress)", **keys)


@pytest.mark.slow
def test_starts_in_the_notes(tmp_path):
    """The notes say where the searches from all starts ended."""
    found = sized(tmp_path, starts=2)
    assert found.status == "solved" and found.notes[0].startswith("2 of 2 starts end at this objective")


@pytest.mark.parametrize("start", [9e-5, pytest.param(1e-6, marks=pytest.mark.slow)])
@pytest.mark.parametrize("gap", ["(cable.area > 5e-5 or cable.area < 2e-5)", "not 2e-5 <= cable.area <= 5e-5"])
def test_the_better_side_of_a_condition_with_or(gap, start, tmp_path):
    """Lines of 2 to 5e-5 m² are not to be had: from any start the least one bears P at the limit, A = P/σ = 1e-5 m².

    The side of 5e-5 m², which a large one is nearest to, has an optimum as well.
    """
    area, wanted = {"cable.area": {**AREA, "start": start}}, {"either": f"max_stress < 1e8 and {gap}"}
    tables = {**LINES_APART, "cable": BARS["cable"], "load": [{"node": 1, "force": [0.0, 0.0, -LOAD]}]}
    found = sized(tmp_path, tables=tables, parameters=area, requirements=wanted, starts=1)
    assert found.status == "solved" and found.optimality["residual"] < 1e-8 and not found.notes
    assert found.values["cable.area"] == pytest.approx(LOAD / LIMIT, rel=1e-8)
    (either,) = found.requirements
    assert either["holds"] and either["governs"]
    assert either["costs"] == pytest.approx(0.01 * found.objective["value"], rel=1e-6)


def test_sides_within_their_error(tmp_path):
    """With ± of 0.5 either side must hold as a whole: 2 is below 3, 4.8 above 4, and 3.4 may be neither."""
    executor = MadeUp()
    executor.error = 0.5
    keys = {"minimise": "-max_stress", "requirements": {"apart": "max_stress < 3 or max_stress > 4"}}
    found = sized(tmp_path, executor, parameters={"cable.area": [2e-5, 3.4e-5, 4.8e-5]}, **keys)
    assert [design["holds"] for design in found.designs] == [True, None, True]
    assert found.values["cable.area"] == 4.8e-5 and found.status == "solved"


def test_sides_that_are_too_many(tmp_path):
    """Of 2⁵ sides together each start follows the nearest, which a note says; strains of 1.4e-3 turn the bars."""
    wanted = {f"either {n}": f"max_stress < {1e8 + n:g} or cable.area > 1e-3" for n in range(5)}
    found = sized(tmp_path, requirements=wanted, starts=1)
    assert found.values["cable.area"] == pytest.approx(LOAD * math.hypot(1.0, 0.6) / 1.2 / LIMIT, rel=0.01)
    assert any("has more than 16 sides together, of which each start follows" in note for note in found.notes)


def test_with_a_probability(tmp_path):
    """Of draws that all have the same seed; the lower end of the interval of Clopper and Pearson is above 0.7."""
    keys = {
        "draws": {"load.0.force.2": {"distribution": "uniform", "loc": 1.0, "scale": 2.0}},
        "count": 40,
        "minimise": "max_stress + max_tension",
        "requirements": {"likely": {"condition": "max_stress > max_tension", "probability": 0.7}},
    }
    executor = MadeUp()
    areas = [1e-5 * (1.0 + 0.25 * n) for n in range(9)]
    found = sized(tmp_path, executor, parameters={"cable.area": areas}, **keys)
    study = refweb.Study(scene="s", parameters=keys["draws"], sample="random", count=40)
    from scipy.stats import binomtest, ttest_1samp

    from refweb.sweeps.design import points

    drawn = np.array([case.values["load.0.force.2"] for case in points(study)])
    lower = [binomtest(int((1e5 * a > drawn).sum()), 40).proportion_ci(0.95).low for a in areas]
    first = next(n for n, low in enumerate(lower) if low > 0.7)
    assert found.values["cable.area"] == areas[first] and len(executor.ran) == 9 * 40
    assert found.requirements[0]["least"] == pytest.approx(lower[first] / 0.7 - 1.0)
    mean = ttest_1samp(drawn + 1e5 * areas[first], 0.0).confidence_interval(0.95)
    assert found.objective["value"] + found.objective["error"] == pytest.approx(mean.high, rel=1e-12)
    assert found.notes[0].startswith("max_stress + max_tension is the mean of 40 draws")
    with pytest.raises(refweb.InputError, match="is not shown by count = 4 draws"):
        sized(tmp_path, executor, parameters={"cable.area": areas}, **keys | {"count": 4})


def test_derivatives_of_a_run():
    """Those of the adjoint are those of runs.

    Two alike lines share the largest stress, and have opposite derivatives by the place of the node. That of the pull
    on the supports is left out, as it is a kink.
    """
    tables = {
        **BARS,
        "observe": [{"name": "side", "quantity": "stress", "line": 0}, {"name": "most", "quantity": "stress"}],
    }
    tables["observe"] += [{"name": "pull", "quantity": "reaction", "node": [0, 2], "select": "max"}]
    tables["cable"] = {**BARS["cable"], "strength": 2e8}
    numbers = (("web.points.1.0", 0.0), ("cable.density", DENSITY))
    names = ("cable_mass", "packed_volume", "margin", "utilisation")
    task = Task(names, (*names, "side", "most", "pull"), numbers)
    found = task(refweb.Scene.from_dict(tables))["more"]
    assert "pull by web.points.1.0" not in found and "pull by cable.density" in found
    assert found["cable_mass by web.points.1.0"] == pytest.approx(0.0, abs=1e-12)
    left, right = (found[f"most of line {line} by web.points.1.0"] for line in (0, 1))
    assert left == found["side by web.points.1.0"] and right == pytest.approx(-left, rel=1e-9)
    length = 2.0 * math.hypot(1.0, 0.6)
    assert found["cable_mass by cable.density"] == pytest.approx(1e-5 * length, rel=1e-10)
    assert found["packed_volume by cable.density"] == pytest.approx(0.0, abs=1e-15)
    results = []
    for x in (-1e-5, 1e-5):
        points = [[-HALF, 0, 0], [x, 0, -0.6], [HALF, 0, 0]]
        moved = refweb.Scene.from_dict({**tables, "web": {**BARS["web"], "points": points}})
        results.append(Task(())(moved)["results"])
    stress = [result["side"]["value"] for result in results]
    assert found["side by web.points.1.0"] == pytest.approx((stress[1] - stress[0]) / 2e-5, rel=1e-6)
    slope = found["utilisation by web.points.1.0"]  # of either side: both govern
    assert abs(slope) == pytest.approx(abs(found["side by web.points.1.0"]) / 2e8, rel=1e-9)
    used = sum(stress) / 2.0 / 2e8
    assert found["margin by web.points.1.0"] == pytest.approx(-slope / used**2, rel=1e-6)


# Folders


def test_folder_and_resume(tmp_path, capsys):
    """What is recorded is not run again, and the design is the same; its scene meets the requirements by itself."""
    tables = {**BARS, "cable": {**BARS["cable"], "strength": 2e8}}
    path, out = (
        write(tmp_path, tables, starts=1, requirements={"strong": "margin > 1", "used": "utilisation < 0.6"}),
        tmp_path / "s",
    )
    first = refweb.size(path, out=out, executor=(here := Here()), progress=False)
    lines = (out / "results.csv").read_text().splitlines(keepends=True)
    assert len(lines) == 1 + len(here.ran) == 1 + first.runs
    design = refweb.run(out / "design.toml").results
    assert 0.0 < 1e8 - design["max_stress"].value - design["max_stress"].error < 1.0
    assert refweb.load(out / "design").results == design and (out / "design" / "report.html").is_file()
    (out / "results.csv").write_text("".join(lines[: len(lines) // 2]) + lines[-1][:20])  # killed within a row
    again = refweb.size(path, out=out, executor=(rest := Here()), progress=False)
    assert again.values == first.values and again.objective == first.objective
    assert set(rest.ran) == set(here.ran[len(lines) // 2 - 1 :]) and len(rest.ran) == len(set(rest.ran))
    assert main(["size", str(path), "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert f"0 runs, {len(here.ran)} recorded before" in printed and (out / "trade-off.png").stat().st_size > 10_000
    assert main(["info", str(out)]) == 0 and "strong" in capsys.readouterr().out
    assert main(["plot", str(out)]) == 2 and "trade-off.png" in capsys.readouterr().err
    assert main(["sweep", "price-of-safety", "--out", str(out)]) == 2 and "holds no study" in capsys.readouterr().err


@pytest.mark.slow
def test_a_kill_loses_no_recorded_run(tmp_path):
    """Of a process of its own, killed after some rows; what goes on is compared with one that was not killed."""
    height = {"paths": ["web.points.1.2"], "from": -3.0, "to": -0.2}
    path = write(tmp_path, parameters={"cable.area": AREA, "height": height}, starts=2)
    command = [sys.executable, "-m", "refweb", "size", str(path), "--out", str(tmp_path / "s")]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    table = tmp_path / "s" / "results.csv"
    while process.poll() is None and not (table.is_file() and table.read_text().count("\n") > 6):
        time.sleep(0.05)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    recorded = {line.split(",")[0] for line in table.read_text().splitlines()[1:] if line.endswith(("0", "."))}
    rest = refweb.size(path, out=tmp_path / "s", executor=(here := Here()), progress=False)
    whole = refweb.size(path, executor=Here(), progress=False)
    assert rest.values == whole.values and rest.objective == whole.objective and not recorded & set(here.ran)


# Wrong input

WRONG = {
    "misspelt key": ({"minimize": "x"}, 'did you mean "minimise"?'),
    "misspelt path": ({"parameters": {"cable.aera": AREA}}, 'did you mean "area"?'),
    "misspelt key of a number": ({"parameters": {"cable.area": {"form": 1, "to": 2}}}, 'did you mean "from"?'),
    "misspelt result": ({"requirements": {"strong": "max_stres < 1"}}, 'did you mean "max_stress"?'),
    "misspelt minimum": ({"minimise": "cable_mas"}, 'did you mean "cable_mass"?'),
    "reversed": ({"parameters": {"cable.area": {"from": 2e-6, "to": 1e-6}}}, "to = 1e-06 must be > from = 2e-06"),
    "end": ({"parameters": {"cable.area": {"from": -1.0, "to": 1e-6}}}, "area = -1.0 must be > 0"),
    "start": ({"parameters": {"cable.area": {"from": 1.0, "to": 2.0, "start": 3.0}}}, "start = 3 must be from 1 to 2"),
    "empty catalogue": ({"parameters": {"line": {"catalogue": []}}}, "must hold at least one row"),
    "empty file": ({"parameters": {"line": {"catalogue": "empty.csv"}}}, "empty.csv: holds no row"),
    "no file": ({"parameters": {"line": {"catalogue": "none.csv"}}}, "none.csv: cannot be read"),
    "catalogue column": ({"parameters": {"line": {"catalogue": [{"diamter": 1.0}]}}}, "diamter"),
    "nothing free": ({"parameters": {}}, "must be a table of free numbers"),
    "twice": ({"parameters": {"cable.area": AREA, "a": {"paths": ["cable.area"], "from": 1, "to": 2}}}, "both set"),
    "always": ({"requirements": {"strong": "deflection > -1"}}, "is true of every design within bounds"),
    "never": ({"requirements": {"strong": "cable.area > 1"}}, "is true of no design within bounds"),
    "constant": ({"requirements": {"strong": "1 < 2"}}, "is true of every design within bounds"),
    "no value": ({"requirements": {"strong": "1/(max_stress - max_stress) < 2"}}, "has no value, whatever its names"),
    "no least": ({"minimise": "cable_mass/(max_stress - max_stress)"}, "has no value, whatever its names are, as a di"),
    "a power": ({"requirements": {"strong": "max_stress**9**9 < 1e8"}}, "an exponent must be from -100 to 100"),
    "excluded": (
        {"requirements": {"strong": "max_stress < 1e8 and 2e8 < max_stress"}},
        "strong: no max_stress is above 2e+08 and below 1e+08: change one of them",
    ),
    "excluded by two": (
        {"requirements": {"a": "max_stress < 1e8 or cable.area > 9e-4", "b": "2e8 < max_stress and cable.area < 8e-4"}},
        "a, b: no max_stress is above 2e+08 and below 1e+08: change one of them",
    ),
    "no condition": ({"requirements": {"strong": "max_stress"}}, "compares nothing"),
    "a condition": ({"minimise": "max_stress < 1"}, "is a condition, and must be a number"),
    "a number": ({"minimise": "3"}, "depends on no free number"),
    "area and diameter": (
        {"parameters": {"cable.area": AREA, "cable.diameter": {"from": 1e-3, "to": 2e-3}}},
        "both set",
    ),
    "an equation": ({"requirements": {"strong": "max_stress == 1e8"}}, "holds for no whole ± of max_stress"),
    "no effect": ({"minimise": "cable_length"}, "does not depend on cable.area: every design is as good"),
    "probability": ({"requirements": {"s": {"condition": "max_stress < 1e8", "probability": 0.5}}}, "without [draws]"),
    "count": ({"count": 4}, "has no meaning without [draws]"),
    "method": ({"method": "enumeration"}, "needs no numbers between bounds"),
    "name": ({"parameters": {"max_stress": {**AREA, "paths": ["cable.area"]}}}, "is the name of a result"),
    "scene": ({"scene": "squre-load"}, 'did you mean "square-load"?'),
    "nothing": ({"requirements": None}, "holds no requirements"),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_requirements_are_one_line_and_change_nothing(name, tmp_path, capsys, monkeypatch):
    keys, message = WRONG[name]
    path = write(tmp_path, **keys)
    (tmp_path / "empty.csv").write_text("name,area\n")
    before = sorted(p.name for p in tmp_path.iterdir())
    monkeypatch.chdir(tmp_path)
    assert main(["size", str(path), "--out", "s"]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and err.startswith("refweb: ") and message in err
    assert sorted(p.name for p in tmp_path.iterdir()) == before


def test_requirements_are_no_scene_and_no_study(tmp_path, capsys):
    path = str(write(tmp_path))
    for verb in ("run", "sweep"):
        assert main([verb, path]) == 2 and "refweb size" in capsys.readouterr().err
    assert main(["check", path]) == 0 and "gradients" in capsys.readouterr().out
    assert main(["info", path, "--json"]) == 0 and json.loads(capsys.readouterr().out)["sizing"]["minimise"]


# Parts


@pytest.mark.parametrize("limit", [1.5, 3.0])
def test_sequential_quadratic_programming(limit):
    """Rosenbrock's valley in a disk, against SLSQP of scipy; inside of the disk and on its rim."""

    def functions(x):
        gradient = [-400.0 * x[0] * (x[1] - x[0] ** 2) - 2.0 * (1.0 - x[0]), 200.0 * (x[1] - x[0] ** 2)]
        value = 100.0 * (x[1] - x[0] ** 2) ** 2 + (1.0 - x[0]) ** 2
        return value, np.array(gradient), np.array([limit - x @ x]), -2.0 * x[None]

    found = minimise(functions, np.array([-0.3, 0.3]), np.full(2, -2.0), np.full(2, 2.0), 1e-10)
    disk = {"type": "ineq", "fun": lambda x: functions(x)[2], "jac": lambda x: functions(x)[3]}
    options = {"jac": lambda x: functions(x)[1], "constraints": disk, "options": {"ftol": 1e-15, "maxiter": 500}}
    known = minimize(lambda x: functions(x)[0], [0.8, 0.6], method="SLSQP", **options).x
    np.testing.assert_allclose(found, known, atol=1e-6)


def test_reserves_of_intervals():
    """Ends of all differences of two numbers within ±."""
    formula = Criterion("x > 2 * y and y < 4", ["x", "y"], True)
    first, second = formula.reserves({"x": Interval(3.0, 5.0), "y": Interval(0.5, 1.5)})
    assert first == (0.0, 4.0) and second == (2.5 / 4.0, 3.5 / 4.0)
    assert formula({"x": Interval(3.0, 5.0), "y": Interval(0.5, 1.6)}) is None


@pytest.mark.parametrize(
    "text, count",
    [
        ("x > 1 or y > 1", 2),
        ("not (x > 1 and y > 1)", 2),
        ("not (x > 1 or y > 1)", 1),
        ("x > 1 and not (y > 1 and not (x > 3 or y < 2))", 3),
    ],
)
def test_a_condition_holds_where_one_of_its_sides_does(text, count):
    """By De Morgan's laws the denial of a conjunction has a side for each of its parts, that of a disjunction one."""
    formula = Criterion(text, ["x", "y"], True)
    assert formula.count == count
    for x, y in itertools.product((0.5, 1.5, 2.5, 3.5), repeat=2):
        values = {"x": Interval(x, x), "y": Interval(y, y)}
        sides = [all(r.low > 0.0 for r in formula.side(n).reserves(values)) for n in range(count)]
        assert formula({"x": x, "y": y}) == any(sides)


@pytest.mark.parametrize(
    "text", ["x > 2", "2 * x - y / 3 <= x**2", "1 < sqrt(x) + abs(-y)", "max(x, y) > 3 and min(x, y * x) < 1 or x > 0"]
)
def test_reserves_and_their_slopes(text):
    """A condition is true where its reserve is above 0; the slope is that of differences."""
    formula = Criterion(text, ["x", "y"], True)
    rng = np.random.default_rng(3)
    for x, y in rng.uniform(0.1, 4.0, (40, 2)):
        reserves = formula.reserves({"x": Interval(x, x), "y": Interval(y, y)})
        assert formula({"x": x, "y": y}) == (min(r.low for r in reserves) > 0.0)
        slopes = {"x": np.array([1.0, 0.0]), "y": np.array([0.0, 1.0])}
        for n, (value, slope) in enumerate(formula.slopes({"x": x, "y": y}, slopes)):
            assert value == pytest.approx(reserves[n].low)
            moved = [
                formula.reserves({"x": x + h[0], "y": y + h[1]})[n].low
                for h in ((1e-6, 0), (-1e-6, 0), (0, 1e-6), (0, -1e-6))
            ]
            by_difference = [(moved[0] - moved[1]) / 2e-6, (moved[2] - moved[3]) / 2e-6]
            np.testing.assert_allclose(np.zeros(2) + slope, by_difference, rtol=1e-5, atol=1e-7)


def test_the_front_is_of_designs_that_none_beats():
    rng = np.random.default_rng(1)
    designs = [{"objective": a, "reserve": b} for a, b in rng.random((60, 2))]
    chosen = front(designs)
    for design in designs:
        beaten = any(
            d["objective"] <= design["objective"] and d["reserve"] >= design["reserve"] and d is not design
            for d in designs
        )
        assert beaten == (design not in chosen)
