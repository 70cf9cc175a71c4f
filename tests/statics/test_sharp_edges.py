"""Lines that turn round an edge which is sharp for their elements: the push along them, and where it is told."""

import re

import nets
import numpy as np
import pytest

import refweb
from refweb.effects.contact.sharp_edges import Edge, sharpest_edge
from refweb.results.state import State

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


def moving(radius):
    """The same line in dynamics, on the way to its rest."""
    given = tent(0.3 * LENGTH, radius)
    return given.replace(
        cable=refweb.Cable(law="tension-only", modulus=1e8, area=1e-5, density=1000.0, prestrain=0.05),
        effects=[*given.effects, refweb.Damping(rate=200.0)],
        solve=refweb.Dynamic(duration=0.1),
        accuracy=refweb.Accuracy(error="none"),
        output=refweb.Output(interval=0.01, frames=1),
    )


@pytest.mark.parametrize("radius, so", [(0.005, True), (0.2, False)])
def test_a_sharp_edge_is_told_in_dynamics(radius, so):
    """Angle and length are those of the equilibrium."""
    texts = told(refweb.run(moving(radius)))
    assert bool(texts) == so
    if so:
        (rest,) = told(refweb.run(tent(0.3 * LENGTH, radius)))
        pattern = r"turns by ([\d.]+)° at .* for elements of ([\d.]+) m"
        found, expected = (np.array(re.search(pattern, text).groups(), dtype=float) for text in (texts[0], rest))
        np.testing.assert_allclose(found, expected, rtol=0.02)


def test_a_slack_line_is_not_pushed_along():
    """The same shape with and without tension, as deep in the bar."""
    shape = tent(0.3 * LENGTH, 0.005)
    edges = []
    for prestrain in (0.05, -0.05):
        system = shape.replace(
            cable=refweb.Cable(law="tension-only", modulus=1e8, area=1e-5, density=1.0, prestrain=prestrain)
        ).build()
        state = State(system, 1.0, np.zeros((system.rows, 3)))
        edges.append(sharpest_edge(state, system.net.bodies[0], np.full(18, 1e-3), 0.05))
    assert edges[0] is not None and edges[1] is None


def test_a_sharp_edge_is_told_by_a_run_that_was_stopped(tmp_path):
    """With edges of frames before it."""
    whole, resumed = nets.whole_and_resumed(moving(0.005), tmp_path)
    assert told(whole) == told(resumed) != []
