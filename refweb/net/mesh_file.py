"""Webs from files of meshes, as meshio reads them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .. import memory
from ..errors import InputError
from ..messages import shown
from ..tables import Table, choice, table, text
from .web import Web

FORMATS = {".vtu": "vtu", ".vtk": "vtk", ".msh": "gmsh"}
"""Formats of meshes by the end of their name, as meshio calls them."""


@table
class File(Table):
    """A web from a VTK (.vtu, .vtk) or Gmsh (.msh) file that has line cells and no others.

    Cell data ``natural_length`` [m] and ``group`` (numbers or texts) and point data ``support`` (not 0: fixed) are
    taken where present; other data is left alone.

    Parameters
    ----------
    path : str
        The file, relative to the scene's folder.

    Raises
    ------
    InputError
        From ``web``, if the file cannot be read or is not a web.

    Notes
    -----
    meshio reads the file. Of other formats that it knows some refer to files of their own, and it does not come to an
    end on some that are cut off; it converts them: ``meshio convert net.inp net.vtu``.

    Examples
    --------
        [web]
        kind = "file"
        path = "net.vtu"
    """

    kind: str = choice("file", default="file")
    path: str = text()

    def web(self, base=None):
        """The `Web`; ``base`` is the folder that a relative path starts from."""
        try:
            return _web_of(_read(Path(base or ".") / self.path))
        except InputError as error:
            raise InputError(f"path = {shown(self.path)}: {error}") from None


def _read(path):
    """The mesh meshio reads; it reports some failures by printing and leaving the program."""
    import contextlib
    import io
    import warnings

    import meshio

    if not path.is_file():
        raise InputError(f"there is no file {path}")
    if path.suffix.lower() not in FORMATS:
        raise InputError(f"format {shown(path.suffix)} must be one of {', '.join(FORMATS)}: use meshio convert")
    memory.check(memory.READING * path.stat().st_size, f"the {path.stat().st_size / 1e6:.3g} MB of {path.name}")
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return meshio.read(path, file_format=FORMATS[path.suffix.lower()])
    except (Exception, SystemExit) as error:
        reason = f"{type(error).__name__} {error}" if isinstance(error, Exception) else said.getvalue()
        reason = " ".join(reason.replace("Error: Couldn't read file", "").replace(str(path), "").split())[:200]
        raise InputError(f"meshio cannot read {path}; is it whole, and its data numeric? ({reason})") from None


def _web_of(mesh):
    kinds = [block.type for block in mesh.cells]
    other = sorted(set(kinds) - {"line"})
    if other or not kinds:
        raise InputError(f"{', '.join(other) or 'no'} cells: a web has line cells and no others")
    points = np.asarray(mesh.points)
    if points.ndim != 2 or points.shape[1] not in (2, 3):
        raise InputError(f"points of shape {points.shape} must have the shape (nodes, 3)")
    points = np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
    lines = np.concatenate([block.data for block in mesh.cells]).astype(np.int64)
    length, group = (
        np.concatenate(mesh.cell_data[key]) if key in mesh.cell_data else None for key in ("natural_length", "group")
    )
    length = _numbers("natural_length", length, len(lines))
    support = _numbers("support", mesh.point_data.get("support"), len(points))
    rim = () if support is None else np.flatnonzero(support)
    return Web(points, lines, length, rim=rim, kind="file", groups=_group_names(group, len(lines)))


def _numbers(name, values, count):
    if values is None:
        return None
    values = np.asarray(values)
    if values.size != count or values.dtype.kind not in "biuf" or not np.isfinite(values).all():
        raise InputError(f"{name} of shape {values.shape} must be {count} finite numbers")
    return values.reshape(count).astype(np.float64)


def _group_names(values, count):
    """Group of each line as text: 2 and 2.0 read "2"."""
    if values is None:
        return None
    values = np.asarray(values)
    if values.size != count:
        raise InputError(f"group of shape {values.shape} must have one entry for each of {count} lines")

    def text(value):
        if isinstance(value, bytes):
            return value.decode(errors="replace")
        return str(int(value)) if isinstance(value, float) and value.is_integer() else str(value)

    return tuple(map(text, values.reshape(count).tolist()))
