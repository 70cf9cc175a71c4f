"""Find the least design that meets requirements: its scene, margins, what governs it, and the trade-off."""

# This docstring is the help of the verb. May change: texts. Must stay: `add_arguments` and `run`, which
# `refweb.__main__` calls, and `show`, which `refweb info` calls for a `run.json` of this kind; names of options; exit
# status 1 where no design meets the requirements, for scripts. Tests: tests/sizing/test_size.py.

from .arguments import add_workers, folder_of, workers_of


def add_arguments(parser):
    """Declare the requirements, the folder and the workers."""
    text = "a requirements file, or the name of one shipped with refweb"
    parser.add_argument("requirements", metavar="REQUIREMENTS", help=text)
    text = "folder of the sizing (default: its title, in the current folder); one that holds runs goes on"
    parser.add_argument("--out", metavar="DIR", help=text)
    add_workers(parser, "designs", " for several designs at once")


def run(arguments):
    """Print what is sized, size it, print the design; the exit status is 1 where no design meets the requirements."""
    from ..pictures.sizing import plot
    from ..sizing import requirements, size
    from .console import print_size, print_size_begins

    asked = requirements.load(arguments.requirements)
    out = folder_of(arguments, asked.title)
    with workers_of(arguments, "starting") as options:
        sized = size.size(asked, out=out, announce=print_size_begins, **options)
    print_size(sized.summary())
    print(f"design in {out / 'design.toml'}, its page in {out / 'design' / 'report.html'}, trade-off in {plot(out)}")
    return 0 if sized.status in ("solved", "unconfirmed") else 1


def show(summary):
    """Print the box of a sizing from the content of its ``run.json``."""
    from .console import print_size

    print_size(summary)
