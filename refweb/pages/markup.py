"""HTML from texts: what users wrote is escaped here, and nowhere else.

jinja2 would not make it shorter: sections, tables, pairs, lists, pictures and figures are 24
lines of a template in place of 23 here, and another 5 load it.
"""

from __future__ import annotations

import base64
import json
from html import escape
from typing import Any


class Html(str):
    """Text that is HTML already."""


def html(content):
    """A text as HTML; what is HTML stays as it is, parts of a list follow each other."""
    if isinstance(content, list | tuple):
        return Html("".join(map(html, content)))
    return content if isinstance(content, Html) else Html(escape(str(content)))


def tag(name, content: str | list[Any] | tuple[Any, ...] = "", **attributes):
    """An element around its content; ``class_`` is the attribute class, and _ in a name of others stands for -."""
    given = "".join(f' {key.rstrip("_").replace("_", "-")}="{escape(str(value))}"' for key, value in attributes.items())
    return Html(f"<{name}{given}>{html(content)}</{name}>")


def section(identity, heading, *content):
    """A part of the page below its heading."""
    return tag("section", [tag("h2", heading), *content], id=identity)


def table(columns, rows, last=()):
    """Rows below names of columns, the first cell of each as its head, in a box that scrolls if it is too wide.

    Each cell has the name of its column as ``data-label``, for narrow screens, where rows are cards.
    """
    head = tag("tr", [tag("th", name, scope="col") for name in columns])
    body = []
    for row in rows:
        first = tag("th", tag("span", row[0]), scope="row", data_label=columns[0])
        body.append(tag("tr", [first, *_cells(columns[1:], row[1:])]))
    body += [tag("tr", _cells(columns, last), class_="last")] if last else []
    return tag("div", tag("table", [tag("thead", head), tag("tbody", body)]), class_="wide", tabindex="0")


def _cells(columns, cells):
    """Cells with the names of their columns; one that is empty holds nothing at all."""
    return [
        tag("td", tag("span", cell) if cell else "", data_label=name) for name, cell in zip(columns, cells, strict=True)
    ]


def pairs(rows):
    """Names and what they stand for, a row each."""
    return tag("dl", [[tag("dt", name), tag("dd", content)] for name, content in rows])


def listing(texts):
    """Sentences, one below the other."""
    return tag("ul", [tag("li", text) for text in texts])


def image(kind, data, text):
    """A picture that stands in the page itself, from its bytes; `text` says what it shows to those who cannot see it.

    `kind` is "png" or "svg+xml".
    """
    coded = base64.b64encode(data).decode()
    return Html(f'<img src="data:image/{kind};base64,{coded}" alt="{escape(text)}">')


def figure(picture, caption):
    """A picture and what stands below it."""
    return tag("figure", [picture, tag("figcaption", caption)])


def data(identity, content):
    """Plain values as JSON, or a text of base64, that no browser runs; nothing in it ends the element."""
    written = content if isinstance(content, str) else json.dumps(content, allow_nan=False, separators=(",", ":"))
    written = written.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")
    kind = "text/plain" if isinstance(content, str) else "application/json"
    return Html(f'<script type="{kind}" id="{identity}">{written}</script>')
