"""Compute the cost of digits: errors and CPU times of every method on a scene."""

# This docstring is the help of the verb. May change: texts. Must stay: `add_arguments` and `run`, which
# `refweb.__main__` calls, and `show`, which `refweb info` calls; names of options, which are keywords of
# `studies.work_precision.cost`. Tests: tests/studies/test_cost.py.

import pathlib

from .arguments import add_force, add_scene, scene_of


def add_arguments(parser):
    """Declare the scene, the folder, the budget of time and the observable of the errors."""
    add_scene(parser)
    parser.add_argument("--out", metavar="DIR", help="folder for cost.png and cost.csv (default: none is written)")
    parser.add_argument("--budget", type=float, default=120.0, metavar="SECONDS", help="for all of it (default: 120)")
    parser.add_argument("--observe", metavar="NAME", help="observable that errors are of (default: the first)")
    add_force(parser)


def run(arguments):
    """Print what is solved, compare the methods, print what they cost."""
    from ..results.progress import followed
    from ..studies.work_precision import cost
    from .console import print_scene

    scene, out = scene_of(arguments), arguments.out
    options = {"observe": arguments.observe, "budget": arguments.budget, "out": out, "force": arguments.force}
    with followed(True) as tell:
        costs = cost(scene, progress=tell, announce=print_scene, **options)
    show(costs.summary())
    if out is not None:
        print(f"diagram in {pathlib.Path(out) / 'cost.png'}")


def show(summary):
    """Print the box of a work-precision diagram from the content of its ``run.json``."""
    from .console import print_cost

    print_cost(summary)
