"""An independent method for `refweb.studies.work_precision`: scipy's DOP853 with the same forces.

It shares forces, monitors and starts with the methods of refweb and no formula for a step, so that it stays an
independent reference. May change: `TOLERANCES`, which moves points of the diagram. Must stay: that independence;
`NAME`, which `trials`, `cost` and `diagram` read; `Dop853`, which `trials` imports. Tests:
``tests/studies/test_cost.py``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..errors import InputError, SolverError
from ..results.state import State

NAME, TOLERANCES = "dop853", (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
"""Name of the method, and its relative tolerances from coarse to fine."""


class Followed(NamedTuple):
    """Outcome of a run of DOP853.

    Attributes
    ----------
    values : ndarray, shape (rows,)
        The observable at each time.
    x : ndarray, shape (rows of the system, 3)
        Displacement at the end [m].
    nsteps, nfev : int
        Steps and evaluations of forces.
    looking : float
        Time of evaluating the observable at the rows [s], which is not part of the method's cost.
    """

    values: np.ndarray
    x: np.ndarray
    nsteps: int
    nfev: int
    looking: float


class Dop853:
    """DOP853 on one system.

    Parameters
    ----------
    system : refweb.system.system.System
        The system that moves.
    begin : refweb.dynamics.initial_state.Start
        Initial state.

    Raises
    ------
    InputError
        For nodes without mass, links and breaks.
    """

    def __init__(self, system, begin):
        from ..effects.base import refuse_flows
        from ..system.mass import refuse_massless

        refuse_massless(system, NAME)
        refuse_flows(system.net, NAME)
        if system.constraints:
            raise InputError(f'[[link]] needs method = "ida": {NAME} does not hold lengths')
        if system.weakness is not None and (system.weakness.watched or system.weakness.times):
            raise InputError(f"[rupture] has breaks, which {NAME} does not find")
        self.system, self._unknowns = system, len(system.free)
        x = np.zeros((system.rows, 3)) if begin.x is None else begin.x.copy()
        v = system.initial_velocity() if begin.v is None else begin.v.copy()
        v[system.supported] = 0.0
        system.drive(0.0, x, v)
        self._start = np.concatenate([x.ravel()[system.free], v.ravel()[system.free]])
        self._supported, self._mass = np.where(system.supported, x, 0.0), np.repeat(system.net.mass, 3)[system.free]
        self._consistent = system.net.consistent_minus_lumped is not None
        self._breaks, self._rotations = system.corners, None
        if system.turning:
            from ..dynamics.integrators.rotations import Rotations

            self._rotations = Rotations(system)
        self._thickness = min((body.thickness for body in system.net.bodies), default=np.inf)

    def _rows(self, t, y):
        """Displacement and velocity of all rows at a state of the unknowns."""
        system, n = self.system, self._unknowns
        x, v = self._supported.copy(), np.zeros((system.rows, 3))
        x.ravel()[system.free], v.ravel()[system.free] = y[:n], y[n:]
        system.drive(t, x, v)
        return x, v

    def _rate(self, t, y):
        system, n = self.system, self._unknowns
        rows = self._rows(t, y)
        force = system.force(t, *rows).ravel()[system.free]
        over_mass = system.mass.factor.solve(force) if self._consistent else force / self._mass
        rate = y[n:].copy()
        if self._rotations:
            self._rotations.set_rates(*rows, rate)
        return np.concatenate([rate, over_mass])

    def follow(self, times, rtol, observable, clock, check):
        """Advance the system through the times of all rows.

        Parameters
        ----------
        times : ndarray, shape (rows,)
            Times of the rows [s].
        rtol : float
            Relative tolerance; absolute tolerances are rtol times the scales of refweb's solvers.
        observable : refweb.Observe
            Observable that is evaluated at each row.
        clock, check : callable
            ``clock`` returns the time [s]; ``check`` is called after each step and may raise.

        Returns
        -------
        Followed
        """
        from scipy.integrate import DOP853

        from ..dynamics.integrators.tolerances import scales

        y, end, (near, fast) = self._start, times[-1], scales(self.system)
        solver = DOP853(self._rate, 0.0, y, end, rtol=rtol, atol=rtol * np.repeat([near, fast], self._unknowns))
        values, row, steps, looking = np.empty(len(times)), 0, 0, 0.0
        while row < len(values):
            behind = np.searchsorted(self._breaks, solver.t * (1.0 + 1e-12), side="right")
            ahead = self._breaks[behind] if behind < len(self._breaks) else end
            solver.max_step = max(min(ahead - solver.t, self._travel(solver.y)), 1e-12 * end)
            if steps or row:
                message = solver.step()
                steps += 1
                if solver.status == "failed":
                    raise SolverError(f"{NAME} stopped at t = {solver.t:.6g} s: {message}")
            inside = None
            while row < len(values) and times[row] <= solver.t:
                if row:
                    inside = inside or solver.dense_output()
                    y = inside(times[row])
                began = clock()
                x, v = self._rows(times[row], y)
                values[row] = observable.value(State(self.system, times[row], x, v)).value
                looking += clock() - began
                row += 1
            if self._consistent and steps and ahead < end and solver.t > ahead * (1.0 - 1e-12):
                self._turn_corner(solver, ahead)
            check()
        return Followed(values, x, steps, solver.nfev, looking)

    def _travel(self, y):
        """Largest step in which no line can pass through a body [s]."""
        from ..dynamics.integrators.step_limits import TRAVEL

        speed = 2.0 * np.abs(y[self._unknowns :]).max(initial=0.0)
        return TRAVEL * self._thickness / speed if speed > 0.0 else np.inf

    def _turn_corner(self, solver, ahead):
        """Change free velocities at a corner of a motion, as the consistent mass requires."""
        system = self.system
        sides = (self._rows(t, solver.y)[1] for t in (ahead * (1.0 + 1e-12), 0.5 * (solver.t_old + ahead)))
        jump = np.where(system.supported, np.subtract(*sides), 0.0)
        solver.y[self._unknowns :] += system.mass.kick(jump).ravel()[system.free]
        solver.f = self._rate(solver.t, solver.y)
