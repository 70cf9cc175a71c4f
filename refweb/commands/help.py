"""What a table of a scene file is: its keys, units, defaults, limits, and an example."""


def add_arguments(parser):
    """The table, or all of them."""
    text = "such as gravity, web, web.cable, solve.dynamic, cable.groups (default: a line for each)"
    parser.add_argument("table", nargs="?", metavar="TABLE", help=text)
    parser.add_argument("--markdown", action="store_true", help="the whole reference, as Markdown")


def run(arguments):
    """Print the pages."""
    from ..reference.words import as_markdown, as_text, overview

    if arguments.markdown:
        print(as_markdown(), end="")
    else:
        print(overview() if arguments.table is None else as_text(arguments.table))
