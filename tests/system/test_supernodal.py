"""LDLᵀ by supernodes: solutions of scipy's LU and signs of numpy's eigenvalues, of definite and indefinite matrices.

The graphs are lattices, triangulations, parts that do not hang together, a row that is tied to half of all, rows that
are all tied to each other, and rows with supports along some axes, with which nodes have fewer than three unknowns.
"""

import numpy as np
import pytest
from scipy.sparse.linalg import splu
from test_multifrontal import GRAPHS, definite, lattice, pattern_of

from refweb.system import supernodal
from refweb.system.factorization import FINE, Factor, Library
from refweb.system.sparsity import Pattern
from refweb.system.supernodal import Supernodal

EPS = np.finfo(float).eps
MORE = {
    "one row": np.array([[0, 0]]),
    "all with all": np.column_stack(np.triu_indices(110, 1)),  # rows of a supernode are more than one tile
    "long cable": np.column_stack([np.arange(1, 400), np.arange(399)]),
    "wide": lattice(40),
}
ALL = {**GRAPHS, **MORE}


def error_and_bound(whole, y, b):
    """Residual of a solution, and a bound on that of a factorization without growth of its numbers."""
    size = len(b) * np.abs(whole).sum(axis=1).max() * np.abs(y).max() + np.abs(b).max()
    return np.abs(whole @ y - b).max(), 4.0 * EPS * size


@pytest.mark.parametrize("most, sparse", [(12, 0.2), (1, 0.0), (3, 1.0)])
@pytest.mark.parametrize("name", ALL)
def test_solutions_are_those_of_scipy(name, most, sparse, monkeypatch):
    """Of two matrices with one order of elimination, whatever supernodes are."""
    monkeypatch.setattr(supernodal, "MOST", most)
    monkeypatch.setattr(supernodal, "SPARSE", sparse)
    by = Supernodal(pattern := pattern_of(ALL[name]))
    for seed in (0, 1):
        values, _ = definite(pattern, seed)
        matrix = pattern.matrix(values)
        by.factorize(values)
        b = np.random.default_rng(seed).normal(size=(pattern.size, 2))
        for y, column in zip(by.solve_all(b).T, b.T, strict=True):
            error, bound = error_and_bound(matrix, y, column)
            assert error <= bound
            np.testing.assert_array_equal(by.solve(column), y)
        expected = splu(matrix.tocsc()).solve(b)
        condition = np.linalg.cond(matrix.toarray()) if pattern.size < 700 else 1e6
        assert np.abs(by.solve_all(b) - expected).max() <= pattern.size * EPS * condition * np.abs(expected).max()
        scale = np.abs(values).max() * np.abs(b).max()
        np.testing.assert_allclose(by.times(b[:, 0]), matrix @ b[:, 0], rtol=0.0, atol=10.0 * EPS * scale)
        assert by.negative_pivots() == 0


@pytest.mark.parametrize("name", GRAPHS)
@pytest.mark.parametrize("seed", range(3))
def test_signs_of_indefinite_matrices(name, seed):
    """As many negative pivots as eigenvalues, by Sylvester's law; a solution is refined where pivots are small."""
    pattern = pattern_of(GRAPHS[name], "supernodal")
    values, _ = definite(pattern, seed)
    factor = Factor(pattern)
    for shift in (0.0, 4.0, 1e3):
        shifted = values.copy()
        shifted[pattern.diagonal] -= shift * np.random.default_rng(seed).random(pattern.size)
        whole = pattern.matrix(shifted).toarray()
        factor.update(shifted)
        assert factor.negative_pivots() == np.count_nonzero(np.linalg.eigvalsh(whole) < 0.0)
        b = np.ones(pattern.size)
        assert np.abs(whole @ factor.solve(b) - b).max() <= FINE
    assert type(factor._by) is Supernodal and pattern.library.remarks == []


def test_signs_of_a_diagonal_matrix():
    """Which has no edges: nodes alone, some with one unknown or two."""
    free = np.array([0, 1, 2, 4, 6, 7, 11])
    pattern = Pattern(4, free, [np.zeros((0, 2), dtype=np.int32)], Library("supernodal"))
    assert len(pattern.indices) == len(free)
    by, values = Supernodal(pattern), np.array([1.0, -2.0, 3.0, -4.0, 0.5, -0.25, 8.0])
    by.factorize(values)
    np.testing.assert_array_equal(by.solve(values), np.ones(len(free)))
    assert by.negative_pivots() == 3


@pytest.mark.parametrize("bad", [0.0, np.nan, np.inf])
def test_a_pivot_of_zero_is_left_to_qdldl(bad):
    """And so is one that is not finite; the next matrix is factorized by supernodes again."""
    pattern = pattern_of(GRAPHS["lattice"], "supernodal")
    values, _ = definite(pattern)
    singular, factor = values.copy(), Factor(pattern)
    singular[pattern.indptr[4] : pattern.indptr[5]] = bad
    singular[pattern.indices == 4] = bad
    with pytest.raises(RuntimeError, match="a pivot is 0"):
        Supernodal(pattern).factorize(singular)
    if bad == 0.0:
        factor.update(singular)
        assert type(factor._by).__name__ == "Qdldl" and factor.solve(np.ones(pattern.size)) is None
    factor.update(values)
    assert type(factor._by) is Supernodal and pattern.library.remarks == []


def test_threads_may_share_a_factor():
    """Solutions at the same time are those one after another."""
    from concurrent.futures import ThreadPoolExecutor

    by = Supernodal(pattern := pattern_of(ALL["wide"]))
    by.factorize(values_of(pattern))
    right = np.random.default_rng(0).normal(size=(24, pattern.size))
    expected = [by.solve(b) for b in right]
    with ThreadPoolExecutor(4) as pool:
        for found, wanted in zip(pool.map(by.solve, np.tile(right, (8, 1))), expected * 8, strict=True):
            np.testing.assert_array_equal(found, wanted)


def values_of(pattern):
    """Values of a definite matrix without the whole matrix."""
    values = np.full(len(pattern.indices), -1.0)
    values[pattern.diagonal] = 1.0 + np.diff(pattern.indptr)
    return values


def test_rows_of_the_plan():
    """Supernodes partition the nodes, and each row that one is coupled with is in the one above or coupled with it."""
    plan = Supernodal(pattern_of(ALL["wide"]))._plan
    first, size, rest, *_, near, _, _ = plan.table.T.astype(int)
    assert (first[1:] == (first + size)[:-1]).all() and first[0] == 0 and (first + size)[-1] == len(plan.order)
    rows = [set(plan.rows[n : n + r].tolist()) for n, r in zip(near, rest, strict=True)]
    for s, coupled in enumerate(rows):
        if coupled:
            above = np.searchsorted(first, min(coupled), side="right") - 1
            own = set(range(first[above], first[above] + size[above], 3))
            assert above > s and coupled <= own | rows[above]
