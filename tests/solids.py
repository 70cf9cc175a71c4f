"""Surfaces of solids as (corners, triangles), outward, and files of them."""

import itertools

import numpy as np


def box(size, parts=1):
    """A box about the origin, each edge in some parts."""
    points, triangles = [], []
    t = np.linspace(-0.5, 0.5, parts + 1)
    for axis, side in itertools.product(range(3), (-0.5, 0.5)):
        u, v = (np.eye(3)[(axis + k) % 3] for k in (1, 2))
        first = len(points)
        points += [side * np.eye(3)[axis] + a * u + b * v for a in t for b in t]
        for i, j in itertools.product(range(parts), repeat=2):
            a, b, c, d = (first + (i + k) * (parts + 1) + j + m for k, m in ((0, 0), (1, 0), (1, 1), (0, 1)))
            own = [[a, b, c], [a, c, d]]
            triangles += own if side > 0 else [face[::-1] for face in own]
    return np.array(points) * size, np.array(triangles)


def tetrahedron(edge=0.3):
    corners = edge * np.vstack([np.zeros(3), np.eye(3)])
    return corners, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def grid(rows, around, columns):
    """Triangles between rows of places that are closed around; ``columns`` is whether rows are closed as well."""
    here = np.arange(rows * around).reshape(rows, around)
    after, up = np.roll(here, -1, axis=1), np.roll(here, -1, axis=0)
    beyond = np.roll(up, -1, axis=1)
    last = rows if columns else rows - 1
    one, other = np.stack([here, after, beyond], axis=-1), np.stack([here, beyond, up], axis=-1)
    return np.concatenate([one[:last].reshape(-1, 3), other[:last].reshape(-1, 3)])


def sphere(radius, level, axes=(1.0, 1.0, 1.0)):
    """A sphere, or an ellipsoid; ``level`` rows."""
    polar, around = np.linspace(0.0, np.pi, level + 1)[1:-1], np.linspace(0.0, 2.0 * np.pi, 2 * level, endpoint=False)
    rings = np.stack([np.outer(np.sin(polar), f(around)) for f in (np.cos, np.sin)], axis=-1)
    rings = np.concatenate([rings, np.repeat(np.cos(polar)[:, None, None], 2 * level, axis=1)], axis=-1)
    points = np.vstack([rings.reshape(-1, 3), [[0, 0, 1], [0, 0, -1]]])
    top, count = len(points) - 2, 2 * level
    here, after = np.arange(count), np.roll(np.arange(count), -1)
    low = (level - 2) * count
    caps = [
        np.column_stack([0 * here + top, here, after]),
        np.column_stack([0 * here + top + 1, low + after, low + here]),
    ]
    return radius * points * axes, np.vstack([*caps, grid(level - 1, count, False)[:, ::-1]])


def torus(ring, tube, level):
    a, b = (np.linspace(0.0, 2.0 * np.pi, n, endpoint=False) for n in (2 * level, level))
    out = ring + tube * np.cos(b)
    points = np.stack(
        [np.outer(np.cos(a), out), np.outer(np.sin(a), out), tube * np.outer(0 * a + 1, np.sin(b))], axis=-1
    )
    return points.reshape(-1, 3), grid(2 * level, level, True)[:, ::-1]


def ell(long=0.3, wide=0.12, thick=0.2):
    """An angle: two legs at right angles."""
    outline = np.array([[0, 0], [long, 0], [long, wide], [wide, wide], [wide, long], [0, long]])
    bottom, top = (np.column_stack([outline, np.full(6, z)]) for z in (-0.5 * thick, 0.5 * thick))
    lid = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])
    sides = [[i, (i + 1) % 6, 6 + (i + 1) % 6] for i in range(6)] + [[i, 6 + (i + 1) % 6, 6 + i] for i in range(6)]
    return np.vstack([bottom, top]), np.vstack([lid[:, ::-1], 6 + lid, sides])


def write(path, points, triangles):
    """A file of a surface, STL as text or OBJ."""
    if path.suffix == ".obj":
        lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(points, float).tolist()]
        lines += ["f " + " ".join(str(i + 1) for i in face) for face in np.asarray(triangles).tolist()]
    else:
        lines = ["solid it"]
        for face in np.asarray(points, float)[np.asarray(triangles)].tolist():
            lines += ["facet normal 0 0 0", "outer loop"]
            lines += [f"vertex {x!r} {y!r} {z!r}" for x, y, z in face] + ["endloop", "endfacet"]
        lines.append("endsolid it")
    path.write_text("\n".join(lines) + "\n")
    return str(path)
