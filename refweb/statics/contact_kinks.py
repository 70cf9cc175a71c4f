"""Lines that a sphere touches with two elements alike, where no forces balance.

Contact with a sphere acts once a line, at the line's point nearest the centre. Where a line of several elements bends
around the sphere, two of them may be as near: the energy ½ k (R − d)² of the nearer one has a kink there, which draws
an equilibrium into it.

`equilibrium` puts the text of `kink_remark` into a message; both limits are free.
"""

from __future__ import annotations

import numpy as np

ALIKE = 1e-2
"""Largest difference of two depths, over the larger one, that counts as none: iterations go to and fro about a kink."""
APART = 1e-2
"""Least distance of the two points, over the radius, that are not the node between two elements."""


def kink_remark(system, x):
    """Text that names a line with such a contact at displacement x, and the remedy; None where there is none."""
    net = system.net
    if net.order > 1 or net.subdivide == 1:
        return None
    for term in system.terms:
        if not term.contact.with_lines or term.energy is None:
            continue
        rows = term.cells[:, term.contact.felt[0]]
        for body in net.bodies:
            if body.shape.once and (line := _kinked(net, x, body)) is not None and (rows == body.row).any():
                return (
                    f'body "{body.name}" touches line {line} with two elements alike, and contact with a sphere acts '
                    "once a line: no forces balance there; give it a shape that every element touches, shape = "
                    f'"capsule", axis = [0, 0, 1], length = {1e-3 * body.radius:.2g}'
                )
    return None


def _kinked(net, x, body):
    """The first line with two elements in a sphere that are as deep; None where there is none."""
    positions = net.points + x
    start, end = (positions[net.cells[:, side]] - positions[body.row] for side in (0, 1))
    along = end - start
    share = np.clip(-(start * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-300), 0.0, 1.0)
    nearest = start + share[:, None] * along
    depth = body.radius - np.linalg.norm(nearest, axis=1)
    for line in np.unique(net.line[depth > 0.0]):
        elements = np.flatnonzero(net.line == line)
        deepest = elements[depth[elements].argmax()]
        others = elements[np.linalg.norm(nearest[elements] - nearest[deepest], axis=1) > APART * body.radius]
        if len(others) and depth[others].max() > (1.0 - ALIKE) * depth[deepest]:
            return int(line)
    return None
