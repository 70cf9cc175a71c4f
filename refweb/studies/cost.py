"""Cost of correct digits: all runs, their references, the cost in words, and the result folder.

May change: private functions; sentences, and `DIGITS`, of which the cost is reported. Must stay: `COLUMNS` of
``cost.csv``; keys of `summary`, which are those of ``run.json`` and which `commands.console` prints; attributes of
`Cost`, which `refweb` exports. Tests: ``tests/studies/test_cost.py``.
"""

from __future__ import annotations

import math
import pathlib
from dataclasses import dataclass, field
from itertools import takewhile
from typing import TYPE_CHECKING, Any

import numpy as np

from ..results.files import as_toml, write_atomically, write_json, write_text
from ..results.folder import check_folder, clear
from ..results.provenance import versions
from . import dop853

if TYPE_CHECKING:
    from collections.abc import Iterator
    from os import PathLike

    from matplotlib.figure import Figure

    from ..results.observables.observe import Observe
    from ..scene import Scene

COLUMNS = "method setting error_observable error_state cpu_s nfev njev nlu nsteps status".split()
"""Columns of ``cost.csv``."""
DIGITS = (1, 2, 3, 6, 9, 12)
"""Numbers of digits whose cost is reported."""


@dataclass(eq=False)
class Cost:
    """Work and precision of every method on one scene.

    Attributes
    ----------
    scene : refweb.Scene
        The scene.
    observable : refweb.Observe
        Observable that is compared, at every history row or load step.
    trials : list of refweb.studies.trials.Trial
        All runs; ``error_observable`` [unit of the observable] is the largest difference over the rows, and
        ``error_state`` [m] that of the displacements at the end. Of each ``values`` is the observable, shape (rows,),
        and ``x`` the displacement at the end [m], shape (rows of the system, 3).
    web : dict
        Data of the web for ``run.json``: numbers of ``nodes``, ``lines`` and ``cells``, ``cable_length`` [m], ``area``
        [m²] and ``mass`` [kg].
    references : tuple of refweb.studies.trials.Trial
        The two reference runs of errors; empty where there are no two.
    independent : bool
        True if the references are of different kinds of methods.
    apart : tuple of float
        Difference of the references: in the observable, and in displacement [m].
    trust : tuple of float
        Least errors that can be measured: the same, or the median of such differences where that is of the same size.
        Smaller errors mean nothing.
    scale : float
        Largest value of the observable over time, which digits are relative to.
    status : {"running", "solved", "failed", "interrupted"}
        How the study ended: "solved" if at least one run is solved.
    message : str
        Reason of a failure, else empty.
    cost : dict of str to float
        ``cpu_s`` and ``wall_s`` of the whole study [s].
    """

    scene: Scene
    observable: Observe
    trials: list[Any]
    web: dict[str, Any]
    references: tuple[Any, ...] = ()
    independent: bool = False
    apart: tuple[float, float] = (np.nan, np.nan)
    trust: tuple[float, float] = (np.nan, np.nan)
    scale: float = np.nan
    status: str = "running"
    message: str = ""
    cost: dict[str, Any] = field(default_factory=lambda: {"cpu_s": 0.0, "wall_s": 0.0})

    @property
    def sentence(self) -> str:
        """Cost of digits, in words."""
        if not self.references:
            return "No two runs can be compared, so nothing is known of errors."
        return f"{_prices(self)} {_agreement(self)}"

    def price(self, digits: int, method: str | None = None) -> Any:
        """The cheapest `Trial` with so many digits, which finer trials of its method have as well; else None.

        It is that of one method, or of all methods but DOP853, which no scene can ask for. The result is None if the
        references do not agree to so many digits. Runs with other smoothings than the scene's do not count, since they
        have other laws.
        """
        limit, best = self.scale * 10.0**-digits, []
        if not self.trust[0] <= limit:
            return None
        methods = {t.method for t in self.trials if t.key != "smoothing"}
        for name in methods - {dop853.NAME} if method is None else methods & {method}:
            ladder = [t for t in self.trials if t.method == name and t.status == "solved"]
            best += takewhile(lambda t: t.error_observable <= limit, reversed(ladder))
        return min(best, key=lambda t: t.cpu_s, default=None)

    def rows(self) -> Iterator[list[Any]]:
        """Rows of ``cost.csv`` below its header, `COLUMNS`."""
        for t in self.trials:
            work = [t.work[key] for key in ("nfev", "njev", "nlu", "nsteps")]
            yield [t.method, t.setting, t.error_observable, t.error_state, t.cpu_s, *work, t.status]

    def summary(self) -> dict[str, Any]:
        """The content of ``run.json``, a dict of plain values; ``kind`` is "cost"."""
        none = lambda value: value if math.isfinite(value) else None  # noqa: E731
        runs = [dict(zip(COLUMNS, row, strict=True)) for row in self.rows()]
        runs = [{key: none(v) if isinstance(v, float) else v for key, v in run.items()} for run in runs]
        return {
            "kind": "cost",
            "status": self.status,
            "message": self.message,
            "scene": self.scene.title,
            "web": self.web,
            "sentence": self.sentence,
            "observable": {"name": self.observable.name, "unit": self.observable.unit, "largest": none(self.scale)},
            "references": [f"{t.method}, {t.setting}" for t in self.references],
            "independent": self.independent,
            "apart": {"observable": none(self.apart[0]), "state": none(self.apart[1])},
            "trust": {"observable": none(self.trust[0]), "state": none(self.trust[1])},
            "runs": [{**run, "message": t.message} for run, t in zip(runs, self.trials, strict=True)],
            "cost": self.cost,
            "versions": versions(),
        }

    def draw(self) -> Figure:
        """The work-precision diagram, a `matplotlib.figure.Figure`."""
        from .diagram import diagram

        return diagram(self)

    def save(self, folder: str | PathLike[str], force: bool = False) -> None:
        """Write ``cost.csv``, ``cost.png``, ``scene.toml`` and ``run.json``.

        Raises
        ------
        InputError
            Where the folder is not empty or cannot be written.
        """
        check_folder(folder, force)
        folder = pathlib.Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        write_json(folder / "run.json", self.summary())
        clear(folder)
        write_text(folder / "scene.toml", as_toml(self.scene.to_dict()))
        lines = [",".join(map(str, row)) for row in (COLUMNS, *self.rows())]
        write_text(folder / "cost.csv", "\n".join(lines) + "\n")
        write_atomically(folder / "cost.png", self.draw().savefig)


def _prices(costs):
    """Prices of digits."""
    best = {}
    for digits in DIGITS:
        if (trial := costs.price(digits)) is not None:
            best[trial] = digits
    best = {trial: digits for trial, digits in best.items() if digits >= min(3, max(best.values()))}
    sentences = [
        f"{digits} digit{'s' if digits > 1 else ''}{' cost' if not i else ''} {trial.cpu_s:.2g} s with {trial.method}, "
        f"{trial.setting}"
        for i, (trial, digits) in enumerate(sorted(best.items(), key=lambda item: item[1]))
    ]
    name = costs.observable.name
    return f"{name}: {'; '.join(sentences)}." if sentences else f"No run has a digit of {name} that can be trusted."


def _agreement(costs):
    """Agreement of the references, and its meaning."""
    first, second = (f"{t.method} ({t.setting})" for t in costs.references)
    agreed, known = (
        max(-math.log10(max(off / costs.scale, 1e-16)), 0.0) if costs.scale else 0.0
        for off in (costs.apart[0], costs.trust[0])
    )
    if not costs.independent:
        return (
            f"There are runs of only one kind of method: {first} and {second} are {agreed:.1f} digits apart, which "
            "says how it converges, and no more."
        )
    if f"{known:.1f}" == f"{agreed:.1f}":
        return f"The references, {first} and {second}, agree to {agreed:.1f} digits."
    return (
        f"The references, {first} and {second}, agree to {agreed:.1f} digits, which may be luck: {known:.1f} digits "
        "are usual between the finest runs of different kinds."
    )
