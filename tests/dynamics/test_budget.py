"""What digits may cost: no run is begun, or goes on, that takes more than what is left of the budget.

The clock counts steps in place of seconds, so that nothing depends on how busy the machine is.
"""

import numpy as np
import pytest

import refweb
from refweb.dynamics import budget
from refweb.dynamics.integrators.sundials import Sundials
from refweb.errors import InputError

WEB = refweb.Inline(points=[[0, 0, 0], [1, 0, 0], [2, 0, 0]], lines=[[0, 1], [1, 2]], supports=[0, 2])
CABLE = refweb.Cable(law="tension-only", modulus=1e7, area=1e-4, density=100.0)
FIRST, SECOND = 1e-4, 1e-4 * 0.01
"""rtol of the first run and of the one that six digits ask for next."""


@pytest.fixture(scope="module")
def steps():
    """Steps of all runs and twins so far, which the clock shows as seconds."""
    taken, own = [0], Sundials.step

    def counted(self, *arguments):
        taken[0] += 1
        return own(self, *arguments)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Sundials, "step", counted)
        patch.setattr(budget, "clock", lambda: float(taken[0]))
        yield taken


@pytest.fixture(scope="module")
def plain(steps):
    """(Steps with the twin, solution) of both runs by themselves."""
    return cost(steps, rtol=FIRST), cost(steps, rtol=SECOND)


def solved(rtol=FIRST, out=None, **accuracy):
    """A node between two slack lines that snap taut; its run is bit for bit the same each time."""
    scene = refweb.Scene(
        web=WEB,
        cable=CABLE,
        effects=[refweb.Velocity(node=1, value=(0.3, 0.0, 2.0))],
        solve=refweb.Dynamic(duration=0.02, method="cvode", rtol=rtol),
        accuracy=refweb.Accuracy(**accuracy),
    )
    return refweb.run(scene, out=out)


def cost(steps, **keys):
    """(Steps with the twin, solution) of a run."""
    before = steps[0]
    return (solution := solved(**keys)) and (steps[0] - before, solution)


def words(solution):
    return [text for text in solution.warnings if "of the budget of" in text]


def same(one, other):
    return one.results == other.results and all(
        np.array_equal(one.history[key], other.history[key]) for key in one.history
    )


def test_a_run_is_not_begun_that_costs_too_much(plain, steps):
    """What the first and the second run cost is counted by itself; expected is that within a third."""
    (first, coarse), (second, finer) = plain
    spent, stopped = cost(steps, digits=6, budget=first + 0.7 * second)
    assert spent == first and same(stopped, coarse) and stopped.status == "solved"
    (text,) = words(stopped)
    expected = float(text.split("the next run would take some ")[1].split(" s")[0])
    assert text.startswith(f"with rtol = {SECOND:.3g} ") and expected == pytest.approx(second, rel=1 / 3)
    assert sum("does not have the 6 digits asked for" in text for text in stopped.warnings) == 3
    spent, further = cost(steps, digits=6, budget=first + 1.5 * second)
    assert spent == first + second and same(further, finer) and len(words(further)) == 1


def test_the_budget_where_none_is_given(plain, steps, monkeypatch):
    """It is 20 times the first run, or a time that is larger: here a hundred steps, and then a million."""
    first, _ = plain[0]
    monkeypatch.setattr(budget, "LEAST", 100.0)
    spent, stopped = cost(steps, digits=6)
    assert first < spent < 21 * first and f"budget of {20.0 * first:.3g} s" in words(stopped)[0]
    monkeypatch.setattr(budget, "LEAST", 1e6)
    _, reached = cost(steps, digits=3)
    assert not words(reached)
    assert all(one.error <= 0.5e-3 * abs(one.value) for one in reached.results.values())


@pytest.mark.parametrize("where", ["memory", "folder"])
def test_a_run_is_ended_that_costs_too_much(plain, steps, monkeypatch, tmp_path, where):
    """One that was expected to cost nothing: the run before it is the result, bit for bit."""
    (first, coarse), (second, _) = plain
    monkeypatch.setattr(budget.Budget, "expected", lambda *arguments: 0.0)
    left, out = 0.4 * second, None if where == "memory" else tmp_path / "run"
    spent, stopped = cost(steps, digits=6, budget=first + left, out=out)
    assert first + 0.2 * left < spent - first < first + left + budget.SURE * 100
    (text,) = words(stopped)
    assert "a run was ended" in text and same(stopped, coarse) and stopped.status == "solved"
    if out is not None:
        read = refweb.load(out)
        assert same(read, coarse) and np.array_equal(read.state.x, coarse.state.x)


def test_a_twin_is_ended_that_costs_too_much(plain, steps, monkeypatch):
    """The run itself is within what is left; the twin behind it, of a tenth of the tolerance, takes more steps."""
    (first, coarse), (second, finer) = plain
    own = finer.solver["nsteps"]
    monkeypatch.setattr(budget.Budget, "expected", lambda *arguments: 0.0)
    monkeypatch.setattr(budget, "SURE", np.inf)
    left = own + 0.5 * (second - own)
    spent, stopped = cost(steps, digits=6, budget=first + left)
    assert left <= spent - 2 * first < left + 100 and same(stopped, coarse) and len(words(stopped)) == 1


def test_bad_input():
    with pytest.raises(InputError, match="budget = 60 needs digits"):
        refweb.Accuracy(budget=60.0)
    with pytest.raises(InputError, match="budget = 0"):
        refweb.Accuracy(digits=3, budget=0.0)
