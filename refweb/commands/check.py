"""Check a scene without solving it; writes nothing."""

# This docstring is the help of the verb. May change: texts. Must stay: `add_arguments` and `run`, which
# `refweb.__main__` calls; exit status 0 of a scene that is right; that nothing is solved or written. A new check
# belongs in the scene, `runner.notices` or `doubts`. Tests: tests/commands/test_cli.py, tests/commands/test_doubts.py.

from ..errors import InputError
from .arguments import add_scene, print_sizing, print_study, scene_of


def add_arguments(parser):
    """Declare the scene and its values."""
    add_scene(parser)


def run(arguments):
    """Refuse what a run would refuse, else print what it would solve and warn of before; also of a study or sizing."""
    from ..runner import notices, simulation_of
    from ..sizing.requirements import is_sizing
    from ..solution import Solution
    from ..sweeps.study import is_study
    from .console import print_scene
    from .doubts import doubts_on

    if is_study(arguments.scene):
        if arguments.values:
            raise InputError(f"--set has no meaning for {arguments.scene}: it is a study, which has [parameters]")
        print_study(arguments.scene)
        return
    if is_sizing(arguments.scene):
        if arguments.values:
            raise InputError(f"--set has no meaning for {arguments.scene}: it has [parameters]")
        print_sizing(arguments.scene)
        return
    scene, system = scene_of(arguments).settle()
    solution = Solution(scene)
    simulation_of(scene, system, solution)
    print_scene(scene, system)
    for finding in [*notices(scene, system), *solution.findings, *doubts_on(scene, system)]:
        print(f"{finding.severity}: {finding.text}")
