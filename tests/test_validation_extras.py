"""``python -m validation`` without what its cases import: said at once, with the command that brings it."""

import pytest

from validation import __main__ as validation


@pytest.mark.parametrize("name", validation.EXTRAS)
def test_missing_extras_are_told(name, monkeypatch, capsys):
    found = validation.importlib.util.find_spec
    monkeypatch.setattr(validation.importlib.util, "find_spec", lambda one: None if one == name else found(one))
    with pytest.raises(SystemExit) as ended:
        validation.main([])
    assert ended.value.code == 2
    assert capsys.readouterr().err == f"python -m validation: needs {name}: python -m pip install -e '.[test]'\n"
    assert validation.main(["--list"]) == 0
