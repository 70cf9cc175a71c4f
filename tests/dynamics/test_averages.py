"""Means over a window that slides along a run: in closed form, by every method, and what they refuse.

A mass on a line that is linear and without mass is an oscillator, v sin(ωt)/ω from rest length: its mean over a window
that ends at t is v sin(ω(t − ½w)) sin(½ωw)/(½ω²w).
"""

import itertools
from dataclasses import replace

import nets
import numpy as np
import pytest

import refweb
from refweb.dynamics.integrators.averages import (
    PARTS,
    Windows,
    begin_averages,
    coefficients,
    open_share,
    slide,
    write_means,
)
from refweb.dynamics.integrators.extremes import Extremes
from refweb.errors import InputError

STIFFNESS, MASS, SPEED, DURATION = 7e3, 1.0, 1.0, 0.1
WINDOWS = {"short": 1e-4, "rows": 3.7e-3, "long": 2e-2, "whole": DURATION}
"""Shorter than a step, longer than several rows of 1e-3 s and no multiple of them, of many rows, and all of the run."""
REDUCE = ("max", "min", "final")
EXPLICIT = "central-difference", "order 4", "order 6"
METHODS = nets.METHODS | {"ida": dict(method="ida", rtol=1e-5)}


def of_way(name, average, reduce="max", quantity="displacement"):
    return refweb.Observe(name=name, quantity=quantity, node=1, component="x", reduce=reduce, average=average)


def oscillator(windows=WINDOWS, interval=1e-3, duration=DURATION, **parts):
    """The scene, with the largest, smallest and last mean of each window; what is not its own key is one of solve."""
    own = {key: parts.pop(key) for key in ("event", "accuracy", "frames") if key in parts}
    return refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0]),
        cable=refweb.Cable(law="linear", modulus=STIFFNESS * 1e4, area=1e-4, density=1e-9),
        support=[refweb.Supports(nodes=[1], components=["y", "z"])],
        effects=[refweb.PointMass(node=1, mass=MASS), refweb.Velocity(node=1, value=(SPEED, 0, 0))],
        solve=refweb.Dynamic(duration=duration, **parts),
        output=refweb.Output(interval=interval, frames=own.pop("frames", 1)),
        observe=[of_way(f"{name} {reduce}", w, reduce) for name, w in windows.items() for reduce in REDUCE],
        **own,
    )


OMEGA = np.sqrt(STIFFNESS / MASS)  # half of the line's mass is 5e-14 kg


def mean(t, window):
    """The mean at some times; before a window is full that of what has passed."""
    window = np.minimum(t, window)
    half = np.where(window > 0.0, 0.5 * OMEGA * window, 1.0)
    share = np.where(window > 0.0, np.sin(half) / half, 1.0)
    return SPEED / OMEGA * np.sin(OMEGA * (t - 0.5 * window)) * share


def truths(windows=WINDOWS):
    """Closed forms by name: extremes are at the ends, or where the sine is 1 or −1."""
    found = {}
    for name, w in windows.items():
        tops = 0.5 * w + np.pi / OMEGA * (0.5 + np.arange(10))
        values = mean(np.array([w, DURATION, *tops[(tops >= w) & (tops <= DURATION)]]), w)
        extremes = values.max(), values.min(), values[1]
        found |= {f"{name} {reduce}": value for reduce, value in zip(REDUCE, extremes, strict=True)}
    return found


@pytest.mark.parametrize("name", nets.some(METHODS, 2))
def test_means_are_those_of_the_closed_form_within_their_errors(name):
    """Results, and rows by the largest ± of their window, at all times of which a window is not full as well."""
    solution = refweb.run(oscillator(**METHODS[name]))
    assert solution.status == "solved" and not solution.warnings
    for key, truth in truths().items():
        result = solution.results[key]
        assert abs(result.value - truth) <= result.error and result.where is None, (key, result, truth)
        # A sine of 1e-2 m that is known to a hundredth at the worst; rounding of times is 1e-17 s over 1e-4 s.
        assert result.error < 1e-2 * SPEED / OMEGA, (key, result)
    for window, width in WINDOWS.items():
        off = abs(solution.history[f"{window} final"] - mean(solution.history["time"], width))
        assert off.max() <= max(solution.results[f"{window} {reduce}"].error for reduce in REDUCE), window


@pytest.mark.parametrize("order, method", [(2, "central-difference"), (4, "order 4"), (6, "order 6")])
def test_means_have_the_order_of_the_method(order, method):
    """By the largest error of all results and of all rows, at steps that halve twice."""
    windows = {name: WINDOWS[name] for name in ("rows", "long")}
    errors = []
    for step in (1.25e-3, 6.25e-4, 3.125e-4) if order == 2 else (5e-3, 2.5e-3, 1.25e-3):
        case = oscillator(windows, 5e-3, step_size=step, accuracy=refweb.Accuracy(error="none"), **METHODS[method])
        solution = refweb.run(case)
        off = [abs(solution.results[key].value - truth) for key, truth in truths(windows).items()]
        times = solution.history["time"]
        rows = [abs(solution.history[f"{name} max"] - mean(times, w)).max() for name, w in windows.items()]
        errors.append([max(off), max(rows)])
    slopes = np.log2(np.array(errors)[:-1] / np.array(errors)[1:])
    np.testing.assert_allclose(slopes, order, atol=0.15 * order)


def test_many_steps_in_a_cell():
    """Ten thousand steps in a window; ± of the twin holds."""
    windows = {"whole": DURATION, "half": 0.5 * DURATION}
    solution = refweb.run(oscillator(windows, DURATION, step_size=1e-5))
    for key, truth in truths(windows).items():
        result = solution.results[key]
        assert abs(result.value - truth) <= result.error < 1e-6 * SPEED / OMEGA, (key, result, truth)


def flight(velocity=(0.0, 0.0, 0.0), duration=1.0, interval=None, observe=(), effects=(), **solve):
    """A free ball, and a line that is held at both ends."""
    return refweb.Scene(
        web=refweb.Inline(points=[[-1, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0, 1]),
        cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-4, density=200.0),
        effects=[refweb.Body(name="ball", radius=0.1, mass=2.0, position=(0, 0, -0.101), velocity=velocity), *effects],
        solve=refweb.Dynamic(duration=duration, **solve),
        output=refweb.Output(interval=interval or duration),
        accuracy=refweb.Accuracy(error="none"),
        observe=observe,
    )


@pytest.mark.parametrize("width", [0.02, 0.0071])
def test_mean_of_a_contact_force_is_momentum_over_time(width):
    """To rounding: the kicks of central differences are the trapezoidal rule, whatever kinks a force has."""
    given = dict(body="ball", component="z")
    observe = [
        refweb.Observe(name="push", quantity="reaction", average=width, **given),
        refweb.Observe(name="speed", quantity="velocity", **given),
    ]
    rows = refweb.run(flight((0, 0, 1.0), 0.02, width, observe, [refweb.Contact(stiffness=1e5)])).history
    assert rows["time"][1] == width and abs(rows["push"][1]) > 1.0
    np.testing.assert_allclose(rows["push"][1] * width, 2.0 * np.diff(rows["speed"])[0], rtol=1e-12)


@pytest.mark.parametrize("method", [*METHODS])
@pytest.mark.parametrize("interval", [0.05, 0.5])
def test_mean_of_what_dips_within_a_step(method, interval):
    """A node flies by another at 3 m/s, 3 mm beside it: ∫ √(c² + u²) du in closed form; nothing limits steps."""
    speed, aside, start, window = 3.0, 3e-3, -0.7, 0.4
    scene = refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [start, aside, 0]], lines=[[0, 1]], supports=[0], natural_length=10.0),
        cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-6, density=1e3),
        effects=[refweb.Velocity(node=1, value=(speed, 0, 0))],
        solve=refweb.Dynamic(duration=0.5, **METHODS[method]),
        output=refweb.Output(interval=interval),
        observe=[refweb.Observe(name=r, quantity="distance", node=[0, 1], average=window, reduce=r) for r in REDUCE],
    )

    def truth(end):
        u = start + speed * (end - np.array([window, 0.0]))
        return np.diff(0.5 * (u * np.hypot(aside, u) + aside**2 * np.arcsinh(u / aside)))[0] / (speed * window)

    results = refweb.run(scene).results
    turn = 2.0 * -start / speed  # window of equal distances at both ends
    for name, value in {"max": truth(0.5), "min": truth(0.5 * (turn + window)), "final": truth(0.5)}.items():
        assert abs(results[name].value - value) <= results[name].error < 1e-2 * value, (name, results[name], value)
    assert method in EXPLICIT or abs(results["final"].value - truth(0.5)) < 1e-9


def test_what_an_integral_leaves_open_holds_a_kink():
    """|s − a| through five values: the polynomial's mean is off by no more than what is left open, wherever a is."""
    at = np.linspace(0.0, 1.0, PARTS + 1)
    for kink in np.linspace(0.0, 1.0, 1201):  # thirds among them, where the fourth difference vanishes
        values = np.abs(at - kink)
        c = coefficients(values, True)
        mean, truth = sum(one / (k + 1) for k, one in enumerate(c)), 0.5 * (kink**2 + (1.0 - kink) ** 2)
        assert abs(mean - truth) <= open_share(values) + 1e-15  # rounding


@pytest.mark.parametrize("width", [0.3, 0.7, 1.0])
def test_means_leave_open_what_kinks_within_their_window_do(width):
    """The same over a window of six steps of random lengths, or less, from a start at t = 0 or not."""
    rng = np.random.default_rng(22)
    for _ in range(50):
        kink, times = rng.uniform(0.0, 1.0), np.array([0.0, *np.sort(rng.uniform(0.1, 0.9, 5)), 1.0])
        windows = Windows(np.zeros(1, dtype=np.int64), np.array([width]), np.zeros(1))
        extremes = Extremes.at_start(np.array([kink]), np.zeros(1, dtype=np.int64))
        averages, row = begin_averages(windows, extremes), np.zeros(2)
        for begin, end in itertools.pairwise(times):
            averages.within[0] = np.abs(np.linspace(begin, end, PARTS + 1) - kink)
            slide(0, end, True, windows, averages, extremes)
            averages.looked[0] = end
        write_means(row, windows, averages, extremes)
        start, end = 1.0 - width - kink, 1.0 - kink
        truth = 0.5 * (end * abs(end) - start * abs(start)) / width
        assert abs(row[1] - truth) <= extremes.corrections[0] + 1e-14  # rounding
        assert extremes.corrections[0] <= np.diff(times).max() ** 2 / 6.0 / width + 1e-14  # a kink in its middle


def test_a_long_run_keeps_its_digits():
    """A speed of 1 m/s through 3e3 windows: its time is rounded by 3e-17 s, a window is 1e-4 s."""
    speed = refweb.Observe(name="speed", quantity="velocity", body="ball", component="x", reduce="max", average=1e-4)
    solution = refweb.run(flight((1.0, 0, 0), 0.3, 0.1, [speed], step_size=3e-6))
    assert abs(solution.results["speed"].value - 1.0) < 1e-11 and abs(solution.history["speed"] - 1.0).max() < 1e-11


@pytest.mark.parametrize("name, method", [(name, METHODS[name]) for name in ("central-difference", "bdf", "ida")])
def test_jumps_of_velocity(name, method):
    """A node moved at 1 m/s until 4 ms, at −2 m/s until 7 ms, then at rest: the mean counts each side for its own."""
    table = [[0, 0, 0, 0], [4e-3, 4e-3, 0, 0], [7e-3, -2e-3, 0, 0], [8e-3, -2e-3, 0, 0]]
    windows = {"odd": 1.3e-3, "whole": 0.01}
    case = oscillator(windows, 1e-3, 0.01, **method).replace(
        web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0], [2, 0, 0]], lines=[[0, 1], [1, 2]], supports=[0]),
        support=[refweb.Supports(nodes=[2], components=["y", "z"])],
        effects=[
            refweb.PointMass(node=2, mass=MASS),
            refweb.Motion(node=1, displacement=table),
        ],
        observe=[of_way(f"{n} {r}", w, r, "velocity") for n, w in windows.items() for r in REDUCE],
    )
    solution = refweb.run(case)
    way = lambda t: np.interp(t, [row[0] for row in table], [row[1] for row in table])  # noqa: E731
    times = solution.history["time"][1:]
    for name, w in windows.items():
        width = np.minimum(times, w)
        truth = (way(times) - way(times - width)) / width
        # Within a step that ends at a corner the methods look a 2⁻¹⁶ part ahead of it at the speed before.
        np.testing.assert_allclose(solution.history[f"{name} max"][1:], truth, atol=1e-4)
    assert solution.results["odd max"].value == pytest.approx(1.0, abs=1e-4)
    assert solution.results["odd min"].value == pytest.approx(-2.0, abs=1e-4)
    assert solution.results["whole max"].value == solution.results["whole min"].value


@pytest.mark.parametrize("name", ["central-difference", "order 6"])
def test_means_go_on_bit_for_bit(name):
    """Row by row from a checkpoint in an integrator of its own."""
    from refweb.dynamics.simulation import Simulation

    case = oscillator(**METHODS[name])

    def integrator():
        return Simulation(case, case.build(), refweb.Solution(case)).integrator

    times = 1e-3 * np.arange(60)
    whole = integrator()
    course = whole.start()
    rows = whole.advance(course, times).values
    split = integrator()
    other = split.start()
    for t, row in zip(times, rows, strict=True):
        np.testing.assert_array_equal(split.advance(other, [t]).values[0], row)
        kept = {key: array.copy() for key, array in split.save(other).items()}
        split = integrator()
        other = split.load(kept)
    assert course.averages.passed.min() > 0
    for key, array in whole.save(course).items():
        np.testing.assert_array_equal(array, split.save(other)[key], err_msg=key)


@pytest.mark.parametrize("name", ["central-difference", "bdf"])
def test_a_run_that_ends_before_a_window_is_full(name):
    """It has the mean of what has passed, and says so."""
    stop = refweb.Event(name="far", kind="threshold", observe="way", value=5e-3, stop=True)
    case = oscillator(dict(long=WINDOWS["long"]), **METHODS[name])
    case = case.replace(observe=[*case.observe, refweb.Observe(name="way", quantity="displacement")], event=[stop])
    solution = refweb.run(case)
    assert solution.events[0]["time"] == pytest.approx(np.arcsin(5e-3 * OMEGA) / OMEGA, rel=0.2)
    told = [one for one in solution.warnings if "before a window was full" in one]
    assert [one.split(" is ")[0] for one in told] == ["long max", "long min"]
    end = solution.history["time"][-1]
    for reduce in REDUCE:
        # A step of 1e-3 s: central differences are off by (ωh)²/24 and find the event to the step.
        assert solution.results[f"long {reduce}"].value == pytest.approx(float(mean(end, 1.0)), rel=2e-3)
        assert solution.results[f"long {reduce}"].time == end


def test_no_means_are_no_numbers():
    """What a scene without any has in its loop: arrays without entries, in its checkpoints too."""
    from refweb.dynamics.integrators.central_difference import CentralDifference
    from refweb.dynamics.integrators.monitors import Observed

    solver = CentralDifference(oscillator({}).build())
    course = solver.start()
    outs = tuple(solver.system.per_cell())
    windows = Observed.of((), (), len(outs), outs, solver.model.contacts).windows
    arrays = {**windows.by_name(), **course.averages.by_name()}
    assert {array.size for name, array in arrays.items() if name != "looked"} == {0}


REFUSED = {
    "none": (dict(average=0.0), {}, "average = 0.0 must be > 0 [s]"),
    "negative": (dict(average=-1e-3), {}, "average = -0.001 must be > 0 [s]"),
    "long": (dict(average=0.2), {}, "average = 0.2 must be ≤ duration = 0.1 [s]: no window would be full"),
    "tiny": (dict(average=1e-8), {}, "average = 1e-08 must be ≥ 1e-05 [s], the duration over 10000"),
    "booked": (dict(quantity="kinetic_energy"), {}, 'no meaning for quantity = "kinetic_energy", which is summed'),
    "static": ({}, dict(solve=refweb.Static()), "average = 0.001 has no meaning in statics: leave it out"),
    "event": (
        {},
        dict(event=[refweb.Event(name="e", kind="threshold", observe="m", value=1.0)]),
        'observe = "m" is a mean, average = 0.001',
    ),
}


@pytest.mark.parametrize("observe, parts, message", REFUSED.values(), ids=REFUSED)
def test_refusals(observe, parts, message):
    with pytest.raises(InputError) as refused:
        one = refweb.Observe(**{"name": "m", "quantity": "displacement", "average": 1e-3, **observe})
        case = oscillator({}).replace(observe=[one])
        if "solve" in parts:
            case = refweb.Scene(web=case.web, cable=case.cable, observe=[one], **parts)
        case.replace(**({} if "solve" in parts else parts)).build()
    assert message in str(refused.value)


def test_digits_of_a_mean():
    """As many as are asked for, by ± and by the closed form."""
    windows = {"rows": WINDOWS["rows"]}
    solution = refweb.run(oscillator(windows, accuracy=refweb.Accuracy(digits=5)))
    for key, truth in truths(windows).items():
        result = solution.results[key]
        assert abs(result.value - truth) <= result.error <= 1e-5 * abs(truth), (key, result, truth)


def test_means_beside_horizon_and_ensemble():
    """Of an oscillator, which is not chaotic: no result is statistical, and the runs of the ensemble say the same."""
    windows = {"rows": WINDOWS["rows"]}
    solution = refweb.run(oscillator(windows, accuracy=refweb.Accuracy(horizon=True, ensemble=3)))
    assert solution.horizon["statistical"] == []
    for key, truth in truths(windows).items():
        result, many = solution.results[key], solution.horizon["ensemble"][key]
        assert abs(result.value - truth) <= result.error
        assert abs(many["mean"] - result.value) <= result.error and many["deviation"] <= 1e-6 * abs(truth), (key, many)


def test_means_beside_refinement():
    """Of a line of a hundredth of the mass: eight elements move the means by what ± and elements leave together."""
    case = oscillator({"rows": WINDOWS["rows"]}, accuracy=refweb.Accuracy(refine=True))
    case = case.replace(cable=replace(case.cable, density=100.0))
    coarse = refweb.run(case)
    fine = refweb.run(case.replace(cable=replace(case.cable, subdivide=8), accuracy=refweb.Accuracy(error="none")))
    for key, result in coarse.results.items():
        off = abs(fine.results[key].value - result.value)
        assert off <= result.error + result.discretisation, (key, result, off)
        assert result.discretisation < 1e-2 * abs(result.value), (key, result)


def test_costs_are_compared_by_values_of_an_instant():
    from refweb.studies.work_precision import _observable

    case = oscillator({"long": 2e-2})
    assert _observable(case, None).average is None
    with pytest.raises(InputError, match=r'"long max" is a mean, average = 0\.02'):
        _observable(case, "long max")
