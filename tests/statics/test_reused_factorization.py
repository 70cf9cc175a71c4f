"""Steps, bounds and deviations by a factorization at hand: as few as is stated, and as good as with one for each.

Truth of the solutions of conjugate gradients are those of numpy; of the statics the same webs with a factorization of
its own for every step, and the condition that forces which balance prove a bound.
"""

import importlib.util

import numpy as np
import pytest
from nets import system

from refweb.effects.elasticity import strains
from refweb.effects.load import Load
from refweb.net.cable import Cable
from refweb.net.lattices import Window
from refweb.net.tension_laws import Law
from refweb.statics import load_steps, newton
from refweb.statics.bars import Bars
from refweb.statics.duality_bound import duality_bound
from refweb.statics.equilibrium import LIMIT
from refweb.system import conjugate_gradients
from refweb.system.factorization import Factor

STEPS = (1.0, 2.0, 3.0, 4.0, 5.0)
MOST = {"square": 9, "triangle": 10, "hexagon": 15}
"""Factorizations of five load steps from flat with their bounds, where one for each step takes 29, 29 and 35."""
LARGE = 22
"""The same of any web of 200 x 200 cells."""


def web(mesh, prestrain=0.0, law="tension-only", cells=30):
    cable = Cable(law=law, modulus=7e7, area=1e-4, density=200.0, prestrain=prestrain)
    window = Window(mesh=mesh, rows=cells, columns=cells, side=0.1).web()
    return system(window, cable, [Load(node="centre", force=(0.0, 0.0, 1.0))])


def series(net_system):
    return list(load_steps.solve(net_system, STEPS))


@pytest.mark.parametrize("mesh", MOST)
def test_few_factorizations_and_the_same_results(mesh, monkeypatch):
    """Each equilibrium lies within both bounds of the other, gaps and deviations are of the same size."""
    updates = []
    update = Factor.update
    monkeypatch.setattr(Factor, "update", lambda self, *args: (updates.append(1), update(self, *args))[1])
    net_system = web(mesh)
    found = series(net_system)
    assert len(updates) == sum(f.stats["nlu"] for f in found) <= MOST[mesh]
    monkeypatch.setattr(newton, "SMALL", np.inf)
    for one, other in zip(found, series(net_system), strict=True):
        assert one.stats["residual"] <= LIMIT
        bounds = one.duality_bound, other.duality_bound
        assert (np.abs(one.tension - other.tension) <= sum(bound.tension for bound in bounds)).all()
        energies = [net_system.energy(f.step, f.x) for f in (one, other)]
        rounding = 1e3 * np.finfo(float).eps * abs(energies[0])
        assert abs(energies[0] - energies[1]) <= max(bound.gap for bound in bounds) + rounding
        assert bounds[0].gap <= 5.0 * bounds[1].gap and bounds[0].sharp
        sizes = [np.abs(f.deviations[1:]).max() for f in (one, other)]
        assert sizes[0] == pytest.approx(sizes[1], rel=0.1)  # which are solved for to a few hundredths
        assert np.abs(one.x - other.x).max() <= 10.0 * sizes[1] + np.abs(one.deviations[0]).max()


def test_tensions_ahead_of_a_step_save_steps(monkeypatch):
    """Of the web whose lines turn most; the equilibrium is the same, by the bounds of both."""
    start = web("hexagon")
    one, other = newton.Newton(start), newton.Newton(start)
    rest = np.zeros((start.rows, 3))
    found = one.solve(1.0, rest)
    monkeypatch.setattr(newton.Newton, "_tension_ahead", lambda *args: None)
    without = other.solve(1.0, rest)
    assert 1.3 * found.stats["nsteps"] <= without.stats["nsteps"]
    bounds = [duality_bound(start, state).tension for state in (found, without)]
    assert (np.abs(found.tension - without.tension) <= sum(bounds)).all()


@pytest.mark.parametrize("order", [1, 3])
def test_what_tensions_make_of_the_stiffness(order):
    """Where they are those that a displacement leads to, K there is that of the bars' material and these: no other."""
    cable = Cable(law="tension-only", modulus=7e7, area=1e-4, density=200.0, prestrain=0.01, order=order)
    window = Window(mesh="square", rows=4, columns=4, side=0.1).web()
    net_system = system(window, cable, [])
    net, rng = net_system.net, np.random.default_rng(order)
    bars = Bars(net, 1e-5 * rng.normal(size=(net_system.rows, 3)))
    assert (bars.tension > 0.0).all()
    doubled = bars.besides(2.0 * bars.tension, 0.0 * bars.tension)
    # Of bars with tension T alone: Bᵀ (T/l) (1 − t⊗t) B.
    shares = net.weights[:, None] * net.gradients
    across = np.eye(3) - bars.direction[:, :, None] * bars.direction[:, None, :]
    across *= (bars.tension / bars.length)[:, None, None]
    expected = np.einsum("cqij,qa,qb->caibj", across.reshape(len(net.cells), -1, 3, 3), shares, shares)
    np.testing.assert_allclose(doubled, expected.reshape(doubled.shape), rtol=1e-12, atol=1e-12 * expected.max())
    assert not bars.besides(bars.tension, 0.0 * bars.tension).any()


def test_tensions_ahead_are_of_first_order():
    """What is left of them falls with the square of the change, and none is negative."""
    net = system(*_prestressed(), []).net
    rng = np.random.default_rng(5)
    x, change = 1e-4 * rng.normal(size=(2, len(net.points), 3))
    bars = Bars(net, x)
    left = [np.abs(bars.ahead(h * change) - Bars(net, x + h * change).tension).max() for h in (1.0, 0.5, 0.25)]
    assert np.log2(left[0] / left[1]) == pytest.approx(2.0, abs=0.1)
    assert np.log2(left[1] / left[2]) == pytest.approx(2.0, abs=0.1)
    assert bars.ahead(-1e3 * net.points).min() == 0.0


def _prestressed():
    cable = Cable(law="tension-only", modulus=7e7, area=1e-4, density=200.0, prestrain=0.01)
    return Window(mesh="square", rows=4, columns=4, side=0.1).web(), cable


@pytest.mark.slow
@pytest.mark.skipif(not importlib.util.find_spec("rslab"), reason="a factorization takes seconds without it")
@pytest.mark.parametrize("mesh", MOST)
def test_few_factorizations_of_large_webs(mesh):
    found = series(web(mesh, cells=200))
    assert sum(state.stats["nlu"] for state in found) <= LARGE
    assert all(state.stats["residual"] <= LIMIT and state.duality_bound.sharp for state in found)


def test_a_factorization_of_another_matrix_is_not_trusted():
    """What is held belongs to a web of a hundredth of the stiffness: bounds and deviations come out as ever."""
    net_system = web("square", prestrain=-0.01)
    one, other = newton.Newton(net_system), newton.Newton(net_system)
    state = one.solve(1.0, np.zeros((net_system.rows, 3)))
    expected = duality_bound(net_system, state)
    values = np.zeros(len(net_system.pattern.indices))
    values[net_system.pattern.diagonal] = np.geomspace(1.0, 1e6, net_system.pattern.size)
    other.factor.update(values, 1e-3)
    bound = duality_bound(net_system, state, other.factor)
    assert bound.gap <= 2.0 * expected.gap
    assert other.factor.shift is None  # it has made its own


@pytest.mark.parametrize("columns", [1, 4])
def test_conjugate_gradients_solve_within_their_iterations(columns):
    """M differs from A in three directions, so that four iterations end at rounding."""
    rng = np.random.default_rng(columns)
    basis = np.linalg.qr(rng.normal(size=(30, 30)))[0]
    near = basis * np.geomspace(1.0, 1e4, 30) @ basis.T
    root = basis[:, :3] * np.sqrt(np.geomspace(1.0, 1e4, 30)[:3])
    matrix = near + root * (1.0, 0.5, 2.0) @ root.T
    b = rng.normal(size=(30, columns)).squeeze()
    found = conjugate_gradients.solve(matrix.__matmul__, lambda r: np.linalg.solve(near, r), b, 1e-9, 30)
    assert found.enough and found.iterations <= 5
    expected = np.linalg.solve(matrix, b)
    assert np.abs(found.y - expected).max() <= 1e-7 * np.abs(expected).max()


def test_conjugate_gradients_end_where_there_is_no_stiffness():
    eye = np.eye(5)
    down = np.diag([1.0, 1.0, -1.0, 1.0, 1.0])
    for matrix, near in ((down, eye), (eye, down)):
        found = conjugate_gradients.solve(matrix.__matmul__, near.__matmul__, np.array([0.1, 0, 1, 0, 0.2]), 1e-9, 6)
        assert not found.enough


def test_hopeless_iterations_end_early():
    matrix, b = np.diag(np.geomspace(1.0, 1e8, 200)), np.ones(200)
    found = conjugate_gradients.solve(matrix.__matmul__, np.array, b, 1e-6, 50)
    assert not found.enough and found.iterations < 10


def test_the_next_step_starts_near_its_end():
    """A flat web: the residual of a start by the law F^(1/3) is a part of that of the last state's."""
    from refweb.statics.predictor import predicted

    net_system = web("square")
    states = series(net_system)

    def off(x):
        return np.abs(x - states[3].x).max()

    for before in (states[2:3], states[1:3]):
        assert off(predicted(net_system, 4.0, before)) < 0.25 * off(states[2].x)
    # Through the last two where loads are not 0 at 0, and nowhere where load steps return.
    assert predicted(net_system, states[1].step, states[1:2]) is states[1].x


def test_slack_bars_are_lent_what_a_smooth_law_has():
    """Its η is a share of the mean strain of taut bars; these are lent nothing, and none is where no bar is slack."""
    net = system(*_prestressed(), []).net
    x = 1e-2 * np.random.default_rng(5).normal(size=(len(net.points), 3))
    bars, strain = Bars(net, x), strains(net, x).ravel()
    assert 0.1 < np.mean(strain < 0.0) < 0.9
    expected = Law("smooth").tangent(strain, 1.0, 0.0, 0.1 * strain[strain > 0.0].mean())
    np.testing.assert_allclose(bars.lent(0.1), np.where(strain < 0.0, bars.stiffness * expected, 0.0), rtol=1e-12)
    still = Bars(net, 0.0 * x)
    assert not still.lent(0.1).any() and not bars.lent(0.0).any()
    narrow = 1e-11 * strain[strain > 0.0].mean()  # where the tangent of the law is η²/ε²
    expected = np.where(strain < 0.0, bars.stiffness * (narrow / strain) ** 2, 0.0)
    np.testing.assert_allclose(bars.lent(1e-11), expected, rtol=1e-9)
