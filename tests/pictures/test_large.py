"""What a large web is drawn by: wires for tubes, few of many undeformed lines, views fitted to the outermost points."""

import numpy as np
import pytest

from refweb.pictures import camera, render, stage
from refweb.pictures.camera import View, choose, outermost
from refweb.pictures.model import FINE, Tubes
from refweb.pictures.opengl import MOST_CORNERS


@pytest.mark.slow
def test_wires_are_as_wide_as_tubes():
    """A line that is there often enough to be drawn as a wire, and the same as one tube: the same but at rims."""
    line = np.array([[[-0.6, 0.0, 0.0], [0.6, 0.2, 0.1]]])
    view = View(np.eye(3), np.array([0.0, 0.0, 1.0]), (1.0, 0.5), False)
    drawn = []
    for count in (1, MOST_CORNERS // (2 * FINE) + 1):
        tubes = Tubes(np.repeat(line, count, axis=0), np.tile([0.1, 0.4, 0.6], (count, 1)), 0.03)
        found = render.images([[tubes]], [view], [(400, 200)])
        if found is None:
            pytest.skip("no OpenGL")
        drawn.append((found[0][0] < 200).any(axis=2))
    wide = [image[:, 100:300].sum(axis=0) for image in drawn]
    slope = np.hypot(1, 0.2 / 1.2)  # of a strip 12 pixels wide that lies aslant
    assert abs(wide[0].mean() - 12 * slope) < 1 and abs(wide[1].mean() - 12 * slope) < 1.5
    assert abs(drawn[0].nonzero()[0].mean() - drawn[1].nonzero()[0].mean()) < 0.5


def test_lines_that_lie_on_each_other_are_drawn_once(monkeypatch):
    """A flat web from its side: what is left covers the same place; fewer lines are left alone."""
    x, y = (a.ravel() for a in np.meshgrid(np.arange(30.0), np.arange(40.0)))
    lines = np.stack([np.stack([x, 0 * y], axis=1), np.stack([x + 1, 0 * y], axis=1)], axis=1)
    assert stage.distinct_lines(lines) is lines
    monkeypatch.setattr(stage, "MOST_UNDEFORMED", 100)
    found = stage.distinct_lines(lines)
    assert len(found) == 30
    np.testing.assert_array_equal(np.sort(found[:, 0, 0]), np.arange(30.0))


def test_marked_pixels_are_those_that_lines_meet():
    """A rising diagonal, and a line that leaves the page; rows count from the top."""
    diagonal = np.array([[[0.0, 0.0], [2.0, 1.0]], [[0.0, 0.97], [9.0, 0.97]]])
    image = stage.marked_pixels(diagonal, (0.0, 2.0, 0.0, 1.0), 40, 20)[..., 3] > 0
    columns = np.arange(40)
    assert image[0].all() and image[19 - columns // 2, columns].all()
    assert not image[19, 3:].any() and not image[10, :15].any() and image[1:].sum() <= 40


def test_many_points_are_seen_as_few_are(monkeypatch):
    """The views of a bulged web are those of all its points, to a hundredth of the page; a bump makes no plane."""
    x, y = (a.ravel() for a in np.meshgrid(*2 * [np.linspace(-1, 1, 60)]))
    flat = np.stack([x, y, 0 * x], axis=1)
    bulged = flat + np.outer(0.3 * np.exp(-4 * (x**2 + y**2)), [0.0, 0, 1])
    few, _ = choose(flat, bulged, np.zeros((0, 3)), 0.3, False, 1.6)
    monkeypatch.setattr(camera, "MANY", 500)
    assert len(outermost(bulged)) < 300
    many, _ = choose(flat, bulged, np.zeros((0, 3)), 0.3, False, 1.6)
    for one, other in zip(few, many, strict=True):
        a, b = (view.project(bulged)[0] / np.array(view.half) for view in (one, other))
        assert np.abs(a - b).max() < 0.02
    bumped = flat.copy()
    bumped[1830, 2] = 1e-3
    assert len(choose(flat, bumped, np.zeros((0, 3)), 0.5, False, 1.6)[0]) == 2
