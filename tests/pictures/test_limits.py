"""Limits of axes come from the values; a bar of ± that goes beyond is cut, with an arrow and its number."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from nets import SMALL

import refweb
from refweb.pictures import limits, plots, sheet
from refweb.pictures.limits import Bar
from refweb.pictures.record import of_solution
from refweb.pictures.studies import Rows, draw
from refweb.results.case_rows import Named
from refweb.results.observables.observe import bounds_by_name

NOT_NEGATIVE = (0.0, np.inf)


@pytest.fixture(autouse=True)
def small(monkeypatch):
    monkeypatch.setattr(sheet, "RESOLUTION", 40)


def texts(axes):
    return [text.get_text() for text in axes.texts]


def arrows(axes):
    """Places of the arrows at the ends of an axis, and which way they point."""
    markers = {"^", "v", "<", ">"}
    return [(*line.get_xydata()[0], line.get_marker()) for line in axes.get_lines() if line.get_marker() in markers]


@pytest.mark.parametrize(
    ("values", "bars", "bounds", "ends"),
    [
        ([0.0, 10.0], [], (-np.inf, np.inf), (-1.0, 11.0)),
        ([0.0, 10.0], [], NOT_NEGATIVE, (0.0, 11.0)),
        ([5.0, 6.0], [], NOT_NEGATIVE, (4.9, 6.1)),
        ([-2.0, 8.0], [], NOT_NEGATIVE, (-3.0, 9.0)),  # a value is never hidden
        ([0.0, 10.0], [Bar(0.0, 10.0, 2.0, 2.0)], NOT_NEGATIVE, (0.0, 13.2)),
        ([0.0, 10.0], [Bar(0.0, 10.0, 11.0, 11.0)], NOT_NEGATIVE, (0.0, 11.0)),
        ([0.0, 10.0], [Bar(0.0, 1.0, 3.0, 3.0)], (-np.inf, np.inf), (-3.2, 11.2)),
        ([3.0], [Bar(0.0, 3.0, 1.0, 1.0)], NOT_NEGATIVE, (1.8, 4.2)),  # one value: its size stands for the range
        ([0.0, np.nan], [Bar(0.0, 0.0, 7.0, 7.0)], NOT_NEGATIVE, (0.0, 0.1)),
    ],
)
def test_the_window(values, bars, bounds, ends):
    """A margin of a tenth, with ± where it is at most the range of the values, and no negative part."""
    np.testing.assert_allclose(limits.window(np.array(values), bars, bounds), ends, atol=1e-12)


def test_no_window_without_values():
    assert limits.window(np.array([np.nan])) is None


def test_a_bar_that_is_cut_has_an_arrow_and_its_number():
    axes = Figure().subplots()
    axes.set_xlim(0.0, 1.0)
    limits.limit(axes, np.array([0.0, 285.6]), [Bar(0.1, 285.6, 285.6, 371.12)], NOT_NEGATIVE, "kPa")
    assert axes.get_ylim() == pytest.approx((0.0, 314.16))
    assert arrows(axes) == [(0.1, pytest.approx(314.16), "^")] and texts(axes) == ["± 371 kPa"]


def test_a_bar_that_is_cut_at_both_ends_has_two_arrows():
    axes = Figure().subplots()
    limits.limit(axes, np.array([-1.0, 1.0]), [Bar(0.5, 0.0, 5.0, 5.0)], unit="mm/s")
    assert [(way, end) for _, end, way in arrows(axes)] == [("^", pytest.approx(1.2)), ("v", pytest.approx(-1.2))]
    assert texts(axes) == ["± 5 mm/s"] * 2


def test_many_bars_that_are_cut_are_counted():
    axes = Figure().subplots()
    bars = [Bar(float(n), n / 10.0, 0.0, 20.0 + n) for n in range(7)]
    limits.limit(axes, [], bars, NOT_NEGATIVE, "N")
    assert len(arrows(axes)) == 7 and texts(axes) == ["7 bars are cut, ± at most 26 N"]


def test_a_horizontal_axis_is_cut_as_well():
    axes = Figure().subplots()
    limits.limit_along(axes, np.array([1.0, 2.0]), np.array([0.5, 30.0]), NOT_NEGATIVE, "m")
    assert axes.get_xlim() == pytest.approx((0.35, 2.15)) and [way for *_, way in arrows(axes)] == [">", "<"]
    assert texts(axes) == ["± at most 30 m"] * 2


def test_what_cannot_be_negative_is_known_by_the_scene():
    """Of magnitudes, tensions of a law without push and stored energies; not of components, positions and struts."""
    observe = [
        {"name": "speed", "quantity": "velocity"},
        {"name": "along", "quantity": "velocity", "component": "x"},
        {"name": "pull", "quantity": "tension"},
        {"name": "stretch", "quantity": "strain"},
    ]
    tables = {"cable": {"law": "tension-only", "groups": {"rim": {"area": 1.0}}}, "observe": observe}
    lower = {name: bounds[0] for name, bounds in bounds_by_name(tables).items()}
    assert [lower[name] for name in ("speed", "pull", "kinetic_energy", "strain_energy", "stress")] == [0.0] * 5
    assert [lower[name] for name in ("along", "stretch", "potential_energy", "work")] == [-np.inf] * 4
    for more in (
        {"cable": {"law": "tension-only", "groups": {"rim": {"law": "linear"}}}},
        {"cable": {"law": "smooth"}},
        {"damping": {"time": 1e-3}},
    ):
        assert bounds_by_name(tables | more)["pull"][0] == -np.inf


def test_a_plot_of_a_run_has_no_negative_part_and_cuts_what_is_wide(tmp_path):
    """By the law without push, in statics of one result over three steps, where ± is set by hand."""
    (tmp_path / "small.toml").write_text(SMALL, encoding="utf-8")
    record = of_solution(refweb.run(tmp_path / "small.toml", progress=False))
    steps = [dict(step, results=dict(step["results"])) for step in record.summary["steps"]]
    name = "max_tension"
    values = [step["results"][name]["value"] for step in steps]
    error = 3.0 * (max(values) - min(values))
    steps[-1]["results"][name] = {**steps[-1]["results"][name], "error": error}
    axes = plots.draw(record._replace(summary={**record.summary, "steps": steps}), name).axes[0]
    low, high = axes.get_ylim()
    unit = axes.get_ylabel().partition("[")[2].rstrip("]")
    assert low >= 0.0 and unit == "N"
    assert high == pytest.approx(max(values) + 0.1 * (max(values) - min(values)), rel=1e-6)
    assert texts(axes)[0] == f"± {error:.3g} N"


def test_a_plot_of_a_study_cuts_what_is_wide():
    """Both over the parameter and in the share of cases."""
    rows = [
        {"p": 1.0, "status": "solved", "force [N]": 2.0, "force ±": 0.5},
        {"p": 2.0, "status": "solved", "force [N]": 4.0, "force ±": 40.0},
    ]
    study = {"parameters": {"p": {"from": 1.0, "to": 2.0}}, "sample": "sobol", "conditions": {}}
    summary = {"study": study, "title": "Forces", "not_negative": ["force"]}
    over, shares = draw(Rows(summary, rows, list(rows[0])), Named("force", "N")).axes
    assert over.get_ylim() == pytest.approx((1.5 - 0.25, 4.25)) and "± 40 N" in texts(over)
    assert shares.get_xlim() == pytest.approx((1.25, 4.25)) and "± at most 40 N" in texts(shares)
