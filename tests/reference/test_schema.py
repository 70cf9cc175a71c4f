"""The schema of scene files accepts what the checks accept and refuses what they refuse, key by key."""

import dataclasses
import json
import tomllib

import pytest
from jsonschema import Draft4Validator

import refweb
from refweb.__main__ import main
from refweb.reference.schema import accepted, schema
from refweb.registry import EFFECTS, INTEGRATORS, LAWS, LISTS, PARTS, SHAPES, SOLVES, WEBS, load
from refweb.scene import SHIPPED_SCENES
from refweb.settings import Head
from refweb.tables import Table

SCHEMA = schema()
VALIDATOR = Draft4Validator(SCHEMA)
SHIPPED = {path.stem: tomllib.loads(path.read_text(encoding="utf-8")) for path in SHIPPED_SCENES.glob("*.toml")}
NUMBERS = [
    -3,
    -1.5,
    -1,
    -1e-13,
    0,
    0.0,
    1e-14,
    1e-13,
    0.05,
    0.1,
    0.2,
    1,
    1.0,
    1.5,
    2,
    3,
    4,
    5,
    6,
    7,
    12,
    13,
    1000,
    1001,
]
NUMBERS += [1e100, 2e100, -2e100, 10_000, 10_001, 2**63 - 1, True, False]
TEXTS = [
    "last",
    "long",
    "full",
    "star",
    "",
    " ",
    "x",
    "w",
    "web",
    "smooth",
    "newton",
    "cvode",
    "auto",
    "sphere",
    "distance",
    "stress",
    "max",
    "a" * 81,
]
TEXTS += ["a" * 201, "a" * 4097, "middle", "dyneema", "contact", "twin", "lumped", "bdf", "dynamic", "static", "stays"]
TEXTS += ["square", "space", *WEBS]
LISTS_OF = [
    [],
    [1],
    [0.5],
    [-1],
    ["x"],
    ["x", "z"],
    [0, 2],
    [3],
    ["centre", 1],
    [1, 2, 3],
    [0.0, 1.0, "z"],
    [1, 2, 3, 4],
]
LISTS_OF += [[[0, 1]], [[0.0, 2.5], [1.0, 3.5]], [[0, -1]], [[0, 1, 2]], [[0, 1, 2], [1.5, 0, 0]], [[0, 1, 2, 3]], [[]]]
LISTS_OF += [[1, 2, True], [[0, 1], 2], [{"body": "drum", "turns": 1}], [{"turns": 1}]]
TABLES = [{}, {"a": 1}, {"a": []}, {"a": [1, 2]}, {"a": [-1]}, {"a": "x"}, {"a": {}}, {"a": {"b": 1}}]
TABLES += [{"direction": [0.0, 0.0, 1.0]}, {"arms": [[1.0, 2.0]]}]
VALUES = [*NUMBERS, *TEXTS, *LISTS_OF, *TABLES]


def classes():
    """All classes of tables, those by name inside of others among them."""
    references = [r for table in (WEBS, EFFECTS, PARTS, LISTS, SOLVES, SHAPES) for r in table.values()]
    found = {Head: None} | dict.fromkeys(map(load, references))
    for kind in list(found):
        for f in dataclasses.fields(kind):
            own = getattr(f.metadata["read"], "accepts", None)
            own = own() if callable(own) and not isinstance(own, type) else own
            inner = own.get("additionalProperties", own.get("items")) if isinstance(own, dict) else own
            found |= {inner: None} if isinstance(inner, type) else {}
    return list(found)


FIELDS = {f"{kind.__name__}.{f.name}": f for kind in classes() for f in dataclasses.fields(kind) if f.name != "form"}


def test_it_is_a_schema():
    Draft4Validator.check_schema(SCHEMA)
    assert len(FIELDS) > 100 and SCHEMA["$schema"].endswith("draft-04/schema#")


@pytest.mark.parametrize("name", FIELDS)
def test_a_key_takes_what_its_reader_takes(name):
    """Both say the same of numbers, texts, lists and tables; texts that cannot be printed are left to the reader."""
    f, read = FIELDS[name], FIELDS[name].metadata["read"]
    assert hasattr(read, "accepts"), "what the reader of this key accepts is not said: `refweb.accepted.accepts`"
    validator, taken = Draft4Validator(accepted(f)), 0
    for value in VALUES:
        try:
            read(f.name, value)
            taken += 1
            assert validator.is_valid(value), f"{value} is read"
        except refweb.InputError as refusal:
            assert not validator.is_valid(value), str(refusal)
    assert 0 < taken < len(VALUES)


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_scenes_validate(name):
    """As they stand, and with all defaults filled in."""
    assert list(VALIDATOR.iter_errors(SHIPPED[name])) == []
    assert VALIDATOR.is_valid(refweb.Scene.load(name).to_dict())


def tables(value):
    """All tables in a value, that itself among them."""
    for one in [value] if isinstance(value, dict) else []:
        yield one
    for one in value.values() if isinstance(value, dict) else value if isinstance(value, list) else []:
        yield from tables(one)


@pytest.mark.parametrize("name", ["catenary", "closing-net", "spinning-web"])
def test_a_misspelt_key_does_not_validate(name):
    given = json.loads(json.dumps(SHIPPED[name]))
    for table in tables(given):
        for key in list(table):
            value = table.pop(key)
            table[key + "s"] = value
            assert not VALIDATOR.is_valid(given), key
            del table[key + "s"]
            table[key] = value
    assert VALIDATOR.is_valid(given)


SCENE = {
    "web": {"kind": "cable", "start": [0, 0, 0], "end": [1, 0, 0], "elements": 2},
    "cable": {"modulus": 1.0, "area": 1.0, "density": 1.0},
    "solve": {"kind": "dynamic", "duration": 1.0},
}


def agree(given):
    """Whether a scene validates, which its check agrees with."""
    try:
        refweb.Scene.from_dict(given)
        read = True
    except refweb.InputError:
        read = False
    assert VALIDATOR.is_valid(given) == read, given
    return read


def test_what_is_missing_and_what_does_not_belong():
    assert agree(SCENE)
    for key, table in SCENE.items():
        assert not agree({k: v for k, v in SCENE.items() if k != key})
        for own in table:
            assert not agree(SCENE | {key: {k: v for k, v in table.items() if k != own}})
    web = {**SCENE["web"], "mesh": "square"}
    for wrong in ({"web": web}, {"gravity": [{"acceleration": [0, 0, 1]}]}, {"load": {"node": 0}}, {"load": []}):
        assert not agree(SCENE | wrong)


def test_methods_have_their_own_keys():
    values = {"safety": 0.5, "step_size": 0.1, "order": 4, "rtol": 1e-6, "atol_position": 1e-9, "atol_velocity": 1e-9}
    values |= {"family": "bdf", "max_order": 2, "linear_solver": "auto"}
    assert values.keys() == {key for method in INTEGRATORS.values() for key in method.keys}
    taken = 0
    for method in (*INTEGRATORS, "auto", None):
        for key, value in values.items():
            given = {"method": method, key: value} if method else {key: value}
            taken += agree(SCENE | {"solve": {**SCENE["solve"], **given}})
    central = len(INTEGRATORS["central-difference"].keys)
    assert taken == sum(len(method.keys) for method in INTEGRATORS.values()) + central


def test_shapes_have_their_own_keys():
    body = {"name": "a", "position": [0, 0, 1], "fixed": True}
    shapes = {
        "sphere": {"radius": 1.0},
        "ring": {"radius": 1.0, "normal": [0, 0, 1]},
        "box": {"size": [1, 1, 1]},
        "cylinder": {"radius": 1.0, "length": 1.0, "axis": [0, 0, 1]},
    }
    for shape, own in shapes.items():
        for other, keys in shapes.items():
            given = {**body, "shape": shape, **keys}
            assert agree(SCENE | {"body": [given]}) == (shape == other)
        assert agree(SCENE | {"body": [{**body, **own}]}) == (shape == "sphere")


def test_editors_are_told_what_keys_mean():
    """Each key of the schema has a description, but for those that make a web or a solution what it is."""
    for table in tables(SCHEMA):
        for key, own in table.get("properties", {}).items() if isinstance(table.get("properties"), dict) else ():
            texts = own, own.get("items", {})
            assert any("description" in one or "oneOf" in one for one in texts) or key == "kind", key
    cable = SCHEMA["properties"]["cable"]["properties"]
    assert cable["law"]["enum"] == [*LAWS] and cable["law"]["default"] == "smooth"
    assert "Cross section" in cable["area"]["description"] and "[m²]" in cable["area"]["description"]
    assert cable["area"]["minimum"] == 0 and cable["area"]["exclusiveMinimum"]


def test_command(capsys):
    assert main(["schema"]) == 0
    assert json.loads(capsys.readouterr().out) == SCHEMA


def test_a_key_whose_reader_says_nothing_takes_all():
    f = dataclasses.field(metadata={"read": lambda name, value: value, "unit": ""})
    assert accepted(f) == {}
    assert all(issubclass(kind, Table) for kind in classes())
