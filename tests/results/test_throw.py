"""Numbers of a throw against closed forms: a mouth on springs, solid angles, hulls, and what is not known."""

import numpy as np
import pytest

import refweb
from refweb.net.web import Web
from refweb.results.throw import Throw, covered, in_hull, solid_angle
from refweb.sweeps.case import cells_of

METHODS = ["central-difference", "cvode", "ida"]
CORNERS = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
FINER = {"central-difference": {"safety": 0.05}}
OUT, ALONG, MASS = 2.0, 5.0, 0.1
STIFF = 100.0
"""Stiffness of a spoke of 1 m [N/m]."""


def thrown(method="central-difference", duration=0.1, effects=(), throw=None, **parts):
    """Four masses on elastic spokes that fly apart at `OUT` m/s and, with their hub, up at `ALONG` m/s."""
    web = refweb.Inline(points=[*CORNERS.tolist(), [0.0] * 3], lines=[[i, 4] for i in range(4)])
    speeds = [OUT * corner + [0.0, 0.0, ALONG] for corner in CORNERS]
    velocities = [refweb.Velocity(node=i, value=tuple(speed)) for i, speed in enumerate(speeds)]
    return refweb.Scene(
        web=web,
        cable=refweb.Cable(law="linear", modulus=STIFF / 1e-6, area=1e-6, density=0.0),
        effects=[
            refweb.PointMass(node="all", mass=MASS),
            refweb.Velocity(node=4, value=(0.0, 0.0, ALONG)),
            *velocities,
            *effects,
        ],
        supports=refweb.Supports(nodes=[]),
        throw=throw or Throw(area="mouth", travel="height"),
        **dict(
            solve=refweb.Dynamic(
                duration=duration, method=method, **({"safety": 0.05} if method == METHODS[0] else {})
            ),
            output=refweb.Output(interval=1e-3),
            observe=[
                refweb.Observe(name="mouth", quantity="mouth_area", node=[0, 1, 2, 3], reduce="max"),
                refweb.Observe(name="height", quantity="position", node=4, component="z", reduce="final"),
            ],
        )
        | parts,
    )


@pytest.mark.parametrize("method", METHODS)
def test_a_mouth_on_springs(method):
    """Masses at r = 1 + v/ω sin ωt from the hub: the area 2 r² is largest at a quarter of the period."""
    rate = np.sqrt(STIFF / MASS)
    far = 1.0 + OUT / rate
    share = 0.95
    near = np.arcsin((np.sqrt(share) * far - 1.0) * rate / OUT)
    solution = refweb.run(thrown(method, throw=Throw(area="mouth", travel="height", share=share)))
    expected = dict(
        largest_area=2.0 * far**2,
        deployment_time=0.5 * np.pi / rate,
        travelled=ALONG * 0.5 * np.pi / rate,
        effective_period=(np.pi - 2.0 * near) / rate,
    )
    for name, value in expected.items():
        found = solution.throw[name]
        assert abs(found["value"] - value) < found["error"] < 0.02 * value, name
    assert solution.results["mouth"].value == pytest.approx(solution.throw["largest_area"]["value"], rel=1e-4)


def test_lower_bounds():
    """A run that ends while the mouth opens says so, and gives no ±."""
    solution = refweb.run(thrown(duration=0.03))
    for name in ("largest_area", "deployment_time", "travelled", "effective_period"):
        assert solution.throw[name]["at_least"] and solution.throw[name]["error"] is None
    without = refweb.run(thrown(accuracy=refweb.Accuracy(error="none")))
    assert without.throw["deployment_time"]["error"] is None and "at_least" not in without.throw["deployment_time"]


def ring(radius, height, count=400):
    angle = 2.0 * np.pi * np.arange(count) / count
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(count, height)])


def test_solid_angles():
    """2π (1 − cos α) of a cone, 4π/6 of a face of a cube."""
    for alpha in (0.2, 0.8, 1.4):
        found = solid_angle(ring(np.sin(alpha), np.cos(alpha)), np.zeros(3))
        assert found == pytest.approx(2.0 * np.pi * (1.0 - np.cos(alpha)), rel=1e-4)  # of 400 corners
    face = np.array([[1, 1, 1], [-1, 1, 1], [-1, -1, 1], [1, -1, 1]], dtype=float)
    assert solid_angle(face, np.zeros(3)) == pytest.approx(4.0 * np.pi / 6.0, rel=1e-12)
    assert solid_angle(face, np.array([0.0, 0.0, 1.0 - 1e-9])) == pytest.approx(2.0 * np.pi, rel=1e-6)


def test_share_of_directions():
    """Five faces of a cube cover 5/6, a hemisphere ½, from its centre; a disc at a distance what it is seen under."""
    cube = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    mouth = np.array([[1, 1, 1], [-1, 1, 1], [-1, -1, 1], [1, -1, 1]], dtype=float)
    centre = np.zeros(3)
    assert in_hull(cube, centre) and covered(mouth, cube, centre, True) == pytest.approx(5.0 / 6.0, rel=1e-12)
    above = np.array([0.0, 0.0, 3.0])
    assert not in_hull(cube, above)
    assert covered(mouth, cube, above, False) == solid_angle(mouth, above) / (4.0 * np.pi)
    rings = [ring(np.sin(a), -np.cos(a)) for a in np.linspace(0.01, 0.5 * np.pi, 20)]
    bowl, rim = np.vstack(rings), rings[-1]
    inside = np.array([0.0, 0.0, -1e-6])
    assert in_hull(bowl, inside) and covered(rim, bowl, inside, True) == pytest.approx(0.5, abs=1e-5)
    disc = ring(1.0, 0.0)
    assert not in_hull(disc, np.array([0.0, 0.0, 1.0]))
    seen = 0.5 * (1.0 - np.cos(0.25 * np.pi))
    assert covered(disc, disc, np.array([0.0, 0.0, 1.0]), False) == pytest.approx(seen, rel=1e-4)


def test_a_target_in_a_net():
    """The hub as a pyramid's tip: the target inside it, under the mouth, and then above it."""
    for height, inside in ((0.9, True), (1.3, False)):
        hub = refweb.Body(name="target", radius=0.01, mass=1.0, position=(0.0, 0.0, height))
        scene = thrown(effects=[hub], throw=Throw(area="mouth", target="target"), duration=0.01)
        points = np.vstack([CORNERS + [0.0, 0.0, 1.0], np.zeros(3)])
        lines = [[i, 4] for i in range(4)]
        still = [e for e in scene.effects if not isinstance(e, refweb.Velocity)]
        solution = refweb.run(scene.replace(web=Web(points, lines), effects=still))
        found = solution.throw
        angle = solid_angle(points[:4], np.array([0.0, 0.0, height])) / (4.0 * np.pi)
        assert found["inside"]["value"] is inside and found["closed"]["value"] is False
        assert found["covered"]["value"] == pytest.approx(1.0 - angle if inside else angle, rel=1e-12)
        assert found["covered"]["error"] < 1e-9
        assert scene.throw.numbers == list(found)
        cells = cells_of(solution.summary())
        assert cells["inside [1]"] == inside and cells["inside ±"] == 0.0 and cells["statistical"] == ""
        assert cells["covered [1]"] == found["covered"]["value"]


def test_cells_of_what_is_not_known():
    """What twins do not agree on is one draw; a result of the same name goes first."""
    mine = {"value": 3.0, "error": 0.5, "unit": "m", "time": 0.0, "where": None}
    throw = {
        "inside": {"value": None, "drawn": True},
        "closed": {"value": False, "drawn": False},
        "covered": {"value": 0.25, "error": None, "unit": "1"},
        "travelled": {"value": 7.0, "error": 0.1, "unit": "m"},
        "effective_period": {"value": 2.0, "error": None, "unit": "s", "at_least": True},
    }
    cells = cells_of({"status": "solved", "message": "", "results": {"travelled": mine}, "throw": throw})
    assert cells["inside [1]"] == 1.0 and cells["inside ±"] is None
    assert cells["closed [1]"] == 0.0 and cells["closed ±"] == 0.0
    assert cells["covered [1]"] == 0.25 and cells["travelled [m]"] == 3.0 and cells["travelled ±"] == 0.5
    assert cells["effective_period least"] == 2.0 and cells["effective_period most"] == np.inf
    assert cells["statistical"] == "inside covered"


def test_what_run_and_twin_disagree_on_is_not_known():
    rows = np.column_stack([np.linspace(0.0, 1.0, 11), np.sin(np.linspace(0.0, 3.0, 11))])

    class Twin(Throw):
        """Says something else of a state each time."""

        def _capture(self, state, mouth, largest):
            return {"inside": state, "covered": 0.5}

    observables = [refweb.Observe(name="mouth", quantity="mouth_area", node=[0, 1, 2])]
    throw = Twin(area="mouth", target="one")
    undecided = {"value": None, "drawn": True}
    assert throw.results(observables, rows, True, (rows, False), 3.0)["inside"] == undecided
    assert throw.results(observables, rows, True, (rows, True), 3.0, rows[-1, 0])["inside"] == undecided
    assert throw.results(observables, rows, True, (rows, True), 3.0)["inside"] == {"value": True, "drawn": True}
    for known, told in ((0.7, True), (0.5, False)):  # the largest area is at t = π/6, between rows at 0.4 and 0.6
        found = throw.results(observables, rows, True, (rows, True), 3.0, known)
        assert (found["deployment_time"]["error"] is not None) == told == (found["largest_area"]["error"] is not None)


def test_it_is_written_and_read(tmp_path):
    from refweb.results.summary_text import on_run

    scene = thrown()
    solution = refweb.run(scene, out=tmp_path / "run")
    told = [text for _, text in on_run(solution.summary()) if text.startswith("deployment time ")]
    assert len(told) == 1 and solution.summary()["throw"] == solution.throw
    assert refweb.load(tmp_path / "run").throw == solution.throw
    assert refweb.run(scene.replace(throw=None)).summary().keys().isdisjoint({"throw"})


@pytest.mark.parametrize(
    "throw, words",
    [
        (dict(area="moth"), r"\[throw\] area = \"moth\" is not an observable, did you mean \"mouth\""),
        (dict(area="height"), "must be an observable of quantity"),
        (dict(area="mouth", travel="mouth"), "must be an observable in m, not m²"),
        (dict(area="mouth", target="ball"), "is not a body"),
    ],
)
def test_refusals(throw, words):
    with pytest.raises(refweb.InputError, match=words):
        thrown(throw=Throw(**throw)).build()
