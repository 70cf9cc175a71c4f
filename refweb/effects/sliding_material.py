"""Inertia of material that slides along lines to a drum, or from there, while a reel changes their natural length.

Material beyond an edge of two nodes, a and then b on the way to the drum, has the mass Q φ with the factor φ of the
reel. It passes the edge at the rate q = −Q φ', and has the momentum q (r_b − r_a) beside that of the nodes, and the
angular momentum q r_a × r_b. Each of both nodes gets half of what that changes by, and of what nodes of other
velocities give each other:

    f = q (v_a − v_b) − ½ q' (r_b − r_a).

In axes that rotate with Ω, velocities are those plus Ω × r. With m v' = f beside other forces, and material that leaves
each node with the node's velocity, momentum and angular momentum are those of the net but for the material that leaves
through the drum, with the velocity of the drum: for any places, velocities and number of elements. q' is an impulse
where the rate of a reel jumps, see `impulse`. The push of material that comes to rest at the drum, of the size
ρA (φ' L)², is in the sum of these forces, and acts along the line. A chain of 200 beads that a drum takes one after the
other, as heavy as the masses at both ends, comes to the same places as 64 elements, to 2e-4 of its length where it does
not turn and to 0.012 of it after five turns.

Where lines close loops, material goes the ways of least ∑ q² L: by halves around a ring.

Where q jumps at a corner of the table, the force at the corner is that ahead of it; at `BEHIND` times that time it is
the other, and at 0 as well.

May change: how fluxes are found. Must stay: the fields of `EDGE`, behind which, at `TABLE`, the table of the factor
stands; `BEHIND` is more than the width that `rate_of` looks back by; `impulse`, which steps and `MaterialFlow` call;
`force`, by which `MaterialFlow` knows the terms. Must follow: masses that change, in `mass_flow` and
`system.material_flow`. Tests: ``tests/effects/test_reel_mass.py``.
"""

from __future__ import annotations

import numpy as np

from ..compiled.rows import matrix_of, record_at, width_of
from ..errors import InputError, refused_at
from ..kernels import BOUND, FORCE, STIFFNESS, kernel
from .base import Balance, ForceTerm, Tangent, Timing, VelocityForce
from .time_tables import flattened, interpolate
from .vectors import cross

EDGE = np.dtype([("mass", float), ("largest", float), ("apart", float, (3,)), ("speed", float, (3,))])
"""Q [kg], the largest |Q φ'| [kg/s], a − b in the web as built [m], and Ω [rad/s]; then the table of φ."""
TABLE = width_of(EDGE)
SAME, BEHIND, LEAST = 1e-12, 1.0 + 4e-12, 1e-300
"""Share of a time within which it is that of a corner, that time over it which is behind the corner, and a time from 0
within which it is 0 [s]."""


@kernel()
def rate_of(t, data, c):
    """q of an edge [kg/s], that ahead of a corner."""
    return -record_at(EDGE, data, c, 0).mass * interpolate(t * (1.0 - SAME), data[c], TABLE, 2, 1)[1]


@kernel(FORCE)
def force(t, x, v, f, cells, data, out):
    for c in range(cells.shape[0]):
        q, edge, a, b = rate_of(t, data, c), record_at(EDGE, data, c, 0), cells[c, 0], cells[c, 1]
        apart, speed = edge.apart, edge.speed
        along = (apart[0] + x[a, 0] - x[b, 0], apart[1] + x[a, 1] - x[b, 1], apart[2] + x[a, 2] - x[b, 2])
        turned = cross((speed[0], speed[1], speed[2]), along)
        out[c, 0] = 0.0
        for i in range(3):
            push = q * (v[a, i] - v[b, i] + turned[i])
            f[a, i] += push
            f[b, i] += push
            out[c, 0] += push * (v[a, i] + v[b, i])


@kernel()
def fill(q, w, block):
    """Write q times (1, −1), and w × q beside that, to both rows of a block."""
    for side in range(2):
        sign = 2.0 * side - 1.0
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            for row in range(0, 6, 3):
                block[row + i, 3 * side + i] = sign * q
                block[row + k, 3 * side + j] = sign * w[i]
                block[row + j, 3 * side + k] = -sign * w[i]


@kernel(STIFFNESS)
def stiffness(t, x, v, blocks, cells, data, definite):
    for c in range(cells.shape[0]):
        q, w = 0.0 if definite else rate_of(t, data, c), record_at(EDGE, data, c, 0).speed
        fill(0.0, (q * w[0], q * w[1], q * w[2]), blocks[c])


@kernel(STIFFNESS)
def damping(t, x, v, blocks, cells, data, definite):
    for c in range(cells.shape[0]):
        fill(0.0 if definite else rate_of(t, data, c), (0.0, 0.0, 0.0), blocks[c])


@kernel(BOUND)
def bound(reach, speed, x, mass, rates, cells, data):
    for c in range(cells.shape[0]):
        edge = record_at(EDGE, data, c, 0)
        for end in range(2):
            rates[cells[c, end]] += 2.0 * edge.largest * (abs(edge.speed[0]) + abs(edge.speed[1]) + abs(edge.speed[2]))


@kernel(BOUND)
def damping_bound(reach, speed, x, mass, rates, cells, data):
    for c in range(cells.shape[0]):
        for end in range(2):
            rates[cells[c, end]] += 2.0 * record_at(EDGE, data, c, 0).largest


def force_terms(system):
    """The `ForceTerm` of each reel whose mass follows, in the order of `Net.flows`; none in statics.

    Raises
    ------
    InputError
        For connected lines without a node that is that of a drum, or with several.
    """
    net, terms = system.net, []
    frames = [term.frame.angular_velocity for term in system.rotating]
    for flow in net.flows:
        if flow.wound:
            continue
        with refused_at("[[reel]]"):
            edges, mass = _edges(net, flow, _drums(system, flow))
        data, times = np.zeros(len(edges), EDGE), np.transpose(flow.table)
        steepest = np.abs(np.diff(times[1]) / np.diff(times[0])).max(initial=0.0)
        data["mass"], data["largest"] = mass, np.abs(mass) * steepest
        data["apart"] = net.points[edges[:, 0]] - net.points[edges[:, 1]]
        data["speed"] = frames[0] if frames else 0.0
        numbers = np.hstack([matrix_of(data), np.tile(flattened(flow.table), (len(edges), 1))])
        turning = Tangent(stiffness if frames else None, bound if frames else None, symmetric=False)
        terms.append(
            ForceTerm(
                name="reel",
                cells=edges.astype(np.int32),
                data=numbers,
                force=force,
                tangent=turning,
                velocity=VelocityForce(damping, damping_bound),
                timing=Timing(tuple(times[0]), at_rest=False),
                balance=Balance("work", power=0),
            )
        )
    return [] if net.quasi_static else terms


def _drums(system, flow):
    """Node of the drum of each row of a flow, shape (rows,)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    net, cells = system.net, system.net.cells[flow.elements]
    pairs = np.repeat(cells[:, :1], cells.shape[1] - 1, axis=1).ravel(), cells[:, 1:].ravel()
    graph = coo_array((np.ones(len(pairs[0])), pairs), shape=(len(net.points), len(net.points)))
    part = connected_components(graph, directed=False)[1][flow.rows]
    given = flow.rows[system.supported[flow.rows].all(axis=1)] if flow.drums is None else flow.drums
    for node in given[~np.isin(given, flow.rows)][:1]:
        raise InputError(f"drum = {node} is no end of the lines of this reel: name a node of theirs")
    drums = np.empty(len(flow.rows), dtype=int)
    for number in np.unique(part):
        inside = part == number
        nodes = flow.rows[inside][np.isin(flow.rows[inside], given)]
        if len(nodes) != 1:
            lines = np.unique(net.line[flow.elements][np.isin(cells[:, 0], flow.rows[inside])])
            count = "no node" if not len(nodes) else f"{len(nodes)} nodes ({', '.join(map(str, nodes[:3]))})"
            why = "that is supported, moved or on a body" if flow.drums is None else "of drum"
            raise InputError(
                f'mass = "follows": {count} of line {lines[0]} and those that it is connected to by this reel {why}: '
                "name one node at the drum, drum = ..., for each part of the lines"
            )
        drums[inside] = nodes[0]
    return drums


def _edges(net, flow, drums):
    """(Nodes of the edges of a flow, shape (edges, 2), Q of each [kg])."""
    from scipy.sparse import coo_array
    from scipy.sparse.linalg import spsolve

    cells = net.cells[flow.elements][:, net.along]
    edges = np.stack([cells[:, :-1], cells[:, 1:]], axis=2).reshape(-1, 2)
    share = 1.0 / np.repeat(net.natural_length[flow.elements], cells.shape[1] - 1)
    a, b = np.searchsorted(flow.rows, edges).T
    n, free = len(flow.rows), np.flatnonzero(flow.rows != drums)
    entries = np.concatenate([share, share, -share, -share])
    ways = coo_array((entries, (np.concatenate([a, b, a, b]), np.concatenate([a, b, b, a]))), shape=(n, n)).tocsc()
    height = np.zeros(n)
    if len(free):
        height[free] = spsolve(ways[free][:, free], np.where(flow.off_bodies(net), flow.mass, 0.0)[free])
    return edges, share * (height[a] - height[b])


@kernel()
def jump_of(t, data, c):
    """Jump of q of an edge [kg/s] at time t, where 0 is a corner of a table that begins there; 0 between corners."""
    near = max(abs(t) * SAME, LEAST)
    ahead, later = interpolate(t - near, data[c], TABLE, 2, 1)[1], interpolate(t + near, data[c], TABLE, 2, 1)[1]
    return record_at(EDGE, data, c, 0).mass * (ahead - later)


@kernel(FORCE)
def impulse(t, x, v, f, cells, data, out):
    """Add −½ Δq (r_b − r_a) at time t to both nodes of each edge [N s]."""
    for c in range(cells.shape[0]):
        jump, apart = jump_of(t, data, c), record_at(EDGE, data, c, 0).apart
        for i in range(3):
            half = 0.5 * jump * (apart[i] + x[cells[c, 0], i] - x[cells[c, 1], i])
            for end in range(2):
                f[cells[c, end], i] += half
