"""Natural frequencies about an equilibrium: the lowest pairs of K φ = ω² M φ, none missed, each with an error bound.

K is the tangent at the equilibrium; across the lines of a net it is that of their tensions. First, eigenvalues are
counted, see `refweb.studies.pencil`: unstable directions, directions without stiffness, and others.

With M definite there is an eigenvalue within ‖Kφ − ω²Mφ‖ of ω², in the norm of M⁻¹ and with φᵀMφ = 1. The rounding of K
and the error of the equilibrium are added to this bound. For the latter, K is assembled again after another Newton
step.

In a rotating frame K includes the centrifugal force, and `refweb.studies.turning` finds the modes with Coriolis forces.

May change: private functions; how bounds are found, if they cover the error. Must stay: names of fields of `Spectrum`,
which `modes` writes to ``modes.csv`` and ``run.json``, and the order of frequencies; `spectrum`, which `modes` and
`frequency_gradients` call. Tests: ``tests/studies/test_modes.py``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import SolverError
from .pencil import Pencil
from .turning import coriolis, turning_pairs


@dataclass(frozen=True, eq=False)
class Spectrum:
    """The lowest modes at one equilibrium, unstable ones first; directions without stiffness are only counted.

    Attributes
    ----------
    step : float
        Load step; in dynamics the time, 0.
    squared : ndarray, shape (modes,)
        ω² [1/s²], increasing; negative where the equilibrium is unstable.
    bound : ndarray, shape (modes,)
        Bound on the error of ω² [1/s²].
    residual : ndarray, shape (modes,)
        ‖Kφ − ω²Mφ‖ over |ω²| ‖φ‖, in the norms of M⁻¹ and M [1].
    shapes : ndarray, shape (modes, rows, 3)
        Displacements; the largest of a node is 1, and its largest component positive. Those of rotations of bodies are
        angles over it [rad/m].
    later : ndarray, shape (modes, rows, 3), optional
        In a rotating frame, displacements a quarter of a period later.
    modal_mass : ndarray, shape (modes,)
        φᵀMφ of the shapes [kg]: a shape over its root is mass-normalised.
    shares : ndarray, shape (modes, 3)
        Parts of the kinetic energy along x, y and z [1]; what is left is that of bodies that turn.
    moving : ndarray, shape (modes,)
        Share of the mass that moves, (Σ m|φ|²)²/(Σ m Σ m|φ|⁴) [1]: 1 where all moves alike, near 0 for a local mode.
        Rotations of bodies count with a length of theirs.
    nodes : ndarray of int, shape (modes,)
        Row of the largest displacement: of a body where no node moves.
    unstable, zero : int
        Number of modes of negative ω², and of directions without stiffness.
    """

    step: float
    squared: np.ndarray
    bound: np.ndarray
    residual: np.ndarray
    shapes: np.ndarray
    modal_mass: np.ndarray
    shares: np.ndarray
    moving: np.ndarray
    nodes: np.ndarray
    unstable: int
    zero: int
    later: np.ndarray | None = None

    @property
    def frequency(self):
        """√|ω²|/2π [Hz], shape (modes,); negative, which stands for imaginary, where ω² is negative."""
        return _frequency(self.squared)

    @property
    def error(self):
        """± of each frequency [Hz] from the bound on ω², shape (modes,)."""
        ends = [_frequency(self.squared + sign * self.bound) for sign in (-1.0, 1.0)]
        return np.abs(np.array(ends) - self.frequency).max(axis=0)


def _frequency(squared):
    return np.sign(squared) * np.sqrt(np.abs(squared)) / (2.0 * np.pi)


def spectrum(system, t, x, number, seed=0):
    """The `Spectrum` of a system at its equilibrium.

    Parameters
    ----------
    system : refweb.system.system.System
        System with a symmetric tangent.
    t : float
        Load step or time.
    x : ndarray, shape (rows, 3)
        Displacement of the equilibrium [m].
    number : int
        Number of modes; the net may have fewer.
    seed : int
        Seed of the start vector of the iteration.

    Raises
    ------
    SolverError
        If no unknown with mass has stiffness, or a node has neither.
    """
    pencil, across = Pencil(system, t, x, seed), system.carriers.count_across(system) if system.angles else 0
    if (turned := coriolis(system, x)) is not None:
        lower = lambda v: _rounding(pencil, v) + _left(pencil, v)  # noqa: E731
        *pairs, unstable, zero = turning_pairs(pencil, turned, number + across, lower)
    else:
        *pairs, unstable, zero = _pairs(pencil, number + across)
    if pairs and across:
        kept = np.flatnonzero(system.carriers.turns_about_axles(system, pairs[-1]))[:number]
        pairs = [values[..., kept] for values in pairs] if len(kept) else []
    if not pairs:
        raise SolverError(
            f"no mode at step {t:g}: none of the {len(pencil.massive) - across} unknowns that have mass has stiffness; "
            "stretch the web by a load, or by a prestrain of its cable"
        )
    return _described(pencil, *pairs, unstable, zero)


def _pairs(pencil, number):
    """(ω², bounds, residuals, vectors) of the lowest modes, if there are any, and the numbers of unstable and zero."""
    unstable, low = pencil.below(0.0, 1.0), pencil.below(0.0, -1.0)
    vectors, shift = [], 0.0
    if unstable:
        vectors.append(pencil.above(pencil.beside(0, -1.0), min(number, unstable)))
    if unstable < low < len(pencil.massive):
        shift = pencil.beside(low, 1.0)
        low = pencil.below(shift)
    if number > unstable and low < len(pencil.massive):
        vectors.append(pencil.above(shift, min(number - unstable, len(pencil.massive) - low)))
    return *(_ordered(pencil, np.hstack(vectors)) if vectors else ()), unstable, low - unstable


def _ordered(pencil, vectors):
    """ω², increasing, with bounds, residuals and vectors."""
    vectors = vectors / np.sqrt((vectors * (pencil.M @ vectors)).sum(axis=0))
    squared = (vectors * (pencil.K @ vectors)).sum(axis=0)
    vectors, squared = vectors[:, (order := np.argsort(squared))], squared[order]
    residual = pencil.residual(squared, vectors)
    return squared, residual + _rounding(pencil, vectors) + _left(pencil, vectors), residual, vectors


def _described(pencil, squared, bound, residual, vectors, unstable, zero):
    """The `Spectrum` of vectors with φ*Mφ = 1."""
    system = pencil.system
    modes = np.arange(len(squared))
    shapes = np.zeros((len(modes), system.rows, 3), dtype=vectors.dtype)
    kinetic = np.zeros_like(shapes)
    shapes.reshape(len(modes), -1)[:, system.free] = vectors.T
    kinetic.reshape(len(modes), -1)[:, system.free] = (vectors.conj() * (pencil.M @ vectors)).T
    places = np.arange(system.rows) < system.rows - system.net.spins
    mass = np.where(system.supported.all(axis=1), 0.0, system.net.mass / system.levers**2)
    if system.carriers:
        system.carriers.add_moves(pencil.x, shapes)
    swept = system.levers * np.linalg.norm(shapes, axis=2)
    of_nodes = swept[:, : system.net.nodes]
    candidates = of_nodes if of_nodes.any(axis=1).all() else swept
    largest = candidates.max(axis=1, keepdims=True)
    nodes = np.argmax(candidates > (1.0 - 1e-6) * largest, axis=1)  # the first of equal ones
    largest = shapes[modes, nodes]
    largest = largest[modes, abs(largest).argmax(axis=1)]
    shapes *= (largest.conj() / abs(largest))[:, None, None]  # at the instant when that is at its largest
    size = np.linalg.norm(shapes[modes, nodes].real, axis=1)
    shapes /= size[:, None, None]
    return Spectrum(
        step=pencil.t,
        squared=squared,
        bound=bound,
        residual=residual / np.maximum(abs(squared), np.finfo(float).tiny),
        shapes=np.ascontiguousarray(shapes.real),
        modal_mass=1.0 / size**2,
        shares=kinetic[:, places].sum(axis=1).real,
        moving=(swept**2 @ mass) ** 2 / (mass.sum() * (swept**4 @ mass)),
        nodes=nodes,
        unstable=unstable,
        zero=zero,
        later=np.ascontiguousarray(-shapes.imag) if np.iscomplexobj(shapes) else None,
    )


def _rounding(pencil, vectors):
    """Effect of the rounding of K on ω²."""
    size = abs(vectors)
    rounding = 8.0 * (size * (abs(pencil.K) @ size)).sum(axis=0)
    return np.finfo(float).eps * (rounding + 2.0 * (vectors.conj() * (pencil.strained @ vectors)).sum(axis=0).real)


def _left(pencil, vectors):
    """Effect of the error of the equilibrium on ω²: K changes by another Newton step."""
    system = pencil.system
    step = pencil.moved(system.force(pencil.t, pencil.x).ravel()[system.free])
    change = pencil.change(system.moved(pencil.x, system.rows_of(step)))
    return np.linalg.norm(vectors.conj().T @ (change @ vectors), axis=0)  # whole rows: what parts equal frequencies too
