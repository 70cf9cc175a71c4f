"""Comparison of result folders: agreement of their results within ±, and differences of their scenes.

May change: private functions, `MEANINGLESS` and other texts. Must stay: keys of what `compare` returns, which are those
of ``refweb compare --json`` and which `commands.console` prints; the rule of agreement in its docstring. Tests:
``tests/results/test_comparison.py``.
"""

from __future__ import annotations

import math
import pathlib
import tomllib

from ..errors import InputError
from ..messages import short
from .error_budget import NO_LIMIT, STATISTICAL
from .folder import read_summary
from .solution import read_results


def compare(folders):
    """Results of some folders and the keys in which their scenes differ.

    Parameters
    ----------
    folders : sequence of path-like
        Two result folders or more.

    Returns
    -------
    dict
        Plain values. ``folders`` and ``status`` have an entry for each run. ``results`` is a list of dicts with
        ``name``, ``step`` (None without several load steps), ``unit``, ``values`` (the entry of each ``run.json``, or
        None), ``differences`` from the first value, ``agree``, and ``meaningless`` (reason why the comparison means
        nothing, else None). ``scene`` is a list of dicts with ``path`` and ``values`` (None where a scene lacks the
        key). ``agree`` is True if all common results agree.

    Raises
    ------
    InputError
        For fewer than two folders, a folder without results of refweb, and folders without a common result.

    Notes
    -----
    Results agree if all their intervals have a point in common: value ± error, or the interval of an open value. A
    value without ± agrees with equal values alone. If the verdict of a result is "no limit" or "statistical" in a run,
    its value belongs to a mesh, or is one draw of many. Such results are compared as all others, but the comparison
    means nothing.
    """
    if len(folders) < 2:
        raise InputError(f"compare {' '.join(map(str, folders))}: needs two result folders or more")
    folders = [pathlib.Path(folder) for folder in folders]
    summaries, scenes = zip(*map(_read, folders), strict=True)
    several = any(len(summary["steps"]) > 1 for summary in summaries)
    tables = [_results(folder, summary, several) for folder, summary in zip(folders, summaries, strict=True)]
    keys = dict.fromkeys(key for results in tables for key in results)
    rows = [_row(key, [results.get(key) for results in tables]) for key in keys]
    common = [row for row in rows if row["agree"] is not None]
    if not common:
        has = "; ".join(map(_has, folders, summaries, tables))
        raise InputError(f"no two folders have a result in common: {has}")
    return {
        "folders": list(map(str, folders)),
        "status": [summary["status"] for summary in summaries],
        "results": rows,
        "scene": _scenes(scenes),
        "agree": all(row["agree"] for row in common),
    }


def _read(folder):
    """(``run.json``, ``scene.toml``) of a result folder."""
    name, summary = short(str(folder)), read_summary(folder)
    if summary is None:
        raise InputError(f"{name}: holds no run.json of refweb")
    if not isinstance(summary.get("results"), dict) or not isinstance(summary.get("steps"), list):
        raise InputError(f"{name}: its run.json holds no results")
    try:
        return summary, tomllib.loads((folder / "scene.toml").read_text(encoding="utf-8"))
    except (ValueError, OSError, RecursionError) as error:
        raise InputError(f"{name}/scene.toml: cannot be read: {error}") from None


def _results(folder, summary, several):
    """Results of a run by (name, step)."""
    parts = [(None, summary["results"])]
    try:
        if several and summary["steps"]:
            parts = [(step["step"], step["results"]) for step in summary["steps"]]
        read = [(step, read_results(results)) for step, results in parts]
    except (KeyError, TypeError, ValueError, AttributeError):
        raise InputError(f"{short(str(folder))}/run.json: is not what a run of refweb writes") from None
    return {(name, step): result.plain() for step, results in read for name, result in results.items()}


def _has(folder, summary, results):
    """Text of the results of a run."""
    names = ", ".join(dict.fromkeys(name for name, _ in results))
    return f"{folder} has {names}" if names else f"the run in {folder} is {summary['status']} and has none"


def _row(key, values):
    """Row of one result in all folders."""
    known = [value for value in values if value is not None]
    first = known[0]
    return {
        "name": key[0],
        "step": key[1],
        "unit": first["unit"],
        "values": [
            value and {k: value.get(k) for k in ("value", "error", "interval", "unit", "verdict")} for value in values
        ],
        "differences": [_difference(value, first) for value in values],
        "agree": _agree(known) if len(known) > 1 else None,
        "meaningless": _why_meaningless(known) if len(known) > 1 else None,
    }


MEANINGLESS = {
    NO_LIMIT: "it changes with every finer mesh, so that neither agreement nor difference says anything of the scenes; "
    "compare its mean over a time (average)",
    STATISTICAL: "the motion is chaotic and each value is one draw of many; compare mean and spread of many runs "
    "(refweb sweep)",
}
"""Reasons why a comparison means nothing, by the verdict on a result."""


def _why_meaningless(results):
    """Reason why a comparison of results means nothing, by their verdicts; else None."""
    given = [result.get("verdict") for result in results]
    verdicts = [verdict for verdict in MEANINGLESS if verdict in given]
    return "; ".join(f'verdict "{verdict}": {MEANINGLESS[verdict]}' for verdict in verdicts) or None


def _difference(value, first):
    """Difference of two values of one unit; None for others."""
    return value["value"] - first["value"] if value and value["unit"] == first["unit"] else None


def _agree(results):
    """Tell if some results may be one value."""
    if len({result["unit"] for result in results}) > 1:
        return False
    if len({result["value"] for result in results}) == 1:
        return True
    spans = [span for result in results if (span := _span(result)) is not None]
    return len(spans) == len(results) and max(lower for lower, _ in spans) <= min(upper for _, upper in spans)


def _span(result):
    """Least and largest value that a result may have, None where that is not known."""
    if result.get("interval") is not None:
        lower, upper = result["interval"]
        return -math.inf if lower is None else lower, math.inf if upper is None else upper
    if result["error"] is None:
        return None
    return result["value"] - result["error"], result["value"] + result["error"]


def _scenes(scenes):
    """Paths at which scenes differ, and the value in each scene."""
    leaves = [dict(_leaves(scene)) for scene in scenes]
    rows = [
        (path, [leaf_values.get(path) for leaf_values in leaves])
        for path in dict.fromkeys(path for leaf_values in leaves for path in leaf_values)
    ]
    return [
        {"path": path, "values": values} for path, values in rows if any(value_n != values[0] for value_n in values)
    ]


def _leaves(value, path=""):
    """Paths and values of all keys that are no tables; tables of a list have their names in the path, else numbers."""
    parts = None
    if isinstance(value, dict):
        parts = value.items()
    elif isinstance(value, list) and value and all(isinstance(item, dict) for item in value):
        names = [item.get("name") for item in value]
        named = all(isinstance(name, str) for name in names) and len(set(names)) == len(names)
        parts = zip(names if named else range(len(value)), value, strict=True)
    if parts is None:
        yield path, value
    else:
        for key, item in parts:
            yield from _leaves(item, f"{path}.{key}" if path else str(key))
