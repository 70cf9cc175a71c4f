"""Statistics of the rows of a study: spread and numerical ± apart, probabilities with their confidence intervals.

The mean of a result has two errors. The spread of the cases makes one, which decreases with the number of samples. The
numerical error ± of each case makes the other, which does not. Both are given side by side and never added.

The probability of a condition has an interval by Clopper and Pearson (1934), which covers it at least as often as its
level says, of independent samples; for evenly spread samples the same interval is used, and is mostly too wide. A case
that ± leaves undecided, and a case that has failed, may count as true or false: the interval covers both, and the share
of cases has a lower and an upper value. Results after the horizon of a chaotic motion are random samples, and their ±
has no meaning. If they have an ensemble, its mean and spread are used. In a study with samples a case counts by its one
run, as a trial of Clopper and Pearson does: the difference between runs of one case is one more random variable. In a
study without samples a condition is evaluated for each case: with an ensemble within `LIKELY` standard deviations,
without one by the value and its ±, and as undecided if there is no ±.

May change: private functions, `RESAMPLES` and `LIKELY`, which move intervals. Must stay: `chances`, which
`sweeps.study_result` calls with the rows of a study; keys of entries, which stand in ``run.json`` and which
`results.study_text` reads; spread and ± side by side, never added; `bounds` and `clopper_pearson`, which `sizing.runs`
calls. Tests: ``tests/sweeps/test_chances.py``.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter

import numpy as np

from ..results.case_rows import results_among
from .expressions import Expression, Interval, exact
from .study import SAMPLES

RESAMPLES = 999
"""Number of bootstrap samples for the intervals of Sobol's indices."""
LIKELY = 2.0
"""Number of standard deviations about the mean of an ensemble that contain most of its runs."""
UNDONE = ("skipped", "waiting")
"""Status of rows without a value of a condition, since their cases have not been run."""


def chances(study, rows, columns, names):
    """Statistics of rows.

    Parameters
    ----------
    study : Study
        The study.
    rows : sequence of (Case, dict)
        Cases with their rows.
    columns : sequence of str
        Columns of the rows.
    names : list of dict
        Values of the lists in each group of cases.

    Returns
    -------
    list of dict
        For each group: ``of``, its values by path; ``cases``, the number of rows by status; ``results``, the results of
        `_spread` by name; ``conditions``, those of `_share` by name; ``indices``, those of `_indices` by name, or None
        with the reason.
    """
    results, sampled = results_among(columns), study.sample in SAMPLES
    known = [*study.parameters, *(result_item.name for result_item in results)]
    conditions = {name: Expression(text, known) for name, text in study.conditions.items()} if results else {}
    entries = []
    for number, of in enumerate(names):
        mine = [(case, row) for case, row in rows if case.group == number]
        plain = [(case, row) for case, row in mine if case.part in ("", "A", "B")]
        solved = [row for _, row in plain if row["status"] == "solved"]
        count = Counter(row["status"] for _, row in mine)
        entry = {"of": of, "cases": dict(count), "results": {}, "conditions": {}}
        for result_item in results:
            if spread := _spread(study, result_item, solved, sampled):
                entry["results"][result_item.name] = spread
        for name, condition in conditions.items():
            entry["conditions"][name] = _share(study, condition, results, plain, sampled)
        if study.indices:
            entry["indices"] = {result_item.name: _indices(study, result_item, mine) for result_item in results}
        entries.append(entry)
    return entries


def column_of(row, result):
    """Value, ± and statistical flag of a result in a row; the mean of the ensemble if there is one."""
    value, error = row.get(f"{result.name} [{result.unit}]"), row.get(f"{result.name} ±")
    statistical = result.name in (row.get("statistical") or "").split()
    return value, error, statistical


def _spread(study, result, rows, sampled):
    """Mean, spread and quantiles of a result, each with its part from ±; None if no row has the result.

    A standard deviation is the norm of the values minus their mean, over √(n − 1): it changes by at most the norm of
    their errors, over √(n − 1).
    """
    values, errors, within, means = [], [], [], []
    for row in rows:
        value, error, statistical = column_of(row, result)
        if value is None or not math.isfinite(value):
            continue
        values.append(value)
        errors.append(0.0 if statistical else error)
        means.append(row[f"{result.name} mean"] if row.get(f"{result.name} mean") is not None else value)
        within.append(row.get(f"{result.name} deviation") or 0.0)
    if not values:
        return None
    values, means, n = np.array(values), np.array(means), len(values)
    unknown = sum(error is None for error in errors)
    wide = np.array([error or 0.0 for error in errors])
    statistics_found = {"unit": result.unit, "count": n, "least": float(values.min()), "largest": float(values.max())}
    statistics_found |= {"without_error": unknown, "error": None if unknown else float(wide.max())}
    if any(f"{result.name} verdict" in row for row in rows):
        named = [row.get(f"{result.name} verdict") or "none" for row in rows if f"{result.name} verdict" in row]
        statistics_found["verdicts"] = {verdict: named.count(verdict) for verdict in dict.fromkeys(named)}
    if not sampled:
        return statistics_found
    between = float(np.var(means, ddof=1)) if n > 1 else 0.0
    deviation = math.sqrt(between + float(np.mean(np.square(within))))
    statistics_found |= {"mean": float(means.mean()), "mean_error": None if unknown else float(wide.mean())}
    statistics_found |= {"deviation": deviation, "standard_error": math.sqrt(between / n) if n > 1 else None}
    statistics_found["deviation_error"] = None if unknown or n == 1 else float(np.sqrt((wide**2).sum() / (n - 1)))
    statistics_found["quantiles"] = [
        _quantile(values, None if unknown else wide, q, study.confidence) for q in study.quantiles
    ]
    return statistics_found


def _quantile(values, errors, q, level):
    """A quantile; its bounds from ±, since quantiles increase with the values; its confidence interval by ranks.

    The number of samples below a quantile is binomial: no distribution of the values is assumed. With few samples there
    is no interval.
    """
    from scipy.stats import quantile_test

    at = {"q": q, "value": float(np.quantile(values, q)), "least": None, "most": None, "interval": None}
    if errors is not None:
        at["least"], at["most"] = (float(np.quantile(values + sign * errors, q)) for sign in (-1.0, 1.0))
    ends = [float(end) for end in quantile_test(values, p=q).confidence_interval(level)]
    at["interval"] = ends if all(map(math.isfinite, ends)) else None
    return at


def bounds(row, results, values, sampled):
    """Values by name for a condition: parameters, and results as intervals of ±, without width if ± is not known.

    Random samples have no width if cases are ``sampled``. Otherwise the interval is `LIKELY` standard deviations about
    the mean of the ensemble, without an ensemble that of ±, and unbounded if ± is not known.
    """
    values_found = dict(values)
    for result in results:
        value, error, statistical = column_of(row, result)
        if value is None:
            continue
        wide = 0.0 if error is None else error
        if statistical:
            wide = 0.0 if sampled else math.inf if error is None else error
        if not sampled and (spread := row.get(f"{result.name} deviation")) is not None:
            value, wide = row[f"{result.name} mean"], LIKELY * spread
        lower, upper = row.get(f"{result.name} least"), row.get(f"{result.name} most")
        values_found[result.name] = Interval(
            value - wide if lower is None else lower, value + wide if upper is None else upper
        )
    return values_found


def _share(study, condition, results, cases, sampled):
    """Share of the cases for which a condition holds, and of samples its probability.

    ``true`` and ``false`` count cases that are decided within ±, ``undecided`` the cases that ± or the spread of an
    ensemble leaves undecided, and ``failed`` the cases without a result. ``unproven`` counts decided cases with a
    result without ±, and ``statistical`` decided cases with a result that is a random sample. ``share`` is computed
    from the values without ±. Undecided and failed cases count as false in ``lower`` and as true in ``upper``.
    """
    used = [item for item in results if item.name in condition.used]
    kinds = ("true", "false", "undecided", "failed", "unproven", "statistical", "by_value")
    count: dict[str, int] = dict.fromkeys(kinds, 0)
    for case, row in cases:
        if row["status"] in UNDONE:
            continue
        bounds_found = bounds(row, results, case.values, sampled)
        if row["status"] != "solved" or any(item.name not in bounds_found for item in used):
            count["failed"] += 1
            continue
        verdict = condition(bounds_found)
        count[{True: "true", False: "false", None: "undecided"}[verdict]] += 1
        columns = [column_of(row, item) for item in used]
        count["statistical"] += any(statistical for *_, statistical in columns)
        count["unproven"] += verdict is not None and any(
            error is None and not statistical and row.get(f"{item.name} least") is None
            for item, (_, error, statistical) in zip(used, columns, strict=True)
        )
        values = {item.name: exact(value) for item, (value, *_) in zip(used, columns, strict=True)}
        count["by_value"] += condition(bounds_found | values) is True
    decided = count["true"] + count["false"] + count["undecided"]
    n = decided + count["failed"]
    share = {"condition": condition.text, **count, "share": count["by_value"] / decided if decided else None}
    share["lower"], share["upper"] = (count["true"] / n, 1.0 - count["false"] / n) if n else (None, None)
    if sampled and n:
        lower, _ = clopper_pearson(count["true"], n, study.confidence)
        _, upper = clopper_pearson(n - count["false"], n, study.confidence)
        share["interval"] = [lower, upper]
        share["by_samples"] = list(clopper_pearson(count["by_value"], decided, study.confidence)) if decided else None
    return share


def clopper_pearson(successes, count, level):
    """The interval of Clopper and Pearson of a probability, from successes among a count of independent trials."""
    from scipy.stats import binomtest

    interval = binomtest(successes, count).proportion_ci(level, method="exact")
    return float(interval.low), float(interval.high)


def _indices(study, result, cases):
    """Sobol's indices of a result, of first order and total, with their intervals; None with the reason.

    Intervals are bootstrap percentiles. They do not contain ±: ``error`` is the largest ± over the spread, and the
    indices are meaningful only if it is small.
    """
    from scipy.stats import sobol_indices

    drawn, n = list(study.drawn), study.count
    table = {part: np.full(n, np.nan) for part in ("A", "B", *drawn)}
    errors = []
    for case, row in cases:
        value, error, statistical = column_of(row, result)
        if row["status"] == "solved" and value is not None:
            table[case.part][case.draw] = value
            errors.append(0.0 if statistical else error)
    missing = sum(int(np.isnan(values).sum()) for values in table.values())
    if missing:
        return {"reason": f"{missing} of {n * (len(drawn) + 2)} cases have no result"}
    spread = float(np.std(np.concatenate([table["A"], table["B"]])))
    if not spread:
        return {"reason": "all cases have the same result"}

    def of(rows):
        func = {"f_A": table["A"][None, rows], "f_B": table["B"][None, rows]}
        func["f_AB"] = np.array([table[path][rows] for path in drawn])[:, None]
        indices = sobol_indices(func=func, n=n)
        return np.array([np.ravel(indices.first_order), np.ravel(indices.total_order)])

    generator = np.random.default_rng(study.seed)
    best = of(np.arange(n))
    with np.errstate(invalid="ignore", divide="ignore"):
        again = np.array([of(generator.integers(0, n, n)) for _ in range(RESAMPLES)])
    tails = 0.5 * (1.0 - study.confidence)
    low, high = np.nanquantile(again, [tails, 1.0 - tails], axis=0)
    by_result: dict = {path: {} for path in drawn}
    for (k, kind), (p, path) in itertools.product(enumerate(("first", "total")), enumerate(drawn)):
        by_result[path][kind] = {"value": float(best[k, p]), "interval": [float(low[k, p]), float(high[k, p])]}
    known = [error for error in errors if error is not None]
    return {"of": by_result, "error": max(known) / spread if len(known) == len(errors) else None}
