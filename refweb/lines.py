"""Nodal line elements over natural arc length.

A cable is a curve x(s) ∈ R³ over its natural arc length s. scikit-fem knows such an element once the mapping's metric
is the natural length: `NaturalLength` has DF = detDF = L and invDF = 1/L, so that ``grad(u)`` of an
``ElementVector(ElementLineP1(), 3)`` is du/ds, and branching, closed and prestressed nets need nothing extra. From the
`skfem.Basis` only the dofs, the quadrature and the reference derivatives dN/dξ are kept; the compiled kernels do the
rest. Another order is another element here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# Columns of Net.line_data: what a kernel over lines finds in `data`.
LENGTH, AXIAL_STIFFNESS, SLACKNESS, SMOOTHING, G0, R0, POINT = range(7)
"""``data[:, POINT + 4q : POINT + 4q + 4]`` is dX/dξ at quadrature point q and its magnitude [m]."""


@dataclass(frozen=True, eq=False)
class Net:
    """What effects act on: the rows of the unknowns, their mass, and the lines between them.

    Attributes
    ----------
    web : refweb.webs.Web
        Nodes and lines as the user numbered them.
    law : refweb.laws.Law
        Tension law of all lines.
    points : ndarray, shape (rows, 3)
        Reference positions [m]; the web's nodes come first.
    mass : ndarray, shape (rows,)
        Lumped mass [kg].
    cells : ndarray of int32, shape (cells, nodes per cell)
        Rows that each element couples, in the order of dN/dξ.
    line : ndarray of int32, shape (cells,)
        The web's line that each element belongs to.
    line_data : ndarray, shape (cells, columns)
        Natural length [m], EA [N], ε0, η, their (g0, r0) of `refweb.laws`, then dX/dξ and its magnitude at each
        quadrature point [m].
    area, strength : ndarray, shape (cells,)
        Cross section [m²] and strength [Pa].
    gradients : ndarray, shape (points, nodes per cell)
        dN/dξ on the reference element [0, 1].
    weights : ndarray, shape (points,)
        Quadrature weights, of sum 1.
    quasi_static : bool
        True where time is the load step of statics.
    cable_mass : float
        Mass of the lines alone [kg].
    bodies : tuple of refweb.bodies.RigidBody
        Bodies, whose rows follow those of the nodes.
    """

    web: object
    law: object
    points: np.ndarray
    mass: np.ndarray
    cells: np.ndarray
    line: np.ndarray
    line_data: np.ndarray
    area: np.ndarray
    strength: np.ndarray
    gradients: np.ndarray
    weights: np.ndarray
    quasi_static: bool = False
    cable_mass: float = 0.0
    bodies: tuple = ()

    @property
    def natural_length(self):
        """Natural length of each element [m], shape (cells,)."""
        return self.line_data[:, LENGTH]

    @property
    def slackness(self):
        """Strain at or below which an element is slack, shape (cells,): ε0, which is 0 for laws without it."""
        return self.line_data[:, SLACKNESS]


def basis(points, lines, natural_length, element=None):
    """The `skfem.Basis` of lines whose metric is the natural length.

    Parameters
    ----------
    points : ndarray, shape (nodes, 3)
        Positions [m]; only the embedding, no metric, comes from them.
    lines : ndarray of int, shape (lines, 2)
        End nodes.
    natural_length : ndarray, shape (lines,)
        Natural lengths [m].
    element : skfem.Element, optional
        Scalar or vector line element, ``ElementLineP1()`` by default.
    """
    import skfem
    from skfem.mapping import Mapping

    class NaturalLength(Mapping):
        """ξ ∈ [0, 1] to the line's point, with the natural length as metric."""

        def _metric(self, value, X, tind):
            value = value if tind is None else value[tind]
            return np.broadcast_to(value[:, None], (len(value), X.shape[-1]))

        def F(self, X, tind=None):
            t = lines.T if tind is None else lines.T[:, tind]
            return points[t[0]].T[:, :, None] + (points[t[1]] - points[t[0]]).T[:, :, None] * X

        def DF(self, X, tind=None):
            return self._metric(natural_length, X, tind)[None, None]

        def invDF(self, X, tind=None):
            return self._metric(1.0 / natural_length, X, tind)[None, None]

        def detDF(self, X, tind=None):
            return self._metric(natural_length, X, tind)

    mesh = skfem.MeshLine1(np.ascontiguousarray(points.T), np.ascontiguousarray(lines.T), validate=False)
    element = element or skfem.ElementLineP1()
    one_point = (np.array([[0.5]]), np.array([1.0]))
    return skfem.Basis(mesh, element, mapping=NaturalLength(), quadrature=one_point)


def build(web, cable, quasi_static=False):
    """The `Net` of a web made of a cable."""
    values = cable.properties(web)
    line_basis = basis(web.points, web.lines, values["natural_length"])
    cells = np.ascontiguousarray(line_basis.element_dofs.T, dtype=np.int32)
    local, weights = line_basis.X, line_basis.W
    gradients = np.array([line_basis.elem.lbasis(local, a)[1][0] for a in range(cells.shape[1])]).T.copy()

    length = values["natural_length"]
    slackness, smoothing = values["slackness"], values["smoothing"]
    r0 = np.sqrt(slackness**2 + 4.0 * smoothing**2)
    g0 = 2.0 * smoothing**2 / np.where(r0 > 0.0, r0 + slackness, 1.0)
    data = [length, values["modulus"] * values["area"], slackness, smoothing, g0, r0]
    for row in gradients:
        tangent = np.einsum("a,cai->ci", row, web.points[cells])
        data += [*tangent.T, np.linalg.norm(tangent, axis=1)]

    mass = np.zeros(len(web.points))
    share = values["density"] * values["area"] * length / cells.shape[1]
    for a in range(cells.shape[1]):
        np.add.at(mass, cells[:, a], share)
    return Net(
        web=web,
        law=cable.tension_law,
        points=web.points,
        mass=mass,
        cells=cells,
        line=np.arange(len(cells), dtype=np.int32),
        line_data=np.ascontiguousarray(np.column_stack(data)),
        area=values["area"],
        strength=values["strength"],
        gradients=gradients,
        weights=weights,
        quasi_static=quasi_static,
        cable_mass=float(mass.sum()),
    )
