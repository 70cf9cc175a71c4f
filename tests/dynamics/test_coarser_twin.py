"""The step-refinement run with fewer steps, where lines touch lines, against a run by hand and a closed form."""

from dataclasses import replace

import numpy as np
import pytest

import refweb
from refweb.dynamics.integrators.central_difference import CentralDifference
from refweb.dynamics.integrators.splitting import Splitting

RATE, ROW = np.sqrt(7e3), 0.01
"""√(EA/L m) of the oscillator [rad/s], and the time between its rows [s]."""


def oscillator(contact=True, event=(), interval=ROW, **solve):
    """1 kg at 1 m/s on a line that pulls and pushes, far from 46 others: x = sin ωt/ω."""
    points = [[end, 5 * number, 0] for number in range(47) for end in (0, 1)]
    lines = np.arange(len(points)).reshape(-1, 2).tolist()
    touch = [refweb.SelfContact(radius=0.01, stiffness=1e-3)] if contact else []
    return refweb.Scene(
        web=refweb.Inline(points=points, lines=lines, supports=[0, *range(2, len(points))]),
        cable=refweb.Cable(law="linear", modulus=7e7, area=1e-4, density=0.0),
        effects=[refweb.PointMass(node=1, mass=1.0), refweb.Velocity(node=1, value=(1.0, 0.0, 0.0)), *touch],
        support=[refweb.Supports(nodes=1, components=["y", "z"])],
        observe=[refweb.Observe(name="x", quantity="displacement", node=1, component="x")],
        solve=refweb.Dynamic(duration=0.3, **{"step_size": 1e-3, **solve}),
        output=refweb.Output(interval=interval),
        event=event,
    )


def test_the_difference_is_that_from_fewer_steps():
    """Of 10 steps to a row the twin makes 7, the next number above 10/1.5, as a run by hand does."""
    scene = oscillator()
    solution, by_hand = refweb.run(scene), refweb.run(scene.replace(solve=replace(scene.solve, step_size=ROW / 7)))
    assert (solution.solver["nsteps"], solution.twin_steps) == (300, 210) == (300, by_hand.solver["nsteps"])
    result, times = solution.results["x"], solution.history["time"]
    apart = solution.history["x"] - by_hand.history["x"]
    means = [
        np.sqrt((apart[(times >= begin * 0.3) & (times <= end * 0.3)] ** 2).mean())
        for begin, end in ((0.5, 1.0), (0.25, 0.5), (0.125, 0.25), (0.0, 0.125))
    ]
    difference = max(abs(apart[-1]), *means)
    np.testing.assert_allclose(result.error, 3.0 * difference / (1.0 - 0.7**2), rtol=1e-9)
    assert abs(result.value - np.sin(RATE * 0.3) / RATE) <= result.error


@pytest.mark.parametrize(
    "keys, spans, fewer",
    [
        (dict(safety=0.5), [10] * 20, True),
        (dict(safety=0.6), [20] * 20, False),
        (dict(step_size=0.5), [10] * 20, True),
        (dict(step_size=0.6), [20] * 20, False),
        (dict(safety=0.5), [7] * 20, False),
        (dict(safety=0.5), [10] * 20 + [2] * 5, True),
        (dict(safety=0.5), [10] * 20 + [2] * 20, False),
    ],
    ids=["safety", "large safety", "step_size", "large step_size", "short rows", "few corners", "many corners"],
)
@pytest.mark.parametrize("method", [CentralDifference, Splitting], ids=["order 2", "order 4"])
def test_fewer_steps_are_stable_and_not_too_few(method, keys, spans, fewer):
    """At most four fifths of the bound, and at least 8 steps in spans of nine tenths of the time."""
    system = oscillator().build()
    ((key, share),) = keys.items()
    solver = method(system)
    step = share * solver.stretch * solver.bound()
    by = method(system, **{key: share if key == "safety" else step}).coarser_by(0.999 * step * np.array(spans))
    assert by == (1.0 / 1.5 if fewer else None)


def test_elsewhere_there_are_more_steps():
    """Without lines in contact the twin of 10 steps to a row has 15, and of rows of 7 steps 10."""
    for given, steps in ((dict(contact=False), (300, 450)), (dict(interval=7e-3), (300, 429))):
        solution = refweb.run(oscillator(**given))
        assert (solution.solver["nsteps"], solution.twin_steps) == steps and solution.results["x"].error > 0.0


@pytest.mark.parametrize("sound, steps", [(1.0, 450), (1.5, 600)])
def test_more_steps_follow_a_run_that_fails(sound, steps, monkeypatch):
    """Of 10 steps to a row 15 follow 7, and 20 follow 15; ± holds then as well, and nothing is told."""
    own = CentralDifference.advance

    def advance(self, course, times):
        if self.finer != 1.0 and self.finer < sound:
            raise refweb.SolverError("too long steps")
        return own(self, course, times)

    monkeypatch.setattr(CentralDifference, "advance", advance)
    solution = refweb.run(oscillator())
    result = solution.results["x"]
    assert solution.twin_steps == steps and not solution.warnings
    assert abs(result.value - np.sin(RATE * 0.3) / RATE) <= result.error


def test_more_steps_follow_fewer_that_an_event_does_not_end():
    """The threshold lies between both amplitudes, 1/√(1 − (ωh/2)²) of the true one by central differences."""
    steps = 1e-3, ROW / 7
    first, second = (1.0 / (RATE * np.sqrt(1.0 - (0.5 * RATE * step) ** 2)) for step in steps)
    passed = refweb.Event(name="far", kind="threshold", observe="x", value=0.5 * (first + second), stop=True)
    ends = [refweb.run(oscillator(event=[passed], step_size=step)).state.time < 0.3 for step in steps]
    solution = refweb.run(oscillator(event=[passed]))
    assert ends == [False, True] and solution.state.time == 0.3
    assert solution.twin_steps > solution.solver["nsteps"] and solution.results["x"].error > 0.0


def test_breaks_are_compared_with_more_steps():
    scene = oscillator()
    weak = replace(scene.cable, strength=1e12)
    solution = refweb.run(scene.replace(cable=weak, effects=[*scene.effects, refweb.Rupture()]))
    assert solution.twin_steps > solution.solver["nsteps"]
