"""Check a scene without solving it; writes nothing."""

from .arguments import add_scene, add_values, scene_of


def add_arguments(parser):
    """The scene."""
    add_scene(parser)
    add_values(parser)


def run(arguments):
    """Refuse what a run would refuse, else print what it would solve, and what a run would warn of before."""
    from ..runner import notices, simulation_of
    from ..solution import Solution
    from .console import print_scene

    scene = scene_of(arguments).settled()
    system = scene.build()
    simulation_of(scene, system, Solution(scene))
    print_scene(scene, system)
    for finding in notices(scene, system):
        print(f"{finding.severity}: {finding.text}")
