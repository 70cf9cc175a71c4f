"""Status, message and cost of a run, however it is left."""

import time
from types import SimpleNamespace

import pytest

from refweb.errors import InputError, SolverError
from refweb.results.run_status import Clock, recorded

ENDS = [
    (None, "solved", ""),
    (KeyboardInterrupt(), "interrupted", "interrupted after 3 steps"),
    (SolverError("no equilibrium"), "failed", "no equilibrium"),
    (InputError("wrong"), "failed", "InputError: wrong"),
    (ZeroDivisionError("a fault"), "failed", "ZeroDivisionError: a fault"),
]


def fresh():
    return SimpleNamespace(status="running", message="", cost={"wall_s": -1.0, "by_effect": {}})


@pytest.mark.parametrize("error, status, message", ENDS)
def test_ends(error, status, message):
    found, clock = fresh(), Clock()
    try:
        with recorded(found, clock, lambda: "3 steps"):
            time.sleep(0.01)
            if error is not None:
                raise error
    except BaseException as raised:
        assert raised is error
    assert (found.status, found.message) == (status, message)
    assert found.cost.keys() == {"cpu_s", "wall_s", "compile_s", "by_effect"}
    assert 0.01 <= found.cost["wall_s"] <= clock.spent()["wall_s"]
    assert 0.0 <= found.cost["cpu_s"] <= clock.spent()["cpu_s"]


def test_an_interruption_that_has_no_words():
    found = fresh()
    with pytest.raises(KeyboardInterrupt), recorded(found, Clock()):
        raise KeyboardInterrupt
    assert (found.status, found.message) == ("interrupted", "")


def test_a_run_may_say_itself_that_it_failed():
    found = fresh()
    with recorded(found, Clock()):
        found.status, found.message = "failed", "nothing solved"
    assert (found.status, found.message) == ("failed", "nothing solved")
