"""Compute natural frequencies and mode shapes about the equilibrium of a scene."""

# This docstring is the help of the verb. May change: texts. Must stay: `add_arguments` and `run`, which
# `refweb.__main__` calls, and `show`, which `refweb info` calls for a `run.json` of this kind; names of options. Tests:
# tests/studies/test_modes.py.

from .arguments import add_force, add_scene, folder_of, scene_of


def add_arguments(parser):
    """Declare the scene, the number of modes and the folder."""
    add_scene(parser)
    parser.add_argument("-n", dest="number", type=int, default=10, metavar="N", help="how many (default: 10)")
    parser.add_argument("--out", metavar="DIR", help="result folder (default: the title and -modes)")
    add_force(parser)


def run(arguments):
    """Print the scene, compute its modes, print the modes."""
    from ..results.progress import followed
    from ..studies.modes import modes
    from .console import print_scene

    scene = scene_of(arguments)
    out = folder_of(arguments, scene.title, "-modes")
    with followed(True) as tell:
        spectra = modes(scene, arguments.number, out=out, force=arguments.force, progress=tell, announce=print_scene)
    show(spectra.summary())
    print(f"modes in {out}")


def show(summary):
    """Print the box of modes from the content of their ``run.json``."""
    from .console import print_modes

    print_modes(summary)
