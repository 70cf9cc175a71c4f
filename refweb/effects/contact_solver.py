"""Implicit contacts: friction, damping and drag, solved contact by contact within a kick of an explicit method.

A kick of size h does not change positions. It changes velocities from v⁻ to v⁺, and the impulses of contacts depend on
both. With the relative velocity u = J v of a contact, its force F(u) of `refweb.effects.contact.friction` and all other
forces f,

    v⁺ = v⁻ + h M⁻¹(f + Σ Jᵀ F(u_θ)),        u_θ = (1 − θ) u⁻ + θ u⁺.

Friction below its slip velocity is very stiff, so that these equations are implicit. They are coupled, since contacts
share nodes and bodies. A Gauss–Seidel sweep solves one contact after the other with the latest forces of all others,
and the next sweep runs in reverse order, as in [1]_. A single contact has a solution in closed form up to one number.
Along the normal, u = b + θ h w F is piecewise linear. In the tangent plane, axes are chosen along which J M⁻¹ Jᵀ has no
mixed term. With Z_i = θ h w_i μ N, the size r = √(|u_t|² + v_s²) is the root of

    v_s²/r² + Σ b_i²/(r + Z_i)² = 1,

whose left side decreases and is convex, so that Newton's method on its inverse root converges from below.

θ is ½ if a kick hardly changes the slip, which makes steps of order 2. It tends to 1 if the contact sticks, so that the
slip vanishes instead of changing its sign. θ(z) = 1/(1 − e⁻ᶻ) − 1/z is exact for a force −z u/h w. It differs from ½ by
z/12, which is of order h and keeps order 2. All forces change the kinetic energy in a kick by h times their power at v
= ½ (v⁻ + v⁺). The energy balance uses this power, so that it closes even if sweeps have not converged. If this power
would be positive at a contact, whose slip changes its direction within the kick, θ is ½ there: F(u)·u is never
positive.

All kinds of contact have one record, `refweb.kernels.CONTACT`: lines on bodies, bodies on bodies, lines on lines, and
nodes in a fluid. A force term has a kernel that detects its contacts, and one for their law: the force of one contact
while all others stay. `friction_law` is friction with damping. A force on a node that is attached to a body is a force
and a moment on the body: rows of the body replace those of the node.

May change: `SETTLING`, `CLOSE` and `UNMIXED`, which move results within the error of a step. Must stay: the law in
`friction_law`, which is that of `contact.friction`; fields of `refweb.kernels.CONTACT` that are read and written;
`prepare`, `carry`, `gauss_seidel`, `warm_start` and `commit`, which `integrators.implicit_contacts` and
`integrators.step` call. Another order of contacts or sums changes the last digits of results. Must stay as well: all
names that `drag.implicit_drag`, `contact.line_body_friction` and other files import. Tests:
``tests/effects/test_contact_losses.py``, ``tests/effects/test_attached_contact_losses.py``.

References
----------
.. [1] M. Jean, "The non-smooth contact dynamics method", Comput. Methods Appl. Mech. Engrg. 177 (1999) 235–257,
   doi:10.1016/S0045-7825(98)00383-1.
"""

from __future__ import annotations

import math

from ..compiled.rows import record_at
from ..kernels import LAW, ContactArray, Integers, Matrix, PartArray, kernel
from ..net.rotation import RigidRotations, matrix_at, times, times_transposed
from .base import CONTACT_COLUMNS, TOUCH
from .vectors import cross, dot, solve

SETTLING = 1
"""Number of sweeps after which θ is constant: with a warm start a second sweep changes nothing."""
CLOSE = 1e-9
"""Step of Newton's method for the size of a slip, over that, behind which the next would be rounding."""
UNMIXED = 1e-15
"""Size of the mixed term of J M⁻¹ Jᵀ, over its terms along the tangents, below which it is rounding."""


# Contacts


@kernel(forceinline=True)
def set_part(part, row, i, rate, force):
    """Write the entries of a row in J and in Jᵀ for direction i of a contact."""
    part.row = row
    for k in range(3):
        part.jacobian[i, k], part.transpose[i, k] = rate[k], force[k]


@kernel(forceinline=True)
def set_basis(contact, normal):
    """Write the normal of a contact, and two tangents."""
    e = cross(normal, (1.0, 0.0, 0.0) if abs(normal[0]) < 0.6 else (0.0, 1.0, 0.0))
    size = math.sqrt(dot(e, e))
    e = e[0] / size, e[1] / size, e[2] / size
    h = cross(normal, e)
    for k in range(3):
        contact.basis[0, k], contact.basis[1, k], contact.basis[2, k] = normal[k], e[k], h[k]


@kernel(forceinline=True)
def direction(contact, i):
    """Direction i of a contact."""
    return contact.basis[i, 0], contact.basis[i, 1], contact.basis[i, 2]


@kernel(forceinline=True)
def relative_velocity(contact, parts, v):
    """Components of u along the directions [m/s], of velocities v (rows, 3)."""
    p = q = s = 0.0
    for m in range(contact.first, contact.first + contact.count):
        row, rate = parts[m].row, parts[m].jacobian
        for k in range(3):
            p, q, s = p + rate[0, k] * v[row, k], q + rate[1, k] * v[row, k], s + rate[2, k] * v[row, k]
    return p, q, s


@kernel(forceinline=True)
def acceleration(contact, parts, f, inverse):
    """Components of du/dt along the directions [m/s²] by forces f."""
    p = q = s = 0.0
    for m in range(contact.first, contact.first + contact.count):
        row, rate = parts[m].row, parts[m].jacobian
        for k in range(3):
            a = inverse[row, k] * f[row, k]
            p, q, s = p + rate[0, k] * a, q + rate[1, k] * a, s + rate[2, k] * a
    return p, q, s


@kernel(forceinline=True)
def apply_force(contact, parts, p, q, s, f):
    """Add a force along the three directions to those on all rows."""
    for m in range(contact.first, contact.first + contact.count):
        row, by = parts[m].row, parts[m].transpose
        for k in range(3):
            f[row, k] += p * by[0, k] + q * by[1, k] + s * by[2, k]


@kernel(forceinline=True)
def set_delassus(contact, parts, inverse):
    """Write J M⁻¹ Jᵀ."""
    d00 = d01 = d02 = d11 = d12 = d22 = 0.0
    for m in range(contact.first, contact.first + contact.count):
        row, rate, by = parts[m].row, parts[m].jacobian, parts[m].transpose
        for k in range(3):
            p, q, s = by[0, k] * inverse[row, k], by[1, k] * inverse[row, k], by[2, k] * inverse[row, k]
            d00, d01, d02 = d00 + rate[0, k] * p, d01 + rate[0, k] * q, d02 + rate[0, k] * s
            d11, d12, d22 = d11 + rate[1, k] * q, d12 + rate[1, k] * s, d22 + rate[2, k] * s
    block = contact.delassus
    block[0, 0], block[1, 1], block[2, 2] = d00, d11, d22
    block[0, 1] = block[1, 0] = d01
    block[0, 2] = block[2, 0] = d02
    block[1, 2] = block[2, 1] = d12


@kernel(forceinline=True)
def turn_tangents(vectors, cosine, sine):
    """Rotate the second and third of some vectors (3, 3) in their plane."""
    for k in range(3):
        first, second = vectors[1, k], vectors[2, k]
        vectors[1, k], vectors[2, k] = cosine * first + sine * second, cosine * second - sine * first


@kernel(leaf=True)
def prepare(h, n, v, inverse, contacts, parts):
    """Write the data of contact n for the solver, with tangents for which J M⁻¹ Jᵀ has no mixed term."""
    contact = contacts[n]
    if contact.group == 0:
        return
    set_delassus(contact, parts, inverse)
    block = contact.delassus
    if contact.normal_force > 0.0 and abs(block[1, 2]) > UNMIXED * (block[1, 1] + block[2, 2]):
        angle = 0.5 * math.atan2(2.0 * block[1, 2], block[1, 1] - block[2, 2])
        cosine, sine = math.cos(angle), math.sin(angle)
        turn_tangents(contact.basis, cosine, sine)
        for m in range(contact.first, contact.first + contact.count):
            turn_tangents(parts[m].jacobian, cosine, sine)
            turn_tangents(parts[m].transpose, cosine, sine)
        set_delassus(contact, parts, inverse)
    u = relative_velocity(contact, parts, v)
    for i in range(3):
        contact.velocity[i], contact.force[i] = u[i] - contact.wind[i], 0.0
    contact.theta[0], contact.theta[1] = 1.0, 1.0
    if contact.damping > 0.0:
        contact.theta[0] = fitted(h * block[0, 0] * contact.normal_force * contact.damping)


@kernel(forceinline=True)
def add_part(contact, parts, row, i, rate, force):
    """Add the entries of a row for direction i of a contact to its part, which is created if it does not exist."""
    m, end = contact.first, contact.first + contact.count
    while m < end and parts[m].row != row:
        m += 1
    if m == end:
        contact.count += 1
        for j in range(3):
            set_part(parts[m], row, j, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    for k in range(3):
        parts[m].jacobian[i, k] += rate[k]
        parts[m].transpose[i, k] += force[k]


@kernel(apart=("carried",))
def carry(
    n: int, x: Matrix, carriers: Integers, turns: RigidRotations, contacts: ContactArray, parts: PartArray
) -> None:
    """Replace attached nodes in contact n by their bodies.

    An attached node, at the arm a from the centre of mass, has the velocity v + ω × a. A force p on it acts on the body
    as p and the moment a × p. In the rows of `refweb.net.rotation`, ω is W times the velocity of the rotation, with W
    along the axes of space. The force is also written at the node, which is no unknown.
    """
    contact = contacts[n]
    for m in range(contact.first, contact.first + contact.count):
        number = carriers[parts[m].row]
        if number < 0:
            continue
        b = turns.carried[number, 1]
        row, spin, turn = turns.rows[b, 0], turns.rows[b, 1], turns.rows[b, 2]
        turned, w = matrix_at(x, spin, turn), turns.mobility[b]
        mobility = (w[0, 0], w[0, 1], w[0, 2]), (w[1, 0], w[1, 1], w[1, 2]), (w[2, 0], w[2, 1], w[2, 2])
        arm = times(turned, (turns.arms[number, 0], turns.arms[number, 1], turns.arms[number, 2]))
        for i in range(3):
            g = parts[m].transpose[i, 0], parts[m].transpose[i, 1], parts[m].transpose[i, 2]
            moment = cross(arm, g)
            add_part(contact, parts, row, i, g, g)
            turning = times(turned, times(mobility, times_transposed(turned, moment)))
            add_part(contact, parts, spin, i, turning, moment)
            for k in range(3):
                parts[m].jacobian[i, k] = 0.0


# The law of damping and friction


@kernel()
def fitted(z):
    """θ(z) = 1/(1 − e⁻ᶻ) − 1/z, from ½ to 1, of a loss that alone reduces a velocity by the factor e⁻ᶻ, z ≥ 0."""
    if z < 0.1:
        return 0.5 + z / 12.0 * (1.0 - z * z / 60.0 * (1.0 - z * z / 42.0))
    return 1.0 / (1.0 - math.exp(-z)) - 1.0 / z


@kernel()
def slip_size(b, c, y, z, slip):
    """Root r of slip²/r² + b²/(r + y)² + c²/(r + z)² = 1, with y, z ≥ 0: never below the root of large steps."""
    r = max(slip, math.sqrt(b * b + c * c) - max(y, z))
    for _ in range(100):
        by_slip, by_b, by_c = 1.0 / r, 1.0 / (r + y), 1.0 / (r + z)
        p, q, s = slip * by_slip, b * by_b, c * by_c
        p, q, s = p * p, q * q, s * s
        total = p + q + s
        step = total * (math.sqrt(total) - 1.0) / (p * by_slip + q * by_b + s * by_c)
        r += step
        if not abs(step) > CLOSE * r:
            break
    return r


@kernel(forceinline=True)
def solve_normal(contact, h, rate):
    """(Force along the normal, N) if the other forces alone accelerate the contact by ``rate`` [m/s²]."""
    push, weight = contact.normal_force, contact.delassus[0, 0]
    while True:
        theta = contact.theta[0]
        start = contact.velocity[0] + theta * h * rate
        u = start / (1.0 + theta * h * weight * push * contact.damping)
        damped = contact.damping * u
        if damped < -1.0:
            damped = -1.0
        force = -push * damped
        if theta == 0.5 or damped * (contact.velocity[0] + 0.5 * h * (rate + weight * force)) >= 0.0:
            return force, push * (1.0 + damped)
        contact.theta[0] = 0.5


@kernel(forceinline=True)
def solve_tangents(contact, h, drag, first, last, settling):
    """Friction along both tangents, μ N = ``drag``, if other forces alone accelerate by ``first`` and ``last``."""
    slip, first_weight, second = contact.slip_velocity, h * contact.delassus[1, 1], h * contact.delassus[2, 2]
    u, w = contact.velocity[1], contact.velocity[2]
    if settling:
        r = slip_size(u + h * first, w + h * last, first_weight * drag, second * drag, slip)
        contact.theta[1] = fitted(max(first_weight, second) * drag / r)
    while True:
        theta = contact.theta[1]
        b, c, y, z = u + theta * h * first, w + theta * h * last, theta * first_weight * drag, theta * second * drag
        r = slip_size(b, c, y, z, slip)
        b, c = b / (r + y), c / (r + z)
        force = -drag * b, -drag * c
        if theta == 0.5:
            return force
        mean, more = u + 0.5 * (h * first + first_weight * force[0]), w + 0.5 * (h * last + second * force[1])
        if b * mean + c * more >= 0.0:
            return force
        contact.theta[1] = 0.5


@kernel(forceinline=True)
def way_of(first, end):
    """1 where contacts are taken in their order from ``first`` to ``end``, −1 in reverse order."""
    return 1 if end > first else -1


@kernel(LAW, leaf=True)
def friction_law(h, number, first, end, f, inverse, contacts, parts):
    """Law of contacts that push, see `rub`: a call for each of them would take a quarter of the time."""
    largest = 0.0
    for n in range(first, end, way_of(first, end)):
        largest = max(largest, rub(h, number, contacts[n], f, inverse, parts))
    return largest


@kernel(forceinline=True)
def rub(h, number, contact, f, inverse, parts):
    """Find the force of a contact that pushes: damping along its normal, friction along its tangents."""
    if not contact.normal_force > 0.0:
        return 0.0
    before = contact.force[0], contact.force[1], contact.force[2]
    rate = acceleration(contact, parts, f, inverse)
    p, normal, change = 0.0, contact.normal_force, 0.0
    if contact.damping > 0.0:
        weight = contact.delassus[0, 0]
        p, normal = solve_normal(contact, h, rate[0] - weight * before[0])
        change = h * weight * abs(p - before[0])
    q = s = 0.0
    drag = contact.friction * normal
    if drag > 0.0:
        first_weight, second = contact.delassus[1, 1], contact.delassus[2, 2]
        first = rate[1] + contact.delassus[1, 0] * (p - before[0]) - first_weight * before[1]
        last = rate[2] + contact.delassus[2, 0] * (p - before[0]) - second * before[2]
        q, s = solve_tangents(contact, h, drag, first, last, number < SETTLING)
        change = max(change, h * first_weight * abs(q - before[1]), h * second * abs(s - before[2]))
    contact.force[0], contact.force[1], contact.force[2] = p, q, s
    apply_force(contact, parts, p - before[0], q - before[1], s - before[2], f)
    return change


# The steps of the solver


@kernel(leaf=True)
def gauss_seidel(h, number, f, inverse, contacts, parts, count, laws):
    """Solve contacts in turn, in reverse order if ``number`` is odd; return the largest change of a velocity [m/s]."""
    largest, stride, n = 0.0, -1 if number % 2 else 1, count - 1 if number % 2 else 0
    while 0 <= n < count:
        term, end = contacts[n].term, n
        while 0 <= end < count and contacts[end].term == term:
            end += stride
        largest, n = max(largest, laws[term](h, number, n, end, f, inverse, contacts, parts)), end
    return largest


@kernel(forceinline=True)
def slot_of(memory, contact):
    """Slot of a contact in the memory of its cell: that of its tag, a free slot, or that of the oldest step."""
    slots, oldest = memory.shape[1], contact.tag % memory.shape[1]
    for s in range(slots):
        slot = (contact.tag + s) % slots
        step = memory[contact.owner, slot].step
        if step == 0 or memory[contact.owner, slot].tag == contact.tag:
            return slot
        if step < memory[contact.owner, oldest].step:
            oldest = slot
    return oldest


@kernel(leaf=True)
def forget(memory):
    """Forget the forces of all steps."""
    for c in range(memory.shape[0]):
        for slot in range(memory.shape[1]):
            memory[c, slot].step = 0


@kernel(leaf=True)
def warm_start(number, memory, f, contacts, parts, begin, end):
    """Start with the forces of the step before ``number``, so that sticking contacts take few sweeps."""
    for n in range(begin, end):
        contact = contacts[n]
        if contact.group == 0:
            continue
        past = memory[contact.owner, slot_of(memory, contact)]
        if past.tag != contact.tag or past.step != number - 1 or number == 1:
            continue
        a, b, c = direction(contact, 0), direction(contact, 1), direction(contact, 2)
        p, q, s = solve(a, b, c, (past.force[0], past.force[1], past.force[2]))
        contact.force[0], contact.force[1], contact.force[2] = p, q, s
        apply_force(contact, parts, p, q, s, f)


@kernel(leaf=True)
def commit(number, memory, v, contacts, parts, begin, end, out):
    """Write the power of each cell at the velocities v, and the force on a body; keep forces for the next step."""
    out[:] = 0.0
    for n in range(begin, end):
        contact = contacts[n]
        if contact.group == 0:
            continue
        p, q, s = contact.force[0], contact.force[1], contact.force[2]
        past = memory[contact.owner, slot_of(memory, contact)]
        past.tag, past.step = contact.tag, number
        for k in range(3):
            past.force[k] = p * contact.basis[0, k] + q * contact.basis[1, k] + s * contact.basis[2, k]
        shows = record_at(TOUCH, out, contact.cell, 0)
        shows.value += dot((p, q, s), relative_velocity(contact, parts, v))
        for k in range(3 if out.shape[1] == CONTACT_COLUMNS else 0):
            shows.force[k] -= past.force[k]
