"""Results of a study in words: rows for each result, condition and index, for the console and the page."""

from __future__ import annotations

from ..messages import shown
from .summary_text import Rows
from .units import readable, scale_of


def on_count(summary):
    """Number of cases, and their status."""
    words = {
        "solved": "solved",
        "failed": "failed",
        "refused": "refused",
        "lost": "lost with their workers",
        "skipped": "skipped",
        "waiting": "not run yet",
    }
    told = ", ".join(f"{number} {words[status]}" for status, number in summary["count"].items())
    return f"{summary['cases']} cases: {told}"


def on_design(study):
    """Design of a study, in words."""
    varied = ", ".join(f"{path} ({_varied(one)})" for path, one in study["parameters"].items())
    how = {"grid": "each with each", "zip": "one beside the other"}.get(study["sample"])
    if how is None:
        how = f"{study['count']} samples, {study['sample']}, seed {study['seed']}"
        how += ", for Sobol's indices" if study["indices"] else ""
    return varied, how


def _varied(one):
    if isinstance(one, list):
        return f"{len(one)} value{'s' * (len(one) != 1)}"
    if "distribution" in one:
        keys = ", ".join(f"{key} = {value:g}" for key, value in one.items() if key != "distribution")
        return f"{one['distribution']}{', ' * bool(keys)}{keys}"
    return f"{one['from']:g} … {one['to']:g}"


def of_group(of):
    """The values that a group of cases has in common, in words."""
    return ", ".join(f"{path.rpartition('.')[2]} = {shown(value)}" for path, value in of.items())


def rows_of_spread(entry):
    """A row for each result: its mean, the shares of ± and of the samples in that, its spread, its quantiles."""
    rows, columns = [], []
    for name, one in entry["results"].items():
        factor, unit = scale_of(max(abs(one["least"]), abs(one["largest"])), one["unit"])
        keys = ("mean", "mean_error", "standard_error", "deviation") if "mean" in one else ("least", "largest")
        values = [one[key] for key in keys] + [q["value"] for q in one.get("quantiles", ())] + [one["error"]]
        short = ("mean_error", "standard_error")
        forms = [".2g" if key in short else ".4g" for key in keys] + [".4g"] * len(one.get("quantiles", ())) + [".2g"]
        told = ["not known" if v is None else f"{v / factor:{form}}" for v, form in zip(values, forms, strict=True)]
        rows.append([f"{name} [{unit}]" if unit else name, *told])
        heads = ("mean", "its ±", "by samples ±", "spread") if "mean" in one else keys
        columns = ["result", *heads, *(f"{100.0 * q['q']:g} %" for q in one.get("quantiles", ())), "± at most"]
    return Rows(columns, rows, [])


def on_spread(entry):
    """Sentences on results whose ± is not small beside their spread."""
    for name, one in entry["results"].items():
        spread = one.get("deviation", one["largest"] - one["least"])
        rounding = 1e-14 * max(abs(one["largest"]), abs(one["least"]))
        if one["error"] is not None and one["count"] > 1 and one["error"] > max(0.5 * spread, rounding):
            told = readable(one["error"], None, one["unit"])
            more = "exceeds" if one["error"] > spread else "is not small beside"
            spread = readable(spread, None, one["unit"])
            yield f"{name}: ± of up to {told} {more} the spread, {spread}: a smaller safety or rtol tells cases apart"


def rows_of_conditions(entry):
    """A row for each condition: its probability with its interval, and how many cases decide it."""
    rows = []
    for name, one in entry["conditions"].items():
        if one["share"] is None:
            chance = "not known"
        else:
            chance = f"{100.0 * one['share']:.4g} %"
        between = one.get("interval")
        told = f"{100.0 * between[0]:.3g} … {100.0 * between[1]:.3g} %" if between else ""
        left = ", ".join(f"{one[key]} {key}" for key in ("undecided", "failed", "unproven", "statistical") if one[key])
        rows.append([name, chance, told, f"{one['true']} true, {one['false']} false", left, one["condition"]])
    return Rows(["condition", "holds in", "interval", "cases", "", "which is"], rows, [])


def rows_of_indices(entry):
    """A row for each result and parameter: Sobol's indices of first order and total."""
    rows = []
    for name, found in (entry.get("indices") or {}).items():
        for path, kinds in found.get("of", {}).items():
            told = ["{:.2f} ({:.2f} … {:.2f})".format(one["value"], *one["interval"]) for one in kinds.values()]
            rows.append([name, path, *told])
    return Rows(["result", "parameter", "alone", "with others"], rows, [])


def on_indices(entry):
    """Reason why results have no indices, and warning where ± is not small beside the spread."""
    for name, found in (entry.get("indices") or {}).items():
        if "reason" in found:
            yield f"{name} has no indices: {found['reason']}"
        elif found["error"] is None:
            yield f"{name}: ± is not known, and is not in its indices"
        elif found["error"] > 0.1:
            yield f"{name}: ± is up to {found['error']:.2g} of the spread that its indices share out"


def on_samples(study):
    """Sentence on the confidence intervals with the samples of a study."""
    if study["sample"] not in ("grid", "zip", "random"):
        yield "samples are evenly spread: intervals are those of as many independent ones, and mostly too wide"
    if study["sample"] == "sobol" and study["count"] & (study["count"] - 1):
        yield f"samples by sobol are evenly spread where their count is a power of 2, which {study['count']} is not"
