"""Single arrays of a VTU file as refweb writes it: a scale of colours for all frames needs no more of them."""

from __future__ import annotations

import base64
import re
import zlib

import numpy as np

TYPES = {"Float64": "<f8", "Int64": "<i8", "Int32": "<i4", "UInt8": "u1"}
LINES = (3, 21, 35)
"""VTK's numbers of lines of order 1 to 3."""


def cell_arrays(path, names):
    """Cell data of one number a line.

    Parameters
    ----------
    path : path
        A ``.vtu`` whose arrays are compressed by zlib in blocks, with sizes of 32 bits.
    names : sequence of str

    Returns
    -------
    dict of str to ndarray, shape (lines,), or None
        None of a file that is otherwise, has no such data, or has other cells than lines.
    """
    try:
        text = path.read_bytes()
        if b'compressor="vtkZLibDataCompressor"' not in text[:400] or b"header_type" in text[:400]:
            return None
        cells = text[text.index(b"<CellData") :]
        if not np.isin(_array(text[text.index(b"<Cells") :], "types"), LINES).all():
            return None
        return {name: _array(cells, name) for name in names}
    except (OSError, ValueError, KeyError, IndexError, zlib.error):
        return None


def _array(text, name):
    """The array of a name; a ValueError where there is none that holds one number each."""
    match = re.search(rb'<DataArray ([^>]*Name="%s"[^>]*)>\s*([^<]*)' % re.escape(name.encode()), text)
    if match is None or re.search(rb'NumberOfComponents="(?!1")', match[1]):
        raise ValueError(f"{name} is no array of numbers")
    kind, data = re.findall(rb'type="(\w+)"', match[1])[0].decode(), match[2]
    count = int(np.frombuffer(base64.b64decode(data[:8])[:4], "<u4")[0])
    head = 4 * -(-(4 * (3 + count)) // 3)
    sizes = np.frombuffer(base64.b64decode(data[:head]), "<u4")[3 : 3 + count]
    blocks, packed, start = [], base64.b64decode(data[head:]), 0
    for size in sizes:
        blocks.append(zlib.decompress(packed[start : start + size]))
        start += size
    return np.frombuffer(b"".join(blocks), TYPES[kind]).astype(float)
