"""A law by a curve of points: the curve itself, nets with one, and what is refused."""

import numpy as np
import pytest
from nets import skew_web, some, system
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq, minimize
from test_contract import check_term, largest_frequency, state

import refweb
from refweb.dynamics.integrators.central_difference import CentralDifference
from refweb.effects.elasticity import Elasticity
from refweb.net import discretisation
from refweb.net.cable import Cable
from refweb.net.laws.curve import Curve, Table
from refweb.net.laws.law import evaluate
from refweb.net.laws.line_data import LineData
from refweb.statics.duality_bound import duality_bound
from refweb.statics.equilibrium import Equilibrium
from refweb.statics.newton import Newton
from refweb.system.system import System

NYLON = ((0.0, 0.0), (0.02, 1.1e7), (0.05, 4.1e7), (0.11, 2.0e8), (0.18, 5.1e8))
"""A rope that is soft at first."""
SOFTENING = ((0.01, 0.0), (0.013, 6e7), (0.02, 9e7), (0.2, 1.1e8))


def lines(curve, count, axial=3.0):
    """Numbers of lines with a curve."""
    columns = Table.numbers({"curve": [curve] * count})
    return LineData.of_law(np.full(count, axial), **columns)


def values(curve, strain):
    """Stress, tangent, curvature and energy of a curve at strains, over the largest slope."""
    data = lines(curve, len(strain), 1.0)
    kernels = (Table.stress, Table.tangent, Table.curvature, Table.energy_density)
    return [evaluate(kernel, strain, data, Table.columns) for kernel in kernels]


@pytest.mark.parametrize("points", [NYLON, SOFTENING])
def test_the_curve_is_that_of_pchip_with_its_slopes_and_integral(points):
    """Inside of the points, where scipy's slopes at the ends are above 0; 0 below, straight beyond."""
    curve, (strain, stress) = Curve(points, "Pa"), np.array(points).T
    scipy_curve = PchipInterpolator(strain, stress)
    slopes = scipy_curve.derivative()(strain)
    first, last = int(slopes[0] <= 0.0), len(strain) - 1 - int(slopes[-1] <= 0.0)
    inside = np.linspace(strain[first], strain[last], 400)[1:-1]
    inside = inside[np.abs(inside[:, None] - strain).min(axis=1) > 1e-9]  # curvature jumps at points
    got = values(curve, inside)
    for number, derivative in enumerate((scipy_curve, scipy_curve.derivative(), scipy_curve.derivative(2))):
        expected = derivative(inside) / curve.steepest
        np.testing.assert_allclose(got[number], expected, rtol=1e-10, atol=1e-12 * np.abs(expected).max())
    whole = np.array([scipy_curve.integrate(strain[first], e) for e in inside]) / curve.steepest
    begin = values(curve, strain[[first]])[3]
    np.testing.assert_allclose(got[3] - begin, whole, rtol=1e-10, atol=1e-15)
    below, beyond = np.array([-0.5, 0.0, strain[0]]), strain[-1] + np.array([0.0, 0.1, 3.0])
    assert not values(curve, below)[0].any() and not values(curve, below)[3].any()
    end = values(curve, beyond)
    assert end[0][0] * curve.steepest == pytest.approx(stress[-1], rel=1e-14) and end[1][0] > 0.0
    np.testing.assert_allclose(end[0], end[0][0] + end[1][0] * (beyond - strain[-1]), rtol=1e-14)


@pytest.mark.parametrize("seed", range(5))
def test_random_curves_rise_have_their_largest_slope_and_an_inverse(seed):
    rng = np.random.default_rng(seed)
    steps = 10.0 ** rng.uniform(-3.0, 0.0, (2, 7))
    points = tuple(zip(np.append(0.0, steps[0].cumsum()), np.append(0.0, steps[1].cumsum()), strict=True))
    curve, last = Curve(points, "Pa"), points[-1][0]
    strain = np.unique(np.append(np.linspace(1e-6, 1.2, 4001) * last, [e for e, _ in points[1:]]))
    stress, tangent, _, energy = values(curve, strain)
    assert (tangent > 0.0).all() and (np.diff(stress) > 0.0).all()
    assert tangent.max() <= 1.0 + 1e-12
    dense = np.concatenate(
        [np.linspace(e, after, 2000) for (e, _), (after, _) in zip(points, points[1:], strict=False)]
    )
    assert values(curve, dense)[1].max() == pytest.approx(1.0, abs=1e-5)
    np.testing.assert_allclose(
        [value for _, value in points], values(curve, np.array([e for e, _ in points]))[0] * curve.steepest, rtol=1e-13
    )
    middle, width = 0.5 * (strain[1:] + strain[:-1]), np.diff(strain)
    by_simpson = (stress[1:] + stress[:-1] + 4.0 * values(curve, middle)[0]) * width / 6.0  # exact for cubics
    np.testing.assert_allclose(np.diff(energy), by_simpson, rtol=1e-6, atol=1e-14 * energy[-1])
    # The inverse is as good as its rounding over the tangent.
    inverse = Table.strain_of(3.0 * stress, lines(curve, len(strain)))
    assert (np.abs(inverse - strain) <= 8.0 * np.finfo(float).eps * (strain + stress / tangent)).all()


def cable(points=NYLON, **keys):
    return Cable(law="table", stress=points, area=1e-4, density=300.0, **keys)


def solved(web_cable, web=None, force=(0.3, -0.2, 2.0), **keys):
    """A square web under a force at its centre."""
    web = web or refweb.Window(mesh="square", rows=4, columns=4, side=0.2)
    return refweb.run(refweb.Scene(web=web, cable=web_cable, effects=[refweb.Load(node="centre", force=force)], **keys))


@pytest.mark.parametrize("key", ["stress", "tension"])
def test_a_straight_table_is_the_law_of_tension_alone(key):
    """To rounding, with the number of steps and the proven errors that it has."""
    scale = 1.0 if key == "stress" else 1e-4
    points = [[0.0, 0.0], [0.003, scale * 2.1e5], [0.1, scale * 7e6]]
    curved = solved(Cable(law="table", area=1e-4, density=300.0, **{key: points}))
    straight = solved(Cable(law="tension-only", modulus=7e7, area=1e-4, density=300.0))
    assert curved.solver["nlu"] == straight.solver["nlu"]
    np.testing.assert_allclose(curved.tension, straight.tension, rtol=0.0, atol=1e-13 * straight.tension.max())
    for name, result in straight.results.items():
        assert curved.results[name].value == pytest.approx(result.value, rel=1e-13)
        assert curved.results[name].error == pytest.approx(result.error, rel=0.1)  # of rounding


def test_points_of_the_smooth_law_give_its_results_with_the_order_of_pchip():
    """Slopes by harmonic means of equal chords are of order 2, and so the curve between them is of order 3."""
    smooth = refweb.Law("smooth")
    parameters = dict(modulus=7e7, slackness=2e-3, smoothing=2e-3)
    keys = dict(area=1e-4, density=300.0, prestrain=4e-3)
    exact, errors = solved(Cable(law="smooth", **parameters, **keys)).tension, []
    counts = (20, 40, 80, 160)
    for count in counts:
        strain = np.linspace(0.0, 0.02, count + 1)
        points = np.column_stack([strain, smooth.stress(strain, *parameters.values())])
        errors.append(np.abs(solved(Cable(law="table", stress=points, **keys)).tension - exact).max())
    assert -np.polyfit(np.log(counts), np.log(errors), 1)[0] == pytest.approx(3.0, abs=0.3)


class Program:
    """The potential of a net with a curve for each line, by scipy's PCHIP: convex, its least value is the equilibrium.

    Parameters
    ----------
    points, pairs, natural : ndarray
        Nodes [m], ends of lines, natural lengths [m].
    curves : list of tuple of ndarray
        Strains and tensions [N] of each line.
    load : ndarray
        Forces on nodes [N].
    free : ndarray of int
        Free nodes.
    """

    def __init__(self, points, pairs, natural, curves, load, free):
        self.points, self.pairs, self.natural, self.load, self.free = points, pairs, natural, load, free
        self.laws = []
        for strain, tension in curves:
            curve = PchipInterpolator(strain, tension)
            self.laws.append((strain, tension, curve, curve.derivative(), curve.antiderivative()))

    def law(self, line, e):
        """Tension, its slope, and energy per natural length of a line at a strain."""
        strain, tension, curve, slope, energy = self.laws[line]
        if e <= strain[0]:
            return 0.0, 0.0, 0.0
        inside, last = min(e, strain[-1]), float(slope(strain[-1]))
        more = e - inside
        value = float(curve(inside)) + last * more
        return value, float(slope(inside)), float(energy(inside)) + more * (tension[-1] + 0.5 * last * more)

    def lines(self, u):
        """Vectors, lengths and laws of all lines at displacements of the free nodes."""
        x = self.points.copy()
        x[self.free] += u.reshape(-1, 3)
        vector = x[self.pairs[:, 1]] - x[self.pairs[:, 0]]
        length = np.linalg.norm(vector, axis=1)
        return vector, length, np.array([self.law(i, e) for i, e in enumerate(length / self.natural - 1.0)])

    def potential(self, u):
        _, _, laws = self.lines(u)
        return (self.natural * laws[:, 2]).sum() - (self.load[self.free] * u.reshape(-1, 3)).sum()

    def gradient(self, u):
        vector, length, laws = self.lines(u)
        force, pull = -self.load, (laws[:, 0] / length)[:, None] * vector
        force = force.copy()
        np.add.at(force, self.pairs[:, 1], pull)
        np.add.at(force, self.pairs[:, 0], -pull)
        return force[self.free].ravel()

    def hessian(self, u):
        vector, length, laws = self.lines(u)
        whole = np.zeros((len(self.points), 3, len(self.points), 3))
        for (i, j), d, size, natural, (pull, slope, _) in zip(
            self.pairs, vector, length, self.natural, laws, strict=True
        ):
            along = np.outer(d, d) / size**2
            block = slope / natural * along + pull / size * (np.eye(3) - along)
            for a, b, sign in ((i, i, 1.0), (j, j, 1.0), (i, j, -1.0), (j, i, -1.0)):
                whole[a, :, b] += sign * block
        return whole[self.free][:, :, self.free].reshape(3 * len(self.free), -1)

    def tensions(self, start):
        """Tensions at the least potential [N]: of each line, and how near they are known."""
        found = minimize(
            self.potential,
            start,
            jac=self.gradient,
            hess=self.hessian,
            method="trust-exact",
            options={"gtol": 1e-11 * np.abs(self.load).max(), "maxiter": 2000},
        )
        return self.lines(found.x)[2][:, 0], np.abs(self.gradient(found.x)).max()


def rising(rng):
    """Points of a random curve whose slopes at the ends are above 0 by PCHIP."""
    while True:
        steps = 10.0 ** rng.uniform(-1.0, 0.0, (2, rng.integers(2, 6)))
        strain, tension = np.append(0.0, steps[0].cumsum()), np.append(0.0, steps[1].cumsum())
        strain = 0.01 * rng.integers(0, 2) * rng.random() + 0.2 * strain / strain[-1]
        slope = PchipInterpolator(strain, tension).derivative()(strain)
        if slope.min() > 1e-3 * slope.max():
            return strain, 50.0 * tension


@pytest.mark.parametrize("seed", some(range(50), 5))
def test_proven_bounds_contain_the_tensions_of_a_convex_program(seed):
    """Random nets with a curve for each line, of states near and far from the equilibrium."""
    rng = np.random.default_rng(seed)
    held, free = 4, int(rng.integers(2, 6))
    points = np.vstack([[[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0.5]], rng.uniform(0.3, 1.7, (free, 3)) * (1, 1, 0.3)])
    pairs = [[i, held + int(rng.integers(free))] for i in range(held)]
    pairs += [[held + i, held + i + 1] for i in range(free - 1)]
    pairs += [[int(rng.integers(held)), held + i] for i in range(free)]
    pairs = np.array([list(pair) for pair in dict.fromkeys(map(tuple, pairs))])
    distance = np.linalg.norm(points[pairs[:, 1]] - points[pairs[:, 0]], axis=1)
    natural = distance / (1.0 + rng.uniform(-0.05, 0.1, len(pairs)))
    load = np.zeros(points.shape)
    load[held:] = rng.normal(size=(free, 3))
    curves = [rising(rng) for _ in pairs]
    names = tuple(f"line{i}" for i in range(len(pairs)))
    web = refweb.Web(points=points, lines=pairs, natural_length=natural, rim=np.arange(held), groups=names)
    groups = {name: {"tension": np.column_stack(curve).tolist()} for name, curve in zip(names, curves, strict=True)}
    loads = [refweb.Load(node=held + i, force=tuple(load[held + i])) for i in range(free)]
    net_system = system(web, Cable(law="table", tension=NYLON, area=1e-4, density=300.0, groups=groups), loads)
    state = Newton(net_system).solve(1.0, np.zeros(points.shape))
    truth, off = Program(points, pairs, natural, curves, load, np.arange(held, held + free)).tensions(
        state.x[held:].ravel() + 1e-3 * rng.normal(size=3 * free)
    )
    assert off < 1e-6
    bound = duality_bound(net_system, state)
    scale = truth.max()
    # Its gradient of 1e-6 N leaves tensions of soft parts unknown by no more than 1e-5 of the largest.
    assert (np.abs(state.tension - truth) <= bound.tension + 1e-5 * scale).all()
    assert bound.tension.max() < 1e-4 * scale
    for far in (1e-3, 1e-2):
        x = state.x.copy()
        x[held:] += far * rng.normal(size=(free, 3))
        force, per_cell = net_system.forces(1.0, x)
        moved = Equilibrium(1.0, x, per_cell.tension.copy(), force, {})
        bound = duality_bound(net_system, moved)
        assert (np.abs(moved.tension - truth) <= bound.tension + 1e-5 * scale).all()
        energies = [net_system.energy_of(net_system.lines, 1.0, y).sum() for y in (x, state.x)]
        assert abs(energies[0] - energies[1]) <= bound.strain_energy


GROUPS = {
    "one curve": {},
    "a curve for each group": dict(edge=dict(stress=SOFTENING), tie=dict(tension=[[0.0, 0.0], [1.0, 40.0]])),
    "beside other laws": dict(
        edge=dict(law="smooth", modulus=2e8, smoothing=1e-2), tie=dict(law="linear", modulus=1e8)
    ),
}


@pytest.mark.parametrize("groups", GROUPS)
@pytest.mark.parametrize("seed", range(2))
def test_it_keeps_what_every_law_keeps(groups, seed):
    """Force as gradient, tangents of elasticity and damping by Taylor, as `tests/test_contract.py` asks; the bound."""
    made = discretisation.build(skew_web(), cable(groups=GROUPS[groups]))
    free = np.zeros((6, 3), dtype=bool)
    for effect in (Elasticity(), refweb.Damping(time=0.02)):
        one = System(made, [effect], free)
        check_term(one.net, one, one.terms[0], seed)
    one = System(made, [Elasticity()], free)
    x = state(made, seed)[0]
    limit = CentralDifference(one).bound(x, reach=0.0)
    assert limit <= 2.0 / np.sqrt(largest_frequency(one, x)) * (1.0 + 1e-12)


def on_a_rope(method, **keys):
    """A mass on a rope, let go at a tenth of its length above the point where the rope is as long as it is."""
    web = refweb.Inline(points=[[0, 0, 0], [0, 0, -1.0]], lines=[[0, 1]], supports=[0])
    effects = [refweb.Gravity(acceleration=(0, 0, -9.81)), refweb.PointMass(node=1, mass=80.0)]
    observe = [refweb.Observe(name="place", quantity="displacement", node=1, component="z", reduce="final")]
    observe += [refweb.Observe(name="tension", quantity="tension", reduce="max")]
    return refweb.run(
        refweb.Scene(
            web=web,
            cable=cable(NYLON[:3]) if keys.pop("short", False) else cable(),
            effects=[*effects, refweb.Velocity(node=1, value=(0.0, 0.0, -2.0))],
            observe=observe,
            solve=refweb.Dynamic(duration=0.4, method=method, **keys),
            output=refweb.Output(interval=0.02),
        )
    )


@pytest.fixture(scope="module")
def fall():
    """Displacement at 0.4 s [m] and largest tension [N] of the mass on the rope, by scipy."""
    curve, slack = PchipInterpolator(*np.array(NYLON).T), NYLON[0][0]
    mass = 80.0 + 0.5 * 300.0 * 1e-4

    def motion(t, y):
        pull = 1e-4 * float(curve(-y[0])) if -y[0] > slack else 0.0
        return [y[1], pull / mass - 9.81]

    def lowest(t, y):
        return y[1]

    path = solve_ivp(
        motion, (0.0, 0.4), [0.0, -2.0], method="DOP853", rtol=1e-10, atol=1e-12, max_step=1e-3, events=lowest
    )
    longest = -path.y_events[0][0, 0]
    assert longest < NYLON[-1][0]
    return path.y[0, -1], 1e-4 * float(curve(longest))


@pytest.mark.parametrize("method", ["central-difference", "cvode"])
def test_in_dynamics(method, fall):
    """What scipy finds is within ±; what the rope stores is what gravity and the mass have lost."""
    solution = on_a_rope(method, **{"safety": 0.05} if method == "central-difference" else {})
    for name, exact in zip(("place", "tension"), fall, strict=True):
        result = solution.results[name]
        assert abs(result.value - exact) <= result.error + 1e-9 * abs(exact) and result.error < 2e-2 * abs(exact)
    assert solution.solver["energy_drift"] < 1e-4
    assert not any(finding.code == "beyond-curve" for finding in solution.findings)


def test_a_result_beyond_the_last_point_gets_a_warning():
    found = [
        finding.text for finding in on_a_rope("central-difference", short=True).findings if "curve" in finding.code
    ]
    assert len(found) == 1 and "beyond the last point of its curve at 5 %" in found[0]
    far = solved(cable(NYLON[:2]), force=(0.0, 0.0, 3000.0))
    (text,) = [finding.text for finding in far.findings if finding.code == "beyond-curve"]
    assert f"strained by {100.0 * far.strain.max():.4g} %, beyond the last point of its curve at 2 %" in text


def test_pretension_and_sag_are_those_of_the_curve():
    """The natural length is such that the curve has the tension; strains of a curve on which nothing lies are none."""
    tense = solved(cable(pretension=1500.0), force=(0.0, 0.0, 0.0))
    np.testing.assert_allclose(tense.tension, 1500.0, rtol=1e-12)
    strain = Table.strain_of(np.array([1500.0]), lines(Curve(NYLON, "Pa"), 1, 1e-4 * Curve(NYLON, "Pa").steepest))
    np.testing.assert_allclose(tense.strain, strain[0], rtol=1e-10)
    assert 1e-4 * float(PchipInterpolator(*np.array(NYLON).T)(strain[0])) == pytest.approx(1500.0, rel=1e-12)


def test_a_curve_of_a_file_and_back(tmp_path):
    """The columns by name, in any order; the scene that is written has the path of the file."""
    (tmp_path / "rope.csv").write_text("Tension,strain\n0,0\n1100,0.02\n4100,0.05\n")
    tables = {
        "web": {"kind": "window", "mesh": "square", "rows": 4, "columns": 4, "side": 0.2},
        "cable": {"law": "table", "tension": "rope.csv", "area": 1e-4, "density": 300.0},
        "load": [{"node": "centre", "force": [0.3, -0.2, 2.0]}],
        "solve": {"kind": "static"},
    }
    tables["cable"]["groups"] = {"rim": {"tension": "rope.csv"}}
    scene = refweb.Scene.from_dict(tables, tmp_path)
    assert scene.to_dict()["cable"]["groups"]["rim"]["tension"] == str(tmp_path / "rope.csv")
    listed = solved(Cable(law="table", area=1e-4, density=300.0, tension=[[0, 0], [0.02, 1100], [0.05, 4100]]))
    np.testing.assert_array_equal(refweb.run(scene).tension, listed.tension)
    np.testing.assert_array_equal(refweb.run(refweb.Scene.from_dict(scene.to_dict())).tension, listed.tension)
    (tmp_path / "rope.csv").write_text("strain,load\n0,0\n0.02,1100\n")
    with pytest.raises(
        refweb.InputError,
        match=r"tension = .*: rope.csv: column \"load\" is unknown, .*; rope.csv: column tension is missing",
    ):
        scene.build()


REFUSED = {
    r"must rise, but does not from point 2 \(0.05, 4.1e\+07 Pa\) to point 3 \(0.11, 4e\+07 Pa\)": dict(
        stress=(*NYLON[:3], (0.11, 4e7))
    ),
    r"must rise, but does not from point 1 \(0.02, 1.1e\+07 Pa\) to point 2 \(0.02": dict(
        stress=(*NYLON[:2], (0.02, 4e7))
    ),
    r"the first point is \(0.02, 1.1e\+07 Pa\), must have a strain ≥ 0 and a stress of 0": dict(stress=NYLON[1:]),
    r"the first point is \(-0.01, 0 N\)": dict(tension=[[-0.01, 0.0], [0.1, 5.0]]),
    "stress has 1 point, a curve has two or more": dict(stress=[[0.0, 0.0]]),
    r"stress\[0\] = \[1.0\] must be a row of 2 numbers": dict(stress=[[1.0]]),
    "stress and tension both give the curve": dict(stress=NYLON, tension=NYLON),
    r'law = "table" needs stress = \[\[strain, Pa\], ...\]': {},
    'stress has no meaning with law = "linear"': dict(law="linear", modulus=1e7, stress=NYLON),
    'modulus = 1e\\+07 has no meaning with law = "table"': dict(modulus=1e7, stress=NYLON),
    'smoothing = 0.01 has no meaning with law = "table"': dict(smoothing=0.01, stress=NYLON),
    "modulus is missing": dict(stress=NYLON, groups=dict(rim=dict(law="linear"))),
    "groups.rim:? stress and tension both": dict(stress=NYLON, groups=dict(rim=dict(stress=NYLON, tension=NYLON))),
    'groups.rim: stress has no meaning with law = "linear"': dict(
        stress=NYLON, groups=dict(rim=dict(law="linear", modulus=1e7, stress=NYLON))
    ),
    'parameters: exponent has no meaning with law = "table"': dict(stress=NYLON, parameters=dict(exponent=2.0)),
    "there is no file": dict(stress="nowhere.csv"),
}


@pytest.mark.parametrize("message", REFUSED)
def test_what_is_refused(message):
    keys = {"law": "table", "area": 1e-4, "density": 300.0, **REFUSED[message]}
    with pytest.raises(refweb.InputError, match=message):
        solved(Cable(**keys))


def test_a_material_gives_density_and_strength_alone():
    rope = Cable(law="table", stress=NYLON, area=1e-4, material="nylon", groups=dict(rim=dict(material="polyester")))
    assert rope.modulus is None and rope.groups["rim"].modulus is None
    assert rope.density == 1140.0 and rope.groups["rim"].strength == 1.12e9
    assert Cable(**rope.to_dict()) == rope


@pytest.mark.parametrize("far", [1e-6, 1e-4, 1e-3, 1e-2, -1e-3, -1e-2])
def test_bounds_along_a_line_are_near_to_what_they_bound(far):
    """A node on a line between two supports, off its place: no line turns, and the gap is that along the lines.

    Its parts are at most twice the energies by which lines with a tangent as steep as this one's differ.
    """
    points, natural = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0]], dtype=float), np.array([0.98, 0.95])
    pairs, load = np.array([[0, 1], [1, 2]]), np.array([[0, 0, 0], [500.0, 0, 0], [0, 0, 0]])
    web = refweb.Web(points=points, lines=pairs, natural_length=natural, rim=np.array([0, 2]), groups=("a", "b"))
    inner = SOFTENING[:3] + ((0.2, 3e8),)  # PCHIP's slopes at its ends are above 0
    rest = system(web, cable(groups={"b": {"stress": inner}}), [refweb.Load(node=1, force=tuple(load[1]))])
    curves = [np.array(curve).T * [[1.0], [1e-4]] for curve in (NYLON, inner)]
    program, straight = Program(points, pairs, natural, curves, load, np.array([1])), np.array([1.0, 0.0, 0.0])
    place = brentq(lambda u: program.gradient(u * straight)[0], -0.02, 0.05, xtol=1e-16)
    x = np.zeros((3, 3))
    x[1, 0] = place + far
    force, per_cell = rest.forces(1.0, x)
    bound = duality_bound(rest, Equilibrium(1.0, x, per_cell.tension.copy(), force, {}))
    (_, _, here), (_, _, truth) = (program.lines(u * straight) for u in (place + far, place))
    assert (np.abs(here[:, 0] - truth[:, 0]) <= bound.tension).all()
    assert abs(far) <= (bound.strain * natural).min() * (1.0 + 1e-6) or here[:, 0].min() == 0.0
    above = program.potential((place + far) * straight) - program.potential(place * straight)
    stored = (natural * (here - truth)[:, 2]).sum()
    rounding = 1e-14 * (natural * here[:, 2]).sum()
    assert above <= bound.gap + rounding and abs(stored) <= bound.strain_energy + rounding
    if abs(far) <= 1e-4:
        assert bound.gap <= 4.0 * above


def test_groups_alone_may_give_curves_but_one_to_each_line():
    pairs, points = np.array([[0, 1], [1, 2]]), np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0]], dtype=float)
    web = refweb.Web(points=points, lines=pairs, rim=np.array([0]), groups={"a": [0], "b": [1], "both": [0, 1]})
    keys, tension = dict(law="table", area=1e-4, density=300.0), {"tension": [[0.0, 0.0], [1.0, 40.0]]}
    made = Cable(**keys, groups={"a": {"stress": NYLON}, "b": tension}).properties(web)
    steepest = Curve(NYLON, "Pa").steepest
    np.testing.assert_allclose(made["modulus"], [steepest, 40.0 / 1e-4], rtol=1e-15)
    with pytest.raises(refweb.InputError, match='law = "table" of line 1 needs stress'):
        Cable(**keys, groups={"a": tension}).properties(web)
    with pytest.raises(refweb.InputError, match="line 1 has both stress and tension"):
        cable(groups={"both": {"stress": SOFTENING}, "b": tension}).properties(web)
