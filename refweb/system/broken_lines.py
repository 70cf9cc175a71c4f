"""Systems with broken elements: how a system loses elements, and the record of the breaks.

May change: private functions. Must stay: names and order of the fields of `Breaks`, which `integrators.rupture` writes
to checkpoints as ``broken_…``; EA = 0 marks a broken element, see `Net.broken`; the loss of energy in `tear`, which
closes the energy balance. `torn` drops cached properties of `System` by name: a new one that depends on broken lines
belongs in its list. Must stay as well: `with_broken_lines`, which `build` imports. Tests:
``tests/effects/test_rupture.py``.
"""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Breaks(NamedTuple):
    """Broken lines, in the order in which they broke.

    Attributes
    ----------
    elements : ndarray of int
        Elements.
    times : ndarray
        When each broke [s].
    energies : ndarray
        Energy that each had stored, with the energy of forces that ended with it [J].
    places : ndarray, shape (breaks, 3)
        Where its middle was [m].
    widths : ndarray
        How much earlier each may have broken [s].
    """

    elements: np.ndarray = np.zeros(0, dtype=np.int64)
    times: np.ndarray = np.zeros(0)
    energies: np.ndarray = np.zeros(0)
    places: np.ndarray = np.zeros((0, 3))
    widths: np.ndarray = np.zeros(0)

    def and_then(self, *more: NDArray[Any]) -> Breaks:
        """These breaks and more, given as the fields are."""
        return Breaks(*(np.concatenate([before, after]) for before, after in zip(self, more, strict=True)))


def torn(system, elements, energies):
    """The system with some elements broken, whose stored energies [J] are given.

    Parameters
    ----------
    system : refweb.system.system.System
        The system; it is not changed.
    elements : ndarray of int
        Elements.
    energies : ndarray
        Rupture energy of each [J].

    Raises
    ------
    InputError
        For a consistent mass.
    """
    system = _breakable(system)
    net = system.net
    numbers = net.line_data.copy()
    numbers.ea[elements] = 0.0
    numbers.rupture_energy[elements] = energies
    changed = copy.copy(system)
    changed.net = replace(net, line_data=numbers)
    broken = np.zeros(len(net.cells), dtype=bool)
    broken[elements] = True
    changed.terms = [_severed(term, broken) for term in system.terms]
    for kept in ("unsupported_parts", "carriers"):
        changed.__dict__.pop(kept, None)
    changed.arrange()
    return changed


def _breakable(system):
    """The system, with the column, term and `BreakLimits` of broken elements if it has none."""
    if system.weakness is not None:
        return system
    from ..effects.base import BreakLimits
    from ..effects.broken import HELD, held_energy

    changed = copy.copy(system)
    changed.net = net = system.net.with_column(HELD, 0.0)
    changed.terms = [*system.terms]
    changed.terms.append(held_energy(net))
    changed.weakness = BreakLimits(np.full(len(net.cells), np.inf))
    return changed


def with_broken_lines(system):
    """The system with the broken lines of its web, each broken at its middle."""
    elements = system.net.middle_of(system.net.web.broken)
    return torn(system, elements, np.zeros(len(elements)))


def _severed(term, broken):
    """The term without force in cells of broken elements."""
    if term.elements.numbers is None or term.elements.disable is None:
        return term
    left = replace(term, data=_without(term, term.data, broken[term.elements.numbers]))
    crossing = term.contact.crossing
    if crossing is None:
        return left
    crossing = crossing._replace(data=_without(term, crossing.data, broken[crossing.elements]))
    return replace(left, contact=term.contact._replace(crossing=crossing))


def _without(term, data, ends):
    """Numbers of cells, without force in the cells one of whose elements ``ends``."""
    ends = ends if ends.ndim == 1 else ends.any(axis=1)
    if not ends.any():
        return data
    data, end_data = data.copy(), data[ends]
    term.elements.disable(end_data)
    data[ends] = end_data
    return data


def tear(system, t, x, v, elements):
    """The system with more elements broken, and the energy of each [J], at displacement x, velocity v and time t.

    The lost energy is the energy of the system minus that of the torn system. Elements that break together share it in
    proportion to their stored energies.
    """
    energy = sum(system.energy_of(f, t, x)[elements] for f in system.terms if f.over_lines and f.energy is not None)
    stored = [f for f in system.terms if f.balance.column not in ("work", "dissipated_energy")]
    before = sum(system.energy_of(term, t, x).sum() for term in stored)
    changed = torn(system, elements, np.zeros(len(elements)))
    left = [f for f in changed.terms if f.balance.column not in ("work", "dissipated_energy")]
    lost = before - sum(changed.energy_of(term, t, x).sum() for term in left)
    share = (
        np.abs(energy) / np.abs(energy).sum()
        if np.abs(energy).sum() > 0.0
        else np.full(len(elements), 1.0 / len(elements))
    )
    return torn(system, elements, lost * share), lost * share
