"""Moving pictures, written image by image: GIF, and MP4 by ffmpeg."""

from __future__ import annotations

import shutil
import struct
import subprocess
import tempfile
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError

ENDINGS = ("gif", "mp4")
COLOURS = 255
"""Of a GIF; one number more stands for what stays as it is."""
LAST = 1.0
"""How long the last image of what does not swing stays [s]."""


def writer(path, size, fps, samples, certain):
    """A `Gif` or an `Mp4`, by the ending of a path; ``samples`` and ``certain`` colours are for a `Gif`."""
    if path.suffix.lower() == ".gif":
        return Gif(path, size, fps, samples, certain)
    return Mp4(path, size, fps)


def ffmpeg():
    """The program that makes an MP4.

    Raises
    ------
    InputError
        Where there is none.
    """
    path = shutil.which("ffmpeg")
    if path is None:
        raise InputError('out = "….mp4" needs ffmpeg, which is not found on PATH: install it, or name a .gif')
    return path


class Gif:
    """A GIF with one palette, in which each image has only what differs from the one before.

    Parameters
    ----------
    path : pathlib.Path
        Where it is written.
    size : (width, height)
        Of its images [pixel].
    fps : float
        Images per second [1/s].
    samples : sequence of PIL.Image.Image
        Images of which the palette is made.
    certain : ndarray, shape (colours, 3)
        Colours in 0…1 that it has in any case.
    """

    def __init__(self, path, size, fps, samples, certain):
        self._size, self._delay, self._last = size, 1000 / fps, None
        self._palette = _palette(samples, certain)
        self._file = open(path, "wb")
        self._file.write(b"GIF89a" + struct.pack("<HHBBB", *size, 0xF7, 0, 0))
        self._file.write(self._palette.colours)
        self._file.write(b"\x21\xff\x0bNETSCAPE2.0\x03\x01\x00\x00\x00")

    def add(self, image, seconds=0.0):
        """Add an image, that stays for longer than others [s] where that is said."""
        from PIL import GifImagePlugin, Image

        numbers = self._palette.nearest[_bin(np.asarray(image))]
        rows, columns = slice(0, 1), slice(0, 1)
        if self._last is None:
            part, (rows, columns) = numbers, (slice(0, None), slice(0, None))
        else:
            differs = numbers != self._last
            if differs.any():
                rows, columns = (_span(differs.any(axis=axis)) for axis in (1, 0))
            part = np.where(differs, numbers, COLOURS).astype(np.uint8)[rows, columns]
        self._last = numbers
        drawn = Image.fromarray(part)
        drawn.putpalette(self._palette.colours)
        options = {"duration": max(self._delay, 1000 * seconds), "disposal": 1, "transparency": COLOURS}
        corner = (columns.start, rows.start)
        self._file.write(b"".join(GifImagePlugin.getdata(drawn, offset=corner, include_color_table=False, **options)))

    def close(self):
        """End it."""
        self._file.write(b";")
        self._file.close()

    def abandon(self):
        """Leave it as it is."""
        self._file.close()


class Mp4:
    """An MP4 that ffmpeg makes of the images.

    Parameters
    ----------
    path, size, fps
        As for `Gif`.
    """

    def __init__(self, path, size, fps):
        raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", "{}x{}".format(*size), "-r", f"{fps:g}", "-i", "-"]
        made = ["-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4", str(path)]
        self._fps, self._said = fps, tempfile.TemporaryFile(prefix="refweb-")
        self._program: Any = subprocess.Popen(
            [ffmpeg(), "-y", "-loglevel", "error", *raw, *made],
            stdin=subprocess.PIPE,
            stdout=self._said,
            stderr=self._said,
        )

    def add(self, image, seconds=0.0):
        """Add an image, that stays for longer than others [s] where that is said."""
        data = image.tobytes()
        try:
            for _ in range(max(1, round(self._fps * seconds))):
                self._program.stdin.write(data)
        except OSError:
            self._fail()

    def close(self):
        """End it."""
        try:
            self._program.stdin.close()
        except OSError:
            self._fail()
        if self._program.wait() != 0:
            self._fail()
        self._said.close()

    def abandon(self):
        """Leave it as it is."""
        self._program.kill()
        self._program.wait()
        self._said.close()

    def _fail(self):
        self._program.wait()
        self._said.seek(0)
        words = self._said.read().decode(errors="replace").strip().rpartition("\n")[2]
        raise InputError(f"ffmpeg makes no MP4: {words or 'it says not why'}: name a .gif")


def _span(where):
    """The slice from the first to the last that is true."""
    indices = np.flatnonzero(where)
    return slice(int(indices[0]), int(indices[-1]) + 1)


class Palette(NamedTuple):
    """The colours of a GIF: 768 bytes, and the number of the nearest one by `_bin`, shape (64³,)."""

    colours: bytes
    nearest: np.ndarray


def _bin(colours):
    """Number of the bin, of 64³, of a colour, shape (…, 3), uint8."""
    red, green, blue = (colours[..., i].astype(np.int32) >> 2 for i in range(3))
    return (red << 12) | (green << 6) | blue


def _nearest(table):
    """Number of the colour, of shape (colours, 3), that is nearest to the middle of each bin, shape (64³,)."""
    table, levels = np.asarray(table, dtype=np.float32), np.arange(64, dtype=np.float32) * 255 / 63
    green, blue = (x.ravel() for x in np.meshgrid(levels, levels, indexing="ij"))
    nearest = np.empty((64, 64 * 64), dtype=np.uint8)
    for red, numbers in zip(levels, nearest, strict=True):
        bins = np.stack([np.full_like(green, red), green, blue], axis=1)
        numbers[:] = ((table**2).sum(axis=1) - 2 * bins @ table.T).argmin(axis=1)
    return nearest.ravel()


def _palette(samples, certain):
    """The palette that has white, colours that are certain, and those of images.

    Rare colours count for more than their share: thin lines have their shades beside a white page.
    """
    from PIL import Image

    count = np.zeros(64**3, dtype=int)
    for image in samples:
        pixels = np.asarray(image).reshape(-1, 3)
        count += np.bincount(_bin(pixels), minlength=len(count))
    key = np.flatnonzero(count)
    colours = np.stack([key >> 12, key >> 6 & 63, key & 63], axis=1) * 255 // 63
    spread = np.repeat(colours.astype(np.uint8), np.ceil(count[key] ** 0.75 / 8).astype(int), axis=0)
    table = [255, 255, 255, *np.round(255 * np.asarray(certain)).astype(int).ravel().tolist()]
    left = COLOURS - len(table) // 3
    palette = Image.fromarray(spread[None]).quantize(left, method=Image.Quantize.MEDIANCUT, kmeans=1)
    table += (palette.getpalette() or [])[: 3 * left]
    return Palette(bytes(table + [255] * (768 - len(table))), _nearest(np.reshape(table, (-1, 3))))
