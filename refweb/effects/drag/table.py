"""Drag of a fluid, at rest or in steady wind, on lines and on free bodies.

The force is in `refweb.effects.drag.force`, and its solver for explicit steps in `refweb.effects.drag.implicit_drag`.

May change: private functions, messages, and the coefficient of spheres `SPHERE`, which moves results. Must stay: the
name "drag", by which `integrators.tangent` tells the term from contacts that rub; keys and docstring of `Drag` (scene
format and help; after a change write ``validation/REFERENCE.md`` anew); cells of a node one after another, which
`implicit_drag` takes as one group; the order of numbers of a cell, read by `force.end_of`, of which `without` sets the
first two to 0; public names of `Drag`, which other files use. Tests: ``tests/effects/test_drag.py``,
``tests/test_contract.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ...compiled.rows import matrix_of
from ...errors import InputError
from ...messages import nearest
from ...tables import Several, Table, by_group, real, table, vector
from ..base import Balance, CellElements, ForceTerm, Tangent, Timing, VelocityForce, without
from .force import end_of, kernels
from .implicit_drag import implicit_drag

if TYPE_CHECKING:
    from ...net.net import Net

SPHERE = 0.47
"""Coefficient of a sphere, at Reynolds numbers from 10³ to 3·10⁵."""


@table
class BodyDrag(Table):
    """Drag of one body, ½ ρ C A |u|², for all directions of motion.

    Parameters
    ----------
    coefficient : float, optional
        C; for a sphere 0.47 by default.
    area : float, optional
        A [m²]; for a sphere that of its circle by default.

    Examples
    --------
        [drag.bodies.hub]
        coefficient = 1.1
        area = 0.04
    """

    coefficient: float | None = real(default=None, at_least=0)
    area: float | None = real(default=None, above=0, unit="m²")


@table
class Drag(Table):
    """Drag of a fluid, quadratic in the velocity relative to it; it does not shorten explicit steps.

    Let a line of diameter D have the relative velocity u_n across its axis and u_t along it. Its drag per natural
    length is ½ ρ C_n D |u_n| u_n + ½ ρ π C_t D |u_t| u_t; half of that of an element acts on the node at each end.
    Reels change natural lengths, but not the drag. The drag of a free body is ½ ρ C A |u| u, without a moment. Bodies
    and lines do not shelter each other from wind.

    If the start is so fast that drag takes much of the energy in one step, the run is repeated with shorter steps,
    until the energy balance closes.

    In a fluid at rest the losses by drag are ``dissipated_energy``. In wind the power of drag counts as ``work``, which
    may have either sign.

    Parameters
    ----------
    density : float
        ρ of the fluid [kg/m³].
    normal : float
        C_n of a line across its axis.
    tangential : float
        C_t of a line along its axis, for the whole surface.
    diameter : float, optional
        D [m]; by default that of a round line of its area.
    wind : sequence of 3 float
        Velocity of the fluid [m/s].
    bodies : dict of str to BodyDrag
        Coefficient and area of bodies; free bodies that are no spheres need them.

    Raises
    ------
    InputError
        For numbers out of bounds. From ``on``, for a name in ``bodies`` that no free body has, and for a free body that
        is no sphere without coefficient or area.

    References
    ----------
    S. F. Hoerner, "Fluid-Dynamic Drag", 1965, chapter 3: cylinders across a flow, 1.2, and spheres. M. Hall, A.
    Goupee, "Validation of a lumped-mass mooring line model with DeepCwind semisubmersible model test data", Ocean Eng.
    104 (2015) 590–603, doi:10.1016/j.oceaneng.2015.05.035: drag at nodes, with both parts.

    Examples
    --------
        [drag]
        density = 1.2
        wind = [3.0, 0.0, 0.0]
    """

    density: float = real(above=0, unit="kg/m³")
    normal: float = real(default=1.2, at_least=0)
    tangential: float = real(default=0.01, at_least=0)
    diameter: float | None = real(default=None, above=0, unit="m")
    wind: Several = vector(default=(0.0, 0.0, 0.0), unit="m/s")
    bodies: dict[str, Any] = by_group(BodyDrag, "drag", members="bodies", default_factory=dict)

    def on(self, net: Net) -> list[ForceTerm]:
        """The terms of the nodes of elements and of free bodies; ``out`` is the power [W]."""
        free = [body for body in net.bodies if not body.prescribed]
        names = [body.name for body in free]
        for name in self.bodies:
            if name not in names:
                raise InputError(f'bodies."{name}" is not a free body, {nearest(name, names)}')
        terms = [self._term(net, *self._ends(net))]
        if free:
            ends = np.zeros(len(free), end_of(1))
            ends["normal"], ends["wind"] = [self._of(body) for body in free], self.wind
            ends["group"] = ends["length"] = 1.0
            terms.append(self._term(net, np.array([[body.row] for body in free], dtype=np.int32), ends))
        return terms

    def _ends(self, net):
        """Cells and numbers of all nodes of elements, those of a node together, and the element of each."""
        count, elements = len(net.places), len(net.cells)
        power = np.arange(count)
        functions = np.linalg.inv(np.vander(net.places, increasing=True))  # by power, then node
        shares = functions.T @ (1.0 / (power + 1.0))
        diameter = np.sqrt(4.0 * net.area / math.pi) if self.diameter is None else np.full(elements, self.diameter)
        pressed = 0.5 * self.density * diameter * net.natural_length
        cells, ends = [], np.zeros((count, elements), end_of(count))
        ends["wind"], ends["along"], ends["length"] = self.wind, net.line_data.reference, net.natural_length
        for a, position in enumerate(net.places):
            order = [a, *(b for b in range(count) if b != a)]
            slopes = (power[1:] * position ** (power[1:] - 1)) @ functions[1:]
            both = np.outer(shares[a] * pressed, [self.normal, math.pi * self.tangential])
            ends[a]["normal"], ends[a]["tangential"] = both.T
            ends[a]["slopes"] = slopes[order]
            cells.append(net.cells[:, order])
        cells = np.vstack(cells)
        order = np.argsort(cells[:, 0], kind="stable")
        cells, ends = cells[order], ends.ravel()[order]
        _, first, group = np.unique(cells[:, 0], return_index=True, return_counts=True)
        ends["group"][first] = group
        return np.ascontiguousarray(cells, dtype=np.int32), ends, order % elements

    def _of(self, body):
        """½ ρ C A of a body [kg/m]."""
        settings, sphere = self.bodies.get(body.name, BodyDrag()), body.shape.once
        for key in () if sphere else ("coefficient", "area"):
            if getattr(settings, key) is None:
                raise InputError(f'bodies."{body.name}".{key} is missing: only of spheres it is known')
        coefficient = SPHERE if settings.coefficient is None else settings.coefficient
        return 0.5 * self.density * coefficient * (settings.area or math.pi * body.shape.grown().radius ** 2)

    def _term(self, net, cells, ends, elements=None):
        blows = any(self.wind)
        force, stiffness, damping, bound = kernels(cells.shape[1])
        return ForceTerm(
            name="drag",
            cells=cells,
            data=matrix_of(ends),
            force=force,
            balance=Balance("work" if blows else "dissipated_energy", power=0),
            tangent=Tangent(*((stiffness, bound) if cells.shape[1] > 1 else (None, None)), symmetric=False),
            velocity=VelocityForce(damping, implicit=implicit_drag(cells.shape[1])),
            timing=Timing(at_rest=blows),
            elements=CellElements(elements, without(slice(2))),
        )
