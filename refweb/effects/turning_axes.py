"""Forces in axes that rotate steadily about the origin: forces linear in position, and Coriolis forces.

With the angular velocity Ω of the axes, a symmetric matrix G [1/s²] and consistent or lumped masses M, each row has the
force

    M G r − 2 M Ω × v,      with the potential −½ r·M G r of the first part.

Coriolis forces do no work: the sum of kinetic energy and all potentials is constant, the Jacobi integral. A sphere
whose rotation is followed has the moment −I Ω × ω, with its moment of inertia I and its angular velocity ω in these
axes. A ring keeps its plane in these axes, and this moment does not act about its normal.
`refweb.effects.turning_bodies` has the moments on bodies that rotate in space.

Consistent mass couples the nodes of an element here as in M v'.

May change: private functions and how the kernels are written. Must stay: `force_terms`, which `frame` and `orbit` call;
the two forces above, which `turning_bodies` has for bodies that turn in space and `turning_flows` for reeled mass: all
three change together. Tests: ``tests/effects/test_frame.py``, ``tests/effects/test_orbit.py``,
``tests/test_contract.py``.
"""

from __future__ import annotations

import functools
import math

import numpy as np

from ..compiled.rows import matrix_of, record_at
from ..kernels import BOUND, ENERGY, FORCE, STIFFNESS, kernel
from .base import ForceTerm, Tangent, Timing, VelocityForce, column


def position_of(nodes):
    """Dtype of the data of M G r of cells of so many nodes.

    G; the largest eigenvalue of −G, at least 0; the mass matrix of the cell, and the positions of its nodes in the web.
    """
    cell = [("mass", float, (nodes, nodes)), ("points", float, (nodes, 3))]
    return np.dtype([("pull", float, (3, 3)), ("stiffest", float), *cell])


def velocity_of(nodes):
    """Dtype of the data of the Coriolis force: Ω, and the mass matrix of a cell of so many nodes."""
    return np.dtype([("speed", float, (3,)), ("mass", float, (nodes, nodes))])


@functools.cache
def kernels_of_place(nodes):
    """Force, energy, stiffness and bound of M G r.

    Parameters
    ----------
    nodes : int
        Nodes per cell, which its mass matrix couples.
    """
    Position = position_of(nodes)

    @kernel(FORCE)
    def force(t, x, v, f, cells, data, out):
        for c in range(cells.shape[0]):
            masses = record_at(Position, data, c, 0)
            pull, at = masses.pull, masses.points
            for b in range(nodes):
                row = cells[c, b]
                p0, p1, p2 = at[b, 0] + x[row, 0], at[b, 1] + x[row, 1], at[b, 2] + x[row, 2]
                for a in range(nodes):
                    to, m = cells[c, a], masses.mass[a, b]
                    for i in range(3):
                        f[to, i] += m * (pull[i, 0] * p0 + pull[i, 1] * p1 + pull[i, 2] * p2)

    @kernel(ENERGY)
    def energy(t, x, cells, data, out):
        for c in range(cells.shape[0]):
            masses, out[c] = record_at(Position, data, c, 0), 0.0
            pull, at = masses.pull, masses.points
            for b in range(nodes):
                row = cells[c, b]
                p0, p1, p2 = 2.0 * at[b, 0], 2.0 * at[b, 1], 2.0 * at[b, 2]
                p0, p1, p2 = p0 + x[row, 0], p1 + x[row, 1], p2 + x[row, 2]
                for a in range(nodes):
                    to, m = cells[c, a], masses.mass[a, b]
                    for i in range(3):
                        out[c] -= 0.5 * m * x[to, i] * (pull[i, 0] * p0 + pull[i, 1] * p1 + pull[i, 2] * p2)

    @kernel(STIFFNESS)
    def stiffness(t, x, v, blocks, cells, data, definite):
        for c in range(cells.shape[0]):
            masses, blocks[c] = record_at(Position, data, c, 0), 0.0
            for a in range(nodes if not definite else 0):
                for b in range(nodes):
                    m = masses.mass[a, b]
                    for i in range(3):
                        for j in range(3):
                            blocks[c, 3 * a + i, 3 * b + j] -= m * masses.pull[i, j]

    @kernel(BOUND)
    def bound(reach, speed, x, mass, rates, cells, data):
        for c in range(cells.shape[0]):
            masses = record_at(Position, data, c, 0)
            for a in range(nodes):
                for b in range(nodes):
                    rates[cells[c, a]] += masses.stiffest * abs(masses.mass[a, b])

    return force, energy, stiffness, bound


@kernel()
def turned(w0, w1, w2, a0, a1, a2):
    """Ω × a."""
    return w1 * a2 - w2 * a1, w2 * a0 - w0 * a2, w0 * a1 - w1 * a0


@functools.cache
def kernels_of_velocity(nodes):
    """Force, damping and its bound of the Coriolis force, of cells of so many nodes."""
    Velocity = velocity_of(nodes)

    @kernel(FORCE)
    def coriolis(t, x, v, f, cells, data, out):
        for c in range(cells.shape[0]):
            velocity = record_at(Velocity, data, c, 0)
            w = velocity.speed
            for b in range(nodes):
                row = cells[c, b]
                q0, q1, q2 = turned(w[0], w[1], w[2], v[row, 0], v[row, 1], v[row, 2])
                for a in range(nodes):
                    to, m = cells[c, a], 2.0 * velocity.mass[a, b]
                    f[to, 0] -= m * q0
                    f[to, 1] -= m * q1
                    f[to, 2] -= m * q2

    @kernel(STIFFNESS)
    def damping(t, x, v, blocks, cells, data, definite):
        for c in range(cells.shape[0]):
            velocity, blocks[c] = record_at(Velocity, data, c, 0), 0.0
            for a in range(nodes if not definite else 0):
                for b in range(nodes):
                    m = 2.0 * velocity.mass[a, b]
                    for i in range(3):
                        j, k = (i + 1) % 3, (i + 2) % 3
                        blocks[c, 3 * a + j, 3 * b + k] -= m * velocity.speed[i]
                        blocks[c, 3 * a + k, 3 * b + j] += m * velocity.speed[i]

    @kernel(BOUND)
    def damping_bound(reach, speed, x, mass, rates, cells, data):
        for c in range(cells.shape[0]):
            velocity = record_at(Velocity, data, c, 0)
            w = velocity.speed
            largest = math.sqrt(2.0 * (w[0] ** 2 + w[1] ** 2 + w[2] ** 2))  # of row sums of Ω ×
            for a in range(nodes):
                for b in range(nodes):
                    rates[cells[c, a]] += 2.0 * largest * abs(velocity.mass[a, b])

    return coriolis, damping, damping_bound


def force_terms(net, frame, pull, **arguments):
    """The terms of all rows of a net with mass; with consistent mass also those of the lines.

    ``frame`` is a `MovingFrame` with Ω [rad/s], ``pull`` is G [1/s²], shape (3, 3), and ``arguments`` are ``name`` and
    ``balance`` of the terms.
    """
    heavy = net.heavy
    turning = [body for body in net.bodies if body.spin is not None and not body.shape.planar]
    spins = np.array([body.spin for body in turning if body.turn is None], int)
    masses = np.concatenate([net.mass[heavy], 0.5 * net.mass[spins]])  # what has 2 m for masses, and I for spins
    terms = [
        _of_place(column(heavy), net.mass[heavy], net.points[heavy], pull, frame, arguments),
        _of_velocity(column(np.concatenate([heavy, spins])), masses, frame, arguments),
    ]
    if (coupled := net.consistent_minus_lumped) is not None:
        terms.append(_of_place(net.cells, coupled, net.points[net.cells], pull, frame, arguments))
        terms.append(_of_velocity(net.cells, coupled, frame, arguments))
    if any(body.turn is not None for body in turning):
        from . import turning_bodies

        terms += turning_bodies.force_terms(net, frame.angular_velocity, pull, arguments)
    for flow in net.flows:
        terms += flow.turning(net, frame, pull, arguments["name"])
    return terms


def _of_place(cells, mass, points, pull, frame, arguments):
    stiffest, data = max(-float(np.linalg.eigvalsh(pull)[0]), 0.0), np.zeros(len(cells), position_of(cells.shape[1]))
    data["pull"], data["stiffest"], data["points"] = pull, stiffest, np.reshape(points, data["points"].shape)
    data["mass"] = np.reshape(mass, data["mass"].shape)
    force, energy, stiffness, bound = kernels_of_place(cells.shape[1])
    return ForceTerm(
        cells=cells,
        data=matrix_of(data),
        force=force,
        energy=energy,
        tangent=Tangent(stiffness, bound if stiffest else None),  # what only lowers frequencies makes no step shorter
        frame=frame,
        **arguments,
    )


def _of_velocity(cells, mass, frame, arguments):
    data = np.zeros(len(cells), velocity_of(cells.shape[1]))
    data["speed"], data["mass"] = frame.angular_velocity, np.reshape(mass, data["mass"].shape)
    force, damping, damping_bound = kernels_of_velocity(cells.shape[1])
    return ForceTerm(
        cells=cells,
        data=matrix_of(data),
        force=force,
        tangent=Tangent(symmetric=False),
        velocity=VelocityForce(damping, damping_bound),
        timing=Timing(at_rest=False),
        frame=frame,
        **arguments,
    )
