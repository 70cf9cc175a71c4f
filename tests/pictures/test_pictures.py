"""Pictures of small result folders, by OpenGL where there is some and by matplotlib alone; their refusals; films."""

import subprocess
import sys

import meshio
import numpy as np
import pytest
from PIL import Image

import refweb
from refweb.errors import InputError
from refweb.pictures import film as films
from refweb.pictures import pictures
from refweb.pictures import render as drawing
from refweb.pictures.camera import View
from refweb.pictures.frames import read
from refweb.pictures.record import of_folder, of_solution
from refweb.pictures.stage import Look, Seen, Stage, limits_of, scaled_unit

OCTAHEDRON = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=float)
FACES = np.array([[i, j, k] for i in (0, 1) for j in (2, 3) for k in (4, 5)])


def tent(n=7, height=0.2):
    """A square net of side 2 m drawn up at its centre: points, undeformed points [m], lines."""
    x, y = (a.ravel() for a in np.meshgrid(*2 * [np.linspace(-1, 1, n)]))
    flat = np.stack([x, y, 0 * x], axis=1)
    number = np.arange(n * n).reshape(n, n)
    pairs = [(number[:, :-1], number[:, 1:]), (number[:-1], number[1:])]
    lines = np.concatenate([np.stack([a.ravel(), b.ravel()], axis=1) for a, b in pairs])
    return flat + height * np.outer(1 - np.maximum(abs(x), abs(y)), [0, 0, 1]), flat, lines


def catenary():
    """A cable of span 4 m that was straight: points, undeformed points [m], lines."""
    x = np.linspace(-2, 2, 17)
    line = np.stack([x, 0 * x, 0 * x], axis=1)
    return line + np.outer(2 * np.cosh(x / 2) - 2 * np.cosh(1), [0, 0, 1]), line, np.stack([range(16), range(1, 17)], 1)


def write(folder, frames, ball=False):
    """A result folder; ``frames`` are (number, time, (points, undeformed points, lines))."""
    (folder / "frames").mkdir(parents=True)
    rows = []
    for number, time, (points, flat, lines) in frames:
        middle = np.linalg.norm(points[lines].mean(axis=1)[:, :2], axis=1)
        slack = (middle > 0.9 * middle.max()).astype(float)
        reaction = np.where(np.arange(len(points))[:, None] == 0, 1.0, 0.0) * [0, 0, 1]
        meshes = {
            "web": meshio.Mesh(
                points,
                [("line", lines)],
                point_data={"displacement": points - flat, "reaction": reaction},
                cell_data={"tension": [3e3 - middle], "stress": [3e7 - 1e7 * middle], "slack": [slack]},
            )
        }
        if ball:
            meshes["ball"] = meshio.Mesh(0.1 * OCTAHEDRON, [("triangle", FACES)])
        for part, (name, mesh) in enumerate(meshes.items()):
            file = f"frames/{name}_{number:06d}.vtu"
            mesh.write(folder / file)
            rows.append(f'<DataSet timestep="{time}" group="" part="{part}" file="{file}"/>')
    pvd = f'<VTKFile type="Collection" version="0.1"><Collection>{"".join(rows)}</Collection></VTKFile>'
    (folder / "web.pvd").write_text(pvd)
    (folder / "run.json").write_text('{"status": "solved", "scene": "A tent"}')
    return folder


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    frames = [(10 * i, 0.1 * i, tent(height=0.1 * i)) for i in range(3)]
    return write(tmp_path_factory.mktemp("film") / "tent", frames, ball=True)


@pytest.fixture(autouse=True)
def small(monkeypatch):
    monkeypatch.setattr(pictures, "SIZE", (800, 500))
    monkeypatch.setattr(films, "SIZE", (400, 250))


@pytest.fixture
def no_opengl(monkeypatch):
    monkeypatch.setattr(drawing, "windows", lambda: [])


def colours(path):
    """Number of distinct colours of a picture, and the share of it that is not white."""
    image = np.asarray(Image.open(path).convert("RGB"))
    return len(np.unique(image.reshape(-1, 3), axis=0)), np.mean(np.any(image != 255, axis=2))


def drawn(folder, out=None, **options):
    """The path of a picture of a folder."""
    out = folder / "web.png" if out is None else out
    pictures.picture(folder, out=out, **options)
    return out


def staged(frame, field="stress"):
    return Stage.of(Seen.of(frame, field), Look(field, (0.0, 1.0)), 1.6)


def test_picture(film, monkeypatch):
    monkeypatch.undo()
    out = drawn(film)
    assert Image.open(out).size == (1600, 1000)
    count, share = colours(out)
    assert count > 500 and share > 0.02


def test_both_ways_of_drawing_show_the_same(film, monkeypatch, tmp_path):
    images, found = drawing.images, []
    monkeypatch.setattr(drawing, "images", lambda *job: found.append(images(*job)) or found[-1])
    solid = drawn(film, out=tmp_path / "solid.png")
    if found[0] is None:
        pytest.skip("no OpenGL here")
    monkeypatch.setattr(drawing, "windows", lambda: [])
    flat = drawn(film, out=tmp_path / "flat.png")
    a, b = (np.asarray(Image.open(path).convert("L")) < 250 for path in (solid, flat))
    assert np.sum(a & b) > 0.85 * np.sum(a | b)
    assert np.any(a != b)


def test_a_window_that_kills_the_child_is_survived(film, monkeypatch, tmp_path, capfd):
    monkeypatch.setattr(drawing, "windows", lambda: [("vtkEGLRenderWindow", False)])
    code = "import os; os.write(2, b'bad X server'); os.kill(os.getpid(), 11)"
    run = subprocess.run
    monkeypatch.setattr(drawing.subprocess, "run", lambda c, **options: run([c[0], "-c", code], **options))
    assert colours(drawn(film, out=tmp_path / "web.png"))[0] > 500
    assert capfd.readouterr().err == ""


def test_cable_is_seen_along_the_normal_of_its_plane(no_opengl, tmp_path):
    out = drawn(write(tmp_path / "cable", [(0, 0.0, catenary())]), out=tmp_path / "cable.png")
    assert colours(out)[0] > 100
    frame = read(tmp_path / "cable", 0)
    stage = staged(frame)
    assert len(stage.views) == 1
    assert np.abs(stage.views[0].axes - [[1, 0, 0], [0, 0, 1], [0, -1, 0]]).max() < 1e-12


def test_flat_web_is_seen_obliquely(tmp_path):
    frame = read(write(tmp_path / "flat", [(0, 0.0, tent(height=0.0))]), 0)
    stage = staged(frame)
    assert [view.perspective for view in stage.views] == [True, False]


@pytest.mark.parametrize("tangent", [None, 0.2])
def test_view_fits_its_points(tangent):
    points = np.random.default_rng(1).normal(size=(50, 3))
    axes = np.linalg.qr(points[:3])[0]
    view = View.fit(axes * np.linalg.det(axes), points, 1.5, tangent, margin=1.0)
    flat = (view.project(points)[0] - view.offset) / view.half
    assert np.abs(flat).max() == pytest.approx(1.0, abs=1e-12)
    place = view.point(0.3, -0.4, -2.0)
    assert (view.project(place)[0] - view.offset) / view.half == pytest.approx([0.3, -0.4])


def test_higher_order_elements_are_curves(tmp_path):
    nodes = np.array([[0, 0, 0], [1, 0, 0], [0.5, 0, -0.25]])
    folder = write(tmp_path / "arc", [(0, 0.0, catenary())])
    meshio.Mesh(nodes, [("line3", [[0, 1, 2]])], cell_data={"tension": [[1.0]]}).write(folder / "frames/web_000000.vtu")
    path = read(folder, 0).paths[0]
    assert path[:, 2] == pytest.approx(path[:, 0] * (path[:, 0] - 1), abs=1e-15)


@pytest.mark.parametrize("order", [2, 3])
def test_curved_elements_of_a_run_are_drawn(no_opengl, tmp_path, order):
    """A cable of four elements that hangs: curves are seen, beside their chords by 2 cm or more; undeformed, lines."""
    cable = refweb.Cable(law="tension-only", modulus=1e6, area=1e-4, density=1e4, order=order, subdivide=2)
    web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0], [2, 0, 0]], lines=[[0, 1], [1, 2]], natural_length=1.2)
    gravity = refweb.Gravity(acceleration=(0.0, 0.0, -9.81))
    scene = refweb.Scene(web=web, cable=cable, effects=[gravity], supports=refweb.Supports(nodes=[0, 2]))
    refweb.run(scene, out=tmp_path / "cable")
    assert colours(drawn(tmp_path / "cable"))[0] > 100
    frame = read(tmp_path / "cable", 0)
    assert frame.paths.shape == frame.origin.shape == (4, 9, 3) and frame.tree
    assert not frame.origin[:, :, 1:].any() and np.abs(np.diff(frame.origin, 2, axis=1)).max() < 1e-13
    chord = np.linspace(frame.paths[:, 0], frame.paths[:, -1], 9, axis=1)
    assert np.linalg.norm(frame.paths - chord, axis=2).max() > 0.02


def test_a_frame_in_memory_is_that_of_its_folder(tmp_path):
    """To the last bit: curved elements, a body, supports, all that is known of lines and nodes; and so is its page."""
    scene = refweb.Scene(
        title="In memory",
        web=refweb.Window(mesh="square", rows=2, columns=2, side=0.5),
        cable=refweb.Cable(law="tension-only", modulus=1e6, area=1e-4, density=1e3, order=3),
        effects=[
            refweb.Gravity(acceleration=(0, 0, -9.81)),
            refweb.Body(name="ball", radius=0.2, position=(0, 0, -0.15), fixed=True),
            refweb.Contact(stiffness=1e3),
        ],
    )
    solution = refweb.run(scene)
    solution.save(tmp_path / "out")
    number = solution.frames[-1][0]
    here, there = of_solution(solution).frame(number), read(tmp_path / "out", number)
    assert here.fields.keys() == there.fields.keys() and here.bodies.keys() == there.bodies.keys() == {"ball"}
    assert (here.number, here.time, here.tree) == (there.number, there.time, there.tree)
    pairs = [(getattr(here, name), getattr(there, name)) for name in ("paths", "origin", "slack", "supports", "lifted")]
    pairs += [(here.fields[name], there.fields[name]) for name in here.fields]
    for a, b in [*pairs, *zip(here.bodies["ball"], there.bodies["ball"], strict=True)]:
        np.testing.assert_array_equal(a, b)
    assert solution.picture()._repr_png_() == drawn(tmp_path / "out").read_bytes()


def test_slack_lines_are_grey_and_no_part_of_the_range(film):
    frame = read(film, 20)
    stage = staged(frame)
    assert frame.slack.any() and not frame.slack.all()
    assert limits_of(of_folder(film), "stress", [20])[0] == frame.fields["stress"][~frame.slack].min()
    assert len(stage.model(frame)[1].paths) == frame.slack.sum()


@pytest.mark.parametrize(
    "field, largest, expected",
    [
        ("stress", 6.3e7, (1e-6, "MPa")),
        ("tension", 20.0, (1.0, "N")),
        ("mass", 2e-4, (1e6, "mg")),
        ("displacement", 0.03, (1e3, "mm")),
        ("strain", 2e-3, (100.0, "%")),
        ("other", 5.0, (1.0, "")),
    ],
)
def test_units(field, largest, expected):
    factor, unit = scaled_unit(field, largest)
    assert (pytest.approx(factor), unit) == expected


def test_refusals(film, tmp_path):
    for options, words in (
        ({"field": "stres"}, ('field = "stres"', '"stress"')),
        ({"frame": 12}, ("frame = 12", "nearest is 10", "last 20")),
        ({"out": film / "web.pgn"}, ('"pgn"', '"png"')),
        ({"out": film / "none" / "web.png"}, ("no folder",)),
    ):
        with pytest.raises(InputError) as error:
            pictures.picture(film, **options)
        assert all(word in str(error.value) for word in words) and "\n" not in str(error.value)
    with pytest.raises(InputError, match="not a result folder"):
        drawn(tmp_path)
    with pytest.raises(InputError, match='unknown format "png"'):
        films.animate(film, out=film / "web.png")


def test_field_of_points(film, no_opengl, tmp_path):
    assert colours(drawn(film, frame=10, field="displacement", out=tmp_path / "web.png"))[0] > 500


def test_film_has_all_frames(film):
    out = films.animate(film, out=film / "web.gif")
    with Image.open(out) as gif:
        assert gif.n_frames == 3
        assert gif.size == films.SIZE


def test_import_stays_light():
    code = "import sys, refweb.pictures.film; print(*({'pyvista', 'vtkmodules', 'matplotlib'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == ""
