"""Numbers of a throw: how long and how far on the mouth of a net is open, and what it covers of a target at the end."""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from ..messages import nearest, quote
from ..tables import Table, real, table, text

UNITS = {"largest_area": "m²", "deployment_time": "s", "travelled": "m", "effective_period": "s", "covered": "1"}


@table
class Throw(Table):
    """Numbers that a throw is judged by, in ``run.json`` and `Solution.throw`, each with its ±.

    The definitions are refweb's own. Of the area of the mouth over time, as rows have it, with a parabola through the
    three rows around the largest: ``largest_area``; ``deployment_time``, when that is; ``travelled``, by how much
    another observable has changed until then; ``effective_period``, how long the area is at least ``share`` of the
    largest around that time. What is not over at the end of the run, or was so at its start, is a lower bound, and says
    so.

    Of a ``target`` at the end of the run: ``inside``, whether its centre is in the convex hull of the web's nodes;
    ``closed``, whether the area of the mouth is at most ``closed`` of the largest; ``covered``, the share of directions
    from its centre that the net covers. With Ω the solid angle of the mouth, as a fan from the mean of its nodes, that
    is 1 − Ω/4π where the centre lies on the side of the mouth that the mean of all nodes is on, and inside the hull,
    and else Ω/4π: the net seen through its outline.

    ± holds what differs in the twin run and what a history of half the rows would make of the same motion; where run
    and twin disagree on what is inside or closed it is not known, and ``drawn`` is what one run of many has. Behind the
    time at which lines break in another order in the twin, or an event ends only one of them, nothing is. Studies have
    these numbers among their results, 1 and 0 for what is so and what is not, see `refweb.sweeps.case.cells_of`.

    Parameters
    ----------
    area : str
        Name of an observable of ``mouth_area``.
    travel : str, optional
        Name of an observable of a length, whose change is the distance travelled.
    share : float
        Of the largest area, from which on the net is effective, 0 < share < 1.
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
    def numbers(self):
        """Names of what it finds."""
        of_target = ["inside", "closed", "covered"] if self.target is not None else []
        travelled = ["travelled"] if self.travel is not None else []
        return ["largest_area", "deployment_time", *travelled, "effective_period", *of_target]

    def on(self, observables, system, solve):
        """Refuse what the scene does not have."""
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

    def results(self, observables, rows, state, twin=None, factor=0.0, known=np.inf):
        """Results of a throw, a dict of dicts for ``run.json``.

        Parameters
        ----------
        observables : sequence of refweb.Observe
            Those of the scene.
        rows : ndarray, shape (rows, columns)
            Times and, in their order, observables.
        state : refweb.results.state.State
            At the end.
        twin : (ndarray, refweb.results.state.State), optional
            The same of the twin.
        factor : float
            ± over what differs in the twin.
        known : float
            Time from which on the twin tells nothing of the run [s].
        """
        names = [o.name for o in observables]
        values = self._of(rows, names)
        half, refined_values = self._of(rows[::2], names), None if twin is None else self._of(twin[0], names)
        mouth = observables[names.index(self.area)].node
        if self.target is not None:
            values |= self._capture(state, mouth, values["largest_area"])
            if twin is not None and refined_values is not None:
                refined_values |= self._capture(twin[1], mouth, refined_values["largest_area"])
        settled, end, record = values.pop("settled"), rows[-1, 0], {}
        for name, value in values.items():
            if name != "bounds":
                compared = refined_values if settled.get(name, end) < known else None
                record[name] = _entry(name, value, half, compared, factor, values, known)
        return record

    def _of(self, rows, names):
        """Values by name; ``bounds`` are names of those that are lower bounds, ``settled`` is when values are [s]."""
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
        inside = in_hull(nodes, centre)
        return {
            "inside": inside,
            "closed": bool(size <= self.closed * largest),
            "covered": covered(outline, nodes, centre, inside),
        }


def _entry(name, value, half, refined, factor, own_value, known):
    """A number with its ±, or whether something is so, for ``run.json``."""
    if isinstance(value, bool):
        same = known == np.inf if refined is None else refined[name] == value
        return {"value": value if same else None, "drawn": value}
    error = None
    if refined is not None:
        error = factor * abs(value - refined[name]) + abs(value - half.get(name, value)) + 4e-16 * abs(value)
    bound = {"at_least": True} if name in own_value["bounds"] else {}
    return {"value": float(value), "error": None if bound else error, "unit": UNITS[name], **bound}


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


def in_hull(points, point):
    """Tell if a position is in the convex hull of points; that of points in a plane has no inside."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(points)
    except QhullError:
        return False
    return bool((hull.equations[:, :3] @ point + hull.equations[:, 3] < 0.0).all())


def solid_angle(outline, centre):
    """Size of the solid angle [sr] of a closed polygon seen from a place, as a fan from the mean of its corners.

    Of each triangle after A. van Oosterom, J. Strackee, "The solid angle of a plane triangle", IEEE Trans. Biomed. Eng.
    30 (1983) 125–126.
    """
    a, b = outline - centre, np.roll(outline, -1, axis=0) - centre
    c = np.broadcast_to(outline.mean(axis=0) - centre, a.shape)
    la, lb, lc = (np.linalg.norm(vector, axis=1) for vector in (a, b, c))
    volume = (a * np.cross(b, c)).sum(axis=1)
    below = la * lb * lc + (a * b).sum(axis=1) * lc + (b * c).sum(axis=1) * la + (c * a).sum(axis=1) * lb
    return float(abs(2.0 * np.arctan2(volume, below).sum()))


def covered(outline, nodes, centre, inside):
    """Share of directions from a centre that a net covers, see `Throw`."""
    normal, middle = np.cross(outline, np.roll(outline, -1, axis=0)).sum(axis=0), outline.mean(axis=0)
    share = solid_angle(outline, centre) / (4.0 * np.pi)
    within = inside and ((centre - middle) @ normal) * ((nodes.mean(axis=0) - middle) @ normal) > 0.0
    return 1.0 - share if within else share
