"""Nested dissection and the factorization by fronts: a tree without edges across, and solutions of numpy.

The graphs are lattices, triangulations, parts that do not hang together, a row that is tied to half of all, and rows
with supports along some axes.
"""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.spatial import Delaunay

from refweb.system import factorization, multifrontal
from refweb.system.dissection import dissected
from refweb.system.factorization import Factor, Library
from refweb.system.multifrontal import Multifrontal
from refweb.system.sparsity import Pattern


def lattice(n):
    """Edges of n × n nodes."""
    number = np.arange(n * n).reshape(n, n)
    return np.concatenate(
        [
            np.column_stack([a.ravel(), b.ravel()])
            for a, b in ((number[1:], number[:-1]), (number[:, 1:], number[:, :-1]))
        ]
    )


def triangulation(n):
    """Edges between n random points."""
    corners = Delaunay(np.random.default_rng(n).random((n, 2))).simplices
    return np.concatenate([corners[:, :2], corners[:, 1:], corners[:, ::2]])


GRAPHS = {
    "lattice": lattice(16),
    "triangulation": triangulation(200),
    "two parts": np.concatenate([lattice(9), 81 + triangulation(100)]),
    "hub": np.concatenate([lattice(14), np.column_stack([np.full(98, 196), np.arange(98)])]),
    "cable": np.column_stack([np.arange(1, 150), np.arange(149)]),
    "no edges but one": np.array([[0, 60]]),
}


def graph_of(edges):
    n = edges.max() + 1
    ends = np.concatenate([edges, edges[:, ::-1], np.repeat(np.arange(n)[:, None], 2, axis=1)])
    return coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(n, n)).tocsr()


def pattern_of(edges, library="multifrontal"):
    """A pattern in which some rows are supported along one or all axes."""
    n = edges.max() + 1
    supported = np.zeros((n, 3), dtype=bool)
    supported[3::7, 1] = supported[5::11] = True
    return Pattern(n, np.flatnonzero(~supported), [edges.astype(np.int32)], Library(library))


def definite(pattern, seed=0):
    """Values of a random positive definite matrix of a pattern, and the whole matrix."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(len(pattern.slots[0]), 6, 6))
    values = pattern.assemble([root @ root.transpose(0, 2, 1)])
    values[pattern.diagonal] += 1.0
    return values, pattern.matrix(values).toarray()


@pytest.mark.parametrize("most", [1, 5, 24])
@pytest.mark.parametrize("name", GRAPHS)
def test_no_edge_joins_two_parts(name, most):
    """Unless one is above the other; and no part without others below it is larger than asked for, but a separator."""
    graph = graph_of(GRAPHS[name])
    numbers = dissected(graph, most)
    ends = graph.tocoo()
    low, high = np.sort([numbers[ends.row], numbers[ends.col]], axis=0)
    levels = [int(b).bit_length() - int(a).bit_length() for a, b in zip(low, high, strict=True)]
    assert (high >> levels == low).all()
    assert numbers.min() >= 1 and len(numbers) == graph.shape[0]


def test_separators_of_a_lattice_are_short():
    """No longer than a row with one bend, of n × n nodes; halves are within one separator of each other."""
    n = 32
    numbers = dissected(graph_of(lattice(n)), 24)
    first = np.count_nonzero(numbers == 1)
    assert first <= n + 1
    top = numbers.copy()
    while (top > 3).any():
        top[top > 3] >>= 1
    assert abs(np.count_nonzero(top == 2) - np.count_nonzero(top == 3)) <= n + 1


@pytest.mark.ordinary("lattice-1", "triangulation-24", "two parts-1", "hub-24", "cable-24", "no edges but one-1")
@pytest.mark.parametrize("part", [1, 24])
@pytest.mark.parametrize("name", GRAPHS)
def test_solutions_are_those_of_numpy(name, part, monkeypatch):
    """Of two matrices with one order of elimination, to rounding times the condition."""
    monkeypatch.setattr(multifrontal, "PART", part)
    monkeypatch.setattr(multifrontal, "FULLEST", np.inf)
    by = Multifrontal(pattern := pattern_of(GRAPHS[name]))
    for seed in (0, 1):
        values, whole = definite(pattern, seed)
        by.factorize(values)
        b = np.random.default_rng(seed).normal(size=(pattern.size, 2))
        expected, tolerance = np.linalg.solve(whole, b), 1e-14 * np.linalg.cond(whole)
        assert np.abs(by.solve(b[:, 0]) - expected[:, 0]).max() <= tolerance * np.abs(expected).max()
        assert np.abs(by.solve_all(b) - expected).max() <= tolerance * np.abs(expected).max()
        np.testing.assert_allclose(by.times(b[:, 0]), whole @ b[:, 0], rtol=0.0, atol=1e-13 * np.abs(whole).max())


def used(factor):
    return type(factor._by).__name__


def test_superlu_takes_what_is_not_definite():
    """With the signs of numpy's eigenvalues; the next definite matrix is factorized by fronts again."""
    pattern = pattern_of(GRAPHS["lattice"])
    values, whole = definite(pattern)
    factor, indefinite = Factor(pattern), values.copy()
    indefinite[pattern.diagonal[::5]] -= 20.0
    signs = np.linalg.eigvalsh(pattern.matrix(indefinite).toarray())
    assert (signs < 0.0).any()
    for given, by, negative in (
        (values, "Multifrontal", 0),
        (indefinite, "_Superlu", np.count_nonzero(signs < 0.0)),
        (values, "Multifrontal", 0),
    ):
        factor.update(given)
        assert used(factor) == by and factor.negative_pivots() == negative
        b = np.ones(pattern.size)
        assert np.abs(pattern.matrix(given) @ factor.solve(b) - b).max() <= factorization.FINE
    assert pattern.library.remarks == []


def test_superlu_takes_what_would_be_too_full(monkeypatch):
    monkeypatch.setattr(multifrontal, "FULLEST", 0.1)
    pattern = pattern_of(GRAPHS["lattice"])
    factor = Factor(pattern)
    factor.update(definite(pattern)[0])
    assert used(factor) == "_Superlu" and pattern.library.remarks == []
