"""Static equilibrium: the paper's three webs, closed forms, certificates, refusals.

Two tolerances are the solver's own. The residual, the largest force left on a free node, is at most 1e-9 of the largest
load, weight or tension; it is below 1e-10 unless rounding stands in the way. A displacement error follows from it and
the stiffness, which the tests bound by hand.
"""

import functools
import itertools

import mpmath
import numpy as np
import pytest
import scipy.sparse
from nets import LAWS, skew_cable, skew_web, system
from oracle import Oracle

import refweb
from refweb.effects.gravity import Gravity
from refweb.effects.load import Load
from refweb.effects.motion import Motion
from refweb.net.cable import Cable
from refweb.net.lattices import Paper, Window
from refweb.net.single_cable import SingleCable
from refweb.net.web import Web
from refweb.results.state import State
from refweb.statics import load_steps
from refweb.statics.duality_bound import duality_bound
from refweb.statics.equilibrium import Equilibrium
from refweb.statics.newton import Newton

RESIDUAL = 1e-9
GAP = 1e-10
PAPER = dict(modulus=7e7, area=1e-4, density=200.0)
MESHES = ("triangle", "square", "hexagon")
SMOOTHINGS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
EACH = [1e-2, *(pytest.param(smoothing, marks=pytest.mark.slow) for smoothing in (1e-3, 1e-4, 1e-5)), 1e-6, 0.0]
EPS = np.finfo(float).eps


def law(smoothing):
    """The paper's law at ε0 = 0; its limit for a smoothing of 0."""
    return dict(law="smooth", smoothing=smoothing) if smoothing else dict(law="tension-only")


def solve(net_system, steps=(1.0,)):
    return list(load_steps.solve(net_system, steps))


def relative_gap(net_system, found):
    """Duality gap over |Π|."""
    return found.duality_bound.gap / abs(net_system.energy(found.step, found.x))


def joined(points, pairs, natural_length, rim, cable, *effects, **options):
    """System of a few lines."""
    web = Web(points=points, lines=pairs, natural_length=natural_length, rim=rim)
    return system(web, cable, effects, **options)


# The paper's three webs, 1 to 5 N at the centre, from flat.


@functools.cache
def paper_web(mesh):
    return Paper(mesh=mesh, cable_length=201.4).web()


def paper_system(mesh, smoothing, **options):
    cable = Cable(**law(smoothing), **PAPER, **options)
    return system(paper_web(mesh), cable, [Load(node="centre", force=(0.0, 0.0, 1.0))])


@functools.cache
def paper_series(mesh, smoothing):
    """Equilibria at 1 to 5 N and their gaps over |Π|."""
    net_system = paper_system(mesh, smoothing)
    found = solve(net_system, (1, 2, 3, 4, 5))
    return found, [] if smoothing else [relative_gap(net_system, f) for f in found]


def deflection(mesh, found):
    return found.x[paper_web(mesh).centre, 2]


@pytest.mark.ordinary("triangle-0.01", "triangle-1e-06", "triangle-0.0", "square-0.01", "square-1e-06", "square-0.0")
@pytest.mark.parametrize("smoothing", EACH)
@pytest.mark.parametrize("mesh", MESHES)
def test_paper_webs_from_flat(mesh, smoothing):
    """The work promised for every web and smoothing: 25 factorizations from flat, 35 without smoothing, then 8 each.

    The count includes those of the pivot check. A net under a normal load is taut or slack, not compressed: K has no
    negative pivot. Where slack lines push a little, under the floor of the law, a second start takes as many again,
    and more where the floor is so high that the net without it stands elsewhere.
    """
    found, gaps = paper_series(mesh, smoothing)
    counts, most = [f.stats["nlu"] for f in found], 2.5 if any((f.tension < 0.0).any() for f in found) else 1.0
    assert counts[0] <= most * (25 if smoothing else 35) and max(counts[1:]) <= most * 8, counts
    assert max(f.stats["residual"] for f in found) <= RESIDUAL
    assert all(gap <= GAP for gap in gaps)
    if smoothing:
        assert [f.stats["smallest_pivot"] for f in found] == [1] * 5


@pytest.mark.ordinary("*-0.0")
@pytest.mark.parametrize("smoothing", EACH)
@pytest.mark.parametrize("step", range(5))
def test_paper_webs_compared(smoothing, step):
    """As in the paper: the hexagon web yields most and is stressed least."""
    found = {mesh: paper_series(mesh, smoothing)[0][step] for mesh in MESHES}
    down = {mesh: deflection(mesh, f) for mesh, f in found.items()}
    assert 0.0 < down["triangle"] < down["square"] < down["hexagon"]
    assert found["hexagon"].tension.max() < found["square"].tension.max() < found["triangle"].tension.max()


@pytest.mark.ordinary("triangle")
@pytest.mark.parametrize("mesh", MESHES)
def test_smoothing_converges_to_tension_only_at_first_order(mesh):
    """|deflection(η) − deflection(0)| ~ η, of order 1 without a logarithm.

    For ε0 = 0 and ε ≫ η the law is σ = E(ε − η + η²/ε − ...): every taut line is short of the tension EAη, the floor
    α = η, which the net answers in proportion. The next term is η/ε smaller. Strains of these webs under 1 N are around
    4e-5 (square, triangle) and 1.3e-4 (hexagon), hence the order is seen below η ≈ 1e-6 only, and between 1e-6 and 1e-8
    it may differ from 1 by (1e-6/4e-5)/ln(100) = 0.005 or so times a factor of order one: 0.02 is allowed.
    """
    smoothings = np.array([1e-6, 1e-7, 1e-8])
    limit = deflection(mesh, paper_series(mesh, 0.0)[0][0])
    error = [abs(deflection(mesh, solve(paper_system(mesh, eta))[0]) - limit) for eta in smoothings]
    order = np.polyfit(np.log(smoothings), np.log(error), 1)[0]
    print(f"{mesh}: fitted order {order:.4f}")
    assert abs(order - 1) <= 0.02
    # Over the whole series the error falls from each η to the next.
    series = [abs(deflection(mesh, solve(paper_system(mesh, eta))[0]) - limit) for eta in SMOOTHINGS[::2]]
    assert (np.diff(series) < 0).all()


@pytest.mark.slow
def test_smoothing_acts_like_cable_longer_by_its_amount():
    """In the hexagon web, all taut, the tension EA(ε − η) is that of the tension-only law with L(1 + η) in place of L.

    The two differ by η/ε ≈ 1e-7/1.3e-4 < 1e-3 of the effect, times a factor of order one.
    """
    at_rest = deflection("hexagon", paper_series("hexagon", 0.0)[0][0])
    smooth = deflection("hexagon", solve(paper_system("hexagon", 1e-7))[0]) - at_rest
    longer = deflection("hexagon", solve(paper_system("hexagon", 0.0, prestrain=-1e-7))[0]) - at_rest
    assert abs(smooth / longer - 1) <= 5e-3


# Closed forms.


@pytest.mark.parametrize("name", ["tension-only", "linear"])
@pytest.mark.parametrize("natural_length", [1.0, 0.99, 0.9, 1.01, 1.2])
@pytest.mark.parametrize("load", [1e-6, 1e-2, 10.0])
def test_two_links_under_a_centre_load(name, natural_length, load):
    """Flat, prestressed or a slack V: 2 T sin θ = F with T = EA (l/L − 1), sin θ = h/l, l² = 1 + h².

    F(h) is convex from where it is zero, so that h F' ≥ F: a force r left on the node moves it by at most r h/F, and
    changes T = F/(2 sin θ) by at most 2 r/F of itself. r is 1e-10 of the larger of F and T, or rounding of EA.
    """
    axial = 100.0
    cable = Cable(law=name, modulus=1e6, area=1e-4, density=0.0)
    points = [[-1, 0, 0], [0, 0, 0], [1, 0, 0]]
    net_system = joined(
        points, [[0, 1], [1, 2]], [natural_length] * 2, [0, 2], cable, Load(node=1, force=(0.0, 0.0, load))
    )
    (found,) = solve(net_system)
    with mpmath.workdps(40):
        natural, force = mpmath.mpf(float(natural_length)), mpmath.mpf(load)

        def mismatch(h):
            length = mpmath.sqrt(1 + h * h)
            return 2 * axial * (length / natural - 1) * h / length - force

        least = mpmath.sqrt(max(natural**2 - 1, 0))
        height = mpmath.findroot(mismatch, (least, least + 10), solver="bisect", maxsteps=1000)
        tension = axial * (mpmath.sqrt(1 + height**2) / natural - 1)
        left = (1e-10 * max(tension, force) + 4 * EPS * axial) / force
    assert abs(found.x[1, 2] - height) <= left * height
    assert np.abs(found.x[1, :2]).max() <= left * height
    assert np.abs(found.tension - float(tension)).max() <= 2 * left * tension
    assert found.stats["residual"] <= RESIDUAL


def test_hanger_of_three_cables_of_which_one_is_slack():
    """Two taut cables in a plane carry the load; the third, long enough, hangs loose, and its tension is exactly zero.

    Two equations for the node's position. The cables enclose about 90°, so that its stiffness is at least EA/(2 L) in
    any direction of the plane, and a residual of 1e-10 of the load of 2 N moves it by 1e-10 · 2 · 2L/EA < 1e-11 m.
    """
    ends, natural = np.array([[-1.0, 0.0, 1.0], [1.0, 0.0, 0.8], [0.2, 0.3, 1.0]]), [1.3, 1.2, 1.5]
    points, weight, axial = [[0.0, 0.0, 0.0], *ends.tolist()], 2.0, 100.0
    cable = Cable(law="tension-only", modulus=1e6, area=1e-4, density=0.0)
    load = Load(node=0, force=(0.0, 0.0, -weight))
    (found,) = solve(joined(points, [[0, 1], [0, 2], [0, 3]], natural, [1, 2, 3], cable, load))

    def tensions(x, z):
        vectors = [(mpmath.mpf(ends[i, 0]) - x, mpmath.mpf(ends[i, 2]) - z) for i in range(2)]
        lengths = [mpmath.sqrt(a * a + b * b) for a, b in vectors]
        return (
            vectors,
            lengths,
            [axial * (length / mpmath.mpf(n) - 1) for length, n in zip(lengths, natural, strict=False)],
        )

    def balance(x, z):
        vectors, lengths, tension = tensions(x, z)
        pulls = [(t * a / length, t * b / length) for (a, b), length, t in zip(vectors, lengths, tension, strict=True)]
        return [sum(p[0] for p in pulls), sum(p[1] for p in pulls) - weight]

    with mpmath.workdps(40):
        x, z = mpmath.findroot(balance, (0.0, 0.0))
        tension = [float(t) for t in tensions(x, z)[2]]
    assert min(tension) > 0 and np.linalg.norm(ends[2] - [float(x), 0.0, float(z)]) < natural[2]
    assert found.tension[2] == 0.0
    np.testing.assert_allclose(found.x[0], [float(x), 0.0, float(z)], atol=1e-11, rtol=0)
    np.testing.assert_allclose(found.tension[:2], tension, atol=1e-9, rtol=0)
    assert (np.abs(found.tension[:2] - tension) <= found.duality_bound.tension[:2]).all()


def polygon(links, length, axial, weight, span):
    """Exact equilibrium polygon of equal elastic links with equal weights at the joints, from (0, 0) to ``span``.

    Link i pulls with (H, V + i w); shooting for H and V in 30 digits. Returns joints (links + 1, 2), tensions and H.
    """
    with mpmath.workdps(30):
        each, weight = mpmath.mpf(length) / links, mpmath.mpf(weight)

        def vectors(H, V):
            for i in range(links):
                vertical = V + i * weight
                tension = mpmath.sqrt(H * H + vertical * vertical)
                stretched = each * (1 + tension / axial)
                yield stretched * H / tension, stretched * vertical / tension, tension

        def miss(H, V):
            found = list(vectors(H, V))
            return sum(f[0] for f in found) - span[0], sum(f[1] for f in found) - span[1]

        total = weight * links
        H, V = mpmath.findroot(miss, (total / 3, -total / 2))
        dx, dz, tension = zip(*vectors(H, V), strict=True)
        joints = np.array(
            [[0.0, 0.0], *zip(itertools.accumulate(dx), itertools.accumulate(dz), strict=True)], dtype=float
        )
        return joints, np.array(tension, dtype=float), float(H)


@pytest.mark.ordinary(
    "0.0-700000.0-tension-only", "0.7-70000000.0-linear", "0.0-7000000000.0-linear", "0.7-7000000000.0-tension-only"
)
@pytest.mark.parametrize("name", ["tension-only", "linear"])
@pytest.mark.parametrize("modulus", [7e5, 7e7, 7e9])
@pytest.mark.parametrize("drop", [0.0, 0.7])
def test_chain_of_100_links_is_the_exact_polygon(name, modulus, drop):
    """The links of a chain 4 m long over 3 m are straight and its weights at the joints: the discrete polygon is exact.

    The stiffness of a taut chain is at least H/l of the graph's Laplacian, whose smallest eigenvalue for n links is
    4 sin²(π/2n). So positions are off by at most |r|/(4 sin²(π/2n) H/l), r the forces left on the joints; they are
    computed here from the positions found, and have a rounding of 1e-16 EA each. In truth the positions are better: a
    last step squares the solver's error away, and r is what the stiff links make of rounded positions, 1e-16 m in each
    of 100 links. 1e-12 m is a hundred times their sum.
    """
    links, length, span, density = 100, 4.0, (3.0, drop), 500.0
    start, end = (0.0, 0.0, 0.0), (span[0], 0.0, drop)
    web = SingleCable(start=start, end=end, length=length, elements=links).web()
    cable = Cable(law=name, modulus=modulus, area=1e-4, density=density)
    net_system = system(web, cable, [Gravity(acceleration=(0.0, 0.0, -9.81))])
    (found,) = solve(net_system)
    axial, weight = modulus * 1e-4, density * 1e-4 * length / links * 9.81
    joints, tension, H = polygon(links, length, axial, weight, span)
    position = web.points + found.x
    lines = Oracle(web, cable).force(found.x)
    left = (lines - [0.0, 0.0, weight])[1:-1]
    stiffness = H / (length / links * (1 + tension.max() / axial)) * 4 * np.sin(np.pi / (2 * links)) ** 2
    allowed = (np.linalg.norm(left) + EPS * axial * np.sqrt(links)) / stiffness
    print(f"{name}, E = {modulus:g}: {np.abs(position[:, [0, 2]] - joints).max():.1e} m of {allowed:.1e} m allowed")
    assert np.abs(position[:, [0, 2]] - joints).max() <= min(allowed, 1e-12)
    np.testing.assert_allclose(found.tension, tension, rtol=1e-9 + EPS * axial / H * links)


def irvine(length, axial, weight, span):
    """Irvine's elastic catenary under its weight per natural length: s ↦ (x, z), from (0, 0) to (span, 0).

    Level ends: the support carries half the weight, and one equation gives H.
    """
    half = weight / 2

    def along(H, s, asinh, sqrt):
        rest = half - weight * s / length
        x = H * s / axial + H * length / weight * (asinh(half / H) - asinh(rest / H))
        root = sqrt(1 + (half / H) ** 2) - sqrt(1 + (rest / H) ** 2)
        z = weight * s / axial * (half / weight - s / (2 * length)) + H * length / weight * root
        return x, -z

    H = mpmath.findroot(lambda H: along(H, length, mpmath.asinh, mpmath.sqrt)[0] - span, weight / 3)
    return lambda s: np.stack(along(float(H), s, np.arcsinh, np.sqrt), axis=-1)


def test_linear_elements_on_the_elastic_catenary_are_of_second_order():
    """L2 error over natural arc length of the piecewise linear curve, on a cable that stretches by about 10 %.

    The interpolant of a smooth curve is of order 2 and so are the nodes of lumped weights; the next term is of order 4,
    (1/20)² of the first on the coarsest mesh, far inside ± 0.1.
    """
    length, span, axial, density, gravity = 4.0, 3.0, 10.0, 500.0, 9.81
    exact = irvine(length, axial, density * 1e-4 * gravity * length, span)
    xi, weights = np.polynomial.legendre.leggauss(6)
    xi, weights = (xi + 1) / 2, weights / 2
    counts, errors = np.array([20, 40, 80, 160]), []
    for n in counts:
        web = SingleCable(start=(0.0, 0.0, 0.0), end=(span, 0.0, 0.0), length=length, elements=int(n)).web()
        cable = Cable(law="tension-only", modulus=axial / 1e-4, area=1e-4, density=density)
        (found,) = solve(system(web, cable, [Gravity(acceleration=(0.0, 0.0, -gravity))]))
        nodes = (web.points + found.x)[:, [0, 2]]
        s = (np.arange(n)[:, None] + xi) * length / n
        linear = nodes[:-1, None] * (1 - xi[:, None]) + nodes[1:, None] * xi[:, None]
        errors.append(np.sqrt(np.sum(weights * ((linear - exact(s)) ** 2).sum(axis=-1)) * length / n))
    order = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    print(f"fitted order {order:.3f}, errors {errors} m")
    assert abs(order - 2) <= 0.1


# The certificate.


def small_web(mesh="square", prestrain=-0.02, rows=6, name="tension-only"):
    """A slack window under gravity and an oblique load, soft enough that strains are a few per cent."""
    web = Window(mesh=mesh, rows=rows, columns=rows, side=0.1).web()
    cable = Cable(law=name, modulus=1e5, area=1e-4, density=200.0, prestrain=prestrain)
    effects = [Load(node="centre", force=(0.1, 0.05, 0.5)), Gravity(acceleration=(0.0, 0.0, -9.81))]
    return system(web, cable, effects)


@pytest.mark.parametrize("mesh", MESHES)
@pytest.mark.parametrize("prestrain", [-0.05, 0.0, 0.05])
def test_certificate_contains_the_solution_of_a_conic_solver(mesh, prestrain):
    """min Σ ½ k z² − f·u with |d| ≤ L + z, z ≥ 0, solved by an interior-point method that knows nothing of cables.

    Its own gap p − d bounds its tensions by √(2 k (p − d)), for the same reason as ours does. It stops where rounding
    lets it gain no more, with constraints kept to some 1e-10, which makes 1e-10 |Π| of the energy: added to p − d.
    """
    clarabel = pytest.importorskip("clarabel")
    net_system = small_web(mesh, prestrain)
    (found,) = solve(net_system)
    net, free = net_system.net, net_system.free
    lines, unknowns = len(net.cells), len(free)
    stiffness = net.line_data.ea / net.natural_length
    load = sum(net_system.force_of(f, 1.0, np.zeros_like(found.x)) for f in net_system.terms if not f.balance.internal)
    vector = net.points[net.cells[:, 1]] - net.points[net.cells[:, 0]]
    row, one = np.arange(lines), np.ones(lines)
    incidence = scipy.sparse.coo_array(
        (np.concatenate([one, -one]), (np.tile(row, 2), net.cells.T[::-1].ravel())), (lines, net_system.rows)
    )
    difference = scipy.sparse.kron(incidence, scipy.sparse.eye_array(3), format="csc")[:, free]
    extension = scipy.sparse.eye_array(lines, format="csc")
    # Cone rows of each line: L + z, then its vector; before them z ≥ 0.
    order = np.argsort(np.concatenate([4 * row, (4 * row[:, None] + [1, 2, 3]).ravel()]))
    cones = scipy.sparse.block_array([[None, extension], [difference, None]], format="csr")[order]
    first = scipy.sparse.hstack([scipy.sparse.csc_array((lines, unknowns)), extension])
    A = -scipy.sparse.vstack([first, cones], format="csc")
    b = np.concatenate([np.zeros(lines), np.concatenate([net.natural_length, vector.ravel()])[order]])
    P = scipy.sparse.diags_array(np.concatenate([np.zeros(unknowns), stiffness]), format="csc")
    q = np.concatenate([-load.ravel()[free], np.zeros(lines)])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-12
    kinds = [clarabel.NonnegativeConeT(lines), *[clarabel.SecondOrderConeT(4)] * lines]
    matrices = (scipy.sparse.csc_matrix(P), q, scipy.sparse.csc_matrix(A), b)
    answer = clarabel.DefaultSolver(*matrices, kinds, settings).solve()
    energy = net_system.energy(1.0, found.x)
    assert "Solved" in str(answer.status)
    its_gap = abs(answer.obj_val - answer.obj_val_dual) + 1e-10 * abs(energy)
    tension = stiffness * np.array(answer.x)[unknowns:]
    print(f"energies {energy:.12g} and {answer.obj_val:.12g} J, gaps {found.duality_bound.gap:.1e} and {its_gap:.1e} J")
    assert abs(energy - answer.obj_val) <= found.duality_bound.gap + its_gap
    bound = found.duality_bound.tension + np.sqrt(2 * stiffness * its_gap)
    assert (np.abs(found.tension - tension) <= bound).all()


@pytest.mark.parametrize("prestrain", [-0.05, 0.0, 0.05])
@pytest.mark.parametrize("size", [1e-12, 1e-9, 1e-6, 1e-4, 1e-2])
def test_certificate_holds_away_from_the_equilibrium(prestrain, size):
    """It bounds the error of whatever positions it is given, not only of those that Newton's method returns."""
    net_system = small_web(prestrain=prestrain)
    (best,) = solve(net_system)
    least, own = net_system.energy(1.0, best.x), best.duality_bound
    stored = net_system.energy_of(net_system.lines, 1.0, best.x).sum()
    for seed in range(5):
        x = best.x.copy()
        x.ravel()[net_system.free] += size * np.random.default_rng(seed).standard_normal(len(net_system.free))
        force, seen = net_system.forces(1.0, x)
        found = duality_bound(net_system, Equilibrium(1.0, x, seen.tension.copy(), force))
        error = net_system.energy(1.0, x) - least
        # Energies of this size are sums of a hundred terms: rounding of 1e-15 of them.
        assert -own.gap - 1e-15 <= error <= found.gap + 1e-15
        assert (np.abs(seen.tension - best.tension) <= found.tension + own.tension).all()
        energy = net_system.energy_of(net_system.lines, 1.0, x).sum()
        assert abs(energy - stored) <= found.strain_energy + own.strain_energy


@pytest.mark.parametrize("seed", range(5))
def test_gap_of_a_hanging_line_is_its_energy_above_the_least(seed):
    """A line with a weight F balances in one way only: the dual value is Π* = −F²/2k exactly, and the gap is Π − Π*.

    Energies count from the start at depth L, where f·x = 0. All terms are of order 1 J, with a few roundings each.
    """
    axial, length, weight = 100.0, 2.0, 3.0
    points, cable = [[0, 0, 0], [0, 0, -length]], Cable(law="tension-only", modulus=1e6, area=1e-4, density=0.0)
    net_system = joined(points, [[0, 1]], None, [0], cable, Load(node=1, force=(0.0, 0.0, -weight)))
    x = np.zeros((2, 3))
    x[1] = np.random.default_rng(seed).standard_normal(3)
    force, seen = net_system.forces(1.0, x)
    found = duality_bound(net_system, Equilibrium(1.0, x, seen.tension.copy(), force))
    stretched = max(np.linalg.norm(points[1] + x[1]) - length, 0.0)
    above = axial / length * stretched**2 / 2 + weight * x[1, 2] + weight**2 * length / axial / 2
    assert found.gap == pytest.approx(above, rel=1e-13, abs=1e-14)
    assert abs(seen.tension[0] - weight) <= found.tension[0]


@pytest.mark.parametrize("share", [1e-1, 1e-2, 1e-3, 1e-4])
def test_the_bound_on_strain_energy_is_sharp(share):
    """A line along its weight F, stretched by a share δ too much: T − F = δF, and all bounds are met but for O(δ²).

    The energy is off by (T² − F²)/2k = (2δ + δ²) F²/2k, of which the bound 2 √(U gap) + gap is (2δ + 3δ²) F²/2k.
    """
    axial, length, weight = 100.0, 2.0, 3.0
    points, cable = [[0, 0, 0], [0, 0, -length]], Cable(law="tension-only", modulus=1e6, area=1e-4, density=0.0)
    net_system = joined(points, [[0, 1]], None, [0], cable, Load(node=1, force=(0.0, 0.0, -weight)))
    stiffness, x = axial / length, np.zeros((2, 3))
    x[1, 2] = -(1.0 + share) * weight / stiffness
    force, seen = net_system.forces(1.0, x)
    found = duality_bound(net_system, Equilibrium(1.0, x, seen.tension.copy(), force))
    unit = 0.5 * weight**2 / stiffness
    allowed = 1e-15 / share**2  # a few roundings of energies, over the gap δ² F²/2k
    assert found.strain_energy == pytest.approx((2.0 * share + 3.0 * share**2) * unit, rel=allowed)
    assert found.tension[0] == pytest.approx(share * weight, rel=allowed)


def test_the_gap_holds_the_rounding_of_positions():
    """Under loads whose stretch F/k is no double Π(x) lies above Π* = −F²/2k, though T is F to the last bit.

    In exact arithmetic Π(x) − Π* = ½ k (x − F/k)², of which a gap of computed forces alone knows nothing.
    """
    axial, length, unseen = 100.0, 2.0, 0
    points, cable = [[0, 0, 0], [0, 0, -length]], Cable(law="tension-only", modulus=1e6, area=1e-4, density=0.0)
    for weight in np.random.default_rng(0).uniform(0.5, 5.0, 40):
        net_system = joined(points, [[0, 1]], None, [0], cable, Load(node=1, force=(0.0, 0.0, -weight)))
        (found,) = solve(net_system)
        with mpmath.workdps(60):
            stiffness = mpmath.mpf(net_system.net.line_data.ea[0]) / mpmath.mpf(length)
            off = -mpmath.mpf(float(found.x[1, 2])) - mpmath.mpf(float(weight)) / stiffness
            above = stiffness * off**2 / 2
        assert found.duality_bound.gap >= above, weight
        # By computed forces alone the gap is that of T − F, as doubles.
        unseen += (found.tension[0] - weight) ** 2 / (2.0 * axial / length) < above
        energy = 0.5 * weight**2 / (axial / length)
        assert found.duality_bound.gap < 1e-14 * energy and found.x[1, :2].tolist() == [0.0, 0.0]
    assert unseen > 0


# Any start, load, slackness.


@pytest.mark.parametrize("seed", range(3))
def test_tensions_do_not_depend_on_the_start(seed):
    net_system = small_web()
    (flat,) = solve(net_system)
    newton, start = Newton(net_system), flat.x.copy()
    start.ravel()[net_system.free] += 0.03 * np.random.default_rng(seed).standard_normal(len(net_system.free))
    other = newton.solve(1.0, start)
    other.duality_bound = duality_bound(net_system, other)
    assert (np.abs(other.tension - flat.tension) <= other.duality_bound.tension + flat.duality_bound.tension).all()


@pytest.mark.parametrize("mesh", MESHES)
@pytest.mark.parametrize("steps", [(1, -1), (1, 0, -1), (0, -1)])
def test_load_reversal_ends_at_the_mirror_image(mesh, steps):
    """A flat web has no side: −F gives the mirror image, through any states before.

    As for two links, a residual of 1e-10 of the largest tension, some ten times the load, moves a node by about 1e-9 of
    the deflection; 1e-8 for nodes with less stiffness than the loaded one.
    """
    web = Window(mesh=mesh, rows=8, columns=8, side=0.1).web()
    cable = Cable(law="tension-only", **PAPER)
    load = Load(node="centre", force=(0.0, 0.0, 1.0))
    (up,) = solve(system(web, cable, [load]))
    found = solve(system(web, cable, [load]), steps)
    allowed = 1e-8 * up.x[web.centre, 2]
    np.testing.assert_allclose(found[-1].x, up.x * [1.0, 1.0, -1.0], rtol=0, atol=allowed)
    for state, step in zip(found, steps, strict=True):
        assert state.stats["residual"] <= RESIDUAL
        # Without load nothing is tense; a flat web balances what is left, of the size of residuals.
        assert step or (state.tension <= state.duality_bound.tension).all()
        assert step or state.tension.max() <= 10.0 * RESIDUAL * up.tension.max()


@pytest.mark.ordinary(
    "load-triangle",
    "load-square",
    "gravity-triangle",
    "gravity-square",
    "both-triangle",
    "both-square",
    "in plane-triangle",
    "in plane-square",
)
@pytest.mark.parametrize("mesh", MESHES)
@pytest.mark.parametrize("acting", ["load", "gravity", "both", "in plane"])
def test_slack_webs(mesh, acting):
    """Webs 5 % too long, in which Newton's method alone wanders: the certificate says that the answer is one."""
    web = Window(mesh=mesh, rows=10, columns=10, side=0.1).web()
    load, gravity = Load(node="centre", force=(0.5, 0.3, 1.0)), Gravity(acceleration=(0.0, 0.0, -9.81))
    pull = Load(node="centre", force=(1.0, 0.0, 0.0))
    effects = {"load": [load], "gravity": [gravity], "both": [load, gravity], "in plane": [pull]}[acting]
    net_system = system(web, Cable(law="tension-only", prestrain=-0.05, **PAPER), effects)
    (found,) = solve(net_system)
    assert found.stats["residual"] <= RESIDUAL
    assert relative_gap(net_system, found) <= GAP
    assert (found.tension >= 0.0).all()


def test_loads_over_fifteen_decades():
    """1e-9 N to 1e6 N on a flat web; small ones follow the membrane's power, T ~ F^(2/3).

    The power is exact for small strains, here up to those of 1e-3 N: T = 0.05 N of 7000 N is 7e-6, and corrections are
    a few times the strain. At 1e-9 N strains are 1e-9, which positions of 1 m could not hold to more than 7 digits.
    """
    web = Window(mesh="square", rows=10, columns=10, side=0.1).web()
    loads, largest = 10.0 ** np.arange(-9, 7, 3), []
    for load in loads:
        net_system = system(web, Cable(law="tension-only", **PAPER), [Load(node="centre", force=(0.0, 0.0, load))])
        (found,) = solve(net_system)
        assert found.stats["residual"] <= RESIDUAL and relative_gap(net_system, found) <= GAP
        largest.append(found.tension.max())
    np.testing.assert_allclose(np.diff(np.log10(largest[:3])), 2.0, rtol=0, atol=1e-4)


def test_slack_nodes_are_counted():
    """A loaded V and a line that dangles from it: nothing holds its end."""
    points = [[-1, 0, 0], [1, 0, 0], [0, 0, -0.5], [0, 0.2, -0.6]]
    net_system = joined(
        points,
        [[0, 2], [2, 1], [2, 3]],
        None,
        [0, 1],
        Cable(law="tension-only", **PAPER),
        Load(node=2, force=(0.0, 0.0, -1.0)),
    )
    (found,) = solve(net_system)
    assert State(net_system, 1.0, found.x).slack_nodes.tolist() == [3]
    assert found.stats["residual"] <= RESIDUAL and found.tension[2] == 0.0
    assert relative_gap(net_system, found) <= GAP


@pytest.mark.parametrize("name", LAWS)
def test_a_net_with_nothing_to_carry_ends_without_tension(name):
    """The skew net, stretched at first, can turn about its two supports until all is slack.

    Rounding of displacements of 1 m makes 1e-16 EA in lines of EA up to 60 N; a residual of 1e-9 allows for that.
    """
    (found,) = solve(system(skew_web(), skew_cable(name)))
    assert found.stats["residual"] <= RESIDUAL
    assert np.abs(found.tension).max() <= 10 * EPS * 60.0


# Refusals and free nets.


@pytest.mark.parametrize("name", LAWS)
def test_a_load_that_nothing_carries_is_refused_with_nodes_and_direction(name):
    points = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [5, 0, 0], [6, 0, 0]]
    pairs, cable = [[0, 1], [1, 2], [3, 4]], Cable(**LAWS[name], **PAPER)
    loads = [Load(node=1, force=(0.0, 0.0, 1.0)), Load(node=3, force=(0.0, -2.0, 0.0))]
    with pytest.raises(refweb.SolverError, match=r"mechanism of 2 nodes \(3, 4\) .* along y by -2 N .* no support"):
        solve(joined(points, pairs, None, [0, 2], cable, *loads))
    # A support in x alone carries nothing along y.
    supported = np.zeros((5, 3), dtype=bool)
    supported[[0, 2]] = True
    supported[3, 0] = True
    with pytest.raises(refweb.SolverError, match="along y"):
        solve(joined(points, pairs, None, [], cable, *loads, supported=supported))


@pytest.mark.parametrize("name", ["tension-only", "linear"])
@pytest.mark.parametrize("direction", [(1.0, 0.0, 0.0), (0.6, 0.0, 0.8)])
def test_a_balanced_free_net_is_allowed(name, direction):
    """Two opposite forces on a free line: it turns until it lies along them, and T = F.

    Its turning stiffness T/l is of order one here: its direction has the error of the residual, 1e-10 of T, and the
    tension a second-order one beside it.
    """
    pull = 3.0 * np.array(direction)
    loads = [Load(node=0, force=tuple(-pull)), Load(node=1, force=tuple(pull))]
    cable = Cable(law=name, modulus=1e5, area=1e-4, density=0.0)
    (found,) = solve(joined([[0, 0, 0], [1, 0, 0]], [[0, 1]], None, [], cable, *loads))
    assert found.tension[0] == pytest.approx(3.0, rel=1e-9)
    line = np.array([1.0, 0.0, 0.0]) + found.x[1] - found.x[0]
    np.testing.assert_allclose(line, 1.3 * np.array(direction), atol=1e-9, rtol=0)


# What the pivots say.


@pytest.mark.parametrize(
    "options, sign",
    [
        (dict(law="linear", prestrain=-0.05), -1),
        (dict(law="linear", prestrain=0.05), 1),
        (dict(law="linear"), 0),
        (dict(law="smooth", smoothing=1e-3, prestrain=-0.05), -1),
        (dict(law="smooth", smoothing=1e-3, prestrain=0.05), 1),
        (dict(law="smooth", smoothing=1e-3), 0),
    ],
)
def test_sign_of_the_smallest_pivot(options, sign):
    """A straight chain at rest would buckle under compression, is indifferent without tension, and firm with it."""
    web = SingleCable(start=(0.0, 0.0, 0.0), end=(1.0, 0.0, 0.0), elements=5).web()
    net_system = system(web, Cable(**options, **PAPER))
    newton = Newton(net_system)
    found = newton.solve(1.0, np.zeros((6, 3)))
    # The straight chain is in equilibrium up to the rounding of its tensions.
    assert np.abs(found.x).max() <= 1e-12
    assert newton.smallest_pivot(1.0, found.x, found.stats) == sign
    (found,) = solve(net_system)
    assert found.stats["smallest_pivot"] == sign


# Reactions.


@pytest.mark.parametrize("prestrain", [-0.05, 0.0])
@pytest.mark.parametrize("mesh", MESHES)
def test_reactions_balance_loads_and_moments(mesh, prestrain):
    """Reactions, loads and what is left on free nodes add up to zero, and so do their moments, to rounding.

    Each is a sum of a few hundred products, rounded to 1e-16 of the largest: 1e-12 of the sum of all leaves room. What
    is left on each free node is the residual.
    """
    net_system = small_web(mesh, prestrain)
    (found,) = solve(net_system)
    state = State(net_system, 1.0, found.x)
    load = sum(net_system.force_of(f, 1.0, found.x) for f in net_system.terms if not f.balance.internal)
    left = np.where(net_system.supported, 0.0, found.force)
    size = np.abs(state.reaction).sum() + np.abs(load).sum()
    reach = np.abs(state.position).max()
    assert not state.reaction[~net_system.supported].any()
    total = state.reaction + load - left
    assert np.abs(total.sum(axis=0)).max() <= 1e-12 * size
    assert np.abs(np.cross(state.position, total).sum(axis=0)).max() <= 1e-12 * size * reach
    assert np.linalg.norm(left, axis=1).max() <= RESIDUAL * max(found.tension.max(), np.abs(load).max())


@pytest.mark.parametrize("name", ["smooth", "linear"])
def test_work_of_reactions_is_the_energy_gained(name):
    """A node of a net is led along a path: ∫ R·du = E(end) − E(start), with the Gauss points of the path as load steps.

    Along a smooth branch the error of ten points is that of the forces: 1e-10 of the largest tension on each of the few
    nodes, times the path.
    """
    web, path = skew_web(), np.array([0.03, -0.02, -0.05])
    supported = np.zeros((6, 3), dtype=bool)
    supported[:4] = True
    motion = Motion(node=5, displacement=[(0.0, 0.0, 0.0, 0.0), (1.0, *path)])
    net_system = system(web, skew_cable(name), [motion], supported=supported)
    points, weights = np.polynomial.legendre.leggauss(10)
    found = solve(net_system, [0.0, *(points + 1) / 2, 1.0])
    power = [State(net_system, f.step, f.x).reaction[5] @ path for f in found[1:-1]]
    work = weights / 2 @ power
    gained = net_system.energy(1.0, found[-1].x) - net_system.energy(0.0, found[0].x)
    print(f"{work:.15g} J and {gained:.15g} J")
    assert abs(work - gained) <= 1e-9 * max(f.tension.max() for f in found) * np.linalg.norm(path)


def test_a_fixed_body_presses_a_slack_web():
    """The web starts inside the body and without tension: what balances is the contact, by both ways of solving."""
    ball = refweb.Body(name="ball", radius=0.1, position=(0.0, 0.0, -0.08), fixed=True)
    push = refweb.Observe(name="push", quantity="reaction", body="ball")
    held = refweb.Observe(name="held", quantity="reaction")
    pressed = refweb.Scene(
        web=refweb.Window(mesh="square", rows=4, columns=4, side=0.2),
        cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-4, density=200.0),
        effects=[ball, refweb.Contact(stiffness=1e5)],
        observe=[push, held],
    )
    values = []
    for method in ("newton", "relaxation"):
        solution = refweb.run(pressed.replace(solve=refweb.Static(method=method)))
        found = {name: result.value for name, result in solution.results.items()}
        # Supports and body hold the web between them, to the residual that a run may end with.
        assert found["push"] > 1.0 and abs(found["push"] - found["held"]) <= 1e-8 * found["push"]
        values.append(found["push"])
    np.testing.assert_allclose(values[0], values[1], rtol=1e-8)


def test_the_bound_of_a_strain_is_that_of_its_tension_over_ea():
    """Proven by duality for a line that is taut: strain is tension over EA, so is what it may be off by."""
    solution = refweb.run(
        refweb.Scene(
            web=refweb.Inline(points=[[-1, 0, 0], [0, 0, 0], [1, 0, 0]], lines=[[0, 1], [1, 2]], supports=[0, 2]),
            cable=refweb.Cable(law="tension-only", modulus=1e6, area=1e-4, density=1.0),
            effects=[refweb.Load(node=1, force=(0.0, 0.0, 1.0))],
            solve=refweb.Static(),
            observe=[refweb.Observe(name=q, quantity=q, line=0) for q in ("tension", "strain")],
        )
    )
    tension, strain = solution.results["tension"], solution.results["strain"]
    np.testing.assert_allclose(
        [strain.value, strain.error], np.array([tension.value, tension.error]) / 100.0, rtol=1e-6
    )
