"""The page in `refweb.commands`, word by word: its verb, in a package that is installed for it."""

import importlib
import inspect

import packages
import pytest

import refweb.commands
from refweb.__main__ import main
from refweb.registry import COMMANDS

PAGE = inspect.getdoc(refweb.commands)
EXAMPLE, ENTRY = packages.blocks(PAGE)
_, NAME, MODULE, _ = packages.entry_point(ENTRY)


@pytest.fixture
def verb(tmp_path):
    """The module of the example, in a package that is installed."""
    with packages.of_page(tmp_path, EXAMPLE, ENTRY):
        yield importlib.import_module(MODULE)


def left(*arguments):
    """Status that argparse leaves with."""
    with pytest.raises(SystemExit) as leaving:
        main(arguments)
    return leaving.value.code


def test_the_page_is_short_and_names_what_there_is():
    assert 20 <= len(PAGE.splitlines()) <= 42
    assert NAME not in COMMANDS
    assert all(COMMANDS[name] == f"refweb.commands.{name}" for name in COMMANDS)


def test_help(verb, capsys):
    """The first sentence of its docstring is its line, behind those that are there."""
    assert left("--help") == 0
    *_, last = capsys.readouterr().out.splitlines()
    sentence = verb.__doc__.strip().removesuffix(".")
    assert last.split(maxsplit=1) == [NAME, sentence[0].lower() + sentence[1:]]
    assert left(NAME, "--help") == 0
    assert f"usage: refweb {NAME}" in (printed := capsys.readouterr().out) and "SCENE" in printed


def test_it_runs(verb, capsys):
    """Mass of a web: density, section and natural length of each line."""
    built = refweb.Scene.load("square-impact").build()
    cable = refweb.Scene.load("square-impact").cable
    mass = cable.density * cable.area * built.net.natural_length.sum()
    for factor, options in [(1.0, []), (1e-3, ["--per", "1e-3"])]:
        assert main([NAME, "square-impact", *options]) == 0
        out, err = capsys.readouterr()
        assert float(out) * factor == pytest.approx(mass, rel=1e-5) and err == ""


@pytest.mark.parametrize(
    "arguments, message", [(["square-impact", "--per", "-1"], "must be > 0"), (["nothing"], "no such")]
)
def test_wrong_input(verb, capsys, arguments, message):
    assert main([NAME, *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and err.startswith("refweb: ") and message in err


ENDS = [(KeyboardInterrupt(), 130, "interrupted"), (refweb.SolverError("no answer at 2 s"), 1, "no answer at 2 s")]


@pytest.mark.parametrize("error, status, message", ENDS)
def test_other_ends(verb, capsys, monkeypatch, error, status, message):
    def ends(self):
        raise error

    monkeypatch.setattr(refweb.Scene, "build", ends)
    assert main([NAME, "square-impact"]) == status
    assert capsys.readouterr() == ("", f"refweb: {message}\n")


def test_info_asks_the_verb_of_its_kind(verb, capsys, tmp_path, monkeypatch):
    (tmp_path / "run.json").write_text(f'{{"kind": "{NAME}", "mass": 2}}', encoding="utf-8")
    assert main(["info", str(tmp_path)]) == 2
    assert "is not what a run of refweb writes" in capsys.readouterr().err
    monkeypatch.setattr(verb, "show", lambda summary: print(summary["mass"]), raising=False)
    assert main(["info", str(tmp_path)]) == 0 and capsys.readouterr().out == "2\n"
