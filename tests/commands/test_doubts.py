"""Doubts that ``refweb check`` tells of: each scene beside its neighbour that makes sense, of which nothing is said."""

import numpy as np
import pytest

import refweb
from refweb.__main__ import main
from refweb.commands.doubts import _largest_area, doubts_on

WINDOW = refweb.Window(mesh="square", rows=4, columns=4, side=0.5)
CABLE = dict(law="tension-only", modulus=1e9, area=1e-6, density=1000.0)


def told(scene, code):
    return [finding.text for finding in doubts_on(scene, scene.build()) if finding.code == code]


def hit(position, velocity, web=WINDOW, duration=0.5, effects=(), **body):
    given = {"name": "ball", "radius": 0.1, "mass": 1.0, "position": position, "velocity": velocity, **body}
    return refweb.Scene(
        web=web,
        cable=refweb.Cable(**CABLE),
        effects=[refweb.Body(**given), refweb.Contact(stiffness=1e4), *effects],
        solve=refweb.Dynamic(duration=duration),
    )


# Units


@pytest.mark.parametrize("modulus, doubtful", [(210.0, True), (9.9e4, True), (1e5, False), (2.1e11, False)])
def test_modulus_in_mpa(modulus, doubtful):
    scene = refweb.Scene(web=WINDOW, cable=refweb.Cable(**{**CABLE, "modulus": modulus}))
    assert bool(told(scene, "unit-in-doubt")) == doubtful
    group = refweb.Cable(**CABLE, groups={"anchors": refweb.Group(modulus=modulus)})
    texts = told(scene.replace(cable=group), "unit-in-doubt")
    assert bool(texts) == doubtful and all(
        "[cable.groups.anchors] modulus" in text and "is it in MPa?" in text for text in texts
    )


@pytest.mark.parametrize("factor", [1.0, 1e3])
def test_lengths_in_mm(factor):
    """Meshes of 0.5 m in mm are 2.5e5 m²; so are layers of 0.25 m², and a small web of them."""
    for web in (
        refweb.Window(mesh="square", rows=4, columns=4, side=0.5 * factor),
        refweb.Layers(mesh="hexagon", layers=3, cell_area=0.25 * factor**2),
    ):
        texts = told(refweb.Scene(web=web, cable=refweb.Cable(**CABLE)), "unit-in-doubt")
        assert len(texts) == (factor > 1.0) and all("are lengths in mm?" in text for text in texts)


def test_area_in_mm2():
    """A round cable of 1 m² is 2 √(1/π) = 1.12838 m thick, longer than the lines of 0.5 m; one of 0.19 m² is not."""
    scene = refweb.Scene(web=WINDOW, cable=refweb.Cable(**{**CABLE, "area": 1.0}))
    (text,) = told(scene, "unit-in-doubt")
    assert "line 0 is 500 mm long and 1.12838 m thick" in text and "is the area in mm²?" in text
    assert not told(scene.replace(cable=refweb.Cable(**{**CABLE, "area": 0.19})), "unit-in-doubt")
    finer = refweb.Cable(**{**CABLE, "area": 0.19}, subdivide=8)  # elements are shorter than thick, lines are not
    assert not told(scene.replace(cable=finer), "unit-in-doubt")


# Bodies


@pytest.mark.parametrize(
    ("position", "velocity", "words"),
    [
        ([0, 0, -0.5], [0, 0, 4], ""),
        ([0, 0, -0.5], [0.3, 0.2, 4], ""),
        ([0, 0, -0.5], [0, 0, -4], "flies past"),  # away, from 0.4 m
        ([0, 0, -0.15], [0, 0, -4], "flies away"),  # away, from less than its size
        ([3, 0, -0.5], [0, 0, 4], "flies past"),
        ([1.15, 0, -0.5], [0, 0, 4], ""),  # 0.15 m beside the outermost nodes at 1 m: a gap of 0.05 m
        ([0, 0, -5], [0, 0, 4], "flies past"),  # the run ends 2.9 m before the web
        ([0, 0, -0.5], [0, 0, 0], ""),  # it rests, and nothing says where it is to go
    ],
)
def test_straight_path(position, velocity, words):
    """A ball of 0.2 m and a web of 2 × 2 m in z = 0."""
    texts = told(hit(position, velocity), "flies-past")
    assert len(texts) == bool(words) and all(words in text for text in texts)


def test_gap_of_a_path():
    """Past the outermost nodes, which stand at x = 1 m, at x = 3 m: 1.9 m from the surface of the ball."""
    (text,) = told(hit([3, 0, -0.5], [0, 0, 4]), "flies-past")
    gap = float(text.partition("gap of ")[2].split()[0])
    assert gap == pytest.approx(1.9, abs=0.03)


def test_paths_that_bend_or_of_the_web():
    """Gravity turns a ball that is thrown up; a web that is thrown meets a body at rest, or does not."""
    down = refweb.Gravity(acceleration=(0, 0, -9.81))
    assert told(hit([0, 0, 0.5], [0, 0, 1.0], duration=0.6), "flies-past")
    assert not told(hit([0, 0, 0.5], [0, 0, 1.0], duration=0.6, effects=[down]), "flies-past")
    for speed, missed in ((2.0, False), (-2.0, True)):
        thrown = refweb.Velocity(node="all", value=(0, 0, speed))
        scene = hit([0, 0, 1.0], [0, 0, 0], duration=1.0, effects=[thrown]).replace(supports=refweb.Supports(nodes=[]))
        assert bool(told(scene, "flies-past")) == missed


def test_a_hub_that_carries_the_web_is_no_target():
    hub = dict(position=(0, 0, 3.0), velocity=(0, 0, 1.0))
    scene = hit(hub["position"], hub["velocity"], effects=[refweb.Attach(body="ball", node="centre")])
    assert not told(scene, "flies-past") and not told(scene, "starts-around")


@pytest.mark.parametrize(
    ("position", "around"), [([0.25, 0.25, 0.05], True), ([0.25, 0.25, -0.15], False), ([2.0, 0.0, 0.0], False)]
)
def test_a_web_that_begins_around_a_body(position, around):
    """A ball of 0.1 m in a mesh of 0.5 m touches no line."""
    texts = told(hit(position, [0, 0, 1.0]), "starts-around")
    assert len(texts) == around and all('around body "ball"' in text for text in texts)


def test_a_long_body_beside_a_flat_web_is_not_in_it():
    """A rod of 2 m in parallel to the web, 0.3 m below; upright it stands through the web."""
    for axis, around in (((1, 0, 0), False), ((0, 0, 1), True)):
        effects = [
            refweb.Body(
                name="rod", shape="capsule", radius=0.05, length=2.0, axis=axis, position=(0.25, 0.25, -0.3), fixed=True
            ),
            refweb.Contact(stiffness=1e4),
        ]
        scene = refweb.Scene(
            web=WINDOW, cable=refweb.Cable(**CABLE), effects=effects, solve=refweb.Dynamic(duration=0.1)
        )
        assert bool(told(scene, "starts-around")) == around


def test_a_bag_around_a_ball():
    """Nodes at the corners of a cube; the ball in its middle, and beside it."""
    points = [[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    lines = [[a, b] for a in range(8) for b in range(a) if np.abs(np.subtract(points[a], points[b])).sum() == 1]
    bag = refweb.Inline(points=points, lines=lines, supports=[0])
    assert told(hit([0.5, 0.5, 0.5], [0, 0, 1.0], web=bag), "starts-around")
    assert not told(hit([0.5, 0.5, -0.5], [0, 0, 1.0], web=bag), "starts-around")


# Throws


def test_largest_area_of_a_mouth():
    """Sides of 1 m: a square; of 3, 4 and 5 m: 6 m²; of 1, 1, 1 and 2.9 m the centre of the circle is outside."""
    square = refweb.Web([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]], [[0, 1], [1, 2], [2, 3], [3, 0]])
    assert _largest_area(square, np.arange(4)) == pytest.approx(1.0, rel=1e-9)
    triangle = refweb.Web([[0, 0, 0], [3, 0, 0], [0, 4, 0.0]], [[0, 1], [1, 2], [2, 0]])
    assert _largest_area(triangle, np.arange(3)) == pytest.approx(6.0, rel=1e-6)
    sides = np.array([1.0, 1.0, 1.0, 2.9])
    half = 0.5 * sides.sum()
    flat = refweb.Web([[0, 0, 0], [1, 0, 0], [2, 0.5, 0], [3, 0, 0.0]], [[0, 1], [1, 2], [2, 3], [3, 0]], sides)
    brahmagupta = np.sqrt(np.prod(half - sides))
    assert _largest_area(flat, np.arange(4)) == pytest.approx(brahmagupta, rel=1e-9)


def test_a_net_that_starts_open():
    """One flat net of 2 × 2 m as it is made, and the same packed to a tenth, whose lines keep their lengths."""
    layers = refweb.Layers(mesh="square", layers=2, cell_area=0.25).web()
    corners = {"tips": [int(n) for n in layers.corners]}
    for packed, told_of in ((1.0, True), (0.1, False)):
        web = refweb.Inline(
            points=(packed * layers.points).tolist(),
            lines=layers.lines.tolist(),
            natural_length=layers.natural_length.tolist(),
            names=corners,
        )
        scene = refweb.Scene(
            web=web,
            cable=refweb.Cable(**CABLE),
            observe=[refweb.Observe(name="mouth", quantity="mouth_area", node="tips")],
            throw=refweb.Throw(area="mouth"),
            solve=refweb.Dynamic(duration=0.1),
        )
        texts = told(scene, "starts-open")
        assert len(texts) == told_of and all("2.25 m² at the start, and 2.25 m² at most" in text for text in texts)


# At the command line


def test_check_prints_what_a_run_warns_of(tmp_path, capsys):
    """A body in the web at the start, and a modulus in MPa."""
    text = """
[web]
kind = "window"
mesh = "square"
width = 2.0
height = 2.0
side = 0.5
[cable]
modulus = 5e4
area = 1e-6
density = 1000.0
[[body]]
name = "ball"
radius = 0.2
mass = 1.0
position = [0.0, 0.0, 0.1]
velocity = [0.0, 0.0, 1.0]
[contact]
stiffness = 1e3
[solve]
kind = "dynamic"
duration = 1e-3
"""
    (tmp_path / "hit.toml").write_text(text)
    assert main(["check", str(tmp_path / "hit.toml")]) == 0
    out = capsys.readouterr().out
    assert "warning: a body overlaps the web at the start" in out and "is it in MPa?" in out
    assert 'the web begins around body "ball"' in out
    assert sorted(path.name for path in tmp_path.iterdir()) == ["hit.toml"]
    before = {line.removeprefix("warning: ") for line in out.splitlines() if line.startswith("warning: ")}
    run = refweb.run(tmp_path / "hit.toml", progress=False)
    assert any(text in before for text in run.warnings)
