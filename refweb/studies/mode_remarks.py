"""Findings on natural frequencies: on each equilibrium, and on effects that the modes leave out.

May change: texts. Must stay: codes of findings, which stand in `refweb.findings.CODES`; `remarks_on` and `left_out`,
which `modes` calls. Tests: ``tests/studies/test_modes.py``.
"""

from __future__ import annotations

import numpy as np

from ..findings import Finding
from ..results.state import floor_remark
from ..statics.remarks import remark_on_open
from ..system.static_system import waiting
from .pencil import STRAIN


def remarks_on(computed, state, equilibrium):
    """Findings on the modes of an equilibrium."""
    net = state.system.net
    if computed.unstable:
        yield Finding(
            "unstable",
            f"{computed.unstable} modes have ω² < 0, an imaginary frequency, written as negative: the equilibrium "
            "is a saddle and the web leaves it by itself",
        )
    if computed.zero:
        text = f"{computed.zero} directions have no stiffness: they have no frequency and are not listed"
        yield Finding("no-stiffness", text)
    yield from remark_on_open(state, equilibrium)
    kinked = ~net.law_is("bar") & (net.line_data.smoothing == 0.0)
    if count := np.count_nonzero(kinked & (abs(state.element_strain - net.slackness) <= STRAIN)):
        text = f"{count} elements are between slack and taut, and count as taut: there no vibration is linear"
        yield Finding("kink", text)
    yield from floor_remark(net, float(state.stress.max()))


def left_out(system):
    """Effects that the modes of a system leave out."""
    frames = [term.name for term in system.rotating]
    if any(term.velocity.damping is not None and term.name not in frames for term in system.terms):
        yield Finding("left-out", "forces that depend on velocity, such as damping, are left out")
    if names := [body.name for body in waiting(system)]:
        which = "bodies that move at the start or touch nothing are held, and the web does not feel"
        yield Finding("left-out", f"{which} them: {', '.join(names)}", "body")
