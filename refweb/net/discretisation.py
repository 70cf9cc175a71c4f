"""A web cut into nodal line elements over natural arc length.

A cable is a curve x(s) ∈ R³ over its natural arc length s. scikit-fem knows such an element once the mapping's metric
is the natural length: `NaturalLength` has DF = detDF = L and invDF = 1/L, so that ``grad(u)`` of an
``ElementVector(ElementLineP1(), 3)`` is du/ds, and branching, closed and prestressed nets need nothing extra. From the
`skfem.Basis` the dofs, the quadrature and the reference derivatives dN/dξ are kept. The compiled kernels fill the
values of the tangent on the pattern of these dofs; `refweb.system.weak_form` has it as a form of scikit-fem. Explicit
steps assemble no matrix, and take what they need of straight elements from `refweb.net.elements`.

A line of the web is ``subdivide`` elements of ``order`` 1, 2 or 3, each with as many Gauss points as its order. That is
the least quadrature with which no motion of an element but a rigid one is free of strain, and it keeps the orders of
the elements: on the elastic catenary L2 errors fall with order p + 1 and nodal errors with 2p, those of frequencies
with 2p for either mass. A Gauss point is then a bar of its own, of length w L; see `refweb.net.net.Net.bars`.

The integrand has a kink where a line goes slack inside an element. Its quadrature is then of order 2 for any p, and
orders above 1 lose their advantage. In a cable that is knocked together L2 errors fall with orders 2.0, 3.0 and 4.0 for
p = 1, 2 and 3 while all of it is taut, and with 2.0, 1.1 and 1.0 once its middle is slack: nodes of a slack element fly
on by themselves, with velocities that several points going slack one after another leave wrong by ~ h. With 160 nodes
the errors of p = 2 and 3 are still an eighth of that of p = 1, with 1000 nodes all three are alike. The strain jumps
where a slack part is pulled taut, and no order exceeds 1.

May change: how arrays are filled. Must stay: rows of the web's nodes first, then those inside lines, line by line,
since files, checkpoints and observables count so; elements of a line one after another; the order of `line_data.FIELDS`
in `_line_data`; fields of `Net`; no import of scikit-fem for explicit steps (``tests/test_pay_for_what_you_call.py``);
`build`, which `build` and `threads` import; `basis`, which `system.weak_form` imports. Tests:
``tests/net/test_elements.py``, ``tests/system/test_orders.py``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..registry import SHIPPED
from .elements import gauss, line_element, lumped_shares, values
from .laws.line_data import LineData, offsets
from .net import Net
from .tension_laws import law_of, names_in


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


def _numbered(dofs, line, position, nodes):
    """Row of each dof: the web's nodes keep their number, the others follow line by line and along each line."""
    count = max(dofs.max() + 1, nodes)
    of_line, along = np.empty(count, dtype=np.int64), np.empty(count)
    of_line[dofs], along[dofs] = line[:, None], position
    added = nodes + np.lexsort((along[nodes:], of_line[nodes:]))
    row = np.arange(count)
    row[added] = np.arange(nodes, count)
    return row


class Elements(NamedTuple):
    """Elements into which the lines of a web are divided.

    Attributes
    ----------
    points : ndarray, shape (rows, 3)
        Positions of all nodes [m].
    cells : ndarray of int32, shape (cells, nodes per cell)
        Nodes of each element, ends first.
    line : ndarray of int32, shape (cells,)
        Line of the web that each belongs to.
    places, gradients, weights : ndarray
        ξ of the nodes of an element, dN/dξ by quadrature point and node, and weights of the points.
    """

    points: np.ndarray
    cells: np.ndarray
    line: np.ndarray
    places: np.ndarray
    gradients: np.ndarray
    weights: np.ndarray


def _elements(web, element, pieces, length, explicit):
    """The `Elements` of a web, each line in equal pieces of these natural lengths [m]."""
    line = np.repeat(np.arange(len(web.lines), dtype=np.int32), pieces)
    points, ends = _divided(web, pieces)
    if element.maxdeg == 1 and explicit:
        places, weights = gauss(1)
        cells = np.array(ends, dtype=np.int32, order="C")
        return Elements(points, cells, line, element.doflocs[:, 0], values(element, places)[1], weights)
    line_basis = basis(points, ends, length, element if element.maxdeg > 1 else None)
    dofs, places = line_basis.element_dofs.T, element.doflocs[:, 0]
    position = np.tile(np.arange(pieces), len(web.lines))[:, None] + places
    row = _numbered(dofs, line, position, len(web.points))
    cells = np.ascontiguousarray(row[dofs], dtype=np.int32)
    if len(row) > len(web.points):
        start, end = (web.points[web.lines[:, side]] for side in (0, 1))
        points = np.empty((len(row), 3))
        points[cells] = start[line][:, None] + (position / pieces)[:, :, None] * (end - start)[line][:, None]
        points[: len(web.points)] = web.points
    return Elements(points, cells, line, places, values(element, line_basis.X)[1], line_basis.W)


def _line_data(web, line, pieces, length, values):
    """The `LineData` of elements, from the properties of each."""
    slackness, smoothing = values["slackness"], values["smoothing"]
    reference = web.points[web.lines[:, 1]] - web.points[web.lines[:, 0]]
    size = np.linalg.norm(reference, axis=1)
    laws = length, values["modulus"] * values["area"], slackness, smoothing, *offsets(slackness, smoothing)
    return LineData.of([*laws, reference[line] / pieces, size[line] / pieces])


def _masses(element, cells, share, rows, consistent):
    """Lumped mass of each row, and consistent less lumped mass of each element or None; ``share`` is its mass."""
    mass, lumped = np.zeros(rows), lumped_shares(element)
    for a in range(cells.shape[1]):
        np.add.at(mass, cells[:, a], share * lumped[a])
    if not consistent:
        return mass, None
    at, weights = gauss(element.maxdeg + 1)  # exact for products of two functions
    functions = values(element, at)[0]
    apart = np.einsum("q,qa,qb->ab", weights, functions, functions) - np.diag(lumped)
    return mass, share[:, None, None] * apart


def build(web, cable, quasi_static=False, consistent=False, explicit=False):
    """The `refweb.net.net.Net` of a web made of a cable.

    Parameters
    ----------
    web : refweb.net.web.Web
        Nodes and lines.
    cable : refweb.net.cable.Cable
        Material, order and subdivision.
    quasi_static : bool
        True if time is the load step of statics.
    consistent : bool
        True if mass is consistent, ∫ρA N_a N_b ds, and not lumped to ∫ρA N_a ds.
    explicit : bool
        True if no matrix is assembled, so that straight elements do without scikit-fem.
    """
    given, pieces, element = cable.properties(web, quasi_static), cable.subdivide, line_element(cable.order)
    laws = names_in(given["law"])
    values = {name: np.repeat(value, pieces) for name, value in given.items()}
    length = values["natural_length"] / pieces
    cut = _elements(web, element, pieces, length, explicit)
    share = values["density"] * values["area"] * length
    allowed = values["knot_factor"] / values["safety_factor"]
    mass, apart = _masses(element, cut.cells, share, len(cut.points), consistent)
    net = Net(
        web=web,
        laws=tuple(map(law_of, laws)),
        points=cut.points,
        mass=mass,
        element_mass=share,
        cells=cut.cells,
        line=cut.line,
        line_data=_line_data(web, cut.line, pieces, length, values),
        area=values["area"],
        strength=values["strength"],
        gradients=cut.gradients,
        weights=cut.weights,
        nodes=len(cut.points),
        places=cut.places,
        subdivide=pieces,
        quasi_static=quasi_static,
        cable_mass=float(mass.sum()),
        consistent_minus_lumped=apart,
        allowed_share=None if (allowed == 1.0).all() else allowed,
        kept=tuple(dict.fromkeys(curve for curve in given.get("curve", ()) if curve is not None)),
    )
    return _with_laws(net, values)


def _with_laws(net, values):
    """The net with the columns of its laws, and of the number of its law for each element where there are several."""
    law_index = np.zeros(len(net.cells))
    for number, law in enumerate(net.laws):
        elements = values["law"] == law.name
        law_index[elements] = number
        of_law = law.numbers({key: value[elements] for key, value in values.items()})
        for name, column in of_law.items():
            if name not in net.line_data.dtype.names:
                net = net.with_column(name, 0.0)
            net.line_data[name][elements] = column
        if law.name not in SHIPPED["law"]:
            from .laws.consistency import refuse_inconsistent

            refuse_inconsistent(law, net.line_data[elements], net.line[elements])
    return net if len(net.laws) == 1 else net.with_column("law", law_index)
