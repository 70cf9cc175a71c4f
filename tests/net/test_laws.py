"""Laws against mpmath, over the whole range of strain, slackness and smoothing."""

import mpmath
import numpy as np
import pytest

from refweb.net.laws.law import evaluate
from refweb.net.laws.line_data import LineData
from refweb.net.laws.smooth import Smooth
from refweb.net.laws.straight import Linear, TensionOnly
from refweb.net.tension_laws import Law

mpmath.mp.dps = 60
STRAINS = np.concatenate([s * np.logspace(-15, 0, 31) for s in (1, -1)] + [[0.0]])
SMOOTHINGS = [0.0, 1e-9, 1e-7, 1e-5, 1e-3, 1e-2, 1e-1]
SLACKNESSES = [0.0, 1e-9, 1e-6, 1e-3, 1e-1]


def exact(strain, slackness, smoothing):
    """The paper's eq. (3), its tangent and its integral in 60 digits."""
    e, e0, n = (mpmath.mpf(float(x)) for x in (strain, slackness, smoothing))

    def primitive(s):
        r = mpmath.sqrt(s * s + 4 * n * n)
        return (s * s + s * r) / 4 + (n * n * mpmath.asinh(s / (2 * n)) if n else 0)

    s, alpha = e - e0, (-e0 + mpmath.sqrt(e0 * e0 + 4 * n * n)) / 2
    r = mpmath.sqrt(s * s + 4 * n * n)
    tangent = (1 + s / r) / 2 if r else mpmath.mpf(1)
    return (s + r) / 2 - alpha, tangent, primitive(s) - primitive(-e0) - alpha * e


@pytest.mark.parametrize("smoothing", SMOOTHINGS)
@pytest.mark.parametrize("slackness", SLACKNESSES)
def test_smooth_law_to_1e_14(slackness, smoothing):
    law = Law("smooth")
    around = slackness + np.concatenate([smoothing * np.linspace(-5, 5, 11), slackness * np.array([-1e-3, 1e-3])])
    edge = 1e-4 * max(slackness, 2 * smoothing) * np.array([-1.01, -1, -0.99, 0.5, 0.99, 1, 1.01])
    strain = np.concatenate([STRAINS, np.clip(around, -1, 1), edge])
    got = [f(strain, 1.0, slackness, smoothing) for f in (law.stress, law.tangent, law.energy_density)]
    for i, e in enumerate(strain):
        stress, tangent, energy = exact(e, slackness, smoothing)
        assert abs(got[0][i] - stress) <= 1e-14 * abs(stress)
        assert abs(got[1][i] - tangent) <= 1e-14 * abs(tangent)
        scale = max(abs(e), slackness, smoothing)
        assert abs(got[2][i] - energy) <= 1e-14 * scale**2


def test_floor_is_the_limit_under_compression():
    law = Law("smooth")
    for slackness, smoothing in [(0.0, 1e-3), (1e-3, 1e-3), (0.1, 1e-9), (0.0, 0.0)]:
        e0, n = mpmath.mpf(slackness), mpmath.mpf(smoothing)
        alpha = (-e0 + mpmath.sqrt(e0 * e0 + 4 * n * n)) / 2
        assert abs(law.floor(7e7, slackness, smoothing) - 7e7 * alpha) <= 1e-14 * 7e7 * alpha
        assert law.stress(-1.0, 7e7, slackness, smoothing) >= -law.floor(7e7, slackness, smoothing)


@pytest.mark.parametrize("smoothing", SMOOTHINGS)
@pytest.mark.parametrize("slackness", SLACKNESSES)
def test_curvature_and_height_above_the_floor(slackness, smoothing):
    """d²σ/dε² = E (1 − s²/r²)/2r and σ + αE = E (s + r)/2, both without cancellation."""
    n, strains = mpmath.mpf(smoothing), STRAINS[::3]
    lines = LineData.of_law(np.full(len(strains), 3.0), slackness, smoothing)
    curvature, above_floor = (evaluate(kernel, strains, lines) for kernel in (Smooth.curvature, Smooth.above_floor))
    for i, strain in enumerate(strains):
        s = mpmath.mpf(float(strain)) - mpmath.mpf(slackness)
        r = mpmath.sqrt(s * s + 4 * n * n)
        second = (1 - s * s / (r * r)) / (2 * r) if r else 0
        assert abs(curvature[i] - 3 * second) <= 1e-14 * 3 * second
        height = 3 * (s + r) / 2
        assert abs(above_floor[i] - height) <= 1e-14 * height
    for law, above in ((TensionOnly, np.maximum(3.0 * strains, 0.0)), (Linear, np.inf)):
        assert (evaluate(law.curvature, strains, lines) == 0.0).all()
        assert (evaluate(law.above_floor, strains, lines) == above).all()


def test_tension_only_is_the_limit_of_the_smooth_law_and_linear_is_two_sided():
    strain = np.linspace(-0.5, 0.5, 101)
    tension_only, smooth, linear = Law("tension-only"), Law("smooth"), Law("linear")
    np.testing.assert_array_equal(tension_only.stress(strain, 3.0), np.maximum(3.0 * strain, 0))
    for method in ("stress", "tangent", "energy_density"):
        pair = [getattr(law, method)(strain, 3.0) for law in (tension_only, smooth)]
        np.testing.assert_allclose(*pair, rtol=1e-15)  # the smooth formula at η = 0: a few roundings more
    np.testing.assert_array_equal(linear.stress(strain, 3.0), 3.0 * strain)
    np.testing.assert_array_equal(linear.energy_density(strain, 3.0), 1.5 * strain * strain)


def test_unknown_law_names_the_nearest():
    with pytest.raises(ValueError, match='did you mean "smooth"'):
        Law("smoth")
    with pytest.raises(ValueError, match="has numbers of its own"):
        Law("table")


@pytest.mark.parametrize("name", ["smooth", "tension-only", "linear"])
def test_strain_of_a_stress_is_the_inverse(name):
    law, numbers = Law(name), [(1.0, 0.0, 0.0)]
    if name == "smooth":
        numbers += [(7e7, 0.0, 1e-5), (1e3, 0.1, 1e-2), (1.0, 0.0, 0.5)]
    for modulus, *rest in numbers:
        for strain in (1e-3, 0.2, 3.0):
            stress = law.stress(strain, modulus, *rest)
            if stress > 1e-9 * modulus:
                np.testing.assert_allclose(law.strain(stress, modulus, *rest), strain, rtol=1e-12, atol=1e-14)
