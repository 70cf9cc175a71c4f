"""Values of broken elements: tension and strain 0, and their constant rupture energy.

Every system with broken elements has this term, also if they were broken in the initial web.

May change: how the kernels are written. Must stay: the column `HELD`, which `rupture` adds, `system.broken_lines`
writes and `results.folder` reads by its name; the name "rupture_energy", a column of ``history.csv``; EA = 0 as the
mark of a broken element, which `system.broken_lines` sets; `held_energy`, which `rupture` and `system.broken_lines`
import. Tests: ``tests/effects/test_rupture.py``.
"""

from __future__ import annotations

import functools

from ..compiled.rows import record_at
from ..errors import InputError
from ..kernels import ENERGY, FORCE, kernel
from .base import DAMPED_TENSION, LINE_OUT, Balance, ForceTerm, Timing
from .line_kernels import line_at

HELD = "rupture_energy"
"""Column of line data with the energy that a broken element had stored [J]."""


@functools.cache
def kernels(column):
    """Force and energy kernels; the rupture energy is in a ``column`` of the line data."""

    @kernel(FORCE)
    def force(t, x, v, f, cells, data, out):
        for c in range(cells.shape[0]):
            if line_at(data, c).ea == 0.0:
                shows = record_at(LINE_OUT, out, c, 0)
                shows.tension = shows.strain = 0.0
                if out.shape[1] > DAMPED_TENSION:
                    shows.damped_tension = 0.0

    @kernel(ENERGY)
    def energy(t, x, cells, data, out):
        for c in range(cells.shape[0]):
            out[c] = data[c, column]

    return force, energy


def held_energy(net):
    """The `ForceTerm` of the rupture energy of broken elements, with their tension and strain 0.

    Raises
    ------
    InputError
        For a consistent mass.
    """
    if net.consistent_minus_lumped is not None:
        raise InputError(
            'there is [solve] mass = "consistent", which ties the ends of a line together that breaks: it must be '
            '"lumped"'
        )
    force, energy = kernels(net.line_data.column(HELD))
    return ForceTerm(
        name="rupture",
        cells=net.cells,
        data=None,
        force=force,
        energy=energy,
        balance=Balance("rupture_energy", internal=True),
        timing=Timing(at_rest=False),
    )
