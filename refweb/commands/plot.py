"""Plot result folders: histories with ±, books, spectra; several over each other."""

# This docstring is the help of the verb. May change: texts. Must stay: `add_arguments` and `run`, which
# `refweb.__main__` calls; names of options, which are keywords of `pictures.plots.plot`. Tests:
# tests/pictures/test_plots.py.

import sys


def add_arguments(parser):
    """Declare the folders, the quantities and the file."""
    parser.add_argument("folders", nargs="+", metavar="DIR", help="result folders; several are drawn over each other")
    text = (
        "an observable or another column of history.csv; energy or momentum, with balance; spectrum or spectrum:NAME; "
    )
    text += "stress, tension or strain of lines, over distance; frequencies, of modes. Repeatable (default: the "
    text += "observables and the energy balance; in statics results over load steps, of one stress over distance)"
    parser.add_argument("--quantity", action="append", metavar="NAME", help=text)
    parser.add_argument("--against", metavar="NAME", help="a column of history.csv in place of time, such as strain")
    parser.add_argument("--out", metavar="FILE", help="a .png, .svg or .pdf (default: plot.png in the first DIR)")


def run(arguments):
    """Draw, and print where the plot is; which folders lack what goes to the error stream."""
    from ..pictures.plots import plot

    picture = plot(arguments.folders, quantity=arguments.quantity, out=arguments.out, against=arguments.against)
    print(picture.path)
    for words in picture.lacking:
        print(f"refweb: {words}", file=sys.stderr)
