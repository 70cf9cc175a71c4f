"""Forces in rotating axes on the mass that reels add to that of a line as built.

They are those of `refweb.effects.turning_axes` for a mass m (φ(t) − 1) at each node, with the factor φ of the reel. The
force m (φ − 1) G r does work, since its potential changes with time; that of Coriolis does none.

May change: how the kernels are written. Must stay: the fields of `FLOW`, behind which, at `TABLE`, the table of the
factor stands; both forces, which are those of `turning_axes` and change with them; `force_terms`, which `mass_flow`
calls. Tests: ``tests/effects/test_reel_mass.py``.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..compiled.rows import matrix_of, record_at, width_of
from ..kernels import BOUND, ENERGY, FORCE, STIFFNESS, kernel
from .base import Balance, ForceTerm, Tangent, Timing, VelocityForce, column
from .time_tables import flattened, interpolate
from .vectors import cross

FLOW = np.dtype(
    [("pull", float, (3, 3)), ("speed", float, (3,)), ("mass", float), ("largest", float), ("point", float, (3,))]
)
"""G, Ω, the mass m and its largest change [kg], and the position of the node in the web; then the table of φ − 1."""
TABLE = width_of(FLOW)


@kernel()
def added_mass(t, data, c):
    """m (φ − 1) of a cell [kg]."""
    return record_at(FLOW, data, c, 0).mass * interpolate(t, data[c], TABLE, 2, 1)[0]


@kernel()
def pulled(x, cells, data, c):
    """G r of a cell [m/s²]."""
    flow, row = record_at(FLOW, data, c, 0), cells[c, 0]
    p, a = flow.pull, flow.point
    r0, r1, r2 = a[0] + x[row, 0], a[1] + x[row, 1], a[2] + x[row, 2]
    return (
        p[0, 0] * r0 + p[0, 1] * r1 + p[0, 2] * r2,
        p[1, 0] * r0 + p[1, 1] * r1 + p[1, 2] * r2,
        p[2, 0] * r0 + p[2, 1] * r1 + p[2, 2] * r2,
    )


@kernel(FORCE)
def force(t, x, v, f, cells, data, out):
    for c in range(cells.shape[0]):
        m, g, row = added_mass(t, data, c), pulled(x, cells, data, c), cells[c, 0]
        out[c, 0] = m * (g[0] * v[row, 0] + g[1] * v[row, 1] + g[2] * v[row, 2])
        for i in range(3):
            f[row, i] += m * g[i]


@kernel(ENERGY)
def energy(t, x, cells, data, out):
    for c in range(cells.shape[0]):
        row, a, p = cells[c, 0], record_at(FLOW, data, c, 0).point, record_at(FLOW, data, c, 0).pull
        out[c] = 0.0
        for i in range(3):
            for j in range(3):
                out[c] -= 0.5 * added_mass(t, data, c) * x[row, i] * p[i, j] * (2.0 * a[j] + x[row, j])


@kernel(STIFFNESS)
def stiffness(t, x, v, blocks, cells, data, definite):
    for c in range(cells.shape[0]):
        m = 0.0 if definite else added_mass(t, data, c)
        for i in range(3):
            for j in range(3):
                blocks[c, i, j] = -m * record_at(FLOW, data, c, 0).pull[i, j]


@kernel(BOUND)
def bound(reach, speed, x, mass, rates, cells, data):
    for c in range(cells.shape[0]):
        flow = record_at(FLOW, data, c, 0)
        for i in range(3):
            for j in range(3):
                rates[cells[c, 0]] += flow.largest * abs(flow.pull[i, j])


@kernel(FORCE)
def coriolis(t, x, v, f, cells, data, out):
    for c in range(cells.shape[0]):
        m, w, row = 2.0 * added_mass(t, data, c), record_at(FLOW, data, c, 0).speed, cells[c, 0]
        q = cross((w[0], w[1], w[2]), (v[row, 0], v[row, 1], v[row, 2]))
        for i in range(3):
            f[row, i] -= m * q[i]


@kernel(STIFFNESS)
def damping(t, x, v, blocks, cells, data, definite):
    for c in range(cells.shape[0]):
        m, w = 0.0 if definite else 2.0 * added_mass(t, data, c), record_at(FLOW, data, c, 0).speed
        blocks[c] = 0.0
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            blocks[c, j, k] -= m * w[i]
            blocks[c, k, j] += m * w[i]


@kernel(BOUND)
def damping_bound(reach, speed, x, mass, rates, cells, data):
    for c in range(cells.shape[0]):
        flow = record_at(FLOW, data, c, 0)
        w = flow.speed
        rates[cells[c, 0]] += 2.0 * flow.largest * math.sqrt(2.0 * (w[0] ** 2 + w[1] ** 2 + w[2] ** 2))


def force_terms(net, flow, frame, pull, name):
    """The two terms of a flow of a net, see `refweb.effects.turning_axes.force_terms`."""
    moves = flow.off_bodies(net)
    rows, data = flow.rows[moves], np.zeros(np.count_nonzero(moves), FLOW)
    added = [(t, factor - 1.0) for t, factor in flow.table]
    data["pull"], data["speed"], data["mass"] = pull, frame.angular_velocity, flow.mass[moves]
    data["largest"] = flow.mass[moves] * max(abs(change) for _, change in added)
    data["point"] = net.points[rows]
    numbers = np.hstack([matrix_of(data), np.tile(flattened(added), (len(rows), 1))])
    shared: dict[str, Any] = dict(name=name, cells=column(rows), data=numbers, frame=frame)
    times = tuple(t for t, _ in added)
    return [
        ForceTerm(
            force=force, energy=energy, tangent=Tangent(stiffness, bound), timing=Timing(times),
            balance=Balance("work", power=0), **shared,
        ),
        ForceTerm(
            force=coriolis, tangent=Tangent(symmetric=False), velocity=VelocityForce(damping, damping_bound),
            timing=Timing(times, at_rest=False), balance=Balance("work"), **shared,
        ),
    ]  # fmt: skip
