"""Parts of a docstring in the style of numpydoc.

May change: how sections are found. Must stay: titles of sections of numpydoc, which docstrings of tables have; what the
functions return, of which `pages` and `schema` make help, ``validation/REFERENCE.md`` and the schema; all names that
`pages` and `schema` import. Tests: ``tests/reference/test_help.py``, ``tests/reference/test_schema.py``.
"""

from __future__ import annotations

import inspect
import re
import textwrap


def sections(documented):
    """Lines of the sections of a docstring by title; what stands before the first one has the title ""."""
    lines, parts = (inspect.getdoc(documented) or "").splitlines() or [""], {"": []}
    title, skipped = "", 0
    for line, below in zip(lines, [*lines[1:], ""], strict=True):
        if skipped:
            skipped -= 1
        elif line and re.fullmatch("-{3,}", below):
            title, skipped = line, 1
            parts[title] = []
        else:
            parts[title].append(line)
    return parts


def plain(text):
    """A text without the marks of references: names stand in single backticks."""
    return text.replace("``", "`")


def paragraphs(lines):
    """Paragraphs as one line each; tables and what is indented stay as they are."""
    blocks = [block for block in re.split(r"\n\s*\n", "\n".join(lines)) if block.strip()]
    kept = [bool(re.search(r"(?m)^( {2,}|=+ +=)", block)) for block in blocks]
    return [plain(block if verbatim else " ".join(block.split())) for block, verbatim in zip(blocks, kept, strict=True)]


def summary(documented):
    """The first paragraph."""
    return (paragraphs(sections(documented)[""]) or [""])[0]


def prose(documented):
    """Paragraphs behind the first one, and those of its notes."""
    parts = sections(documented)
    return [*paragraphs(parts[""])[1:], *paragraphs(parts.get("Notes", []))]


def parameters(documented):
    """Descriptions of parameters, by name."""
    descriptions, names = {}, []
    for line in sections(documented).get("Parameters", []):
        if line and not line.startswith(" "):
            names = [name.strip() for name in line.partition(" : ")[0].split(",")]
            descriptions |= dict.fromkeys(names, "")
        else:
            descriptions |= {name: f"{descriptions[name]} {line.strip()}".strip() for name in names}
    return {name: plain(text) for name, text in descriptions.items()}


def refusals(documented):
    """Inputs refused with an InputError, without the functions that refuse them."""
    _, *lines = sections(documented).get("Raises", [""])
    text = plain(" ".join(" ".join(lines).split()))
    return re.sub(r"from `[\w.]+`, ", "", text)


def example(documented):
    """The example, as lines of a scene file; empty where there is none."""
    return textwrap.dedent("\n".join(sections(documented).get("Examples", []))).strip("\n")
