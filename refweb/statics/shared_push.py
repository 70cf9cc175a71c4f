"""Rest of spheres on lines that touch them with several elements alike, which share the push.

Contact with a sphere acts once a line, at the deepest of its elements c, so that the energy is max e_c with
e_c = ½ k (R − d_c)². Where a line of several elements bends around the sphere, two of them may be as deep. The energy
has a kink there: a valley, as it is the larger of two functions, into which both slopes lead. No force of one element
balances the others in it. The push at such a state is any

    Σ α_c f_c,     α_c ≥ 0,     Σ α_c = 1,     α_c > 0 only where e_c is the largest,

the generalized gradient of Clarke [1]_, and the state is an equilibrium if some shares α balance all forces. It is
stable if the tangent with these shares is positive on all moves that keep the largest e_c equal.
`refweb.system.contact_shares` has the contact by given shares.

The method of multipliers [2]_ finds the shares of all lines at once. The energy of each line is replaced by

    φ(x) = max over α of  Σ α_c e_c(x) − ½ w Σ (α_c − β_c)².

Its gradient Σ α_c ∇e_c is continuous, with the α of the simplex that is nearest β + e/w. Its tangent is that of these
α and (1/w) Σ (∇e_c − m)(∇e_c − m)ᵀ over the elements with a share, m being their mean. Newton's method finds an
equilibrium; then β becomes α, until all elements with a share have the same energy. Elements come and go by the
simplex, so that no sets of them are tried. The result does not depend on w. It begins above the energy of a line, where
φ is nearly that of constant shares, and falls to a thousandth of it: in a net of 6 by 6 meshes with 8 elements a line
a ball takes 65 factorizations from its start, and is not found with w a hundredth of the energy from the start.

Dynamics has the force of the deepest element alone. Damped, it comes to the same rest, and goes to and fro about it by
the way of a step.

May change: the limits of w and numbers of rounds: they change the cost and no result. Must stay:
`SharedPush.equilibrium` and ``newton``, which `load_steps` uses; shares of an `Equilibrium` in the order of
`system.contact_shares`. `SharedPush` copies a system and drops its cached properties by name: a new one of `System`
that depends on terms belongs in that list. Tests: ``tests/statics/test_contact_kinks.py``.

References
----------
.. [1] F. H. Clarke, "Optimization and Nonsmooth Analysis", SIAM 1990, chapter 2, doi:10.1137/1.9781611971309.
.. [2] D. P. Bertsekas, "Constrained Optimization and Lagrange Multiplier Methods", Academic Press 1982, chapter 5.
"""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np

from ..effects.base import Balance, ForceTerm, Tangent
from ..net.rotation import to_quaternion
from ..system.contact_shares import STIFFNESS, shareable, shared
from .equilibrium import LIMIT, NotFound, add_spent, force_scale, gone, residual, with_reason
from .newton import Newton

WIDEST, NARROWEST = 100.0, 1e-3
"""w over the energy of a line at the start, and at last: rounding of energies over w is an error of shares."""
STIFF = 2e-6
"""Least w over the energy of a line, times the depth F/k of the largest force over the radius.

Where contact is stiff, that depth is small against the radius, and its rounding moves shares more."""
NARROWER = 0.1
"""Factor on w from one round to the next."""
NEGLIGIBLE = 1e-3
"""Energy of a line below which w is a share of this, over F²/k with the largest force F."""
EQUAL, ENOUGH = 1e-12, 1e-9
"""Difference of energies over the largest one of a line at which rounds end; that at which they may end where it does
not fall."""
ROUNDING = 64.0 * np.finfo(float).eps
"""Error of an energy over its push times the radius, as the depth is a difference of lengths."""
ROUNDS, PARTS, PART = 40, 4, 100
"""Largest number of rounds, and of parts of one and of factorizations of a part; no part follows where a body has left
the web."""


class LineShares:
    """Energy φ of the contact of one term, of cells of which ``pieces`` after each other are a line.

    Parameters
    ----------
    term : refweb.effects.base.ForceTerm
        Contact once an element.
    pieces : int
        Elements of a line.
    once : ndarray of bool, shape (lines,)
        True for contact of a line with a sphere; elements on other bodies share nothing.

    Attributes
    ----------
    before : ndarray, shape (lines, pieces)
        β [1].
    width, narrowest : ndarray, shape (lines,)
        w, and its last value [J].
    """

    def __init__(self, term, pieces, once):
        self.term, self.pieces, self.once = term, pieces, once
        self.before = np.ones((len(once), pieces))
        self.width = self.narrowest = np.ones(len(once))

    def energies(self, t, x):
        """Energy of each element as if its line had no others [J], shape (lines, pieces)."""
        energies = np.zeros(len(self.term.cells))
        self.term.energy(t, x, self.term.cells, self.term.data, energies)
        return energies.reshape(-1, self.pieces)

    def shares(self, energies):
        """α at some energies, shape (lines, pieces): the point of the simplex nearest β + e/w."""
        target = self.before + energies / self.width[:, None]
        decreasing = -np.sort(-target, axis=1)
        over = (np.cumsum(decreasing, axis=1) - 1.0) / np.arange(1, self.pieces + 1)
        last = (decreasing > over).sum(axis=1) - 1
        shares = np.maximum(target - over[np.arange(len(over)), last][:, None], 0.0)
        return np.where(self.once[:, None], shares, 1.0)

    def begin(self, t, x, scale):
        """Set β in proportion to the energies at x, and w; ``scale`` is the largest force [N]."""
        energies = self.energies(t, x)
        touching = self.once & energies.any(axis=1)
        self.before[self.once] = 1.0 / self.pieces
        self.before[touching] = energies[touching] / energies[touching].sum(axis=1)[:, None]
        self.width = np.maximum(WIDEST * energies.max(axis=1), scale * self._laws[0])

    def advance(self, t, x, scale):
        """Take α at x as β and a smaller w; return the largest difference of energies over the largest of its line."""
        (radius, stiffness), energies = self._laws, self.energies(t, x)
        largest, self.before = energies.max(axis=1), self.shares(energies)
        share = np.maximum(NARROWEST, STIFF * radius * stiffness / scale)
        self.narrowest = share * np.maximum(largest, NEGLIGIBLE * scale**2 / stiffness)
        self.width = np.maximum(NARROWER * self.width, self.narrowest)
        differences = np.where(self.before > 0.0, largest[:, None] - energies, 0.0).max(axis=1)
        differences = np.maximum(differences - ROUNDING * radius * np.sqrt(2.0 * stiffness * largest), 0.0)
        pressed = self.once & (largest > 0.0)
        return (differences[pressed] / largest[pressed]).max(initial=0.0)

    def several(self, t, x):
        """Mask of the lines that push with several elements, shape (lines,)."""
        return self.once & (((self.before > 0.0) & (self.energies(t, x) > 0.0)).sum(axis=1) > 1)

    @property
    def _laws(self):
        """Radius [m] and stiffness of each line's contact."""
        return self.term.data[:: self.pieces, : STIFFNESS + 1].T

    def energy(self, t, x, cells, data, out):
        """Write φ, by element."""
        energies = self.energies(t, x)
        shares = self.shares(energies)
        out[:] = (shares * energies - 0.5 * self.width[:, None] * (shares - self.before) ** 2).ravel()

    def force(self, t, x, v, f, cells, data, out):
        """Add −∇φ, and write depths and forces on bodies, by element."""
        self.term.force(t, x, v, f, cells, shared(data, self.shares(self.energies(t, x)).ravel()), out)

    def stiffness(self, t, x, v, blocks, cells, data, definite):
        """Write the tangent of each element by its share."""
        shares = self.shares(self.energies(t, x)).ravel()
        self.term.tangent.stiffness(t, x, v, blocks, cells, shared(data, shares), definite)

    def exchange(self, t, x, v, blocks, cells, data, definite):
        """Write the tangent of the change of shares, of all nodes of a line."""
        blocks[:] = 0.0
        energies = self.energies(t, x)
        shares = self.shares(energies)
        nodes, width = self.term.contact.felt[0], blocks.shape[1] // 3
        for line in np.flatnonzero(((shares > 0.0).sum(axis=1) > 1) & self.once & energies.any(axis=1)):
            pieces = np.flatnonzero(shares[line] > 0.0)
            slopes = np.zeros((len(pieces), width, 3))
            for slope, c, force in zip(slopes, pieces, self._forces(t, x, line * self.pieces + pieces), strict=True):
                slope[c * (nodes - 1) : c * (nodes - 1) + nodes] = force[:nodes]
                slope[nodes - len(force) :] = force[nodes:]
            slopes = slopes.reshape(len(pieces), -1)
            slopes -= slopes.mean(axis=0)
            blocks[line] = slopes.T @ slopes / self.width[line]
            if self.term.cells.shape[1] == nodes + 3:
                to_quaternion(blocks[line], x, *cells[line, -2:], 3 * width - 6)

    def _forces(self, t, x, numbers):
        """Force of each of some elements on each of its rows [N], shape (elements, arity, 3)."""
        cells = self.term.cells[numbers]
        alone = np.arange(cells.size, dtype=np.int32).reshape(cells.shape)
        forces, out = np.zeros((cells.size, 3)), np.zeros((len(cells), self.term.columns))
        self.term.force(t, x[cells.ravel()], np.zeros_like(forces), forces, alone, self.term.data[numbers], out)
        return forces.reshape(*cells.shape, 3)

    def terms(self):
        """Two `ForceTerm`: this contact, and the change of its shares."""
        term, nodes = self.term, self.term.contact.felt[0]
        cells = term.cells.reshape(-1, self.pieces, term.cells.shape[1])
        rows = [cells[:, 0, :1], *(cells[:, c, 1:nodes] for c in range(self.pieces)), cells[:, 0, nodes:]]
        tangent = term.tangent._replace(stiffness=self.stiffness)
        return replace(term, force=self.force, energy=self.energy, tangent=tangent), ForceTerm(
            name=term.name,
            cells=np.ascontiguousarray(np.hstack(rows)),
            data=np.zeros((len(cells), 1)),
            force=_nothing,
            energy=_nothing,
            tangent=Tangent(self.exchange, symmetric=term.tangent.symmetric),
            balance=Balance(term.balance.column, internal=True),
        )


def _nothing(*arguments):
    """Add no force and no energy."""


class SharedPush:
    """Equilibria in which elements of a line share the push of a sphere.

    Parameters
    ----------
    newton : refweb.statics.newton.Newton
        Newton's method of the system without shares.
    first : float
        Load step of which its prestress is, as for `Newton`.

    Attributes
    ----------
    newton : refweb.statics.newton.Newton
        Newton's method of the system with φ.
    """

    def __init__(self, newton, first):
        self._without_shares, self._plain, net = newton, newton.system, newton.system.net
        once, system = [body.row for body in net.bodies if body.shape.once], copy.copy(newton.system)
        for cached in ("pattern", "unsupported_parts", "mass", "links", "carriers", "contact_forces"):
            system.__dict__.pop(cached, None)
        self._lines, system.terms = [], list(system.terms)
        for number, term in shareable(newton.system).items():
            touched = term.cells[:: net.subdivide, term.contact.felt[0]]
            self._lines.append(LineShares(term, net.subdivide, np.isin(touched, once)))
            system.terms[number], exchange = self._lines[-1].terms()
            system.terms.append(exchange)
        system.arrange()
        self.newton = Newton(system, newton.progress, first)

    def equilibrium(self, t, x, error=None):
        """Equilibrium at load step t from x, or from where Newton's method without shares has ended with an ``error``.

        Raises
        ------
        SolverError
            Where none is found.
        """
        error = error or NotFound("", dict(nsteps=0, nfev=0, njev=0, nlu=0), x)
        for start in (x, error.x):
            if start is None or gone(self._plain, start) is not None:
                continue
            self.newton.start_path(() if start is x else self._without_shares.path)
            try:
                return self._solve(t, start, error.stats)
            except NotFound as another:
                add_spent(another.stats, error.stats)
                error = another
        raise with_reason(self._plain, t, error)

    def _solve(self, t, x, spent):
        """Equilibrium at load step t from x; counts of ``spent`` are added to its stats."""
        scale, difference = force_scale(self._plain, t, x, self._plain.forces(t, x).per_cell.tension), np.inf
        for lines in self._lines:
            lines.begin(t, x, scale)
        stats = {key: spent[key] for key in ("nsteps", "nfev", "njev", "nlu")}
        for n in range(ROUNDS):
            state = self._balanced(t, x, n > 0, stats)
            add_spent(stats, state.stats)
            x, last = state.x, difference
            difference = max(lines.advance(t, x, self.newton.scale) for lines in self._lines)
            if difference <= EQUAL or (difference <= ENOUGH and difference > 0.5 * last):
                break
        else:
            raise NotFound(
                f"no equilibrium found at step {t:g} in {ROUNDS} rounds of shares of elements in the push of a sphere, "
                f'energies differ by {difference:.2g}: give spheres shape = "capsule", of a small length',
                stats,
                x,
            )
        state.stats |= stats
        self._polish(t, state)
        x = state.x
        for lines in self._lines:
            lines.width *= NARROWEST**2  # a tangent that keeps energies equal
        if not self.newton.follows:
            state.stats["smallest_pivot"] = self.newton.smallest_pivot(t, x, state.stats)
        shared = any(lines.several(t, x).any() for lines in self._lines)
        if shared and residual(self._plain, self._plain.force(t, x), self.newton.scale) > LIMIT:
            state.contact_shares = np.concatenate([lines.before.ravel() for lines in self._lines])
        return state

    def _balanced(self, t, x, warm, stats):
        """Equilibrium with φ, from x; ``stats`` grow by what the parts before the last have spent."""
        for _ in range(PARTS - 1):
            try:
                return self.newton.solve(t, x, warm=warm, limit=PART)
            except NotFound as error:
                if error.x is None or gone(self._plain, error.x) is not None:
                    raise
                add_spent(stats, error.stats)
                x = error.x
        return self.newton.solve(t, x, warm=warm, limit=PART)

    def _polish(self, t, state):
        """Take two more steps, as long as the residual falls; with a large w, that rounding changes shares little."""
        system, newton = self.newton.system, self.newton
        for lines in self._lines:
            lines.width = np.maximum(lines.narrowest, lines.energies(t, state.x).max(axis=1))
        newton.factorize_at(state)
        for _ in range(2):
            p = newton.factor.solve(state.force.ravel()[system.free])
            if p is None:
                break
            x = system.moved(state.x, system.rows_of(p))
            force, per_cell = system.forces(t, x)
            if (error := residual(system, force, newton.scale)) >= state.stats["residual"]:
                break
            state.x, state.force, state.tension = x, force, per_cell.tension.copy()
            state.stats["residual"] = float(error)
            for lines in self._lines:
                lines.before = lines.shares(lines.energies(t, x))
