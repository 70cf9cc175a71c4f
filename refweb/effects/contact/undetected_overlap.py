"""Undetected overlap: findings on bodies in each other without contact between them.

The overlap is checked once for every block of rows, for all shapes but rings, which have no ends along their normal. If
the spheres around two bodies meet, points of the skeleton of each are compared with the depth in the other. This costs
very little, and it may miss a short overlap.

May change: private functions, `PLACES`, `LEAST` and `MOST`, which decide when a finding comes, and not results. Must
stay: the choice and order of the pairs of `Silent`, since checkpoints keep a pair by its number, and the three columns
of `kept`, which `restore` reads; `silent_of`, `inspect`, `kept`, `restore` and `remarks`, which `dynamics.simulation`
calls. Tests: ``tests/effects/test_between_bodies.py``.
"""

from __future__ import annotations

import itertools

import numpy as np

from ...errors import InputError
from ...findings import Finding
from ...net.skeleton import ARC, POINT

PLACES = 9
"""Number of places that are looked at on each part."""
LEAST = 1e-6
"""Overlap that is told, over the size of the smaller body."""
MOST = 3
"""Largest number of pairs that are named."""


def silent_of(system):
    """The `Silent` of a system whose bodies may meet and do not touch each other, None where they cannot."""
    bodies = [body for body in system.net.bodies if not body.shape.planar]
    if len(bodies) < 2 or all(body.prescribed for body in bodies) or any(term.contact.pairs for term in system.terms):
        return None
    return Silent(system.net, bodies)


class Silent:
    """Pairs of bodies that have been in each other.

    Parameters
    ----------
    net : refweb.net.net.Net
        With the bodies.
    bodies : list of refweb.net.rigid_body.RigidBody
        Those that are looked at.
    """

    def __init__(self, net, bodies):
        self._net, self._overlaps = net, {}
        pairs = [(a, b) for a, b in itertools.combinations(bodies, 2) if not (a.prescribed and b.prescribed)]
        self._pairs = pairs
        self._rows = np.array([(a.row, b.row) for a, b in pairs])
        self._reach = np.array([a.extent + b.extent for a, b in pairs])

    def inspect(self, time, x):
        """Note which bodies are in each other at displacements x, shape (rows, 3)."""
        places = self._net.points + x
        away = np.linalg.norm(places[self._rows[:, 0]] - places[self._rows[:, 1]], axis=1)
        for n in np.flatnonzero(away < self._reach).tolist():
            a, b = self._pairs[n]
            if n not in self._overlaps:
                deep = max(_depth(a, b, places, x), _depth(b, a, places, x))
                if deep > LEAST * min(a.thickness, b.thickness):
                    self._overlaps[n] = deep, time

    def kept(self):
        """Known overlaps, shape (pairs, 3): number of a pair, depth [m] and time [s]."""
        return np.array([(n, *values) for n, values in self._overlaps.items()]).reshape(-1, 3)

    def restore(self, kept):
        """Go on with what was known."""
        self._overlaps = {int(n): (float(deep), float(time)) for n, deep, time in kept}

    def remarks(self):
        """Remarks for a reader of the results."""
        for n, (deep, time) in itertools.islice(self._overlaps.items(), MOST):
            a, b = self._pairs[n]
            yield Finding(
                "undetected-overlap",
                f'bodies "{a.name}" and "{b.name}" are {deep:.3g} m deep in each other at t = {time:.6g} s and do not '
                "feel it: between_bodies = true in [contact] lets bodies touch",
                "body",
            )
        if (more := len(self._overlaps) - MOST) > 0:
            yield Finding("undetected-overlap", f"{more} more pairs of bodies are in each other", "body")


def _depth(body, body_b, places, x):
    """Depth of the skeleton of a body in another one [m]."""
    try:
        parts = body.shape.skeleton()
    except InputError:  # a surface of more edges than can be looked at
        return 0.0
    if parts is None or not len(parts):
        return 0.0
    axes, its = (item.axes @ item.rotation(x).T for item in (body, body_b))
    points_in_b = (_along(parts) + body.offset) @ axes + places[body.row] - places[body_b.row]
    points_in_b = points_in_b @ its.T - body_b.offset
    depth, deepest = body_b.shape.depth(), 0.0
    grown = body_b.shape.touched(float(parts["thickness"].max()))
    for point, thickness in zip(points_in_b, np.repeat(parts["thickness"], PLACES), strict=True):
        thick = grown._replace(radius=float(grown.radius + thickness))
        deepest = max(deepest, depth(tuple(point.tolist()), thick)[0])
    return deepest


def _along(parts):
    """Places on parts of a skeleton, shape (parts × `PLACES`, 3)."""
    points = np.empty((len(parts), PLACES, 3))
    for n, part in enumerate(parts):
        share = np.linspace(0.0, 1.0, PLACES)[:, None]
        if part["kind"] == ARC:
            begin, end = part["owns"]
            angle = begin + share * (end - begin)
            points[n] = part["start"] + np.cos(angle) * part["end"] + np.sin(angle) * part["third"]
        else:
            end = part["start"] if part["kind"] == POINT else part["end"]
            points[n] = (1.0 - share) * part["start"] + share * end
    return points.reshape(-1, 3)
