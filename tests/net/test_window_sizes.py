"""Windows by width and height, and their outline: sizes and counts by hand, of each mesh."""

import numpy as np
import pytest

import refweb
from refweb.__main__ import main
from refweb.errors import InputError

HEX = np.sqrt(3.0)


@pytest.mark.parametrize("mesh", ["square", "triangle", "hexagon"])
@pytest.mark.parametrize("rows, columns", [(2, 3), (3, 4), (6, 5), (7, 9)])
def test_width_and_height_of_a_window_make_it(mesh, rows, columns):
    """The size of the bounding box, and what is a little off it, lead back to the same rows and columns."""
    given = refweb.Window(mesh=mesh, rows=rows, columns=columns, side=0.25).web()
    width, height, _ = np.ptp(given.points, axis=0)
    for off in (-0.05, 0.0, 0.05):
        web = refweb.Window(mesh=mesh, width=width + off, height=height - off, side=0.25).web()
        np.testing.assert_array_equal(web.points, given.points)
        np.testing.assert_array_equal(web.lines, given.lines)
    mixed = refweb.Window(mesh=mesh, width=width, rows=rows, side=0.25).web()
    np.testing.assert_array_equal(mixed.points, given.points)


def test_size_of_squares():
    """20 columns and 10 rows of 0.1 m."""
    web = refweb.Window(mesh="square", width=2.0, height=1.0, side=0.1).web()
    np.testing.assert_allclose(np.ptp(web.points, axis=0), [2.0, 1.0, 0.0])
    assert web.cells == 200


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        (dict(rows=3), "columns is missing: give columns = ..., or width = ... [m]"),
        (dict(width=1.0), "rows is missing: give rows = ..., or height = ... [m]"),
        (dict(rows=3, columns=3, width=1.0), "width = 1 and columns = 3 both say how large it is"),
        (dict(width=1e9, height=1e9), "must be ≤ 1000000"),
        (dict(width=0.0, height=1.0), "width = 0.0 must be > 0 [m]"),
    ],
)
def test_wrong_sizes(keys, message):
    with pytest.raises(InputError) as refusal:
        refweb.Window(mesh="square", side=0.1, **keys)
    assert message in str(refusal.value)


@pytest.mark.parametrize("rows, columns", [(3, 3), (4, 6), (5, 3)])
def test_rim_and_corners_of_squares(rows, columns):
    """Inner nodes are a grid of (rows − 1) × (columns − 1): its outline, and two lines at each of its four corners."""
    web = refweb.Window(mesh="square", rows=rows, columns=columns, side=1.0).web()
    rim, corners = web.find_lines("rim"), web.find_lines("corners")
    inner = np.setdiff1d(np.arange(len(web.points)), web.rim)
    low, high = web.points[inner].min(axis=0), web.points[inner].max(axis=0)
    ends = web.points[web.lines]
    outside = [
        n
        for n in web.find_lines("inner")
        if any((ends[n, :, k] == edge[k]).all() for k in (0, 1) for edge in (low, high))
    ]
    assert rim.tolist() == outside and len(rim) == 2 * (rows - 2 + columns - 2)
    at_corner = ((ends == low) | (ends == high))[:, :, :2].all(axis=2).any(axis=1)
    assert corners.tolist() == np.flatnonzero(at_corner & np.isin(np.arange(len(ends)), rim)).tolist()
    assert set(corners) <= set(rim) <= set(web.find_lines("inner"))


@pytest.mark.parametrize("mesh", ["triangle", "hexagon"])
def test_rim_of_other_meshes_is_closed_and_around(mesh):
    """Each node of the outline has two lines of it, and no inner node stands outside of its hull."""
    from scipy.spatial import ConvexHull

    web = refweb.Window(mesh=mesh, rows=6, columns=6, side=1.0).web()
    rim = web.lines[web.find_lines("rim")]
    counts = np.bincount(rim.ravel())
    if mesh == "triangle":  # the inner web of hexagons has lines that end at one of its meshes
        assert set(counts) == {0, 2}
    inner = np.setdiff1d(np.arange(len(web.points)), web.rim)
    hulls = [ConvexHull(web.points[nodes][:, :2]).volume for nodes in (inner, np.unique(rim))]
    assert hulls[0] == pytest.approx(hulls[1]) and len(web.find_lines("corners"))


def test_small_windows_have_no_outline_or_a_line():
    """One inner node has no lines; a row of them is its own outline, and ends at both."""
    one = refweb.Window(mesh="square", rows=2, columns=2, side=1.0).web()
    assert "rim" not in one.groups and "corners" not in one.groups
    row = refweb.Window(mesh="square", rows=2, columns=5, side=1.0).web()
    assert len(row.find_lines("rim")) == 3 and len(row.find_lines("corners")) == 2


def test_check_prints_sizes(tmp_path, capsys):
    text = '[web]\nkind = "window"\nmesh = "hexagon"\nwidth = 7.0\nheight = 5.4\nside = 1.0\n'
    text += "[cable]\nmodulus = 1e9\narea = 1e-6\ndensity = 1.0\n[cable.groups.rim]\narea = 2e-6\n"
    (tmp_path / "net.toml").write_text(text + '[solve]\nkind = "static"\n')
    assert main(["check", str(tmp_path / "net.toml")]) == 0
    assert f"{4 * HEX:.4g} × 5.5 × 0 m along x, y and z" in capsys.readouterr().out
    saved = refweb.Scene.load(tmp_path / "net.toml").to_dict()
    assert refweb.Scene.from_dict(saved).web == refweb.Scene.load(tmp_path / "net.toml").web
