"""Draw a result folder: one instant, or all of them as a film."""

# This docstring is the help of the verb. May change: texts. Must stay: `add_arguments` and `run`, which
# `refweb.__main__` calls; names of options, which are keywords of `pictures.pictures.picture` and
# `pictures.film.animate`. Tests: tests/pictures/test_pictures.py.

import argparse
import pathlib

from ..errors import InputError


def add_arguments(parser):
    """Declare the folder, the frame, the field, the look and the file."""
    folder = parser.add_argument("folder", metavar="DIR")
    parser.add_argument(
        "--frame", type=int, metavar="N", help="number of the frame, of modes that of the mode; -1 is the last"
    )
    text = "the frame nearest this time [s] or load step (default: that of the largest value of the first observable)"
    parser.add_argument("--time", type=float, metavar="T", help=text)
    text = (
        "what the colours show: stress, tension, strain, slack, displacement, velocity, reaction, of lines that have a "
    )
    text += "strength utilisation, and largest_NAME, of each line the largest NAME over all frames (default: stress)"
    parser.add_argument("--field", metavar="NAME", help=text)
    text = "range of the colours [SI], --range=-1e3,2e3 where it begins with a minus, or auto: that of the one frame "
    text += "(default: that of all frames)"
    parser.add_argument(
        "--range", nargs="+", action=_Words, maximum=2, folder=folder, metavar=("LOW", "HIGH"), help=text
    )
    parser.add_argument("--scale", type=float, default=1.0, metavar="S", help="what displacements are drawn times")
    text = "one view: oblique, side, front, top, or a direction to the viewer such as 1 0 0.5 (default: two views)"
    parser.add_argument("--view", nargs="+", action=_Words, maximum=3, folder=folder, metavar=("NAME", "X"), help=text)
    text = "number the lines, those with the largest values first, as many as do not cover each other"
    parser.add_argument("--labels", choices=["lines"], help=text)
    parser.add_argument("--out", metavar="FILE", help="picture to write (default: DIR/web.png)")
    text = "a film of all frames, of a mode its swing: a GIF (default: DIR/web.gif) or an MP4"
    parser.add_argument("--animate", action="store_true", help=text)


class _Words(argparse.Action):
    """A name, or up to some numbers; a word that follows them is the folder, which usage has at the end."""

    def __init__(self, *args, maximum, folder, **options):
        super().__init__(*args, **options)
        self._maximum, self._folder = maximum, folder

    def __call__(self, parser, namespace, values, option_string=None):
        words = list(values or ())
        count = self._maximum if _number(words[0]) else 1
        setattr(namespace, self.dest, words[:count])
        if words[count:] and namespace.folder is None:
            namespace.folder, self._folder.required = words[count], False
            count += 1
        if words[count:]:
            parser.error(f"argument {option_string}: too many words: {' '.join(words[count:])}")


def run(arguments):
    """Draw, and print where the picture is."""
    from ..pictures.pictures import picture
    from ..results.progress import followed

    folder, out = pathlib.Path(arguments.folder), arguments.out
    options = {name: getattr(arguments, name) for name in ("frame", "time", "field", "scale")}
    if arguments.animate and arguments.labels:
        raise InputError(f"--labels {arguments.labels} has no meaning with --animate: leave one of them out")
    options["range"], options["view"] = _values(arguments.range), _values(arguments.view)
    with followed(True, "drawing") as tell:
        if arguments.animate:
            from ..pictures.film import animate

            out = folder / "web.gif" if out is None else out
            animate(folder, out, **options, progress=tell)
        else:
            out = folder / "web.png" if out is None else out
            picture(folder, **options, out=out, labels=arguments.labels)
    print(out)


def _values(words):
    """Read ``--range`` and ``--view``: a name, or numbers, with spaces or commas between them."""
    if words is None:
        return None
    words = [part for word in words for part in word.split(",") if part]
    return [float(word) for word in words] if all(map(_number, words)) else " ".join(words)


def _number(word):
    """Tell if a word is a number."""
    try:
        return float(word) is not None
    except ValueError:
        return False
