"""A force of contact has no limit only where it scales as that of a first touch, with elements and with stiffness."""

import pytest

import refweb
from refweb.results.error_budget import MODEL, NO_LIMIT
from validation.methods import trust


@pytest.mark.parametrize(
    ("seed", "verdict"),
    [
        (58, NO_LIMIT),  # 21.5, 15.3 and 9.8 N with 1, 2 and 4 elements, and 7.2 N with 8
        (35, MODEL),  # grows twofold with four times the stiffness, but stays at 150 N from 4 elements on
        (29, MODEL),  # falls by 0.55 with twice the elements, faster than a first touch, and stays at 25 N from 4 on
    ],
)
def test_verdict_on_a_force(seed, verdict):
    _, scene = next(trust.scenes("impact", seed))
    scene = scene.replace(observe=[one for one in scene.observe if one.name == "contact_force"])
    found = refweb.trust(scene, progress=False).results["contact_force"]
    assert found.verdict == verdict
    if verdict == MODEL:
        with_eight = trust.results_at(scene, 8)["contact_force"]
        assert with_eight == pytest.approx(trust.results_at(scene, 4)["contact_force"], rel=0.1)
        assert abs(with_eight - found.value) < found.error
