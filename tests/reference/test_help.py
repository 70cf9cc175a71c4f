"""``refweb help`` and the reference: each table with all its keys, examples that pass the check, one text for both."""

import dataclasses
import pathlib
import tomllib

import meshio
import numpy as np
import pytest
import solids
from jsonschema import Draft4Validator

import refweb
from refweb.__main__ import main
from refweb.reference.glossary import GLOSSARY
from refweb.reference.pages import names, pages_of, takes
from refweb.reference.schema import schema
from refweb.reference.words import as_markdown, as_text
from refweb.registry import EFFECTS, LISTS, PARTS, SHAPES, SIZING, SOLVES, STUDY, WEBS, load
from refweb.scene import shipped
from refweb.tables import Table, key_of, real, table

REFERENCE = pathlib.Path(__file__).parents[2] / "validation" / "REFERENCE.md"
PAGES = {page.name: page for name in names() for page in pages_of(name)}

# A flat net of two by two squares about the origin, its outer lines a group.
POINTS = [[x, y, 0] for y in (-1, 0, 1) for x in (-1, 0, 1)]
LINES = [[3 * r + c, 3 * r + c + 1] for r in range(3) for c in range(2)] + [[n, n + 3] for n in range(6)]
NET = {"kind": "inline", "points": POINTS, "lines": LINES, "supports": [0, 2, 6, 8]}
NET["groups"] = {"rim": [0, 1, 4, 5, 6, 8, 9, 11]}
SCENE = {
    "web": NET,
    "cable": {"modulus": 7e7, "area": 1e-4, "density": 200.0},
    "solve": {"kind": "dynamic", "duration": 0.25},
}
BALL = {"name": "ball", "radius": 0.1, "mass": 1.0, "position": [0, 0, -0.2]}
AROUND = {
    "attach": {
        "supports": {"nodes": []},
        "body": [BALL | {"name": "hub"}, BALL | {"name": "box", "position": [0, 0, 1]}],
    },
    "contact": {"body": [BALL]},
    "contact.bodies": {"body": [BALL]},
    "damping": {"body": [BALL]},
    "drag.bodies": {"body": [BALL | {"name": "hub"}], "drag": {"density": 1.2}},
    "event": {"body": [BALL], "contact": {}},
    "temperature.groups": {"temperature": {"expansion": 1e-6, "change": 0.0}},
    "load": {"body": [BALL | {"name": "hub"}]},
    "link": {"solve": {**SCENE["solve"], "method": "ida"}},
    "motion": {"body": [{"name": "drum", "radius": 0.1, "position": [0, 0, -0.2]}]},
    "thread.around": {
        "body": [BALL | {"name": "pulley", "shape": "ring", "normal": [0, 1, 0]}],
    },
    "winch": {
        "cable": {**SCENE["cable"], "law": "tension-only"},
        "thread": [{"name": "rope", "nodes": [0, 1, 2], "modulus": 1e9, "area": 1e-6, "density": 1.0}],
    },
    "bending": {"cable": {**SCENE["cable"], "subdivide": 2}},
    "fold": {"supports": {"nodes": []}},
    "control": {
        "load": [{"node": 4, "force": [0, 0, 1]}],
        "observe": [{"name": "height", "quantity": "position", "node": 4, "component": "z"}],
    },
    "gym": {
        "load": [{"node": 4, "force": [0, 0, 1]}],
        "point_mass": [{"node": 4, "mass": 1.0}],
        "observe": [
            {"name": name, "quantity": quantity, "node": 4, "component": "z"}
            for name, quantity in (("height", "position"), ("speed", "velocity"))
        ],
    },
    "throw": {
        "observe": [
            {"name": "mouth", "quantity": "mouth_area", "node": [0, 1, 2]},
            {"name": "height", "quantity": "position", "node": 0, "component": "z"},
        ]
    },
}
"""What examples need besides the net."""


def merged(given, more):
    """Tables with those of others put into them."""
    both = {key: merged(given[key], more[key]) for key in given.keys() & more.keys() if isinstance(given[key], dict)}
    return given | more | both


@pytest.mark.parametrize("name", [name for name in PAGES if name not in ("study", "sizing")])
def test_examples_pass_the_check(name, tmp_path, monkeypatch, capsys):
    """In the smallest scene around them; they are of their own table, short, and they validate."""
    page = PAGES[name]
    own = tomllib.loads(page.example)
    head, _, kind = name.partition(".")
    assert page.example.count("\n") < 8 and (head in own or head in ("scene", "support"))
    scene = SCENE | AROUND.get(name, {})
    whole = {
        key: table
        for key, table in own.items()
        if key in ("web", "solve", "cable") and table.keys().isdisjoint(("groups", "viscous"))
    }
    scene = merged(scene, own) | whole
    refused = Draft4Validator(schema()).iter_errors(scene)
    assert [error.message for error in refused] == []
    if name == "web.file":
        cells, support = {"line": np.array(LINES)}, {"support": np.arange(9) % 2}
        meshio.write(tmp_path / "net.vtu", meshio.Mesh(np.array(POINTS, float), cells, point_data=support))
    if name == "body.mesh":
        solids.write(tmp_path / "satellite.stl", *solids.box((300.0, 300.0, 300.0)))
    if name == "body.terrain":
        (tmp_path / "hill.csv").write_text("x,y,z\n-1,-1,0\n1,-1,0\n-1,1,0\n1,1,0.5\n")
    import tomli_w

    monkeypatch.chdir(tmp_path)
    (tmp_path / "net.toml").write_text(tomli_w.dumps(scene), encoding="utf-8")
    assert main(["check", "net.toml"]) == 0, capsys.readouterr().err


@pytest.mark.parametrize(
    "name",
    [page for page in PAGES if "." in page and page.split(".")[0] in ("web", "solve", "body") and page != "body.axle"],
)
def test_examples_of_kinds_are_of_their_kind(name):
    head, _, kind = name.partition(".")
    table = tomllib.loads(PAGES[name].example)[head]
    table = table[0] if isinstance(table, list) else table
    assert table.get("kind", table.get("shape")) == kind


def test_the_example_of_a_study_is_one():
    study = refweb.Study(**tomllib.loads(PAGES["study"].example))
    assert study.drawn and study.count and study.conditions and study.scene in shipped()
    assert {key.name for key in PAGES["study"].keys} == {*study.to_dict()} | {"count", "skip", "conditions", "indices"}


def test_the_example_of_a_sizing_is_one():
    sizing = refweb.Sizing(**tomllib.loads(PAGES["sizing"].example))
    assert sizing.parameters and sizing.requirements and sizing.scene in shipped()
    assert {key.name for key in PAGES["sizing"].keys} == {*sizing.to_dict()} | {"count", "draws"}
    for file, page in (("study", PAGES["study"]), ("sizing", PAGES["sizing"])):
        validator = Draft4Validator(schema(file))
        assert list(validator.iter_errors(tomllib.loads(page.example))) == []
        assert list(validator.iter_errors({**tomllib.loads(page.example), "sed": 1}))


def test_every_table_has_a_page():
    tables = {*WEBS.values(), *EFFECTS.values(), *PARTS.values(), *LISTS.values(), *SOLVES.values(), *SHAPES.values()}
    assert {*names()} == {"scene", "web", "solve", "study", "sizing", *PARTS, *LISTS, *EFFECTS} and len(names()) == len(
        {*names()}
    )
    assert len(PAGES) >= len(tables) and {"cable.groups", "contact.bodies", "temperature.groups"} <= PAGES.keys()


@pytest.mark.parametrize("name", PAGES)
def test_a_page_has_every_key_with_what_it_takes_and_means(name, capsys):
    page = PAGES[name]
    assert main(["help", name]) == 0
    printed = capsys.readouterr().out
    words = " ".join(printed.split())
    kinds = {f"web.{k}": r for k, r in WEBS.items()} | {f"solve.{k}": r for k, r in SOLVES.items()}
    kinds |= {f"body.{k}": r for k, r in SHAPES.items()} | PARTS | LISTS | EFFECTS | {"study": STUDY, "sizing": SIZING}
    for f in dataclasses.fields(load(kinds[name])) if name in kinds else ():
        assert f.name in ("kind", "form", "folder") or any(key.name == key_of(f) for key in page.keys)
    for key in page.keys:
        assert key.meaning.endswith(".") and key.takes != "value", key
        assert f" {key.name} {key.takes}" in words and key.meaning in words
        if key.default not in ("", "required"):
            assert f"default {key.default}" in words
    assert page.summary.endswith(".") or page.summary.endswith(".")
    assert page.header in printed and all(line in printed for line in page.example.splitlines())
    assert max(len(line) for line in printed.splitlines() if "  " not in line.strip()) <= 100


def test_the_reference_is_what_help_prints():
    """``python -m refweb help --markdown > validation/REFERENCE.md`` writes it anew."""
    assert REFERENCE.read_text(encoding="utf-8") == as_markdown()


def test_markdown_has_all_of_it(capsys):
    assert main(["help", "--markdown"]) == 0
    text = capsys.readouterr().out
    assert text == as_markdown() and text.count("\n## ") == len(names()) + 2  # materials and the glossary
    for page in PAGES.values():
        assert page.summary in text and page.example in text
        assert all(f"| `{key.name}` | " in text for key in page.keys)
    for line in text.splitlines():
        if line.startswith("|"):
            assert line.replace("\\|", "").count("|") in (3, 4, 5, 6)


def test_overview_has_a_line_for_each_table(capsys):
    assert main(["help"]) == 0
    *lines, empty, hint, glossary, materials, guide = capsys.readouterr().out.splitlines()
    assert "help materials" in materials and "help quick-start" in guide
    assert len(lines) == len(names()) and empty == "" and "refweb help TABLE" in hint and "help glossary" in glossary
    for line, name in zip(lines, names(), strict=True):
        header = line.split("  ")[0]
        assert name == "scene" or header.strip("[]") == name
        several = name in LISTS or (name in EFFECTS and load(EFFECTS[name]).several)
        assert header.startswith("[[") == several and line.endswith(".")


@pytest.mark.parametrize(
    "table, hint",
    [
        ("gravty", 'did you mean "gravity"?'),
        ("[[bodys]]", 'did you mean "body"?'),
        ("web.cabel", 'did you mean "web.cable"?'),
        ("solve.dinamic", 'did you mean "solve.dynamic"?'),
        ("gravity.x", 'did you mean "gravity"?'),
        ("modulus", "it is a key of cable, cable.groups"),
        ("mesh", "it is a key of web.paper, web.window, web.layers"),
        ("", "known: scene, web, cable"),
        ("quick-strat", 'did you mean "quick-start"?'),
        ("own-efect", 'did you mean "own-effect"?'),
    ],
)
def test_a_misspelt_table_gets_the_nearest(table, hint, capsys):
    assert main(["help", table]) == 2
    out, err = capsys.readouterr()
    assert out == "" and f"help {table}: there is no such table, {hint}" in err and err.count("\n") == 1


def test_a_table_is_found_by_its_header():
    assert as_text("[[load]]") == as_text("load") and as_text("[gravity]") == as_text("gravity")
    assert as_text("title") == as_text("seed") == as_text("scene")
    assert as_text("web").count("\n[web] kind") + 1 == len(WEBS)


def test_what_is_added_appears_by_itself(monkeypatch):
    monkeypatch.setitem(EFFECTS, "tide", EFFECTS["gravity"])
    assert "tide" in names() and pages_of("tide")[0].keys == pages_of("gravity")[0].keys
    assert "tide" in schema()["properties"] and "[tide]" in as_markdown()
    monkeypatch.setitem(SHAPES, "bead", SHAPES["sphere"])
    (shape,) = (key for key in pages_of("body")[0].keys if key.name == "shape")
    assert '"bead"' in shape.takes and pages_of("body.bead")


@pytest.mark.parametrize(
    "accepted, words",
    [
        ({"type": "number"}, "number"),
        ({"type": "number", "minimum": 0, "exclusiveMinimum": True, "maximum": 1e100}, "number > 0"),
        ({"type": "number", "minimum": 0.0, "maximum": 1, "exclusiveMaximum": True}, "number ≥ 0, < 1"),
        ({"type": "integer", "minimum": 1, "maximum": 12}, "whole number, 1 … 12"),
        ({"type": "string", "enum": ["a", "b"]}, '"a", "b"'),
        ({"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}, "3 numbers"),
        ({"type": "array", "items": {"type": "string"}, "minItems": 0}, "[text, ...]"),
        ({"type": "object", "additionalProperties": {"type": "integer"}}, "{name = whole number}"),
    ],
)
def test_what_keys_take_in_words(accepted, words):
    assert takes(accepted) == words


def test_limits_stand_with_the_keys_that_have_them():
    """Numbers that checks know are those that help tells."""
    for name, key in [("cable", "subdivide"), ("accuracy", "digits"), ("solve.dynamic", "max_order")]:
        (told,) = (one.takes for one in PAGES[name].keys if one.name == key)
        least, most = (int(one) for one in told.split(",")[1].split("…"))
        kind = {"cable": refweb.Cable, "accuracy": refweb.Accuracy, "solve.dynamic": refweb.Dynamic}[name]
        read = next(f for f in dataclasses.fields(kind) if f.name == key).metadata["read"]
        assert read(key, least) == least and read(key, most) == most
        for beyond in (least - 1, most + 1):
            with pytest.raises(refweb.InputError):
                read(key, beyond)


def test_a_class_without_a_docstring_has_a_page(monkeypatch):
    """As one in a notebook may be: its keys, and no signature in place of a summary."""

    @table
    class Bare(Table):
        weight: float = real(unit="N")

    monkeypatch.setitem(EFFECTS, "bare", Bare)
    text = as_text("bare")
    assert text.splitlines()[0] == "[bare]" and "weight\n        number [N]; required" in text and "Bare" not in text


def test_the_glossary_explains_each_term_once(capsys):
    """In one sentence of at most 25 words; terms of scene files keep their meaning as tables."""
    terms = [term for entries in GLOSSARY.values() for term in entries]
    assert len(terms) >= 120 and len({term.lower() for term in terms}) == len(terms)
    for entries in GLOSSARY.values():
        for term, meaning in entries.items():
            assert meaning.endswith(".") and len(meaning.split()) <= 25, term
            assert main(["help", term]) == 0
            printed = capsys.readouterr().out
            assert printed.startswith(f"{term}: {meaning}") or term in names()
    assert main(["help", "glossary"]) == 0
    printed = capsys.readouterr().out
    assert all(f"{term}: " in printed for term in terms) and max(map(len, printed.splitlines())) <= 100
