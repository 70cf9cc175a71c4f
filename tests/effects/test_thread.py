"""Threads that slide through rings: closed forms of pulleys and rings, independent programs, and the balances."""

import functools

import numpy as np
import pytest
import threads
from nets import METHODS
from scipy.integrate import quad, solve_ivp
from scipy.linalg import eigh
from scipy.optimize import brentq, least_squares
from threads import EA, FALLING, FAR, PULL, ROPE, G

import refweb
from refweb.dynamics.integrators.central_difference import CentralDifference
from refweb.results.vtu import web_mesh
from refweb.statics.duality_bound import duality_bound
from refweb.statics.equilibrium import Equilibrium

scene = functools.partial(threads.scene, **FALLING, **PULL)
"""A scene with a thread that is observed, and gravity."""


def static(points, supports, rope, masses, method="newton", **tables):
    """The solution in statics."""
    return refweb.run(scene(points, supports, rope, {"kind": "static", "method": method}, masses, **tables))


def holds(result, exact):
    """A result whose ± holds what is exact, and says something."""
    assert abs(result.value - exact) <= result.error <= 1e-6 * abs(exact)


# Pulleys


@pytest.mark.parametrize("method", METHODS)
def test_atwood(method):
    """(m₁ − m₂)/(m₁ + m₂) g, from the tension 2 m₁ m₂ g/(m₁ + m₂) on: no vibration is left beside it."""
    heavy, light = 3.0, 1.0
    pull, fall = 2.0 * heavy * light * G / (heavy + light), (heavy - light) / (heavy + light) * G
    solve = {"kind": "dynamic", "duration": 0.3, **METHODS[method]}
    points = [[0, 0, 0], [0.5, 0, 0.2], [1, 0, 0], [0, 0, -1.0], [1, 0, -1.5]]
    seen = [{"name": "pull", "quantity": "tension", "thread": "rope", "reduce": kind} for kind in ("min", "max")]
    seen[1]["name"] = "largest"
    seen += [{"name": f"z{node}", "quantity": "displacement", "node": node, "component": "z"} for node in (3, 4)]
    run = refweb.run(
        scene(
            points,
            [0, 1, 2],
            {"nodes": [3, 0, 1, 2, 4], "prestrain": pull / EA},
            solve,
            {3: heavy, 4: light},
            observe=seen,
            output={"interval": 0.1},
            accuracy={"error": "none"},
        )
    )
    time = run.history["time"]
    for node, sign in ((3, -0.5), (4, 0.5)):
        np.testing.assert_allclose(run.history[f"z{node}"], sign * fall * time**2, atol=1e-5 * fall)
    for name in ("pull", "largest"):
        assert run.results[name].value == pytest.approx(pull, rel=5e-3)
    energy = run.history["total_energy"] - run.history["total_energy"][0]
    assert np.abs(energy).max() <= 1e-5 * heavy * G


@pytest.mark.parametrize("method", ["newton", "relaxation"])
@pytest.mark.parametrize("strands", [2, 3, 6])
def test_block_and_tackle(method, strands):
    """A load on n strands: T = W/n, on the block as it is and on the support where the rope ends there."""
    nodes = ([0, 1] * strands)[: strands + 1]
    run = static([[0, 0, 0], [0, 0, -1]], [0], {"nodes": nodes}, {1: 5.0}, method=method)
    holds(run.results["pull"], 5.0 * G / strands) if method == "newton" else None
    pull = 5.0 * G / strands
    assert run.results["pull"].value == pytest.approx(pull, rel=1e-8)
    np.testing.assert_allclose(run.positions[1], [0.0, 0.0, -(1.0 + pull / EA)], atol=1e-8)


@pytest.mark.parametrize("method", ["newton", "relaxation"])
@pytest.mark.parametrize("height", [0.0, 0.6])
def test_a_heavy_ring(method, height):
    """Equal angles: of a stretched thread ℓ over the distance D, cos α = D/ℓ and T = W/(2 sin α)."""
    length, across, weight = 2.5, 1.8, 4.0 * G

    def beyond(pull):
        stretched = length * (1.0 + pull / EA)
        return 2.0 * pull * np.sqrt(1.0 - (across / stretched) ** 2) - weight

    pull = brentq(beyond, 1.0, 1e3, xtol=1e-13)
    stretched = length * (1.0 + pull / EA)
    sine = np.sqrt(1.0 - (across / stretched) ** 2)
    first = 0.5 * (stretched - height / sine)  # of the lower end
    x, z = first * across / stretched, -first * sine
    points = [[0, 0, 0], [across, 0, height], [0.7, 0.0, -0.5]]
    rope = {"nodes": [0, 2, 1], "length": length}
    run = static(points, [0, 1], rope, {2: 4.0}, method=method)
    np.testing.assert_allclose(run.positions[2], [x, 0.0, z], atol=1e-7)
    if method == "newton":
        holds(run.results["pull"], pull)
        assert not any(finding.code == "not-proven" for finding in run.findings) and run.results["pull"].proven


TWO = [[0, 0, 0], [2.0, 0.3, 0.5], [0.5, 0.1, -0.6], [1.4, 0.2, -0.4]]
WEIGHTS = np.array([3.0, 5.0])
TWO_ROPE = {"nodes": [0, 2, 3, 1], "length": 3.0}


def forces_of_two(places, stiffness):
    """Forces on two rings on a thread between the first two points of `TWO`, a program of its own."""
    chain = np.vstack([TWO[0], places, TWO[1]])
    apart = np.diff(chain, axis=0)
    lengths = np.linalg.norm(apart, axis=1)
    pull = stiffness * max(lengths.sum() / TWO_ROPE["length"] - 1.0, 0.0)
    along = apart / lengths[:, None]
    return pull * np.diff(along, axis=0) - np.outer(WEIGHTS, [0.0, 0.0, G]), pull


def test_two_rings():
    """Two rings that loads keep apart, against a program of its own; left alone they would slide together."""
    apart = [{"node": node, "force": [force, 0.0, 0.0]} for node, force in ((2, -30.0), (3, 20.0))]
    masses = dict(zip((2, 3), WEIGHTS, strict=True))
    run = static(TWO, [0, 1], TWO_ROPE, masses, load=apart)
    push = np.array([[-30.0, 0.0, 0.0], [20.0, 0.0, 0.0]])
    found = least_squares(
        lambda y: (forces_of_two(y.reshape(2, 3), EA)[0] + push).ravel(),
        np.ravel(TWO[2:]) * 1.3,
        xtol=1e-15,
        ftol=1e-15,
    )
    np.testing.assert_allclose(run.positions[2:4].ravel(), found.x, atol=1e-7)
    holds(run.results["pull"], forces_of_two(found.x.reshape(2, 3), EA)[1])


def test_rings_that_meet():
    """Nothing keeps them apart, and at one point the thread between them has no direction."""
    with pytest.raises(refweb.SolverError, match=r'nodes 2 and 3 come together on thread "rope", .* one node'):
        static(TWO, [0, 1], TWO_ROPE, dict(zip((2, 3), WEIGHTS, strict=True)))


def test_rings_that_begin_together_are_told_of_in_dynamics():
    """Two rings at one point of a thread at rest; a run says so once."""
    points = [[0, 0, 0], [1, 0, 0], [0.5, 0, -0.5], [0.5, 0, -0.5]]
    solve = {"kind": "dynamic", "method": "central-difference", "duration": 1e-3}
    run = refweb.run(scene(points, [0, 1], {"nodes": [0, 2, 3, 1]}, solve, {2: 1.0, 3: 1.0}))
    (text,) = (text for text in run.warnings if "come together" in text)
    assert text.startswith('nodes 2 and 3 come together on thread "rope"') and "at t = 0 s" in text


def test_heat_of_lines_leaves_threads_and_says_so():
    """The tension of the thread is that without [temperature]."""
    points, masses, heat = [[0, 0, 0], [1, 0, 0], [0.5, 0, -0.5]], {2: 1.0}, {"expansion": 1e-5, "change": 50.0}
    cold, hot = (static(points, [0, 1], {"nodes": [0, 2, 1]}, masses, **more) for more in ({}, {"temperature": heat}))
    assert hot.results["pull"].value == cold.results["pull"].value
    (text,) = (text for text in hot.warnings if "[temperature]" in text)
    assert 'thread "rope" keeps its natural length' in text


def test_default_results_have_the_tension_of_each_thread():
    """Those of lines are said to leave threads out."""
    run = static([[0, 0, 0], [0, 0, -1]], [0], {"nodes": [0, 1]}, {1: 1.0}, observe=[])
    assert run.results["max_tension"].value == pytest.approx(0.0, abs=1e-6)
    assert run.results["tension_rope"].value == pytest.approx(9.81, rel=1e-9)
    (text,) = (finding.text for finding in run.findings if finding.code == "left-out")
    assert text.startswith("max_stress, max_tension: of lines alone")


# Proven bounds


def conic(net, load):
    """Tensions of lines and threads by a cone program: ½ T²/k − f·x, with T/k ≥ Σ l − L and l ≥ |d|, in 100 N."""
    import clarabel
    from scipy.sparse import block_diag, csc_array, lil_array

    groups = [(line[None, :], net.natural_length[i], net.axial[i]) for i, line in enumerate(net.cells)]
    groups += [(thread.segments, thread.natural_length, thread.line.axial[0]) for thread in net.threads]
    rows, segments = len(net.points), sum(len(group[0]) for group in groups)
    size = 3 * rows + segments + len(groups)  # places, lengths l, and T
    stiffness = np.array([axial / natural for _, natural, axial in groups])
    held = [3 * node + k for node in net.web.rim for k in range(3)]
    A, b, cones, at, n = lil_array((len(held) + 2 * len(groups) + 4 * segments, size)), [], [], 0, 3 * rows
    for component in held:
        A[at, component] = 1.0
        b, at = [*b, net.points.ravel()[component]], at + 1
    cones.append(clarabel.ZeroConeT(len(held)))
    for g, (pairs, natural, _) in enumerate(groups):  # and T ≥ 0
        A[at, n : n + len(pairs)] = 1.0
        A[at, 3 * rows + segments + g], A[at + 1, 3 * rows + segments + g] = -100.0 / stiffness[g], -1.0
        b, at, n = [*b, natural, 0.0], at + 2, n + len(pairs)
    cones.append(clarabel.NonnegativeConeT(2 * len(groups)))
    for s, (i, j) in enumerate(np.concatenate([group[0] for group in groups])):
        A[at, 3 * rows + s] = -1.0
        for k in range(3):
            A[at + 1 + k, 3 * i + k], A[at + 1 + k, 3 * j + k] = 1.0, -1.0
        b, at = [*b, 0.0, 0.0, 0.0, 0.0], at + 4
        cones.append(clarabel.SecondOrderConeT(4))
    P = block_diag([csc_array((size - len(groups),) * 2), csc_array(np.diag(100.0 / stiffness))], format="csc")
    settings = clarabel.DefaultSettings()
    settings.verbose, settings.tol_gap_abs, settings.tol_gap_rel, settings.tol_feas = False, 1e-12, 1e-12, 1e-12
    q = np.concatenate([-0.01 * load.ravel(), np.zeros(size - 3 * rows)])
    z = np.array(clarabel.DefaultSolver(P, q, A.tocsc(), np.array(b), cones, settings).solve().z)
    return 100.0 * z[len(held) : len(held) + 2 * len(groups) : 2]  # multipliers of T/k ≥ Σ l − L


def netted(seed):
    """A scene of random nodes under random loads, on lines and on two threads that run through them."""
    rng = np.random.default_rng(seed)
    points = rng.standard_normal((9, 3)) * [2.0, 2.0, 0.3]
    lines = [[0, 4], [1, 5], [2, 6], [3, 7], [4, 8], [5, 8]]
    threads = [
        ROPE | {"name": "a", "nodes": [0, 5, 6, 1], "prestrain": rng.uniform(-0.2, 0.05)},
        ROPE | {"name": "b", "nodes": [4, 6, 8, 7], "closed": True, "prestrain": rng.uniform(-0.2, 0.05), "area": 3e-5},
    ]
    return refweb.Scene.from_dict(
        {
            "web": {"kind": "inline", "points": points.tolist(), "lines": lines, "supports": [0, 1, 2, 3]},
            "cable": {"law": "tension-only", "modulus": 1e9, "area": 1e-5, "density": 0.0},
            "load": [{"node": n, "force": (100.0 * rng.standard_normal(3)).tolist()} for n in range(4, 9)],
            "thread": threads,
            "observe": [
                *({"name": t["name"], "quantity": "tension", "thread": t["name"]} for t in threads),
                *({"name": f"line{i}", "quantity": "tension", "line": i} for i in range(len(lines))),
            ],
            "solve": {"kind": "static"},
        }
    )


@pytest.mark.parametrize("seed", range(6))
def test_proven_bounds(seed):
    """They are small and hold what a cone program finds, and from displacements that are no equilibria as well."""
    pytest.importorskip("clarabel")
    given = netted(seed)
    run, system = refweb.run(given), given.build()
    load = np.zeros((system.rows, 3))
    for effect in given.effects:
        if isinstance(effect, refweb.Load):
            load[effect.node] += effect.force
    exact = conic(system.net, load)
    exact = dict(zip([*(f"line{i}" for i in range(6)), "a", "b"], exact, strict=True))
    for name, tension in exact.items():
        result = run.results[name]
        assert result.proven and abs(result.value - tension) <= result.error + 1e-5 < 1e-3
    rng, x = np.random.default_rng(seed), np.zeros((system.rows, 3))
    x[: len(run.positions)] = run.positions - system.net.points
    for size in (1e-6, 1e-3, 0.1):
        moved = x + size * np.where(system.supported, 0.0, rng.standard_normal(x.shape))
        forces = system.forces(1.0, moved)
        state = Equilibrium(1.0, moved, forces.per_cell.tension, forces.force, {})
        bound = duality_bound(system, state, None)
        pulls = [forces.per_cell[number][0, 0] for number in system.threads]
        for value, error, name in zip(pulls, bound.threads, "ab", strict=True):
            assert abs(value - exact[name]) <= error + 1e-5
        for i, (value, error) in enumerate(zip(forces.per_cell.tension, bound.tension, strict=True)):
            assert abs(value - exact[f"line{i}"]) <= error + 1e-5


# Dynamics


def test_a_ring_on_a_slack_thread_swings_on_an_ellipse():
    """x = a sin φ, z = −b cos φ: its period is 4 ∫ √((a² cos² φ + b² sin² φ)/(2 g b (cos φ − cos φ₀))) dφ."""
    half, focus, start = 1.0, 0.6, 0.5
    low = np.sqrt(half**2 - focus**2)

    def slowness(s):  # φ = φ₀ sin s, which takes away the root at the end
        phi = start * np.sin(s)
        way = (half * np.cos(phi)) ** 2 + (low * np.sin(phi)) ** 2
        return np.sqrt(way / (2.0 * G * low * (np.cos(phi) - np.cos(start)))) * start * np.cos(s)

    period = 4.0 * quad(slowness, 0.0, 0.5 * np.pi * (1.0 - 1e-7))[0]
    place = [half * np.sin(start), 0.0, -low * np.cos(start)]
    points = [[-focus, 0, 0], [focus, 0, 0], place]
    rope = {"nodes": [0, 2, 1], "length": 2.0 * half, "modulus": 1e11}  # slack to rounding
    solve = {"kind": "dynamic", "duration": period, "method": "explicit", "order": 4}
    run = refweb.run(
        scene(
            points,
            [0, 1],
            rope,
            solve,
            {2: 1.0},
            observe=[{"name": axis, "quantity": "position", "node": 2, "component": axis} for axis in "xz"],
            output={"interval": period / 4.0},
            accuracy={"error": "none"},
        )
    )
    # It is stretched by T/EA = 1e-5, and the period with it by half of that.
    expected = np.array([place[0], 0.0, -place[0], 0.0, place[0]])
    np.testing.assert_allclose(run.history["x"], expected, atol=1e-4)
    np.testing.assert_allclose(run.history["z"][[1, 3]], -low, atol=1e-4)
    assert np.abs(np.diff(run.history["total_energy"])).max() < 1e-5 * G


@pytest.fixture(scope="module")
def thrown():
    """Positions of two rings that fall into a slack thread, by DOP853, and the tension."""

    def rate(t, y):
        places, speeds = y.reshape(2, 2, 3)
        return np.concatenate([speeds.ravel(), (forces_of_two(places, EA)[0] / WEIGHTS[:, None]).ravel()])

    start = np.concatenate([np.ravel(TWO[2:]), np.zeros(6)])
    swing = solve_ivp(rate, (0.0, 0.4), start, method="DOP853", rtol=1e-12, atol=1e-12, max_step=1e-3)
    return swing.y[:6, -1].reshape(2, 3)


@pytest.mark.ordinary("central-difference", "order *", "adams", "ida")
@pytest.mark.parametrize("method", METHODS)
def test_methods_agree(thrown, method):
    """All methods meet an independent integration within ±."""
    solve = {"kind": "dynamic", "duration": 0.4, **METHODS[method]}
    seen = [
        {"name": f"{axis}{node}", "quantity": "position", "node": node, "component": axis}
        for node in (2, 3)
        for axis in "xyz"
    ]
    masses = dict(zip((2, 3), WEIGHTS, strict=True))
    run = refweb.run(scene(TWO, [0, 1], TWO_ROPE, solve, masses, observe=seen, output={"interval": 0.1}))
    for (name, result), exact in zip(run.results.items(), thrown.ravel(), strict=True):
        assert abs(result.value - exact) <= result.error + 1e-9 < 0.05, name


def test_pulling_a_drawstring():
    """A mouth of 1 m of 20 rings: the work of the hand is all the energy, and what the hand draws the mouth loses."""
    scene = refweb.Scene.load("drawstring", {"accuracy.error": "none"})
    thread = next(effect for effect in scene.effects if isinstance(effect, refweb.Thread))
    run = refweb.run(scene)
    history, rings, hand = run.history, np.array(thread.nodes[1:-1]), run.positions[21]
    assert history["work"][-1] > 0.02
    left = history["total_energy"] + history["dissipated_energy"] - history["work"]
    np.testing.assert_allclose(left, 0.0, atol=1e-2 * history["work"][-1])  # second order in 50 steps a row
    around = np.linalg.norm(np.diff(run.positions[rings], axis=0), axis=1).sum()
    natural = scene.build().net.threads[0].natural_length
    ends = 2.0 * np.linalg.norm(hand - run.positions[0])
    assert around + ends == pytest.approx(natural, rel=2e-3)  # of strain
    assert history["mouth"][-1] < 0.05 * history["mouth"][0]


# Modes


@pytest.mark.parametrize("friction", [{}, {"friction": 0.0}])
def test_modes_of_a_ring(friction):
    """EA/L (2 sin α)² + 2 T cos² α/l up and down, 2 T sin² α/l along and 2 T/l across."""
    pull, half, mass = 200.0, 1.3, 2.0
    sine = 0.5
    cosine = np.sqrt(1.0 - sine**2)
    points = [[-half * cosine, 0, 0], [half * cosine, 0, 0], [0, 0, -half * sine]]
    natural = 2.0 * half / (1.0 + pull / EA)
    load = {"node": 2, "force": [0.0, 0.0, -2.0 * pull * sine]}
    rope = {"nodes": [0, 2, 1], "length": natural, **friction}
    given = scene(points, [0, 1], rope, {"kind": "static"}, {2: mass}, load=[load], gravity=[])
    stiffness = [2.0 * pull / half * part for part in (sine**2, 1.0, cosine**2)]
    stiffness[2] += EA / natural * (2.0 * sine) ** 2
    frequencies = np.sqrt(np.array(stiffness) / mass) / (2.0 * np.pi)
    np.testing.assert_allclose(refweb.modes(given, number=3).frequency, frequencies, rtol=1e-9)


def test_modes_of_a_string_over_a_bridge():
    """Beads h apart on both sides of a bridge: ω = 2 √(T/(m h)) sin(kπ/(2(n + 1))), with the one tension of both."""
    pull, apart, mass, counts = 300.0, 0.1, 0.01, (3, 5)
    x = apart * np.arange(sum(counts) + 3)
    bridge, last = counts[0] + 1, len(x) - 1
    beads = [i for i in range(1, last) if i != bridge]
    given = scene(
        np.column_stack([x, 0.0 * x, 0.0 * x]).tolist(),
        [0, bridge, last],
        {"nodes": list(range(len(x))), "prestrain": pull / EA},
        {"kind": "static"},
        dict.fromkeys(beads, mass),
        support=[{"nodes": beads, "components": ["x", "y"]}],
        gravity=[],
    )
    expected = sorted(
        np.sqrt(pull / (mass * apart)) / np.pi * np.sin(k * np.pi / (2.0 * (n + 1)))
        for n in counts
        for k in range(1, n + 1)
    )
    np.testing.assert_allclose(refweb.modes(given, number=8).frequency, expected, rtol=1e-9)


@pytest.mark.parametrize("share", [0.0, 1e-3, 0.3])
@pytest.mark.parametrize("nodes", [[0, 1], [0, 1, 2], [0, 1, 2, 0], [0, 1, 0, 1, 2, 1], [3, 0, 1, 2, 4]])
def test_bound_of_steps(nodes, share):
    """It is below 2/ω of the largest frequency, at any angle and strain, and nodes close to each other."""
    for seed in range(5):
        rng = np.random.default_rng(seed)
        points = rng.standard_normal((max(nodes) + 1, 3))
        points[1] = points[0] + 10.0 ** rng.uniform(-4, 0) * (points[1] - points[0])
        masses = dict(enumerate(10.0 ** rng.uniform(-2, 2, len(points))))
        solve = {"kind": "dynamic", "duration": 1.0}
        system = scene(points.tolist(), [], {"nodes": nodes, "prestrain": share}, solve, masses, gravity=[]).build()
        x = np.zeros((system.rows, 3))
        K = system.pattern.matrix(system.stiffness(0.0, x)).toarray()
        largest = eigh(K, np.diag(np.repeat(system.net.mass, 3)[system.free]), eigvals_only=True)[-1]
        assert CentralDifference(system).bound(x) <= 2.0 / np.sqrt(largest)


# Bodies, mass, results and messages


@pytest.mark.parametrize("order", [("attach", "thread"), ("thread", "attach")])
def test_through_a_ring_on_a_body(order):
    """The block of a tackle is a body; mass of the thread at it is the body's, in any order of the tables."""
    tables = {
        "attach": [{"body": "block", "node": 1}],
        "thread": [{**ROPE, "nodes": [0, 1, 2], "density": 1000.0}],
    }
    ball = {"name": "block", "radius": 0.1, "mass": 2.0, "position": [0.0, 0.0, -1.1]}
    points = [[-1e-3, 0, 0], [0, 0, -1], [1e-3, 0, 0]]
    given = scene(points, [0, 2], {}, {"kind": "static"}, body=[ball], **{name: tables[name] for name in order})
    system = given.build()
    added = 1e-5 * 1000.0 * 0.5 * 2.0 * np.hypot(1.0, 1e-3)
    assert system.net.mass[system.net.bodies[0].row] == pytest.approx(2.0 + added, rel=1e-14)
    assert refweb.run(given).results["pull"].value == pytest.approx(0.5 * (2.0 + added) * G, rel=1e-5)


def test_mass_is_shared_by_segments():
    points = [[0, 0, 0], [1, 0, 0], [1, 3, 0]]
    rope = {"nodes": [0, 1, 2], "closed": True, "density": 1000.0, "length": 4.0}
    mass = scene(points, [0], rope, {"kind": "static"}).build().net.mass
    ends = np.array([1.0, 3.0, np.sqrt(10.0)])
    shares = 0.5 * (ends + np.roll(ends, 1)) / ends.sum()
    np.testing.assert_allclose(mass[:3], 1000.0 * 1e-5 * 4.0 * shares, rtol=1e-14)


def test_results_of_a_thread(tmp_path):
    """All its observables, and its segments in VTU files, which give back the web without them."""
    points = [[-3, 0, 0], [3, 0, 0], [0, 0, -4]]
    seen = [{"name": q, "quantity": q, "thread": "rope"} for q in ("tension", "stress", "strain", "length")]
    run = refweb.run(
        scene(points, [0, 1], {"nodes": [0, 2, 1]}, {"kind": "static"}, {2: 1.0}, observe=seen), out=tmp_path / "out"
    )
    length = 2.0 * np.hypot(3.0, run.positions[2, 2])
    pull = EA * (length / 10.0 - 1.0)
    exact = {"tension": pull, "stress": pull / 1e-5, "strain": pull / EA, "length": length}
    for name, value in exact.items():
        assert abs(run.results[name].value - value) <= run.results[name].error + 1e-9 * abs(value)
    drawn = {name: np.concatenate(values) for name, values in web_mesh(run.state).cell_data.items()}
    np.testing.assert_array_equal(drawn["thread"], [0.0, 1.0, 1.0])
    np.testing.assert_allclose(drawn["tension"][1:], pull, rtol=1e-6)
    assert drawn["natural_length"][1:].sum() == pytest.approx(10.0, rel=1e-12)
    last = sorted((tmp_path / "out/frames").glob("web_*.vtu"))[-1]
    again = refweb.Scene.from_dict(
        {
            "web": {"kind": "file", "path": str(last)},
            "cable": {"law": "tension-only", "modulus": 1e9, "area": 1e-5, "density": 0.0},
            "thread": [{**ROPE, "nodes": [0, 2, 1]}],
            "solve": {"kind": "static"},
        }
    )
    assert again.build().net.web.lines.tolist() == [[3, 4]]


@pytest.mark.parametrize(
    "rope, text",
    [
        ({"nodes": [0]}, r"nodes = \[0\] must be a list of two nodes or more"),
        ({"nodes": [0, 2, 2, 1]}, r"nodes\[1\] = 2 follows itself"),
        ({"nodes": [0, 2, 0], "closed": True}, r"nodes\[2\] = 0 closes to itself"),
        ({"nodes": [0, "tpi", 1]}, r'nodes\[1\] = "tpi" names no node, did you mean "tip"'),
        ({"nodes": [0, 9, 1]}, r"nodes\[1\] = 9 must be 0"),
        ({"nodes": [0, "both", 1]}, r'nodes\[1\] = "both" is 2 nodes, must be one'),
        ({"nodes": [0, "tip", 2]}, r"nodes\[1\] = 2 follows itself"),
        ({"nodes": "tip"}, r'nodes = "tip" is 1 node, must be two or more'),
        ({"nodes": [2, 3]}, r"all 2 are in one point"),
        ({"nodes": [0, 2, 1], "length": 0.0}, r"length = 0.0 must be > 0"),
        ({"nodes": [0, 2, 1], "length": 1.0, "prestrain": 0.1}, r"length = 1 and prestrain = 0.1 both say"),
        ({"nodes": [0, 2, 1], "law": "linear"}, r'law = "linear" is one of bars, which push'),
        ({"nodes": [0, 2, 1], "law": "force-density"}, r'law = "force-density" is for form finding'),
        ({"nodes": [0, 2, 1], "law": "elastic-plastic"}, r'law = "elastic-plastic" yields'),
        ({"nodes": [0, 2, 1], "smoothing": 0.1}, r'smoothing = 0.1 has no meaning with law = "tension-only"'),
        ({"nodes": [0, 2, 1], "modulus": None}, r"modulus is missing"),
    ],
)
def test_messages(rope, text):
    points = [[0, 0, 0], [2, 0, 0], [1, 0, -1], [1, 0, -1]]
    web = {"kind": "inline", "points": [*points, *FAR], "lines": [[4, 5]], "names": {"tip": 2, "both": [2, 3]}}
    rope = {key: value for key, value in {**ROPE, **rope}.items() if value is not None}
    with pytest.raises(refweb.InputError, match=r"\[\[thread\]\] 1.* " + text):
        scene(points, [0, 1], {}, {"kind": "static"}, web=web, thread=[rope]).build()


@pytest.mark.parametrize(
    "seen, text",
    [
        ({"quantity": "tension", "thread": "rop"}, r'thread = "rop" is not a thread, did you mean "rope"'),
        ({"quantity": "length"}, r"thread is missing"),
        ({"quantity": "velocity", "thread": "rope"}, r'thread = "rope" has no meaning for quantity = "velocity"'),
        ({"quantity": "tension", "thread": "rope", "line": 0}, r'line = 0 has no meaning for quantity = "tension"'),
    ],
)
def test_messages_of_observables(seen, text):
    points = [[0, 0, 0], [2, 0, 0], [1, 0, -1]]
    with pytest.raises(refweb.InputError, match=text):
        scene(
            points, [0, 1], {"nodes": [0, 2, 1]}, {"kind": "static"}, {2: 1.0}, observe=[{"name": "a", **seen}]
        ).build()


def test_names_are_unique():
    rope = {**ROPE, "nodes": [0, 2, 1]}
    with pytest.raises(refweb.InputError, match=r'\[\[thread\]\] 2 name = "rope" is listed twice'):
        scene([[0, 0, 0], [2, 0, 0], [1, 0, -1]], [0, 1], {}, {"kind": "static"}, thread=[rope, rope]).build()


RING = {
    "web": {"kind": "inline", "points": [[-1, 0, 0], [1, 0, 0.5], [0.1, 0, -0.8]], "lines": [[0, 1]]}
    | {"supports": [0, 1], "names": {"way": [0, 2, 1]}},
    "cable": {"law": "tension-only", "modulus": 1e9, "area": 1e-5, "density": 970.0},
    "gravity": {"acceleration": [0.0, 0.0, -9.81]},
    "point_mass": [{"node": 2, "mass": 3.0}],
}
"""A ring on a thread between two supports."""


@pytest.mark.parametrize("solve", [{"kind": "static"}, {"kind": "dynamic", "duration": 0.05}])
def test_a_strain_beyond_the_curve_is_said(solve):
    """The ring needs more than the 15 N at which the curve of the thread ends."""
    curve = [[0.0, 0.0], [0.0005, 5.0], [0.001, 15.0]]
    thread = {"name": "t", "nodes": [0, 2, 1], "area": 1e-5, "density": 0.0, "law": "table", "length": 2.6}
    run = refweb.run(refweb.Scene.from_dict(RING | {"thread": [thread | {"tension": curve}], "solve": solve}))
    said = [finding.text for finding in run.findings if finding.code == "beyond-curve"]
    assert len(said) == 1 and said[0].startswith('thread "t" is strained by')
    enough = [*curve, [0.5, 1e5]]
    run = refweb.run(refweb.Scene.from_dict(RING | {"thread": [thread | {"tension": enough}], "solve": solve}))
    assert not any(finding.code == "beyond-curve" for finding in run.findings)


def test_proven_bounds_beside_a_curve():
    """Lines with a straight curve and a thread have the results and bounds that lines without it have."""
    curve = {"law": "table", "stress": [[0.0, 0.0], [0.1, 1e8], [0.2, 2e8]], "area": 1e-5, "density": 0.0}
    first = netted(0)
    second = refweb.Scene.from_dict(first.to_dict() | {"cable": curve})
    one, other = refweb.run(first), refweb.run(second)
    for name, result in other.results.items():
        assert result.proven and abs(result.value - one.results[name].value) <= result.error + one.results[name].error


def test_an_open_thread_runs_in_the_order_of_a_name():
    thread = {"name": "t", "area": 1e-5, "density": 0.0, "modulus": 1e9, "length": 2.6}
    tensions = [
        refweb.run(refweb.Scene.from_dict(RING | {"thread": [thread | {"nodes": nodes}], "solve": {"kind": "static"}}))
        .state.threads["t"][0]
        for nodes in ("way", [0, 2, 1])
    ]  # fmt: skip
    assert tensions[0] == tensions[1] < 29.43
