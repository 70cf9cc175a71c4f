"""Free bodies that turn, against closed forms; volumes and moments of inertia of solids."""

from dataclasses import replace

import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from scipy.special import ellipj, ellipk

from refweb.net.rigid_body import Axle, Grown, RigidBody, matrix_of
from refweb.net.rotation import (
    RigidRotations,
    advance_rotation,
    angular_velocity,
    more_kinetic,
    note_turns,
    quaternion_of,
)
from refweb.net.rotation_bounds import pushes, speeds
from refweb.net.shapes.box import Box
from refweb.net.solid import inertia, moments

ROTORS = [((1.0, 2.0, 3.0), (0.3, 0.2, 2.0), 3.14488764157), ((1.0, 2.0, 3.0), (0.01, 2.0, 0.01), 21.9551458793)]
"""Moments of inertia, angular velocity [rad/s] and the period of that along the axes of the body [s]."""


class Rotor:
    """One body alone: its rows, and what turns it."""

    def __init__(self, moments_, omega, axes=None, axle=None):
        axes = np.eye(3) if axes is None else axes
        tensor = np.array(moments_) * np.eye(3) if np.ndim(moments_) == 1 else np.array(moments_)
        body = RigidBody("it", 0, Box(size=(0.1, 0.2, 0.3)), (0, 0, 0), False, axes, tensor, omega, True, 1, 2)
        if axle is not None:
            body = replace(body, axle=Axle(np.zeros(3), np.array(axle)))
        self.body, self.turns = body, RigidRotations.of(type("Net", (), {"bodies": (body,)}))
        self.x, self.v = np.zeros((2, 3, 3))
        self.v[1] = body.start_spin
        self.omega = np.array(omega)

    def on(self, h, steps=1):
        for _ in range(steps):
            note_turns(self.x, self.turns)
            advance_rotation(h, self.v, self.x, self.turns)

    @property
    def own(self):
        """Angular velocity along the axes of the body."""
        return self.body.axes @ self.body.rotation(self.x).T @ np.array(angular_velocity(0, self.x, self.v, self.turns))

    @property
    def energy(self):
        return 0.5 * self.body.moment * self.v[1] @ self.v[1] + more_kinetic(self.x, self.v, self.turns)


def euler(tensor, omega, t):
    """Angular velocity along principal axes by Jacobi's functions (Landau and Lifshitz, Mechanics, §37)."""
    one, two, three = tensor
    energy2, square = (
        sum(i * w * w for i, w in zip(tensor, omega, strict=True)),
        sum((i * w) ** 2 for i, w in zip(tensor, omega, strict=True)),
    )
    assert square > energy2 * two  # about the largest axis
    rate = np.sqrt((three - two) * (square - energy2 * one) / (one * two * three))
    m = (two - one) * (energy2 * three - square) / ((three - two) * (square - energy2 * one))
    sizes = (energy2 * three - square) / (one * (three - one)), (energy2 * three - square) / (two * (three - two))
    sizes = np.sqrt([*sizes, (square - energy2 * one) / (three * (three - one))])
    u0 = mpmath.ellipf(np.arctan2(omega[1] / sizes[1], omega[0] / sizes[0]), m)
    sn, cn, dn, _ = ellipj(float(u0) + rate * t, m)
    return sizes * [cn, sn, dn], 4.0 * ellipk(m) / rate


@pytest.mark.parametrize("tensor, omega, period", ROTORS)
@pytest.mark.parametrize("steps", [7, 100, 3001])
def test_a_free_rotor_returns_after_its_period(tensor, omega, period, steps):
    """To the twelve digits of the period; momentum to the last bit, energy to rounding."""
    rotor = Rotor(tensor, omega)
    momentum, energy = rotor.v[1].copy(), rotor.energy
    rotor.on(period / steps, steps)
    # About the middle axis e-folds of 1/√3 · 2 rad/s make 1e-11 of the period some 1e-10 of its slope.
    np.testing.assert_allclose(rotor.own, omega, rtol=0, atol=1e-10)
    np.testing.assert_array_equal(rotor.v[1], momentum)
    assert abs(rotor.energy / energy - 1.0) < 2e-16 * (10 + steps)
    np.testing.assert_allclose(np.linalg.norm([1.0 + rotor.x[2, 0], *rotor.x[1]]), 1.0, rtol=1e-15)


@pytest.mark.parametrize("steps", [1, 10, 400])
def test_a_free_rotor_follows_jacobi(steps):
    tensor, omega, period = ROTORS[0]
    t = 0.37 * period
    expected, found_period = euler(tensor, omega, t)
    assert found_period == pytest.approx(period, rel=1e-11)
    rotor = Rotor(tensor, omega)
    rotor.on(t / steps, steps)
    np.testing.assert_allclose(rotor.own, expected, rtol=0, atol=1e-13)


def test_orientation_follows_from_momentum_in_space():
    """Against scipy's DOP853 of q' = ½ ω q, for a full tensor along skew axes, in one step of radians and in many."""
    axes = Rotation.from_rotvec([0.3, -1.0, 0.4]).as_matrix()
    tensor = [[1.0, 0.1, 0.2], [0.1, 1.2, 0.05], [0.2, 0.05, 0.9]]
    omega, end = np.array([1.0, -2.0, 0.5]), 5.0
    rotor, many = Rotor(tensor, omega, axes), Rotor(tensor, omega, axes)
    start = axes.T @ np.array(tensor) @ axes
    momentum = start @ omega

    def rate(t, q):
        R = matrix_of(q)
        w = np.linalg.solve(R @ start @ R.T, momentum)
        return 0.5 * np.concatenate([[-w @ q[1:]], q[0] * w + np.cross(w, q[1:])])

    q = solve_ivp(rate, (0.0, end), [1.0, 0.0, 0.0, 0.0], "DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    rotor.on(end)
    many.on(end / 500, 500)
    for one in (rotor, many):
        np.testing.assert_allclose([1.0 + one.x[2, 0], *one.x[1]], q, rtol=0, atol=1e-11)
        np.testing.assert_allclose(one.body.turning(one.x, one.v), angular_velocity(0, one.x, one.v, one.turns))
    many.on(-end / 500, 500)  # and back
    np.testing.assert_allclose(many.x, 0.0, rtol=0, atol=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("tensor, omega, period", ROTORS)
def test_energy_over_ten_thousand_turns(tensor, omega, period):
    rotor = Rotor(tensor, omega)
    energy, steps = rotor.energy, 1_000_000
    turns = 10_000 * 2.0 * np.pi / np.linalg.norm(omega)
    worst = 0.0
    for _ in range(100):
        rotor.on(turns / steps, steps // 100)
        worst = max(worst, abs(rotor.energy / energy - 1.0))
    assert worst < 1e-12  # a random walk of 1e6 roundings


def test_a_needle_turns_as_a_symmetric_top():
    """ω = L/J₁ + (1/J₃ − 1/J₁) L₃ e₃: space turns about L, the body about its line; moments of 1 : 1.7e5."""
    tensor, omega = (1.0, 1.0, 6e-6), np.array([200.0, 0.0, 3.0])
    rotor = Rotor(tensor, omega)
    rotor.on(1e-3, 100)
    L = np.array(tensor) * omega
    about = Rotation.from_rotvec(0.1 * L)  # J₁ is 1
    own = Rotation.from_rotvec([0.0, 0.0, 0.1 * (1.0 / 6e-6 - 1.0) * L[2]])
    # A rounding of L, 200 long in space, is one of 1.7e5 times that in the speed about the line: 4e-9 rad/s, for 0.1 s.
    np.testing.assert_allclose(rotor.body.rotation(rotor.x), (about * own).as_matrix(), rtol=0, atol=2e-9)
    own, turning = speeds(0, rotor.x, rotor.v, rotor.turns)
    middle = np.hypot(0.05, 0.1), np.hypot(0.15, 0.1)  # of corners from the third axis, and the first
    assert own == 0.0 and turning == pytest.approx(
        3.0 * middle[0] + 200.0 * (middle[1] + np.hypot(0.05, 0.15)), rel=1e-4
    )


@pytest.mark.parametrize("seed", range(6))
def test_no_point_is_faster_than_its_bound(seed):
    """All corners of a box of any inertia and axes, on its way, against the bound of the start; and within 4 of it."""
    rng = np.random.default_rng(seed)
    big = np.sort(10.0 ** rng.uniform(-4, 0, 3))
    frame = Rotation.random(random_state=seed).as_matrix()
    tensor = frame @ np.diag([big[0], big[1], big[1] + 0.9 * big[0]]) @ frame.T
    rotor = Rotor(tensor, rng.standard_normal(3) * 10.0, Rotation.random(random_state=seed + 50).as_matrix())
    corners = np.array([[a, b, c] for a in (-0.05, 0.05) for b in (-0.1, 0.1) for c in (-0.15, 0.15)])
    _, bound = speeds(0, rotor.x, rotor.v, rotor.turns)
    most = 0.0
    for _ in range(3000):
        rotor.on(0.01)
        most = max(most, np.linalg.norm(np.cross(rotor.own, corners), axis=1).max())
    assert 0.25 * bound < most <= bound * (1.0 + 1e-12)
    # A moment changes the velocity of no corner by more than its bound.
    moment, f = rng.standard_normal(3), np.zeros((3, 3))
    f[1] = moment
    axes = rotor.body.axes @ rotor.body.rotation(rotor.x).T
    rate = np.linalg.norm(np.cross(np.linalg.solve(tensor, axes @ moment), corners), axis=1).max()
    assert rate <= pushes(0, rotor.x, f, rotor.turns)[1] / rotor.body.moment * (1.0 + 1e-12)


@pytest.mark.parametrize("axis", range(3))
def test_bounds_of_moments_about_principal_axes(axis):
    """A moment about a principal axis: |m| over its inertia, times the distance of the corners; none across an axle."""
    size, tensor, moment = np.array([0.1, 0.2, 0.3]), (1.0, 2.0, 3.0), -0.7
    free, held = Rotor(tensor, (0.0, 0.0, 0.0)), Rotor(tensor, (0.0, 0.0, 0.0), axle=(0.0, 0.0, 1.0))
    f = np.zeros((3, 3))
    f[1, axis] = moment
    corners = 0.5 * np.linalg.norm(np.delete(size, axis))
    expected = abs(moment) / tensor[axis] * corners
    assert pushes(0, free.x, f, free.turns)[1] / free.body.moment == pytest.approx(expected, rel=1e-12)
    bound = pushes(0, held.x, f, held.turns)[1] / held.body.moment
    assert bound == pytest.approx(expected if axis == 2 else 0.0, rel=1e-12, abs=1e-15)


def test_quaternions_of_matrices():
    for seed in range(20):
        rotation = Rotation.random(random_state=seed)
        x, y, z, w = rotation.as_quat()
        found = quaternion_of(rotation.as_matrix())
        np.testing.assert_allclose(found, np.array([w, x, y, z]) * (1.0 if w > 0.0 else -1.0), atol=1e-14)
        np.testing.assert_allclose(matrix_of(3.0 * found), rotation.as_matrix(), atol=1e-14)
    np.testing.assert_allclose(quaternion_of(np.diag([1.0, -1.0, -1.0])), [0, 1, 0, 0], atol=1e-15)


def test_solids():
    """A ball, a capsule, a box and a cylinder whose edges are nearly sharp, and Gauss's rule over rounded ones."""
    volume, squares = moments(Grown(0.3, (0.0, 0.0, 0.0)))
    assert volume == pytest.approx(4 / 3 * np.pi * 0.3**3) and squares == pytest.approx(
        volume * 0.3**2 / 5 * np.ones(3)
    )
    box = inertia(Grown(1e-9, (1.0, 2.0, 3.0)), 6.0)
    np.testing.assert_allclose(box, np.diag([2 * (4 + 9), 2 * (1 + 9), 2 * (1 + 4)]), rtol=1e-8)
    drum = inertia(Grown(1e-9, (1.0, 1.0, 3.0), round=True), 12.0)
    np.testing.assert_allclose(drum, np.diag([3 + 36, 3 + 36, 6]), rtol=1e-8)
    m, r, h = 2.0, 0.3, 0.8  # textbook's capsule: a cylinder of length h and two half balls
    cylinder, ball = np.pi * r**2 * h, 4 / 3 * np.pi * r**3
    rho = m / (cylinder + ball)
    along = rho * (cylinder * r**2 / 2 + ball * 2 / 5 * r**2)
    across = rho * (cylinder * (h**2 / 12 + r**2 / 4) + ball * (2 / 5 * r**2 + h**2 / 4 + 3 / 8 * h * r))
    np.testing.assert_allclose(inertia(Grown(r, (0.0, 0.0, h / 2)), m), np.diag([across, across, along]), rtol=1e-13)
    for grown in (Grown(0.2, (0.5, 0.1, 0.3)), Grown(0.1, (0.4, 0.4, 0.2), round=True)):
        half = np.array(grown.core) + grown.radius
        x, y, z = (a * (np.arange(160) + 0.5) / 160 for a in half)  # an eighth, by midpoints
        p = np.meshgrid(x, y, z, indexing="ij")
        if grown.round:
            out = (
                np.maximum(np.hypot(p[0], p[1]) - grown.core[0], 0.0) ** 2 + np.maximum(p[2] - grown.core[2], 0.0) ** 2
            )
        else:
            out = sum(np.maximum(a - c, 0.0) ** 2 for a, c in zip(p, grown.core, strict=True))
        inside = out <= grown.radius**2
        cell = half.prod() / 160**3 * 8
        volume, squares = moments(grown)
        assert inside.sum() * cell == pytest.approx(volume, rel=1e-3)
        np.testing.assert_allclose([(a**2)[inside].sum() * cell for a in p], squares, rtol=2e-3)
