"""Nodal line elements over natural arc length.

A cable is a curve x(s) ∈ R³ over its natural arc length s. scikit-fem knows such an element once the mapping's metric
is the natural length: `NaturalLength` has DF = detDF = L and invDF = 1/L, so that ``grad(u)`` of an
``ElementVector(ElementLineP1(), 3)`` is du/ds, and branching, closed and prestressed nets need nothing extra. From the
`skfem.Basis` only the dofs, the quadrature and the reference derivatives dN/dξ are kept; the compiled kernels do the
rest.

A line of the web is ``subdivide`` elements of ``order`` 1, 2 or 3, each with as many Gauss points as its order. That is
the least quadrature with which no motion of an element but a rigid one is free of strain, and it keeps the orders of
the elements: on the elastic catenary L2 errors fall with order p + 1 and nodal errors with 2p, those of frequencies
with 2p for either mass. A Gauss point is then a bar of its own, of length w L; see `Net.bars`.

Where a line goes slack inside an element the integrand has a kink, its quadrature is of order 2 for any p, and orders
above 1 lose their advantage. In a cable that is knocked together L2 errors fall with orders 2.0, 3.0 and 4.0 for
p = 1, 2 and 3 while all of it is taut, and with 2.0, 1.1 and 1.0 once its middle is slack: nodes of a slack element fly
on by themselves, with velocities that several points going slack one after another leave wrong by ~ h. With 160 nodes
the errors of p = 2 and 3 are still an eighth of that of p = 1, with 1000 nodes all three are alike. Where a slack part
is pulled taut the strain jumps, and no order exceeds 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..kernels import kernel

LENGTH, AXIAL_STIFFNESS, SLACKNESS, SMOOTHING, G0, R0, REFERENCE = range(7)
"""Columns of `Net.line_data`, what a kernel over lines finds in ``data``; ``data[:, REFERENCE : REFERENCE + 4]`` is
dX/dξ, constant because lines of a web are straight, and its magnitude. Effects add others by `Net.with_column`."""
COLUMNS = ("length", "axial_stiffness", "slackness", "smoothing", "g0", "r0", "x", "y", "z", "distance")
"""Names of these columns."""


@dataclass(frozen=True, eq=False)
class Net:
    """What effects act on: the rows of the unknowns, their mass, and the lines between them.

    Attributes
    ----------
    web : refweb.net.web.Web
        Nodes and lines as the user numbered them.
    law : refweb.net.tension_laws.Law
        Tension law of all lines.
    points : ndarray, shape (rows, 3)
        Reference positions [m]: the web's nodes, those that order and subdivision add, line by line and along each
        line, then bodies.
    mass : ndarray, shape (rows,)
        Lumped mass [kg].
    cells : ndarray of int32, shape (cells, nodes per cell)
        Rows that each element couples, in the order of dN/dξ: ends first. Elements of a line follow each other.
    line : ndarray of int32, shape (cells,)
        The web's line that each element belongs to.
    line_data : ndarray, shape (cells, columns)
        Natural length [m], EA [N], ε0, η, their (g0, r0) of `refweb.net.tension_laws`, then dX/dξ and its magnitude
        [m], then what effects add.
    columns : tuple of str
        Names of its columns.
    area, strength : ndarray, shape (cells,)
        Cross section [m²] and strength [Pa].
    gradients : ndarray, shape (points, nodes per cell)
        dN/dξ on the reference element [0, 1].
    weights : ndarray, shape (points,)
        Quadrature weights, of sum 1.
    nodes : int
        Number of rows that are nodes, not bodies.
    places : ndarray, shape (nodes per cell,)
        ξ of each node of a cell.
    subdivide : int
        Elements per line.
    quasi_static : bool
        True where time is the load step of statics.
    cable_mass : float
        Mass of the lines alone [kg].
    consistent_minus_lumped : ndarray, shape (cells, nodes per cell, nodes per cell), optional
        Consistent mass less the lumped one of each element [kg], its rows of sum 0; None where mass is lumped.
    bodies : tuple of refweb.net.rigid_body.RigidBody
        Bodies, whose rows follow those of the nodes.
    spins : int
        Number of rows at the end that are rotations of bodies: rotation vector [rad], angular velocity [rad/s], and
        moment of inertia [kg m²] in place of mass.
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
    nodes: int
    places: np.ndarray
    subdivide: int = 1
    quasi_static: bool = False
    cable_mass: float = 0.0
    consistent_minus_lumped: np.ndarray | None = None
    bodies: tuple = ()
    spins: int = 0
    columns: tuple = COLUMNS

    spread = property(lambda self: self.consistent_minus_lumped)  # TRANSITION

    @property
    def heavy(self):
        """Rows with a mass, which a moment of inertia is not."""
        return np.flatnonzero(self.mass[: len(self.mass) - self.spins])

    @property
    def order(self):
        """Order of the elements."""
        return self.cells.shape[1] - 1

    def column(self, name):
        """Number of a column of ``line_data``, for the kernels of the effect that added it."""
        return self.columns.index(name)

    def with_column(self, name, values):
        """The net with one more column in ``line_data``; ``values`` are one number or one for each element."""
        if name in self.columns:
            raise ValueError(f"there is a column {name} already")
        own = np.broadcast_to(values, len(self.cells))
        numbers = np.ascontiguousarray(np.column_stack([self.line_data, own]), dtype=float)
        return replace(self, line_data=numbers, columns=(*self.columns, name))

    @property
    def natural_length(self):
        """Natural length of each element [m], shape (cells,)."""
        return self.line_data[:, LENGTH]

    @property
    def slackness(self):
        """Strain at or below which an element is slack, shape (cells,): ε0, which is 0 for laws without it."""
        return self.line_data[:, SLACKNESS]

    @cached_property
    def bars(self):
        """Quadrature points as bars of natural length w L and stiffness EA/(w L), whose vectors are ``bars @ x``.

        A `scipy.sparse.csr_array` of shape (cells × points, rows), with w dN/dξ as entries; the bars of a cell follow
        each other. Bars with tensions along unit vectors, S of shape (bars, 3), pull the rows by ``-bars.T @ S``.
        """
        from scipy.sparse import csr_array

        points, nodes = self.gradients.shape
        entries = np.tile((self.weights[:, None] * self.gradients).ravel(), len(self.cells))
        columns = np.repeat(self.cells[:, None], points, axis=1)
        starts = nodes * np.arange(points * len(self.cells) + 1)
        return csr_array((entries, columns.ravel(), starts), shape=(points * len(self.cells), len(self.points)))

    @property
    def along(self):
        """Places in a cell's nodes from its first end to its second: ``cells[:, along]`` follows the line."""
        return np.argsort(self.places)

    def find(self, selection, name="node"):
        """Rows of a selection of nodes; "all" has the nodes that order and subdivision add, see `Web.find`."""
        every = selection == "all" or (isinstance(selection, (list, tuple)) and "all" in selection)
        found = self.web.find(selection, name)
        return np.arange(self.nodes) if every else found


@kernel()
def strain(x, cells, data, c, q, nodes, gradients):
    """(dx/dξ, 1/|dx/dξ| or 0, ε) at quadrature point q of cell c."""
    u0 = u1 = u2 = 0.0
    for a in range(nodes):
        row, d = np.uint64(cells[c, a]), gradients[q * nodes + a]  # unsigned: no row counts from the end
        u0 += d * x[row, 0]
        u1 += d * x[row, 1]
        u2 += d * x[row, 2]
    r0, r1, r2, r = data[c, REFERENCE], data[c, REFERENCE + 1], data[c, REFERENCE + 2], data[c, REFERENCE + 3]
    natural = data[c, LENGTH]
    p0, p1, p2 = r0 + u0, r1 + u1, r2 + u2
    length = math.sqrt(p0 * p0 + p1 * p1 + p2 * p2)
    square = (2.0 * r0 + u0) * u0 + (2.0 * r1 + u1) * u1 + (2.0 * r2 + u2) * u2 + (r - natural) * (r + natural)
    inverse = 1.0 / length if length > 0.0 else 0.0
    return p0, p1, p2, inverse, square / (natural * (length + natural))


def basis(points, lines, natural_length, element=None):
    """The `skfem.Basis` of lines whose metric is the natural length, with as many Gauss points as the element's order.

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

    from .elements import gauss

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
    return skfem.Basis(mesh, element, mapping=NaturalLength(), quadrature=gauss(element.maxdeg))


def _divided(web, pieces):
    """Points and ends of the elements when each line of a web is cut into equal pieces."""
    if pieces == 1:
        return web.points, web.lines
    count, cut = len(web.lines), np.arange(1, pieces) / pieces
    start, end = web.points[web.lines[:, 0]], web.points[web.lines[:, 1]]
    inner = start[:, None] + cut[:, None] * (end - start)[:, None]
    numbers = len(web.points) + np.arange(count * (pieces - 1)).reshape(count, pieces - 1)
    chain = np.hstack([web.lines[:, :1], numbers, web.lines[:, 1:]])
    ends = np.stack([chain[:, :-1], chain[:, 1:]], axis=2).reshape(-1, 2)
    return np.vstack([web.points, inner.reshape(-1, 3)]), ends


def _numbered(dofs, line, place, nodes):
    """Row of each dof: the web's nodes keep their number, the others follow line by line and along each line."""
    count = dofs.max() + 1
    of_line, along = np.empty(count, dtype=np.int64), np.empty(count)
    of_line[dofs], along[dofs] = line[:, None], place
    added = nodes + np.lexsort((along[nodes:], of_line[nodes:]))
    row = np.arange(count)
    row[added] = np.arange(nodes, count)
    return row


def build(web, cable, quasi_static=False, consistent=False):
    """The `Net` of a web made of a cable.

    Parameters
    ----------
    web : refweb.net.web.Web
        Nodes and lines.
    cable : refweb.net.cable.Cable
        Material, order and subdivision.
    quasi_static : bool
        Whether time is the load step of statics.
    consistent : bool
        Whether mass is consistent, ∫ρA N_a N_b ds, and not lumped to ∫ρA N_a ds.
    """
    from .elements import gauss, line_element, values

    given, pieces, element = cable.properties(web), cable.subdivide, line_element(cable.order)
    line = np.repeat(np.arange(len(web.lines), dtype=np.int32), pieces)
    own = {name: value[line] for name, value in given.items()}
    length = own["natural_length"] / pieces
    points, ends = _divided(web, pieces)
    line_basis = basis(points, ends, length, element)
    dofs, places = line_basis.element_dofs.T, element.doflocs[:, 0]
    place = np.tile(np.arange(pieces), len(web.lines))[:, None] + places
    row = _numbered(dofs, line, place, len(web.points))
    cells = np.ascontiguousarray(row[dofs], dtype=np.int32)
    if len(row) > len(web.points):
        start, end = (web.points[web.lines[:, side]] for side in (0, 1))
        points = np.empty((len(row), 3))
        points[cells] = start[line][:, None] + (place / pieces)[:, :, None] * (end - start)[line][:, None]
        points[: len(web.points)] = web.points

    slackness, smoothing = own["slackness"], own["smoothing"]
    r0 = np.sqrt(slackness**2 + 4.0 * smoothing**2)
    g0 = 2.0 * smoothing**2 / np.where(r0 > 0.0, r0 + slackness, 1.0)
    reference = web.points[web.lines[:, 1]] - web.points[web.lines[:, 0]]
    size = np.linalg.norm(reference, axis=1)
    data = [length, own["modulus"] * own["area"], slackness, smoothing, g0, r0]
    data += [*(reference[line] / pieces).T, size[line] / pieces]

    share = own["density"] * own["area"] * length
    at, weights = gauss(element.maxdeg + 1)  # exact for products of two functions
    functions = values(element, at)[0]
    lumped = np.atleast_1d(weights @ functions) if element.maxdeg > 1 else np.array([0.5, 0.5])
    mass = np.zeros(len(points))
    for a in range(cells.shape[1]):
        np.add.at(mass, cells[:, a], share * lumped[a])
    apart = np.einsum("q,qa,qb->ab", weights, functions, functions) - np.diag(lumped)
    return Net(
        web=web,
        law=cable.tension_law,
        points=points,
        mass=mass,
        cells=cells,
        line=line,
        line_data=np.ascontiguousarray(np.column_stack(data)),
        area=own["area"],
        strength=own["strength"],
        gradients=values(element, line_basis.X)[1],
        weights=line_basis.W,
        nodes=len(points),
        places=places,
        subdivide=pieces,
        quasi_static=quasi_static,
        cable_mass=float(mass.sum()),
        consistent_minus_lumped=share[:, None, None] * apart if consistent else None,
    )
