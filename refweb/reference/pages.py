"""The pages of the reference: for each table what it is, its keys and what they take, what is refused, and an example.

All of it is read off the classes that check scenes: fields say what keys take, docstrings what they mean.

May change: private functions, the order of pages (`FIRST`), `LARGE`, and texts (`SUMMARIES`); ``python -m refweb help
--markdown > validation/REFERENCE.md`` then writes the reference anew. Must stay: fields of `Page`, `Key` and `Listing`,
which `words` reads; names of pages, which users type. A new key of a table needs no change here. Must stay as well:
`header_of`, `line_of`, `pages_of` and `names`, which `words` imports, the last `commands.help` as well; "web" stands in
`FIRST`, as in no other table. Tests: ``tests/reference/test_help.py``.
"""

from __future__ import annotations

import dataclasses
import json
from dataclasses import MISSING
from typing import Any, NamedTuple

from ..errors import InputError
from ..messages import nearest
from ..registry import EFFECTS, INTEGRATORS, LAWS, LISTS, OBSERVABLES, PARTS, SHAPES, SIZING, SOLVES, STUDY, WEBS, load
from ..settings import Head
from ..tables import Table, key_of
from .docstrings import example, parameters, prose, refusals, summary
from .schema import accepted

FIRST = ("web", "cable", "supports", "support")
"""Tables that the reference begins with."""
FILES = {"study": STUDY, "sizing": SIZING}
"""Classes of files of their own."""
LARGE = 1e18
"""Bounds of this size and above are those of all numbers, and not told with each."""
SUMMARIES = {
    "web": f"Nodes, lines and natural lengths, of one kind: {', '.join(WEBS)}.",
    "solve": f"What is solved, and how: {', '.join(SOLVES)}.",
    "supports": "Supports in place of the web's own.",
    "support": "Supports in addition to others.",
    "study": "Many runs of one scene: a file of its own, for `refweb sweep`.",
    "sizing": "The least design of a scene that meets requirements: a file of its own, for `refweb size`.",
}
"""Summaries of tables that share a class, or that have a class for each kind."""


class Key(NamedTuple):
    """A key of a table, in words."""

    name: str
    takes: str
    unit: str
    default: str
    meaning: str


class Listing(NamedTuple):
    """Rows of words below a page's keys."""

    columns: tuple[Any, ...]
    rows: list[Any]


class Page(NamedTuple):
    """Reference page of one table, or of one kind of it.

    Attributes
    ----------
    name : str
        Name in ``refweb help``: the table, then a dot and the kind, or the key of tables inside of it.
    header : str
        Header in a scene file.
    summary : str
        First sentence of its description.
    prose : list of str
        Further paragraphs of its description.
    keys : list of Key
        Its keys.
    refused : str
        Refusals beyond the limits of single keys.
    example : str
        Lines of a scene file.
    listing : Listing, optional
        Possible values of a key, row by row.
    """

    name: str
    header: str
    summary: str
    prose: list[Any]
    keys: list[Any]
    refused: str
    example: str
    listing: Listing | None = None


def names():
    """Names of the tables of a scene, in the order of the reference, of a study and of a sizing."""
    rest = [name for name in (*PARTS, *LISTS) if name not in FIRST]
    return ["scene", *FIRST, *EFFECTS, "solve", *rest, *FILES]


def pages_of(name):
    """The pages of a table, or of one kind of it: ``web``, ``web.cable``, ``[[body]]``; refuses other names."""
    table, known = name.strip().strip("[]").strip(), names()
    table = "scene" if table in (f.name for f in dataclasses.fields(Head)) else table
    head = table.partition(".")[0]
    if head not in known:
        owners = [
            page.name
            for table_name in known
            for page in pages_of(table_name)
            if head in (key.name for key in page.keys)
        ]
        hint = f"it is a key of {', '.join(owners)}" if owners else nearest(head, known)
        raise InputError(f"help {name}: there is no such table, {hint}")
    pages = list(_PAGES.get(head, _part)(head))
    if table == head:
        return pages
    kinds = [page.name for page in pages]
    if table not in kinds:
        raise InputError(f"help {name}: there is no such table, {nearest(table, [head, *kinds])}")
    return [page for page in pages if page.name == table]


def line_of(name):
    """Summary of a table, in a line."""
    if name == "scene":
        return summary(Head)
    return SUMMARIES.get(name) or summary(load({**PARTS, **LISTS, **EFFECTS}[name]))


def header_of(name):
    """Header of a table in a scene file."""
    if name == "scene":
        return "schema, title, seed"
    if name in FILES:
        return name
    several = name in LISTS or (name in EFFECTS and load(EFFECTS[name]).several)
    return f"[[{name}]]" if several else f"[{name}]"


def _page(name, header, kind, like=None, without=(), **more):
    """The page of a class of tables; ``like`` describes keys of which the class itself says nothing."""
    said = (parameters(like) if like else {}) | parameters(kind)
    keys = [_key(f, said.get(key_of(f), "")) for f in dataclasses.fields(kind) if f.name not in without]
    given = {"summary": summary(kind), "prose": prose(kind), "refused": refusals(kind), "example": example(kind)}
    return Page(name=name, header=header, keys=keys, **(given | more))


def _key(f, meaning):
    default = "required"
    if f.default is not MISSING:
        default = "" if f.default is None else _toml(f.default)
    elif f.default_factory is not MISSING:
        default = ""
    return Key(key_of(f), takes(accepted(f)), f.metadata["unit"], default, meaning)


def _toml(value):
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return f"{value:g}" if isinstance(value, float) else json.dumps(value, ensure_ascii=False)


def takes(schema):
    """Values that a schema accepts, in words."""
    if "anyOf" in schema:
        *first, last = schema["anyOf"]
        if last.get("items") == {"anyOf": first}:
            return f"{takes({'anyOf': first})}, or a list of them"
        return " or ".join(dict.fromkeys(map(takes, schema["anyOf"])))
    if "enum" in schema:
        return ", ".join(map(_toml, schema["enum"]))
    kind = schema.get("type")
    if kind in ("number", "integer"):
        return ("number" if kind == "number" else "whole number") + _bounds(schema)
    if kind == "array":
        item, maximum = schema["items"], schema.get("maxItems")
        item_text = takes(item)
        if item_text.endswith(" numbers"):
            return f"rows of {item_text}"
        return f"{maximum} {item_text}s" if maximum else f"[{item_text}, ...]"
    if kind == "object":
        value_schema = schema["additionalProperties"]
        if isinstance(value_schema, bool):
            return "{" + ", ".join([*schema["properties"], *(["..."] if value_schema else [])]) + "}"
        return "tables by name" if "properties" in value_schema else f"{{name = {takes(value_schema)}}}"
    return {"boolean": "true, false", "string": "text"}.get(kind, "value")


def _bounds(schema):
    """Bounds of a number in words."""
    lower, upper = schema.get("minimum"), schema.get("maximum")
    lower = None if lower is None or lower <= -LARGE else lower
    upper = None if upper is None or upper >= LARGE else upper
    above, below = schema.get("exclusiveMinimum"), schema.get("exclusiveMaximum")
    if None not in (lower, upper) and not above and not below:
        return f", {_toml(lower)} … {_toml(upper)}"
    parts = [] if lower is None else [f"{'>' if above else '≥'} {_toml(lower)}"]
    parts += [] if upper is None else [f"{'<' if below else '≤'} {_toml(upper)}"]
    return (" " + ", ".join(parts)) if parts else ""


def _inner(name, kind):
    """Pages of the tables inside a table, and of those by name."""
    for f in dataclasses.fields(kind):
        schema_of = getattr(f.metadata["read"], "accepts", None)
        inner = schema_of.get("additionalProperties") if isinstance(schema_of, dict) else None
        if isinstance(schema_of, type):
            yield _page(f"{name}.{f.name}", f"[{name}.{f.name}]", schema_of)
        if isinstance(inner, type):
            yield _page(f"{name}.{f.name}", f"[{name}.{f.name}.NAME]", inner, like=kind)


def _scene(name):
    example = 'schema = 1\ntitle = "Net with a weight"\nseed = 7'
    rows = [
        [f"`{header_of(table_name)}`", line_of(table_name)]
        for table_name in names()
        if table_name not in ("scene", *FILES)
    ]
    yield _page("scene", header_of("scene"), Head, example=example, listing=Listing(("table", "what it is"), rows))


def _file(name):
    yield _page(name, header_of(name), load(FILES[name]), without=["folder"], summary=SUMMARIES[name])


def _web(name):
    for kind, reference in WEBS.items():
        yield _page(f"web.{kind}", f'[web] kind = "{kind}"', load(reference), without=["kind"])


def _part(name):
    kind = load({**PARTS, **LISTS, **EFFECTS}[name])
    more = {"summary": SUMMARIES[name], "prose": [summary(kind)]} if name in SUMMARIES else {}
    yield _page(name, header_of(name), kind, **more)
    yield from _inner(name, kind)


def _cable(name):
    yield from _part(name)
    for law, reference in LAWS.items():
        if issubclass(kind := load(reference), Table):
            yield _page(f"cable.{law}", f'[cable] law = "{law}", parameters', kind)


def _body(name):
    kind = load(EFFECTS[name])
    yield _page(name, header_of(name), kind, without=["form"])
    yield _page(f"{name}.axle", "[body.axle]", load("refweb.effects.axle:BodyAxle"))
    for shape, reference in SHAPES.items():
        yield _page(f"body.{shape}", f'[[body]] shape = "{shape}"', load(reference))


def _thread(name):
    yield from _part(name)
    yield _page(f"{name}.around", "[[thread.around]]", load("refweb.effects.around:Around"))


def _observe(name):
    rows = []
    for quantity, reference in OBSERVABLES.items():
        kind = load(reference)
        keys = ", ".join(f"`{key}`" for key in kind.keys)
        rows.append([f"`{quantity}`", kind.unit, keys, summary(kind)])
    (page,) = _part(name)
    yield page._replace(listing=Listing(("quantity", "unit", "keys", "what it is"), rows))


def _solve(name):
    yield _page("solve.static", '[solve] kind = "static"', load(SOLVES["static"]), without=["kind"])
    rows = [
        [f'`"{method}"`', ", ".join(f"`{key}`" for key in integrator.keys)]
        for method, integrator in INTEGRATORS.items()
    ]
    rows.append(['`"auto"`', ""])
    more = {"without": ["kind"], "listing": Listing(("method", "keys that it has alone"), rows)}
    yield _page("solve.dynamic", '[solve] kind = "dynamic"', load(SOLVES["dynamic"]), **more)


_PAGES = {
    "scene": _scene,
    "web": _web,
    "cable": _cable,
    "body": _body,
    "thread": _thread,
    "observe": _observe,
    "solve": _solve,
    "study": _file,
    "sizing": _file,
}
