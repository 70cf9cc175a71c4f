"""Lines between two supports, which no move of a node balances: ± is the rounding of their strain."""

import mpmath
import numpy as np
import pytest

import refweb

MODULUS, AREA = 7e9, 1e-6


def true_strain(one, other, natural):
    """(|a − b| − L)/L of the very numbers, with 50 digits."""
    with mpmath.workdps(50):
        apart = [mpmath.mpf(a) - mpmath.mpf(b) for a, b in zip(one, other, strict=True)]
        return float((mpmath.sqrt(sum(d * d for d in apart)) - natural) / natural)


@pytest.mark.ordinary("1e-14-tension-only", "1e-10-tension-only", "0.0001-tension-only")
@pytest.mark.parametrize("law", ["tension-only", "linear"])
@pytest.mark.parametrize("strain", [1e-14, 1e-10, 1e-4])
def test_their_error_is_that_of_rounding(strain, law):
    """Against 50 digits, of random lines and with one that hangs beside them; ± is some units of round-off of EA."""
    rng, shares = np.random.default_rng(0), []
    for _ in range(10):
        points = rng.uniform(-1.0, 1.0, (3, 3)).tolist()
        length = [
            float(np.linalg.norm(np.subtract(points[0], points[k])) / (1.0 + e)) for k, e in ((1, strain), (2, 1e-3))
        ]
        scene = refweb.Scene(
            web=refweb.Inline(
                points=[*points, (np.mean(points, axis=0)).tolist()],
                lines=[[0, 1], [0, 2], [0, 3], [3, 1]],
                natural_length=[*length, 1.5, 1.5],
                supports=[0, 1, 2],
            ),
            cable=refweb.Cable(law=law, modulus=MODULUS, area=AREA, density=0.0),
            effects=[refweb.Load(node=3, force=(0.3, 0.2, -1.0))],
            observe=[
                refweb.Observe(name="tension", quantity="tension", line=0),
                refweb.Observe(name="pull", quantity="reaction", node=2),
                refweb.Observe(name="strain", quantity="strain", line=0),
            ],
            solve=refweb.Static(),
        )
        results = refweb.run(scene).results
        strains = [true_strain(points[0], points[k], length[k - 1]) for k in (1, 2)]
        pulls = [MODULUS * AREA * one for one in strains]
        for name, value in (("tension", pulls[0]), ("pull", pulls[1])):
            assert abs(results[name].value - value) <= results[name].error, name
        shares.append(results["tension"].error / (np.finfo(float).eps * MODULUS * AREA))
        if results["strain"].error is not None:
            assert abs(results["strain"].value - strains[0]) <= results["strain"].error
    if strain < 1e-12 and law == "linear":
        assert max(shares) < 20.0
