"""Fallback of ``method = "auto"``: other methods, if the chosen one cannot finish.

May change: the order of `OTHERS` and words of texts. Must stay: keys of `arrays`, which stand in ``checkpoint.npz``,
and of `record`, which stand in ``run.json``; `simulation` calls the public methods. A new method of dynamics that may
stand in for others belongs in `OTHERS`. Must stay as well: `MethodFallback`, which `simulation` imports. Tests:
``tests/dynamics/test_fallback.py``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..errors import InputError, SolverError
from ..registry import INTEGRATORS
from .method_choice import Choice, decided, given_to

OTHERS = (
    {"method": "central-difference"},
    {"method": "explicit"},
    {"method": "cvode", "family": "bdf"},
    {"method": "cvode", "family": "adams"},
    {"method": "ida"},
)
"""Methods that are tried in turn: the cheapest steps first, then methods that control their error, the most robust
first."""


class Refusal(NamedTuple):
    """A method that could not finish a scene, and the reason."""

    method: str
    why: str


class MethodFallback:
    """The methods that solve a scene of ``method = "auto"``, one after another.

    Parameters
    ----------
    scene : refweb.Scene
        The scene as given.
    system : refweb.system.system.System
        The system.
    kept : dict of str to ndarray, optional
        Checkpoint of a run that continues, with its method.

    Attributes
    ----------
    refused : list of Refusal
        Methods that could not finish the scene.
    choice : refweb.dynamics.method_choice.Choice
        The present method.
    """

    def __init__(self, scene, system, kept=None):
        self._scene, self._system = scene, system
        self.choice, self.refused = decided(scene, system), []
        names = [] if kept is None else kept.get("refused_methods", np.zeros(0, dtype=str)).tolist()
        for name, why in zip(names, [] if kept is None else kept.get("refused_why", names), strict=True):
            self.refused.append(Refusal(name, str(why)))
        if self.refused and (choice := self._next()) is not None:
            self.choice = choice

    @property
    def scene(self):
        """The scene with the present method."""
        return self._scene.replace(solve=self.choice.solve)

    def record(self):
        """Record of the choice for ``run.json``."""
        refused = {"refused": [refusal._asdict() for refusal in self.refused]} if self.refused else {}
        return {"choice": self.choice.reason, **refused}

    def arrays(self):
        """Arrays for a checkpoint."""
        methods, why = ([refusal[i] for refusal in self.refused] for i in range(2))
        return {"refused_methods": np.array(methods, dtype=str), "refused_why": np.array(why, dtype=str)}

    def give_over(self, error):
        """Change to the next method that takes the scene, after an error; return a text on it.

        Parameters
        ----------
        error : refweb.errors.IntegrationError
            Error of the method that could not finish.

        Raises
        ------
        SolverError
            If there is no further method, with the reasons of all.
        """
        self.refused.append(Refusal(name_of(self.choice.solve), str(error)))
        choice = self._next()
        if choice is None:
            if len(self.refused) == 1:
                raise error
            reasons = "; ".join(f"{refusal.method}: {refusal.why}" for refusal in self.refused)
            raise SolverError(f'method = "auto" finds no method that can finish; {reasons}') from None
        self.choice = choice
        last = self.refused[-1]
        return f'method = "auto": {last.method} cannot finish, {name_of(choice.solve)} takes over; {last.why}'

    def _next(self):
        """The `Choice` of the first untried method of `OTHERS` that takes the scene; None if there is none."""
        tried = [refusal.method for refusal in self.refused]
        for keys in OTHERS:
            solve = given_to(self._scene, **keys)
            if name_of(solve) not in tried and self._takes(solve):
                return Choice(solve, f"{', '.join(tried)} could not finish")
        return None

    def _takes(self, solve):
        """Tell if a method takes the scene."""
        try:
            INTEGRATORS[solve.method].integrator_of(solve, self._system)
        except InputError:
            return False
        return True


def name_of(solve):
    """Name of a method, with that of its family if it has several: ``cvode adams``."""
    return f"{solve.method} {solve.family}" if solve.family else solve.method
