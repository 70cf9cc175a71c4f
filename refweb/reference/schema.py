"""The JSON Schema of scene files, made of the tables that check them; of draft 4, which editors of TOML read.

May change: private functions and descriptions. Must stay: `DRAFT`, draft 4 of JSON Schema, which editors of TOML read;
that it accepts what the checks accept; `accepted`, which `pages` uses. A new key of a table needs no change here, and
no file of the schema is stored. Tests: ``tests/reference/test_schema.py``.
"""

from __future__ import annotations

import dataclasses
from dataclasses import MISSING
from typing import Any

from ..registry import EFFECTS, INTEGRATORS, LISTS, PARTS, SHAPES, SIZING, SOLVES, STUDY, WEBS, load
from ..settings import Head
from ..tables import Table, key_of
from .docstrings import parameters, summary

OTHERS = {"study": STUDY, "sizing": SIZING}
"""Classes of other files."""
DRAFT = "http://json-schema.org/draft-04/schema#"


def schema(file="scene"):
    """The schema of scene files, or of those of a "study" or a "sizing", a dict of plain values."""
    if file in OTHERS:
        kind = load(OTHERS[file])
        return {"$schema": DRAFT, "title": f"A {file} of refweb", **_table(kind, without=["folder"])}
    head, tables = _table(Head), {"web": _webs(), "solve": _solves()}
    tables |= {key: _table(load(reference)) for key, reference in PARTS.items()}
    tables |= {key: _list(_table(load(reference))) for key, reference in LISTS.items()}
    for key, reference in EFFECTS.items():
        kind = load(reference)
        properties_of = _bodies(kind) if key == "body" else _table(kind)
        tables[key] = _list(properties_of) if kind.several else properties_of
    return {
        "$schema": DRAFT,
        "title": "A scene of refweb",
        "description": "A scene file of refweb, in SI units: a table that is present is an effect that is present.",
        **{key: value for key, value in head.items() if key != "description"},
        "properties": {**head["properties"], **tables},
        "required": ["web", "cable", "solve"],
    }


def accepted(f, like=None) -> dict[str, Any]:
    """The schema of what a field accepts; that of anything where its reader says nothing.

    ``like`` is the class of tables whose keys are described where a table in the field says nothing of its own.
    """
    given = getattr(f.metadata["read"], "accepts", {})
    return _plain(given() if callable(given) and not isinstance(given, type) else given, like)


def _plain(given, like) -> Any:
    """A schema with classes of tables as theirs."""
    if isinstance(given, type):
        return _table(given, like=like)
    if isinstance(given, dict):
        return {key: _plain(value, like) for key, value in given.items()}
    return [_plain(value, like) for value in given] if isinstance(given, (list, tuple)) else given


def _table(kind, *more, fixed=None, without=(), optional=(), like=None) -> dict:
    """The schema of a table with the keys of some classes, of which the first describes it.

    Values of ``fixed`` keys make the table what it is, and those in ``optional`` may be left out. It does not have keys
    in ``without``; the class ``like`` describes keys of which the others say nothing.
    """
    fixed, properties, required = fixed or {}, {}, [key for key in fixed or {} if key not in optional]
    for owner in (kind, *more):
        said = (parameters(like) if like else {}) | parameters(owner)
        for f in dataclasses.fields(owner):
            if f.name in without or (f.name in properties and f.name in fixed):
                continue
            property_ = {"enum": [fixed[f.name]]} if f.name in fixed else accepted(f, kind)
            properties[key_of(f)] = {**property_, **_described(f, said.get(key_of(f), ""))}
            if f.default is MISSING and f.default_factory is MISSING and f.name not in fixed:
                required.append(key_of(f))
    schema_found = {"type": "object", "description": summary(kind), "properties": properties}
    either = {"anyOf": [{"required": [*keys]} for keys in kind.either]} if kind.either else {}
    return schema_found | ({"required": required} if required else {}) | either | {"additionalProperties": False}


def _described(f, text):
    """Description and default of a key."""
    unit = f.metadata["unit"]
    text += f" [{unit}]" if unit and f"[{unit}]" not in text else ""
    default = f.default.to_dict() if isinstance(f.default, Table) else f.default
    entry = {"description": text.strip()} if text.strip() else {}
    return entry | ({} if default is MISSING or default is None else {"default": _listed(default)})


def _listed(value):
    return [_listed(item) for item in value] if isinstance(value, tuple) else value


def _list(table):
    return {"type": "array", "items": table, "minItems": 1}


def _webs():
    """Webs by kind, each with what may be said of its fold."""
    forms, fold = [], load(EFFECTS["fold"])
    folded = {"fold": {"anyOf": [{"enum": ["star"]}, _table(fold)], "description": summary(fold)}}
    folded["positions"] = {"type": "string", "description": 'File of a fold with kind = "positions".'}
    for kind, reference in WEBS.items():
        form = _table(load(reference), fixed={"kind": kind})
        forms.append(form | {"properties": form["properties"] | folded})
    return {"oneOf": forms}


def _solves():
    """Statics, and dynamics by every method, each with its own keys."""
    kinds = {kind: load(reference) for kind, reference in SOLVES.items()}
    default = next(f.default for f in dataclasses.fields(kinds["dynamic"]) if f.name == "method")
    keys = {name: method.keys for name, method in INTEGRATORS.items()} | {"auto": ()}
    every = {key for keys_of in keys.values() for key in keys_of}
    forms = [_table(kinds["static"], fixed={"kind": "static"})]
    for method, keys_of in keys.items():
        fixed, optional = {"kind": "dynamic", "method": method}, ["method"] if method == default else []
        forms.append(_table(kinds["dynamic"], fixed=fixed, optional=optional, without=every - set(keys_of)))
    return {"oneOf": forms}


def _bodies(kind):
    """Bodies by shape, each with the keys of its own."""
    default = next(f.default for f in dataclasses.fields(kind) if f.name == "shape")
    forms = []
    for shape, reference in SHAPES.items():
        optional = ["shape"] if shape == default else []
        forms.append(_table(kind, load(reference), fixed={"shape": shape}, optional=optional, without=["form"]))
    return {"oneOf": forms}
