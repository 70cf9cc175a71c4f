"""Print the JSON Schema of scene files, or of another kind, by which editors check and complete them."""

# This docstring is the help of the verb. May change: texts. Must stay: `add_arguments` and `run`, which
# `refweb.__main__` calls; the schema alone on standard output, for editors. `reference.schema` makes it. Tests:
# tests/reference/test_schema.py.

import sys

from .arguments import print_json


def add_arguments(parser):
    """Declare the kind of file."""
    kinds = ("scene", "study", "sizing")
    parser.add_argument("file", nargs="?", default="scene", choices=kinds, help="kind of file (default: scene)")


def run(arguments):
    """Print the schema."""
    from ..reference.schema import schema
    from ..registry import load_installed

    for message in load_installed():
        print(f"refweb: {message}", file=sys.stderr)
    print_json(schema(arguments.file))
