"""Sections of text and tables of a page: results, warnings, model, cost, scene and versions, as HTML.

May change: private functions, headings, `KINDS`, `LONGEST` and the order of rows; sentences belong in
`results.summary_text`. Must stay: keys that are read, those of ``run.json`` and ``scene.toml``; classes, which
``page.css`` knows; identities of sections, which are links; `simulated`, which `page` imports. Tests:
``tests/pages/test_page.py``.
"""

from __future__ import annotations

from ..messages import quote
from ..registry import EFFECTS, possible
from ..results.files import as_toml
from ..results.summary_text import (
    on_cost,
    on_results,
    on_run,
    on_solver,
    on_web,
    rows_of_modes,
    rows_of_results,
    rows_of_steps,
)
from .markup import Html, listing, pairs, section, table, tag

LONGEST = 1000
"""Largest number of characters of a line of the scene."""
KINDS = {"dynamic": "dynamics", "static": "statics", "modes": "modes"}


def results(record):
    """Results with ±, time and position."""
    summary, said = record.summary, []
    steps, values = summary.get("steps") or [], summary.get("results") or {}
    if record.kind == "modes" and steps:
        tables = [table(*rows_of_modes(steps[-1]))]
        if len(steps) > 1:
            said.append(f"of load step {steps[-1]['step']:g}, the last of {len(steps)}")
    elif len(steps) > 1:
        tables = [table(*rows_of_steps(steps))]
    elif values:
        columns, rows, _ = rows_of_results(values, dynamic=record.kind == "dynamic")
        tables = [table(columns, [[cell.removeprefix("t = ").removeprefix("at ") for cell in row] for row in rows])]
    else:
        tables = [tag("p", "There are no results." if summary else "Results are not known.")]
    said += [] if record.kind == "modes" else on_results(values)
    more = [*on_run(summary), *(("solver", text) for text in (on_solver(summary["solver"]) if values else ()))]
    return section("results", "Results", *tables, listing(said) if said else "", pairs(more) if more else "")


def warnings(record, lacking=()):
    """Warnings of the run, and sentences on missing data of its folder."""
    texts = [*record.summary.get("warnings", []), *lacking]
    body = listing(texts) if texts else tag("p", "None.")
    return section("warnings", "Warnings", tag("div", body, class_="warned") if texts else body)


def simulated(record):
    """Model of the run: sizes, cable, effects present and absent, solver."""
    scene = record.scene
    if not scene:
        return section("simulated", "What was simulated", tag("p", "This folder holds no scene.toml that can be read."))
    present = [name for name in possible(EFFECTS) if scene.get(name)]
    absent = [name for name in EFFECTS if name not in present]
    web = record.summary.get("web")
    rows: list = [("web", [_keys(scene.get("web", {})), tag("div", "; ".join(on_web(web))) if web else ""])]
    rows.append(("cable", _cable(scene.get("cable", {}))))
    supports = [_keys(entry) for name in ("supports", "support") for entry in _several(scene.get(name))]
    rows.append(("supports", [tag("div", entry) for entry in supports] or "the web's own"))
    effects = ", ".join(present) or "none but the tension of its lines"
    said = [tag("div", ["present: ", tag("b", effects)]), tag("div", f"absent: {', '.join(absent)}")]
    rows.append(("effects", said))
    for name in present:
        head = f"[[{name}]]" if isinstance(scene[name], list) else f"[{name}]"
        rows.append((head, [tag("div", _keys(entry)) for entry in _several(scene[name])]))
    rows += [(name, _keys(scene[name])) for name in ("solve", "accuracy", "output") if scene.get(name)]
    for name in ("observe", "event"):
        if scene.get(name):
            rows.append((f"[[{name}]]", [tag("div", _keys(entry)) for entry in scene[name]]))
    return section("simulated", "What was simulated", pairs(rows))


def cost(record):
    """Cost of the run, by effect."""
    spent = record.summary.get("cost")
    if not spent:
        return ""
    effects = sorted(spent.get("by_effect", {}).items(), key=lambda item: -item[1])
    largest = max((seconds for _, seconds in effects), default=0.0) or 1.0
    bars = [
        [name, Html(f'<span class="share" style="width:{8 * seconds / largest:.2f}em"></span> {seconds:.3g} s')]
        for name, seconds in effects
    ]
    remark = "Kernels of an effect, each timed alone at the end and multiplied by its calls: an estimate."
    parts = [tag("p", on_cost(spent))] + ([table(["effect", "CPU time"], bars), tag("p", remark)] if bars else [])
    return section("cost", "Cost", *parts)


def scene(record):
    """The scene file with all defaults."""
    if not record.scene:
        return ""
    lines = [
        line if len(line) <= LONGEST else f"{line[:LONGEST]} … ({len(line) - LONGEST} characters more in scene.toml)"
        for line in _together(as_toml(record.scene)).splitlines()
    ]
    what = tag("summary", "The scene file, with all defaults filled in")
    return section("scene", "Scene", tag("details", [what, tag("pre", "\n".join(lines), tabindex="0")]))


def versions(record):
    """Versions of refweb and the libraries of the run."""
    libraries = record.summary.get("versions") or {}
    seed = record.summary.get("seed")
    rows = [*libraries.items(), *([("seed", seed)] if seed is not None else [])]
    return section("versions", "Versions", pairs(rows)) if rows else ""


def _several(given):
    """Tables of a name, a list also for one table."""
    return given if isinstance(given, list) else [given] if given else []


def _keys(given):
    """Keys and values of a table, in one line."""
    return _listed({key: _value(value) for key, value in given.items() if value != {}})


def _listed(words):
    """Names and their values, in one line."""
    return Html(", ".join(tag("span", f"{key} = {value}", class_="key") for key, value in words.items()))


def _value(value):
    if isinstance(value, list) and len(value) > 12:
        return f"{len(value)} entries"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_value(item)}" for key, item in value.items()) + " }"
    return quote(value)


def _cable(cable):
    units = {"modulus": "Pa", "area": "m²", "density": "kg/m³", "strength": "Pa"}
    groups = [tag("div", [f"group {name}: ", _keys(entry)]) for name, entry in cable.get("groups", {}).items()]
    plain_keys = {
        key: f"{value:g} {units[key]}" if key in units else _value(value)
        for key, value in cable.items()
        if key != "groups"
    }
    return [tag("div", _listed(plain_keys)), *groups]


def _together(text):
    """TOML with each list of numbers on one line."""
    lines, inside = [], False
    for line in text.splitlines():
        if inside:
            lines[-1] += line.strip() + (" " if line.strip().endswith(",") else "")
            inside = line.rstrip() != "]"
            if not inside:
                lines[-1] = lines[-1].replace(", ]", "]")
        else:
            lines.append(line)
            inside = line.endswith("= [")
    return "\n".join(lines)
