"""Explicit dynamics of higher order: symmetric Runge–Kutta–Nyström splittings in the loop of central differences.

A step is a symmetric sequence of kicks b h f/m and drifts a h v. It is of order 4 or 6 if forces depend on displacement
alone and are smooth. A kink of the force, at a contact or when a line goes slack, reduces the order of its step. The
splittings are symplectic, so that energy does not drift, and they conserve momenta to rounding. Extremes are searched
at four times in a step, and, between these, on a polynomial of degree 5. An oscillator has them to 6e-10 with safety
0.5; values with a kink have them to order 2.

Dead loads and motion may follow tables of time: steps end at the corners of these, and between them time is a
coordinate that goes with the drifts, in which a force is taken where its drifts have come to, and what is moved at a
constant velocity has come to its place. The work of motion is that of the forces in each kick; that of loads is what
their potential loses in each drift, taken at the time that the kicks have come to, see
`refweb.dynamics.integrators.energy_balance.book_potential`.

The coefficients are those of S. Blanes and P. C. Moan [1]_. On the square web of the paper, thrown by its centre
(smooth law, η = 1e-4, 0.05 s), errors of any displacement and evaluations of forces are

======================================  =====================================================
central differences, 0.9 of the bound   1.3e-6 m for 511
order 4, 6 stages, 0.9, 0.6, 0.4        6.2e-9, 9.5e-10, 1.6e-10 m for 1933, 2899, 4351
order 6, 11 stages, 0.9, 0.6, 0.4       6.2e-11, 5.4e-12, 4.7e-13 m for 3576, 5358, 8031
order 6, 9 stages, Kahan and Li         6.0e-8, 7.8e-9, 6.6e-10 m for 3628, 5437, 8146
order 8, 17 stages, Kahan and Li        3.4e-9, 1.2e-10, 4.6e-12 m for 5594, 8399, 12581
DOP853, rtol = 1e-4, 1e-6, 1e-8, 1e-10  5.6e-8, 1.7e-9, 1.6e-11, 2.0e-13 m for 1673, 3365, 5657, 9113
======================================  =====================================================

Order 8 is not included, since it needs more evaluations than order 6 for errors down to 1e-13 m. In CPU time DOP853
with the same forces takes 1.9 to 3 times as long as order 4 or 6 for errors of 1e-7 to 1e-11 m, by
``validation/methods/work_precision.py``.

May change: words of refusals. Must stay: coefficients, as published, and the keys of `KICKS` and `DRIFTS`, which are
the values of ``order`` in scenes: `settings.Dynamic` checks them, and its help has them in words. All else is that of
`CentralDifference`, whose ``kicks``, ``drifts``, ``stretch`` and `_keys` it sets. Tests:
``tests/dynamics/integrators/test_nystrom.py``.

References
----------
.. [1] S. Blanes, P. C. Moan, "Practical symplectic partitioned Runge–Kutta and Runge–Kutta–Nyström methods", J. Comput.
   Appl. Math. 142 (2002) 313–330, doi:10.1016/S0377-0427(01)00492-7.
"""

from __future__ import annotations

import functools

import numpy as np

from ...errors import InputError
from .central_difference import CentralDifference
from .integrator import Variant

KICKS = {
    4: (0.0829844064174052, 0.396309801498368, -0.0390563049223486),
    6: (0.0414649985182624, 0.198128671918067, -0.0400061921041533, 0.0752539843015807, -0.0115113874206879),
}
DRIFTS = {
    4: (0.245298957184271, 0.604872665711080),
    6: (0.123229775946271, 0.290553797799558, -0.127049212625417, -0.246331761062075, 0.357208872795928),
}
"""Independent coefficients by order; sums of 1 and symmetry give the others."""


def splitting(order):
    """(kicks, drifts) of a step."""
    b, a = list(KICKS[order]), list(DRIFTS[order])
    if order == 4:  # an even number of drifts
        a.append(0.5 - sum(a))
        return np.array([*b, 1.0 - 2.0 * sum(b), *b[::-1]]), np.array([*a, *a[::-1]])
    b.append(0.5 - sum(b))
    return np.array([*b, *b[::-1]]), np.array([*a, 1.0 - 2.0 * sum(a), *a[::-1]])


def stability(kicks, drifts):
    """ωh up to which an oscillator stays bounded, by the trace of its step.

    As 2 cos ωh of the motion itself, the trace comes to −2 near π, and passes it in a narrow resonance; this is where
    that begins, though longer steps may be stable again.
    """
    for at in np.arange(1, 8001) * 1e-3:
        step = np.eye(2)
        for i, kick in enumerate(kicks):
            step[1] -= kick * at * at * step[0]
            if i < len(drifts):
                step[0] += drifts[i] * step[1]
        if abs(np.trace(step)) > 2.0 + 1e-9:
            return at - 1e-3
    raise ArithmeticError("no bound of stability below 8")


@functools.cache
def _stretch(order):
    """Bound of stability of an order over that of central differences."""
    return 0.5 * stability(*splitting(order))


class Splitting(CentralDifference):
    """Runge–Kutta–Nyström splittings on one system.

    Parameters
    ----------
    system, probes, sums, events, safety, step_size, finer
        See `refweb.dynamics.integrators.central_difference.CentralDifference`; ``safety`` is a share of a bound of its
        own.
    order : {4, 6}
        Order of the error of a smooth motion in the step.

    Raises
    ------
    InputError
        As central differences, and for forces that depend on velocity or, but for dead loads, on time.
    """

    method = "explicit"
    variants = {
        f"explicit-{order}": Variant({"order": order}, (0.9, 0.6, 0.4, 0.25, 0.15), "splitting") for order in KICKS
    }

    def __init__(self, system, *observed, order=6, **steps):
        for term in system.terms:
            if internal := term.elements.internal:
                raise InputError(
                    f'[solve] method = "explicit" takes no {internal.title}: steps of order above 2 go back in '
                    'time as well, where what relaxes would grow; use "central-difference" or "cvode"'
                )
            timed = term.balance.power is not None or len(term.timing.times) > 0
            if term.velocity.damping is not None or timed and not term.dead:
                given = " with damping or friction" if term.name in ("contact", "self_contact") else ""
                raise InputError(
                    f'[solve] method = "explicit" takes no [{term.name}]{given}, nothing that depends on velocity, '
                    'and of time dead loads alone: use "central-difference" or "cvode"'
                )
        if system.net.factors:
            raise InputError(
                '[solve] method = "explicit" takes no [[reel]] and [temperature]: use "central-difference" or "cvode"'
            )
        self.order, (self.kicks, self.drifts) = order, splitting(order)
        self.stretch = _stretch(order)
        super().__init__(system, *observed, **steps)

    @property
    def _keys(self):
        return {**super()._keys, "order": self.order}
