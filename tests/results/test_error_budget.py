"""Error budgets: parts, their sum, verdicts and warnings, on results made up for it and on small scenes."""

import numpy as np
import pytest

import refweb
from refweb.dynamics.divergence import divergence
from refweb.results.error_budget import (
    NONE,
    OPEN,
    PARTS,
    VERDICTS,
    digits_of,
    first_touch,
    shares,
    summed,
    with_verdict,
)
from refweb.results.solution import Result

ALL = dict.fromkeys(PARTS, NONE)
CABLE = dict(modulus=7e7, area=1e-4, density=200.0)


def result(value, **parts):
    made = Result(value, None, "m", 0.0, None, parts={**ALL, **parts}, reasons={})
    return with_verdict(summed(made), {})


def test_error_is_the_sum_of_what_is_known():
    assert result(1.0, time=0.01, elements=0.02, chance=OPEN).error == pytest.approx(0.03, rel=1e-15)
    assert result(1.0, time=OPEN).error is None
    assert result(1.0, time=OPEN).verdict is None


@pytest.mark.parametrize(
    "value, parts, verdict, digits",
    [
        (1.0, dict(time=0.001), "determined", 3),
        (-1.0, dict(time=0.09), "determined", 1),
        (1.0, dict(time=0.001, elements=OPEN), None, 3),
        (1.0, dict(time=0.2, elements=OPEN), "wide", None),
        (1.0, dict(time=0.2, elements=0.3), "depends on the model", None),
        (1.0, dict(time=0.2, contact_stiffness=0.3), "depends on the model", None),
        (1.0, dict(time=0.2, smoothing=0.3), "depends on the model", None),
        (1.0, dict(time=0.2, chance=0.3), "statistical", None),
        (0.0, dict(time=0.0), "determined", 0),
        (0.0, dict(time=0.0, elements=OPEN), None, 0),
        (0.0, dict(time=1e-3), "wide", None),
    ],
)
def test_verdicts(value, parts, verdict, digits):
    found = result(value, **parts)
    assert (found.verdict, found.digits) == (verdict, digits)
    assert verdict is None or verdict in VERDICTS


def test_what_is_zero_but_for_rounding_has_no_digits():
    made = summed(Result(3e-17, None, "m", 0.0, None, parts={**ALL, "time": 1e-16}, reasons={}))
    found = with_verdict(made, {}, scales={"m": 1.0})
    assert (found.verdict, found.digits, found.verdict_text) == ("determined", 0, "zero but for rounding")
    assert with_verdict(made, {}, scales={"m": 1e-6}).verdict == "wide"


@pytest.mark.parametrize("quantity, keys", [("velocity", {"node": 1}), ("tension", {"line": 0})])
def test_what_stays_zero_has_no_digits_and_no_price(quantity, keys):
    """A node at rest on lines without tension; and its place across a pull, which is zero within ± by symmetry."""
    pull = refweb.Load(node=1, force=(0.0, 0.0, 1.0))
    scene = refweb.Scene(
        web=refweb.Inline(points=[[-1, 0, 0], [0, 0, 0], [1, 0, 0]], lines=[[0, 1], [1, 2]], supports=[0, 2]),
        cable=refweb.Cable(law="tension-only", modulus=1e6, area=1e-6, density=1000.0),
        solve=refweb.Dynamic(duration=0.1),
        observe=[refweb.Observe(name="it", quantity=quantity, **keys)],
    )
    still = refweb.run(scene).results["it"]
    assert still.value == 0.0 and still.digits == 0 and still.verdict_text.startswith("zero")
    across = refweb.Observe(name="it", quantity="position", node=1, component="x")
    pulled = refweb.run(scene.replace(effects=[pull], observe=[across])).results["it"]
    assert "CPU" not in pulled.verdict_text and pulled.digits in (None, 0)


def test_a_number_of_the_mesh_has_no_limit_whatever_its_error():
    made = summed(Result(1.0, None, "N", 0.0, None, parts={**ALL, "time": 1e-9}, reasons={}))
    assert with_verdict(made, {}, mesh_only=True).verdict == "no limit"


def test_digits_leave_less_than_a_unit_of_the_last():
    random = np.random.default_rng(1)
    for value, error in zip(10.0 ** random.uniform(-9, 9, 200), 10.0 ** random.uniform(-12, 2, 200), strict=True):
        digits = digits_of(value, error * value)
        assert digits == 0 or error <= 10.0**-digits * (1.0 + 1e-8)
        assert digits == 12 or error > 10.0 ** -(digits + 1) * (1.0 - 1e-8)


def test_words_say_what_is_held():
    assert shares({"parts": {**ALL, "time": 0.1, "elements": OPEN}}) == "time only"
    assert shares({"parts": {**ALL, "time": 0.1, "elements": 0.1, "chance": OPEN}}) == "time and elements only"
    assert shares({"parts": {**ALL, "time": 0.1}}) == shares({}) == ""
    assert shares({"parts": {**ALL, "rounding": 0.1, "elements": OPEN}, "proven": True}) == "of these elements, proven"


# Growth of differences


def two_runs(growth):
    """Rows of two runs whose only observable differs as a function of time has it, with a balance as last column."""
    times = np.linspace(0.0, 1.0, 400)
    values = np.sin(20.0 * times)
    return tuple(np.column_stack([times, run, np.zeros(400)]) for run in (values, values + growth(times)))


def test_exponential_growth_is_found_with_its_rate():
    """Of the time at which no digit is left a sixteenth of the whole is known; the last of five parts is not full."""
    found = divergence(*two_runs(lambda t: np.minimum(1e-12 * np.exp(40.0 * t), 1.0)))
    assert found.growth == pytest.approx(40.0, rel=0.15) and abs(found.lost - np.log(1e11) / 40.0) < 1.0 / 16.0


@pytest.mark.parametrize("power", [1, 2, 3])
@pytest.mark.parametrize("begin", [0.0, 0.3, 0.62])
def test_growth_by_a_power_of_time_since_a_touch_is_none(power, begin):
    assert divergence(*two_runs(lambda t: 0.5 * np.maximum(t - begin, 0.0) ** power)) is None


def test_growth_that_does_not_matter_or_few_rows_tell_nothing():
    assert divergence(*two_runs(lambda t: 1e-16 * np.exp(25.0 * t))) is None
    assert divergence(*(rows[::10] for rows in two_runs(lambda t: 1e-12 * np.exp(25.0 * t)))) is None


# Small scenes


def test_straight_elements_loaded_at_their_ends_have_all_parts():
    scene = refweb.Scene(
        web=refweb.Window(mesh="square", rows=3, columns=3, side=0.5),
        cable=refweb.Cable(law="tension-only", **CABLE),
        effects=[refweb.Load(node="centre", force=(0, 0, 1.0))],
    )
    for found in refweb.run(scene).results.values():
        assert found.verdict == "determined" and set(found.parts) == set(PARTS)
        assert found.parts["elements"] == NONE and "straight" in found.reasons["elements"]
        assert found.error == found.parts["rounding"]
    assert refweb.run(scene).results["max_tension"].proven
    heavy = scene.replace(effects=[*scene.effects, refweb.Gravity(acceleration=(0, 0, -9.81))])
    for found in refweb.run(heavy).results.values():
        assert found.parts["elements"] == OPEN and found.verdict is None


def hit(stiffness=1e4, **changes):
    given = dict(
        web=refweb.Window(mesh="square", rows=4, columns=4, side=0.2),
        cable=refweb.Cable(law="tension-only", prestrain=1e-3, **CABLE),
        effects=[
            refweb.Body(name="ball", radius=0.1, mass=1.0, position=(0.01, 0.02, -0.105), velocity=(0, 0, 2.0)),
            refweb.Contact(stiffness=stiffness),
        ],
        observe=[
            refweb.Observe(name="depth", quantity="displacement", reduce="max"),
            refweb.Observe(name="peak", quantity="reaction", body="ball", reduce="max"),
            refweb.Observe(name="mean", quantity="reaction", body="ball", reduce="max", average=2e-3),
        ],
        solve=refweb.Dynamic(duration=4e-3),
        output=refweb.Output(interval=1e-4, frames=40),
    )
    return refweb.Scene(**{**given, **changes})


def test_first_touch_is_that_of_one_mass_on_a_spring():
    """m v²/2 = k δ²/2, F = k δ: of the mass of a node in the middle, four halves of a line of 0.2 m."""
    scene = hit()
    system, mass = scene.build(), 2.0 * 0.2 / (1.0 + 1e-3) * 200.0 * 1e-4
    touch = first_touch(scene, system, scene.observables[1])
    assert touch == pytest.approx(2.0 * np.sqrt(1e4 * mass), rel=1e-12)
    assert first_touch(scene, system, scene.observables[0]) is None
    assert first_touch(scene, system, scene.observables[2]) is None


def test_a_first_touch_has_no_limit_and_nothing_else():
    results = refweb.run(hit()).results
    assert results["peak"].verdict == "no limit" and "average" in results["peak"].verdict_text
    assert "no limit" not in (results["depth"].verdict, results["mean"].verdict)


def test_what_touches_nothing_has_no_error_of_stiffness():
    far = refweb.Body(name="ball", radius=0.1, mass=1.0, position=(0.01, 0.02, -0.5), velocity=(0, 0, 2.0))
    found = refweb.run(hit(effects=[far, refweb.Contact(stiffness=1e4)])).results["depth"]
    assert found.parts["contact_stiffness"] == NONE and found.reasons["contact_stiffness"] == "nothing touches"
    assert refweb.run(hit()).results["depth"].parts["contact_stiffness"] == OPEN


def test_a_peak_that_is_wide_is_warned_of():
    """Of the largest stress of an instant, where waves meet, steps of the default size tell next to nothing."""
    stress = refweb.Observe(name="stress", quantity="stress", reduce="max")
    scene = refweb.Scene.load("triangle-impact", {"solve.safety": 0.5}).replace(observe=[stress])
    solution = refweb.run(scene)
    (finding,) = (finding for finding in solution.findings if finding.code == "wide-error")
    found = solution.results["stress"]
    assert found.error > 0.1 * found.value and found.verdict == "wide" and "digits = 1" in found.verdict_text
    assert "stress" in finding.text and "refweb trust" in finding.text
