"""Bodies that turn among the equations of implicit methods: rates of quaternions, and what they add to Jacobians.

Positions follow x' = g(x, v): of a quaternion q with the velocity u = L/I of its row of rotation, see
`refweb.net.rotation`,

    q' = ½ ω q,        ω = R W Rᵀ u,        δω = R W Rᵀ δu + δθ × ω − R W Rᵀ (δθ × u),

δθ being the rotation that δq makes; of all else x' = v. Its length is left to the equations, which keep it: forces and
ω follow from q/|q|. With X = ∂g/∂x and V = ∂g/∂v, an implicit step solves

    z_x − γX z_x − γV z_v = r_x,        M z_v + γK z_x + γC z_v = M r_v,

so that with P = (1 − γX)⁻¹ eliminating displacements leaves (M + γC + γ²KPV) z_v = M r_v − γKP r_x.

May change: private methods. Must stay: public names, which `cvode`, `ida`, `step_observer` and `studies.dop853` call:
first `linearize` at a state, then `begin` with γ, then products; ``places`` has the scalar part of a quaternion first;
`followed`, which `step_observer` imports; `Rotations`, which `studies.dop853` imports. Tests:
``tests/effects/test_tumbling.py``, ``tests/dynamics/integrators/test_cvode.py``.
"""

from __future__ import annotations

import numpy as np

from ...errors import InputError
from ...net.rotation import RigidRotations, quaternion_rate
from ...net.rotation_bounds import speeds


class Rotations:
    """The bodies of one system that turn by what acts on them.

    Parameters
    ----------
    system : refweb.system.system.System
        With at least one of them.
    """

    def __init__(self, system):
        self.turns = turns = RigidRotations.of(system.net)
        number = np.full(3 * system.rows, -1)
        number[system.free] = np.arange(len(system.free))
        free = np.flatnonzero(number[3 * turns.rows[:, 1]] >= 0)
        _, self._spin, self._turn = turns.rows[free].T
        self._mobility, self._axles = turns.mobility[free], turns.axles[free]
        spin = number[3 * self._spin[:, None] + np.arange(3)]
        self.places = np.column_stack([number[3 * self._turn], spin])
        self.spins, self._angles = spin, number[3 * self._turn + 1]
        body = [b for b in system.net.bodies if b.turn is not None]
        self._extent = np.array([b.extent for b in body])[free]
        self._on_axle = np.flatnonzero(self._axles.any(axis=1))

    def quaternions(self, x):
        """Quaternions (w, x, y, z) of any length at displacements of all rows, shape (bodies, 4)."""
        return np.column_stack([1.0 + x[self._turn, 0], x[self._spin]])

    def _matrices(self, q):
        """Rotation matrices of unit quaternions, shape (bodies, 3, 3)."""
        w, v = q[:, 0, None, None], q[:, 1:]
        across = crosses(v)
        return np.eye(3) + 2.0 * (w * across + across @ across)

    def _omega(self, x, v):
        """Unit quaternions and their lengths, W along the axes of space, u and ω."""
        q = self.quaternions(x)
        size = np.linalg.norm(q, axis=1)
        R = self._matrices(q / size[:, None])
        W, u = R @ self._mobility @ R.swapaxes(1, 2), v[self._spin]
        return q, size, W, u, (W @ u[:, :, None])[:, :, 0]

    def set_rates(self, x, v, rates):
        """Write g of these bodies to the ``rates`` of the unknowns, at displacements and velocities of all rows."""
        q, _, _, _, omega = self._omega(x, v)
        rates[self.places], on = left(q, omega), self._on_axle
        rates[self._angles[on]] = (self._axles[on] * omega[on]).sum(axis=1)

    def leave_along_axles(self, force):
        """Leave of the moments among forces on the unknowns those that turn bodies about their axles."""
        for n in self._on_axle:
            force[self.spins[n]] = (self._axles[n] @ force[self.spins[n]]) * self._axles[n]

    def rows_along_axles(self, pattern, values):
        """Leave the same of the values of a matrix in the pattern of a system."""
        for n in self._on_axle:
            at = np.array([np.flatnonzero(pattern.indices == row) for row in self.spins[n]])
            values[at] = np.outer(self._axles[n], self._axles[n]) @ values[at]
        return values

    def linearize(self, x, v):
        """Find X and V of a state of all rows, shape (bodies, 4, 4) and (bodies, 4, 3)."""
        q, size, W, u, omega = self._omega(x, v)
        p, o, n = 0.5 * q, 0.5 * omega, len(q)
        by_omega = np.empty((n, 4, 3))
        by_omega[:, 0], by_omega[:, 1:] = -p[:, 1:], p[:, 0, None, None] * np.eye(3) - crosses(p[:, 1:])
        by_q = np.zeros((n, 4, 4))
        by_q[:, 0, 1:], by_q[:, 1:, 0], by_q[:, 1:, 1:] = -o, o, crosses(o)
        angle = np.empty((n, 3, 4))
        angle[:, :, 0], angle[:, :, 1:] = -q[:, 1:], q[:, 0, None, None] * np.eye(3) + crosses(q[:, 1:])
        angle *= 2.0 / size[:, None, None] ** 2
        self.X = by_q + by_omega @ (W @ crosses(u) - crosses(omega)) @ angle
        self.V = by_omega @ W

    def begin(self, gamma):
        """Set P and PV of γ."""
        self._P = np.linalg.inv(np.eye(4) - gamma * self.X)
        self._PV = self._P @ self.V

    def eliminated(self, pattern, values):
        """The values of KPV, for those of K, in the pattern of a system."""
        values = values.copy()
        for n, columns in enumerate(self.places):
            at = pattern.indptr[columns][:, None] + np.arange(
                pattern.indptr[columns[0] + 1] - pattern.indptr[columns[0]]
            )
            part = self._PV[n].T @ values[at]
            values[at[0]], values[at[1:]] = 0.0, part
        return values

    def before(self, r):
        """P r of displacements."""
        r = r.copy()
        r[self.places] = (self._P @ r[self.places][:, :, None])[:, :, 0]
        return r

    def carried(self, z):
        """PV z of velocities."""
        carried = z.copy()
        carried[self.places] = (self._PV @ z[self.spins][:, :, None])[:, :, 0]
        return carried

    def product(self, x, v):
        """X x + V v of unknown displacements and velocities."""
        rates = v.copy()
        rates[self.places] = (self.X @ x[self.places][:, :, None] + self.V @ v[self.spins][:, :, None])[:, :, 0]
        return rates

    def pattern(self):
        """Rows and columns of the entries of X, and of V, numbers of unknowns."""
        rows, columns = np.broadcast_arrays(self.places[:, :, None], self.places[:, None, :])
        slow, fast = np.broadcast_arrays(self.places[:, :, None], self.spins[:, None, :])
        return (rows.ravel(), columns.ravel()), (slow.ravel(), fast.ravel())

    def set_lengths(self, x):
        """Make the quaternions of a state of all rows of length 1."""
        q = self.quaternions(x)
        q /= np.linalg.norm(q, axis=1)[:, None]
        x[self._turn, 0], x[self._spin] = q[:, 0] - 1.0, q[:, 1:]

    def speed(self, x, v):
        """Largest speed of any point of these bodies while they move freely [m/s]."""
        return max(sum(speeds(n, x, v, self.turns)) for n in range(len(self.turns.moment)))

    def scale(self, tolerance, angular):
        """Make tolerances of unknown displacements, or of velocities where ``angular``, those of angles."""
        places = self.spins if angular else self.places
        tolerance[places] /= self._extent[:, None]


def crosses(a):
    """Matrices of a × b, shape (n, 3, 3)."""
    m = np.zeros((len(a), 3, 3))
    m[:, 0, 1], m[:, 0, 2], m[:, 1, 2] = -a[:, 2], a[:, 1], -a[:, 0]
    return m - m.swapaxes(1, 2)


def left(q, omega):
    """½ ω q, shape (n, 4)."""
    return np.column_stack(quaternion_rate(*q.T, omega.T))


def followed(system, method, takes):
    """The `Rotations` of a system, for a method that ``takes`` them; refused where it does not."""
    if not takes:
        name = next(body.name for body in system.net.bodies if body.turn is not None)
        raise InputError(
            f'body "{name}" turns in space, which {method} does not follow: use "central-difference", "cvode" or "ida"'
        )
    return Rotations(system)
