"""Numbers of a throw against closed forms: a mouth on springs, solid angles, hulls, and what is not known."""

import numpy as np
import pytest

import refweb
from refweb.net.web import Web
from refweb.results.summary_text import on_run
from refweb.results.throw import Throw, covered, depth_in_hull, side_of_mouth, solid_angle
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
    """A run that ends while the mouth opens says so, with ± of what it came to by then."""
    solution, rate = refweb.run(thrown(duration=0.03)), np.sqrt(STIFF / MASS)
    area = 2.0 * (1.0 + OUT / rate * np.sin(rate * 0.03)) ** 2
    expected = dict(largest_area=area, deployment_time=0.03, travelled=ALONG * 0.03, effective_period=0.03)
    for name, value in expected.items():
        found = solution.throw[name]
        assert found["at_least"] and abs(found["value"] - value) <= found["error"] + 1e-15 < 0.02 * value, name
    cells = cells_of(solution.summary())
    assert cells["largest_area ±"] is None and cells["largest_area most"] == np.inf
    assert (
        cells["largest_area least"] == solution.throw["largest_area"]["value"] - solution.throw["largest_area"]["error"]
    )


def test_without_a_twin_nothing_is_known_and_it_says_so():
    hub = refweb.Body(name="target", radius=0.01, mass=1.0, position=(0.0, 0.0, 1.0))
    scene = thrown(effects=[hub], throw=Throw(area="mouth", target="target"), accuracy=refweb.Accuracy(error="none"))
    solution = refweb.run(scene)
    assert all(entry["error"] is None for entry in solution.throw.values())
    assert solution.throw["inside"]["value"] is solution.throw["closed"]["value"] is None
    texts = [text for _, text in on_run(solution.summary()) if text.split()[0] in ("deployment", "inside", "closed")]
    assert len(texts) == 3 and all("not known" in text and "no step refinement" in text for text in texts)
    cells = cells_of(solution.summary())
    assert cells["statistical"] == "" and cells["inside ±"] is None and cells["inside [1]"] == 0.0


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


def test_depth_in_a_hull_and_side_of_a_mouth():
    """In a cube of edge 2 the nearest face; of points in a plane the distance from it, and no inside."""
    cube = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    mouth = np.array([[1, 1, 1], [-1, 1, 1], [-1, -1, 1], [1, -1, 1]], dtype=float)
    for place, depth, side in (
        ((0.2, 0.0, 0.5), 0.5, 0.5),
        ((0.2, 0.0, 1.25), -0.25, -0.25),
        ((3.0, 0, -9), -8.0, 1.0),
    ):
        assert depth_in_hull(cube, np.array(place)) == pytest.approx(depth, rel=1e-12)
        assert side_of_mouth(mouth, cube, np.array(place)) == pytest.approx(side, rel=1e-12)
    assert depth_in_hull(mouth, np.array([0.0, 0.0, 1.5])) == pytest.approx(-0.5, rel=1e-12)


def test_share_of_directions():
    """Five faces of a cube cover 5/6, a hemisphere ½, from its centre; a disc at a distance what it is seen under."""
    cube = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    mouth = np.array([[1, 1, 1], [-1, 1, 1], [-1, -1, 1], [1, -1, 1]], dtype=float)
    centre = np.zeros(3)
    assert depth_in_hull(cube, centre) > 0.0
    assert covered(mouth, cube, centre, True) == pytest.approx(5.0 / 6.0, rel=1e-12)
    above = np.array([0.0, 0.0, 3.0])
    assert not depth_in_hull(cube, above) > 0.0
    assert covered(mouth, cube, above, False) == solid_angle(mouth, above) / (4.0 * np.pi)
    rings = [ring(np.sin(a), -np.cos(a)) for a in np.linspace(0.01, 0.5 * np.pi, 20)]
    bowl, rim = np.vstack(rings), rings[-1]
    inside = np.array([0.0, 0.0, -1e-6])
    assert depth_in_hull(bowl, inside) > 0.0 and covered(rim, bowl, inside, True) == pytest.approx(0.5, abs=1e-5)
    disc = ring(1.0, 0.0)
    assert not depth_in_hull(disc, np.array([0.0, 0.0, 1.0])) > 0.0
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
    """What ± leaves undecided may be 0 or 1; what twins tell nothing of is one draw; a result goes first."""
    mine = {"value": 3.0, "error": 0.5, "unit": "m", "time": 0.0, "where": None}
    throw = {
        "inside": {"value": None, "drawn": True, "margin": 0.1, "error": 0.2},
        "closed": {"value": False, "drawn": False, "margin": -1.0, "error": 0.2},
        "covered": {"value": 0.25, "error": None, "unit": "1", "reason": "it is late", "statistical": True},
        "travelled": {"value": 7.0, "error": 0.1, "unit": "m"},
        "effective_period": {"value": 2.0, "error": 0.5, "unit": "s", "at_least": True},
    }
    given = {"status": "solved", "message": "", "results": {"travelled": mine}, "throw": throw}
    cells = cells_of(given)
    assert cells["inside [1]"] == 1.0 and [cells[f"inside {end}"] for end in ("±", "least", "most")] == [1.0, 0.0, 1.0]
    assert cells["closed [1]"] == 0.0 and cells["closed ±"] == 0.0 and "closed least" not in cells
    assert cells["covered [1]"] == 0.25 and cells["travelled [m]"] == 3.0 and cells["travelled ±"] == 0.5
    assert cells["effective_period least"] == 1.5 and cells["effective_period most"] == np.inf
    assert cells["statistical"] == "covered"
    texts = [text for _, text in on_run(given)]
    assert texts[:3] == [
        "inside undecided, yes in this run",
        "closed no",
        "covered 0.25, its ± is not known: it is late",
    ]
    assert texts[4] == "effective period at least 2.00 ± 0.50 s"


class Scripted(Throw):
    """A throw whose capture is what its state says."""

    def _capture(self, state, mouth, largest):
        return dict(zip(("inside", "closed", "covered", "side"), state, strict=True))


@pytest.fixture
def hump():
    """Rows of a mouth whose area is largest at t = π/6, between rows at 0.5 and 0.6."""
    return np.column_stack([np.linspace(0.0, 1.0, 11), np.sin(np.linspace(0.0, 3.0, 11))])


MOUTH = [refweb.Observe(name="mouth", quantity="mouth_area", node=[0, 1, 2])]


def test_what_lies_within_its_error_is_undecided(hump):
    """± is three times what run and twin differ by: a depth of 0.1 m is inside where that is below 0.1/3 m."""
    throw = Scripted(area="mouth", target="one")
    for refined, decided in ((0.08, True), (0.06, False), (-0.1, False), (0.12, True), (0.14, False)):
        found = throw.results(MOUTH, hump, (0.1, -1.0, 0.2, 5.0), (hump, (refined, -1.0, 0.2, 5.0)), 3.0)
        inside = found["inside"]
        assert inside["value"] is (True if decided else None) and inside["drawn"] is True
        assert inside["error"] == pytest.approx(3.0 * abs(refined - 0.1)) and inside["margin"] == 0.1
        assert found["closed"]["value"] is False
        # either side of the mouth: what is covered is 0.2 or 0.8
        assert found["covered"]["error"] == pytest.approx(0.0 if decided else 0.6, abs=1e-12)
    found = throw.results(MOUTH, hump, (0.1, -1.0, 0.2, 0.5), (hump, (0.1, -1.0, 0.2, 0.2)), 3.0)
    assert found["inside"]["value"] is True and found["covered"]["error"] == pytest.approx(0.6)
    found = throw.results(MOUTH, hump, (-0.1, 0.1, 0.2, 0.5), (hump, (-0.1, 0.05, 0.2, 0.2)), 3.0)
    assert found["inside"]["value"] is False and found["covered"]["error"] < 1e-12  # outside the side has no meaning
    assert found["closed"]["value"] is None and found["closed"]["drawn"] is True


def test_the_closed_share_is_of_an_area_that_has_an_error(hump):
    """Half the rows make another largest area, and a mouth that is as near to closed is undecided."""
    throw = Scripted(area="mouth", target="one", closed=0.5)
    coarse = throw.results(MOUTH, hump, (1.0, 1.0, 0.2, 1.0), (hump, (1.0, 1.0, 0.2, 1.0)), 3.0)
    off = 0.5 * coarse["largest_area"]["error"]
    assert coarse["closed"]["error"] == pytest.approx(off) and off > 0.0
    for margin, value in ((0.9 * off, None), (1.1 * off, True), (-1.1 * off, False)):
        state = (1.0, margin, 0.2, 1.0)
        assert throw.results(MOUTH, hump, state, (hump, state), 3.0)["closed"]["value"] is value


def test_nothing_is_known_behind_the_time_that_the_twin_tells_of(hump):
    throw, state = Scripted(area="mouth", target="one"), (0.1, -1.0, 0.2, 1.0)
    late = throw.results(MOUTH, hump, state, (hump, state), 3.0, hump[-1, 0])["inside"]
    assert (
        late["value"] is None and late["error"] is None and late["statistical"] and "from t = 1 s on" in late["reason"]
    )
    for known, told in ((0.7, True), (0.5, False)):
        found = throw.results(MOUTH, hump, state, (hump, state), 3.0, known)
        assert (found["deployment_time"]["error"] is not None) == told == (found["largest_area"]["error"] is not None)
        assert ("reason" in found["deployment_time"]) != told


def test_what_is_a_bound_in_the_twin_is_one(hump):
    """The area of the twin still rises at its end: what the run has as its largest one may not be that."""
    rising = hump[:6]
    found = Throw(area="mouth").results(MOUTH, hump, None, (rising, None), 3.0)
    assert found["largest_area"]["at_least"] and found["largest_area"]["error"] > 0.0


def test_it_is_written_and_read(tmp_path):
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
