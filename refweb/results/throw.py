"""Numbers of a throw: opening of the mouth of a net over time and distance, and its cover of a target at the end.

May change: private functions, `NO_TWIN` and other texts. Must stay: keys and docstring of `Throw` (scene format and
help; after a change write ``validation/REFERENCE.md`` anew); names of numbers in `UNITS`, `FLAGS` and `numbers`, which
stand in ``run.json`` and in conditions of studies. Tests: ``tests/results/test_throw.py``, against closed forms.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError
from ..messages import nearest, quote
from ..tables import Table, real, table, text

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..settings import Dynamic, Static
    from ..system.system import System
    from .observables.observe import Observe
    from .state import State

NO_TWIN = "there is no step refinement"
UNITS = {"largest_area": "m²", "deployment_time": "s", "travelled": "m", "effective_period": "s", "covered": "1"}
FLAGS = ("inside", "closed")
"""Names of statements that are true or false."""


@table
class Throw(Table):
    """Numbers of a throw, in ``run.json`` and `Solution.throw`, each with its ±.

    The definitions are refweb's own. Four numbers follow from the area of the mouth over the rows of the history, with
    a parabola through the three rows around the largest. ``largest_area`` is the largest area, and ``deployment_time``
    its time. ``travelled`` is the change of another observable until then. ``effective_period`` is the time around it
    in which the area is at least ``share`` of the largest. A number is a lower bound, and marked as such, if the
    largest area is at the end of the run, or if the period reaches the start or the end. The number less its ± is then
    the least possible value.

    Three results describe the capture of a ``target`` at the end of the run. ``inside`` is true if its centre is in the
    convex hull of the web's nodes. ``closed`` is true if the area of the mouth is at most ``closed`` of the largest.
    ``covered`` is the share of directions from the centre of the target that the net covers. Let Ω be the solid angle
    of the mouth, as a fan from the mean of its nodes. The share is 1 − Ω/4π if the centre is in the hull, on the same
    side of the mouth as the mean of all nodes. Else it is Ω/4π: the net is seen through its outline.

    ± contains the difference from the step-refinement run, and the difference from a history of half the rows. A
    ``margin`` with its ± decides ``inside`` and ``closed``. It is the depth of the centre in the hull [m], and the area
    at which the mouth counts as closed less the area at the end [m²]. The statement is true or false if the size of the
    margin exceeds its ±. Else it is undecided, and ``value`` is None; ``drawn`` is the statement for this run. ± of
    ``covered`` contains both shares if it is undecided where the centre is. There is no ± without a step-refinement
    run, after the time at which lines break in another order in it, and if an event ends only one of the two runs. Then
    ``reason`` says why, and statements are undecided. Studies have these numbers among their results, with 1 for true
    and 0 for false.

    Parameters
    ----------
    area : str
        Name of an observable of ``mouth_area``.
    travel : str, optional
        Name of an observable of a length, whose change is the distance travelled.
    share : float
        Share of the largest area from which on the net is effective, 0 < share < 1.
    target : str, optional
        Name of a body.
    closed : float
        Share of the largest area up to which the mouth is closed, 0 ≤ closed < 1.

    Raises
    ------
    InputError
        For numbers out of bounds; from `Scene.build`, in statics, for an observable or a body that the scene does not
        have, and an observable of another quantity or unit.

    Examples
    --------
        [throw]
        area = "mouth"
        travel = "height"
    """

    area: str = text()
    travel: str | None = text(default=None)
    share: float = real(default=0.8, above=0, at_most=1)
    target: str | None = text(default=None)
    closed: float = real(default=0.05, at_least=0, at_most=1)

    @property
    def numbers(self) -> list[str]:
        """Names of the numbers."""
        of_target = ["inside", "closed", "covered"] if self.target is not None else []
        travelled = ["travelled"] if self.travel is not None else []
        return ["largest_area", "deployment_time", *travelled, "effective_period", *of_target]

    def on(self, observables: Sequence[Observe], system: System, solve: Static | Dynamic) -> None:
        """Refuse observables and bodies that the scene does not have."""
        if solve.kind != "dynamic":
            raise InputError("a throw has no meaning in statics: leave it out")
        names = [o.name for o in observables]
        for key in ("area", "travel"):
            name = getattr(self, key)
            if name is not None and name not in names:
                raise InputError(f"{key} = {quote(name)} is not an observable, {nearest(name, names)}")
        for name in names:
            if name in self.numbers:
                raise InputError(f"[[observe]] name = {quote(name)} is a result of [throw]: names are unique")
        mouth = observables[names.index(self.area)]
        if mouth.quantity != "mouth_area" or mouth.component is not None or mouth.average is not None:
            raise InputError(
                f'area = {quote(self.area)} must be an observable of quantity = "mouth_area", without component and '
                "average"
            )
        if self.travel is not None and (unit := observables[names.index(self.travel)].unit) != "m":
            raise InputError(f"travel = {quote(self.travel)} must be an observable in m, not {unit}")
        bodies = [body.name for body in system.net.bodies]
        if self.target is not None and self.target not in bodies:
            hint = nearest(self.target, bodies) if bodies else "the scene has no [[body]]"
            raise InputError(f"target = {quote(self.target)} is not a body, {hint}")

    def results(
        self,
        observables: Sequence[Observe],
        rows: Any,
        state: State,
        twin: Any = None,
        factor: float = 0.0,
        known: float = np.inf,
    ) -> dict[str, dict[str, Any]]:
        """Results of a throw, a dict of dicts for ``run.json``.

        Parameters
        ----------
        observables : sequence of refweb.Observe
            Observables of the scene.
        rows : ndarray, shape (rows, columns)
            Times and observables, in their order.
        state : refweb.results.state.State
            State at the end.
        twin : (ndarray, refweb.results.state.State), optional
            Rows and state of the step-refinement run.
        factor : float
            ± over the difference from the step-refinement run.
        known : float
            Time after which the step-refinement run shows no error of the run [s].
        """
        names = [o.name for o in observables]
        values, half = self._of(rows, names), self._of(rows[_every_other(len(rows))], names)
        refined = None if twin is None else self._of(twin[0], names)
        mouth = observables[names.index(self.area)].node
        if self.target is not None:
            values |= self._capture(state, mouth, values["largest_area"])
            half |= {"closed": values["closed"] + self.closed * (half["largest_area"] - values["largest_area"])}
            if twin is not None and refined is not None:
                refined |= self._capture(twin[1], mouth, refined["largest_area"])
        settled, end, errors = values["settled"], rows[-1, 0], {}
        bounds = {*values["bounds"], *(refined["bounds"] if refined else ())}
        for name in (*self.numbers, *(["side"] if self.target is not None else [])):
            tells = refined is not None and settled.get(name, end) < known
            errors[name] = _error_of(name, values, half, refined, factor) if tells else None
        if errors.get("closed") is not None and twin is not None:
            column = 1 + names.index(self.area)
            errors["closed"] += float(factor * _mean_difference(rows[:, [0, column]], twin[0][:, [0, column]]))
        if errors.get("covered") is not None and not _decided(values, errors):
            errors["covered"] += abs(1.0 - 2.0 * values["covered"])
        why = {"reason": NO_TWIN}
        if refined is not None:
            why = {"reason": f"the step refinement tells nothing of it from t = {known:.6g} s on", "statistical": True}
        return {
            name: _entry(name, values[name], errors[name], bounds) | (why if errors[name] is None else {})
            for name in self.numbers
        }

    def _of(self, rows, names):
        """Values by name; ``bounds`` are the names of lower bounds, ``settled`` the times of final values [s]."""
        times, area = rows[:, 0], rows[:, 1 + names.index(self.area)]
        top = int(area.argmax())
        near = slice(top - 1, top + 2) if 0 < top < len(area) - 1 else slice(top, top + 1)
        when, largest = _vertex(times[near], area[near])
        bounds = ["largest_area", "deployment_time", "travelled"] if top == len(area) - 1 else []
        values = {"largest_area": largest, "deployment_time": when}
        if self.travel is not None:
            travel = rows[:, 1 + names.index(self.travel)]
            values["travelled"] = abs(_parabola(times[near], travel[near], when) - travel[0])
        level, ends = self.share * largest, []
        for step, edge in ((-1, 0), (1, len(area) - 1)):
            n = top
            while n != edge and area[n + step] >= level:
                n += step
            if n == edge:
                ends.append(times[edge])
                bounds += ["effective_period"]
            else:
                m = n + step
                ends.append(times[n] + (times[m] - times[n]) * (area[n] - level) / (area[n] - area[m]))
        settled = dict.fromkeys(values, times[near][-1]) | {"effective_period": ends[1]}
        return {**values, "effective_period": float(ends[1] - ends[0]), "bounds": bounds, "settled": settled}

    def _capture(self, state, mouth, largest):
        """Capture of the target by the net in a state."""
        net = state.system.net
        (centre,) = (state.position[body.row] for body in net.bodies if body.name == self.target)
        outline, nodes = state.position[net.web.find_around(mouth)], state.position[: len(net.web.points)]
        size = 0.5 * np.linalg.norm(np.cross(outline, np.roll(outline, -1, axis=0)).sum(axis=0))
        depth = depth_in_hull(nodes, centre)
        return {
            "inside": depth,
            "closed": float(self.closed * largest - size),
            "covered": covered(outline, nodes, centre, depth > 0.0),
            "side": side_of_mouth(outline, nodes, centre),
        }


def _mean_difference(rows, refined):
    """Root mean square of the difference of two columns (time, value) in the second half of the time.

    A difference at the end alone may be small by chance.
    """
    count = min(len(rows), len(refined))
    late = (rows[:count, 0] == refined[:count, 0]) & (rows[:count, 0] >= 0.5 * rows[count - 1, 0])
    return np.sqrt(np.mean((rows[:count, 1] - refined[:count, 1])[late] ** 2)) if late.any() else 0.0


def _every_other(count):
    """Numbers of every second row of a count, and of the last row."""
    return np.unique([*range(0, count, 2), count - 1])


def _error_of(name, values, half, refined, factor):
    """± of a number, or of the margin of a statement."""
    value = values[name]
    return float(factor * abs(value - refined[name]) + abs(value - half.get(name, value)) + 4e-16 * abs(value))


def _decided(values, errors):
    """Tell if ± decides on which side of the mouth the centre is, and if it is inside."""
    inside, side = (abs(values[name]) > errors[name] for name in ("inside", "side"))
    return inside and (side or values["inside"] < 0.0)


def _entry(name, value, error, bounds):
    """A number with its ±, or a statement, for ``run.json``."""
    if name in FLAGS:
        drawn = value > 0.0 or (name == "closed" and value == 0.0)
        decided = error is not None and abs(value) > error
        return {"value": drawn if decided else None, "drawn": drawn, "margin": value, "error": error}
    if name == "covered" and error is not None:
        error = min(error, max(value, 1.0 - value))
    return {"value": float(value), "error": error, "unit": UNITS[name]} | ({"at_least": True} if name in bounds else {})


def _parabola(times, values, when):
    """Value at a time of the parabola through three values, or the only value."""
    if len(times) == 1:
        return float(values[0])
    return float(np.polyval(np.polyfit(times - times[1], values, 2), when - times[1]))


def _vertex(times, values):
    """(Time, value) of the top of the parabola through three values, or of the only value."""
    if len(times) == 1:
        return float(times[0]), float(values[0])
    a, b, c = np.polyfit(times - times[1], values, 2)
    if not a < 0.0:
        return float(times[1]), float(values[1])
    return float(times[1] - 0.5 * b / a), float(c - 0.25 * b * b / a)


def depth_in_hull(points, point):
    """Depth of a position below the nearest face of the convex hull of points [m], negative outside.

    The hull of points in a plane has no inside: the depth is minus the distance from the plane.
    """
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(points)
    except QhullError:
        middle = points.mean(axis=0)
        *_, axes = np.linalg.svd(points - middle)
        return -float(abs(axes[-1] @ (point - middle)))
    return -float((hull.equations[:, :3] @ point + hull.equations[:, 3]).max())


def side_of_mouth(outline, nodes, centre):
    """Distance of a centre from the plane of a mouth [m], negative where the mean of all nodes is on the other side.

    Its size is at most the distance of that mean from the plane, which may leave the side undecided as well.
    """
    normal, middle = np.cross(outline, np.roll(outline, -1, axis=0)).sum(axis=0), outline.mean(axis=0)
    size = np.linalg.norm(normal)
    if size == 0.0:
        return 0.0
    of_centre, of_net = ((position - middle) @ normal / size for position in (centre, nodes.mean(axis=0)))
    return float(np.sign(of_centre * of_net) * min(abs(of_centre), abs(of_net)))


def solid_angle(outline, centre):
    """Size of the solid angle [sr] of a closed polygon seen from a place, as a fan from the mean of its corners.

    Source, for each triangle: A. van Oosterom, J. Strackee, "The solid angle of a plane triangle", IEEE Trans. Biomed.
    Eng. 30 (1983) 125–126.
    """
    a, b = outline - centre, np.roll(outline, -1, axis=0) - centre
    c = np.broadcast_to(outline.mean(axis=0) - centre, a.shape)
    la, lb, lc = (np.linalg.norm(vector, axis=1) for vector in (a, b, c))
    volume = (a * np.cross(b, c)).sum(axis=1)
    below = la * lb * lc + (a * b).sum(axis=1) * lc + (b * c).sum(axis=1) * la + (c * a).sum(axis=1) * lb
    return float(abs(2.0 * np.arctan2(volume, below).sum()))


def covered(outline, nodes, centre, inside):
    """Share of directions from a centre that a net covers, see `Throw`."""
    share = min(solid_angle(outline, centre) / (4.0 * np.pi), 1.0)  # the fan of a folded outline may count twice
    return 1.0 - share if inside and side_of_mouth(outline, nodes, centre) > 0.0 else share
