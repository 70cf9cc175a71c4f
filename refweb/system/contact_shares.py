"""Contact of lines with spheres in which several elements of a line share the push.

Contact with a sphere acts once a line, at the element that comes deepest, so that its energy is the largest of those of
the elements, max e_c. With shares α_c ≥ 0 that add up to 1 the energy is Σ α_c e_c and the force Σ α_c f_c, as of
elements that each have a contact of stiffness α_c k.

May change: how `shareable` finds terms (`law_between` marks the effect `effects.contact.table.Contact`). Must stay:
`STIFFNESS` is a column of `effects.contact.pair.SPHERE`; the order of shares, cell by cell of the terms in the order of
`System.terms`: `statics.shared_push` makes them, `results.folder` writes them to checkpoints as ``contact_shares``,
`solution` and `dynamics.initial_state` read them back, and `statics.contact_kinks` cuts them by the order of
`sharing_terms`; `with_shares`, which `solution`, `statics.equilibrium` and `statics.contact_kinks` call; `shareable`
and `shared`, which `statics.shared_push` calls. Tests: ``tests/statics/test_contact_kinks.py``.
"""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np

from ..compiled.rows import column_of
from ..effects.contact.pair import SPHERE

STIFFNESS = column_of(SPHERE, "stiffness")
"""Column of the stiffness in the data of such terms."""


def sharing_terms(system):
    """Numbers of the terms of contact with spheres, a list; empty where lines have one element."""
    once = [body.row for body in system.net.bodies if body.shape.once]
    if system.net.subdivide == 1 or not once:
        return []
    contacts = [(n, term) for n, term in enumerate(system.terms) if term.contact.with_lines and term.energy is not None]
    return [number for number, term in contacts if np.isin(term.cells[:, term.contact.felt[0]], once).any()]


def shareable(system):
    """The `sharing_terms` with a contact once an element in place of once a line, a dict by number."""
    net, by_element = system.net, {}
    for effect in system.effects:
        if hasattr(effect, "law_between"):
            terms = effect.on(replace(net, subdivide=1))
            by_element = {term.force: alone for term, alone in zip(effect.on(net), terms, strict=True)}
    terms = {}
    for number in sharing_terms(system):
        term = system.terms[number]
        alone = by_element[term.force]
        terms[number] = replace(term, force=alone.force, energy=alone.energy, tangent=alone.tangent)
    return terms


def with_shares(system, shares):
    """The system with the ``shares`` of all cells of its `shareable` terms, one after another, shape (cells,)."""
    changed, begin = copy.copy(system), 0
    changed.terms, changed.contact_shares = list(system.terms), shares
    for number, term in shareable(system).items():
        end = begin + len(term.cells)
        changed.terms[number] = replace(term, data=shared(term.data, shares[begin:end]))
        begin = end
    return changed


def shared(data, shares):
    """Data of cells whose stiffness is that of their shares."""
    data = data.copy()
    data[:, STIFFNESS] *= shares
    return data
