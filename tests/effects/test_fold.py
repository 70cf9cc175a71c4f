"""Folded starts: slack, free of overlap, with natural lengths untouched; and runs that begin from them."""

import nets
import numpy as np
import pytest
import scipy.optimize
from jsonschema import Draft4Validator

import refweb
from refweb.net.folding import distances, nearest_lines
from refweb.net.web import Web
from refweb.reference.schema import schema

GAP = 2e-3
METHODS = ["central-difference", "cvode", "ida"]


def net(web=None, effects=(), fold=None, **parts):
    """A net that nothing holds, of round lines of 2 mm, with corner masses."""
    return refweb.Scene(
        web=web or refweb.Window(mesh="square", rows=8, columns=8, side=0.25),
        cable=refweb.Cable(
            law="tension-only", modulus=1e7, area=np.pi * (0.5 * GAP) ** 2, density=1000.0, **parts.pop("cable", {})
        ),
        effects=[refweb.Fold(**(fold or dict(ratio=0.3, gap=GAP))), *effects],
        supports=refweb.Supports(nodes=[]),
        **dict(solve=refweb.Dynamic(duration=0.02), output=refweb.Output(interval=5e-3)) | parts,
    )


def sampled(a, b, c, d):
    """Distance of two segments by a bounded minimization from several starts: another program."""

    def square(at):
        apart = a + at[0] * (b - a) - c - at[1] * (d - c)
        return apart @ apart

    starts = [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0), (0.5, 0.5)]
    found = [scipy.optimize.minimize(square, s, bounds=[(0, 1)] * 2, method="L-BFGS-B", tol=1e-18) for s in starts]
    return np.sqrt(min(one.fun for one in found))


@pytest.mark.slow
def test_distance_of_segments():
    """By minimization of a convex function, and where lines are parallel, cross or have no length."""
    rng = np.random.default_rng(1)
    ends = rng.standard_normal((30, 2, 3))
    ends[:10, :, 2] = 0.0  # in a plane: some cross
    ends[11, 1] = ends[11, 0]
    ends[13] = ends[12] + [0.3, 0.1, 0.0]
    ends[15] = ends[14] + 0.4 * (ends[14, 1] - ends[14, 0])  # on one line, overlapping
    pairs = np.arange(30).reshape(-1, 2)
    found = distances(ends[:, 0], ends[:, 1], pairs)
    expected = [sampled(*ends[i], *ends[j]) for i, j in pairs]
    np.testing.assert_allclose(found, expected, atol=2e-7)  # of a minimum of 1e-14 in the square
    assert found[7] == pytest.approx(0.0, abs=1e-12)


def every_distance(points, lines):
    """Least distance of all pairs of lines without a common node, each pair looked at."""
    i, j = np.triu_indices(len(lines), 1)
    apart = (lines[i][:, :, None] != lines[j][:, None, :]).all(axis=(1, 2))
    pairs = np.column_stack([i[apart], j[apart]])
    return distances(points[lines[:, 0]], points[lines[:, 1]], pairs).min()


@pytest.mark.parametrize("mesh", ["square", "triangle", "hexagon"])
@pytest.mark.parametrize("cable", [{}, {"prestrain": -0.05}])
def test_a_star_is_slack_and_free_of_overlap(mesh, cable):
    web = refweb.Window(mesh=mesh, rows=8, columns=8, side=0.25)
    system = net(web, cable=cable).build()
    flat, lines = system.net.web, system.net.web.lines
    points = flat.points + system.laid[: len(flat.points)]
    size = np.linalg.norm(points[lines[:, 1]] - points[lines[:, 0]], axis=1)
    assert (size < 0.9 * system.net.natural_length).all()
    plain = net(web, cable=cable).replace(effects=()).build()
    np.testing.assert_array_equal(system.net.natural_length, plain.net.natural_length)
    assert every_distance(points, lines) >= GAP
    assert nearest_lines(points, lines, 1.0)[0] == pytest.approx(every_distance(points, lines), rel=1e-12)
    hub = flat.points[flat.centre]
    before, after = (np.linalg.norm(places - hub, axis=1) for places in (flat.points, points))
    np.testing.assert_allclose(after, 0.3 * before, atol=1e-14)


def test_nodes_between_lie_on_their_lines():
    """Of subdivided and of curved elements: every element is as slack as its line."""
    for cable in (dict(subdivide=3), dict(order=2, subdivide=2), dict(order=3)):
        scene = net(cable=cable, solve=refweb.Dynamic(duration=0.02, method="cvode"))
        system = scene.build()
        places = system.net.points + system.laid
        whole = places[system.net.web.lines]
        size = np.linalg.norm(whole[:, 1] - whole[:, 0], axis=1)[system.net.line] / system.net.subdivide
        ends = places[system.net.cells[:, :2]]
        np.testing.assert_allclose(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), size, rtol=1e-12)
        inner = np.einsum("c,cx->cx", np.ones(len(ends)), ends[:, 1] - ends[:, 0])
        for a, place in enumerate(system.net.places):
            np.testing.assert_allclose(places[system.net.cells[:, a]], ends[:, 0] + place * inner, atol=1e-14)


@pytest.mark.parametrize("method", METHODS)
def test_a_folded_net_flies_and_spins(method):
    """At rest it stays, without tension; thrown and spun about its hub all of it moves as it was told to begin with."""
    spin = refweb.Velocity(node="all", value=(0.0, 0.0, 5.0), spin=(0.0, 0.0, 3.0))
    solution = refweb.run(net(effects=[spin], solve=refweb.Dynamic(duration=0.02, method=method)))
    system = solution.state.system
    places, mass = system.net.points + system.laid, system.net.mass
    assert not solution.history["max_tension"].any() and not solution.history["strain_energy"].any()
    speed = np.array([0, 0, 5.0]) + np.cross([0, 0, 3.0], places)
    np.testing.assert_allclose(solution.state.v, speed, atol=1e-9)
    np.testing.assert_allclose(solution.state.position, places + 0.02 * speed, atol=1e-9)
    assert solution.history["kinetic_energy"][0] == pytest.approx(0.5 * mass @ (speed**2).sum(axis=1), rel=1e-12)


def test_it_unfolds(tmp_path):
    """Spun fast enough the web opens and is taut; books close, results have ±, and the start is the first frame."""
    spin = refweb.Velocity(node="all", spin=(0.0, 0.0, 40.0))
    scene = net(effects=[spin, refweb.PointMass(node="corners", mass=0.05)], solve=refweb.Dynamic(duration=0.15))
    solution = refweb.run(scene, out=tmp_path / "run")
    assert solution.history["max_tension"][0] == 0.0 and solution.results["max_tension"].value > 0.0
    assert solution.results["max_tension"].error > 0.0 and solution.solver["energy_drift"] < 1e-2
    size = np.linalg.norm(solution.state.position[: solution.state.system.net.nodes, :2], axis=1).max()
    assert size > 1.5 * 0.3 * np.hypot(1.0, 1.0)
    resumed = refweb.load(tmp_path / "run")
    np.testing.assert_array_equal(resumed.state.x, solution.state.x)


def test_positions_of_a_file(tmp_path):
    """Those of a star, written out and read back, are the same start; through a scene file as well."""
    star = net()
    system = star.build()
    flat = system.net.web
    points = flat.points + system.laid[: len(flat.points)]
    text = "x, y, z\n" + "".join(",".join(map(repr, row)) + "\n" for row in points.tolist())
    (tmp_path / "folded.csv").write_text(text)
    given = star.replace(title="one").to_dict()
    given["fold"] = {"kind": "positions", "file": "folded.csv", "gap": GAP}
    import tomli_w

    (tmp_path / "net.toml").write_text(tomli_w.dumps(given))
    found = refweb.Scene.load(tmp_path / "net.toml").build()
    np.testing.assert_array_equal(found.laid, system.laid)
    (tmp_path / "folded.csv").write_text("x,y,z\n0,0,0\n")
    with pytest.raises(refweb.InputError, match=r"\[fold\].*has 1 rows, must have one for each of"):
        refweb.Scene.load(tmp_path / "net.toml").build()


@pytest.mark.parametrize(
    "fold, words",
    [
        (dict(ratio=0.3, turns=3.0), r"line \d+ would be taut: its ends are .* m apart"),
        (dict(ratio=0.02, turns=0.0, gap=0.01), "m apart, must be ≥ gap = 0.01"),
        (dict(ratio=1.2), "ratio = 1.2 must be < 1"),
        (dict(kind="positions"), "file is missing"),
        (dict(kind="positions", file="a.csv", turns=1.0), "turns has no meaning"),
        (dict(kind="positions", file="/nowhere/a.csv"), "there is no file"),
        (dict(ratio=0.3, axis=(0, 0, 0)), "must have a direction"),
        (dict(ratio=0.3, hub="rim"), 'hub = "rim" is 28 nodes, must be one'),
    ],
)
def test_what_cannot_be_folded(fold, words):
    with pytest.raises(refweb.InputError, match=words):
        net(fold=fold).build()


def test_the_web_may_say_how_it_is_folded(tmp_path):
    """As `[fold]` does: the same scene."""
    plain, given = net(), net().to_dict()
    del given["fold"]
    web, table = given.pop("web"), plain.to_dict()["fold"]
    for said in ({"fold": table}, {"fold": "star"}, {"positions": "a.csv"}):
        scene = refweb.Scene.from_dict({**given, "web": web | said}, tmp_path)
        own = said["fold"] if "fold" in said else {"kind": "positions", "file": str(tmp_path / "a.csv")}
        fold = own if isinstance(own, dict) else {"kind": own}
        assert scene.to_dict() == refweb.Scene.from_dict({**given, "web": web, "fold": fold}, tmp_path).to_dict()
        assert list(Draft4Validator(schema()).iter_errors({**given, "web": web | said})) == []
    with pytest.raises(refweb.InputError, match="folded twice"):
        refweb.Scene.from_dict({**given, "web": web | {"fold": "star"}, "fold": {"ratio": 0.3}})
    with pytest.raises(refweb.InputError, match='kind = "sta" .*did you mean "star"'):
        refweb.Scene.from_dict({**given, "web": web | {"fold": "sta"}})


def test_a_star_by_itself():
    """What is left out has values that fold webs of the paper."""
    for mesh in ("square", "triangle", "hexagon"):
        system = net(refweb.Window(mesh=mesh, rows=8, columns=8, side=0.25), fold=dict(kind="star", gap=GAP)).build()
        reach = np.linalg.norm((system.net.points + system.laid)[: system.net.nodes, :2], axis=1).max()
        assert 0.4 < reach / np.linalg.norm(system.net.points[: system.net.nodes, :2], axis=1).max() < 0.6


def test_other_refusals():
    held = net().replace(supports=None)
    with pytest.raises(refweb.InputError, match=r"\[fold\] node \d+ would move, and is supported"):
        held.build()
    with pytest.raises(refweb.InputError, match="cannot be used in statics"):
        net(solve=refweb.Static(), output=refweb.Output()).build()
    with pytest.raises(refweb.InputError, match='start = "equilibrium" must be "web" with'):
        net(solve=refweb.Dynamic(duration=0.01, start="equilibrium")).build()
    crossed = Web([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 2], [1, 3]], [2.0, 2.0])
    with pytest.raises(refweb.InputError, match="lines 0 and 1 would be .* m apart, must be ≥ gap"):
        net(crossed, fold=dict(ratio=0.5, hub=0)).build()


def test_nothing_is_laid_without_it():
    assert nets.system(nets.skew_web(), nets.skew_cable()).laid is None
