"""Lines that yield under loading in which none turns back: the system of their curve, whose errors are proven.

As long as a line that yields is not let go, its tension is a function of strain that rises: E ε up to the yield stress,
then along the slope of hardening over the elastic and the plastic strain together (Hencky's deformation theory). So the
equilibrium is that of lines with a curve, whatever the path has been, and `refweb.statics.duality_bound` proves it. It
has no bound where a line yields without hardening, since its tension then tells nothing of its strain.

May change: `CLOSE` and the insides of other functions than `pieces_of`. Must stay: `turned_back` finds each line that
was let go, else a bound is wrong; functions that `equilibrium` and `gradients` call. `of_curves`
drops cached properties of `System` by the names in `KEPT_BY_LINES`: a new one that follows from terms or numbers of
lines belongs there. Must stay as well: numbers of a piece by position as those of `net.laws.curve` (`WIDTH`), whose
kernels read them at the address in `Table.columns`, and the array in ``kept`` of the net, which keeps it alive; the
name "plastic" of the terms that `of_curves` leaves out and the columns ``plastic_strain_…`` and ``plastic_force_…``,
all of `effects.plastic`; strains of corners, the same in `pieces_of` and `corners_of`; `add_bounds`, which
`equilibrium` imports; `corners_of`, which `gradients` imports. Tests:
``tests/statics/test_monotone_loading.py``.
"""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np

from ..effects import plastic
from ..effects.base import with_numbers
from ..effects.elasticity import Elasticity
from ..net.laws.curve import WIDTH, Table
from .duality_bound import duality_bound
from .floating import between_slack_lines

KEPT_BY_LINES = (
    "pattern", "carriers", "mass", "unsupported_parts", "lengths", "material_flow", "links", "contact_forces"
)  # fmt: skip
"""Cached properties of a system that follow from its terms or from the numbers of its lines."""
CLOSE = 1e-8
"""Plastic strain over the strain at yield by which a line counts as not let go: equilibria differ by rounding."""


def add_bounds(system, state, factor=None):
    """Add ``duality_bound`` and ``floating`` to an equilibrium, if its errors can be proven.

    Parameters
    ----------
    system : refweb.system.system.System
        The system at rest, with lines that yield.
    state : refweb.statics.equilibrium.Equilibrium
        Its state, with the plastic strains of the load step before.
    factor : refweb.system.factorization.Factor, optional
        See `refweb.statics.duality_bound.duality_bound`.
    """
    if system.net.factors or turned_back(system, state.step, state.x) or not (system := of_curves(system)).convex:
        return
    bound = duality_bound(system, state, factor)
    if all(np.isfinite(errors).all() for errors in (bound.tension, bound.strain, bound.strain_energy)):
        state.duality_bound = bound
        state.floating = between_slack_lines(system, state)


def turned_back(system, t, x):
    """Tell if a line has been let go: it has yielded more than its strain asks for."""
    net, x = system.at(t).net, system.taken_on(t, x)
    reached = plastic.plastic_strain(net, x)
    asked = plastic.plastic_strain(net, with_numbers(net, x, np.zeros((len(net.cells), 0))))
    margin = CLOSE * plastic.strain_at(net, reached.max(axis=1))
    return bool((reached - asked > margin[:, None])[net.law_is("plastic")].any())


def of_curves(system):
    """The system whose lines have a curve in place of yield."""
    net, changed = system.net, copy.copy(system)
    yields, pieces = net.law_is("plastic"), pieces_of(net)
    addresses = pieces.ctypes.data + pieces[0].nbytes * np.arange(len(pieces))
    for name, values in zip(Table.columns, (addresses, pieces.shape[1], np.inf), strict=True):
        known = name in net.line_data.dtype.names
        net = replace(net, line_data=net.line_data.copy()) if known else net.with_column(name, 0.0)
        net.line_data[name][:] = np.where(yields, values, net.line_data[name])
    laws = tuple(Table if law.plastic else law for law in net.laws)
    changed.net = net = replace(net, laws=laws, kept=(*net.kept, pieces), length_force=None)
    rest = [term for term in system.terms if term.name != "plastic" and term is not system.lines]
    changed.terms = [Elasticity().on(net), *rest]
    for known in KEPT_BY_LINES:
        changed.__dict__.pop(known, None)
    changed.arrange()
    return changed


def pieces_of(net):
    """Pieces of the curve of each element as those of `refweb.net.laws.curve.Curve`, shape (elements, points, WIDTH).

    The first is elastic, the others are those of the points of the yield stress.
    """
    numbers, points = net.line_data, plastic.corners(net)
    ea = numbers.ea
    strain, force = (np.array([numbers[f"plastic_{kind}_{i}"] for i in range(points)]) for kind in ("strain", "force"))
    slope = np.diff(force, axis=0) / np.diff(strain, axis=0)
    begin, share = strain + force / ea, force / ea
    pieces = np.zeros((len(ea), points, WIDTH))
    pieces[:, 0, 2] = 1.0
    pieces[:, 1:, 0], pieces[:, 1:, 1], pieces[:, 1:, 2] = begin[:-1].T, share[:-1].T, (slope / (ea + slope)).T
    energy = np.cumsum(0.5 * (share[1:] + share[:-1]) * np.diff(begin, axis=0), axis=0)
    pieces[:, 1:, 5] = (0.5 * share[0] ** 2 + np.vstack([np.zeros(len(ea)), energy[:-1]])).T
    return pieces


def corners_of(net):
    """Strains of the corners of the curve of each element, very large where it does not yield, (elements, points)."""
    numbers = net.line_data
    names = [(f"plastic_strain_{i}", f"plastic_force_{i}") for i in range(plastic.corners(net))]
    return np.array([numbers[strain] + numbers[force] / numbers.ea for strain, force in names]).T
