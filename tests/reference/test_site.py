"""The documentation site: every block of code of its pages runs, in the order of a page, and the site can be built.

Blocks are found by their fences, so that a new one is run as well. A ``title`` is the name of the file that a block is
written to; lines of ``sh`` begin with ``refweb`` and are run in this process, or are those of another program;
``python`` blocks of a page share names. Blocks that take long are ``{ .sh .slow }``.
"""

import contextlib
import importlib.util
import io
import os
import pathlib
import re
import shlex
import subprocess
import sys

import pytest

import refweb.reference
from refweb import registry
from refweb.__main__ import main
from refweb.reference.glossary import explained
from refweb.reference.pages import names
from refweb.reference.words import HOW_TO, overview

ROOT = pathlib.Path(__file__).parents[2]
SITE = pathlib.Path(refweb.reference.__file__).parent / "site"
PAGES = sorted((SITE / "pages").glob("*.md"))
FENCE = re.compile(
    r"^```(?: ?\{ (?P<marks>[^}]*) \}|(?P<language>\w+))(?: title=\"(?P<title>[^\"]+)\")?\n(?P<text>.*?)^```$",
    re.MULTILINE | re.DOTALL,
)
RUN, WRITTEN, SHOWN = {"sh", "python"}, {"toml", "csv", "python"}, {"math", "text"}
"""Languages of blocks that are run, of those that are written where they have a title, and of those that are read."""


def blocks(path):
    """(language, title, text, slow) of each block of a page."""
    for match in FENCE.finditer(path.read_text(encoding="utf-8")):
        marks = [mark.lstrip(".") for mark in (match["marks"] or match["language"]).split()]
        yield marks[0], match["title"], match["text"], "slow" in marks


def shell(line, folder):
    """Run a line of the shell: refweb in this process, anything else as it is."""
    words = shlex.split(line, comments=True)
    if words[:1] == ["refweb"] and "my_webs" not in os.listdir(folder):
        status = main(words[1:])
        assert status == 0 or words[1] == "compare" and status == 1, line  # results that differ
    else:
        target, path = folder / "target", os.pathsep.join([str(folder / "target"), os.environ["PYTHONPATH"]])
        if words[0] == "pip":
            pytest.importorskip("setuptools", minversion="70.1")  # builds without the network
            words = ["pip", "install", "--quiet", "--no-deps", "--no-build-isolation", "--target", str(target), "."]
        words = words[1:] if words[0] == "python" else ["-m", *words]
        subprocess.run([sys.executable, *words], check=True, env={**os.environ, "PYTHONPATH": path})


def follow(path, folder, slow):
    """Do what a page says, in a folder; slow blocks as well, or not."""
    space = {"__name__": "__main__"}
    for language, title, text, long in blocks(path):
        assert language in RUN | WRITTEN | SHOWN, f"{path.name}: no test knows {language}"
        if title:
            (folder / title).parent.mkdir(exist_ok=True)
            (folder / title).write_text(text, encoding="utf-8")
        elif language == "python" and (slow or not long):
            exec(compile(text, path.name, "exec"), space)
        for line in text.splitlines() if language == "sh" and (slow or not long) else ():
            shell(line, folder)


SLOW = [path for path in PAGES if any(long for *_, long in blocks(path))]


LONG = ("learning", "size-a-net")
"""Pages whose blocks take more than 5 s of CPU: training of a policy, and a study of nets; both are slow tests."""


@pytest.mark.ordinary(
    "capture-False", "own-net-False", "plug-ins-False", "python-False", "quick-start-False", "theory-False"
)
@pytest.mark.parametrize(
    "path, slow",
    [pytest.param(path, False, marks=[pytest.mark.slow] * (path.stem in LONG)) for path in PAGES]
    + [pytest.param(path, True, marks=pytest.mark.slow) for path in SLOW],
    ids=lambda value: value.stem if isinstance(value, pathlib.Path) else str(value),
)
def test_a_page_does_what_it_says(path, slow, tmp_path):
    before = {kind: dict(entry.table) for kind, entry in registry.KINDS.items()}
    with contextlib.chdir(tmp_path), contextlib.redirect_stdout(io.StringIO()):
        follow(path, tmp_path, slow)
    for kind, entry in registry.KINDS.items():
        entry.table.clear()
        entry.table.update(before[kind])


def test_blocks_are_found():
    """As many as there are fences, and some of each language that is run."""
    found = [block for path in PAGES for block in blocks(path)]
    fences = sum(path.read_text(encoding="utf-8").count("\n```") for path in PAGES)
    assert 2 * len(found) == fences and {language for language, *_ in found} == RUN | WRITTEN | SHOWN
    assert sum(language in RUN for language, *_ in found) > 20


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.stem)
def test_help_prints_a_guide(path, capsys):
    """Its name is neither that of a table nor a term of the glossary; the overview names it."""
    assert path.stem not in names() and explained(path.stem) is None and path.stem in overview()
    assert main(["help", path.stem]) == 0 and capsys.readouterr().out == path.read_text(encoding="utf-8")


@pytest.mark.parametrize("kind", HOW_TO)
def test_help_prints_how_to_write_a_plug_in(kind, capsys):
    """By a plain name and by that of the page; code of the docstring is in it, and the overview names it."""
    assert f"own-{kind}" in overview() and f"own-{kind}" not in names() and explained(f"own-{kind}") is None
    assert main(["help", f"own-{kind}"]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith(f"# {HOW_TO[kind][0]} of your own\n") and "```python" in printed
    assert main(["help", f"how-to/{kind}"]) == 0 and capsys.readouterr().out == printed


def test_pages_link_to_pages():
    made = {
        "how-to/effect.md",
        "how-to/shape.md",
        "how-to/law.md",
        "how-to/observable.md",
        "how-to/integrator.md",
        "how-to/verb.md",
    }
    for path in PAGES:
        for target in re.findall(r"\]\(([\w/.-]+\.md)\)", path.read_text(encoding="utf-8")):
            assert target in made or (SITE / "pages" / target).is_file(), target


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("mkdocs") is None, reason="needs refweb[docs]")
def test_it_is_built_without_warnings(tmp_path):
    """By the command that CONTRIBUTING.md names, into a folder of the test."""
    command = re.search(r"mkdocs build [^`\n]+", (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")).group()
    words = [*command.split(), "--site-dir", str(tmp_path / "site")]
    done = subprocess.run([sys.executable, "-m", *words], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    pages = {path.stem for path in (tmp_path / "site").rglob("*.html")}
    assert pages >= {"index", "api", "scene-files", "glossary", "effect", *(path.stem for path in PAGES)}
