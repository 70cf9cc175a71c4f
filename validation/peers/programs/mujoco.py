"""MuJoCo: nodes are bodies on three slides, lines are spatial tendons with a dead band below their natural length."""

from concurrent.futures import ThreadPoolExecutor

import mujoco
import numpy as np

COMPILES = False


def version():
    return f"MuJoCo {mujoco.__version__}"


def spec_of(problem, step, damping=0.0):
    spec = mujoco.MjSpec()
    spec.option.timestep, spec.option.gravity = step, (0.0, 0.0, 0.0)
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_EULERDAMP
    free, masses = problem.free, problem.masses
    for n, point in enumerate(problem.start):
        body = spec.worldbody.add_body(name=f"n{n}", pos=point)
        body.add_site(name=f"s{n}")
        if free[n]:
            body.mass, body.inertia, body.explicitinertial = masses[n], 3 * [1e-9], True
            for axis in np.eye(3):
                body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis, damping=damping)
    for (i, j), length in zip(problem.lines, problem.natural, strict=True):
        tendon = spec.add_tendon(stiffness=[problem.ea / length, 0, 0], springlength=(0.0, length))
        tendon.wrap_site(f"s{i}")
        tendon.wrap_site(f"s{j}")
    return spec


def tangle(spec, problem, impedance):
    """Add the contact of lines with the ball and with each other; ``impedance`` is the share of a rigid contact."""
    spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_EULERDAMP
    line = np.median(problem.masses)  # of nodes within a line
    solimp = (impedance, impedance, 1e-3, 0.5, 2.0)
    spec.add_flex(
        name="lines",
        dim=1,
        radius=problem.line_radius,
        vertbody=[f"n{n}" for n in range(len(problem.points)) if n != problem.ball],
        vert=np.zeros(3 * (len(problem.points) - 1)),
        elem=problem.lines.ravel(),
        condim=1,
        selfcollide=mujoco.mjtFlexSelf.mjFLEXSELF_SAP,
        solref=(-problem.line_stiffness / line, 0.0),
        solimp=solimp,
    )
    spec.body(f"n{problem.ball}").add_geom(
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[problem.ball_radius - problem.line_radius, 0.0, 0.0],
        mass=0.0,
        condim=1,
        priority=1,
        solref=(-problem.ball_stiffness / line, 0.0),
        solimp=solimp,
    )


def impact(problem, steps):
    model = spec_of(problem, problem.duration / steps).compile()
    data = mujoco.MjData(model)
    data.qvel[:] = problem.velocities[problem.free].ravel()
    mujoco.mj_step(model, data, nstep=steps)
    mujoco.mj_kinematics(model, data)
    return data.xpos[1:].copy()


def draws(problem, steps):
    """One model, which two threads share: steps run outside of Python's lock."""
    model = spec_of(problem, problem.duration / steps).compile()
    body = problem.node + 1  # the world is the first one

    def one(speed):
        data = mujoco.MjData(model)
        data.qvel[model.body_dofadr[body] + 2] = speed
        mujoco.mj_step(model, data, nstep=steps)
        mujoco.mj_kinematics(model, data)
        return data.xpos[body].copy()

    with ThreadPoolExecutor(2) as pool:
        return np.array(list(pool.map(one, problem.draws.tolist())))


def statics(problem, step=1e-4, damping=0.05, still=1e-6):
    """Damped steps under the last load until nothing moves: MuJoCo has no solver for equilibria."""
    model = spec_of(problem, step, damping).compile()
    data = mujoco.MjData(model)
    data.xfrc_applied[problem.node + 1, 2] = problem.loads[-1]
    while data.time < 10.0:
        mujoco.mj_step(model, data, nstep=500)
        if np.abs(data.qvel).max() < still:
            mujoco.mj_kinematics(model, data)
            return data.xpos[1:].copy()
    raise RuntimeError(f"moves with {np.abs(data.qvel).max():.1e} m/s after {data.time:.0f} s of time")


def capture(problem, steps, impedance=1e-4):
    """Lines are capsules of a flex, whose contact is a soft constraint, with solref of a direct stiffness.

    Its acceleration is that stiffness times the overlap, so that the push is linear in it and grows with the masses of
    a contact: that of the ball is the law of the problem, that of lines is another one, of the same stiffness.
    """
    spec = spec_of(problem, problem.duration / steps)
    tangle(spec, problem, impedance)
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qvel[:] = problem.velocities[problem.free].ravel()
    mujoco.mj_step(model, data, nstep=steps)
    mujoco.mj_kinematics(model, data)
    return data.xpos[1:].copy()
