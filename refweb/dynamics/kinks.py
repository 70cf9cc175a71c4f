"""Kinks of forces at which a motion stays, so that it has no derivative: lines at no strain, bodies that just touch.

A motion passes a kink within a step, which leaves an error of order 1 in the step. Where it stays at one, as a web at
rest whose lines are neither slack nor taut, a number that rises changes it otherwise than one that falls. Forces are
compared beside an instant, along its derivatives: their second difference goes as the step at a kink, elsewhere as its
square. Forces of lines are compared line by line, since those of two lines at a node may make up for each other.

May change: private functions, messages and `FELT`. Must stay: `kinks_of` and `text_of`, which `linear_run` calls;
`TOUCHING`, names of the terms of contact. Tests: ``tests/dynamics/test_dynamic_gradients.py``,
``tests/dynamics/test_gradient_jumps.py``.
"""

from __future__ import annotations

import numpy as np

from .responses import BENT, ROUNDED, step_of

FELT = 1e-6
"""Change of a force over the largest one below which it does not count."""
TOUCHING = ("contact", "self_contact")
"""Effects that act where something touches."""


def kinks_of(system, numbers, t, instant):
    """Kinks at an instant along the derivatives by some numbers, a set of (number, term, line element or row) each."""
    forces = Forces(system, t)
    return [set(forces.kinks(number, instant, n)) for n, number in enumerate(numbers)]


def text_of(system, kink):
    """A kink of `kinks_of` in words."""
    term, at = system.terms[kink[0]], kink[1]
    if term.over_lines:
        return f"line {system.net.line[at]} is neither slack nor taut, or at another corner of its law"
    name = system.row_name(at)
    return f"{name} just touches" if term.name in TOUCHING else f"the force of [{term.name}] on {name} has a kink"


class Forces:
    """Forces of terms at a time, of lines by element and node, shape (elements, nodes, 3), of others by row."""

    def __init__(self, system, t):
        self._system, self._t, self._outs = system, t, system.per_cell()

    def _force(self, n, system, x, v):
        term = system.terms[n]
        cells = term.cells
        if term.over_lines:
            cells = np.arange(cells.size, dtype=cells.dtype).reshape(cells.shape)
            x, v = x[term.cells.ravel()], v[term.cells.ravel()]
        force = np.zeros_like(x)
        term.force(self._t, x, v, force, cells, system.data_of(term, self._t), self._outs[n])
        return force.reshape(*cells.shape, 3) if term.over_lines else force

    def kinks(self, number, instant, n):
        """Pairs of a term and an element or row with a kink along the derivatives by a number, the n-th."""
        x, v, dx, dv = instant.x, instant.v, instant.dx[n], instant.dv[n]
        step, system = step_of(self._system, v, dx, dv), self._system

        def moved(term, share):
            return [self._force(term, system, x + s * step * dx, v + s * step * dv) for s in (-share, share)]

        def changed(term, share):
            return [self._force(term, beside, x, v) for beside in number.beside(share * number.step)]

        for term, acts in enumerate(system.terms):
            free = ~system.supported[acts.cells] if acts.over_lines else ~system.supported
            for ends, wanted in ((moved, step is not None), (changed, term in number.differing)):
                for at in self._bent(term, ends, free, x, v) if wanted else ():
                    yield term, int(at)

    def _bent(self, term, ends, free, x, v):
        """Elements or rows of which a term has a kink between two ends, which share the free unknowns."""
        force = self._force(term, self._system, x, v)
        low, high = ends(term, 1.0)
        first, second = (_largest(np.where(free, part, 0.0)) for part in (high - low, high + low - 2.0 * force))
        bent = (second > BENT * first) & (second > FELT * np.maximum(first, second).max(initial=0.0))
        bent &= second > ROUNDED * _largest(force)
        if not bent.any():
            return ()
        low, high = ends(term, 0.5)
        half = _largest(np.where(free, high + low - 2.0 * force, 0.0))
        return np.flatnonzero(bent & (np.abs(second - 2.0 * half) < 0.1 * second))


def _largest(forces):
    """Largest component of the force of each element or row."""
    return np.abs(forces).reshape(len(forces), -1).max(axis=1)
