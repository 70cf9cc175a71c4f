"""Pages of the reference as text for a terminal and as Markdown.

May change: private functions, the layout of `as_text`, and texts in `RULES` and `MATERIALS_TEXT` (then write the
reference anew); `RULES` has the value of `tables.LARGEST`. Must stay: `as_markdown` in step with
``validation/REFERENCE.md``, which ``python -m refweb help --markdown`` writes anew; keys of `HOW_TO`, which are names
of guides on the site and in help; `guide`, which `commands.help` and `site.hooks` import; `overview`, which
`commands.help` imports. Tests: ``tests/reference/test_help.py``, ``tests/reference/test_site.py``.
"""

from __future__ import annotations

import inspect
import pathlib
import re
import textwrap

from .. import registry
from ..net import materials
from . import glossary
from .pages import header_of, line_of, names, pages_of

RULES = (
    "Units are SI. A table that is present is an effect that is present. Other tables and keys are refused, and "
    "the message names the nearest; so are numbers that are not finite or above 1e100 in size.",
    'A node is a number, from 0, or a name: "centre", the node nearest the origin; "rim", the nodes that the web '
    'itself supports; "corners", those of a flat web; "all"; or one of the web\'s own names. Lines are numbers, '
    'groups, or "all".',
    "`refweb schema` prints these tables as JSON Schema for editors: save it as `refweb.schema.json`, and begin a "
    "scene file with the line `#:schema ./refweb.schema.json`.",
)
"""Rules for all tables."""
MATERIALS_TEXT = (
    "`[cable] material` and `[cable.groups.NAME] material` take modulus, density and strength from this table where a "
    "scene does not give them. Values are typical ones of new, dry fibres at room temperature; a braid or a twisted "
    "rope of them is softer and weaker."
)
"""Text above the table of materials."""
GUIDES = pathlib.Path(__file__).parent / "site" / "pages"
"""Folder of the guides: pages of the documentation site that are written by hand."""
HOW_TO = {
    "effect": ("An effect", "refweb.effects"),
    "shape": ("A body shape", "refweb.net.rigid_body"),
    "law": ("A tension law", "refweb.net.laws"),
    "observable": ("An observable", "refweb.results.observables"),
    "integrator": ("An integrator", "refweb.dynamics.integrators"),
    "verb": ("A verb of the command line", "refweb.commands"),
}
"""Titles and modules of the guides on plug-ins, ``own-effect`` and others, ``how-to/effect`` on the site."""


def overview():
    """All tables, a line each."""
    lines = {header_of(name): line_of(name) for name in names()}
    width = max(map(len, lines))
    listed = [f"{header:{width}}  {line}" for header, line in lines.items()]
    hint = "refweb help TABLE says what a table may hold, such as refweb help web"
    more = ["refweb help glossary explains terms", "refweb help materials lists materials"]
    more.append(f"refweb help quick-start says how to begin; further guides: {', '.join(guides())}")
    return "\n".join([*listed, "", hint, *more])


def guides():
    """Names of the guides."""
    return sorted([*(path.stem for path in GUIDES.glob("*.md")), *(f"own-{name}" for name in HOW_TO)])


def guide(name):
    """Text of a guide, as Markdown."""
    if (kind := name.removeprefix("own-")) in HOW_TO:
        return how_to(*HOW_TO[kind]) + "\n"
    return (GUIDES / f"{name}.md").read_text(encoding="utf-8")


def how_to(title, module):
    """The part of the docstring of a module that says how to write one, in Markdown."""
    text = (inspect.getdoc(registry.load(module)) or "").split("\n\n", 1)[1]
    text = re.sub(r"^How to write [^\n]*\n-+\n", "", text)
    parts = [f"# {title} of your own"]
    for block in re.split(r"\n\n(?=\S)", text):
        prose, marked, code = block.partition("::\n\n")
        parts.append(prose.replace("``", "`") + (":" if marked else ""))
        if marked:
            language = "toml" if code.lstrip().startswith(("[", "observe")) else "python"
            code = textwrap.dedent(code).strip().replace("'''", '"""')
            parts.append(f"```{language}\n{code}\n```")
    return "\n\n".join(parts)


def as_text(name):
    """The pages of a table for a terminal."""
    return "\n\n".join(map(_text, pages_of(name)))


def _text(page):
    wrapped = lambda text, indent="": textwrap.fill(  # noqa: E731
        text, 100, initial_indent=indent, subsequent_indent=indent, break_on_hyphens=False
    )
    parts = [page.header, wrapped(page.summary, "  ")]
    parts += [text if "\n" in text else wrapped(text, "  ") for text in page.prose]
    keys = []
    for key in page.keys:
        type_text = key.takes + (f" [{key.unit}]" if key.unit else "")
        type_text += {"": "", "required": "; required"}.get(key.default, f"; default {key.default}")
        keys.append(f"    {key.name}")
        keys += [wrapped(text, "        ") for text in (type_text, key.meaning) if text]
    parts.append("\n".join(keys))
    if page.listing is not None:
        rows = [[cell.replace("`", "") for cell in row] for row in (page.listing.columns, *page.listing.rows)]
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        rows = ["  ".join(f"{cell:{w}}" for cell, w in zip(row, widths, strict=True)) for row in rows]
        parts.append("\n".join(f"    {row}".rstrip() for row in rows))
    if page.refused:
        parts.append(wrapped(f"Refused: {page.refused}", "  "))
    if page.example:
        parts.append("  Example\n\n" + textwrap.indent(page.example, "    "))
    return "\n\n".join(parts)


def as_markdown():
    """The whole reference."""
    parts = ["# Reference of scene files", *RULES]
    for name in names():
        pages = pages_of(name)
        parts.append(f"## {header_of(name) if name == 'scene' else f'`{header_of(name)}`'}")
        if len(pages) > 1 and pages[0].name != name:
            parts.append(line_of(name))
        for page in pages:
            parts += [f"### `{page.header}`"] if page.name != name else []
            parts += _markdown(page)
    parts += ["## Materials", MATERIALS_TEXT, materials.as_markdown(), glossary.as_markdown()]
    return "\n\n".join(parts) + "\n"


def _markdown(page):
    """Parts of a page."""
    yield page.summary
    for text in page.prose:
        yield f"```\n{text}\n```" if "\n" in text else text
    defaults = [key.default if key.default in ("", "required") else f"`{key.default}`" for key in page.keys]
    cells = [[f"`{k.name}`", k.takes, k.unit, d, k.meaning] for k, d in zip(page.keys, defaults, strict=True)]
    yield _grid(("key", "takes", "unit", "default", "what it is"), cells)
    if page.listing is not None:
        yield _grid(*page.listing)
    if page.refused:
        yield f"Refused: {page.refused}"
    if page.example:
        yield f"```toml\n{page.example}\n```"


def _grid(columns, rows):
    lines = [columns, ["---"] * len(columns), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)
