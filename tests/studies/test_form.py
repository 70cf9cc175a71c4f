"""Form finding: shapes by linear equations and by least length, and elastic nets that stand still in them."""

import warnings

import numpy as np
import pytest
import scipy.sparse
import scipy.sparse.linalg
from scipy.optimize import brentq

import refweb
from refweb.net.sag import over_chord

STEEL = dict(modulus=1e9, area=1e-5, density=0.0)


def densities(q, **more):
    """A cable of a force density [N/m]."""
    return refweb.Cable(**{**STEEL, "law": "force-density", "force_density": q, **more})


def linear_equations(points, lines, q, supports, load):
    """(positions, least eigenvalue) of Cᵀ Q C x = p, C being the branch-node matrix, by scipy."""
    count, edges = len(points), np.arange(len(lines))
    entries = np.concatenate([np.ones(len(lines)), -np.ones(len(lines))])
    C = scipy.sparse.csr_array((entries, (np.tile(edges, 2), np.ravel(lines, "F"))), shape=(len(lines), count))
    D = (C.T @ scipy.sparse.diags_array(np.broadcast_to(q, len(lines)).astype(float)) @ C).tocsc()
    free, x = np.setdiff1d(np.arange(count), supports), np.array(points, dtype=float)
    right = load[free] - D[free][:, supports] @ x[supports]
    inner = D[free][:, free]
    x[free] = scipy.sparse.linalg.spsolve(inner, right)
    return x, np.linalg.eigvalsh(inner.toarray())[0]


def grid(n, seed=0):
    """(points, lines, rim) of n × n squares of 1 m, the rim at random heights and inner nodes moved."""
    rng = np.random.default_rng(seed)
    i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij")
    rim = np.flatnonzero(((i % n == 0) | (j % n == 0)).ravel())
    points = np.column_stack([i.ravel(), j.ravel(), 0 * i.ravel()]).astype(float)
    points[rim, 2] = rng.uniform(-1.0, 1.0, len(rim))
    points += 0.1 * rng.standard_normal(points.shape)
    number = lambda a, b: (n + 1) * a + b  # noqa: E731
    lines = [[number(a, b), number(a, b + 1)] for a in range(n + 1) for b in range(n)]
    lines += [[number(a, b), number(a + 1, b)] for a in range(n) for b in range(n + 1)]
    return points, np.array(lines), rim


def scene_of(points, lines, supports, cable, effects=(), **more):
    web = refweb.Inline(points=points, lines=lines, supports=supports, **more.pop("web", {}))
    return refweb.Scene(web=web, cable=cable, effects=effects, solve=more.pop("solve", refweb.Static()), **more)


def own_densities(lines, q):
    """Groups of the web, and of the cable, that give each line a force density of its own."""
    groups = {f"g{k}": [k] for k in range(len(lines))}
    return groups, {name: refweb.Group(force_density=float(value)) for name, value in zip(groups, q, strict=True)}


@pytest.mark.parametrize("law, value", [("force-density", 3.0), ("force-density", -2.0), ("constant-force", 5.0)])
def test_laws(law, value):
    """Forces q d and F d/l, energies ½ q l² and F l but for a constant, stiffness q and F/l across the line."""
    points, lines, _ = grid(1, 3)
    key = {"force-density": "force_density", "constant-force": "pretension"}[law]
    cable = refweb.Cable(**STEEL, law=law, **{key: value})
    system = scene_of(points, lines, [], cable, web={"natural_length": [0.7, 1.3, 0.9, 1.1]}).build()
    rng = np.random.default_rng(1)
    x, y = 0.2 * rng.standard_normal((2, *points.shape))
    force, energy, K = np.zeros_like(x), np.zeros(2), np.zeros((12, 12))
    for i, j in lines:
        d, e = (points[j] + u[j] - points[i] - u[i] for u in (x, y))
        length = np.linalg.norm(d)
        pull = value * d if law == "force-density" else value * d / length
        force[i] += pull
        force[j] -= pull
        for k, vector in enumerate((d, e)):
            size = np.linalg.norm(vector)
            energy[k] += 0.5 * value * size**2 if law == "force-density" else value * size
        across = value / length * (np.eye(3) - np.outer(d, d) / length**2)
        block = value * np.eye(3) if law == "force-density" else across
        K += np.kron(np.outer(*2 * [np.eye(4)[i] - np.eye(4)[j]]), block)
    np.testing.assert_allclose(system.force(0.0, x), force, atol=1e-14 * abs(value))
    np.testing.assert_allclose(system.energy(0.0, x) - system.energy(0.0, y), energy[0] - energy[1], rtol=1e-12)
    stiffness = system.pattern.matrix(system.stiffness(0.0, x)).toarray()
    np.testing.assert_allclose(stiffness, K, atol=1e-13 * np.abs(K).max())


@pytest.mark.parametrize("lowest", [0.5, -0.2, -2.0])
def test_force_densities_by_linear_equations(lowest):
    """Positions, tensions q l and reactions of a net with a force density for each line, of any sign, under loads.

    Where all are above 0 the error is proven, and the truth lies within it; where some are not, that is said, and that
    it is a saddle where the matrix of the equations is not definite.
    """
    points, lines, rim = grid(5)
    rng = np.random.default_rng(2)
    q = rng.uniform(0.5, 2.0, len(lines))
    q[rng.choice(len(lines), 6, replace=False)] = lowest
    groups, tables = own_densities(lines, q)
    loads = [refweb.Load(node=node, force=tuple(rng.standard_normal(3).tolist())) for node in (14, 21)]
    scene = scene_of(
        points,
        lines,
        rim,
        densities(1.0, groups=tables),
        loads,
        web={"groups": groups},
        observe=[
            refweb.Observe(name="tension", quantity="tension"),
            refweb.Observe(name="least", quantity="tension", select="min"),
            refweb.Observe(name="z", quantity="position", node=21, component="z"),
            refweb.Observe(name="energy", quantity="strain_energy"),
        ],
    )
    load = np.zeros_like(points)
    for one in loads:
        load[one.node] = one.force
    exact, smallest = linear_equations(points, lines, q, rim, load)
    solution = refweb.run(scene)
    np.testing.assert_allclose(solution.positions, exact, atol=1e-13)
    lengths = np.linalg.norm(exact[lines[:, 1]] - exact[lines[:, 0]], axis=1)
    np.testing.assert_allclose(solution.tension, q * lengths, rtol=1e-12)
    proven, found = lowest > 0.0, solution.results
    expected = {"tension": (q * lengths).max(), "least": (q * lengths).min(), "z": exact[21, 2]}
    start = np.linalg.norm(points[lines[:, 1]] - points[lines[:, 0]], axis=1)
    expected["energy"] = 0.5 * (q * (lengths**2 - start**2)).sum()
    for name, value in expected.items():
        error = found[name].error
        assert (
            abs(found[name].value - value) <= error + 1e-14 * abs(value) and error < 1e-5
        )  # √(rounding) of the energy
    assert found["tension"].proven == found["least"].proven == proven
    assert (solution.solver["duality_gap"] is not None) == proven
    assert any('can push (law = "force-density")' in warning for warning in solution.warnings) != proven
    assert not any("strained by" in warning or "slack" in warning for warning in solution.warnings)
    assert any("is a saddle" in warning for warning in solution.warnings) == (smallest < 0.0) == (lowest == -2.0)
    assert solution.solver["above_lowest"] == (None if smallest < 0.0 else 0.0)


def test_hypar():
    """A net of one force density within straight edges of a twisted square is the saddle z = x y."""
    n = 6
    points, lines, rim = grid(n)
    plan = np.stack(np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0), indexing="ij"), axis=-1).reshape(-1, 2)
    exact = np.column_stack([plan, (plan[:, 0] - n / 2) * (plan[:, 1] - n / 2) / n])
    points[rim] = exact[rim]
    scene = scene_of(points, lines, rim, densities(7.0))
    solution = refweb.run(scene)
    np.testing.assert_allclose(solution.positions, exact, atol=1e-13)
    made = refweb.form(scene, refweb.Cable(law="tension-only", modulus=1e10, area=1e-5, density=7800.0))
    still = refweb.run(made)
    np.testing.assert_allclose(still.positions, exact, atol=1e-13)
    np.testing.assert_allclose(still.tension, solution.tension, rtol=1e-9)  # of strains of 1e-4, to rounding


@pytest.mark.parametrize("method", ["newton", "relaxation"])
def test_arch_of_struts_and_hanging_chain(method):
    """Equal loads p on equal force densities q: the parabola z = p i (n − i)/2q, by both methods where lines pull."""
    n, p = 10, -0.3
    points = np.column_stack([np.linspace(-5.0, 5.0, n + 1), np.zeros(n + 1), np.zeros(n + 1)])
    lines = np.column_stack([np.arange(n), np.arange(1, n + 1)])
    loads = [refweb.Load(node=list(range(1, n)), force=(0.0, 0.0, p))]
    i = np.arange(n + 1)
    for q in (1.0, -1.0) if method == "newton" else (1.0,):
        solve = refweb.Static(method=method)
        solution = refweb.run(scene_of(points, lines, [0, n], densities(q), loads, solve=solve))
        saddle = any("is a saddle" in warning for warning in solution.warnings)
        assert saddle == (q < 0.0) and (solution.solver["above_lowest"] == 0.0) != (saddle or method == "relaxation")
        height = p * i * (n - i) / (2.0 * q)
        np.testing.assert_allclose(solution.positions[:, 2], height, atol=1e-7 if method == "relaxation" else 1e-13)
        length = np.hypot(1.0, np.diff(height))
        np.testing.assert_allclose(solution.tension, q * length, rtol=1e-6 if method == "relaxation" else 1e-13)


def test_three_strings_meet_at_120_degrees():
    """The node is Fermat's point of a triangle without an angle of 120°: the least length of strings of one force."""
    corners = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 1.0], [1.0, 3.0, -1.0]])
    points = np.vstack([corners, [[1.0, 0.2, 2.0]]])
    cable = refweb.Cable(**STEEL, law="constant-force", pretension=10.0)
    observe = [refweb.Observe(name="z", quantity="position", node=3, component="z")]
    scene = scene_of(points, [[0, 3], [1, 3], [2, 3]], [0, 1, 2], cable, observe=observe)
    solution = refweb.run(scene)
    ways = corners - solution.positions[3]
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    np.testing.assert_allclose(ways @ ways.T, 1.5 * np.eye(3) - 0.5, atol=1e-12)
    np.testing.assert_allclose(solution.tension, 10.0, rtol=1e-15)
    assert any("does not depend on its length" in warning for warning in solution.warnings)
    assert solution.results["z"].error < 1e-12
    still = refweb.run(refweb.form(scene))
    assert np.abs(still.displacement).max() < 1e-15
    np.testing.assert_allclose(still.tension, 10.0, rtol=1e-12)  # of a strain of 1e-3


def test_steiner_tree_of_a_square():
    """Two nodes between four corners: the least length, 1 + √3, and another force in the string between them."""
    corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    lines = [[0, 4], [3, 4], [1, 5], [2, 5], [4, 5]]
    start = [[0.3, 0.45, 0.1], [0.6, 0.6, -0.2]]
    cable = refweb.Cable(**STEEL, law="constant-force", pretension=2.0)
    scene = scene_of(corners + start, lines, [0, 1, 2, 3], cable)
    solution = refweb.run(scene)
    ends = solution.positions[np.array(lines)]
    np.testing.assert_allclose(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum(), 1.0 + np.sqrt(3.0), rtol=1e-12)
    web = {"groups": {"tie": [4]}}
    tie = refweb.Cable(**STEEL, law="constant-force", pretension=2.0, groups={"tie": refweb.Group(pretension=1.0)})
    solution = refweb.run(scene_of(corners + start, lines, [0, 1, 2, 3], tie, web=web))
    slope = np.sqrt(1.0 - 0.25**2) / 0.25  # 2 · 2 cos a = 1 at each node, over half of the square
    np.testing.assert_allclose(solution.positions[4], [0.5 / slope, 0.5, 0.0], atol=1e-12)


def catenary(count):
    """A chain of one force density over 2 m, whose weight follows its length; the largest error of its heights [m].

    x is equally spaced, so that the horizontal pull is H = q Δx in all lines, and the shape tends to the catenary
    z = a cosh(x/a) + c, a = H/w.
    """
    span, weight = 2.0, 20.0
    x = np.linspace(-0.5 * span, 0.5 * span, count + 1)
    points = np.column_stack([x, 0.0 * x, 0.0 * x])
    lines = np.column_stack([np.arange(count), np.arange(1, count + 1)])
    pull = 12.0
    q = pull * count / span
    cable = refweb.Cable(
        law="force-density", force_density=q, modulus=1e11, area=1e-4, density=weight / 9.81 / 1e-4, strength=1e8
    )
    gravity = refweb.Gravity(acceleration=(0.0, 0.0, -9.81))
    made = refweb.form(scene_of(points, lines, [0, count], cable, [gravity]))
    still = refweb.run(made)
    assert still.solver["nsteps"] == 0 and not still.displacement.any()
    np.testing.assert_allclose(still.positions[:, 0], x, atol=1e-13)
    natural, tension = np.array(made.web.natural_length), still.tension
    slopes = np.diff(still.positions[:, 2]) / np.diff(x)
    np.testing.assert_allclose(tension, pull * np.hypot(1.0, slopes), rtol=1e-8)
    np.testing.assert_allclose(
        pull * np.diff(slopes), 0.5 * weight * (natural[1:] + natural[:-1]), rtol=1e-9
    )  # of what the lines weigh at their nodes
    a = pull / weight
    return np.abs(still.positions[:, 2] - a * (np.cosh(x / a) - np.cosh(0.5 * span / a))).max()


def test_weight_follows_the_shape():
    """The elastic chain that is made stands still, weighs what its lines do, and is a catenary with order 2."""
    counts = np.array([8, 16, 32])
    errors = [catenary(int(count)) for count in counts]
    assert abs(np.polyfit(np.log(counts), np.log(errors), 1)[0] + 2.0) < 0.1 and errors[-1] < 5e-3


def test_struts_and_cables_stand_still_in_their_shape(tmp_path):
    """A net with struts: lines that push become bars, the scene is one file, and names of nodes stay what they are."""
    import tomli_w

    points, lines, rim = grid(4, 5)
    q = np.full(len(lines), 2.0)
    q[[9, 20]] = -0.4
    groups, tables = own_densities(lines, q)
    corners = [0, 4, 20, 24]
    flat = points * [1.0, 1.0, 0.0]
    scene = scene_of(
        flat,
        lines,
        rim,
        densities(1.0, groups=tables, density=100.0),
        [refweb.Load(node="centre", force=(0.0, 0.0, 3.0)), refweb.Gravity(acceleration=(0.0, 1.0, -9.81))],
        web={"groups": groups, "names": {"inner": [6, 7]}},
        solve=refweb.Static(load_steps=[0.5, 1.5]),
        observe=[refweb.Observe(name="deflection", quantity="displacement", node=["centre", "inner"])],
    )
    before = refweb.run(scene, progress=False)
    centre = scene.build().net.web.find("centre")
    made = refweb.form(scene)
    assert made.solve.load_steps == (1.5,) and list(made.effects[0].node) == centre.tolist()
    laws = {table.law for table in made.cable.groups.values()}
    assert laws == {"linear", "tension-only"}
    path = tmp_path / "made.toml"
    path.write_text(tomli_w.dumps(made.to_dict()), encoding="utf-8")
    for one in (made, refweb.Scene.load(path)):
        still = refweb.run(one, progress=False)
        assert not still.displacement.any() and still.results["deflection"].value == 0.0
        lengths = np.linalg.norm(np.diff(still.positions[lines], axis=1)[:, 0], axis=1)
        np.testing.assert_allclose(still.tension, q * lengths, rtol=1e-8)
    assert (before.tension[[9, 20]] < 0.0).all() and corners[-1] == len(points) - 1


@pytest.mark.parametrize("law", ["tension-only", "smooth"])
def test_elastic_lines_beside_keep_their_lengths(law):
    """A hanging rope, pretensioned, between lines of a force density: the shape holds with the rope's own length."""
    points = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 1, 0], [1, -1, 0]]
    cable = refweb.Cable(
        law=law,
        modulus=1e7,
        area=1e-4,
        density=0.0,
        pretension=50.0,
        groups={
            "soft": refweb.Group(law="force-density", force_density=30.0),
            "loose": refweb.Group(prestrain=-0.1),
        },
    )
    load = refweb.Load(node=1, force=(0.0, 2.0, -5.0))
    lines, groups = [[0, 1], [1, 2], [1, 3], [1, 4], [1, 2]], {"soft": [2, 3], "loose": [4]}
    scene = scene_of(points, lines, [0, 2, 3, 4], cable, [load], web={"groups": groups})
    before, still = refweb.run(scene), refweb.run(refweb.form(scene))
    assert np.abs(still.displacement).max() < 1e-15
    np.testing.assert_allclose(still.positions, before.positions, atol=1e-14)
    np.testing.assert_allclose(still.tension, before.tension, rtol=1e-9)
    natural, near = refweb.form(scene).web.natural_length, 1e-15 if law == "tension-only" else 1e-4
    np.testing.assert_allclose(natural[:2], 1.0 / (1.0 + 50.0 / 1e3), rtol=near)
    np.testing.assert_array_equal(natural[4:], scene.build().net.natural_length[4:])
    assert before.results["max_tension"].proven == (law == "tension-only")
    assert before.tension[4] < 0.0 if law == "smooth" else before.tension[4] == 0.0


@pytest.mark.parametrize(
    "law, tension",
    [
        (dict(law="tension-only"), 30.0),
        (dict(law="smooth", slackness=1e-3, smoothing=1e-2), 30.0),
        (dict(law="smooth"), 30.0),
        (dict(law="linear"), 30.0),
        (dict(law="linear"), -30.0),
        (dict(law="smooth", smoothing=0.0), 0.0),
    ],
)
def test_pretension(law, tension):
    """The tension of each line in the web's position, whatever the law is; a group replaces the cable's prestrain."""
    points, lines, rim = grid(2, 7)
    group = {"groups": {"some": refweb.Group(pretension=2.0 * tension)}}
    for more, expected in (
        ({"pretension": tension}, [1.0, 1.0]),
        ({"prestrain": 0.0, "pretension": tension, **group}, [1.0, 2.0]),
    ):
        cable = refweb.Cable(modulus=1e7, area=1e-4, density=1.0, **law, **more)
        system = scene_of(points, lines, list(range(9)), cable, web={"groups": {"some": [3, 5]}}).build()
        found = system.forces(0.0, np.zeros((system.rows, 3))).per_cell.tension
        np.testing.assert_allclose(np.delete(found, [3, 5]), tension, rtol=1e-11, atol=1e-12)
        np.testing.assert_allclose(found[[3, 5]], expected[1] * tension, rtol=1e-11, atol=1e-12)
    with_prestrain = refweb.Cable(modulus=1e7, area=1e-4, density=1.0, prestrain=0.1, **law, **group)
    net = scene_of(points, lines, list(range(9)), with_prestrain, web={"groups": {"some": [3, 5]}}).build().net
    lengths = np.linalg.norm(points[lines[:, 1]] - points[lines[:, 0]], axis=1)
    np.testing.assert_allclose(np.delete(net.natural_length * 1.1 / lengths, [3, 5]), 1.0, rtol=1e-15)


@pytest.mark.slow
def test_sag():
    """Lines of a net hang by the share of their length under their weight, with order 2 in their elements."""
    counts, errors = np.array([8, 16, 32]), []
    points = [[0, 0, 0], [2, 0, 0], [2, 3, 0]]
    for count in counts:
        cable = refweb.Cable(law="tension-only", modulus=1e12, area=1e-4, density=100.0, sag=0.1, subdivide=int(count))
        gravity = refweb.Gravity(acceleration=(0.0, 0.0, -9.81))
        low = refweb.Observe(name="low", quantity="position", component="z", select="min")
        scene = scene_of(points, [[0, 1], [1, 2]], [0, 1, 2], cable, [gravity], observe=[low])
        solution = refweb.run(scene)
        errors.append(abs(solution.results["low"].value + 0.1 * 3.0))
    assert abs(np.polyfit(np.log(counts), np.log(errors), 1)[0] + 2.0) < 0.1 and errors[-1] < 1e-3


def test_length_of_a_catenary_by_its_sag():
    for sag in (1e-8, 1e-3, 0.5, 100.0):  # parameter a of a catenary over 1 m, by its sag
        parameter = brentq(lambda a: 2.0 * a * np.sinh(0.25 / a) ** 2 - sag, 1e-3, 1.0 + 1.0 / sag)  # noqa: B023
        np.testing.assert_allclose(over_chord(np.array([sag])), 2.0 * parameter * np.sinh(0.5 / parameter), rtol=1e-9)


POINTS = [[0, 0, 0], [1, 0, 0], [2, 0, 0]]
FORCED = {"law": "force-density", "force_density": 1.0}


@pytest.mark.parametrize(
    "cable, more, message",
    [
        ({"law": "force-density"}, {}, 'law = "force-density" of line 0 needs force_density = ..., not 0 .N/m.'),
        ({"law": "constant-force"}, {}, 'law = "constant-force" of line 0 needs pretension = ..., not 0 .N.'),
        (
            {"law": "linear", "force_density": 1.0},
            {},
            "force_density = 1 has no meaning with law = .linear., which line 0",
        ),
        ({**FORCED, "pretension": 1.0}, {}, 'pretension = 1 has no meaning with law = "force-density"'),
        ({**FORCED, "prestrain": 0.1}, {}, "prestrain = 0.1 has no meaning"),
        ({**FORCED, "sag": 0.1}, {}, "sag = 0.1 has no meaning"),
        ({"prestrain": 0.1, "sag": 0.1}, {}, "prestrain = 0.1 and sag = 0.1 both say what the natural length is"),
        ({"force_density": 0.0, "law": "force-density"}, {}, "force_density = 0 must not be 0"),
        (
            {"law": "tension-only", "pretension": -1.0},
            {},
            'pretension: line 0 pushes with 1 N, and law = "tension-only" does not',
        ),
        ({"law": "linear", "pretension": -1e5}, {}, "pretension: line 0 pushes with 100000 N, more than its EA"),
        ({"sag": 101.0}, {}, "sag = 101.0 must be ≤ 100"),
        (FORCED, {"solve": {"kind": "dynamic", "duration": 1.0}}, "is for form finding, .* run what refweb.form makes"),
        (FORCED, {"reel": [{"lines": [0], "factor": [[0, 1], [1, 0.9]]}]}, "line 0 has a law of form finding, whose"),
        (FORCED, {"temperature": {"expansion": 1e-5, "change": 10.0}}, "line 0 has a law of form finding"),
        (
            {"law": "constant-force", "pretension": 1.0},
            {"solve": {"kind": "static", "method": "relaxation"}},
            'method = "relaxation" must be "newton" with law = "constant-force"',
        ),
    ],
)
def test_refusals(cable, more, message):
    given = {
        "web": {"kind": "inline", "points": POINTS, "lines": [[0, 1], [1, 2]], "supports": [0, 2]},
        "cable": {"modulus": 1e9, "area": 1e-5, "density": 1.0, **cable},
        "solve": {"kind": "static"},
        **more,
    }
    with pytest.raises(refweb.InputError, match=message):
        refweb.Scene.from_dict(given).build()
    if "pretension" in cable and "law" in cable and cable["law"] != "force-density":
        given["web"]["natural_length"] = 1.0
        with pytest.raises(refweb.InputError):
            refweb.Scene.from_dict(given | {"solve": {"kind": "static", "method": "relaxation"}}).build()


def test_what_form_finding_refuses():
    plain = scene_of(POINTS, [[0, 1], [1, 2]], [0, 2], densities(1.0))
    elastic = refweb.Cable(**STEEL, law="tension-only")
    refusals = [
        (plain.replace(solve=refweb.Dynamic(duration=1.0)), elastic, 'kind = "dynamic" must be "static"'),
        (plain.replace(cable=densities(1.0, subdivide=2)), elastic, "subdivide = 2, order = 1 must be 1"),
        (
            plain.replace(effects=[refweb.Motion(node=0, displacement=[(0, 0, 0, 0)])]),
            elastic,
            "motion.* cannot be used",
        ),
        (plain, densities(1.0), 'law = "force-density" is for form finding'),
        (plain, refweb.Cable(**STEEL, law="tension-only", prestrain=0.1), "prestrain = 0.1 cannot be used"),
        (
            plain.replace(cable=densities(-1.0)),
            elastic,
            'line 0 pushes with 1 N, and law = "tension-only" does not',
        ),
    ]
    for scene, cable, message in refusals:
        with pytest.raises(refweb.InputError, match=message):
            refweb.form(scene, cable)
    heavy = plain.replace(effects=[refweb.Gravity(acceleration=(0, 0, -9.81))], cable=densities(1.0, density=100.0))
    with pytest.raises(refweb.SolverError, match="the shape is no equilibrium of the scene that is made"):
        refweb.form(heavy, elastic)
    with pytest.raises(refweb.InputError, match="lines of form finding do not vibrate"):
        refweb.modes(plain)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert refweb.form(plain, elastic).title == "scene, formed"


@pytest.mark.parametrize("load", [-5.0, -2.0, -2.001])
def test_what_constant_forces_cannot_carry_is_refused(load):
    """Two lines of 1 N carry less than 2 N, 1.9 N by an angle with the vertical of acos(0.95)."""

    def scene(force):
        return refweb.Scene(
            web=refweb.Inline(points=[[-1, 0, 0], [1, 0, 0], [0, 0, 0.1]], lines=[[0, 2], [1, 2]], supports=[0, 1]),
            cable=refweb.Cable(law="constant-force", pretension=1.0, modulus=1e9, area=1e-6, density=0.0),
            effects=[refweb.Load(node=2, force=(0.0, 0.0, force))],
            observe=[refweb.Observe(name="z", quantity="position", node=2, component="z")],
            solve=refweb.Static(),
        )

    exact = -0.95 / np.sqrt(1.0 - 0.95**2)
    assert refweb.run(scene(-1.9)).results["z"].value == pytest.approx(exact, rel=1e-9)
    with pytest.raises(refweb.SolverError, match="cannot carry the loads: lower these, or raise pretension"):
        refweb.run(scene(load))
