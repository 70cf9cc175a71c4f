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


def along(u):
    """du/ds of a vector field: components first, then cells and quadrature points."""
    return u.grad[:, 0]


def tangent_and_stretch(w):
    """t and λ."""
    x = along(w.x)
    stretch = np.sqrt(dot(x, x))
    return x / stretch, stretch


def forms(law):
    """Internal force, tangent and energy of a tension law, for numbers E, A, ε0, η per line and a position field x."""

    @skfem.LinearForm
    def internal_force(v, w):
        t, stretch = tangent_and_stretch(w)
        return w.A * law.stress(stretch - 1, w.E, w.slackness, w.smoothing) * dot(t, along(v))

    @skfem.BilinearForm
    def tangent(u, v, w):
        t, stretch = tangent_and_stretch(w)
        tension = w.A * law.stress(stretch - 1, w.E, w.slackness, w.smoothing)
        stiffness = w.A * law.tangent(stretch - 1, w.E, w.slackness, w.smoothing)
        stretching = dot(t, along(u)) * dot(t, along(v))
        return stiffness * stretching + tension / stretch * (dot(along(u), along(v)) - stretching)

    @skfem.Functional
    def energy(w):
        return w.A * law.energy_density(tangent_and_stretch(w)[1] - 1, w.E, w.slackness, w.smoothing)

    return internal_force, tangent, energy


@skfem.BilinearForm
def structure(u, v, w):
    """Couples every component of a line's nodes with every other: the entries that the tangent of some state has.

    The tangent itself has fewer where lines are slack or along an axis, because ``COOData`` eliminates zeros.
    """
    return along(u).sum(axis=0) * along(v).sum(axis=0)


@skfem.LinearForm
def lumped_mass(v, w):
    """Row sums of the consistent mass ∫ ρA δx·dx ds."""
    return w.density * w.A * v.sum(axis=0)


class Oracle:
    """The lines of a web as scikit-fem assembles them.

    Parameters
    ----------
    web : refweb.webs.Web
        The web.
    cable : refweb.cables.Cable
        Its material.
    """

    def __init__(self, web, cable):
        values = cable.properties(web)
        vector = skfem.ElementVector(skfem.ElementLineP1(), 3)
        self.points = web.points
        self.basis = lines.basis(web.points, web.lines, values["natural_length"], vector)
        self.forms = forms(cable.tension_law)
        names = dict(E="modulus", A="area", density="density", slackness="slackness", smoothing="smoothing")
        self.numbers = {key: values[name][:, None] for key, name in names.items()}

    def _at(self, x):
        return dict(self.numbers, x=self.basis.interpolate((self.points + x).ravel()))

    def force(self, x):
        """Force of the lines on every node at the displacement x [N], shape (nodes, 3)."""
        return -self.forms[0].assemble(self.basis, **self._at(x)).reshape(-1, 3)

    def stiffness(self, x):
        """Tangent of all components [N/m]."""
        return self.forms[1].assemble(self.basis, **self._at(x))

    def energy(self, x):
        """Strain energy of each line [J]."""
        return self.forms[2].elemental(self.basis, **self._at(x))

    def structure(self):
        """Matrix whose entries are the pairs of components that some line couples."""
        return structure.assemble(self.basis)

    def mass(self):
        """Lumped mass of each node, once per component [kg], shape (nodes, 3)."""
        return lumped_mass.assemble(self.basis, **self.numbers).reshape(-1, 3)
