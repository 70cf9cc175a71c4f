"""Continue a dynamic run that was killed, interrupted or failed."""

# This docstring is the help of the verb. `runner.resume` goes on with the rows, frames and ``run.json`` in DIR, which
# then hold the whole run; this file prints. May change: texts. Must stay: `add_arguments` and `run`, which
# `refweb.__main__` calls; the name of the verb, which messages of `results.folder.remedy` tell users. Tests:
# tests/test_faults.py.

from .arguments import resumable


def add_arguments(parser):
    """Declare the folder of the run."""
    parser.add_argument("folder", metavar="DIR", help="its result folder")


def run(arguments):
    """Continue from the last checkpoint, print the results."""
    from .. import runner
    from ..results.progress import followed
    from .console import print_scene, print_solution

    with resumable(arguments.folder), followed(True) as tell:
        solution = runner.resume(arguments.folder, progress=tell, announce=print_scene)
    print_solution(solution, arguments.folder)
