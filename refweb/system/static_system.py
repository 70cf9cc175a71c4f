"""The system of statics: free bodies are fixed, and forces that need velocity are left out."""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np

from ..errors import InputError


def at_rest(system):
    """A copy with free bodies fixed, without forces on them and terms that need velocity; or the system.

    Raises
    ------
    InputError
        For a line that is broken.
    """
    refuse_broken(system.net)
    waiting = [body.row for body in system.net.bodies if not body.fixed]
    if not waiting and all(term.timing.at_rest for term in system.terms):
        return system
    _ = system.library  # both say what factorizes for either
    rest = copy.copy(system)
    for kept in ("pattern", "unsupported_parts", "mass", "links", "carriers"):
        rest.__dict__.pop(kept, None)
    rest.supported = system.supported.copy()
    rest.supported[waiting] = True
    rest.supported[system.rows - system.net.spins :] = True
    if system.carriers:
        rest.carriers, rest.carried = system.carriers.waiting(system.net), np.zeros_like(system.carried)
    rest.terms = []
    for term in system.terms:
        if not term.timing.at_rest:
            continue
        felt = ~np.isin(term.cells, waiting).any(axis=1)
        if felt.all():
            rest.terms.append(term)
        elif felt.any():
            rest.terms.append(replace(term, cells=term.cells[felt], data=term.data[felt]))
    rest.arrange()
    return rest


def refuse_broken(net):
    """Refuse a net with broken lines, which statics does not take."""
    if len(net.broken):
        raise InputError(
            f"line {net.line[net.broken[0]]} is broken, and statics takes no broken lines: use [solve] "
            'kind = "dynamic" and start = "web", or leave the line out of the web'
        )
