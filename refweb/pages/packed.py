"""Arrays as one text: their bytes, deflated and in base64, and a table of positions and types.

Positions become integers of 16 bits, values for colours integers of 8 bits, see `levels`. The page unpacks them with
the ``DecompressionStream`` of the browser.

May change: nothing on one side alone: ``model.js`` unpacks the same bytes, and repeats the levels of `VALUES` and
`UNKNOWN` as numbers; `PLACES` fit into 16 bits. Must stay: what ``tests/unpacked.py`` does as inverse of `pack` and
`differences`. Tests: ``tests/pages/test_page.py``, ``tests/pages/test_browser.py``.
"""

from __future__ import annotations

import base64
import zlib

import numpy as np

PLACES, VALUES, UNKNOWN = 65534, 254, 255
"""Numbers of steps in the range of positions and of values, and the level for values that are not finite."""


def levels(values, steps):
    """Values as integer numbers of steps of their range.

    Parameters
    ----------
    values : ndarray
        Values to write; entries that are not finite get the level ``steps + 1``.
    steps : int
        Number of steps of the range.

    Returns
    -------
    levels : ndarray of int, shape of the values
        ``low + (high - low) * levels / steps`` is at most half a step away from a value.
    low, high : float
        The range; 0 and 0 if no value is finite.
    """
    finite = np.isfinite(values)
    low, high = (float(values[finite].min()), float(values[finite].max())) if finite.any() else (0.0, 0.0)
    size = high / 2 - low / 2  # half, which is finite
    share = np.where(finite, values, low) / 2 - low / 2
    rounded = np.rint(steps * (share / size)) if size > 0 else np.zeros(np.shape(values))
    return np.where(finite, rounded, steps + 1).astype(int), low, high


def differences(frames):
    """Levels of frames as bytes that compress well: changes from frame to frame, high bytes before low bytes.

    Parameters
    ----------
    frames : ndarray of int, shape (frames, ...)
        0 … 65535.
    """
    changes = np.diff(frames, axis=0, prepend=np.zeros_like(frames[:1])) & 0xFFFF
    return np.stack([changes >> 8, changes & 0xFF]).astype(np.uint8)


def pack(arrays):
    """Arrays by name as one text.

    Returns
    -------
    text : str
        Base64 of the deflated bytes (zlib's format).
    table : dict
        For each name its ``type``, "uint8", "uint32" or "float32", first byte and number of entries.
    """
    table, parts, end = {}, [], 0
    for name, array in arrays.items():
        written = np.ascontiguousarray(array)
        written = written.astype(written.dtype.newbyteorder("<"))
        table[name] = {"type": array.dtype.name, "start": end, "length": int(written.size)}
        size = written.nbytes + -written.nbytes % 4  # entries of four bytes begin at a multiple of four
        parts.append(written.tobytes().ljust(size, b"\0"))
        end += size
    return base64.b64encode(zlib.compress(b"".join(parts), 9)).decode(), table
