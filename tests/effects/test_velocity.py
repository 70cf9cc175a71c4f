"""Velocities at the start: given ones, and those of a rigid turn."""

import numpy as np
import pytest

import refweb

POINTS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.2, 1.3, -0.4], [-0.7, 0.5, 0.9]])


def started(velocities, supported=()):
    """Velocities (4, 3) [m/s] with which four nodes on massive lines start."""
    scene = refweb.Scene(
        web=refweb.Inline(points=POINTS.tolist(), lines=[[0, 1], [1, 2], [2, 3]], supports=list(supported)),
        cable=refweb.Cable(modulus=1e6, area=1e-6, density=1e3),
        effects=velocities,
        solve=refweb.Dynamic(duration=1e-3),
    )
    return scene.build().initial_velocity()[:4]


def test_a_rigid_turn():
    """Distances of all nodes stay as they are at first order, and the point itself rests."""
    spin, about = np.array([0.3, -2.0, 5.0]), POINTS[2]
    v = started([refweb.Velocity(node="all", spin=tuple(spin), about=tuple(about))])
    assert not v[2].any() and np.linalg.norm(v[0]) > 1.0
    apart, rates = POINTS[:, None] - POINTS, v[:, None] - v
    np.testing.assert_allclose((apart * rates).sum(axis=-1), 0.0, atol=1e-13)  # some eps times 2 m and 10 m/s
    # About the axis, counterclockwise: the speed is the distance from it times |ω|, and spin · (r × v) > 0.
    r = POINTS - about
    np.testing.assert_allclose(np.linalg.norm(v, axis=1), np.linalg.norm(np.cross(r, spin), axis=1), rtol=1e-15)
    assert (np.cross(r, v)[[0, 1, 3]] @ spin > 0.0).all()


def test_a_turn_adds_to_a_velocity():
    value, spin = (1.0, 2.0, 3.0), (0.0, 0.0, 2.0)
    both = started([refweb.Velocity(node="all", value=value, spin=spin)])
    alone = started([refweb.Velocity(node="all", spin=spin)])
    np.testing.assert_allclose(both, alone + value, rtol=1e-15)


def test_all_leaves_supports_at_rest_and_names_do_not():
    spin = (0.0, 0.0, 2.0)
    assert not started([refweb.Velocity(node="all", spin=spin)], supported=[1])[1].any()
    with pytest.raises(refweb.InputError, match="node = 1 is supported along y"):
        started([refweb.Velocity(node=1, spin=spin)], supported=[1])
    assert not started([refweb.Velocity(node=1, spin=spin, about=tuple(POINTS[1]))], supported=[1]).any()


@pytest.mark.parametrize(
    "given, text",
    [
        ({}, "value is missing: a velocity needs value"),
        (dict(value=(0.0, 0.0, 1.0), about=(1.0, 0.0, 0.0)), "about = .* has no meaning without spin"),
        (dict(spin=(0.0, 1.0)), "spin"),
        (dict(spinn=(0.0, 1.0, 0.0)), "spin"),
    ],
)
def test_what_is_no_velocity(given, text):
    with pytest.raises(refweb.InputError, match=text):
        refweb.Velocity(node="all", **given)
