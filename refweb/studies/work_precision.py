"""Work and precision: every method on one scene, its errors against its CPU time.

Trials of all methods, from coarse to fine, run within a budget, see `refweb.studies.budget`. Errors are differences
from one of two references of different kinds, see `refweb.studies.references`. A message says if all runs are of one
kind.

May change: texts of messages. Must stay: `_observable`, which a test calls; names of the arguments of `cost`, which
`refweb` exports and to which `commands.cost` gives its options as keywords. Tests: ``tests/studies/test_cost.py``,
``tests/dynamics/test_averages.py``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from ..errors import InputError, SolverError, in_file
from ..messages import nearest, quote
from ..registry import OBSERVABLES, load
from ..results.folder import check_folder
from ..results.observables.observe import default
from ..results.progress import followed
from ..results.provenance import web_of
from ..results.run_status import Clock, recorded
from ..scene import Scene
from ..tables import checked, real
from . import trials
from .budget import climb, compile_all
from .cost import Cost
from .references import compare

if TYPE_CHECKING:
    from os import PathLike

    from ..system.system import System


def cost(
    scene: Scene | str | PathLike[str],
    observe: str | None = None,
    budget: float = 120.0,
    out: str | PathLike[str] | None = None,
    force: bool = False,
    progress: bool | Callable[..., Any] | None = True,
    announce: Callable[[Scene, System], object] | None = None,
) -> Cost:
    """Run a scene by every method that takes it, from coarse to fine, and compare errors and CPU times.

    Parameters
    ----------
    scene : Scene, path-like or str
        A scene, a scene file or the name of a scene shipped with refweb. Its events and step refinements are left out.
    observe : str, optional
        Name of the observable whose errors are compared: a nodal quantity, one of lines, or the slack fraction. The
        default is the first of these in the scene.
    budget : float
        CPU time of the whole study [s]; runs have at least half of it, however long kernels take to compile.
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
        If no method solves the scene.
    """
    clock, began = Clock(), trials.clock()
    budget = checked("budget", budget, real(above=0, unit="s"))
    scene = scene if isinstance(scene, Scene) else Scene.load(scene)
    if out is not None:
        check_folder(out, force)
        scene.to_dict()  # refuses a web that no file can hold
    scene = scene.replace(event=())
    if scene.control:
        raise InputError("[[control]] cannot be compared by all methods: refweb cost runs without it; leave it out")
    system = scene.build()
    with in_file(scene.file):
        observable = _observable(scene, observe)
    if announce is not None:
        announce(scene, system)
    runner = (trials.Dynamics if scene.solve.kind == "dynamic" else trials.Statics)(scene, system, observable)
    ladders = trials.trials_of(scene)
    result = Cost(scene, observable, [trial for ladder in ladders.values() for trial in ladder], web_of(system))
    try:
        with recorded(result, clock), followed(progress) as tell:
            compile_all(ladders, runner)
            deadline = max(began + 0.9 * budget, trials.clock() + 0.5 * budget)  # the rest is for the diagram
            climb(ladders, runner, deadline, budget, tell)
            if not any(t.status == "solved" for t in result.trials):
                result.status = "failed"
    finally:
        compare(result)
        if result.status == "failed" and not result.message:
            result.message = next((f"{t.method}: {t.message}" for t in result.trials if t.message), result.sentence)
        if out is not None:
            result.save(out, force)
    if result.status == "failed":
        raise SolverError(f"no method solves the scene within {budget:g} s; {result.message}")
    return result


def _observable(scene, name):
    """Observable of a name; by default the first that the state at an instant determines."""
    if name is None:
        return next(o for o in (*scene.observables, *default()) if not (o.observable.booked or o.average))
    names = {o.name: o for o in scene.observables}
    if name not in names:
        raise InputError(f"observe = {quote(name)} is not an observable of the scene, {nearest(name, names)}")
    if names[name].average is not None:
        raise InputError(
            f"observe = {quote(name)} is a mean, average = {names[name].average:g}: methods are compared by values of "
            "an instant; name an observable without average"
        )
    if names[name].observable.booked:
        known = [quantity for quantity, entry in OBSERVABLES.items() if not load(entry).booked]
        raise InputError(
            f'observe = {quote(name)} is of quantity "{names[name].quantity}", must be one of {", ".join(known)}'
        )
    return names[name]
