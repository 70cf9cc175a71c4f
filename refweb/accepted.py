"""Accepted values of readers, as JSON Schema of draft 4 has them; a reader carries them as ``accepts``.

May change: the insides of functions. Must stay: ``accepts`` says the same as the reader that carries it, in JSON Schema
of draft 4: `refweb.reference` makes the schema of scenes and the help of it, and plug-ins with readers of their own
call the functions here; `any_of`, which `settings`, `tables` and other files import; `array`, which `settings`,
`tables` and other files import; `by_name`, which `tables`, `net.inline` and other files import; `limits`, which
`tables` and `effects.body` import. Tests: ``tests/reference/test_schema.py``, ``tests/reference/test_help.py``.
"""

from __future__ import annotations


def accepts(schema):
    """Say what a reader accepts: a dict, or a function that returns one where that may change.

    A class of tables may stand where a schema does: it stands for that of its keys.
    """

    def attach(read):
        read.accepts = schema
        return read

    return attach


def limits(kind, above=None, at_least=None, below=None, at_most=None):
    """Numbers of a kind, "number" or "integer", within bounds."""
    lower, upper = at_least if above is None else above, at_most if below is None else below
    ends = {"minimum": lower, "exclusiveMinimum": above is not None or None, "maximum": upper}
    given = {"type": kind, **ends, "exclusiveMaximum": below is not None or None}
    return {key: value for key, value in given.items() if value is not None}


def array(items, minimum=0, maximum=None):
    """Lists of so many items."""
    return {"type": "array", "items": items, "minItems": minimum} | ({"maxItems": maximum} if maximum else {})


def by_name(items):
    """Tables whose keys are names."""
    return {"type": "object", "additionalProperties": items}


def any_of(*schemas):
    """Accept any value that one of some schemas accepts."""
    return {"anyOf": list(schemas)}
