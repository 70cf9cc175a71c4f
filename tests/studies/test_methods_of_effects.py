"""Scenes of an orbit, of drag and of a folded start by all methods: ``auto`` takes them, ± holds the truth, and
``refweb cost`` finds two methods of different kinds that agree."""

import pytest

import refweb
from refweb.scene import Scene
from validation.methods.cross_validation import EFFECTS, SMALL

SCENES = {name: SMALL | EFFECTS[name] for name in ("[orbit]", "[drag]")}
SCENES["fold"] = SMALL | {"fold": {"ratio": 0.5, "gap": 1e-4}, "supports": {"nodes": []}}


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_every_method(name):
    height = {"name": "height", "quantity": "displacement", "node": "centre", "component": "z"}
    scene = Scene.from_dict(SCENES[name] | {"observe": [height]})
    chosen = refweb.run(scene.replace(solve=refweb.Dynamic(duration=0.3, method="auto"))).results["height"]
    found = refweb.cost(scene, budget=25.0)
    assert {"central-difference", "cvode-bdf", "ida"} <= {t.method for t in found.trials if t.status == "solved"}
    assert found.independent and found.apart[0] < 1e-9 * found.scale
    exact = found.references[0].values[-1]
    assert abs(chosen.value - exact) < chosen.error
