"""List the scenes that are shipped with refweb."""

import tomllib


def add_arguments(parser):
    """None."""


def run(arguments):
    """Print name, title and first comment of each."""
    from ..scene import shipped

    texts = {name: path.read_text(encoding="utf-8") for name, path in shipped().items()}
    titles = {name: tomllib.loads(text).get("title", name) for name, text in texts.items()}
    name_width, title_width = (max(map(len, words)) for words in (titles, titles.values()))
    for name, text in texts.items():
        shows = text.splitlines()[0].lstrip("# ")
        print(f"{name:{name_width}}  {titles[name]:{title_width}}  {shows}")
