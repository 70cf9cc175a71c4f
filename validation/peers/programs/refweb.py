"""refweb: a scene of the same net."""

import numpy as np

import refweb

COMPILES = True


def version():
    return f"refweb {refweb.__version__}"


def scene(problem, effects, **parts):
    web = refweb.Inline(
        points=problem.points.tolist(),
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


def thrown(problem, steps=None, observe=(), **method):
    effects = [
        refweb.PointMass(node=problem.node, mass=problem.mass),
        refweb.Velocity(node=problem.node, value=(0.0, 0.0, problem.speed)),
    ]
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


def form(problem, force_density=7.0):
    cable = refweb.Cable(law="force-density", force_density=force_density, modulus=1e9, area=1e-6, density=1000.0)
    web = refweb.Inline(
        points=problem.points.tolist(), lines=problem.lines.tolist(), supports=problem.supports.tolist()
    )
    return refweb.run(refweb.Scene(web=web, cable=cable), progress=False).positions
