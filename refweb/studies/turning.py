"""Frequencies in a rotating frame, with Coriolis forces: pairs of (K + iωG − ω²M) φ = 0.

G = 2 m Ω × is antisymmetric, so that iG is Hermitian. Frequencies come in pairs ±ω with conjugate shapes; those above 0
are listed. K includes the centrifugal force. If K is positive definite, all frequencies are real. With u = (φ, ωφ) they
are those of a definite pencil [1]_,

    B u = 1/ω A u,        A = [K 0; 0 M],        B = [−iG M; M 0],

and the number between 0 and s is the number of negative pivots of K + isG − s²M. With the residual r = (K + iωG − ω²M)
φ, there is a frequency whose 1/ω is within |r|/ω, in the norm of K⁻¹, over the norm of u in A.

If K is indefinite, Coriolis forces may stabilise the equilibrium. For example, a free mass has K = −mΩ² and moves in a
straight line, which is a double frequency ω = Ω with one shape. For such nets of up to `MOST` unknowns, all eigenvalues
of the first order system are computed. Here ω is a root of κ + ωγ − ω²μ = 0. A change of κ = φ*Kφ by e changes ω by at
most the root δ of μδ² + √(γ² + 4κμ) δ = e. This is an estimate, which takes the shapes as exact.

May change: private functions; `MOST`, up to which all eigenvalues are computed, and `SMALL`. Must stay: the order of
the fields of `Pairs`, which `spectrum` unpacks; the seed, by which a run gives the same result again; `coriolis`, which
`frequency_gradients` and `spectrum` call; `turning_pairs`, which `spectrum` imports. Tests:
``tests/studies/test_turning.py``.

References
----------
.. [1] F. Tisseur, K. Meerbergen, "The quadratic eigenvalue problem", SIAM Review 43 (2001) 235–286, section 4,
   doi:10.1137/S0036144500381988.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.linalg
from scipy.sparse import block_array, coo_array, csc_array, csc_matrix, diags_array, kron, triu
from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh, splu

from ..errors import SolverError
from ..system.factorization import negative_pivots
from .pencil import DENSE

MOST = 1500
"""Number of unknowns with mass up to which nets with indefinite K are solved; so many take some minutes."""
SMALL = 1e-7
"""Rate that counts as zero, over the largest rate: the square root of the rounding of its square."""


class Pairs(NamedTuple):
    """Pairs of a pencil in a rotating frame.

    Attributes
    ----------
    squared, bound : ndarray, shape (modes,)
        ω² [1/s²], or minus the square of a rate of growth, and the bound on its error.
    residual : ndarray, shape (modes,)
        |(K + iωG − ω²M) φ| in the norm of M⁻¹, with φ*Mφ = 1 [1/s²].
    vectors : ndarray of complex, shape (unknowns, modes)
        Shapes.
    unstable, zero : int
        Number of modes that grow, and of directions without restoring force.
    """

    squared: np.ndarray
    bound: np.ndarray
    residual: np.ndarray
    vectors: np.ndarray
    unstable: int
    zero: int


def coriolis(system, x):
    """G = −∂f/∂v of the unknowns at a displacement [kg/s], a sparse matrix; None where no frame turns."""
    speed = np.array(system.rotating[0].frame.angular_velocity if system.rotating else (0.0, 0.0, 0.0))
    if not speed.any():
        return None
    net = system.net
    mass = coo_array(diags_array(np.where(np.arange(system.rows) < system.rows - net.spins, net.mass, 0.0)))
    if net.consistent_minus_lumped is not None:
        count = net.cells.shape[1]
        rows, columns = np.repeat(net.cells, count, axis=1).ravel(), np.tile(net.cells, count).ravel()
        mass = mass + coo_array((net.consistent_minus_lumped.ravel(), (rows, columns)), shape=mass.shape)
    across = 2.0 * np.cross(np.eye(3), speed)  # (Ω × e)_i = across[i, j] e_j
    of_places = csc_array(csc_array(kron(mass, across))[system.free][:, system.free])
    if not system.angles:
        return of_places
    return of_places + system.pattern.matrix(system.carriers.coriolis(system, x, speed))


class Gyroscopic:
    """K, M and G of a pencil in its unknowns with mass; unknowns without mass follow.

    Parameters
    ----------
    pencil : refweb.studies.pencil.Pencil
        K and M.
    G : sparse matrix, shape (unknowns, unknowns)
        That of `coriolis`.
    """

    def __init__(self, pencil, G):
        self.pencil, self.G = pencil, G
        self.M = csc_array(pencil.M)[pencil.massive][:, pencil.massive]
        self.matrix = G[pencil.massive][:, pencil.massive]
        self._weigh = splu(csc_matrix(self.M))

    def stiffness(self):
        """Dense K of the unknowns with mass; the others are in equilibrium with them."""
        K, pencil = csc_array(self.pencil.K), self.pencil
        massive_stiffness = K[pencil.massive][:, pencil.massive].toarray()
        if len(pencil.massless):
            across = K[pencil.massless][:, pencil.massive].toarray()
            massive_stiffness -= across.T @ pencil.follow(across)
        return 0.5 * (massive_stiffness + massive_stiffness.T)

    def all_rows(self, parts):
        """Vectors of all unknowns, shape (unknowns, modes)."""
        vectors = np.zeros((self.pencil.system.pattern.size, parts.shape[1]), dtype=complex)
        vectors[self.pencil.massive] = parts
        if len(self.pencil.massless):
            rest = (self.pencil.K @ vectors)[self.pencil.massless]
            vectors[self.pencil.massless] = -self.pencil.follow(rest.real) - 1j * self.pencil.follow(rest.imag)
        return vectors / np.sqrt(self.form(self.pencil.M, vectors))

    @staticmethod
    def form(matrix, vectors):
        """φ*Aφ of each vector φ, with a symmetric matrix A."""
        return (vectors.conj() * (matrix @ vectors)).sum(axis=0).real

    def forms(self, vectors):
        """κ = φ*Kφ and γ = φ*iGφ of vectors with φ*Mφ = 1."""
        return self.form(self.pencil.K, vectors), (vectors.conj() * (1j * (self.G @ vectors))).sum(axis=0).real

    def rest(self, rates, vectors):
        """(K + λG + λ²M) φ of the unknowns with mass; it is zero for those without."""
        rest = self.pencil.K @ vectors + rates * (self.G @ vectors) + rates**2 * (self.pencil.M @ vectors)
        return rest[self.pencil.massive]

    def weighed(self, rest):
        """Norm of each column in M⁻¹."""
        inverse = self._weigh.solve(rest.real) + 1j * self._weigh.solve(rest.imag)
        return np.sqrt(np.maximum((rest.conj() * inverse).sum(axis=0).real, 0.0))

    def below(self, omega):
        """Number of frequencies between 0 and ``omega``, for a definite K."""
        real = self.pencil.K - omega**2 * self.pencil.M
        turned = omega * self.G
        both = csc_matrix(triu(block_array([[real, -turned], [turned, real]]), format="csc"))
        return negative_pivots(both, self.pencil.system.library) // 2


def turning_pairs(pencil, G, number, lower):
    """The lowest `Pairs` of a net in a rotating frame; modes that grow come first.

    Parameters
    ----------
    pencil : refweb.studies.pencil.Pencil
        K and M.
    G : sparse matrix
        That of `coriolis`.
    number : int
        Number of pairs; there are as many as unknowns with mass.
    lower : callable
        Function of vectors: error of φ*Kφ [1/s²] by rounding and by the error of the equilibrium.

    Raises
    ------
    SolverError
        If some pairs are not found, or K is indefinite and there are too many unknowns.
    """
    gyroscopic = Gyroscopic(pencil, G)
    if pencil.below(0.0, -1.0) == 0:
        return _definite(gyroscopic, min(number, len(pencil.massive)), lower)
    if len(pencil.massive) > MOST:
        raise SolverError(
            f"no modes at step {pencil.t:g}: nothing but Coriolis forces holds some directions of a net of "
            f"{len(pencil.massive)} unknowns with mass, which is more than {MOST}, and none could be said to be "
            "missed: support nodes, or divide lines less"
        )
    return _general(gyroscopic, number, lower)


def _definite(gyroscopic, number, lower):
    pencil = gyroscopic.pencil
    size, solve = len(pencil.massive), pencil.bend(0.0)
    for attempt in range(4):
        wanted = min(number + 1 + 20 * attempt, size)
        dense = size <= DENSE or 3 * wanted >= size
        vectors = gyroscopic.all_rows((_all if dense else _some)(gyroscopic, wanted, solve, attempt))
        stiff, turned = gyroscopic.forms(vectors)
        split = np.sqrt(turned**2 + 4.0 * stiff)
        omega = np.where(turned > 0.0, 0.5 * (turned + split), 2.0 * stiff / (split - np.minimum(turned, 0.0)))
        order = np.argsort(omega)
        omega, vectors, stiff, split = omega[order], vectors[:, order], stiff[order], split[order]
        mark = omega[number - 1] * (1.0 - 1e-7)
        if gyroscopic.below(mark) == np.count_nonzero(omega < mark):
            break
    else:
        raise SolverError(f"no modes at step {pencil.t:g}: below ω = {mark:.4g} 1/s some modes are not found")
    omega, vectors, stiff, split = omega[:number], vectors[:, :number], stiff[:number], split[:number]
    rest = gyroscopic.rest(1j * omega, vectors)
    soft = np.column_stack([solve(r.real) + 1j * solve(r.imag) for r in rest.T])
    left = np.sqrt(np.maximum((rest.conj() * soft).sum(axis=0).real, 0.0))
    share = left / np.sqrt(stiff + omega**2)  # error of 1/ω, over 1/ω
    off = omega * share / np.maximum(1.0 - share, 0.5) + lower(vectors) / split
    return Pairs(omega**2, 2.0 * omega * off + off**2, gyroscopic.weighed(rest), vectors, 0, 0)


def _all(gyroscopic, wanted, solve, attempt):
    """Shapes φ of the largest 1/ω, of the unknowns with mass."""
    M, G, K = gyroscopic.M.toarray(), gyroscopic.matrix.toarray(), gyroscopic.stiffness()
    none = np.zeros_like(M)
    B, A = np.block([[-1j * G, M], [M, none]]), np.block([[K, none], [none, M]])
    return scipy.linalg.eigh(B, A)[1][: len(M), : -wanted - 1 : -1]


def _some(gyroscopic, wanted, solve, attempt):
    """Solve as `_all`, by Lanczos iteration."""
    M, G, size = gyroscopic.M, gyroscopic.matrix, gyroscopic.M.shape[0]
    pencil, weigh = gyroscopic.pencil, gyroscopic._weigh

    def times(u):
        u = u.ravel()
        return np.concatenate([M @ u[size:] - 1j * (G @ u[:size]), M @ u[:size]])

    def heavy(u):
        u = u.ravel()
        vector = np.zeros(pencil.system.pattern.size, dtype=complex)
        vector[pencil.massive] = u[:size]
        pull = pencil.K @ vector
        if len(pencil.massless):
            rest = pull[pencil.massless]
            vector[pencil.massless] = -pencil.follow(rest.real) - 1j * pencil.follow(rest.imag)
            pull = pencil.K @ vector
        return np.concatenate([pull[pencil.massive], M @ u[size:]])

    def light(u):
        u = u.ravel()
        first = solve(u[:size].real) + 1j * solve(u[:size].imag)
        return np.concatenate([first, weigh.solve(u[size:].real) + 1j * weigh.solve(u[size:].imag)])

    shape = (2 * size, 2 * size)
    B, A, inverse = (
        LinearOperator(shape, matvec=by, dtype=complex)  # pyright: ignore[reportCallIssue]  # as __new__ takes them
        for by in (times, heavy, light)
    )
    start = np.random.default_rng(pencil.seed + attempt).standard_normal(2 * size).astype(complex)
    try:
        _, vectors = eigsh(B, wanted, A, which="LA", v0=start, Minv=inverse)
    except ArpackError as error:
        raise SolverError(f"no modes at step {pencil.t:g}: {error}") from None
    return vectors[:size]


def _general(gyroscopic, number, lower):
    """All pairs of the first order system; a growth below `SMALL` of the fastest rate counts as zero."""
    gyroscopic.pencil.bend(gyroscopic.pencil.beside(gyroscopic.pencil.below(0.0, -1.0), 1.0))
    root = scipy.linalg.cholesky(gyroscopic.M.toarray(), lower=True)

    def scaled(matrix):
        half = scipy.linalg.solve_triangular(root, matrix, lower=True)
        return scipy.linalg.solve_triangular(root, half.T, lower=True).T

    K, G = scaled(gyroscopic.stiffness()), scaled(gyroscopic.matrix.toarray())
    size = len(K)
    eigenvalues, parts = np.linalg.eig(np.block([[np.zeros_like(K), np.eye(size)], [-K, -G]]))
    none = SMALL * np.sqrt(abs(K).sum(axis=0).max())
    least_growth, growth, turn = np.maximum(none, 1e-6 * abs(eigenvalues)), np.real(eigenvalues), np.imag(eigenvalues)
    grows = (growth > least_growth) & (turn > -none)
    turns = (abs(growth) <= least_growth) & (turn > none)
    if not (grows.any() or turns.any()):
        raise SolverError(f"no mode at step {gyroscopic.pencil.t:g}: nothing that has mass has stiffness or is turned")
    kept = np.flatnonzero(grows | turns)
    kept = kept[np.argsort(np.where(grows, -growth, turn)[kept])][:number]
    rates, grown = eigenvalues[kept], grows[kept]
    vectors = gyroscopic.all_rows(scipy.linalg.solve_triangular(root.T, parts[:size, kept]))
    stiff, turned = gyroscopic.forms(vectors)
    split = np.sqrt(abs(turned**2 + 4.0 * stiff))
    split = np.where(split**2 < 64.0 * np.finfo(float).eps * (turned**2 + 4.0 * abs(stiff)), 0.0, split)
    roots = np.array([0.5 * (turned + split), 0.5 * (turned - split)])
    omega = roots[abs(roots - np.imag(rates)).argmin(axis=0), np.arange(len(kept))]
    rates = np.where(grown, rates, 1j * omega)
    rest = gyroscopic.weighed(gyroscopic.rest(rates, vectors))
    rounding = 8.0 * np.finfo(float).eps * (abs(stiff) + abs(rates * turned) + abs(rates) ** 2)
    off = rest + rounding + lower(vectors)
    off = 2.0 * off / (split + np.sqrt(split**2 + 4.0 * off))
    value = np.where(grown, np.real(rates), omega)
    squared = np.where(grown, -1.0, 1.0) * value**2
    flutter = grows & (abs(turn) > none)  # four rates each, the others two
    zero = size - int(turns.sum()) - int(grows.sum()) - int(flutter.sum())
    return Pairs(squared, 2.0 * abs(value) * off + off**2, rest, vectors, int(grows.sum()), zero)
