"""Solids that a surface bounds: read, checked, mended and weighed, and the field of their depth."""

import math
import re

import meshio
import numpy as np
import pytest
import solids

import refweb
from refweb import memory
from refweb.net.boundary import field as fields
from refweb.net.boundary.closed import NotClosedError, closed, moments
from refweb.net.boundary.distances import signed
from refweb.net.boundary.field import AROUND, HEAD, field_of
from refweb.net.boundary.surface_file import read
from refweb.net.shapes import filled
from refweb.net.shapes.mesh import Mesh, _solid

SIZE = np.array([0.3, 0.4, 0.2])


def mesh(path, surface, **keys):
    return Mesh(file=solids.write(path, *surface), **keys)


# Moments


def test_moments_of_a_box_and_of_a_tetrahedron():
    """Far from the origin as well: ab c (b² + c²)/12, and for the corner of a cube the closed form of its integrals."""
    points, triangles = solids.box(SIZE, 3)
    volume, centre, inertia = moments(points + [3.0, -2.0, 1.0], triangles)
    a, b, c = SIZE
    assert volume == pytest.approx(a * b * c, rel=1e-13)
    np.testing.assert_allclose(centre, [3.0, -2.0, 1.0], rtol=0, atol=1e-14)
    expected = np.diag([b * b + c * c, c * c + a * a, a * a + b * b]) * volume / 12.0
    np.testing.assert_allclose(inertia, expected, rtol=0, atol=1e-15)
    volume, centre, inertia = moments(*solids.tetrahedron(1.0))
    assert volume == pytest.approx(1.0 / 6.0, rel=1e-14)
    np.testing.assert_allclose(centre, 0.25, rtol=1e-14)
    # ∫x² = 1/60 and ∫xy = 1/120 about the corner, less V/16 of the centre.
    own, mixed = 1.0 / 60.0 - 1.0 / 96.0, 1.0 / 120.0 - 1.0 / 96.0
    np.testing.assert_allclose(inertia, 3.0 * own * np.eye(3) - (own - mixed) * np.eye(3) - mixed, rtol=0, atol=1e-16)


def test_moments_of_an_ellipsoid_converge():
    axes, errors = np.array([1.0, 2.0, 3.0]), []
    for level in (10, 20, 40):
        volume, _, inertia = moments(*solids.sphere(1.0, level, axes))
        exact = 4.0 / 3.0 * np.pi * axes.prod()
        tensor = exact / 5.0 * ((axes**2).sum() * np.eye(3) - np.diag(axes**2))
        errors.append([abs(volume / exact - 1.0), np.abs(inertia - tensor).max() / exact])
    assert np.all(np.log2(np.array(errors[:-1]) / errors[1:]) > 1.9)


# Files


def test_files_of_every_format_are_one_solid(tmp_path):
    points, triangles = solids.ell()
    stl = solids.write(tmp_path / "text.stl", points, triangles)
    meshio.write(tmp_path / "binary.stl", meshio.Mesh(points, [("triangle", triangles)]), binary=True)
    solids.write(tmp_path / "it.obj", points, triangles)
    backwards = ["v " + " ".join(map(repr, p)) for p in points.tolist()]
    backwards += ["f " + " ".join(str(i - len(points)) for i in t) for t in triangles.tolist()]
    (tmp_path / "backwards.obj").write_text("\n".join(backwards))
    quads = [[0, 1, 2, 3], [0, 3, 4, 5]]
    walls = [[i, (i + 1) % 6, 6 + (i + 1) % 6, 6 + i] for i in range(6)]
    solids.write(tmp_path / "quads.obj", points, [q[::-1] for q in quads] + [[6 + i for i in q] for q in quads] + walls)
    lines = ["# a comment", "mtllib it.mtl", "o thing", "usemtl red", "s off"]
    lines += ["v " + " ".join(map(repr, p)) + " 0.5 0.5 0.5" for p in points.tolist()]
    lines += ["vt 0 0", "vt 1 0", "vn 0 0 1", "g walls"]
    lids = [list(range(6))[::-1], list(range(6, 12))]  # whole angles, which are not convex
    forms = ["{0}/1/1", "{0}//1", "{0}/2", "{0}"]
    lines += ["f " + " ".join(forms[n % 4].format(i + 1) for i in face) for n, face in enumerate(lids + walls)]
    (tmp_path / "textured.obj").write_text("\n".join(lines) + "\nl 1 2\n")
    import pyvista

    pyvista.PolyData(points, np.column_stack([np.full(len(triangles), 3), triangles])).save(tmp_path / "it.vtp")
    expected = moments(*[getattr(closed(*read(tmp_path / "text.stl")), key) for key in ("points", "triangles")])
    legs = np.array([0.3 * 0.12 * 0.2, 0.12 * 0.18 * 0.2])
    assert expected.volume == pytest.approx(legs.sum(), rel=1e-12)
    middles = np.array([[0.15, 0.06, 0.0], [0.06, 0.21, 0.0]])
    np.testing.assert_allclose(expected.centre, legs @ middles / legs.sum(), atol=1e-12)
    for name in ("binary.stl", "it.obj", "backwards.obj", "quads.obj", "textured.obj", "it.vtp"):
        surface = closed(*read(tmp_path / name))
        assert len(surface.triangles) == 20 and not surface.turned
        found = moments(surface.points, surface.triangles)
        assert found.volume == pytest.approx(expected.volume, rel=1e-6)  # seven digits in STL
        np.testing.assert_allclose(found.inertia, expected.inertia, atol=1e-9)
    scaled = Mesh(file=stl, scale=2.0, grid=24)
    assert scaled.volume() == pytest.approx(8.0 * expected.volume, rel=1e-6)
    np.testing.assert_allclose(
        scaled.inertia(3.0), 3.0 / expected.volume * 4.0 * expected.inertia, rtol=1e-6, atol=1e-9
    )


def turned(triangles, *which):
    return np.where(np.isin(np.arange(len(triangles)), which)[:, None], triangles[:, ::-1], triangles)


def without(surface, *which):
    return surface[0], np.delete(surface[1], which, axis=0)


def joined(*surfaces):
    first = np.cumsum([0, *(len(points) for points, _ in surfaces)])
    return np.vstack([p for p, _ in surfaces]), np.vstack([t + k for (_, t), k in zip(surfaces, first, strict=False)])


def moved(surface, by, scale=1.0):
    return scale * surface[0] + by, surface[1]


BOX = solids.box(SIZE)
FAULTS = {
    "open": (without(BOX, 3), r"the surface is open: 3 edges have one triangle, such as the one from \(.*\) to \(.*\)"),
    "three at an edge": (
        joined(BOX, moved(BOX, SIZE * [1.0, 1.0, 0.0])),
        r"1 edges have more than two triangles.*with 4: part the solids",
    ),
    "crossing": (
        joined(BOX, moved(BOX, 0.5 * SIZE)),
        r"crosses itself: triangle \d+ about \(.*\) and triangle \d+ pass through each other; join",
    ),
    "few": ((BOX[0], BOX[1][:2]), "holds 2 triangles with an area: a closed surface has at least 4"),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_faults_of_a_surface_are_named(name):
    surface, message = FAULTS[name]
    with pytest.raises(NotClosedError, match=message):
        closed(*surface)


REFUSED = {
    "flat": (moved(BOX, 0.0, np.array([1.0, 1.0, 0.0])), r'has no inside.*shape = "terrain"'),
    "sheet": ((BOX[0], BOX[1][:2]), r'has no inside.*nowhere above 1/2.*shape = "terrain" with heights = FILE'),
    "large": (moved(BOX, 0.0, 1e8), r"its size is 4e\+07 m with scale = 1, it must be 1e-06 to 1e\+06 m: give scale"),
    "small": (moved(BOX, 0.0, 1e-7), "its size is 4e-08 m"),
    "not finite": ((np.where(BOX[0] > 0.19, np.inf, BOX[0]), BOX[1]), "corners must be numbers ≤ 1e\\+100|cannot read"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_bounds_no_solid_is_refused(name, tmp_path):
    surface, message = REFUSED[name]
    with pytest.raises(refweb.InputError, match=message) as error:
        _ = mesh(tmp_path / "it.obj", surface).solid
    assert str(error.value).startswith("file = ") and "\n" not in str(error.value)


FILES = {
    "it.stl": ("", r"cannot read|holds no triangles"),
    "it.obj": ("v 0 0 0\n", "holds no triangles"),
    "lines.obj": ("v 0 0 0\nv 1 0 0\nl 1 2\n", "holds no triangles"),
    "it.ply": ("ply\n", r"format \".ply\" must be one of .stl, .obj, .vtp"),
    "broken.vtp": ("<VTKFile", "VTK cannot read|holds no triangles"),
    "none.stl": (None, "there is no file"),
    "far.obj": ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "an element of point 9, must be 1 … 3"),
    "zero.obj": ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 0\n", r'zero.obj, line 4: "f 1 2 0" must name points from 1'),
    "words.obj": ("v 0 0 0\nv 1 0 zero\n", r'words.obj, line 2: "v 1 0 zero" must be v and three numbers'),
    "face.obj": ("v 0 0 0\nf 1/a b c\n", r'face.obj, line 2: "f 1/a b c" must name points from 1'),
    "bow.obj": (
        "v 0 0 0\nv 2 0 0\nv 0 1 0\nv 3 1 0\nv 1 3 0\nf 1 2 3 4 5\n",
        "the sides of a face of 5 corners cross: mend it|has no inside",
    ),
}


@pytest.mark.parametrize("name", FILES)
def test_files_without_a_surface_are_refused(name, tmp_path):
    content, message = FILES[name]
    if content is not None:
        (tmp_path / name).write_text(content)
    with pytest.raises(refweb.InputError, match=message) as error:
        _ = Mesh(file=str(tmp_path / name)).solid
    assert "\n" not in str(error.value)


def test_a_band_of_one_side_is_refused():
    """A Klein bottle: every edge has two triangles, and no flip makes them face one side."""
    here = np.arange(36).reshape(6, 6)
    wide = np.vstack([here, here[0][::-1]])
    wide = np.column_stack([wide, wide[:, 0]])
    halves = ((0, 0), (1, 0), (1, 1)), ((0, 0), (1, 1), (0, 1))
    faces = [[wide[i + a, j + b] for a, b in half] for i in range(6) for j in range(6) for half in halves]
    rng = np.random.default_rng(0)
    with pytest.raises(refweb.InputError, match="one side only|more than two|open"):
        closed(rng.random((36, 3)), np.array(faces))


def test_a_flip_is_made_and_said(tmp_path):
    inward = mesh(tmp_path / "inward.obj", (BOX[0], BOX[1][:, ::-1]), grid=12)
    assert inward.remarks() == ("12 of 12 triangles faced inward and were turned",) and inward.volume() > 0.0
    some = mesh(tmp_path / "some.obj", (BOX[0], turned(BOX[1], 0, 5, 6)), grid=12)
    assert some.remarks() == ("3 of 12 triangles faced inward and were turned",)
    hollow = mesh(tmp_path / "hollow.obj", joined(BOX, moved(BOX, 0.0, 0.5)), grid=64)
    assert hollow.volume() == pytest.approx(7.0 / 8.0 * SIZE.prod())
    assert hollow.remarks() == ("12 of 24 triangles faced inward and were turned",)
    deep, _ = hollow.solid.field.at(np.array([[0.0, 0.0, 0.0], [0.0, 0.15, 0.0]]))
    assert deep[0] < -0.04 and deep[1] > 0.02


def test_triangles_without_area_do_no_harm():
    """Two corners that are one drop out; a corner on the edge of a neighbour stays, and changes no digit of depth."""
    points, triangles = solids.box(SIZE)
    p = np.vstack([points, 0.5 * (points[triangles[0, 0]] + points[triangles[0, 1]]), points[:1]])
    a, b, c = triangles[0]
    # The first triangle is cut in two at the middle m of ab, beside it stands one of a, m, b that has no area.
    m, again = len(points), len(points) + 1
    cut = np.vstack([triangles[1:], [[a, m, c], [m, b, c], [a, b, m], [0, again, 5]]])
    plain, slivers = closed(points, triangles), closed(p, cut)
    assert slivers.dropped == 1 and len(slivers.triangles) == 14
    one, other = moments(plain.points, plain.triangles), moments(slivers.points, slivers.triangles)
    assert one.volume == pytest.approx(other.volume, rel=1e-14)
    fields_of = [field_of(s.points, s.triangles, 12) for s in (plain, slivers)]
    np.testing.assert_allclose(fields_of[0].numbers, fields_of[1].numbers, rtol=0, atol=1e-15)


# The field


def box_depth(p, half=0.5 * SIZE):
    q = np.abs(p) - half
    return -np.linalg.norm(np.maximum(q, 0.0), axis=-1) - np.minimum(q.max(axis=-1), 0.0)


@pytest.mark.slow
def test_distances_at_the_points_of_the_grid_are_exact():
    points, triangles = solids.box(SIZE, 2)
    h, shape = 0.02, (24, 28, 20)
    origin = -0.5 * h * (np.array(shape) - 1)
    deep = np.full(shape, np.inf)
    signed(points, triangles, origin, h, deep, np.full(shape, -1, np.int32), np.zeros(shape, np.uint8))
    places = np.stack(
        np.meshgrid(*(o + h * np.arange(n) for o, n in zip(origin, shape, strict=True)), indexing="ij"), -1
    )
    np.testing.assert_allclose(deep, box_depth(places), rtol=0, atol=1e-15)
    centre, triangles = solids.torus(0.15, 0.05, 24)
    shape, h = (50, 50, 24), 0.01
    origin, deep = -0.5 * h * (np.array(shape) - 1), np.full(shape, np.inf)
    signed(centre, triangles, origin, h, deep, np.full(shape, -1, np.int32), np.zeros(shape, np.uint8))
    places = np.stack(
        np.meshgrid(*(o + h * np.arange(n) for o, n in zip(origin, shape, strict=True)), indexing="ij"), -1
    )
    exact = 0.05 - np.hypot(np.hypot(places[..., 0], places[..., 1]) - 0.15, places[..., 2])
    # Facets are no further from the torus than the sagitta of both of their arcs.
    assert np.abs(deep - exact).max() < 0.05 * (1 - math.cos(math.pi / 24)) + 0.2 * (1 - math.cos(math.pi / 48)) + 1e-3


def test_gradient_and_hessian_are_those_of_the_field():
    """Central differences, across the borders of cells too: the second derivatives are continuous."""
    surface = solids.ell()
    field = field_of(*surface, 20)
    rng, h = np.random.default_rng(0), 1e-5
    low, size = surface[0].min(axis=0), np.ptp(surface[0], axis=0)
    places = low + rng.uniform(-0.1, 1.1, (300, 3)) * size
    origin = field.numbers[fields.ORIGIN : fields.ORIGIN + 3]
    places[::3] = origin + field.spacing * np.round((places[::3] - origin) / field.spacing)
    _, gradient = field.at(places)
    hessian = np.array([fields.depth_at(tuple(p), field.address)[2] for p in places])
    for axis, columns in enumerate(([0, 1, 2], [1, 3, 4], [2, 4, 5])):
        step = h * np.eye(3)[axis]
        (above, up), (below, down) = field.at(places + step), field.at(places - step)
        # Third derivatives are up to 2/h² of the grid.
        bound = 2.0 * h * h / field.spacing**2
        np.testing.assert_allclose((above - below) / (2 * h), gradient[:, axis], rtol=0, atol=bound + 1e-9)
        np.testing.assert_allclose((up - down) / (2 * h), hessian[:, columns], rtol=0, atol=10 * h / field.spacing**2)
    assert (
        np.linalg.norm(gradient, axis=1).max() < 1.25
    )  # what `refweb.effects.contact.nonconvex_contacts` takes for the most


@pytest.mark.slow
def test_the_error_of_the_field_falls_with_the_grid():
    """Edges are rounded by a share of a cell; a smooth surface, of facets as small as cells, by its square."""
    edged = [field_of(*BOX, cells).error for cells in (16, 32, 64)]
    np.testing.assert_allclose(np.log2(np.divide(edged[:-1], edged[1:])), 1.0, atol=0.15)
    assert edged[0] < 0.35 * 0.4 / 16
    smooth = [field_of(*solids.sphere(0.2, level), cells).error for level, cells in ((16, 8), (32, 16), (64, 32))]
    assert np.polyfit(np.log([8, 16, 32]), np.log(smooth), 1)[0] < -1.8
    # On the surface of a sphere itself facets add their sagitta.
    rng = np.random.default_rng(1)
    p = rng.standard_normal((500, 3))
    p *= 0.2 / np.linalg.norm(p, axis=1, keepdims=True)
    found = np.abs(field_of(*solids.sphere(0.2, 64), 32).at(p)[0]).max()
    assert found < 2.0 * 0.2 * (1 - math.cos(math.pi / 128)) + smooth[-1]


def test_depth_inside_and_far_outside():
    field = field_of(*BOX, 40)
    inner = np.random.default_rng(2).uniform(-0.5, 0.5, (400, 3)) * SIZE
    deep, _ = field.at(inner)
    assert np.abs(deep - box_depth(inner)).max() < 0.5 * field.spacing  # where two faces are equally near
    far = np.random.default_rng(3).uniform(-2.0, 2.0, (400, 3))
    far = far[box_depth(far) < 0.0]
    outside, _ = field.at(far)
    # No further away than the body is, so that nothing near is left out, and no nearer than the end of the field.
    assert (outside <= -0.5 * field.spacing).all() or (outside < 0.0).mean() > 0.99
    assert (outside >= box_depth(far) - field.spacing).all()


@pytest.mark.slow
def test_walls_are_measured():
    assert field_of(*BOX, 64).thickness == pytest.approx(0.1, rel=0.1)
    assert field_of(*solids.torus(0.15, 0.05, 24), 64).thickness == pytest.approx(0.05, rel=0.15)
    edge = 0.3
    inner = edge / (3.0 + math.sqrt(3.0))  # of the corner of a cube
    assert field_of(*solids.tetrahedron(edge), 64).thickness == pytest.approx(inner, rel=0.1)


@pytest.mark.slow
def test_a_thin_wall_asks_for_a_finer_grid(tmp_path):
    plate = solids.box([0.5, 0.5, 0.02])
    body = mesh(tmp_path / "plate.obj", plate)
    fine = body.solid.field
    assert fine.thickness >= 2.0 * fine.spacing and fine.thickness == pytest.approx(0.01, rel=0.15)
    assert fine.offset == 0.0 and not body.remarks()


@pytest.mark.parametrize("thick", [0.02, 1e-5])
def test_a_wall_too_thin_for_its_grid_is_thickened(thick, tmp_path):
    """The body is the plate with all that is nearer than the offset: depth is offset − distance from the plate."""
    size = np.array([0.5, 0.5, thick])
    body = mesh(tmp_path / "plate.obj", solids.box(size), grid=24)
    field = body.solid.field
    (text,) = body.remarks()
    assert re.search(r"thinner than 4 cells of its grid, 0.083 m: the body is 0.0\d+ m thicker .* grid = 48 ", text)
    places = np.random.default_rng(5).uniform(-1.0, 1.0, (500, 3)) * (0.5 * size + 1.8 * field.offset)
    beyond = np.abs(places) - 0.5 * size
    distance = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
    near = (distance > 0.5 * field.offset) & (distance < 1.5 * field.offset)
    deep, _ = field.at(places[near])
    # A spline smooths the bend of depth about a wall within a cell and a half of it.
    assert near.sum() > 100 and np.abs(deep - field.offset + distance[near]).max() < 0.15 * field.spacing
    assert field.thickness >= 2.0 * field.spacing
    middle, _ = field.at(np.zeros((1, 3)))
    assert middle[0] > 1.5 * field.spacing
    assert body.grown().core[2] >= 0.5 * thick + field.offset  # nothing of it lies beyond the box that is searched
    assert body.error == pytest.approx(field.offset, rel=0.3)


def test_a_foil_has_a_field_without_a_grid_that_is_given(tmp_path, monkeypatch):
    monkeypatch.setattr(filled, "MOST", 200_000)
    body = mesh(tmp_path / "foil.obj", solids.box([0.5, 0.5, 1e-5]))
    assert body.solid.field.offset < 0.03 and len(body.remarks()) == 1


def test_a_grid_that_does_not_fit_is_refused_beforehand(tmp_path, monkeypatch):
    monkeypatch.setattr(memory, "available", lambda: 1e9)
    with pytest.raises(refweb.InputError, match=r"the 1\d\d\d × 1\d\d\d × \d+ points of its grid need about [\d.]+ GB"):
        _ = mesh(tmp_path / "it.obj", solids.box([1.0, 1.0, 0.9]), grid=1200).solid


def test_a_solid_is_made_once(tmp_path):
    path = solids.write(tmp_path / "it.stl", *BOX)
    one, other = Mesh(file=path, grid=12), Mesh(file=path, grid=12)
    assert one.solid is other.solid
    before = _solid.cache_info().misses
    solids.write(tmp_path / "it.stl", *solids.box(2.0 * SIZE))
    changed = Mesh(file=path, grid=12)
    assert changed.volume() == pytest.approx(8.0 * one.volume(), rel=1e-6)
    assert _solid.cache_info().misses == before + 1
    assert one.solid.field.numbers.size == HEAD + math.prod(one.solid.field.counts)
    assert min(one.solid.field.counts) >= 2 * AROUND
