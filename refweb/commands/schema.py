"""Print the JSON Schema of scene files, by which editors check and complete them."""

from .arguments import print_json


def add_arguments(parser):
    """None."""


def run(arguments):
    """Print it."""
    from ..reference.schema import schema

    print_json(schema())
