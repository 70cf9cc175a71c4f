"""State of a net at an instant, and the quantities that follow from it.

May change: `STIFF`, `MUCH` and texts of findings. Must stay: names of properties, which observables (of users too),
frames and remarks read; keys of `margin_of`, which stand in ``run.json``; codes of findings, which stand in
`refweb.findings.CODES`; `curve_remark`, `strain_remark` and `strain_remarks_of_thread`, which `dynamics.simulation` and
`statics.remarks` import; `floor_remark`, which these and `studies.mode_remarks` import; public names of `State`, which
other files use. Tests: ``tests/results/test_results.py``, ``tests/results/test_observable_contract.py``.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..compiled.rows import records_of
from ..effects.base import FELT, STRAIN, TOUCH, ContactForce
from ..findings import Finding
from .columns import static_energies

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from ..net.net import Net
    from ..net.threads import ThreadLine
    from ..system.system import System

STIFF = 1e-12
"""Least stiffness of a row over its largest, in other directions, that counts as one."""


class State:
    """Displacement and velocity of a system at one time, and the quantities that follow from them.

    Parameters
    ----------
    system : refweb.system.system.System
        System of all effects.
    time : float
        Time [s]; in statics the load step.
    x : ndarray, shape (rows, 3)
        Displacement [m].
    v : ndarray, shape (rows, 3), optional
        Velocity [m/s], zero by default.
    """

    def __init__(
        self, system: System, time: float, x: NDArray[np.float64], v: NDArray[np.float64] | None = None
    ) -> None:
        self.system: System = system
        self.time: float = time
        self.x: NDArray[np.float64] = x
        self.v: NDArray[np.float64] = np.zeros_like(x) if v is None else v

    @cached_property
    def _forces(self):
        force, per_cell = self.system.forces(self.time, self.x, self.v)
        lines = [i for i, term in enumerate(self.system.terms) if term.contact.with_lines]
        contact = {i: records_of(TOUCH, per_cell[i])["value"] for i in lines}
        pressed = any(f.contact.felt for f in self.system.terms) or any(t.wraps for t in self.system.net.threads)
        felt: Any = self.system.contact_forces.of(per_cell) if pressed else None
        threads = {thread.name: per_cell[i][0] for i, thread in self.system.threads.items()}
        return force, per_cell.tension, contact, felt, threads, per_cell.lines[:, STRAIN]

    @property
    def threads(self) -> dict[str, NDArray[np.float64]]:
        """Tension [N], stress [Pa], strain [1] and length [m] of each thread by name.

        With friction the first three are those of the segment with the largest tension, and the tension of each segment
        and the slip over each ring [m] follow.
        """
        return self._forces[4]

    def overlap(self, body: Any) -> NDArray[np.float64]:
        """Depth of the deepest contact of each element with a body [m], 0 without contact, shape (cells,)."""
        term, cells = self.system.contact_forces.lines_on(body)
        return self._forces[2][term][cells]

    @property
    def pair_overlaps(self) -> NDArray[np.float64]:
        """Depth of the bodies of each pair in each other [m], 0 without contact, shape (pairs,)."""
        return records_of(FELT, self._forces[3])["depth"][self.system.rows - self.system.net.nodes :]

    def _by_line(self, values):
        """Largest value over the elements of each line."""
        net = self.system.net
        largest = np.full(len(net.web.lines), -np.inf)
        np.maximum.at(largest, net.line, values)
        return largest

    @cached_property
    def position(self) -> NDArray[np.float64]:
        """Positions [m], shape (rows, 3)."""
        return self.system.net.points + self.x

    @cached_property
    def element_tension(self) -> NDArray[np.float64]:
        """Tension of each element [N], shape (cells,)."""
        return self._forces[1]

    @cached_property
    def tension(self) -> NDArray[np.float64]:
        """Tension [N], shape (lines,)."""
        return self._by_line(self.element_tension)

    @cached_property
    def stress(self) -> NDArray[np.float64]:
        """Nominal stress T/A [Pa], shape (lines,)."""
        return self._by_line(self.element_tension / self.system.net.area)

    @cached_property
    def element_strain(self) -> NDArray[np.float64]:
        """Strain of each element, the largest over its quadrature points [1], shape (cells,)."""
        if self.system.net.wound:
            return self._forces[5]
        from ..effects.elasticity import strains

        strain = strains(self.system.at(self.time).net, self.x).max(axis=1)
        strain[self.system.net.broken] = 0.0
        return strain

    @cached_property
    def element_slack(self) -> NDArray[np.bool_]:
        """True for each element that is slack all along, as `slack`, shape (cells,); none of form finding is."""
        slack_below = self.system.net.slackness if self.plastic_strain is None else self.plastic_strain
        return (self.element_strain <= slack_below) & ~self.system.net.forming

    @cached_property
    def plastic_strain(self) -> NDArray[np.float64] | None:
        """Plastic strain of each element, the largest over its quadrature points [1], None where no line yields."""
        if not self.system.net.law_is("plastic").any():
            return None
        from ..effects.plastic import plastic_strain

        return plastic_strain(self.system.at(self.time).net, self.x).max(axis=1)

    @cached_property
    def strain(self) -> NDArray[np.float64]:
        """Engineering strain [1], shape (lines,)."""
        return self._by_line(self.element_strain)

    @cached_property
    def slack(self) -> NDArray[np.bool_]:
        """True for each line whose strain is ≤ ε0 (laws without slackness: ≤ 0), shape (lines,)."""
        return np.bincount(self.system.net.line, ~self.element_slack) == 0.0

    @cached_property
    def slack_nodes(self) -> NDArray[np.int64]:
        """Free nodes whose position is not unique: no taut line, taut thread, bar or other stiffness holds them."""
        net = self.system.net
        fixed = np.all(self.system.supported, axis=1)
        fixed[net.web.bare] = True  # by a link
        fixed[net.cells[net.law_is("bar") | ~self.element_slack].ravel()] = True
        for thread in net.threads:
            fixed[thread.segments[thread.tensions(self.threads[thread.name]) > 0.0].ravel()] = True
        open_ = np.flatnonzero(~fixed[: net.nodes])
        return open_[~self._stiff(fixed)[open_]] if len(open_) else open_

    def _stiff(self, fixed):
        """True for rows that effects hold, by a positive stiffness against all that is fixed, shape (rows,)."""
        system = self.system
        sums = np.zeros((system.rows, 3, 3))
        for term in system.terms:
            of_lines = term.over_lines or term.elements.observed
            if of_lines or term.contact != ContactForce() or not term.tangent.stiffness:
                continue
            count, arity = term.cells.shape
            blocks = np.zeros((count, 3 * arity, 3 * arity))
            numbers = system.data_of(term, self.time)
            term.tangent.stiffness(self.time, self.x, self.v, blocks, term.cells, numbers, False)
            for k in range(arity):
                others = fixed[np.delete(term.cells, k, axis=1)].all(axis=1)
                part = slice(3 * k, 3 * k + 3)
                np.add.at(sums, term.cells[others, k], blocks[others, part, part])
        sums += system.supported[:, :, None] * np.eye(3) * np.abs(sums).max(axis=(1, 2), initial=0.0)[:, None, None]
        smallest, _, largest = np.linalg.eigvalsh(0.5 * (sums + sums.transpose(0, 2, 1))).T
        return smallest > STIFF * largest

    @cached_property
    def reaction(self) -> NDArray[np.float64]:
        """Force of the supports on nodes, and of contact on bodies [N], shape (rows, 3)."""
        force = np.where(self.system.supported, -self.system.balance(self.time, self.x, self.v)[0], 0.0)
        felt = self._forces[3]
        for body in self.system.net.bodies:
            force[body.row] = 0.0 if felt is None else self.system.contact_forces.force_on(body, felt)
        return force

    @cached_property
    def utilisation(self) -> NDArray[np.float64] | None:
        """Stress over strength, shape (lines,); None if no line has a strength."""
        net = self.system.net
        if not np.isfinite(net.strength).any():
            return None
        return self._by_line(self.element_tension / (net.area * net.strength))

    @cached_property
    def margin(self) -> dict[str, Any] | None:
        """Smallest margin of safety, see `margin_of`; None if no line has a strength."""
        net = self.system.net
        if not np.isfinite(net.strength).any():
            return None
        used = self.element_tension / (net.area * net.allowed)
        return margin_of(net, int(used.argmax()), float(used.max()), self.time)

    @cached_property
    def energies(self) -> dict[str, float]:
        """Energies of the effects by column of the energy balance, and their total [J].

        Work is that of dead loads. It is left out if other loads act, since their work depends on the path.
        """
        book = {}
        for term in (f for f in self.system.terms if f.energy is not None):
            energy = float(self.system.energy_of(term, self.time, self.x).sum())
            book[term.balance.column] = book.get(term.balance.column, 0.0) + energy
        work = -book.pop("work", 0.0)
        stored = sum(energy for name, energy in book.items() if name != "dissipated_energy")
        book |= {"total_energy": stored, "work": work}
        return {name: book[name] for name in static_energies(self.system)}


def margin_of(net: Net, element: int, used: float, time: float) -> dict[str, Any]:
    """The margin of safety at an element, as in ``run.json``.

    Parameters
    ----------
    net : refweb.net.net.Net
        The net.
    element : int
        Number of the element.
    used : float
        Its largest stress over the allowed stress, strength × knot_factor / safety_factor [1].
    time : float
        Time of the largest stress [s], in statics the load step.

    Returns
    -------
    dict
        ``value`` is the allowed stress over the largest stress, less 1. ``allowed`` is the allowed stress [Pa], and
        ``used`` the largest stress over it [1]. ``line`` is the line; ``stress`` [Pa], ``area`` [m²] and ``strength``
        [Pa] are its largest stress, area and strength. ``time`` is the time. ``error`` is ± of ``used``, None if it is
        not known. ``value``, ``allowed`` and ``strength`` are None where they are infinite.
    """
    allowed, strength = float(net.allowed[element]), float(net.strength[element])
    return {
        "value": 1.0 / used - 1.0 if used > 0.0 else None,
        "used": used,
        "line": int(net.line[element]),
        "stress": used * allowed if used else 0.0,
        "allowed": allowed if np.isfinite(allowed) else None,
        "strength": strength if np.isfinite(strength) else None,
        "area": float(net.area[element]),
        "time": float(time),
        "error": None,
    }


MUCH = 0.2
"""Strain above which a finding warns: real cables break below it, and a linear law does not describe them."""


def strain_remark(net: Net, strain: tuple[float, int], name: str = "") -> Iterator[Finding]:
    """Find a largest strain, (value, line), above `MUCH`, of a line that does not yield.

    ``name`` is that of the line in messages, by default its number.
    """
    if strain[0] > MUCH and not net.law_is("plastic")[net.line == strain[1]].any():
        yield Finding(
            "large-strain",
            f"{name or f'line {strain[1]}'} is strained by {100.0 * strain[0]:.3g} %, above {100.0 * MUCH:g} %: no "
            "cable stretches that far, and its law does not describe it; lower what acts on it, or raise modulus or "
            "area",
            "thread" if name else "cable",
        )


def curve_remark(net: Net, share: float, element: int, name: str = "") -> Iterator[Finding]:
    """Find a strain beyond the last point of the curve of an element, by the largest ``share`` of that strain.

    ``name`` is that of the line in messages, by default its number.
    """
    if share > 1.0:
        last, line = net.line_data.last_strain[element], name or f"line {net.line[element]}"
        yield Finding(
            "beyond-curve",
            f"{line} is strained by {100.0 * share * last:.4g} %, beyond the last point of its curve at "
            f"{100.0 * last:.4g} %, where its last slope goes on: give the curve more points, or lower what acts",
            "thread" if name else "cable",
        )


def strain_remarks_of_thread(thread: ThreadLine, strain: float) -> Iterator[Finding]:
    """Find a largest strain of a thread above `MUCH`, or beyond the last point of its curve."""
    yield from strain_remark(thread.line, (strain, 0), thread.title)
    if (scale := thread.line.curve_scale) is not None:
        yield from curve_remark(thread.line, strain * float(scale[0]), 0, thread.title)


def floor_remark(net: Net, stress: float) -> Iterator[Finding]:
    """Find a floor of the smooth law above 1 % of the largest stress [Pa]."""
    for number in (number for number, law in enumerate(net.laws) if law.smoothed):
        smooth = net.law_index == number
        floor = float((net.laws[number].floor(net.line_data[smooth]) / net.area[smooth]).max())
        if floor > 0.01 * stress:
            yield Finding(
                "law-floor",
                f"floor of the smooth law {floor:.4g} Pa is above 1 % of the largest stress {stress:.4g} Pa: "
                'slack lines push; lower smoothing or use law = "tension-only"',
                "cable",
            )
