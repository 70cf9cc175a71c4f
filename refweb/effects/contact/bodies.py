"""Pairs of bodies that may touch each other, as terms of cells.

A cell is two bodies: the rows of both, and two rows of rotation of each. If a body has fewer rows of rotation, its
position row fills their columns and is not read. The skeleton of a sphere is one point with the whole thickness. It
determines the contact with another body, whose skeleton is then left out.

May change: `MORE`, the space for further contacts, upwards, and messages. Must stay: `force_terms`, which `table`
calls; the order in which `_pair` and `_side` write numbers, which is that of `BODIES`, `SIDE` and `pair`, read by
`body_body_detection`; the six rows of a cell and `FELT_BY_BOTH`, which counts them; `PER_PART`, the limit of contacts
in `contact_points`; the names "contact", as in `table`, and "body_contact_energy". Tests:
``tests/effects/test_between_bodies.py``.
"""

from __future__ import annotations

import itertools

import numpy as np

from ...compiled.rows import records_of, width_of
from ...errors import InputError
from ...net.skeleton import PART
from ..base import OWN, Balance, ContactForce, ForceTerm, Tangent, Timing, VelocityForce
from .body_body_detection import BODIES
from .pair import lever

PER_PART, MORE = 3, 1024
"""Largest number of contacts of a part of a skeleton on a convex body; space for further contacts if a body is not
convex."""
FELT_BY_BOTH = 1, 0
"""`ContactForce.felt` of two bodies."""


def pairs_of(net):
    """All pairs of bodies of a net that may touch: not two that nothing moves but tables."""
    return [(a, b) for a, b in itertools.combinations(net.bodies, 2) if not (a.prescribed and b.prescribed)]


def skeleton_of(body):
    """The skeleton of the shape of a body, or a refusal by name."""
    try:
        parts = body.shape.skeleton()
    except InputError as error:
        raise InputError(f'body "{body.name}": {error}') from None
    if parts is None:
        raise InputError(
            f'between_bodies = true: body "{body.name}" has a shape that says nothing of its edges and does not touch '
            "other bodies; leave between_bodies out, or give it another shape"
        )
    return parts


def force_terms(net, law_of):
    """The terms of all pairs of bodies of a net, of one kind each.

    ``law_of`` is a function of two bodies that returns (stiffness, exponent, damping, friction, slip velocity).
    """
    if not (pairs := pairs_of(net)):
        raise InputError(
            "between_bodies = true has no meaning here: it takes two bodies, one of them free; leave it out"
        )
    pressed, losing = {}, {}
    for a, b in pairs:
        law, depths = law_of(a, b), tuple(body.shape.depth() for body in (a, b))
        pressed.setdefault(depths, []).append((a, b, law))
        if law[2] > 0.0 or law[3] > 0.0:
            losing.setdefault(depths, []).append((a, b, law))
    terms = [_penalty(net, depths, group) for depths, group in pressed.items()]
    return terms + [_friction(net, depths, group) for depths, group in losing.items()]


def _penalty(net, depths, group):
    from .body_body_penalty import kernels, near

    force, energy, stiffness, bound = kernels(*depths)
    turns = any(body.turn is not None for a, b, _ in group for body in (a, b))
    return ForceTerm(
        **_shared(net, group),
        force=force,
        energy=energy,
        tangent=Tangent(stiffness, bound, symmetric=not turns),  # moments, and quaternions
        contact=ContactForce(FELT_BY_BOTH, tuple((a, b) for a, b, _ in group), near),
        balance=Balance("body_contact_energy", internal=True),
    )


def _friction(net, depths, group):
    from .body_body_friction import kernels

    force, stiffness, damping, implicit = kernels(*depths)
    shared = _shared(net, group)
    parts = records_of(BODIES, shared["data"])["sides"]["parts"].sum(axis=1)
    return ForceTerm(
        **shared,
        force=force,
        tangent=Tangent(stiffness, symmetric=False),
        velocity=VelocityForce(damping, implicit=implicit(int(parts.max()))),
        contact=ContactForce(FELT_BY_BOTH),
        balance=Balance("dissipated_energy", OWN, internal=True),
        timing=Timing(at_rest=False),
    )


def _shared(net, group) -> dict:
    """Common arguments of the `ForceTerm` of some pairs."""
    cells, data = zip(*(_pair(net, *pair) for pair in group), strict=True)
    rows = np.zeros((len(data), max(len(row) for row in data)))
    for row, values in zip(rows, data, strict=True):
        row[: len(values)] = values
    largest = records_of(BODIES, rows)["room"]
    largest[:] = largest.max()
    cells = np.array(cells, dtype=np.int32)
    return dict(name="contact", cells=cells, data=rows)


def _pair(net, first, second, law):
    """(rows, numbers) of two bodies."""
    skeletons = [skeleton_of(body) for body in (first, second)]
    points = [len(parts) == 1 and body.shape.once for parts, body in zip(skeletons, (first, second), strict=True)]
    if points[0] or points[1]:
        skeletons[0 if points[1] and not points[0] else 1] = np.zeros(0, PART)
    rows, sides, begin = [first.row, second.row], [], width_of(BODIES)
    grown = [max(parts["thickness"], default=0.0) for parts in reversed(skeletons)]
    for body, parts, more in zip((first, second), skeletons, grown, strict=True):
        spins = [row for row in (body.spin, body.turn) if row is not None]
        rows += (spins + [body.row, body.row])[:2]
        sides.append(_side(body, len(spins), law, len(parts), begin, more))
        begin += parts.size * width_of(PART)
    convex = all(getattr(body.shape.depth(), "convex", True) for body in (first, second))
    size = 1 + PER_PART * sum(len(parts) for parts in skeletons) + (0 if convex else MORE)
    numbers = [
        [size],
        net.points[first.row] - net.points[second.row],
        *sides,
        *(parts.view(float) for parts in skeletons),
    ]
    return rows, np.concatenate(numbers)


def _side(body, spins, law, parts, begin, more):
    """Data of one body of a pair for `refweb.effects.contact.body_body_detection`; the other is ``more`` thick."""
    (radius, core, round_, *field), (stiffness, *losses) = body.shape.touched(more), law
    mobility = body.mobility[np.triu_indices(3)] if spins == 2 else (1.0, 0.0, 0.0, 1.0, 0.0, 1.0)
    longest = lever(body) if spins == 2 else body.radius  # √(I (y × g)·J⁻¹(y × g)) of any point y, at most [m]
    numbers = [*body.axes.ravel(), *body.offset, spins, body.shape.planar, *mobility, longest, body.extent]
    numbers += [not body.prescribed, body.thickness, parts, begin]
    pair = [body.shape.extent, stiffness, *np.zeros(6), *losses, radius, *core, round_, False, False]
    pair += [*np.eye(3).ravel(), *field]
    return np.array([*numbers, *pair], dtype=float)
