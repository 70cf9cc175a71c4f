"""Threads with friction at their rings: capstans, pulleys, resting rings, independent programs, and the balances."""

import functools

import numpy as np
import pytest
import threads
from nets import METHODS
from scipy.optimize import brentq, fsolve
from threads import EA, G

import refweb
from refweb.results.vtu import web_mesh

scene = functools.partial(threads.scene, accuracy={"error": "none"})
"""A scene with a thread, without errors."""


def seen(segments=(), rings=(), **more):
    """Observables t0, t1, ... of tensions of segments and s1, ... of slips at rings."""
    of = {"thread": "rope", **more}
    tensions = [{"name": f"t{n}", "quantity": "tension", "segment": n, **of} for n in segments]
    return tensions + [{"name": f"s{n}", "quantity": "slip", "ring": n, **of} for n in rings]


def moved(node, way):
    """A motion of a node along x, by points of (load step or time, displacement)."""
    return {"node": node, "displacement": [[t, x, 0.0, 0.0] for t, x in way]}


# Statics

POSTS = [[-1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.5, 0.0, 0.75**0.5], [0.0, 0.0, 3.0**0.5], [-1.0, 0.0, 3.0**0.5]]
"""Ends of a thread and three fixed rings, at each of which it turns by 60°."""
WAY = [0.0, -0.003, -0.01, -0.02, -0.018, -0.01, 0.003, -0.006, -0.03]
"""Displacements of an end along x, a load step each."""


def on_posts(friction, **keys):
    """Tensions and slips by load step, while one end of the thread on posts is pulled and let go."""
    steps = list(range(len(WAY)))
    return refweb.run(
        scene(
            POSTS,
            range(5),
            {"nodes": [0, 1, 2, 3, 4], "friction": friction, "prestrain": 5e-3, **keys},
            {"kind": "static", "load_steps": steps},
            motion=[moved(4, zip(steps, WAY, strict=True))],
            observe=seen(range(4), (1, 2, 3)),
        )
    )


def by_sweeps(friction, lengths):
    """Tensions by load step, where rings are brought to their limits one after another, a program of its own."""
    limit, natural, tensions = np.exp(friction * np.pi / 3.0), np.array(lengths[0]) / 1.005, []
    for now in lengths:
        pull = [functools.partial(lambda end, length: EA * max(end / length - 1.0, 0.0), end) for end in now]
        start = natural.copy()
        over = np.zeros(3)
        for _ in range(3000):
            before = over.copy()
            for r in range(3):
                a, b = natural[r] + over[r], natural[r + 1] - over[r]  # as if it had not slipped

                def beyond(d, sign, r=r, a=a, b=b, pull=pull):
                    first, second = pull[r](a - d), pull[r + 1](b + d)
                    return second - limit * first if sign > 0.0 else first - limit * second

                over_now = 0.0
                for sign in (1.0, -1.0):
                    if beyond(0.0, sign) > 0.0:
                        over_now = sign * brentq(
                            lambda d, s=sign, beyond=beyond: beyond(s * d, s), 0.0, 0.2, xtol=1e-16, rtol=1e-15
                        )
                over[r] = over_now
                natural[r], natural[r + 1] = a - over_now, b + over_now
            if np.abs(over - before).max() < 1e-16:
                break
        assert natural.sum() == pytest.approx(start.sum(), rel=1e-14)
        tensions.append([pull[s](natural[s]) for s in range(4)])
    return np.array(tensions)


def test_pulled_to_and_fro_over_posts():
    """Against a program of its own, step by step; rings slip one after another, and stick on the way back."""
    run = on_posts(0.3)
    lengths = [[1.0, 1.0, 1.0, 1.0 - way] for way in WAY]
    found = np.column_stack([run.history[f"t{s}"] for s in range(4)])
    np.testing.assert_allclose(found, by_sweeps(0.3, lengths), rtol=1e-9, atol=1e-8)
    assert (np.diff(run.history["dissipated_energy"]) >= 0.0).all()
    assert any(f.code == "not-proven" and "load_steps" in f.text for f in run.findings)


def test_capstan():
    """T₄/T₁ = e^(μπ) to rounding when all three rings slip."""
    run = on_posts(0.3)
    assert run.history["t3"][-1] / run.history["t0"][-1] == pytest.approx(np.exp(0.3 * np.pi), rel=1e-11)
    slips = [run.history[f"s{r}"][-1] for r in (1, 2, 3)]
    assert 0.0 < slips[0] < slips[1] < slips[2]


def over_an_arch(load):
    """A thread with friction over 20 rings of half a circle, with 1 kg at its first end and a load at its last."""
    turn = np.linspace(np.pi, 0.0, 20)[:, None]
    points = np.vstack([[-1, 0, -2], np.hstack([np.cos(turn), 0.0 * turn, np.sin(turn)]), [1, 0, -2]])
    nodes = list(range(22))
    rope = {"nodes": nodes, "friction": 0.2, "modulus": 1e8}
    return scene(
        points.tolist(), nodes[1:-1], rope, {"kind": "static"}, {0: 1.0, 21: load},
        gravity={"acceleration": [0.0, 0.0, -G]}, accuracy={},
        observe=[{"name": f"z{n}", "quantity": "position", "node": n, "component": "z"} for n in (0, 21)],
    )  # fmt: skip


def test_equal_loads_with_friction():
    """All rings slip outward, the tension falls by e^(−μθ) at each, and friction resists what would turn back.

    The ends are where the natural length of half the thread is used up. They have ±, and are not open.
    """
    step = np.pi / 19.0
    chord, turns = 2.0 * np.sin(0.5 * step), 0.5 * step + step * np.arange(10)
    stretch = 1.0 + G * np.exp(-0.2 * turns) / 1e3
    share = np.append(np.ones(9), 0.5)  # of the segment at the top each half has a half
    exact = -(1.0 + G / 1e3) * (2.0 + (share * chord * (1.0 - 1.0 / stretch)).sum())
    solution = refweb.run(over_an_arch(1.0))
    assert not any(f.code == "loose-nodes" for f in solution.findings)
    for result in solution.results.values():
        assert result.error is not None and result.error < 1e-9
        assert result.value == pytest.approx(exact, abs=result.error + 1e-11)


def test_a_load_just_beyond_the_capstan():
    """As one far beyond: by a share of 1e-5 above the limit."""
    with pytest.raises(refweb.SolverError, match="node 0, is at node 1: the load at node 21 is more than that end and"):
        refweb.run(over_an_arch((1.0 + 1e-5) * np.exp(0.2 * np.pi)))


@pytest.mark.parametrize("friction", [{}, {"friction": 0.3}])
def test_a_load_beyond_the_capstan(friction):
    """The thread runs through; the message names the end that is pulled to its ring, and the load."""
    heavy = 1.01 * np.exp(0.3 * np.pi)
    points = [[0.0, 0.0, -1.0], [0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [0.2, 0.0, -1.0]]
    given = scene(
        points, [1, 2], {"nodes": [0, 1, 2, 3], **friction}, {"kind": "static"}, {0: heavy, 3: 1.0},
        gravity={"acceleration": [0.0, 0.0, -G]},
    )  # fmt: skip
    text = "node 3, is at node 2: the load at node 0 is more than that end"
    with pytest.raises(refweb.SolverError, match=f"{text} and friction" if friction else f"{text} can hold; lower it"):
        refweb.run(given)


def test_limits_of_friction():
    """Without friction one tension, as a thread that has none; with much, four separate lines."""
    free, tied = on_posts(0.0), on_posts(1e3)
    for step, way in enumerate(WAY):
        total = 4.0 - way
        pull = EA * max(total / (4.0 / 1.005) - 1.0, 0.0)
        for s in range(4):
            assert free.history[f"t{s}"][step] == pytest.approx(pull, rel=1e-10)
            length = 1.0 - way * (s == 3)
            assert tied.history[f"t{s}"][step] == pytest.approx(EA * max(length * 1.005 - 1.0, 0.0), rel=1e-10)
    assert not tied.history["dissipated_energy"].any() and np.abs(free.history["dissipated_energy"]).max() < 1e-12


SPAN, LONG, HEAVY, MU = 2.0, 2.3, 4.0 * G, 0.2


def ring_at(start, friction):
    """A heavy ring on a thread between two supports at one height, in statics; x at the start."""
    first = 0.5 * LONG
    z = -np.sqrt(max(first**2 - (0.5 * SPAN) ** 2, 0.0))
    points = [[0, 0, 0], [SPAN, 0, 0], [start, 0.0, z]]
    rope = {"nodes": [0, 2, 1], "length": LONG, "friction": friction}
    run = refweb.run(
        scene(
            points,
            [0, 1],
            rope,
            {"kind": "static", "load_steps": [0.25, 0.5, 0.75, 1.0]},
            {2: HEAVY / G},
            load=[{"node": 2, "force": [0.0, 0.0, -HEAVY], "factor": [[0.0, 0.0], [1.0, 1.0]]}],
            observe=seen((0, 1), (1,)),
        )
    )
    return run, points


def ring_program(x, z):
    """Lengths, turning angle and cosines of the segments of a ring."""
    first, second = np.hypot(x, z), np.hypot(SPAN - x, z)
    return first, second, np.arctan2(-z, x) + np.arctan2(-z, SPAN - x)


@pytest.mark.parametrize("start, slips", [(1.0, False), (1.03, False), (0.95, False), (1.4, True), (0.5, True)])
def test_rest_positions_of_a_heavy_ring(start, slips):
    """Within an interval it rests where its two pieces of thread hold it; from outside it slips to the edge of that."""
    run, points = ring_at(start, MU)
    first, second = run.history["t0"][-1], run.history["t1"][-1]
    place = run.positions[2]
    share = np.hypot(start, points[2][2]), np.hypot(SPAN - start, points[2][2])
    natural = LONG * np.array(share) / sum(share)

    def balance(y, over):
        l1, l2, _ = ring_program(y[0], y[1])
        pulls = EA * (l1 / (natural[0] - over) - 1.0), EA * (l2 / (natural[1] + over) - 1.0)
        force = -pulls[0] * y[0] / l1 + pulls[1] * (SPAN - y[0]) / l2
        return force, -pulls[0] * y[1] / l1 - pulls[1] * y[1] / l2 - HEAVY, pulls

    def at_limit(y):
        across, up, pulls = balance(y[:2], y[2])
        less, more = (pulls[0], pulls[1]) if start > 0.5 * SPAN else (pulls[1], pulls[0])
        return across, up, (more - less * np.exp(MU * ring_program(y[0], y[1])[2])) if slips else y[2]

    sign = 1.0 if slips else 0.0
    exact = fsolve(at_limit, [place[0], place[2], run.history["s1"][-1] * sign], xtol=1e-11)
    np.testing.assert_allclose([place[0], place[2]], exact[:2], atol=1e-8)
    assert run.history["s1"][-1] == pytest.approx(exact[2], abs=1e-9)
    ratio, turn = abs(np.log(first / second)), ring_program(place[0], place[2])[2]
    assert ratio == pytest.approx(MU * turn, rel=1e-9) if slips else ratio < MU * turn


# Dynamics

HIGH, LOW, HOLD = 3.0, 1.0, {}
FRICTIONAL = {name: keys for name, keys in METHODS.items() if keys.get("method") != "explicit"}


@pytest.fixture(scope="module")
def held(tmp_path_factory):
    """Two masses on a thread over a ring, held where it slips with the tensions that it has in Atwood's machine.

    In statics the heavy one is pulled down by 5 mm; the length of the thread is that with these tensions.
    """
    limit, shrinks = np.exp(MU * np.pi), 1.0
    for _ in range(20):  # the material gets shorter by the strain that it loses over the ring
        fall = (HIGH - limit * LOW) / (HIGH + limit * LOW * shrinks) * G
        pulls = HIGH * (G - fall), LOW * (G + fall * shrinks)
        shrinks = (1.0 + pulls[1] / EA) / (1.0 + pulls[0] / EA)
    length = 1.005 / (1.0 + pulls[0] / EA) + 1.5 / (1.0 + pulls[1] / EA)
    points = [[0, 0, 0], [0, 0, -1.0], [0, 0, -1.5]]
    rope, masses = {"nodes": [1, 0, 2], "friction": MU, "length": length}, {1: HIGH, 2: LOW}
    pull = {"node": 1, "displacement": [[0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, -0.005]]}
    folder = tmp_path_factory.mktemp("atwood") / "held"
    tables = {"gravity": {"acceleration": [0.0, 0.0, -G]}, "observe": seen((0, 1), (1,))}
    run = refweb.run(scene(points, [0, 1, 2], rope, {"kind": "static"}, masses, motion=[pull], **tables), folder)
    for value, exact in zip((run.history["t0"][-1], run.history["t1"][-1]), pulls, strict=True):
        assert value == pytest.approx(exact, rel=1e-9)
    return folder, (fall, fall * shrinks), pulls, (points, [0], rope), (masses, tables)


@pytest.mark.parametrize("method", FRICTIONAL)
def test_atwood(held, method):
    """(m₁ − k m₂)/(m₁ + k m₂) g with k = e^(μπ); what falls short of energy is lost at the ring."""
    folder, (fall, rise), pulls, web, (masses, tables) = held
    solve = {"kind": "dynamic", "duration": 0.3, "start": str(folder), **METHODS[method]}
    seen_too = [{"name": f"z{n}", "quantity": "displacement", "node": n, "component": "z"} for n in (1, 2)]
    tables = {**tables, "observe": [*tables["observe"], *seen_too], "output": {"interval": 0.1}}
    run = refweb.run(scene(*web, solve, masses, **tables))
    time, way = run.history["time"], 0.5 * fall * run.history["time"] ** 2
    np.testing.assert_allclose(run.history["z1"], -0.005 - way, atol=2e-5 * fall)
    np.testing.assert_allclose(run.history["z2"], rise / fall * way, atol=2e-5 * fall)
    for name, pull in zip(("t0", "t1"), pulls, strict=True):
        np.testing.assert_allclose(run.history[name], pull, rtol=5e-3)
    energy, lost = (
        run.history[f"{name}_energy"] - run.history[f"{name}_energy"][0] for name in ("total", "dissipated")
    )
    np.testing.assert_allclose(lost, (pulls[0] - pulls[1]) * way, rtol=2e-3, atol=1e-4)
    np.testing.assert_allclose(energy + lost, 0.0, atol=1e-5 * HIGH * G)
    assert run.history["t0"][1:] == pytest.approx(run.history["t1"][1:] * np.exp(MU * np.pi), rel=1e-9)
    assert len(time) == 4


def bob(solve, **tables):
    """A bob on a thread over two fixed rings, which is thrown and turns back several times in half a second."""
    points = [[-1.0, 0.0, 0.0], [0.0, 0.0, 0.5], [0.7, 0.2, 0.5], [1.0, 0.0, -0.6]]
    rope = {"nodes": [0, 1, 2, 3], "friction": [0.2, 0.3], "prestrain": 1e-3, "modulus": 2e7}
    given = {
        "gravity": {"acceleration": [0.0, 0.0, -G]},
        "velocity": [{"node": 3, "value": [0.3, 0.2, -1.0]}],
        "output": {"interval": 0.1},
        "observe": [*seen((2,), (1, 2)), {"name": "z", "quantity": "displacement", "node": 3, "component": "z"}],
    }
    return scene(
        points, [0, 1, 2], rope, {"kind": "dynamic", "duration": 0.5, **solve}, {3: 0.1}, **{**given, **tables}
    )


@pytest.fixture(scope="module")
def thrown():
    """Its history by Adams methods at a tight tolerance."""
    return refweb.run(bob({"method": "cvode", "family": "adams", "rtol": 1e-10})).history


def test_order_of_explicit_steps(thrown):
    """Positions, slips and the energy balance are of order 2, through stick and slip."""
    errors = []
    for count in (800, 3200, 12800):
        history = refweb.run(bob({"step_size": 0.5 / count})).history
        energy = history["total_energy"] + history["dissipated_energy"]
        off = [np.abs(history[name] - thrown[name]).max() for name in ("z", "s1", "s2")]
        errors.append([*off, np.abs(energy - energy[0]).max()])
        assert (np.diff(history["dissipated_energy"]) >= 0.0).all()
    slopes = -np.diff(np.log(errors), axis=0) / np.log(4.0)
    assert (np.abs(slopes - 2.0) < 0.6).all() and (np.abs(slopes.mean(axis=0) - 2.0) < 0.25).all()
    assert thrown["dissipated_energy"][-1] > 0.02 and len(set(np.sign(np.diff(thrown["s2"])))) >= 2


@pytest.mark.slow
@pytest.mark.parametrize("method", ["bdf", "ida"])
def test_methods_agree(thrown, method):
    """By steps that end where a ring turns back; the balance closes."""
    history = refweb.run(bob({**METHODS[method], "rtol": 1e-6})).history
    for name in ("z", "s1", "s2"):
        np.testing.assert_allclose(history[name], thrown[name], atol=1e-5)
    energy = history["total_energy"] + history["dissipated_energy"]
    np.testing.assert_allclose(energy, energy[0], atol=1e-3 * history["dissipated_energy"][-1])


@pytest.mark.ordinary("central-difference")
@pytest.mark.parametrize("method", ["central-difference", "bdf"])
def test_a_run_goes_on_with_its_slips(tmp_path, thrown, method):
    """What slips have been and have lost is in the folder of a run, and a run from there continues."""
    keys = {**METHODS[method], **({"rtol": 1e-6} if method == "bdf" else {"step_size": 0.5 / 3200})}
    refweb.run(bob({**keys, "duration": 0.2}), tmp_path / "first")
    run = refweb.run(bob({**keys, "duration": 0.3, "start": str(tmp_path / "first")}, velocity=[]))
    for name in ("z", "s1", "s2", "dissipated_energy"):
        assert run.history[name][-1] == pytest.approx(thrown[name][-1], abs=1e-5)


def randomly(seed, solve, **tables):
    """A thread through random points, some of them free masses that are thrown."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(3, 6))
    points = np.column_stack([np.arange(count), *np.zeros((2, count))]) + 0.2 * rng.normal(size=(count, 3))
    free = [n for n in range(1, count) if rng.random() < 0.6] or [count - 1]
    closed = bool(rng.random() < 0.3)
    friction = rng.choice([0.05, 0.2, 0.6], size=count - 2 * (not closed)).tolist()
    rope = {"nodes": list(range(count)), "closed": closed, "friction": friction, "modulus": 2e7}
    rope["prestrain"] = float(rng.choice([0.01, -0.01, 1e-3]))
    given = {
        "gravity": {"acceleration": [0.0, 0.0, -G]},
        "velocity": [{"node": n, "value": rng.normal(size=3).tolist()} for n in free],
        "output": {"interval": 0.05},
        "observe": [{"name": "z", "quantity": "displacement", "node": free[-1], "component": "z"}],
    }
    fixed, masses = [n for n in range(count) if n not in free], {n: float(rng.uniform(0.05, 0.3)) for n in free}
    return scene(points.tolist(), fixed, rope, {"kind": "dynamic", "duration": 0.15, **solve}, masses, **given | tables)


@pytest.mark.slow
@pytest.mark.parametrize("count, least", [(10, 9), pytest.param(100, 97, marks=pytest.mark.slow)])
def test_random_scenes(count, least):
    """± holds what a tighter run gives, in nearly all, and what is lost only grows."""
    holds = 0
    for seed in range(count):
        run = refweb.run(randomly(seed, {}, accuracy={}))
        exact = refweb.run(randomly(seed, {"method": "cvode", "family": "adams", "rtol": 1e-10})).results["z"].value
        holds += abs(run.results["z"].value - exact) <= run.results["z"].error + 1e-10  # that of its rtol
        assert (np.diff(run.history["dissipated_energy"]) >= 0.0).all()
    assert holds >= least, holds


# Return mapping


@pytest.mark.parametrize("closed", [False, True])
def test_laws_of_rings(closed):
    """Random moves of random threads, some slack: what sticks is within its limits, what slips at one, and stays."""
    for seed in range(25):
        rng = np.random.default_rng(seed)
        count = int(rng.integers(2, 10)) + closed
        points = rng.normal(size=(count + (not closed), 3))
        friction = rng.choice([0.0, 0.05, 0.3, 1.0, 5.0], size=count - (not closed))
        rope = {"nodes": list(range(len(points))), "closed": closed, "friction": friction.tolist()}
        rope["prestrain"] = float(rng.choice([0.0, -0.02, 0.01]))
        if not len(friction):
            continue
        system = scene(
            points.tolist(), [], rope, {"kind": "dynamic", "duration": 1.0}, dict.fromkeys(range(len(points)), 1.0)
        ).build()
        thread, x, size = system.net.threads[0], np.zeros((system.rows, 3)), 10.0 ** rng.uniform(-6, 0)
        for _ in range(3):
            x[: len(points)] += size * rng.normal(size=points.shape)
            y = system.taken_on(0.0, x)
            place = (points + x[: len(points)])[[*range(len(points)), *([0] if closed else [])]]
            apart = np.diff(place, axis=0)
            length, over = np.linalg.norm(apart, axis=1), thread.slips(y) - thread.slips(x)
            along = apart / length[:, None]
            pull = EA * np.maximum(length / thread.natural_lengths(thread.slips(y)) - 1.0, 0.0)
            small = 1e-9 * (pull.max() + 1e-5 * EA)
            for r, d in enumerate(over):
                first, second, mu = r, (r + 1) % count, friction[(r + 1) % count] if closed else friction[r]
                u, v = along[first], along[second]
                limit = np.exp(-mu * np.arctan2(np.linalg.norm(np.cross(u, v)), u @ v))
                beyond = limit * pull[second] - pull[first], limit * pull[first] - pull[second]
                assert max(beyond) <= small
                assert abs(beyond[0 if d > 0.0 else 1]) <= small or abs(d) < 1e-14
            np.testing.assert_allclose(system.taken_on(0.0, y)[: thread.first + 1], y[: thread.first + 1], atol=1e-13)
            np.testing.assert_allclose(thread.natural_lengths(thread.slips(y)).sum(), thread.natural_length, rtol=1e-14)
            assert (thread.natural_lengths(thread.slips(y)) > 0.0).all()
            x = y


def test_explicit_steps_keep_their_bound():
    """2/ω of the tangent is not below the bound of steps, where rings stick and where they slip."""
    from scipy.linalg import eigvals

    from refweb.dynamics.integrators.central_difference import CentralDifference

    for seed in range(8):
        rng = np.random.default_rng(seed)
        points, masses = rng.normal(size=(5, 3)), rng.uniform(0.1, 1.0, 5)
        rope = {"nodes": [0, 1, 2, 3, 4], "friction": 0.2, "prestrain": 0.02}
        system = scene(points.tolist(), [], rope, {"kind": "dynamic", "duration": 1.0}, enumerate(masses)).build()
        x = np.zeros((system.rows, 3))
        x[:5] = 0.05 * rng.normal(size=(5, 3))
        tangent = system.pattern.matrix(system.stiffness(0.0, x)).toarray()
        largest = np.abs(eigvals(tangent / np.repeat(system.net.mass, 3)[system.free][:, None])).max()
        assert CentralDifference(system).bound(x, reach=0.0) <= 2.0 / np.sqrt(max(largest, 1e-300)) * (1.0 + 1e-12)


# Results and refusals


def test_results(tmp_path):
    """Segments have their own tension in VTU; observables of both faces agree."""
    run = refweb.run(bob({"method": "cvode", "rtol": 1e-6}, output={"interval": 0.1, "frames": 1}), tmp_path / "run")
    mesh = web_mesh(run.state)
    tension = mesh.cell_data["tension"][1]
    assert tension[2] == pytest.approx(run.history["t2"][-1], rel=1e-6)
    natural = mesh.cell_data["natural_length"][1]
    assert natural.sum() == pytest.approx(run.state.system.net.threads[0].natural_length, rel=1e-12)
    np.testing.assert_allclose(mesh.cell_data["strain"][1], tension / 200.0, atol=1e-12)


@pytest.mark.parametrize(
    "rope, text",
    [
        ({"nodes": [0, 2, 1], "friction": -0.1}, r"friction = -0.1 must be ≥ 0"),
        ({"nodes": [0, 2, 1], "friction": []}, r"friction = \[\] must be a number for each ring"),
        ({"nodes": [0, 2, 1], "friction": [0.1, "a"]}, r'friction\[1\] = "a" must be a number'),
        ({"nodes": [0, 2, 1], "friction": [0.1, 0.2]}, r"friction has 2 numbers, must have 1, one for each ring"),
        ({"nodes": [0, 2, 1], "friction": [0.1], "closed": True}, r"friction has 1 numbers, must have 3"),
        ({"nodes": [0, 2, 3, 1], "friction": 0.1}, r"nodes 2 and 3 follow each other in one point"),
        ({"nodes": [0, 2, 1], "friction": 0.1, "law": "smooth", "smoothing": 1e-3}, r'law = "smooth" pushes'),
    ],
)
def test_refused_threads(rope, text):
    with pytest.raises(refweb.InputError, match=text):
        scene([[0, 0, 0], [2, 0, 0], [1, 0, -1], [1, 0, -1]], [0, 1, 2, 3], rope, {"kind": "static"}).build()


@pytest.mark.parametrize(
    "observe, text",
    [
        ({"quantity": "slip", "ring": 0}, r"ring = 0: it must be from 1 to 2, a number in the list of nodes"),
        ({"quantity": "slip", "ring": 3}, r"ring = 3: it must be from 1 to 2"),
        ({"quantity": "slip"}, r"ring is missing: it must be from 1 to 2"),
        ({"quantity": "tension", "segment": 3}, r"segment = 3 must be < 3, the number of segments"),
        ({"quantity": "strain", "segment": 1}, r'segment = 1 has no meaning for quantity = "strain" of a thread'),
    ],
)
def test_refused_observables(observe, text):
    with pytest.raises(refweb.InputError, match=text):
        bob({}, observe=[{"name": "it", "thread": "rope", **observe}]).build()


def test_refused_gradients():
    """What has slipped depends on the path."""
    run = ring_at(1.4, MU)[0]
    with pytest.raises(refweb.InputError, match=r'no friction or winch, as of thread "rope"'):
        run.gradient("t0", "thread.0.length")


def test_refused_methods():
    with pytest.raises(refweb.InputError, match=r'method = "explicit" takes no \[\[thread\]\] friction'):
        refweb.run(bob({"method": "explicit"}))
