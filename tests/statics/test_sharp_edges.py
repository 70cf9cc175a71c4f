"""Lines that turn round an edge which is sharp for their elements: the push along them, and where it is told."""

import numpy as np
import pytest

import refweb
from refweb.statics.sharp_edges import Edge

HEIGHT, LENGTH = 0.3, 0.1
ANGLE = 2.0 * np.arcsin(HEIGHT)
"""Angle by which a line turns that goes down by `HEIGHT` on each metre of both sides."""


def tent(shift, radius, stiffness=1e5, **contact):
    """A tight line over the edge of a bar, with the top at 0, and a node off it by a ``shift``.

    By symmetry no rigid bar pushes a thread along, wherever nodes are.
    """
    places = np.concatenate([[-1.0], shift + LENGTH * np.arange(-8.0, 9.0), [1.0]])
    points = [[s * np.cos(0.5 * ANGLE), 0.0, 0.03 * (1.0 - abs(s)) - HEIGHT * abs(s)] for s in places]
    return refweb.Scene(
        web=refweb.Inline(points=points, lines=[[i, i + 1] for i in range(18)], supports=[0, 18]),
        cable=refweb.Cable(law="tension-only", modulus=1e8, area=1e-5, density=0.0, prestrain=0.05),
        effects=[
            refweb.Body(
                name="bar", shape="box", size=(0.6, 1.0, 0.6), rounding=radius, axes=[[1, 0, 1], [0, 1, 0]], fixed=True,
                position=(0.0, 0.0, -0.3 * np.sqrt(2.0) + radius * (np.sqrt(2.0) - 1.0)),
            ),
            refweb.Contact(stiffness=stiffness, **contact),
        ],
        observe=[
            refweb.Observe(name=f"f{axis}", quantity="reaction", body="bar", component=axis) for axis in "xz"
        ],
        solve=refweb.Static(),
    )  # fmt: skip


def told(solution):
    """Texts on sharp edges."""
    return [f.text for f in solution.findings if f.code == "push-along-lines" and "does not fall with" in f.text]


@pytest.mark.parametrize("radius, stiffness", [(0.005, 1e5), (0.005, 1e6), (0.1, 1e5)])
def test_a_line_is_pushed_along_at_a_sharp_edge(radius, stiffness):
    """The mean over places from a node to the middle of an element is that of the formula, within a quarter."""
    shares = []
    for part in (np.arange(4.0) + 0.5) / 8.0:
        found = refweb.run(tent(part * LENGTH, radius, stiffness)).results
        shares.append(abs(found["fx"].value / found["fz"].value))
    assert np.mean(shares) == pytest.approx(Edge(0, ANGLE, LENGTH, radius).share, rel=0.25)


@pytest.mark.parametrize(
    "radius, contact, so", [(0.005, {}, True), (0.005, {"friction": 0.3}, False), (0.2, {}, False)]
)
def test_a_sharp_edge_is_told(radius, contact, so):
    """It is told with its remedy; not with more friction, nor for a bar round which several nodes turn the line."""
    texts = told(refweb.run(tent(0.3 * LENGTH, radius, **contact)))
    assert bool(texts) == so
    if so:
        edge = Edge(0, ANGLE, LENGTH, radius)
        enough = edge._replace(radius=LENGTH * edge.enough(0.05))
        assert enough.share == pytest.approx(0.05) and enough.radius > radius
        assert 'at an edge of body "bar"' in texts[0] and "a rounding of at least" in texts[0]
