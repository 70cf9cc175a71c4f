"""Factorizations of tangents: LDLᵀ, whose D shows the signs of the pivots, and LU of unsymmetric matrices.

Five codes compute LDLᵀ. qdldl works column by column; it takes every matrix with a pivot of 0, and less than `MEDIUM`
unknowns in statics, or `STEPPED` in dynamics, for which nothing has to be compiled. `refweb.system.supernodal` works on
blocks of columns by kernels: on a CPU with AVX-512 it factorizes a square web in a quarter of qdldl's time at 4563
unknowns and a fifth at 29 403, and solves in half of it. `refweb.system.multifrontal` takes positive definite matrices
alone, and SuperLU of scipy all others: it computes LU; if all its pivots are on the diagonal, U is D Lᵀ. From `HUGE`
unknowns on, where both have the same speed, fronts take the place of supernodes, since their order fills less the
larger a web is: a factorization takes 0.21 s by supernodes, 0.34 by fronts and 1.1 by SuperLU at 118 803 unknowns
(squares), 0.32 and 0.31 by the first two at 120 300 (triangles), 0.47 and 0.45 at 237 009 (hexagons) and 0.92 and 1.01
at 305 283 (squares).

rslab (``pip install 'refweb[fast]'``) works on blocks of columns as well, and keeps its ordering. It is used from
`HUGE` unknowns on, if it is installed: there it takes as long as fronts for a factorization and half as long for a
solution. At 29 403 unknowns it takes 52 ms, and supernodes 19. rslab is a young library: if the residual of a solution
or the signs of its pivots are wrong, qdldl replaces it for the rest of the run, with a finding.

May change: `STEPPED`, `MEDIUM`, `LARGE`, `HUGE` and `NEMIN`, which are measured: they change times, and results by
rounding; the insides of the classes. `FINE` and `ROUGH` decide when a solution is refined or refused. Must stay: keys
of `LIBRARIES`, the same as `registry.FACTORIZATIONS` and values of scenes; `Lu` and `Factor` have ``update``,
``solve``, ``shift`` and ``solutions`` alike, since `statics.newton` holds either. Signs of pivots decide stability in
statics and counts of modes. Must stay as well: `weak_pivot`, which `links` and `integrators.massless_nodes` import;
`negative_pivots`, which `statics.stability` and `studies.turning` import; `Library`, which `system` imports; public
names of `Lu`, which other files use; `_Rslab`, which a test calls. Tests: ``tests/system/test_factorization.py``.
"""

from __future__ import annotations

import contextlib
import importlib.util
from typing import Any

import numpy as np

from ..errors import InputError

STEPPED, MEDIUM, HUGE = 2000, 8000, 100_000
"""Numbers of unknowns from which on supernodes are used, in dynamics and in statics, and rslab, if it is installed, or
fronts, if it is not. Kernels of supernodes compile for 1.4 s at first, which statics of fewer unknowns save after 20
runs only."""
LARGE = 5000
"""Number of unknowns from which on qdldl tries two orderings."""
FINE, ROUGH = 1e-8, 1e-2
"""Relative residual to which a solution is refined, and relative residual above which a solution is refused."""


NEMIN = 8
"""Columns below which rslab joins blocks that follow each other; with its own 16 a solution takes a sixth longer."""


class Library:
    """The library that factorizes the symmetric matrices of a system.

    Parameters
    ----------
    asked : {"auto", "qdldl", "supernodal", "superlu", "multifrontal", "rslab"}
        Library that the scene asks for.
    medium : int
        Number of unknowns from which on "auto" uses supernodes.

    Attributes
    ----------
    name : {"qdldl", "supernodal", "superlu", "multifrontal", "rslab"}
        Name of the library in use.
    why : str or None
        Its name and the reason for the choice; None before the first factorization.
    remarks : list of str
        Reasons for which another library replaced it.

    Raises
    ------
    InputError
        If the library that the scene asks for is not installed.
    """

    def __init__(self, asked="auto", medium=MEDIUM):
        self._asked, self._medium, self.name, self.why, self.remarks = asked, medium, "qdldl", None, []
        if asked == "rslab" and not importlib.util.find_spec("rslab"):
            raise InputError("[solve] factorization = \"rslab\" is not installed: pip install 'refweb[fast]'")

    def choose(self, size):
        """Choose a library for a number of unknowns."""
        if self.remarks:
            return
        self.name = self._asked
        if self._asked == "auto":
            self.name = "supernodal" if size >= self._medium else "qdldl"
            if size >= HUGE:
                self.name = "rslab" if importlib.util.find_spec("rslab") else "multifrontal"
        self.why = f"{self.name}, {f'for {size} unknowns' if self._asked == 'auto' else 'as asked for'}"

    def fall_back(self, what):
        """Use qdldl from here on, and note the reason."""
        self.name = "qdldl"
        self.why = f"{self.why}, then qdldl: {what}"
        self.remarks.append(f"rslab {what}: qdldl factorizes instead, and the results are its")


class Qdldl:
    """LDLᵀ by qdldl, column by column, without exchanges of pivots; the ordering is found once.

    It is the ordering of minimum degree; among equal degrees the number decides. From `LARGE` unknowns on, the second
    factorization counts the unknowns from the last one on, and the direction with less fill-in is kept. For hexagon
    webs the factor is then an eighth smaller and takes a fifth less time; for triangles it is larger, for squares the
    same.

    Attributes
    ----------
    turn : {1, -1}
        Direction in which the unknowns are counted.
    solver : qdldl.Solver, optional
        The factorization, None before the first.
    """

    solutions = 10

    def __init__(self, pattern):
        self.pattern, self.turn, self._may_turn = pattern, 1, pattern.size >= LARGE
        self.solver: Any = None

    def factorize(self, values):
        """Factorize; only the solutions show a zero pivot."""
        if self.solver is None:
            self._begin(values)
            return
        if self._may_turn:
            before, self.turn, self._may_turn = self.solver, -1, False
            self._begin(values)
            if self.solver.factors()[0].nnz < before.factors()[0].nnz:
                return
            self.solver, self.turn = before, 1
        self._matrix = self.pattern.upper_matrix(values, self.turn)
        self.solver.update(self._matrix, upper=True)

    def _begin(self, values):
        """Find an ordering, and factorize."""
        import qdldl

        self._matrix = matrix = self.pattern.upper_matrix(values, self.turn)
        try:
            self.solver = qdldl.Solver(matrix, upper=True)
        except RuntimeError:  # a zero pivot, which raises here and not in an update
            definite = matrix.copy()
            definite.data[:] = 0.0
            definite.setdiag(1.0)
            self.solver = qdldl.Solver(definite, upper=True)
            self.solver.update(matrix, upper=True)

    def solve(self, b):
        """Solution of A y = b."""
        return self.solver.solve(np.ascontiguousarray(b[:: self.turn]))[:: self.turn]

    def solve_all(self, b):
        """Solutions of A y = b, shape (n, k)."""
        return np.column_stack([self.solve(column) for column in b.T])

    def times(self, y):
        """A y."""
        upper, y = self._matrix, y[:: self.turn]
        return (upper @ y + upper.T @ y - upper.diagonal() * y)[:: self.turn]

    def negative_pivots(self):
        """Number of pivots that are not positive."""
        return _not_positive(self.solver)


class _Superlu:
    """LU by SuperLU with pivots on the diagonal; their signs are those of LDLᵀ."""

    solutions = 8

    def __init__(self, pattern):
        self.pattern = pattern
        self._lu: Any = None

    def factorize(self, values):
        """Factorize; raise a RuntimeError if the matrix is singular or a pivot is not on the diagonal."""
        self._matrix = self.pattern.matrix(values)
        self._lu = None  # of which there is one at a time in memory
        self._lu = symmetric_lu(self._matrix)
        if (self._lu.perm_r != self._lu.perm_c).any():
            raise RuntimeError("a pivot is 0")

    def solve(self, b):
        """Solution of A y = b."""
        return self._lu.solve(b)

    solve_all = solve

    def times(self, y):
        """A y."""
        return self._matrix @ y

    def negative_pivots(self):
        """Number of pivots that are not positive."""
        return int(np.count_nonzero(~(self._lu.U.diagonal() > 0.0)))


class _Rslab:
    """LDLᵀ by rslab, with exchanges of pivots; the pattern is analysed once."""

    solutions = 6

    def __init__(self, pattern):
        self.pattern = pattern
        self._symbolic: Any = None

    def factorize(self, values):
        """Factorize; raise a RuntimeError if the matrix is singular."""
        import rslab

        self._matrix = self.pattern.matrix(values)
        if self._symbolic is None:
            self._symbolic = rslab.analyze(self._matrix, path="ldlt", threads=1, nemin=NEMIN)
        self._factor: Any = None  # of which there is one at a time in memory
        self._factor = self._symbolic.factor(values[self.pattern.lower])

    def solve(self, b):
        """Solution of A y = b."""
        return self._factor.solve(b)

    def solve_all(self, b):
        """Solutions of A y = b, shape (n, k), in half the time of separate solutions."""
        return self._factor.solve_many(b)

    def times(self, y):
        """A y."""
        return self._matrix @ y

    def negative_pivots(self):
        """Number of pivots that are not positive; None if rslab does not report all signs."""
        positive, negative, zero = self._factor.inertia
        complete = positive + negative + zero == self.pattern.size and not self._factor.n_perturbed
        return negative + zero if complete else None


def _multifrontal(pattern):
    """A `refweb.system.multifrontal.Multifrontal`, whose kernels only its caller needs."""
    from .multifrontal import Multifrontal

    return Multifrontal(pattern)


def _supernodal(pattern):
    """A `refweb.system.supernodal.Supernodal`, whose kernels only its caller needs."""
    from .supernodal import Supernodal

    return Supernodal(pattern)


LIBRARIES = {
    "qdldl": Qdldl,
    "supernodal": _supernodal,
    "superlu": _Superlu,
    "rslab": _Rslab,
    "multifrontal": _multifrontal,
}


class Factor:
    """LDLᵀ of matrices of one `refweb.system.sparsity.Pattern`, by its `Library`; the ordering is kept.

    Attributes
    ----------
    shift : float or None
        Prestress τ by which the factorized tangent is shifted [N]; None if the matrix is no tangent.
    solutions : int
        Number of solutions that cost clearly less than another factorization.
    """

    def __init__(self, pattern):
        self.pattern, self.shift = pattern, None
        self._made = {}
        self._by: Any = None
        self._values = np.zeros(0)

    @property
    def solutions(self):
        return self._by.solutions

    def update(self, values, shift=None):
        """Factorize the symmetric matrix of these values, of a tangent with a ``shift`` or of another matrix."""
        self._values = values
        if not self.pattern.size:
            return
        self.shift = shift
        name = self.pattern.library.name
        for by in (name, "superlu") if name == "multifrontal" else (name,):  # which takes positive definite ones alone
            with contextlib.suppress(RuntimeError):
                self._adopt(by)
                return
        self._adopt("qdldl")  # singular, of which qdldl leaves what can be used

    def _adopt(self, name):
        """Factorize by a library."""
        if name not in self._made:
            self._made[name] = LIBRARIES[name](self.pattern)
        self._by = self._made[name]
        self._by.factorize(self._values)

    def solve(self, b):
        """Solution of A y = b, shape (n,); None if the factorization broke down on a zero pivot.

        qdldl reports no breakdown: therefore the residual of the solution is computed and, if it is large, reduced by
        refinement.
        """
        if not self.pattern.size:
            return np.zeros(0)
        y, error = self._refined(b)
        if isinstance(self._by, _Rslab):
            wrong = "" if error <= FINE else f"solves to {error:.0e} only"
            if not wrong and b @ y < -FINE * np.abs(b) @ np.abs(y) and self.negative_pivots() == 0:
                wrong = "misses a negative pivot"  # of bᵀA⁻¹b < 0
            if wrong:
                self._adopt("qdldl")
                y, error = self._refined(b)
                if error <= FINE:  # which is no fault of the matrix, then
                    self.pattern.library.fall_back(wrong)
        return y if error <= ROUGH else None

    def precondition(self, b):
        """Solutions of A y = b without refinement, shape (n,) or (n, k), for a caller that checks the residual."""
        return self._by.solve(b) if b.ndim == 1 else self._by.solve_all(b)

    def _refined(self, b):
        """Solution of A y = b, and its residual over the right-hand side."""
        y, rest = np.zeros_like(b), b
        bound, error = np.abs(b).max(initial=0.0), np.inf
        for _ in range(3):
            y = y + self._by.solve(rest)
            rest = b - self._by.times(y)
            error = np.abs(rest).max(initial=0.0)
            if error <= FINE * bound:
                return y, 0.0
        return y, error / bound if bound else np.inf

    def negative_pivots(self):
        """Number of pivots that are not positive."""
        if not self.pattern.size:
            return 0
        count = self._by.negative_pivots()
        if count is None:
            self.pattern.library.fall_back("does not say the signs of all pivots")
            self._adopt("qdldl")
            count = self._by.negative_pivots()
        return count


def symmetric_lu(matrix):
    """LU of a symmetric matrix by SuperLU, with an ordering for symmetric matrices and pivots on the diagonal."""
    from scipy.sparse.linalg import splu

    return splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})


def negative_pivots(upper, library):
    """Number of pivots that are not positive, of a symmetric matrix by its upper triangle, made once."""
    if library.name == "rslab":
        import rslab

        with contextlib.suppress(RuntimeError):  # a singular matrix
            positive, negative, zero = rslab.ldlt(upper.T, threads=1).inertia
            if positive + negative + zero == upper.shape[0]:
                return negative + zero
    import qdldl

    return _not_positive(qdldl.Solver(upper, upper=True))


def _not_positive(solver):
    """Number of pivots of a `qdldl.Solver` that are not positive."""
    return int(np.count_nonzero(~(solver.factors()[1] > 0.0)))


class Lu:
    """LU of matrices of one `refweb.system.sparsity.Pattern`, with the interface of a `Factor`."""

    shift, solutions = None, 0

    def __init__(self, pattern):
        self.pattern = pattern
        self._solver: Any = None

    def update(self, values, shift=None):
        """Factorize the matrix of these values."""
        from scipy.sparse.linalg import splu

        try:
            self._solver = splu(self.pattern.matrix(values), permc_spec="MMD_AT_PLUS_A")
        except RuntimeError:  # exactly singular
            self._solver = None

    def solve(self, b, transposed=False):
        """Solution of A y = b, shape (n,), or of Aᵀ y = b; None if A is singular."""
        if self.singular:
            return None
        y = self._solver.solve(b, "T" if transposed else "N")
        return y if np.isfinite(y).all() else None

    @property
    def singular(self):
        """True if a pivot is exactly 0."""
        return self._solver is None

    def sign_of_determinant(self):
        """Sign of det A, of a matrix that is not singular."""
        odd = _is_odd(self._solver.perm_r) != _is_odd(self._solver.perm_c)
        return int(np.prod(np.sign(self._solver.U.diagonal()))) * (-1 if odd else 1)

    def negative_pivots(self) -> int:
        """Refuse: the signs of pivots say nothing about an unsymmetric matrix."""
        raise NotImplementedError

    def precondition(self, b) -> np.ndarray:
        """Refuse: conjugate gradients need a symmetric matrix."""
        raise NotImplementedError


def _is_odd(turned):
    """Tell if a permutation is odd."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    count = len(turned)
    cycles, _ = connected_components(coo_array((np.ones(count), (np.arange(count), turned)), shape=(count, count)))
    return (count - cycles) % 2 == 1


def weak_pivot(solver):
    """Index of the first pivot of a `qdldl.Solver` that is not positive, None if all are."""
    _, pivots, order = solver.factors()
    bad = np.flatnonzero(~(pivots > 0.0))
    return int(order[bad[0]]) if len(bad) else None
