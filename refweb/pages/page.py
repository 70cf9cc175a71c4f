"""The page of a run: one HTML file without other files, from a result folder or a solution.

May change: private functions, the order of sections and sentences. Must stay: names that `filled` gives, which
``page.html`` has; the order of `SCRIPTS`, in which they run; the hash of a script, which is that of its text between
the tags of ``page.html``, line breaks included: browsers run no other; `NAME`, the file, and `ENDINGS`; `report_of`,
which `solution` imports; `report`, which `commands.report`, `commands.view` and `sizing.size` import; `sheet`, which
`commands.report` imports. Tests: ``tests/pages/test_page.py``, ``tests/pages/test_browser.py``.
"""

from __future__ import annotations

import base64
import functools
import hashlib
import json
import re
import string
from pathlib import Path

from .. import __version__
from ..errors import InputError
from ..pictures.pictures import target
from ..pictures.record import of_folder, of_solution
from ..results.files import write_text
from ..results.folder import read_summary, so_far
from . import drawings, sections
from . import sheet as sheets
from .markup import Html, html, tag
from .sheet_text import PACKING

SCRIPTS = ("model.js", "webgl.js", "hand.js", "view.js")
ENDINGS = ("html", "htm")
NAME = "report.html"
"""Name of the page of a result folder."""


def report(folder, out=None, frames=None, progress=None):
    """Write the page of a result folder.

    Parameters
    ----------
    folder : path-like
        A result folder of a run or of modes; a run that failed or was killed has a page as well.
    out : path-like, optional
        The file; by default ``report.html`` in the folder.
    frames : int, optional
        Number of frames in the three-dimensional view; by default as many as keep the page small.
    progress : callable, optional
        Called with a line of text and the finished share, 0 to 1.

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    InputError
        If the folder is not one of a run or of modes, the file cannot be written, or ``frames`` is below 1.
    """
    folder = Path(folder)
    record, unread = _record(folder)
    text = functools.partial(page_of, record, frames, progress, unread)
    return _write(text, folder / NAME if out is None else out)


def sheet(folder, out=None, packing=PACKING):
    """Write the sheet of a result folder: sizes, largest tension, margin of safety and the worth of the results.

    Parameters
    ----------
    folder : path-like
        A result folder of a run or of modes.
    out : path-like, optional
        The file; by default ``sheet.html`` in the folder.
    packing : float
        Share of the packed volume that is cable [1], > 0 and ≤ 1.

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    InputError
        If the folder is not one of a run or of modes, or the file cannot be written.
    """
    folder = Path(folder)
    if not 0.0 < packing <= 1.0:
        raise InputError(
            f"packing = {packing:g} must be > 0 and ≤ 1: it is the share of the packed volume that is cable"
        )
    text = functools.partial(_sheet_of, *_record(folder), packing)
    return _write(text, folder / sheets.NAME if out is None else out)


def _sheet_of(record, unread="", packing=PACKING):
    """The page with only the sheet, as text."""
    return filled(record.title, _status(record, unread), [sheets.sheet(record, packing)], "")


def _record(folder):
    """The record of a result folder of a run or of modes, and the reason of a missing summary; refuse other folders."""
    record = of_folder(folder, with_frames=False)
    record.refuse_others("pages")
    if record.status == "running":
        record = record._replace(summary=so_far(folder, read_summary(folder)))
    return record, "" if record.summary else _unread(folder / "run.json")


def report_of(solution, out=None, frames=None, only_sheet=False):
    """Write the page of a solution, or its sheet only, by default into its folder; see `report`."""
    if out is None and solution.path is None:
        raise InputError("out is missing: this solution has no folder, so say where the page goes, such as report.html")
    if only_sheet and frames is not None:
        raise InputError(f"frames = {frames} has no meaning for a sheet, which shows none: leave it out")
    record = of_solution(solution, with_frames=False)
    text = functools.partial(_sheet_of, record) if only_sheet else functools.partial(page_of, record, frames)
    return _write(text, Path(solution.path) / (sheets.NAME if only_sheet else NAME) if out is None else out)


def _unread(path):
    """Reason for which a ``run.json`` gives no summary, a text."""
    if not path.exists():
        return "there is no run.json"
    try:
        json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        return f"run.json cannot be read: {error}"
    return "run.json cannot be read: it is not what a run of refweb writes"


def _write(text, out):
    """Check that a file can be written, then write the page from ``text()`` to it."""
    out = Path(out)
    if out.suffix[1:].lower() not in ENDINGS:
        raise InputError(f'out = "{out}" must end in .html')
    write_text(target(out, ENDINGS), text())
    return out


def page_of(record, frames=None, progress=None, unread=""):
    """The page of a record, as text; ``unread`` is the reason of a missing summary."""
    frames_found = drawings.frames_of(record, frames, progress)
    lacking = list(_lacking(record, frames_found, unread))
    parts = [sheets.sheet(record), sections.results(record)]
    parts += [sections.warnings(record, lacking), drawings.space(record, frames_found)]
    parts += [sections.simulated(record), drawings.plots(record), drawings.pictures(record)]
    parts += [make(record) for make in (sections.cost, sections.scene, sections.versions)]
    parts = [part for part in parts if part]
    return filled(record.title, _status(record, unread), parts, "\n".join(map(_read, SCRIPTS)))


def filled(title, status, parts, script):
    """A page as text, from its title, status, sections and script."""
    contents = [re.match(r'<section id="([^"]*)"><h2>(.*?)</h2>', part) for part in parts]
    digest = base64.b64encode(hashlib.sha256(f"\n{script}".encode()).digest()).decode()
    return string.Template(_read("page.html")).substitute(
        title=html(title),
        version=html(__version__),
        status=status,
        style=_read("page.css"),
        contents=html([tag("a", Html(section[2]), href=f"#{section[1]}") for section in contents if section]),
        main="\n".join(parts),
        script=script,
        script_hash=f"sha256-{digest}",
    )


def _lacking(record, drawn, unread):
    """Sentences on missing data: summary, history, frames."""
    if unread:
        yield f"Results, warnings and how the run ended are not known: {unread}."
    try:
        _, history = record.table()
        if not len(next(iter(history.values()), [])):
            yield "The history has no rows."
    except InputError:
        yield "The history cannot be read."
    if drawn is None:
        yield "No frame can be drawn." if record.times else "There are no frames."


def _status(record, unread):
    """Sentence on the status of a run and its scene, as far as they are known."""
    method = (record.summary.get("solver") or {}).get("method")
    known = [sections.KINDS.get(record.kind) or record.kind] if record.scene or record.kind != "dynamic" else []
    known += [str(method)] if method else []
    status = unread.partition(":")[0] or record.status
    badge = tag("span", status, class_="status" + " bad" * (status != "solved"))
    return html([badge, f" {', '.join(known)}. " if known else " ", record.summary.get("message") or ""])


def _read(name):
    return (Path(__file__).parent / name).read_text(encoding="utf-8")
