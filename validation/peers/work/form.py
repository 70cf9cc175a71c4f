"""Form finding by force densities."""

import numpy as np

from ..problem import Problem
from ..truth import Truth
from . import Work


def saddle(quick, side=100):
    """A square grid within a rim that is twisted; nodes within start at height 0."""
    side = 10 if quick else side
    number = np.arange((side + 1) ** 2).reshape(side + 1, side + 1)
    plan = np.stack(np.meshgrid(*2 * [np.arange(side + 1.0)], indexing="ij"), axis=-1).reshape(-1, 2)
    rim = (plan == 0).any(axis=1) | (plan == side).any(axis=1)
    lines = np.vstack([np.column_stack([number[:-1].ravel(), number[1:].ravel()]),
                       np.column_stack([number[:, :-1].ravel(), number[:, 1:].ravel()])])  # fmt: skip
    used, lines = np.unique(lines[~rim[lines].all(axis=1)], return_inverse=True)
    lines = lines.reshape(-1, 2)
    points = np.column_stack([plan, np.where(rim, height(plan, side), 0.0)])[used]
    return Problem(
        points=points,
        lines=lines,
        natural=np.ones(len(lines)),
        supports=np.flatnonzero(rim[used]),
        ea=1e3,
        density=0.1,
        node=0,
    )


def height(plan, side):
    return (plan[:, 0] - side / 2) * (plan[:, 1] - side / 2) / side


def exact(problem):
    """Closed form: each node is in the middle of its four neighbours, and so is z = x y/side."""
    plan = problem.points[:, :2]
    found = np.column_stack([plan, height(plan, plan.max())])
    return Truth(found, 0.0, "the closed form z = x y/side of a grid of one force density")


WORKS = (
    Work(
        name="form",
        title="Form finding of 100 × 100",
        said="A square grid of 100 × 100 cells of one force density within a twisted rim, 19 800 lines.",
        task="form",
        problem=saddle,
        truth=exact,
        settings={"refweb": [{}], "jax_fdm": [{}]},
        target=1e-6,
    ),
)
