"""Webs: published counts, closed forms, Euler's relation, arcs, selections, files, and every refusal."""

from math import pi, sqrt

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from refweb.errors import InputError
from refweb.net import lattices
from refweb.net.inline import Inline
from refweb.net.lattices import Layers, Paper, Window
from refweb.net.mesh_file import File
from refweb.net.single_cable import SingleCable
from refweb.net.web import Web

MESHES = ("triangle", "square", "hexagon")
# Section 3.2, captions of Figures 11–13: meshes, nodes, and elements (5165 where the paper prints 5156); fixed ends
PUBLISHED = {"triangle": (1260, 755, 2014, 74), "square": (1600, 1677, 3120, 156), "hexagon": (1778, 3554, 5165, 166)}
# sides of the bounding box in element lengths
BOX = {"triangle": (25, 14 * sqrt(3) + 2), "square": (40, 40), "hexagon": (39 * sqrt(3), 67)}
FORMATS = {"net.vtu": "vtu", "net.vtk": "vtk", "net.msh": "gmsh22"}
TRIANGLE = dict(points=[[0, 0, 0], [1, 0, 0], [0, 1, 0]], lines=[[0, 1], [1, 2], [2, 0]])


def distances(web):
    return np.linalg.norm(web.points[web.lines[:, 1]] - web.points[web.lines[:, 0]], axis=1)


def face_areas(web):
    """Areas of the faces that the lines of a flat web enclose: every half-line turns into the next one at its head."""
    tail, head = np.concatenate([web.lines, web.lines[:, ::-1]]).T
    n = len(tail)
    twin = (np.arange(n) + n // 2) % n
    x, y = web.points[:, 0], web.points[:, 1]
    order = np.lexsort((np.arctan2(y[head] - y[tail], x[head] - x[tail]), tail))
    place = np.argsort(order)
    first = np.searchsorted(tail[order], np.arange(len(web.points)))
    degree = np.bincount(tail)
    before = order[first[head] + (place[twin] - first[head] - 1) % degree[head]]
    _, face = connected_components(coo_array((np.ones(n), (np.arange(n), before)), shape=(n, n)), directed=False)
    area = np.bincount(face, weights=x[tail] * y[head] - x[head] * y[tail]) / 2
    return area[area > 1e-9 * web.area]


def assert_euler(web, mesh):
    count, _ = web.components()
    faces = face_areas(web)
    enclosed = len(web.lines) - len(web.points) + count
    links = np.bincount(web.lines.ravel())[web.rim] == 1
    sectors = links.sum() if mesh != "triangle" and web.kind != "layers" else 0
    assert count == 1
    assert len(faces) == enclosed == web.cells - sectors
    if len(faces):
        side = distances(web)[0]
        mesh_area = {"triangle": sqrt(3) / 4, "square": 1, "hexagon": 1.5 * sqrt(3)}[mesh] * side**2
        np.testing.assert_allclose(faces, mesh_area, rtol=1e-9)


@pytest.mark.parametrize("mesh", MESHES)
def test_paper(mesh):
    web = Paper(mesh=mesh, cable_length=201.4).web()
    cells, nodes, lines, fixed = PUBLISHED[mesh]
    assert (web.cells, len(web.points), len(web.lines), len(web.rim)) == (cells, nodes, lines, fixed)
    assert_euler(web, mesh)
    side = 201.4 / lines
    np.testing.assert_allclose(web.natural_length, side, rtol=1e-13)
    assert web.cable_length == pytest.approx(201.4, rel=1e-14)
    box = np.ptp(web.points, axis=0)
    np.testing.assert_allclose(box, [*np.multiply(BOX[mesh], side), 0], rtol=1e-13)
    np.testing.assert_allclose(web.points.min(axis=0) + web.points.max(axis=0), 0, atol=1e-13)
    assert web.area == pytest.approx(BOX[mesh][0] * BOX[mesh][1] * side**2, rel=1e-13)
    degree = np.bincount(web.lines.ravel())
    assert (degree[web.rim] == 1).all()
    inner = np.delete(degree, web.rim)
    assert (inner == {"square": 4, "hexagon": 3}[mesh]).all() if mesh != "triangle" else inner.max() == 6
    assert not web.length_given and web.kind == "paper"


def test_triangle_links_stand_normal_to_the_sides():
    web = Paper(mesh="triangle", cable_length=201.4).web()
    x, y, _ = np.abs(web.points[web.rim] / 0.1).T
    assert np.isclose(x, 12.5).sum() == 2 * 14
    assert np.isclose(y, 7 * sqrt(3) + 1).sum() == 2 * 23


@pytest.mark.parametrize(
    ("mesh", "centre", "corners"), [("triangle", (0, 0), 8), ("square", (0, 0), 8), ("hexagon", (0, -0.5), 8)]
)
def test_paper_centre_and_corners(mesh, centre, corners):
    web = Paper(mesh=mesh, cable_length=201.4).web()
    side = web.natural_length[0]
    np.testing.assert_allclose(web.points[web.centre], [*np.multiply(centre, side), 0], atol=1e-12)
    assert len(web.corners) == corners and np.isin(web.corners, web.rim).all()


@pytest.mark.parametrize(("mesh", "rows", "columns"), [("triangle", 29, 23), ("square", 40, 40), ("hexagon", 45, 40)])
def test_window_of_the_papers_size_is_the_papers_web(mesh, rows, columns):
    window = Window(mesh=mesh, rows=rows, columns=columns, side=2.0).web()
    paper = Paper(mesh=mesh, cable_length=7).web()
    np.testing.assert_array_equal(window.lines, paper.lines)
    np.testing.assert_array_equal(window.rim, paper.rim)
    np.testing.assert_allclose(window.points * (7 / len(paper.lines) / 2), paper.points, rtol=1e-14, atol=1e-16)


def window_counts(mesh, rows, columns):
    """Cells, nodes, fixed ends."""
    odd, even = rows // 2, rows - rows // 2
    if mesh == "square":
        return rows * columns, (rows + 1) * (columns + 1) - 4, 2 * (rows + columns) - 4
    if mesh == "hexagon":
        last = columns - 1 if rows % 2 else columns - 2
        return rows * columns - odd, None, columns - 1 + last + 2 * (rows - 1)
    inner = even * columns + odd * (columns + 1)
    fixed = columns + (columns if rows % 2 else columns + 1) + 2 * odd
    return (rows - 1) * (2 * columns - 1), inner + fixed, fixed


@pytest.mark.parametrize("mesh", MESHES)
def test_windows(mesh):
    least = {"triangle": (2, 1), "square": (2, 2), "hexagon": (2, 3)}[mesh]
    for rows in range(least[0], 9):
        for columns in range(least[1], 9):
            web = Window(mesh=mesh, rows=rows, columns=columns, side=0.25).web()
            cells, nodes, fixed = window_counts(mesh, rows, columns)
            assert (web.cells, len(web.rim)) == (cells, fixed)
            assert nodes in (None, len(web.points))
            assert_euler(web, mesh)
            np.testing.assert_allclose(web.natural_length, 0.25, rtol=1e-13)
            np.testing.assert_allclose(web.points.min(axis=0) + web.points.max(axis=0), 0, atol=1e-14)
            assert (np.bincount(web.lines.ravel())[web.rim] == 1).all()


def test_square_web_is_symmetric():
    web = Window(mesh="square", rows=7, columns=7, side=1.0).web()
    middle = web.points[web.lines].mean(axis=1)[:, :2]

    def sorted_rows(points):
        points = np.round(points, 9) + 0.0
        return points[np.lexsort(points.T)]

    for image in (middle * [-1, 1], middle * [1, -1], middle[:, ::-1]):
        np.testing.assert_array_equal(sorted_rows(image), sorted_rows(middle))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (dict(mesh="square", rows=1, columns=5), 'rows = 1 must be ≥ 2 for mesh = "square"'),
        (dict(mesh="square", rows=5, columns=1), 'columns = 1 must be ≥ 2 for mesh = "square"'),
        (dict(mesh="triangle", rows=1, columns=5), 'rows = 1 must be ≥ 2 for mesh = "triangle"'),
        (dict(mesh="triangle", rows=2, columns=0), 'columns = 0 must be ≥ 1 for mesh = "triangle"'),
        (dict(mesh="hexagon", rows=1, columns=5), 'rows = 1 must be ≥ 2 for mesh = "hexagon"'),
        (dict(mesh="hexagon", rows=3, columns=2), 'columns = 2 must be ≥ 3 for mesh = "hexagon"'),
        (dict(mesh="square", rows=2000, columns=2000), "rows × columns = 4000000 must be ≤ 1000000"),
    ],
)
def test_window_refuses(given, message):
    with pytest.raises(InputError) as error:
        Window(side=1.0, **given)
    assert str(error.value) == message


@pytest.mark.parametrize("mesh", MESHES)
@pytest.mark.parametrize("layers", range(1, 21))
def test_layers_equal_closed_form(mesh, layers):
    n, cell_area = layers, 0.37
    web = Layers(mesh=mesh, layers=n, cell_area=cell_area).web()
    cells, lines, nodes, length = {
        "triangle": (
            (3 * n - 2) ** 2,
            3 * (3 * n - 2) * (3 * n - 1) / 2,
            (3 * n - 1) * 3 * n / 2,
            3 * 3**-0.25 * sqrt(cell_area) * (3 * n - 1) * (3 * n - 2),
        ),
        "square": ((2 * n - 1) ** 2, 4 * n * (2 * n - 1), 4 * n**2, 4 * n * (2 * n - 1) * sqrt(cell_area)),
        "hexagon": (
            3 * n**2 - 3 * n + 1,
            9 * n**2 - 3 * n,
            6 * n**2,
            (9 * n**2 - 3 * n) * sqrt(2 * cell_area / (3 * sqrt(3))),
        ),
    }[mesh]
    assert (web.cells, len(web.lines), len(web.points)) == (cells, lines, nodes)
    assert_euler(web, mesh)
    area = face_areas(web).sum()
    assert web.cable_length == pytest.approx(length, rel=1e-13)
    assert area == pytest.approx(cells * cell_area, rel=1e-12)
    assert web.cable_length / area == pytest.approx(length / (cells * cell_area), rel=1e-12)
    rim = {"triangle": 3 * (3 * n - 2), "square": 4 * (2 * n - 1), "hexagon": 12 * n - 6}[mesh]
    assert len(web.rim) == rim
    hull = {"triangle": 3, "square": 4, "hexagon": 6 if n == 1 else 12}[mesh]
    assert len(web.corners) == hull


@pytest.mark.parametrize(("mesh", "limit"), [("triangle", 3**0.75), ("square", 2.0), ("hexagon", sqrt(2) * 3**0.25)])
def test_ratio_converges_to_the_papers_limit(mesh, limit):
    """√A times the length-area ratio of generated webs, whose excess falls as 1/N."""
    webs = [Layers(mesh=mesh, layers=layers, cell_area=0.25).web() for layers in (10, 100)]
    excess = [0.5 * web.cable_length / (web.cells * 0.25) - limit for web in webs]
    assert np.log10(excess[0] / excess[1]) == pytest.approx(1.0, abs=0.05)


def test_layers_refuse():
    with pytest.raises(InputError, match="layers = 0 must be ≥ 1"):
        Layers(mesh="square", layers=0, cell_area=1.0)
    with pytest.raises(InputError, match="layers = 501 makes 1002001 cells, must be ≤ 1000000"):
        Layers(mesh="square", layers=501, cell_area=1.0).web()
    with pytest.raises(InputError, match='mesh = "hexagn" must be one of .*did you mean "hexagon"'):
        Layers(mesh="hexagn", layers=2, cell_area=1.0)


@pytest.mark.parametrize("mesh", MESHES)
def test_the_limit_of_layers_is_one_of_cells(mesh, monkeypatch):
    """A web of as many cells as are allowed is made, and one that has one more is refused with its number of cells."""
    layers = Layers(mesh=mesh, layers=5, cell_area=1.0)
    cells = layers.web().cells
    monkeypatch.setattr(lattices, "_MOST_CELLS", cells)
    assert layers.web().cells == cells
    monkeypatch.setattr(lattices, "_MOST_CELLS", cells - 1)
    with pytest.raises(InputError, match=f"^layers = 5 makes {cells} cells, must be ≤ {cells - 1}$"):
        layers.web()


@pytest.mark.parametrize("elements", [2, 3, 10, 101])
@pytest.mark.parametrize("stretch", [1 + 1e-14, 1 + 1e-9, 1.01, pi / 2, 3.0, 1e3])
def test_slack_cable_lies_on_an_arc_of_equal_chords(elements, stretch):
    start, end = np.array([0.3, -0.2, 1.0]), np.array([1.5, 0.7, 0.6])
    length = stretch * np.linalg.norm(end - start)
    web = SingleCable(start=tuple(start), end=tuple(end), elements=elements, length=length).web()
    chord = length / elements
    np.testing.assert_allclose(web.natural_length, chord, rtol=1e-15)
    np.testing.assert_allclose(distances(web), chord, rtol=0, atol=1e-14 * length)
    np.testing.assert_array_equal(web.points[[0, -1]], [start, end])
    np.testing.assert_array_equal(web.rim, [0, elements])
    middle = web.points - (start + end) / 2
    along = (end - start) / np.linalg.norm(end - start)
    down = np.array([0, 0, -1]) - along * -along[2]
    down /= np.linalg.norm(down)
    assert (middle[1:-1] @ down > 0).all()
    np.testing.assert_allclose(middle @ np.cross(along, down), 0, atol=1e-14 * length)
    if elements > 2 and stretch > 1.001:
        turn = np.einsum("ij,ij->i", np.diff(web.points, axis=0)[1:], np.diff(web.points, axis=0)[:-1])
        np.testing.assert_allclose(turn, turn[0], rtol=0, atol=1e-13 * length**2)
    assert web.length_given and web.cells == 0


@pytest.mark.parametrize("length", [1e15, 1e17, 1e50])
def test_cable_beside_which_its_distance_is_lost(length):
    """A closed polygon."""
    web = SingleCable(start=(0, 0, 0), end=(1, 0, 0), elements=5, length=length).web()
    chords = np.linalg.norm(np.diff(web.points[1:-1], axis=0), axis=1)
    np.testing.assert_allclose(chords, length / 5, rtol=1e-14)


def test_cable_on_a_half_circle():
    web = SingleCable(start=(-1, 0, 0), end=(1, 0, 0), elements=6, length=12 * np.sin(pi / 12), sag=(0, 2, 0)).web()
    angle = pi * np.arange(7) / 6
    expected = np.stack([-np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    np.testing.assert_allclose(web.points, expected, atol=1e-14)


@pytest.mark.parametrize(("end", "side"), [((0, 0, -2), 0), ((0.1 + 0.2 - 0.3, 0, 2), 0), ((2, 0, 0), 2)])
def test_default_sag(end, side):
    web = SingleCable(start=(0, 0, 0), end=end, elements=4, length=3.0).web()
    assert (web.points[1:-1, side] < -0.1).all()


@pytest.mark.parametrize(("length", "given"), [(None, False), (1.5, True), (2.0, True)])
def test_short_cable_is_straight(length, given):
    web = SingleCable(start=(0, 0, 1), end=(0, 2, 1), elements=4, length=length).web()
    np.testing.assert_array_equal(web.points, [[0, y, 1] for y in (0, 0.5, 1, 1.5, 2)])
    np.testing.assert_array_equal(web.natural_length, (length or 2.0) / 4)
    assert web.length_given is given and web.kind == "cable"


@pytest.mark.parametrize(
    ("start", "end", "elements", "centre"),
    [
        ((5, 0, 0), (6, 0, 0), 4, 2),
        ((6, 0, 0), (5, 0, 0), 5, 3),
        ((0, 3, 0), (9, 4, 0), 5, 2),
        ((0, 0, 0), (1, 0, 0), 1, 0),
    ],
)
def test_cable_centre_is_at_half_its_length(start, end, elements, centre):
    assert SingleCable(start=start, end=end, elements=elements).web().centre == centre


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (dict(end=(0, 0, 0)), "end = [0.0, 0.0, 0.0] must be apart from start by a finite distance > 0 [m]"),
        (dict(elements=0), "elements = 0 must be ≥ 1"),
        (dict(length=-1.0), "length = -1.0 must be > 0 [m]"),
        (dict(elements=1, length=2.5), "elements = 1 must be ≥ 2: length = 2.5 m > distance = 2 m"),
        (dict(sag=(3, 0, 0)), "sag = [3.0, 0.0, 0.0] must not be zero or parallel to the cable, from start to end"),
        (dict(sag=(0, 0, 0)), "sag = [0.0, 0.0, 0.0] must not be zero or parallel to the cable, from start to end"),
        (dict(sag=(1, 0)), "sag = [1, 0] must be a vector of 3 numbers, not 2"),
    ],
)
def test_cable_refuses(given, message):
    with pytest.raises(InputError) as error:
        SingleCable(**{"start": (0, 0, 0), "end": (2, 0, 0), "elements": 4, **given})
    assert str(error.value).replace("(1, 0)", "[1, 0]") == message


def test_inline():
    table = Inline(
        points=[[0, 0, 0], [3, 0, 0], [3, 4, 0], [0, 0, 5]],
        lines=[[0, 1], [1, 2], [2, 0], [0, 3]],
        supports=[3, 1, 3],
        names={"tip": 2, "feet": [3, 0]},
        groups=["leg", "leg", "", "mast"],
    )
    web = table.web()
    assert Inline(**table.to_dict()) == table
    np.testing.assert_allclose(web.natural_length, [3, 4, 5, 5], rtol=1e-15)
    np.testing.assert_array_equal(web.rim, [1, 3])
    assert (web.cells, web.area, web.centre, web.kind, web.length_given) == (1, 20.0, 0, "inline", False)
    assert [web.find_lines(name).tolist() for name in ("leg", "mast")] == [[0, 1], [3]]
    assert web.find(["feet", "tip", 3, "rim", "centre"], "nodes").tolist() == [3, 0, 2, 1]
    given = Inline(**TRIANGLE, natural_length=2.5).web()
    assert given.natural_length.tolist() == [2.5] * 3 and given.length_given
    assert Inline(**TRIANGLE, natural_length=[1, 2, 3]).web().natural_length.tolist() == [1, 2, 3]


def test_cells_of_a_web_in_parts():
    """Two triangles apart, and a line by itself: each closed loop is a mesh, whatever part it belongs to."""
    points = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    apart = [*points, *([x + 5, y, z] for x, y, z in points)]
    triangles = [[0, 1], [1, 2], [2, 0], [3, 4], [4, 5], [5, 3]]
    assert Inline(points=points, lines=triangles[:3]).web().cells == 1
    assert Inline(points=apart, lines=triangles).web().cells == 2
    assert Inline(points=[*apart, [9, 0, 0], [9, 1, 0]], lines=[*triangles, [6, 7]]).web().cells == 2
    assert Inline(points=apart, lines=[*triangles, [1, 3]]).web().cells == 2
    count, part = Inline(points=apart, lines=triangles).web().components()
    assert count == 2 and part.tolist() == [0, 0, 0, 1, 1, 1]


def test_arrays_are_typed_and_read_only():
    web = Inline(**TRIANGLE, supports=[0]).web()
    assert (web.points.dtype, web.lines.dtype, web.natural_length.dtype, web.rim.dtype) == ("f8", "i4", "f8", "i4")
    for array in (web.points, web.lines, web.natural_length, web.rim):
        assert array.flags.c_contiguous and not array.flags.writeable


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (dict(lines=[[0, 1], [1, 2], [2, 3]]), "lines[2] = [2, 3] must be node numbers 0 … 2"),
        (dict(lines=[[0, 1], [1, 1], [2, 0]]), "lines[1] = [1, 1] joins a node to itself"),
        (dict(points=[[0, 0, 0], [1, 0, 0], [1, 0, 0]]), "lines[1] = [1, 2] has no length: its nodes coincide"),
        (dict(points=[[0, 0, 0], [1, 0, float("nan")], [0, 1, 0]]), "points[1][2] = nan must be a finite number"),
        (dict(points=[[0, 0], [1, 0], [0, 1]]), "points[0] = [0, 0] must be a row of 3 numbers, not 2"),
        (dict(lines=[[0, 1], [1, 2], [2, -1]]), "lines[2][1] = -1 must be ≥ 0"),
        (dict(lines=[[0, 1], [1, 2], [2, 0.5]]), "lines[2][1] = 0.5 must be a whole number ≥ 0"),
        (dict(natural_length=[1, 2]), "natural_length has 2 entries for 3 lines"),
        (dict(natural_length=[1, 2, 0]), "natural_length[2] = 0.0 must be > 0 [m]"),
        (dict(natural_length=-2), "natural_length = -2.0 must be > 0 [m]"),
        (dict(natural_length="far"), 'natural_length = "far" must be "distance", one number or one for each line [m]'),
        (dict(supports=[0, 3]), "supports[1] = 3 must be 0 … 2"),
        (dict(names={"tip": 7}), "names.tip[0] = 7 must be 0 … 2"),
        (dict(names={"tip": 0.5}), "names.tip = 0.5 must be a whole number ≥ 0"),
        (dict(names=3), "names = 3 must be a table of node numbers, such as {tip = 3}"),
        (dict(names={"rim": 0}), "names.rim = [0]: centre, rim, corners, all have a meaning of their own"),
        (dict(groups=["a"]), "groups has 1 entries for 3 lines"),
    ],
)
def test_inline_refuses(given, message):
    with pytest.raises(InputError) as error:
        Inline(**{**TRIANGLE, **given}).web()
    assert str(error.value) == message


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([[0, 0], [1, 0]], [[0, 1]]), r"points of shape \(2, 2\) must have the shape \(nodes, 3\)"),
        (([[0, 0, 0], [1, 0, 0]], [0, 1]), r"lines of shape \(2,\) must be at least one pair of node numbers"),
        (([[0, 0, 0], [1, 0, 0]], [[0.0, 1.0]]), "must be at least one pair of node numbers"),
        (([[0, 0, 0], [1, 0, np.inf]], [[0, 1]]), r"points\[1\] = \[1.0, 0.0, inf\] must be finite"),
        (([[0, 0, 0], [1e200, 0, 0]], [[0, 1]]), r"natural_length\[0\] = inf must be finite and > 0"),
        (([[0, 0, 0], [1, 0, 0]], [[0, 1]], [np.nan]), r"natural_length\[0\] = nan must be finite and > 0"),
        (([[0, 0, 0], [1, 0, 0]], [[0, 1]], None, [2]), r"rim\[0\] = 2 must be 0 … 1"),
    ],
)
def test_web_refuses(arguments, message):
    with pytest.raises(InputError, match=message):
        Web(*arguments)


def test_find():
    web = Paper(mesh="hexagon", cable_length=201.4).web()
    assert web.find(17).tolist() == [17] and web.find(np.int64(17)).dtype == np.int64
    assert web.find([5, 3, 5]).tolist() == [5, 3] and web.find([]).shape == (0,)
    assert web.find("centre").tolist() == [web.centre]
    np.testing.assert_array_equal(web.find(["rim"]), web.rim)
    np.testing.assert_array_equal(web.find("corners"), web.corners)
    np.testing.assert_array_equal(web.find("all"), np.arange(3554))
    for selection, name, message in (
        (4000, "node", "node = 4000 must be 0 … 3553"),
        ([0, -1], "nodes", "nodes[1] = -1 must be ≥ 0"),
        (True, "node", "node = true must be a whole number ≥ 0"),
        (1.5, "node", "node = 1.5 must be a whole number ≥ 0"),
        ("center", "node", 'node = "center" names no node, did you mean "centre"?'),
        (["rmi"], "nodes", 'nodes[0] = "rmi" names no node, did you mean "rim"?'),
    ):
        with pytest.raises(InputError) as error:
            web.find(selection, name)
        assert str(error.value) == message
    with pytest.raises(InputError, match='node = "rim": this web has no supports of its own'):
        Inline(**TRIANGLE).web().find("rim")


def test_centre_ties_go_to_lowest_y_then_x():
    points = [[1, 1, 0], [1, -1, 0], [-1, -1 + 1e-14, 0], [-1, 1, 0]]
    assert Web(points, [[0, 1], [1, 2], [2, 3]]).centre == 2
    assert Web([[-1, 1, 0], [1, -1, 0]], [[0, 1]]).centre == 1


def test_corners_are_where_the_hull_turns():
    """Not a point that rounding has moved out of a side."""
    points = [[0, 0, 0], [1, -1e-12, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]]
    assert Web(points, [[0, 1], [1, 2], [2, 3], [3, 4], [4, 0]]).corners.tolist() == [0, 2, 3, 4]


def test_corners_of_webs_without_any():
    with pytest.raises(InputError, match=r"flat web in z = 0 m; this web reaches \|z\| = 1 m"):
        Web([[0, 0, 0], [1, 0, 0], [0, 1, 1]], [[0, 1], [1, 2]]).find("corners")
    with pytest.raises(InputError, match="the nodes of this web lie on one line"):
        Web([[0, 0, 0], [1, 1, 0], [2, 2, 0]], [[0, 1], [1, 2]]).find("corners")


def test_a_large_web_is_checked_by_array_operations():
    web = Window(mesh="square", rows=230, columns=230, side=1.0).web()
    assert len(web.lines) == 230 * 229 * 2 and web.components()[0] == 1


@pytest.fixture
def mesh():
    import meshio

    points = np.array([[0, 0, 0], [1, 0, 0], [2, 0.1, 0], [2, 1, 1 / 3]])
    return meshio.Mesh(points, [("line", [[0, 1], [1, 2]]), ("line", [[2, 3]])])


@pytest.mark.parametrize("name", FORMATS)
def test_file_round_trip(mesh, tmp_path, name):
    mesh.cell_data = {"natural_length": [np.array([1.5, 2.5]), np.array([3.5])]}
    mesh.cell_data["group"] = [np.array([7, 8]), np.array([8])]
    mesh.point_data = {"support": np.array([1, 0, 0, -2])}
    mesh.write(tmp_path / name, file_format=FORMATS[name])
    web = File(path=name).web(tmp_path)
    np.testing.assert_allclose(web.points, mesh.points, rtol=1e-15)
    assert web.lines.tolist() == [[0, 1], [1, 2], [2, 3]] and web.natural_length.tolist() == [1.5, 2.5, 3.5]
    assert web.rim.tolist() == [0, 3] and web.find_lines("8").tolist() == [1, 2]
    assert web.find_lines("7").tolist() == [0]
    assert (web.kind, web.length_given, web.cells) == ("file", True, 0)
    assert len(File(path=str(tmp_path / name)).web("/nowhere").lines) == 3


def test_file_without_data_takes_distances(mesh, tmp_path):
    mesh.write(tmp_path / "net.vtu")
    web = File(path="net.vtu").web(tmp_path)
    np.testing.assert_allclose(web.natural_length, distances(web), rtol=1e-15)
    assert not web.length_given and len(web.rim) == 0 and web.groups == {}


def test_file_of_pyvista(mesh, tmp_path):
    pyvista = pytest.importorskip("pyvista")
    net = pyvista.PolyData(mesh.points, lines=[2, 0, 1, 2, 1, 2, 2, 2, 3])
    net.cell_data["natural_length"] = [1.5, 2.5, 3.5]
    net.cast_to_unstructured_grid().save(tmp_path / "net.vtu")
    web = File(path="net.vtu").web(tmp_path)
    assert web.lines.tolist() == [[0, 1], [1, 2], [2, 3]] and web.natural_length.tolist() == [1.5, 2.5, 3.5]


def refusal(folder, name):
    with pytest.raises(InputError) as error:
        File(path=name).web(folder)
    message = str(error.value)
    assert message.startswith(f'path = "{name}": ') and message.isprintable()
    return message


@pytest.mark.parametrize("name", FORMATS)
def test_truncated_and_garbage_files(mesh, tmp_path, name, capfd):
    mesh.write(tmp_path / name, file_format=FORMATS[name])
    capfd.readouterr()
    whole = (tmp_path / name).read_bytes()
    random = np.random.default_rng(0).bytes(500)
    for part in (whole[: len(whole) // 2], whole[: len(whole) // 4], b"", random, b"<VTKFile>", whole[:60] + random):
        (tmp_path / name).write_bytes(part)
        refusal(tmp_path, name)
    assert capfd.readouterr() == ("", "")


def test_files_that_are_no_web(mesh, tmp_path):
    import meshio

    assert "there is no file" in refusal(tmp_path, "absent.vtu")
    (tmp_path / "folder.vtu").mkdir()
    assert "there is no file" in refusal(tmp_path, "folder.vtu")
    (tmp_path / "net.unknown").write_text("x")
    assert 'format ".unknown" must be one of .vtu, .vtk, .vtp, .msh, .csv' in refusal(tmp_path, "net.unknown")
    for cells, message in (
        (
            [("triangle", [[0, 1, 2]]), ("line", [[2, 3]])],
            "it holds 1 line, 1 triangle cells: a web has only lines; ",
        ),
        ([("vertex", [[0]])], "it holds 1 vertex cells: a web has only lines; "),
        ([("line", [[0, 1], [1, 2], [2, 9]])], "lines[2] = [2, 9] must be node numbers 0 … 3"),
    ):
        meshio.Mesh(mesh.points, cells).write(tmp_path / "net.vtu")
        assert message in refusal(tmp_path, "net.vtu")
    lines = [("line", [[0, 1], [1, 2], [2, 3]])]
    for data, message in (
        ({"natural_length": [np.ones((3, 2))]}, "natural_length of shape (3, 2) must be 3 finite numbers"),
        ({"natural_length": [np.array([1, np.nan, 1])]}, "natural_length of shape (3,) must be 3 finite numbers"),
        ({"natural_length": [np.array([1.0, 0.0, 1.0])]}, "natural_length[1] = 0 must be finite and > 0 [m]"),
        ({"group": [np.ones((3, 2))]}, "group of shape (3, 2) must have one entry for each of 3 lines"),
    ):
        meshio.Mesh(mesh.points, lines, cell_data=data).write(tmp_path / "net.vtu")
        assert refusal(tmp_path, "net.vtu").endswith(message)


def test_no_external_entity_is_followed(mesh, tmp_path):
    mesh.write(tmp_path / "net.vtu")
    (tmp_path / "secret.txt").write_text("0 0 0")
    text = (tmp_path / "net.vtu").read_text()
    text = text.replace("<VTKFile", '<!DOCTYPE V [<!ENTITY e SYSTEM "secret.txt">]>\n<VTKFile', 1)
    (tmp_path / "net.vtu").write_text(text.replace("<Piece", "&e;<Piece", 1))
    assert "meshio cannot read" in refusal(tmp_path, "net.vtu")
