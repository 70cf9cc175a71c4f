"""Bending: cantilever, elastica, buckling and vibration of a chain with torsion springs, and where it has springs."""

from dataclasses import replace

import mpmath
import nets
import numpy as np
import pytest
import scipy.linalg
from nets import skew_cable, skew_web
from scipy.integrate import solve_bvp
from scipy.optimize import brentq, fsolve

import refweb
from refweb.dynamics.integrators.central_difference import CentralDifference
from refweb.dynamics.integrators.cvode import Cvode
from refweb.dynamics.integrators.ida import Ida
from refweb.effects.bending import Bending, springs
from refweb.errors import InputError
from refweb.net import discretisation
from refweb.system.broken_lines import torn
from refweb.system.system import System


def slope(errors, steps):
    return np.polyfit(np.log(steps), np.log(errors), 1)[0]


def chain(count, length=1.0, start=0.0, **web):
    """Elements along x that have a length together."""
    points = [[start + length * i / count, 0.0, 0.0] for i in range(count + 1)]
    return refweb.Inline(points=points, lines=[[i, i + 1] for i in range(count)], **web)


def bar(axial=1e6, **cable):
    return refweb.Cable(**{**dict(law="linear", modulus=axial, area=1.0, density=1.0), **cable})


def cantilever(count, load, axial=1e6, **static):
    """A beam of B = 1 and length 1, of ``count`` elements and a half, clamped by a supported element."""
    size = 1.0 / (count + 0.5)
    scene = refweb.Scene(
        web=chain(count + 1, size * (count + 1), -0.5 * size, supports=[0, 1]),
        cable=bar(axial),
        effects=[refweb.Bending(stiffness=1.0), refweb.Load(node=count + 1, force=(0.0, 0.0, load))],
        solve=refweb.Static(**static),
        observe=[refweb.Observe(name="bent", quantity="bending_energy")],
    )
    solution = refweb.run(scene)
    assert solution.status == "solved"
    return solution


def test_cantilever_under_a_small_load():
    """Springs of k = B/h at distances m h from the tip turn by P m h/k each: w = P h³/B Σ m² = PL³/3B − O(h²)."""
    load, errors = 1e-6, []
    counts = np.array([4, 8, 16, 32])
    for count in counts:
        solution, size = cantilever(count, load), 1.0 / (count + 0.5)
        deflection = solution.displacement[-1, 2]
        squares = count * (count + 1) * (2 * count + 1) / 6
        np.testing.assert_allclose(deflection, load * size**3 * squares, rtol=1e-9)  # less what is of order load²
        np.testing.assert_allclose(solution.results["bent"].value, 0.5 * load * deflection, rtol=1e-9)
        errors.append(abs(deflection - load / 3.0))
    assert abs(slope(errors, 1.0 / (counts + 0.5)) - 2.0) < 1e-3


def test_relaxation_finds_the_same():
    pair = [cantilever(3, 1.0, axial=1e2, method=method).displacement for method in ("newton", "relaxation")]
    np.testing.assert_allclose(*pair, atol=1e-7)  # residuals are below 1e-9 of the largest force, flexibilities below 1


def elastica(load):
    """(deflection, height of the tip) of a cantilever of B = L = 1 under a tip load.

    K. E. Bisshopp, D. C. Drucker, "Large deflection of cantilever beams", Q. Appl. Math. 3 (1945) 272–275.
    """

    def modulus(tip):
        k = mpmath.sqrt((1 + mpmath.sin(tip)) / 2)
        return k * k, mpmath.asin(1 / (k * mpmath.sqrt(2)))

    def excess(tip):
        m, phi = modulus(tip)
        return float(mpmath.ellipk(m) - mpmath.ellipf(phi, m) - mpmath.sqrt(load))

    tip = brentq(excess, 1e-6, np.pi / 2 - 1e-9, xtol=1e-14)
    m, phi = modulus(tip)
    deflection = 1 - 2 / mpmath.sqrt(load) * (mpmath.ellipe(m) - mpmath.ellipe(phi, m))
    return float(deflection), float(mpmath.sqrt(2 * mpmath.sin(tip) / load))


@pytest.mark.parametrize("load, table", [(1.0, (0.30172, 0.05643)), (10.0, (0.81061, 0.55500))])
def test_elastica(load, table):
    """Table I of K. Mattiasson, Int. J. Numer. Meth. Eng. 17 (1981) 145–153, and order 2 towards it."""
    deflection, height = elastica(load)
    np.testing.assert_allclose([deflection, 1.0 - height], table, atol=6e-6)
    counts, errors = np.array([8, 16, 32]), []
    for count in counts:
        tip = cantilever(count, load).positions[-1]
        errors.append(np.hypot(tip[2] - deflection, tip[0] - height))
    assert abs(slope(errors, 1.0 / (counts + 0.5)) - 2.0) < 0.1 and errors[-1] < 1e-3


def clamped(count, clamp=(0,), axial=1e6, density=1.0, supports=(0,), effects=(), **more):
    """A beam of B = 1 and length 1 along x, clamped at nodes of ``count`` elements."""
    return refweb.Scene(
        web=chain(count, supports=list(supports)),
        cable=bar(axial, density=density),
        effects=[refweb.Bending(stiffness=1.0, clamp=list(clamp)), *effects],
        observe=[refweb.Observe(name="bent", quantity="bending_energy")],
        **{"solve": refweb.Static(), **more},
    )


@pytest.mark.parametrize("count", [1, 2, 10])
def test_clamped_cantilever_under_a_small_load(count):
    """PL³/3B (1 + 1/2n²): springs of k = B n bend by P (L − x)/k each, that of the clamp, of 2 B n, by half of it."""
    load = 1e-6
    solution = refweb.run(clamped(count, effects=[refweb.Load(node=count, force=(0.0, load, 0.0))]))
    deflection = solution.displacement[-1, 1]
    np.testing.assert_allclose(deflection, load / 3.0 * (1.0 + 0.5 / count**2), rtol=1e-9)  # less what is of load²
    np.testing.assert_allclose(solution.results["bent"].value, 0.5 * load * deflection, rtol=1e-9)


@pytest.mark.parametrize("count", [2, 5])
def test_a_clamp_does_not_hold_its_node(count):
    """A beam whose other end is guided across: by Castigliano w = P h³/B (n²/4 + Σ (n/2 − m)²), which is PL³/12B."""
    load = 1e-6
    guided = clamped(count, (0, count), support=[refweb.Supports(nodes=[count], components=["x", "y"])]).replace(
        effects=[refweb.Bending(stiffness=1.0, clamp=[0, count]), refweb.Load(node=count, force=(0, 0, load))]
    )
    squares = count**2 / 4 + sum((count / 2 - m) ** 2 for m in range(1, count))
    deflection = refweb.run(guided).displacement[-1, 2]
    np.testing.assert_allclose(deflection, load / count**3 * squares, rtol=1e-9)
    np.testing.assert_allclose(squares / count**3, (1.0 + 2.0 / count**2) / 12.0, rtol=1e-14)


def test_a_clamp_between_two_beams_parts_them():
    """Each side of the clamp bends as a cantilever, with half of its first element, and does not feel the other."""
    load = 1e-6
    loads = [refweb.Load(node=node, force=(0.0, 0.0, force)) for node, force in ((0, load), (8, 3.0 * load))]
    solution = refweb.run(clamped(8, [4], supports=[4], effects=loads))
    expected = load / 24.0 * (1.0 + 0.5 / 4**2)
    np.testing.assert_allclose(solution.displacement[[0, 8], 2], [expected, 3.0 * expected], rtol=1e-9)


def sagging(count, weight):
    """Tip of a chain of ``count`` links without strain, springs as those of a clamped beam, weight at its nodes.

    Moments about each joint by the angles φ of the links: k_j (φ_j − φ_{j−1}) is h cos φ_j times the weights behind,
    and that of the next joint.
    """
    h = 1.0 / count
    weights = np.full(count, weight * h)
    weights[-1] *= 0.5
    behind, springs_of = np.cumsum(weights[::-1])[::-1], np.full(count, count)
    springs_of[0] *= 2

    def balance(angles):
        moments = springs_of * np.diff(angles, prepend=0.0)
        return moments - np.append(moments[1:], 0.0) - behind * h * np.cos(angles)

    angles = fsolve(balance, np.zeros(count), xtol=1e-12)
    return np.array([h * np.cos(angles).sum(), h * np.sin(angles).sum()])


def test_clamped_cantilever_under_its_weight():
    """0.981 N/m on a beam of B = L = 1, qL⁴/8B = 122.6 mm if it were small: links without strain and the elastica.

    The elastica is θ'' = −q (1 − s) cos θ with θ(0) = θ'(1) = 0. An axial stiffness of 1e9 N stretches by 1e-9.
    """
    weight, counts, errors = 0.981, np.array([5, 10, 20]), []

    def slopes(s, y):
        return np.array([y[1], -weight * (1.0 - s) * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])])

    start = np.linspace(0.0, 1.0, 41)
    beam = solve_bvp(slopes, lambda a, b: np.array([a[0], b[1], a[2], a[3]]), start, np.zeros((4, 41)), tol=1e-10)
    exact = beam.y[2:, -1]
    for count in counts:
        scene = clamped(
            int(count), axial=1e9, density=weight / 9.81, effects=[refweb.Gravity(acceleration=(0.0, 0.0, -9.81))]
        )
        tip = refweb.run(scene).positions[-1]
        np.testing.assert_allclose([tip[0], -tip[2]], sagging(count, weight), atol=2e-8)
        errors.append(np.hypot(tip[0] - exact[0], tip[2] + exact[1]))
        if count == 10:  # of (1 + 1/n²) by its springs, and less by the cosine of its slope, a sixth: 1.3 % together
            np.testing.assert_allclose(tip[2], -0.1226, rtol=0.013)
    assert abs(slope(errors, 1.0 / counts) - 2.0) < 0.05 and errors[-1] < 1e-3


def transverse(count):
    """Frequencies [1/s] and modes of small vibrations of a clamped chain of B = μ = L = 1, shape (count + 1, modes)."""
    h = 1.0 / count
    turns = np.zeros((count, count + 1))  # of joint j by displacements: that of its link less that of the one before
    for j in range(count):
        turns[j, j : j + 2] += [-1.0 / h, 1.0 / h]
        if j:
            turns[j, j - 1 : j + 1] -= [-1.0 / h, 1.0 / h]
    springs_of = np.full(count, 1.0 / h)
    springs_of[0] *= 2.0
    K = (turns.T * springs_of @ turns)[1:, 1:]
    M = np.full(count, h)
    M[-1] *= 0.5
    squares, modes = scipy.linalg.eigh(K, np.diag(M))
    return np.sqrt(squares), np.vstack([np.zeros(count), modes])


def test_modes_of_a_clamped_beam():
    """Those of a chain by its own matrices, and 1.8751² √(B/μ)/L² of order 2; each bends along y and along z."""
    counts, errors = np.array([5, 10, 20]), []
    for count in counts:
        modes = refweb.modes(clamped(int(count)), number=4, progress=False)
        exact = transverse(count)[0][:2] / (2.0 * np.pi)
        np.testing.assert_allclose(modes.frequency, np.repeat(exact, 2), rtol=1e-9)
        errors.append(abs(modes.frequency[0] - 1.8751040687119611**2 / (2.0 * np.pi)))
    assert abs(slope(errors, 1.0 / counts) - 2.0) < 0.05


def test_motion_of_a_clamped_beam():
    """Its first mode, by central differences with order 2 in the step, and by CVODE within its tolerance."""
    count, small = 6, 1e-6
    frequencies, modes = transverse(count)
    omega, shape = frequencies[0], modes[:, :1] / modes[-1, 0] * [0.0, 1.0, 0.0]
    system, end = clamped(count, axial=1e3, solve=refweb.Dynamic(duration=1.0)).build(), 2.3 * np.pi / omega
    exact, errors, safeties = small / omega * np.sin(omega * end) * shape, [], (0.8, 0.4, 0.2)
    for safety in safeties:
        solver = CentralDifference(system, safety=safety)
        run = solver.start(v=small * shape)
        solver.advance(run, [end])
        errors.append(np.abs(run.x - exact).max())
    assert abs(slope(errors, safeties) - 2.0) < 0.05
    solver = Cvode(system, rtol=1e-7, atol_position=1e-7 * small / omega, atol_velocity=1e-7 * small)
    run = solver.start(v=small * shape)
    solver.advance(run, [end])
    np.testing.assert_allclose(run.x, exact, atol=3e-4 * small / omega)  # as that of a simply supported beam


def test_a_broken_line_bends_no_clamp():
    """Turned by a right angle, ½ 2B/L (π/2)² and a moment; nothing where the element is broken."""
    system = clamped(1, solve=refweb.Dynamic(duration=1.0)).build()
    x = np.array([[0.0, 0.0, 0.0], [-1.0, 0.0, 1.0]])
    np.testing.assert_allclose(system.force(0.0, x)[1], [np.pi, 0.0, 0.0], rtol=1e-14, atol=1e-9)
    np.testing.assert_allclose(sum(system.energy_of(f, 0.0, x).sum() for f in system.terms[1:]), np.pi**2 / 4)
    broken = torn(system, np.array([0]), np.zeros(1))
    assert not broken.force(0.0, x).any()


@pytest.mark.parametrize("count", [2, 3, 10])
def test_buckling(count):
    """A column with hinged ends: P w_j = k θ_j with θ = −Δ²w/a has w_j = sin(πj/n) at P = 4 (k/a) sin²(π/2n).

    k = B/L holds the natural length, a = L (1 − P/EA) is compressed. Between P (1 − 1e-6) and P (1 + 1e-6) the straight
    column loses its stability: the smallest pivot changes sign.
    """
    axial = 1e3
    euler = 4.0 * count**2 * np.sin(np.pi / (2 * count)) ** 2
    critical = 0.5 * axial * (1.0 - np.sqrt(1.0 - 4.0 * euler / axial))
    for load, sign in [(critical * (1.0 - 1e-6), 1), (critical * (1.0 + 1e-6), -1)]:
        scene = refweb.Scene(
            web=chain(count, supports=[]),
            cable=bar(axial),
            support=[refweb.Supports(nodes=[0]), refweb.Supports(nodes=[count], components=["y", "z"])],
            effects=[refweb.Bending(stiffness=1.0), refweb.Load(node=count, force=(-load, 0.0, 0.0))],
            solve=refweb.Static(),
        )
        assert refweb.run(scene).solver["smallest_pivot"] == sign


def beam(count):
    """A simply supported beam of B = μ = L = 1, its frequency by the difference formula, and its first mode."""
    system = nets.system(chain(count, supports=[0, count]).web(), bar(1e3), [Bending(stiffness=1.0)], False)
    omega = 4.0 * count**2 * np.sin(np.pi / (2 * count)) ** 2
    return system, omega, np.sin(np.pi * np.arange(count + 1) / count)[:, None] * [0.0, 0.0, 1.0]


@pytest.mark.parametrize("method", [Cvode, Ida])
def test_frequency_by_implicit_steps(method):
    system, omega, shape = beam(8)
    small, end = 1e-6, 2.3 * np.pi / omega
    solver = method(system, rtol=1e-7, atol_position=1e-7 * small / omega, atol_velocity=1e-7 * small)
    run = solver.start(v=small * shape)
    solver.advance(run, [end])
    # BDF of order 2 leaves a few hundred times its tolerance after a period.
    np.testing.assert_allclose(run.x, small / omega * np.sin(omega * end) * shape, atol=3e-4 * small / omega)
    assert run.drift < 1e-4


def test_frequency():
    """Of order 2 in the step towards that of the chain, 4 (k/m a²)^½ sin²(π/2n), and in the element to π² √(B/μ)/L²."""
    small = 1e-6
    system, omega, shape = beam(8)
    safeties, errors, drifts, end = (0.8, 0.4, 0.2, 0.1), [], [], 2.3 * np.pi / omega
    for safety in safeties:
        solver = CentralDifference(system, safety=safety)
        run = solver.start(v=small * shape)
        solver.advance(run, [end])
        errors.append(np.abs(run.x - small / omega * np.sin(omega * end) * shape).max())
        drifts.append(run.drift)
    assert abs(slope(errors, safeties) - 2.0) < 0.05 and abs(slope(drifts, safeties) - 2.0) < 0.05
    counts, errors, end = np.array([12, 24, 48]), [], 0.75
    for count in counts:
        system, _, shape = beam(count)
        solver = CentralDifference(system, safety=0.2)
        run = solver.start(v=small * shape)
        solver.advance(run, [end])
        errors.append(np.abs(run.x - small / np.pi**2 * np.sin(np.pi**2 * end) * shape).max())
    assert abs(slope(errors, 1.0 / counts) - 2.0) < 0.05


def test_bound_of_a_straight_chain():
    """2/ω with m ω² = 4 EA/a + 16 B/a³ at the nodes whose neighbours have springs too."""
    count, axial = 10, 1e3
    bound = CentralDifference(beam(count)[0]).bound()
    stiffness = 4.0 * axial * count + 16.0 * count**3
    np.testing.assert_allclose(bound, 2.0 / np.sqrt(stiffness * count), rtol=1e-12)


def skew_system(seed, pieces=3, size=0.1, clamp=None):
    """A branching net of divided lines, in a state with turns of up to two rad."""
    net = discretisation.build(skew_web(), replace(skew_cable("linear"), subdivide=pieces))
    rng = np.random.default_rng(seed)
    net = replace(net, mass=10.0 ** rng.uniform(-3, 0, len(net.mass)))
    system = System(net, [Bending(stiffness=2.0, clamp=clamp)], np.zeros((len(net.points), 3), dtype=bool))
    return system, size * rng.standard_normal(net.points.shape)


@pytest.mark.parametrize("clamp", [None, (1, 4)])
@pytest.mark.parametrize("size", [0.0, 0.02, 0.1, 0.3])
def test_bound_bounds(size, clamp):
    for seed in range(5):
        system, x = skew_system(seed, size=size, clamp=clamp)
        K = system.pattern.matrix(system.stiffness(0.0, x)).toarray()
        largest = scipy.linalg.eigvalsh(K, np.diag(np.repeat(system.net.mass, 3)))[-1]
        assert CentralDifference(system).bound(x, reach=0.0) <= 2.0 / np.sqrt(largest) * (1.0 + 1e-12)


@pytest.mark.parametrize("angle", [0.0, 1e-8, 1e-3, 0.0316, 0.0317, 0.5, 1.6, 2.5, 3.1, 3.1415])
def test_tangent_at_every_angle(angle):
    """Energy and its first two derivatives along a line, against mpmath."""
    net = discretisation.build(chain(2, 2.0, supports=[]).web(), bar())
    system = System(net, [Bending(stiffness=3.0)], np.zeros((3, 3), dtype=bool))
    turned = np.array([[0.0, 0.0, 0.0], [0.7, 0.0, 0.0], [0.7 + 1.3 * np.cos(angle), 0.0, 1.3 * np.sin(angle)]])
    x, rng = turned - net.points, np.random.default_rng(7)
    d = rng.standard_normal((3, 3))

    def energy(h):
        p = [
            [mpmath.mpf(float(net.points[i, k])) + float(x[i, k]) + h * float(d[i, k]) for k in range(3)]
            for i in (0, 1, 2)
        ]
        a, b = ([p[i + 1][k] - p[i][k] for k in range(3)] for i in (0, 1))
        n = [a[k - 2] * b[k - 1] - a[k - 1] * b[k - 2] for k in range(3)]
        sine, cosine = mpmath.sqrt(sum(c * c for c in n)), sum(u * w for u, w in zip(a, b, strict=True))
        return mpmath.mpf(3) / 2 * mpmath.atan2(sine, cosine) ** 2

    with mpmath.workdps(40):
        value, first, second = (float(mpmath.diff(energy, 0, n, h=mpmath.mpf("1e-12"))) for n in (0, 1, 2))
    K = system.pattern.matrix(system.stiffness(0.0, x)).toarray()
    # Rounding of the turned positions, which the reference has as well, is 1e-16; near a fold it is over sin θ.
    folded = 1.0 / max(np.sin(angle), 0.1)
    np.testing.assert_allclose(system.energy(0.0, x), value, rtol=1e-14, atol=1e-30)
    np.testing.assert_allclose(-(system.force(0.0, x) * d).sum(), first, rtol=1e-13 * folded, atol=1e-15)
    np.testing.assert_allclose(d.ravel() @ K @ d.ravel(), second, rtol=1e-12 * folded**2)
    np.testing.assert_allclose(K, K.T, atol=1e-13 * np.abs(K).max())


def test_a_fold_is_finite():
    """½ (B/L̄) π² where a line is folded back onto itself, or an element has no length; forces B π/(L̄ |a|) beside it."""
    net = discretisation.build(chain(2, 2.0, supports=[]).web(), bar())
    system = System(net, [Bending(stiffness=3.0)], np.zeros((3, 3), dtype=bool))
    fold = np.array([[0.0] * 3, [0.0] * 3, [-1.5, 0.0, 0.0]])
    np.testing.assert_allclose(system.energy(0.0, fold), 1.5 * np.pi**2, rtol=1e-15)
    beside = fold + [[0.0] * 3, [0.0] * 3, [0.0, 1e-9, 0.0]]
    np.testing.assert_allclose(system.force(0.0, beside)[0], [0.0, -3.0 * np.pi, 0.0], atol=1e-6)
    np.testing.assert_allclose(system.force(0.0, beside)[2], [0.0, 6.0 * np.pi, 0.0], atol=1e-6)
    for x in (fold, np.array([[1.0, 0.0, 0.0], [0.0] * 3, [0.0] * 3])):
        for definite in (False, True):
            assert np.isfinite(system.stiffness(0.0, x, definite=definite)).all()
        assert np.isfinite(system.force(0.0, x)).all() and np.isfinite(system.energy(0.0, x))


def test_tiny_deflections_keep_their_digits():
    """(k/L²) (1, −2, 1) of the force at a deflection of 1e-17 m, where positions of a metre end at 1e-16."""
    net = discretisation.build(chain(2, 2.0, supports=[]).web(), bar())
    system = System(net, [Bending(stiffness=3.0)], np.zeros((3, 3), dtype=bool))
    x = np.zeros((3, 3))
    x[1, 2] = 1e-17
    np.testing.assert_allclose(system.force(0.0, x)[:, 2], 6e-17 * np.array([1.0, -2.0, 1.0]), rtol=1e-14)


@pytest.mark.parametrize("mesh, through", [("square", 2), ("triangle", 3)])
@pytest.mark.parametrize("pieces", [1, 3])
def test_springs_of_webs(mesh, through, pieces):
    """Lines run on through every node that has all of its lines, and within each divided line."""
    web = refweb.Window(mesh=mesh, rows=6, columns=6, side=0.2).web()
    net = discretisation.build(web, refweb.Cable(modulus=7e7, area=1e-4, density=1.0, subdivide=pieces))
    rows, elements = springs(net)
    inner = np.bincount(rows[:, 1], minlength=len(net.points))
    full = np.bincount(web.lines.ravel()) == 2 * through
    assert full.sum() > 10 and (inner[: len(web.points)][full] == through).all()
    assert (inner[len(web.points) :] == 1).all() and inner[len(web.points) :].size == (pieces - 1) * len(web.lines)
    ends = np.sort(net.cells[elements].reshape(-1, 4), axis=1)
    assert all(set(e) == set(r) for e, r in zip(ends.tolist(), rows.tolist(), strict=True))
    straight = rows[full[np.minimum(rows[:, 1], len(full) - 1)] | (rows[:, 1] >= len(full))]
    a, b = (net.points[straight[:, i + 1]] - net.points[straight[:, i]] for i in (0, 1))
    assert np.abs(np.cross(a, b)).max() < 1e-15


def ring(count):
    angle = 2.0 * np.pi * np.arange(count) / count
    points = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(count)]).tolist()
    return refweb.Inline(points=points, lines=[[i, (i + 1) % count] for i in range(count)], supports=[])


def star(*degrees):
    """Lines from node 0 at angles from −x: the first ends there."""
    angles = np.radians(degrees)
    points = [[0.0, 0.0, 0.0], *np.column_stack([np.cos(angles), np.sin(angles), 0.0 * angles]).tolist()]
    return refweb.Inline(points=points, lines=[[0, i + 1] for i in range(len(degrees))], supports=[])


@pytest.mark.parametrize(
    "web, expected",
    [
        (ring(12), 12),  # 30° exactly
        (star(180.0, 15.0, -15.0), {(1, 2), (1, 3)}),  # a fork: each branch continues the stem
        (star(180.0, 5.0, -20.0), {(1, 2), (1, 3)}),
        (star(180.0, 0.0, 190.0, 10.0), {(1, 2), (3, 4)}),  # two lines that cross at 10°
        (star(180.0, 31.0, 0.0), {(1, 3)}),
    ],
)
def test_every_end_takes_the_line_that_continues_it_best(web, expected):
    rows, _ = springs(discretisation.build(web.web(), bar()))
    if isinstance(expected, int):
        assert len(rows) == expected
    else:
        assert {tuple(sorted(pair)) for pair in rows[:, [0, 2]].tolist()} == expected and len(rows) == len(expected)


def test_stiffness_is_over_the_mean_length():
    points = [[0, 0, 0], [1, 0, 0], [4, 0, 0]]
    web = refweb.Inline(points=points, lines=[[0, 1], [1, 2]], natural_length=[1.5, 2.5], supports=[])
    (term,) = System(
        discretisation.build(web.web(), bar()), [Bending(stiffness=3.0)], np.zeros((3, 3), dtype=bool)
    ).terms
    np.testing.assert_array_equal(term.data[:, 0], [1.5])


def test_free_beam_keeps_momentum_and_energy():
    """Bent far and thrown, as a rod of many springs: book of order 2, angular momentum kept."""
    web, rng = chain(8, supports=[]).web(), np.random.default_rng(3)
    held = np.zeros((9, 3), dtype=bool)
    system = nets.system(web, bar(100.0), [Bending(stiffness=0.1)], False, held)
    angle = np.linspace(0.0, 1.5 * np.pi, 9)[:, None]
    x = np.hstack([np.sin(angle), 1.0 - np.cos(angle), 0.0 * angle]) / (1.5 * np.pi) - web.points
    v, mass = rng.standard_normal((9, 3)), system.net.mass[:, None]
    drifts, safeties = [], (0.2, 0.1, 0.05, 0.025)
    for safety in safeties:
        solver = CentralDifference(system, safety=safety)
        run = solver.start(x, v)
        solver.advance(run, np.linspace(0.0, 0.5, 11)[1:])
        before, after = (np.cross(web.points + u, mass * w).sum(axis=0) for u, w in ((x, v), (run.x, run.v)))
        np.testing.assert_allclose(after, before, atol=1e-12)
        drifts.append(run.drift)
    assert abs(slope(drifts, safeties) - 2.0) < 0.1


def test_refusals():
    square = refweb.Window(mesh="square", rows=4, columns=4, side=0.2)
    hexagon = refweb.Window(mesh="hexagon", rows=4, columns=4, side=0.2)
    cable = refweb.Cable(modulus=7e7, area=1e-4, density=1.0)
    scene = refweb.Scene(web=hexagon, cable=cable, effects=[Bending(stiffness=1.0)])
    with pytest.raises(InputError, match=r"\[bending\] stiffness = 1 bends nothing: no line .* subdivide > 1"):
        scene.build()
    scene.replace(cable=replace(cable, subdivide=2)).build()
    with pytest.raises(
        InputError, match=r"\[bending\] stiffness = 1 needs \[cable\] order = 1, not 2: .*subdivide = 2"
    ):
        scene.replace(web=square, cable=replace(cable, order=2)).build()
    with pytest.raises(InputError, match=r"stiffness = 0.0 must be > 0 \[N·m²\]"):
        Bending(stiffness=0)
    with pytest.raises(InputError, match=r'\[bending\] clamp = "midle" names no node, did you mean "middle"'):
        clamped(2).replace(web=chain(2, names={"middle": [1]}), effects=[Bending(stiffness=1.0, clamp="midle")]).build()
    hub = [refweb.Body(name="hub", radius=0.1, mass=1.0, position=(1.0, 0.0, 0.0)), refweb.Attach(body="hub", node=2)]
    with pytest.raises(InputError, match=r"\[bending\] clamp = 2 is a node on a free body, .* attach the next node"):
        clamped(2, [2], effects=hub, solve=refweb.Dynamic(duration=1.0)).build()
