"""Look at a result folder: its page in a browser, a window, or a script for ParaView."""

# This docstring is the help of the verb. May change: texts. Must stay: `add_arguments` and `run`, which
# `refweb.__main__` calls; names of options; that a page older than `run.json` is written anew. Tests:
# tests/pictures/test_viewers.py.

import pathlib
import sys

from ..errors import InputError


def add_arguments(parser):
    """Declare the folder and the viewer."""
    parser.add_argument("folder", metavar="DIR")
    group = parser.add_mutually_exclusive_group()
    group.add_argument("--window", action="store_true", help="a window of pyvista, with a slider over the frames")
    group.add_argument("--paraview", action="store_true", help="write a script for paraview --script=FILE")
    parser.add_argument("--field", metavar="NAME", help="what the colours of --window and --paraview show")
    parser.add_argument("--out", metavar="FILE", help="where --paraview writes it (default: DIR/web_in_paraview.py)")


def run(arguments):
    """Show the folder in the viewer that is asked for."""
    elsewhere = arguments.window or arguments.paraview
    if arguments.out is not None and not arguments.paraview:
        raise InputError(f"--out {arguments.out} belongs to --paraview; the page is written by refweb report --out")
    if arguments.field is not None and not elsewhere:
        raise InputError(f"--field {arguments.field} belongs to --window or --paraview; the page shows all fields")
    if arguments.window:
        from ..pictures.window import window

        window(arguments.folder, arguments.field)
    elif arguments.paraview:
        from ..pictures.paraview import script

        print(script(arguments.folder, arguments.field, arguments.out))
    else:
        _browse(pathlib.Path(arguments.folder))


def _browse(folder):
    """Open the page of a folder, which is written first where there is none that is newer than the run."""
    import webbrowser

    from ..pages.page import NAME, report
    from ..results.progress import followed

    page, run = folder / NAME, folder / "run.json"
    if not page.exists() or (run.exists() and page.stat().st_mtime < run.stat().st_mtime):
        with followed(True, "drawing") as tell:
            report(folder, progress=tell)
    print(page)
    if not webbrowser.open(page.resolve().as_uri()):
        words = "no browser was found to open it with; it is one file, open it wherever there is one"
        print(f"refweb: {page}: {words}", file=sys.stderr)
