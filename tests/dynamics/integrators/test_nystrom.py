"""Explicit steps of order 4 and 6: orders, stability, invariants, and what they refuse."""

import itertools

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import refweb
from refweb.dynamics.integrators.central_difference import CentralDifference
from refweb.dynamics.integrators.splitting import Splitting, splitting, stability
from refweb.errors import InputError

ORDERS = [4, 6]
END = 0.02


def window(effects=(), **changes):
    """A small square web under prestress, smooth law; its centre is thrown."""
    thrown = refweb.Velocity(node="centre", value=(0.5, 0.2, 2.0))
    cable = refweb.Cable(law="smooth", smoothing=1e-3, modulus=7e7, area=1e-4, density=200.0, prestrain=0.01)
    return refweb.Scene(
        **{"web": refweb.Window(mesh="square", rows=4, columns=4, side=0.2), "cable": cable, **changes},
        effects=[thrown, *effects],
        solve=refweb.Dynamic(duration=END),
    ).build()


def exact(system, end):
    """Displacement of every row by scipy's DOP853, begun anew at corners of tables."""
    free, n = system.free, len(system.free)
    mass = np.repeat(system.net.mass, 3)[free]

    def rate(t, y):
        x, v = np.zeros((2, system.rows, 3))
        x.ravel()[free], v.ravel()[free] = y[:n], y[n:]
        return np.concatenate([y[n:], system.force(t, x, v).ravel()[free] / mass])

    y = np.concatenate([np.zeros(n), system.initial_velocity().ravel()[free]])
    stops = sorted({0.0, end, *(t for term in system.terms for t in term.timing.times)})
    for begin, stop in itertools.pairwise(stops):
        y = solve_ivp(rate, (begin, stop), y, "DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
    x = np.zeros((system.rows, 3))
    x.ravel()[free] = y[:n]
    return x


def ran(system, end, **steps):
    solver = Splitting(system, **steps)
    run = solver.start()
    return solver, run, solver.advance(run, [end])


@pytest.mark.parametrize("order", ORDERS)
def test_order(order):
    """Fitted over steps of which the error is far above rounding; 0.4: the next even order adds to the first ones."""
    system = window()
    reference, limit = exact(system, END), CentralDifference(system).bound()
    steps = limit * np.array([0.8, 0.6, 0.45, 0.35])
    counts = np.ceil(END / steps)
    errors = [
        np.abs(ran(system, END, order=order, step_size=END / n * (1 + 1e-12))[1].x - reference).max() for n in counts
    ]
    assert errors[-1] > 1e-13
    slope = np.polyfit(np.log(END / counts), np.log(errors), 1)[0]
    assert abs(slope - order) < 0.4, (slope, errors)


FACTOR = ((0.0, 0.0), (0.0037, 1.0), (0.0061, -0.7), (0.0142, 0.4), (0.017, 0.4))
"""Corners at no multiple of any step."""


@pytest.mark.parametrize("order", ORDERS)
def test_order_under_dead_loads(order):
    """Displacement and energy book, which dead loads of any factor leave as they are; momentum to rounding."""
    jerked = refweb.Load(node="centre", force=(3.0, 1.0, 20.0), factor=FACTOR)
    steady = refweb.Load(node=8, force=(0.0, 2.0, -4.0))
    system = window([jerked, steady, refweb.Gravity(acceleration=(0.0, 0.0, -9.81))])
    reference, limit = exact(system, END), CentralDifference(system).bound()
    steps, errors, drifts = [], [], []
    for share in (0.96, 0.72, 0.54, 0.42):
        _, run, _ = ran(system, END, order=order, step_size=share * limit)
        steps.append(END / run.nsteps)
        errors.append(np.abs(run.x - reference).max())
        drifts.append(run.drift)
    assert errors[-1] > 1e-12
    slope, closing = (np.polyfit(np.log(steps), np.log(values), 1)[0] for values in (errors, drifts))
    assert abs(slope - order) < 0.4, (slope, errors)
    assert closing > order - 0.4 and drifts[-1] < 1e-8, (closing, drifts)
    mass = np.where(system.supported, 0.0, system.net.mass[:, None])
    factor = np.array([*FACTOR, (END, FACTOR[-1][1])]).T
    held = system.supported[: len(system.net.web.points), 2].any()
    given = np.trapezoid(factor[1], factor[0]) * np.array(jerked.force) + END * np.array(steady.force)
    given += END * system.net.mass.sum() * np.array([0.0, 0.0, -9.81])
    gained = (mass * (run.v - system.initial_velocity())).sum(axis=0)
    assert held and np.abs(gained - given - run.impulse).max() < 1e-12 * np.abs(run.impulse).max()


def spring(effect, observe, **solve):
    """A mass of 1 kg on a linear spring of 7e3 N/m, what sets it moving, and what is looked at for 0.3 s."""
    return refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0]),
        cable=refweb.Cable(law="linear", modulus=7e7, area=1e-4, density=0.0),
        effects=[refweb.PointMass(node=1, mass=1.0), effect],
        support=[refweb.Supports(nodes=1, components=["y", "z"])],
        observe=observe,
        solve=refweb.Dynamic(duration=0.3, method="explicit", **solve),
        accuracy=refweb.Accuracy(error="none"),
        output=refweb.Output(interval=0.3),
    )


@pytest.mark.parametrize("order", ORDERS)
def test_largest_work_between_steps(order):
    """A mass on a spring that a force is let go on, x = F/k (1 − cos ωt): the work is at most 2 F²/k, of order 4."""
    errors, shares = [], np.array([0.8, 0.4, 0.2])
    for share in shares:
        done = refweb.Observe(name="done", quantity="work", reduce="max")
        scene = spring(refweb.Load(node=1, force=(7.0, 0.0, 0.0)), [done], order=order, safety=share)
        errors.append(abs(refweb.run(scene).results["done"].value / (2.0 * 7.0**2 / 7e3) - 1.0))
    assert errors[-1] < 1e-4 and np.polyfit(np.log(shares), np.log(errors), 1)[0] > 3.0, errors


@pytest.mark.parametrize("order", ORDERS)
def test_far_fewer_evaluations_than_central_differences(order):
    """At 0.4 of its own bound, against central differences at 0.05 of theirs, which evaluate forces more often."""
    system = window()
    reference = exact(system, END)
    solver, run, _ = ran(system, END, order=order, safety=0.4)
    other = CentralDifference(system, safety=0.05)
    slow = other.start()
    other.advance(slow, [END])
    assert solver.spent(run)["nfev"] < other.spent(slow)["nfev"]
    assert np.abs(run.x - reference).max() < 0.3 * np.abs(slow.x - reference).max()


@pytest.mark.parametrize("order", ORDERS)
def test_coefficients(order):
    """Symmetric, consistent, and stable up to a bound below that of as many steps of central differences."""
    kicks, drifts = splitting(order)
    assert len(kicks) == len(drifts) + 1
    np.testing.assert_array_equal(kicks, kicks[::-1])
    np.testing.assert_array_equal(drifts, drifts[::-1])
    np.testing.assert_allclose([kicks.sum(), drifts.sum()], 1.0, rtol=1e-15)
    assert stability(np.array([0.5, 0.5]), np.array([1.0])) == pytest.approx(2.0, abs=2e-3)
    assert 2.0 < stability(kicks, drifts) < 2.0 * len(drifts)


@pytest.mark.parametrize("order", ORDERS)
def test_bound_of_stability(order):
    """A mass on a linear spring stays bounded below it; longer steps are refused."""
    solver = Splitting(window(), order=order)
    limit = stability(solver.kicks, solver.drifts)
    assert solver.stretch == pytest.approx(0.5 * limit)
    for share in (0.3, 0.6, 0.9, 0.99):
        q, p, largest, h = 0.0, 1.0, 0.0, share * limit
        for _ in range(2000):
            for i, kick in enumerate(solver.kicks):
                p -= kick * h * q
                if i < len(solver.drifts):
                    q += solver.drifts[i] * h * p
            largest = max(largest, abs(q))
        assert largest < 10.0  # near a resonance the ellipse that it moves on is long
    with pytest.raises(InputError, match="step_size = .* must be ≤"):
        Splitting(window(), order=order, step_size=1.01 * solver.stretch * solver.bound())


@pytest.mark.parametrize("order", ORDERS)
def test_books_close(order):
    """Energy without drift over long times; the impulse of the supports makes up for momentum to rounding."""
    system = window([refweb.Gravity(acceleration=(0.0, 1.0, -9.81))])
    solver, run, rows = ran(system, 0.2, order=order, safety=0.9)
    assert run.drift < {4: 1e-4, 6: 1e-6}[order]  # at 0.9 of the bound the fastest of its waves have some 1e-4 and 1e-6
    free = ~system.supported
    mass = system.net.mass[:, None]
    weight = (mass * (0.0, 1.0, -9.81)).sum(axis=0) * 0.2
    start = np.where(free, mass * system.initial_velocity(), 0.0).sum(axis=0)
    end = np.where(free, mass * run.v, 0.0).sum(axis=0)
    np.testing.assert_allclose(end - start, weight + run.impulse, atol=1e-11 * np.abs(run.impulse).max())


@pytest.mark.parametrize("order", ORDERS)
def test_an_impact_is_that_of_central_differences(order):
    """A ball on a slack web has kinks; both are within their stated errors."""
    ball = refweb.Body(name="ball", radius=0.1, mass=1.0, position=(0.01, 0.02, -0.105), velocity=(0.0, 0.0, 2.0))
    given = refweb.Scene(
        web=refweb.Window(mesh="square", rows=6, columns=6, side=0.2),
        cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-4, density=200.0),
        effects=[ball, refweb.Contact(stiffness=1e4)],
        solve=refweb.Dynamic(duration=0.1, method="explicit", order=order),
    )
    explicit = refweb.run(given)
    central = refweb.run(given.replace(solve=refweb.Dynamic(duration=0.1, safety=0.1)))
    assert explicit.solver["method"] == "explicit" and explicit.solver["energy_drift"] < 1e-3
    for name, one in explicit.results.items():
        other = central.results[name]
        assert abs(one.value - other.value) <= one.error + other.error, name
    assert explicit.results["deflection"].error < 1e-2 * explicit.results["deflection"].value


REFUSED = {
    "damping": refweb.Damping(time=1e-3),
    "rotating frame": refweb.Frame(angular_velocity=(0.0, 0.0, 1.0)),
    "reel": refweb.Reel(lines="all", factor=[(0, 1), (1, 0.9)]),
    "pressure": refweb.Pressure(lines="all", normal=(0, 0, 1), value=1.0),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_refused(name):
    with pytest.raises(InputError, match='method = "explicit" takes no.*use "central-difference" or "cvode"'):
        Splitting(window([REFUSED[name]]))


def test_keys():
    with pytest.raises(InputError, match="order = 5 must be 4 or 6"):
        refweb.Dynamic(duration=1.0, method="explicit", order=5)
    with pytest.raises(InputError, match='order = 4 has no meaning with method = "central-difference"'):
        refweb.Dynamic(duration=1.0, order=4)
    assert refweb.Dynamic(duration=1.0, method="explicit").order == 6


@pytest.mark.parametrize("order", ORDERS)
def test_peaks_between_steps(order):
    """A mass on a linear spring: largest displacement, speed and energy, at which no step ends, of order 4."""
    rate, errors, shares = np.sqrt(7e3), [], np.array([0.8, 0.4, 0.2])
    for share in shares:
        observe = [
            refweb.Observe(name="x", quantity="displacement", node=1, component="x", reduce="max"),
            refweb.Observe(name="v", quantity="velocity", node=1, component="x", reduce="min"),
            refweb.Observe(name="stored", quantity="strain_energy", reduce="max"),
        ]
        thrown = refweb.Velocity(node=1, value=(1.0, 0.0, 0.0))
        results = refweb.run(spring(thrown, observe, order=order, safety=share)).results
        exact = {"x": 1.0 / rate, "v": -1.0, "stored": 0.5}
        errors.append([abs(results[name].value / value - 1.0) for name, value in exact.items()])
        assert results["x"].time * rate % (2.0 * np.pi) == pytest.approx(0.5 * np.pi, abs=0.05)
    # Where in a step the peak lies changes with the step, and moves single errors: of a fit over a factor of 4.
    assert max(errors[-1]) < 1e-4 and np.polyfit(np.log(shares), np.log(np.max(errors, axis=1)), 1)[0] > 3.0
