"""The page of a run: one HTML file that needs nothing else."""

from __future__ import annotations

import base64
import hashlib
import os
import re
import string
from pathlib import Path

from .. import __version__
from ..errors import InputError
from ..pictures.record import of_folder, of_solution
from ..results.files import write_text
from ..results.folder import read_summary, so_far
from . import drawings, sections
from .markup import Html, html, tag

SCRIPTS = ("model.js", "webgl.js", "hand.js", "view.js")
NAME = "report.html"
"""What the page of a result folder is called."""


def report(folder, out=None, frames=None, progress=None):
    """Write the page of a result folder.

    Parameters
    ----------
    folder : path-like
        A result folder of a run or of modes; one that failed or was killed has its page as well.
    out : path-like, optional
        The file; by default ``report.html`` in the folder.
    frames : int, optional
        Number of frames that can be turned and played; by default as many as leave the page small.
    progress : callable, optional
        Called with a line of text and the share that is done, 0 to 1.

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    InputError
        Where the folder is no result folder, the file cannot be written, or ``frames`` is below 1.
    """
    folder = Path(folder)
    record = of_folder(folder, seen=False)
    if record.status == "running":
        record = record._replace(summary=so_far(folder, read_summary(folder)))
    return _write(record, folder / NAME if out is None else out, frames, progress)


def report_of(solution, out, frames=None):
    """Write the page of a solution, wherever it is; see `report`."""
    return _write(of_solution(solution, seen=False), out, frames, None)


def _write(record, out, frames, progress):
    out = Path(out)
    if out.suffix.lower() not in (".html", ".htm"):
        raise InputError(f'out = "{out}" must end in .html')
    if not out.parent.is_dir():
        raise InputError(f'out = "{out}": there is no folder "{out.parent}"')
    if out.is_dir() or not os.access(out.parent, os.W_OK):
        raise InputError(f'out = "{out}": cannot be written, choose another place')
    write_text(out, page_of(record, frames, progress))
    return out


def page_of(record, frames=None, progress=None):
    """The page of a record, as text."""
    parts = [sections.results(record), sections.warnings(record), drawings.space(record, frames, progress)]
    parts += [sections.simulated(record), drawings.plots(record), drawings.pictures(record)]
    parts += [make(record) for make in (sections.cost, sections.scene, sections.versions)]
    parts = [part for part in parts if part]
    contents = [re.match(r'<section id="([^"]*)"><h2>(.*?)</h2>', part) for part in parts]
    script = "\n" + "\n".join(map(_read, SCRIPTS))
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    return string.Template(_read("page.html")).substitute(
        title=html(record.title),
        version=html(__version__),
        status=_status(record),
        style=_read("page.css"),
        contents=html([tag("a", Html(found[2]), href=f"#{found[1]}") for found in contents if found]),
        main="\n".join(parts),
        script=script[1:],
        script_hash=f"sha256-{digest}",
    )


def _status(record):
    """How the run ended, and what it was."""
    solver = record.summary.get("solver") or {}
    what = f"{sections.KINDS.get(record.kind, record.kind)}, {solver.get('method') or 'method unknown'}"
    status = record.status if record.summary else "unknown: there is no run.json"
    badge = tag("span", status, class_="status" + " bad" * (record.status != "solved"))
    return html([badge, f" {what}. ", record.summary.get("message") or ""])


def _read(name):
    return (Path(__file__).parent / name).read_text(encoding="utf-8")
