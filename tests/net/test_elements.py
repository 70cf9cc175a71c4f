"""The compiled elements against the weak form on the page, and the digits of their strain."""

from dataclasses import replace

import mpmath
import numpy as np
import pytest
import skfem
from nets import LAWS, skew_cable, skew_net, skew_web, system
from oracle import Oracle

from refweb.compiled.rows import column_of, records_of, width_of
from refweb.effects import line_blocks
from refweb.effects.base import BLOCK_OUT, MOVES, RESTS, UNKNOWN
from refweb.effects.elasticity import Elasticity
from refweb.effects.line_blocks import BLOCK, runs_of
from refweb.net import discretisation, elements
from refweb.net.cable import Cable
from refweb.net.laws.law import LINE
from refweb.net.web import Web
from refweb.results.state import State
from refweb.system.system import System
from refweb.system.weak_form import tangent_matrix

# Both ways sum some dozen products of numbers with a relative rounding of 1e-16 each, and the oracle's strain λ − 1 is
# rounded to 1e-16 of a largest strain near 0.1: 1e-15 of the largest entry, and a factor of 100 to be safe.
TIGHT = 1e-13
FINER = [(1, 1), (2, 1), (3, 1), (1, 3), (2, 3), (3, 2)]
"""Orders and subdivisions."""


def finer_cable(law, order, subdivide):
    return replace(skew_cable(law), order=order, subdivide=subdivide)


def displacement(seed, rows=6, size=0.05):
    return size * np.random.default_rng(seed).standard_normal((rows, 3))


def skew_system(law, order=1, subdivide=1):
    """The skew net with two nodes held and a third in one direction only."""
    cable = finer_cable(law, order, subdivide)
    supported = np.zeros((len(discretisation.build(skew_web(), cable).points), 3), dtype=bool)
    supported[[0, 2]] = True
    supported[4, 1] = True
    return system(skew_web(), cable, supported=supported)


@pytest.mark.parametrize("order, subdivide", FINER)
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("seed", range(5))
def test_kernels_equal_the_weak_form(law, seed, order, subdivide):
    oracle, net_system = Oracle(skew_web(), finer_cable(law, order, subdivide)), skew_system(law, order, subdivide)
    x = displacement(seed, net_system.rows)
    expected = oracle.force(x)
    np.testing.assert_allclose(net_system.force(1.0, x), expected, rtol=0, atol=TIGHT * np.abs(expected).max())
    free = net_system.free
    expected = oracle.stiffness(x)[free][:, free].toarray()
    got = net_system.pattern.matrix(net_system.stiffness(1.0, x)).toarray()
    np.testing.assert_allclose(got, expected, rtol=0, atol=TIGHT * np.abs(expected).max())
    expected = oracle.energy(x)
    got = net_system.energy_of(net_system.lines, 1.0, x)
    np.testing.assert_allclose(got, expected, rtol=0, atol=TIGHT * np.abs(expected).max())


@pytest.mark.parametrize("order, subdivide", FINER)
def test_added_nodes_follow_the_webs_own_along_each_line(order, subdivide):
    """And divide it straight, at its Gauss–Lobatto points; the elements of a line are rows that follow each other."""
    web, cable = skew_web(), finer_cable("linear", order, subdivide)
    net, oracle = discretisation.build(web, cable), Oracle(web, cable)
    assert net.order == order and net.nodes == len(net.points) == 6 + 9 * (order * subdivide - 1)
    np.testing.assert_array_equal(net.points[:6], web.points)
    # Two roundings of coordinates of at most 1.1 m.
    np.testing.assert_allclose(net.points, oracle.points, rtol=0, atol=4e-16)
    np.testing.assert_array_equal(net.cells[:, net.along], oracle.cells)
    np.testing.assert_array_equal(net.line, np.repeat(np.arange(9), subdivide))
    natural = np.add.reduceat(net.natural_length, subdivide * np.arange(9))
    np.testing.assert_allclose(natural, web.natural_length, rtol=1e-15)
    if order == 3:
        inner = np.sort(net.places)[1:3]
        np.testing.assert_allclose(inner, 0.5 * (1.0 + np.array([-1.0, 1.0]) / np.sqrt(5.0)), rtol=1e-15)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_functions_of_an_element(order):
    """1 at their own node and 0 at the others, of sum 1 everywhere; all polynomials of the order, with their slopes."""
    element = elements.line_element(order)
    nodes = element.doflocs[:, 0]
    assert nodes.tolist()[:2] == [0.0, 1.0] and element.maxdeg == order
    at, own = elements.values(element, nodes)
    np.testing.assert_allclose(at, np.eye(order + 1), rtol=0, atol=1e-14)
    places = np.linspace(0.0, 1.0, 11)
    at, slopes = elements.values(element, places)
    for power in range(order + 1):
        np.testing.assert_allclose(at @ nodes**power, places**power, rtol=0, atol=1e-14)
        right = power * places ** max(power - 1, 0)
        np.testing.assert_allclose(slopes @ nodes**power, right, rtol=0, atol=1e-13)


@pytest.mark.parametrize("law", ["smooth", "tension-only", "linear"])
@pytest.mark.parametrize("order", [1, 2, 3])
def test_the_tangent_is_the_weak_form_on_the_page(order, law):
    """What the compiled kernels fill is what scikit-fem assembles, but for the rounding of sums of some 40 products."""
    net = discretisation.build(skew_web(), replace(skew_cable(law), order=order, subdivide=2))
    system = System(net, [Elasticity()], np.zeros((len(net.points), 3), dtype=bool))
    x = 0.05 * np.random.default_rng(1).normal(size=net.points.shape)
    filled = system.pattern.matrix(system.stiffness(0.0, x)).toarray()
    expected = tangent_matrix(net, x).toarray()
    np.testing.assert_allclose(filled, expected, rtol=0, atol=1e-13 * np.abs(expected).max())


@pytest.mark.parametrize("pieces", [1, 3])
def test_explicit_steps_have_the_same_elements(pieces):
    """Without scikit-fem, to the last bit."""
    plain, by_basis = (skew_net(pieces=pieces, explicit=explicit) for explicit in (True, False))
    for name in ("points", "cells", "line", "gradients", "weights", "places", "mass"):
        np.testing.assert_array_equal(getattr(plain, name), getattr(by_basis, name))


def test_the_straight_element_is_scikit_fems():
    """It is written down for explicit steps: functions, slopes, places of its nodes, and ends as its dofs."""
    own, theirs, places = elements.line_element(1), skfem.ElementLineP1(), np.linspace(0.0, 1.0, 7)
    assert own.maxdeg == theirs.maxdeg
    np.testing.assert_array_equal(own.doflocs, theirs.doflocs)
    for found, expected in zip(elements.values(own, places), elements.values(theirs, places), strict=True):
        np.testing.assert_array_equal(found, expected)
    net = skew_net()
    basis = discretisation.basis(net.points, net.web.lines, net.natural_length)
    np.testing.assert_array_equal(net.cells, basis.element_dofs.T)
    np.testing.assert_array_equal(net.gradients, elements.values(theirs, basis.X)[1])
    np.testing.assert_array_equal(net.weights, basis.W)


def test_basis_is_scikit_fems():
    net = skew_net()
    for element in (None, skfem.ElementLineP2(), skfem.ElementVector(skfem.ElementLineP1(), 3)):
        basis = discretisation.basis(net.points, net.web.lines, net.natural_length, element)
        assert type(basis) is skfem.Basis
        # ∫ ds: the metric is the natural length, whatever the distance of the nodes.
        np.testing.assert_allclose(basis.dx.sum(axis=1), net.natural_length, rtol=1e-15)
    basis = discretisation.basis(net.points, net.web.lines, net.natural_length)
    ends = basis.interpolate(np.arange(6.0)).grad[0, :, 0] * net.natural_length
    np.testing.assert_allclose(ends, np.diff(net.web.lines, axis=1)[:, 0], rtol=1e-15)


def test_mass_follows_natural_length():
    # Eighths are exact in binary, and so are the products and sums of a few of them: no rounding to allow for.
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [3, 1, 0]]) / 8
    pairs, length = np.array([[0, 1], [1, 2], [2, 3], [0, 2]]), np.array([1.25, 0.5, 2.0, 1.75])
    web = Web(points=points, lines=pairs, natural_length=length, groups=("", "thick", "", ""))
    cable = Cable(modulus=1.0, area=0.25, density=512.0, groups={"thick": dict(area=0.5, density=256.0)})
    per_line = np.array([512 * 0.25, 256 * 0.5, 512 * 0.25, 512 * 0.25]) * length
    mass = discretisation.build(web, cable).mass
    by_node = [per_line[[0, 3]].sum(), per_line[[0, 1]].sum(), per_line[1:].sum(), per_line[2]]
    assert mass.tolist() == [share / 2 for share in by_node]
    assert mass.sum() == per_line.sum()


@pytest.mark.parametrize("order, subdivide", FINER)
def test_mass_is_scikit_fems(order, subdivide):
    """Lumped: the row sums of the consistent mass, none of them negative. Lumped and its spread: the matrix itself."""
    web, cable = skew_web(), finer_cable("linear", order, subdivide)
    expected = Oracle(web, cable).mass().toarray()
    net = discretisation.build(web, cable, consistent=True)
    assert discretisation.build(web, cable).consistent_minus_lumped is None and net.mass.min() > 0.0
    np.testing.assert_allclose(np.repeat(net.mass, 3), expected.sum(axis=1), rtol=1e-13)
    np.testing.assert_array_equal(net.mass, discretisation.build(web, cable).mass)
    properties = cable.properties(web)
    whole = sum(properties["density"] * properties["area"] * properties["natural_length"])
    np.testing.assert_allclose([net.mass.sum(), net.cable_mass], whole, rtol=1e-14)
    matrix = np.diag(np.repeat(net.mass, 3))
    for cell, spread in zip(net.cells, net.consistent_minus_lumped, strict=True):
        np.testing.assert_allclose(spread.sum(axis=1), 0.0, atol=1e-15 * net.mass.max())
        for k in range(3):
            matrix[np.ix_(3 * cell + k, 3 * cell + k)] += spread
    np.testing.assert_allclose(matrix, expected, rtol=0, atol=TIGHT * expected.max())
    # The same through the pattern of the tangent, as a solver assembles it.
    net_system = skew_system("linear", order, subdivide)
    free = net_system.free
    got = net_system.pattern.matrix(
        net_system.assemble_lines(np.kron(net.consistent_minus_lumped, np.eye(3)))
    ).toarray()
    got += np.diag(np.repeat(net.mass, 3)[free])
    np.testing.assert_allclose(got, expected[np.ix_(free, free)], rtol=0, atol=TIGHT * expected.max())


def one_line(end, natural_length=None):
    """A line from the origin, of a law without parameters, free at both ends."""
    length = None if natural_length is None else [natural_length]
    web = Web(points=[[0, 0, 0], end], lines=[[0, 1]], natural_length=length)
    cable = Cable(law="linear", modulus=1e5, area=1e-4, density=300.0)
    return system(web, cable, supported=np.zeros((2, 3), dtype=bool))


def exact_strain(end, natural_length, u):
    """Strain in 60 digits of the doubles given."""
    with mpmath.workdps(60):
        square = sum((mpmath.mpf(float(p)) + mpmath.mpf(float(d))) ** 2 for p, d in zip(end, u, strict=True))
        return mpmath.sqrt(square) / mpmath.mpf(float(natural_length)) - 1


@pytest.mark.parametrize("direction", ["along", "oblique", "across"])
@pytest.mark.parametrize("size", 10.0 ** np.arange(-12, 1))
def test_strain_keeps_its_digits_at_tiny_displacements(direction, size):
    """The strain has a relative error of a few roundings however small it is; λ − 1 has an absolute one of 1e-16.

    Where no terms of 2 X'·u' + u'·u' cancel, its relative error is that of about ten operations, 10 × 1.1e-16 at most
    with those of the length: 1e-14 leaves room and is far below the 1e-16/ε of λ − 1. The line (3, 4, 12)/8 has the
    length 13/8 exactly, so that its strain at rest is zero in both computations. Across it u' is normal to X' in every
    component, as in a flat web, and the strain is of second order: 1e-25 at 1e-12 m.
    """
    end = np.array([4.0, 0.0, 3.0]) / 8 if direction == "across" else np.array([3.0, 4.0, 12.0]) / 8
    unit = dict(along=end, oblique=np.array([0.7, 0.1, -0.2]), across=np.array([0.0, 1.0, 0.0]))[direction]
    u = size * unit
    net_system = one_line(end)
    assert net_system.net.natural_length[0] == (5 / 8 if direction == "across" else 13 / 8)
    exact = exact_strain(end, net_system.net.natural_length[0], u)
    got = State(net_system, 0.0, np.array([np.zeros(3), u])).strain[0]
    assert abs(got - exact) <= 1e-14 * abs(exact)


@pytest.mark.parametrize("size", [0.0, *10.0 ** np.arange(-12, 1)])
@pytest.mark.parametrize("factor", [0.75, 1.5])
def test_strain_of_a_prestressed_line(size, factor):
    """With natural length L ≠ |X'| the strain has a constant part, and the digits are those of that part."""
    end, u = np.array([3.0, 4.0, 12.0]) / 8, size * np.array([0.2, 0.4, 0.3])
    exact = exact_strain(end, factor * 13 / 8, u)
    got = State(one_line(end, factor * 13 / 8), 0.0, np.array([np.zeros(3), u])).strain[0]
    assert abs(got - exact) <= 1e-14 * max(abs(exact), abs(1 / factor - 1))


@pytest.mark.parametrize("order, subdivide", FINER)
@pytest.mark.parametrize("law", LAWS)
def test_pattern_is_the_adjacency_and_stays(law, order, subdivide):
    net_system = skew_system(law, order, subdivide)
    free, pattern = net_system.free, net_system.pattern
    adjacency = Oracle(skew_web(), finer_cable(law, order, subdivide)).structure().tocsc()[:, free][free]
    adjacency.sort_indices()
    np.testing.assert_array_equal(pattern.indptr, adjacency.indptr)
    np.testing.assert_array_equal(pattern.indices, adjacency.indices)
    assert pattern.indices.dtype == pattern.indptr.dtype == np.int32
    # From all lines taut to all slack: the web blown up, as it is, and shrunk to a tenth.
    for factor in (1.0, 0.0, -0.9):
        K = pattern.matrix(net_system.stiffness(0.0, factor * net_system.net.points))
        assert np.array_equal(K.indices, adjacency.indices) and np.array_equal(K.indptr, adjacency.indptr)
    if law == "tension-only":
        assert not K.data.any()


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("start, moved", [(0.5, -0.5), (0.0, 0.0)])
def test_line_of_zero_length(law, start, moved):
    """Two ends at one place, by displacement or from the start: no direction, hence no force, and a finite tangent."""
    web = Web(points=[[0, 0, 0], [1, 0, 0], [1, start, 0]], lines=[[0, 1], [1, 2]], natural_length=[0.5, 0.5])
    cable = Cable(modulus=1e5, area=1e-4, density=300.0, **LAWS[law])
    net_system = system(web, cable, supported=np.zeros((3, 3), dtype=bool))
    u = np.array([[0, 0, 0], [0, 0, 0], [0, moved, 0]], dtype=float)
    assert State(net_system, 0.0, u).strain.tolist() == [1.0, -1.0]
    force = net_system.force(0.0, u)
    assert np.isfinite(force).all() and force[1, 0] < 0.0 and not force[2].any()
    assert np.isfinite(net_system.energy(0.0, u))
    for definite in (True, False):
        K = net_system.pattern.matrix(net_system.stiffness(0.0, u, definite=definite)).toarray()
        assert np.isfinite(K).all() and K[0, 0] > 0.0


def pulls_together_as_alone(term, x, cells, data):
    """Forces, tensions and strains of elements by blocks beside those of one after another."""
    none, shown, one = np.zeros_like(x), np.zeros((len(cells), 3)), np.zeros((len(cells), 3))
    together, alone = none.copy(), none.copy()
    force, taken, numbers, *_ = term.elements.by_blocks(cells, data)
    force(0.0, x, none, together, taken, numbers, shown)
    term.force(0.0, x, none, alone, cells, data, one)
    # the same products, which either may contract with sums
    np.testing.assert_allclose(shown, one, rtol=1e-14, atol=1e-14 * np.abs(data).max())
    np.testing.assert_allclose(together, alone, rtol=0.0, atol=TIGHT * max(np.abs(alone).max(), 1e-300))


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_lines_taken_together_pull_as_each_alone(law):
    """By blocks, and what is left of the last: whatever their number, forces are those of the lines one by one."""
    net = skew_system(law)
    cells, data = (np.tile(part, (2 * BLOCK, 1)) for part in (net.net.cells, net.net.line_data.matrix))
    for count in (1, 2, 9, BLOCK - 1, BLOCK, BLOCK + 1, 2 * BLOCK + 7):
        assert runs_of(cells[:count]) is None
        pulls_together_as_alone(net.terms[0], displacement(3), cells[:count], data[:count])


def grid_of(rows, columns):
    """Lines of a grid in the order of their first nodes, as webs have them."""
    node = np.arange(rows * columns).reshape(rows, columns)
    across = np.stack([node[:, :-1].ravel(), node[:, 1:].ravel()], axis=1)
    lines = np.concatenate([across, np.stack([node[:-1].ravel(), node[1:].ravel()], axis=1)])
    return lines[np.lexsort((lines[:, 1], lines[:, 0]))].astype(np.int32)


LISTS = {
    "grid": grid_of(13, 40),
    "grid, turned ends": np.ascontiguousarray(grid_of(13, 40)[:, ::-1]),
    "grid, half of the ends turned": np.where(
        np.arange(987)[:, None] // 300 % 2, grid_of(13, 40)[:, ::-1], grid_of(13, 40)
    ),
    "grid, backwards": np.ascontiguousarray(grid_of(13, 40)[::-1]),
    "chain": grid_of(1, 700),
    "grid with one element from end to end": np.concatenate([grid_of(9, 30), [[0, 269]]]).astype(np.int32),
}


@pytest.mark.parametrize("cells", LISTS.values(), ids=LISTS)
@pytest.mark.parametrize("law", LAWS, ids=str)
def test_runs_of_lines_pull_as_each_alone(law, cells):
    """Lines whose nodes follow each other, in any order, each with numbers of its own."""
    net, rng = skew_system(law), np.random.default_rng(len(cells))
    data = np.tile(net.net.line_data.matrix, (len(cells), 1))[: len(cells)]
    data = data * rng.uniform(0.99, 1.01, data.shape)
    runs, order = runs_of(cells)
    assert sorted(order) == list(range(len(cells))) and runs[:, 1].sum() == len(cells)
    pulls_together_as_alone(net.terms[0], displacement(4, cells.max() + 1), cells, data)


def shown_by_blocks(force, x, taken, numbers, blocks):
    """Forces on rows at x, where blocks of lines show what they have."""
    f = np.zeros_like(x)
    force(0.0, x, f, f, taken, numbers, blocks)
    return f


@pytest.mark.parametrize("cells", LISTS.values(), ids=LISTS)
@pytest.mark.parametrize("law", LAWS, ids=str)
def test_blocks_show_their_largest_values(law, cells):
    """The same forces to the last bit; each line is shown where a block is above all before it, and steps before."""
    net, rng = skew_system(law), np.random.default_rng(len(cells))
    data = np.tile(net.net.line_data.matrix, (len(cells), 1))[: len(cells)]
    data = data * rng.uniform(0.99, 1.01, data.shape)
    force, taken, numbers, rows, _ = net.terms[0].elements.by_blocks(cells, data)
    blocks = np.zeros((rows, width_of(BLOCK_OUT)))
    shows = records_of(BLOCK_OUT, blocks)
    shows["rest"], shows["tension"][-1], shows["strain"][-1] = UNKNOWN, -np.inf, -np.inf
    assert rows == -(-len(cells) // BLOCK) + 1
    most, fresh = np.full(2, -np.inf), []
    for seed in range(4):
        x, lines, expected = (
            displacement(seed, cells.max() + 1),
            np.zeros((len(cells), 2)),
            np.zeros((cells.max() + 1, 3)),
        )
        force(0.0, x, np.zeros_like(x), expected, taken, numbers, lines)
        shows["shown"] = np.nan
        assert np.array_equal(shown_by_blocks(force, x, taken, numbers, blocks), expected)
        for n in range(rows - 1):
            part = lines[n * BLOCK : (n + 1) * BLOCK]
            largest = part.max(axis=0)
            assert [*shows[n]][:4] == [*largest, len(part), MOVES]
            fresh.append((largest > most).any())
            np.testing.assert_array_equal(shows["shown"][n, : len(part)], part if fresh[-1] else np.nan)
            most = np.maximum(most, largest)
        assert [shows["tension"][-1], shows["strain"][-1]] == [*most]
    assert not all(fresh)


def test_blocks_at_rest_show_what_they_have_until_they_move():
    """A web without prestress: blocks without differences are left out, and found anew when a node moves."""
    net, cells = skew_system("tension-only"), LISTS["grid"]
    data = np.tile(net.net.line_data.matrix[:1], (len(cells), 1))
    data[:, column_of(LINE, "distance")] = data[:, column_of(LINE, "natural_length")] = np.linalg.norm(data[0, 6:9])
    force, taken, numbers, rows, _ = net.terms[0].elements.by_blocks(cells, data)
    blocks, x = np.zeros((rows, width_of(BLOCK_OUT))), np.zeros((cells.max() + 1, 3))
    shows = records_of(BLOCK_OUT, blocks)
    shows["rest"] = UNKNOWN
    x[:, 0] = 0.3  # as a whole
    for _ in range(2):
        assert not shown_by_blocks(force, x, taken, numbers, blocks).any()
        assert (shows["rest"][:-1] == RESTS).all() and not shows["tension"].any()
    shows["tension"][1] = 7.0  # stays where nothing is found anew
    for away in (9.0, 0.0):
        x[0, 1:] = away
        expected = np.zeros_like(x)
        force(0.0, x, x, expected, taken, numbers, np.zeros((len(cells), 2)))
        assert expected.any() == (away > 0.0)
        assert np.array_equal(shown_by_blocks(force, x, taken, numbers, blocks), expected)
        assert [*shows["rest"][:-1]] == [MOVES] + [RESTS] * (rows - 2)
        assert (shows["tension"][0] > 0.0) == (away > 0.0) and shows["tension"][1] == 7.0
    numbers[:, BLOCK * column_of(LINE, "natural_length") :][:, :BLOCK] *= 0.9  # with prestress none is at rest
    shows["rest"], x[...] = UNKNOWN, 0.0
    assert shown_by_blocks(force, x, taken, numbers, blocks).any() and (shows["rest"][:-1] == MOVES).all()


def test_runs_keep_the_order_of_sums():
    """Where lines stand in the order of their nodes, forces have the same bits as without runs."""
    net, cells = skew_system("tension-only"), LISTS["grid"]
    data = np.tile(net.net.line_data.matrix, (len(cells), 1))[: len(cells)]
    x, forces = displacement(5, cells.max() + 1), []
    whole = line_blocks.force_by_blocks(net.net.law), cells, line_blocks.blocks_of(data), 0, None
    for force, taken, numbers, *_ in (whole, net.terms[0].elements.by_blocks(cells, data)):
        forces.append(np.zeros_like(x))
        force(0.0, x, np.zeros_like(x), forces[-1], taken, numbers, np.zeros((len(cells), 2)))
    assert forces[0].any() and np.array_equal(*forces)
