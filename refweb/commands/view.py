"""Look at a result folder: its page in a browser."""

import pathlib

from ..errors import InputError


def add_arguments(parser):
    """The folder."""
    parser.add_argument("folder", metavar="DIR")


def run(arguments):
    """Show it."""
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
        raise InputError(f"{page}: there is no browser to open it with; it is one file, open it wherever there is one")
