"""Many impacts on a small net on two cores."""

from dataclasses import replace

import numpy as np

from ..programs import refweb
from ..truth import Truth, verlet
from ..webs import paper, problem
from . import Work

PROGRAMS = ("refweb", "mujoco", "opensees", "exudyn", "kratos", "warp")


def cases(quick):
    speeds = np.random.default_rng(1).uniform(0.5, 1.5, 8 if quick else 200)
    return problem(paper(quick=True), mass=1.0, speed=1.0, duration=0.02 if quick else 0.1, draws=speeds)


def right(problem, steps=4000):
    """Last positions of the thrown mass, each by a run of its own."""
    runs = [replace(problem, speed=speed) for speed in problem.draws.tolist()]
    found = np.array([refweb.impact(run, steps=steps // 2, method="explicit", order=6)[run.node] for run in runs])
    other = np.array([verlet(run, steps)[run.node] for run in runs])
    apart = float(np.abs(found - other).max())
    return Truth(found, apart, f"refweb's steps of order 6 and {steps} steps of the Verlet method in NumPy")


WORKS = (
    Work(
        name="draws",
        title="200 impacts on two cores",
        said="The impact on a net of 112 lines at 200 speeds, drawn from 0.5 to 1.5 m/s, by two processes or threads. "
        "Error: the mass after 0.1 s. CPU time is that of all processes, wall time that which the user waits; each is "
        "run as a user would, refweb by a sweep, whose processes import it, MuJoCo by threads that share a model, the "
        "others by processes that are copies of the first. Memory is that of the first.",
        task="draws",
        problem=cases,
        truth=right,
        settings=dict.fromkeys(PROGRAMS, [{"steps": 1250}]) | {"dop853": [{"rtol": 1e-2}, {"rtol": 1e-3}]},
        target=5e-5,
        quick=dict.fromkeys(PROGRAMS, [{"steps": 250}]) | {"dop853": [{"rtol": 1e-3}]},
    ),
)
