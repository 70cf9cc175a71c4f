"""Find all parts of the error of each result, and say what the numbers are worth."""

# This docstring is the help of the verb. May change: texts, but for `LEAST` and `RUNS` of `dynamics.budget` in that of
# --budget. Must stay: `add_arguments` and `run`, which `refweb.__main__` calls; names of options; `show` of the content
# of `trust.json`, not of `run.json`. Tests: tests/studies/test_further_runs.py.

import pathlib

from .arguments import add_force, add_scene, resumable, scene_of


def add_arguments(parser):
    """Declare the scene, the folder and the budget of time."""
    add_scene(parser)
    parser.add_argument("--out", metavar="DIR", help="folder for trust.json and trust.png (default: none is written)")
    parser.add_argument(
        "--budget", type=float, metavar="SECONDS", help="CPU time of all runs (default: 600, or 20 times the first)"
    )
    add_force(parser)


def run(arguments):
    """Print what is solved, find the errors, print them with their verdicts."""
    from ..results.progress import followed
    from ..runner import trust
    from ..studies.further_runs import report
    from .console import print_scene

    scene, out = scene_of(arguments), arguments.out
    options = {"budget": arguments.budget, "out": out, "force": arguments.force}
    with resumable(out), followed(True) as tell:
        solution = trust(scene, progress=tell, announce=print_scene, **options)
    show(report(solution))
    if out is not None:
        print(f"budget of errors in {pathlib.Path(out) / 'trust.png'}")


def show(report):
    """Print the box of an error budget from the content of its ``trust.json``."""
    from .console import print_trust

    print_trust(report)
