"""Adjoint of an equilibrium: derivatives of a result by all numbers of its lines, loads and supports, by one solution.

At an equilibrium f(x, p) = 0 of the unknowns. With K = −∂f/∂x and the multipliers λ of Kᵀ λ = ∂J/∂x, a result J(x, p)
has the derivative

    dJ/dp = ∂J/∂p + λ·∂f/∂p.

λ has the form of a displacement, and λ·f is the virtual work of the forces. That of an element is −Σ w T t·λ' with λ' =
dλ/dξ, so that its derivatives are those of the tension: by EA, T/EA; by natural length, −(1 + ε) T'/L. Of masses they
are the accelerations of gravity and of rotating axes, of loads λ itself, and of positions of supports −Kᵀ λ there.

May change: private functions and the two constants of corrections. Must stay: public names of `Adjoint`, which
`gradients`, `responses` and `studies.frequency_gradients` use, and `multipliers` also `dynamics.parameters`; `MASSES`,
which `studies.frequency_gradients` imports; fields of `Sensitivity` and properties of `LineState`, which `gradients`,
`responses` and `studies.frequency_gradients` read; signs of λ and ∂J/∂p as above. A term that depends on numbers of
lines in a way that is not here must not be in `gradients.KNOWN`, or its gradients are wrong. Tests:
``tests/statics/test_gradients.py``.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ..effects.elasticity import strains
from ..errors import InputError
from ..net.elements import line_element, lumped_shares
from ..net.laws.law import evaluate
from ..results.state import State
from ..system.effect_parts import parts_of
from .equilibrium import Equilibrium
from .newton import Newton

ROUNDS, SOLVED = 4, 1e-9
"""Corrections of multipliers by the residual; residual over the right-hand side above which they are refused."""
MASSES = ("gravity", "frame", "orbit")
"""Terms whose forces are in proportion to mass."""


class Sensitivity(NamedTuple):
    """Derivatives by numbers of the elements and rows.

    Attributes
    ----------
    axial, length : ndarray, shape (cells,)
        By EA [N] and by natural length [m] of each element.
    mass : ndarray, shape (rows,)
        By the mass of each row [kg].
    area : ndarray, shape (cells,)
        By the area of each element [m²], apart from EA and mass.
    coupled : ndarray, shape (cells,)
        By the mass of each element [kg], apart from that of rows: of consistent mass.
    """

    axial: np.ndarray
    length: np.ndarray
    mass: np.ndarray
    area: np.ndarray
    coupled: np.ndarray

    @classmethod
    def zeros(cls, net):
        """Derivatives that are 0."""
        cells = len(net.cells)
        return cls(*(np.zeros(count) for count in (cells, cells, len(net.points), cells, cells)))

    def plus(self, more, share=1.0):
        """The sum with a share of more."""
        return Sensitivity(*(a + share * b for a, b in zip(self, more, strict=True)))


class LineState:
    """Lines of a net at a displacement of all rows.

    Parameters
    ----------
    net : refweb.net.net.Net
        The net, with the natural lengths of the load step.
    x : ndarray, shape (rows, 3)
        Displacement [m].
    """

    def __init__(self, net, x):
        self.net, self.x = net, x

    @cached_property
    def strain(self):
        """Strain at each quadrature point, shape (cells, points)."""
        return strains(self.net, self.x)

    def _of_law(self, which):
        """A kernel of the laws at each quadrature point, shape (cells, points)."""
        net, (cells, points) = self.net, self.strain.shape
        lines = net.line_data[np.repeat(np.arange(cells), points)]
        return evaluate(getattr(net.law, which), self.strain.ravel(), lines, net.law.columns).reshape(cells, points)

    @cached_property
    def tension(self):
        """Tension at each quadrature point [N], shape (cells, points)."""
        return self._of_law("stress")

    @cached_property
    def tangent(self):
        """Slope of tension over strain at each quadrature point [N], shape (cells, points)."""
        return self._of_law("tangent")

    @cached_property
    def curvature(self):
        """Slope of the tangent over strain at each quadrature point [N], shape (cells, points)."""
        return self._of_law("curvature")

    @cached_property
    def direction(self):
        """Unit vector of each bar, see `refweb.net.net.Net.bars`, shape (cells × points, 3)."""
        vectors = self.net.bar_vectors(self.x)
        length = np.linalg.norm(vectors, axis=1)
        return vectors / np.where(length > 0.0, length, 1.0)[:, None]

    def stretch(self, rows):
        """Change of length of each bar by a displacement of all rows [m], shape (cells, points)."""
        return ((self.net.bars @ rows) * self.direction).sum(axis=1).reshape(self.strain.shape)

    def work(self, rows):
        """Derivatives of the virtual work of the lines on a displacement, by EA and natural length of each element."""
        along, ea = self.stretch(rows), self.net.line_data.ea
        axial = -(self.tension * along).sum(axis=1) / np.where(ea != 0.0, ea, 1.0)
        return axial, ((1.0 + self.strain) * self.tangent * along).sum(axis=1) / self.net.natural_length


class Adjoint:
    """The equilibrium of a system at a displacement, linearised.

    Parameters
    ----------
    system : refweb.system.system.System
        The system at rest.
    t : float
        Load step.
    x : ndarray, shape (rows, 3)
        Displacement [m].
    newton : refweb.statics.newton.Newton, optional
        With a factorization of the tangent at, or near, x; by default it is factorized here.
    """

    def __init__(self, system, t, x, newton=None):
        self.system, self.t, self.x, self.net = system, t, x, system.at(t).net
        self.lines, self.state = LineState(self.net, x), State(system, t, x)
        self.newton, self._shared = newton or _factorized(system, t, x), newton is not None
        self._matrix = system.pattern.matrix(system.stiffness(t, x))

    def multipliers(self, slope):
        """(λ, its last correction), both of shape (rows, 3), for ∂J/∂x of that shape.

        Raises
        ------
        InputError
            Where the result depends on parts that move without stiffness.
        """
        slope = slope.copy()
        if self.system.carriers:
            self.system.carriers.add_forces_to_bodies(self.x, slope)
        b = slope.ravel()[self.system.free]
        solved = self._refined(b)
        if solved is None and self._shared:  # a line has become slack since then
            self.newton, self._shared = _factorized(self.system, self.t, self.x), False
            solved = self._refined(b)
        if solved is None:
            raise InputError(
                "it depends on parts of the web that move without stiffness: hold them by supports, loads or lines"
            )
        return tuple(map(self.rows_of, solved))

    def rows_of(self, p):
        """Displacement of all rows by that of the unknowns, to first order, nodes that bodies carry included."""
        rows = self.system.rows_of(p)
        if self.system.carriers:
            self.system.carriers.add_moves(self.x, rows[None])
        return rows

    def _refined(self, b):
        """(Solution of Kᵀ λ = b, its last correction), None where the factorization does not lead to one."""
        factor: Any = self.newton.factor
        follows = self.newton.follows
        down = self._matrix.T if follows else self._matrix
        solution, change = np.zeros_like(b), np.zeros_like(b)
        for _ in range(ROUNDS):
            rest = b - down @ solution
            change = factor.solve(rest, transposed=True) if follows else factor.solve(rest)
            if change is None:
                return None
            solution = solution + change
        left = np.abs(b - down @ solution).max(initial=0.0)
        return (solution, change) if left <= SOLVED * np.abs(b).max(initial=0.0) else None

    def pulled(self, rows):
        """Kᵀ times a displacement of all rows, supports included, shape (rows, 3)."""
        if self.system.angles and self.system.contact:
            raise InputError("forces of supports are not taken beside contact of bodies that turn")
        system, total = self.system, np.zeros_like(rows)
        for term in (term for term in system.terms if term.tangent.stiffness is not None):
            size = 3 * term.cells.shape[1]
            block, still = np.empty((len(term.cells), size, size)), np.zeros_like(rows)
            term.tangent.stiffness(self.t, self.x, still, block, term.cells, system.data_of(term, self.t), False)
            given = rows[term.cells].reshape(len(term.cells), -1)
            back = np.einsum("cij,ci->cj", block, given).reshape(*term.cells.shape, 3)
            np.add.at(total, term.cells, back)
        return total

    @cached_property
    def deviations(self):
        """Possible errors of x, see `refweb.statics.equilibrium.Equilibrium`, shape (k, rows, 3)."""
        force, per_cell = self.system.forces(self.t, self.x)
        state = Equilibrium(self.t, self.x, per_cell.tension, force)
        moves = [self.newton.factor.solve(disturbance) for disturbance in self.newton.disturbing(state)[:2]]
        return np.array([self.rows_of(p) for p in moves])

    @cached_property
    def weight(self):
        """Terms of forces that are in proportion to mass, as those of masses of 1 kg, a list."""
        if not any(term.name in MASSES for term in self.system.terms):
            return []
        net = replace(self.net, mass=np.ones_like(self.net.mass), flows=())
        parts = parts_of(self.system.effects, net)
        return [term for term in parts if getattr(term, "name", "") in MASSES and term.timing.at_rest]

    @cached_property
    def acceleration(self):
        """Force on each row by a mass of 1 kg there [m/s²], shape (rows, 3)."""
        return sum((self.system.force_of(term, self.t, self.x) for term in self.weight), np.zeros_like(self.x))

    def work(self, rows):
        """The `Sensitivity` of the virtual work of all forces on a displacement of all rows."""
        axial, length = self.lines.work(rows)
        mass = (self.acceleration * rows).sum(axis=1)
        return Sensitivity.zeros(self.net)._replace(axial=axial, length=length, mass=mass)

    @cached_property
    def _shares(self):
        """Share of the mass of an element that each of its nodes has."""
        return lumped_shares(line_element(self.net.order))

    def by_element_mass(self, by_numbers):
        """Derivatives of a `Sensitivity` by the mass of each element [kg], shape (cells,)."""
        return by_numbers.mass[self.net.cells] @ self._shares + by_numbers.coupled


def _factorized(system, t, x):
    """The `refweb.statics.newton.Newton` of a system with the factorization of its tangent at a displacement."""
    newton = Newton(system, None, t)
    newton.factorize_at(Equilibrium(t, x, np.zeros(0), np.zeros(0), {"nlu": 0}))
    return newton
