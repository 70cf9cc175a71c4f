"""Results of a sizing as text: its free numbers, requirements and what governs, for the console.

May change: all texts, which are for readers. Must stay: keys that are read, those of `sizing.size.Sized.summary`; the
functions, which `commands.console` calls. Tests: ``tests/sizing/test_size.py``.
"""

from __future__ import annotations

from ..messages import quote
from .summary_text import Rows
from .units import readable


def on_free(sizing):
    """Free numbers of a requirements file as text."""
    parts = []
    for name, given in sizing["parameters"].items():
        if "catalogue" in given:
            rows = given["catalogue"]
            parts.append(f"{name} ({rows if isinstance(rows, str) else f'catalogue of {len(rows)} rows'})")
        elif "values" in given:
            parts.append(f"{name} ({len(given['values'])} value{'s' * (len(given['values']) != 1)})")
        else:
            parts.append(f"{name} ({given['from']:g} … {given['to']:g}{', whole' if given.get('whole') else ''})")
    if isinstance(sizing["scene"], list):
        parts.insert(0, f"scene ({len(sizing['scene'])})")
    return ", ".join(parts)


def on_requirement(entry):
    """A requirement as text: its condition and probability."""
    wanted = "" if entry["probability"] is None else f", probability above {entry['probability']:g}"
    return f"{entry['condition']}{wanted}"


def on_design(values):
    """Pairs of name and value of a design."""
    return [
        (name, f"{value:.6g}" if isinstance(value, float) else quote(value).strip('"'))
        for name, value in values.items()
    ]


def on_objective(summary):
    """The objective with its ±."""
    objective = summary["objective"]
    return f"{summary['sizing']['minimise']} = {readable(objective['value'], objective['error'], objective['unit'])}"


def rows_of_requirements(summary):
    """A row for each requirement: its reserve, if it governs, and what a stricter limit costs."""
    rows = []
    for entry in summary["requirements"]:
        lower, upper = entry["least"], entry["most"]
        reserve = "unlimited" if lower is None else f"{100.0 * lower:.3g}"
        reserve += "" if lower is None or upper is None or upper - lower < 1e-5 else f" … {100.0 * upper:.3g}"
        verdict = {True: "yes", False: "no", None: "undecided"}[entry["holds"]]
        costs = "" if not entry["costs"] else f"{entry['costs']:.3g}"
        governs = "governs" if entry["governs"] else ""
        rows.append([entry["name"], on_requirement(entry), verdict, reserve, governs, costs])
    unit = summary["objective"]["unit"]
    columns = ["", "condition", "met", "reserve [%]", "", f"1 % stricter costs{f' [{unit}]' if unit else ''}"]
    return Rows(columns, rows, [])


def on_search(summary):
    """Method, number of designs, and how exactly the conditions of an optimum hold."""
    text = f"{summary['method']}: {len(summary['designs'])} designs, {summary['runs']} runs"
    text += f", {summary['recorded']} recorded before" if summary["recorded"] else ""
    if optimality := summary["optimality"]:
        text += f"; conditions of an optimum to {optimality['residual']:.1e}"
        if optimality["at_bound"]:
            text += f"; at a bound: {', '.join(optimality['at_bound'])}"
    return text
