"""``method = "auto"`` tries another method where the one it chose cannot finish, and says so."""

import json

import numpy as np
import pytest

import refweb
from refweb.dynamics import accuracy_loop, method_choice
from refweb.errors import EnergyDriftError, SolverError
from refweb.results.folder import Folder


def blow(force, factor, lines=2, digits=None, error="twin", more=(), **solve):
    """A row of taut lines held at both ends that a table hits in its middle."""
    points, middle = [[k, 0, 0] for k in range(lines + 1)], lines // 2
    return refweb.Scene(
        web=refweb.Inline(points=points, lines=[[k, k + 1] for k in range(lines)], supports=[0, lines]),
        cable=refweb.Cable(law="tension-only", modulus=7e9, area=1e-6, density=200.0, prestrain=1e-3),
        effects=[
            refweb.PointMass(node=middle, mass=0.05),
            refweb.Load(node=middle, force=(0.0, 0.3 * force, force), factor=factor),
            *more,
        ],
        solve=refweb.Dynamic(**{"method": "auto", "duration": 0.02, **solve}),
        accuracy=refweb.Accuracy(digits=digits, error=error),
        output=refweb.Output(interval=1e-3, frames=2),
        observe=[refweb.Observe(name="z", quantity="displacement", node=middle, component="z")],
    )


def hammer(**solve):
    """A blow of 1 ms after which the book of central differences is open at the first attempt."""
    return blow(5e4, [(0.0, 0.0), (5e-4, 1.0), (1e-3, 0.0)], **solve)


def slow_blow(**solve):
    """A blow on a web at its equilibrium, with a tolerance for one digit: BDF loses too much of its waves."""
    return blow(50.0, [(0.0, 0.0), (1e-3, 1.0), (2e-3, 0.0)], 4, digits=1, start="equilibrium", duration=0.07, **solve)


@pytest.fixture
def once(monkeypatch):
    """No attempt but the first: what would be repeated is refused."""
    monkeypatch.setattr(accuracy_loop, "ATTEMPTS", 1)
    monkeypatch.setattr(accuracy_loop, "PAYS", 0.0)


@pytest.fixture
def twice(monkeypatch):
    """Two attempts, and tables alone are given to BDF however quick central differences are."""
    monkeypatch.setattr(accuracy_loop, "ATTEMPTS", 2)
    monkeypatch.setattr(accuracy_loop, "PAYS", 0.0)
    monkeypatch.setattr(method_choice, "QUICK_RUN", 0.0)


def told(solution, refused, used):
    """The method used, and those refused with their reasons, in ``run.json`` and the warnings."""
    solver = solution.summary()["solver"]
    assert solver["method"] == used
    assert [one["method"] for one in solver["refused"]] == refused
    for one in solver["refused"]:
        assert any(one["method"] in text and one["why"] in text for text in solution.warnings)


@pytest.mark.parametrize(("more", "used"), [((), "explicit"), ((refweb.Damping(time=1e-7),), "cvode")])
def test_the_next_that_takes_the_scene(more, used, once, tmp_path, capsys):
    """The hammer blow, against Adams at 1e-10; the folder holds the rows and frames of one method."""
    truth = refweb.run(hammer(more=more, method="cvode", family="adams", rtol=1e-10, error="none")).results["z"].value
    solution = refweb.run(hammer(more=more), out=tmp_path / "run")
    told(solution, ["central-difference"], used)
    result = solution.results["z"]
    assert abs(result.value - truth) <= result.error < 0.2 * abs(truth)
    np.testing.assert_allclose(solution.history["time"], np.arange(21) * 1e-3, rtol=1e-12)
    assert len(list((tmp_path / "run" / "frames").iterdir())) == 11
    from refweb.commands.console import print_run

    print_run(json.loads((tmp_path / "run" / "run.json").read_text()))
    said = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert f"central-difference cannot finish, {used}" in said and "takes over; energy drift" in said
    with pytest.raises(EnergyDriftError):
        refweb.run(hammer(method="central-difference"))


def test_from_an_implicit_method_to_an_explicit_one(twice, tmp_path):
    """What is gone on with is the method that worked, bit for bit."""
    whole = refweb.run(slow_blow())
    told(whole, ["cvode bdf"], "central-difference")
    plain = refweb.run(slow_blow(method="central-difference"))
    assert whole.results["z"] == plain.results["z"]

    def interrupted(text, share):
        begun = json.loads((tmp_path / "run" / "run.json").read_text())["warnings"]
        if share > 0.6 and any("takes over" in warning for warning in begun):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        refweb.run(slow_blow(), out=tmp_path / "run", progress=interrupted)
    resumed = refweb.resume(tmp_path / "run")
    told(resumed, ["cvode bdf"], "central-difference")
    assert resumed.results["z"] == whole.results["z"]
    np.testing.assert_array_equal(resumed.history["z"], whole.history["z"])


def test_where_no_method_comes_to_an_end(tmp_path):
    """A force whose energies are beyond any number: the refusal names each method with its reason."""
    endless = blow(1e100, [(0.0, 0.0), (1e-3, 1e60)])
    with pytest.raises(SolverError, match="no method that can finish") as refusal:
        refweb.run(endless, out=tmp_path / "run")
    summary = json.loads((tmp_path / "run" / "run.json").read_text())
    assert summary["status"] == "failed" and summary["message"] == str(refusal.value)
    for method in ("central-difference: energy not finite", "explicit: ", "cvode bdf: ", "cvode adams: ", "ida: "):
        assert method in str(refusal.value)


def test_what_is_no_fault_of_a_method(monkeypatch, tmp_path):
    """A folder that cannot be written is not tried again with another method."""

    def full(self, values):
        raise SolverError("no space is left")

    monkeypatch.setattr(Folder, "row", full)
    with pytest.raises(SolverError, match="^no space is left$"):
        refweb.run(hammer(), out=tmp_path / "full")
