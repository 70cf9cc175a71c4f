"""Two lines between the same two nodes are one of the sum of their areas; nodes that links alone hold."""

import meshio
import nets
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipk

import refweb

POINTS = [[0.0, 0.0, 0.0], [0.5, 0.1, 0.0], [1.1, 0.0, 0.2], [0.6, 0.9, 0.1], [2.0, 0.1, 0.0]]
TWICE = [[0, 1], [1, 0], [1, 2], [1, 3], [3, 1], [2, 3], [2, 4], [2, 4]]
GROUPS = ["thin", "thick", "", "thin", "thick", "", "thin", "thick"]
ONCE = [[0, 1], [1, 2], [1, 3], [2, 3], [2, 4]]
THIN, THICK, LENGTH = 1e-5, 3e-5, 0.99
LOAD = refweb.Load(node=1, force=(3.0, -2.0, -5.0))


def scene(twice, solve, effects=(LOAD,), web=None, **cable):
    """A small net whose lines are partly double, or whose double lines are one of the sum of the areas."""
    groups = GROUPS if twice else ["double", "", "double", "", "double"]
    lines = TWICE if twice else ONCE
    distance = [LENGTH * float(np.linalg.norm(np.subtract(POINTS[a], POINTS[b]))) for a, b in lines]
    areas = dict(thin=dict(area=THIN), thick=dict(area=THICK)) if twice else dict(double=dict(area=THIN + THICK))
    own = dict(law="tension-only", modulus=1e8, area=2e-5, density=800.0, groups=areas)
    given = dict(output=refweb.Output(interval=1e-3), accuracy=refweb.Accuracy(error="none"))
    return refweb.Scene(
        web=web
        or refweb.Inline(points=POINTS, lines=lines, natural_length=distance, groups=groups, supports=[0, 3, 4]),
        cable=refweb.Cable(**{**own, **cable}),
        effects=list(effects),
        solve=solve,
        **(given if solve.kind == "dynamic" else {}),
    )


def double(solution):
    """Largest tension of the double lines together, where there are two of them or one [N]."""
    tension = solution.state.tension
    return tension[[0, 3, 6]] + tension[[1, 4, 7]] if len(tension) == 8 else tension[[0, 2, 4]]


SOLVES = {
    "newton": refweb.Static(),
    "relaxation": refweb.Static(method="relaxation"),
    "central-difference": refweb.Dynamic(duration=5e-3, step_size=1e-5),
    "cvode": refweb.Dynamic(method="cvode", duration=5e-3, rtol=1e-8),
}
WITHIN = {"newton": 1e-12, "relaxation": 1e-8, "central-difference": 1e-11, "cvode": 1e-5}
"""Of the largest displacement: the residual, the rounding of 500 steps, and the tolerance with which errors add up."""


@pytest.mark.parametrize("name, order", [*((name, 1) for name in SOLVES), ("newton", 2)])
def test_two_lines_are_one_of_their_sum(name, order):
    """Of any order and cut in any way, whose nodes are then at one place and move alike."""
    two, one = (refweb.run(scene(twice, SOLVES[name], order=order)) for twice in (True, False))
    assert two.status == one.status == "solved"
    size = np.abs(one.state.x).max()
    assert size > 1e-5
    np.testing.assert_allclose(two.state.x[:5], one.state.x[:5], rtol=0, atol=WITHIN[name] * size)
    np.testing.assert_allclose(double(two), double(one), rtol=0, atol=100.0 * WITHIN[name] * double(one).max())


def test_modes_of_two_lines_are_those_of_one():
    two, one = (refweb.modes(scene(twice, refweb.Static()), 6) for twice in (True, False))
    np.testing.assert_allclose(two.frequency, one.frequency, rtol=1e-9)


def test_bending_of_two_lines_is_twice_that_of_one():
    """Along a straight chain every one of two lines continues one, not both."""
    energies = []
    for lines, stiffness in ([[0, 1], [1, 2], [2, 3]], 2.0), ([[0, 1], [0, 1], [1, 2], [2, 1], [2, 3], [2, 3]], 1.0):
        web = refweb.Inline(points=[[i, 0.0, 0.0] for i in range(4)], lines=lines, supports=[0]).web()
        system = nets.system(
            web, nets.Cable(modulus=1e6, area=1e-4, density=1.0), [refweb.Bending(stiffness=stiffness)]
        )
        x = 0.1 * np.random.default_rng(0).standard_normal((4, 3))
        term = next(term for term in system.terms if term.name == "bending")
        energies.append(system.energy_of(term, 0.0, x).sum())
    np.testing.assert_allclose(energies[1], energies[0], rtol=1e-14)


def test_frames_and_mesh_files_keep_both_lines(tmp_path):
    """A frame has all cells, and as a mesh file with natural lengths and groups is the web again."""
    two = refweb.run(scene(True, refweb.Static()), tmp_path / "results")
    (frame,) = sorted((tmp_path / "results" / "frames").glob("*.vtu"))[-1:]
    drawn = meshio.read(frame)
    np.testing.assert_array_equal(drawn.cells_dict["line"], TWICE)
    np.testing.assert_allclose(drawn.cell_data["tension"][0], two.state.tension, rtol=1e-12)
    web = two.state.system.net.web
    data = {"natural_length": [web.natural_length], "group": [np.array([1 + (g == "thick") for g in GROUPS])]}
    support = {"support": np.isin(np.arange(5), [0, 3, 4]).astype(float)}
    meshio.Mesh(web.points, [("line", web.lines)], point_data=support, cell_data=data).write(tmp_path / "net.vtu")
    file = refweb.File(path=str(tmp_path / "net.vtu"))
    areas = {"1": dict(area=THIN), "2": dict(area=THICK)}
    again = refweb.run(scene(True, refweb.Static(), web=file, groups=areas))
    expected = refweb.run(scene(True, refweb.Static(), groups=dict(thick=dict(area=THICK)), area=THIN))
    np.testing.assert_allclose(again.state.x, expected.state.x, rtol=0, atol=1e-14)


# Nodes that links alone hold

GRAVITY = 9.81


def hung(links, points, masses, duration, **web):
    """Masses on links below a node that is held; the only line stands beside them, between two supports."""
    anchors = [[-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    given = refweb.Inline(points=[*anchors, *points], lines=[[0, 1]], supports=[0, 1])
    effects = [refweb.Link(nodes=nodes) for nodes in links]
    effects += [refweb.PointMass(node=2 + i, mass=mass) for i, mass in enumerate(masses)]
    return refweb.Scene(
        web=web.get("web", given),
        cable=refweb.Cable(law="linear", modulus=1e6, area=1e-5, density=1000.0),
        effects=[*effects, refweb.Gravity(acceleration=(0.0, 0.0, -GRAVITY))],
        solve=refweb.Dynamic(method="ida", duration=duration, rtol=1e-8, max_order=5),
        output=refweb.Output(interval=duration / 8, frames=2),
        accuracy=refweb.Accuracy(error="none"),
    )


@pytest.mark.slow
def test_a_pendulum_on_a_link_alone(tmp_path):
    """From horizontal it comes back after 4 K(sin²45°) √(L/g); its frame has the node, and no line of it."""
    period = 4.0 * ellipk(0.5) * np.sqrt(0.7 / GRAVITY)
    solution = refweb.run(hung([[1, 2]], [[0.7, 0.0, 0.0]], [2.0], period), tmp_path / "results")
    assert solution.status == "solved" and not solution.state.slack_nodes.size
    # Errors of some 1000 steps add up to 100 times the tolerance.
    np.testing.assert_allclose(solution.state.x[2], 0.0, atol=1e-6)
    frame = meshio.read(sorted((tmp_path / "results" / "frames").glob("*.vtu"))[-1])
    assert len(frame.points) == 3 and len(frame.cells_dict["line"]) == 1
    points, cells = [[-1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.7, 0.0, 0.0]], [("line", [[0, 1]])]
    meshio.Mesh(points, cells, point_data={"support": np.array([1.0, 1.0, 0.0])}).write(tmp_path / "net.vtu")
    file = refweb.File(path=str(tmp_path / "net.vtu"))
    again = refweb.run(hung([[1, 2]], [], [2.0], period, web=file))
    np.testing.assert_array_equal(again.state.x, solution.state.x)


@pytest.mark.slow
def test_a_double_pendulum_on_links_alone():
    """Against its angles by DOP853, before it is chaotic."""
    first, second, length, other = 2.0, 0.5, 0.7, 0.4
    a, b, end = 1.2, 0.3, 1.0

    def rate(_, y):
        (p, q, u, w), m = y, first + second
        mass = [[m * length, second * other * np.cos(p - q)], [length * np.cos(p - q), other]]
        pull = [
            -second * other * w * w * np.sin(p - q) - m * GRAVITY * np.sin(p),
            length * u * u * np.sin(p - q) - GRAVITY * np.sin(q),
        ]
        return u, w, *np.linalg.solve(mass, pull)

    p, q = solve_ivp(rate, (0.0, end), (a, b, 0.0, 0.0), method="DOP853", rtol=1e-12, atol=1e-12).y[:2, -1]

    def places(p, q):
        inner = length * np.array([np.sin(p), 0.0, -np.cos(p)])
        return np.array([inner, inner + other * np.array([np.sin(q), 0.0, -np.cos(q)])])

    solution = refweb.run(hung([[1, 2, 3]], places(a, b).tolist(), [first, second], end))
    np.testing.assert_allclose(solution.positions[2:4], places(p, q), rtol=0, atol=1e-5)


def test_nodes_that_nothing_holds_are_refused():
    """Links hold no length in statics and modes, which say so; a node that no link names either is in nothing."""
    lone = hung([[1, 2]], [[0.7, 0.0, 0.0], [0.9, 0.0, 0.0]], [2.0, 1.0], 0.1)
    with pytest.raises(
        refweb.InputError, match=r"\[web\] node 3 is used by no line, no \[\[link\]\] and no \[\[thread\]\]"
    ):
        refweb.run(lone)
    with pytest.raises(refweb.InputError, match=r"node 2 has no mass: give density > 0 or a \[\[point_mass\]\]"):
        refweb.run(hung([[1, 2]], [[0.7, 0.0, 0.0]], [], 0.1))
    held = hung([[1, 2]], [[0.7, 0.0, 0.0]], [2.0], 0.1)
    static = held.replace(solve=refweb.Static(), output=refweb.Output(), accuracy=refweb.Accuracy())
    for refused in (lambda: refweb.run(static), lambda: refweb.modes(held)):
        with pytest.raises(refweb.InputError, match=r"\[\[link\]\]"):
            refused()
