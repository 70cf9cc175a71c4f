"""Webs of surfaces: the edges of faces are lines, each once, as Euler's formula counts them."""

import numpy as np
import pytest
from test_mesh_files import OLD

import refweb
from refweb.__main__ import main
from refweb.errors import InputError
from refweb.findings import NOTE, WARNING
from refweb.net.mesh_file import File

CORNERS = [[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)]
QUADS = [[1, 3, 4, 2], [5, 6, 8, 7], [1, 2, 6, 5], [2, 4, 8, 6], [4, 3, 7, 8], [3, 1, 5, 7]]
"""Sides of a cube, of corners from 1."""
CUBE_EDGES = {(a, b) for a in range(8) for b in range(a) if np.abs(np.subtract(CORNERS[a], CORNERS[b])).sum() == 1}
"""Pairs of corners of a cube that differ in one coordinate."""


def pairs(web, points):
    """Pairs of numbers of places that the lines of a web join, as CUBE_EDGES has them."""
    number = {tuple(place): n for n, place in enumerate(np.asarray(points, dtype=float).tolist())}
    ends = [[number[tuple(web.points[node].tolist())] for node in line] for line in web.lines]
    assert len({tuple(sorted(end)) for end in ends}) == len(ends)  # each once
    return {(max(end), min(end)) for end in ends}


def obj(folder, rows, name="net.obj"):
    (folder / name).write_text("\n".join([*(f"v {x} {y} {z}" for x, y, z in CORNERS), *rows]))
    return File(path=name)


def test_edges_of_a_cube_in_obj(tmp_path):
    """With texture and normals, whose numbers have lists of their own, and counted backwards; a note tells of it."""
    faces = ["f " + " ".join(f"{c}/{1 + n % 3}/1" for n, c in enumerate(quad)) for quad in QUADS[:3]]
    faces += ["f " + " ".join(str(c - 9) for c in quad) for quad in QUADS[3:]]
    web = obj(tmp_path, ["vt 0 0", "vt 1 0", "vt 1 1", "vn 0 0 1", "g low", *faces[:1], "g high", *faces[1:]]).web(
        tmp_path
    )
    assert pairs(web, CORNERS) == CUBE_EDGES and len(web.lines) == 12
    assert sorted(web.find_lines("low")) == sorted(np.flatnonzero((web.points[web.lines][:, :, 2] == 0).all(axis=1)))
    assert len(web.find_lines("high")) == 12  # each edge of the cube belongs to one of the five other sides
    assert [note.severity for note in web.notes] == [NOTE]
    assert "6 faces and no lines: the web's lines are the 12 edges" in web.notes[0].text


def test_edges_of_an_stl_surface(tmp_path):
    """A cube of 12 triangles: its 12 edges and a diagonal of each side; E = V + F − 2."""
    text = "solid cube\n"
    for a, b, c, d in QUADS:
        for triangle in ((a, b, c), (a, c, d)):
            rows = "".join(f"vertex {x} {y} {z}\n" for x, y, z in (CORNERS[n - 1] for n in triangle))
            text += f"facet normal 0 0 0\nouter loop\n{rows}endloop\nendfacet\n"
    (tmp_path / "net.stl").write_text(text + "endsolid cube\n")
    web = File(path="net.stl").web(tmp_path)
    found = pairs(web, CORNERS)
    assert len(web.points) == 8 and CUBE_EDGES < found and len(found) == 8 + 12 - 2
    lengths = sorted(web.natural_length)
    np.testing.assert_allclose(lengths, [1.0] * 12 + [np.sqrt(2.0)] * 6, rtol=1e-6)


@pytest.mark.parametrize("name", ["ball.vtp", "ball.vtu", "ball.vtk"])
def test_edges_of_a_vtk_surface(tmp_path, name):
    """A ball: E = V + F − 2."""
    pyvista = pytest.importorskip("pyvista")
    ball = pyvista.Sphere(theta_resolution=8, phi_resolution=6)
    (ball if name == "ball.vtp" else ball.cast_to_unstructured_grid()).save(tmp_path / name)
    web = File(path=name).web(tmp_path)
    assert len(web.points) == ball.n_points and len(web.lines) == ball.n_points + ball.n_cells - 2


def test_edges_of_pixels(tmp_path):
    """Cells of an image, whose corners VTK counts row by row: two squares have seven sides, and no diagonals."""
    pyvista = pytest.importorskip("pyvista")
    pyvista.ImageData(dimensions=(3, 2, 1)).cast_to_unstructured_grid().save(tmp_path / "net.vtu")
    web = File(path="net.vtu").web(tmp_path)
    assert web.natural_length.tolist() == [1.0] * 7 and len(web.points) == 6


SURFACE = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
3
0 1 "support"
2 2 "sail"
2 3 "flap"
$EndPhysicalNames
$Nodes
6
1 0 0 0
2 1 0 0
3 1 1 0
4 0 1 0
5 2 0 0
6 9 9 9
$EndNodes
$Elements
4
1 15 2 1 1 1
2 2 2 2 1 1 2 3
3 2 2 2 1 1 3 4
4 2 2 3 2 2 5 3
$EndElements
"""


def test_surfaces_of_gmsh(tmp_path):
    """Physical surfaces are groups of edges, of which one between two of them is in both."""
    (tmp_path / "net.msh").write_text(SURFACE)
    web = File(path="net.msh").web(tmp_path)
    ends = lambda name: {tuple(sorted(web.lines[n].tolist())) for n in web.find_lines(name)}  # noqa: E731
    assert ends("sail") == {(0, 1), (1, 2), (0, 2), (2, 3), (0, 3)}
    assert ends("flap") == {(1, 2), (1, 4), (2, 4)}
    assert len(web.lines) == 7 and len(web.points) == 5 and web.rim.tolist() == [0]


def test_edges_beside_lines(tmp_path):
    """A file of both is refused without the key; true takes both, each once, false the lines alone."""
    surface = OLD.replace("$Elements\n9", "$Elements\n10").replace("9 15 2 5 4 4\n", "9 15 2 5 4 4\n10 2 2 1 1 1 2 3\n")
    (tmp_path / "net.msh").write_text(surface)
    with pytest.raises(InputError, match="edges = false takes its lines alone, edges = true the edges of its faces"):
        File(path="net.msh").web(tmp_path)
    alone = File(path="net.msh", edges=False).web(tmp_path)
    (tmp_path / "lines.msh").write_text(OLD)
    plain = File(path="lines.msh").web(tmp_path)
    assert alone.lines.tolist() == plain.lines.tolist() and not alone.notes
    assert {name: list(lines) for name, lines in alone.groups.items()} == {n: list(m) for n, m in plain.groups.items()}
    both = File(path="net.msh", edges=True).web(tmp_path)
    assert both.lines[:-1].tolist() == plain.lines.tolist() and sorted(both.lines[-1].tolist()) == [0, 2]
    assert not both.notes and list(both.find_lines("thick")) == list(plain.find_lines("thick"))


def test_lengths_and_groups_of_lines_stay_beside_edges(tmp_path):
    """Of a triangle and a line along one of its sides: that line keeps its length, the other sides have distances."""
    meshio = pytest.importorskip("meshio")
    data = {"natural_length": [np.array([0.5]), np.array([9.0])], "group": [np.array([2.0]), np.array([3.0])]}
    cells = [("line", [[1, 0]]), ("triangle", [[0, 1, 2]])]
    meshio.Mesh(np.array([[0, 0, 0], [3, 0, 0], [0, 4, 0.0]]), cells, cell_data=data).write(tmp_path / "net.vtu")
    web = File(path="net.vtu", edges=True).web(tmp_path)
    assert web.lines.tolist() == [[1, 0], [1, 2], [2, 0]] and web.natural_length.tolist() == [0.5, 5.0, 4.0]
    assert web.find_lines("2").tolist() == [0] and web.find_lines("3").tolist() == [1, 2]


def test_edges_that_are_not_there(tmp_path):
    with pytest.raises(InputError, match="edges = false takes lines alone, and the file has 1 faces and no lines"):
        File(**{**obj(tmp_path, ["f 1 2 3"]).to_dict(), "edges": False}).web(tmp_path)
    with pytest.raises(InputError, match="edges = true takes edges of faces, and the file has no faces"):
        File(**{**obj(tmp_path, ["l 1 2 3"]).to_dict(), "edges": True}).web(tmp_path)


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("f 1 2 12", "net.obj has an element of point 12, must be 1 … 8"),
        ("f 1 2 0", "net.obj, line 9: .* must name points from 1"),
        ("f 1 -9 2", "net.obj, line 9: .* must name points from 1"),
        ("l 1", "net.obj, line 9: .* a line needs two points"),
        ("v 1 2", "net.obj, line 9: .* must be v and three numbers"),
        ("f 1 1 1", "its faces have no edges"),
        ("", "it holds no cells: a web has only lines; write rows l 1 2"),
    ],
)
def test_wrong_obj_files(tmp_path, row, message):
    with pytest.raises(InputError, match=message):
        obj(tmp_path, [row]).web(tmp_path)


def test_lines_of_obj(tmp_path):
    """A polyline is a line for each piece; points that no line uses stay, as in other files of lines."""
    web = obj(tmp_path, ["g stay", "l 1 2 4"]).web(tmp_path)
    assert web.lines.tolist() == [[0, 1], [1, 3]] and web.find_lines("stay").tolist() == [0, 1]
    assert len(web.points) == 8 and not web.notes


# CSV with columns of other names

NODES = "id,x,y,z,is_free\n1,0,0,0,0\n2,1,0,0,1\n3,2,0,0,0\n"
MEMBERS = "a,b,q\n1,2,5\n2,3,5\n"
SCENE = """
[web]
kind = "file"
path = "nodes.csv"
lines = "members.csv"
{keys}
[supports]
nodes = [0, 2]
[cable]
law = "tension-only"
modulus = 1e9
area = 1e-4
density = 0.0
[[load]]
node = 1
force = [0.0, 0.0, -10.0]
[solve]
kind = "static"
"""
COLUMNS = 'columns = { i = "a", j = "b" }\nfirst = 1'


def csv(folder, nodes=NODES, members=MEMBERS, keys=COLUMNS):
    (folder / "nodes.csv").write_text(nodes)
    (folder / "members.csv").write_text(members)
    (folder / "scene.toml").write_text(SCENE.format(keys=keys))
    return folder / "scene.toml"


def test_columns_of_other_names(tmp_path, capsys):
    """Two lines of 1 m and EA = 1e5 N under 10 N in the middle: their sag w solves 2 EA (1 − 1/√(1 + w²)) w = 10."""
    scene = csv(tmp_path)
    web = refweb.Scene.load(scene).build().net.web
    assert web.lines.tolist() == [[0, 1], [1, 2]] and [note.severity for note in web.notes] == [NOTE, NOTE]
    assert main(["check", str(scene)]) == 0
    assert 'note: nodes.csv: columns "id", "is_free" left alone' in capsys.readouterr().out
    solution = refweb.run(scene)
    sag = solution.results["deflection"]
    stretch = lambda w: 2e5 * (np.sqrt(1 + w * w) - 1) * w / np.sqrt(1 + w * w) - 10.0  # noqa: E731
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stretch(middle) < 0 else (low, middle)
    assert sag.value == pytest.approx(low, rel=1e-6)


def test_a_column_that_may_be_misspelt_is_a_warning(tmp_path):
    csv(tmp_path, members="a,b,natural_lenght\n1,2,5\n2,3,5\n")
    (note,) = refweb.Scene.load(tmp_path / "scene.toml").build().net.web.notes[1:]
    assert note.severity == WARNING and 'give columns = {natural_length = "natural_lenght"}' in note.text


def test_all_that_is_wrong_is_said_at_once(tmp_path, capsys):
    nodes = NODES.replace("2,1,0,0,1", "2,one,0,0,1").replace("3,2,0", "3,2,-")
    scene = csv(tmp_path, nodes, "a,b\n1,2\n2,7\n1,x\n0,1\n2,3,4\n1,8\n2,9\n")
    assert main(["check", str(scene)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert 'members.csv, line 6 has 3 cells, the first row 2; nodes.csv, line 3: x = "one" must be a number' in said
    assert 'nodes.csv, line 4: y = "-" must be a number; members.csv, line 4: j = "x" must be a whole number' in said
    assert "members.csv, line 3: nodes [2, 7] must be 1 … 3, counted from 1; and 3 problems more" in said


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ("", 'column i is missing, the first row has "a,b,q"; members.csv: column j is missing'),
        ("", 'columns = {i = "...", j = "..."} says what they are called, and first = 1 that numbers begin at 1'),
        ("", 'columns "a", "b", "q" are unknown, known: i, j, natural_length, group'),
        (
            'columns = { i = "a", j = "b" }',
            "line 3: nodes [2, 3] must be 0 … 2, counted from 0; first = 1 reads numbers",
        ),
        ('columns = { i = "a", j = "c" }', 'column j, called "c" in columns, is missing'),
        ('columns = { k = "a" }', "columns.k is no column of a web"),
        ("columns = { i = 3 }", "columns.i = 3 must be the name of a column in the file"),
        ("columns = 3", "columns = 3 must be a table of names of columns"),
        ("first = -1", "first = -1 must be ≥ 0"),
        ("edges = true", "edges = true is a key of mesh files, not of CSV: leave it out"),
    ],
)
def test_wrong_columns(tmp_path, capsys, keys, message):
    assert main(["check", str(csv(tmp_path, keys=keys))]) == 2
    assert message in capsys.readouterr().err


def test_keys_of_csv_beside_a_mesh(tmp_path):
    with pytest.raises(InputError, match="first = 1 is a key of CSV files: leave it out"):
        File(**{**obj(tmp_path, ["l 1 2"]).to_dict(), "first": 1}).web(tmp_path)


def test_a_geometry_of_gmsh_is_told_how_to_mesh(tmp_path):
    (tmp_path / "net.geo").write_text("Point(1) = {0, 0, 0, 1};\n")
    with pytest.raises(InputError, match=r"`gmsh -1 net\.geo` makes the mesh net\.msh of it"):
        File(path="net.geo").web(tmp_path)
