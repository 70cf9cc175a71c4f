"""NVIDIA Warp on the CPU: kernels of one's own in double precision, one for lines and one for nodes."""

import numpy as np
import warp as wp

from ..many import by_processes

COMPILES = True
wp.config.quiet = True


def version():
    return f"Warp {wp.__version__}"


@wp.kernel
def pull(
    x: wp.array(dtype=wp.vec3d),
    lines: wp.array(dtype=wp.vec2i),
    natural: wp.array(dtype=wp.float64),
    ea: wp.float64,
    force: wp.array(dtype=wp.vec3d),
):
    line = wp.tid()
    i, j = lines[line][0], lines[line][1]
    across = x[j] - x[i]
    length = wp.length(across)
    if length > natural[line]:
        pulled = ea * (wp.float64(1.0) / natural[line] - wp.float64(1.0) / length) * across
        wp.atomic_add(force, i, pulled)
        wp.atomic_sub(force, j, pulled)


@wp.kernel
def move(
    x: wp.array(dtype=wp.vec3d),
    v: wp.array(dtype=wp.vec3d),
    force: wp.array(dtype=wp.vec3d),
    weight: wp.array(dtype=wp.float64),
    step: wp.float64,
):
    node = wp.tid()
    v[node] += step * weight[node] * force[node]
    x[node] += step * v[node]
    force[node] = wp.vec3d()


def impact(problem, steps, more=None):
    velocity = problem.velocities  # flat and slack lines do not pull: also those half a step before
    with wp.ScopedDevice("cpu"):
        x, v = wp.array(problem.start, dtype=wp.vec3d), wp.array(velocity, dtype=wp.vec3d)
        lines, natural = wp.array(problem.lines, dtype=wp.vec2i), wp.array(problem.natural, dtype=wp.float64)
        weight = wp.array(np.where(problem.free, 1.0 / problem.masses, 0.0), dtype=wp.float64)
        force, step = wp.zeros_like(x), problem.duration / steps
        push = more(problem, x, lines, natural, force) if more else None
        for n in range(steps):
            wp.launch(pull, len(problem.lines), [x, lines, natural, wp.float64(problem.ea), force])
            if push:
                push(n)
            wp.launch(move, len(problem.points), [x, v, force, weight, wp.float64(step)])
        return x.numpy()


SKIN, EVERY = 0.02, 20
"""Distance within which lines are searched in advance [m], and steps between searches."""


@wp.kernel(module="unique")
def push_ball(
    x: wp.array(dtype=wp.vec3d),
    lines: wp.array(dtype=wp.vec2i),
    ball: int,
    radius: wp.float64,
    stiffness: wp.float64,
    force: wp.array(dtype=wp.vec3d),
):
    line = wp.tid()
    i, j = lines[line][0], lines[line][1]
    along, to = x[j] - x[i], x[ball] - x[i]
    s = wp.clamp(wp.dot(to, along) / wp.dot(along, along), wp.float64(0.0), wp.float64(1.0))
    away = s * along - to
    distance = wp.length(away)
    if distance < radius:
        push = stiffness * (radius / distance - wp.float64(1.0)) * away
        wp.atomic_add(force, i, (wp.float64(1.0) - s) * push)
        wp.atomic_add(force, j, s * push)
        wp.atomic_sub(force, ball, push)


@wp.func
def smooth(y: wp.float64):
    y = wp.clamp(y, wp.float64(-1.0), wp.float64(1.0))
    return (wp.float64(0.75) - wp.float64(0.25) * y * y) * y


@wp.kernel(module="unique")
def middles(x: wp.array(dtype=wp.vec3d), lines: wp.array(dtype=wp.vec2i), middle: wp.array(dtype=wp.vec3)):
    line = wp.tid()
    middle[line] = wp.vec3(wp.float64(0.5) * (x[lines[line][0]] + x[lines[line][1]]))


@wp.kernel(module="unique")
def push_lines(
    x: wp.array(dtype=wp.vec3d),
    lines: wp.array(dtype=wp.vec2i),
    natural: wp.array(dtype=wp.float64),
    grid: wp.uint64,
    middle: wp.array(dtype=wp.vec3),
    reach: float,
    radius: wp.float64,
    stiffness: wp.float64,
    force: wp.array(dtype=wp.vec3d),
):
    line = wp.tid()
    i, j = lines[line][0], lines[line][1]
    u, touch, one = x[j] - x[i], wp.float64(2.0) * radius, wp.float64(1.0)
    for other in wp.hash_grid_query(grid, middle[line], reach):
        k, m = lines[other][0], lines[other][1]
        if other > line and i != k and i != m and j != k and j != m:
            w, p = x[m] - x[k], x[i] - x[k]
            normal = wp.cross(u, w)
            square, off = wp.dot(normal, normal), wp.dot(p, normal)
            if off * off < touch * touch * square:
                s, t = wp.dot(wp.cross(w, p), normal) / square, wp.dot(wp.cross(u, p), normal) / square
                long, wide, high = wp.length(u) / touch, wp.length(w) / touch, wp.abs(off) / wp.sqrt(square)
                share = smooth(s * long) - smooth((s - one) * long)
                share *= smooth(t * wide) - smooth((t - one) * wide)
                share *= radius * (long / natural[line] + wide / natural[other])
                room = wp.sqrt(touch * touch - high * high)
                shape = room / radius
                size = share * stiffness * high * shape * shape * shape / wp.sqrt(wp.float64(27.0))
                push = size * wp.sign(off) / wp.sqrt(square) * normal
                wp.atomic_add(force, i, (one - s) * push)
                wp.atomic_add(force, j, s * push)
                wp.atomic_sub(force, k, (one - t) * push)
                wp.atomic_sub(force, m, t * push)


def contacts(problem, x, lines, natural, force):
    """The function of a step's number that adds the contact forces."""
    count, reach = len(problem.lines), float(problem.natural.max() * 1.3 + 2.0 * problem.line_radius + SKIN)
    grid, middle = wp.HashGrid(32, 32, 32), wp.zeros(count, dtype=wp.vec3)
    ball = [problem.ball, wp.float64(problem.ball_radius), wp.float64(problem.ball_stiffness)]
    line = [reach, wp.float64(problem.line_radius), wp.float64(problem.line_stiffness)]

    def push(n):
        if n % EVERY == 0:
            wp.launch(middles, count, [x, lines, middle])
            grid.build(middle, reach)
        wp.launch(push_ball, count, [x, lines, *ball, force])
        wp.launch(push_lines, count, [x, lines, natural, grid.id, middle, *line, force])

    return push


def capture(problem, steps):
    return impact(problem, steps, contacts)


def draws(problem, steps):
    return by_processes(impact, problem, steps=steps)
