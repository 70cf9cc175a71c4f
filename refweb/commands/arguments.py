"""Arguments that several verbs have, and what they print as JSON."""

# May change: help texts, which are those of verbs. Must stay: names of options, and of the parsed arguments ("scene",
# "values", "json", "force", "workers", "scheduler"), which verbs read; what the functions return; all names that
# `check`, `run` and other files import. Tests: tests/commands/test_cli.py, tests/commands/test_values.py.

import contextlib
import json
import pathlib

from ..errors import InputError


def add_scene(parser):
    """Declare the argument for the scene, and the option for values in place of those of the scene."""
    parser.add_argument("scene", metavar="SCENE", help="a scene file, or the name of a scene shipped with refweb")
    text = (
        "a value in place of the scene's, by its path, as solve.duration=0.5 or body.0.velocity=[0,0,2]; an effect is "
        "left out by false, as contact=false; repeatable"
    )
    parser.add_argument("--set", dest="values", action="append", default=[], metavar="PATH=VALUE", help=text)


def scene_of(arguments):
    """The scene that `add_scene` asks for."""
    from ..scene import Scene

    if not arguments.values:
        return Scene.load(arguments.scene)
    from ..reference.paths import read_settings

    return Scene.load(arguments.scene, read_settings(arguments.values))


def folder_of(arguments, title, kind=""):
    """Result folder that ``--out`` names, by default a title and a kind in the current folder."""
    from ..scene import slug

    return pathlib.Path(arguments.out if arguments.out is not None else slug(title) + kind)


def add_json(parser):
    """Declare the option that prints JSON."""
    parser.add_argument("--json", action="store_true", help="as JSON")


def print_json(content):
    """Print a dict as JSON."""
    print(json.dumps(content, indent=1, ensure_ascii=False))


def add_force(parser):
    """Declare the option that allows earlier results to be replaced."""
    parser.add_argument("--force", action="store_true", help="replace the results of an earlier run in DIR")


def add_workers(parser, runs="it", use=""):
    """Declare the options for workers: their help names the ``runs``, and the ``use`` of several processes."""
    text = f"processes of this machine{use} (default: one for each processor)"
    parser.add_argument("--workers", type=int, metavar="N", help=text)
    text = f"run {runs} on a Dask cluster, tcp://HOST:PORT of its scheduler; needs refweb[cluster]"
    parser.add_argument("--scheduler", metavar="ADDRESS", help=text)


@contextlib.contextmanager
def workers_of(arguments, text):
    """Options of `refweb.sweep` and `refweb.size` for the workers asked for; progress begins with a text."""
    from ..results.progress import followed
    from ..sweeps import workers

    if arguments.workers is not None and arguments.scheduler is not None:
        raise InputError(
            f"--workers {arguments.workers} has no meaning with --scheduler, whose workers are there: leave it out"
        )
    with contextlib.ExitStack() as stack:
        executor = stack.enter_context(workers.cluster(arguments.scheduler)) if arguments.scheduler else None
        tell = stack.enter_context(followed(True, text))
        yield {"executor": executor, "workers": arguments.workers, "progress": tell}


@contextlib.contextmanager
def resumable(folder):
    """Tell how to resume a run that is interrupted in the block; ``folder`` is its result folder, or None."""
    try:
        yield
    except KeyboardInterrupt:
        if folder is None:
            raise
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
