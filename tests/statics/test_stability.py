"""The word on stability, by eigenvalues of differences of forces that are written here, and by closed forms."""

import numpy as np
import pytest
import scipy.linalg

import refweb

EA = 1e3
AREA = 1e-4


class Net:
    """A random small net and the forces on its nodes, written once more.

    Differences are taken along the imaginary axis, so that they have no error of their own.
    """

    def __init__(self, seed, sizes=(3, 9)):
        rng = np.random.default_rng(seed)
        self.law = ("tension-only", "linear")[rng.integers(2)]
        self.density = 0.0 if (light := rng.random() < 0.2) else 100.0
        count = int(rng.integers(*sizes))
        flat = rng.random() < 0.4
        points = rng.uniform(-1.0, 1.0, (count, 3)) * [1.0, 1.0, 0.0 if flat else 0.7]
        if rng.random() < 0.35:  # a chain along the axis
            points = np.column_stack([np.linspace(-1.0, 1.0, count), np.zeros((count, 2))])
            pairs = [(i, i + 1) for i in range(count - 1)]
            self.supports = [0, count - 1]
        else:
            apart = np.linalg.norm(points[:, None] - points, axis=2)
            pairs = {
                tuple(sorted((i, int(np.argsort(apart[i, :i])[k])))) for i in range(1, count) for k in range(min(i, 3))
            }
            pairs = sorted(pairs)
            self.supports = sorted(rng.choice(count, min(count - 1, int(rng.integers(2, 5))), replace=False).tolist())
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
        size = 10.0 ** rng.uniform(-0.5, 2.5)
        has = dict(zip(["pressure", "thrust", "drag", "frame", "load"], rng.random(5) < 0.35, strict=True))
        self.pressure = size * rng.uniform(-1.0, 1.0) if has["pressure"] else None
        self.thrust = (
            self.free[0],
            int(np.flatnonzero((self.pairs == self.free[0]).any(axis=1))[0]),
            size * rng.uniform(-1.0, 1.0),
        )
        self.thrust = self.thrust if has["thrust"] else None
        self.wind = rng.normal(size=3) * 10.0 ** rng.uniform(0.0, 1.3) if has["drag"] else None
        self.turn = np.array([10.0 ** rng.uniform(0.0, 2.0), 0.0, 0.0]) if has["frame"] else None
        self.load = rng.normal(size=3) * size if has["load"] else None
        if rng.random() < 0.1:  # nothing but what turns
            self.pressure = self.thrust = self.wind = self.load = None
            self.turn = np.array([10.0 ** rng.uniform(1.0, 2.0), 0.0, 0.0])

    @property
    def scene(self):
        effects = [refweb.PointMass(node=int(i), mass=float(self.added[i])) for i in np.flatnonzero(self.added)]
        if self.pressure is not None:
            effects.append(refweb.Pressure(lines="all", normal=(0.0, 0.0, 1.0), value=self.pressure))
        if self.thrust is not None:
            node, line, force = self.thrust
            effects.append(refweb.Thrust(node=int(node), line=line, force=force))
        if self.wind is not None:
            effects.append(refweb.Drag(density=1.2, wind=tuple(self.wind), diameter=0.01))
        if self.turn is not None:
            effects.append(refweb.Frame(angular_velocity=tuple(self.turn)))
        if self.load is not None:
            effects.append(refweb.Load(node=int(self.free[-1]), force=tuple(self.load)))
        return refweb.Scene(
            web=refweb.Inline(
                points=self.points.tolist(), lines=self.pairs.tolist(), supports=self.supports,
                natural_length=self.natural.tolist(),
            ),
            cable=refweb.Cable(law=self.law, modulus=EA / AREA, area=AREA, density=self.density),
            effects=effects,
            solve=refweb.Static(),
        )  # fmt: skip

    def forces(self, p, v):
        """On every node at positions and velocities, both of shape (nodes, 3), which may be complex."""
        f = np.zeros_like(p)
        d = p[self.pairs[:, 1]] - p[self.pairs[:, 0]]
        length = np.sqrt((d * d).sum(axis=1))
        tension = EA * (length / self.natural - 1.0)
        if self.law == "tension-only":
            tension = np.where(tension.real > 0.0, tension, 0.0)
        unit = d / length[:, None]
        np.add.at(f, self.pairs[:, 0], tension[:, None] * unit)
        np.subtract.at(f, self.pairs[:, 1], tension[:, None] * unit)
        if self.pressure is not None:
            push = 0.5 * self.pressure * np.cross(d, [0.0, 0.0, 1.0])
            np.add.at(f, self.pairs[:, 0], push)
            np.add.at(f, self.pairs[:, 1], push)
        if self.thrust is not None:
            node, line, force = self.thrust
            f[node] += force * unit[line] * (1.0 if self.pairs[line, 0] == node else -1.0)
        if self.wind is not None:
            for side in (0, 1):
                nodes = self.pairs[:, side]
                u = v[nodes] - self.wind
                along = (u * unit).sum(axis=1)
                across = u - along[:, None] * unit
                speed = np.sqrt((across * across).sum(axis=1))
                share = 0.5 * (0.5 * 1.2 * 0.01 * self.natural)
                drag = (
                    1.2 * speed[:, None] * across + 0.01 * np.pi * (np.sign(along.real) * along * along)[:, None] * unit
                )
                np.subtract.at(f, nodes, share[:, None] * drag)
        if self.turn is not None:
            turned = np.cross(self.turn, np.cross(self.turn, p)) + 2.0 * np.cross(self.turn, v)
            f = f - self.mass[:, None] * turned
        if self.load is not None:
            f[self.free[-1]] += self.load
        return f

    def matrices(self, p):
        """M, C and K of the free nodes."""
        count, step = 3 * len(self.free), 1e-30
        K, C = np.zeros((count, count)), np.zeros((count, count))
        for n in range(count):
            moved = np.zeros(p.shape, dtype=complex)
            moved[self.free[n // 3], n % 3] = 1j * step
            still = np.zeros_like(moved)
            K[:, n] = -self.forces(p + moved, still)[self.free].ravel().imag / step
            C[:, n] = -self.forces(p + still, moved)[self.free].ravel().imag / step
        return np.repeat(self.mass[self.free], 3), C, K

    def truth(self, p):
        """(Largest Re s, least real part of a real λ of K) over what rounding makes of each, and whether K holds."""
        M, C, K = self.matrices(p)
        root = np.sqrt(M)
        K, C = K / np.outer(root, root), C / np.outer(root, root)
        fastest = max(np.sqrt(np.linalg.norm(K, 2)), np.linalg.norm(C, 2))
        if fastest == 0.0:
            return 0.0, 0.0
        size = len(K)
        s = scipy.linalg.eigvals(np.block([[np.zeros_like(K), np.eye(size)], [-K / fastest**2, -C / fastest]]))
        values = scipy.linalg.eigvals(K / fastest**2)
        real = values[abs(values.imag) < 1e-10].real
        return s.real.max(), real.min(initial=0.0)


def words(net):
    """What a run says of stability, and its state; None where there is no equilibrium."""
    try:
        solution = refweb.run(net.scene)
    except refweb.SolverError:
        return None
    return [text for text in solution.warnings if "saddle" in text or "stable" in text], solution


def check(seeds):
    """Every word is right: said where a disturbance grows or, in a frame, where K drives the web away."""
    kinds = dict(stable=0, divergence=0, flutter=0, held=0, marginal=0, none=0)
    for seed in seeds:
        net = Net(seed)
        if (found := words(net)) is None:
            kinds["none"] += 1
            continue
        said, solution = found
        p = solution.positions
        largest = max(np.abs(solution.tension).max(), 1e-3)
        assert np.abs(net.forces(p, np.zeros_like(p))[net.free]).max() < 1e-7 * largest, seed
        growth, least = net.truth(p)
        if 1e-9 < growth < 1e-6 or -1e-9 > least > -1e-12:
            kinds["marginal"] += 1
        elif growth > 1e-6:
            assert len(said) == 1 and "saddle" in said[0] and "hold it" not in said[0], (seed, said, growth, least)
            kinds["divergence" if least < -1e-9 else "flutter"] += 1
        elif least < -1e-9:
            assert len(said) == 1 and "saddle" in said[0] and "Coriolis forces hold it" in said[0], (seed, said)
            kinds["held"] += 1
        else:
            assert not said, (seed, said, growth, least)
            kinds["stable"] += 1
    return kinds
