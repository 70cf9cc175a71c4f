"""Folded positions of a web, drawn in and wound about a hub, and the check of taut lines and distances.

A node at the distance r from the axis through the hub goes to s r and is turned about the axis by ω(r) = 2π n r/R, with
R the largest r. With κ = r ω' ≤ 2π n, no distance grows by more than

    σ = s (√(1 + κ²/4) + κ/2),        so that σ = σ₀ for        κ = σ₀/s − s/σ₀,

the larger singular value of s [[1, 0], [κ, 1]]; along the axis it is s. Where natural lengths are at least σ times the
distance, all lines are slack.

May change: `CHUNK`, which decides memory alone. Must stay: `turns_of` and `wound` together with σ, since `effects.fold`
relies on slack lines; `refuse_unfit`, which it calls. `SLACKEST` changes the default number of turns. Tests:
``tests/effects/test_fold.py``.
"""

from __future__ import annotations

import math

import numpy as np

from ..errors import InputError

SLACKEST = 0.9
"""Largest distance of the ends of a line over its natural length, if the turns are not given."""
CHUNK = 1_000_000
"""Number of pairs of lines that are processed together."""


def turns_of(ratio, tightest):
    """Number of turns n for which σ is `SLACKEST` times ``tightest``, the least natural length over distance; or 0."""
    limit = SLACKEST * tightest
    return max(limit / ratio - ratio / limit, 0.0) / (2.0 * math.pi)


def wound(points, hub, axis, ratio, turns):
    """Positions of points, drawn in to ``ratio`` and wound ``turns`` times about an axis through a hub."""
    along = np.array(axis) / np.linalg.norm(axis)
    away = points - hub
    height = away @ along
    flat = away - height[:, None] * along
    r = np.linalg.norm(flat, axis=1)
    angle = 2.0 * np.pi * turns * r / (r.max() or 1.0)
    turned = np.cos(angle)[:, None] * flat + np.sin(angle)[:, None] * np.cross(along, flat)
    return hub + ratio * (turned + height[:, None] * along)


def distances(starts, ends, pairs):
    """Least distance of the segments of each pair, shape (pairs,).

    The minimum of |a + s u − t v|² over the unit square of s and t is at its stationary point if that is inside.
    Otherwise it is on one of the four edges, and is the distance of an end from a segment.
    """
    (i, j), tiny = pairs.T, np.finfo(float).tiny
    u, v, a = ends[i] - starts[i], ends[j] - starts[j], starts[i] - starts[j]
    uu, vv, uv = (u * u).sum(axis=1), (v * v).sum(axis=1), (u * v).sum(axis=1)
    ua, va = (u * a).sum(axis=1), (v * a).sum(axis=1)
    square = np.full(len(pairs), np.inf)

    def compare(s, t):
        apart = a + s[:, None] * u - t[:, None] * v
        np.minimum(square, (apart * apart).sum(axis=1), out=square)

    for end in (0.0, 1.0):
        s = np.full(len(pairs), end)
        compare(s, np.clip((va + s * uv) / np.maximum(vv, tiny), 0.0, 1.0))
        compare(np.clip((s * uv - ua) / np.maximum(uu, tiny), 0.0, 1.0), s)
    deep = uu * vv - uv * uv
    s, t = ((first / np.maximum(deep, tiny)) for first in (uv * va - vv * ua, uu * va - uv * ua))
    inside = (deep > 1e-14 * uu * vv) & (s > 0.0) & (s < 1.0) & (t > 0.0) & (t < 1.0)
    compare(np.where(inside, s, 0.0), np.where(inside, t, np.clip(va / np.maximum(vv, tiny), 0.0, 1.0)))
    return np.sqrt(square)


def nearest_lines(points, lines, gap):
    """Distance and numbers of the two lines nearest to each other that share no node.

    Only lines that may be closer than ``gap`` are compared; the distance is infinite if there are none.
    """
    from scipy.spatial import cKDTree

    starts, ends = points[lines[:, 0]], points[lines[:, 1]]
    half = 0.5 * np.linalg.norm(ends - starts, axis=1).max()
    close = cKDTree(0.5 * (starts + ends)).query_pairs(2.0 * half + gap, output_type="ndarray")
    apart = (lines[close[:, 0]][:, :, None] != lines[close[:, 1]][:, None, :]).all(axis=(1, 2))
    pairs, best = close[apart], (math.inf, -1, -1)
    for first in range(0, len(pairs), CHUNK):
        some = pairs[first : first + CHUNK]
        apart = distances(starts, ends, some)
        at = int(apart.argmin())
        best = min(best, (float(apart[at]), *some[at].tolist()))
    return best


def refuse_unfit(points, lines, length, gap):
    """Refuse positions with a taut line, a line without length, or two lines without common node within a gap.

    ``points (nodes, 3)`` and ``gap`` are in m, ``lines (lines, 2)`` are nodes, and ``length (lines,)`` is natural [m].
    """
    size = np.linalg.norm(points[lines[:, 1]] - points[lines[:, 0]], axis=1)
    share = size / length
    tightest = int(share.argmax())
    if share[tightest] >= 1.0:
        raise InputError(
            f"line {tightest} would be taut: its ends are {size[tightest]:.6g} m apart, must be below its natural "
            f"length of {length[tightest]:.6g} m; draw the web in further, or wind it less"
        )
    for line in np.flatnonzero(size == 0.0)[:1]:
        raise InputError(f"line {line} would have no length: its nodes {lines[line].tolist()} are at one place")
    near, first, second = nearest_lines(points, lines, gap)
    if near < gap:
        raise InputError(
            f"lines {first} and {second} would be {near:.3g} m apart, must be ≥ gap = {gap:.3g} [m]: fold the web "
            "less, or give a smaller gap"
        )
