"""What a scene or a result folder holds."""

import json
import pathlib

from ..errors import InputError
from ..registry import COMMANDS, load


def add_arguments(parser):
    """The scene or the folder, and how to print it."""
    parser.add_argument("source", metavar="SCENE | DIR")
    parser.add_argument("--json", action="store_true", help="as JSON")


def run(arguments):
    """Print what is there."""
    folder = pathlib.Path(arguments.source)
    if folder.is_dir() and ((folder / "run.json").exists() or not _is_shipped(arguments.source)):
        _folder(folder, arguments.json)
    else:
        _scene(arguments.source, arguments.json)


def _is_shipped(name):
    """Whether that is the name of a shipped scene, which a folder without results does not hide."""
    from ..scene import SHIPPED_SCENES

    return (SHIPPED_SCENES / f"{pathlib.Path(name).name.removesuffix('.toml')}.toml").exists()


def _folder(folder, as_json):
    try:
        summary = json.loads((folder / "run.json").read_text(encoding="utf-8"))
        if summary.get("status") == "running":
            summary = _so_far(folder, summary)
        if as_json:
            _print(summary)
        else:
            load(COMMANDS[summary.get("kind", "run")]).show(summary)
    except FileNotFoundError:
        raise InputError(f"{folder}: holds no run.json, so it is not a result folder of refweb") from None
    except BrokenPipeError:
        raise
    except (ValueError, OSError, RecursionError) as error:
        raise InputError(f"{folder}/run.json: cannot be read: {error}") from None
    except (KeyError, TypeError, IndexError, AttributeError):
        raise InputError(f"{folder}/run.json: is not what a run of refweb writes") from None


def _so_far(folder, summary):
    """The summary of a run without an end: how far it came, and whether it is dead."""
    from ..results.folder import is_alive, reached

    alive, at = is_alive(folder), reached(folder)
    text = f"it has reached {at}" if at else "it has written no row"
    if alive is False:
        return {**summary, "status": "killed", "message": f"its process is dead; {text}; {_remedy(folder)}"}
    return {**summary, "message": f"{text}; {'its process is alive' if alive else 'whether it is alive is not known'}"}


def _remedy(folder):
    if (folder / "checkpoint.npz").exists():
        return f"refweb resume {folder} continues it"
    return "refweb run --force starts it again"


def _scene(source, as_json):
    from ..console import print_scene
    from ..results.provenance import web_of
    from ..scene import Scene

    scene = Scene.load(source)
    system = scene.build()
    if as_json:
        _print({"scene": scene.to_dict(), "web": web_of(system)})
    else:
        print_scene(scene, system)


def _print(content):
    print(json.dumps(content, indent=1, ensure_ascii=False))
