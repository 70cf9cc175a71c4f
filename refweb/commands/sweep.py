"""Run a study: one scene with many values, spread and ± apart, chances of conditions."""

# This docstring is the help of the verb; `refweb info` calls `show` for a `run.json` of this kind.

import contextlib
import pathlib

from ..errors import InputError


def add_arguments(parser):
    """The study, its folder, and who runs it."""
    parser.add_argument("study", metavar="STUDY", help="a study file, or the name of a study shipped with refweb")
    text = "folder of the study (default: its title, in the current folder); one that holds rows goes on"
    parser.add_argument("--out", metavar="DIR", help=text)
    text = "processes of this machine (default: one for each processor)"
    parser.add_argument("--workers", type=int, metavar="N", help=text)
    text = "run it on a Dask cluster, tcp://HOST:PORT of its scheduler; needs refweb[cluster]"
    parser.add_argument("--scheduler", metavar="ADDRESS", help=text)


def run(arguments):
    """Print what is run, run what is missing, print what the rows say together."""

    from ..pages.study import report
    from ..pictures.studies import plot
    from ..results.progress import followed
    from ..scene import slug
    from ..sweeps import study, sweep, workers
    from .console import print_sweep, print_sweep_begins

    asked = study.load(arguments.study)
    out = pathlib.Path(arguments.out if arguments.out is not None else slug(asked.title))
    if arguments.workers is not None and arguments.scheduler is not None:
        raise InputError(
            f"--workers {arguments.workers} has no meaning with --scheduler, whose workers are there: leave it out"
        )
    with contextlib.ExitStack() as stack:
        executor = stack.enter_context(workers.cluster(arguments.scheduler)) if arguments.scheduler else None
        with followed(True, "starting workers") as tell:
            options = {"executor": executor, "workers": arguments.workers, "progress": tell}
            outcome = sweep.sweep(asked, out=out, announce=print_sweep_begins, **options)
    print_sweep(outcome.summary())
    plot(out)
    print(f"rows in {out / 'results.csv'}, page in {report(out)}")


def show(summary):
    """Print the box of a study from the content of its ``run.json``."""
    from .console import print_sweep

    print_sweep(summary)
