"""LDLᵀ by five libraries: the same solutions and signs of pivots, which is taken, and what is done where one errs.

Truth of the signs are eigenvalues by numpy.
"""

import importlib.util
import json

import numpy as np
import pytest

import refweb
from refweb.errors import InputError
from refweb.system import factorization
from refweb.system.factorization import Factor, Library, negative_pivots
from refweb.system.sparsity import Pattern

THERE = importlib.util.find_spec("rslab") is not None
needs_rslab = pytest.mark.skipif(not THERE, reason='rslab, of the extra "fast", is not installed')
LIBRARIES = ["qdldl", "supernodal", "superlu", "multifrontal", pytest.param("rslab", marks=needs_rslab)]


def pattern(library, n=6):
    """The pattern of a chain of n rows with all components free."""
    cells = np.column_stack([np.arange(n - 1), np.arange(1, n)]).astype(np.int32)
    return Pattern(n, np.arange(3 * n), [cells], Library(library))


def matrix(pattern, seed, shift=0.0):
    """Values of a random symmetric matrix of a pattern, and the whole matrix."""
    rng = np.random.default_rng(seed)
    blocks = rng.normal(size=(len(pattern.slots[0]), 6, 6))
    values = pattern.assemble([blocks + blocks.transpose(0, 2, 1)])
    values[pattern.diagonal] += shift
    return values, pattern.matrix(values).toarray()


@pytest.mark.parametrize("library", LIBRARIES)
@pytest.mark.parametrize("seed", range(8))
def test_solutions_and_signs(library, seed):
    """Indefinite and definite ones, factorized one after the other."""
    chain = pattern(library)
    factor = Factor(chain)
    for shift in (0.0, 30.0, -30.0, 3.0):
        values, whole = matrix(chain, seed, shift)
        factor.update(values)
        b = np.random.default_rng(seed).normal(size=chain.size)
        expected, eigenvalues = np.linalg.solve(whole, b), np.linalg.eigvalsh(whole)
        condition = abs(eigenvalues).max() / abs(eigenvalues).min()
        assert factor.solve(b) == pytest.approx(expected, abs=1e-7 * condition * abs(expected).max())
        assert factor.negative_pivots() == np.count_nonzero(eigenvalues < 0.0)
        assert negative_pivots(chain.upper_matrix(values), chain.library) == factor.negative_pivots()
    assert chain.library.remarks == [] and chain.library.why == f"{library}, as asked for"


@pytest.mark.parametrize("library", LIBRARIES)
def test_a_singular_matrix_has_no_solution(library):
    chain = pattern(library)
    factor = Factor(chain)
    for values in (np.zeros(len(chain.indices)), matrix(chain, 1)[0]):
        factor.update(values)
        assert (factor.solve(np.ones(chain.size)) is None) is not values.any()
    assert chain.library.remarks == []  # which is no fault of the library


@pytest.mark.parametrize("turn", [1, -1])
def test_unknowns_may_be_counted_from_either_end(turn):
    chain = pattern("qdldl")
    by = factorization.Qdldl(chain)
    by.turn = turn
    for seed, shift in ((0, 0.0), (1, 0.0), (2, -30.0)):
        values, whole = matrix(chain, seed, shift)
        upper = chain.upper_matrix(values, turn).toarray()
        np.testing.assert_array_equal(upper, np.triu(whole[::turn, ::turn]))
        by.factorize(values)
        b = np.random.default_rng(seed).normal(size=(chain.size, 2))
        np.testing.assert_allclose(by.solve(b[:, 0]), np.linalg.solve(whole, b[:, 0]), rtol=1e-7)
        np.testing.assert_allclose(by.solve_all(b), np.linalg.solve(whole, b), rtol=1e-7)
        np.testing.assert_allclose(by.times(b[:, 0]), whole @ b[:, 0], rtol=0.0, atol=1e-13 * np.abs(whole).max())
        assert by.negative_pivots() == np.count_nonzero(np.linalg.eigvalsh(whole) < 0.0)


@pytest.mark.parametrize("mesh", ["square", "triangle", "hexagon"])
def test_the_way_to_count_that_fills_less_is_kept(mesh, monkeypatch):
    """Of both, as qdldl itself has them; from the second factorization on."""
    import qdldl

    monkeypatch.setattr(factorization, "LARGE", 1000)
    window = refweb.Window(mesh=mesh, rows=30, columns=30, side=0.1)
    system = refweb.Scene(web=window, cable=net("qdldl").cable, solve=refweb.Static(factorization="qdldl")).build()
    values = system.assemble_lines(system.net.unit_tension / system.net.natural_length[:, None, None])
    fills = [qdldl.Solver(system.pattern.upper_matrix(values, turn), upper=True).factors()[0].nnz for turn in (1, -1)]
    by = factorization.Qdldl(system.pattern)
    for fill in (fills[0], min(fills), min(fills)):
        by.factorize(values)
        assert by.solver.factors()[0].nnz == fill


def test_the_choice(monkeypatch):
    """By the number of unknowns, where it is installed; or as asked for."""
    for there in (True, False):
        monkeypatch.setattr(factorization.importlib.util, "find_spec", lambda name, there=there: there or None)
        for size, fast, else_ in (
            (factorization.HUGE, "rslab", "multifrontal"),
            (factorization.HUGE - 1, "supernodal", "supernodal"),
            (factorization.MEDIUM, "supernodal", "supernodal"),
            (factorization.MEDIUM - 1, "qdldl", "qdldl"),
        ):
            name = fast if there else else_
            library = Library()
            assert library.why is None
            library.choose(size)
            assert (library.name, library.why) == (name, f"{name}, for {size} unknowns")
        library = Library("qdldl")
        library.choose(10 * factorization.HUGE)
        assert library.why == "qdldl, as asked for"
    with pytest.raises(InputError, match=r"factorization = \"rslab\" is not installed: pip install 'refweb\[fast\]'"):
        Library("rslab")


WRONG = {
    "residual": ("solve", lambda self, b: 1.1 * b, "rslab solves to"),
    "sign": ("negative_pivots", lambda self: 0, "rslab misses a negative pivot"),
    "count": ("negative_pivots", lambda self: None, "rslab does not say the signs of all pivots"),
}


@needs_rslab
@pytest.mark.parametrize("kind", WRONG)
def test_what_is_wrong_is_seen_told_and_done_by_the_other(kind, monkeypatch):
    name, wrong, told = WRONG[kind]
    chain = pattern("rslab")
    values, whole = matrix(chain, 0, -30.0)
    monkeypatch.setattr(factorization._Rslab, name, wrong)
    factor = Factor(chain)
    factor.update(values)
    if kind == "count":
        assert factor.negative_pivots() == chain.size
    b = np.ones(chain.size)
    assert factor.solve(b) == pytest.approx(np.linalg.solve(whole, b), rel=1e-7)
    assert factor.negative_pivots() == chain.size and chain.library.name == "qdldl"
    (remark,) = chain.library.remarks
    assert remark.startswith(told) and told.removeprefix("rslab ") in chain.library.why
    factor.update(values)
    assert chain.library.remarks == [remark]


def net(library, **solve):
    """A square web under a load, in statics or dynamics."""
    solve = solve or dict(kind="static", load_steps=[1, 2])
    return refweb.Scene(
        web=refweb.Window(mesh="square", rows=6, columns=6, side=0.1),
        cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-4, density=200.0),
        effects=[refweb.Load(node="centre", force=(0.0, 0.0, 1.0))],
        solve=(refweb.Static if solve["kind"] == "static" else refweb.Dynamic)(factorization=library, **solve),
    )


@pytest.mark.parametrize("library", LIBRARIES[1:])
@pytest.mark.parametrize("method", ["static", "cvode", "ida"])
def test_runs_agree_within_their_errors(method, library, tmp_path):
    """Bounds are kept, ± overlap, and ``run.json`` names what has factorized."""
    solve = {} if method == "static" else dict(kind="dynamic", method=method, duration=2e-3, linear_solver="block")
    one, other = (refweb.run(net(by, **solve), out=tmp_path / by) for by in ("qdldl", library))
    for name, result in one.results.items():
        off = abs(result.value - other.results[name].value)
        assert off <= result.error + other.results[name].error, name
    if method == "static":
        assert other.solver["duality_gap"] <= 10.0 * one.solver["duality_gap"] + 1e-15
        assert other.solver["nlu"] == one.solver["nlu"]
    assert other.warnings == one.warnings
    for by in ("qdldl", library):
        run = json.loads((tmp_path / by / "run.json").read_text(encoding="utf-8"))
        assert run["solver"]["factorization"] == f"{by}, as asked for"


def test_what_factorizes_nothing_names_nothing():
    scene = net("auto", kind="dynamic", duration=1e-3)
    assert refweb.run(scene).solver["factorization"] is None


@pytest.mark.slow
@pytest.mark.parametrize("library", LIBRARIES[1:])
def test_modes_agree(library):
    one, other = (refweb.modes(net(by), number=4) for by in ("qdldl", library))
    for name, result in one.results.items():
        assert abs(result.value - other.results[name].value) <= result.error + other.results[name].error
    assert other.solver["factorization"] == f"{library}, as asked for"
