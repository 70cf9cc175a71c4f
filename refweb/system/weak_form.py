"""The tangent of lines as a weak form of scikit-fem: readable documentation of the compiled kernels.

Position x(s) ∈ R³ over natural arc length s, λ = |x'|, t = x'/λ, tension T(λ − 1). The form is the derivative of the
internal virtual work ∫ T t·δx' ds. No run evaluates it: the compiled kernels of `refweb.effects.elasticity` compute the
same in 2 % of the time, and a test compares both.

May change: all, since no run imports this file. Must stay: the result of `tangent_matrix`, the tangent of
`refweb.effects.elasticity` to rounding, with which ``tests/net/test_elements.py`` compares it.
"""

from __future__ import annotations

import numpy as np
import skfem
from scipy.sparse import coo_array
from skfem.helpers import dot

from ..net.discretisation import basis
from ..net.elements import line_element
from ..net.tension_laws import Law


def tangent_of(law):
    """The tangent of a `refweb.net.tension_laws.Law`, an `skfem.BilinearForm` at the position field ``x``."""

    @skfem.BilinearForm
    def tangent(u, v, w):
        """∫ [T' (t·δx')(t·dx') + T/λ (δx'·dx' − (t·δx')(t·dx'))] ds."""
        along, du, dv = w.x.grad[:, 0], u.grad[:, 0], v.grad[:, 0]
        stretch = np.sqrt(dot(along, along))
        t, strain = along / stretch, stretch - 1.0
        tension = law.stress(strain, w.ea, w.slackness, w.smoothing)
        stiffness = law.tangent(strain, w.ea, w.slackness, w.smoothing)
        stretching = dot(t, du) * dot(t, dv)
        return stiffness * stretching + tension / stretch * (dot(du, dv) - stretching)

    return tangent


def tangent_matrix(net, x):
    """The tangent of the lines of a net at a displacement.

    Parameters
    ----------
    net : refweb.net.net.Net
        A net of lines of one law.
    x : ndarray, shape (rows, 3)
        Displacements [m].

    Returns
    -------
    scipy.sparse.csr_array, shape (3 rows, 3 rows)
        Of component 3 row + axis [N/m].
    """
    element = skfem.ElementLineP1() if net.order == 1 else line_element(net.order)
    lines = basis(net.points, net.cells[:, :2], net.natural_length, skfem.ElementVector(element, 3))
    component = np.zeros(lines.N, dtype=int)
    component[lines.element_dofs.T] = (3 * net.cells[:, :, None] + np.arange(3)).reshape(len(net.cells), -1)
    numbers = {name: net.line_data[name][:, None] for name in ("ea", "slackness", "smoothing")}
    position = lines.interpolate((net.points + x).ravel()[component])
    matrix = tangent_of(Law(net.law.name)).assemble(lines, x=position, **numbers).tocoo()
    size = 3 * len(net.points)
    return coo_array((matrix.data, (component[matrix.row], component[matrix.col])), shape=(size, size)).tocsr()
