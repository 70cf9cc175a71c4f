"""A system as statics sees it."""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np


def at_rest(system):
    """A copy in which free bodies are held and feel nothing, and what needs velocity is left out; or the system."""
    waiting = [body.row for body in system.net.bodies if not body.fixed]
    if not waiting and all(family.at_rest for family in system.families):
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
    rest.families = []
    for family in system.families:
        if not family.at_rest:
            continue
        felt = ~np.isin(family.cells, waiting).any(axis=1)
        if felt.all():
            rest.families.append(family)
        elif felt.any():
            rest.families.append(replace(family, cells=family.cells[felt], data=family.data[felt]))
    rest.arrange()
    return rest
