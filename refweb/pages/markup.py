"""HTML elements of pages from texts; texts of users are escaped here.

A template engine, jinja2, would need 24 lines for the same elements in place of 23 here, and 5 more to load it.

May change: private functions and attributes that no style or script reads. Must stay: that each text that is no `Html`
is escaped here (notebooks do so in `results.notebook`); ``wide``, ``last`` and ``data-label``, which ``page.css``
reads; the form of `section`, by which `page` finds contents; all names that `study`, `sections` and other files import.
Tests: ``tests/pages/test_page.py``.
"""

from __future__ import annotations

import base64
import json
from html import escape
from typing import Any


class Html(str):
    """Text that is HTML already."""


def html(content):
    """Convert a text to HTML; HTML is unchanged, and parts of a list are joined."""
    if isinstance(content, list | tuple):
        return Html("".join(map(html, content)))
    return content if isinstance(content, Html) else Html(escape(str(content)))


def tag(name, content: str | list[Any] | tuple[Any, ...] = "", **attributes):
    """An element with its content; ``class_`` is the attribute class, and _ in other names becomes -."""
    given = "".join(f' {key.rstrip("_").replace("_", "-")}="{escape(str(value))}"' for key, value in attributes.items())
    return Html(f"<{name}{given}>{html(content)}</{name}>")


def section(identity, heading, *content):
    """A section of the page with its heading."""
    return tag("section", [tag("h2", heading), *content], id=identity)


def table(columns, rows, last=()):
    """A table with names of columns and, in each row, a first cell as head; a wide table scrolls.

    Each cell has the name of its column as ``data-label``: narrow screens show rows as cards.
    """
    head = tag("tr", [tag("th", name, scope="col") for name in columns])
    body = []
    for row in rows:
        first = tag("th", tag("span", row[0]), scope="row", data_label=columns[0])
        body.append(tag("tr", [first, *_cells(columns[1:], row[1:])]))
    body += [tag("tr", _cells(columns, last), class_="last")] if last else []
    return tag("div", tag("table", [tag("thead", head), tag("tbody", body)]), class_="wide", tabindex="0")


def _cells(columns, cells):
    """Cells with the names of their columns; an empty cell has no content."""
    return [
        tag("td", tag("span", cell) if cell else "", data_label=name) for name, cell in zip(columns, cells, strict=True)
    ]


def pairs(rows):
    """A table of names and their values."""
    return tag("dl", [[tag("dt", name), tag("dd", content)] for name, content in rows])


def listing(texts):
    """A list of sentences."""
    return tag("ul", [tag("li", text) for text in texts])


def image(kind, data, text):
    """A picture embedded in the page, from its bytes; `text` describes it to users who cannot see it.

    `kind` is "png" or "svg+xml".
    """
    coded = base64.b64encode(data).decode()
    return Html(f'<img src="data:image/{kind};base64,{coded}" alt="{escape(text)}">')


def figure(picture, caption):
    """A picture and its caption."""
    return tag("figure", [picture, tag("figcaption", caption)])


def data(identity, content):
    """Plain values as JSON, or a text of base64, in an element that browsers do not execute."""
    written = content if isinstance(content, str) else json.dumps(content, allow_nan=False, separators=(",", ":"))
    written = written.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")
    kind = "text/plain" if isinstance(content, str) else "application/json"
    return Html(f'<script type="{kind}" id="{identity}">{written}</script>')
