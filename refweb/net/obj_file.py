"""Reading of OBJ files: points, lines and faces.

A corner of a face has numbers for position, texture and normal, ``f 1/4/2 ...``; only the first is used. A negative
number counts backwards from the last point above it.

May change: private functions, texts of errors, and `NO_GROUP`, names that count as no group. Must stay: the five parts
of `read_obj` (points, lines, faces, groups of both) in this order, which `mesh_readers` and `boundary.surface_file`
unpack. Tests: ``tests/net/test_faces.py``, ``tests/net/test_boundary.py``.
"""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from ..messages import quote

SIDES = {"l": (2, "a line needs two points"), "f": (3, "a face needs three points")}
"""Least number of corners of each kind of element, and the message for fewer."""
NO_GROUP = ("off", "default", "all")
"""Names that programs write for elements without a group."""


def read_obj(path):
    """Read (positions, shape (n, 3), lines, faces, group of each line, group of each face) of an OBJ file.

    Lines and faces are lists of points, from 0. A group is that of the last row ``g NAME``, "" for none. A file that is
    no text, a point without three numbers, and an element with unknown points are refused.
    """
    points, group = [], ""
    cells, names = {kind: [] for kind in SIDES}, {kind: [] for kind in SIDES}
    try:
        text = path.read_text(encoding="utf-8-sig", errors="strict")
    except UnicodeDecodeError:
        text = path.read_bytes().decode("latin-1")
    for number, row in enumerate(text.replace("\\\r\n", " ").replace("\\\n", " ").splitlines(), 1):
        words = row.partition("#")[0].split()
        if not words:
            continue
        if words[0] == "v":
            points.append(_point(path, number, words))
        elif words[0] in cells:
            cells[words[0]].append(_corners(path, number, words, len(points)))
            names[words[0]].append(group)
        elif words[0] == "g":
            group = next((word for word in words[1:] if word not in NO_GROUP), "")
    if not points:
        raise InputError(f"{path.name} has no points: is it an OBJ file, with rows v x y z?")
    for corners in (*cells["l"], *cells["f"]):
        if max(corners) >= len(points):
            raise InputError(f"{path.name} has an element of point {max(corners) + 1}, must be 1 … {len(points)}")
    return np.array(points), cells["l"], cells["f"], names["l"], names["f"]


def _point(path, number, words):
    try:
        x, y, z = (float(word) for word in words[1:4])
    except ValueError:
        raise InputError(f"{path.name}, line {number}: {quote(' '.join(words))} must be v and three numbers") from None
    return x, y, z


def _corners(path, number, words, count):
    """Points of an element, from 0; ``count`` is the number of points above it."""
    try:
        given = [int(word.partition("/")[0]) for word in words[1:]]
    except ValueError:
        given = [0]
    if 0 in given or min(given, default=1) < -count:
        name = quote(" ".join(words))
        raise InputError(f"{path.name}, line {number}: {name} must name points from 1, or from -1 backwards")
    limit, reason = SIDES[words[0]]
    if len(given) < limit:
        raise InputError(f"{path.name}, line {number}: {quote(' '.join(words))}: {reason}")
    return [corner - 1 if corner > 0 else count + corner for corner in given]
