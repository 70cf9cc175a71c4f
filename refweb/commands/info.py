"""Print the content of a scene, a study, requirements or a result folder."""

# This docstring is the help of the verb. May change: texts. Must stay: `add_arguments` and `run`, which
# `refweb.__main__` calls; the call of `show(summary)` of the verb that `kind` in `run.json` names; keys of `--json`,
# which are for scripts. Tests: tests/commands/test_cli.py.

import json
import pathlib

from ..errors import InputError
from ..registry import COMMANDS, known, load
from .arguments import add_json, print_json, print_sizing, print_study


def add_arguments(parser):
    """Declare the scene or folder, and the format."""
    parser.add_argument("source", metavar="SCENE | DIR")
    add_json(parser)


def run(arguments):
    """Print the content of a result folder, a study, requirements or a scene."""
    from ..scene import shipped
    from ..sizing.requirements import is_sizing
    from ..sweeps.study import is_study

    folder = pathlib.Path(arguments.source)
    if folder.is_dir() and ((folder / "run.json").exists() or str(folder) not in shipped()):
        _folder(folder, arguments.json)
    elif is_study(arguments.source):
        _study(arguments.source, arguments.json)
    elif is_sizing(arguments.source):
        _sizing(arguments.source, arguments.json)
    else:
        _scene(arguments.source, arguments.json)


def _folder(folder, as_json):
    try:
        summary = json.loads((folder / "run.json").read_text(encoding="utf-8"))
        if summary.get("status") == "running":
            from ..results.folder import so_far

            summary = so_far(folder, summary)
        if as_json:
            print_json(summary)
        else:
            verb = summary.get("kind", "run")
            known(COMMANDS, verb)
            load(COMMANDS[verb]).show(summary)
    except FileNotFoundError:
        raise InputError(f"{folder}: holds no run.json, so it is not a result folder of refweb") from None
    except BrokenPipeError:
        raise
    except (ValueError, OSError, RecursionError) as error:
        raise InputError(f"{folder}/run.json: cannot be read: {error}") from None
    except (KeyError, TypeError, IndexError, AttributeError):
        raise InputError(f"{folder}/run.json: is not what a run of refweb writes") from None


def _study(source, as_json):
    if not as_json:
        print_study(source)
        return
    from ..sweeps.study import load

    study = load(source).to_dict()
    print_json({"study": {key: value for key, value in study.items() if key != "folder"}})


def _sizing(source, as_json):
    if not as_json:
        print_sizing(source)
        return
    from ..sizing.requirements import load

    print_json({"sizing": load(source).to_dict()})


def _scene(source, as_json):
    from ..results.provenance import web_of
    from ..scene import Scene

    scene = Scene.load(source)
    system = scene.build()
    if as_json:
        print_json({"scene": scene.to_dict(), "web": web_of(system)})
    else:
        from .console import print_scene

        print_scene(scene, system)
