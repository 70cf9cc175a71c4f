"""Newton: particles and its springs, which push as well as pull, in single precision."""

import newton
import numpy as np
import warp as wp

COMPILES = True
wp.config.quiet = True


def version():
    return f"Newton {newton.__version__}, Warp {wp.__version__}"


def particles(problem, ball=None):
    """Nodes but the ball, and lines."""
    builder = newton.ModelBuilder(gravity=(0.0, 0.0, 0.0))
    masses = np.where(problem.free, problem.masses, 0.0)  # a particle without mass does not move
    for n, (point, velocity, mass) in enumerate(zip(problem.start, problem.velocities, masses, strict=True)):
        if n != ball:
            builder.add_particle(point.tolist(), velocity.tolist(), float(mass), radius=0.0)
    for (i, j), length in zip(problem.lines.tolist(), problem.natural.tolist(), strict=True):
        builder.add_spring(i, j, problem.ea / length, 0.0, 0.0)
        builder.spring_rest_length[-1] = length  # in place of that between the particles
    return builder


def moved(model, problem, steps, contacts=None):
    """The state at the end."""
    solver = newton.solvers.SolverSemiImplicit(model)
    before, after, control = model.state(), model.state(), model.control()
    for _ in range(steps):
        before.clear_forces()
        if contacts:
            model.collide(before, contacts)
        solver.step(before, after, control, contacts, problem.duration / steps)
        before, after = after, before
    return before


def impact(problem, steps):
    return moved(particles(problem).finalize(device="cpu"), problem, steps).particle_q.numpy().astype(float)


def capture(problem, steps):
    """Its contact has particles and triangles, no lines: nodes touch the ball, and lines pass each other."""
    builder = particles(problem, problem.ball)
    ball = builder.add_body(
        xform=wp.transform(problem.start[problem.ball], wp.quat_identity()), mass=float(problem.masses[problem.ball])
    )
    builder.add_shape_sphere(ball, radius=problem.ball_radius, cfg=newton.ModelBuilder.ShapeConfig(density=0.0))
    model = builder.finalize(device="cpu")
    model.soft_contact_ke, model.soft_contact_kd = problem.ball_stiffness, 0.0
    model.soft_contact_kf, model.soft_contact_mu = 0.0, 0.0
    model.particle_grid = None
    before = moved(model, problem, steps, model.contacts())
    return np.vstack([before.particle_q.numpy(), before.body_q.numpy()[:, :3]]).astype(float)
