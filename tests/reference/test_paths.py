"""Values by path: what a dict of a scene becomes, and what is no path."""

import copy

import pytest

import refweb
from refweb.reference.paths import read_settings, with_value
from refweb.tables import Table

GIVEN = {
    "title": "net",
    "cable": {"area": 1.0, "groups": {"a b": {"area": 2.0}}},
    "body": [{"name": "ball", "velocity": [0, 0, 1]}, {"name": "debris"}],
    "solve": {"load_steps": [1, 2], "nodes": []},
}
PUT = {
    "cable.area": lambda given: given["cable"]["area"],
    'cable.groups."a b".area': lambda given: given["cable"]["groups"]["a b"]["area"],
    "cable.groups.rim.area": lambda given: given["cable"]["groups"]["rim"]["area"],
    "body.1.velocity": lambda given: given["body"][1]["velocity"],
    "body.0.velocity.2": lambda given: given["body"][0]["velocity"][2],
    "body.debris.mass": lambda given: given["body"][1]["mass"],
    "body.2.mass": lambda given: given["body"][2]["mass"],
    "load.0.node": lambda given: given["load"][0]["node"],
    "gravity.acceleration": lambda given: given["gravity"]["acceleration"],
    "solve.load_steps.1": lambda given: given["solve"]["load_steps"][1],
    "title": lambda given: given["title"],
}
WRONG = {
    "body.3.mass": "body.3.mass = 7: body.3: the number must be 0 … 1; 2 adds one",
    "body.-1.mass": 'body is a list: "-1" must be a number, 0 … 1, or its name, known: ball, debris',
    "body.bal.mass": 'body is a list: "bal" must be a number, 0 … 1, or its name, did you mean "ball"?',
    "body." + "9" * 900: "the number must be 0 … 1; 2 adds one",
    "solve.load_steps.2": "solve.load_steps.2: the number must be 0 … 1",
    "solve.load_steps.first": 'solve.load_steps is a list: "first" must be a number, 0 … 1',
    "solve.nodes.0": "solve.nodes = [] is empty, give it whole",
    "cable.area.x": "cable.area = 1.0 has no keys",
    "": 'path "" must be keys and numbers with dots between',
    "a b": 'path "a b" must be keys',
    "a = 1\nb": "must be keys",
    "a" + ".a" * 100_000: "must be keys",
}


@pytest.mark.parametrize("path", PUT)
def test_a_value_is_put_where_the_path_says_and_nowhere_else(path):
    given = copy.deepcopy(GIVEN)
    changed = with_value(given, path, 7)
    assert PUT[path](changed) == 7 and given == GIVEN
    assert with_value(changed, path, None) == with_value(given, path, None)


def test_an_effect_is_left_out_by_false():
    """And nothing else is, nor what stands in an effect."""
    given = GIVEN | {"contact": {"friction": 0.3}}
    assert with_value(given, "contact", False) == with_value(GIVEN, "gravity", False) == GIVEN
    assert "body" not in with_value(given, "body", False)
    assert with_value(given, "contact.friction", False)["contact"] == {"friction": False}
    assert with_value(given, "cable", False)["cable"] is False
    scene = refweb.Scene.load("closing-net", {"contact": False, "accuracy.error": "none", "solve.duration": 1e-3})
    assert scene.contact is None and refweb.Scene.load("closing-net").contact is not None


@pytest.mark.parametrize("path", WRONG)
def test_what_is_no_path(path):
    with pytest.raises(refweb.InputError) as refusal:
        with_value(GIVEN, path, 7)
    assert WRONG[path] in str(refusal.value) and len(str(refusal.value)) < 250


def test_values_are_read_as_toml_and_bare_words_as_texts():
    given = ["a.b=0.5", "c = [0, 0, 2]", "d=newton", 'e="x = y"', "f=true", "a.b=1e3", "g={x = 1}", "h=./a b", "i="]
    read = {"a.b": 1e3, "c": [0, 0, 2], "d": "newton", "e": "x = y", "f": True, "g": {"x": 1}, "h": "./a b", "i": ""}
    assert read_settings(given) == read and list(read_settings(given)) == list("a") * 0 + list(read)


@pytest.mark.parametrize("given", ["a", "=1", "a=[1,", "a={x=", 'a="x', "a=[1]\nb=2"])
def test_what_is_no_setting(given):
    with pytest.raises(refweb.InputError, match="--set "):
        read_settings([given])


def test_a_path_of_each_key_of_a_scene_leads_to_it():
    """What ``scene.toml`` holds comes back where each of its values is put at its own path."""
    scene = refweb.Scene.load("closing-net").to_dict()

    def leaves(value, path):
        parts = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else None
        if parts is None or value == []:
            yield path, value
        else:
            for key, one in parts:
                yield from leaves(one, (*path, str(key)))

    again = scene
    for path, value in leaves(scene, ()):
        assert with_value(scene, ".".join(path), value) == scene
        again = with_value(again, ".".join(path), "changed")
    assert {value for _, value in leaves(again, ())} == {"changed"}
    assert isinstance(refweb.Scene.load("closing-net", {"solve.duration": 0.5}).solve, Table)
