"""What rows say together: spread and ± apart, intervals that hold at their level, indices in closed form.

Rows are made up here, of functions whose distributions are known, so that tens of thousands of them cost nothing.
"""

import concurrent.futures

import numpy as np
import pytest
from scipy.stats import beta, binom, norm

import refweb
from refweb.results.study_text import on_design, rows_of_conditions, rows_of_spread
from refweb.sweeps.chances import chances, clopper_pearson
from refweb.sweeps.design import groups, points
from refweb.sweeps.study import Study

U = {"from": 0.0, "to": 1.0}


def told(study, function, error=0.0, **cells):
    """What `chances` makes of the cases of a study whose result ``y`` is a function of their values."""
    rows = []
    for case in points(study):
        own = error(case.values) if callable(error) else error
        more = {name: cell(case.values) if callable(cell) else cell for name, cell in cells.items()}
        rows.append((case, {"status": "solved", "y [m]": function(case.values), "y ±": own, **more}))
    return chances(study, rows, ["y [m]", "y ±"], groups(study))


# Samples


def test_samples_are_of_their_distributions():
    """Of 256 points of a Sobol sequence each of 16 equal shares has 16; of a Latin hypercube each of 256 has one."""
    for sample, parts in (("sobol", 16), ("latin-hypercube", 256)):
        given = {"x": {"distribution": "norm", "loc": 3.0, "scale": 2.0}, "y": {"from": 1.0, "to": 5.0}}
        found = points(Study(scene="s", parameters=given, sample=sample, count=256, seed=4))
        shares = norm(3.0, 2.0).cdf([case.values["x"] for case in found])
        assert np.bincount((shares * parts).astype(int), minlength=parts).tolist() == [256 // parts] * parts
        shares = (np.array([case.values["y"] for case in found]) - 1.0) / 4.0
        assert np.bincount((shares * parts).astype(int), minlength=parts).tolist() == [256 // parts] * parts


@pytest.mark.parametrize("sample", ["random", "sobol", "halton", "latin-hypercube"])
def test_every_entry_of_a_list_meets_the_same_samples(sample):
    study = Study(scene="s", parameters={"mesh": ["a", "b"], "x": U}, sample=sample, count=8, seed=1)
    found = points(study)
    assert [case.values["mesh"] for case in found] == ["a"] * 8 + ["b"] * 8 and groups(study) == [
        {"mesh": "a"},
        {"mesh": "b"},
    ]
    first, second = ([case.values["x"] for case in found if case.group == group] for group in (0, 1))
    assert first == second and len(set(first)) == 8 and all(0.0 <= x <= 1.0 for x in first)
    other = points(Study(scene="s", parameters={"x": U}, sample=sample, count=8, seed=2))
    assert [case.values["x"] for case in other] != first


def test_a_ratio_is_spread_over_its_logarithm():
    given = {"x": {"from": 1.0, "to": 1e4, "spacing": "log"}, "n": {"distribution": "randint", "low": 0, "high": 4}}
    found = points(Study(scene="s", parameters=given, sample="latin-hypercube", count=400, seed=1))
    assert np.histogram([np.log10(case.values["x"]) for case in found], [0, 1, 2, 3, 4])[0].tolist() == [100] * 4
    assert (
        sorted(case.values["n"] for case in found) == sorted([0, 1, 2, 3] * 100) and type(found[0].values["n"]) is int
    )


# Means, spread and quantiles


def test_the_mean_of_samples_is_within_its_standard_error():
    """Of 100 studies of 64 independent samples; the z-score has the variance of Student's t, 63/61."""
    scores = []
    for seed in range(100):
        study = Study(scene="s", parameters={"x": U}, sample="random", count=64, seed=seed)
        (entry,) = told(study, lambda v: v["x"])
        one = entry["results"]["y"]
        scores.append((one["mean"] - 0.5) / one["standard_error"])
    assert abs(np.mean(scores)) < 4.0 / np.sqrt(100) and 0.7 < np.std(scores) < 1.3


def test_intervals_of_quantiles_hold_at_their_level():
    inside = 0
    for seed in range(200):
        study = Study(
            scene="s", parameters={"x": U}, sample="random", count=100, seed=seed, quantiles=[0.3], confidence=0.9
        )
        (entry,) = told(study, lambda v: v["x"] ** 3)
        low, high = entry["results"]["y"]["quantiles"][0]["interval"]
        inside += low <= 0.3**3 <= high
    assert inside >= binom.ppf(1e-4, 200, 0.9)


def test_spread_and_error_are_told_apart():
    """Each dominates once: samples let the share of the spread in the mean fall, and that of ± stay as it is."""
    for wide, error in ((1.0, 1e-6), (1e-6, 1.0)):
        shares = []
        for count in (64, 1024):
            study = Study(scene="s", parameters={"x": U}, sample="sobol", count=count, seed=3)
            (entry,) = told(study, lambda v, wide=wide: wide * v["x"], error)
            one = entry["results"]["y"]
            assert one["deviation"] == pytest.approx(wide / np.sqrt(12.0), rel=0.05)
            assert one["mean_error"] == pytest.approx(error) == one["error"]
            (low, _, high) = (q for q in one["quantiles"])
            assert low["most"] - low["least"] == pytest.approx(2.0 * error) and high["value"] == pytest.approx(
                0.95 * wide, rel=0.05
            )
            shares.append(one["standard_error"])
        assert shares[0] / shares[1] == pytest.approx(4.0, rel=0.05)


def test_the_spread_of_values_that_are_off_is_within_its_error():
    """Values off by up to ±, also all away from their mean, where the spread changes most."""
    generator = np.random.default_rng(0)
    study = Study(scene="s", parameters={"x": U}, sample="random", count=8, seed=3)
    (exact,) = told(study, lambda v: v["x"], 0.1)
    spread, error = (exact["results"]["y"][key] for key in ("deviation", "deviation_error"))
    assert error == pytest.approx(0.1 * np.sqrt(8 / 7))
    outward = [lambda v: v["x"] + 0.1 * np.sign(v["x"] - exact["results"]["y"]["mean"])]
    changed = [
        told(study, off, 0.1)[0]["results"]["y"]["deviation"] - spread
        for off in [*outward, *[lambda v: v["x"] + generator.uniform(-0.1, 0.1)] * 50]
    ]
    assert 0.8 * error < max(np.abs(changed)) <= error
    (unknown,) = told(study, lambda v: v["x"], lambda v: None)
    assert unknown["results"]["y"]["deviation_error"] is None


def test_results_beyond_the_horizon_join_by_their_ensemble():
    """The variance is that between the cases and that within: x uniform, each run spread by 0.1 about it."""
    study = Study(scene="s", parameters={"x": U}, sample="sobol", count=256, seed=3, conditions={"high": "y > 0.5"})
    more = {"statistical": "y", "y mean": lambda v: v["x"], "y deviation": 0.1}
    (entry,) = told(study, lambda v: v["x"] + 0.01, 0.3, **more)
    one, chance = entry["results"]["y"], entry["conditions"]["high"]
    assert one["mean"] == pytest.approx(0.5, abs=0.01) and one["error"] == 0.0
    assert one["deviation"] ** 2 == pytest.approx(1.0 / 12.0 + 0.01, rel=0.02)
    assert chance["statistical"] == 256 and chance["undecided"] == 0


def test_an_ensemble_leaves_a_case_that_is_not_drawn_undecided():
    """Of normal runs with mean x and deviation 0.1 the limit 0.5 leaves hardly any at 0.2 and 0.8 only."""
    study = Study(scene="s", parameters={"x": [0.2, 0.4, 0.6, 0.8]}, conditions={"high": "y > 0.5"})
    more = {"statistical": "y", "y mean": lambda v: v["x"], "y deviation": 0.1}
    (entry,) = told(study, lambda v: 0.9, 0.3, **more)
    chance = entry["conditions"]["high"]
    assert [chance[key] for key in ("true", "false", "undecided", "statistical")] == [1, 1, 2, 4]


# Conditions


def test_clopper_pearson_holds_at_its_level():
    """Coverage summed over all outcomes of the binomial distribution, and the beta quantiles that define the ends."""
    for n, level in ((20, 0.95), (60, 0.8)):
        ends = [clopper_pearson(k, n, level) for k in range(n + 1)]
        for p in np.linspace(0.01, 0.99, 25):
            covered = sum(binom.pmf(k, n, p) for k, (low, high) in enumerate(ends) if low <= p <= high)
            assert covered >= level - 1e-9
        tail = 0.5 * (1.0 - level)
        assert ends[7] == pytest.approx((beta.ppf(tail, 7, n - 6), beta.ppf(1.0 - tail, 8, n - 7)))


@pytest.mark.ordinary("0.02")
@pytest.mark.parametrize("error", [0.0, 0.02])
def test_a_known_probability_is_covered(error):
    """x uniform, p(x < 0.3) = 0.3, in 100 studies of 40 samples: also where values are off by their ±."""
    inside = undecided = 0
    for seed in range(100):
        given = {"parameters": {"x": U}, "sample": "random", "count": 40, "conditions": {"low": "y < 0.3"}}
        (entry,) = told(Study(scene="s", seed=seed, confidence=0.9, **given), lambda v: v["x"] + 0.9 * error, error)
        chance = entry["conditions"]["low"]
        inside += chance["interval"][0] <= 0.3 <= chance["interval"][1]
        undecided += chance["undecided"]
        assert chance["true"] + chance["false"] + chance["undecided"] == 40
    assert inside >= binom.ppf(1e-4, 100, 0.9)
    if error:
        assert undecided == pytest.approx(100 * 40 * 2.0 * error, rel=0.3)
    else:
        assert undecided == 0


def test_what_is_not_known_counts_either_way():
    study = Study(scene="s", parameters={"x": U}, sample="random", count=4, conditions={"low": "y < 0.5"})
    ends = [("solved", 0.1), ("solved", 0.9), ("failed", None), ("skipped", None)]
    rows = [
        (case, {"status": status, "y [m]": y, "y ±": 0.01} if y else {"status": status})
        for case, (status, y) in zip(points(study), ends, strict=True)
    ]
    (entry,) = chances(study, rows, ["y [m]", "y ±"], groups(study))
    chance = entry["conditions"]["low"]
    assert [chance[key] for key in ("true", "false", "failed")] == [1, 1, 1] and chance["share"] == 0.5
    assert chance["interval"] == [clopper_pearson(1, 3, 0.95)[0], clopper_pearson(2, 3, 0.95)[1]]


def test_a_grid_has_shares_and_no_chances():
    study = Study(scene="s", parameters={"x": [0.1, 0.2, 0.6]}, conditions={"low": "y < 0.5"})
    (entry,) = told(study, lambda v: v["x"], lambda v: None)
    assert entry["conditions"]["low"]["share"] == pytest.approx(2 / 3) and "interval" not in entry["conditions"]["low"]
    assert entry["conditions"]["low"]["unproven"] == 3 and entry["results"]["y"]["error"] is None
    assert "mean" not in entry["results"]["y"]


def test_undecided_cases_count_either_way_in_lower_and_upper_shares():
    """Of x = 0.1, 0.2 ... 0.9 with ± 0.15 the limit 0.5 leaves 0.4, 0.5 and 0.6 open: 3 to 6 of 9 are below."""
    study = Study(scene="s", parameters={"x": [n / 10 for n in range(1, 10)]}, conditions={"low": "y < 0.5"})
    (entry,) = told(study, lambda v: v["x"], 0.15)
    chance = entry["conditions"]["low"]
    assert [chance[key] for key in ("true", "false", "undecided")] == [3, 3, 3]
    assert chance["lower"] == pytest.approx(3 / 9) and chance["upper"] == pytest.approx(6 / 9)
    assert chance["lower"] <= chance["share"] <= chance["upper"] and chance["share"] == pytest.approx(4 / 9)
    (row,) = rows_of_conditions(entry).rows
    assert row[1] == "33.33 to 66.67 %, 44.44 % by values without ±" and "3 undecided" in row[4]


def test_one_case_that_is_undecided_holds_in_anything_from_none_to_all():
    study = Study(scene="s", parameters={"x": [0.4]}, conditions={"low": "y < 0.5"})
    (entry,) = told(study, lambda v: v["x"], 0.15)
    (row,) = rows_of_conditions(entry).rows
    assert row[1] == "0 to 100 %, 100 % by values without ±"


def test_a_range_of_one_value_is_that_value():
    wide, one = ({"sample": "grid", "parameters": {"x": {"from": 0.1, "to": 0.3, "count": n}}} for n in (2, 1))
    assert on_design(wide)[0] == "x (0.1 … 0.3)" and on_design(one)[0] == "x (0.1)"


def test_arithmetic_of_results_is_undecided_within_what_their_errors_make_of_it():
    """2 y − 1 < 0 is decided where |y − 0.5| > ±, as y < 0.5 is; x y at x = 3 has three times the ±."""
    given = {"plain": "y < 0.5", "scaled": "2*y - 1 < 0", "product": "x*y < 1.5"}
    study = Study(scene="s", parameters={"x": [3.0], "z": [n / 10 for n in range(1, 10)]}, conditions=given)
    (entry,) = told(study, lambda v: v["z"], 0.15)
    found = [entry["conditions"][name] for name in given]
    assert all([one[key] for key in ("true", "false", "undecided")] == [3, 3, 3] for one in found)


def test_a_draw_that_is_not_sampled_counts_with_its_error():
    """Behind the horizon and without an ensemble: with ± 0.3 only 0.1 and 0.9 are decided, and none without ±."""
    study = Study(scene="s", parameters={"x": [0.1, 0.4, 0.6, 0.9]}, conditions={"low": "y < 0.5"})
    for error, expected in ((0.3, [1, 1, 2]), (None, [0, 0, 4])):
        (entry,) = told(study, lambda v: v["x"], lambda v, error=error: error, statistical="y")
        chance = entry["conditions"]["low"]
        assert [chance[key] for key in ("true", "false", "undecided")] == expected and chance["statistical"] == 4


def test_an_undecided_flag_is_undecided_and_a_bound_decides():
    study = Study(scene="s", parameters={"x": [0.0, 1.0]}, conditions={"held": "y > 0.5"})
    (entry,) = told(study, lambda v: 1.0, 1.0, **{"y least": lambda v: v["x"], "y most": 1.0})
    chance = entry["conditions"]["held"]
    assert [chance[key] for key in ("true", "false", "undecided", "unproven")] == [1, 0, 1, 0]
    (entry,) = told(study, lambda v: 1.0, lambda v: None, **{"y least": lambda v: v["x"], "y most": np.inf})
    assert entry["conditions"]["held"]["unproven"] == 0


def test_verdicts_are_counted():
    study = Study(scene="s", parameters={"x": [0.1, 0.2, 0.6]})
    verdicts = {"y verdict": lambda v: "wide" if v["x"] < 0.5 else None}
    (entry,) = told(study, lambda v: v["x"], 0.1, **verdicts)
    assert entry["results"]["y"]["verdicts"] == {"wide": 2, "none": 1}
    spread = rows_of_spread(entry)
    assert spread.columns[-1] == "verdict" and spread.rows[0][-1] == "2 wide, 1 none"
    (plain,) = told(study, lambda v: v["x"], 0.1)
    assert "verdict" not in rows_of_spread(plain).columns


# Sobol's indices

A, B = 7.0, 0.1


def ishigami(values):
    x = [values[name] for name in ("x1", "x2", "x3")]
    return np.sin(x[0]) + A * np.sin(x[1]) ** 2 + B * x[2] ** 4 * np.sin(x[0])


def test_indices_of_the_ishigami_function():
    """Ishigami and Homma (1990): variances V1 = (1 + b π⁴/5)²/2, V2 = a²/8, V13 = b² π⁸ 8/225."""
    given = {name: {"from": -np.pi, "to": np.pi} for name in ("x1", "x2", "x3")}
    study = Study(scene="s", parameters=given, sample="sobol", count=1024, seed=5, indices=True)
    assert len(points(study)) == 1024 * 5
    (entry,) = told(study, ishigami, 0.01)
    one, two, both = 0.5 * (1.0 + B * np.pi**4 / 5.0) ** 2, A**2 / 8.0, 8.0 * B**2 * np.pi**8 / 225.0
    total = one + two + both
    first, whole = (one, two, 0.0), (one + both, two, both)
    found = entry["indices"]["y"]
    for name, true, with_others in zip(("x1", "x2", "x3"), first, whole, strict=True):
        for kind, index in (("first", true / total), ("total", with_others / total)):
            value, (low, high) = found["of"][name][kind]["value"], found["of"][name][kind]["interval"]
            assert value == pytest.approx(index, abs=0.03) and low - 0.02 <= index <= high + 0.02
    assert found["error"] == pytest.approx(0.01 / np.sqrt(total), rel=0.02)
    assert entry["results"]["y"]["count"] == 2048, "A and B are samples, what is mixed of them is none"
    assert entry["results"]["y"]["mean"] == pytest.approx(A / 2.0, abs=0.05)


def test_indices_without_all_results_are_not_known():
    given = {"x": U, "y": U}
    study = Study(scene="s", parameters=given, sample="sobol", count=4, seed=5, indices=True)
    rows = [(case, {"status": "failed"}) for case in points(study)]
    rows[1:] = [(case, {"status": "solved", "y [m]": 1.0, "y ±": 0.0}) for case, _ in rows[1:]]
    (entry,) = chances(study, rows, ["y [m]", "y ±"], groups(study))
    assert entry["indices"]["y"] == {"reason": "1 of 16 cases have no result"}


def test_runs_join_with_their_errors():
    """On two arms: ± is far below the spread of forces, and above it where all forces are the same but for 1e-14."""

    class Here(concurrent.futures.Executor):
        def submit(self, fn, /, *args, **kwargs):
            future = concurrent.futures.Future()
            future.set_result(fn(*args, **kwargs))
            return future

    web = {
        "kind": "inline",
        "points": [[-1, 0, 0], [0, 0, 0], [1, 0, 0]],
        "lines": [[0, 1], [1, 2]],
        "supports": [0, 2],
    }
    scene = refweb.Scene.from_dict(
        {
            "web": web,
            "cable": {"law": "tension-only", "modulus": 1e6, "area": 1e-4, "density": 100.0},
            "load": [{"node": 1, "force": [0.0, 0.0, 1.0]}],
            "solve": {"kind": "static"},
        }
    )
    for width, larger in ((0.1, False), (1e-14, True)):
        given = {"load.0.force.2": {"from": 1.0 - width, "to": 1.0 + width}}
        found = refweb.sweep(scene, given, executor=Here(), sample="sobol", count=4)
        one = found.chances[0]["results"]["max_tension"]
        assert (one["error"] > one["deviation"]) == larger
