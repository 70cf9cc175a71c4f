"""Common part of CVODE and IDA: a solver of SUNDIALS that takes the steps, and the linear systems in them.

`LINEAR_SOLVERS` says how these are solved. By "block" displacements are eliminated by hand, and what is left, a matrix
of half the size or less, is factorized as the preconditioner of GMRES. Where that inverts the Jacobian exactly, one
iteration does, and nothing is multiplied: what is to be inverted is the Jacobian times a vector that is known.

May change: `DENSE`, texts in `LINEAR_SOLVERS`. Must stay: keys of `LINEAR_SOLVERS`, which scenes name and
`settings.Dynamic` lists; `_made`, `_initial` and `linear_options`, which `cvode` and `ida` bring, and private methods
that they call; what SUNDIALS prints becomes the reason in a message; `Sundials` and `Symmetric`, which `cvode` and
`ida` import; private methods of `Sundials`, which `ida` and `cvode` call. Tests:
``tests/dynamics/integrators/test_cvode.py``, ``test_ida.py``.
"""

from __future__ import annotations

import contextlib
import ctypes
import io
import os
import re
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from ...effects.base import refuse_found
from ...system.factorization import Factor
from .step_observer import StepObserver, Stopped

LINEAR_SOLVERS = {
    "block": "GMRES with the true Jacobian, preconditioned by the block elimination",
    "sparse": "SuperLU_MT on the whole Jacobian, values in its fixed pattern",
    "dense": "LU of the whole Jacobian",
    "fixed-point": "none: corrector iterations only, for steps that an explicit method could take",
}
DENSE = 80
"""Unknown displacements up to which a dense factorization is the fastest."""


class Sundials(StepObserver):
    """A solver of SUNDIALS on one system.

    A subclass brings what is named below as its own, and says in `__init__` what `max_order` is.

    Parameters
    ----------
    system, probes, sums, events, rtol, atol_position, atol_velocity
        See `refweb.dynamics.integrators.step_observer.StepObserver`.

    Attributes
    ----------
    linear_solver, choice : str
        Linear solver, and the reason for it.
    """

    takes_rotations = takes_flows = takes_internal = True
    linear_solver = choice = ""
    max_order: int
    _symmetric: Symmetric
    jacobian: Callable[..., Any]

    def __init__(self, system, *observed, **tolerances):
        super().__init__(system, *observed, **tolerances)
        refuse_found(system.terms, f'method = "{self.method}"')
        self._product, self._exact, self._true = None, False, False
        internal = system.internal
        self._inner = (
            np.zeros(0, dtype=np.int64) if internal is None else np.searchsorted(system.free, internal.components)
        )
        heavy = bool((np.repeat(system.net.mass, 3)[system.free] > 0.0).all())
        self._definite = heavy and system.convex and not len(self._inner)  # M + γ²K is, since K has no negative part

    def tolerance(self):
        """Absolute tolerances of unknown displacements and of velocities, each of shape (unknowns,)."""
        both = [np.full(self.unknowns, size) for size in (self.atol_position, self.atol_velocity)]
        if len(self._inner):
            of_lines = self._inner[self.system.internal.elements >= 0]  # strains
            both[0][of_lines] /= self.system.natural_length(0.0).min()
        if self.rotations:
            self.rotations.scale(both[0], False)
            self.rotations.scale(both[1], True)
        return both

    def force_at(self, t, x, v):
        """Force on each unknown [N], with that of material that comes or goes; masses become those of the time."""
        force = super().force_at(t, x, v)
        if self.system.net.flows:
            flow, free = self.system.material_flow, self.system.free
            self._set_masses(np.repeat(flow.masses(t, x), 3)[free])
            force = force + flow.force(t, x, v).ravel()[free]
        return force

    def tangents(self, t, x, v):
        """Values of K, and of C or None, at a state of all rows; a drum that moves is not coupled.

        C has what resists internal variables, c z' = f.
        """
        K, C = super().tangents(t, x, v)
        if self.system.net.flows:
            C = np.zeros_like(K) if C is None else C
            rates = self.system.material_flow.rates(t, x, v)
            C[self.system.pattern.diagonal] += np.repeat(rates, 3)[self.system.free]
        if len(self._inner):
            C = np.zeros_like(K) if C is None else C
            C[self.system.pattern.diagonal[self._inner]] += self.system.resistance(t)
        return K, C

    def _set_masses(self, mass):
        """Take other masses of the unknowns [kg]."""
        raise NotImplementedError

    # What a subclass brings, besides `jacobian` as its solver calls it

    def _made(self, **options):
        """The solver of sksundae at the tolerances."""
        raise NotImplementedError

    def _initial(self, t, x, v):
        """Arguments of ``init_step`` of the solver."""
        raise NotImplementedError

    def linear_options(self) -> dict:
        """The linear solver, as options; a "block" one factorizes with `_symmetric`."""
        raise NotImplementedError

    # What is made of it

    def spent(self, course):
        """Statistics of a run, and the linear solver with the reason for it, for ``run.json``."""
        made = {"linear_solver": self.choice, "factorization": self.system.factorized_by}
        return {**super().spent(course), **made}

    # The linear solver

    def _choose(self, name, large, why=""):
        """Take the linear solver that is asked for; of "auto" a dense one for few unknowns, else ``large``."""
        if name != "auto":
            self.linear_solver, self.choice = name, f"{name}, as asked for: {LINEAR_SOLVERS[name]}"
            return
        few = self.unknowns <= DENSE
        name = "dense" if few else large
        size = f"{self.unknowns} unknowns, {'at most' if few else 'more than'} {DENSE}"
        self.linear_solver, self.choice = name, f"{name}, for {size}{why}: {LINEAR_SOLVERS[name]}"

    def _full_matrix(self, rows, columns, size):
        """Options for a Jacobian whose values stand at these rows and columns, where several of a place add up."""
        if self.linear_solver == "dense":
            self._places = rows * size + columns
            return dict(linsolver="dense", jacfn=self.jacobian)
        from scipy.sparse import csc_matrix

        keys, self._places = np.unique(columns * size + rows, return_inverse=True)
        indptr = np.searchsorted(keys, size * np.arange(size + 1)).astype(np.int32)
        pattern = csc_matrix((np.ones(keys.shape), (keys % size).astype(np.int32), indptr), shape=(size, size))
        return dict(linsolver="sparse", sparsity=pattern, jacfn=self.jacobian)

    def _write(self, J, values):
        """Write values at the places of `_full_matrix` to a dense matrix, or to the values of a sparse one."""
        self.stats["nlu"] += 1
        J[:] = np.bincount(self._places, values, J.size).reshape(J.shape)

    def _factorize(self, values, definite, able=True):
        """Factorize a matrix of the system's pattern for a preconditioner.

        Where it is not definite, or not even ``able`` to be that, what ``definite()`` gives takes its place, and
        `_true` is false.
        """
        system, self._true = self.system, able
        self.stats["nlu"] += 1
        if not system.symmetric:
            self._factor = Unsymmetric(system.pattern, values)
            return
        self._factor = self._symmetric
        if able:
            self._factor.update(values)
            self._true = self._definite or not self._factor.negative_pivots()
        if not self._true:
            self.stats["nlu"] += 1
            self._factor.update(definite())

    def _inverts(self, z, exact):
        """Write to z what is known to be the solution, if anything is; ``exact`` is whether J is what is factorized."""
        self._exact, product, self._product = exact, self._product, None
        if product is None or not exact:
            return False
        z[:] = product  # what is to be solved for is J times it
        return True

    def _multiplied(self, u):
        """Note what J is multiplied with; whether its product may be left out, since the preconditioner inverts it."""
        self._product = u.copy()
        return self._exact

    # Steps

    def begin(self, t, x, v):
        """Make the solver at a state of the unknowns."""
        options = dict(max_order=self.max_order, rtol=self.rtol, max_num_steps=10_000_000, **self.linear_options())
        with _heard(), _quiet():
            self._solver = self._made(**options)
            self._end = _checked(self._solver.init_step(t, *self._initial(t, x, v)))
        self._reached, self._unready = t, self.linear_solver == "sparse"
        if self._unready:  # SUNDIALS cannot free what SuperLU_MT has not factorized yet: a run may end before that
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(self._solver))

    def step(self, stop, end):
        """Take a step of the solver, not beyond ``stop``, on the way to ``end``."""
        with _heard():
            reached = self._one_step(stop, end)
            if reached == self._reached:  # SUNDIALS first returns the end of the step that it was last asked inside of
                reached = self._one_step(stop, end)
        if self._unready:
            self._unready = False
            ctypes.pythonapi.Py_DecRef(ctypes.py_object(self._solver))
        self._reached = reached
        return reached

    def _one_step(self, stop, end):
        """Take a step; return its time."""
        self._end = _checked(self._solver.step(end, "onestep", float(stop) if np.isfinite(stop) else None))
        return float(self._end.t)

    def _solution(self, t):
        """Solution of the solver at a time within the last step, or at its end."""
        return self._end if t == self._end.t else _checked(self._solver.step(t))


class Symmetric(Factor):
    """LDLᵀ solved once and not refined, for preconditioners and for the mass matrix, whose condition is small."""

    def apply(self, b):
        """Solution of A y = b."""
        return self._by.solve(b)


class Unsymmetric:
    """LU as a preconditioner, where an effect makes the tangent unsymmetric."""

    def __init__(self, pattern, values):
        from scipy.sparse.linalg import splu

        self._lu = splu(pattern.matrix(values), permc_spec="MMD_AT_PLUS_A")

    def apply(self, b):
        """Solution of A y = b."""
        return self._lu.solve(b)


def _checked(result):
    if result.status < 0:
        raise Stopped(result.message)
    return result


@contextlib.contextmanager
def _heard():
    """Keep what SUNDIALS prints, as the reason for which it stopped."""
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said):
            yield
    except Stopped as stop:
        reason = re.sub(r"\[\w+, Error: (-?\d+)\]", "", said.getvalue())
        raise Stopped(" ".join(reason.split()) or str(stop)) from None


@contextlib.contextmanager
def _quiet():
    """Make a solver that writes no warnings to the terminal: what counts is in the message of its failure."""
    names = ("SUNLOGGER_WARNING_FILENAME", "SUNLOGGER_ERROR_FILENAME")
    before = {name: os.environ.get(name) for name in names}
    os.environ.update(dict.fromkeys(names, os.devnull))
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="Custom sparse Jacobian approximation will be ignored")
            yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
