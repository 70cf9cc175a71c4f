"""What a run is expected to cost: its step by Gershgorin's bound by hand, and what is named to set it."""

import re

import numpy as np
import pytest

import refweb
from refweb.dynamics.expected_cost import expected_cost, ruling
from refweb.dynamics.integrators.central_difference import CentralDifference

EA, DENSITY, SHORT = 1e4, 100.0, 0.01
POINTS = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0 + SHORT, 0.0, 0.0], [2.0, 0.0, 0.0]]


def scene(*effects, **solve):
    return refweb.Scene(
        web=refweb.Inline(points=POINTS, lines=[[0, 1], [1, 2], [2, 3]], supports=[0, 3]),
        cable=refweb.Cable(law="linear", modulus=EA / 1e-4, area=1e-4, density=DENSITY),
        effects=list(effects),
        solve=refweb.Dynamic(duration=1.0, **solve),
        output=refweb.Output(interval=0.1),
    )


def rule(given, reach=np.inf):
    system = given.build()
    return ruling(CentralDifference(system, safety=0.5), system, reach, 0.0)


def ball(**more):
    return refweb.Body(name="ball", radius=0.1, mass=1.0, position=(1.0, 0.0, 0.3), **more)


def test_elasticity_of_the_shortest_line():
    """Both its nodes have half of it and half of a long line: row sums of 2 EA/L of both over their mass."""
    found = rule(scene())
    mass = 0.5 * DENSITY * 1e-4 * (1.0 - SHORT + SHORT)  # the smaller of the two
    np.testing.assert_allclose(found.step, 0.5 * 2.0 / np.sqrt(2.0 * EA * (1.0 / SHORT + 1.0 / (1.0 - SHORT)) / mass))
    assert found.by == "elasticity of line 1"


def test_other_causes():
    """A stiff contact within reach and not out of it, and damping of lines; friction never."""
    stiff = scene(ball(), refweb.Contact(stiffness=1e8, friction=0.3))
    assert rule(stiff).by in ("contact at node 1", "contact at node 2", 'contact at body "ball"')
    assert rule(stiff, 0.0).by == "elasticity of line 1" and rule(stiff).step < rule(stiff, 0.0).step
    assert rule(stiff).step == pytest.approx(rule(scene(ball(), refweb.Contact(stiffness=1e8))).step, rel=0.3)
    assert rule(scene(refweb.Damping(time=1.0))).by.startswith("damping at node ")


def test_in_words():
    given = scene(ball(), refweb.Contact(stiffness=1e8))
    text = expected_cost(given, given.build())
    assert "by elasticity of line 1; " in text and "where all is touched, by contact at " in text
    assert " steps, some " in text and text.endswith("s of CPU time with step refinement")
    alone = scene(step_size=1e-5).replace(accuracy=refweb.Accuracy(error="none"))
    assert expected_cost(alone, alone.build()).startswith("10 µs as given, of ")
    assert "at most by elasticity of line 1; 1e+05 steps, some " in expected_cost(alone, alone.build())
    seconds = {}
    for friction in (0.0, 0.3):  # where all is touched, friction is what a step takes longest for
        rubbed = scene(ball(), refweb.Contact(stiffness=1.0, friction=friction))
        least, most = re.search(r"some (\S+) to (\S+) s of CPU", expected_cost(rubbed, rubbed.build())).groups()
        seconds[friction] = float(least), float(most)
    assert seconds[0.3][1] > seconds[0.0][1] > seconds[0.0][0]
    implicit = scene(method="cvode")
    assert expected_cost(implicit, implicit.build()) is None


def test_coriolis_forces_are_a_cause_of_their_own():
    """Lines without stiffness to speak of, in a frame that turns fast: no damping is there to be named."""
    turning = scene(refweb.Frame(angular_velocity=(0.0, 0.0, 1e4)))
    assert rule(turning).by.startswith("Coriolis forces of [frame] at node ")
