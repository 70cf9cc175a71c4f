"""``method = "auto"``: choice of the dynamic method of a scene, with the reason.

Links and nodes without mass need IDA; curved elements and a consistent mass need CVODE. All other scenes use an
explicit method if the motion needs short steps. Waves need them; contact, initial velocities and starts out of
equilibrium cause waves. A compiled step, of 1e-6 s and 12e-9 s per element, is then about a hundred times cheaper than
a step of CVODE. If only tables move a web from its equilibrium, BDF takes steps as long as the motion allows. Adams
methods do so if damping ends the waves and shortens explicit steps. CPU times for three digits of the displacement of
the centre, from ``validation/methods/work_precision.py``:

=========================================  ===================  =========  ===========  ========
scene                                      central differences  CVODE BDF  CVODE Adams  IDA
=========================================  ===================  =========  ===========  ========
ball on a square web of 180 lines          0.02 s               over 1 s   0.8 s        over 1 s
steel cable that swings                    0.01 s               over 1 s   over 1 s     over 1 s
taut steel net, loaded over 8 s            1.3 s                0.11 s     over 5 s     0.14 s
web that settles, damped by its material   3.2 s                1.0 s      0.67 s       1.2 s
=========================================  ===================  =========  ===========  ========

May change: constants, which are measured, and words of reasons: another choice changes digits of a result within its ±.
Must stay: `decided`, `Choice`, `given_to`, `TURNING` and `step_price`, which `method_fallback`, `expected_cost`,
`studies` and ``refweb check`` use; a chosen method takes the scene. Reasons stand in ``run.json``. Tests:
``tests/dynamics/test_fallback.py``, ``tests/studies/test_cost.py``.
"""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..registry import INTEGRATORS, load
from ..settings import Dynamic

USUAL_DIGITS = 3
"""Default number of digits."""
DIGITS_OF_ORDER_6 = 5
"""Digits from which order 6 is cheaper than order 2."""
DIGITS_OF_ADAMS = 8
"""Digits from which Adams methods are cheaper than order 2, if order 6 does not take the forces. Central differences
take √10 times the steps for each digit. On webs with a load that has a factor, they take 0.01 s for 6 digits; Adams
methods take 0.3 s for 9 digits."""
PER_STEP, PER_ELEMENT, PER_CELL = 1e-6, 12e-9, 8e-9
"""CPU time of a compiled explicit step, of each element in it, and of each cell of other force terms [s]."""
PER_TOUCH, PER_RUB = 5e-8, 3e-7
"""CPU time of an element in contact with a body in a step, without and with friction [s]."""
STEP_OF_CVODE = 100.0
"""Explicit steps that cost as much as one step of CVODE, which takes at least one step to each corner of a table."""
QUICK_RUN = 0.5
"""CPU time of an explicit run [s] below which no other method is tried."""
TURNING = ("frame", "orbit")
"""Names of terms whose forces by velocity are Coriolis forces."""
DAMPED_BY = 5.0
"""Factor by which damping shortens explicit steps, above which another method is used."""


class Choice(NamedTuple):
    """The `refweb.Dynamic` in place of ``method = "auto"``, and the reason as text."""

    solve: Dynamic
    reason: str


def decided(scene, system):
    """The `Choice` for a scene."""
    net, digits = system.net, _digits(scene)
    bare = np.flatnonzero((net.mass <= 0.0) & ~system.supported.all(axis=1))
    if system.constraints:
        return Choice(given_to(scene, "ida"), "only ida holds the lengths of [[link]]")
    if len(bare):
        return Choice(given_to(scene, "ida"), f"node {bare[0]} has no mass, which only ida takes")
    family = "adams" if digits >= DIGITS_OF_ORDER_6 else "bdf"
    if net.order > 1 or net.consistent_minus_lumped is not None:
        what = f"order {net.order}" if net.order > 1 else "a consistent mass"
        return Choice(given_to(scene, "cvode", family=family), f"{what} is not for explicit steps")
    bound = _bound(system)
    corners = np.searchsorted(system.corners, scene.solve.duration)
    steps = max(scene.solve.duration / (0.5 * bound), float(corners))
    seconds = steps * step_price(system)
    price = f"{steps:.3g} explicit steps, some {seconds:.2g} s of CPU time"
    if listed := [term.name for term in system.terms if term.contact.finder is not None]:
        why = f"[{listed[0]}] finds its pairs as they come near, which explicit steps alone take: {price}"
        return Choice(given_to(scene, "central-difference"), why)
    damped, slow = _damped(system, bound), seconds > QUICK_RUN and steps > STEP_OF_CVODE * corners
    if slow and damped > DAMPED_BY:
        shorter = f"explicit steps {damped:.3g} times shorter ({price})"
        if any(term.velocity.bound is not None and term.name not in TURNING for term in system.terms):
            why = f"damping makes {shorter}, and ends the waves they would follow"
        else:
            why = f"Coriolis forces make {shorter}"
        return Choice(given_to(scene, "cvode", family="adams"), why)
    if slow and _quiet(scene, system):
        why = f"only tables over time move it from its equilibrium, without waves that would need {price}"
        return Choice(given_to(scene, "cvode", family="bdf"), why)
    if digits >= DIGITS_OF_ORDER_6:
        try:
            load(INTEGRATORS["explicit"].integrator)(system)
            why = f"{digits} digits, and forces of displacement alone and dead loads: {price}"
            return Choice(given_to(scene, "explicit"), why)
        except InputError:
            if digits >= DIGITS_OF_ADAMS:
                why = f"{digits} digits, and forces that no explicit step of order 6 takes"
                return Choice(given_to(scene, "cvode", family="adams"), why)
    return Choice(given_to(scene, "central-difference"), price)


def _undamped(system):
    """The system without the bounds of damping."""
    calm = copy.copy(system)
    calm.terms = [replace(term, velocity=term.velocity._replace(bound=None)) for term in system.terms]
    return calm


def step_price(system, touched=False):
    """Expected CPU time of an explicit step of one evaluation of forces [s]; ``touched`` if all elements have contact.

    If forces depend on velocity, a step is iterated; it takes more iterations if damping reduces the bound more.
    """
    others = sum(len(term.cells) for term in system.terms if not term.over_lines)
    price = PER_STEP + PER_ELEMENT * len(system.net.cells) + PER_CELL * others
    if touched:
        price += sum(
            len(f.cells) * (PER_TOUCH if f.velocity.implicit is None else PER_RUB)
            for f in system.terms
            if f.contact.with_lines
        )
    damped = any(term.velocity.damping is not None and term.velocity.implicit is None for term in system.terms)
    if damped:
        price *= 1.0 + min(_damped(system, _bound(system)), 7.0)
    return price


def _damped(system, bound):
    """Factor by which damping reduces the critical time step."""
    return _bound(_undamped(system)) / bound


def given_to(scene, method, **keys):
    """The `refweb.Dynamic` of a scene with a method, at a tolerance for its digits."""
    solve, keys = scene.solve, {"method": method, **keys}
    if INTEGRATORS[method].knob == "rtol":
        keys["rtol"] = max(10.0 ** -(_digits(scene) + 1), 1e-12)
    return Dynamic(duration=solve.duration, mass=solve.mass, start=solve.start, **keys)


def _digits(scene):
    return scene.accuracy.digits or USUAL_DIGITS


def _bound(system):
    return load(INTEGRATORS["central-difference"].integrator)(system).bound()


def _quiet(scene, system):
    """Tell if no body, velocity or lack of equilibrium causes waves."""
    return scene.solve.start == "equilibrium" and not system.contact and not system.initial_velocity().any()
