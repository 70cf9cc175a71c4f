"""Meshes as people have them: Gmsh, VTK of any kind, frames of results, CSV; and what is said of others."""

import re

import numpy as np
import pytest
from nets import some

import refweb
from refweb.__main__ import main
from refweb.errors import InputError
from refweb.net.mesh_file import File, remarks

# Gmsh: a unit square of four curves, whose third is in two physical groups.

NAMES = """$PhysicalNames
4
0 1 "support"
0 2 "tip"
1 3 "rim"
1 4 "thick"
$EndPhysicalNames
"""
OLD = f"""$MeshFormat
2.2 0 8
$EndMeshFormat
{NAMES}$Nodes
5
1 0 0 0
2 1 0 0
3 1 1 0
4 0 1 0
5 9 9 9
$EndNodes
$Elements
9
1 15 2 1 1 1
2 15 2 1 2 2
3 15 2 2 3 3
4 1 2 3 1 1 2
5 1 2 3 2 2 3
6 1 2 4 2 2 3
7 1 2 4 3 3 4
8 1 2 7 4 4 1
9 15 2 5 4 4
$EndElements
"""
NEW = f"""$MeshFormat
4.1 0 8
$EndMeshFormat
{NAMES}$Entities
4 4 0 0
1 0 0 0 1 1
2 1 0 0 1 1
3 1 1 0 1 2
4 0 1 0 1 5
1 0 0 0 1 0 0 1 3 2 1 -2
2 1 0 0 1 1 0 2 3 4 2 2 -3
3 0 1 0 1 1 0 1 4 2 3 -4
4 0 0 0 0 1 0 1 7 2 4 -1
$EndEntities
$Nodes
4 4 1 4
0 1 0 1
1
0 0 0
0 2 0 1
2
1 0 0
0 3 0 1
3
1 1 0
0 4 0 1
4
0 1 0
$EndNodes
$Elements
8 8 1 8
0 1 15 1
1 1
0 2 15 1
2 2
0 3 15 1
3 3
0 4 15 1
4 4
1 1 1 1
5 1 2
1 2 1 1
6 2 3
1 3 1 1
7 3 4
1 4 1 1
8 4 1
$EndElements
"""


@pytest.mark.parametrize("text", [OLD, NEW], ids=["2.2", "4.1"])
def test_gmsh(tmp_path, text):
    (tmp_path / "net.msh").write_text(text)
    web = File(path="net.msh").web(tmp_path)
    np.testing.assert_array_equal(web.points, [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])  # the fifth belongs to none
    assert web.lines.tolist() == [[0, 1], [1, 2], [2, 3], [3, 0]] and web.rim.tolist() == [0, 1]
    given = {"rim": [0, 1], "thick": [1, 2], "7": [3], "anchors": [1, 3], "inner": [2]}
    assert {name: lines.tolist() for name, lines in web.groups.items()} == given
    assert web.find("tip").tolist() == [2] and web.find("5").tolist() == [3]


def test_lines_beside_surfaces_of_gmsh_are_refused_with_what_there_is(tmp_path):
    surface = OLD.replace("$Elements\n9", "$Elements\n10").replace("9 15 2 5 4 4\n", "9 15 2 5 4 4\n10 2 2 1 1 1 2 3\n")
    (tmp_path / "net.msh").write_text(surface)
    with pytest.raises(InputError, match=r"it holds 5 line, 1 triangle, 4 vertex cells: .* Mesh.SaveAll = 0"):
        File(path="net.msh").web(tmp_path)
    (tmp_path / "net.msh").write_text(NEW.replace("0 1 7 2 4 -1", "0 0 2 4 -1"))
    with pytest.raises(InputError, match="some curves or points have a physical group and others none"):
        File(path="net.msh").web(tmp_path)


# VTK

POINTS = np.array([[0, 0, 0], [1, 0, 0], [2, 0.5, 0], [2, 1, 1 / 3]])


def saved(folder, name, polylines=False):
    """The chain 0, 1, 2, 3 as pyvista writes it, as three lines, or as a polyline of two and a line."""
    pyvista = pytest.importorskip("pyvista")
    net = pyvista.PolyData(POINTS, lines=[3, 0, 1, 2, 2, 2, 3] if polylines else [2, 0, 1, 2, 1, 2, 2, 2, 3])
    net.point_data["support"] = [1, 0, 0, 1]
    net.cell_data["natural_length"] = [3.0, 3.5] if polylines else [1.5, 2.5, 3.5]
    net.cell_data["group"] = ["long", "short"] if polylines else ["long", "long", "short"]
    (net if name.startswith("p") else net.cast_to_unstructured_grid()).save(
        folder / name, binary=not name.endswith("a.vtk")
    )


FORMATS = ("p.vtp", "p.vtk", "p-a.vtk", "u.vtu", "u.vtk")
VTK = some([(name, polylines) for name in FORMATS for polylines in (False, True)], 3)


@pytest.mark.parametrize("name, polylines", VTK)
def test_vtk(tmp_path, name, polylines):
    """Polygonal data, texts and polylines, of which each piece has its share of natural length by distance."""
    saved(tmp_path, name, polylines)
    if name == "p-a.vtk":
        assert (tmp_path / name).read_text().startswith("# vtk DataFile Version 5.1")
    web = File(path=name).web(tmp_path)
    np.testing.assert_allclose(web.points, POINTS, rtol=1e-7 if name.endswith("a.vtk") else 0)  # of ten digits in text
    second = np.sqrt(1.25)
    length = [3.0 / (1.0 + second), 3.0 * second / (1.0 + second), 3.5] if polylines else [1.5, 2.5, 3.5]
    np.testing.assert_allclose(web.natural_length, length, rtol=1e-14)
    assert web.lines.tolist() == [[0, 1], [1, 2], [2, 3]] and web.rim.tolist() == [0, 3]
    assert web.find_lines("long").tolist() == [0, 1] and web.find_lines("short").tolist() == [2]


@pytest.mark.slow
def test_solids_and_damaged_files_of_vtk(tmp_path, capfd):
    pyvista = pytest.importorskip("pyvista")
    pyvista.Box().triangulate().delaunay_3d().save(tmp_path / "ball.vtu")
    with pytest.raises(InputError, match=r"it holds \d+ tetra cells: .* Extract Edges"):
        File(path="ball.vtu").web(tmp_path)
    pyvista.Sphere().save(tmp_path / "ball.vtp")
    whole = (tmp_path / "ball.vtp").read_bytes()
    for part in (whole[:400], b"", b"<VTKFile>", whole[:300] + bytes(range(256))):
        (tmp_path / "ball.vtp").write_bytes(part)
        with pytest.raises(InputError, match='path = "ball.vtp": ') as error:
            File(path="ball.vtp").web(tmp_path)
        assert str(error.value).isprintable()
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("order", [1, 2])
def test_a_frame_is_its_web_again(tmp_path, capsys, order):
    """At the command line: the web of a frame has the same positions, supports, groups and equilibrium."""
    scene = """
[web]
{web}
[cable]
law = "tension-only"
modulus = 1e6
area = 1e-4
density = 100.0
{more}
[cable.groups.anchors]
area = 2e-4
[gravity]
acceleration = [0, 0, -9.81]
[[observe]]
name = "sag"
quantity = "displacement"
node = "centre"
[solve]
kind = "static"
"""
    window = 'kind = "window"\nmesh = "square"\nrows = 3\ncolumns = 4\nside = 0.2'
    first, again = tmp_path / "first.toml", tmp_path / "again.toml"
    first.write_text(scene.format(web=window, more=f"prestrain = 0.01\norder = {order}"))
    again.write_text(scene.format(web='kind = "file"\npath = "out/frames/web_000000.vtu"', more=f"order = {order}"))
    assert main(["run", str(first), "--out", str(tmp_path / "out")]) == 0
    web, given = refweb.Scene.load(again).build().net.web, refweb.Scene.load(first).build().net.web
    np.testing.assert_allclose(web.points, given.points, atol=1e-15)
    np.testing.assert_array_equal(web.lines, given.lines)
    np.testing.assert_array_equal(web.rim, given.rim)
    np.testing.assert_allclose(web.natural_length, given.natural_length / 1.01, rtol=1e-14)
    results = [refweb.run(refweb.Scene.load(path)).results["sag"] for path in (first, again)]
    assert abs(results[0].value - results[1].value) <= results[0].error + results[1].error


# CSV


def csv(folder, points, lines):
    (folder / "points.csv").write_text(points, encoding="utf-8-sig")
    (folder / "lines.csv").write_text(lines, encoding="utf-8")
    return File(path="points.csv", lines="lines.csv").web(folder)


NODES = "x,y,z,name,support\n0,0,0,,1\n1,0,0,tip,\n1, 1, 0.5,tip,0\n0,1,0,,1\n"


def test_csv(tmp_path):
    web = csv(tmp_path, NODES, "i,j,natural_length,group\n0,1,1.5,edge\n\n1,2,2.5,\n2,3,3.5,edge\n")
    np.testing.assert_array_equal(web.points, [[0, 0, 0], [1, 0, 0], [1, 1, 0.5], [0, 1, 0]])
    assert web.lines.tolist() == [[0, 1], [1, 2], [2, 3]] and web.natural_length.tolist() == [1.5, 2.5, 3.5]
    assert web.rim.tolist() == [0, 3] and web.find("tip").tolist() == [1, 2]
    assert web.find_lines("edge").tolist() == [0, 2] and web.length_given
    plain = csv(tmp_path, "z,y,x\n0,0,0\n0,0,2\n", "j,i\n1,0\n")
    assert plain.points.tolist() == [[0, 0, 0], [2, 0, 0]] and plain.natural_length.tolist() == [2.0]
    scene = refweb.Scene(
        web=File(path="points.csv", lines="lines.csv"),
        cable=refweb.Cable(modulus=1.0, area=1.0, density=1.0),
        solve=refweb.Static(),
        folder=tmp_path,
    )
    written = scene.to_dict()["web"]
    assert written["path"] == str(tmp_path / "points.csv") and written["lines"] == str(tmp_path / "lines.csv")


@pytest.mark.parametrize(
    ("points", "lines", "message"),
    [
        (NODES, "i,j\n0,1\n1,9\n", "lines.csv, line 3: nodes [1, 9] must be 0 … 3, counted from 0"),
        (NODES, "i,j\n0,one\n", 'lines.csv, line 2: j = "one" must be a whole number'),
        (NODES, "i,k\n0,1\n", 'lines.csv: column "k" is unknown, known: i, j, natural_length, group'),
        (NODES, "i\n0\n", 'lines.csv: column j is missing, the first row has "i"'),
        (NODES, "i,j\n0,1,2\n", "lines.csv, line 2 has 3 cells, the first row 2"),
        (NODES, "i,j\n", "lines.csv has no rows below its first"),
        ("x;y;z\n0;0;0\n", "i,j\n0,1\n", 'points.csv: column "x;y;z" is unknown'),
        ("x,y,z\n0,0,\n1,0,0\n", "i,j\n0,1\n", 'points.csv, line 2: z = "" must be a number'),
        ("x,y,z\n0,0,0\n2_0,0,0\n", "i,j\n0,1\n", 'points.csv, line 3: x = "2_0" must be a number'),
        ("", "i,j\n0,1\n", "points.csv: column x is missing"),
    ],
)
def test_csv_refuses(tmp_path, points, lines, message):
    with pytest.raises(InputError, match=re.escape(message)):
        csv(tmp_path, points, lines)


def test_what_a_file_has_twice_or_unjoined_is_told(tmp_path, capsys):
    """A line that is there twice, and two nodes at one place; neither where a line of some length joins the two."""
    csv(tmp_path, "x,y,z\n0,0,0\n1,0,0\n1,0,0\n2,0,0\n", "i,j\n0,1\n1,0\n2,3\n")
    text = '[web]\nkind = "file"\npath = "points.csv"\nlines = "lines.csv"\n[supports]\nnodes = "all"\n'
    text += '[cable]\nmodulus = 1e6\narea = 1e-4\ndensity = 1\n[solve]\nkind = "static"\n'
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    assert main(["check", str(tmp_path / "scene.toml")]) == 0
    out = capsys.readouterr().out
    assert "warning: 1 lines join two nodes that another line joins, 0 and 1 among them" in out
    assert "warning: 1 pairs of nodes are at one place and no line joins them, 1 and 2 among them" in out
    joined = csv(tmp_path, "x,y,z\n0,0,0\n1,0,0\n1,0,0\n", "i,j,natural_length\n0,1,1\n1,2,0.5\n")
    assert list(remarks(joined)) == []


def test_csv_is_two_files(tmp_path):
    for given, message in (
        (dict(path="points.csv"), "lines is missing beside"),
        (dict(path="net.vtu", lines="lines.csv"), "lines = .* has no meaning with"),
    ):
        with pytest.raises(InputError, match=message):
            File(**given).web(tmp_path)
