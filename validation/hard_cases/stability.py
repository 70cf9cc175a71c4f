"""Random small nets whose equilibria are stable or not, by eigenvalues of differences of forces that are written here.

The forces are those of lines, of pressure, thrust, wind and a frame that turns, once more in numpy. Their differences
are taken along the imaginary axis, so that they have no error of their own. An equilibrium is left by itself where some
s of (s² M + s C + K) φ = 0 has a positive real part; in a frame K may drive a web away that Coriolis forces hold.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg

import refweb

AXIAL, AREA = 1e3, 1e-4
AIR, DIAMETER, NORMAL, TANGENTIAL = 1.2, 0.01, 1.2, 0.01
UP = np.array([0.0, 0.0, 1.0])
STEP = 1e-30
"""Length of a difference along the imaginary axis [m]."""
NONE, SOME = 1e-9, 1e-6
"""Rates over the fastest one: what counts as no growth, and what counts as growth."""
ROUNDING, SOFT = 1e-14, 1e-10
"""Eigenvalues of K over the largest: what counts as none, and what counts as one."""


class RandomNet:
    """A net of a few nodes with lines that pull alone, or bars, under some effects at random.

    Parameters
    ----------
    seed : int
        Of all that is random.
    sizes : tuple of int
        Least number of nodes, and one above the largest.
    """

    def __init__(self, seed, sizes=(3, 9)):
        rng = np.random.default_rng(seed)
        self.law = ("tension-only", "linear")[rng.integers(2)]
        self.density = 0.0 if (light := rng.random() < 0.2) else 100.0
        count = int(rng.integers(*sizes))
        flat = rng.random() < 0.4
        points = rng.uniform(-1.0, 1.0, (count, 3)) * [1.0, 1.0, 0.0 if flat else 0.7]
        if rng.random() < 0.35:  # a chain along the axis of a frame
            points = np.column_stack([np.linspace(-1.0, 1.0, count), np.zeros((count, 2))])
            pairs = [(i, i + 1) for i in range(count - 1)]
            self.supports = [0, count - 1]
        else:
            apart = np.linalg.norm(points[:, None] - points, axis=2)
            pairs = [(int(j), i) for i in range(1, count) for j in np.argsort(apart[i, :i])[: min(i, 3)]]
            held = rng.choice(count, min(count - 1, int(rng.integers(2, 5))), replace=False)
            self.supports = sorted(held.tolist())
        self.points, self.pairs = points, np.array(pairs)
        built = np.linalg.norm(points[self.pairs[:, 1]] - points[self.pairs[:, 0]], axis=1)
        self.natural = built / (1.0 + rng.uniform(-0.03, 0.04) + 0.02 * rng.random(len(built)))
        self.free = np.setdiff1d(np.arange(count), self.supports)
        self.added = np.zeros(count)
        if light:
            self.added[self.free] = rng.uniform(0.01, 0.1, len(self.free))
        self.mass = self.added.copy()
        for pair, length in zip(self.pairs, self.natural, strict=True):
            self.mass[pair] += 0.5 * self.density * AREA * length
        self._choose_effects(rng, 10.0 ** rng.uniform(-0.5, 2.5))

    def _choose_effects(self, rng, size):
        """Effects at random: pressure [N/m], (node, line, thrust [N]), wind [m/s], Ω [rad/s], load [N], or None."""
        pressed, pulled, blown, turned, loaded = rng.random(5) < 0.35
        node, push = int(self.free[0]), size * rng.uniform(-1.0, 1.0, 2)
        line = int(np.flatnonzero((self.pairs == node).any(axis=1))[0])
        wind, speed = rng.normal(size=3) * 10.0 ** rng.uniform(0.0, 1.3), 10.0 ** rng.uniform(0.0, 2.0)
        self.pressure = push[0] if pressed else None
        self.thrust = (node, line, push[1]) if pulled else None
        self.wind = wind if blown else None
        self.turn = speed * np.eye(3)[0] if turned else None
        self.load = rng.normal(size=3) * size if loaded else None
        if rng.random() < 0.1:  # nothing but what turns
            self.pressure = self.thrust = self.wind = self.load = None
            self.turn = 10.0 ** rng.uniform(1.0, 2.0) * np.eye(3)[0]

    @property
    def scene(self):
        """The static scene."""
        effects = [refweb.PointMass(node=int(i), mass=float(self.added[i])) for i in np.flatnonzero(self.added)]
        if self.pressure is not None:
            effects.append(refweb.Pressure(lines="all", normal=tuple(UP), value=float(self.pressure)))
        if self.thrust is not None:
            node, line, force = self.thrust
            effects.append(refweb.Thrust(node=node, line=line, force=float(force)))
        if self.wind is not None:
            effects.append(refweb.Drag(density=AIR, wind=tuple(self.wind.tolist()), diameter=DIAMETER))
        if self.turn is not None:
            effects.append(refweb.Frame(angular_velocity=tuple(self.turn.tolist())))
        if self.load is not None:
            effects.append(refweb.Load(node=int(self.free[-1]), force=tuple(self.load.tolist())))
        points, lines, natural = self.points.tolist(), self.pairs.tolist(), self.natural.tolist()
        return refweb.Scene(
            web=refweb.Inline(points=points, lines=lines, supports=self.supports, natural_length=natural),
            cable=refweb.Cable(law=self.law, modulus=AXIAL / AREA, area=AREA, density=self.density),
            effects=effects,
            solve=refweb.Static(),
        )

    def forces(self, p, v):
        """Forces on the nodes [N] at positions and velocities, which may be complex, shape (nodes, 3)."""
        f = np.zeros_like(p)
        first, last = self.pairs.T
        d = p[last] - p[first]
        length = np.sqrt((d * d).sum(axis=1))
        unit = d / length[:, None]
        tension = AXIAL * (length / self.natural - 1.0)
        if self.law == "tension-only":
            tension = np.where(tension.real > 0.0, tension, 0.0)
        np.add.at(f, first, tension[:, None] * unit)
        np.subtract.at(f, last, tension[:, None] * unit)
        if self.pressure is not None:
            for nodes in (first, last):
                np.add.at(f, nodes, 0.5 * self.pressure * np.cross(d, UP))
        if self.thrust is not None:
            node, line, force = self.thrust
            f[node] += force * unit[line] * (1.0 if first[line] == node else -1.0)
        if self.wind is not None:
            for nodes in (first, last):
                u = v[nodes] - self.wind
                along = (u * unit).sum(axis=1)
                across = u - along[:, None] * unit
                normal = NORMAL * np.sqrt((across * across).sum(axis=1))
                tangential = np.pi * TANGENTIAL * np.sign(along.real) * along**2
                pull = normal[:, None] * across + tangential[:, None] * unit
                np.subtract.at(f, nodes, (0.25 * AIR * DIAMETER * self.natural)[:, None] * pull)
        if self.turn is not None:
            turned = np.cross(self.turn, np.cross(self.turn, p)) + 2.0 * np.cross(self.turn, v)
            f = f - self.mass[:, None] * turned
        if self.load is not None:
            f[self.free[-1]] += self.load
        return f

    def rates(self, p):
        """(Largest Re s, the least real eigenvalue of K if that is negative), over the fastest rate and its square."""
        count = 3 * len(self.free)
        K, C = np.zeros((count, count)), np.zeros((count, count))
        for n in range(count):
            moved = np.zeros(p.shape, dtype=complex)
            moved[self.free[n // 3], n % 3] = 1j * STEP
            still = np.zeros_like(moved)
            K[:, n] = -self.forces(p + moved, still)[self.free].ravel().imag / STEP
            C[:, n] = -self.forces(p + still, moved)[self.free].ravel().imag / STEP
        root = np.sqrt(np.repeat(self.mass[self.free], 3))
        K, C = K / np.outer(root, root), C / np.outer(root, root)
        fastest = max(np.sqrt(np.linalg.norm(K, 2)), np.linalg.norm(C, 2))
        if fastest == 0.0:
            return 0.0, 0.0
        K, C = K / fastest**2, C / fastest
        growth = scipy.linalg.eigvals(np.block([[np.zeros_like(K), np.eye(count)], [-K, -C]])).real.max()
        values = scipy.linalg.eigvals(K)
        return growth, values.real[abs(values.imag) < 1e-10].min(initial=0.0)


def word_on(net):
    """What kind an equilibrium is of, where the word of its run is right; "wrong" and what is said where it is not.

    "stable", "grows", "held" by Coriolis forces alone, "undecided" where that is said, "marginal" where rounding
    decides, "refused" where no equilibrium is found.
    """
    try:
        solution = refweb.run(net.scene)
    except refweb.SolverError:
        return "refused"
    p = solution.positions
    left = np.abs(net.forces(p, np.zeros_like(p))[net.free]).max()
    if left > 1e-7 * max(np.abs(solution.tension).max(), 1e-3):
        return f"wrong: a force of {left:.3g} N is left"
    said = " ".join(text for text in solution.warnings if "saddle" in text or "stable" in text)
    growth, least = net.rates(p)
    if "not decided" in said:
        return "undecided"
    if NONE < growth < SOME or -ROUNDING > least > -SOFT:
        return "marginal"
    held = "Coriolis forces hold it" in said
    kind = "grows" if growth >= SOME else "held" if least <= -SOFT else "stable"
    word = "held" if held else "grows" if "saddle" in said else "stable"
    return kind if kind == word else f"wrong: {kind}, Re s = {growth:.3g}, and it says: {said}"
