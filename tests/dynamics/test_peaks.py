"""Peaks between steps: what is there, with a ± that holds, in closed form.

A free sphere on a line that is held at both ends is an oscillator as long as it touches: of depth d0 and speed v it has
the largest force k √(d0² + v²/ω²) where v is inwards, else that of the start.
"""

import nets
import numpy as np
import pytest

import refweb
from refweb.dynamics.integrators.extremes import EDGE
from refweb.dynamics.integrators.measurements import top_of

STIFFNESS, MASS, RADIUS, DEPTH = 1e4, 1.0, 0.1, 2e-3
OMEGA = np.sqrt(STIFFNESS / MASS)
PHASES = np.linspace(-0.48, 0.48, 30) * np.pi
METHODS = nets.METHODS | {"ida": dict(method="ida", rtol=1e-4)}
LINE = refweb.Inline(points=[[-1, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0, 1])


def touching(position, velocity, observe, duration=0.01, mass=MASS, interval=None, frames=1, **solve):
    """A sphere at a place beside the middle of a line that does not move."""
    body = refweb.Body(name="ball", radius=RADIUS, mass=mass, position=position, velocity=velocity)
    return refweb.Scene(
        web=LINE,
        cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-4, density=200.0),
        effects=[body, refweb.Contact(stiffness=STIFFNESS)],
        solve=refweb.Dynamic(duration=duration, **solve),
        output=refweb.Output(interval=interval or duration, frames=frames),
        observe=observe,
    )


OBSERVED = [
    refweb.Observe(name="magnitude", quantity="reaction", body="ball", reduce="max"),
    refweb.Observe(name="force", quantity="reaction", body="ball", component="z", reduce="min"),
    refweb.Observe(name="way", quantity="displacement", body="ball", component="z", reduce="max"),
    refweb.Observe(name="energy", quantity="contact_energy", reduce="max"),
]


def oscillator(phase, depth=DEPTH, **solve):
    """(scene, closed forms) of a phase: 0 is at rest where it is deepest, before that it moves inwards."""
    start, speed = depth * np.cos(phase), -depth * OMEGA * np.sin(phase)
    deepest = depth if speed > 0.0 else start
    force = STIFFNESS * deepest
    truth = dict(magnitude=force, force=-force, way=deepest - start, energy=0.5 * force * deepest)
    return touching((0.0, 0.0, start - RADIUS), (0.0, 0.0, speed), OBSERVED, 1.7 / OMEGA, **solve), truth


def worst(phases, **solve):
    """Largest error over ± and over the truth, of all phases and observables."""
    shares, errors = [], []
    for phase in phases:
        case, truth = oscillator(phase, **solve)
        solution = refweb.run(case)
        for name, value in truth.items():
            # The depth of the start has 0.1 m − 1e-17 m: 1e-13 of depths above 1e-4 m.
            scale = truth["magnitude"] / STIFFNESS if name == "way" else abs(value)
            off, result = abs(solution.results[name].value - value) - 1e-13 * scale, solution.results[name]
            shares.append(off / result.error if off > 0.0 else 0.0)
            errors.append(off / scale)
    return max(shares), max(errors)


@pytest.mark.ordinary("central-difference-phases0", "order 6-phases2")
@pytest.mark.parametrize(
    "name, phases", [(name, PHASES[:: 5 if name in ("bdf", "adams", "ida") else 1]) for name in METHODS]
)
def test_errors_of_peaks_hold(name, phases):
    """30 phases of explicit methods, some of the others: no peak is off by more than its ±."""
    share, error = worst(phases, **METHODS[name])
    assert share <= 1.0
    assert error < 2e-2


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bdf", "adams", "ida"])
def test_errors_of_peaks_hold_at_all_phases(name):
    share, error = worst(PHASES, **METHODS[name])
    assert share <= 1.0 and error < 1e-3


@pytest.mark.parametrize("late", [1e-3, 0.05, 0.5, 0.95])
@pytest.mark.parametrize("method", ["central-difference", "explicit"])
def test_a_peak_in_the_first_step(method, late):
    """A body too heavy to be stopped passes a line: it is deepest where it is nearest, within its first step.

    Run and twin find it alike; the path is a straight line, which every method has exactly, and ± holds what a parabola
    leaves of the root in the depth.
    """
    away, speed, h = 0.09, 5.0, 1e-3
    observe = OBSERVED[:1]
    case = touching((0.0, -late * h * speed, -away), (0.0, speed, 0.0), observe, mass=1e9, step_size=h, method=method)
    result = refweb.run(case).results["magnitude"]
    truth = STIFFNESS * (RADIUS - away)
    at_start = STIFFNESS * (RADIUS - np.hypot(away, late * h * speed))
    assert abs(result.value - truth) <= max(result.error, 1e-9 * truth)
    assert abs(result.value - truth) < 0.01 * (truth - at_start) + 1e-9 * truth
    assert abs(result.time - late * h) < 0.05 * h


@pytest.mark.parametrize("method", ["central-difference", "cvode"])
def test_a_peak_behind_a_jump(method):
    """An end of a line goes out and back at a constant speed each: strain is largest at the corner, and not above.

    The parabola through values on both sides of the corner would pass it. Behind the second corner, where the end goes
    out for a while again, nothing is larger either.
    """
    way = [(0.0, 0.0, 0.0, 0.0), (3.3e-4, 1e-3, 0.0, 0.0), (5e-4, 0.0, 0.0, 0.0), (6e-4, 5e-4, 0.0, 0.0)]
    web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0], [1, 1, 0]], lines=[[0, 1], [1, 2]], supports=[0, 2])
    case = refweb.Scene(
        web=web,
        cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-4, density=200.0),
        effects=[refweb.Motion(node=1, displacement=way), refweb.PointMass(node=2, mass=1.0)],
        supports=refweb.Supports(nodes=[0]),
        solve=refweb.Dynamic(duration=6e-4, method=method),
        output=refweb.Output(interval=6e-4),
        observe=[refweb.Observe(name="strain", quantity="strain", line=0, reduce="max")],
        accuracy=refweb.Accuracy(error="none"),
    )
    strain = refweb.run(case).results["strain"]
    np.testing.assert_allclose([strain.value, strain.time], [1e-3, 3.3e-4], rtol=1e-9)


def test_order_of_a_peak():
    """Peaks of central differences are of order 2, at each phase: at steps they are not, as they jump between these."""
    steps = 1e-3 * 0.5 ** np.arange(4)
    for phase in (-0.4, -0.8, -1.2):
        case, truth = oscillator(phase)
        errors = []
        for h in steps:
            solve = refweb.Dynamic(duration=1.7 / OMEGA, step_size=float(h))
            found = refweb.run(case.replace(solve=solve, accuracy=refweb.Accuracy(error="none"))).results
            errors.append(abs(found["magnitude"].value / truth["magnitude"] - 1.0))
        order = np.polyfit(np.log(steps), np.log(errors), 1)[0]
        # What is left of it is of order 4, up to a tenth at the longest step.
        assert 1.8 < order < 2.2, (phase, errors)


def test_what_has_bounds_keeps_them():
    """Tension is not below zero, nor are more than all lines slack: a parabola through a kink passes both."""
    observe = [
        refweb.Observe(name="slack", quantity="slack_fraction", reduce="max"),
        refweb.Observe(name="taut", quantity="slack_fraction", reduce="min"),
        refweb.Observe(name="tension", quantity="tension", line=3, reduce="min"),
        refweb.Observe(name="push", quantity="reaction", body="ball", reduce="min"),
    ]
    body = refweb.Body(name="ball", radius=0.1, mass=0.05, position=(0.01, 0.02, -0.1), velocity=(0.0, 0.0, 3.0))
    for method in ("central-difference", "explicit", "cvode"):
        case = refweb.Scene(
            web=refweb.Window(mesh="square", rows=2, columns=2, side=0.2),
            cable=refweb.Cable(law="tension-only", modulus=1e7, area=1e-5, density=200.0),
            effects=[body, refweb.Contact(stiffness=2e3)],
            solve=refweb.Dynamic(duration=0.02, method=method),
            accuracy=refweb.Accuracy(error="none"),
            observe=observe,
        )
        found = {name: result.value for name, result in refweb.run(case).results.items()}
        lines = len(case.build().net.cells)
        for name in ("slack", "taut"):
            assert 0.0 <= found[name] <= 1.0 and (found[name] * lines) % 1.0 == 0.0
        assert found["tension"] == 0.0 and found["push"] == 0.0


@pytest.mark.parametrize("name", ["central-difference", "order 6"])
def test_peaks_and_corrections_go_on_bit_for_bit(name):
    """Row by row from a checkpoint in an integrator of its own: all that is known of peaks is the same."""
    from refweb.dynamics.simulation import Simulation

    case, _ = oscillator(-0.83, interval=1e-3, **METHODS[name])

    def integrator():
        return Simulation(case, case.build(), refweb.Solution(case)).integrator

    times = 1e-3 * np.arange(18)
    whole = integrator()
    course = whole.start()
    whole.advance(course, times)
    assert (course.extremes.corrections > 0.0).any()
    split = integrator()
    other = split.start()
    for t in times:
        split.advance(other, [t])
        kept = {key: array.copy() for key, array in split.save(other).items()}
        split = integrator()
        other = split.load(kept)
    for key, array in whole.save(course).items():
        np.testing.assert_array_equal(array, split.save(other)[key], err_msg=key)


def test_top_of_a_parabola():
    """Exact on a parabola, however far apart the points are; none where it opens upwards."""
    p, times = np.polynomial.Polynomial([1.0, 2.0, -3.0]), [0.0, EDGE, 0.7]
    top = top_of(times, [p(t) for t in times])
    np.testing.assert_allclose(top, [1.0 / 3.0, 4.0 / 3.0], rtol=1e-9)
    assert top_of(times, [-p(t) for t in times]) is None


def test_a_step_of_one_rounding_has_no_top():
    """A solver that stops short of a row takes one: the middle is one of its ends, and rounding the only difference."""
    now = np.nextafter(9e-4, 1.0)
    for middle in (9e-4, now):
        assert top_of([9e-4, middle, now], [1.0, np.nextafter(1.0, 2.0), 1.0]) is None
