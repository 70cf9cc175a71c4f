"""Arguments that several verbs have, and what they print as JSON."""

# Help texts here are those of verbs, which read `scene`, `values`, `json` and `force` of the parsed arguments.

import contextlib
import json


def add_scene(parser):
    """The scene to work on."""
    parser.add_argument("scene", metavar="SCENE", help="a scene file, or the name of a scene shipped with refweb")


def add_values(parser):
    """Values in place of those of the scene."""
    text = (
        "a value in place of the scene's, by its path, as solve.duration=0.5 or body.0.velocity=[0,0,2]; an effect is "
        "left out by false, as contact=false; repeatable"
    )
    parser.add_argument("--set", dest="values", action="append", default=[], metavar="PATH=VALUE", help=text)


def scene_of(arguments):
    """The scene that `add_scene` and `add_values` ask for."""
    from ..scene import Scene

    if not arguments.values:
        return Scene.load(arguments.scene)
    from ..reference.paths import read_settings

    return Scene.load(arguments.scene, read_settings(arguments.values))


def add_json(parser):
    """Add the option that prints JSON."""
    parser.add_argument("--json", action="store_true", help="as JSON")


def print_json(content):
    """Print a dict as JSON."""
    print(json.dumps(content, indent=1, ensure_ascii=False))


def add_force(parser):
    """Leave to replace results."""
    parser.add_argument("--force", action="store_true", help="replace the results of an earlier run in DIR")


@contextlib.contextmanager
def resumable(folder):
    """Say of a run that is interrupted how it goes on; ``folder`` is its result folder, None for none."""
    try:
        yield
    except KeyboardInterrupt:
        if folder is None:
            raise
        import pathlib

        from ..results.folder import read_summary, remedy

        folder = pathlib.Path(folder)
        begun = (read_summary(folder) or {}).get("status") == "interrupted"
        raise KeyboardInterrupt(*([remedy(folder)] if begun else [])) from None


def print_sizing(source):
    """Print what a requirements file sizes, without running it; refuses what `refweb size` refuses."""
    from ..sizing.size import prepared
    from .console import print_size_begins

    print_size_begins(prepared(source)[0])
    print(f"requirements, of which refweb size {source} finds the least design")


def print_study(source):
    """Print what a study runs, without running it; refuses what `refweb sweep` refuses."""
    from ..sweeps.study import load
    from ..sweeps.sweep import prepared
    from .console import print_sweep_begins

    print_sweep_begins(prepared(load(source))[0])
    print(f"a study, many runs of one scene: refweb sweep {source} runs it")
