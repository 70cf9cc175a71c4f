"""The book of momentum: it closes where runs are right, and refuses those whose impulses are not what was given."""

from dataclasses import replace

import nets
import numpy as np
import pytest
from scipy.integrate import quad

import refweb
from refweb.dynamics.integrators import momentum_balance
from refweb.dynamics.integrators.momentum_balance import CLOSURE, allowed
from refweb.dynamics.integrators.step_limits import StepLimits
from refweb.effects import gravity
from refweb.effects.base import Balance, ForceTerm
from refweb.effects.time_tables import flattened, integrate, interpolate
from refweb.errors import EnergyDriftError
from refweb.kernels import FORCE, kernel
from refweb.registry import EFFECTS
from refweb.system.system import System
from refweb.tables import table

ROUNDING = 1e-12
"""Share of the largest momentum that rounding may leave: some 1e4 roundings in 1e3 steps."""
SIDE, EARTH, BEGIN = 0.2, (0.3, -1.0, -9.81), 0.0051
WINDOW = refweb.Window(mesh="square", rows=3, columns=3, side=SIDE)
CENTRE = WINDOW.web().points[WINDOW.web().centre]
FREE = refweb.Supports(nodes=[])
WEIGHT = refweb.Gravity(acceleration=EARTH)
THROWN = [refweb.Velocity(node=0, value=(1.0, -0.5, 0.3)), refweb.Velocity(node=7, value=(0.2, 2.0, -1.0))]
BALL = refweb.Body(
    name="ball", radius=0.1, mass=0.1, position=tuple(CENTRE + [0.01, 0.03, -0.101]), velocity=(0, 0.5, 2)
)
METHODS = {
    "central-difference": dict(method="central-difference"),
    "explicit-4": dict(method="explicit", order=4),
    "explicit-6": dict(method="explicit", order=6),
    "bdf": dict(method="cvode"),
    "adams": dict(method="cvode", family="adams"),
    "ida": dict(method="ida"),
}
EXPLICIT, IMPLICIT = list(METHODS)[:3], list(METHODS)[3:]


def scene(method, *effects, supports=None, duration=0.02, interval=0.002, web=WINDOW, **more):
    return refweb.Scene(
        web=web,
        cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-4, density=200.0, prestrain=0.0),
        supports=supports,
        effects=list(effects),
        solve=refweb.Dynamic(duration=duration, **METHODS[method], **more),
        output=refweb.Output(interval=interval),
        accuracy=refweb.Accuracy(error="none"),
    )


def contact(method):
    """Contact, with friction where the method takes it."""
    return refweb.Contact(stiffness=1e4, friction=0.0 if method.startswith("explicit") else 0.3)


def pulse(width, impulse=(0.01, 0.0, 0.02), node="centre"):
    return refweb.Load(
        node=node, force=impulse, factor=[(BEGIN, 0.0), (BEGIN + width, 1.0 / width), (BEGIN + 2 * width, 0.0)]
    )


def vectors(solution, name):
    return np.column_stack([solution.history[f"{name}_{axis}"] for axis in "xyz"])


def momentum(solution):
    """Of what is free at the end, from velocities and masses alone."""
    system = solution.state.system
    linear = system.rows - system.net.spins
    free_v = np.where(system.supported, 0.0, solution.state.v)
    return system.net.mass[:linear] @ free_v[:linear]


def closes(solution, given, within):
    """Momentum is that at the start, the impulse of the supports, and what was given; the book says so as well."""
    history, drift = solution.history, solution.solver["momentum_drift"]
    start, support = vectors(solution, "momentum")[0], vectors(solution, "support_impulse")[-1]
    largest = np.abs(vectors(solution, "momentum")).max() + np.abs(support).max() + np.abs(given).max()
    assert np.abs(momentum(solution) - start - support - given).max() <= within * largest
    if "outer_impulse_x" in history:
        np.testing.assert_allclose(vectors(solution, "outer_impulse")[-1], given, atol=within * largest)
    assert 0.0 <= drift <= within and solution.warnings == []


# What is given


def test_tables_are_integrated_exactly():
    """Against quadrature of the table's own values, before, between and behind its rows."""
    table = [(0.1, 2.0), (0.25, -1.0), (0.2500001, 3.0), (0.9, 0.5)]
    data, points = np.array([7.0, *flattened(table)]), [t for t, _ in table]
    value = lambda t: np.interp(t, *np.transpose(table))  # noqa: E731
    for t in (-0.7, 0.1, 0.2, 0.25, 0.25000005, 0.6, 0.9, 2.0):
        known = interpolate(t, data, 1, 2, 1)[0]
        assert known == pytest.approx(value(t), rel=1e-12)
        low, high = sorted((points[0], t))
        exact = quad(value, low, high, points=[p for p in points if low < p < high] or None, epsabs=1e-14)[0]
        assert integrate(t, data, 1, 2, 1) == pytest.approx(exact if t > points[0] else -exact, rel=1e-11, abs=1e-15)


@pytest.mark.ordinary("supported-*", "free-central-difference", "free-explicit-*", "free-adams")
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("supports", [None, FREE], ids=["supported", "free"])
def test_gravity_and_a_hit(method, supports):
    """m g t of all that has mass, the ball among it: what falls on the supports they give back."""
    solution = refweb.run(scene(method, WEIGHT, BALL, contact(method), supports=supports, duration=0.01))
    net = solution.state.system.net
    given = 0.01 * net.mass[net.heavy].sum() * np.array(EARTH)
    assert solution.state.v[net.bodies[0].row, 2] < 1.8  # it was hit: gravity alone takes 0.1 m/s
    closes(solution, given, ROUNDING if method in EXPLICIT else allowed(1e-6))
    turning = solution.solver["angular_momentum_drift"]
    assert turning is None if supports is None else turning <= (ROUNDING if method in EXPLICIT else allowed(1e-6))


@pytest.mark.ordinary(
    "0.0001-central-difference",
    "0.0001-explicit-4",
    "0.0001-explicit-6",
    "1e-08-central-difference",
    "1e-08-explicit-4",
    "1e-08-explicit-6",
    "1e-08-bdf",
    "1e-08-adams",
)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("width", [1e-4, 1e-8])
def test_a_pulse(method, width):
    """A pulse that is shorter than a step, on a web that is held: its impulse, ∫F dt."""
    solution = refweb.run(scene(method, pulse(width)))
    rounding = 8.0 * np.spacing(BEGIN) / width
    closes(solution, np.array([0.01, 0.0, 0.02]), (ROUNDING if method in EXPLICIT else allowed(1e-6)) + rounding)


def test_damping_in_proportion_to_mass():
    """A free web that falls: momentum is M (g + (c v₀ − g) exp(−c t))/c; the book closes to rounding, whatever h is.

    Positions and velocities alone, −c M Δx, are off by c h² |a| M/4.
    """
    rate = 50.0
    falling = scene("central-difference", *THROWN, WEIGHT, refweb.Damping(rate=rate), supports=FREE, safety=0.25)
    solution = refweb.run(falling)
    net, state = solution.state.system.net, solution.state
    mass, start = net.mass.sum(), vectors(solution, "momentum")[0]
    weight = mass * np.array(EARTH)
    exact = weight / rate + (start - weight / rate) * np.exp(-rate * 0.02)
    np.testing.assert_allclose(momentum(solution), exact, rtol=1e-4)
    assert solution.solver["momentum_drift"] <= ROUNDING
    plain = start + 0.02 * weight - rate * net.mass @ state.x
    off = np.abs(momentum(solution) - plain).max() / np.abs(start).max()
    assert 1e3 * ROUNDING < off < 1e-4


def test_follower_loads_are_integrated():
    """Two masses that fly along their line, which thrust keeps straight: F t; the run says that it is integrated."""
    web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[])
    thrust = refweb.Thrust(node=1, line=0, force=-3.0, factor=[(0.0, 1.0), (0.01, 0.0)])
    for method in ("central-difference", "bdf", "ida"):
        solution = refweb.run(scene(method, thrust, refweb.PointMass(node=[0, 1], mass=1.0), web=web, interval=2e-4))
        closes(solution, np.array([3.0 * 0.005, 0.0, 0.0]), ROUNDING if method in EXPLICIT else allowed(1e-6))
        assert solution.solver["integrated_impulses"] == ["thrust"]
    turning = scene("central-difference", *THROWN, refweb.Frame(angular_velocity=(1.0, 5.0, -3.0)), supports=FREE)
    solution = refweb.run(turning)
    assert solution.solver["momentum_drift"] <= ROUNDING and solution.solver["integrated_impulses"] == ["frame"]
    assert np.abs(vectors(solution, "outer_impulse")[-1]).max() > 0.01 * np.abs(momentum(solution)).max()


# What turns


def ring(normal, name="ring", x=-0.001):
    """A ring that comes from the left along the web."""
    left = WINDOW.web().points[:, 0].min()
    place = (float(left) - 0.1 + x, float(CENTRE[1]) + 0.05, 0.0)
    return refweb.Body(
        name=name, shape="ring", radius=0.1, normal=normal, mass=0.1, position=place, velocity=(2, 0.5, 0)
    )


def test_a_ring_turns_with_what_the_web_loses():
    """About the normal of the ring: orbits of all masses, and its own I ω, from the state alone."""
    rubbed = scene("central-difference", ring((0, 0, 1)), refweb.Contact(stiffness=1e4, friction=0.5), supports=FREE)
    solution = refweb.run(rubbed)
    net, state = solution.state.system.net, solution.state
    assert abs(state.v[-1, 2]) > 0.1 and solution.solver["angular_momentum_drift"] <= ROUNDING

    def turning(points, v):
        return np.cross(points[:-1], net.mass[:-1, None] * v[:-1]).sum(axis=0)[2] + net.mass[-1] * v[-1, 2]

    first = turning(net.points, state.system.initial_velocity())
    assert turning(net.points + state.x, state.v) == pytest.approx(first, rel=ROUNDING)


def test_where_angular_momentum_is_booked():
    """Not with supports, with a load, with drag, or where rings may turn about different normals."""
    touch = refweb.Contact(stiffness=1e4, friction=0.3)
    drift = lambda *effects, supports=FREE: (  # noqa: E731
        refweb.run(scene("central-difference", *THROWN, *effects, supports=supports, duration=2e-3)).solver[
            "angular_momentum_drift"
        ]
    )
    rings = ring((0, 0, 1), "one"), ring((0, 0, -2), "other", -0.3)
    for kept in ((), (WEIGHT,), (refweb.Damping(time=1e-5),), (*rings, touch)):
        assert drift(*kept) <= ROUNDING
    for lost in ((pulse(1e-4),), (refweb.Damping(rate=1.0),), (rings[0], ring((0, 1, 1), "tilted", -0.3), touch)):
        assert drift(*lost) is None
    assert drift(supports=refweb.Supports(nodes=[3])) is None


# What is refused


@kernel(FORCE)
def one_percent_more(t, x, v, f, cells, data, out):
    for c in range(cells.shape[0]):
        for i in range(3):
            f[cells[c, 0], i] += 1.01 * data[c, i]


@kernel(FORCE)
def couple(t, x, v, f, cells, data, out):
    for c in range(cells.shape[0]):
        f[cells[c, 0], 2] += data[c, 0]
        f[cells[c, 1], 2] -= data[c, 0]
        out[c, 0] = data[c, 0] * (v[cells[c, 0], 2] - v[cells[c, 1], 2])


@table
class Couple(refweb.Velocity):
    """Forces on two nodes across their distance, which call themselves internal."""

    def on(self, net):
        cells, balance = np.array([[0, 1]], dtype=np.int32), Balance("work", power=0, internal=True)
        return ForceTerm("couple", cells, np.array([[0.1]]), couple, balance)


@pytest.mark.ordinary("central-difference", "explicit-*", "adams", "bdf")
@pytest.mark.parametrize("method", METHODS)
def test_a_kernel_that_gives_too_much(method, monkeypatch):
    """Weight times 1.01: the energy of the book is that of m g, and the work of a short fall is too little to tell."""
    wrong = lambda self, net: replace(made(self, net), force=one_percent_more)  # noqa: E731
    made = gravity.Gravity.on
    monkeypatch.setattr(gravity.Gravity, "on", wrong)
    with pytest.raises(
        EnergyDriftError, match=r"^momentum drift 0.00\d+ of the largest momentum of the run, limit \S+: .*; use"
    ):
        refweb.run(scene(method, WEIGHT, *THROWN, supports=FREE, duration=2e-3, interval=1e-3))


@pytest.mark.parametrize("method", ["central-difference", "explicit-6", "bdf", "ida"])
def test_steps_that_pass_over_a_pulse(method, monkeypatch):
    """Steps that know of no corners miss it whole, with its work: no other book sees that."""
    monkeypatch.setattr(System, "corners", np.zeros(0))
    monkeypatch.setattr(StepLimits, "stop", lambda self, t, x, v, end, step: np.inf)
    with pytest.raises(EnergyDriftError, match="momentum drift (1|0.[1-9])"):
        refweb.run(scene(method, pulse(1e-8)))


def test_forces_that_turn_what_nothing_turns(monkeypatch):
    monkeypatch.setitem(EFFECTS, "couple", f"{__name__}:Couple")
    pair = Couple(node=0, value=(0.0, 0.0, 0.0))
    with pytest.raises(EnergyDriftError, match=f"^angular momentum drift .* limit {CLOSURE:g}"):
        refweb.run(scene("central-difference", pair, *THROWN, supports=FREE))


def test_a_run_is_repeated_as_long_as_it_pays(monkeypatch):
    """A limit that a run misses, and one at a tenth of rtol keeps: the solution says what was done."""
    held = scene("bdf", BALL, contact("bdf"), rtol=1e-5, duration=0.004)
    drift = refweb.run(held).solver["momentum_drift"]
    monkeypatch.setattr("refweb.dynamics.integrators.step_observer.allowed", lambda rtol: 0.5 * drift)
    solution = refweb.run(held)
    (warning,) = solution.warnings
    assert "momentum drift" in warning and warning.endswith("use a smaller rtol than 1e-05; repeated with rtol = 1e-06")
    assert solution.solver["momentum_drift"] <= 0.5 * drift


# What is left


@pytest.mark.ordinary("adams", "ida")
@pytest.mark.parametrize("method", IMPLICIT)
def test_tolerances_and_what_is_allowed(method):
    """What is left falls with rtol, and is a tenth of what is allowed at most."""
    drifts = []
    for rtol in (1e-4, 1e-6):
        hit = scene(method, WEIGHT, BALL, contact(method), pulse(1e-4), rtol=rtol, duration=0.006)
        solution = refweb.run(hit)
        drifts.append(solution.solver["momentum_drift"])
        assert drifts[-1] <= 0.1 * allowed(rtol) and solution.warnings == []
    assert drifts[1] < 0.2 * drifts[0]


def test_a_web_at_rest():
    """Rounding alone moves it: that is no drift of what it has."""
    for method in ("central-difference", "explicit-6", "bdf"):
        still = scene(method, duration=0.05).replace(
            cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-4, density=200.0, prestrain=0.01)
        )
        assert refweb.run(still).solver["momentum_drift"] < 0.1 * CLOSURE


def test_a_run_that_goes_on_keeps_its_book(tmp_path):
    """Bit for bit: what is integrated, what was there at the start, and the largest that was ever left."""
    thrust = refweb.Thrust(node=5, line=5, force=3.0)
    given = scene("central-difference", thrust, WEIGHT, refweb.Damping(rate=5.0), pulse(1e-3), BALL, contact("bdf"))
    given = given.replace(output=refweb.Output(interval=0.001, frames=5))
    nets.interrupt(given, tmp_path / "run")
    again, undisturbed = refweb.resume(tmp_path / "run"), refweb.run(given)
    assert 0.0 < undisturbed.solver["momentum_drift"] <= ROUNDING
    assert again.solver["momentum_drift"] == undisturbed.solver["momentum_drift"]
    assert vectors(again, "outer_impulse").tolist() == vectors(undisturbed, "outer_impulse").tolist()


def test_the_book_names_what_it_does_not_see():
    for word in ("reels", "temperature", "pressure", "[[motion]]"):
        assert word in momentum_balance.__doc__.split("does not see")[1]
