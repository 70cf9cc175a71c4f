"""Threads that run over bodies: the shortest line on a sphere or a cylinder, its length, gradient and stiffness.

From the middle of the body, across the axis of a cylinder, the two ends are at the distances r_p and r_q, and the line
goes around by the angle θ. With the radius R and

    w = √(r_p² − R²) + √(r_q² − R²) + R α,        α = |θ| − acos(R/r_p) − acos(R/r_q),

its length is √(w² + Δz²) where α > 0, with the distance Δz along the axis; a sphere has none, and θ is the angle
between both ends. Where α ≤ 0 the line is straight, and clear of the body. The gradient is continuous there.

The gradient at each end is the unit vector along the line, since the line is the shortest. Across itself the line has
the curvature 1/t with the length t of its straight part, and on a sphere R cot θ/r² and −R/(r_p r_q sin θ) out of the
plane. The body takes minus the sum, and the moment of both pulls about its base, which has no part along the axis.

The angle θ follows from the azimuths of both ends. Each is within half a turn of that in the web's position; that of a
node on a body that turns about its axle, within half a turn of the one that it turns to. So any number of turns is
counted, and nothing is remembered from step to step.

`thread` calls `term`. May change: how the bound is found, if it is not smaller; `SURFACE`, a tolerance of rounding.
Must stay: length, gradient and tangent of one formula, which `around.winding_length` has in Python for the web as
built: change both together; the name "thread", which `statics.gradients.KNOWN` and `studies.modes` have; columns of
``out``, those of `net.threads.COLUMNS` and then a `base.TOUCH` for each segment on a body with the force on it, which
`system.contact_forces` adds up; fields of `SEGMENT`, which `half_turns` reads by name; `segments_of`, which
`half_turns` imports. Tests: ``tests/effects/test_around.py``, ``tests/test_contract.py``.
"""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..compiled.rows import record_at, width_of
from ..kernels import BOUND, FORCE, STIFFNESS, kernel
from ..net.threads import COLUMNS, TAUT
from .around import CYLINDER, KINDS, SPHERE, STRAIGHT, refuse_free, steady
from .base import CONTACT_COLUMNS, TOUCH, Balance, CellElements, ForceTerm, Tangent
from .line_kernels import line_at
from .thread_segments import energy_kernel
from .vectors import cross, dot

if TYPE_CHECKING:
    from ..net.net import Net
    from ..net.threads import ThreadLine

SEGMENT = np.dtype(
    [
        ("kind", float),
        ("body", float),
        ("spin", float),
        ("first", float, (3,)),
        ("second", float, (3,)),
        ("radius", float),
        ("axes", float, (9,)),
        ("off", float, (3,)),
        ("angles", float, (3,)),
        ("turns", float, (2,)),
        ("sense", float),
        ("length", float),
    ]
)
"""A segment: its kind, the column of its body's base in the cell, the row of the body's rotation, −1 without one; its
ends from the middle of the body, of a straight one the vector from end to end in ``second``; radius and axes of the
body, and its middle from the base; azimuths and angle as in `refweb.effects.around.Wrap`; rows whose second component
is the angle of the body about its axle, of ends on it, else −1; that is positive about the axis or, with −1, negative;
length in the web's position."""
SURFACE = 1e-9
"""Height of an end over the surface that counts as rounding, over the radius."""


class Frame(NamedTuple):
    """An end of a line on a body.

    Attributes
    ----------
    far : float
        Distance r from the middle or the axis [m].
    straight : float
        Length t of the straight part [m]; 0 on the surface.
    angle : float
        acos(R/r) [rad].
    out, along : tuple of 3 float
        Unit vectors away from the middle or the axis, and across it from the first end to the second.
    """

    far: float
    straight: float
    angle: float
    out: tuple[float, float, float]
    along: tuple[float, float, float]


class Path(NamedTuple):
    """A segment at a displacement.

    Attributes
    ----------
    length : float
        Its length [m].
    first, second : tuple of 3 float
        Gradients of the length at both ends [1].
    wound : bool
        True where it touches the body.
    begin, finish : Frame
        Its ends, where it touches.
    flat : float
        w [m].
    angle : float
        Angle |θ| around the body [rad].
    """

    length: float
    first: tuple[float, float, float]
    second: tuple[float, float, float]
    wound: bool
    begin: Frame
    finish: Frame
    flat: float
    angle: float


@kernel()
def scaled(a, p, b, q):
    """a p + b q."""
    return a * p[0] + b * q[0], a * p[1] + b * q[1], a * p[2] + b * q[2]


@kernel()
def frame(p, axis, radius):
    """The `Frame` of an end at p, with ``along`` a right-handed turn about the axis."""
    far = math.sqrt(dot(p, p))
    out = scaled(1.0 / far, p, 0.0, p) if far > 0.0 else p
    if far <= radius * (1.0 + SURFACE):
        return Frame(far, 0.0, 0.0, out, cross(axis, out))
    return Frame(far, math.sqrt((far - radius) * (far + radius)), math.acos(radius / far), out, cross(axis, out))


@kernel()
def reversed_frame(end):
    """The same end with the other direction along."""
    return Frame(end.far, end.straight, end.angle, end.out, scaled(-1.0, end.along, 0.0, end.along))


@kernel()
def azimuth(x, p, segment, n):
    """Azimuth of end n at p, of any number of turns [rad]."""
    axes, near, turn = segment.axes, segment.angles[n], int(segment.turns[n])
    if turn >= 0:
        near += segment.sense * x[turn, 1]
    angle = math.atan2(
        p[0] * axes[3] + p[1] * axes[4] + p[2] * axes[5], p[0] * axes[0] + p[1] * axes[1] + p[2] * axes[2]
    )
    return angle + 2.0 * math.pi * round((near - angle) / (2.0 * math.pi))


@kernel()
def ends_of(x, i, j, b, segment):
    """Both ends of a segment from the middle of its body; of a straight one zero, and the vector from end to end."""
    f, s = segment.first, segment.second
    if segment.kind == STRAIGHT:
        u = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
        return (0.0, 0.0, 0.0), (s[0] + u[0], s[1] + u[1], s[2] + u[2])
    return (
        (f[0] + x[i, 0] - x[b, 0], f[1] + x[i, 1] - x[b, 1], f[2] + x[i, 2] - x[b, 2]),
        (s[0] + x[j, 0] - x[b, 0], s[1] + x[j, 1] - x[b, 1], s[2] + x[j, 2] - x[b, 2]),
    )


@kernel()
def path_of(x, i, j, b, segment):
    """The `Path` of a segment from row i to row j; row b is the base of its body."""
    p, q = ends_of(x, i, j, b, segment)
    chord = scaled(1.0, q, -1.0, p)
    length, radius = math.sqrt(dot(chord, chord)), segment.radius
    inverse = 1.0 / length if length > 0.0 else 0.0
    unit = scaled(inverse, chord, 0.0, chord)
    nowhere = Frame(1.0, 0.0, 0.0, unit, unit)
    straight = Path(length, scaled(-1.0, unit, 0.0, unit), unit, False, nowhere, nowhere, length, 0.0)
    if segment.kind == STRAIGHT:
        return straight
    axis, high = (segment.axes[6], segment.axes[7], segment.axes[8]), 0.0
    if segment.kind == CYLINDER:
        angle = segment.angles[2] + azimuth(x, q, segment, 1) - segment.angles[1]
        angle -= azimuth(x, p, segment, 0) - segment.angles[0]
        low, up = dot(p, axis), dot(q, axis)
        high, p, q = up - low, scaled(1.0, p, -low, axis), scaled(1.0, q, -up, axis)
    else:
        normal = cross(p, q)
        sine = math.sqrt(dot(normal, normal))
        if sine == 0.0:
            return straight
        angle, axis = math.atan2(sine, dot(p, q)), scaled(1.0 / sine, normal, 0.0, normal)
    start, end = frame(p, axis, radius), frame(q, axis, radius)
    if angle < 0.0:
        start, end = reversed_frame(start), reversed_frame(end)
    lies = abs(angle) - start.angle - end.angle
    if lies <= 0.0:
        return straight
    flat = start.straight + end.straight + radius * lies
    length = math.sqrt(flat * flat + high * high)
    share, rise = flat / length, high / length
    first = scaled(share * start.straight / start.far, start.out, -share * radius / start.far, start.along)
    second = scaled(share * end.straight / end.far, end.out, share * radius / end.far, end.along)
    if segment.kind == CYLINDER:
        first, second = scaled(1.0, first, -rise, axis), scaled(1.0, second, rise, axis)
    return Path(length, first, second, True, start, end, flat, abs(angle))


@kernel()
def add_outer(h, r, s, factor, a, b):
    """Add factor a⊗b to the part (r, s) of a matrix."""
    for k in range(3):
        for m in range(3):
            h[r + k, s + m] += factor * a[k] * b[m]


@kernel()
def add_flat(h, r, factor, end, radius, sign, definite):
    """Add the curvature of w at an end; ``sign`` is 1 at the first and −1 at the second."""
    square = end.far * end.far
    if end.straight > 0.0:
        add_outer(h, r, r, factor * radius * radius / (square * end.straight), end.out, end.out)
    elif definite:
        return
    add_outer(h, r, r, factor * end.straight / square, end.along, end.along)
    add_outer(h, r, r, factor * sign * radius / square, end.out, end.along)
    add_outer(h, r, r, factor * sign * radius / square, end.along, end.out)


@kernel()
def add_out_of_plane(h, path, radius, definite):
    """Add the curvature on a sphere out of the plane of both ends; ``definite`` leaves out what is negative."""
    start, end, normal = path.begin, path.finish, cross(path.begin.out, path.begin.along)
    sine = max(math.sin(path.angle), SURFACE)
    cotangent = math.cos(path.angle) / sine
    a = (start.straight + radius * cotangent) / (start.far * start.far)
    d = (end.straight + radius * cotangent) / (end.far * end.far)
    b = -radius / (start.far * end.far * sine)
    if definite:  # the positive eigenvalues of [[a, b], [b, d]]
        middle, apart = 0.5 * (a + d), 0.5 * math.sqrt((a - d) * (a - d) + 4.0 * b * b)
        if middle - apart < 0.0:
            larger = max(middle + apart, 0.0)
            share = 0.5 * larger / apart if apart > 0.0 else 0.0
            a, d, b = share * (apart + 0.5 * (a - d)), share * (apart - 0.5 * (a - d)), share * b
    add_outer(h, 0, 0, a, normal, normal)
    add_outer(h, 3, 3, d, normal, normal)
    add_outer(h, 0, 3, b, normal, normal)
    add_outer(h, 3, 0, b, normal, normal)


@kernel()
def curvature(h, path, segment, definite):
    """Write the second derivatives of the length by both ends, ``h (6, 6)`` [1/m]."""
    h[:] = 0.0
    inverse = 1.0 / path.length if path.length > 0.0 else 0.0
    ends = path.first, path.second
    if not path.wound or segment.kind == CYLINDER:
        for r in range(2):
            for s in range(2):
                add_outer(h, 3 * r, 3 * s, -inverse, ends[r], ends[s])
    if not path.wound:
        for r in range(0, 6, 3):
            for s in range(0, 6, 3):
                for k in range(3):
                    h[r + k, s + k] += inverse if r == s else -inverse
        return
    share = 1.0
    if segment.kind == CYLINDER:
        share = path.flat * inverse
        axis = segment.axes[6], segment.axes[7], segment.axes[8]
        start, end = path.begin, path.finish
        flat = (
            scaled(start.straight / start.far, start.out, -segment.radius / start.far, start.along),
            scaled(end.straight / end.far, end.out, segment.radius / end.far, end.along),
        )
        for r in range(2):
            for s in range(2):
                add_outer(h, 3 * r, 3 * s, inverse, flat[r], flat[s])
                add_outer(h, 3 * r, 3 * s, inverse if r == s else -inverse, axis, axis)
    else:
        add_out_of_plane(h, path, segment.radius, definite)
    add_flat(h, 0, share, path.begin, segment.radius, 1.0, definite)
    add_flat(h, 3, share, path.finish, segment.radius, -1.0, definite)


@functools.cache
def kernels(law, record, width, wraps):
    """Force, energy, stiffness and bound kernels of threads over bodies.

    Parameters
    ----------
    law : type
        Law of the thread.
    record : numpy.dtype
        Numbers of a line that it reads.
    width : int
        Columns of a cell ahead of 1/A and of the `SEGMENT` of each segment.
    wraps : int
        Rows of a cell behind those of its nodes: bases of bodies.
    """
    stress, tangent, size = law.stress, law.tangent, width_of(SEGMENT)

    @kernel()
    def path_at(x, cells, data, c, s):
        """The `Path` of segment s of cell c."""
        segment = record_at(SEGMENT, data, c, width + 1 + size * s)
        return path_of(x, cells[c, s], cells[c, s + 1], cells[c, int(segment.body)], segment)

    @kernel()
    def strain_of(x, cells, data, c):
        line = line_at(data, c)
        longer = line.distance - line.natural_length
        for s in range(cells.shape[1] - wraps - 1):
            longer += path_at(x, cells, data, c, s).length
            longer -= record_at(SEGMENT, data, c, width + 1 + size * s).length
        return longer / line.natural_length

    @kernel(FORCE)
    def force(t, x, v, f, cells, data, out):
        for c in range(cells.shape[0]):
            line, strain = record_at(record, data, c, 0), strain_of(x, cells, data, c)
            tension = stress(strain, line)
            for s in range(cells.shape[1] - wraps - 1):
                segment, path = record_at(SEGMENT, data, c, width + 1 + size * s), path_at(x, cells, data, c, s)
                i, j, b, spin = cells[c, s], cells[c, s + 1], cells[c, int(segment.body)], int(segment.spin)
                press = scaled(tension, path.first, tension, path.second)
                for k in range(3):
                    f[i, k] -= tension * path.first[k]
                    f[j, k] -= tension * path.second[k]
                    if path.wound:
                        f[b, k] += press[k]
                if segment.kind != STRAIGHT:
                    number = int(segment.body) + wraps - cells.shape[1]
                    touch = record_at(TOUCH, out, c, COLUMNS + CONTACT_COLUMNS * number)
                    touch.value = 0.0
                    for k in range(3):
                        touch.force[k] = press[k] if path.wound else 0.0
                if path.wound and spin >= 0:
                    p, q = ends_of(x, i, j, b, segment)
                    off = segment.off[0], segment.off[1], segment.off[2]
                    first = cross(scaled(tension, p, tension, off), path.first)
                    second = cross(scaled(tension, q, tension, off), path.second)
                    for k in range(3):
                        f[spin, k] += first[k] + second[k]
            out[c, 0], out[c, 1], out[c, 2] = tension, tension * data[c, width], strain
            out[c, 3] = line.natural_length * (1.0 + strain)

    @kernel(STIFFNESS)
    def stiffness(t, x, v, blocks, cells, data, definite):
        g, h, signs = np.empty(3 * cells.shape[1]), np.empty((6, 6)), (1.0, 1.0, -1.0)
        for c in range(cells.shape[0]):
            line, strain = record_at(record, data, c, 0), strain_of(x, cells, data, c)
            along, tension = tangent(strain, line) / line.natural_length, stress(strain, line)
            if definite and tension < 0.0:
                tension = 0.0
            g[:] = 0.0
            blocks[c] = 0.0
            for s in range(cells.shape[1] - wraps - 1):
                segment, path = record_at(SEGMENT, data, c, width + 1 + size * s), path_at(x, cells, data, c, s)
                curvature(h, path, segment, definite)
                at = 3 * s, 3 * s + 3, 3 * int(segment.body)
                for k in range(3):
                    g[at[0] + k] += path.first[k]
                    g[at[1] + k] += path.second[k]
                    if path.wound:
                        g[at[2] + k] -= path.first[k] + path.second[k]
                count = 3 if path.wound else 2
                for r in range(count):
                    for w in range(count):
                        for k in range(3):
                            for m in range(3):
                                value = 0.0
                                for n in range(2):
                                    for o in range(2):
                                        if (r == n or r == 2) and (w == o or w == 2):
                                            value += h[3 * n + k, 3 * o + m]
                                blocks[c, at[r] + k, at[w] + m] += tension * signs[r] * signs[w] * value
            for i in range(g.size):
                for j in range(g.size):
                    blocks[c, i, j] += along * g[i] * g[j]

    @kernel(BOUND)
    def bound(reach, speed, x, mass, rates, cells, data):
        # Parts of g are 1 at most for each end of a segment, and 2 of its body, 4 together.
        for c in range(cells.shape[0]):
            line, segments = record_at(record, data, c, 0), cells.shape[1] - wraps - 1
            along = 2.0 * (segments + wraps) * abs(line.ea) / line.natural_length
            tension, soon = abs(stress(strain_of(x, cells, data, c), line)), TAUT * abs(line.ea)
            shortest = TAUT * line.natural_length
            for s in range(segments):
                segment, path = record_at(SEGMENT, data, c, width + 1 + size * s), path_at(x, cells, data, c, s)
                i, j, b = cells[c, s], cells[c, s + 1], cells[c, int(segment.body)]
                present = tension / path.length if path.length > 0.0 else 0.0
                across = 2.0 * max(present, soon / max(segment.length, shortest))
                rates[i] += along
                rates[j] += along
                if path.wound:
                    across *= 2.0
                    rates[b] += 2.0 * (along + across)
                    for row, end in ((i, path.begin), (j, path.finish)):
                        free, square = end.straight, end.far * end.far
                        turned = 2.0 * max(tension / free, soon / max(free, shortest)) if free > 0.0 else 0.0
                        turned += 4.0 * max(tension, soon) * segment.radius / square
                        rates[row] += turned
                        rates[b] += turned
                    if segment.kind == SPHERE:
                        sine = max(math.sin(path.angle), SURFACE)
                        turned = 4.0 * max(tension, soon) * segment.radius / (path.begin.far * path.finish.far * sine)
                        rates[i] += turned
                        rates[j] += turned
                        rates[b] += turned
                rates[i] += across
                rates[j] += across

    return force, energy_kernel(law, record, strain_of), stiffness, bound


def segments_of(net: Net, thread: ThreadLine) -> tuple[Any, list[int], bool]:
    """(Records of its segments, bases of bodies, True if a body bears moments that keep its axis)."""
    rows, count = thread.rows, len(thread.distances)
    segments, bases, bears = np.zeros(count, dtype=SEGMENT), [], False
    segments["second"], segments["length"], segments["spin"] = thread.vectors, thread.distances, -1.0
    for wrap in thread.wraps:
        body, off = steady(net, wrap.body)
        shape: Any = body.shape
        segment, ends = segments[wrap.segment], rows[wrap.segment : wrap.segment + 2]
        segment["kind"], segment["body"] = KINDS[type(shape).__name__], len(rows) + len(bases)
        bases.append(body.base)
        middle = net.points[body.base] + off
        segment["first"], segment["second"] = net.points[ends] - middle
        segment["radius"], segment["axes"], segment["off"] = shape.radius, body.axes.ravel(), off
        segment["angles"] = wrap.angles
        segment["spin"] = -1 if body.turn is None else body.spin
        segment["turns"] = [body.turn if body.axle and end in body.carried else -1 for end in ends]
        segment["sense"] = np.sign(body.axle.direction @ body.axes[2]) if body.axle else 1.0
        bears |= segment["kind"] == CYLINDER
    return segments, bases, bool(bears)


def term(net: Net, thread: ThreadLine) -> ForceTerm:
    """The term of a thread that runs over bodies."""
    if net.quasi_static:
        refuse_free(net)
    line = thread.line
    numbers = line.line_data.matrix
    segments, bases, bears = segments_of(net, thread)
    force, energy, stiffness, bound = kernels(line.law, line.law_record, numbers.shape[1], len(bases))
    return ForceTerm(
        name="thread",
        cells=np.array([[*thread.rows, *bases]], dtype=np.int32),
        data=np.concatenate([numbers[0], [1.0 / line.area[0]], segments.view(float).ravel()])[None, :],
        force=force,
        energy=energy,
        tangent=Tangent(stiffness, bound, across=thread.across),
        balance=Balance("strain_energy", internal=True, twists=bears),
        elements=CellElements(observed=COLUMNS + CONTACT_COLUMNS * len(bases)),
    )
