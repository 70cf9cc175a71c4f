"""List the scenes, studies and requirements that are shipped with refweb."""

# This docstring is the help of the verb. May change: the layout. Must stay: `add_arguments` and `run`, which
# `refweb.__main__` calls; the first comment of a shipped file as its line here. Tests: tests/commands/test_new.py.

import tomllib


def add_arguments(parser):
    """Declare nothing: the verb has no arguments."""


def run(arguments):
    """Print name, title and first comment of each; those of studies and of requirements stand behind empty lines."""
    from ..scene import shipped
    from ..sizing.requirements import shipped as sizings
    from ..sweeps.study import shipped as studies

    _print(shipped())
    print("\nFor refweb sweep:")
    _print(studies())
    print("\nFor refweb size:")
    _print(sizings())


def _print(paths):
    texts = {name: path.read_text(encoding="utf-8") for name, path in paths.items()}
    titles = {name: tomllib.loads(text).get("title", name) for name, text in texts.items()}
    name_width, title_width = (max(map(len, words)) for words in (titles, titles.values()))
    for name, text in texts.items():
        shows = text.splitlines()[0].lstrip("# ")
        print(f"{name:{name_width}}  {titles[name]:{title_width}}  {shows}")
