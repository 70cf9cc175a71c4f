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
    found = shutil.which("ffmpeg")
    if found is None:
        raise InputError('out = "….mp4" needs ffmpeg, which is not found on PATH: install it, or name a .gif')
    return found


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

        numbers = np.array(image.quantize(palette=self._palette.image, dither=Image.Dither.NONE))
        numbers[np.asarray(image.convert("L")) == 255] = 0  # what is looked for is a near colour, not the nearest
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
        place = (columns.start, rows.start)
        self._file.write(b"".join(GifImagePlugin.getdata(drawn, offset=place, include_color_table=False, **options)))

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
    found = np.flatnonzero(where)
    return slice(int(found[0]), int(found[-1]) + 1)


class Palette(NamedTuple):
    """The colours of a GIF: a `PIL.Image.Image` that has them, and their 768 bytes."""

    image: Any
    colours: bytes


def _palette(samples, certain):
    """The palette that has white, colours that are certain, and those of images.

    Rare colours count for more than their share: thin lines have their shades beside a white page.
    """
    from PIL import Image

    bins: dict = {}
    for image in samples:
        pixels = np.asarray(image).reshape(-1, 3)
        key = (pixels.astype(np.uint32) >> 2) @ np.array([4096, 64, 1], dtype=np.uint32)
        for one, count in zip(*np.unique(key, return_counts=True), strict=True):
            bins[int(one)] = bins.get(int(one), 0) + int(count)
    key, count = np.array(list(bins)), np.array(list(bins.values()))
    colours = np.stack([key >> 12, key >> 6 & 63, key & 63], axis=1) * 255 // 63
    spread = np.repeat(colours.astype(np.uint8), np.ceil(count**0.75 / 8).astype(int), axis=0)
    table = [255, 255, 255, *np.round(255 * np.asarray(certain)).astype(int).ravel().tolist()]
    left = COLOURS - len(table) // 3
    found = Image.fromarray(spread[None]).quantize(left, method=Image.Quantize.MEDIANCUT, kmeans=1)
    table += (found.getpalette() or [])[: 3 * left]
    colours = bytes(table + [255] * (768 - len(table)))
    image = Image.new("P", (1, 1))
    image.putpalette(colours)
    return Palette(image, colours)
