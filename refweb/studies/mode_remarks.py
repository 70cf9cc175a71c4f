"""Remarks on natural frequencies: on each equilibrium, and on effects that the modes leave out."""

from __future__ import annotations

import numpy as np

from ..net.tension_laws import LINEAR
from ..results.state import floor_remark
from ..statics.remarks import remark_on_open
from .pencil import STRAIN


def remarks_on(spectrum_here, state, equilibrium):
    """Remarks on the modes of an equilibrium: pairs of a kind and a text."""
    net = state.system.net
    if spectrum_here.unstable:
        yield (
            "unstable",
            f"{spectrum_here.unstable} modes have ω² < 0, an imaginary frequency, written as negative: the equilibrium "
            "is a saddle and the web leaves it by itself",
        )
    if spectrum_here.zero:
        yield "zero", f"{spectrum_here.zero} directions have no stiffness: they have no frequency and are not listed"
    if text := remark_on_open(state, equilibrium):
        yield "slack", text
    kinked = (net.laws != LINEAR) & (net.line_data.smoothing == 0.0)
    if count := np.count_nonzero(kinked & (abs(state.element_strain - net.slackness) <= STRAIN)):
        yield "kink", f"{count} elements are between slack and taut, and count as taut: there no vibration is linear"
    for text in floor_remark(net, float(state.stress.max())):
        yield "floor", text


def left_out(system):
    """Effects that the modes of a system leave out."""
    if any(term.velocity.damping is not None and term not in system.rotating for term in system.terms):
        yield "forces that depend on velocity, such as damping, are left out"
    if free := [body.name for body in system.net.bodies if not body.fixed]:
        yield f"free bodies wait, and the web does not feel them: {', '.join(free)}"
