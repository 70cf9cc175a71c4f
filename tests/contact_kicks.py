"""One kick of explicit dynamics by losses that are solved for, as tests ask for it."""

from __future__ import annotations

import numpy as np

from refweb.compiled.rows import records_of
from refweb.compiled.tables import Functions
from refweb.effects import contact_solver
from refweb.effects.base import CONTACT_COLUMNS, TOUCH
from refweb.kernels import CONTACT, LAW, MEMORY, PART
from refweb.net.rotation import RigidRotations

SPACE, PARTS = 400, 12


class Solved:
    """The contacts of a system in one kick, and their forces.

    Parameters
    ----------
    system : refweb.system.system.System
        Some of its terms have losses that are solved for.
    x, v : ndarray, shape (rows, 3)
        Displacement [m] and velocity ahead of the kick [m/s].
    h : float
        Size of the kick [s].
    f : ndarray, shape (rows, 3), optional
        Other forces [N].
    mass : ndarray, shape (rows,), optional
        Masses in place of those of the net [kg].
    sweeps : int
        Largest number of sweeps.

    Attributes
    ----------
    terms : list of refweb.effects.base.ForceTerm
        Those with such losses.
    contacts, parts : ndarray
        Of `refweb.kernels.CONTACT`, and of `refweb.kernels.PART` from ``first`` of a contact on.
    forces : ndarray, shape (rows, 3)
        Those of the contacts [N].
    after, mean : ndarray, shape (rows, 3)
        Velocity behind the kick, and the mean of both [m/s], with those of nodes that bodies carry.
    power : float
        Power that is booked [W].
    felt : ndarray, shape (3,)
        Sum of the forces that cells show as felt by bodies [N].
    sweeps : int
        Number of sweeps before the last.
    """

    def __init__(self, system, x, v, h, f=None, mass=None, sweeps=1000):
        net, self.terms = system.net, [term for term in system.terms if term.velocity.implicit is not None]
        mass = net.mass if mass is None else mass
        inverse = np.where(system.supported, 0.0, 1.0 / np.where(mass > 0.0, mass, 1.0)[:, None])
        contacts, parts = np.zeros(SPACE, CONTACT), np.zeros(SPACE * PARTS, PART)
        contacts["first"] = PARTS * np.arange(SPACE)
        ends, count = [], 0
        for m, term in enumerate(self.terms):
            begin = count
            count = term.velocity.implicit.detect(x, term.cells, term.data, np.empty((0, 0)), contacts, parts, begin)
            contacts["term"][begin:count] = m
            ends.append((begin, count))
        assert count <= SPACE
        turns, carriers = RigidRotations.of(net), np.full(system.rows, -1)
        carriers[turns.carried[:, 0]] = np.arange(len(turns.carried))
        for n in range(count):
            if len(turns.carried):
                contact_solver.carry(n, x, carriers, turns, contacts, parts)
            contact_solver.prepare(h, n, v, inverse, contacts, parts)
        laws = Functions(LAW, [term.velocity.implicit.law for term in self.terms])
        total = np.zeros_like(v) if f is None else f.copy()
        for self.sweeps in range(sweeps):
            change = contact_solver.gauss_seidel(h, self.sweeps, total, inverse, contacts, parts, count, laws)
            if not change > 1e-15 * np.abs(v).max():
                break
        self.forces = total if f is None else total - f
        self.after = v + h * inverse * total
        if system.carried.any():
            system.drive(0.0, x.copy(), self.after)
        self.mean, self.power, self.felt = 0.5 * (v + self.after), 0.0, np.zeros(3)
        for term, (begin, end) in zip(self.terms, ends, strict=True):
            out, memory = np.ones((len(term.cells), term.columns)), np.zeros((len(term.cells), 8), MEMORY)
            contact_solver.commit(1, memory, self.mean, contacts, parts, begin, end, out)
            self.power += out[:, 0].sum()
            if term.columns == CONTACT_COLUMNS:
                self.felt += records_of(TOUCH, out)["force"].sum(axis=0)
        self.contacts, self.parts = contacts[:count], parts

    def rows(self, contact):
        """Rows that a contact moves."""
        first = contact["first"]
        return self.parts["row"][first : first + contact["count"]]
