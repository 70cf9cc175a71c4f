"""Print what a table of a scene file may hold, what a term means, or a guide."""

# This docstring is the help of the verb. May change: which page comes first where a word names several. Must stay:
# `add_arguments` and `run`, which `refweb.__main__` calls; `--markdown`, which writes `validation/REFERENCE.md`:
# tests/reference/test_help.py compares both.

import argparse
import sys
import textwrap


def add_arguments(parser):
    """Declare the table, or term, and the format."""
    text = (
        "such as gravity, web.cable, solve.dynamic; a term, or glossary for all; materials; a guide; a command "
        "(default: a line for each table)"
    )
    parser.add_argument("table", nargs="?", metavar="TABLE", help=text)
    parser.add_argument("--markdown", action="store_true", help="the whole reference, as Markdown")


def run(arguments):
    """Print the pages of a table, a term, a guide or a verb."""
    from ..errors import InputError
    from ..messages import closest
    from ..reference.glossary import explained
    from ..reference.pages import names
    from ..reference.words import as_markdown, as_text, guide, guides, overview
    from ..registry import COMMANDS, load, load_installed

    for message in load_installed():
        print(f"refweb: {message}", file=sys.stderr)
    if arguments.markdown:
        print(as_markdown(), end="")
    elif arguments.table is None:
        print(overview())
    elif arguments.table == "materials":
        from ..net.materials import as_text as as_table
        from ..reference.words import MATERIALS_TEXT

        print(f"{as_table()}\n\n{textwrap.fill(MATERIALS_TEXT.replace('`', ''), 100)}")
    elif (name := arguments.table.strip().replace("how-to/", "own-").replace(" ", "-")) in guides():
        print(guide(name), end="")
    elif arguments.table in COMMANDS and arguments.table not in names() and explained(arguments.table) is None:
        verb = load(COMMANDS[arguments.table])
        parser = argparse.ArgumentParser(
            prog=f"refweb {arguments.table}", description=(verb.__doc__ or "").replace("``", "")
        )
        verb.add_arguments(parser)
        parser.print_help()
    elif arguments.table in names() or (text := explained(arguments.table)) is None:
        if name.partition(".")[0] not in names() and (close := closest(name, [*names(), *guides()])) in guides():
            raise InputError(f'help {arguments.table}: there is no such table, did you mean "{close}"?')
        print(as_text(arguments.table))
    else:
        print(text)
