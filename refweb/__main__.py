"""The command line: ``refweb run | resume | check | info | picture | modes | cost``.

Exit status: 0 solved, 1 the solver failed, 2 wrong input, 130 interrupted. Nothing heavy is imported before a command
needs it.
"""

from __future__ import annotations

import argparse
import os
import pathlib
import signal
import sys
import threading
import warnings
from dataclasses import replace

from .errors import InputError


def parser():
    """The `argparse.ArgumentParser` of all commands."""
    top = argparse.ArgumentParser(
        prog="refweb",
        description="Equilibrium and dynamics of space webs: cable nets, often slack, flat and tensionless.",
    )
    top.add_argument("--version", action="store_true", help="show the version and leave")
    commands = top.add_subparsers(dest="command", metavar="COMMAND", title="commands")

    command = commands.add_parser("run", help="solve a scene and write its result folder")
    command.add_argument("scene", metavar="SCENE", help="a scene file, or the name of a scene shipped with refweb")
    command.add_argument("--out", metavar="DIR", help="result folder (default: the title, in the current folder)")
    command.add_argument("--force", action="store_true", help="replace the results of an earlier run in DIR")
    command.add_argument("--horizon", action="store_true", help="find how long the motion is determined")

    command = commands.add_parser("resume", help="go on with a dynamic run that was killed, interrupted or failed")
    command.add_argument("folder", metavar="DIR", help="its result folder")

    command = commands.add_parser("check", help="check a scene without solving it; writes nothing")
    command.add_argument("scene", metavar="SCENE")

    command = commands.add_parser("info", help="what a scene or a result folder holds")
    command.add_argument("source", metavar="SCENE | DIR")
    command.add_argument("--json", action="store_true", help="as JSON")

    command = commands.add_parser("picture", help="draw a result folder")
    command.add_argument("folder", metavar="DIR")
    command.add_argument("--frame", type=int, metavar="N", help="number of the frame (default: the last)")
    command.add_argument("--field", metavar="NAME", help="what the colours show (default: stress)")
    command.add_argument("--out", metavar="FILE", help="picture to write (default: DIR/web.png)")
    command.add_argument("--animate", action="store_true", help="all frames as a GIF (default: DIR/web.gif)")

    command = commands.add_parser("modes", help="natural frequencies and mode shapes about the equilibrium of a scene")
    command.add_argument("scene", metavar="SCENE", help="a scene file, or the name of a scene shipped with refweb")
    command.add_argument("-n", dest="number", type=int, default=10, metavar="N", help="how many (default: 10)")
    command.add_argument("--out", metavar="DIR", help="result folder (default: the title and -modes)")
    command.add_argument("--force", action="store_true", help="replace the results of an earlier run in DIR")

    command = commands.add_parser("cost", help="what digits cost: errors and CPU times of every method on a scene")
    command.add_argument("scene", metavar="SCENE", help="a scene file, or the name of a scene shipped with refweb")
    command.add_argument("--out", metavar="DIR", help="folder for cost.png and cost.csv (default: none is written)")
    command.add_argument("--budget", type=float, default=120.0, metavar="SECONDS", help="for all of it (default: 120)")
    command.add_argument("--observe", metavar="NAME", help="observable that errors are of (default: the first)")
    command.add_argument("--force", action="store_true", help="replace the results of an earlier run in DIR")
    return top


def _run(arguments):
    from .console import after, before, progress
    from .runner import run
    from .scene import Scene, slug

    scene = Scene.load(arguments.scene)
    if arguments.horizon:
        if scene.solve.kind == "static":
            raise InputError(f"--horizon has no meaning for {arguments.scene}: it is static, leave it out")
        scene = scene.replace(accuracy=replace(scene.accuracy, horizon=True))
    out = pathlib.Path(arguments.out if arguments.out is not None else slug(scene.title))
    with progress() as tell:
        solution = run(scene, out=out, force=arguments.force, progress=tell, announce=before)
    after(solution, out)


def _resume(arguments):
    from .console import after, before, progress
    from .runner import resume

    with progress() as tell:
        solution = resume(arguments.folder, progress=tell, announce=before)
    after(solution, arguments.folder)


def _check(arguments):
    from .console import before
    from .results.solution import Solution
    from .runner import follower_of
    from .scene import Scene

    scene = Scene.load(arguments.scene)
    system = scene.build()
    follower_of(scene, system, Solution(scene))
    before(scene, system)


def _info(arguments):
    import json

    from .console import before, modal, stored, work_precision
    from .results.provenance import web_of
    from .scene import Scene

    folder = pathlib.Path(arguments.source)
    if folder.is_dir():
        try:
            summary = json.loads((folder / "run.json").read_text(encoding="utf-8"))
            if arguments.json:
                print(json.dumps(summary, indent=1, ensure_ascii=False))
            else:
                {"modes": modal, "cost": work_precision}.get(summary.get("kind"), stored)(summary)
        except FileNotFoundError:
            raise InputError(f"{folder}: holds no run.json, so it is no result of refweb") from None
        except BrokenPipeError:
            raise
        except (ValueError, OSError, RecursionError) as error:
            raise InputError(f"{folder}/run.json: cannot be read: {error}") from None
        except (KeyError, TypeError, IndexError, AttributeError):
            raise InputError(f"{folder}/run.json: is not what a run of refweb writes") from None
        return
    scene = Scene.load(arguments.source)
    system = scene.build()
    if arguments.json:
        print(json.dumps({"scene": scene.to_dict(), "web": web_of(system)}, indent=1, ensure_ascii=False))
    else:
        before(scene, system)


def _picture(arguments):
    from .console import progress
    from .pictures.pictures import animate, picture

    if arguments.animate:
        if arguments.frame is not None:
            raise InputError(f"--frame {arguments.frame} and --animate exclude each other: leave one out")
        with progress("drawing") as tell:
            path = animate(arguments.folder, field=arguments.field, out=arguments.out, progress=tell)
    else:
        with progress("drawing"):
            path = picture(arguments.folder, frame=arguments.frame, field=arguments.field, out=arguments.out)
    print(path)


def _modes(arguments):
    from .console import before, modal, progress
    from .scene import Scene, slug
    from .studies.modes import modes

    scene = Scene.load(arguments.scene)
    out = pathlib.Path(arguments.out if arguments.out is not None else f"{slug(scene.title)}-modes")
    with progress() as tell:
        found = modes(scene, arguments.number, out=out, force=arguments.force, progress=tell, announce=before)
    modal(found.summary())
    print(f"modes in {out}")


def _cost(arguments):
    from .console import before, progress, work_precision
    from .scene import Scene
    from .studies.work_precision import cost

    scene, out = Scene.load(arguments.scene), arguments.out
    options = {"observe": arguments.observe, "budget": arguments.budget, "out": out, "force": arguments.force}
    with progress() as tell:
        found = cost(scene, progress=tell, announce=before, **options)
    work_precision(found.summary())
    if out is not None:
        print(f"diagram in {pathlib.Path(out) / 'cost.png'}")


def main(arguments=None):
    """Run the command line; return the exit status."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")
    top = parser()
    arguments = top.parse_args(arguments)
    if arguments.version:
        from . import __version__

        print(f"refweb {__version__}")
        return 0
    if arguments.command is None:
        top.print_help()
        return 2
    own = {"run": _run, "resume": _resume, "check": _check, "info": _info, "picture": _picture, "modes": _modes}
    command = {**own, "cost": _cost}[arguments.command]
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, signal.default_int_handler)  # a batch queue's end is an interruption too
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # overflow: what it leads to is found and named
            warnings.filterwarnings("ignore", message="Glyph")  # a title in a script the font of pictures lacks
            command(arguments)
        sys.stdout.flush()
    except InputError as error:
        print(f"refweb: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("refweb: interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # what is left in the buffer goes nowhere
        return 1
    except OSError as error:
        print(f"refweb: {error.filename or 'file'}: {error.strerror or error}", file=sys.stderr)
        return 1
    except Exception as error:
        print(f"refweb: {_reason(error)}", file=sys.stderr)
        return 1
    return 0


def _reason(error):
    """A message without a traceback; a fault of refweb's own is named as one, with its place."""
    if type(error).__module__.startswith("refweb"):
        return str(error)
    last = error.__traceback__
    while last.tb_next is not None:
        last = last.tb_next
    place = f"{pathlib.Path(last.tb_frame.f_code.co_filename).name}:{last.tb_lineno}"
    return f"internal error, {type(error).__name__}: {error} ({place}); please report it with the scene"


if __name__ == "__main__":
    sys.exit(main())
