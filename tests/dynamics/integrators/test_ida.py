"""IDA: the same motion as other methods, nodes without mass, rigid links, and what is refused."""

import nets
import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipk

import refweb
from refweb.dynamics.integrators.central_difference import CentralDifference
from refweb.dynamics.integrators.cvode import Cvode
from refweb.dynamics.integrators.ida import Ida
from refweb.effects.damping import Damping
from refweb.effects.elasticity import Elasticity
from refweb.effects.link import Link
from refweb.errors import InputError, SolverError
from refweb.net import discretisation
from refweb.results import probes
from refweb.statics import load_steps
from refweb.system.system import System

SOLVERS = ["block", "sparse", "dense"]
GRAVITY = 9.81


def moving(web, effects, consistent=False, **cable):
    """A system in time, its rim supported."""
    net = discretisation.build(
        web, refweb.Cable(**{**dict(law="tension-only", modulus=7e7, area=1e-4), **cable}), False, consistent
    )
    supported = np.zeros((len(net.points), 3), dtype=bool)
    supported[web.rim] = True
    return System(net, [Elasticity(), *effects], supported)


def window(effects, **cable):
    web = refweb.Window(mesh="square", rows=4, columns=4, side=0.1).web()
    return moving(web, effects, **cable)


def thrown(value=(0.1, 0.05, 1.0), mass=0.1, node="centre"):
    return [refweb.PointMass(node=node, mass=mass), refweb.Velocity(node=node, value=value)]


def ball(**changes):
    given = dict(name="ball", radius=0.08, mass=0.5, position=(0.013, 0.02, -0.0801), velocity=(0.0, 0.0, 1.0))
    return [refweb.Body(**{**given, **changes}), refweb.Contact(stiffness=1e4)]


def ran(solver, duration, rows=11):
    run = solver.start()
    history = solver.advance(run, np.linspace(0.0, duration, rows))
    return run, history


def deflection(node, sign=1):
    """Probe of the displacement of a node along z."""
    return probes.Probe(probes.displacement, [2, node, node + 1], np.zeros((1, 3)), sign)


# The same motion


def test_an_impact_is_that_of_the_other_methods():
    """A ball into a web, within three times the error that halving the tolerance, or the step, shows for each."""
    system = window(ball(), density=200.0)
    coarse, fine = (ran(Ida(system, rtol=rtol), 0.01)[0].x for rtol in (1e-4, 1e-5))
    own = np.abs(coarse - fine).max()
    for solver, finer in (
        (Cvode(system, rtol=1e-4), Cvode(system, rtol=1e-5)),
        (CentralDifference(system, safety=0.2), CentralDifference(system, safety=0.1)),
    ):
        other, best = ran(solver, 0.01)[0].x, ran(finer, 0.01)[0].x
        assert np.abs(fine - best).max() <= 3.0 * (own + np.abs(other - best).max())
    assert own < 1e-5 and np.abs(fine[:-1]).max() > 5e-3


@pytest.mark.slow
def test_errors_fall_with_the_tolerance():
    """BDF of order 2 on a smooth motion: errors go with rtol^(2/3), here within the half of that exponent."""
    system = window(thrown(), density=200.0, prestrain=1e-2)
    exact = ran(Cvode(system, rtol=1e-11, family="adams"), 0.01)[0].x
    tolerances = np.array([1e-4, 1e-5, 1e-6, 1e-7])
    errors = [np.abs(ran(Ida(system, rtol=rtol), 0.01)[0].x - exact).max() for rtol in tolerances]
    slope = np.polyfit(np.log(tolerances), np.log(errors), 1)[0]
    assert 1 / 3 < slope < 1.0 and errors[-1] < 1e-5 * 6e-3


@pytest.mark.ordinary("200.0-plain")
@pytest.mark.parametrize("case", nets.some(["plain", "consistent", "order 3", "damped"], 2))
@pytest.mark.parametrize("density", [200.0, 0.0])
def test_linear_solvers_agree(case, density):
    """Also with CVODE where all has mass: errors at this tolerance are below 1e-4 of the deflection of 4 mm."""
    effects = [*thrown(), *([Damping(time=1e-4)] if case == "damped" else [])]
    options = {"consistent": dict(consistent=True), "order 3": dict(order=3)}.get(case, {})
    system = window(effects, density=density, prestrain=1e-2, **options)
    found = [ran(Ida(system, rtol=1e-6, linear_solver=name), 0.004)[0] for name in SOLVERS]
    if density:
        found.append(ran(Cvode(system, rtol=1e-6), 0.004)[0])
    for run in found:
        np.testing.assert_allclose(run.x, found[0].x, rtol=0, atol=4e-7)
        assert run.drift < 1e-5


def small(links):
    """Damped lines, nodes with and without mass, gravity, and links on request, at a moving state."""
    points = [[0, 0, 0], [1, 0, 0.1], [2, 0.1, 0], [3, 0, 0.2], [4, 0, 0]]
    web = refweb.Inline(points=points, lines=[[0, 1], [1, 2], [2, 3], [3, 4]], supports=[0, 4]).web()
    effects = [
        refweb.PointMass(node=[1, 3], mass=0.3),
        refweb.Gravity(acceleration=(1.0, 2.0, -GRAVITY)),
        Damping(time=0.1),
    ]
    effects += [Link(nodes=links)] if links else []
    return moving(web, effects, modulus=1e4, density=0.0, prestrain=0.1)


@pytest.mark.parametrize("links", [[], [0, 1], [1, 3], [0, 1, 3, 4]])
def test_jacobian_is_the_slope_of_the_residual(links):
    """dF(y + h d, y' + h c d)/dh by Taylor's theorem: the remainder is of order h²; and the block form inverts it.

    Links join supports and free nodes, and free nodes with each other, whose forces depend on where both are.
    """
    system = small(links)
    solver = Ida(system, linear_solver="dense")
    solver.start()
    heavy = np.count_nonzero(system.net.mass[system.free // 3])
    size = solver.unknowns + heavy + 2 * max(len(links) - 1, 0)
    rng = np.random.default_rng(0)
    y, yp, d, c = 0.05 * rng.standard_normal(size), rng.standard_normal(size), rng.standard_normal(size), 7.0
    if links:
        y[-len(links) + 1 :] = 0.0  # μ, which is 0 but for errors, is left out of derivatives

    def residual(y, yp):
        r = np.empty(size)
        solver.residual(0.0, y, yp, r)
        return r

    J = np.empty((size, size))
    solver.jacobian(0.0, y, yp, None, c, J)
    steps = np.array([1e-2, 5e-3, 2.5e-3])
    rest = [np.linalg.norm(residual(y + h * d, yp + h * c * d) - residual(y, yp) - h * (J @ d)) for h in steps]
    assert abs(np.polyfit(np.log(steps), np.log(rest), 1)[0] - 2.0) < 0.1
    if not links:
        block = Ida(system, linear_solver="block")
        block.start()
        block.set_up(0.0, y, yp, None, c)
        product, back = np.empty(size), np.empty(size)
        block.jacobian_times(0.0, y, yp, None, d, product, c)
        np.testing.assert_allclose(product, J @ d, rtol=1e-12, atol=1e-12 * np.abs(J @ d).max())
        block.precondition(0.0, y, yp, None, product, back, c, 0.0)  # gives back what was multiplied
        block.precondition(0.0, y, yp, None, product, back, c, 0.0)
        np.testing.assert_allclose(back, d, rtol=1e-9, atol=1e-9)


# Nodes without mass


def cross(law="tension-only", prestrain=1e-3, effects=()):
    """Four arms of 1 m, each of two elements without mass, and 1 kg in the middle."""
    points, pairs = [[0.0, 0.0, 0.0]], []
    for way in ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]):
        pairs += [[0, len(points)], [len(points), len(points) + 1]]
        points += [[0.5 * w for w in way], way]
    web = refweb.Inline(points=points, lines=pairs, supports=[2, 4, 6, 8]).web()
    return moving(web, effects, law=law, density=0.0, prestrain=prestrain)


@pytest.mark.slow
def test_cross_goes_as_far_as_its_energy():
    """½ m v² = Π(w) − Π(0), Π = 4 · ½ EA L ε²: the arms stay straight, as massless cables do.

    The peak is seen at the middles and ends of steps, 1e-3 of a quarter period apart, which takes 1e-6 of it.
    """
    natural, stiffness = 1.0 / 1.001, 7e7 * 1e-4
    strained = lambda w: 4 * 0.5 * stiffness * natural * (np.hypot(1.0, w) / natural - 1.0) ** 2  # noqa: E731
    furthest = brentq(lambda w: strained(w) - strained(0.0) - 0.5, 0.0, 1.0, xtol=1e-15)
    system = cross(effects=thrown((0.0, 0.0, 1.0), 1.0, 0))
    for name in SOLVERS:
        solver = Ida(system, [deflection(0)], rtol=1e-7, linear_solver=name)
        run, _ = ran(solver, 0.2)
        np.testing.assert_allclose(run.extremes.values[0], furthest, rtol=1e-5)
        np.testing.assert_allclose(run.x[1::2, 2], 0.5 * run.x[0, 2], rtol=1e-7)
        np.testing.assert_allclose(run.v[1::2, 2], 0.5 * run.v[0, 2], atol=1e-5)
        assert run.drift < 1e-4


def test_window_goes_as_far_as_its_energy():
    """½ m v² = Π(w) − Π(0) with Π from statics, where the middle is moved to w and all else finds its place.

    The web is symmetric about its middle, which moves along z alone.
    """
    web = refweb.Window(mesh="square", rows=4, columns=4, side=0.1).web()
    middle = int(web.find("centre")[0])

    def strained(w):
        moved = refweb.Motion(node=middle, displacement=[(0.0, 0.0, 0.0, 0.0), (1.0, 0.0, 0.0, w)])
        cable = refweb.Cable(law="tension-only", modulus=7e7, area=1e-4, density=0.0, prestrain=1e-2)
        system = nets.system(web, cable, [moved])
        (found,) = load_steps.solve(system, [1.0])
        return system.energy(1.0, found.x)

    furthest = brentq(lambda w: strained(w) - strained(0.0) - 0.5 * 0.1, 0.0, 0.1, xtol=1e-12)
    system = window(thrown((0.0, 0.0, 1.0)), density=0.0, prestrain=1e-2)
    run, _ = ran(Ida(system, [deflection(middle)], rtol=1e-7), 0.03)
    np.testing.assert_allclose(run.extremes.values[0], furthest, rtol=1e-5)
    assert np.abs(run.x[middle, :2]).max() < 1e-9 and run.drift < 1e-5


@pytest.mark.slow
def test_light_lines_become_massless_ones():
    """A ball into a web of density ρ → 0: the difference to density 0 falls like ρ, and steps are many times fewer."""
    given = dict(prestrain=1e-2)
    bare, _ = ran(Ida(window(ball(), density=0.0, **given), rtol=1e-6), 0.03)
    light = [ran(Ida(window(ball(), density=rho, **given), rtol=1e-4), 0.03)[0] for rho in (20.0, 2.0)]
    far, near = (abs(run.x[-1, 2] - bare.x[-1, 2]) for run in light)
    assert 5.0 < far / near < 20.0 and near < 1e-4 and bare.drift < 1e-5
    assert light[1].nsteps > 3 * ran(Ida(window(ball(), density=0.0, **given), rtol=1e-4), 0.03)[0].nsteps


def test_massless_nodes_are_where_forces_balance():
    """Given places are none for nodes without mass: at t = 0 they are in equilibrium, and their rates keep that."""
    load = refweb.Load(node=1, force=(0.0, 0.0, 20.0))
    system = cross(prestrain=1e-2, effects=[*thrown((0.3, 0.1, 1.0), 1.0, 0), load])
    solver = Ida(system)
    run = solver.start()
    assert np.abs(system.force(0.0, run.x)[1::2]).max() < 1e-10 * 70.0
    assert abs(run.x[1, 2]) > 1e-2  # 20 N between two lines of 70 N and 0.5 m: 20/(2 · 70/0.5) m and less
    slope = system.force(0.0, run.x + 1e-5 * run.v)[1::2] - system.force(0.0, run.x - 1e-5 * run.v)[1::2]
    assert np.abs(slope).max() / 2e-5 < 1e-6 * 7e3
    np.testing.assert_array_equal(run.v[0], (0.3, 0.1, 1.0))


@pytest.mark.parametrize("prestrain", [0.0, -0.01])
def test_a_node_that_nothing_holds_is_refused(prestrain):
    with pytest.raises(SolverError, match="^node [1357] has no position at t = 0: it has no mass, .* give density"):
        Ida(cross(prestrain=prestrain, effects=thrown(mass=1.0, node=0))).start()


@pytest.mark.parametrize("law", [dict(law="tension-only"), dict(law="linear"), dict(law="smooth", smoothing=1e-5)])
@pytest.mark.parametrize("name", SOLVERS)
def test_a_node_that_loses_tension_ends_the_run(law, name):
    """A mass between two cables is thrown along them, x = v/ω sin ωt: one is slack when x is its stretch.

    The law does not matter, except that a smooth one has tension at strains of the order of its smoothing. Time is that
    of the end of a step.
    """
    web = refweb.SingleCable(start=(-1, 0, 0), end=(1, 0, 0), elements=8).web()
    system = moving(web, thrown((3.0, 0.0, 1e-3), 1.0, 4), density=0.0, prestrain=1e-2, **law)
    natural = 1.0 / 1.01
    rate = np.sqrt(2.0 * 7e3 / natural)
    slack = np.arcsin((1.0 - natural) * rate / 3.0) / rate
    solver = Ida(system, rtol=1e-6, linear_solver=name)
    run = solver.start()
    with pytest.raises(
        SolverError, match=r"^node [567] has lost its position by t = [\d.e-]+ s: it has no mass"
    ) as error:
        solver.advance(run, np.linspace(0.0, 0.1, 101))
    time = float(str(error.value).split("t = ")[1].split()[0])
    assert -0.01 * slack < time - slack < 2.0 * run.step
    assert run.time < time


# Rigid links


def chain(count, links, modulus=1e6, law="tension-only", length=1.01, mass=0.05, effects=()):
    """Point masses along 1 m, with one end fixed; its lines are slack where ``length`` is above 1 and links hold."""
    points = np.zeros((count + 1, 3))
    points[:, 0] = np.arange(count + 1) / count
    pairs = [[i, i + 1] for i in range(count)]
    natural = [length / count] * count
    web = refweb.Inline(points=points.tolist(), lines=pairs, supports=[0], natural_length=natural).web()
    acting = [refweb.Gravity(acceleration=(0.0, 0.0, -GRAVITY))]
    acting += [refweb.PointMass(node=list(range(1, count + 1)), mass=mass), *effects]
    acting += [Link(nodes=list(range(count + 1)))] if links else []
    return moving(web, acting, law=law, modulus=modulus, density=0.0)


def stretch(system, x):
    """Largest relative error of the lengths of a chain."""
    where = (system.net.points + x)[: system.net.nodes]
    sizes = np.linalg.norm(np.diff(where, axis=0), axis=1) * (len(where) - 1)
    return np.abs(sizes - 1.0).max()


@pytest.mark.slow
@pytest.mark.parametrize("order, rtol", nets.some([(5, 1e-8), (2, 1e-6)], 2))
def test_pendulum(order, rtol):
    """From horizontal: period 4 K(sin²45°) √(L/g), force at the bottom 3 m g, along the link.

    In a period errors of some 1000 steps add up to 100 times the tolerance, of position, force and momentum alike.
    """
    system, off = chain(1, True, mass=2.0), 100.0 * rtol
    weights = np.eye(1, 6, 0) + np.eye(1, 6, 1) + np.eye(1, 6, 2)
    reaction = probes.Probe(probes.reaction, [2, 0, 1], weights, 1)
    solver = Ida(system, [reaction], rtol=rtol, max_order=order)
    period = 4.0 * ellipk(0.5) / np.sqrt(GRAVITY)
    run = solver.start()
    rows = solver.advance(run, period * np.array([0.0, 0.25, 0.5, 0.75, 1.0]))
    np.testing.assert_allclose(rows.probes[:, 0] / (3.0 * 2.0 * GRAVITY), [0.0, 1.0, 0.0, 1.0, 0.0], atol=off)
    np.testing.assert_allclose(run.x[1], 0.0, atol=off)
    np.testing.assert_allclose(run.extremes.values[0], 3.0 * 2.0 * GRAVITY, rtol=off)
    # What gravity and the support have given is the momentum; the rows hold both.
    given = rows.time[:, None] * [0.0, 0.0, -2.0 * GRAVITY]
    np.testing.assert_allclose(rows.momentum - rows.impulse, given, atol=off * np.abs(given).max())
    assert run.drift < off and (run.constraint_drift < off).all()


@pytest.mark.slow
def test_a_chain_of_links_keeps_its_lengths():
    """20 links swing from horizontal for 1 s, with a whip at its end: lengths to 1e-10, energy to 1e-5."""
    system = chain(20, True)
    solver = Ida(system, rtol=1e-6, max_order=5)
    run, worst = solver.start(), []
    for time in np.linspace(0.0, 1.0, 21)[1:]:
        solver.advance(run, [time])
        worst.append((stretch(system, run.x), np.abs(system.constraints[0].speed(run.x, run.v)).max()))
    assert np.max(worst) < 1e-10 and run.drift < 1e-5
    assert 0.0 < run.constraint_drift[0] < 1e-4 and solver.spent(run)["constraint_drift"][0] == run.constraint_drift[0]


@pytest.mark.slow
def test_links_are_the_limit_of_stiff_lines():
    """20 lines whose stiffness rises to 1e5 N, by CVODE: the difference falls like 1/EA."""
    links, _ = ran(Ida(chain(20, True), rtol=1e-7, max_order=5), 0.25, rows=2)
    off = []
    for modulus in (1e7, 1e8, 1e9):
        stiff, _ = ran(Cvode(chain(20, False, modulus, "linear", 1.0), rtol=1e-7, linear_solver="dense"), 0.25, rows=2)
        off.append(np.abs(stiff.x - links.x).max())
    slopes = np.diff(np.log10(off))
    assert (np.abs(slopes + 1.0) < 0.1).all() and off[-1] < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("name", nets.some(["sparse", "dense"], 2))
def test_links_and_contact(name):
    """A ball hits a chain that falls: momentum goes over, lengths stay, energy is kept."""
    hit = ball(radius=0.1, mass=0.3, position=(0.78, 0.0, 0.1001), velocity=(0.0, 0.0, -3.0))
    system = chain(8, True, effects=hit)
    run, history = ran(Ida(system, rtol=1e-6, linear_solver=name), 0.1)
    assert stretch(system, run.x) < 1e-10 and run.drift < 1e-4
    assert run.v[-1, 2] > -2.0  # it has given momentum to the chain


def test_velocities_are_taken_as_far_as_links_allow():
    """Two masses on a link, one thrown along it: both go on with half the speed, which has the least energy lost."""
    points = [[0.0, 0, 0], [1.0, 0, 0], [2.0, 0, 0]]
    web = refweb.Inline(points=points, lines=[[0, 1], [1, 2]], supports=[], natural_length=1.5).web()
    effects = [
        refweb.PointMass(node="all", mass=1.0),
        refweb.Velocity(node=0, value=(3.0, 0.0, 1.0)),
        Link(nodes=[0, 1]),
    ]
    system = moving(web, effects, density=0.0)
    run, _ = ran(Ida(system), 0.01)
    start = Ida(system).start()
    np.testing.assert_allclose(start.v, [[1.5, 0.0, 1.0], [1.5, 0.0, 0.0], [0.0, 0.0, 0.0]], atol=1e-14)
    np.testing.assert_allclose(run.v.sum(axis=0), (3.0, 0.0, 1.0), rtol=1e-9)


def refused(effects, message, start=None, **changes):
    with pytest.raises(InputError, match=message):
        solver = Ida(chain(4, False, effects=effects), **changes)
        solver.start(start)


def test_links_that_cannot_be_are_refused():
    refused([Link(nodes=[0, 1, 2, 1])], "1 of nodes 2 and 1: the other links and the supports hold")
    refused(
        [Link(nodes=[1, 2]), Link(nodes=[2, 1])], "2 of nodes 2 and 1: the other links|1 of nodes 1 and 2: the other"
    )
    driven = refweb.Motion(node=2, displacement=[(0.0, 0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 1.0)])
    refused([driven, Link(nodes=[1, 2])], r"^\[\[link\]\] 1 of nodes 1 and 2: node 2 moves by \[\[motion\]\]")
    refused([Link(nodes=[1, 2])], 'linear_solver = "block" must be "sparse" or "dense"', linear_solver="block")
    longer = np.zeros((5, 3))
    longer[4] = 0.01, 0.0, 0.0
    refused([Link(nodes=[1, 2, 3, 4])], "1 of nodes 3 and 4: the start has it stretched by 0.04", longer)
    with pytest.raises(InputError, match="both are supported, so that it holds nothing"):
        Ida(cross(effects=[*thrown(node=0), Link(nodes=[2, 4])]))
    with pytest.raises(InputError, match="1 of nodes 0 and 1: node 1 has no mass: give density > 0"):
        Ida(cross(effects=[*thrown(node=0), Link(nodes=[0, 1])]))
    for wrong, message in (
        (dict(nodes=[1]), "must be a list of two nodes or more"),
        (dict(nodes=[1, 1]), r"nodes\[0\] = 1 and nodes\[1\] = 1 must not be at one place"),
        (dict(nodes=[1, "all"]), r'nodes\[1\] = "all" is 5 nodes, must be one'),
        (dict(nodes=[1, 9]), r"nodes\[1\] = 9 must be 0 … 4"),
    ):
        with pytest.raises(InputError, match=message):
            Link(**wrong).on(chain(4, False).net)


SCENE = dict(
    web=dict(kind="inline", points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0]),
    cable=dict(law="linear", modulus=1e6, area=1e-4, density=1.0),
    link=[dict(nodes=[0, 1])],
)


@pytest.mark.parametrize("method", ["central-difference", "cvode", "newton", "relaxation"])
def test_other_methods_refuse_links(method):
    kind = dict(kind="dynamic", duration=1.0) if method in ("central-difference", "cvode") else dict(kind="static")
    with pytest.raises(InputError, match=r'^\[\[link\]\] needs .* method = "ida"') as refusal:
        refweb.Scene.from_dict({**SCENE, "solve": {**kind, "method": method}}).build()
    assert "\n" not in str(refusal.value)


def test_other_solvers_refuse_links():
    system = chain(4, True)
    for solve in (Cvode, CentralDifference, lambda system: next(load_steps.solve(system, [1.0]))):
        with pytest.raises(InputError, match=r'^\[\[link\]\] needs .*method = "ida"'):
            solve(system)


def test_no_links_in_an_equilibrium_to_start_from():
    solve = dict(kind="dynamic", duration=1.0, method="ida")
    refweb.Scene.from_dict({**SCENE, "solve": solve}).build()
    with pytest.raises(InputError, match='start = "equilibrium" knows no'):
        refweb.Scene.from_dict({**SCENE, "solve": {**solve, "start": "equilibrium"}}).build()


# Stiff cases, by IDA and by CVODE

METHODS = [Ida, Cvode]


@pytest.mark.ordinary("linear-sparse-Ida", "tension-only-sparse-Cvode", "*-block-*", "*-dense-*")
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", SOLVERS)
@pytest.mark.parametrize("law", ["tension-only", "linear"])
def test_stiff_and_light(method, name, law):
    """E = 1e11 Pa and 0.02 kg/m³: the bound of central differences is 2e-8 s, and 2e-3 s are to be seen."""
    web = refweb.SingleCable(start=(0, 0, 0), end=(1, 0, 0), elements=10).web()
    system = moving(web, thrown((0.0, 0.0, 1.0), node=5), law=law, modulus=1e11, density=0.02, prestrain=1e-4)
    assert CentralDifference(system).bound() < 1e-7
    run, _ = ran(method(system, rtol=1e-4, linear_solver=name), 2e-3)
    assert run.nsteps < 2000 and run.drift < 1e-3


@pytest.mark.parametrize("method", METHODS)
def test_an_element_a_thousand_times_shorter(method):
    """What is thrown moves as without it, but for its length of 1e-3 of an element."""
    points = [[0.1 * i, 0.0, 0.0] for i in range(11)]
    found = []
    for short in (False, True):
        places = points[:6] + ([[0.5 + 1e-4, 0.0, 0.0]] if short else []) + points[6:]
        pairs = [[i, i + 1] for i in range(len(places) - 1)]
        web = refweb.Inline(points=places, lines=pairs, supports=[0, len(places) - 1]).web()
        effects = [refweb.PointMass(node=5, mass=0.1)]
        effects += [refweb.Velocity(node=[5, 6] if short else 5, value=(0.0, 0.0, 1.0))]
        system = moving(web, effects, density=200.0, prestrain=1e-3)
        run, _ = ran(method(system, rtol=1e-5), 2e-3)
        found.append(run.x[5, 2])
        assert run.drift < 1e-3
    np.testing.assert_allclose(*found, rtol=1e-3)


@pytest.mark.parametrize("method", METHODS)
def test_two_nodes_at_one_place(method):
    """A slack line between them is felt when it is taut; before that each goes its own way."""
    points = [[0.0, 0, 0], [1.0, 0, 0], [1.0, 0, 0], [2.0, 0, 0]]
    web = refweb.Inline(
        points=points, lines=[[0, 1], [1, 2], [2, 3]], natural_length=[1.5, 0.1, 1.5], supports=[0, 3]
    ).web()
    effects = [refweb.PointMass(node=[1, 2], mass=1.0), refweb.Velocity(node=1, value=(0.0, 0.0, 1.0))]
    system = moving(web, effects, density=0.0, modulus=7e5)
    solver = method(system, rtol=1e-6)
    run = solver.start()
    solver.advance(run, [0.09])
    np.testing.assert_allclose(run.x[1:3], [[0.0, 0.0, 0.09], [0.0, 0.0, 0.0]], atol=1e-12)
    solver.advance(run, [0.2])
    assert run.v[2, 2] > 0.5 and run.drift < 1e-4
    np.testing.assert_allclose(run.v.sum(axis=0), (0.0, 0.0, 1.0), atol=1e-9)
