"""The lines of a net as bars: a straight line is one bar, a curved line has a bar at each quadrature point.

May change: how the arrays are computed. Must stay: names, units and meaning of all attributes and methods of `Bars`:
`duality_bound` proves errors by them, `newton`, `floating` and `thread_bars`, which derives from it, use them. Bars
stand in the order of `refweb.net.net.Net.bars`. Tests: ``tests/statics/test_statics.py``,
``test_reused_factorization.py``.
"""

from __future__ import annotations

import numpy as np

from ..effects.elasticity import strains
from ..kernels import kernel
from ..net.laws.law import evaluate


class Bars:
    """State of the bars of a net at a displacement: arrays over them.

    Their laws are convex: that of tension alone, with no length in place of the natural one that of a force density,
    and curved ones, which kernels evaluate.

    Parameters
    ----------
    net : refweb.net.net.Net
        The net.
    x : ndarray, shape (rows, 3)
        The displacement [m].

    Attributes
    ----------
    natural, unstressed, stiffness : ndarray, shape (bars,)
        Natural length [m], length up to which the bar is slack [m], and EA over the natural length [N/m], the largest
        stiffness.
    length, tension, tangent : ndarray, shape (bars,)
        Length [m], tension [N] and, where it is taut, its slope over length [N/m].
    curved : ndarray of int
        Bars whose law is a curve.
    direction : ndarray, shape (bars, 3)
        Unit vectors, 0 of a bar without length.
    matrix : csr_array, shape (bars, rows)
        `refweb.net.net.Net.bars`.
    """

    def __init__(self, net, x):
        self.matrix = net.bars
        axial = net.per_bar(net.line_data.ea)
        self._net, self.natural = net, net.bar_lengths
        self.stiffness = axial / self.natural
        vector = net.bar_vectors(x)
        self.length = np.linalg.norm(vector, axis=1)
        strain, slackness = strains(net, x).ravel(), net.per_bar(net.slackness)
        forming = net.per_bar(net.forming)
        self.unstressed = np.where(forming, 0.0, self.natural * (1.0 + slackness))
        self.tension = axial * np.maximum(strain + forming, 0.0)
        self._stretch = np.where(forming, self.length, self.natural * strain)
        self._strain = np.where(forming, 0.0, strain - slackness)  # neither slack nor taut
        self.direction = vector / np.where(self.length > 0, self.length, 1.0)[:, None]
        self.tangent = self.stiffness
        self.curved = np.flatnonzero(net.per_bar(~(net.law_is("cone") | net.forming)))
        if len(self.curved):
            self._lines, curved = net.line_data[net.per_bar(np.arange(len(net.cells)))[self.curved]], self.curved
            self.strain, self.tangent = strain[curved], self.tangent.copy()
            self.tension[curved] = self.evaluated("stress", self.strain)
            self.tangent[curved] = self.evaluated("tangent", self.strain) / self.natural[curved]

    @property
    def energy(self):
        """Strain energy of each bar [J], shape (bars,)."""
        energy = 0.5 * self.tension**2 / self.stiffness
        if len(self.curved):
            energy[self.curved] = self.natural[self.curved] * self.evaluated("energy_density", self.strain)
        return energy

    first = np.zeros(0, dtype=int)
    """First bar of each thread, behind those of the lines."""

    def shared(self, stretch):
        """Change of force [N] by stretches of other bars [m]: none."""
        return 0.0

    def stretched(self, parts, size):
        """Parts of the bars in the duality gap along themselves [J], for forces of that ``size`` [N]."""
        return parts

    def evaluated(self, which, strain):
        """A kernel of the laws by name at strains of the curved bars."""
        return evaluate(getattr(self._net.law, which), strain, self._lines, self._net.law.columns)

    def strain_of(self, tension):
        """Strains of the curved bars at tensions [N]; of no tension that up to which they are slack."""
        strain, index = self._lines.slackness.copy(), self._net.per_bar(self._net.law_index)[self.curved]
        for number, law in enumerate(self._net.laws):
            lines = (index == number) & (tension > 0.0)
            strain[lines] = law.strain_of(tension[lines], self._lines[lines])
        return strain

    def ahead(self, change):
        """Tensions to first order in a change of the displacement, of shape (rows, 3) [m]; none is negative [N]."""
        along = ((self._net.bars @ change) * self.direction).sum(axis=1)
        tension = np.maximum(self.stiffness * (self._stretch + along), 0.0)
        if len(self.curved):
            tension[self.curved] = self.evaluated("stress", self.strain + (along / self.natural)[self.curved])
        return tension

    def lent(self, share):
        """Fictitious stiffness of slack bars [N/m], by a smooth law: η is ``share`` of the mean strain of taut bars."""
        slack, taut = self._strain < 0.0, self._strain > 0.0
        width = share * self._strain[taut].mean() if taut.any() else 0.0
        if not (width > 0.0 and slack.any()):
            return np.zeros_like(self._strain)
        root = np.sqrt(self._strain**2 + 4.0 * width**2)
        return np.where(slack, self.stiffness * 2.0 * width**2 / ((root + abs(self._strain)) * root), 0.0)

    def besides(self, tension, along):
        """Change of the stiffness across the bars by other tensions, plus a stiffness ``along`` the bars.

        A block per element, shape (cells, 3 nodes, 3 nodes).
        """
        net = self._net
        across = (tension - self.tension) / np.where(self.length > 0, self.length, 1.0)
        size = 3 * net.gradients.shape[1]
        blocks = np.zeros((len(net.cells), size, size))
        _add_bars(across, along, self.direction, net.weights[:, None] * net.gradients, blocks)
        return blocks


@kernel()
def _add_bars(across, along, direction, shares, blocks):
    """Add stiffness [N/m] across and along the direction of each bar, whose vector has ``shares`` of its nodes."""
    points, nodes = shares.shape
    for c in range(blocks.shape[0]):
        for q in range(points):
            n = c * points + q
            for a in range(nodes):
                for b in range(nodes):
                    share = shares[q, a] * shares[q, b]
                    d, e = share * across[n], share * (along[n] - across[n])
                    for i in range(3):
                        for j in range(3):
                            blocks[c, 3 * a + i, 3 * b + j] += e * direction[n, i] * direction[n, j]
                        blocks[c, 3 * a + i, 3 * b + i] += d
