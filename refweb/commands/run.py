"""Solve a scene and write its result folder."""

# This docstring is the help of the verb. May change: texts. Must stay: `add_arguments` and `run`, which
# `refweb.__main__` calls, and `show`, which `refweb info` calls for a `run.json` without a kind; names of options.
# Tests: tests/commands/test_cli.py.

from ..errors import InputError
from .arguments import add_force, add_scene, folder_of, resumable, scene_of


def add_arguments(parser):
    """Declare the scene, the folder and the horizon."""
    add_scene(parser)
    parser.add_argument("--out", metavar="DIR", help="result folder (default: the title, in the current folder)")
    add_force(parser)
    parser.add_argument("--horizon", action="store_true", help="find how long the motion is determined")


def run(arguments):
    """Print what is solved, solve it, print the results."""
    from dataclasses import replace

    from .. import runner
    from ..results.progress import followed
    from .console import print_scene, print_solution

    scene = scene_of(arguments)
    if arguments.horizon:
        if scene.solve.kind == "static":
            raise InputError(f"--horizon has no meaning for {arguments.scene}: it is static, leave it out")
        scene = scene.replace(accuracy=replace(scene.accuracy, horizon=True))
    out = folder_of(arguments, scene.title)
    with resumable(out), followed(True) as tell:
        solution = runner.run(scene, out=out, force=arguments.force, progress=tell, announce=print_scene)
    print_solution(solution, out)


def show(summary):
    """Print the box of a finished run from the content of its ``run.json``."""
    from .console import print_run

    print_run(summary)
