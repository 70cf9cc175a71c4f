"""Compare results of two runs or more side by side: do they agree within ±?"""

# This docstring is the help of the verb. May change: texts. Must stay: `add_arguments` and `run`, which
# `refweb.__main__` calls; exit status 1 for results that differ and the option `--json`, which are for scripts. Tests:
# tests/results/test_comparison.py.

from .arguments import add_json, print_json


def add_arguments(parser):
    """Declare the folders and the format."""
    parser.add_argument("folders", nargs="+", metavar="DIR", help="result folders, two or more")
    add_json(parser)


def run(arguments):
    """Print results and what differs between the scenes; 1 where results differ."""
    from ..results.comparison import compare

    comparison = compare(arguments.folders)
    if arguments.json:
        print_json(comparison)
    else:
        from .console import print_comparison

        print_comparison(comparison)
    return 0 if comparison["agree"] else 1
