"""Nodes tied to a body by constraints, which refweb eliminates: an independent check of ``[[attach]]``.

The web and the body are those of the scene without ``[[attach]]``: each node has its own mass, the body its own mass
and inertia. With the arm a of the point on the body, the multipliers λ of three constraints and three more, μ, in the
form of Gear, Gupta and Leimkuhler (J. Comput. Appl. Math. 12–13 (1985) 77–90, doi:10.1016/0377-0427(85)90008-1),

    x_n' = v_n + μ      M v' = f + Cᵀλ      q' = ½ ω q      0 = x_n − x_b − a      0 = v_n − v_b − ω × a,

Cᵀλ being −λ on the node, λ on the body and the moment a × λ. IDA of SUNDIALS solves this with a dense Jacobian of
differences. Forces are refweb's, and none of them knows of the tie; nothing of `refweb.effects.attach` or of what
carries nodes is used.
"""

import numpy as np
from sksundae.ida import IDA

import refweb

UNTESTED = 1e30
"""Absolute tolerance of multipliers, which takes them out of the error test."""


class Tied:
    """A scene whose nodes are tied to one free body that turns.

    Parameters
    ----------
    scene : refweb.Scene
        With ``[[attach]]`` to one body.
    """

    def __init__(self, scene):
        ties = [one for one in scene.effects if isinstance(one, refweb.Attach)]
        self.system = system = scene.replace(effects=[e for e in scene.effects if e not in ties]).build()
        net = system.net
        (self.body,) = {body.name: body for body in net.bodies if body.name == ties[0].body}.values()
        found = [(node, tie.point) for tie in ties for node in net.web.find(tie.node).tolist()]
        self.nodes = np.array([node for node, _ in found])
        self.arms = np.array(
            [
                net.points[node] - net.points[self.body.row] if point is None else np.array(point) @ self.body.axes
                for node, point in found
            ]
        )
        self.linear = system.rows - net.spins
        self.free = np.flatnonzero(~system.supported[: self.linear].ravel())
        self.mass = np.repeat(net.mass[: self.linear], 3)[self.free]

    def _parts(self, y):
        n, m = len(self.free), 3 * len(self.nodes)
        return np.split(y, np.cumsum([n, 4, n, 3, m]))

    def rows(self, y):
        """Displacement and velocity of all rows at a state of the unknowns."""
        system, body = self.system, self.body
        x, v = np.zeros((system.rows, 3)), np.zeros((system.rows, 3))
        place, q, speed, u, _, _ = self._parts(y)
        x[: self.linear].ravel()[self.free] = place
        v[: self.linear].ravel()[self.free] = speed
        x[body.spin], x[body.turn, 0], v[body.spin] = q[1:], q[0] - 1.0, u
        return x, v

    def _residual(self, t, y, yp, r):
        body, (x, v) = self.body, self.rows(y)
        (_, q, speed, _, pull, slip), rates = self._parts(y), self._parts(yp)
        pull, slip = pull.reshape(-1, 3), slip.reshape(-1, 3)
        arms, omega = self.arms @ body.rotation(x).T, body.turning(x, v)
        f = self.system.force(t, x, v)
        np.subtract.at(f, self.nodes, pull)
        f[body.row] += pull.sum(axis=0)
        f[body.spin] += np.cross(arms, pull).sum(axis=0)
        moved = np.zeros((self.linear, 3))
        moved.ravel()[self.free] = speed
        np.add.at(moved, self.nodes, slip)
        place = self.system.net.points + x
        w, p = q[0], q[1:]
        rate = 0.5 * np.concatenate([[-omega @ p], w * omega + np.cross(omega, p)])
        r[:] = np.concatenate(
            [
                rates[0] - moved.ravel()[self.free],
                rates[1] - rate,
                self.mass * rates[2] - f[: self.linear].ravel()[self.free],
                body.moment * rates[3] - f[body.spin],
                (place[self.nodes] - place[body.row] - arms).ravel(),
                (v[self.nodes] - v[body.row] - np.cross(omega, arms)).ravel(),
            ]
        )

    def _start(self):
        """Unknowns and their rates at t = 0, those of μ 0: λ keeps the constraints' second derivative."""
        system, body, count = self.system, self.body, 3 * len(self.nodes)
        v = system.initial_velocity()
        x, omega = np.zeros_like(v), body.turning(np.zeros_like(v), v)
        x[self.nodes] = system.net.points[body.row] + self.arms - system.net.points[self.nodes]
        v[self.nodes] = v[body.row] + np.cross(omega, self.arms)
        own = [a[: self.linear].ravel()[self.free] for a in (x, v)]
        y = np.concatenate([own[0], [1.0, 0.0, 0.0, 0.0], own[1], v[body.spin], np.zeros(2 * count)])
        rates, r = np.zeros_like(y), np.zeros_like(y)

        def missed(pull):
            """Second derivative of the constraints for some λ, with the rates that belong to it."""
            y[-2 * count : -count] = pull
            rates[:] = 0.0
            self._residual(0.0, y, rates, r)
            place, q, speed, u, _, _ = (-part for part in self._parts(r))
            slope = [place, q, speed / self.mass, u / body.moment, np.zeros(count), np.zeros(count)]
            rates[:] = np.concatenate(slope)
            a = np.zeros((self.linear, 3))
            a.ravel()[self.free] = slope[2]
            W = body.axes.T @ body.mobility @ body.axes
            turned = W @ (slope[3] - np.cross(omega, v[body.spin]))
            whole = np.cross(turned, self.arms) + np.cross(omega, np.cross(omega, self.arms))
            return (a[self.nodes] - a[body.row] - whole).ravel()

        rest = missed(np.zeros(count))
        slopes = np.array([missed(unit) - rest for unit in np.eye(count)]).T
        missed(np.linalg.solve(slopes, -rest))
        return y, rates

    def solve(self, end, rtol):
        """Displacement and velocity of all rows at a time [m, m/s], and how far off the ties are there [m, m/s]."""
        y, rates = self._start()
        count, n = 3 * len(self.nodes), len(y)
        atol = np.full(n, rtol * 1e-2)
        atol[n - 2 * count :] = UNTESTED
        algebraic = list(range(n - 2 * count, n))
        solver = IDA(self._residual, rtol=rtol, atol=atol, algebraic_idx=algebraic, max_num_steps=10**6)
        found = solver.solve(np.array([0.0, end]), y, rates)
        assert found.success, found.message
        x, v = self.rows(found.y[-1])
        r = np.zeros(n)
        self._residual(end, found.y[-1], found.yp[-1], r)
        return x, v, np.abs(r[-2 * count : -count]).max(), np.abs(r[-count:]).max()
