"""A frame that turns steadily: the centrifugal and the Coriolis force on every mass.

In axes that turn with the angular velocity Ω about a line through the origin a mass m at r that moves with v feels

    m (Ω²I − ΩΩᵀ) r − 2 m Ω × v,      with the potential −½ m |Ω × r|² of the first part.

Coriolis forces do no work: kinetic energy and potentials, this one among them, keep their sum, the Jacobi integral. The
moment of inertia I of a sphere whose rotation is followed feels −I Ω × ω, ω its angular velocity in these axes; a ring
keeps its plane in these axes and turns about its normal, which that does not change.

Consistent mass couples the nodes of an element here as it does in M v': the force is that of the position between them.
"""

from __future__ import annotations

import functools
import math

import numpy as np

from ..kernels import BOUND, ENERGY, FORCE, STIFFNESS, kernel
from ..tables import Several, Table, table, vector
from .base import Family, column

MASS = 3
"""First column of a cell's mass matrix, behind Ω; behind that stand the positions of its nodes in the web."""


@kernel()
def turned(data, c, a0, a1, a2):
    """Ω × a."""
    w0, w1, w2 = data[c, 0], data[c, 1], data[c, 2]
    return w1 * a2 - w2 * a1, w2 * a0 - w0 * a2, w0 * a1 - w1 * a0


@functools.cache
def kernels(nodes):
    """Force, energy and stiffness of the centrifugal force; force, damping and its bound of the Coriolis force.

    Parameters
    ----------
    nodes : int
        Nodes per cell, which its mass matrix couples.
    """
    rest = MASS + nodes * nodes

    @kernel(FORCE)
    def centrifugal(t, x, v, f, cells, data, out):
        for c in range(cells.shape[0]):
            for b in range(nodes):
                row, at = cells[c, b], rest + 3 * b
                p0, p1, p2 = data[c, at] + x[row, 0], data[c, at + 1] + x[row, 1], data[c, at + 2] + x[row, 2]
                q0, q1, q2 = turned(data, c, p0, p1, p2)
                q0, q1, q2 = turned(data, c, q0, q1, q2)
                for a in range(nodes):
                    to, m = cells[c, a], data[c, MASS + nodes * a + b]
                    f[to, 0] -= m * q0
                    f[to, 1] -= m * q1
                    f[to, 2] -= m * q2

    @kernel(ENERGY)
    def energy(t, x, cells, data, out):
        for c in range(cells.shape[0]):
            out[c] = 0.0
            for b in range(nodes):
                row, at = cells[c, b], rest + 3 * b
                u0, u1, u2 = x[row, 0], x[row, 1], x[row, 2]
                q = turned(data, c, 2.0 * data[c, at] + u0, 2.0 * data[c, at + 1] + u1, 2.0 * data[c, at + 2] + u2)
                for a in range(nodes):
                    to, m = cells[c, a], data[c, MASS + nodes * a + b]
                    p = turned(data, c, x[to, 0], x[to, 1], x[to, 2])
                    out[c] -= 0.5 * m * (p[0] * q[0] + p[1] * q[1] + p[2] * q[2])

    @kernel(STIFFNESS)
    def stiffness(t, x, v, blocks, cells, data, definite):
        for c in range(cells.shape[0]):
            blocks[c] = 0.0
            square = data[c, 0] ** 2 + data[c, 1] ** 2 + data[c, 2] ** 2
            for a in range(nodes if not definite else 0):
                for b in range(nodes):
                    m = data[c, MASS + nodes * a + b]
                    for i in range(3):
                        for j in range(3):
                            blocks[c, 3 * a + i, 3 * b + j] += m * data[c, i] * data[c, j]
                        blocks[c, 3 * a + i, 3 * b + i] -= m * square

    @kernel(FORCE)
    def coriolis(t, x, v, f, cells, data, out):
        for c in range(cells.shape[0]):
            for b in range(nodes):
                row = cells[c, b]
                q0, q1, q2 = turned(data, c, v[row, 0], v[row, 1], v[row, 2])
                for a in range(nodes):
                    to, m = cells[c, a], 2.0 * data[c, MASS + nodes * a + b]
                    f[to, 0] -= m * q0
                    f[to, 1] -= m * q1
                    f[to, 2] -= m * q2

    @kernel(STIFFNESS)
    def damping(t, x, v, blocks, cells, data, definite):
        for c in range(cells.shape[0]):
            blocks[c] = 0.0
            for a in range(nodes if not definite else 0):
                for b in range(nodes):
                    m = 2.0 * data[c, MASS + nodes * a + b]
                    for i in range(3):
                        j, k = (i + 1) % 3, (i + 2) % 3
                        blocks[c, 3 * a + j, 3 * b + k] -= m * data[c, i]
                        blocks[c, 3 * a + k, 3 * b + j] += m * data[c, i]

    @kernel(BOUND)
    def damping_bound(reach, speed, x, mass, rates, cells, data):
        for c in range(cells.shape[0]):
            most = math.sqrt(2.0 * (data[c, 0] ** 2 + data[c, 1] ** 2 + data[c, 2] ** 2))  # of row sums of Ω ×
            for a in range(nodes):
                for b in range(nodes):
                    rates[cells[c, a]] += 2.0 * most * abs(data[c, MASS + nodes * a + b])

    return centrifugal, energy, stiffness, coriolis, damping, damping_bound


@table
class Frame(Table):
    """A steadily turning frame; positions, velocities, supports and all other effects are those in its axes.

    Parameters
    ----------
    angular_velocity : sequence of 3 float
        Ω of the frame [rad/s], about an axis through the origin.

    Raises
    ------
    InputError
        For an angular velocity that is not three finite numbers.

    References
    ----------
    L. D. Landau, E. M. Lifshitz, "Mechanics", 3rd ed. 1976, §39: the forces, and the energy that is kept.

    Examples
    --------
        [frame]
        angular_velocity = [0.0, 0.0, 6.283]
    """

    angular_velocity: Several = vector(unit="rad/s")

    def on(self, net):
        """Centrifugal and Coriolis force of all rows with mass; where mass is consistent those of the lines as well.

        The centrifugal force lowers frequencies and makes no step of an explicit method shorter: it needs no bound.
        """
        heavy, spins = (
            net.heavy,
            np.array([b.spin for b in net.bodies if b.spin is not None and not b.shape.planar], int),
        )
        pulled = column(heavy), self._numbers(net.mass[heavy], net.points[heavy])
        halves = np.concatenate([net.mass[heavy], 0.5 * net.mass[spins]])  # what has 2 m for masses, and I for spins
        rows = np.concatenate([heavy, spins])
        families = self._families(pulled, (column(rows), self._numbers(halves, net.points[rows])))
        if net.consistent_minus_lumped is not None:
            lines = net.cells, self._numbers(net.consistent_minus_lumped, net.points[net.cells])
            families += self._families(lines, lines)
        return families

    def _numbers(self, mass, points):
        flat = (a.reshape(len(mass), int(np.prod(a.shape[1:]))) for a in (mass, points))
        parts = [np.tile(self.angular_velocity, (len(mass), 1)), *flat]
        return np.ascontiguousarray(np.hstack(parts))

    def _families(self, pulled, turned):
        force, energy, stiffness, coriolis, damping, damping_bound = kernels(pulled[0].shape[1])
        return [
            Family(
                name="frame",
                book="frame_energy",
                angular_velocity=self.angular_velocity,
                cells=pulled[0],
                data=pulled[1],
                force=force,
                energy=energy,
                stiffness=stiffness,
            ),
            Family(
                name="frame",
                book="frame_energy",
                angular_velocity=self.angular_velocity,
                cells=turned[0],
                data=turned[1],
                force=coriolis,
                damping=damping,
                damping_bound=damping_bound,
                symmetric=False,
                at_rest=False,
            ),
        ]
