"""Run a study: one scene with many values, spread and ± apart, chances of conditions."""

# This docstring is the help of the verb. May change: texts. Must stay: `add_arguments` and `run`, which
# `refweb.__main__` calls, and `show`, which `refweb info` calls for a `run.json` of this kind; names of options. Tests:
# tests/sweeps/test_sweep.py.

from .arguments import add_workers, folder_of, workers_of


def add_arguments(parser):
    """Declare the study, its folder and the workers."""
    parser.add_argument("study", metavar="STUDY", help="a study file, or the name of a study shipped with refweb")
    text = "folder of the study (default: its title, in the current folder); one that holds rows goes on"
    parser.add_argument("--out", metavar="DIR", help=text)
    add_workers(parser)


def run(arguments):
    """Print what is run, run what is missing, print what the rows say together."""

    from ..pages.study import report
    from ..pictures.studies import plot
    from ..sweeps import study, sweep
    from .console import print_sweep, print_sweep_begins

    asked = study.load(arguments.study)
    out = folder_of(arguments, asked.title)
    with workers_of(arguments, "starting workers") as options:
        outcome = sweep.sweep(asked, out=out, announce=print_sweep_begins, **options)
    print_sweep(outcome.summary())
    plot(out)
    print(f"rows in {out / 'results.csv'}, page in {report(out)}")


def show(summary):
    """Print the box of a study from the content of its ``run.json``."""
    from .console import print_sweep

    print_sweep(summary)
