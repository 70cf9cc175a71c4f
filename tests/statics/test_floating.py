"""Positions that an equilibrium leaves open: parts that float between slack lines, and what moves at no cost.

The truth are two cone programs of Clarabel. The first, Π = Σ ½ k e² − f·x with |x_a − x_b| ≤ L + e, finds the vectors
of taut lines; the second the least and the largest of a coordinate among all nets whose taut lines are these vectors.
"""

import numpy as np
import pytest
from scipy.sparse import csc_matrix

import refweb

MODULUS, AREA = 1e7, 1e-4
TAUT = 1e-7
"""Strain from which on a line is taut for the truth, beside 1e-3 from loads of 1 N."""


def scene(points, lines, lengths, supports, loads, components=(), observe=(), **changes):
    """A net of given natural lengths; ``components`` are pairs of a node and the axes it is held along as well."""
    return refweb.Scene(
        web=refweb.Inline(points=points, lines=lines, natural_length=lengths, supports=supports),
        cable=refweb.Cable(law=changes.pop("law", "tension-only"), modulus=MODULUS, area=AREA, density=0.0),
        support=[refweb.Supports(nodes=node, components=axes) for node, axes in components],
        effects=[refweb.Load(node=node, force=force) for node, force in loads],
        observe=observe,
        **{"solve": refweb.Static(), **changes},
    )


def every_coordinate(nodes):
    return [
        refweb.Observe(name=f"{axis}{node}", quantity="position", node=node, component=axis)
        for node in range(nodes)
        for axis in "xyz"
    ]


class Program:
    """The cone programs of a net; ``held`` are its fixed components 3 node + axis."""

    def __init__(self, points, lines, lengths, held, loads):
        self.points, self.lines, self.lengths = np.array(points, dtype=float), np.array(lines), np.array(lengths)
        self.free = np.setdiff1d(np.arange(self.points.size), held)
        count, unknowns = len(lines), len(self.free)
        turn = np.zeros((count, 3, self.points.size))
        for k, (a, b) in enumerate(lines):
            turn[k, range(3), 3 * b + np.arange(3)], turn[k, range(3), 3 * a + np.arange(3)] = 1.0, -1.0
        fixed = self.points.ravel().copy()
        fixed[self.free] = 0.0
        self.turn, self.there = turn[:, :, self.free], turn @ fixed
        load = np.zeros(self.points.shape)
        for node, force in loads:
            load[node] += force
        stiffness = MODULUS * AREA / self.lengths
        weight = np.diag(np.concatenate([np.zeros(unknowns), stiffness]))
        rows, rest = [np.hstack([np.zeros((count, unknowns)), np.eye(count)])], [np.zeros(count)]
        for k in range(count):
            stretch = np.zeros((1, unknowns + count))
            stretch[0, unknowns + k] = 1.0
            rows += [stretch, np.hstack([self.turn[k], np.zeros((3, count))])]
            rest += [[self.lengths[k]], self.there[k]]
        goal = np.concatenate([-load.ravel()[self.free], np.zeros(count)])
        found = solved(weight, goal, rows, rest, 0, count, count)
        self.vectors = self.turn @ found[:unknowns] + self.there
        self.taut = np.linalg.norm(self.vectors, axis=1) > (1.0 + TAUT) * self.lengths

    def ends(self, at):
        """Least and largest coordinate 3 node + axis in all equilibria [m]."""
        if at not in self.free:
            return (self.points.ravel()[at],) * 2
        rows = [self.turn[k] for k in np.flatnonzero(self.taut)]
        rest = [self.there[k] - self.vectors[k] for k in np.flatnonzero(self.taut)]
        for k in np.flatnonzero(~self.taut):
            rows += [np.zeros((1, len(self.free))), self.turn[k]]
            rest += [[self.lengths[k]], self.there[k]]
        goal, slack = np.zeros(len(self.free)), np.count_nonzero(~self.taut)
        found = []
        for sign in (1.0, -1.0):
            goal[np.searchsorted(self.free, at)] = sign
            x = solved(np.zeros((len(goal), len(goal))), goal, rows, rest, 3 * (len(self.lines) - slack), 0, slack)
            found.append(x[np.searchsorted(self.free, at)])
        return tuple(found)


def solved(weight, goal, rows, rest, zeros, positive, cones):
    """The least of ½ x·W x + goal·x with R x + r zero, not negative, and in cones of four, in this order of rows."""
    clarabel = pytest.importorskip("clarabel")
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-11
    kinds = [clarabel.ZeroConeT(zeros), clarabel.NonnegativeConeT(positive), *[clarabel.SecondOrderConeT(4)] * cones]
    matrices = csc_matrix(weight), goal, csc_matrix(-np.vstack(rows)), np.concatenate(rest)
    return np.array(clarabel.DefaultSolver(*matrices, kinds, settings).solve().x)


def random_net(seed):
    """A net of 7 nodes with taut parts that float, hang, or are held along some axes only."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1.0, 1.0, (7, 3))
    pairs = {(i, i + 1) for i in range(6)} | {tuple(sorted(rng.choice(7, 2, replace=False))) for _ in range(3)}
    lines = [list(map(int, pair)) for pair in sorted(pairs)]
    lengths = np.array([np.linalg.norm(points[a] - points[b]) for a, b in lines])
    lengths *= rng.choice([1.0, 1.0 + rng.uniform(0.01, 0.5)], len(lines))
    supports = [0, 6] if rng.random() < 0.7 else [0]
    components = [(3, str(rng.choice(["x", "y", "z"])))] if rng.random() < 0.5 else []
    loads = []
    for _ in range(2):  # pulls a line apart, which leaves its part to float
        a, b = lines[rng.integers(len(lines))]
        force = points[b] - points[a]
        force /= np.linalg.norm(force)
        loads += [(a, tuple(-force)), (b, tuple(force))]
    if rng.random() < 0.5:
        loads.append((int(rng.integers(1, 6)), tuple(rng.normal(size=3))))
    loads = [(node, force) for node, force in loads if node not in supports]
    components = [(node, [axis]) for node, axis in components]
    return points.tolist(), lines, lengths.tolist(), supports, loads, components


def check(seed):
    """Each coordinate lies within ± of both ends of its interval, or is named as open, with these ends."""
    points, lines, lengths, supports, loads, components = random_net(seed)
    held = [3 * n + k for n in supports for k in range(3)] + [3 * n + "xyz".index(a) for n, (a,) in components]
    program = Program(points, lines, lengths, held, loads)
    observe = every_coordinate(len(points))
    results = refweb.run(scene(points, lines, lengths, supports, loads, components, observe)).results
    counted = {"open": 0, "known": 0}
    for at, one in enumerate(observe):
        result, (least, most) = results[one.name], program.ends(at)
        if result.error is None:
            counted["open"] += 1
            # A chain that is nearly straight gives way across by √(2 δ) for what it is longer by: δ = 1e-7, as `TAUT`.
            np.testing.assert_allclose(result.interval, (least, most), rtol=0, atol=1e-3, err_msg=f"{seed} {one.name}")
        else:
            counted["known"] += 1
            assert result.interval is None
            # Clarabel's energy is known to some 1e-9 J, of stiffnesses from 1e-2 N/m on, which is √(2 · 1e-7) m.
            assert max(abs(result.value - least), abs(result.value - most)) < result.error + 5e-4, (seed, one.name)
    return counted


@pytest.mark.ordinary("1", "2")
@pytest.mark.parametrize("seed", range(3))
def test_random_nets(seed):
    check(seed)


@pytest.mark.slow
def test_many_random_nets():
    total = {"open": 0, "known": 0}
    for seed in range(200):
        for kind, count in check(seed).items():
            total[kind] += count
    assert min(total.values()) > 1000, total


def pulled_apart(observe, loads=((1, -1.0), (2, 1.0)), **changes):
    """Two nodes 0.1 m apart, pulled by ∓1 N, on tethers of 1.3 m to supports 2 m apart."""
    points = [[0, 0, 0], [0.9, 0, 0], [1.0, 0, 0], [2, 0, 0]]
    loads = [(node, (force, 0.0, 0.0)) for node, force in loads]
    return scene(points, [[0, 1], [1, 2], [2, 3]], [1.3, 0.1, 1.3], [0, 3], loads, observe=observe, **changes)


OBSERVE = [
    refweb.Observe(name="x", quantity="position", node=1, component="x"),
    refweb.Observe(name="moved", quantity="displacement", node=1, component="x"),
    refweb.Observe(name="y", quantity="position", node=2, component="y"),
    refweb.Observe(name="tension", quantity="tension", line=1),
    refweb.Observe(name="stored", quantity="strain_energy"),
    refweb.Observe(name="pull", quantity="reaction", node=0),
    refweb.Observe(name="place", quantity="position", node=1),
    refweb.Observe(name="farthest", quantity="displacement"),
    refweb.Observe(name="apart", quantity="strain", line=1),
]


@pytest.mark.parametrize("method", ["newton", "relaxation"])
def test_a_taut_part_between_slack_tethers(method):
    """Along x until a tether is straight; across as far as the ends of both meet, the arcs of two circles."""
    results = refweb.run(pulled_apart(OBSERVE, solve=refweb.Static(method=method))).results
    long = 0.1 * (1.0 + 1.0 / (MODULUS * AREA))
    np.testing.assert_allclose(results["x"].interval, (0.7 - long, 1.3), rtol=1e-9)
    np.testing.assert_allclose(results["moved"].interval, (-0.2 - long, 0.4), rtol=1e-8)
    across = np.sqrt(1.3**2 - (1.0 - 0.5 * long) ** 2)
    np.testing.assert_allclose(results["y"].interval, (-across, across), rtol=1e-8)
    assert all(results[name].error is None for name in ("x", "moved", "y", "place", "farthest"))
    for name, value in (("tension", 1.0), ("stored", 0.5 * 0.1 / (MODULUS * AREA))):
        assert abs(results[name].value - value) <= results[name].error < 1e-6, name
    if method == "newton":
        for name, value in (("pull", 0.0), ("apart", 1.0 / (MODULUS * AREA))):
            assert abs(results[name].value - value) <= results[name].error < 1e-6, name


def test_what_floats_is_told(capsys, tmp_path):
    from refweb.__main__ import main
    from refweb.results.files import as_toml

    (tmp_path / "scene.toml").write_text(as_toml(pulled_apart(OBSERVE[:3]).to_dict()), encoding="utf-8")
    assert main(["run", str(tmp_path / "scene.toml"), "--out", str(tmp_path / "out")]) in (None, 0)
    told = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert "2 nodes are in parts that only slack lines hold, their positions are not unique: 1, 2" in told
    assert "x lies anywhere from 0.5999 to 1.3 m" in told


def test_nothing_holds_a_part():
    """Along an axis that no support holds the interval has no ends; ``run.json`` has None there."""
    points, loads = [[0, 0, 0], [1, 0, 0]], [(0, (-1.0, 0.0, 0.0)), (1, (1.0, 0.0, 0.0))]
    one = scene(points, [[0, 1]], [1.0], [], loads, [(0, ["y"]), (1, ["z"])], every_coordinate(2))
    solution = refweb.run(one)
    assert solution.results["x0"].interval == (-np.inf, np.inf)
    assert solution.summary()["results"]["x0"]["interval"] == [None, None]
    assert solution.results["y1"].error is not None and solution.results["z0"].error is not None


@pytest.mark.parametrize("length, known", [(0.3, True), (0.9, False)])
def test_the_largest_of_nodes_may_be_passed(length, known):
    """A node on a slack tether beside one that hangs 0.5 m deep: its ± is known where the tether is too short."""
    points = [[0, 0, 0], [0.5, 0, 0], [1, 0, 0], [0.0, -0.1, 0]]
    side = float(np.hypot(0.5, 0.5))
    depth = refweb.Observe(name="deepest", quantity="displacement", component="z")
    loads = [(1, (0.0, 0.0, 1.0))]
    lengths = [side, side, length]
    results = refweb.run(scene(points, [[0, 1], [1, 2], [0, 3]], lengths, [0, 2], loads, observe=[depth])).results
    assert results["deepest"].value == pytest.approx(0.5, rel=1e-2) and (results["deepest"].error is not None) == known


def test_a_start_at_an_equilibrium_that_floats_is_told():
    dynamic = pulled_apart(OBSERVE[:3], solve=refweb.Dynamic(duration=1e-3, start="equilibrium"))
    heavy = dynamic.replace(cable=refweb.Cable(law="tension-only", modulus=MODULUS, area=AREA, density=100.0))
    assert any("their positions are not unique" in text for text in refweb.run(heavy).warnings)


def test_modes_of_what_floats():
    heavy = pulled_apart(()).replace(cable=refweb.Cable(law="tension-only", modulus=MODULUS, area=AREA, density=100.0))
    assert any("only slack lines hold" in text for text in refweb.modes(heavy, 2).warnings)


def hose(law="tension-only"):
    """A closed hose of 12 lines under pressure in the plane, on two slack tethers."""
    angle = 2.0 * np.pi * np.arange(12) / 12
    points = [*np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle]).tolist(), [3, 0, 0], [-3, 0, 0]]
    ring = [[k, (k + 1) % 12] for k in range(12)]
    side = float(2.0 * np.sin(np.pi / 12))
    return refweb.Scene(
        web=refweb.Inline(
            points=points, lines=[*ring, [0, 12], [6, 13]], natural_length=[side] * 12 + [2.5, 2.5], supports=[12, 13]
        ),
        cable=refweb.Cable(law=law, modulus=MODULUS, area=AREA, density=0.0),
        support=[refweb.Supports(nodes="all", components=["z"])],
        effects=[refweb.Pressure(lines=list(range(12)), normal=(0, 0, 1), value=3.0)],
        observe=[
            refweb.Observe(name="x", quantity="position", node=0, component="x"),
            refweb.Observe(name="z", quantity="position", node=3, component="z"),
            refweb.Observe(name="tension", quantity="tension", line=3),
            refweb.Observe(name="stored", quantity="strain_energy"),
            refweb.Observe(name="held", quantity="reaction", node=12),
        ],
        solve=refweb.Static(),
    )


def test_a_hose_under_pressure_floats():
    """It may stand anywhere and turn: T = p r, with the radius of the regular polygon that it has stretched to.

    The pressure on a chord s is p s, half of it on each end: two chords with an angle of 2π/n between them give
    2 T sin(π/n) = p s cos(π/n), and s = L (1 + T/EA).
    """
    solution = refweb.run(hose())
    pressure, length, n = 3.0, 2.0 * np.sin(np.pi / 12), 12
    tension = pressure * length / (2.0 * np.tan(np.pi / n))
    tension /= 1.0 - tension / (MODULUS * AREA)
    results = solution.results
    assert results["x"].error is None and results["z"].error is not None
    assert abs(results["tension"].value - tension) <= results["tension"].error < 1e-6 * tension
    stored = 0.5 * n * length * tension**2 / (MODULUS * AREA)
    assert abs(results["stored"].value - stored) <= results["stored"].error < 1e-6 * stored
    assert results["held"].value == 0.0 and results["held"].error < 1e-6
    assert any("can move at no cost" in text for text in solution.warnings)


def test_bars_that_form_a_mechanism_float():
    """A square of bars between two hinges, without a load: it may sway, its tensions are known."""
    observe = [
        refweb.Observe(name="sway", quantity="displacement", node=1, component="x"),
        refweb.Observe(name="lift", quantity="displacement", node=1, component="y"),
        refweb.Observe(name="held", quantity="displacement", node=1, component="z"),
        refweb.Observe(name="tension", quantity="tension", line=0),
    ]
    points, lines = [[0, 0, 0], [0, 1, 0], [1, 1, 0], [1, 0, 0]], [[0, 1], [1, 2], [2, 3]]
    flat = [(1, ["z"]), (2, ["z"])]
    results = refweb.run(scene(points, lines, [1.0] * 3, [0, 3], [], flat, observe, law="linear")).results
    assert results["sway"].error is None
    assert results["lift"].error is None  # it sways on a circle
    assert results["held"].error is not None and results["tension"].error is not None
