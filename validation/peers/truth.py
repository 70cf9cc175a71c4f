"""The right answers: by refweb with all its digits, and by methods that share no line with it; both have to agree."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .programs import refweb


class Truth(NamedTuple):
    """Positions that are right, shape (n, 3) [m], how far two methods differ [m], and which those are."""

    positions: np.ndarray
    apart: float
    said: str


def tangent(problem, positions):
    """Derivative of minus the forces at the free nodes, of taut lines alone, in compressed columns."""
    from scipy.sparse import bsr_array

    across = positions[problem.lines[:, 1]] - positions[problem.lines[:, 0]]
    length, tension = np.linalg.norm(across, axis=1), problem.tensions(positions)
    outer = across[:, :, None] * across[:, None, :] / (length**2)[:, None, None]
    axial = np.where(tension > 0.0, problem.ea / problem.natural, 0.0)[:, None, None]
    blocks = axial * outer + (tension / length)[:, None, None] * (np.eye(3) - outer)
    lines, count = len(problem.lines), len(positions)
    ends = np.tile([[-1.0], [1.0]], (lines, 1))[:, :, None] * np.eye(3)
    across_ends = bsr_array((ends, problem.lines.ravel(), 2 * np.arange(lines + 1)), shape=(3 * lines, 3 * count))
    stiffness = bsr_array((blocks, np.arange(lines), np.arange(lines + 1)), shape=(3 * lines, 3 * lines))
    free = np.repeat(problem.free, 3)
    return (across_ends.T @ stiffness @ across_ends).tocsc()[free][:, free]


def newton(problem, shift=10.0, most=200):
    """Equilibrium under the last load by Newton's method with a shift that falls with the residual, from a bowl."""
    from dataclasses import replace

    from scipy.sparse import eye_array
    from scipy.sparse.linalg import splu

    free, load = problem.free, problem.loads[-1]
    positions = replace(problem, dish=0.2).start
    for _ in range(most):
        residual = problem.forces(positions)
        residual[problem.node, 2] += load
        size = np.abs(residual[free]).max()
        if size < 1e-9 * load:
            return positions
        matrix = tangent(problem, positions)
        matrix = matrix + min(shift, size) * eye_array(matrix.shape[0], format="csc")
        factors = splu(
            matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )
        moved = factors.solve(residual[free].ravel()).reshape(-1, 3)
        positions[free] += moved * min(1.0, 0.05 / np.abs(moved).max())
    raise RuntimeError(f"residual {size:.1e} N after {most} steps")


def equilibrium(problem):
    """The positions under the last load, a `Truth`."""
    found, other = refweb.statics(problem), newton(problem)
    apart = float(np.abs(found - other).max())
    return Truth(other, apart, "a shifted Newton method in NumPy and SciPy, and refweb's with its bound")


def verlet(problem, steps):
    """Positions at the end of the motion by the Verlet method, in NumPy."""
    step, weight = problem.duration / steps, np.where(problem.free, 1.0 / problem.masses, 0.0)[:, None]
    x, v = problem.start, problem.velocities
    for _ in range(steps):
        x += 0.5 * step * v
        v += step * weight * problem.forces(x)
        x += 0.5 * step * v
    return x


def motion(problem, steps=8000):
    """The positions at the end of the motion, a `Truth`."""
    found, other = refweb.impact(problem, steps=2 * steps, method="explicit", order=6), verlet(problem, 2 * steps)
    apart = float(np.abs(found - other).max())
    return Truth(
        0.5 * (found + other),
        apart,
        f"the mean of refweb's steps of order 6 and the Verlet method in NumPy, {2 * steps} steps each",
    )
