"""Compile what the shipped scenes need, for images of machines and for clusters.

Machine code is kept in a cache folder of the user's, or in the folder that the environment variable REFWEB_CACHE names.
Two processes compile where there are two cores; REFWEB_COMPILERS=1 leaves it to one. With ``--ship`` machine code that
all usual processors of this kind run is written into the package itself, for a wheel.
"""

# This docstring is the help of the verb. May change: `METHODS` and `ROWS`, which decide what is compiled ahead: users
# compile the rest at its first use. Must stay: `add_arguments` and `run`, which `refweb.__main__` calls; `--ship`, by
# which wheels are built, and its setting of processors before numba is imported. No test runs this file.

import contextlib
import dataclasses
import os

METHODS = ("cvode", "ida", "explicit")
"""Methods that no shipped scene has by default."""
ROWS = 2
"""Rows of history that each scene is run for."""


def add_arguments(parser):
    """Declare the option for a wheel."""
    parser.add_argument("--ship", action="store_true", help="write into the package, for a wheel")


def run(arguments):
    """Run each scene for some rows; what is on disk already is not compiled again."""
    if arguments.ship:
        _ship()
    import refweb

    from ..scene import shipped

    scenes = {name: refweb.Scene.load(name) for name in shipped()}
    square, solve = scenes["square-impact"], refweb.Dynamic
    scenes |= {f"square-impact, {m}": square.replace(solve=solve(duration=1.0, method=m)) for m in METHODS}
    for name, scene in scenes.items():
        if scene.solve.kind == "dynamic":
            longest = max(
                [ROWS * (scene.output.interval or 1e-3), *(observe.average or 0.0 for observe in scene.observe)]
            )
            scene = scene.replace(solve=dataclasses.replace(scene.solve, duration=longest))
            _foresee(scene)
        cost = refweb.run(scene).cost
        print(f"{name}: {cost['compile_s']:.1f} s of compiling")


def _foresee(scene):
    """Compute the expected steps that the box before a run prints, where it prints them."""
    from ..dynamics.expected_cost import expected_cost
    from ..errors import InputError
    from ..registry import INTEGRATORS

    if INTEGRATORS[scene.solve.method].knob == "safety":
        with contextlib.suppress(InputError):
            expected_cost(scene, scene.build())


def _ship():
    """Keep machine code in the package, made for the processors that wheels are for; before numba is imported."""
    from ..compiled.store import SHIPPED, portable
    from ..errors import InputError

    processor = portable()
    if processor is None:
        raise InputError("--ship: no processor is known that machine code in a wheel would be made for here")
    os.environ["REFWEB_CACHE"] = str(SHIPPED)
    os.environ["NUMBA_CPU_NAME"], os.environ["NUMBA_CPU_FEATURES"] = processor
