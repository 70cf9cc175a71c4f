"""Print the JSON Schema of scene files, by which editors check and complete them."""

import json


def add_arguments(parser):
    """None."""


def run(arguments):
    """Print it."""
    from ..reference.schema import schema

    print(json.dumps(schema(), indent=1, ensure_ascii=False))
