"""Penetration check of lines with bodies.

A line can only pass through a body by its middle, where the push changes its direction. All methods check the depth of
every line, see `refweb.effects.contact.line_body_ccd`. Explicit methods do so before each drift, in which nodes and
bodies move in straight lines; CVODE and IDA use their interpolants. If no line has reached the middle of a body since
the start of a run, it is proven that nothing has passed. A line in the core at the start is refused.

The middle of a mesh is that of its field, see `refweb.net.boundary.field`. Walls that are thinner than nearly all of
the surface are not checked.

May change: other words of messages. Must stay: texts of `status`, which stand in ``run.json``; the entries of a row of
``crossings``, which `record` reads, and the same without its time for `would_pass`, which
`integrators.central_difference` calls; `BodyPassage`, which `dynamics.simulation` imports. Tests:
``tests/effects/test_passage.py``.
"""

from __future__ import annotations

import numpy as np

from ...findings import Finding


def named(system, met):
    """'line 1 ... body "a"', of what has met: a line by its nodes, and a body by its row."""
    net = system.net
    return net.line_between(met[:2]), next(body for body in net.bodies if body.row == met[2])


def would_pass(system, met):
    """Message that a line would come to the middle of a body in any step."""
    line, body = named(system, met)
    return (
        f'line {line} would come to the middle of body "{body.name}", {body.thickness:.3g} m below its surface: use a '
        "slower motion or a thicker body"
    )


class BodyPassage:
    """Record of lines that may have passed through bodies.

    Parameters
    ----------
    system : refweb.system.system.System
        With contact.
    """

    def __init__(self, system):
        self._system, self._met = system, np.full(5, np.inf)
        self._followed = any(term.contact.passing is not None for term in system.terms)

    def record(self, met):
        """Record the first crossing, a row of `refweb.dynamics.integrators.integrator.IntegratorState.crossings`."""
        self._met = met

    def status(self):
        """Status as in ``run.json``: "certified", or the reason for doubt."""
        if not self._followed:
            return "not certified: curved elements are not followed"
        time, *met = self._met
        if not np.isfinite(time):
            return "certified"
        line, body = named(self._system, met)
        return (
            f'not certified: line {line} came to the middle of body "{body.name}", where it may pass, at t = '
            f"{time:.6g} s"
        )

    def remarks(self):
        """Remarks for a reader of the results."""
        if np.isfinite(self._met[0]):
            yield Finding("passage-in-doubt", f"lines may have passed through bodies, {self.status()}", "contact")
