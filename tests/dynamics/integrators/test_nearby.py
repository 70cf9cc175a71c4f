"""Lists of what bodies can reach: nothing is missed, and a run is the same to the last bit as one that looks at all."""

from dataclasses import replace

import numpy as np
import pytest

import refweb
from refweb.dynamics.integrators.central_difference import CentralDifference
from refweb.dynamics.integrators.tangent import Steps
from refweb.dynamics.simulation import Simulation
from refweb.effects.self_contact import table

BALL = refweb.Body(name="ball", radius=0.08, mass=0.4, position=(0.03, 0.02, -0.1), velocity=(1.5, 0.5, 3.0))
BOX = refweb.Body(name="box", shape="box", size=(0.1, 0.12, 0.08), fixed=True, position=(0.1, 0.0, 0.035))
SPUN = refweb.Body(
    name="rod", shape="cylinder", radius=0.05, length=0.5, axis=(1.0, 0.3, 0.1), mass=0.3, position=(0.0, 0.0, 0.1),
    velocity=(0.3, 0.0, -1.0), angular_velocity=(3.0, -20.0, 10.0),
)  # fmt: skip
GROUND = refweb.Body(name="ground", shape="plane", normal=(0.0, 0.0, 1.0), position=(0.0, 0.0, -0.05), fixed=True)
FALLEN = refweb.Body(
    name="crate", shape="box", size=(0.3, 0.2, 0.2), mass=0.5, position=(0.03, 0.02, 0.12), velocity=(0.4, 0.1, -2.0),
    angular_velocity=(1.0, 2.0, 3.0),
)  # fmt: skip
AT_REST = refweb.Body(name="post", radius=0.05, fixed=True, position=(0.2, 0.2, 0.051))
SHAKEN = refweb.Motion(node="rim", displacement=[(0.0, 0.0, 0.0, 0.0), (0.01, 0.02, 0.0, 0.1), (0.03, 0.0, 0.0, -0.1)])


def case(*effects, subdivide=1, **contact):
    """A window that bodies fly through for 30 ms, or that is shaken beside them."""
    return refweb.Scene(
        web=refweb.Window(mesh="square", rows=8, columns=8, side=0.1),
        cable=refweb.Cable(law="tension-only", modulus=1e7, area=1e-5, density=200.0, subdivide=subdivide),
        effects=[*effects, refweb.Contact(stiffness=3e3, **contact)],
        solve=refweb.Dynamic(duration=0.03),
        output=refweb.Output(interval=2e-3),
        accuracy=refweb.Accuracy(error="none"),
        observe=[
            refweb.Observe(name="deflection", quantity="displacement", reduce="max"),
            refweb.Observe(name="tension", quantity="tension", reduce="max"),
            refweb.Observe(name="energy", quantity="contact_energy", reduce="max"),
        ],
    )


def solver_of(scene, everything):
    system = scene.build()
    if everything:
        system.terms = [replace(term, contact=term.contact._replace(near=None, passing=None)) for term in system.terms]
    solver = Simulation(scene, scene.build(), refweb.Solution(scene)).integrator
    return CentralDifference(system, *solver.observed)


@pytest.mark.ordinary("ball", "bodies", "exponent", "shaken", "rubbing", "tumbling", "crate")
@pytest.mark.parametrize(
    "scene",
    [
        case(BALL),
        case(BALL, BOX, AT_REST, subdivide=3),
        case(BALL, exponent=1.5),
        case(AT_REST, SHAKEN),
        case(BALL, BOX, AT_REST, friction=0.4),
        case(SPUN, friction=0.4, damping=0.3),
        case(GROUND, FALLEN, between_bodies=True),
        case(FALLEN, friction=0.3),
    ],
    ids=["ball", "bodies", "exponent", "shaken", "rubbing", "tumbling", "ground", "crate"],
)
def test_lists_change_no_bit(scene):
    """Of the last state, the history and all peaks: the same run with every line looked at in every step.

    So is one that is taken row by row, where a list is made anew: a run is, for as many rows as the machine is slow.
    """
    times, courses, rows = np.linspace(1e-3, 0.03, 30), [], []
    for everything, count in ((False, 30), (False, 1), (True, 30)):
        solver = solver_of(scene, everything)
        courses.append(solver.start())
        rows.append(np.vstack([solver.advance(courses[-1], some).values for some in times.reshape(-1, count)]))
    assert rows[0][:, 1:].any() and courses[0].extremes.values.min() > 0.0  # something has touched
    for course, values in zip(courses[1:], rows[1:], strict=True):
        np.testing.assert_array_equal(values, rows[0])
        for name, array in courses[0].arrays().items():
            if name == "longest":  # is noted with the lists alone
                continue
            np.testing.assert_array_equal(array, course.arrays()[name], err_msg=name)


@pytest.mark.parametrize("threshold", ["LISTED", "FORESEEN"])
def test_lists_of_pairs_change_no_bit(threshold, monkeypatch):
    """A heap of chains that fall on each other and on a crate is the same with all pairs looked at in every step.

    Pairs are found as they come near, or are all listed ahead.
    """
    monkeypatch.setattr(table, threshold, 0)
    rng, chains, courses = np.random.default_rng(5), 8, []
    points = np.array([(0.05 * n, 0.02 * m, 0.03 * m) for m in range(chains) for n in range(7)])
    points[7:, :2] = points[7:, :2] @ [[0.8, 0.6], [-0.6, 0.8]]  # the first lies across all others
    lines = [(7 * m + n, 7 * m + n + 1) for m in range(chains) for n in range(6)]
    scene = refweb.Scene(
        web=refweb.Inline(points=points, lines=lines, supports=[]),
        cable=refweb.Cable(law="tension-only", modulus=1e7, area=1e-6, density=1000.0),
        effects=[
            refweb.SelfContact(radius=2e-3, stiffness=1e3),
            refweb.Body(name="crate", shape="box", size=(0.2, 0.2, 0.1), mass=0.2, position=(0.1, 0.1, -0.06)),
            refweb.Contact(stiffness=1e3, friction=0.2),
        ],
        solve=refweb.Dynamic(duration=0.1),
    )
    start = np.column_stack([rng.uniform(-0.5, 0.5, (56, 2)), -2.0 + rng.uniform(-1.0, 1.0, 56)])
    for everything in (False, True):
        system = scene.build()
        if everything:
            bare = {"near": None, "finder": None, "foresee": None, "passing": None}
            system.terms = [replace(term, contact=term.contact._replace(**bare)) for term in system.terms]
        solver = CentralDifference(system, step_size=2e-5)
        courses.append(solver.start(None, np.vstack([start, np.zeros((system.rows - 56, 3))])))
        stored = solver.advance(courses[-1], np.linspace(0.01, 0.1, 10))
    columns = [stored.values[:, stored.names.index(name)] for name in ("self_contact", "contact")]
    assert min(np.max(column) for column in columns) > 0.0
    np.testing.assert_array_equal(courses[0].x, courses[1].x)


@pytest.mark.parametrize(("layers", "end"), [(8, 0.2), (3, 0.6)], ids=["found", "listed"])
def test_a_thrown_net_is_the_same_row_by_row(layers, end):
    """Pairs of lines are near each other, and a body is within reach of a row but not yet of the list.

    So it is step by step, as gradients follow a run: they see each step of each span.
    """
    keys = {"web.layers": layers, "web.cell_area": 0.6, "accuracy.error": "none"}
    system, times = refweb.Scene.load("capture-stage", keys).build(), np.linspace(0.1 * end, end, 10)
    assert any(term.contact.finder is not None for term in system.terms) == (layers == 8)
    assert any(term.contact.foresee is not None for term in system.terms)
    courses = []
    for rows in (times[None, :], times[:, None]):
        solver = CentralDifference(system)
        courses.append(solver.start())
        for some in rows:
            solver.advance(courses[-1], some)
    steps, sizes = Steps(CentralDifference(system), ()), []
    steps.follow(times, lambda t, h, corner: sizes.append(h))
    assert courses[0].nsteps == courses[1].nsteps == steps.course.nsteps == len(sizes)
    np.testing.assert_array_equal(courses[0].x, courses[1].x)
    np.testing.assert_array_equal(courses[0].x, steps.course.x)
    np.testing.assert_allclose(sum(sizes), end, rtol=1e-12)  # roundings of 1e-16 a step


@pytest.mark.parametrize("turned", [0.0, 0.02], ids=["still", "turning"])
def test_margins_hold_what_comes_near(turned):
    """All pairs and lines that touch after rows have moved anyhow within their margins are in the lists, in order."""
    from refweb.dynamics.integrators import neighbour_list

    keys = {"web.layers": 8, "web.cell_area": 0.6, "body.0.position": [0.0, 0.0, 1.2]}
    system, rng = refweb.Scene.load("capture-stage", keys).build(), np.random.default_rng(3)
    pairs, lines = (term for term in system.terms if term.contact.foresee or term.contact.places)
    marks, x = np.zeros((system.rows - system.net.spins, 4)), np.zeros((system.rows, 3))
    nodes = system.net.bodies[0].row
    x[:nodes] = rng.normal(0.0, 0.2, (nodes, 3))
    marks[:, 3] = rng.exponential(0.02, len(marks))
    marks[nodes, 3] += turned
    found = neighbour_list.within_margins(lines.contact.near, 1)(0.0, x, marks, lines.cells, lines.data)
    listed = pairs.contact.finder(0.0, marks, x, pairs.cells, pairs.data)[0]
    order = listed[:, 0] * len(pairs.cells) + listed[:, 1]
    assert (np.diff(order) > 0).all() and 0 < len(found) < len(lines.cells)
    none, touching = np.zeros((0, 4)), [0, 0]
    for _ in range(30):
        way = rng.normal(size=(len(marks), 3))
        moved = x.copy()
        way *= ((marks[:, 3] - turned * (np.arange(len(marks)) == nodes)) / np.linalg.norm(way, axis=1))[:, None]
        moved[: len(marks)] += way
        now = pairs.contact.finder(0.0, none, moved, pairs.cells, pairs.data)[0]
        assert np.isin(now[:, 0] * len(pairs.cells) + now[:, 1], order).all()
        near = neighbour_list.within_margins(lines.contact.near, 1)(0.0, moved, none, lines.cells, lines.data)
        assert np.isin(near, found).all()
        touching = [touching[0] + len(now), touching[1] + len(near)]
    assert min(touching) > 0


def distances(net, body, x):
    """From the sphere around a body to each line, as segments between its nodes, or more: from their box to its box."""
    a, b = ((net.points + x)[net.cells[:, k]] - (net.points + x)[body.row] for k in (0, 1))
    place = np.clip(-((b - a) * a).sum(axis=1) / ((b - a) ** 2).sum(axis=1), 0.0, 1.0)
    nearest = np.linalg.norm(a + place[:, None] * (b - a), axis=1) - body.extent
    if body.shape.extent == body.radius:
        return nearest
    over = np.abs(0.5 * (a + b) @ body.axes.T) - np.array(body.core) - body.radius
    return np.maximum(nearest, np.linalg.norm(np.maximum(over, 0.0), axis=1) - 0.5 * np.linalg.norm(b - a, axis=1))


def depths(net, body, x):
    """Of the deepest of some points of each line, below 0 outside of the body."""
    a, b = ((net.points + x)[net.cells[:, k]] - (net.points + x)[body.row] for k in (0, 1))
    points = (a + np.linspace(0.0, 1.0, 33)[:, None, None] * (b - a)) @ body.axes.T
    depth, grown = body.shape.depth(), body.shape.grown()
    return np.array([[depth(tuple(p), grown)[0] for p in of_place] for of_place in points]).max(axis=0)


def test_what_is_near_is_what_is_near():
    """The kernel at random displacements: lines within the skin are found, whole, and none further than their boxes."""
    scene, rng = case(BALL, BOX, subdivide=3), np.random.default_rng(7)
    system = scene.build()
    net, counts = system.net, []
    for term in (one for one in system.terms if one.contact.near is not None):
        body = next(body for body in net.bodies if body.row == term.cells[0, -1])
        for skin in (0.0, 0.05, 0.3):
            x, chosen = rng.normal(0.0, 0.02, (system.rows, 3)), np.empty(len(term.cells), dtype=np.int64)
            count = term.contact.near(skin, x, term.cells, term.data, chosen)
            may = np.isin(net.line, net.line[distances(net, body, x) < skin])
            must = np.isin(net.line, net.line[-depths(net, body, x) < skin])
            np.testing.assert_array_equal(np.isin(net.line, net.line[chosen[:count]]).sum(), count)  # whole lines
            assert may[chosen[:count]].all() and np.isin(np.flatnonzero(must), chosen[:count]).all()
            counts.append(count)
    assert 0 < sorted(counts)[1] and max(counts) < len(net.cells)


def test_bounds_of_steps_do_not_depend_on_lists():
    """A list has all lines that a bound counts, also where lines have moved since, by the rest of the skin.

    The bound counts the lines that come as far as its reach, by the depth of the deepest of many points, and no others.
    """
    scene, rng, shares = case(BOX, GROUND, AT_REST, SPUN, exponent=1.5), np.random.default_rng(5), []
    system, moved = scene.build(), 0.01
    net, nodes = system.net, system.net.bodies[0].row
    for term in (one for one in system.terms if one.contact.near is not None):
        for reach in (0.0, 0.01, 0.03, 0.1):
            x, way = np.zeros((2, system.rows, 3))
            x[:nodes], way[:nodes] = rng.normal(0.0, 0.02, (nodes, 3)), rng.normal(size=(nodes, 3))
            listed = np.empty(len(term.cells), dtype=np.int64)
            listed = listed[: term.contact.near(reach + moved, x, term.cells, term.data, listed)]
            x[:nodes] += moved * way[:nodes] / np.linalg.norm(way[:nodes], axis=1, keepdims=True)
            counted, gaps = np.zeros(len(term.cells), dtype=bool), np.zeros(len(term.cells))
            for c in range(len(term.cells)):
                rates, one = np.zeros(system.rows), slice(c, c + 1)
                term.tangent.bound(reach, 0.0, x, net.mass, rates, term.cells[one], term.data[one])
                counted[c] = rates.any()
            for body in net.bodies:
                its = term.cells[:, 2] == body.row
                gaps[its] = -depths(net, body, x)[term.elements.numbers[its]]
            assert np.isin(np.flatnonzero(counted), listed).all()
            # points are some 0.1 m/32 apart, so that the deepest place of a line is less than 2 mm from one
            assert counted[gaps < reach].all() and not counted[gaps > reach + 2e-3].any()
            shares.append(counted.mean())
    assert min(shares) < 0.1 and max(shares) > 0.3


def test_far_from_a_body_few_lines_are_looked_at():
    """A ball that is a tenth as wide as the web: what stands in the lists at any step is a part of all lines."""
    from refweb.dynamics.integrators import neighbour_list

    solver = solver_of(case(BALL), False)
    course, model = solver.start(), solver.model
    solver.advance(course, [2e-3])
    skin, lists = model.nearby.skin, model.terms
    everything = len(lists.cells[1])
    assert everything == 2 * 8 * 7 and skin["depth"] == np.inf  # whoever comes next looks at all
    term = solver.system.terms[1]
    swap, arrays = neighbour_list.swap_of(term.contact.near), (lists.cells, lists.data, lists.outs, lists.stored)
    swap(1, 0, 0.05, course.x, np.zeros((0, 4)), *arrays)
    chosen = lists.cells[-1][:, 0]
    assert 0 < len(chosen) < 0.5 * everything
    np.testing.assert_array_equal(lists.cells[1], term.cells[chosen])
    np.testing.assert_array_equal(lists.data[1], term.data[chosen])
    lists.outs[1][:], skin["depth"] = 1.0, 0.05
    neighbour_list.show_near(model.nearby, lists)
    np.testing.assert_array_equal(np.flatnonzero(lists.outs[-1][:, 0]), chosen)
    neighbour_list.look_at_all(solver.system, model)
    assert len(lists.cells[1]) == len(lists.outs[1]) == len(lists.stored[1]) == everything
