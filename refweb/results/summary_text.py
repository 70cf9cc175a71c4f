"""Summary of a run as text: rows of results, load steps and modes, and sentences on the rest.

A summary is the content of ``run.json``. The console and the page of a run show the same.

May change: private functions, `FEW_BREAKS` and texts, which are for readers, but for "t = " and "at " in cells of
`rows_of_results`, which `pages.sections` takes off. Names of columns are such texts: cells are taken by their places, a
row has as many as there are columns, and the console sets a column without a name left. Must stay: keys that are read,
those of ``run.json``; the functions, which `commands.console` and `pages` call; `Rows`, which `study_text` and
`sizing_text` make too; all names that `commands.console`, `pages.sections` and other files import. Tests:
``tests/results/test_results.py``, ``tests/results/test_strength.py``.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from .error_budget import DETERMINED, shares
from .units import larger, other_errors, position_text, readable, scale_of, with_error

FEW_BREAKS = 5
"""Largest number of breaks that are listed."""


class Rows(NamedTuple):
    """Rows of text below names of columns; an optional `last` row is a remark on the columns."""

    columns: list[Any]
    rows: list[Any]
    last: list[Any]


def rows_of_results(results, dynamic):
    """Results with their ±, position, time (in dynamics) and verdict."""
    rows, judged = [], any(result.get("parts") for result in results.values())
    for name, result in results.items():
        value = readable(result["value"], result["error"], result["unit"], result.get("within"))
        value += f" ({parts})" if (parts := shares(result)) else ""
        time = [f"t = {result['time']:.6g} s"] if dynamic else []
        verdict = [verdict_of(result)] if judged else []
        rows.append([name, value, *time, f"at {where}" if (where := _position(result)) else "", *verdict])
    return Rows(["result", "value", *(["time"] if dynamic else []), "place", *(["verdict"] * judged)], rows, [])


def verdict_of(result):
    """Verdict of a result in a few words: "determined, 3 digits", "wide"; without a verdict its number of digits."""
    verdict, digits = result.get("verdict"), result.get("digits")
    if verdict == DETERMINED and digits == 0:
        return f"{verdict}, {result['verdict_text']}"
    if verdict is None and digits == 0:
        return result["verdict_text"].partition(",")[0]
    count = "" if digits is None else f"{digits} digit{'s' * (digits != 1)}"
    return ", ".join(filter(None, [verdict, count]))


def on_verdicts(results):
    """Sentences on results that are not determined: the reason, and results to ask for instead."""
    for name, result in results.items():
        if result.get("verdict") not in (None, DETERMINED):
            yield f"{name}: {result['verdict']}: {result['verdict_text']}"


def rows_of_steps(steps):
    """A row for each load step, with results in columns of one unit each; the last row has their positions."""
    loads = "load" in steps[-1]
    names = ["step", *(["load [N]"] if loads else [])]
    columns = {name: [step["results"][name] for step in steps] for name in steps[-1]["results"]}
    factors = {}
    for name, column in columns.items():
        size = max(larger(result["value"], result["error"]) for result in column)
        factors[name], unit = scale_of(size, column[-1]["unit"])
        names.append(f"{name} [{unit}]" if unit else name)
    rows = []
    for n, step in enumerate(steps):
        row = [f"{step['step']:g}", *([f"{step['load']:.6g}"] if loads else [])]
        for name, column in columns.items():
            value, error = column[n]["value"], column[n]["error"]
            row.append(with_error(value / factors[name], error and error / factors[name]))
        rows.append(row)
    where = [_position(column[-1]) for column in columns.values()]
    last = ["", *[""] * loads, *(f"at {text}" if text else "" for text in where)] if any(where) else []
    return Rows(names, rows, last)


def rows_of_modes(step):
    """A row for each mode: frequency with its ±, position of its largest displacement, and remarks."""
    rows, results, squared = [], list(step["results"].values()), step["squared"]
    for k, result in enumerate(results):
        value, error = abs(result["value"]), result["error"]
        text = readable(value, error, "Hz" if squared[k] >= 0.0 else "i Hz")
        axes = " ".join(axis for axis, share in zip("xyz", step["shares"][k], strict=True) if share >= 0.1)
        remarks = [f"unstable, grows e-fold in {0.15915 / value:.3g} s"] if squared[k] < 0.0 < value else []
        remarks += ["zero within ±"] if error >= value else []
        remarks += [f"equal to {k}"] if k and _equal(result, results[k - 1]) else []
        remarks += ["local"] if step["moving"][k] < 0.1 else []
        share = 100.0 * step["moving"][k]
        moving = f"{share:.0f} %" if share >= 10.0 else f"{share:.2g} %"
        rows.append([str(k + 1), text, axes, moving, str(step["at"][k]), ", ".join(remarks)])
    return Rows(["mode", "frequency", "along", "moving mass", "most at", ""], rows, [])


def on_web(web):
    """(Text of the numbers of nodes, lines and cells, text of length, size and mass), from the dict of ``web_of``."""
    area = f"{web['area']:.4g} m², " if web["cells"] else ""
    counts = f"{web['nodes']} nodes, {web['lines']} lines, {web['cells']} cells"
    return counts, f"{web['cable_length']:.6g} m of cable, {area}{web['mass']:.4g} kg"


def on_results(results):
    """Sentences on results: errors that are not known, intervals, errors besides ±."""
    if results and any(result["error"] is None for result in results.values()):
        yield "a value without ± has no known error"
    for name, result in results.items():
        if result.get("interval") is not None:
            yield f"{name} lies anywhere {between(result['interval'], result['unit'])}"
    yield from other_errors(results)


def on_run(summary):
    """(Name, sentence) of horizon, events, contact, breaks and strength."""
    if horizon := summary.get("horizon"):
        yield "horizon", _horizon(horizon)
        for name, r in horizon.get("ensemble", {}).items():
            text = readable(r["mean"], r["deviation"], summary["results"][name]["unit"])
            yield "", f"{name} {text} over the ensemble, standard deviation"
    for n, event in enumerate(summary.get("events") or []):
        when = "did not happen" if event["time"] is None else f"at t = {readable(event['time'], event['error'], 's')}"
        yield "events" * (n == 0), f"{event['name']} {when}"
    if commands := summary.get("commands"):
        paths = ", ".join(dict.fromkeys(path for _, path, _ in commands))
        yield "commands", f"{len(commands)} from outside of the scene, on {paths}"
    for n, control in enumerate(summary.get("controls", [])):
        text = f"{control['name']} sets {control['sets']} up to {control['largest']:.4g}"
        if control["spent"] is not None:
            text += f", in all {readable(control['spent'], control['error'], control['unit'])}"
        yield "controls" * (n == 0), text
    for n, (name, thrown) in enumerate(summary.get("throw", {}).items()):
        yield "throw" * (n == 0), f"{name.replace('_', ' ')} {_of_throw(thrown)}"
    for name, body in summary.get("bodies", {}).items():
        text = f'body "{name}" at most {readable(body["overlap"], None, "m")} deep'
        text += f" at line {body['line']}" if body["line"] is not None else ""
        text = f"{text}, stiffness {body['stiffness']:g}" + ", chosen" * body["chosen"]
        error = body.get("surface_error")
        yield "contact", text + (f", its surface within {error:.1e} m" if error is not None else "")
    for name, pair in summary.get("pairs", {}).items():
        text = f"bodies {name} at most {readable(pair['overlap'], None, 'm')} deep in each other"
        yield "contact", f"{text}, stiffness {pair['stiffness']:g}"
    if lines := summary.get("lines"):
        text = (
            f"lines at most {readable(lines['overlap'], None, 'm')} deep in each other, of radius {lines['radius']:g}"
        )
        yield "contact", f"{text} m, stiffness {lines['stiffness']:.3g}" + ", chosen" * lines.get("chosen", False)
    for name, status in summary.get("passage", {}).items():
        text = "no penetration: certified" if status == "certified" else status
        yield "passage", f"{name}: {text}"
    if (breaks := summary.get("breaks")) is not None:
        yield from _breaks(breaks)
    if before := summary.get("broken_before"):
        line = f"{', '.join(map(str, before[:FEW_BREAKS]))}{', ...' * (len(before) > FEW_BREAKS)}"
        yield "broken", f"{len(before)} line{'s' * (len(before) > 1)} before the run began: {line}"
    if worst := summary.get("utilisation"):
        yield "strength", _of_strength(worst)


def on_solver(solver):
    """Sentences on the work of a solver, and on its energy and momentum balance."""
    if solver["residual"] is not None:
        text = f"{solver['method']}: {solver['nsteps']} iterations, {solver['nlu']} factorizations"
        text += f" by {solver['factorization'].partition(',')[0]}" if solver.get("factorization") else ""
        text += f", residual {solver['residual']:.1e}"
        if solver["duality_gap"] is not None:
            text += f", duality gap {solver['duality_gap']:.1e} J"
        if (above := solver.get("above_lowest")) is not None:
            text += f", at most {above:.1e} J above the lowest state" if above else ", the lowest state, proven"
        yield text
    if solver["energy_drift"] is not None:
        text = f"{solver['method']}: {solver['nsteps']} steps, energy drift {solver['energy_drift']:.1e}"
        text += f", of momentum {solver['momentum_drift']:.1e}"
        if integrated := solver.get("integrated_impulses"):
            text += f" with {', '.join(integrated)} as integrated"
        yield text


def on_cost(cost):
    """Cost of a run; compiling, which happens once, is separate."""
    text = f"{cost['cpu_s']:.2f} s CPU, {cost['wall_s']:.2f} s wall"
    compiling = cost.get("compile_s") or 0.0
    return text + (f", of which compiling {compiling:.1f} s, once" if compiling >= 0.1 else "")


def between(interval, unit):
    """An interval as text; an end of None is infinite."""
    lower, upper = interval
    if lower is None or upper is None:
        ends = [f"{word} {end:.6g} {unit}" for word, end in (("above", lower), ("below", upper)) if end is not None]
        return "".join(ends) or "on its axis"
    return f"from {lower:.6g} to {upper:.6g} {unit}"


def _position(result):
    return position_text(result["where"], result.get("at") or "number")


def _breaks(breaks):
    """(Name, sentence) of the first breaks, and of their number."""
    if not breaks:
        yield "breaks", "none"
    for n, entry in enumerate(breaks[:FEW_BREAKS]):
        when = readable(entry["time"], entry["error"], "s")
        text = f"line {entry['line']} at t = {when}, stored energy {readable(entry['energy'], None, 'J')}"
        yield "breaks" * (n == 0), text
    if len(breaks) > FEW_BREAKS:
        yield "", f"and {len(breaks) - FEW_BREAKS} more, the last at t = {breaks[-1]['time']:.6g} s"


def _of_strength(worst):
    """Sentence on the largest stress over strength, with its ± and the parts of that."""
    if (error := worst.get("error")) is None:
        digits = ".2f" if 0.01 <= worst["value"] < 100.0 else ".2g"
        return f"utilisation {worst['value']:{digits}} at line {worst['line']}, its ± is not known"
    text = f"utilisation {with_error(worst['value'], error)} at line {worst['line']}"
    return f"{text} ({parts})" if (parts := shares(worst)) else text


def _of_throw(thrown):
    """A number or a statement of a throw as text."""
    if "unit" not in thrown:
        if thrown["value"] is not None:
            return "yes" if thrown["value"] else "no"
        drawn = "yes" if thrown["drawn"] else "no"
        if thrown.get("error") is None:
            return f"not known, {drawn} in this run: {thrown.get('reason', 'it has no ±')}"
        return f"undecided, {drawn} in this run"
    text = "at least " * thrown.get("at_least", False) + readable(thrown["value"], thrown["error"], thrown["unit"])
    return text if thrown["error"] is not None else f"{text}, its ± is not known: {thrown.get('reason', 'it has none')}"


def _horizon(horizon):
    """Sentence on the horizon of a motion."""
    ended = [(k, time) for k, time in horizon["digits"] if time is not None]
    text = f"a difference of {horizon['perturbation']:.0e} m"
    growth = horizon["growth"]
    text += " does not grow" if growth is None else f" grows with the Lyapunov exponent {growth:.3g} 1/s"
    text += "".join(f"; {k - 1} digit{'s' * (k != 2)} after {time:.4g} s" for k, time in ended[-3:])
    left = max((k for k, time in horizon["digits"] if time is None), default=0)
    text += f"; {'more than ' * (left == 12)}{left} digit{'s' * (left != 1)} at the end" if left else ""
    return text + (f"; chaotic: {', '.join(horizon['statistical'])}" if horizon["statistical"] else "")


def _equal(first, second):
    # in a turning frame ± says nothing of that
    within = min(first["error"] + second["error"], 1e-6 * abs(first["value"]))
    return abs(first["value"] - second["value"]) <= max(within, 1e-9 * abs(first["value"]))
