"""Newton: particles and its springs, which push as well as pull, in single precision."""

import newton
import numpy as np
import warp as wp

COMPILES = True
wp.config.quiet = True


def version():
    return f"Newton {newton.__version__}, Warp {wp.__version__}"


def impact(problem, steps):
    builder = newton.ModelBuilder(gravity=(0.0, 0.0, 0.0))
    masses = np.where(problem.free, problem.masses, 0.0)  # a particle without mass does not move
    for point, velocity, mass in zip(problem.start.tolist(), problem.velocities.tolist(), masses.tolist(), strict=True):
        builder.add_particle(point, velocity, mass, radius=0.0)
    for (i, j), length in zip(problem.lines.tolist(), problem.natural.tolist(), strict=True):
        builder.add_spring(i, j, problem.ea / length, 0.0, 0.0)
        builder.spring_rest_length[-1] = length  # in place of that between the particles
    model = builder.finalize(device="cpu")
    solver = newton.solvers.SolverSemiImplicit(model)
    before, after, control = model.state(), model.state(), model.control()
    for _ in range(steps):
        before.clear_forces()
        solver.step(before, after, control, None, problem.duration / steps)
        before, after = after, before
    return before.particle_q.numpy().astype(float)
