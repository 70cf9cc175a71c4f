"""The words of messages: values as one line shows them, and the valid name nearest to one that is not.

May change: the insides of functions, if messages stay on one line. Must stay: no import of refweb at the head, since
`errors` and the package itself import this file; phrases such as "did you mean" and the cuts at 60 and 150 characters,
which tests quote; `one_line`, which `errors`, `dynamics.controllers` and other files import; `short`, which `__main__`,
`runner` and other files import; `closest`, which `tables` imports; `row_of`, which `statics.gradients` and
`sweeps.expressions` import. Tests: ``tests/test_tables.py``, ``tests/commands/test_cli.py``.
"""

from __future__ import annotations


def one_line(text):
    """A text without line breaks and control characters."""
    text = " ".join(str(text).split())
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def short(text):
    """A text as a message shows it: at most 60 characters on one line."""
    text = one_line(text[:1000])
    return text if len(text) <= 60 else text[:57] + "..."


def quote(value):
    """A value as a message shows it: short, on one line, texts in quotes."""
    if isinstance(value, str):
        return f'"{short(value)}"'
    if isinstance(value, bool):
        return str(value).lower()
    try:
        return short(str(list(value) if isinstance(value, tuple) else value))
    except (ValueError, RecursionError):  # a number of thousands of digits, lists in lists in lists
        return f"a {type(value).__name__} too large to show"


def closest(name, known):
    """The valid name nearest to one, None if none is near."""
    import difflib

    plain = {k.casefold(): k for k in reversed(known)}
    matches = difflib.get_close_matches(str(name).casefold(), plain, n=1, cutoff=0.5)
    return plain[matches[0]] if matches else None


def nearest(name, known):
    """The part of a message that helps with an unknown name: the nearest valid one, else all of them."""
    known = [str(k) for k in known]
    close = closest(name, known)
    if close:
        return f'did you mean "{close}"?'
    return f"known: {row_of(known)}"


def row_of(names):
    """Names in a row, cut behind 150 characters."""
    text = ", ".join(names)
    return text if len(text) <= 150 else text[:150].rpartition(", ")[0] + ", ..."
