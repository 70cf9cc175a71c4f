"""Pictures of small result folders, by OpenGL where there is some and by matplotlib alone; their refusals; films."""

import os
import re
import subprocess
import sys

import imageio.v3
import meshio
import numpy as np
import pytest
from PIL import Image

import refweb
from refweb.__main__ import main
from refweb.errors import InputError
from refweb.pictures import film as films
from refweb.pictures import movie_writer, opengl, pictures
from refweb.pictures import render as drawing
from refweb.pictures.camera import View, choose
from refweb.pictures.frames import read
from refweb.pictures.record import of_folder, of_solution
from refweb.pictures.stage import SLACK, TWO, Look, Seen, Stage, colour_map, limits_of, scaled_unit
from refweb.results.units import readable

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
    return len(np.unique(image @ [1, 256, 65536])), np.mean(np.any(image != 255, axis=2))


def drawn(folder, out=None, **options):
    """The path of a picture of a folder."""
    out = folder / "web.png" if out is None else out
    pictures.picture(folder, out=out, **options)
    return out


def staged(frame, field="stress"):
    return Stage.of(Seen.of(frame, field), Look(field, (0.0, 1.0)), 1.6)


def test_picture(film, monkeypatch, no_opengl):
    monkeypatch.setattr(pictures, "SIZE", (1600, 1000))
    out = drawn(film)
    assert Image.open(out).size == (1600, 1000)
    count, share = colours(out)
    assert count > 500 and share > 0.02


@pytest.mark.slow
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


def broken_window(*job):
    """What the child process of a broken OpenGL does."""
    os.write(2, b"bad X server")
    os.kill(os.getpid(), 11)


@pytest.mark.slow
def test_a_window_that_kills_the_child_is_survived(film, monkeypatch, tmp_path, capfd):
    monkeypatch.setattr(opengl, "open_off_screen", broken_window)
    assert colours(drawn(film, out=tmp_path / "web.png"))[0] > 500
    assert "Error" not in capfd.readouterr().err


@pytest.mark.slow
def test_one_renderer_is_kept_for_a_film(film, monkeypatch, tmp_path):
    """One child for all frames, which is gone at the end; its images are those of a child of their own."""
    children, start = [], drawing.Renderer.start_child

    def kept(self, *kind):
        children.append(start(self, *kind))
        return children[-1]

    monkeypatch.setattr(drawing.Renderer, "start_child", kept)
    first = drawing.windows()[:1]
    monkeypatch.setattr(drawing, "windows", lambda: list(first))
    films.animate(film, tmp_path / "web.gif")
    assert len(children) == 1 and not children[0]._processes
    record = of_folder(film)
    stage = staged(record.frame(10))
    models = [stage.model(record.frame(number)) for number in record.times]
    together = drawing.images(models, stage.views, [(300, 200), (300, 100)])
    if together is None:
        pytest.skip("no OpenGL here")
    (alone,) = drawing.images(models[1:2], stage.views, [(300, 200), (300, 100)])
    for a, b in zip(together[1], alone, strict=True):
        np.testing.assert_array_equal(a, b)


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


@pytest.mark.ordinary("3")
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


@pytest.mark.slow
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
    tubes = stage.model(frame)[0]
    grey = (tubes.colours == SLACK).all(axis=1)
    assert (grey == frame.slack).all() and (tubes.radius[grey] < tubes.radius[~grey].min()).all()


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


def words(page):
    """All that is written on a page, and in its legend."""
    entries = [text.get_text() for legend in page.legends for text in legend.get_texts()]
    return [text.get_text() for text in page.texts], entries


@pytest.fixture(scope="module")
def hit():
    """A net hit by a ball, in memory; the deflection is largest before the end."""
    return refweb.run(
        refweb.Scene(
            title="Net hit by a ball",
            web=refweb.Window(mesh="square", rows=4, columns=4, side=0.25),
            cable=refweb.Cable(law="tension-only", modulus=7e6, area=1e-5, density=1000.0),
            effects=[
                refweb.Body(name="ball", radius=0.2, mass=0.2, position=(0.02, 0.03, -0.21), velocity=(0, 0, 3)),
                refweb.Contact(stiffness=1e4),
            ],
            solve=refweb.Dynamic(duration=0.18),
            output=refweb.Output(interval=2e-3, frames=5),
            observe=[refweb.Observe(name="deflection", quantity="displacement", reduce="max")],
        )
    )


def test_the_frame_of_the_largest_value_is_shown(hit, no_opengl):
    """Of the first observable; the heading says when."""
    record, largest = of_solution(hit), hit.results["deflection"].time
    number = record.chosen()
    assert largest < 0.8 * hit.state.time and number != max(record.times)
    assert abs(record.times[number] - largest) == min(abs(time - largest) for time in record.times.values())
    assert f"t = {record.times[number]:.6g} s" in words(hit.picture())[0]
    assert record.chosen(time=0.031) == 15 and record.chosen(time=1e9) == max(record.times) == record.chosen(-1)


def test_the_step_of_the_largest_value_is_shown():
    """Of a sag that springs push back, which is largest at the step in the middle."""
    cable = refweb.Cable(law="tension-only", modulus=1e6, area=1e-4, density=1e4)
    web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0], [2, 0, 0]], lines=[[0, 1], [1, 2]], supports=[0, 2])
    scene = refweb.Scene(
        web=web,
        cable=cable,
        effects=[refweb.Load(node=1, force=(0, 0, -5))],
        solve=refweb.Static(load_steps=[1.0, 3.0, 2.0]),
        observe=[refweb.Observe(name="sag", quantity="displacement", reduce="max")],
    )
    record = of_solution(refweb.run(scene))
    assert record.times[record.chosen()] == 3.0 and record.clock(record.chosen()) == "step 3"


def test_one_range_for_all_frames_of_a_run(film, hit, no_opengl, tmp_path):
    """That of all their values, from single arrays of files as from whole frames; and others that are asked for."""
    for record in (of_folder(film), of_solution(hit)):
        values = [record.frame(number) for number in record.times]
        taut = np.concatenate([frame.fields["stress"][~frame.slack] for frame in values])
        least = taut.min() if taut.min() > 0.5 * taut.max() else 0.0
        for frame in values:
            assert pictures.look_of(record, frame, None, None, 1.0, None).limits == (least, taut.max())
            auto = pictures.look_of(record, frame, None, "auto", 1.0, None).limits
            assert auto == limits_of(record, "stress", [frame.number])
        assert pictures.look_of(record, values[0], None, (1, 2e3), 1.0, None).limits == (1.0, 2e3)


@pytest.mark.slow
def test_a_range_that_is_left_is_seen_at_the_bar(hit, no_opengl):
    """As a tip of the colour bar at the end that values leave."""
    frame = of_solution(hit).frame(of_solution(hit).chosen())
    taut = frame.fields["stress"][~frame.slack]
    a, b = taut.min() + 0.3 * np.ptp(taut), taut.min() + 0.6 * np.ptp(taut)
    for limits, beyond in ((None, "neither"), ((a, 1e9), "min"), ((0.0, b), "max"), ((a, b), "both")):
        (bar,) = [axes._colorbar for axes in hit.picture(range=limits).axes if hasattr(axes, "_colorbar")]
        assert bar.extend == beyond


def test_displacements_times_a_factor(hit, no_opengl):
    """Lines, supports and bodies alike, about where they were; the page says so."""
    frame = of_solution(hit).frame(30)
    large = frame.posed(4.0)
    assert frame.posed(1.0) is frame
    np.testing.assert_allclose(large.paths - frame.origin, 4.0 * (frame.paths - frame.origin), atol=1e-15)
    before = np.array([0.02, 0.03, -0.21])
    middles = [one.bodies["ball"].points.mean(axis=0) - before for one in (frame, large)]
    np.testing.assert_allclose(middles[1], 4.0 * middles[0], atol=1e-12)
    np.testing.assert_array_equal(large.supports, frame.supports)
    assert any("displacements × 4" in text for text in words(hit.picture(scale=4))[0])
    assert not any("×" in text for text in words(hit.picture())[0])


@pytest.mark.parametrize("tall", [0.3, 1.0, 4.0])
def test_the_web_is_as_wide_from_the_side(tall):
    """As in the view beside it or above it, whatever its shape; all of it is within both."""
    points, flat, _ = tent(height=tall)
    for aspect in (1.6, 1.0):
        views, rectangles = choose(flat, points, np.zeros((0, 3)), tall, False, aspect)
        widths = [view.share(points) * rectangle[2] for view, rectangle in zip(views, rectangles, strict=True)]
        assert widths[1] == pytest.approx(widths[0], rel=0.02)
        for view in views:
            assert np.abs((view.project(points)[0] - view.offset) / view.half).max() < 1.0
        (a, b, w, h), (c, d, _, k) = rectangles
        assert b >= d + k or a + w <= c, "they do not overlap"


def test_views_by_name_and_direction(film):
    frame = read(film, 20)
    seen = Seen.of(frame, "stress")
    towards = {"side": (0, -1, 0), "front": (1, 0, 0), "top": (0, 0, 1)}
    for name, direction in towards.items():
        for view in (name, 3.0 * np.array(direction)):
            (found,) = Stage.of(seen, Look("stress", (0.0, 1.0), 1.0, view), 1.6).views
            assert found.axes[2] == pytest.approx(direction) and not found.perspective
            assert (
                np.linalg.det(found.axes) == pytest.approx(1.0) and (found.axes @ found.axes.T).round(12).trace() == 3
            )
    (oblique,) = Stage.of(seen, Look("stress", (0.0, 1.0), 1.0, "oblique"), 1.6).views
    assert oblique.perspective


def test_the_undeformed_web_covers_nothing_from_above(film, no_opengl):
    """From above it lies on the web, whose colours are to be seen; in the view from the side it is on top."""
    from matplotlib.collections import LineCollection, PolyCollection

    for view, below in (("top", True), (None, False)):
        axes = pictures.picture(film, frame=20, view=view).axes[0 if view else 1]
        (lines,) = [one for one in axes.collections if isinstance(one, LineCollection)]
        (web,) = [one for one in axes.collections if isinstance(one, PolyCollection)]
        assert (lines.get_zorder() < web.get_zorder()) == below
    image = np.array([[[255, 255, 255], [255, 255, 254]]], dtype=np.uint8)
    assert pictures.with_clear_white(image)[0, :, 3].tolist() == [0, 255]


def test_slack_has_two_colours(film, no_opengl):
    frame, page = read(film, 20), pictures.picture(film, field="slack", frame=20)
    tubes = staged(frame, "slack").model(frame)[0]
    assert (tubes.colours[frame.slack] == TWO["slack"]).all() and (tubes.colours[~frame.slack] == TWO["taut"]).all()
    assert words(page)[1][:2] == ["taut", "slack"] and not any(hasattr(axes, "_colorbar") for axes in page.axes)


def test_the_legend_names_what_is_drawn(film, no_opengl):
    """The undeformed web only where a view has it and it has moved, a body and supports only where they are seen."""
    assert words(pictures.picture(film, frame=20))[1] == ["slack", "support", "undeformed", "ball"]
    assert "undeformed" not in words(pictures.picture(film, frame=20, view="oblique"))[1]
    assert "undeformed" not in words(pictures.picture(film, frame=0))[1]
    frame = read(film, 20)
    far = frame.bodies["ball"]._replace(points=frame.bodies["ball"].points + 50.0)
    stage = staged(frame._replace(bodies={"ball": far}, supports=frame.supports[:0]))
    page = pictures.blank_page(stage, "", (800, 500))
    assert words(page)[1] == ["slack", "undeformed"]


@pytest.fixture(scope="module")
def modes():
    return refweb.modes("catenary", 2)


@pytest.mark.slow
def test_a_mode_says_its_frequency(modes, no_opengl, tmp_path):
    """With ± and unit; a folder of modes is drawn as they are in memory."""
    found = modes.results["frequency_2"]
    texts = words(modes.picture(frame=2))[0]
    assert f"mode 2, {readable(found.value, found.error, 'Hz')}" in texts and "Hz" in "".join(texts)
    assert of_solution(modes).chosen() == 1
    modes.save(tmp_path / "modes")
    assert modes.picture()._repr_png_() == pictures.picture(tmp_path / "modes")._repr_png_()


def test_a_mode_swings_about_the_equilibrium(modes):
    """A whole period; half a period on, it is as far on the other side. It is seen, and it is where a folder has it."""
    record = of_solution(modes)
    frame, poses = record.frame(1), films.poses_of(record, None, None)
    rest = frame.posed(phase=0.0).paths
    nodes = modes.state.position[modes.state.system.net.cells]
    assert np.abs(rest[:, [0, -1]] - nodes[:, :2]).max() < 1e-12
    assert poses[0].phase == 1.0 and frame.posed(phase=1.0).paths == pytest.approx(frame.paths, abs=1e-15)
    half = len(poses) // 2
    for k, pose in enumerate(poses):
        mirrored = frame.posed(phase=poses[(k + half) % len(poses)].phase).paths
        np.testing.assert_allclose(frame.posed(phase=pose.phase).paths - rest, rest - mirrored, atol=1e-12)
    assert poses[-1].phase == pytest.approx(poses[1].phase), "it loops"
    size = np.linalg.norm(np.ptp(rest.reshape(-1, 3), axis=0))
    assert np.linalg.norm(frame.paths - rest, axis=2).max() > 0.04 * size
    assert np.abs(frame.posed(3.0).paths - rest).max() == pytest.approx(3.0 * np.abs(frame.swing).max())


@pytest.mark.slow
def test_a_film_of_a_mode(modes, no_opengl, monkeypatch, tmp_path):
    monkeypatch.setattr(films, "PHASES", 8)
    with Image.open(films.animate(modes, tmp_path / "mode.gif", frame=2)) as gif:
        images = [gif.seek(k) or np.asarray(gif.convert("L"), dtype=float) for k in range(gif.n_frames)]
    assert len(images) == 8
    for k in range(1, 4):
        np.testing.assert_array_equal(images[k], images[8 - k])
    assert np.any(images[0] != images[4])


def test_refusals(film, modes, tmp_path):
    for options, said in (
        ({"field": "stres"}, ('field = "stres"', '"stress"')),
        ({"frame": 12}, ("frame = 12", "nearest is 10", "last 20")),
        ({"frame": 10, "time": 0.1}, ("frame = 10 and time = 0.1", "leave one out")),
        ({"time": np.nan}, ("time = nan", "finite")),
        ({"scale": 0.0}, ("scale = 0.0", "> 0")),
        ({"range": (2, 1)}, ("range = 2 1", "low must be less")),
        ({"range": "aut"}, ('range = "aut"', '"auto"')),
        ({"range": (1, 2, 3)}, ("range", "two numbers")),
        ({"range": (0, 1), "field": "slack"}, ("two colours", "leave it out")),
        ({"view": "sidee"}, ('view = "sidee"', '"side"')),
        ({"view": (0, 0, 0)}, ("view = [0, 0, 0]", "oblique", "not all 0")),
        ({"view": (1, 0)}, ("view = [1, 0]", "three numbers")),
        ({"out": film / "web.pgn"}, ('"pgn"', '"png"')),
        ({"out": film / "none" / "web.png"}, ("no folder",)),
    ):
        with pytest.raises(InputError) as error:
            pictures.picture(film, **options)
        assert all(word in str(error.value) for word in said) and "\n" not in str(error.value)
    with pytest.raises(InputError, match="not a result folder"):
        pictures.picture(tmp_path)
    for options, said in (
        ({"out": film / "web.png"}, 'unknown format "png"'),
        ({"out": film / "web.gif", "fps": 60}, "fps = 60"),
        ({"out": film / "web.gif", "frame": 10}, "frame = 10: a film has all frames"),
        ({"out": film / "web.gif", "time": 0.1}, "time = 0.1: a film has all frames"),
    ):
        with pytest.raises(InputError, match=said):
            films.animate(film, **options)
    with pytest.raises(InputError, match="frame = 7: there is no such frame, the nearest is 2"):
        films.animate(modes, tmp_path / "mode.gif", frame=7)
    assert not list(tmp_path.iterdir())


def test_field_of_points(film, no_opengl, tmp_path):
    assert colours(drawn(film, frame=10, field="displacement", out=tmp_path / "web.png"))[0] > 500


def test_film_has_all_frames(film):
    """At a time each, in one palette; what is kept from image to image is white where nothing is drawn."""
    out = films.animate(film, film / "web.gif")
    assert out == film / "web.gif"
    with Image.open(out) as gif:
        assert gif.n_frames == 3 and gif.info["loop"] == 0
        assert gif.size == films.SIZE
        images, waits = [], []
        for k in range(3):
            gif.seek(k)
            waits.append(gif.info["duration"])
            images.append(np.asarray(gif.convert("RGB")))
    assert waits == [100, 100, 1000]
    assert all(image[-1, 0].tolist() == [255, 255, 255] for image in images) and (images[0] != images[2]).any()


@pytest.mark.slow
def test_a_film_by_polygons_shows_the_same(film, monkeypatch, tmp_path):
    """As by OpenGL, where there is some; and its images are those that stand on pictures."""
    films.animate(film, tmp_path / "a.gif")
    monkeypatch.setattr(drawing, "windows", lambda: [])
    films.animate(film, tmp_path / "b.gif")
    with Image.open(tmp_path / "a.gif") as a, Image.open(tmp_path / "b.gif") as b:
        for k in range(3):
            a.seek(k), b.seek(k)
            here, there = (np.asarray(gif.convert("L")) < 235 for gif in (a, b))
            assert np.sum(here & there) > 0.75 * np.sum(here | there)


def test_colours_of_a_gif_are_those_of_its_images(tmp_path):
    """To a few of 255, also those of thin lines on a white page, from the last of the images to the bar."""
    bar = np.round(255 * colour_map()(np.linspace(0, 1, 64))[:, :3]).astype(int)
    images = []
    for turn in range(4):
        pixels = np.full((64, 90, 3), 255, dtype=np.uint8)
        pixels[np.arange(64), 20 + turn] = np.roll(bar, 16 * turn, axis=0)
        pixels[10:30, 40:60] = np.linspace(60, 200, 20, dtype=np.uint8)[:, None, None] * np.ones((1, 1, 3), np.uint8)
        images.append(Image.fromarray(pixels))
    movie_writer.write(tmp_path / "a.gif", iter(images), 4 * [0.1], images[:2], bar)
    with Image.open(tmp_path / "a.gif") as found:
        for k, image in enumerate(images):
            found.seek(k)
            far = np.abs(np.asarray(found.convert("RGB"), dtype=int) - np.asarray(image, dtype=int))
            assert far.max() <= 8 and (far[:, 70:] == 0).all()


def test_an_interruption_leaves_nothing(film, no_opengl, monkeypatch, tmp_path):
    def interrupted(*_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        films.animate(film, tmp_path / "web.gif", progress=lambda text, share: share > 0 and interrupted())
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_an_mp4(film, no_opengl, tmp_path):
    """All frames, and the last for a second."""
    out = films.animate(film, tmp_path / "web.mp4")
    shown = imageio.v3.imread(out, plugin="pyav")
    assert shown.shape == (12, films.SIZE[1], films.SIZE[0], 3) and list(tmp_path.iterdir()) == [out]
    films.animate(film, tmp_path / "web.gif")
    with Image.open(tmp_path / "web.gif") as gif:
        gif.seek(2)
        assert np.abs(np.asarray(gif.convert("RGB"), dtype=float) - shown[-1]).mean() < 3.0  # of 255, x264 loses some


def test_options_of_the_command(film, no_opengl, tmp_path, capsys):
    """Names, numbers with spaces or commas between them; where it is, is printed."""
    out = tmp_path / "web.png"
    asked = ["--time", "0.1", "--range", "-1e3", "2e7"] if sys.version_info >= (3, 14) else ["--range=-1e3,2e7"]
    assert main(["picture", str(film), *asked, "--scale", "2", "--view", "1", "-2", "0.5", "--out", str(out)]) == 0
    assert capsys.readouterr().out.strip() == str(out) and out.exists()
    assert main(["picture", "--view", "0", "1", "0", str(film)]) == main(["picture", "--range", "auto", str(film)]) == 0
    assert capsys.readouterr().out.splitlines() == 2 * [str(film / "web.png")]
    assert main(["picture", str(film), "--view", "sied"]) == 2 and 'did you mean "side"' in capsys.readouterr().err
    assert main(["picture", str(film), "--range", "auto", "--frame", "1", "--time", "2"]) == 2
    assert main(["picture", str(film), "--animate", "--frame", "10"]) == 2
    assert main(["picture", str(film), "--animate", "--field", "slack"]) == 0
    assert capsys.readouterr().out.strip() == str(film / "web.gif")


def test_import_stays_light():
    code = "import sys, refweb.pictures.film; print(*({'pyvista', 'vtkmodules', 'matplotlib'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == ""


def test_lines_show_the_largest_of_their_nodes(film):
    """As results do: the largest displacement of the nodes is the largest that a line shows."""
    mesh = meshio.read(film / "frames/web_000020.vtu")
    sizes = np.linalg.norm(mesh.point_data["displacement"], axis=1)
    shown = read(film, 20).fields["displacement"]
    assert shown.tolist() == sizes[mesh.cells[0].data].max(axis=1).tolist() and shown.max() == sizes.max()


def test_what_is_no_number_or_too_large_is_refused(film):
    for options, words in (
        (dict(scale=1e300), "scale = 1e+300 must be a number > 0 and ≤ 1e+06"),
        (dict(scale="big"), 'scale = "big" must be a number'),
    ):
        with pytest.raises(InputError, match=re.escape(words)):
            pictures.picture(film, **options)
    with pytest.raises(InputError, match="source = 3 must be a Solution or a result folder"):
        refweb.picture(3)
    far, near = (
        pictures.look_of(of_folder(film), read(film, 20), None, None, 1.0, (s, 0.0, 0.0)) for s in (1e200, 1.0)
    )
    assert far.view.tolist() == near.view.tolist() == [1.0, 0.0, 0.0]
