"""NVIDIA Warp on the CPU: kernels of one's own in double precision, one for lines and one for nodes."""

import numpy as np
import warp as wp

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


def impact(problem, steps):
    velocity = problem.velocities  # flat and slack lines do not pull: also those half a step before
    with wp.ScopedDevice("cpu"):
        x, v = wp.array(problem.start, dtype=wp.vec3d), wp.array(velocity, dtype=wp.vec3d)
        lines, natural = wp.array(problem.lines, dtype=wp.vec2i), wp.array(problem.natural, dtype=wp.float64)
        weight = wp.array(np.where(problem.free, 1.0 / problem.masses, 0.0), dtype=wp.float64)
        force, step = wp.zeros_like(x), problem.duration / steps
        for _ in range(steps):
            wp.launch(pull, len(problem.lines), [x, lines, natural, wp.float64(problem.ea), force])
            wp.launch(move, len(problem.points), [x, v, force, weight, wp.float64(step)])
        return x.numpy()
