"""Follower loads, pressure and thrust: polygons and arcs by hand, work around closed paths, solvers and books."""

import nets
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import refweb
from refweb.dynamics.integrators.central_difference import CentralDifference
from refweb.dynamics.integrators.cvode import Cvode
from refweb.dynamics.integrators.ida import Ida
from refweb.effects.elasticity import Elasticity
from refweb.net import discretisation, elements
from refweb.net.web import Web
from refweb.statics import dynamic_relaxation as relaxation
from refweb.statics import load_steps
from refweb.statics.equilibrium import NotFound
from refweb.statics.newton import Newton
from refweb.system.factorization import Factor
from refweb.system.system import System

MODULUS, AREA, DENSITY = 7e7, 1e-4, 200.0
EA = MODULUS * AREA
UP = (0.0, 0.0, 1.0)


def cable(law="tension-only", **changes):
    return refweb.Cable(**{**dict(law=law, modulus=MODULUS, area=AREA, density=DENSITY), **changes})


def system_of(web, cable, effects, supported=None, quasi_static=True):
    """A system whose rows are free but for those components of the web's nodes that ``supported`` holds."""
    net = discretisation.build(web, cable, quasi_static=quasi_static)
    held = np.zeros((len(net.points), 3), dtype=bool)
    if supported is not None:
        held[: len(supported)] = supported
    return System(net, [Elasticity(), *effects], held)


def slope(errors, steps):
    return np.polyfit(np.log(steps), np.log(errors), 1)[0]


def loop(count, radius=1.0, turned=False):
    """A regular polygon about the z axis, counterclockwise, or with every other line the other way."""
    angle = 2.0 * np.pi * np.arange(count) / count
    pairs = np.column_stack([np.arange(count), np.roll(np.arange(count), -1)])
    if turned:
        pairs[::2] = pairs[::2, ::-1]
    return Web(radius * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle]), pairs)


def on_spokes(count):
    """Supports of a polygon that turns and moves nowhere: one node on the x axis, all in the plane."""
    held = np.zeros((count, 3), dtype=bool)
    held[:, 2] = held[[0, count // 2], 1] = True
    held[count // 4, 0] = True
    return held


# Statics


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("count", [4, 12])
def test_polygon_under_pressure(count, turned):
    """2 T sin(π/n) = p l cos(π/n) at each corner, T = EA (l/L − 1): l = EA/(EA/L − p/(2 tan π/n)), T = p × inradius."""
    web, push = loop(count, turned=turned), 500.0
    given = dict(away_from=(0.0, 0.0, 0.0)) if turned else {}
    pressure = refweb.Pressure(lines="all", normal=(0.0, 0.0, 2.0), value=push, **given)
    system = system_of(web, cable(), [pressure], on_spokes(count))
    half, natural = np.pi / count, 2.0 * np.sin(np.pi / count)
    for found in load_steps.solve(system, [0.5, 1.0]):
        p = found.step * push
        length = EA / (EA / natural - p / (2.0 * np.tan(half)))
        radius = length / (2.0 * np.sin(half))
        np.testing.assert_allclose(found.tension, p * radius * np.cos(half), rtol=1e-10)
        position = system.net.points + found.x
        np.testing.assert_allclose(np.linalg.norm(position, axis=1), radius, rtol=1e-10)
        assert found.stats["smallest_pivot"] == 1  # a closed loop has the potential −p × area
    assert found.duality_bound is None


def arc(natural, count, order, push, law="tension-only"):
    """Equilibrium of a cable between supports 1 m apart under pressure, from a straight start."""
    x = np.linspace(0.0, 1.0, count + 1)
    pairs = np.column_stack([np.arange(count), np.arange(1, count + 1)])
    web = Web(np.column_stack([x, 0 * x, 0 * x]), pairs, np.full(count, natural / count), rim=(0, count))
    held = np.zeros((count + 1, 3), dtype=bool)
    held[[0, count]] = True
    pressure = refweb.Pressure(lines="all", normal=UP, value=push)
    (found,) = load_steps.solve(system_of(web, cable(law, order=order), [pressure], held), [1.0])
    return found


def arc_tension(natural, push):
    """T = p R of a circular arc over a chord of 1 m = 2 R sin φ, whose length 2 R φ is stretched by T/EA."""

    def excess(phi):
        radius = 0.5 / np.sin(phi)
        return 2.0 * radius * phi - natural * (1.0 + push * radius / EA)

    return push * 0.5 / np.sin(brentq(excess, 1e-6, np.pi - 1e-6, xtol=1e-15))


@pytest.mark.ordinary("2-1.0", "1-1.5", "3-1.5", "1-0.98")
@pytest.mark.parametrize("natural", [0.98, 1.0, 1.5])
@pytest.mark.parametrize("order", [1, 2, 3])
def test_arc_converges_with_twice_the_order(order, natural):
    """The pull of the supports is that of the arc; it starts straight: taut, without tension, or half as long again."""
    counts = {1: (8, 12, 16, 24), 2: (4, 6, 8, 12), 3: (4, 6, 8)}[order]
    exact, errors = arc_tension(natural, 300.0), []
    for count in counts:
        found = arc(natural, count, order, 300.0)
        assert found.tension.min() > 0.98 * exact
        errors.append(abs(np.linalg.norm(found.force[0]) / exact - 1.0))
    assert errors[-1] < 1e-2 and abs(slope(errors, 1.0 / np.array(counts)) - 2 * order) < 0.15


@pytest.mark.parametrize("law", nets.LAWS)
def test_newton_and_relaxation_agree(law):
    """A net in space under pressure and thrust: two ways that share the forces and nothing else."""
    web = refweb.Window(mesh="square", rows=4, columns=4, side=0.2).web()
    effects = [
        refweb.Pressure(lines="all", normal=(0.0, 1.0, 1.0), value=5.0, factor=[(0.0, 0.0), (1.0, 1.0), (2.0, 3.0)]),
        refweb.Thrust(node=7, line=int(np.flatnonzero((web.lines == 7).any(axis=1))[0]), force=-4.0),
        refweb.Gravity(acceleration=(0.0, 0.0, -9.81)),
    ]
    system = nets.system(web, cable(**{**nets.LAWS[law], "prestrain": 0.01}), effects)
    both = (solve(system, [0.5, 2.0]) for solve in (load_steps.solve, relaxation.solve))
    for newton, relaxed in zip(*both, strict=True):
        assert newton.stats["residual"] <= 1e-9 and newton.stats["nlu"] < 20
        np.testing.assert_allclose(relaxed.x, newton.x, rtol=0, atol=1e-8 * np.abs(newton.x).max())
        np.testing.assert_allclose(relaxed.tension, newton.tension, rtol=0, atol=1e-8 * newton.tension.max())


def test_newton_is_quadratic():
    """With the whole unsymmetric tangent: of the last two steps each squares the residual."""
    web, told = refweb.Window(mesh="square", rows=4, columns=4, side=0.2).web(), []
    pressure = refweb.Pressure(lines="all", normal=(0.0, 1.0, 1.0), value=50.0)
    system = nets.system(web, cable(prestrain=0.05), [pressure])
    list(load_steps.solve(system, [1.0], told.append))
    rates = [float(text.split("residual ")[1]) for text in told]
    assert rates[-1] < 10.0 * rates[-2] ** 1.5 and rates[-2] < 1e-2


def test_other_loads_keep_the_symmetric_factorization():
    web = refweb.Window(mesh="square", rows=4, columns=4, side=0.2).web()
    load = refweb.Load(node="centre", force=(0.0, 0.0, 1.0))
    assert type(Newton(nets.system(web, cable(), [load])).factor) is Factor
    pressure = refweb.Pressure(lines=[3], normal=UP, value=1.0)
    newton = Newton(nets.system(web, cable(), [load, pressure]))
    assert newton.follows and type(newton.factor) is not Factor


def test_no_equilibrium():
    """A free net that a thrust carries off, and a load that Newton's method does not follow in few steps."""
    web = loop(4)
    system = system_of(web, cable(), [refweb.Thrust(node=0, line=0, force=1.0)])
    with pytest.raises(refweb.SolverError, match="carried off along x by -0.7071 N"):
        list(load_steps.solve(system, [1.0]))
    with pytest.raises(NotFound, match="in 2 factorizations"):
        held = on_spokes(4)
        system = system_of(web, cable(), [refweb.Pressure(lines="all", normal=UP, value=500.0)], held)
        Newton(system).solve(1.0, np.zeros((4, 3)), limit=2)


# Work


def work_around(system, term, path, count=64):
    """∮ f · dx of a term along a smooth closed path x(s), s from 0 to 1, by the trapezoidal rule: exact for waves."""
    s, h, total = np.arange(count) / count, 1e-5, 0.0
    for place in s:
        rate = (path(place + h) - path(place - h)) / (2.0 * h)  # exact to h² (2π)³/6 = 4e-9
        total += (system.force_of(term, 0.0, path(place)) * rate).sum() / count
    return total


def circle(s, radius):
    return radius * np.array([np.cos(2.0 * np.pi * s) - 1.0, np.sin(2.0 * np.pi * s), 0.0])


def test_work_of_pressure_on_an_open_line():
    """The end B of a line from A goes around a circle: ½ p ∮ (B − A) × n · dB = −p × its area."""
    web = Web([[0, 0, 0], [1.0, 0.2, 0]], [[0, 1]])
    system = system_of(web, cable(), [refweb.Pressure(lines=[0], normal=UP, value=3.0)], quasi_static=False)

    def path(s):
        return np.array([np.zeros(3), circle(s, 0.5)])

    np.testing.assert_allclose(work_around(system, system.terms[1], path), -3.0 * np.pi * 0.25, rtol=1e-7)


def enclosed(net, x):
    """Area within a loop of curved elements: ½ ∮ (x dy − y dx), by Gauss points enough for any order here."""
    at, weights = elements.gauss(6)
    functions, slopes = elements.values(elements.line_element(net.order), at)
    nodes = (net.points + x)[net.cells]
    here, there = np.einsum("qa,cai->cqi", functions, nodes), np.einsum("qa,cai->cqi", slopes, nodes)
    return 0.5 * ((here[..., 0] * there[..., 1] - here[..., 1] * there[..., 0]) @ weights).sum()


@pytest.mark.parametrize("order", [1, 2, 3])
def test_pressure_in_a_loop_has_a_potential(order):
    """−p × the area within, whatever the shape: no work around a path, p × the growth of area between two shapes."""
    system = system_of(loop(7), cable(order=order), [refweb.Pressure(lines="all", normal=UP, value=3.0)], None, False)
    net, term, rng = system.net, system.terms[1], np.random.default_rng(0)
    one, other = (0.2 * rng.standard_normal(net.points.shape) for _ in range(2))

    def path(s):
        return one * np.cos(2.0 * np.pi * s) + other * np.sin(2.0 * np.pi * s)

    scale = np.abs(system.force_of(term, 0.0, one)).sum()
    assert abs(work_around(system, term, path)) < 1e-7 * scale
    # The force is linear in x and the area quadratic: the mean of the ends is exact.
    mean = 0.5 * (system.force_of(term, 0.0, one) + system.force_of(term, 0.0, other))
    growth = enclosed(net, other) - enclosed(net, one)
    np.testing.assert_allclose((mean * (other - one)).sum(), 3.0 * growth, atol=1e-13 * scale)
    # Round it, no net force, and no net moment about z.
    force = system.force_of(term, 0.0, one)
    position = net.points + one
    turning = np.cross(position, force)[:, 2]
    assert np.abs(force.sum(axis=0)).max() < 1e-13 * scale and abs(turning.sum()) < 1e-13 * scale


def test_work_of_thrust():
    """The node swings by δ sin 2πs along x while the line turns around it once: ∮ F cos 2πs d(δ sin 2πs) = π F δ."""
    web = Web([[0, 0, 0], [1.0, 0, 0]], [[0, 1]])
    system = system_of(web, cable(), [refweb.Thrust(node=0, line=0, force=3.0)], quasi_static=False)

    def path(s):
        node = np.array([0.5 * np.sin(2.0 * np.pi * s), 0.0, 0.0])
        return np.array([node, node + circle(s, 1.0)])

    np.testing.assert_allclose(work_around(system, system.terms[1], path), np.pi * 3.0 * 0.5, rtol=1e-7)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_thrust_pulls_into_the_line(order):
    """At either end, from the elements next to it, along their tangent; none where that has no length."""
    web = Web([[0, 0, 0], [1.0, 0, 0], [0, 1.0, 0]], [[0, 1], [1, 2], [2, 0]])
    for node, line, along in [(0, 0, (1, 0, 0)), (1, 0, (-1, 0, 0)), (2, 1, (1, -1, 0)), (0, 2, (0, 1, 0))]:
        thrust = refweb.Thrust(node=node, line=line, force=2.0)
        system = system_of(web, cable(order=order, subdivide=2), [thrust])
        force = system.force_of(system.terms[1], 1.0, np.zeros((system.rows, 3)))
        np.testing.assert_allclose(force[node], 2.0 * np.array(along) / np.linalg.norm(along), atol=1e-15)
        assert np.count_nonzero(force.any(axis=1)) == 1
        if order == 3:
            continue  # rounding of its places leaves a direction in what follows
        together = -system.net.points  # all rows at one place
        assert not system.force_of(system.terms[1], 1.0, together).any()
        assert not system.stiffness(1.0, together, only=system.terms[1:]).any()
    # Curved, the tangent at the end and not the chord: a parabola y = s² through nodes of order 2.
    if order == 2:
        web = Web([[0, 0, 0], [1.0, 0, 0]], [[0, 1]])
        system = system_of(web, cable(order=2), [refweb.Thrust(node=1, line=0, force=1.0)])
        x = np.column_stack([np.zeros(3), system.net.points[:, 0] ** 2, np.zeros(3)])
        force = system.force_of(system.terms[1], 1.0, x)
        np.testing.assert_allclose(force[1], -np.array([1.0, 2.0, 0.0]) / np.sqrt(5.0), atol=1e-15)


# Dynamics


def orbit(force=3.0, mass=2.0):
    """A mass that a thrust pulls towards the far end of a slack line, held at the origin: m v²/r = F keeps a circle."""
    web = Web([[0, 0, 0], [0.8, 0, 0]], [[0, 1]], natural_length=[100.0])
    held = np.array([[True] * 3, [False] * 3])
    effects = [refweb.PointMass(node=1, mass=mass), refweb.Thrust(node=1, line=0, force=force)]
    system = system_of(web, cable(density=0.0), effects, held, False)
    rate = np.sqrt(force / mass / 0.8)
    v = np.array([[0.0] * 3, [0.0, 0.8 * rate, 0.0]])

    def path(t):
        return 0.8 * np.array([np.cos(rate * t) - 1.0, np.sin(rate * t), 0.0])

    return system, v, path


def test_orbit_order_two():
    """And it does no work there, so that speed is kept."""
    system, v, path = orbit()
    counts, errors = np.array([50, 100, 200, 400]), []
    for count in counts:
        solver = CentralDifference(system, step_size=2.0 / count * (1.0 + 1e-12))
        run = solver.start(v=v)
        solver.advance(run, [2.0])
        assert run.nsteps == count
        errors.append(np.abs(run.x[1] - path(2.0)).max())
    assert abs(slope(errors, 1.0 / counts) - 2.0) < 0.02 and abs(run.work.sum()) < 1e-3


def blown(quasi_static=False):
    """A taut net in space, blown at and pushed along one of its lines, with factors over time."""
    web = refweb.Window(mesh="square", rows=4, columns=4, side=0.2).web()
    line = int(np.flatnonzero((web.lines == 7).any(axis=1))[0])
    effects = [
        refweb.Pressure(lines="all", normal=(0.0, 1.0, 1.0), value=40.0, factor=[(0.0, 0.0), (0.004, 1.0)]),
        refweb.Thrust(node=7, line=line, force=-30.0, factor=[(0.0, 0.0), (0.006, 1.0)]),
    ]
    return nets.system(web, cable("linear", prestrain=0.05), effects, quasi_static)


@pytest.fixture(scope="module")
def exact():
    """Displacement of the unknowns at 0.01 s, by DOP853 at a tolerance of 1e-11, and the work by one more equation."""
    system = blown()
    free, mass = system.free, np.repeat(system.net.mass, 3)[system.free]
    loads = [f for f in system.terms if f.balance.column == "work"]

    def rate(t, y):
        x, v = np.zeros((system.rows, 3)), np.zeros((system.rows, 3))
        x.ravel()[free], v.ravel()[free] = np.split(y[:-1], 2)
        power = sum((system.force_of(f, t, x) * v).sum() for f in loads)
        return np.concatenate([y[len(free) : -1], system.force(t, x).ravel()[free] / mass, [power]])

    y, ends = np.zeros(2 * len(free) + 1), [0.0, 0.004, 0.006, 0.01]
    for start, end in zip(ends, ends[1:], strict=False):  # corners of the factors
        y = solve_ivp(rate, (start, end), y, method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
    return y[: len(free)], y[-1]


def test_order_two_and_the_book(exact):
    """Positions, work and energy drift of central differences; the corners of the factors stand between steps."""
    system, counts, found = blown(), np.array([250, 500, 1000, 2000]), []
    for count in counts:
        solver = CentralDifference(system, step_size=0.01 / count * (1.0 + 1e-12))
        run = solver.start()
        solver.advance(run, np.linspace(0.0, 0.01, 6)[1:])
        assert run.nsteps == count
        found.append([np.abs(run.x.ravel()[system.free] - exact[0]).max(), abs(run.work.sum() - exact[1]), run.drift])
    assert exact[1] > 0.1 and np.abs(exact[0]).max() > 1e-3
    for errors in np.array(found).T:
        assert abs(slope(errors, 1.0 / counts) - 2.0) < 0.1


@pytest.mark.ordinary("Cvode-block", "Cvode-sparse")
@pytest.mark.parametrize("solver, choice", [(Cvode, "block"), (Cvode, "sparse"), (Ida, "block"), (Ida, "dense")])
def test_implicit_solvers(solver, choice, exact):
    """Within 1000 times the tolerance after some hundred steps, the work booked by power with it."""
    system = blown()
    method = solver(system, rtol=1e-6, linear_solver=choice)
    run = method.start()
    method.advance(run, [0.005, 0.01])
    np.testing.assert_allclose(run.x.ravel()[system.free], exact[0], rtol=0, atol=1e-3 * np.abs(exact[0]).max())
    np.testing.assert_allclose(run.work.sum(), exact[1], rtol=1e-3)
    assert run.drift < 1e-3


def test_preconditioner_inverts_the_whole_jacobian():
    """The LU of M + γ²K without symmetry: against the dense matrix I − γJ, J by differences of the right-hand side."""
    system = blown()
    solver, gamma = Cvode(system, linear_solver="block"), 1e-3
    run = solver.start()
    n = solver.unknowns
    y = np.concatenate([1e-3 * np.sin(np.arange(n)), np.zeros(n)])

    def rate(y):
        result = np.empty(2 * n)
        solver.right_side(0.006, y, result)
        return result

    jacobian = np.column_stack([(rate(y + 1e-6 * e) - rate(y - 1e-6 * e)) / 2e-6 for e in np.eye(2 * n)])
    solver.set_up(0.006, y, rate(y), False, np.zeros(1), gamma)
    r, z = np.sin(np.arange(2.0 * n)), np.empty(2 * n)
    solver.precondition(0.006, y, rate(y), r, z, gamma, 0.0, 0)
    size = np.abs(gamma * jacobian).max() * np.abs(z).max()
    np.testing.assert_allclose(z - gamma * jacobian @ z, r, rtol=0, atol=1e-7 * size)
    assert run.time == 0.0 and not system.symmetric


def test_bounds_bound():
    """Row sums of |K| at all times are below what the kernels say."""
    loads = [
        refweb.Pressure(lines="all", normal=(1.0, 2.0, -2.0), value=30.0, factor=[(0.0, -2.0), (1.0, 1.0)]),
        refweb.Thrust(node=4, line=5, force=-3.0, factor=[(0.0, 0.0), (1.0, 2.0)]),
    ]
    rng, system = np.random.default_rng(0), system_of(nets.skew_web(), nets.skew_cable(), loads, None, False)
    for term in system.terms[1:]:
        x = 0.05 * rng.standard_normal((system.rows, 3))
        rates = np.zeros(system.rows)
        term.tangent.bound(0.0, 0.0, x, system.net.mass, rates, term.cells, term.data)
        for t in (0.0, 0.7, 1.0, 9.0):
            blocks = np.empty((len(term.cells), 3 * term.cells.shape[1], 3 * term.cells.shape[1]))
            term.tangent.stiffness(t, x, x, blocks, term.cells, term.data, False)
            sums = np.zeros((system.rows, 3))
            for cell, block in zip(term.cells, blocks, strict=True):
                sums[cell] += np.abs(block).sum(axis=1).reshape(-1, 3)
            assert (sums <= rates[:, None] * (1.0 + 1e-12)).all()


# Scenes


def scene(effects, solve=None, **changes):
    web = refweb.Inline(
        points=[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],
        lines=[[0, 1], [1, 2], [2, 3], [3, 0]],
        supports=[0, 2],
        groups=["edge", "", "edge", ""],
        names={"tip": 1},
    )
    given = dict(web=web, cable=cable(), effects=effects, solve=solve or refweb.Static())
    return refweb.Scene(**{**given, **changes})


def test_groups_and_names():
    """Pressure on a group from inside, one thrust at a name."""
    effects = [
        refweb.Pressure(lines="edge", normal=UP, value=2.0, away_from=(0.5, 0.5, 0.0)),
        refweb.Thrust(node="tip", line=1, force=0.5),
    ]
    given = scene(effects)
    system = given.build()
    force = sum(system.force_of(f, 1.0, np.zeros((4, 3))) for f in system.terms[1:])
    np.testing.assert_allclose(force, [[0, -1, 0], [0, -1 + 0.5, 0], [0, 1, 0], [0, 1, 0]], atol=1e-15)
    text = given.to_dict()
    assert refweb.Scene.from_dict(text).to_dict() == text
    assert text["pressure"][0]["lines"] == "edge" and text["thrust"] == [{"node": "tip", "line": 1, "force": 0.5}]
    solution = refweb.run(given)
    assert solution.status == "solved" and "work" not in solution.history


def test_work_of_a_run_and_not_of_statics():
    work = refweb.Observe(name="done", quantity="work")
    effects = [refweb.Pressure(lines="all", normal=UP, value=2.0), refweb.Load(node=1, force=(0.0, 0.0, 1.0))]
    with pytest.raises(refweb.InputError, match=r'"work" is not known in statics with .*\[\[pressure\]\].*path'):
        scene(effects, observe=[work]).build()
    solution = refweb.run(scene(effects, refweb.Dynamic(duration=0.01, safety=0.05), observe=[work]))
    energy = solution.history["total_energy"]
    # What was put in is there, but for an energy drift of second order in the step.
    np.testing.assert_allclose(solution.history["done"], energy - energy[0], atol=1e-3 * solution.history["done"].max())
    assert solution.history["done"][-1] > 0.0


@pytest.mark.parametrize(
    "effect, message",
    [
        (lambda: refweb.Pressure(lines="all", normal=(0, 0, 0), value=1.0), "normal = .* must have a direction"),
        (lambda: refweb.Pressure(lines=[4], normal=UP, value=1.0), r"lines\[0\] = 4 must be 0 … 3"),
        (lambda: refweb.Pressure(lines=[-1], normal=UP, value=1.0), r"lines\[0\] = -1 must be ≥ 0"),
        (lambda: refweb.Pressure(lines=[], normal=UP, value=1.0), "lines = .* at least one line"),
        (lambda: refweb.Pressure(lines="egde", normal=UP, value=1.0), '"egde" names no line, did you mean "edge"'),
        (
            lambda: refweb.Pressure(lines=[0], normal=UP, value=1.0, away_from=(7.0, 0.0, 3.0)),
            "away_from = .* is on neither side of line 0",
        ),
        (lambda: refweb.Thrust(node=2, line=0, force=1.0), "node = 2 must be an end of line 0, 0 or 1"),
        (lambda: refweb.Thrust(node="rim", line=0, force=1.0), 'node = "rim" is 2 nodes, must be one'),
        (lambda: refweb.Thrust(node=0, line=9, force=1.0), "line = 9 must be 0 … 3"),
    ],
)
def test_refusals(effect, message):
    with pytest.raises(refweb.InputError, match=message):
        scene([effect()]).build()
