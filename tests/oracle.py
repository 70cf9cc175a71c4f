"""The weak form of a cable on the page: what the compiled kernels are held against.

Position x(s) ∈ R³ over natural arc length s, λ = |x'|, t = x'/λ, T = A σ(λ − 1):

    internal force   ∫ T t·δx' ds
    tangent          ∫ [A σ' (t·δx')(t·dx') + T/λ (δx'·dx' − (t·δx')(t·dx'))] ds

Nothing of it is refweb's own. Every element is an interval of one axis of natural arc length, beside its neighbours
and not joined to them, so that the metric is that of scikit-fem's mesh. Functions and quadrature are scikit-fem's, but
for the cubic that it does not have; the laws are written here as the paper has them. `Oracle` gathers the nodes of
intervals into rows by the numbering that scenes promise: the web's nodes, then those that order and subdivision add,
line by line and along each line.
"""

import numpy as np
import scipy.sparse
import skfem
from skfem.helpers import dot

# Laws


class Smooth:
    """σ = E[(s + r)/2 − α], s = ε − ε0, r = √(s² + 4η²), α = (−ε0 + √(ε0² + 4η²))/2; its slope, and its integral."""

    @staticmethod
    def stress(strain, E, slackness, smoothing):
        s = strain - slackness
        floor = 0.5 * (np.sqrt(slackness**2 + 4.0 * smoothing**2) - slackness)
        return E * (0.5 * (s + np.sqrt(s**2 + 4.0 * smoothing**2)) - floor)

    @staticmethod
    def tangent(strain, E, slackness, smoothing):
        s = strain - slackness
        return 0.5 * E * (1.0 + s / np.sqrt(s**2 + 4.0 * smoothing**2))

    @staticmethod
    def energy_density(strain, E, slackness, smoothing):
        def integral(s):
            root = np.sqrt(s**2 + 4.0 * smoothing**2)
            return 0.25 * s * (s + root) + smoothing**2 * np.arcsinh(0.5 * s / smoothing)

        floor = 0.5 * (np.sqrt(slackness**2 + 4.0 * smoothing**2) - slackness)
        return E * (integral(strain - slackness) - integral(-slackness) - floor * strain)


class TensionOnly:
    """σ = E max(ε, 0)."""

    @staticmethod
    def stress(strain, E, slackness, smoothing):
        return E * np.maximum(strain, 0.0)

    @staticmethod
    def tangent(strain, E, slackness, smoothing):
        return E * (strain >= 0.0)

    @staticmethod
    def energy_density(strain, E, slackness, smoothing):
        return 0.5 * E * np.maximum(strain, 0.0) ** 2


class Linear:
    """σ = E ε."""

    @staticmethod
    def stress(strain, E, slackness, smoothing):
        return E * strain

    @staticmethod
    def tangent(strain, E, slackness, smoothing):
        return E + 0.0 * strain

    @staticmethod
    def energy_density(strain, E, slackness, smoothing):
        return 0.5 * E * strain**2


LAWS = {"smooth": Smooth, "tension-only": TensionOnly, "linear": Linear}


# Elements


class Cubic(skfem.element.ElementH1):
    """Lagrange's polynomials on the four points at which (1 − z²) P₃'(z) is zero, z = 2 ξ − 1; ends come first."""

    nodal_dofs, interior_dofs, maxdeg, dofnames = 1, 2, 3, ["u", "u", "u"]
    refdom = skfem.refdom.RefLine
    inner = np.polynomial.Legendre.basis(3).deriv().roots()
    doflocs = 0.5 * (np.concatenate([[-1.0, 1.0], inner])[:, None] + 1.0)

    def lbasis(self, X, i):
        own, others = self.doflocs[i, 0], np.delete(self.doflocs[:, 0], i)
        product = np.polynomial.Polynomial.fromroots(others) / np.prod(own - others)
        return product(X[0]), product.deriv()(X[0])[None]


ELEMENTS = {1: skfem.ElementLineP1, 2: skfem.ElementLineP2, 3: Cubic}


# Forms


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


@skfem.BilinearForm
def mass(u, v, w):
    """Consistent mass ∫ ρA δx·dx ds."""
    return w.density * w.A * dot(u, v)


def rows_of_lines(web, cable):
    """Rows of the nodes of each line from its first end to its second, shape (lines, nodes of a line)."""
    added, rows = cable.order * cable.subdivide - 1, []
    for number, (first, last) in enumerate(web.lines.tolist()):
        begin = len(web.points) + number * added
        rows.append([first, *range(begin, begin + added), last])
    return np.array(rows)


class Oracle:
    """The lines of a web as scikit-fem assembles them.

    Parameters
    ----------
    web : refweb.net.web.Web
        The web.
    cable : refweb.net.cable.Cable
        Its material, order and subdivision.

    Attributes
    ----------
    points : ndarray, shape (rows, 3)
        Positions of all nodes in the straight web [m].
    cells : ndarray, shape (elements, order + 1)
        Rows of each element's nodes from its first end to its second.
    """

    def __init__(self, web, cable):
        order, pieces, element = cable.order, cable.subdivide, ELEMENTS[cable.order]()
        rows = rows_of_lines(web, cable)
        self.cells = np.vstack([line[k * order : (k + 1) * order + 1] for line in rows for k in range(pieces)])
        along = np.sort(element.doflocs[:, 0])
        place = np.append(np.ravel([(k + along[:-1]) / pieces for k in range(pieces)]), 1.0)[:, None]
        self.points = np.empty((rows.max() + 1, 3))
        for line, (first, last) in zip(rows, web.points[web.lines], strict=True):
            self.points[line] = (1.0 - place) * first + place * last

        of_line = np.repeat(np.arange(len(web.lines)), pieces)
        values = {name: value[of_line] for name, value in cable.properties(web).items()}
        self.basis = self._basis(2 * order - 1, element, values["natural_length"] / pieces)
        # Dofs of an element: first its two ends, then what lies inside along it; of each node x, y, z.
        own = np.hstack([self.cells[:, [0, -1]], self.cells[:, 1:-1]])
        self.row = np.empty(self.basis.N, dtype=int)
        self.row[self.basis.element_dofs.T] = (3 * own[:, :, None] + np.arange(3)).reshape(len(own), -1)
        self.gather = scipy.sparse.csr_array((np.ones(self.basis.N), (self.row, np.arange(self.basis.N))))
        self.forms = forms(LAWS[cable.law])
        names = dict(E="modulus", A="area", density="density", slackness="slackness", smoothing="smoothing")
        self.numbers = {key: values[name][:, None] for key, name in names.items()}

    @staticmethod
    def _basis(degree, element, lengths):
        """Intervals of these lengths [m] side by side; their quadrature is exact for a degree."""
        ends = np.cumsum(lengths)
        places = np.column_stack([ends - lengths, ends]).ravel()
        mesh = skfem.MeshLine1(places[None], np.arange(len(places)).reshape(-1, 2).T, validate=False)
        return skfem.Basis(mesh, skfem.ElementVector(element, 3), intorder=degree)

    def _at(self, x):
        return dict(self.numbers, x=self.basis.interpolate((self.points + x).ravel()[self.row]))

    def _by_row(self, matrix):
        """A matrix of scikit-fem's dofs as one of components 3 row + axis."""
        return (self.gather @ matrix.tocsr() @ self.gather.T).tocsr()

    def force(self, x):
        """Force of the lines on every node at the displacement x [N], shape (rows, 3)."""
        return (self.gather @ -self.forms[0].assemble(self.basis, **self._at(x))).reshape(-1, 3)

    def stiffness(self, x):
        """Tangent of all components [N/m]."""
        return self._by_row(self.forms[1].assemble(self.basis, **self._at(x)))

    def energy(self, x):
        """Strain energy of each element [J]."""
        return self.forms[2].elemental(self.basis, **self._at(x))

    def structure(self):
        """Matrix whose entries are the pairs of components that some element couples."""
        return self._by_row(structure.assemble(self.basis))

    def mass(self):
        """Consistent mass of all components [kg], by quadrature that is exact for it."""
        exact = skfem.Basis(self.basis.mesh, self.basis.elem, intorder=8)
        return self._by_row(mass.assemble(exact, **self.numbers))
