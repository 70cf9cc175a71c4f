"""A force of contact that is that of a first touch has no limit: whoever refines elements and contact finds none."""

import pytest

import refweb
from refweb.results.error_budget import NO_LIMIT
from validation.methods import trust


@pytest.mark.parametrize("seed", [58, 35, 29])
def test_a_first_touch_grows_with_elements_and_stiffness(seed):
    """The force √(k m) v of a node of mass m: with n times the elements and n² times the stiffness √n as much."""
    _, scene = next(trust.scenes("impact", seed))
    scene = scene.replace(observe=[one for one in scene.observe if one.name == "contact_force"])
    found = refweb.trust(scene, progress=False).results["contact_force"]
    assert found.verdict == NO_LIMIT
    both = [trust.results_at(scene, n, n * n)["contact_force"] for n in (2, 4, 8)]
    assert both[2] > 1.1 * both[0]  # twice as much, but for what the web as a whole pushes back


@pytest.mark.slow
def test_a_ring_that_a_cable_stops_has_a_limit():
    """The cable decides on the force, and neither elements nor stiffness."""
    ring = refweb.Observe(name="force", quantity="reaction", body="ring", reduce="max")
    scene = refweb.Scene.load("ring-on-slack-cable").replace(observe=[ring])
    assert refweb.trust(scene, progress=False).results["force"].verdict != NO_LIMIT
