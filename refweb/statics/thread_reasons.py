"""Reasons why a net with threads may have no equilibrium: a load that pulls a thread through, or rings together.

May change: `ABOUT`, the order of reasons and their words. Must stay: name and arguments of `reason_of`, which
`equilibrium.with_reason` calls where an iteration has failed. No number of a result depends on this file. Tests:
``tests/effects/test_thread.py``, ``test_thread_friction.py``, ``test_winch.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..net.threads import NEAR, coincident_nodes

ABOUT = 0.3
"""As `NEAR`, of an end with the smaller load: iterations jump about where a thread runs out."""

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..net.threads import ThreadLine
    from ..system.system import System


def reason_of(system: System, t: float, x: NDArray[np.float64], tangents: bool) -> str | None:
    """Text of the reason by the displacement at which an iteration ended, (rows, 3) [m]; None without one.

    ``t`` is the load step, and ``tangents`` is True for Newton's method.
    """
    threads = system.net.threads
    for thread in threads:
        for end, ring in ((0, 1), (-1, -2)) if not (thread.closed or thread.winch) else ():
            near = ABOUT if _is_lighter(system, t, thread, end) else NEAR
            if not system.supported[thread.rows[end]].all() and (at := _pulled_to(system, thread, x, end, ring, near)):
                rubs = any(thread.friction)
                return (
                    f"{thread.title} slides until its end, node {thread.rows[end]}, is {at}: the load at node "
                    f"{thread.rows[-1 - end]} is more than that end{' and friction' if rubs else ''} can hold; lower "
                    f"it, or {'raise friction' if rubs else 'support the end'}"
                )
    if (together := coincident_nodes(system.net, x, system.supported)) is not None:
        way_out = ', or try method = "relaxation"' if tangents else ""
        if any(any(thread.friction) for thread in threads):
            way_out = "; or rings slip where nothing holds both sides of them: raise friction or lower loads"
        return f"{together}{way_out}"
    if any(numbers[0] > 0.0 for numbers in system.net.winches):  # at a tension
        return "a winch pulls in all that is not held against its tension: lower its tension, or give it a speed"
    return None


def _is_lighter(system, t, thread: ThreadLine, end):
    """True if outer forces alone load both ends, which nothing else holds, and this one less than the other."""
    ends = thread.rows[[end, -1 - end]]
    if system.supported[ends].any() or np.isin(ends, system.net.cells).any():
        return False
    light, heavy = np.linalg.norm(system.outer_force(t)[ends], axis=1)
    return light < heavy


def _pulled_to(system, thread: ThreadLine, x, end, ring, near):
    """Words that say where an end of a thread has been pulled to, its next ring or body; "" where it is clear.

    ``near`` is the largest distance from there that counts as none, over the length of the thread or the radius of the
    body.
    """
    position = system.net.points + x
    node, segment = position[thread.rows[end]], 0 if end == 0 else len(thread.distances) - 1
    for wrap in thread.wraps:
        if wrap.segment == segment:
            body = system.net.body_of(wrap.body)
            away = node - position[body.row]
            if type(body.shape).__name__ != "Sphere":
                away = away - (away @ body.axes[2]) * body.axes[2]
            return f'at body "{body.name}"' if np.linalg.norm(away) < body.shape.radius * (1.0 + near) else ""
    at = thread.rows[ring]
    close = len(thread.rows) > 2 and np.linalg.norm(node - position[at]) < near * thread.natural_length
    return f"at node {at}" if close else ""
