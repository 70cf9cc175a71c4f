"""Writer of moving pictures: GIF by pillow, which stores differences of images, and MP4 by imageio and PyAV.

The ``open_gif`` of pyvista records one window of pyvista, but a page here has two views, axes and texts. One palette
for each image, the default of imageio and pillow, makes a file of 2.7 MB for the film of ``capture-stage``, with
colours that change from image to image; one palette for all images makes 1.5 MB.

May change: private functions, `COLOURS`, `ALMOST_WHITE` and the palette. Must stay: `write` for images of one size,
each with its duration, as `film` gives them; `ENDINGS`: a new one needs a branch in `write`. Tests:
``tests/pictures/test_pictures.py``.
"""

from __future__ import annotations

import numpy as np

ENDINGS = ("gif", "mp4")
COLOURS = 255
"""Number of colours of a GIF; pillow adds one for unchanged pixels."""
ALMOST_WHITE = 247
"""Level of all channels above which a colour stands for white: pillow looks colours up in steps of four levels."""


def write(path, images, seconds, samples, certain):
    """Write images of pillow, RGB, from an iterator to a ``.gif`` or an ``.mp4``.

    A GIF needs 1 byte of memory for each pixel of all images, an MP4 the memory of one image. Each image has a duration
    in ``seconds``, of which the first is the shortest. The palette of a GIF is made from images ``samples``, and has
    the colours ``certain (colours, 3)``, 0 to 255, in any case.
    """
    if path.suffix.lower() == ".gif":
        palette = _palette(samples, certain)
        drawn = (image.quantize(palette=palette, dither=0) for image in images)
        next(drawn).save(
            path, save_all=True, append_images=drawn, duration=[round(1000 * each) for each in seconds], loop=0
        )
        return
    import imageio.v3

    with imageio.v3.imopen(path, "w", plugin="pyav") as film:
        film.init_video_stream("libx264", fps=1.0 / seconds[0], pixel_format="yuv420p")
        for image, each in zip(images, seconds, strict=True):
            for _ in range(round(each / seconds[0])):
                film.write_frame(np.asarray(image))


def _palette(samples, certain):
    """An image whose palette has white, the certain colours, and colours of sample images."""
    from PIL import Image

    number = COLOURS - 1 - len(certain)
    frequent = Image.fromarray(np.vstack(samples)).quantize(number, method=Image.Quantize.FASTOCTREE)
    colours = np.reshape(frequent.getpalette() or [], (-1, 3))[:number]
    table = np.vstack([[[255, 255, 255]], certain, colours[colours.min(axis=1) <= ALMOST_WHITE]])
    palette = Image.new("P", (1, 1))
    palette.putpalette(table.ravel().tolist())
    return palette
