"""One work by all programs: first each of their settings once, then each peer beside refweb, in pairs.

All that is measured stands in ``WORK.json`` of a folder, so that a comparison that was stopped goes on.
"""

from __future__ import annotations

import json
import time

import numpy as np

from . import runs
from .truth import Truth


class Comparison:
    """What is known of a work.

    Parameters
    ----------
    work : Work
    machine : Machine
    folder : pathlib.Path
        Where what is measured is kept.
    quick : bool
        The quick variant.
    announce : callable
        Called with a line of text for each run.
    """

    def __init__(self, work, machine, folder, quick, announce=print):
        self.work, self.machine, self.quick, self.announce = work, machine, quick, announce
        name = f"{work.name}-quick" if quick else work.name
        self.path, self.truth_path = folder / f"{name}.json", folder / f"{name}.npz"
        stored = json.loads(self.path.read_text(encoding="utf-8")) if self.path.exists() else {}
        self.records = stored.get("records", [])
        self.problem, self.settings = work.problem(quick), {**work.settings, **(work.quick if quick else {})}
        self._truth = None

    @property
    def truth(self):
        """The `Truth`, computed once."""
        if self._truth is None and self.truth_path.exists():
            with np.load(self.truth_path) as stored:
                self._truth = Truth(stored["positions"], float(stored["apart"]), str(stored["said"]))
        if self._truth is None:
            self.announce(f"{self.work.name}: truth")
            self._truth = self.work.truth(self.problem)
            np.savez(self.truth_path, **self._truth._asdict())
        return self._truth

    def run(self, name, settings, beside=None):
        """Run a program, and keep its `record`; ``beside`` is the peer that a run is one of a pair with."""
        truth = self.truth
        cost, result = runs.run(self.machine, name, self.work.task, self.problem, settings)
        cost |= {"program": name, "settings": settings, "beside": beside, "ended": time.time()}
        if result is not None and np.isfinite(result).all():
            cost["error"] = float(np.linalg.norm(result - truth.positions, axis=1).max())
            if len(result) == len(self.problem.points):
                tensions = self.problem.tensions(result) - self.problem.tensions(truth.positions)
                cost["tension_error"] = float(np.abs(tensions).max())
            told = f"{cost['cpu']:.2f} s CPU, error {cost['error']:.1e} m"
        else:
            cost.setdefault("failure", "positions that are no numbers")
            told = cost["failure"]
        self.records.append(cost)
        self.path.write_text(json.dumps({"records": self.records}, indent=1), encoding="utf-8")
        given = ", ".join(f"{key} = {value:g}" if isinstance(value, float) else f"{key} = {value}"
                          for key, value in settings.items())  # fmt: skip
        self.announce(f"{self.work.name}: {name} {given}: {told}")

    def of(self, name, settings=None, beside=None):
        """Records of a program, of some settings, in pairs with a peer."""
        return [
            r for r in self.records
            if r["program"] == name and settings in (None, r["settings"]) and beside in (None, r["beside"])
        ]  # fmt: skip

    def chosen(self, name):
        """Settings of a program that cost least of those that reach the target; None where none does."""
        good = [r for r in self.of(name) if "error" in r and r["error"] <= self.work.target]
        return min(good, key=lambda r: r["cpu"])["settings"] if good else None

    def ladder(self, names):
        """Run every setting once that has not been run."""
        for name in names:
            for settings in self.settings.get(name, ()):
                if not self.of(name, settings):
                    self.run(name, settings)

    def pairs(self, peer, count, budget):
        """Run a peer and refweb one after the other, first the one and then the other, until the time is spent."""
        mine, other = self.chosen("refweb"), self.chosen(peer)
        begun, known = time.monotonic(), len(self.ratios(peer))
        for k in range(known, count):
            if mine is None or other is None or (k > 0 and time.monotonic() - begun > budget):
                return
            order = [("refweb", mine), (peer, other)]
            for name, settings in order if k % 2 else reversed(order):
                self.run(name, settings, peer)

    def ratios(self, peer):
        """CPU time of a peer over that of refweb in each pair."""
        both = (self.of(name, beside=peer) for name in (peer, "refweb"))
        return [a["cpu"] / b["cpu"] for a, b in zip(*both, strict=False) if "cpu" in a and "cpu" in b]

    def takes(self, name):
        """Whether a program has settings and a function for the work."""
        return name in self.settings and self.work.task in runs.tasks(name)
