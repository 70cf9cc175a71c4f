"""Find the least design that meets requirements: its scene, margins, what governs it, and the trade-off."""

# This docstring is the help of the verb; `refweb info` calls `show` for a `run.json` of this kind.

import contextlib
import pathlib

from ..errors import InputError


def add_arguments(parser):
    """The requirements, the folder, and who runs designs."""
    text = "a requirements file, or the name of one shipped with refweb"
    parser.add_argument("requirements", metavar="REQUIREMENTS", help=text)
    text = "folder of the sizing (default: its title, in the current folder); one that holds runs goes on"
    parser.add_argument("--out", metavar="DIR", help=text)
    text = "processes of this machine for several designs at once (default: one for each processor)"
    parser.add_argument("--workers", type=int, metavar="N", help=text)
    text = "run designs on a Dask cluster, tcp://HOST:PORT of its scheduler; needs refweb[cluster]"
    parser.add_argument("--scheduler", metavar="ADDRESS", help=text)


def run(arguments):
    """Print what is sized, size it, print the design; the exit status is 1 where no design meets the requirements."""
    from ..pictures.sizing import plot
    from ..results.progress import followed
    from ..scene import slug
    from ..sizing import requirements, size
    from ..sweeps import workers
    from .console import print_size, print_size_begins

    asked = requirements.load(arguments.requirements)
    out = pathlib.Path(arguments.out if arguments.out is not None else slug(asked.title))
    if arguments.workers is not None and arguments.scheduler is not None:
        raise InputError(
            f"--workers {arguments.workers} has no meaning with --scheduler, whose workers are there: leave it out"
        )
    with contextlib.ExitStack() as stack:
        executor = stack.enter_context(workers.cluster(arguments.scheduler)) if arguments.scheduler else None
        with followed(True, "starting") as tell:
            options = {"executor": executor, "workers": arguments.workers, "progress": tell}
            sized = size.size(asked, out=out, announce=print_size_begins, **options)
    print_size(sized.summary())
    print(f"design in {out / 'design.toml'}, its page in {out / 'design' / 'report.html'}, trade-off in {plot(out)}")
    return 0 if sized.status in ("solved", "unconfirmed") else 1


def show(summary):
    """Print the box of a sizing from the content of its ``run.json``."""
    from .console import print_size

    print_size(summary)
