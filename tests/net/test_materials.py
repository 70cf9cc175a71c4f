"""Materials by name: they fill in what a scene leaves out, and what they fill in is said."""

import pytest

import refweb
from refweb.__main__ import main
from refweb.net.materials import MATERIALS


def scene(cable, **tables):
    return refweb.Scene.from_dict({
        "web": {"kind": "inline", "points": [[0, 0, 0], [1, 0, 0], [2, 0, 0]], "lines": [[0, 1], [1, 2]],
                "supports": [0], "groups": ["", "tail"]},
        "cable": {"law": "tension-only", "area": 1e-6, **cable},
        "support": [{"nodes": [1, 2], "components": ["y", "z"]}],
        "load": [{"node": 2, "force": [120.0, 0.0, 0.0]}],
        "solve": {"kind": "static"},
        "observe": [{"name": "stretch", "quantity": "displacement", "node": 2, "component": "x"}],
        **tables,
    })  # fmt: skip


def test_a_material_gives_what_a_scene_leaves_out():
    """Two lines under 120 N stretch by F L/EA each; what is used of the strength is F/A over it."""
    solution = refweb.run(scene({"material": "dyneema"}))
    assert solution.results["stretch"].value == pytest.approx(2.0 * 120.0 / (1.2e11 * 1e-6), rel=1e-12)
    assert solution.utilisation.value == pytest.approx(120.0 / 1e-6 / 3.6e9, rel=1e-12)
    (note,) = [finding for finding in solution.findings if finding.code == "material"]
    assert note.severity == "note"
    for part in ("modulus = 1.2e+11 Pa", "density = 975 kg/m³", "strength = 3.6e+09 Pa", "typical", "CIS YA100"):
        assert part in note.text


def test_keys_go_before_the_material():
    """And are not said to be the material's; a group has its own material."""
    solution = refweb.run(
        scene({"material": "nylon", "modulus": 5e9, "groups": {"tail": {"material": "steel-rope", "density": 0.0}}})
    )
    exact = 120.0 / (5e9 * 1e-6) + 120.0 / (1e11 * 1e-6)
    assert solution.results["stretch"].value == pytest.approx(exact, rel=1e-12)
    first, second = [finding.text for finding in solution.findings if finding.code == "material"]
    assert "modulus" not in first and "density = 1140" in first
    assert second.startswith('group "tail": modulus = 1e+11 Pa, strength') and "density" not in second


def test_a_saved_scene_keeps_the_values():
    again = refweb.Scene.from_dict(scene({"material": "zylon"}).to_dict())
    assert (again.cable.modulus, again.cable.density, again.cable.material) == (1.8e11, 1540.0, "zylon")


def test_without_a_material_keys_are_asked_for():
    with pytest.raises(refweb.InputError, match=r"modulus is missing: give modulus = ... \[Pa\] or a material"):
        scene({"density": 1.0})
    with pytest.raises(refweb.InputError, match=r"density is missing: give density = ... \[kg/m³\] or a material"):
        scene({"modulus": 1e9})
    with pytest.raises(refweb.InputError, match='did you mean "dyneema"'):
        scene({"material": "dynema"})


def test_values_are_of_their_order(capsys):
    """Every material breaks between 1 and 20 % of strain, is lighter than steel or is it, and names its source."""
    for name, material in MATERIALS.items():
        assert 0.01 < material.strength / material.modulus < 0.2 and 900.0 < material.density <= 7850.0, name
        assert material.source and material.kind
    assert main(["help", "materials"]) == 0
    text = capsys.readouterr().out
    assert all(name in text for name in MATERIALS) and "EN 1993-1-11" in text
