"""Draw a result folder: one instant, or all of them as a film."""

import pathlib


def add_arguments(parser):
    """The folder, what is drawn of it, how and where."""
    parser.add_argument("folder", metavar="DIR")
    parser.add_argument("--frame", type=int, metavar="N", help="number of the frame; -1 is the last")
    text = "the frame nearest this time [s] or load step (default: that of the largest value of the first observable)"
    parser.add_argument("--time", type=float, metavar="T", help=text)
    parser.add_argument("--field", metavar="NAME", help="what the colours show (default: stress)")
    text = "range of the colours [SI], or auto for that of the one frame (default: that of all frames)"
    parser.add_argument("--range", nargs="+", metavar=("LOW", "HIGH"), help=text)
    parser.add_argument("--scale", type=float, default=1.0, metavar="S", help="what displacements are drawn times")
    text = "one view: oblique, side, front, top, or a direction to the viewer such as 1 0 0.5 (default: two views)"
    parser.add_argument("--view", nargs="+", metavar=("NAME", "X"), help=text)
    parser.add_argument("--out", metavar="FILE", help="picture to write (default: DIR/web.png)")
    text = "a film of all frames, of a mode its swing: a GIF (default: DIR/web.gif), or where ffmpeg is found an MP4"
    parser.add_argument("--animate", action="store_true", help=text)


def run(arguments):
    """Draw, and print where the picture is."""
    from ..pictures.pictures import picture
    from ..results.progress import followed

    folder, out = pathlib.Path(arguments.folder), arguments.out
    options = {name: getattr(arguments, name) for name in ("frame", "time", "field", "scale")}
    options["range"], options["view"] = _values(arguments.range), _values(arguments.view)
    with followed(True, "drawing") as tell:
        if arguments.animate:
            from ..pictures.film import animate

            out = folder / "web.gif" if out is None else out
            animate(folder, out, **options, progress=tell)
        else:
            out = folder / "web.png" if out is None else out
            picture(folder, **options, out=out)
    print(out)


def _values(words):
    """What ``--range`` and ``--view`` give: a name, or numbers, with spaces or commas between them."""
    if words is None:
        return None
    words = [part for word in words for part in word.split(",") if part]
    try:
        return [float(word) for word in words]
    except ValueError:
        return " ".join(words)
