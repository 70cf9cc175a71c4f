"""References of errors: the two finest runs of different kinds of methods that agree best.

No method alone can be a reference. All runs are compared with one of the two, and smaller errors than the difference of
the two mean nothing. If all finest runs differ by about as much, as in chaotic motions, the best agreement may be luck,
and the median difference counts. If all runs are of one kind, the references are the two finest of one method.

May change: private functions; `LUCK`, which decides when an agreement counts as luck. Must stay: the attributes that
`compare` sets, which `cost` and `diagram` read; two methods of different kinds where there are any. Tests:
``tests/studies/test_cost.py``.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

LUCK = 10.0
"""Median difference of the finest runs, over the least difference, below which the least may be luck."""


def compare(trials):
    """Find the references, and the errors of all runs."""
    solved = [t for t in trials.trials if t.status == "solved"]
    able = [t for t in solved if t.key != "smoothing"]
    finest = {t.method: t for t in able}.values()
    pairs = [pair for pair in combinations(finest, 2) if pair[0].kind != pair[1].kind]
    trials.independent = bool(pairs)
    pairs = pairs or [pair for pair in zip(able[:-1], able[1:], strict=True) if pair[1] in finest]
    pairs = [pair for pair in pairs if trials.independent or pair[0].method == pair[1].method]
    if not pairs:
        return
    scale = max(np.abs(able[-1].values).max(), 1e-300), max(np.linalg.norm(able[-1].x, axis=1).max(), 1e-300)

    def relative(pair):
        return max(off / size for off, size in zip(_apart(*pair), scale, strict=True))

    first, second = trials.references = min(pairs, key=relative)
    trials.apart, trials.scale = _apart(first, second), float(np.abs(first.values).max())
    usual = np.median([_apart(*pair) for pair in pairs], axis=0).tolist()
    trials.trust = tuple(max(u, off) if u < LUCK * off else off for u, off in zip(usual, trials.apart, strict=True))
    for trial in solved:
        trial.error_observable, trial.error_state = trials.trust if trial is first else _apart(trial, first)


def _apart(first, second):
    """Largest differences of the observable and of displacement at the end."""
    return (
        float(np.abs(first.values - second.values).max()),
        float(np.linalg.norm(first.x - second.x, axis=1).max(initial=0.0)),
    )
