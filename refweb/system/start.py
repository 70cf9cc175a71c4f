"""Displacement and velocity at the start, from the effects and bodies of a system.

`System.laid` and `System.initial_velocity` alone call the two functions. May change: their insides. Must stay: their
names, argument and the shapes of results; effects, those of users too, bring ``lay(net, supported)`` and ``start(net,
supported, v)``; bodies write their rows last. Tests: ``tests/effects/test_velocity.py``, ``test_fold.py``.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np


def laid(system):
    """Displacement at the start [m], shape (rows, 3); None if the web starts in its position as built."""
    return next((e.lay(system.net, system.supported) for e in system.effects if hasattr(e, "lay")), None)


def initial_velocity(system):
    """Velocities at the start [m/s], shape (rows, 3), from effects, in the start position of the web, and bodies."""
    v, net = np.zeros((system.rows, 3)), system.net
    net = net if system.laid is None else replace(net, points=net.points + system.laid)
    for effect in system.effects:
        if hasattr(effect, "start"):
            effect.start(net, system.supported, v)
    for body in system.net.bodies:
        v[body.row] = body.velocity
        if body.spin is not None:
            v[body.spin] = body.start_spin
    return v
