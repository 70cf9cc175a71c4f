"""Plots of small runs: what is drawn is what the run has, told in its units; refusals leave nothing on the disk."""

import json
import re
import shutil

import numpy as np
import pytest
from nets import SMALL

import refweb
from refweb.__main__ import main
from refweb.errors import InputError
from refweb.pictures import balances, distances, plots, sheet
from refweb.pictures.plot_data import Shown
from refweb.pictures.record import of_folder, of_solution
from refweb.pictures.spectra import FEWEST, _peak, peaks_of, spectrum_of

SOLVE = '[solve]\nkind = "static"\nload_steps = [1, 2, 3]'
THROWN = """
[damping]
rate = 2.0

[gravity]
acceleration = [0.0, 0.0, 1.0]

[solve]
kind = "dynamic"
duration = 0.2

[output]
interval = 2e-3
frames = 20

[[observe]]
name = "deflection"
quantity = "displacement"
reduce = "max"

[[observe]]
name = "speed"
quantity = "velocity"
node = "centre"
component = "z"

[[event]]
name = "far"
kind = "threshold"
observe = "deflection"
value = 0.02
"""


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """A folder of result folders, which no test changes."""
    place = tmp_path_factory.mktemp("runs")
    for name, text in {"static": SMALL, "dynamic": SMALL.replace(SOLVE, THROWN)}.items():
        (place / f"{name}.toml").write_text(text, encoding="utf-8")
        refweb.run(place / f"{name}.toml", out=place / name, progress=False)
    shutil.copytree(place / "dynamic", place / "again")
    refweb.modes(place / "static.toml", number=3, out=place / "modes", progress=False)
    return place


@pytest.fixture(autouse=True)
def small(monkeypatch):
    monkeypatch.setattr(sheet, "RESOLUTION", 40)


def shown(folder, name=""):
    return Shown(of_folder(folder), name, sheet.Ink.of(0))


def texts(figure):
    """All that is written on a figure."""
    from matplotlib.text import Text

    return "\n".join(text.get_text() for text in figure.findobj(Text))


def of(figure, name):
    """The axes whose vertical axis is called so."""
    return next(axes for axes in figure.axes if axes.get_ylabel().startswith(name))


def spans(axes):
    """Lower and upper ends of the bars of ±, in the order of their points."""
    bars = [c for c in axes.containers if hasattr(c, "has_yerr")]
    return [bar.lines[2][0].get_segments()[0] for bar in bars]


def test_a_history_is_drawn_as_it_is(runs):
    """In the unit of the axis, its result at its time with ± as long as it is, and where an event happened."""
    solution = refweb.load(runs / "dynamic")
    axes = of(plots.draw(of_folder(runs / "dynamic"), "deflection"), "deflection")
    assert axes.get_ylabel() == "deflection [mm]" and axes.get_xlabel() == "time [s]"
    line = axes.get_lines()[0].get_xydata()
    history = solution.history
    np.testing.assert_allclose(line, np.column_stack([history["time"], 1e3 * history["deflection"]]), rtol=1e-14)
    result = solution.results["deflection"]
    (ends,) = spans(axes)
    np.testing.assert_allclose(ends[:, 0], result.time)
    np.testing.assert_allclose(ends[:, 1], 1e3 * np.array([result.value - result.error, result.value + result.error]))
    (event,) = solution.events
    assert any(np.allclose(line.get_xdata(), event["time"]) for line in axes.get_lines())
    assert "far" in texts(axes.figure) and "±" in texts(axes.figure)


def test_no_band_where_no_error_is_known(runs):
    """Columns that are no results have none, nor has a result without ±."""
    record = of_folder(runs / "dynamic")
    assert spans(of(plots.draw(record, "kinetic_energy"), "kinetic_energy")) == []
    results = {name: {**one, "error": None} for name, one in record.summary["results"].items()}
    axes = of(plots.draw(record._replace(summary={**record.summary, "results": results}), "deflection"), "deflection")
    (bar,) = (c for c in axes.containers if hasattr(c, "has_yerr"))
    assert not bar.has_yerr and not any("±" in text.get_text() for text in axes.get_legend().get_texts())


def test_other_errors_stand_below(runs):
    """What smoothing and elements do to a result is not in its ±, and is told where that result is drawn."""
    record = of_folder(runs / "dynamic")
    results = {name: {**one, "smoothing": 2e-3} for name, one in record.summary["results"].items()}
    record = record._replace(summary={**record.summary, "results": results})
    words = texts(plots.draw(record, "deflection"))
    assert "smoothing moves deflection by 2 mm" in words and "smoothing moves speed" not in words
    assert "smoothing" not in texts(plots.draw(record, "kinetic_energy"))


def test_energies_are_stacked_to_what_came_in(runs):
    """Each area is as high as its energy: all of them are total and loss, of potential energy what is above its least.

    They are as large as that at the start and work but for the drift that the run itself has found.
    """
    s = shown(runs / "dynamic")
    table, book = s.history, balances.energy_book(s)
    assert list(book.parts) == ["strain_energy", "potential_energy", "kinetic_energy", "dissipated_energy"]
    low = table["potential_energy"].min()
    assert low < 0.0 and book.smallest["potential_energy"] == low
    np.testing.assert_allclose(book.top + low, table["total_energy"] + table["dissipated_energy"], atol=1e-14)
    largest = max(np.abs(v).sum() for v in zip(*(table[name] for name in book.parts), strict=True))
    drift = s.record.summary["solver"]["energy_drift"]
    assert np.abs(book.drift).max() == pytest.approx(drift * largest, rel=0.5)
    axes = of(plots.draw(s.record, "energy"), "energy")
    factor = {"J": 1.0, "mJ": 1e3}[axes.get_ylabel().split("[")[1][:-1]]
    heaps = factor * np.cumsum([np.zeros(len(book.top)), *book.parts.values()], axis=0)
    for row in (20, 70):
        corners = [area.get_paths()[0].vertices for area in axes.collections]
        ends = [np.unique(points[points[:, 0] == table["time"][row], 1])[[0, -1]] for points in corners]
        np.testing.assert_allclose(ends, np.column_stack([heaps[:-1, row], heaps[1:, row]]))
    work = table["work"] - table["work"][0]
    np.testing.assert_allclose(axes.get_lines()[-1].get_ydata(), factor * (book.top[0] + work))


@pytest.mark.slow
def test_the_sum_of_energies_is_told_above_what(runs):
    """What the legend says the sum is above, and the height of its line, are the total energy and loss together."""
    for name, tail in {"static": "", "dynamic": "dissipated_energy"}.items():
        axes = of(plots.draw(of_folder(runs / name), "energy"), "energy")
        factor = {"J": 1.0, "mJ": 1e-3, "µJ": 1e-6}[axes.get_ylabel().split("[")[1][:-1]]
        said = [text.get_text().strip() for text in axes.get_legend().get_texts()]
        (words,) = (text for text in said if text.startswith("sum"))
        number, unit = words.removeprefix("sum above ").split() if "above" in words else ("0", "J")
        assert ("above" in words) == any("potential above" in text for text in said)
        table = shown(runs / name).history
        drawn = factor * axes.get_lines()[0].get_ydata() + float(number) * {"J": 1.0, "mJ": 1e-3, "µJ": 1e-6}[unit]
        expected = table["total_energy"] + (table[tail] if tail else 0.0)
        # six digits of the number in the legend
        np.testing.assert_allclose(drawn, expected, rtol=0.0, atol=1e-5 * np.abs(expected).max())


def test_a_history_of_one_row(runs):
    """Is drawn at its instant, and in the unit of its result, where that is larger than the row."""
    record = of_folder(runs / "dynamic")
    first = {name: column[:1] for name, column in record.table()[1].items()}
    one = record._replace(table=lambda: (record.table()[0], first))
    energies = of(plots.draw(one, "energy"), "energy")
    ends = [part.vertices[:, 0] for area in energies.collections for part in area.get_paths()]
    assert ends and all(np.all(x == first["time"][0]) for x in ends)
    assert all(line.get_marker() == "." for line in of(energies.figure, "drift").get_lines())
    axes = of(plots.draw(one, "deflection"), "deflection")
    (ends,) = spans(axes)
    assert axes.get_ylabel() == "deflection [mm]"
    assert ends[:, 1].mean() == pytest.approx(1e3 * refweb.load(runs / "dynamic").results["deflection"].value)


@pytest.mark.parametrize("value", [-1.177709927, 10.005])
@pytest.mark.parametrize("rows", [1, 3])
def test_ticks_are_true(runs, rows, value):
    """No axis has an offset or a power beside it; each tick reads as its value, also where values hardly differ."""
    record = of_folder(runs / "static")
    steps = json.loads(json.dumps(record.summary["steps"][:rows]))
    for step in steps:
        step["results"]["deflection"] |= {"value": value + 1e-11 * step["step"], "error": 1e-11}
    table = {name: column[:rows] for name, column in record.table()[1].items()}
    few = record._replace(summary={**record.summary, "steps": steps}, table=lambda: (record.table()[0], table))
    figure = plots.draw(few, "deflection")
    figure.draw_without_rendering()
    axes = of(figure, "deflection")
    assert axes.yaxis.get_offset_text().get_text() == axes.xaxis.get_offset_text().get_text() == ""
    said = [text.get_text().replace("\N{MINUS SIGN}", "-") for text in axes.get_yticklabels()]
    assert max(map(len, said)) <= 8 and len(set(said)) == len(said) > 2
    np.testing.assert_allclose([float(text) for text in said], axes.get_yticks(), rtol=1e-12)
    low, high = axes.get_ylim()
    assert low < value < high


def test_momentum_against_impulses(runs):
    """Momentum is what supports, load, gravity and damping gave, along each axis."""
    book = balances.momentum_book(shown(runs / "dynamic"))["z"]
    largest = np.abs(book.impulses["impulse of loads and all else"]).max()
    assert largest > 0.01 and np.abs(book.drift).max() < 1e-12 * largest
    axes = of(plots.draw(of_folder(runs / "dynamic"), "momentum"), "along z")
    names = [text.get_text().strip() for text in axes.figure.axes[0].get_legend().get_texts()]
    assert names[0].startswith("momentum") and len(names) == 4
    np.testing.assert_allclose(axes.get_lines()[0].get_ydata(), axes.get_lines()[3].get_ydata(), atol=1e-9 * largest)


@pytest.mark.parametrize("cycles", [25.0, 25.3])
def test_the_spectrum_of_a_sine(cycles):
    """Its peak is within half a line of the sine, and as high but for what a Hann window loses between lines, 15 %."""
    time = np.arange(400) * 1e-2
    found = spectrum_of(
        time, 3.0 + 0.2 * np.sin(2 * np.pi * cycles / 4.0 * time) + 0.02 * np.sin(2 * np.pi * 20 * time)
    )
    assert found.resolution == pytest.approx(2.0 / 4.0)
    assert abs(found.frequency[found.peak] - cycles / 4.0) <= 0.5 / 4.0
    high = found.amplitude[found.peak]
    assert high == pytest.approx(0.2, rel=1e-3) if cycles == 25.0 else 0.85 * 0.2 < high < 0.2
    assert found.amplitude[80] == pytest.approx(0.02, rel=1e-2)


def test_a_spectrum_that_there_is_not():
    """Of few rows, rows at odd times, values that are not finite; a last row that is nearer is left out."""
    time = np.arange(FEWEST) * 0.1
    with pytest.raises(InputError, match=rf"has {FEWEST - 1} rows, needs {FEWEST} at least"):
        spectrum_of(time[1:], time[1:])
    with pytest.raises(InputError, match="not equally far apart"):
        spectrum_of(time**2, time)
    with pytest.raises(InputError, match="not finite"):
        spectrum_of(time, time * np.nan)
    end = np.append(time, time[-1] + 0.03)
    assert np.array_equal(spectrum_of(end, np.cos(end)).amplitude, spectrum_of(time, np.cos(time)).amplitude)
    assert spectrum_of(time, np.exp(time)).peak is None


def test_a_peak_stands_out():
    """By a factor of two from the valleys on both sides; a trend that is higher is told, and waves on it are none."""
    time = np.arange(400) * 1e-2
    ring = 0.2 * np.sin(2 * np.pi * 20 * time)
    found = spectrum_of(time, 5.0 * time + ring)
    assert found.frequency[found.peak] == 20.0 and found.amplitude[1] > found.amplitude[found.peak]
    assert "highest peak that stands out at 20.00 ± 0.25 Hz: 200 mm; most of all at 0.25 ± 0.25" in _peak(found, "m")
    alone = spectrum_of(time, ring)
    assert _peak(alone, "m") == "highest peak that stands out at 20.00 ± 0.25 Hz: 200 mm"
    amplitude = np.array([0.0, 9.0, 5.0, 2.0, 2.08, 1.0, 0.5])  # a wave 4 % above the valley to its left
    assert not len(peaks_of(amplitude)) and peaks_of(np.where(amplitude == 2.08, 4.1, amplitude)).tolist() == [4]
    assert peaks_of(amplitude[::-1]).tolist() == [5]  # and not the wave at 2
    assert not len(peaks_of(np.array([0.0, 4.0, 2.0])))  # the mean, which is left out, is no valley
    assert _peak(spectrum_of(time, np.exp(time)), "m") == "no peak stands out"


def test_stress_over_distance(runs):
    """From the node that is loaded, at the last load step, where stress is largest: four lines are nearest."""
    record = of_folder(runs / "static")
    found = distances.spread(record, "stress")
    solution = refweb.load(runs / "static")
    assert found.frame.time == 3.0 and "which is loaded" in found.origin
    np.testing.assert_allclose(found.values, solution.stress)
    web = solution.scene.build().net.web
    middles = web.points[web.lines].mean(axis=1)
    np.testing.assert_allclose(found.distance, np.linalg.norm(middles - web.points[web.centre], axis=1))
    axes = of(plots.draw(record, "stress-distance"), "stress")
    points = sum(len(line.get_xdata()) for line in axes.get_lines())
    assert points == len(web.lines)
    assert plots.draw(record, "strain", title="").get_suptitle() == ""


@pytest.mark.parametrize("key", ["subdivide", "order"])
def test_distances_of_divided_lines(runs, key):
    """Of elements, from the same node: the web's nodes keep their numbers."""
    scene = refweb.Scene.load(runs / "static.toml", {f"cable.{key}": 2, "solve.load_steps": [1]})
    found = distances.spread(of_solution(refweb.run(scene, progress=False)), "stress")
    assert found.origin == distances.spread(of_folder(runs / "static"), "stress").origin
    side = 0.5 / (2 if key == "subdivide" else 1)
    assert found.distance.min() == pytest.approx(0.5 * side)


def test_distances_are_from_where_a_body_touches(runs):
    record = of_folder(runs / "static")
    bodies = {
        "ball": {"overlap": 1e-4, "line": 5},
        "plate": {"overlap": 1e-6, "line": 2},
        "far": {"overlap": 0.0, "line": None},
    }
    found = distances.spread(record._replace(summary={**record.summary, "bodies": bodies}), "tension")
    assert found.distance[5] == 0.0 and '"ball"' in found.origin
    bare = distances.spread(record._replace(scene={}), "strain")
    assert bare.distance[np.argmax(bare.values)] == 0.0 and "strain is largest" in bare.origin
    moved = of_folder(runs / "dynamic")
    time = moved.summary["results"]["deflection"]["time"]
    near = distances.spread(moved, "stress")
    assert abs(near.frame.time - time) == min(abs(t - time) for t in moved.times.values()) > 0.0
    assert "nearest to deflection" in near.remark


def test_distances_where_all_is_slack(runs):
    """From the centre if nothing is hit or loaded, and told; from the node that is loaded else."""
    record = of_folder(runs / "static")

    def slack(number):
        frame = record.frame(number)
        none = {name: np.zeros_like(v) if name in distances.FIELDS else v for name, v in frame.fields.items()}
        return frame._replace(fields=none, slack=np.ones(len(frame.slack), dtype=bool))

    still = record._replace(frame=slack)
    assert "which is loaded" in distances.spread(still, "stress").origin
    bare = still._replace(scene={})
    found = distances.spread(bare, "stress")
    assert found.origin == "the centre of the web, as all lines are slack"
    web = refweb.load(runs / "static").scene.build().net.web
    middles = web.points[web.lines].mean(axis=1)
    np.testing.assert_allclose(found.distance, np.linalg.norm(middles - web.points.mean(axis=0), axis=1), atol=1e-12)
    words = texts(plots.draw(bare, "stress"))
    assert "largest" not in words and f"slack: {len(found.slack)} of {len(found.slack)} lines at step 3" in words


def test_load_steps_with_their_error(runs):
    """A point with ± for each step, and the interval of a value that equilibrium leaves open."""
    record = of_folder(runs / "static")
    axes = of(plots.draw(record, "max_stress"), "max_stress")
    unit = {"kPa": 1e3, "Pa": 1.0}[axes.get_ylabel().split("[")[1][:-1]]
    ends = np.array(spans(axes)) * [1.0, unit]
    given = [step["results"]["max_stress"] for step in record.summary["steps"]]
    np.testing.assert_allclose(ends[:, 0, 0], [1.0, 2.0, 3.0])
    np.testing.assert_allclose(ends[:, 1, 1] + ends[:, 0, 1], [2.0 * one["value"] for one in given])
    np.testing.assert_allclose(ends[:, 1, 1] - ends[:, 0, 1], [2.0 * one["error"] for one in given], rtol=1e-3)
    steps = json.loads(json.dumps(record.summary["steps"]))
    value = steps[2]["results"]["max_stress"]["value"]
    steps[2]["results"]["max_stress"]["interval"] = [0.5 * value, None]
    axes = of(plots.draw(record._replace(summary={**record.summary, "steps": steps}), "max_stress"), "max_stress")
    np.testing.assert_allclose(spans(axes)[2][:, 1] * unit, [0.5 * value, value])
    assert "may be from" in texts(axes.figure) and "to any" in texts(axes.figure)


def test_modes_with_their_error(runs):
    record = of_folder(runs / "modes")
    assert list(plots.kinds(record)) == ["frequencies"]
    axes = of(plots.draw(record), "frequency")
    table = record.table()[1]
    points = [c for c in axes.containers if hasattr(c, "has_yerr")]
    assert len(points) == 3 and axes.get_xlabel() == "load step"
    for mode, one in enumerate(points, start=1):
        np.testing.assert_allclose(one.lines[0].get_ydata(), table["frequency"][table["mode"] == mode])
    over = of(plots.draw(record, "share_z"), "share_z")
    np.testing.assert_allclose(over.get_lines()[0].get_ydata(), table["share_z"][-3:])
    last = {key: column[-3:] for key, column in table.items()}
    single = record._replace(table=lambda: (record.table()[0], {**last, "frequency": last["frequency"] * [-1, 1, 1]}))
    figure = plots.draw(single)
    axes = of(figure, "frequency")
    assert axes.get_xlabel() == "mode" and "imaginary, unstable" in texts(figure)
    (cross,) = (line for line in axes.get_lines() if line.get_marker() == "x")
    np.testing.assert_allclose(cross.get_xydata(), [[1.0, -last["frequency"][0]]])


def test_two_folders_overlay(runs):
    """A line each with its name; who lacks a quantity is named."""
    records = [of_folder(runs / name) for name in ("dynamic", "again")]
    records[1] = records[1]._replace(table=lambda: (records[0].table()[0][:2], records[0].table()[1]))
    figure = plots.draw(records, ["deflection", "speed", "energy"])
    axes = of(figure, "deflection")
    words = " ".join(text.get_text() for text in axes.get_legend().get_texts())
    curves = [line for line in axes.get_lines() if len(line.get_xdata()) > 2]
    assert len(curves) == 2 and "dynamic: " in words and "again: " in words
    assert len({(line.get_color(), str(line.get_linestyle())) for line in curves}) == 2
    assert "again has no speed" in texts(figure)
    with pytest.raises(InputError, match="static and dynamic|dynamic and static"):
        plots.draw([records[0], of_folder(runs / "static")])


def test_books_and_the_rest_of_two_folders(runs):
    records = [of_folder(runs / name) for name in ("dynamic", "again")]
    figure = plots.draw(records, ["energy", "momentum", "spectrum", "stress-distance"])
    kinetic = [line for line in of(figure, "kinetic").get_lines() if len(line.get_xdata())]
    assert len(kinetic) == 2 and np.array_equal(kinetic[0].get_xydata(), kinetic[1].get_xydata())
    assert len(plots.draw([of_folder(runs / "static")] * 2).axes) == 3


def test_what_is_drawn_where_nothing_is_asked_for(runs):
    """Observables and energies; load steps; of a single one stress over distance."""
    names = [axes.get_ylabel().split(" [")[0] for axes in plots.draw(of_folder(runs / "dynamic")).axes]
    assert names == ["deflection", "speed", "energy", "drift"]
    record = of_folder(runs / "static")
    assert [a.get_ylabel().split(" [")[0] for a in plots.draw(record).axes] == [
        "deflection",
        "max_stress",
        "max_tension",
    ]
    first = {name: column[:1] for name, column in record.table()[1].items()}
    single = record._replace(table=lambda: (record.table()[0], first))
    assert [a.get_ylabel().split(" [")[0] for a in plots.draw(single).axes] == ["stress"]
    (area,) = of(plots.draw(single, "energy"), "energy").collections
    assert area.get_paths()[0].get_extents().width == 0.5
    for name in ("static", "dynamic", "modes"):
        record = of_folder(runs / name)
        for kind in plots.kinds(record):
            assert plots.draw(record, kind).axes


@pytest.mark.parametrize("rows", [5_000, 1_000_003])
def test_a_long_history_keeps_its_extremes(rows):
    """Few of its rows, among them the first, the last and the extremes of each part, also of one row; gaps stay out."""
    values = np.sin(np.arange(rows) * 1e-3)
    values[[rows // 3, rows // 2]] = 7.0, -7.0
    values[1234] = np.nan
    assert 1234 not in sheet.telling(values)
    keep = sheet.telling(values, values[::-1])
    assert len(keep) < 4100 and {0, rows - 1, rows // 3, rows // 2, rows - 1 - rows // 3} <= set(keep.tolist())
    parts = np.array_split(values, 500)
    drawn = np.interp(np.arange(rows), keep, np.nan_to_num(values[keep]))
    for part, there in zip(parts, np.array_split(drawn, 500), strict=True):
        assert np.nanmax(part) == pytest.approx(there.max(), abs=2e-3 * rows / 1000)
    assert np.array_equal(sheet.telling(values[:100]), np.arange(100))


def test_what_a_run_that_failed_has(runs, tmp_path):
    """The status stands in the title, the message below; a half row of a run that is alive is left out."""
    folder = shutil.copytree(runs / "dynamic", tmp_path / "half")
    run = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps({**run, "status": "failed", "message": "it broke", "results": {}}))
    lines = (folder / "history.csv").read_text().splitlines()
    (folder / "history.csv").write_text("\n".join([*lines[:20], lines[20][:30]]))
    shutil.rmtree(folder / "frames")
    (folder / "web.pvd").unlink()
    figure = plots.draw(of_folder(folder, with_frames=False))
    assert "run failed" in texts(figure) and "it broke" in texts(figure)
    assert "half: run failed: it broke" in texts(
        plots.draw([of_folder(folder, with_frames=False), of_folder(runs / "again")])
    )
    alive = json.dumps({**run, "status": "running", "results": {}})
    (folder / "run.json").write_text(alive)
    words = texts(plots.draw(of_folder(folder, with_frames=False)))
    assert "run not ended" in words and "of the largest energy" not in words
    assert len(of(figure, "deflection").get_lines()[0].get_xdata()) == 19
    (folder / "history.csv").write_text("\n")
    with pytest.raises(InputError, match="no names with units"):
        plots.plot([folder])
    (folder / "history.csv").write_text(lines[0] + "\n")
    with pytest.raises(InputError, match="no rows"):
        plots.plot([folder])
    assert not list(tmp_path.rglob("*.png"))


@pytest.mark.slow
def test_files_whose_text_is_text(runs, tmp_path):
    """Of an SVG in full, twice the same; a PDF and a PNG begin as such, and nothing else is left."""
    for ending, head in {"svg": b"<?xml", "pdf": b"%PDF", "png": b"\x89PNG"}.items():
        out = tmp_path / f"plot.{ending}"
        assert plots.plot([runs / "static"], out=out) == (out, ()) and out.read_bytes().startswith(head)
    text = (tmp_path / "plot.svg").read_text(encoding="utf-8")
    assert ">max_stress [" in text and ">load step<" in text
    plots.plot([runs / "static"], out=tmp_path / "again.svg")
    assert (tmp_path / "again.svg").read_text(encoding="utf-8") == text
    assert len(list(tmp_path.iterdir())) == 4
    assert plots.as_svg(plots.draw(of_folder(runs / "static"))) == text


def test_names_that_letters_cannot_hide(runs):
    """Dollars, underscores at the beginning and brackets of a title and a name are written as they are."""
    record = of_folder(runs / "dynamic")
    columns, table = record.table()
    columns = [columns[0], "_$x^$ [1]", *columns[2:]]
    table = dict(zip(["time", "_$x^$", *list(table)[2:]], table.values(), strict=True))
    record = record._replace(
        table=lambda: (columns, table), summary={**record.summary, "scene": "a $\\frac$ [b]", "results": {}}, name="_$a"
    )
    figure = plots.draw([record, record._replace(name="_b")], "_$x^$")
    assert plots.as_svg(figure).count("_$a") == 1 and "a $\\frac$ [b]" in texts(figure)


WRONG = {
    "defection": 'quantity = "defection": there is nothing of that name, did you mean "deflection"?',
    "spectrum:sped": 'did you mean "spectrum:speed"?',
    "stress_distance": 'did you mean "stress-distance"?',
    "frequencies": "known: ",
}


@pytest.mark.parametrize("name", WRONG)
def test_a_quantity_that_there_is_not(runs, tmp_path, name):
    with pytest.raises(InputError, match=re.escape(WRONG[name])):
        plots.plot([runs / "dynamic"], quantity=name, out=tmp_path / "plot.png")
    assert list(tmp_path.iterdir()) == []


def test_refusals_name_what_was_typed(runs):
    """Not what it stands for; a run that has no spectrum is told to have none; what is no text is no name."""
    for name, typed, said in [
        ("modes", "stress", 'quantity = "stress": there is nothing of that name'),
        ("modes", "spectrum", 'quantity = "spectrum": modes have no spectrum'),
        ("static", "spectrum", 'quantity = "spectrum": a static run has no spectrum'),
        ("static", "spectrum:deflection", 'quantity = "spectrum:deflection": a static run has no spectrum'),
        ("dynamic", 3, "quantity = 3: is not a name, known: deflection, speed"),
        ("dynamic", ["energy", True], "quantity = true: is not a name"),
    ]:
        with pytest.raises(InputError, match=re.escape(said)):
            plots.draw(of_folder(runs / name), typed)


def test_places_and_folders_that_cannot_be(runs, tmp_path):
    for out, said in {
        "a.gif": 'unknown format "gif", known: png',
        "b/a.png": "no folder",
        "a.pn": 'mean "png"',
    }.items():
        with pytest.raises(InputError, match=said):
            plots.plot([runs / "static"], out=tmp_path / out)
    with pytest.raises(InputError, match="is not a result folder"):
        plots.plot([tmp_path])
    (tmp_path / "run.json").write_text('{"kind": "cost", "versions": {"refweb": "0"}}')
    with pytest.raises(InputError, match="not a run: its diagram is cost.png there"):
        plots.plot([tmp_path])
    assert [path.name for path in tmp_path.iterdir()] == ["run.json"]


SPOILT = {
    "web": [3, ["a"]],
    "results": [3, "x", [3], {"a": 3}, {"a": {"value": "x", "error": None, "unit": "m", "time": 0.0, "where": None}}],
    "steps": [3, "x", [3], [{}], [{"step": "x"}]],
    "events": [3, "x", ["a"]],
    "solver": ["x", [3]],
    "bodies": ["x", {"a": 3}, {"a": {"line": 3}}],
    "kind": [3, ["modes"]],
}


@pytest.mark.parametrize("key", SPOILT)
def test_a_summary_that_no_run_has_written(runs, key):
    """Is refused in one line; one that says nothing of it is drawn."""
    record = of_folder(runs / "dynamic")
    for given in SPOILT[key]:
        for look in (plots.kinds, plots.draw):
            with pytest.raises(InputError, match="is not what a run of refweb writes"):
                look(record._replace(summary={**record.summary, key: given}))
    bare = {name: value for name, value in record.summary.items() if name != key}
    assert plots.draw(record._replace(summary=bare), "deflection").axes


@pytest.mark.slow
def test_from_memory_and_loaded_alike(runs, tmp_path):
    """With and without a folder, a run gives the same figure, which a notebook shows."""
    scene = refweb.Scene.load(runs / "dynamic.toml")
    held = refweb.run(scene, progress=False)
    loaded = refweb.load(runs / "dynamic")
    pages = [plots.as_svg(solution.plot()) for solution in (held, loaded)]
    assert pages[0] == pages[1]
    figure = held.plot(["energy", "stress-distance"], out=tmp_path / "plot.png")
    assert (tmp_path / "plot.png").read_bytes()[:4] == figure._repr_png_()[:4] == b"\x89PNG"
    assert refweb.modes(runs / "static.toml", number=2, progress=False).plot().axes
    with pytest.raises(InputError, match='did you mean "energy"'):
        held.plot("enegy", out=tmp_path / "none.png")
    assert not (tmp_path / "none.png").exists()


@pytest.mark.slow
def test_the_verb(runs, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(runs / "static", "a")
    assert main(["plot", "a", str(runs / "static"), "--quantity", "max_tension", "--quantity", "energy"]) == 0
    assert capsys.readouterr().out.strip() == "a/plot.png"
    assert main(["plot", "a", "--out", "a/plot.svg"]) == 0 and "max_stress" in open("a/plot.svg").read()
    assert main(["plot", "a", "--quantity", "deflecton"]) == 2
    assert 'did you mean "deflection"?' in capsys.readouterr().err
    assert main(["run", str(runs / "static.toml"), "--out", "a", "--force"]) == 0
    assert not list((tmp_path / "a").glob("plot.*"))
    lines = (runs / "again" / "history.csv").read_text().splitlines()
    shutil.copytree(runs / "again", "b")
    (tmp_path / "b" / "history.csv").write_text("\n".join(",".join(line.split(",")[:2]) for line in lines) + "\n")
    both = ["plot", "b", str(runs / "dynamic"), "--quantity"]
    assert main([*both, "speed"]) == main([*both, "spectrum", "--quantity", "energy"]) == 0
    said = capsys.readouterr()
    assert said.err == "refweb: b has no speed\nrefweb: b has no energy\n" and "b/plot.png\nb/plot.png" in said.out


def test_a_column_over_another(runs, tmp_path, capsys):
    """The line is that of both columns in their units; what is no column is named with the nearest that is."""
    folder, path = runs / "dynamic", tmp_path / "loop.svg"
    figure = plots.draw(of_folder(folder), "speed", against="deflection")
    (axes,) = figure.axes
    history = refweb.load(folder).history
    x, y = axes.lines[0].get_data()
    factors = [np.abs(history[name]).max() / np.abs(drawn).max() for name, drawn in (("deflection", x), ("speed", y))]
    np.testing.assert_allclose([x * factors[0], y * factors[1]], [history["deflection"], history["speed"]], atol=1e-12)
    assert axes.get_xlabel().startswith("deflection [")
    assert main(["plot", str(folder), "--quantity", "speed", "--against", "deflection", "--out", str(path)]) == 0
    assert path.is_file() and "loop.svg" in capsys.readouterr().out
    assert main(["plot", str(folder), "--quantity", "speed", "--against", "deflexion"]) == 2
    assert 'against = "deflexion": there is no such column' in capsys.readouterr().err
    assert main(["plot", str(folder), "--quantity", "sped", "--against", "deflection"]) == 2
    assert 'quantity = "sped": there is no such column' in capsys.readouterr().err
