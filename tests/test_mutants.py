"""The list of bugs that tests are held against is true: each can be put in, and there are tests that mirror it."""

import re

import mutants
import pytest
from mutants import MUTANTS, ROOT, Mutant


def test_bugs_can_be_put_in():
    """The text of each stands in its file once, what stands there instead is other code, and it still compiles."""
    for number, mutant in enumerate(MUTANTS, 1):
        code = (ROOT / mutant.path).read_text(encoding="utf-8")
        changed = mutant.changed(code)
        compile(changed, str(mutant.path), "exec")
        assert re.sub(r"\s", "", changed) != re.sub(r"\s", "", code), f"{number} {mutant.file}"
        assert mutant.tests and all((ROOT / file).is_file() for file in mutant.tests), f"{number} {mutant.file}"


def test_there_are_enough():
    """Sixty at least, none twice, and in every room that computes."""
    assert len(MUTANTS) >= 60 and len({(m.file, m.text, m.wrong) for m in MUTANTS}) == len(MUTANTS)
    rooms = {m.file.split("/")[0] for m in MUTANTS}
    assert rooms >= {"net", "effects", "system", "statics", "dynamics", "results", "studies"}


def test_a_text_that_is_gone_is_an_error():
    mutant = Mutant("net/web", "no such text", "nothing")
    with pytest.raises(ValueError, match="stands there 0 times, must be once"):
        mutant.changed((ROOT / mutant.path).read_text(encoding="utf-8"))


def test_who_notices(tmp_path, monkeypatch):
    """One bug that a test notices, one that none does, and tests that fail without any, on code of two lines."""
    own = tmp_path / "own"
    for folder in ("refweb/net", "tests/net"):
        (own / folder).mkdir(parents=True)
    for package in ("refweb", "refweb/net"):
        (own / package / "__init__.py").touch()
    code = own / "refweb" / "net" / "web.py"
    code.write_text("one = 1\ntwo = 2\n")
    tests = own / "tests" / "net" / "test_webs.py"
    tests.write_text("from refweb.net import web\n\ndef test_one():\n    assert web.one == 1\n")
    monkeypatch.setattr(mutants, "ROOT", own)
    monkeypatch.setattr(mutants, "COPIED", ("refweb", "tests"))
    seen, unseen = Mutant("net/web", "one = 1", "one = 3"), Mutant("net/web", "two = 2", "two = 3")
    assert mutants.tried(seen, own, tmp_path / "cache") == "tests/net/test_webs.py::test_one"
    assert mutants.tried(unseen, own, tmp_path / "cache") is None and code.read_text() == "one = 1\ntwo = 2\n"

    def without_pytest(root, files, cache):
        there = (root / "refweb" / "net" / "web.py").read_text()
        return (0, "") if "one = 1" in there else (1, files[0])

    monkeypatch.setattr(mutants, "tested", without_pytest)
    for bugs, status in (([seen], 0), ([seen, unseen], 1), ([seen, unseen._replace(same="never read")], 0)):
        monkeypatch.setattr(mutants, "MUTANTS", bugs)
        assert mutants.main([]) == status
    code.write_text("one = 3\ntwo = 2\n")
    assert mutants.main([]) == 1 and mutants.chosen(["two"]) == [(2, bugs[1])] == mutants.chosen(["2"])
