"""Check a scene without solving it; writes nothing."""


def add_arguments(parser):
    """The scene."""
    parser.add_argument("scene", metavar="SCENE")


def run(arguments):
    """Refuse what a run would refuse, else print what it would solve."""
    from ..console import print_scene
    from ..runner import simulation_of
    from ..scene import Scene
    from ..solution import Solution

    scene = Scene.load(arguments.scene).settled()
    system = scene.build()
    simulation_of(scene, system, Solution(scene))
    print_scene(scene, system)
