"""The page of a study: statistics of its rows, a plot of each result, and the rows, as one HTML file.

May change: private functions, the order of sections and `MOST_ROWS`; sentences belong in `results.study_text`. Must
stay: `report`, which `commands.report` and `commands.sweep` call; classes, which ``page.css`` knows. Tests:
``tests/sweeps/test_study_pages.py``.
"""

from __future__ import annotations

from pathlib import Path

from ..pictures.pictures import target
from ..pictures.plots import as_svg
from ..pictures.studies import draw, of_folder
from ..results import study_text as words
from ..results.case_rows import FIRST, LAST, NAME, read
from ..results.files import write_text
from ..results.folder import so_far
from ..results.summary_text import on_cost
from . import page
from .markup import figure, html, image, listing, pairs, section, table, tag
from .sections import warnings

MOST_ROWS = 500
"""Largest number of rows on a page."""


def report(folder, out=None):
    """Write the page of a study, by default ``report.html`` in its folder; returns the file.

    Raises
    ------
    InputError
        If the folder contains no study, or the file cannot be written.
    """
    folder = Path(folder)
    study = of_folder(folder)
    if study.summary["status"] == "running":
        study = study._replace(summary=so_far(folder, study.summary))
    out = target(folder / page.NAME if out is None else Path(out), page.ENDINGS)
    write_text(out, page_of(study, read(folder / NAME)))
    return out


def page_of(study, rows):
    """The page of a study, as text; ``rows`` are all of its rows."""
    summary = study.summary
    status = tag("span", summary["status"], class_="status" + " bad" * (summary["status"] != "solved"))
    parts = [_together(summary), warnings(study), _plots(study), _rows(study, rows), _study(summary)]
    return page.filled(
        summary["title"],
        html([status, f" {words.on_count(summary)}. ", summary["message"] or ""]),
        [*parts, section("versions", "Versions", pairs(summary["versions"].items()))],
        "",
    )


def _together(summary):
    """Statistics of all rows, group by group."""
    said = [tag("p", text) for text in summary["reasons"]]
    for entry in summary["chances"]:
        if of := words.of_group(entry["of"]):
            said.append(tag("h3", of))
        for make in (words.rows_of_spread, words.rows_of_conditions, words.rows_of_indices):
            statistics_of = make(entry)
            said += [table(statistics_of.columns, statistics_of.rows)] if statistics_of.rows else []
        texts = [*words.on_spread(entry), *words.on_indices(entry)]
        said += [listing(texts)] if texts else []
    said += [tag("p", text, class_="note") for text in words.on_samples(summary["study"])]
    return section("results", "Results", *said)


def _plots(study):
    """A plot of each result."""
    drawn = []
    for result in study.results if study.rows else []:
        picture = image("svg+xml", as_svg(draw(study, result)).encode(), f"{result.name} of all cases")
        drawn.append(figure(picture, result.name))
    body = tag("div", drawn, class_="plots") if drawn else tag("p", "No case has a result.")
    return section("plots", "Plots", body)


def _rows(study, rows):
    """The rows, numbers to six digits."""
    columns = [name for name in study.columns if name != "statistical"]
    columns.sort(key=lambda name: name in (*FIRST, *LAST))
    cells = [[_cell(row.get(name)) for name in columns] for row in rows[:MOST_ROWS]]
    remark = f"All digits are in {NAME}."
    if len(rows) > MOST_ROWS:
        remark += f" The first {MOST_ROWS} of {len(rows)} rows are here."
    body = table(columns, cells) if rows else tag("p", "There are no rows.")
    return section("rows", "Rows", tag("details", [tag("summary", f"{len(rows)} rows"), body]), tag("p", remark))


def _cell(value):
    return "" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)


def _study(summary):
    """The study file and the cost of the study."""
    import tomli_w

    varied, how = words.on_design(summary["study"])
    cost = summary["cost"]
    spent = f"{cost['cases_cpu_s']:.2f} s CPU of all cases; the last start {on_cost(cost)}"
    text = tomli_w.dumps(summary["study"])
    file = tag("details", [tag("summary", "The study file, with all defaults filled in"), tag("pre", text)])
    return section(
        "study",
        "Study",
        pairs([("scene", summary["scene"]), ("varied", varied), ("cases", how), ("cost", spent)]),
        file,
    )
