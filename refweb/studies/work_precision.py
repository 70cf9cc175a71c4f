"""What digits cost: every method on one scene, its errors against its CPU time.

Errors are differences to a reference that no method alone can set: of the finest runs of all methods, the two of
different kinds that agree best are the references; with one of them all others are compared, and their difference is
how far any error can be trusted. Where all finest runs are about as far apart, as they are where motions are chaotic,
the best agreement may be luck, and the median difference counts. Where there are runs of one kind alone, the two finest
of one method stand in, and that is said.

The budget is kept by looking at the clock of `refweb.studies.trials`: what is expected to be the cheapest comes first,
and of a method that has had its turns later; a run may take a third of what is left, is left out where it is expected
to take more, and is ended where it does. The coarsest run of a method may always take a twentieth of the budget.
"""

from __future__ import annotations

import json
import math
import pathlib
from dataclasses import dataclass, field
from itertools import combinations, takewhile

import numpy as np

from ..errors import InputError, SolverError, in_file
from ..messages import nearest, shown
from ..registry import OBSERVABLES, load
from ..results.files import as_toml, write_atomically, write_text
from ..results.folder import check_folder, clear
from ..results.observables.observe import default
from ..results.provenance import versions, web_of
from ..results.run_status import Clock, recorded
from ..scene import Scene
from ..tables import checked, real
from . import dop853, trials

SHARE = 1.0 / 3.0
"""Largest share of what is left of the budget that a run may take."""
TURN = 0.05
"""Share of the budget that the coarsest run of each method may take, however little is left."""
FAIR = 1.5
"""Factor of an expected price for each rung that the method has behind it."""
CHEAP, REPEATS = 0.2, 3
"""Runs of less CPU time [s] are repeated; their smallest time counts."""
LUCK = 10.0
"""Factor between the median difference of the finest runs and the least one, below which the least may be luck."""
COLUMNS = "method setting error_observable error_state cpu_s nfev njev nlu nsteps status".split()
"""Columns of ``cost.csv``."""
DIGITS = (1, 2, 3, 6, 9, 12)
"""Digits whose price is told."""


@dataclass(eq=False)
class Cost:
    """Work and precision of every method on one scene.

    Attributes
    ----------
    scene : refweb.Scene
        The scene.
    observable : refweb.Observe
        What is compared, at every history row or load step.
    trials : list of refweb.studies.trials.Trial
        All runs; ``error_observable`` [unit of the observable] is the largest difference over the rows, and
        ``error_state`` [m] that of the displacements at the end. Of each ``values`` is the observable, shape (rows,),
        and ``x`` the displacement at the end [m], shape (rows of the system, 3).
    web : dict
        What is written of the web to ``run.json``: numbers of ``nodes``, ``lines`` and ``cells``, ``cable_length`` [m],
        ``area`` [m²] and ``mass`` [kg].
    references : tuple of refweb.studies.trials.Trial
        The two runs that errors are measured with; empty where there are no two.
    independent : bool
        Whether they are of different kinds.
    apart : tuple of float
        How far they are apart: in the observable, and in displacement [m].
    trust : tuple of float
        What is known of errors: the same, or the median of such differences where that is of the same size. An error
        below that means nothing.
    scale : float
        Largest value of the observable over time, which digits are relative to.
    status : {"running", "solved", "failed", "interrupted"}
        How it ended: "solved" where one run at least is.
    message : str
        Why it failed, else empty.
    cost : dict of str to float
        ``cpu_s`` and ``wall_s`` of all of it [s].
    """

    scene: object
    observable: object
    trials: list
    web: dict
    references: tuple = ()
    independent: bool = False
    apart: tuple = (np.nan, np.nan)
    trust: tuple = (np.nan, np.nan)
    scale: float = np.nan
    status: str = "running"
    message: str = ""
    cost: dict = field(default_factory=lambda: {"cpu_s": 0.0, "wall_s": 0.0})

    @property
    def sentence(self):
        """What digits cost, in words."""
        return " ".join(_sentence(self))

    def price(self, digits, method=None):
        """The cheapest `Trial` from which on a method keeps so many digits of the observable, None where none does.

        Of one method, or of all but DOP853, which no scene can ask for. What the references cannot tell counts as none;
        other smoothings than the scene's are other laws, and not among the methods.
        """
        limit, best = self.scale * 10.0**-digits, []
        if not self.trust[0] <= limit:
            return None
        methods = {t.method for t in self.trials if t.key != "smoothing"}
        for name in methods - {dop853.NAME} if method is None else methods & {method}:
            ladder = [t for t in self.trials if t.method == name and t.status == "solved"]
            best += takewhile(lambda t: t.error_observable <= limit, reversed(ladder))
        return min(best, key=lambda t: t.cpu_s, default=None)

    def rows(self):
        """Rows of ``cost.csv`` below its header, `COLUMNS`."""
        for t in self.trials:
            work = [t.work[key] for key in ("nfev", "njev", "nlu", "nsteps")]
            yield [t.method, t.setting, t.error_observable, t.error_state, t.cpu_s, *work, t.status]

    def summary(self):
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

    def draw(self):
        """The work-precision diagram, a `matplotlib.figure.Figure`."""
        from .diagram import diagram

        return diagram(self)

    def save(self, folder, force=False):
        """Write ``cost.csv``, ``cost.png``, ``scene.toml`` and ``run.json``.

        Raises
        ------
        InputError
            Where the folder is not empty or cannot be written.
        """
        check_folder(folder, force)
        folder = pathlib.Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        write_text(folder / "run.json", json.dumps(self.summary(), indent=1, ensure_ascii=False) + "\n")
        clear(folder)
        write_text(folder / "scene.toml", as_toml(self.scene.to_dict()))
        lines = [",".join(map(str, row)) for row in (COLUMNS, *self.rows())]
        write_text(folder / "cost.csv", "\n".join(lines) + "\n")
        write_atomically(folder / "cost.png", self.draw().savefig)


def cost(scene, observe=None, budget=120.0, out=None, force=False, progress=None, announce=None):
    """Run a scene by every method that takes it, from coarse to fine, and compare errors and CPU times.

    Parameters
    ----------
    scene : Scene, path-like or str
        A scene, a scene file or the name of a scene shipped with refweb. Its events and twins are left out.
    observe : str, optional
        Name of the observable that errors are of: a nodal quantity, one of lines, or the slack fraction; by default
        the first of the scene that is one.
    budget : float
        CPU time that all of it may take [s]; runs have at least half of it, however long kernels take to compile.
    out : path-like, optional
        Result folder; without it nothing touches the disk.
    force : bool
        Replace the results of an earlier run in ``out``.
    progress : callable, optional
        Called with a line of text and the share of the budget that is spent.
    announce : callable, optional
        Called with the scene and its system when the input has been accepted.

    Returns
    -------
    Cost

    Raises
    ------
    InputError
        For wrong input; nothing has been written.
    SolverError
        Where no method solves the scene.
    """
    clock, began = Clock(), trials.clock()
    budget = checked("budget", budget, real(above=0, unit="s"))
    scene = scene if isinstance(scene, Scene) else Scene.load(scene)
    if out is not None:
        check_folder(out, force)
        scene.to_dict()  # refuses a web that no file can hold
    scene = scene.replace(event=())
    system = scene.build()
    with in_file(scene.file):
        observable = _observable(scene, observe)
    if announce is not None:
        announce(scene, system)
    runner = (trials.Dynamics if scene.solve.kind == "dynamic" else trials.Statics)(scene, system, observable)
    ladders = trials.trials_of(scene)
    found = Cost(scene, observable, [trial for ladder in ladders.values() for trial in ladder], web_of(system))
    try:
        with recorded(found, clock):
            _compile(ladders, runner)
            deadline = max(began + 0.9 * budget, trials.clock() + 0.5 * budget)  # the rest is for the diagram
            _climb(ladders, runner, deadline, budget, progress or (lambda text, share: None))
            if not any(t.status == "solved" for t in found.trials):
                found.status = "failed"
    finally:
        _compare(found)
        if found.status == "failed" and not found.message:
            found.message = next((f"{t.method}: {t.message}" for t in found.trials if t.message), found.sentence)
        if out is not None:
            found.save(out, force)
    if found.status == "failed":
        raise SolverError(f"no method solves the scene within {budget:g} s; {found.message}")
    return found


def _observable(scene, name):
    """What is compared: the observable of a name, or the first that a state alone determines."""
    if name is None:
        return next(o for o in (*scene.observables, *default()) if not o.observable.booked)
    names = {o.name: o for o in scene.observables}
    if name not in names:
        raise InputError(f"observe = {shown(name)} is no observable of the scene, {nearest(name, names)}")
    if names[name].observable.booked:
        known = [quantity for quantity, entry in OBSERVABLES.items() if not load(entry).booked]
        raise InputError(
            f'observe = {shown(name)} is of quantity "{names[name].quantity}", must be one of {", ".join(known)}'
        )
    return names[name]


def _compile(ladders, runner):
    """Compile the kernels of each method, and find those that refuse the scene."""
    for ladder in ladders.values():
        try:
            runner.compile(ladder[0])
        except InputError as error:
            for trial in ladder:
                trial.status, trial.message = "refused", str(error)


def _climb(ladders, runner, deadline, budget, tell):
    """Run all ladders at once, always the rung that is expected to be the cheapest, while there is time.

    Expected prices count `FAIR` times for each rung that a method has behind it, so that all kinds have a turn.
    """
    ahead = {name: 0 for name, ladder in ladders.items() if ladder and ladder[0].status != "refused"}
    while ahead:
        prices = {name: _expected(ladders[name], rung, runner) for name, rung in ahead.items()}
        name = min(prices, key=lambda name: prices[name] * FAIR ** ahead[name])
        ladder, now = ladders[name], trials.clock()
        trial, rest = ladder[ahead[name]], ladder[ahead[name] :]
        share = SHARE * (deadline - now) if ahead[name] else max(SHARE * (deadline - now), TURN * budget)
        tell(f"{name}, {trial.setting}", min(1.0 - (deadline - now) / budget, 1.0))
        if prices[name] > share and (ahead[name] or trial.key == "safety"):
            trial.message = "would take more than its share of the budget"
        else:
            _try(trial, runner, now + share)
        if trial.status == "budget":
            for left in rest:
                left.message = trial.message
        ahead[name] += 1
        if trial.status == "budget" or ahead[name] == len(ladder):
            del ahead[name]


def _expected(ladder, rung, runner):
    """CPU time to expect of a rung [s]: growing as it did before, or as explicit steps and tolerances do."""
    trial = ladder[rung]
    spent = [(t.value, t.cpu_s) for t in ladder[:rung] if t.status == "solved"]
    if not spent:
        return runner.expected(trial)
    power = 1.0 if trial.key == "safety" else 0.2
    if len(spent) > 1:
        (first, one), (last, other) = spent[-2:]
        power = max(power, math.log(other / one) / math.log(first / last))
    return spent[-1][1] * (spent[-1][0] / trial.value) ** power


def _try(trial, runner, until):
    """Run a trial, several times where it is cheap, and note how it ended."""
    least = np.inf
    for _ in range(REPEATS):
        began = trials.clock()
        try:
            runner.run(trial, until)
        except trials.OverBudget:
            if least < np.inf:
                break
            trial.message = "took more than its share of the budget"
            return
        except SolverError as error:
            trial.status, trial.message, trial.cpu_s = "failed", str(error), trials.clock() - began
            return
        trial.status, least = "solved", min(least, trial.cpu_s)
        if trial.cpu_s > CHEAP or 2.0 * trials.clock() - began > until:
            break
    trial.cpu_s = least


def _apart(one, other):
    """Largest differences of the observable and of displacement at the end."""
    return (
        float(np.abs(one.values - other.values).max()),
        float(np.linalg.norm(one.x - other.x, axis=1).max(initial=0.0)),
    )


def _compare(found):
    """Find the references, and the errors of all runs."""
    solved = [t for t in found.trials if t.status == "solved"]
    able = [t for t in solved if t.key != "smoothing"]
    finest = {t.method: t for t in able}.values()
    pairs = [pair for pair in combinations(finest, 2) if pair[0].kind != pair[1].kind]
    found.independent = bool(pairs)
    pairs = pairs or [pair for pair in zip(able[:-1], able[1:], strict=True) if pair[1] in finest]
    pairs = [pair for pair in pairs if found.independent or pair[0].method == pair[1].method]
    if not pairs:
        return
    scale = max(np.abs(able[-1].values).max(), 1e-300), max(np.linalg.norm(able[-1].x, axis=1).max(), 1e-300)

    def relative(pair):
        return max(off / size for off, size in zip(_apart(*pair), scale, strict=True))

    first, second = found.references = min(pairs, key=relative)
    found.apart, found.scale = _apart(first, second), float(np.abs(first.values).max())
    usual = np.median([_apart(*pair) for pair in pairs], axis=0).tolist()
    found.trust = tuple(max(u, off) if u < LUCK * off else off for u, off in zip(usual, found.apart, strict=True))
    for trial in solved:
        trial.error_observable, trial.error_state = found.trust if trial is first else _apart(trial, first)


def _sentence(found):
    if not found.references:
        yield "No two runs can be compared, so nothing is known of errors."
        return
    best = {}
    for digits in DIGITS:
        if (trial := found.price(digits)) is not None:
            best[trial] = digits
    best = {trial: digits for trial, digits in best.items() if digits >= min(3, max(best.values()))}
    told = [
        f"{digits} digit{'s' if digits > 1 else ''}{' cost' if not i else ''} {trial.cpu_s:.2g} s with {trial.method}, "
        f"{trial.setting}"
        for i, (trial, digits) in enumerate(sorted(best.items(), key=lambda item: item[1]))
    ]
    name = found.observable.name
    yield f"{name}: {'; '.join(told)}." if told else f"No run has a digit of {name} that can be trusted."
    one, other = (f"{t.method} ({t.setting})" for t in found.references)
    agreed, known = (
        max(-math.log10(max(off / found.scale, 1e-16)), 0.0) if found.scale else 0.0
        for off in (found.apart[0], found.trust[0])
    )
    if not found.independent:
        yield (
            f"There are runs of one kind of method alone: {one} and {other} are {agreed:.1f} digits apart, which says "
            "how it converges, and no more."
        )
    elif f"{known:.1f}" == f"{agreed:.1f}":
        yield f"The references, {one} and {other}, agree to {agreed:.1f} digits."
    else:
        yield (
            f"The references, {one} and {other}, agree to {agreed:.1f} digits, which may be luck: {known:.1f} digits "
            "are usual between the finest runs of different kinds."
        )
