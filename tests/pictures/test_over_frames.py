"""Fields over all frames, the peak that frames miss, numbers of lines, and point masses as dots."""

import json
import re

import meshio
import numpy as np
import pytest
from matplotlib.text import Text

import refweb
from refweb.__main__ import main
from refweb.errors import InputError
from refweb.pictures import pictures
from refweb.pictures import render as drawing
from refweb.pictures.frames import Masses
from refweb.pictures.line_numbers import _apart
from refweb.pictures.model import Balls
from refweb.pictures.over_frames import on_peak, with_largest
from refweb.pictures.record import of_folder, of_solution
from refweb.pictures.stage import MASS_RADIUS, MASSES, Look, Seen, Stage

E, AREA, STRENGTH = 1e6, 1e-4, 1e6
MASS = {1: 0.8, 2: 0.1}


@pytest.fixture(autouse=True)
def small(monkeypatch):
    monkeypatch.setattr(pictures, "SIZE", (800, 500))
    monkeypatch.setattr(drawing, "windows", lambda: [])


def swinging(frames=1, **cable):
    """Two masses on lines between supports, one of which moves: rows each 10 ms, and every so many a frame."""
    points = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0], [1, 1, 0], [2, 1, 0]]
    lines = [[0, 1], [1, 2], [2, 3], [1, 4], [2, 5]]
    web = refweb.Inline(points=points, lines=lines, supports=[0, 3, 4, 5])
    return refweb.Scene(
        title="Swinging",
        web=web,
        cable=refweb.Cable(law="tension-only", modulus=E, area=AREA, density=1.0, **cable),
        effects=[
            *(refweb.PointMass(node=node, mass=mass) for node, mass in MASS.items()),
            refweb.Velocity(node=1, value=(0.0, 0.0, 3.0)),
        ],
        solve=refweb.Dynamic(duration=0.6),
        output=refweb.Output(interval=1e-2, frames=frames),
    )


@pytest.fixture(scope="module")
def solution():
    return refweb.run(swinging(strength=STRENGTH), progress=False)


@pytest.fixture(scope="module")
def coarse():
    """The same with a frame each 0.25 s: they miss the peak."""
    return refweb.run(swinging(25, strength=STRENGTH), progress=False)


def written(page):
    return "\n".join(text.get_text() for text in page.findobj(Text))


def test_utilisation_is_in_the_files_of_lines_with_a_strength(tmp_path, solution):
    """Stress over strength, in every frame; absent where no line has a strength."""
    solution.save(tmp_path / "run")
    for path in sorted((tmp_path / "run/frames").glob("web_*.vtu")):
        data = meshio.read(path).cell_data
        np.testing.assert_allclose(data["utilisation"][0], data["stress"][0] / STRENGTH, rtol=1e-14)
    plain = of_solution(refweb.run(swinging(), progress=False))
    assert "utilisation" not in plain.frame(next(iter(plain.times))).fields


@pytest.mark.parametrize("saved", [False, True])
def test_the_largest_of_each_line(tmp_path, solution, saved):
    """Over the frames of memory or of files: that of each line, not of the frame with the largest of all."""
    if saved:
        solution.save(tmp_path / "run")
    record = of_folder(tmp_path / "run") if saved else of_solution(solution)
    expected = np.max([state.stress for _, state in solution.frames], axis=0) / STRENGTH
    extended = with_largest(record, "largest_utilisation")
    for number in record.times:
        np.testing.assert_allclose(extended.frame(number).fields["largest_utilisation"], expected, rtol=1e-14)
    page = solution.picture(field="largest_utilisation")
    assert f"largest over the {len(record.times)} frames written" in written(page)


def test_what_is_no_such_field(solution):
    record = of_solution(solution)
    assert with_largest(record, "largest_height") is record and with_largest(record, None) is record
    with pytest.raises(InputError, match='field = "largest_height": no such field'):
        solution.picture(field="largest_height")


@pytest.mark.slow
def test_a_peak_that_frames_miss_is_said(coarse):
    """The bar ends in a tip, and value, line and time stand on the picture."""
    result = coarse.results["max_stress"]
    high = max(float(state.stress.max()) for _, state in coarse.frames)
    assert result.value > 1.01 * high
    page = coarse.picture(field="stress")
    found = re.search(r"the peak (\S+) kPa at line (\d+), t = (\S+) s, is between frames", written(page))
    assert float(found[1]) == pytest.approx(1e-3 * result.value, rel=1e-5)
    assert int(found[2]) == result.where and float(found[3]) == pytest.approx(result.time, rel=1e-5)
    look = pictures.look_of(of_solution(coarse), of_solution(coarse).frame(0), "stress", None, 1.0, None)
    assert look.missed and look.limits[1] == high
    assert on_peak(of_solution(coarse), "stress", result.value) == ""
    assert on_peak(of_solution(coarse), "utilisation", high / STRENGTH).startswith("the peak ")
    assert "between frames" not in written(coarse.picture(field="stress", range=(0.0, 1e3)))


def test_all_lines_are_numbered_where_there_is_room(solution):
    page = solution.picture(labels="lines")
    numbers = [text.get_text() for text in page.axes[0].texts if text.get_text().isdigit()]
    assert sorted(numbers) == [str(line) for line in range(5)] and "are numbered" not in written(page)


def test_numbers_do_not_cover_each_other():
    """In the order of their values: the second is too near to the first, the third is not."""
    places = np.array([[0.0, 0.0], [5.0, 1.0], [40.0, 0.0], [0.0, 30.0]])
    assert _apart(places, [0, 1, 2, 3], 10.0) == [0, 2, 3] and _apart(places, [1, 0, 3, 2], 10.0) == [1, 3, 2]


@pytest.mark.parametrize(
    ("options", "words"),
    [(["--labels", "lines", "--animate"], "--labels lines has no meaning with --animate"), (["--labels", "x"], "x")],
)
def test_refusals(tmp_path, solution, capsys, options, words):
    solution.save(tmp_path / "run")
    try:
        status = main(["picture", str(tmp_path / "run"), *options])
    except SystemExit as ended:
        status = ended.code
    assert status == 2 and words in capsys.readouterr().err
    with pytest.raises(InputError, match='labels = "nodes" is nothing that can be numbered'):
        solution.picture(labels="nodes")


@pytest.mark.parametrize("saved", [False, True])
def test_point_masses_are_dots(tmp_path, solution, saved):
    """At their nodes, with volumes as their masses: the size of an eighth of the mass is a half."""
    if saved:
        solution.save(tmp_path / "run")
    record = of_folder(tmp_path / "run") if saved else of_solution(solution)
    number, state = solution.frames[-1]
    masses = record.frame(number).masses
    np.testing.assert_array_equal(masses.mass, list(MASS.values()))
    np.testing.assert_allclose(masses.points, state.position[list(MASS)], rtol=1e-14)
    np.testing.assert_allclose(masses.displacement, state.x[list(MASS)], atol=1e-15)
    frame = record.frame(number)
    stage = Stage.of(Seen.of(frame, "stress"), Look("stress", (0.0, 1.0)), 1.6)
    dots = [part for part in stage.model(frame) if isinstance(part, Balls) and part.colour == MASSES]
    by_radius = {round(part.radius / (MASS_RADIUS * stage.radius), 12): part.centres for part in dots}
    assert sorted(by_radius) == [0.5, 1.0]
    np.testing.assert_allclose(by_radius[1.0], masses.points[:1])
    assert "0.1 to 0.8 kg" in written(solution.picture())
    doubled = frame.posed(2.0).masses
    assert isinstance(doubled, Masses)
    np.testing.assert_allclose(doubled.points, state.position[list(MASS)] + state.x[list(MASS)], atol=1e-14)


def test_a_net_without_point_masses_has_none(tmp_path):
    scene = swinging().replace(effects=[refweb.Velocity(node=1, value=(0.0, 0.0, 3.0))])
    refweb.run(scene, progress=False).save(tmp_path / "run")
    record = of_folder(tmp_path / "run")
    assert record.frame(next(iter(record.times))).masses is None
    with np.load(tmp_path / "run/checkpoint.npz") as checkpoint:
        assert "point_masses" not in checkpoint
    assert json.loads((tmp_path / "run/run.json").read_text(encoding="utf-8"))["status"] == "solved"
