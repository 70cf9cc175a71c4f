"""Observables of the energy balance: energies, work and step size, sums that need no probe.

May change: only docstrings, which are help: then write ``validation/REFERENCE.md`` anew. Must stay: names of energies,
which are columns of `results.columns` and of `Balance` of effects; `weights` and `lost_by_path`, which
`dynamics.history`, `dynamics.responses` and `statics.remarks` call; class names in `registry.OBSERVABLES`; `Booked`,
which `dynamics.responses` and `statics.responses` import. Tests: ``tests/results/test_observable_contract.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...effects.base import refuse_flows
from ...errors import InputError
from .observable import ANY, NOT_NEGATIVE, Observable, Value

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...statics.equilibrium import Equilibrium
    from ...system.system import System
    from ..state import State


BY_PLACE = ("potential_energy", "frame_energy", "orbit_energy")
"""Energies that follow from masses and places. Columns of a history have those of the masses at t = 0 where masses
follow: what is added has its weight in ``work``."""


def weights(system: System, column: str) -> NDArray[np.float64]:
    """Weights of (energy of each term, kinetic energy, work, step size) in a column."""
    total, books = column == "total_energy", [f.balance.column for f in system.terms]
    stored = [book not in ("work", "dissipated_energy") for book in books]
    weights_found = [
        (total and term_weight) or (book != "work" and book == column)
        for term_weight, book in zip(stored, books, strict=True)
    ]
    weights_found += [total or column == "kinetic_energy", column == "work", column == "step_size"]
    return np.array(weights_found, dtype=float)


def lost_by_path(state: State) -> bool:
    """Tell if lines have yielded beside natural lengths that change, so that load steps count for what they lose."""
    return bool(state.system.net.factors and state.plastic_strain is not None and state.plastic_strain.any())


class Booked(Observable):
    """A column of the energy balance, with the name of the quantity.

    Attributes
    ----------
    needs : str
        Table of the effect that writes to the column; empty if there is always one.
    signed : bool
        True if the value may be negative.
    """

    unit = "J"
    booked = True
    needs = ""
    signed = True

    def bounds(self, system: System | None) -> tuple[float, float]:
        """Bounds of the value: strain, contact, bending, kinetic and lost energies are not negative."""
        return ANY if self.signed else NOT_NEGATIVE

    def on(self, system: System) -> None:
        """Refuse a column that no effect writes to, and energies by place with masses that follow."""
        if self.needs and self.observe.quantity not in [f.balance.column for f in system.terms]:
            raise InputError(f'quantity = "{self.observe.quantity}" needs {self.needs} in the scene')
        if self.observe.quantity in BY_PLACE:
            refuse_flows(system.net, f'quantity = "{self.observe.quantity}"')

    def of(self, state: State) -> Value:
        """Value from the energies of the state, without kinetic energy."""
        return Value(state.energies[self.observe.quantity], None)

    def weights(self, system: System) -> NDArray[np.float64]:
        """Weights of (energy of each term, kinetic energy, work, step size)."""
        return weights(system, self.observe.quantity)


def _column(text: str, needs: str = "", signed: bool = True, dynamic: bool = False) -> type[Booked]:
    """Make the class of a column, with its docstring ``text`` and its attributes."""
    return type("Column", (Booked,), {"__doc__": text, "needs": needs, "signed": signed, "dynamic": dynamic})


KineticEnergy = _column("Kinetic energy of all rows.", signed=False, dynamic=True)
PotentialEnergy = _column("Potential energy of gravity.", "[gravity]")
ContactEnergy = _column("Energy of contact of lines with bodies.", "[contact]", signed=False)
BodyContactEnergy = _column("Energy of contact between bodies.", "[contact] with between_bodies = true", signed=False)
SelfContactEnergy = _column("Energy of contact of lines with lines.", "[self_contact]", signed=False)
BendingEnergy = _column("Energy of bent lines.", "[bending]", signed=False)
FrameEnergy = _column("Potential energy in a rotating frame.", "[frame]")
OrbitEnergy = _column("Potential energy by position in an orbit.", "[orbit]")
RuptureEnergy = _column("Energy that was stored in lines when they broke.", "[rupture]", signed=False, dynamic=True)
WinchEnergy = _column("Energy that winches have taken from the web: the negative of their work.", "[[winch]]")


class StrainEnergy(Booked):
    """Strain energy of the lines and threads."""

    signed = False

    def error(self, state: State, equilibrium: Equilibrium) -> float | None:
        """The proven bound of duality, if there is one."""
        if equilibrium.duality_bound is None:
            return super().error(state, equilibrium)
        return equilibrium.duality_bound.strain_energy


class PlasticEnergy(StrainEnergy):
    """Energy lost in lines that have yielded: a proven error is that of what they have taken up, kept or lost.

    Where natural lengths change beside it, it depends on the load steps, and ± is not known.
    """

    needs = 'law = "elastic-plastic"'

    def error(self, state: State, equilibrium: Equilibrium) -> float | None:
        """± as of the strain energy; None where it depends on the load steps."""
        return None if lost_by_path(state) else super().error(state, equilibrium)


class DissipatedEnergy(Booked):
    """Energy lost by damping and friction."""

    signed = False
    dynamic = True
    needs = (
        "[damping], [cable.viscous], [drag] in a fluid at rest, [[thread]] friction, or damping or friction in "
        "[contact] or [self_contact],"
    )


class TotalEnergy(Booked):
    """Sum of stored energies and of what winches and lines that yield or break have taken, with the kinetic energy."""

    def on(self, system: System) -> None:
        """Refuse energies by place in it with masses that follow."""
        super().on(system)
        if any(f.balance.column in BY_PLACE for f in system.terms):
            refuse_flows(system.net, f'quantity = "{self.observe.quantity}"')

    def error(self, state: State, equilibrium: Equilibrium) -> float | None:
        """The estimate; None where it depends on the load steps."""
        return None if lost_by_path(state) else super().error(state, equilibrium)


class Work(Booked):
    """Work of loads, motions, reels and other devices."""

    needs = "[[load]], [[motion]] or another effect that does work"

    def on(self, system: System) -> None:
        """Refuse a scene without such effects, and in statics work that depends on the path."""
        moved = system.works
        if not moved:
            super().on(system)
        loads = [f for f in system.terms if f.balance.column == "work"]
        if system.net.quasi_static and (moved or any(f.energy is None for f in loads)):
            tables = "[[motion]], [[pressure]], [[thrust]], [[reel]], [temperature] and mass that follows"
            raise InputError(f'quantity = "work" is not known in statics with {tables}: it depends on the path')


class StepSize(Booked):
    """Size of the last step before an instant."""

    signed = False
    unit = "s"
    dynamic = True
