"""Output at a terminal: one box before a run and one after."""

# May change: all texts and their layout, as programs read `run.json` and `--json` instead. Must stay: names and
# arguments of `print_…`, which verbs call; keys that are read, those of `run.json` and `trust.json`. Sentences on
# results belong in `results.summary_text`. Must stay as well: all names that `run`, `cost` and other files import;
# `_box` and `_columns`, which a test calls. Tests: tests/commands/test_cli.py, tests/results/test_results.py.

from __future__ import annotations

import contextlib
import sys

from rich.console import Console, Group
from rich.panel import Panel
from rich.table import Table as Grid
from rich.text import Text

from ..errors import InputError
from ..findings import REFUSAL, read_findings
from ..messages import quote
from ..registry import EFFECTS, INTEGRATORS, name_of
from ..results.provenance import web_of
from ..results.summary_text import (
    between,
    on_cost,
    on_results,
    on_run,
    on_solver,
    on_verdicts,
    on_web,
    rows_of_modes,
    rows_of_results,
    rows_of_steps,
    verdict_of,
)
from ..results.units import larger, readable, scale_of

OMITTED = ("by samples ±", "its ±", "verdict")
"""Columns of a study that are left out where its table is too wide, after those of quantiles."""
LEFT = 18
"""Width of the frame of a box and of the names on its left."""


def _console():
    return Console(highlight=False, width=None if sys.stdout.isatty() else 110)


def _box(title, rows):
    grid = Grid.grid(padding=(0, 2))
    grid.add_column(style="bold", no_wrap=True)
    grid.add_column()
    for name, content in rows:
        grid.add_row(Text(name), content if not isinstance(content, str) else Text(content))
    _console().print(Panel(grid, title=Text(title), title_align="left", expand=False))


def _curve(curve):
    """A curve of a law in words."""
    ends = f"strains from {curve.first:g} to {curve.last:g}"
    return f"{len(curve.points)} points, {ends}, slopes up to {curve.steepest:.4g} {curve.unit}"


def print_scene(scene, system):
    """Print what is simulated: sizes, cable, effects present, solver."""
    cable, solve = scene.cable, scene.solve
    law = cable.law
    if law == "smooth":
        law += f", ε0 = {cable.slackness:g}, η = {cable.smoothing:g}"
    of_form = {"force-density": (cable.force_density, "N/m"), "constant-force": (cable.pretension, "N")}
    value, unit = of_form.get(law, (None, ""))
    law += f", {value:g} {unit}" if value is not None else ""
    law += "".join(f", {name} = {number:g}" for name, number in (cable.parameters or {}).items())
    modulus = f"E = {cable.modulus:g} Pa, " if cable.law != "table" else ""
    present = [name_of(EFFECTS, effect) for effect in scene.effects]
    count = {name: present.count(name) for name in present}
    counted = [f"{name} × {times}" if times > 1 else f"{name}" for name, times in count.items()]
    named = (f"{name} ({group.law})" if group.law else name for name, group in cable.groups.items())
    groups = f", groups {', '.join(named)}" if cable.groups else ""
    how = f"{solve.kind}, {solve.method}, "
    if solve.method == "auto":
        from ..dynamics.method_choice import decided

        solve, why = decided(scene, system)
        how = f"{solve.kind}, {solve.method} ({why}), "
    if solve.kind == "static":
        how += "load steps " + ", ".join(f"{s:g}" for s in solve.load_steps[:8])
        how += ", ..." if len(solve.load_steps) > 8 else ""
    else:
        knob = INTEGRATORS[solve.method].knob
        step = f"{knob} {getattr(solve, knob):g}" if solve.step_size is None else f"step {solve.step_size:g} s"
        how += f"{solve.duration:g} s, {step}, output interval {scene.output.interval:g} s"
    web = web_of(system)
    counts, sizes = on_web(web)
    sizes += "; " + " × ".join(f"{size:.4g}" for size in web["extent"]) + " m along x, y and z"
    _box(
        scene.title,
        [
            ("web", f"{counts}; {len(system.free)} unknowns"),
            ("", sizes),
            ("cable", f"{law}; {modulus}A = {cable.area:g} m², ρ = {cable.density:g} kg/m³{groups}"),
            *(("curve", _curve(curve)) for curve in system.net.kept),
            *_arms(cable),
            ("effects", ", ".join(counted) or "none"),
            *((f'body "{body.name}"', text) for body in system.net.bodies for text in body.shape.texts()),
            *_stiffness(scene, system),
            *((f'control "{c.name}"', f"{c.law} sets {c.sets} each {c.period:g} s") for c in scene.control),
            ("solve", how),
            *(_on_steps(scene.replace(solve=solve), system) if solve.kind == "dynamic" else ()),
        ],
    )


def _on_steps(scene, system):
    """Rows of the box on steps, rows and corners of a dynamic scene."""
    from ..dynamics.schedule import FEW_CORNERS, Counts

    if INTEGRATORS[scene.solve.method].knob == "safety":
        from ..dynamics.expected_cost import expected_cost

        with contextlib.suppress(InputError):  # the run refuses it
            yield "steps", expected_cost(scene, system)
    yield "rows", Counts.of(scene).text(scene)
    if len(system.corners) > FEW_CORNERS:
        from ..dynamics.breakpoints import remarks_on_corners

        yield from (("corners", finding.text) for finding in remarks_on_corners(scene, system))


def _arms(cable):
    """Row of the viscous arms of a cable, none without."""
    if cable.viscous is not None:
        yield "arms", "; ".join(f"E = {modulus:g} Pa, τ = {time:g} s" for modulus, time in cable.viscous.arms)


def _stiffness(scene, system):
    """Rows of the box on the stiffness of contact that refweb has chosen."""
    for body in system.net.bodies if scene.chosen else ():
        if body.name in scene.chosen:
            from ..effects.contact.overlap import aim

            stiffness, exponent = scene.contact.law_of(body)
            unit = "N/m" if exponent == 1.0 else f"N/m^{exponent:g}"
            text = f'stiffness {stiffness:g} {unit} for body "{body.name}", chosen for an overlap of '
            yield "contact", text + readable(aim(system.net, body), None, "m")
    if "self_contact" in scene.chosen:
        from ..effects.self_contact.penetration import Passage

        overlaps = Passage(system).plain()
        text = f"stiffness {overlaps['stiffness']:.3g} N/m for lines on lines, chosen for an overlap of at most "
        yield "contact", text + readable(overlaps["radius"], None, "m")


def _grid(columns, rows, left=(0,), unwrapped=()):
    """Rows of texts below names of columns; by number, those that begin at the left, and those that are not wrapped."""
    grid = Grid(box=None, padding=(0, 2), pad_edge=False)
    for number, name in enumerate(columns):
        grid.add_column(Text(name), justify="left" if number in left else "right", no_wrap=number in unwrapped)
    for row in rows:
        grid.add_row(*map(Text, row))
    return grid


def _results_of_steps(steps):
    """A row for each load step, of results in columns of one unit each, and last where they stand."""
    table = rows_of_steps(steps)
    return _grid(table.columns, [*table.rows, *([table.last] if table.last else [])], left=())


def _results(results, dynamic):
    grid = Grid.grid(padding=(0, 2))
    for row in rows_of_results(results, dynamic).rows:
        grid.add_row(*map(Text, row))
    return grid


def print_run(summary, more=()):
    """Print the box of a finished run from the content of its ``run.json``, with ``more`` rows (name, text)."""
    solver, cost, rows = summary["solver"], summary["cost"], []
    if len(summary["steps"]) > 1:
        rows.append(("results", _results_of_steps(summary["steps"])))
    elif summary["results"]:
        rows.append(("results", _results(summary["results"], dynamic=not summary["steps"])))
    rows += [("", text) for text in on_results(summary["results"])]
    rows += [("verdict", text) for text in on_verdicts(summary["results"])]
    rows += on_run(summary)
    rows += more
    rows += [("solver", text) for text in on_solver(solver)]
    rows.append(("cost", on_cost(cost)))
    rows += [(f.severity, f.text) for f in read_findings(summary) if f.severity != REFUSAL]
    if summary["status"] != "solved":
        resumed = "refweb resume continues from its last checkpoint" if solver["energy_drift"] is not None else ""
        rows.append((summary["status"], summary["message"] or resumed))
    _box(f"{summary['scene']}: {summary['status']}", rows)


def print_solution(solution, folder):
    """Print results with their errors, and what they cost."""
    print_run(solution.summary())
    print(f"results in {folder}")


def print_modes(summary):
    """Print the box of modes from the content of their ``run.json``."""
    steps, rows = summary["steps"], []
    if steps:
        rows.append(("modes", _modes(steps[-1])))
    if len(steps) > 1:
        first = [{**step, "results": dict(list(step["results"].items())[:3])} for step in steps]
        rows.append(("steps", _results_of_steps(first)))
    print_run({**summary, "scene": f"{summary['scene']}, modes", "steps": [], "results": {}}, rows)


def _modes(step):
    table = rows_of_modes(step)
    nameless = [number for number, name in enumerate(table.columns) if not name]
    return _grid(table.columns, table.rows, nameless, set(range(len(table.columns))).difference(nameless))


def print_cost(summary):
    """Print the box of a work-precision diagram from the content of its ``run.json``."""
    unit, runs = summary["observable"]["unit"], summary["runs"]
    columns = ("method", "setting", f"error [{unit}]", "of state [m]", "CPU [s]", "nfev", "nsteps")
    number = lambda value, form: "unknown" if value is None else f"{value:{form}}"  # noqa: E731
    solved = []
    for run in (run for run in runs if run["status"] == "solved"):
        errors = (number(run[key], ".1e") for key in ("error_observable", "error_state"))
        work = (str(run[key]) for key in ("nfev", "nsteps"))
        solved.append([run["method"], run["setting"], *errors, number(run["cpu_s"], ".3f"), *work])
    rows: list = [("runs", _grid(columns, solved, (0, 1), range(len(columns))))] if solved else []
    failures = {}
    for run in (run for run in runs if run["status"] != "solved"):
        failures.setdefault((run["status"], run["method"], run["message"]), []).append(run["setting"])
    for (status, method, message), settings in failures.items():
        which = "" if status == "refused" else f", {settings[0]}" + (" and finer" if len(settings) > 1 else "")
        rows.append(({"budget": "left out"}.get(status, status), f"{method}{which}: {message or 'there was no time'}"))
    rows.append(("price", summary["sentence"]))
    rows.append(("cost", on_cost(summary["cost"])))
    _box(f"{summary['scene']}: what digits cost", rows)


def print_trust(report):
    """Print the box of an error budget from the content of its ``trust.json``."""
    from ..results.error_budget import NONE, OPEN, PARTS, WORDS

    results, lines = report["results"], []
    columns = [part for part in PARTS if any(result["parts"][part] != NONE for result in results.values())]
    head = ["result", "value ±", *(part.partition("_")[0] for part in columns)]
    for name, result in results.items():
        factor, _ = scale_of(larger(result["value"], result["error"]), result["unit"])
        parts = (result["parts"][part] for part in columns)
        said = [
            {NONE: "none", OPEN: "?"}.get(part, "") if isinstance(part, str) else f"{part / factor:.2g}"
            for part in parts
        ]
        value = readable(result["value"], result["error"], result["unit"])
        lines.append([name, value, *said, verdict_of(result)])
    rows: list = [("errors", _grid([*head, "verdict"], lines, (0, len(head)), range(len(head))))]
    reasons = {(part, text) for result in results.values() for part, text in result["reasons"].items()}
    rows += [("" if n else "none", f"{WORDS[part]}: {text}") for n, (part, text) in enumerate(sorted(reasons))]
    if any(OPEN in result["parts"].values() for result in results.values()):
        rows.append(("", "?: not estimated"))
    rows += [("verdict", text) for text in on_verdicts(results)]
    for n, run in enumerate(report["runs"]):
        ended = run["status"] if run["status"] != "solved" else f"{run['cpu_s']:.2f} s CPU"
        rows.append(("runs" * (n == 0), f"{run['text']}: {ended}" + (f", {run['message']}" if run["message"] else "")))
    given, spent = report["budget"]["given"], report["budget"]["spent"]
    rows.append(("cost", f"{spent:.2f} s CPU" + (f" of a budget of {given:g} s" if given is not None else "")))
    rows += [("warning", text) for text in report["warnings"]]
    _box(f"{report['scene']}: what the results are worth", rows)


def print_comparison(comparison):
    """Print results side by side, and what differs between their scenes, from what `compare` finds."""
    folders, lines = comparison["folders"], []
    for row in comparison["results"]:
        name = row["name"] + ("" if row["step"] is None else f", step {row['step']:g}")
        differing = [difference for difference in row["differences"] if difference is not None]
        apart = differing[-1] if len(folders) == 2 else max(differing) - min(differing)
        said = "agree" if row["agree"] else "differ"
        said = "means nothing" if row["meaningless"] is not None else said
        if row["agree"] is None:
            said = "only in " + next(f for f, value in zip(folders, row["values"], strict=True) if value is not None)
        difference = "" if len(differing) < 2 else readable(apart, None, row["unit"])
        lines.append([name, *map(_compared, row["values"]), difference, said])
    rows: list = [("results", _grid(["result", *folders, "difference", ""], lines, (0, len(folders) + 2)))]
    known = (value is None or value["error"] is not None for row in comparison["results"] for value in row["values"])
    if not all(known):
        rows.append(("", "a value without ± has no known error, and agrees with equal ones alone"))
    for row in comparison["results"]:
        if row["meaningless"] is not None:
            step = "" if row["step"] is None else f", step {row['step']:g}"
            rows.append(("", f"{row['name']}{step}: the comparison means nothing: {row['meaningless']}"))
    rows += [(s, f"is the run in {f}") for f, s in zip(folders, comparison["status"], strict=True) if s != "solved"]
    differing = [
        [row["path"], *("" if value is None else quote(value) for value in row["values"])]
        for row in comparison["scene"]
    ]
    keys = _grid(["key", *folders], differing, range(len(folders) + 1))
    rows.append(("scenes", keys if differing else "are the same"))
    some = " where they can be compared" * any(row["meaningless"] is not None for row in comparison["results"])
    _box(f"the results agree{some}" if comparison["agree"] else f"the results differ{some}", rows)


def _compared(value):
    """A value of a comparison as text."""
    if value is None:
        return ""
    if value["interval"] is not None:
        return between(value["interval"], value["unit"])
    return readable(value["value"], value["error"], value["unit"])


def print_sweep_begins(sweep):
    """Print what a study is about to run."""
    from ..results.study_text import on_design

    study = sweep.study.to_dict()
    varied, how = on_design(study)
    done = sum(row["status"] not in ("waiting", "skipped") for row in sweep.rows)
    rows = [("scene", sweep.title), ("varied", varied), ("cases", f"{len(sweep.cases)}, {how}")]
    rows += [("", text) for text in sweep.reasons]
    rows += [("", f"{done} of them have rows already")] if done else []
    kept = {"json": "run.json of each", "all": "result folders of all"}
    rows += [("keeps", kept[study["keep"]])] if study["keep"] in kept else []
    _box(sweep.study.title, rows)


def print_sweep(summary):
    """Print the box of a study from the content of its ``run.json``."""
    from ..results import study_text as words

    rows: list = [("cases", words.on_count(summary)), *(("", text) for text in summary["reasons"])]
    for entry in summary["chances"]:
        if of := words.of_group(entry["of"]):
            rows.append(("", Text(of, style="bold")))
        parts = {
            "results": words.rows_of_spread,
            "conditions": words.rows_of_conditions,
            "indices": words.rows_of_indices,
        }
        for name, make in parts.items():
            made = make(entry)
            if made.rows:
                rows.append((name, _columns(made)))
        rows += [("", text) for text in (*words.on_spread(entry), *words.on_indices(entry))]
    rows += [("samples", text) for text in words.on_samples(summary["study"])]
    cost = summary["cost"]
    rows.append(("cost", f"{cost['cases_cpu_s']:.2f} s CPU of all cases; this start {cost['wall_s']:.2f} s wall"))
    rows += [("warning", text) for text in summary["warnings"]]
    if summary["status"] != "solved":
        rows.append((summary["status"], summary["message"]))
    _box(f"{summary['title']}: {summary['status']}", rows)


def print_size_begins(sized):
    """Print what is about to be sized."""
    from ..results.sizing_text import on_free, on_requirement

    sizing = sized.sizing.to_dict()
    rows = [("scene", ", ".join(sized.sizing.scenes)), ("free", on_free(sizing)), ("least", sizing["minimise"])]
    for name, requirement in sized.sizing.requirements.items():
        rows.append((f"{name}", on_requirement(requirement._asdict())))
    rows += [("draws", f"{sized.sizing.count} of {', '.join(sized.sizing.draws)}")] if sized.sizing.draws else []
    rows += [("method", sized.method)]
    rows += [("", f"{sized.recorded} runs are recorded")] if sized.recorded else []
    _box(sized.title, rows)


def print_size(summary):
    """Print the box of a sizing from the content of its ``run.json``."""
    from ..results import sizing_text as words

    rows: list = []
    if summary["requirements"]:
        rows = [
            ("design" * (not n), f"{name} = {text}")
            for n, (name, text) in enumerate(words.on_design(summary["values"]))
        ]
        rows += [("least", words.on_objective(summary)), ("requires", _columns(words.rows_of_requirements(summary)))]
    rows += [("search", words.on_search(summary))]
    rows += [("note", text) for text in summary["notes"]]
    rows.append(("cost", on_cost(summary["cost"])))
    if summary["status"] != "solved":
        rows.append((summary["status"], summary["message"]))
    _box(f"{summary['title']}: {summary['status']}", rows)


def print_gradients(solution, result, gradients, refused, limit):
    """Print the box of gradients of a result, at most so many entries of each; ``refused`` are texts."""
    computed, numbers = solution.results[result], [gradient for gradient in gradients if not gradient.by]
    idle = [g.path for g in numbers if not float(g) and g.left is None and not g.error.any()]
    numbers = [gradient for gradient in numbers if gradient.path not in idle]
    rows: list = [("by", _of_numbers(numbers, computed.unit))] if numbers else []
    rows += [("no effect", ", ".join(idle))] if idle else []
    for gradient in (gradient for gradient in gradients if gradient.by):
        rows.append((gradient.path, _entries(gradient, limit)))
        if (more := gradient.value.size - limit) > 0:
            rows.append(("", f"{more} more with smaller ones: --json prints all"))
    rows += [("left out", text) for text in refused]
    equal = next((gradient.equal for gradient in gradients if gradient.equal), ())
    if equal:
        text = "they keep their order, so that one derivative holds where a number rises, and another where it falls"
        rows.append(("note", f"{', '.join(equal)} are equal within ±: {text}"))
    by_text = {}
    for path, text in [(gradient.path, text) for gradient in numbers for text in gradient.notes]:
        by_text.setdefault(text, []).append(path)
    rows += [("note", f"by {', '.join(paths)}: {text}") for text, paths in by_text.items()]
    _box(
        f"{solution.scene.title}: gradient of {result} = {readable(computed.value, computed.error, computed.unit)}",
        rows,
    )


def _of_numbers(gradients, unit):
    """Gradients by numbers of the scene, each with the change of the result by a hundredth of the number."""
    columns, rows = ("number of the scene", "", "gradient", "±", f"+ 1 % changes [{unit}]"), []
    for gradient in gradients:
        value = float(gradient)
        left = "" if gradient.left is None else f", {gradient.left[0]:.6g} where it falls"
        cells = [gradient.path, f"{gradient.number:g}", f"{value:.6g}{left}", f"{gradient.error[0]:.1e}"]
        rows.append([*cells, f"{0.01 * gradient.number * value + 0.0:.3g}"])
    return _grid(columns, rows)


def _entries(gradient, limit):
    """The largest entries of a gradient by line or group, or of the components of vectors of nodes."""
    names, falls = [str(name) for name in gradient.names], [] if gradient.left is None else ["where it falls"]
    if gradient.value.ndim > 1:
        names = [f"{name} {axis}" for name in names for axis in "xyz"]
    columns, rows = [gradient.by, f"gradient [{gradient.unit}]", "±", *falls], []
    error, *sides = (v.ravel() for v in (gradient.error, gradient.value, gradient.left) if v is not None)
    for at in sorted(range(len(names)), key=lambda at: -max(abs(side[at]) for side in sides))[:limit]:
        value, *left = (f"{side[at]:.6g}" for side in sides)
        rows.append([names[at], value, f"{error[at]:.1e}", *left])
    return _grid(columns, rows)


def _columns(rows):
    """Rows below names of columns, as a grid; columns are left out, and named, before a number loses digits."""
    console, kept = _console(), list(range(len(rows.columns)))
    table = [rows.columns, *rows.rows]
    widths = [max(len(word) for row in table for word in [*row[k].split(), ""]) for k in kept]
    spare = lambda: console.width - LEFT - sum(widths[k] + 4 for k in kept)  # noqa: E731
    omitted = []
    for name in (*(c for c in rows.columns if c.endswith(" %")), *OMITTED):
        if name in rows.columns and spare() < 0:
            omitted.append(name)
            kept.remove(rows.columns.index(name))
    grid = _grid([rows.columns[k] for k in kept], [[row[k] for k in kept] for row in rows.rows])
    for column, k in zip(grid.columns, kept, strict=True) if spare() >= 0 else ():
        widths[k] += min(spare(), max(len(row[k]) for row in table) - widths[k])
        column.width = widths[k]
    return Group(grid, Text(f"left out, see results.csv: {', '.join(omitted)}")) if omitted else grid
