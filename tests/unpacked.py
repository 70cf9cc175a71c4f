"""The data of a page as they are in the run again: what `model.js` does in the browser, in Python."""

import base64
import zlib

import numpy as np

from refweb.pages.packed import UNKNOWN, VALUES


def unpack(text, table):
    """The arrays of a text of `refweb.pages.packed.pack`, each one-dimensional."""
    raw = zlib.decompress(base64.b64decode(text))
    kind = {name: np.dtype(entry["type"]).newbyteorder("<") for name, entry in table.items()}
    return {n: np.frombuffer(raw, kind[n], entry["length"], entry["start"]) for n, entry in table.items()}


def summed(changes, shape):
    """The levels from the result of `refweb.pages.packed.differences`, of a shape (frames, ...)."""
    high, low = np.asarray(changes, dtype=int).reshape(2, *shape)
    return np.cumsum((high << 8) + low, axis=0) & 0xFFFF


def positions(arrays, head, frame):
    """Points of a frame [m], shape (points, 3)."""
    points = arrays["origin"].reshape(-1, 3)
    steps = summed(arrays["moves"], (len(head["numbers"]), 3, len(points)))[frame]
    low, step = np.array(head["moves"]).T
    return points + low + steps.T * step


def values(arrays, field, frame):
    """Values of a field in a frame [SI], shape (lines,); NaN if not finite."""
    low, high = field["ranges"][frame]
    count = 1 if field["constant"] else len(field["ranges"])
    levels = arrays[field["array"]].reshape(count, len(arrays["slack"]) // len(field["ranges"]))
    levels = levels[0 if field["constant"] else frame]
    return np.where(levels == UNKNOWN, np.nan, low + (high - low) * levels / VALUES)
