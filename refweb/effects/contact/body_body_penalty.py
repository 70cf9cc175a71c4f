"""Penalty of contact between two bodies, as compiled kernels.

The contacts, their energy and forces are those of `refweb.effects.contact.body_body_detection`. A force F at the point
y of a body is F on its row and the moment y × F on that of its rotation, y from its row. Tangents of all forces between
two bodies are differences of these forces, of order 2. Only iterations of implicit methods use them; results do not
depend on them. With steps of `STEP` of the size of the bodies their errors are some 1e-9 of the largest entry.

May change: `STEP` and `FARTHEST`; `INWARD` and `CURVED` upwards alone, since the bound may be too large and never too
small. Must stay: one energy from which force and bound follow; that the bound covers damping and friction, whose term
has none; `force_of` and `slopes_of`, which `body_body_friction` calls, and the order of what `kernels` returns, which
`bodies` unpacks; `push`, which `body_body_friction` imports; `near`, which `bodies` imports. Tests:
``tests/effects/test_between_bodies.py``.
"""

from __future__ import annotations

import functools
import math

import numpy as np

from ...compiled.rows import record_at
from ...kernels import BOUND, ENERGY, FORCE, NEAR, STIFFNESS, kernel
from ..base import TOUCH
from ..vectors import cross, dot
from .body_body_detection import apart, law_of, meeting, side_of, vector
from .pair import power_of_depth
from .penalty import SHALLOW, slope_of_power

STEP = 1e-6
"""Step of differences, over the size of the smaller body; also the step for quaternions."""
FARTHEST = 1e6
"""Largest distance that is checked ahead [m]: nearer bodies may touch, at most to a depth of half a body."""
INWARD = 1.6
"""Bound on the largest eigenvalue of the stiffness of a contact that moves along a part, over that of a fixed
contact."""
CURVED = 1.2
"""Factor on this bound for curvature and for forces on lever arms."""


@kernel()
def push(law, weight, depth):
    """k W δ^p of a contact [N]."""
    return law.stiffness * weight * power_of_depth(law.exponent, depth)


@kernel()
def add_push(f, cells, data, c, contact, size):
    """Push two bodies apart at a contact, by ``size`` times G."""
    g = vector(contact.normal)
    for s in range(2):
        force = -size if s == 0 else size
        for k in range(3):
            f[cells[c, s], k] += force * g[k]
        if side_of(data, c, s).spins == 2.0:
            moment = cross(vector(contact.points[s]), g)
            for k in range(3):
                f[cells[c, 2 + 2 * s], k] += force * moment[k]


@functools.cache
def force_of(space_of, add_forces):
    """Kernel of the forces of all pairs, see `slopes_of`; each shows what ``add_forces`` returns."""

    @kernel(FORCE)
    def force(t, x, v, f, cells, data, out):
        space = space_of(data)
        for c in range(cells.shape[0]):
            touch = record_at(TOUCH, out, c, 0)
            touch.value, force = add_forces(x, v, f, cells, data, c, space)
            for k in range(3):
                touch.force[k] = force[k]

    return force


@functools.cache
def slopes_of(space_of, add_forces):
    """Kernel that writes −∂f/∂x, or −∂f/∂v, of pairs by differences.

    Parameters
    ----------
    space_of : kernel
        Makes the working space of the other kernel.
    add_forces : kernel
        ``(x, v, f, cells, data, c, space)``: adds the forces of a pair to f.
    """

    @kernel()
    def slopes(x, v, blocks, cells, data, moving):
        space, x6, v6 = space_of(data), np.zeros((6, 3)), np.zeros((6, 3))
        indices, ahead, behind = np.empty((1, 6), dtype=np.int32), np.empty((6, 3)), np.empty((6, 3))
        for k in range(6):
            indices[0, k] = k
        blocks[:] = 0.0
        for c in range(cells.shape[0]):
            for r in range(6):
                for k in range(3):
                    x6[r, k], v6[r, k] = x[cells[c, r], k], v[cells[c, r], k]
            numbers, size = data[c : c + 1], min(side_of(data, c, 0).thick, side_of(data, c, 1).thick)
            varied = v6 if moving else x6
            for r in range(6):
                spins = 2.0 if r < 2 else side_of(data, c, (r - 2) // 2).spins
                if spins == 0.0 or (spins == 1.0 and (r % 2 == 1 or not moving)) or (moving and r in (3, 5)):
                    continue
                step = STEP * (min(size, 1.0) if r < 2 else 1.0)
                for k in range(3):
                    was = varied[r, k]
                    ahead[:], behind[:] = 0.0, 0.0
                    varied[r, k] = was + step
                    add_forces(x6, v6, ahead, indices, numbers, 0, space)
                    varied[r, k] = was - step
                    add_forces(x6, v6, behind, indices, numbers, 0, space)
                    varied[r, k] = was
                    for i in range(6):
                        for j in range(3):
                            blocks[c, 3 * i + j, 3 * r + k] = (behind[i, j] - ahead[i, j]) / (2.0 * step)

    return slopes


@kernel()
def share_of(data, c, s, mass, cells):
    """(1/√m, lever/√I) of a body; 0 of one that does not move."""
    side = side_of(data, c, s)
    if side.free == 0.0:
        return 0.0, 0.0
    turns = side.spins > (0.0 if law_of(data, c).friction > 0.0 else 1.0)
    turned = side.lever / math.sqrt(mass[cells[c, 2 + 2 * s]]) if turns else 0.0
    return 1.0 / math.sqrt(mass[cells[c, s]]), turned


@kernel()
def add_rates(rates, steep, speed, mass, cells, data, c):
    """Add row sums of the stiffness ``steep`` of all contacts of a pair, each unknown scaled by the root of its mass.

    Half the bound are steps of a tenth of the thickness of a body, so that nothing passes through between two.
    """
    thick = min(side_of(data, c, 0).thick, side_of(data, c, 1).thick)
    (p, q), (r, s) = share_of(data, c, 0, mass, cells), share_of(data, c, 1, mass, cells)
    total = p + q + r + s
    for side in range(2):
        lever, turned, b = p if side == 0 else r, q if side == 0 else s, cells[c, side]
        if lever > 0.0:
            rates[b] = max(rates[b] + steep * total / lever, (10.0 * speed / thick) ** 2 * mass[b])
        if turned > 0.0:
            rates[cells[c, 2 + 2 * side]] += steep * total * turned * mass[cells[c, 2 + 2 * side]]


@kernel(NEAR)
def near(skin, x, cells, data, chosen):
    count = 0
    for c in range(cells.shape[0]):
        away, reach = apart(x, cells, data, c), side_of(data, c, 0).extent + side_of(data, c, 1).extent + skin
        if not dot(away, away) >= reach * reach:  # what is not a number is near
            chosen[count] = c
            count += 1
    return count


@functools.cache
def kernels(first, second):
    """Force, energy, stiffness and bound of pairs of bodies with two depths."""
    space_of, detect = meeting(first, second)

    @kernel()
    def add_forces(x, v, f, cells, data, c, space):
        """Add the forces of a pair; how deep it is [m], and the force on the second body [N]."""
        deepest, felt, law = 0.0, (0.0, 0.0, 0.0), law_of(data, c)
        count = detect(0.0, x, cells, data, c, space)
        for n in range(count):
            contact = space.contacts[n]
            size, g = push(law, contact.weight, contact.depth), contact.normal
            deepest = max(deepest, contact.depth)
            felt = felt[0] + size * g[0], felt[1] + size * g[1], felt[2] + size * g[2]
            add_push(f, cells, data, c, contact, size)
        if count == space.contacts.shape[0]:  # there is no room for all: the run is to end
            f[cells[c, 0], 0] = math.nan
        return deepest, felt

    slopes, force = slopes_of(space_of, add_forces), force_of(space_of, add_forces)

    @kernel(ENERGY)
    def energy(t, x, cells, data, out):
        space = space_of(data)
        for c in range(cells.shape[0]):
            law, out[c] = law_of(data, c), 0.0
            for n in range(detect(0.0, x, cells, data, c, space)):
                contact = space.contacts[n]
                out[c] += push(law, contact.weight, contact.depth) * contact.depth / (law.exponent + 1.0)

    @kernel(STIFFNESS)
    def stiffness(t, x, v, blocks, cells, data, definite):
        if not definite:
            slopes(x, v, blocks, cells, data, False)
            return
        space = space_of(data)
        blocks[:] = 0.0
        for c in range(cells.shape[0]):  # of places alone
            law = law_of(data, c)
            for n in range(detect(0.0, x, cells, data, c, space)):
                contact = space.contacts[n]
                g, weight = contact.normal, max(contact.weight, 0.0)
                steep = law.stiffness * weight * slope_of_power(law.exponent, contact.depth)
                for i in range(3):
                    for j in range(3):
                        value = steep * g[i] * g[j]
                        blocks[c, i, j] += value
                        blocks[c, 3 + i, 3 + j] += value
                        blocks[c, i, 3 + j] -= value
                        blocks[c, 3 + i, j] -= value

    @kernel(BOUND)
    def bound(reach, speed, x, mass, rates, cells, data):
        space = space_of(data)
        for c in range(cells.shape[0]):
            law, steep = law_of(data, c), 0.0
            thick = min(side_of(data, c, 0).thick, side_of(data, c, 1).thick)
            for n in range(detect(min(reach, FARTHEST), x, cells, data, c, space)):
                contact = space.contacts[n]
                steepness = law.stiffness * slope_of_power(law.exponent, min(contact.depth, thick))
                steep += CURVED * steepness * (INWARD if contact.inner != 0.0 else 1.0)
            steep *= 1.0 + law.friction + SHALLOW * law.damping * speed * (1.0 + law.friction)
            if steep > 0.0:
                add_rates(rates, steep, speed, mass, cells, data, c)

    return force, energy, stiffness, bound
