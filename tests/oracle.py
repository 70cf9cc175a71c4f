"""The weak form of a cable on the page: what the compiled kernels are held against.

Position x(s) ∈ R³ over natural arc length s, λ = |x'|, t = x'/λ, T = A σ(λ − 1):

    internal force   ∫ T t·δx' ds
    tangent          ∫ [A σ' (t·δx')(t·dx') + T/λ (δx'·dx' − (t·δx')(t·dx'))] ds

scikit-fem sees natural arc length through the mapping of `refweb.lines.basis`. An ``ElementVector`` numbers the three
components of one node after another, so that its dofs are those of a nodal array ``(n, 3)`` raveled.
"""

import numpy as np
import skfem
from skfem.helpers import dot

from refweb import lines

VECTOR = skfem.ElementVector(skfem.ElementLineP1(), 3)


def along(u):
    """du/ds of a vector field: components first, then cells and quadrature points."""
    return u.grad[:, 0]


@skfem.LinearForm
def internal_force(v, w):
    x = along(w["x"])
    stretch = np.sqrt(dot(x, x))
    return w["A"] * w["sigma"](stretch - 1) * dot(x, along(v)) / stretch


@skfem.BilinearForm
def tangent(u, v, w):
    x = along(w["x"])
    stretch = np.sqrt(dot(x, x))
    t = x / stretch
    stiff, tension = w["A"] * w["slope"](stretch - 1), w["A"] * w["sigma"](stretch - 1)
    both = dot(t, along(u)) * dot(t, along(v))
    return stiff * both + tension / stretch * (dot(along(u), along(v)) - both)


@skfem.Functional
def energy(w):
    x = along(w["x"])
    return w["A"] * w["density"](np.sqrt(dot(x, x)) - 1)


@skfem.BilinearForm
def structure(u, v, w):
    """Couples every component of a cell's nodes with every other: what the tangent of any state can reach.

    ``COOData`` eliminates zeros, hence the tangent itself has fewer entries where lines are slack or lie along an axis.
    """
    return along(u).sum(axis=0) * along(v).sum(axis=0)


@skfem.BilinearForm
def mass(u, v, w):
    return w["line_density"] * dot(u, v)


class Oracle:
    """Force, tangent and energy of a net's lines at displacement x, as scikit-fem assembles them.

    Parameters
    ----------
    web : refweb.webs.Web
        The web.
    cable : refweb.cables.Cable
        Its material.
    """

    def __init__(self, web, cable):
        values = cable.properties(web)
        self.points, law = web.points, cable.tension_law
        self.basis = lines.basis(web.points, web.lines, values["natural_length"], VECTOR)
        numbers = [values[k][:, None] for k in ("modulus", "slackness", "smoothing")]
        self.line = dict(
            A=values["area"][:, None],
            line_density=(values["density"] * values["area"])[:, None],
            sigma=lambda strain: law.stress(strain, *numbers),
            slope=lambda strain: law.tangent(strain, *numbers),
            density=lambda strain: law.energy_density(strain, *numbers),
        )

    def _at(self, x):
        return dict(self.line, x=self.basis.interpolate((self.points + x).ravel()))

    def force(self, x):
        """Force of the lines on every node [N], shape (nodes, 3)."""
        return -internal_force.assemble(self.basis, **self._at(x)).reshape(-1, 3)

    def stiffness(self, x):
        """Tangent of all components [N/m]."""
        return tangent.assemble(self.basis, **self._at(x))

    def energy(self, x):
        """Strain energy of each line [J]."""
        return energy.elemental(self.basis, **self._at(x))

    def structure(self):
        """Matrix whose non-zero entries are the components that some line couples."""
        return structure.assemble(self.basis)

    def mass(self):
        """Mass of each component [kg]: row sums of the consistent mass matrix."""
        return mass.assemble(self.basis, **self.line).sum(axis=1)
