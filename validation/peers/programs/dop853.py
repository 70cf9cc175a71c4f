"""SciPy's DOP853 with forces in NumPy, as a program of a tether or kite of one's own has them."""

import numpy as np
import scipy
from scipy.integrate import solve_ivp

from ..contact import Contacts
from ..many import by_processes

COMPILES = False


def version():
    return f"scipy {scipy.__version__}"


def impact(problem, rtol, forces=None):
    forces = forces or problem.forces
    free, count = problem.free, len(problem.points)
    weight = np.where(free, 1.0 / problem.masses, 0.0)[:, None]

    def rate(t, state):
        x, v = state.reshape(2, count, 3)
        return np.concatenate([v, weight * forces(x)]).ravel()

    start = np.concatenate([problem.start, problem.velocities]).ravel()
    found = solve_ivp(rate, (0.0, problem.duration), start, "DOP853", rtol=rtol, atol=1e-3 * rtol)
    if not found.success:
        raise RuntimeError(found.message)
    return found.y[: 3 * count, -1].reshape(count, 3)


def draws(problem, rtol):
    return by_processes(impact, problem, rtol=rtol)


def capture(problem, rtol):
    contacts = Contacts(problem)
    return impact(problem, rtol, lambda x: problem.forces(x) + contacts.forces(x))
