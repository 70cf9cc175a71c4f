"""Solids of faulty surfaces: made of boxes, whose volume, moments and depth are known in closed form."""

import itertools
import re

import numpy as np
import pytest
import solids

import refweb
from refweb.net.boundary.closed import moments
from refweb.net.boundary.polygons import ears
from refweb.net.boundary.repair import repaired, touches_itself
from refweb.net.boundary.winding import Winding
from refweb.net.shapes.mesh import Mesh

SIZE = np.array([0.3, 0.4, 0.2])
BOX = solids.box(SIZE)


def joined(*surfaces):
    first = np.cumsum([0, *(len(points) for points, _ in surfaces)])
    return np.vstack([p for p, _ in surfaces]), np.vstack([t + k for (_, t), k in zip(surfaces, first, strict=False)])


def box_at(low, high):
    low, high = np.array(low, dtype=float), np.array(high, dtype=float)
    points, triangles = solids.box(high - low)
    return points + 0.5 * (low + high), triangles


def reversed_(surface, *which):
    points, triangles = surface
    return points, np.where(np.isin(np.arange(len(triangles)), which)[:, None], triangles[:, ::-1], triangles)


def weighed(*boxes):
    """(volume, centre, inertia about it) of boxes by their corners and a sign: ± V, ± V (b² + c²)/12 and Steiner."""
    volume, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
    for sign, low, high in boxes:
        low, high = np.array(low, dtype=float), np.array(high, dtype=float)
        v, c = sign * (high - low).prod(), 0.5 * (low + high)
        volume, first, second = (
            volume + v,
            first + v * c,
            second + v * (np.diag((high - low) ** 2) / 12 + np.outer(c, c)),
        )
    centre = first / volume
    second -= volume * np.outer(centre, centre)
    return volume, centre, np.trace(second) * np.eye(3) - second


def depth_in_box(p, low, high):
    q = np.abs(p - 0.5 * np.add(low, high)) - 0.5 * np.subtract(high, low)
    return -np.linalg.norm(np.maximum(q, 0.0), axis=-1) - np.minimum(q.max(axis=-1), 0.0)


def depth_in_cells(p, boxes):
    """Exact depth in a union of boxes: the distance from all cells of their common grid that are not in it."""
    cuts = [np.unique([side[k] for box in boxes for side in box]) for k in range(3)]
    cuts = [np.concatenate([[c[0] - 9.0], c, [c[-1] + 9.0]]) for c in cuts]
    inner, outer = np.full(len(p), np.inf), np.full(len(p), np.inf)
    for cell in itertools.product(*(range(len(c) - 1) for c in cuts)):
        low, high = (np.array([c[i + k] for c, i in zip(cuts, cell, strict=True)]) for k in (0, 1))
        middle = 0.5 * (low + high)
        away = -np.minimum(depth_in_box(p, low, high), 0.0)
        if any((middle > box[0]).all() and (middle < box[1]).all() for box in boxes):
            outer = np.minimum(outer, away)
        else:
            inner = np.minimum(inner, away)
    return np.where(outer > 0.0, -outer, inner)


HALF = 0.5 * SIZE
ONE, TWO = (-HALF, HALF), (np.zeros(3), SIZE)
BESIDE = (HALF * [1, -1, -1], SIZE * [1.5, 0.5, 0.5])
DIAGONAL = (HALF * [1, 1, -1], SIZE * [1.5, 1.5, 0.5])
SHIFTED = (HALF * [1, 0, -0.5], SIZE * [1.5, 0.75, 0.5])
CASES = {  # surface, the boxes whose union it is, the same with signs, whether weighed exactly, what is told
    "hole": ((BOX[0], np.delete(BOX[1], 3, axis=0)), [ONE], None, True, r"open at 3 edges, in 1 holes .* 0.447 m"),
    "no lid": ((BOX[0], BOX[1][2:]), [ONE], None, True, r"open at 4 edges, in 1 holes that were bridged"),
    "flipped": (reversed_(BOX, 3), [ONE], None, True, "1 of 12 triangles faced inward and were turned"),
    "hole and inward": (
        (BOX[0], np.delete(BOX[1], 5, axis=0)[:, ::-1]), [ONE], None, True, "11 of 11 triangles faced inward",
    ),
    "doubled": ((BOX[0], np.vstack([BOX[1], BOX[1][3:4]])), [ONE], None, True, "1 triangles lay on others"),
    "doubled and flipped": ((BOX[0], np.vstack([BOX[1], BOX[1][3:4, ::-1]])), [ONE], None, True, "1 triangles lay on"),
    "common edge": (joined(BOX, box_at(*DIAGONAL)), [ONE, DIAGONAL], None, True, "1 edges have more than two"),
    "common wall": (joined(BOX, box_at(*BESIDE)), [ONE, BESIDE], None, True, "2 triangles lay on others"),
    "touching": (joined(BOX, box_at(*SHIFTED)), [ONE, SHIFTED], None, False, "the solid is the union of its parts"),
    "overlapping": (
        joined(BOX, box_at(*TWO)), [ONE, TWO], [(1, *ONE), (1, *TWO), (-1, np.zeros(3), HALF)], False,
        r"triangles lie in other parts or pass through them: the solid is the union of its parts, its edges",
    ),
    "overlapping, one inward, with a hole": (
        joined(reversed_(BOX, *range(12)), (box_at(*TWO)[0], np.delete(BOX[1], 11, axis=0))),
        [ONE, TWO], [(1, *ONE), (1, *TWO), (-1, np.zeros(3), HALF)], False, r"in 1 holes",
    ),
    "a wall inside": (
        joined(BOX, (HALF * [[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]], np.array([[0, 1, 2], [0, 2, 3]]))),
        [ONE], None, True, r"2 triangles, 0.06 m², bound nothing",
    ),
    "one wall between": (
        joined(BOX, (box_at(*BESIDE)[0], np.delete(BOX[1], [0, 1], axis=0))), [ONE, BESIDE], None, True,
        "4 edges have more than two triangles",
    ),
    "a fin": (
        joined(BOX, (np.array([[0.0, 0.0, 0.05], [0.0, 0.1, 0.3], [0.0, -0.1, 0.3]]), np.array([[0, 1, 2]]))),
        [ONE], None, True, r"1 triangles, 0.025 m², bound nothing: sheets without thickness are not felt",
    ),
}  # fmt: skip


def solid_of(path, faces, **keys):
    return Mesh(file=solids.write(path, *faces), **keys)


@pytest.mark.ordinary("hole", "no lid", "doubled", "overlapping, one inward, with a hole", "a fin")
@pytest.mark.parametrize("name", CASES)
def test_a_faulty_surface_is_the_solid_that_is_meant(name, tmp_path):
    """Volume, centre and inertia, in closed form; depth, against the exact one, where one face is the nearest."""
    surface, boxes, parts, exact, told = CASES[name]
    it = solid_of(tmp_path / "it.obj", surface)
    solid, field = it.solid, it.solid.field
    volume, centre, inertia = weighed(*(parts or [(1, *box) for box in boxes]))
    area = sum(2.0 * (np.prod(s) * (1.0 / s)).sum() for s in (np.subtract(b[1], b[0]) for b in boxes))
    within = (1e-12 if exact else field.error) * area
    assert solid.volume == pytest.approx(volume, abs=within)
    np.testing.assert_allclose(solid.centre, centre, rtol=0, atol=within / volume * 0.5)
    share = 1e-12 if exact else 3e-3
    assert solid.volume == pytest.approx(volume, rel=share)
    np.testing.assert_allclose(solid.inertia, inertia, rtol=0, atol=share * np.trace(inertia))
    assert len(it.remarks()) == (2 if "and inward" in name or "one wall" in name else 1) or "with a hole" in name
    assert any(re.search(told, remark) for remark in it.remarks()), it.remarks()
    corners = np.array([corner for box in boxes for corner in box])
    low, high = corners.min(axis=0), corners.max(axis=0)
    p = low - 0.02 + np.random.default_rng(1).random((3000, 3)) * (high - low + 0.04)
    deep, found = depth_in_cells(p, boxes), field.at(p - solid.centre)[0]
    # Creases are rounded within a cell or two; where the field is smooth only their neighbours are off.
    assert np.abs(found - deep).max() < 0.75 * field.spacing
    assert np.median(np.abs(found - deep)) < 1e-2 * field.spacing
    clear = np.abs(deep) > field.error
    assert ((found > 0.0) == (deep > 0.0))[clear].all()


def test_a_clean_surface_has_the_bits_that_it_had(tmp_path):
    """Nothing is told of it, and its moments are those of its triangles."""
    points, triangles = solids.ell()
    it = solid_of(tmp_path / "it.obj", (points, triangles))
    volume, centre, inertia = moments(points, triangles)
    assert it.solid.volume == volume and (it.solid.centre == centre).all() and (it.solid.inertia == inertia).all()
    assert it.remarks() == () and it.solid.winding is None
    assert not touches_itself(points, triangles, 48)


def test_parts_with_a_gap_are_one_where_no_cell_sees_it(tmp_path):
    """A hundredth of a cell is none; a fifth of the box stays one."""
    parts = [joined(BOX, box_at(BESIDE[0] + [gap, 0, 0], BESIDE[1] + [gap, 0, 0])) for gap in (1e-4, 0.06)]
    near, far = (solid_of(tmp_path / f"{k}.obj", part) for k, part in enumerate(parts))
    middle = np.array([[0.5 * SIZE[0] + 5e-5, 0.0, 0.0]])
    assert near.solid.field.at(middle - near.solid.centre)[0] == pytest.approx(0.1, abs=near.error)
    assert far.solid.field.at(middle + [0.03, 0, 0] - far.solid.centre)[0] == pytest.approx(-0.03, abs=far.error)
    assert near.remarks() and not far.remarks()


def test_a_part_that_is_inside_out_in_others_is_a_hollow():
    """With a fault elsewhere: a file with a doubled face whose inner box faces inward."""
    inner = box_at(-0.5 * HALF, 0.5 * HALF)
    outer = BOX[0], np.vstack([BOX[1], BOX[1][:1]])
    hollow = repaired(*joined(outer, reversed_(inner, *range(12))), 48)
    assert hollow.moments.volume == pytest.approx(7.0 / 8.0 * SIZE.prod(), rel=1e-12)
    filled = repaired(*joined(outer, inner), 48)
    assert filled.moments.volume == pytest.approx(SIZE.prod(), rel=1e-12)


def test_the_hull_is_convex(tmp_path):
    """Of an angle: the square less the triangle beyond its legs; no fault of the surface matters to it."""
    points, triangles = solids.ell(0.3, 0.12, 0.2)
    for name, faces in (("whole", triangles), ("open", triangles[1:])):
        hull = solid_of(tmp_path / f"{name}.obj", (points, faces), surface="hull")
        assert hull.volume() == pytest.approx((0.3**2 - 0.5 * 0.18**2) * 0.2, rel=1e-9)
        assert hull.solid.convex and hull.remarks() == ()
    with pytest.raises(refweb.InputError, match="the surface is flat, and its hull has no volume"):
        _ = solid_of(tmp_path / "flat.obj", (points * [1, 1, 0], triangles), surface="hull").solid
    with pytest.raises(refweb.InputError, match='surface = "hul" must be one of "file", "hull"'):
        Mesh(file="it.obj", surface="hul")


def test_winding_numbers_are_the_solid_angle():
    """Of two balls, one of which is inverted, against the sum of solid angles (van Oosterom and Strackee)."""
    points, triangles = joined(solids.sphere(0.2, 12), reversed_(solids.torus(0.2, 0.08, 12), *range(10**4)))
    points = points @ np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]
    p = np.random.default_rng(0).uniform(-0.3, 0.3, (400, 3))
    a, b, c = (points[triangles[:, k]] - p[:, None] for k in range(3))
    i, j, k = (np.linalg.norm(q, axis=2) for q in (a, b, c))
    above = (a * np.cross(b, c)).sum(axis=2)
    below = i * j * k + (a * b).sum(2) * k + (b * c).sum(2) * i + (c * a).sum(2) * j
    angle = np.arctan2(above, below).sum(axis=1) / (2.0 * np.pi)
    assert set(np.unique(angle.round())) == {-1.0, 0.0, 1.0}
    np.testing.assert_allclose(Winding(points, triangles).at(p), angle, atol=1e-9)


def test_ears_cover_a_polygon():
    """A comb, from every corner, in a plane of any direction: areas add up, and no triangle is turned."""
    flat = np.array([[0, 0], [5, 0], [5, 3], [4, 3], [4, 1], [3, 1], [3, 3], [2, 3], [2, 1], [1, 1], [1, 3], [0, 3]])
    turn = np.linalg.qr(np.random.default_rng(5).standard_normal((3, 3)))[0]
    corners = np.column_stack([flat, np.ones(12)]) @ turn
    for first in range(12):
        own = np.roll(corners, first, axis=0)
        triangles = ears(own)
        a, b, c = (own[triangles[:, k]] for k in range(3))
        across = np.cross(b - a, c - a)
        assert len(triangles) == 10 and 0.5 * np.linalg.norm(across, axis=1).sum() == pytest.approx(11.0)
        assert (across @ across[0] > -1e-12).all()
    assert ears(np.array([[0, 0, 0], [1, 1, 0], [1, 0, 0], [0, 1, 0.0]])) is None  # a bow tie
    hole = np.array([[0, 0], [4, 0], [4, 4], [0, 4], [0, 0], [1, 1], [1, 3], [3, 3], [3, 1], [1, 1]])
    corners = np.column_stack([hole, np.zeros(10)]) @ turn
    a, b, c = (corners[ears(corners)[:, k]] for k in range(3))
    assert 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() == pytest.approx(16.0 - 4.0)


@pytest.mark.parametrize("count", [4, 7])
def test_ears_refuse_sides_that_cross(count):
    """Random polygons, some of which cross: two sides do where each has the ends of the other on both sides."""
    rng = np.random.default_rng(count)

    def apart(p, q, r, s):
        return np.linalg.det(np.array([q - p, r - p])) * np.linalg.det(np.array([q - p, s - p])) < 0.0

    crossed = []
    for _ in range(60):
        p = rng.random((count, 2))
        sides = list(zip(p, np.roll(p, -1, axis=0), strict=True))
        pairs = [(one, two) for n, one in enumerate(sides) for two in sides[:n]]
        crossed.append(any(apart(*one, *two) and apart(*two, *one) for one, two in pairs))
        assert (ears(np.column_stack([p, np.zeros(count)])) is None) == crossed[-1]
    assert 0 < sum(crossed) < 60
