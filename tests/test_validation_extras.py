"""``python -m validation`` without what its cases import: said at once, with the command that brings it."""

import sys

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


@pytest.mark.parametrize("share, status", [(0.99, 0), (1.01, 1)])
def test_a_cost_above_its_limit_is_no_success(share, status, monkeypatch, capsys):
    """The status of what measures steps beside C tells, and the loop that was too fast is named."""
    from validation.cost import explicit

    (scene, limits), kinds = next(iter(explicit.LIMITS.items())), explicit.FLAGS
    ratios = {"same": 0.6, "lean": share * limits["lean"]}
    each = {kind: dict.fromkeys(kinds, kind) for kind in (9.0, 1.0, 0.0)}
    rows = [explicit.Row(scene, 9.0, each[9.0], ratios, each[1.0], each[0.0])]
    monkeypatch.setattr(explicit, "measure", lambda: rows)
    assert explicit.main() == status
    told = capsys.readouterr().out
    assert ("EXCEEDED" in told) == (f"{scene}, lean" in told) == bool(status) and "-O3 -march=native" in told


def test_environments_without_mujoco(monkeypatch, capsys):
    """What is measured then, and the reason why the rest is not."""
    pytest.importorskip("gymnasium")
    from validation.cost import environments

    monkeypatch.setitem(sys.modules, "mujoco", None)
    for name, value in (("LAYERS", (3,)), ("PERIODS", 2), ("ROUNDS", 1), ("ENVIRONMENTS", 1)):
        monkeypatch.setattr(environments, name, value)
    assert environments.main() == 0
    first, second = capsys.readouterr().out.splitlines()
    assert "60 lines" in first and "MuJoCo is left out: " in first and "1 environments of 60 lines" in second


@pytest.mark.slow
def test_the_learning_curve_is_drawn(tmp_path, capsys):
    pytest.importorskip("gymnasium")
    from validation.cost import learning

    assert learning.main("1", tmp_path / "curve.png") == 0
    assert (tmp_path / "curve.png").stat().st_size > 1000 and "CPU time" in capsys.readouterr().out
