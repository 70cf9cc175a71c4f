"""``method = "auto"`` tries other methods where the one that it chose cannot finish, before it gives up."""

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
"""What is tried in turn: the cheapest steps, then methods that choose steps by their error, the most robust first."""


class Refusal(NamedTuple):
    """A method that could not finish a scene, and why."""

    method: str
    why: str


class MethodFallback:
    """The methods that a scene of ``method = "auto"`` is given to, one after another.

    Parameters
    ----------
    scene : refweb.Scene
        As it is asked for.
    system : refweb.system.system.System
        What acts.
    kept : dict of str to ndarray, optional
        Checkpoint of a run that goes on, by the method that it had come to.

    Attributes
    ----------
    refused : list of Refusal
        Methods that could not finish it.
    choice : refweb.dynamics.method_choice.Choice
        The one it is given to.
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
        """The scene with the method it is given to."""
        return self._scene.replace(solve=self.choice.solve)

    def record(self):
        """Record of the choice for ``run.json``."""
        refused = {"refused": [refusal._asdict() for refusal in self.refused]} if self.refused else {}
        return {"choice": self.choice.reason, **refused}

    def arrays(self):
        """Arrays that a checkpoint keeps."""
        methods, why = ([refusal[i] for refusal in self.refused] for i in range(2))
        return {"refused_methods": np.array(methods, dtype=str), "refused_why": np.array(why, dtype=str)}

    def give_over(self, error):
        """Give the scene to the next method that takes it, where one could not finish; in words.

        Parameters
        ----------
        error : refweb.errors.IntegrationError
            Why it did not.

        Raises
        ------
        SolverError
            Where there is none: with the reasons of all.
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
        """The `Choice` of the first of `OTHERS` that is untried and takes the scene; None where there is none."""
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
    """Name of a method, with that of its family where it has several: ``cvode adams``."""
    return f"{solve.method} {solve.family}" if solve.family else solve.method
