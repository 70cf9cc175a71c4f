"""CVODE: orders against an independent method, the trapezoidal rule, linear solvers, books, corners, conduct.

What stands as exact here is DOP853 of scipy at a tolerance of 1e-12 on the forces of the same system, a closed form, or
an invariant. Errors are the largest over all unknown displacements.
"""

import inspect
import json
import pathlib
import re
import subprocess
import sys

import nets
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.sparse.linalg import splu

import refweb
from refweb.__main__ import main
from refweb.dynamics.integrators import cvode, simpson_balance, sundials
from refweb.dynamics.integrators.central_difference import CentralDifference, EnergyDriftError
from refweb.dynamics.integrators.cvode import Cvode
from refweb.dynamics.integrators.ida import Ida
from refweb.dynamics.simulation import Simulation
from refweb.effects.elasticity import Elasticity
from refweb.net import discretisation
from refweb.results.state import State
from refweb.system.system import System

MODULUS, AREA, DENSITY = 7e7, 1e-4, 200.0
SOLVERS = ("block", "sparse", "dense", "fixed-point")
END = 0.005


def cable(law="tension-only", **changes):
    return refweb.Cable(**{**dict(law=law, modulus=MODULUS, area=AREA, density=DENSITY), **changes})


def window(size=4):
    return refweb.Window(mesh="square", rows=size, columns=size, side=0.2)


def small(effects=(), order=1, consistent=False, prestrain=0.05, size=4, **changes):
    """A web whose lines are strained by 5 % and stay taut, away from every kink."""
    web = window(size).web()
    net = discretisation.build(web, cable(order=order, prestrain=prestrain, **changes), consistent=consistent)
    supported = np.zeros((len(net.points), 3), dtype=bool)
    supported[web.rim] = True
    return System(net, [Elasticity(), *effects], supported)


def thrown(system):
    """Velocities of a smooth hit [m/s]."""
    x, y, _ = system.net.points.T / 0.4
    shape = np.where(system.supported[:, 2], 0.0, np.exp(-3.0 * (x**2 + y**2)))
    return shape[:, None] * [2.0, -1.0, 5.0]


PUSH = refweb.Load(node="centre", force=(0.0, 2.0, 30.0), factor=[(0.0, 0.0), (0.002, 1.0), (0.004, -1.0)])
"""A load whose factor has a corner."""


def exact(system, v, end):
    """Unknown displacements and velocities at a time; between corners of tables, so that it never passes one."""
    free, n = system.free, len(system.free)
    mass = splu(system.pattern.matrix(system.mass.values))

    def rate(t, y):
        x, w = np.zeros((system.rows, 3)), np.zeros((system.rows, 3))
        x.ravel()[free], w.ravel()[free] = y[:n], y[n:]
        system.drive(t, x, w)
        return np.concatenate([y[n:], mass.solve(system.force(t, x, w).ravel()[free])])

    parts = *(term.timing for term in system.terms), *system.drives
    corners = sorted({t for part in parts for t in part.times if 0.0 < t < end})
    y, before = np.concatenate([np.zeros(n), v.ravel()[free]]), 0.0
    for after in (*corners, end):
        y = solve_ivp(rate, (before, after), y, "DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
        before = after
    return y[:n], y[n:]


def ran(system, ends, v=None, **options):
    """(solver, run, rows) of CVODE."""
    solver = Cvode(system, **options)
    run = solver.start(v=v)
    return solver, run, solver.advance(run, ends)


def errors(system, tolerances, **options):
    """Largest error of displacement at each tolerance."""
    v = thrown(system)
    x, _ = exact(system, v, END)
    runs = [ran(system, [END], v, rtol=rtol, **options)[1] for rtol in tolerances]
    assert State(system, END, runs[-1].x).element_strain.min() > 0.0
    return np.array([np.abs(run.x.ravel()[system.free] - x).max() for run in runs])


def slope(tolerances, found):
    return np.polyfit(np.log(tolerances), np.log(found), 1)[0]


# Error against tolerance. A method of order p keeps the error C h^(p + 1) of a step at the tolerance, and its error
# over a time is of the size h^p: the power of the tolerance is p/(p + 1), up to 1 where the order follows from the
# error. Steps change by factors of 1.5 and more or not at all, which moves a single error by as much to the power p,
# and over three decades the power by up to 0.1; orders that change move it as well, and Adams methods begin at order 1
# again at each corner of a table, with steps that are the smaller for it.
POWERS = {("bdf", 1): (0.4, 0.6), ("bdf", 2): (0.57, 0.77), ("adams", 2): (0.57, 0.77), ("adams", 12): (0.6, 1.5)}
TOLERANCES = {1: (1e-2, 1e-3, 1e-4), 2: (1e-3, 1e-4, 1e-5, 1e-6), 12: (1e-5, 1e-6, 1e-7, 1e-8, 1e-9)}
CASES = [("bdf", 1, "dense", 1, False)]
CASES += [(*pair, linear, 1, False) for pair in (("bdf", 2), ("adams", 2), ("adams", 12)) for linear in SOLVERS]
CASES += [("bdf", 2, "block", 2, True), ("bdf", 2, "dense", 3, False), ("adams", 2, "fixed-point", 2, True)]
CASES += [("adams", 12, "block", order, mass) for order in (1, 2, 3) for mass in (False, True) if order > 1 or mass]
CASES += [("adams", 12, "dense", 3, True), ("adams", 12, "sparse", 2, False)]


@pytest.mark.ordinary("bdf-1-dense-1-False", "adams-12-fixed-point-1-False")
@pytest.mark.parametrize("family, highest, linear_solver, order, consistent", nets.some(CASES, 3))
def test_error_falls_with_the_tolerance(family, highest, linear_solver, order, consistent):
    system, tolerances = small([PUSH], order=order, consistent=consistent, size=3), TOLERANCES[highest]
    found = errors(system, tolerances, family=family, max_order=highest, linear_solver=linear_solver)
    low, high = POWERS[family, highest]
    assert low < slope(tolerances, found) < high


@pytest.mark.parametrize("law", ["smooth", "tension-only"])
def test_lines_that_go_slack(law):
    """A slack web that is thrown: lines push by the smooth law's floor, or snap taut at kinks.

    Errors fall with the tolerance by less than where nothing is slack: a kink costs the step it lies in its order.
    Where lines push the matrix is not definite, and the block elimination drops what is negative.
    """
    changes = dict(prestrain=-0.002, law=law) | (dict(smoothing=1e-3) if law == "smooth" else {})
    system = small(size=3, **changes)
    v = thrown(system)
    x, _ = exact(system, v, END)
    slack = State(system, END, np.zeros((system.rows, 3))).slack
    assert slack.all() and not State(system, END, rows_of(system, x)).slack.all()
    for linear_solver in ("block", "dense"):
        found = []
        for rtol in (1e-4, 1e-6, 1e-8):
            run = ran(system, [END], v, rtol=rtol, family="adams", linear_solver=linear_solver)[1]
            found.append(np.abs(run.x.ravel()[system.free] - x).max())
        assert found[2] < found[1] < found[0] and found[2] < 1e-6 * np.abs(x).max()


def rows_of(system, unknowns):
    x = np.zeros((system.rows, 3))
    x.ravel()[system.free] = unknowns
    return x


# The steps themselves


class Noted(Cvode):
    """Notes time, displacement and velocity at the end of each step."""

    def begin(self, t, x, v):
        super().begin(t, x, v)
        self.steps = [(t, x, v)]

    def step(self, stop, end):
        t = super().step(stop, end)
        self.steps.append((t, *self.interpolated(t)))
        return t


def between(system, family):
    """What each step leaves of x₁ − x₀ = ½h (v₀ + v₁) and of v₁ − v₀ = ½h (a₀ + a₁), over the tolerance."""
    solver = Noted(system, rtol=1e-6, family=family, max_order=2, linear_solver="dense")
    solver.advance(solver.start(v=thrown(system)), [END])
    mass, left = np.repeat(system.net.mass, 3)[system.free], []
    for (t, x, v), (s, y, w) in zip(solver.steps[:-1], solver.steps[1:], strict=True):
        slopes = [system.force(0.0, rows_of(system, z)).ravel()[system.free] / mass for z in (x, y)]
        moved = y - x - 0.5 * (s - t) * (v + w), w - v - 0.5 * (s - t) * sum(slopes)
        scale = 1e-6 * np.abs(y) + solver.atol_position, 1e-6 * np.abs(w) + solver.atol_velocity
        left.append([np.sqrt(np.mean((a / b) ** 2)) for a, b in zip(moved, scale, strict=True)])
    return np.array(left)


def test_adams_of_order_two_is_the_trapezoidal_rule():
    """Every step but the first few, of order 1, to what CVODE lets corrector iterations leave, 0.1 of the tolerance.

    BDF of order 2 leaves the size of its own error, which the tolerance itself bounds.
    """
    adams, bdf = between(small(size=3), "adams"), between(small(size=3), "bdf")
    assert len(adams) > 100 and adams[10:].max() < 0.1
    assert np.median(bdf[10:].max(axis=1)) > 100.0 * adams[10:].max()


def test_trapezoidal_rule_on_an_oscillator():
    """It turns the phase by 2 atan(½ωh) in each step and keeps the energy, to the rounding of a linear equation."""
    web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]]).web()
    net = discretisation.build(web, cable(law="linear"))
    supported = np.array([[True] * 3, [False, True, True]])
    system = System(net, [Elasticity()], supported)
    rate = np.sqrt(MODULUS * AREA / net.mass[1])
    solver = Noted(system, rtol=1e-6, family="adams", max_order=2, linear_solver="dense")
    run = solver.start(v=np.array([[0.0, 0, 0], [1.0, 0, 0]]))
    solver.advance(run, [20.0 / rate])
    times, x, v = (np.array([step[k] for step in solver.steps[10:]]).reshape(-1) for k in range(3))
    turned = np.exp(-2j * np.arctan(0.5 * rate * np.diff(times)).cumsum())
    found = rate * x + 1j * v
    assert len(times) > 100
    np.testing.assert_allclose(found[1:] / found[0], turned, rtol=0, atol=1e-11)


# Linear algebra


def at_a_state(system, linear_solver, t=0.0):
    """(solver, y, J) at a state off equilibrium; J from the tangent by plain dense algebra."""
    solver = Cvode(system, linear_solver=linear_solver)
    solver.start()
    rng, n = np.random.default_rng(1), len(system.free)
    y = np.concatenate([1e-3 * rng.standard_normal(n), rng.standard_normal(n)])
    x, v = solver.state(t, y[:n], y[n:])
    K, mass = system.pattern.matrix(system.stiffness(t, x, v)), system.pattern.matrix(system.mass.values).toarray()
    C = system.damping(t, x, v)
    C = np.zeros((n, n)) if C is None else system.pattern.matrix(C).toarray()
    below = np.linalg.solve(mass, np.hstack([-K.toarray(), -C]))
    return solver, y, np.vstack([np.hstack([np.zeros((n, n)), np.eye(n)]), below])


def damped(system):
    """The system with a symmetric matrix of damping."""
    values = np.random.default_rng(2).random(len(system.pattern.indices))
    matrix = system.pattern.matrix(values)
    matrix = (matrix + matrix.T).tocsc()
    matrix.sort_indices()
    system.damping = lambda t, x, v, blocks=None: matrix.data
    return system


@pytest.mark.parametrize("lossy", [False, True])
@pytest.mark.parametrize("order, consistent", [(1, False), (1, True), (2, True), (3, False)])
def test_every_linear_solver_inverts_the_same_matrix(order, consistent, lossy):
    """I − γJ, at γ of steps from far below to far above the explicit limit, to the condition of the matrix."""
    system = small(order=order, consistent=consistent, size=3)
    system = damped(system) if lossy else system
    n, rng = len(system.free), np.random.default_rng(3)
    for name in ("block", "dense") if consistent else ("block", "dense", "sparse"):
        solver, y, J = at_a_state(system, name)
        scale = np.repeat([1e-3, 1.0], n)  # of displacements and velocities
        if name == "block":
            for gamma in (1e-7, 1e-5, 1e-3):
                new, r, z = [None], scale * rng.standard_normal(2 * n), np.empty(2 * n)
                solver.set_up(0.0, y, None, False, new, gamma)
                solver.precondition(0.0, y, None, r, z, gamma, 0.0, 1)
                expected = np.linalg.solve(np.eye(2 * n) - gamma * J, r)
                np.testing.assert_allclose(z / scale, expected / scale, rtol=0, atol=1e-9 * np.abs(z / scale).max())
                assert new == [1]
            product = np.empty(2 * n)
            solver.precondition(0.0, y, None, r, z, 2.0 * gamma, 0.0, 1)  # γ has changed since the set-up
            solver.jacobian_times(0.0, y, None, r, product)
            found = product
            expected = J @ r
        elif name == "dense":
            found = np.empty((2 * n, 2 * n))
            solver.jacobian(0.0, y, None, found)
            expected = J
        else:
            pattern = solver.linear_options()["sparsity"]
            solver.jacobian(0.0, y, None, pattern.data)
            found, expected = pattern.toarray(), J
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("consistent", [False, True])
def test_the_jacobian_is_that_of_the_right_side(consistent):
    """What f(y + hu) − f(y) − hJu leaves falls with h², in a net of curved elements."""
    system = small(order=2, consistent=consistent, size=3)
    solver, y, J = at_a_state(system, "block")
    n, rng = len(system.free), np.random.default_rng(4)
    u = rng.standard_normal(2 * n) * np.repeat([1e-3, 1.0], n)
    steps, left = np.array([1e-1, 3e-2, 1e-2, 3e-3]), []
    before, after = np.empty(2 * n), np.empty(2 * n)
    solver.right_side(0.0, y, before)
    for h in steps:
        solver.right_side(0.0, y + h * u, after)
        left.append(np.abs(after - before - h * (J @ u)).max())
    # The next term of the remainder is of the relative size h.
    assert abs(slope(steps, left) - 2.0) < 0.05


def test_what_is_chosen():
    """Small nets are dense; large ones factorize only where steps are long, which costs nothing in accuracy."""
    assert small(size=3).free.size <= sundials.DENSE < small(size=8).free.size
    solver = Cvode(small(size=3))
    assert solver.linear_solver == "dense" and solver.choice.startswith("dense, for 12 unknowns, at most")
    system = small(size=8)
    v = thrown(system)
    x, _ = exact(system, v, END)
    runs = {name: ran(system, [END], v, rtol=1e-7, linear_solver=name) for name in ("auto", "block", "fixed-point")}
    assert "γω ≤" in runs["auto"][0].choice and "as asked for" in runs["block"][0].choice
    factorized = {name: solver.stats["nlu"] for name, (solver, _, _) in runs.items()}
    assert factorized["auto"] < 0.1 * factorized["block"] and factorized["fixed-point"] == 0
    off = {name: np.abs(run.x.ravel()[system.free] - x).max() for name, (_, run, _) in runs.items()}
    assert off["auto"] < 3.0 * off["block"] and off["auto"] < 1e-4 * np.abs(x).max()


def test_long_steps_are_factorized():
    """A web that a slow load moves: stiff lines would hold corrector iterations to steps of the explicit limit."""
    pull = refweb.Load(node="centre", force=(0.0, 0.0, 50.0), factor=[(0.0, 0.0), (1.0, 1.0)])
    system = small([pull], size=8)
    solver, run, _ = ran(system, [1.0], rtol=1e-3)
    limit = CentralDifference(small([pull], size=8)).bound()
    assert run.nsteps < 0.02 * 1.0 / limit and solver.stats["nlu"] > 0
    assert solver.stats["nfev"] < 3 * run.nsteps


def test_a_first_contact_asks_for_no_matrix():
    """A web at rest that a ball meets within a long step, beside a run that factorizes each step."""
    ball = refweb.Body(name="ball", radius=0.1, mass=1.0, position=(0.01, 0.02, -0.11), velocity=(0.0, 0.0, 2.0))
    ends, runs = [0.02], {}
    for name in ("auto", "block"):
        system = small([ball, refweb.Contact(stiffness=1e4)], size=8)
        runs[name] = ran(system, ends, rtol=1e-6, linear_solver=name)
    (solver, run, _), (other, beside, _) = runs["auto"], runs["block"]
    assert solver.stats["nlu"] == 0 < other.stats["nlu"]
    assert solver.stats["nfev"] < 1.2 * other.stats["nfev"]
    way = np.abs(beside.x[:-1]).max()
    assert way > 1e-3 and np.abs(run.x - beside.x)[:-1].max() < 1e-3 * way  # each is off by (1e-6)^(2/3) for 1e-4


def test_a_web_that_begins_to_move_by_itself_keeps_its_long_steps(monkeypatch):
    """A flat web without tension, whose forces grow from zero with the depth of a heavy node, is no first contact."""
    node, counts = refweb.PointMass(node="centre", mass=1.0), []
    system = small([node], size=20, prestrain=0.0)
    v = np.zeros((system.rows, 3))
    v[system.net.mass > 0.5] = [0.0, 0.0, 1.0]
    for attempts in (cvode.ATTEMPTS, 0):
        monkeypatch.setattr(cvode, "ATTEMPTS", attempts)
        counts.append(ran(system, [0.02], v, rtol=3e-4)[0].stats)
    assert counts[0] == counts[1] and counts[0]["nlu"] > 0


# Books

GRAVITY = (0.5, 0.0, -9.81)
MOTION = [(0.0, 0.0, 0.0, 0.0), (0.0051, 0.0, 0.0, 0.01), (0.0113, 0.002, 0.0, -0.01)]
FORCE, FACTOR = np.array([0.0, 1.0, 20.0]), [(0.0, 1.0), (0.008, 2.0), (0.012, -1.0)]


def scene(effects, duration=0.02, interval=1e-3, frames=5, error="none", **changes):
    """A web under prestress by CVODE; what is no field of a scene is a key of [solve]."""
    fields = ("web", "cable", "support", "supports", "observe", "event", "title")
    given = {key: changes.pop(key) for key in fields if key in changes}
    solve = refweb.Dynamic(**{"method": "cvode", "family": "adams", "duration": duration, **changes})
    return refweb.Scene(
        **{"web": window(), "cable": cable(prestrain=0.01), **given},
        effects=effects,
        solve=solve,
        output=refweb.Output(interval=interval, frames=frames),
        accuracy=refweb.Accuracy(error=error),
    )


def ball(stiffness=1e5, **changes):
    given = dict(name="ball", radius=0.1, mass=1.0, position=(0.01, 0.02, -0.105), velocity=(0.0, 0.5, 1.0))
    return refweb.Body(**{**given, **changes}), refweb.Contact(stiffness=stiffness)


def everything():
    """Gravity, a load with a table, prescribed motion with a corner, a ball."""
    return [
        refweb.Gravity(acceleration=GRAVITY),
        refweb.Load(node="centre", force=FORCE, factor=FACTOR),
        refweb.Motion(node=0, displacement=MOTION),
        *ball(),
    ]


def pushed(times):
    """Integral of the load's factor up to each time [s]."""
    knots, values = np.transpose([*FACTOR, (1.0, FACTOR[-1][1])])
    fine = np.linspace(0.0, times[-1], 20001)  # a trapezium of a broken line errs at its corners only, by 1e-9 s
    factor = np.interp(fine, knots, values)
    whole = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(fine) * (factor[1:] + factor[:-1]))])
    return np.interp(times, fine, whole)


@pytest.mark.slow
@pytest.mark.parametrize(
    "family, mass", nets.some([("bdf", "lumped"), ("adams", "lumped"), ("adams", "consistent")], 2)
)
def test_books_close_to_the_tolerance(family, mass):
    """Energy less work, and momentum less impulses, with all that puts something into either.

    Both are integrals of what the run itself is made of, so that they err as it does; momentum is linear in it, and
    its book is the sum of the equations of motion: it closes better than the motion itself.
    """
    drifts, defects, tolerances = [], [], (1e-4, 1e-5, 1e-6) if family == "bdf" else (1e-4, 1e-5, 1e-6, 1e-7)
    for rtol in tolerances:
        pushed_by = refweb.Observe(name="push", quantity="reaction", body="ball", reduce="max")
        solution = refweb.run(scene(everything(), family=family, mass=mass, rtol=rtol, observe=[pushed_by]))
        history, net = solution.history, solution.state.system.net
        assert [finding.text for finding in solution.findings if finding.code != "soft-contact"] == []
        times, weight = history["time"], net.mass.sum() * np.array(GRAVITY)
        given = np.outer(times, weight) + np.outer(pushed(times), FORCE)
        book = [history[f"momentum_{k}"] - history[f"support_impulse_{k}"] for k in "xyz"] - given.T
        defects.append(np.abs(book - book[:, :1]).max())
        drifts.append(solution.solver["energy_drift"])
    assert np.abs(history["work"]).max() > 0.05 and solution.results["push"].value > 10.0
    assert np.abs(history["support_impulse_z"]).max() > 0.1
    # By the powers of the tolerance above; contact and corners cost orders.
    assert slope(tolerances, drifts) > 0.5 and slope(tolerances, defects) > 0.5
    # A thousand steps, each within the tolerance, sum to some ten times that.
    assert drifts[-1] < 50.0 * tolerances[-1] and defects[-1] < 50.0 * tolerances[-1]


def test_work_of_motion_is_force_times_way():
    """Of a support that moves a mass on a massless line by given speeds: the energy that the mass has in the end.

    Closed form: the stretch of the line turns with ω between the corners, and each corner changes its speed.
    """
    web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]]).web()
    table = [(0.0, 0.0, 0.0, 0.0), (0.013, -0.02, 0.0, 0.0), (0.021, 0.01, 0.0, 0.0), (0.03, 0.01, 0.0, 0.0)]
    net = discretisation.build(web, cable(law="linear", density=0.0))
    effects = [Elasticity(), refweb.PointMass(node=1, mass=0.5), refweb.Motion(node=0, displacement=table)]
    system = System(net, effects, np.array([[True] * 3, [False, True, True]]))
    rate = np.sqrt(MODULUS * AREA / 0.5)
    stretch, speed = 0.0, 0.0  # of the line, and of the mass
    for (t, x, *_), (s, y, *_) in zip(table[:-1], table[1:], strict=True):
        own = (y - x) / (s - t)
        a, b = stretch, (speed - own) / rate
        c, d = np.cos(rate * (s - t)), np.sin(rate * (s - t))
        stretch, speed = a * c + b * d, own + rate * (b * c - a * d)
    energy = 0.25 * speed**2 + 0.5 * MODULUS * AREA * stretch**2
    found = []
    for rtol in (1e-4, 1e-6, 1e-8):
        run = ran(system, [0.03], rtol=rtol, family="adams")[1]
        found.append(abs(run.work[-1] - energy))
    assert energy > 1.0 and found[2] < found[1] < found[0] and found[2] < 1e-6 * energy


@pytest.mark.slow
def test_consistent_mass_passes_a_motion_on():
    """A support that moves a line of one element by given speeds: work, and the speed of its free end.

    Closed form: with m the mass of the line, its stretch turns with ω² = 3 EA/(mL) between the corners, and at a corner
    the free end jumps by −½ of what the support does, as (m/3) Δv + (m/6) Δw = 0.
    """
    web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]]).web()
    table = [(0.0, 0.0, 0.0, 0.0), (0.0013, -0.002, 0.0, 0.0), (0.0021, 0.001, 0.0, 0.0), (0.003, 0.001, 0.0, 0.0)]
    net = discretisation.build(web, cable(law="linear"), consistent=True)
    system = System(
        net, [Elasticity(), refweb.Motion(node=0, displacement=table)], np.array([[True] * 3, [False, True, True]])
    )
    mass, stiff = DENSITY * AREA, MODULUS * AREA
    rate, stretch, speed, own = np.sqrt(3.0 * stiff / mass), 0.0, 0.0, None
    for (t, x, *_), (s, y, *_) in zip(table[:-1], table[1:], strict=True):
        before, own = own, (y - x) / (s - t)
        speed -= 0.0 if before is None else 0.5 * (own - before)  # the velocity given at t = 0 is that behind the first
        a, b = stretch, (speed - own) / rate
        c, d = np.cos(rate * (s - t)), np.sin(rate * (s - t))
        stretch, speed = a * c + b * d, own + rate * (b * c - a * d)
    first = (table[1][1] - table[0][1]) / table[1][0]
    speed += 0.5 * own  # the end of the table is a corner, behind which the support rests
    energy = mass * speed**2 / 6.0 + 0.5 * stiff * stretch**2
    work = energy - mass * first**2 / 6.0
    for method in ("cvode", "ida"):
        found = []
        for rtol in (1e-5, 1e-7, 1e-9):
            solver = Cvode(system, rtol=rtol, family="adams") if method == "cvode" else Ida(system, rtol=rtol)
            run = solver.start()
            solver.advance(run, np.linspace(0.0, 0.003, 11))
            found.append([abs(run.v[1, 0] - speed), abs(run.work[-1] - work)])
        assert (np.diff(found, axis=0) < 0.0).all()
        assert (found[-1] < np.array([1e-5 * abs(speed), 1e-5 * energy])).all(), (method, found, speed, work)


@pytest.mark.parametrize("mass", ["lumped", "consistent"])
def test_reactions_change_the_momentum_of_the_whole_web(mass):
    """d/dt ΣMv over all rows by differences of rows is what the supports give, and what frames show of it."""
    reaction = refweb.Observe(name="r", quantity="reaction", component="z")
    solution = refweb.run(
        scene(
            [refweb.Velocity(node="centre", value=(0, 0, 1.0))],
            web=refweb.SingleCable(start=(0, 0, 0), end=(1, 0, 0), elements=4),
            duration=0.004,
            interval=1e-5,
            frames=1,
            rtol=1e-9,
            mass=mass,
            observe=[reaction],
        )
    )
    system, times = solution.state.system, solution.history["time"]
    momentum = np.array([system.mass.momentum(state.v).sum(axis=0)[2] for _, state in solution.frames])
    force = solution.history["r"]
    # Central differences of rows err by Δt²/6 of a third derivative, (3e3/s · 1e-5 s)²/6 = 2e-4.
    np.testing.assert_allclose(np.gradient(momentum, times)[1:-1], force[1:-1], atol=1e-3 * np.abs(force).max())
    shown = [state.reaction[:, 2].sum() for _, state in solution.frames]
    np.testing.assert_allclose(shown, force, atol=1e-9 * np.abs(force).max())


@pytest.mark.parametrize("method", ["cvode", "ida"])
def test_a_body_far_away_asks_for_no_short_steps(method):
    """It falls for 10 s, to 98 m/s and 490 m: in steps of a fifth of its thickness that would be 25 000 and more."""
    far = refweb.Body(name="far", radius=0.1, mass=1.0, position=(0.0, 0.0, -1.0))
    place = refweb.Observe(name="z", quantity="position", body="far", component="z")
    falling = [far, refweb.Contact(stiffness=1e4), refweb.Gravity(acceleration=(0.0, 0.0, -9.81))]
    changes = dict(family=None) if method == "ida" else {}
    stiff = cable(prestrain=0.01, law="linear")
    held = refweb.Supports(nodes=["all"])
    free = scene(falling, 10.0, 1.0, cable=stiff, support=[held], observe=[place], method=method, rtol=1e-6, **changes)
    solution = refweb.run(free)
    assert solution.solver["nsteps"] < 1000
    assert abs(solution.results["z"].value + 1.0 + 0.5 * 9.81 * 100.0) < 1e-4 * 490.0


def drift_at(rtol):
    return refweb.run(scene(ball(), rtol=rtol)).solver["energy_drift"]


def test_an_open_book_is_repeated_with_a_tenth_of_the_tolerance(tmp_path, monkeypatch):
    """With a limit between the drifts at 1e-4 and 1e-5 the run that counts is the second one."""
    drifts = drift_at(1e-4), drift_at(1e-5)
    assert drifts[1] < 0.7 * drifts[0]
    expected = refweb.run(scene(ball(), rtol=1e-5))
    monkeypatch.setattr(simpson_balance, "DRIFT", np.sqrt(drifts[0] * drifts[1]))
    kept, written = refweb.run(scene(ball(), rtol=1e-4)), refweb.run(scene(ball(), rtol=1e-4), out=tmp_path / "out")
    for solution in (kept, written):
        assert solution.results == expected.results and solution.solver == expected.solver
        (warning,) = solution.warnings
        assert "energy drift" in warning and warning.endswith("repeated with rtol = 1e-05")
        np.testing.assert_array_equal(solution.history["time"], expected.history["time"])
        np.testing.assert_array_equal(solution.history["deflection"], expected.history["deflection"])


@pytest.mark.parametrize("linear_solver", SOLVERS)
def test_a_corrupted_book_is_never_returned(tmp_path, monkeypatch, linear_solver):
    """Forces that push along every motion put energy in whatever the tolerance: it is repeated twice, and fails."""
    own = Cvode.right_side

    def corrupted(self, t, y, yp):
        own(self, t, y, yp)
        yp[self.unknowns :] += 5.0 * y[self.unknowns :]

    monkeypatch.setattr(Cvode, "right_side", corrupted)
    with pytest.raises(EnergyDriftError, match="energy drift .* limit 0.01: use a smaller rtol than 1e-06"):
        refweb.run(scene(ball(), rtol=1e-4, linear_solver=linear_solver), out=tmp_path / "out")
    summary = json.loads((tmp_path / "out" / "run.json").read_text(encoding="utf-8"))
    assert summary["status"] == "failed" and summary["results"] == {}
    again = [text.rpartition("; ")[2] for text in summary["warnings"]]
    assert again == ["repeated with rtol = 1e-05", "repeated with rtol = 1e-06"]


# Corners and bodies that no step passes


def drifting(effects):
    """Two nodes of 2 kg on a massless line so slack that it never acts."""
    web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], natural_length=100.0).web()
    net = discretisation.build(web, cable(density=0.0))
    return System(net, [Elasticity(), refweb.PointMass(node="all", mass=2.0), *effects], np.zeros((2, 3), dtype=bool))


@pytest.mark.parametrize("family", ["bdf", "adams"])
@pytest.mark.parametrize("width", [1e-3, 1e-6, 1e-9])
def test_a_short_pulse_is_felt(family, width):
    """A triangle of force at 0.3 s, 1e-3 to 1e-9 of the steps around it: v = ½Fw/m, x = v (t − 0.3 s)."""
    force, at, end = np.array([2.0, -1.0, 3.0]) / width, 0.3, 1.0
    quiet = [(0.0, 0.0), (at - 0.5 * width, 0.0)]
    pulse = refweb.Load(node=1, force=force, factor=[*quiet, (at, 1.0), (at + 0.5 * width, 0.0)])
    solver = Noted(drifting([pulse]), rtol=1e-8, family=family)
    run = solver.start()
    solver.advance(run, [end])
    steps = np.diff([t for t, _, _ in solver.steps])
    assert steps.max() > 30.0 * width
    expected = 0.5 * force * width / 2.0
    # The start and the end of the pulse are 1e-16 s off, by which a force of 1e9 N is.
    np.testing.assert_allclose(run.v[1], expected, rtol=1e-6)
    np.testing.assert_allclose(run.x[1], expected * (end - at), rtol=1e-6)
    assert not run.v[0].any()


@pytest.mark.parametrize("family", ["bdf", "adams"])
@pytest.mark.parametrize("speed", [1.0, 1e3])
def test_a_body_does_not_pass_between_two_steps(family, speed):
    """A ball flies past a line that is held at both ends, near enough to be pushed aside by ∫ k (R − d) b/d dt.

    With the distance b of its way from the line, s = √(R² − b²), that is k b/v (2 R asinh(s/b) − 2 s) while it is
    hardly turned. A step that is bounded by the error alone would be as long as the whole flight.
    """
    radius, off, mass, stiffness = 0.01, 0.004, 1e-3, 1e-3 * speed**2
    web = refweb.Inline(points=[[0, -1, 0], [0, 1, 0]], lines=[[0, 1]], supports=[0, 1])
    hit = refweb.Body(name="ball", radius=radius, mass=mass, position=(-1.0, 0.0, off), velocity=(speed, 0.0, 0.0))
    system = scene([hit, refweb.Contact(stiffness=stiffness)], web=web, cable=cable(), duration=2.0 / speed).build()
    _, run, _ = ran(system, [2.0 / speed], rtol=1e-9, family=family)
    reach = np.sqrt(radius**2 - off**2)
    aside = stiffness * off / speed * (2.0 * radius * np.arcsinh(reach / off) - 2.0 * reach) / mass
    # It is turned by `aside`/speed, and the push changes with that by as much over b/R.
    assert 1e-6 < aside / speed < 1e-4
    np.testing.assert_allclose(run.v[-1, 2], aside, rtol=1e-3)
    np.testing.assert_allclose(run.v[-1, 0], speed, rtol=1e-6)


# Rows


def test_rows_change_nothing():
    """The same motion bit for bit whatever the rows after the first, and however many are asked for at once."""
    system = scene(everything()).build()
    simulation = Simulation(scene(everything()), system, refweb.Solution(scene(everything())))
    times = np.linspace(0.0, 0.02, 21)
    solver = simulation.integrator_at(1e-6)
    run = solver.start()
    rows = solver.advance(run, times).values
    for sizes in ([1] * 21, [1, 2, 7, 11]):
        other = simulation.integrator_at(1e-6)
        again = other.start()
        parts = [other.advance(again, part).values for part in np.split(times, np.cumsum(sizes)[:-1])]
        np.testing.assert_array_equal(np.vstack(parts), rows)
        assert (again.nsteps, again.drift) == (run.nsteps, run.drift)
        np.testing.assert_array_equal(again.extremes.values, run.extremes.values)
    coarse = simulation.integrator_at(1e-6)
    end = coarse.start()
    coarse.advance(end, [0.0, times[1], 0.02])
    assert end.nsteps == run.nsteps
    np.testing.assert_array_equal(end.x, run.x)
    np.testing.assert_array_equal(end.v, run.v)


def test_equilibrium_is_a_fixed_point():
    """Under its weight and a load, slack parts included: what moves is what statics has left, and stays as small."""
    effects = [refweb.Gravity(acceleration=(0.0, 0.0, -9.81)), refweb.Load(node="centre", force=(0.0, 0.0, -5.0))]
    for family in ("bdf", "adams"):
        solution = refweb.run(scene(effects, duration=0.1, interval=0.01, frames=1, start="equilibrium", family=family))
        (_, first), *others = solution.frames
        assert np.abs(first.x[:, 2]).max() > 1e-3
        moved = max(np.abs(state.x - first.x).max() for _, state in others)
        # Statics stops at forces of 1e-9 of the load, of which the web gives way by as much as of its sag.
        assert moved < 1e-9 * np.abs(first.x).max()


# Conduct


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty folder to work in; ``any.toml`` is whatever scene is given."""
    monkeypatch.chdir(tmp_path)

    def command(given):
        monkeypatch.setattr(refweb.Scene, "load", lambda source: given)
        status = main(["run", "any.toml", "--out", "out"])
        return status, json.loads((tmp_path / "out" / "run.json").read_text(encoding="utf-8"))

    return command


def failing(monkeypatch, error, after=300, name="right_side"):
    """Make a callback raise an error at one of its calls."""
    own, calls = getattr(Cvode, name), []

    def called(self, *arguments):
        calls.append(1)
        if len(calls) > after:
            raise error
        return own(self, *arguments)

    # sksundae counts the arguments of its callbacks.
    names = ", ".join("abcdefgh"[: len(inspect.signature(own).parameters) - 1])
    monkeypatch.setattr(Cvode, name, eval(f"lambda self, {names}: called(self, {names})", {"called": called}))


@pytest.mark.parametrize("linear_solver", SOLVERS)
def test_interrupted_in_a_callback(here, tmp_path, monkeypatch, capsys, linear_solver):
    """Ctrl-C while SUNDIALS is at work: status 130, and what was written before it stands."""
    failing(monkeypatch, KeyboardInterrupt())
    status, summary = here(scene(everything(), linear_solver=linear_solver, frames=2))
    assert status == 130 and "interrupted" in capsys.readouterr().err
    history = np.loadtxt(tmp_path / "out" / "history.csv", delimiter=",", skiprows=1, ndmin=2)
    assert summary["status"] == "interrupted"
    assert summary["message"] == f"interrupted after t = {history[-1, 0]:.6g} s"
    assert 2 < len(history) < 21 and summary["solver"]["nfev"] == 300
    assert len(list((tmp_path / "out" / "frames").glob("web_*.vtu"))) == (len(history) + 1) // 2


CALLBACKS = [("dense", "jacobian"), ("sparse", "jacobian"), ("block", "set_up")]
CALLBACKS += [("block", "precondition"), ("block", "jacobian_times"), *((name, "right_side") for name in SOLVERS)]


@pytest.mark.parametrize("linear_solver, name", CALLBACKS)
def test_an_error_in_a_callback_reaches_the_user(here, monkeypatch, capsys, linear_solver, name):
    failing(monkeypatch, ZeroDivisionError("a fault"), 3, name)
    with pytest.raises(ZeroDivisionError, match="a fault"):
        ran(small(size=3), [END], thrown(small(size=3)), linear_solver=linear_solver)
    status, summary = here(scene(everything(), linear_solver=linear_solver))
    err = capsys.readouterr().err
    assert status == 1 and summary["status"] == "failed" and summary["message"] == "ZeroDivisionError: a fault"
    assert err.startswith("refweb: internal error, ZeroDivisionError: a fault") and err.count("\n") == 1


@pytest.mark.slow
def test_a_run_may_end_before_it_has_begun(tmp_path):
    """The memory of SuperLU_MT is freed in good order where nothing has been factorized: the process lives on."""
    code = """
import gc, sys
sys.path += [{here!r}, {tests!r}]
import test_cvode
from refweb.dynamics.integrators.cvode import Cvode
def fault(self, t, y, yp):
    raise ZeroDivisionError
own, Cvode.right_side = Cvode.right_side, fault
for _ in range(20):
    solver = Cvode(test_cvode.small(size=3), linear_solver="sparse")
    try:
        solver.advance(solver.start(), [1.0])
    except ZeroDivisionError:
        pass
    del solver
    gc.collect()
Cvode.right_side = own
test_cvode.ran(test_cvode.small(size=3), [1e-3], linear_solver="sparse")
print("alive")
"""
    here = pathlib.Path(__file__).parent
    code = code.format(here=str(here), tests=str(here.parents[1]))
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0 and done.stdout == "alive\n" and done.stderr == ""


@pytest.mark.ordinary("block", "sparse", "fixed-point")
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("linear_solver", SOLVERS)
def test_a_good_run_says_nothing(capfd, linear_solver):
    """Neither does sksundae, which warns of the pattern that a sparse Jacobian comes with."""
    ran(small(size=3), [END], thrown(small(size=3)), linear_solver=linear_solver)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("linear_solver", ["", *SOLVERS])
def test_what_sundials_says_is_in_the_message(capfd, monkeypatch, linear_solver):
    """With the time, the step size and the node that is moved most; on neither stream."""
    own, options, meaning = Cvode.right_side, {"rtol": 1e-18}, "too much accuracy requested"

    noise = np.random.default_rng(0)

    def broken(self, t, y, yp):
        own(self, t, y, yp)
        yp[-1] += 1e20 * noise.normal() if self.stats["nfev"] > 100 else 0.0

    if linear_solver:
        monkeypatch.setattr(Cvode, "right_side", broken)
        options, meaning = {"linear_solver": linear_solver}, "corrector convergence test failed repeatedly"
    with pytest.raises(refweb.SolverError) as caught:
        ran(small(size=3), [END], thrown(small(size=3)), **options)
    message = str(caught.value)
    found = re.match(r"cvode stopped at t = (\S+) s with steps of (\S+) s: ", message)
    assert found and meaning in message and "\n" not in message and "[" not in message
    assert re.search(r"at node \d+: raise rtol = \S+, or lower the stiffness", message)
    assert capfd.readouterr() == ("", "")


def test_a_run_that_would_not_end(monkeypatch):
    """Noise in the forces holds the steps to where it does not show: that is said instead of taking 1e8 of them."""
    own, noise = Cvode.right_side, np.random.default_rng(0)

    def noisy(self, t, y, yp):
        own(self, t, y, yp)
        yp[-1] += 1e10 * noise.normal()

    monkeypatch.setattr(Cvode, "right_side", noisy)
    with pytest.raises(refweb.SolverError, match="more than 1e[+]08 to the next row: raise rtol = 1e-06, or lower"):
        ran(small(size=3), [END], thrown(small(size=3)))


NAMED = [*((Cvode, name) for name in SOLVERS), *((Ida, name) for name in ("block", "sparse", "dense"))]


@pytest.mark.ordinary("Cvode-sparse", "*-block", "*-dense", "*-fixed-point")
@pytest.mark.parametrize("method, linear_solver", NAMED)
def test_a_number_that_is_not_finite_is_named(capfd, monkeypatch, method, linear_solver):
    """Where the forces on a node have no value from some time on, no step is taken over it."""
    own, system = System.forces, small(size=3)
    (node, *_), from_now = np.flatnonzero(~system.supported.all(axis=1))[::-1], 0.3 * END

    def forces(self, t, x, v=None, per_cell=None):
        found = own(self, t, x, v, per_cell)
        found.force[node] += np.nan if t > from_now else 0.0
        return found

    monkeypatch.setattr(System, "forces", forces)
    solver = method(system, linear_solver=linear_solver)
    run = solver.start(v=thrown(system))
    with pytest.raises(refweb.SolverError) as caught:
        solver.advance(run, [END])
    found = re.fullmatch(r"number not finite at node (\d+), t = (\S+) s: use a smaller rtol", str(caught.value))
    assert int(found[1]) == node and run.time <= from_now < float(found[2]) * (1.0 + 1e-5)
    assert np.isfinite(run.x).all()
    assert capfd.readouterr() == ("", "")


# What is refused


def test_a_node_without_mass():
    system = small(density=0.0)
    bare = np.flatnonzero(~system.supported.all(axis=1))[0]
    with pytest.raises(refweb.InputError) as caught:
        Cvode(system)
    assert str(caught.value) == (
        f'node {bare} has no mass, which cvode needs: give density > 0 or a [[point_mass]], or use method = "ida"'
    )
    Cvode(small([refweb.PointMass(node="all", mass=1.0)], density=0.0))


def test_consistent_mass_has_no_sparse_jacobian():
    with pytest.raises(refweb.InputError, match='"sparse" must be "block" or "dense" with mass = "consistent"'):
        Cvode(small(consistent=True), linear_solver="sparse")


@pytest.mark.ordinary("cvode")
@pytest.mark.parametrize("method", ["cvode", "ida"])
def test_peaks_between_steps(method):
    """A mass on a spring, thrown along it: v/ω and t = π/2ω; the solver looks at it every 5 ms."""
    omega, speed = 20.0, 0.3
    scene = refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0]),
        cable=refweb.Cable(law="linear", modulus=omega**2, area=1.0, density=0.0),
        effects=[refweb.PointMass(node=1, mass=1.0), refweb.Velocity(node=1, value=(speed, 0.0, 0.0))],
        observe=[
            refweb.Observe(name="far", quantity="displacement", node=1, component="x", reduce="max"),
            refweb.Observe(name="stored", quantity="strain_energy", reduce="max"),
        ],
        solve=refweb.Dynamic(duration=0.15, method=method, rtol=1e-9),
        output=refweb.Output(interval=0.01),
        accuracy=refweb.Accuracy(error="none"),
    )
    far, stored = refweb.run(scene).results.values()
    # a parabola through samples of h = 5 ms errs by some (ωh)⁴/64 = 2e-6 of a cosine, and its top by (ωh)²/16 of h
    assert abs(far.value - speed / omega) < 3e-6 * speed / omega
    assert abs(stored.value - 0.5 * speed**2) < 16 * 3e-6 * 0.5 * speed**2
    assert abs(far.time - np.pi / (2.0 * omega)) < 1e-2 * 5e-3
