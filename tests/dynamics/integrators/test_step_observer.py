"""What stands around steps of any method: Simpson's book, the search for events, limits of steps, finer runs."""

from types import SimpleNamespace

import numpy as np
import pytest

import refweb
from refweb.dynamics.integrators.cvode import Cvode
from refweb.dynamics.integrators.events import Event, event_rows, search
from refweb.dynamics.integrators.ida import Ida
from refweb.dynamics.integrators.simpson_balance import Piece, Rates
from refweb.dynamics.integrators.step_limits import TRAVEL, StepLimits

BEGIN, END = 0.3, 0.7


def sample(t):
    """An instant of which nothing but the time is asked."""
    return SimpleNamespace(time=t)


def piece(power, push=lambda t: np.zeros(3), length=lambda t: 0.0, pull=lambda t: 0.0, jump=None):
    """A piece whose rates are functions of time."""
    middle = 0.5 * (BEGIN + END)
    rates = tuple(
        Rates(np.array([power(t), 0.0, *push(t), *(2.0 * push(t))]), np.array([length(t)]), np.array([pull(t)]))
        for t in (BEGIN, middle, END)
    )
    before = np.array([2.0, 5.0, *np.ones(3), *np.zeros(3)])
    return Piece(sample(BEGIN), sample(middle), sample(END), rates, before, 0.5, jump, sample)


@pytest.mark.parametrize("t", [BEGIN, 0.35, 0.5, 0.69, END])
def test_parabolas_are_integrated(t):
    """∫ (1 − 4 τ + 9 τ²) dτ = τ − 2 τ² + 3 τ³ from the start; lengths that change evenly give pull times their way."""
    whole = lambda t: t - 2.0 * t**2 + 3.0 * t**3  # noqa: E731
    push = np.array([1.0, -2.0, 0.5])
    found = piece(lambda t: 1.0 - 4.0 * t + 9.0 * t**2, lambda t: t * push, lambda t: 3.0 * t, lambda t: t)
    work, impulse, pushed = np.split(found.booked(t), (2, 5))
    assert work[0] == pytest.approx(2.0 + whole(t) - whole(BEGIN), rel=1e-14)
    assert work[1] == pytest.approx(5.0 + 1.5 * (t**2 - BEGIN**2), rel=1e-14)
    np.testing.assert_allclose(impulse, 1.0 + 0.5 * push * (t**2 - BEGIN**2), rtol=1e-14)
    np.testing.assert_allclose(pushed, push * (t**2 - BEGIN**2), rtol=1e-13)


def test_simpson_has_cubics_at_the_end():
    work = piece(lambda t: t**3).booked(END)
    assert work[0] == pytest.approx(2.0 + 0.25 * (END**4 - BEGIN**4), rel=1e-14)


def test_a_jump_counts_at_the_end_alone():
    found = piece(lambda t: 0.0, jump=np.array([0.0, 7.0, 1.0, 2.0, 3.0, 0.0, 0.0, 0.0]))
    assert found.booked(0.69).tolist() == [2.0, 5.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]
    assert found.booked(END).tolist() == [2.0, 12.0, 2.0, 3.0, 4.0, 0.0, 0.0, 0.0]


def test_unevenness_is_the_difference_of_two_rules():
    """Of powers |t − 0.5|: Simpson's rule has 0.4 (0.2 + 0 + 0.2)/6, the trapezoidal one 0.4 · 0.2; lengths alike."""
    kink = lambda t: abs(t - 0.5)  # noqa: E731
    # The trapezoidal rule of both halves: 0.4 (0.2 + 2 · 0 + 0.2)/4.
    apart = abs(0.4 * 0.4 / 6.0 - 0.4 * 0.4 / 4.0)
    np.testing.assert_allclose(piece(kink).unevenness, [apart, 0.0], rtol=1e-12)
    by_length = piece(lambda t: 0.0, length=lambda t: 3.0 * t, pull=kink).unevenness
    np.testing.assert_allclose(by_length, [0.0, 3.0 * apart], rtol=1e-12)


def test_events_are_found_to_rounding():
    """Of sin 5t: it falls through ½ at π/6, and rises never; what lies behind the end of the run has not happened."""
    value = lambda piece, slot, sample: (np.sin(5.0 * sample.time), sample.time)[slot]  # noqa: E731
    events = [Event(0, 0.5), Event(0, 0.5, rising=True), Event(1, 0.6, rising=True), Event(1, 0.65, stop=True)]
    rows = event_rows([*events, Event(1, 0.66)])
    for event in rows:
        event["side"] = 1.0 if value(None, event["slot"], sample(BEGIN)) > event["level"] else -1.0
    stop = search(rows, piece(lambda t: 0.0), value)
    exact = [np.pi / 6.0, np.inf, 0.6, 0.65, np.inf]
    np.testing.assert_allclose(rows["time"], exact, rtol=1e-15)
    assert stop == rows["time"][3]


def built(effects, **changes):
    web = refweb.Window(mesh="square", rows=4, columns=4, side=0.1)
    cable = refweb.Cable(law="tension-only", modulus=7e7, area=1e-4, density=200.0)
    solve = refweb.Dynamic(duration=1.0)
    return refweb.Scene(**{"web": web, "cable": cable, "effects": effects, "solve": solve, **changes}).build()


def test_limits_of_steps():
    """The next corner of a table; a share of a ball's radius at twice the largest speed, or half of its distance."""
    push = refweb.Load(node="centre", force=(0.0, 0.0, 1.0), factor=[(0.0, 0.0), (0.2, 1.0), (0.5, 0.0)])
    system = built([push])
    x, v = np.zeros((2, system.rows, 3))
    v[0, 2] = 3.0
    stops = [StepLimits(system).stop(t, x, v, 1.0) for t in (0.0, 0.1, 0.2, 0.3, 0.5)]
    assert stops == [0.2, 0.2, 0.5, 0.5, np.inf]
    for height, way in ((-0.05, TRAVEL * 0.05), (-5.0, 0.5 * 4.95)):
        ball = refweb.Body(name="ball", radius=0.05, mass=1.0, position=(0.0, 0.0, height))
        system = built([ball, refweb.Contact(stiffness=1e4)])
        x, v = np.zeros((2, system.rows, 3))
        assert StepLimits(system).stop(0.0, x, v, 1.0) == np.inf
        v[3] = 0.0, 3.0, 4.0
        for step in (0.0, 1.0):
            assert StepLimits(system).stop(0.25, x, v, 1.0, step) == pytest.approx(0.25 + way / 10.0, rel=1e-12)
        near = 0.25 + TRAVEL * 0.05 / 10.0  # far enough for a step that may be ten times the last one
        assert StepLimits(system).stop(0.25, x, v, 1.0, 1e-5) == pytest.approx(near, rel=1e-12)


def test_a_state_has_all_unknowns():
    """Vectors of another length, as an integrator of one's own may give them, are refused."""
    solver = Cvode(built([]))
    unknown = np.ones(solver.unknowns)
    solver.start()
    assert all(rows.sum() == solver.unknowns for rows in solver.state(0.0, unknown, unknown))
    for x, v in ((unknown[:-1], unknown), (unknown, np.ones(1))):
        with pytest.raises(ValueError, match=f"for {solver.unknowns} unknowns"):
            solver.state(0.0, x, v)


@pytest.mark.parametrize("method, keys", [(Cvode, {"family": "adams", "max_order": 5}), (Ida, {"max_order": 3})])
def test_a_finer_run_is_of_the_same(method, keys):
    """All that was asked for but the tolerances, which are a tenth, or what is said, of those that were given."""
    solver = method(built([]), rtol=1e-4, atol_velocity=1e-3, linear_solver="dense", **keys)
    for by, share in ((None, 0.1), (4.0, 0.25)):
        finer = solver.refined(by)
        assert type(finer) is method and finer.system is solver.system and finer.linear_solver == "dense"
        assert all(getattr(finer, key) == value for key, value in keys.items())
        tolerances = finer.rtol, finer.atol_velocity, finer.atol_position
        assert tolerances == pytest.approx((share * 1e-4, share * 1e-3, share * solver.atol_position), rel=1e-14)
