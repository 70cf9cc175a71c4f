"""Natural frequencies and mode shapes of a scene: an equilibrium, and the small vibrations about it.

May change: `MAX_MODES`, and texts. Must stay: `COLUMNS` of ``modes.csv``, whose order `_rows` has; names of
`_described`, which stand in ``run.json`` and which `results.summary_text` reads; ``frequency_N``, which
`pictures.record` and `sizing.case` know; `modes` and `Modes`, which `refweb` exports; public names of `Modes`, which
other files use. Tests: ``tests/studies/test_modes.py``, ``tests/studies/test_modes_with_bodies.py``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError, in_file
from ..registry import STATICS, load
from ..results.folder import Folder, check_folder
from ..results.progress import followed
from ..results.provenance import versions, web_of
from ..results.run_status import Clock, recorded
from ..results.solution import SOLVER, Result, as_history
from ..results.state import State
from ..scene import Scene
from ..solution import Solution
from ..statics.remarks import Remarks, open_rows
from ..system.static_system import at_rest
from ..tables import checked, integer
from .mode_remarks import left_out, remarks_on
from .spectrum import spectrum

if TYPE_CHECKING:
    from os import PathLike

    from numpy.typing import NDArray

    from ..statics.gradients import Gradient
    from ..system.system import System

MAX_MODES = 1000
"""Largest number of modes."""
COLUMNS = ["step [1]", "mode [1]", "frequency [Hz]", "error [Hz]", "omega_squared [1/s²]", "residual [1]"]
COLUMNS += ["modal_mass [kg]", "share_x [1]", "share_y [1]", "share_z [1]", "moving [1]", "node [1]"]


@dataclass(eq=False, repr=False)
class Modes(Solution):
    """Natural frequencies and shapes; `state` and its arrays are those of the equilibrium at the last load step.

    Attributes
    ----------
    spectra : list of refweb.studies.spectrum.Spectrum
        Modes at each load step. Only the last has shapes, the others have None. A dynamic scene has one spectrum, at
        its equilibrium at t = 0.
    """

    spectra: list[Any] = field(default_factory=list)

    @property
    def frequency(self) -> NDArray[np.float64]:
        """Natural frequencies at the last load step [Hz], shape (modes,); negative ones are imaginary: unstable."""
        return self.spectra[-1].frequency

    @property
    def error(self) -> NDArray[np.float64]:
        """± of each frequency [Hz], shape (modes,): the error of the solver, without the discretisation error."""
        return self.spectra[-1].error

    @property
    def shapes(self) -> NDArray[np.float64]:
        """Displacement of each node in each mode at the last load step, shape (modes, nodes, 3); the largest is 1.

        In a rotating frame nodes move on ellipses: ``spectra[-1].later`` is the displacement a quarter of a period
        later.
        """
        return self.spectra[-1].shapes[:, : self.state.system.net.nodes]

    def gradient(self, result: str, path: str, by: str | None = None) -> Gradient:
        """Derivative of a natural frequency, or of another result of the equilibrium, by numbers of the scene.

        It holds the change of the equilibrium: one solution with its factorization for all numbers. Frequencies that
        are equal within ± keep their order as a number changes: their derivatives are sorted, ``left`` is that for a
        number that falls, and ``equal`` names them.

        Parameters
        ----------
        result : str
            "frequency_1" and so on, or a result of the scene.
        path, by : str
            See `refweb.Solution.gradient`.

        Returns
        -------
        refweb.statics.gradients.Gradient

        Raises
        ------
        InputError
            As `refweb.Solution.gradient`; for modes that grow in axes that turn, frequencies that meet there, and lines
            that have yielded.
        """
        from .frequency_gradients import FrequencyGradients

        if "_gradients" not in self.__dict__:
            self._gradients = FrequencyGradients(replace(self, scene=_without_slips(self.scene)))
        return self._gradients.gradient(result, path, by)

    def __repr__(self) -> str:
        frequencies = ", ".join(f"{f:.6g}" for f in self.frequency[:4]) if self.spectra else ""
        return f'<Modes of "{self.scene.title}": {self.status}; {frequencies} Hz>'

    def summary(self) -> dict[str, Any]:
        """The content of ``run.json``, a dict of plain values; ``kind`` is "modes"."""
        return {"kind": "modes", **super().summary()}

    def save(self, folder: str | PathLike[str], force: bool = False) -> None:
        """Write the result folder: ``modes.csv``, and as frame k the shape of mode k on the equilibrium.

        Parameters
        ----------
        folder : path-like
            Folder, which is created if it does not exist.
        force : bool
            Replace the results of an earlier run.

        Raises
        ------
        InputError
            Where the folder is not empty or cannot be written.
        """
        check_folder(folder, force)
        out = Folder(folder, self.scene, COLUMNS, {**self.summary(), "status": "running"}, table="modes.csv")
        moving = [node_or_body for step in self.steps for node_or_body in step["at"]]
        for row, node_or_body in zip(zip(*self.history.values(), strict=True), moving, strict=True):
            out.row([*row[:-1], node_or_body])
        for number, shape in enumerate(self.spectra[-1].shapes if self.spectra else (), start=1):
            out.frame(number, self.state, shape)
        out.close()
        out.summary(self.summary())


def modes(
    scene: Scene | str | PathLike[str],
    number: int = 10,
    out: str | PathLike[str] | None = None,
    force: bool = False,
    progress: bool | Callable[..., Any] | None = True,
    announce: Callable[[Scene, System], object] | None = None,
) -> Modes:
    """The lowest natural frequencies and mode shapes about an equilibrium, without damping.

    Of a static scene the equilibrium is that of each load step; of a dynamic one that at t = 0 under gravity, loads,
    motion and bodies, see `refweb.system.static_system.waiting`.

    Parameters
    ----------
    scene : Scene, path-like or str
        A scene, a scene file or the name of a scene shipped with refweb.
    number : int
        Number of modes, at most 1000; the web may have fewer.
    out : path-like, optional
        Result folder; without it nothing touches the disk.
    force : bool
        Replace the results of an earlier run in ``out``.
    progress : bool or callable
        True to show the progress in a terminal or a notebook. A callable is called with a line of text and the finished
        share, 0 to 1.
    announce : callable, optional
        Called with the scene and its system when the input has been accepted.

    Returns
    -------
    Modes

    Raises
    ------
    InputError
        For wrong input; nothing has been written.
    SolverError
        If there is no equilibrium, none is found, or nothing can vibrate. The load steps computed so far stay in
        ``out``, marked "failed".
    """
    scene = scene if isinstance(scene, Scene) else Scene.load(scene)
    number = checked("number", number, integer(at_least=1, at_most=MAX_MODES))
    if out is not None:
        check_folder(out, force)
    clock = Clock()
    system = scene.build()
    if any(thread.friction and not any(thread.friction) for thread in system.net.threads):
        system = _without_slips(scene).build()
    with in_file(scene.file):
        rest = _at_rest(system)
    if announce is not None:
        announce(scene, system)
    result = Modes(scene, web=web_of(system), versions=versions(), columns=COLUMNS)
    try:
        with recorded(result, clock, lambda: f"{len(result.spectra)} load steps"), followed(progress) as tell:
            _follow(result, rest, number, tell)
    finally:
        rows = [row for computed in result.spectra for row in _rows(computed, system.net.nodes)]
        result.table = as_history(COLUMNS, rows)
        result.findings += left_out(system)
        if out is not None:
            result.save(out, force)
    return result


def _without_slips(scene):
    """The scene with one tension in threads whose friction is 0, a force with a potential, and what modes look at.

    It is the scene itself where there are none.
    """
    free = [
        type(effect).__name__ == "Thread" and effect.friction is not None and not np.any(effect.friction)
        for effect in scene.effects
    ]
    if not any(free):
        return scene
    pairs = zip(scene.effects, free, strict=True)
    effects = tuple(replace(effect, friction=None) if slips else effect for effect, slips in pairs)
    return scene.replace(effects=effects, observe=(), event=(), control=())


def _at_rest(system):
    """The system that vibrates; refuse links, forces without a potential, and webs without free nodes."""
    rest = at_rest(system)
    if system.net.forming.any():
        raise InputError("[cable] law: lines of form finding do not vibrate: take the scene that refweb.form makes")
    if rest.constraints:
        raise InputError("[[link]]: modes cannot hold lengths exactly: make it a stiff line")
    for term in rest.terms:
        if term.tangent.stiffness is not None and not rest.is_symmetric(term):
            if term.name in ("thread", "winch"):
                raise InputError("modes take no friction of [[thread]] above 0, and no [[winch]]: leave them out")
            raise InputError(f"{term.name} has no potential, so there are no natural modes: leave it out")
    if not len(rest.free):
        raise InputError("no node is free, so there are no modes: support fewer of them")
    return rest


def _follow(result, rest, number, tell):
    """Compute the equilibrium and the modes of each load step."""
    scene, remarks, totals = result.scene, Remarks(), dict(nsteps=0, nfev=0, njev=0, nlu=0)
    static = scene.solve.kind == "static"
    method, steps = (scene.solve.method, scene.solve.load_steps) if static else ("newton", (0.0,))
    solve = load(STATICS[method])
    for equilibrium in solve(rest, steps, lambda text: tell(text, len(result.spectra) / len(steps))):
        if equilibrium.contact_shares is not None:
            from ..statics.contact_kinks import no_modes

            raise no_modes(rest, equilibrium)
        tell(f"step {equilibrium.step:g}, modes", len(result.spectra) / len(steps))
        as_it_stands = rest.at(equilibrium.step, equilibrium.x)  # with the masses of that time
        computed = spectrum(as_it_stands, equilibrium.step, equilibrium.x, number, scene.seed)
        result.state = State(rest, equilibrium.step, equilibrium.x)
        if result.spectra:
            result.spectra[-1] = replace(result.spectra[-1], shapes=None)
        result.spectra.append(computed)
        stats = {key: equilibrium.stats.get(key) for key in SOLVER} | {
            "method": method,
            "factorization": rest.factorized_by,
            "duality_gap": equilibrium.duality_bound.gap if equilibrium.duality_bound else None,
            "smallest_pivot": -1 if computed.unstable else 0 if computed.zero else 1,
            "slack_nodes": len(open_rows(result.state, equilibrium)),
        }
        totals = {key: totals[key] + stats[key] for key in totals}
        result.solver = {**stats, **totals}
        step = {"step": computed.step, "results": _results(computed, rest.net.nodes), "solver": stats}
        result.steps.append({**step, "at": _nodes_or_bodies(computed, rest.net), **_described(computed)})
        remarks.record(computed.step, remarks_on(computed, result.state, equilibrium))
        result.findings = [*remarks.findings(), *rest.remarks()]


def _results(computed, nodes):
    """Frequencies of a spectrum by name; the position of each is that of the largest displacement of its shape.

    It is None where a body without nodes moves most, of a number of nodes.
    """
    values = zip(computed.frequency.tolist(), computed.error.tolist(), computed.nodes.tolist(), strict=True)
    return {
        f"frequency_{k}": Result(f, error, "Hz", computed.step, node if node < nodes else None)
        for k, (f, error, node) in enumerate(values, 1)
    }


def _nodes_or_bodies(computed, net):
    """The node that moves most in each mode, or the name of the body, a list."""
    names = {row: body.name for body in net.bodies for row in (body.row, body.base, body.spin)}
    return [names.get(row, row) for row in computed.nodes.tolist()]


def _described(computed):
    """Data of a spectrum for ``run.json`` besides its frequencies."""
    names = ("squared", "bound", "residual", "modal_mass", "shares", "moving")
    arrays = {name: getattr(computed, name).tolist() for name in names}
    return {"unstable": computed.unstable, "zero": computed.zero, **arrays}


def _rows(computed, nodes):
    """A spectrum as rows of ``modes.csv``, without numbers of nodes where a body moves most."""
    count = np.arange(1, len(computed.squared) + 1)
    columns = [np.full(len(count), computed.step), count, computed.frequency, computed.error, computed.squared]
    node = np.where(computed.nodes < nodes, computed.nodes, np.nan)
    return np.column_stack(
        [*columns, computed.residual, computed.modal_mass, computed.shares, computed.moving, node]
    ).tolist()
