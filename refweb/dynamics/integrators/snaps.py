"""Lines that snap taut in a step: jumps of the derivatives of velocities where the damping force of a line jumps.

A line with a damping time τ that passes its slackness ε0 from below has the damping force N = τ σ'(ε) ε̇ [N] at once,
at a time t* that changes with a number p: by δt* = −δg/ġ of the gap g = ε − ε0. So the derivatives of velocities jump
by M⁻¹ ΔF δg/ġ, with ΔF the jump of the force: the saltation of an event, R. I. Leine and H. Nijmeijer, "Dynamics and
Bifurcations of Non-Smooth Mechanical Systems", Springer 2004. ΔF is along the line and in proportion to ġ,
which falls out: the node at the end of the line has the impulse

    −τ Δσ' δg t,        t the direction of the line, Δσ' the jump of the slope of its law [N].

This is the limit of refined steps. The derivative of the steps themselves does not have it, since a small change of p
moves t* into no other step. At a line that goes slack and at a contact nothing jumps: the force of the line has come
to 0 before, and that of a contact, with its losses, begins at 0.

At a corner of a table of a motion or reel a line may come to its slackness and be no tauter behind it. It is damped for
numbers of one side alone, so that the motion has no derivative.

A law whose slope changes over a strain that is short against that of a step is one with a jump; the curvature at both
ends of the step gives the part of Δσ' that is in the steps.

May change: private functions, and constants, which decide what counts as a jump. Must stay: public names of `Snaps`,
which `tangent` and `linear_run` use; `Shift`, which `gradients` makes; `gaps_of`, which `dynamics.parameters` calls,
and `is_damped`, which `gradients` and `tangent` call as well. Tests: ``tests/dynamics/test_dynamic_gradients.py``,
``tests/dynamics/test_gradient_jumps.py``.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...net.laws.law import evaluate

JUMP = 0.1
"""Change over EA of the slope of a law that a step does not resolve, from which on it is a jump."""
AT_CORNER = 1e-12
"""Distance from the slackness, in strain, up to which a line is neither slack nor taut."""
BESIDE = 1e-9
"""Distance from the slackness, in strain, at which slopes of a law are those on either side of it."""
MOVED = 1e-6
"""Change of this distance over that of a number, over its size, from which on it counts; below it is rounding."""
SOON = 1e-3
"""Time behind a corner of a table, over a step, at which a line is taut that passes its slackness there."""


def strains_of(system, t, x):
    """Strain of each straight element of a system, without cancellation, shape (elements,)."""
    lines, (a, b) = system.line_data(t), system.net.cells.T
    moved, natural = x[b] - x[a], lines.natural_length
    length = np.linalg.norm(lines.reference + moved, axis=1)
    square = ((2.0 * lines.reference + moved) * moved).sum(axis=1)
    return (square + (lines.distance - natural) * (lines.distance + natural)) / (natural * (length + natural))


def gaps_of(system, t, x):
    """Strain of each element of a system above its slackness, shape (elements,)."""
    return strains_of(system, t, x) - system.line_data(t).slackness


def is_damped(system):
    """Tell if lines of a system have a damping time."""
    return "damping_time" in (system.net.line_data.dtype.names or ())


class Shift:
    """Change of the derivative by a number where each snap comes a step later; it is followed as one by a number.

    A run has a snap at the end of a step, and the error of its derivatives is in proportion to the time from the snap
    to this end. A shift has the attributes of a `refweb.dynamics.parameters.Parameter` on which nothing depends.

    Parameters
    ----------
    system : refweb.system.system.System
        The system.
    number : refweb.dynamics.parameters.Parameter
        The number.
    """

    def __init__(self, system, number):
        self.size, self.step, self.differing = number.size, number.step, ()
        self.systems, self.start = (system, system), np.zeros_like(number.start)

    def beside(self, step):
        """Systems with a value below and above."""
        return self.systems

    def add_rate(self, t, x, v, f, inverse, rate):
        """Add nothing to accelerations."""

    def driven(self, t, at, rows):
        """Derivatives of prescribed positions and velocities."""
        return np.zeros((2, len(rows), 3))


class Snaps:
    """Jumps of derivatives by some numbers, where lines with a damping time snap taut.

    Parameters
    ----------
    system : refweb.system.system.System
        The system, of straight elements.
    numbers : sequence of refweb.dynamics.parameters.Parameter
        The numbers p.
    x, v : ndarray, shape (rows, 3)
        State at t = 0.
    dx : ndarray, shape (p, rows, 3)
        Derivatives of x.

    Attributes
    ----------
    kinks : dict of int to (float, str)
        Time [s] from which on there is no derivative, and text, of the first line that snaps taut for numbers of one
        side alone, by the index of the number.
    delays : ndarray, shape (p, snaps)
        δt* of lines that snapped taut in the last step [s per unit of the number].
    """

    def __init__(self, system, numbers, x, v, dx):
        self._system, self._numbers, self._cells, self._law = system, numbers, system.net.cells, system.net.law
        self.kinks, self.delays = {}, np.zeros((len(numbers), 0))
        self._known: Any = self._of(0.0, x)
        at = self._at_slackness(0.0)
        changes, (rates,) = self._changes(0.0, x, dx, at, True)[0], self._changes(0.0, x, v[None], at, False)[0]
        self._add_kinks(0.0, 0.0, at[rates > 0.0], changes[:, rates > 0.0])

    def _at_slackness(self, t):
        """Indices of elements between slack and taut, with a free node, of which the slope of the law jumps."""
        lines, supported = self._system.line_data(t), self._system.supported
        at = np.flatnonzero(np.abs(self._known[0] - lines.slackness) <= AT_CORNER)
        if not at.size:
            return at
        below, above = (
            evaluate(self._law.tangent, lines.slackness + s * BESIDE, lines, self._law.columns) for s in (-1.0, 1.0)
        )
        free = ~supported[self._cells[at]].reshape(len(at), -1).all(axis=1)
        return at[free & ((above - below)[at] > JUMP * lines.ea[at])]

    def _add_kinks(self, since, t, at, changes):
        """Add for each number the kink of the first of some elements whose gap at a time t it changes."""
        for n, number in enumerate(self._numbers):
            for e in at[np.abs(changes[n]) * number.size > MOVED][:1]:
                text = f"at {t:.4g} s line {self._system.net.line[e]} is neither slack nor taut"
                self.kinks.setdefault(n, (since, f"{text}, and its damping force jumps"))

    def _find_kinks(self, t, h, x, v, dx, grown):
        """Note lines that are at their slackness at a corner of a table, and taut on one side of it alone."""
        at, soon = self._at_slackness(t), SOON * h
        rates = np.array([grown[at] / h, gaps_of(self._system, t + soon, x + soon * v)[at] / soon])
        at = at[(rates.max(axis=0) > 0.0) & (rates.min(axis=0) <= MOVED * np.abs(rates).max(axis=0))]
        self._add_kinks(t - h, t, at, self._changes(t, x, dx, at, True)[0])

    def _of(self, t, x):
        """Strain, and slope and curvature of the law [N], of each element."""
        strain, lines = strains_of(self._system, t, x), self._system.line_data(t)
        slopes = [evaluate(part, strain, lines, self._law.columns) for part in (self._law.tangent, self._law.curvature)]
        return strain, *slopes

    def _changes(self, t, x, moves, at, explicit):
        """Changes of g of some elements by moves of nodes, and by numbers where ``explicit``; and directions."""
        (a, b), lines = self._cells[at].T, self._system.line_data(t)
        pull = lines.reference[at] + x[b] - x[a]
        to = pull / np.linalg.norm(pull, axis=1)[:, None]
        changes = ((moves[:, b] - moves[:, a]) * to).sum(axis=2) / lines.natural_length[at]
        numbers: Any = self._numbers if explicit else ()
        for number, change in zip(numbers, changes, strict=False):
            low, high = (gaps_of(beside, t, x)[at] for beside in number.systems)
            change += (high - low) / (2.0 * number.step)
        return changes, to

    def add(self, t, h, x, v, dx, dv, inverse, corner):
        """Add what a step h to the time t, which ends at x and v, jumps to its derivatives ``dv``.

        At a ``corner`` of a table v is behind it.
        """
        (before, slope, bend), lines = self._known, self._system.line_data(t)
        self._known = self._of(t, x)
        strain, jump = self._known[0], self._known[1] - slope
        grown = strain - before
        if corner:
            self._find_kinks(t, h, x, v, dx, grown)
        jump -= 0.5 * (bend + self._known[2]) * grown
        at = np.flatnonzero((grown > 0.0) & (np.abs(jump) > JUMP * lines.ea))
        left = h * np.clip((strain[at] - lines.slackness[at]) / grown[at], 0.0, 1.0)
        changes, to = self._changes(t, x, dx, at, len(at) > 0)
        changes -= left * self._changes(t, x, dv, at, False)[0]
        self.delays = -changes * h / grown[at]
        impulses = (lines.damping_time[at] * jump[at] * changes)[:, :, None] * to
        for change, impulse in zip(dv, impulses, strict=True):
            total = np.zeros_like(change)
            for side, sign in zip(self._cells[at].T, (1.0, -1.0), strict=True):
                np.add.at(total, side, sign * impulse)
            change += inverse * total
