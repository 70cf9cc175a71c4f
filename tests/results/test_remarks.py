"""Runs in which nothing happens, or nonsense: each is named by a warning, and its neighbour that makes sense is not."""

import re

import numpy as np
import pytest

import refweb

TWO = refweb.Inline(points=[[-1, 0, 0], [0, 0, 0], [1, 0, 0]], lines=[[0, 1], [1, 2]], supports=[0, 2])
MAST = refweb.Inline(
    points=[[-1, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0.2, 2]],
    lines=[[0, 3], [1, 3], [2, 3]],
    supports=[0, 1, 2],
)
"""Three legs and a node on top."""


def solved(*effects, web=TWO, solve=None, law="tension-only", observe=(), **keys):
    return refweb.run(
        refweb.Scene(
            web=web,
            cable=refweb.Cable(**{"law": law, "modulus": 1e6, "area": 1e-4, "density": 200.0, **keys}),
            effects=effects,
            solve=solve or refweb.Static(),
            observe=observe,
            accuracy=refweb.Accuracy(error="none"),
        )
    )


def told(solution, words):
    return [text for text in solution.warnings if words in text]


def pull(force, node=1):
    return refweb.Load(node=node, force=force)


# Loads on supports


@pytest.mark.parametrize("solve", [refweb.Static(load_steps=(0.5, 1.0)), refweb.Dynamic(duration=1e-3)])
def test_a_load_on_supports_only(solve):
    """Of two tables the one that does nothing; where some node or axis is free, none."""
    free, held = pull((0.0, 0.0, 1.0)), pull((1.0, 0.0, 2.0), node=[0, 2])
    assert told(solved(free, held, solve=solve), "acts only on supports") == [
        "the load on node 0, node 2 acts only on supports, which carry it: it moves nothing"
    ]
    assert not told(solved(free, pull((1.0, 0.0, 2.0), node=[0, 1]), solve=solve), "acts only on supports")


def test_a_load_that_comes_later():
    """A table that begins with nothing is looked at where there is something."""
    later = refweb.Load(node=0, force=(0.0, 0.0, 1.0), factor=[(0.0, 0.0), (5e-4, 0.0), (6e-4, 1.0), (7e-4, 0.0)])
    solution = solved(later, solve=refweb.Dynamic(duration=1e-3))
    assert len(told(solution, "acts only on supports")) == 1
    rolling = refweb.Supports(nodes=[0], components=["x", "y"])
    scene = solution.scene.replace(supports=refweb.Supports(nodes=[2]), support=[rolling])
    assert not told(refweb.run(scene), "acts only on supports")


@pytest.mark.parametrize("fixed", [False, True])
@pytest.mark.parametrize("pushed", [pull((-5.0, 0.0, 0.0), node=0), refweb.Thrust(node=0, line=0, force=-5.0)])
def test_a_push_on_a_node_of_a_body(pushed, fixed):
    """A free body of 10 kg goes F t²/2m with a push on its node, which is no support; on a fixed one it is."""
    hub = refweb.Body(name="hub", radius=0.1, mass=10.0, position=(0.0, 0.0, 0.0), fixed=fixed)
    moved = refweb.Observe(name="moved", quantity="displacement", body="hub", component="x")
    web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[])
    effects, solve = (hub, refweb.Attach(body="hub", node=0), pushed), refweb.Dynamic(duration=0.5)
    found = solved(*effects, web=web, solve=solve, observe=[moved], density=1e-2)
    assert found.results["moved"].value == pytest.approx(0.0 if fixed else -0.0625, rel=1e-5)
    assert len(told(found, "acts only on supports")) == fixed


# Strains


def test_large_strains_in_statics():
    """F = 2 T sin α with T = EA ε and cos α = 1/(1 + ε): at 20 % F = 2 EA ε √(1 − 1/(1 + ε)²)."""
    force = lambda e: 2.0 * 100.0 * e * np.sqrt(1.0 - 1.0 / (1.0 + e) ** 2)  # noqa: E731
    (text,) = told(solved(pull((0.0, 0.0, force(0.21)))), "is strained by 21 %, above 20 %")
    assert text.startswith("line ") and not told(solved(pull((0.0, 0.0, force(0.19)))), "is strained")
    assert told(solved(pull((0.0, 0.0, 1e30))), "is strained by")


STRESS = refweb.Observe(name="stress", quantity="stress", reduce="max")
END = refweb.Observe(name="end", quantity="displacement")
LAWS = [("tension-only", {}), ("linear", {}), ("smooth", dict(smoothing=1e-2, slackness=1e-2))]


@pytest.mark.parametrize("damping", [False, True])
@pytest.mark.parametrize(("law", "keys"), LAWS)
def test_large_strains_in_dynamics(law, keys, damping):
    """A node with all the mass is thrown against two lines: at rest again where EA ε² is ½ m v², 30 and 10 %.

    Between rows: the whole run has two. It is found from the largest stress where that is followed, else by itself.
    """
    for strain, observe in [(s, o) for s in (0.3, 0.1) for o in (STRESS, END)]:
        speed = (2.0 * 100.0 * strain**2) ** 0.5
        effects = [refweb.PointMass(node=1, mass=1.0), refweb.Velocity(node=1, value=(0.0, 0.0, speed))]
        effects += [refweb.Damping(time=1e-9)] * damping
        solve = refweb.Dynamic(duration=0.6, safety=0.05)
        found = told(solved(*effects, solve=solve, law=law, density=1e-3, observe=[observe], **keys), "is strained")
        assert len(found) == (strain > 0.2)
        if found and law != "smooth":
            assert "30" in found[0] or "29.9" in found[0]


@pytest.mark.parametrize("strain", [0.3, 0.1])
@pytest.mark.parametrize("dynamic", [False, True])
def test_large_strains_of_a_thread(dynamic, strain):
    """Of 2 m over a ring halfway: F = 2 EA ε √(1 − 1/(1 + ε)²) in statics; at rest again where EA ε² is ½ m v²."""
    web = refweb.Inline(points=[[-1, 0, 0], [0, 0, 0], [1, 0, 0], [-2, 0, 0]], lines=[[3, 0]], supports=[0, 2, 3])
    rope = refweb.Thread(name="rope", nodes=[0, 1, 2], modulus=1e6, area=1e-4, density=1e-3)
    speed, force = (200.0 * strain**2) ** 0.5, 200.0 * strain * np.sqrt(1.0 - 1.0 / (1.0 + strain) ** 2)
    acts, solve = pull((0.0, 0.0, force)), refweb.Static()
    if dynamic:
        acts, solve = refweb.Velocity(node=1, value=(0.0, 0.0, speed)), refweb.Dynamic(duration=0.6, safety=0.05)
    found = told(solved(rope, refweb.PointMass(node=1, mass=1.0), acts, web=web, solve=solve), "is strained by")
    assert len(found) == (strain > 0.2)
    assert all(text.startswith('thread "rope" is strained by 30 %, above 20 %') for text in found)


def test_a_mean_of_stress_tells_of_no_strain():
    """The largest mean over a window is below the largest value, and says nothing of its strain."""
    mean = refweb.Observe(name="mean", quantity="stress", reduce="max", average=0.3)
    effects = refweb.PointMass(node=1, mass=1.0), refweb.Velocity(node=1, value=(0.0, 0.0, 3.5))
    solution = solved(*effects, solve=refweb.Dynamic(duration=0.6, safety=0.05), density=1e-3, observe=[mean])
    assert solution.results["mean"].value < 0.2 * 1e6 and told(solution, "is strained by 2")


# Collapse


def test_a_structure_that_collapses():
    """Three legs under a weight hang below their feet; as bars they stand, and so does a net that merely sags."""
    down = pull((0.0, 0.0, -1.0), node=3)
    (text,) = told(solved(down, web=MAST), "the web collapses: node 3 moves by ")
    assert "supports or lines" in text
    assert not told(solved(down, web=MAST, law="linear"), "collapses")
    assert not told(solved(pull((0.0, 0.0, -1.0))), "collapses")
    assert not told(solved(pull((0.0, 0.0, 1.0), node=3), web=MAST), "collapses")


def test_what_is_moved_does_not_collapse():
    far = refweb.Motion(node=[0, 2], displacement=[[0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 9.0]])
    assert not told(solved(far, pull((0.0, 0.0, 1.0))), "collapses")


def test_what_is_paid_out_does_not_collapse():
    """A line of 1 m that a reel makes ten times as long lets its load move by 9 m; a mast falls beside a short one."""
    out = refweb.Reel(lines=0, factor=[(0.0, 1.0), (1.0, 10.0)])
    line = refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0])
    assert not told(solved(out, pull((1.0, 0.0, 0.0)), web=line), "collapses")
    little = refweb.Reel(lines=0, factor=[(0.0, 1.0), (1.0, 1.01)])
    assert told(solved(little, pull((0.0, 0.0, -1.0), node=3), web=MAST), "the web collapses: node 3 moves by ")


# Contact


def test_a_body_that_never_touches():
    """Named, beside one that does; without [contact] that is said instead."""
    near = refweb.Body(name="near", radius=0.1, mass=1.0, position=(0.0, 0.0, -0.101), velocity=(0.0, 0.0, 1.0))
    away = refweb.Body(name="away", radius=0.1, mass=1.0, position=(0.0, 0.0, -9.0))
    solution = solved(near, away, refweb.Contact(stiffness=1e5), solve=refweb.Dynamic(duration=0.01))
    assert told(solution, "never touches") == ['body "away" never touches the web, though there is a [contact]']
    still = refweb.Body(name="still", radius=0.1, fixed=True, position=(0.0, 0.0, -9.0))
    solution = solved(still, refweb.Contact(stiffness=1e5), pull((0.0, 0.0, 1.0)))
    assert told(solution, "never touches") == ['body "still" never touches the web, though there is a [contact]']


# The floor of the smooth law


def test_the_stress_that_a_floor_is_held_against_is_the_largest_of_the_run():
    """In dynamics of all steps, whatever is observed: by an observable of a run of the same scene."""
    keys = dict(law="smooth", smoothing=1e-2, area=3e-4, solve=refweb.Dynamic(duration=0.05))
    peak = refweb.Observe(name="peak", quantity="stress", reduce="max")
    place = refweb.Observe(name="place", quantity="displacement")
    found = {one.name: solved(pull((0.0, 0.0, 0.1)), observe=[one], **keys) for one in (peak, place)}
    (text,) = told(found["place"], "of the largest stress")
    stress = float(re.search(r"largest stress (\S+) Pa", text)[1])
    assert stress == float(f"{found['peak'].results['peak'].value:.4g}") > 0.0
