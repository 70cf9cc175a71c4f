"""Display of a scene and of a solution in a notebook, as HTML.

May change: all of the look. Must stay: `of_solution` and `of_scene`, which `solution` and `scene` call; that each text
of a user is escaped here. Tests: ``tests/results/test_loaded.py``.
"""

from __future__ import annotations

from html import escape

from .units import other_errors, position_text, readable


def of_solution(solution):
    """Title, status, results with their ±, warnings and cost."""
    dynamic = not solution.steps
    head = ["result", "value", *(["time"] if dynamic else []), "at"]
    rows = []
    for name, result in solution.results.items():
        time = [f"{result.time:.6g} s"] if dynamic else []
        value = readable(result.value, result.error, result.unit, result.within)
        rows.append([name, value, *time, position_text(result.where, result.at)])
    remarks = other_errors(solution.summary()["results"])
    said = [*remarks, solution.message, *(f"warning: {text}" for text in solution.warnings)]
    cost = f"{solution.solver.get('method')}, {solution.cost['cpu_s']:.2f} s CPU"
    if len(solution.steps) > 1:
        said.insert(0, f"at load step {solution.steps[-1]['step']:g}, the last of {len(solution.steps)}")
    return _part(f"{solution.scene.title}: {solution.status}", _table(head, rows), [*filter(None, said), cost])


def of_scene(given, title):
    """The tables of a scene, as in its file."""
    rows = []
    for name, value in given.items():
        for entry in value if isinstance(value, list) else [value]:
            if isinstance(entry, dict):
                keys = ", ".join(f"{key} = {_short(content)}" for key, content in entry.items())
                rows.append([f"[[{name}]]" if isinstance(value, list) else f"[{name}]", keys])
    return _part(title, _table(["table", "keys"], rows), [])


def _short(value):
    text = str(value)
    return text if len(text) <= 60 else f"{text[:59]}…"


def _table(head, rows):
    cells = "".join(f"<th style='text-align:left'>{escape(name)}</th>" for name in head)
    body = "".join(
        "<tr>" + "".join(f"<td style='text-align:left'>{escape(str(cell))}</td>" for cell in row) + "</tr>"
        for row in rows
    )
    return f"<table><thead><tr>{cells}</tr></thead><tbody>{body}</tbody></table>"


def _part(title, table, said):
    return f"<div><b>{escape(title)}</b>{table}{''.join(f'<div>{escape(text)}</div>' for text in said)}</div>"
