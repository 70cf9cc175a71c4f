"""OBJ files: corners from their ``v`` rows and faces from their ``f`` rows.

Other rows (textures, normals, groups, materials, lines, comments) say nothing of the shape of a solid and are skipped.
A corner of a face is ``v``, ``v/vt``, ``v//vn`` or ``v/vt/vn``, of which the first number counts; it counts from 1, or
backwards from the last ``v`` row above where it is negative.
"""

from __future__ import annotations

import itertools

import numpy as np

from ...errors import InputError
from ...messages import quote


def faces_of(path):
    """(points (n, 3), list of faces, an array (faces, corners) for each sequence of faces with as many corners)."""
    text = path.read_text(encoding="utf-8-sig", errors="replace").replace("\\\r\n", " ").replace("\\\n", " ")
    points, faces = [], []
    for number, row in enumerate(text.splitlines(), 1):
        kind, *words = row.split("#", 1)[0].split() or [""]
        if kind not in ("v", "f"):
            continue
        try:
            if kind == "v":
                x, y, z = words[:3]
                points.append((float(x), float(y), float(z)))
            else:
                faces.append([_corner(word, len(points)) for word in words])
        except ValueError:
            need = "3 numbers" if kind == "v" else "whole numbers, v, v/vt, v//vn or v/vt/vn"
            raise InputError(f"{path.name}, line {number}: {quote(row.strip()[:60])} must have {need}") from None
    faces = [face for face in faces if len(face) > 2]
    cells = [np.array(list(group), dtype=np.int64) for _, group in itertools.groupby(faces, len)]
    return np.array(points, dtype=float).reshape(-1, 3), cells


def _corner(word, count):
    """Number of a corner, counted from 0; −1 for one that there is not."""
    number = int(word.split("/", 1)[0])
    return number - 1 if number > 0 else max(number + count, -1) if number < 0 else -1
