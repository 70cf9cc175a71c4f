"""VTU files: a short XML header, then arrays compressed by zlib, each of which can be read alone.

The arrays are raw bytes at the end of the file (``appended``, encoding ``raw``), in blocks of `BLOCK` bytes that VTK
decompresses one by one. For a web of 978 600 lines at the start of a throw, 102 MB of arrays give a file of 18 MB.
Base64 within the XML, as meshio writes it, gives a file that is a third longer; it takes 1.5 times the CPU time to
write and 2.5 times to read. The default level of zlib takes twice the time of `LEVEL` and saves 3 % of the bytes. Bytes
without repetition, such as those of tensions in motion, are stored without compression: this would take three quarters
of the time of a frame, and save 5 to 12 % of such arrays.
"""

from __future__ import annotations

import functools
import html
import xml.etree.ElementTree as ElementTree
import zlib
from typing import Any, NamedTuple

import numpy as np

BLOCK, LEVEL = 1 << 18, 1
"""Bytes of a block, and level of zlib, 1 to 9."""
SAMPLE, REPEATS = 1 << 11, 0.8
"""Bytes from the middle of a block that are compressed as a test, and their compressed share below which the block is
compressed."""
AGAIN = 64
"""Largest number of arrays of one block whose compressed bytes are kept: cells, masses and lengths are the same in the
next frame."""
TYPES = {"Float64": "<f8", "Int64": "<i8", "Int32": "<i4", "UInt8": "u1"}
CELLS = {"line": 3, "line3": 21, "line4": 35, "triangle": 5}
"""VTK's numbers of types of cells."""
LINES = (3, 21, 35)
HEAD, MARK = "<VTKFile ", b'<AppendedData encoding="raw">_'


class Block(NamedTuple):
    """Cells of one type: its name, as meshio has it, and their points, shape (cells, points of each)."""

    type: str
    data: np.ndarray


class Mesh(NamedTuple):
    """A mesh with the arguments of ``meshio.Mesh(*mesh)``.

    Attributes
    ----------
    points : ndarray, shape (points, 3)
        Positions [m].
    cells : list of Block
        Cells.
    point_data : dict of str to ndarray
        Numbers or vectors at the points.
    cell_data : dict of str to list of ndarray
        Numbers of the cells, an array for each block.
    """

    points: np.ndarray
    cells: list[Block]
    point_data: dict[str, Any]
    cell_data: dict[str, list]


def quoted(text):
    """A text as the value of an attribute of XML."""
    return f'"{html.escape(text)}"'


def write(path, mesh):
    """Write a mesh of floats.

    Parameters
    ----------
    path : path-like
        The file.
    mesh : Mesh or meshio.Mesh
        Points, cells and their data.
    """
    integer_type = np.int32 if max(len(mesh.points), sum(block.data.size for block in mesh.cells)) < 2**31 else np.int64
    nodes = [block.data.shape[1] for block in mesh.cells]
    counts = [len(block.data) for block in mesh.cells]
    sections = {
        "Points": {"Points": mesh.points},
        "Cells": {
            "connectivity": np.concatenate([block.data.ravel() for block in mesh.cells]).astype(integer_type),
            "offsets": np.cumsum(np.repeat(nodes, counts)).astype(integer_type),
            "types": np.repeat([CELLS[block.type] for block in mesh.cells], counts).astype(np.uint8),
        },
        "PointData": mesh.point_data,
        "CellData": {name: np.concatenate(values) for name, values in mesh.cell_data.items()},
    }
    packed, offset, text = [], 0, []
    for section, arrays in sections.items():
        text.append(f"<{section}>")
        for name, values in arrays.items():
            kind = values.dtype.str if values.dtype.kind in "iu" else "<f8"
            kind = next(known for known, code in TYPES.items() if np.dtype(code) == np.dtype(kind))
            size = f' NumberOfComponents="{values.shape[1]}"' if values.ndim > 1 else ""
            text.append(f'<DataArray type="{kind}" Name={quoted(name)}{size} format="appended" offset="{offset}"/>')
            packed += _packed(np.ascontiguousarray(values, TYPES[kind]), offset)
            offset = sum(map(len, packed))
        text.append(f"</{section}>")
    size = f'NumberOfPoints="{len(mesh.points)}" NumberOfCells="{sum(counts)}"'
    with open(path, "wb") as file:
        file.write(
            f'<?xml version="1.0"?>\n{HEAD}type="UnstructuredGrid" version="0.1" byte_order="LittleEndian" '
            f'header_type="UInt32" compressor="vtkZLibDataCompressor">\n<UnstructuredGrid>\n<Piece {size}>\n'.encode()
        )
        file.write("\n".join([*text, "</Piece>", "</UnstructuredGrid>", ""]).encode() + MARK)
        file.writelines(packed)
        file.write(b"\n</AppendedData>\n</VTKFile>\n")


def _packed(values, offset):
    """An array in VTK's format: number of blocks, bytes of one, bytes of a short last one, sizes; then the blocks.

    meshio 5.3 replaces offsets one by one by those in base64, which are multiples of 4, and looks up each among both
    kinds. Therefore only the first offset is a multiple of 4 here: if an array ends at such a multiple, its last block
    is compressed in another way.
    """
    data = memoryview(values.reshape(-1)).cast("B") if values.size else b""
    if len(data) > BLOCK:
        blocks = [_compressed(data[start : start + BLOCK]) for start in range(0, len(data), BLOCK)]
    else:
        blocks = [_compressed_again(bytes(data))] if len(data) else []
    for how in range(40):
        if not blocks or (offset + sum(map(len, blocks))) % 4:
            break
        blocks[-1] = _compressed(data[BLOCK * (len(blocks) - 1) :], how)
    head = [len(blocks), BLOCK, len(data) % BLOCK, *map(len, blocks)]
    return [np.array(head, "<u4").tobytes(), *blocks]


def _compressed(data, cut=None):
    """A block, compressed or, without repetition, stored; in two parts, if ``cut`` is given."""
    middle = len(data) // 2
    sample = data[middle : middle + SAMPLE]
    repeats = len(zlib.compress(sample, LEVEL)) <= REPEATS * len(sample)
    packer = zlib.compressobj(LEVEL if repeats else 0)
    first = b"" if cut is None else packer.compress(data[:cut]) + packer.flush(zlib.Z_SYNC_FLUSH)
    return first + packer.compress(data[cut or 0 :]) + packer.flush()


_compressed_again = functools.lru_cache(AGAIN)(_compressed)


class Reader:
    """A file that `write` wrote.

    Parameters
    ----------
    path : pathlib.Path
        The file.

    Raises
    ------
    ValueError
        For a file that `write` did not write; from `array` and `mesh` also for a damaged file.
    OSError
        If the file cannot be read.
    """

    def __init__(self, path):
        with open(path, "rb") as file:
            start = file.read(1 << 16)
        end = start.find(MARK)
        if end < 0 or b'compressor="vtkZLibDataCompressor"' not in start[:end]:
            raise ValueError("is not what refweb writes")
        self._path, self._data = path, end + len(MARK)
        try:
            root = ElementTree.fromstring(start[:end] + b"</VTKFile>")
            if root.get("header_type") != "UInt32" or root.get("byte_order") != "LittleEndian":
                raise ValueError("is not what refweb writes")
            self._sections = {
                section.tag: {array.attrib["Name"]: array.attrib for array in section} for section in root[0][0]
            }
        except (ElementTree.ParseError, IndexError, KeyError) as error:
            raise ValueError(str(error)) from None

    def array(self, section, name):
        """The array of a name in a section such as ``CellData``, shape (n,) or (n, components)."""
        try:
            about = self._sections[section][name]
            with open(self._path, "rb") as file:
                file.seek(self._data + int(about["offset"]))
                count, _, _ = np.frombuffer(file.read(12), "<u4")
                sizes = np.frombuffer(file.read(4 * int(count)), "<u4").tolist()
                data = b"".join([zlib.decompress(file.read(size)) for size in sizes])
            values = np.frombuffer(bytearray(data), TYPES[about["type"]])
            return values.reshape(-1, int(about["NumberOfComponents"])) if "NumberOfComponents" in about else values
        except (KeyError, zlib.error) as error:
            raise ValueError(f"{section} {name}: {error}") from None

    def mesh(self):
        """The content of the file as a `Mesh`."""
        types, corners = self.array("Cells", "types"), self.array("Cells", "connectivity")
        ends = np.concatenate([[0], self.array("Cells", "offsets")])
        cuts = [0, *(np.flatnonzero(np.diff(types)) + 1), len(types)] if len(types) else [0]
        names, blocks, cells = {number: name for name, number in CELLS.items()}, [], self._all("CellData")
        for first, last in zip(cuts[:-1], cuts[1:], strict=True):
            nodes = corners[ends[first] : ends[last]].reshape(last - first, -1)
            blocks.append(Block(names[int(types[first])], nodes))
        cell_data = {
            name: [values[first:last] for first, last in zip(cuts[:-1], cuts[1:], strict=True)]
            for name, values in cells.items()
        }
        return Mesh(self.array("Points", "Points"), blocks, self._all("PointData"), cell_data)

    def _all(self, section):
        return {name: self.array(section, name) for name in self._sections.get(section, {})}


def cell_arrays(path, names):
    """Cell data with one number for each line, without reading the rest of the file.

    Parameters
    ----------
    path : pathlib.Path
        A ``.vtu``.
    names : sequence of str

    Returns
    -------
    dict of str to ndarray, shape (lines,), or None
        None if `write` did not write the file, or if it has no such data or has cells that are no lines.
    """
    try:
        file = Reader(path)
        if not np.isin(file.array("Cells", "types"), LINES).all():
            return None
        arrays = {name: file.array("CellData", name) for name in names}
    except (OSError, ValueError):
        return None
    return arrays if all(values.ndim == 1 for values in arrays.values()) else None
