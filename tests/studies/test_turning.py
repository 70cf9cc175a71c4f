"""Frequencies in a frame that turns, with Coriolis forces, against closed forms and what is seen from outside."""

import numpy as np
import pytest

import refweb
from refweb.studies.turning import coriolis

EA = 100.0


def framed(scene, *speed):
    return scene.replace(effects=[*scene.effects, refweb.Frame(angular_velocity=speed)])


def inline(points, lines, **more):
    return refweb.Inline(points=np.asarray(points, float).tolist(), lines=np.asarray(lines).tolist(), **more)


def within(found, expected, relative=1e-9):
    """Every frequency is the expected one [1/s] within its ±, and that is small."""
    expected = np.asarray(expected) / (2.0 * np.pi)
    assert len(found.frequency) == len(expected)
    assert (abs(found.frequency - expected) <= found.error + 1e-14 * abs(expected)).all()
    assert (found.error <= relative * abs(expected).max()).all()


def cross(second=1.0, mass=2.0):
    """A mass on four lines of EA and of a part of it."""
    points = [[-1, 0, 0], [0, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0]]
    return refweb.Scene(
        web=inline(points, [[0, 1], [1, 2], [3, 1], [1, 4]], supports=[0, 2, 3, 4], groups=["x", "x", "y", "y"]),
        cable=refweb.Cable(
            law="linear", modulus=1e6, area=1e-4, density=0.0, prestrain=0.01, groups=dict(y=dict(area=second * 1e-4))
        ),
        effects=[refweb.PointMass(node=1, mass=mass)],
    )


@pytest.mark.parametrize("speed", [0.2, 2.0, 9.0, 12.0])
def test_a_mass_on_a_cross(speed):
    """It swings as seen from outside: across the plane as at rest, in it with √(k/m) ± Ω, whichever is larger."""
    still, found = refweb.modes(cross(), 3), refweb.modes(framed(cross(), 0.0, 0.0, speed), 3)
    slow, fast = 2.0 * np.pi * still.frequency[[0, -1]]
    within(found, np.sort([slow, abs(fast - speed), fast + speed]))
    assert not found.warnings and found.spectra[0].unstable == found.spectra[0].zero == 0
    # It goes round: a quarter of a period later it is as far along the other axis.
    last, later = found.shapes[-1, 1], found.spectra[-1].later[-1, 1]
    np.testing.assert_allclose(np.linalg.norm(last), 1.0, rtol=1e-12)
    np.testing.assert_allclose(last @ later, 0.0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(later), 1.0, rtol=1e-9)


@pytest.mark.parametrize("second, speed", [(0.5, 3.0), (0.5, 7.0), (0.2, 8.0)])
def test_a_mass_on_unequal_springs(second, speed):
    """(k₁/m − Ω² − ω²)(k₂/m − Ω² − ω²) = 4ω²Ω²; between both natural frequencies, Ω drives it out, ω² < 0."""
    mass, length = 2.0, 1.0 / 1.01
    stiff = 2.0 * EA / length * np.array([1.0, second]) + 2.0 * EA * 0.01 * np.array([second, 1.0])
    first, last = stiff / mass - speed**2
    roots = np.sort(np.roots([1.0, -(first + last + 4.0 * speed**2), first * last]))
    across = 2.0 * EA * 0.01 * (1.0 + second) / mass
    expected = np.sort([*(np.sign(roots) * np.sqrt(abs(roots))), np.sqrt(across)])
    found = refweb.modes(framed(cross(second), 0.0, 0.0, speed), 3)
    within(found, expected)
    driven = stiff.min() / mass < speed**2 < stiff.max() / mass
    assert found.spectra[0].unstable == driven and (found.frequency[0] < 0.0) == driven


def test_a_free_mass_goes_straight_ahead():
    """ω = Ω, double, and of one shape; along the axis nothing happens. Slack lines do not hold it."""
    web = inline([[-1, 0, 0], [0, 0, 0], [1, 0, 0]], [[0, 1], [1, 2]], natural_length=3.0, supports=[0, 2])
    cable = refweb.Cable(law="tension-only", modulus=1e6, area=1e-4, density=0.0)
    scene = refweb.Scene(web=web, cable=cable, effects=[refweb.PointMass(node=1, mass=2.0)])
    speed = np.array([1.0, -2.0, 2.0])
    found = refweb.modes(framed(scene, *speed), 5)
    within(found, [3.0, 3.0], relative=1e-6)
    assert found.spectra[0].unstable == 0 and found.spectra[0].zero == 1
    for shape, later in zip(found.shapes[:, 1], found.spectra[0].later[:, 1], strict=True):
        assert abs(shape @ speed) < 1e-6 and abs(shape @ later) < 1e-6  # round a circle about the axis


def string(elements, tension=1.0, **more):
    """A taut string along z, of 1 m and 0.02 kg."""
    return refweb.Scene(
        web=refweb.SingleCable(start=(0, 0, 0), end=(0, 0, 1), elements=elements),
        cable=refweb.Cable(law="linear", modulus=1e6, area=1e-4, density=200.0, prestrain=0.01 * tension, **more),
        effects=[],
    )


@pytest.mark.ordinary("5.0-12-1-lumped", "40.0-6-2-consistent")
@pytest.mark.parametrize("elements, order, mass", [(12, 1, "lumped"), (6, 2, "consistent"), (70, 1, "lumped")])
@pytest.mark.parametrize("speed", [5.0, 40.0])
def test_a_string_along_the_axis(elements, order, mass, speed):
    """Every double frequency across splits into ω ± Ω; slower than Ω, it goes round the other way, as Ω − ω.

    Some are sought by iteration, some are all of a dense matrix; with the lower Ω K is definite, with the other not.
    """
    scene = string(elements, order=order).replace(solve=refweb.Static(mass=mass))
    still = 2.0 * np.pi * refweb.modes(scene, 16).frequency
    found = refweb.modes(framed(scene, 0.0, 0.0, speed), 10)
    expected = np.sort(abs(np.concatenate([still[::2] - speed, still[1::2] + speed])))[:10]
    within(found, expected, relative=1e-7)
    assert (still[0] < speed) == (speed == 40.0)


def test_too_many_directions_that_only_coriolis_holds():
    with pytest.raises(refweb.SolverError, match="nothing but Coriolis forces holds some directions of a net of 1527"):
        refweb.modes(framed(string(510), 0.0, 0.0, 40.0), 4)


@pytest.mark.parametrize("mass", ["lumped", "consistent"])
def test_gyroscopic_matrix_is_that_of_the_force(mass):
    """G v is minus the Coriolis force of any velocities, and antisymmetric."""
    scene = framed(string(5, order=2).replace(solve=refweb.Static(mass=mass)), 1.0, -2.0, 0.5)
    system = scene.build()
    G, v = coriolis(system, np.zeros((system.rows, 3))), np.zeros((system.rows, 3))
    v.ravel()[system.free] = np.random.default_rng(0).standard_normal(len(system.free))
    still = system.force(1.0, np.zeros_like(v), np.zeros_like(v))
    felt = (system.force(1.0, np.zeros_like(v), v) - still).ravel()[system.free]
    np.testing.assert_allclose(G @ v.ravel()[system.free], -felt, rtol=0, atol=1e-12 * abs(felt).max())
    assert abs(G + G.T).max() < 1e-15 * abs(G).max()
