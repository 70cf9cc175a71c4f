"""refweb: a scene of the same net."""

from dataclasses import replace

import numpy as np

import refweb

COMPILES = True


def version():
    return f"refweb {refweb.__version__}"


def scene(problem, effects, **parts):
    web = refweb.Inline(
        points=(problem.points if problem.dish else problem.start).tolist(),
        lines=problem.lines.tolist(),
        supports=problem.supports.tolist(),
        natural_length=problem.natural.tolist(),
    )
    cable = refweb.Cable(law="tension-only", modulus=problem.ea / 1e-4, area=1e-4, density=problem.density / 1e-4)
    return refweb.Scene(web=web, cable=cable, effects=effects, **parts)


def statics(problem):
    load = refweb.Load(node=problem.node, force=(0.0, 0.0, 1.0))
    solve = refweb.Static(load_steps=problem.loads.tolist())
    return refweb.run(scene(problem, [load], solve=solve), progress=False).positions


def thrown(problem, steps=None, observe=(), more=(), **method):
    masses, velocities = problem.point_masses, problem.velocities
    effects = [refweb.PointMass(node=n, mass=masses[n]) for n in np.flatnonzero(masses).tolist()]
    for value in np.unique(velocities[velocities.any(axis=1)], axis=0).tolist():
        nodes = np.flatnonzero((velocities == value).all(axis=1)).tolist()
        effects.append(refweb.Velocity(node=nodes, value=tuple(value)))
    effects += more
    step = {} if steps is None else {"step_size": problem.duration / steps * (1.0 + 1e-12)}
    parts = {
        "solve": refweb.Dynamic(duration=problem.duration, **step, **method),
        "output": refweb.Output(interval=problem.duration),
        "accuracy": refweb.Accuracy(error="none"),
        "observe": observe,
    }
    return scene(problem, effects, **parts)


def impact(problem, **method):
    return refweb.run(thrown(problem, **method), progress=False).positions


def draws(problem, **method):
    axes = [refweb.Observe(name=k, quantity="position", node=problem.node, component=k) for k in "xyz"]
    speeds = {"velocity.0.value.2": problem.draws.tolist()}
    found = refweb.sweep(thrown(problem, observe=axes, **method), speeds, workers=2, progress=None)
    return np.column_stack([found.values(k) for k in "xyz"])


implicit = impact


def capture(problem, **method):
    """The ball is the last node, which a body stands for here."""
    net = replace(problem, **{key: getattr(problem, key)[:-1] for key in ("points", "weights", "thrown")})
    ball = refweb.Body(
        name="ball",
        radius=problem.ball_radius,
        mass=problem.weights[-1],
        position=tuple(problem.points[-1].tolist()),
        velocity=tuple(problem.thrown[-1].tolist()),
    )
    more = [
        ball,
        refweb.Contact(stiffness=problem.ball_stiffness),
        refweb.SelfContact(radius=problem.line_radius, stiffness=problem.line_stiffness),
    ]
    place = [refweb.Observe(name=k, quantity="position", body="ball", component=k) for k in "xyz"]
    found = refweb.run(thrown(net, more=more, observe=place, **method), progress=False)
    return np.vstack([found.positions, [found.results[k].value for k in "xyz"]])


def form(problem, force_density=7.0):
    cable = refweb.Cable(law="force-density", force_density=force_density, modulus=1e9, area=1e-6, density=1000.0)
    web = refweb.Inline(
        points=problem.points.tolist(), lines=problem.lines.tolist(), supports=problem.supports.tolist()
    )
    return refweb.run(refweb.Scene(web=web, cable=cable), progress=False).positions
