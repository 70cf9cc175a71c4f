"""Results of a study as text: rows for each result, condition and index, for the console and the page.

May change: all texts, which are for readers. Must stay: keys that are read, those of `sweeps.study_result` and
`sweeps.chances`; the functions, which `commands.console` and `pages.study` call. Tests:
``tests/sweeps/test_study_pages.py``.
"""

from __future__ import annotations

from ..messages import quote
from .summary_text import Rows
from .units import readable, scale_of


def on_count(summary):
    """Number of cases, and their status."""
    words = {"lost": "lost with their workers", "waiting": "not run yet"}
    text = ", ".join(f"{number} {words.get(status, status)}" for status, number in summary["count"].items())
    return f"{summary['cases']} case{'s' * (summary['cases'] != 1)}: {text}"


def on_design(study):
    """Design of a study as text."""
    varied = ", ".join(f"{path} ({_varied(values)})" for path, values in study["parameters"].items())
    how = {"grid": "each with each", "zip": "one beside the other"}.get(study["sample"])
    if how is None:
        how = f"{study['count']} samples, {study['sample']}, seed {study['seed']}"
        how += ", for Sobol's indices" if study["indices"] else ""
    return varied, how


def _varied(values):
    if isinstance(values, list):
        return f"{len(values)} value{'s' * (len(values) != 1)}"
    if "distribution" in values:
        keys = ", ".join(f"{key} = {value:g}" for key, value in values.items() if key != "distribution")
        return f"{values['distribution']}{', ' * bool(keys)}{keys}"
    return f"{values['from']:g}" if values.get("count") == 1 else f"{values['from']:g} … {values['to']:g}"


def of_group(of):
    """Text of the values that a group of cases has in common."""
    return ", ".join(f"{path.rpartition('.')[2]} = {quote(value)}" for path, value in of.items())


def rows_of_spread(entry):
    """A row for each result: its mean with errors by ± and by the number of samples, its spread, quantiles.

    If runs have verdicts, the last column has the number of each.
    """
    rows, columns = [], []
    judged = any(set(of_result.get("verdicts", ())) - {"none"} for of_result in entry["results"].values())
    for name, of_result in entry["results"].items():
        factor, unit = scale_of(max(abs(of_result["least"]), abs(of_result["largest"])), of_result["unit"])
        keys = ("mean", "mean_error", "standard_error", "deviation") if "mean" in of_result else ("least", "largest")
        quantiles = of_result.get("quantiles", ())
        values = [(of_result[key], ".2g" if key in ("mean_error", "standard_error") else ".4g") for key in keys]
        values += [*((q["value"], ".4g") for q in quantiles), (of_result["error"], ".2g")]
        texts = ["not known" if value is None else f"{value / factor:{form}}" for value, form in values]
        if (off := of_result.get("deviation_error")) is not None:
            texts[keys.index("deviation")] += f" ± {off / factor:.2g}"
        verdicts = ", ".join(f"{number} {verdict}" for verdict, number in of_result.get("verdicts", {}).items())
        rows.append([f"{name} [{unit}]" if unit else name, *texts, *([verdicts] if judged else [])])
        heads = ("mean", "its ±", "by samples ±", "spread") if "mean" in of_result else keys
        columns = ["result", *heads, *(f"{100.0 * q['q']:g} %" for q in quantiles), "± at most"]
        columns += ["verdict"] * judged
    return Rows(columns, rows, [])


def on_spread(entry):
    """Sentences on results whose ± is not small against their spread."""
    for name, of_result in entry["results"].items():
        spread = of_result.get("deviation", of_result["largest"] - of_result["least"])
        rounding = 1e-14 * max(abs(of_result["largest"]), abs(of_result["least"]))
        if of_result["error"] is not None and of_result["count"] > 1 and of_result["error"] > 0.5 * spread > rounding:
            text = readable(of_result["error"], None, of_result["unit"])
            more = "exceeds" if of_result["error"] > spread else "is not small beside"
            spread = readable(spread, None, of_result["unit"])
            remedy = "more [accuracy] digits, or a smaller safety, resolve the differences of cases"
            yield f"{name}: ± of up to {text} {more} the spread, {spread}: {remedy}"


def rows_of_conditions(entry):
    """A row for each condition: its probability with its interval, and the number of cases that decide it."""
    rows = []
    for name, of_condition in entry["conditions"].items():
        share = of_condition["share"]
        chance = "not known" if share is None else f"{100.0 * share:.4g} %"
        lower, upper = of_condition.get("lower"), of_condition.get("upper")
        if lower is not None and lower != upper:
            chance = f"{100.0 * lower:.4g} to {100.0 * upper:.4g} %, {chance} by values without ±"
        between = of_condition.get("interval")
        text = f"{100.0 * between[0]:.3g} … {100.0 * between[1]:.3g} %" if between else ""
        kinds = ("undecided", "failed", "unproven", "statistical")
        left = ", ".join(f"{of_condition[key]} {key}" for key in kinds if of_condition[key])
        cases = f"{of_condition['true']} true, {of_condition['false']} false"
        rows.append([name, chance, text, cases, left, of_condition["condition"]])
    return Rows(["condition", "holds in", "interval", "cases", "", "which is"], rows, [])


def rows_of_indices(entry):
    """A row for each result and parameter: first-order and total-effect Sobol index."""
    rows = []
    for name, indices in (entry.get("indices") or {}).items():
        for path, kinds in indices.get("of", {}).items():
            texts = ["{:.2f} ({:.2f} … {:.2f})".format(item["value"], *item["interval"]) for item in kinds.values()]
            rows.append([name, path, *texts])
    return Rows(["result", "parameter", "alone", "with others"], rows, [])


def on_indices(entry):
    """Reason why results have no indices, and warning if ± is not small against the spread."""
    for name, indices in (entry.get("indices") or {}).items():
        if "reason" in indices:
            yield f"{name} has no indices: {indices['reason']}"
        elif indices["error"] is None:
            yield f"{name}: ± is not known, and is not in its indices"
        elif indices["error"] > 0.1:
            yield f"{name}: ± is up to {indices['error']:.2g} of the spread that its indices share out"


def on_samples(study):
    """Sentence on the confidence intervals with the samples of a study."""
    if study["sample"] not in ("grid", "zip", "random"):
        yield "samples are evenly spread: intervals are those of as many independent ones, and mostly too wide"
    if study["sample"] == "sobol" and study["count"] & (study["count"] - 1):
        yield f"samples by sobol are evenly spread where their count is a power of 2, which {study['count']} is not"
