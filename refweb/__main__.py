"""The command line: ``refweb VERB``, the verbs of `refweb.registry.COMMANDS`.

Exit status: 0 solved, 1 the solver failed, 2 wrong input, 130 interrupted. Nothing heavy is imported before a verb
needs it.

May change: words of messages, `THRESHOLDS`. Must stay: `alone`, which ``pyproject.toml`` names as the program; the exit
status, on which scripts of users rely; a verb is a module of `registry.COMMANDS` with `add_arguments`, `run` and its
help as docstring; what stands at the head of this file is loaded by every verb. Tests: ``tests/commands/test_cli.py``,
``tests/test_pay_for_what_you_call.py``.
"""

from __future__ import annotations

import argparse
import gc
import os
import signal
import sys
import threading
import warnings

from .errors import InputError
from .messages import nearest, short
from .registry import COMMANDS, known, load, load_installed, possible, registered_packages
from .sweeps.threads import use_one

THRESHOLDS = (50_000, 20, 100)
"""When Python looks for unreachable objects, see `gc.set_threshold`: imports make 100 000 that stay."""


def parser(names):
    """The `argparse.ArgumentParser` of the verbs of these names."""
    top = argparse.ArgumentParser(
        prog="refweb",
        description="Equilibrium and dynamics of space webs: cable nets, often slack, flat and tensionless.",
    )
    top.add_argument(
        "--version", action="store_true", help="show the versions of refweb and of what it stands on, and exit"
    )
    verbs = top.add_subparsers(dest="command", metavar="COMMAND", title="commands")
    for name in names:
        verb = load(COMMANDS[name])
        text = (verb.__doc__ or "").strip().replace("``", "").replace("%", "%%")
        form = argparse.RawDescriptionHelpFormatter
        verb.add_arguments(verbs.add_parser(name, help=_help(verb), description=text, formatter_class=form))
    return top


def _help(verb):
    """The first sentence of a verb's docstring, as a line of help."""
    line = " ".join((verb.__doc__ or "").split("\n\n")[0].split()).removesuffix(".").replace("%", "%%")
    return line[:1].lower() + line[1:]


def main(arguments=None):
    """Run the command line; return the exit status."""
    for stream in (sys.stdout, sys.stderr):
        if (reconfigure := getattr(stream, "reconfigure", None)) is not None:
            reconfigure(errors="replace")
    given = sys.argv[1:] if arguments is None else list(arguments)
    name = given[0] if given and not given[0].startswith("-") else None
    try:
        exists = name is None or known(COMMANDS, name)
    except InputError as error:
        print(f"refweb: {error}", file=sys.stderr)
        return 2
    for message in load_installed("verb") if name is None and "--version" not in given else ():
        print(f"refweb: {message}", file=sys.stderr)
    top = parser([name] if name in COMMANDS else COMMANDS)
    if not exists:
        top.error(f"{short(name)}: there is no such command, {nearest(name, possible(COMMANDS))}")
    arguments = top.parse_args(given)
    if arguments.command is None and not arguments.version:
        top.print_help()
        return 2
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, signal.default_int_handler)  # a batch queue's end is an interruption too
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # overflow: what it leads to is found and named
            warnings.filterwarnings("ignore", message="Glyph")  # a title in a script the font of pictures lacks
            status = _print_versions() if arguments.version else load(COMMANDS[str(arguments.command)]).run(arguments)
        sys.stdout.flush()
    except InputError as error:
        print(f"refweb: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt as interruption:
        print(": ".join(["refweb: interrupted", *map(str, interruption.args)]), file=sys.stderr)
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
    return status or 0


def _print_versions():
    """Print versions of refweb and of what it stands on, a line each."""
    from .results.provenance import LIBRARIES, PLOTTING, versions

    for package, version in versions((*LIBRARIES, *PLOTTING)).items():
        print(package, version)


def _reason(error):
    """A message without a traceback; a fault of refweb's own, or of a plug-in, is named as one, with its place."""
    if type(error).__module__.startswith("refweb"):
        return str(error)
    import traceback

    frames = [
        (frame.f_globals.get("__name__", ""), frame.f_code.co_filename, line)
        for frame, line in traceback.walk_tb(error.__traceback__)
    ]
    packages = registered_packages()
    of_plug_ins = [frame for frame in frames if frame[0].partition(".")[0] in packages]
    module, path, line = (of_plug_ins or frames)[-1]
    reason = f"{type(error).__name__}: {error} ({os.path.basename(path)}:{line})"
    if of_plug_ins:
        return f"plug-in {module}: {reason}"
    return f"internal error, {reason}; please report it with the scene"


def alone():
    """Run `main` in a process of its own: with one thread of each library, and little garbage collection."""
    gc.set_threshold(*THRESHOLDS)
    use_one()
    try:
        return main()
    finally:
        gc.freeze()


if __name__ == "__main__":
    sys.exit(alone())
