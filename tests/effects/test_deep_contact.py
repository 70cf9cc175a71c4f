"""Contact deeper than the rounding of edges: depth, forces as the slope of energy, and a line over an edge."""

import nets
import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

import refweb
from refweb.net.grown_core import EXACT, WIDENING, depth
from refweb.net.rigid_body import Grown

CORES = {
    "box": Grown(0.1, (0.2, 0.3, 0.4)),
    "box of sharp edges": Grown(0.006, (0.144, 0.2, 0.3)),
    "cube": Grown(0.02, (0.48, 0.48, 0.48)),
    "plate": Grown(0.1, (0.0, 0.3, 0.4)),
    "bar": Grown(0.1, (0.0, 0.0, 0.4)),
    "cylinder": Grown(0.1, (0.2, 0.2, 0.3), True),
    "disc": Grown(0.1, (0.3, 0.3, 0.0), True),
    "capsule": Grown(0.1, (0.0, 0.0, 0.3), True),
    "ring": Grown(0.3, (0.0, 0.0, np.inf)),
}


def inside(grown, count=200, seed=0):
    """Points in a body, of which each third is near where faces, opposite ones among them, are equally near."""
    rng, size = np.random.default_rng(seed), grown.radius + np.minimum(grown.core, 0.5)
    p = rng.uniform(-1.0, 1.0, (10 * count, 3)) * size
    near = 1e-3 * grown.radius * rng.standard_normal(p.shape)
    p[::3, 2] = near[::3, 2] + np.sign(p[::3, 2]) * (size[2] - size[0] + abs(p[::3, 0]))
    p[1::3, 0] = near[1::3, 0]
    return np.array([q for q in p if depth(tuple(q), grown)[0] > 0.0])[:count]


def matrix(h):
    return np.array([[h[0], h[1], h[2]], [h[1], h[3], h[4]], [h[2], h[4], h[5]]])


@pytest.mark.parametrize("name", CORES)
def test_depth_has_one_slope_everywhere(name):
    """Differences from either side agree with the gradient as they shrink, on creases too; it is at most 1, concave."""
    grown, rng, off = CORES[name], np.random.default_rng(1), []
    for p in inside(grown):
        deep, gradient, hessian = depth(tuple(p), grown)
        assert np.linalg.norm(gradient) <= 1.0 + 1e-14
        assert np.linalg.eigvalsh(matrix(hessian)).max() <= 1e-9 * max(abs(matrix(hessian)).max(), 1.0)
        d, h = rng.standard_normal(3), 1e-6 * grown.radius
        d /= np.linalg.norm(d)
        for side in (-h, h):
            there, slope, _ = depth(tuple(p + side * d), grown)
            # Curvature is at most some times 4/r but for that of a ring and a capsule about their axes.
            bend = 20.0 / min(grown.radius, np.hypot(*p[:2]) if name in ("bar", "capsule", "ring") else np.inf)
            assert abs((there - deep) / side - np.dot(gradient, d)) <= 0.5 * bend * h + 1e-9
            assert np.abs(np.subtract(slope, gradient)).max() <= bend * h + 1e-9
            off.append(np.abs(np.subtract(slope, gradient) / side - matrix(hessian) @ d).max() * grown.radius)
    assert np.quantile(off, 0.9) < 1e-3  # the Hessian itself jumps, seldom within 1e-6 r


def within(p, grown, t):
    """How far outside of the rounded box of depth t a point is, from its half sizes and the radius of its edges."""
    a, b = EXACT * grown.radius, (1.0 - EXACT) * grown.radius
    past = max(t - a, 0.0)
    g = past**2 / (2.0 * b) if past < WIDENING * b else WIDENING * (past - 0.5 * WIDENING * b)
    sizes = np.array(grown.core) - g
    q = np.array([np.hypot(p[0], p[1]), abs(p[2])]) if grown.round else np.abs(p)
    sizes = sizes[[0, 2]] if grown.round else sizes
    return np.linalg.norm(np.maximum(q - sizes, 0.0)) - (grown.radius - t + g) if sizes.min() >= 0.0 else None


@pytest.mark.parametrize("name", ["box", "box of sharp edges", "cube", "cylinder"])
def test_depth_is_that_of_a_rounded_box(name):
    """Searched by bisection, as deep as no opposite faces meet; near a face alone it is the distance from that."""
    grown, found, plain = CORES[name], 0, 0
    for p in inside(grown):
        deep = depth(tuple(p), grown)[0]
        if within(p, grown, deep) is None:
            continue
        low, high = 0.0, deep
        while within(p, grown, high) is not None and within(p, grown, high) <= 0.0:
            high += 1e-3 * grown.radius
        if within(p, grown, high) is None:
            continue
        expected = brentq(lambda t, p=p: within(p, grown, t), low, high, xtol=1e-15)
        assert abs(deep - expected) < 1e-12
        found += 1
        faces = np.sort(grown.radius + np.array(grown.core) - np.abs(p))
        if faces[0] < EXACT * grown.radius and faces[1] > 2.0 * grown.radius and not grown.round:
            assert abs(deep - faces[0]) < 1e-15
            plain += 1
    assert found > 50 and (plain > 0 or name in ("cylinder", "cube", "box of sharp edges"))


SHAPES = {
    "sphere": dict(radius=0.2),
    "ring": dict(radius=0.2, normal=(0.1, 0.2, 1.0)),
    "box": dict(size=(0.3, 0.4, 0.5), axes=[(3.0, 1.0, 0.0), (-1.0, 3.0, 0.0)]),
    "plate": dict(shape="box", size=(0.2, 0.4, 0.5), rounding=0.1),
    "cylinder": dict(radius=0.15, length=0.4, axis=(0.1, 0.0, 1.0)),
    "disc": dict(shape="cylinder", radius=0.25, length=0.2, axis=(0.1, 0.0, 1.0), rounding=0.1),
}


def one_line(shape, order, exponent):
    """(system, term of contact) of a line across a fixed body at the origin."""
    web = refweb.Inline(points=[[-0.5, 0, 0], [0.5, 0, 0]], lines=[[0, 1]], supports=[]).web()
    body = refweb.Body(**{"name": "it", "shape": shape, "position": (0.0, 0.0, 0.0), "fixed": True, **SHAPES[shape]})
    cable = refweb.Cable(law="linear", modulus=1.0, area=1e-6, density=1.0, order=order)
    system = nets.system(web, cable, [body, refweb.Contact(stiffness=1e3, exponent=exponent)], False)
    return system, next(term for term in system.terms if term.contact.with_lines)


def deep_states(system, shape, count=25, seed=5):
    """Displacements in which the line goes through the body anywhere, bent where it can be."""
    rng, nodes = np.random.default_rng(seed), system.net.nodes
    place = system.net.points[:nodes, :1] + 0.5
    for _ in range(count):
        a, b = rng.uniform(-0.3, 0.3, (2, 3))
        x = np.zeros((system.rows, 3))
        x[:nodes] = a + place * (b - a) - system.net.points[:nodes]
        x[2:nodes] += 0.04 * rng.standard_normal((nodes - 2, 3))
        yield x


def force_of(system, term, x):
    force = np.zeros_like(x)
    out = np.zeros((len(term.cells), term.columns))
    term.force(0.0, x, np.zeros_like(x), force, term.cells, term.data, out)
    return force


@pytest.mark.parametrize(
    "order, exponent", [(1, 1), *(pytest.param(*case, marks=pytest.mark.slow) for case in ((2, 1), (1, 1.5), (3, 1.5)))]
)
@pytest.mark.parametrize("shape", nets.some(SHAPES, 2))
def test_force_is_minus_the_slope_of_energy_however_deep(shape, order, exponent):
    """Central differences along every coordinate of random lines through the body, and those of the force beside K."""
    system, term = one_line(shape, order, exponent)
    step, touched, off = 1e-6, 0, []
    for x in deep_states(system, shape):
        force = force_of(system, term, x)
        size = np.abs(force).max()
        if size == 0.0:
            continue
        touched += 1
        blocks = np.zeros((len(term.cells), *2 * (3 * term.cells.shape[1],)))
        term.tangent.stiffness(0.0, x, np.zeros_like(x), blocks, term.cells, term.data, False)
        rows = term.cells[0]
        for column, (row, axis) in enumerate([(row, axis) for row in rows for axis in range(3)]):
            d = np.zeros_like(x)
            d[row, axis] = step
            ends = [system.energy_of(term, 0.0, x + sign * d).sum() for sign in (-1.0, 1.0)]
            assert abs((ends[0] - ends[1]) / (2.0 * step) - force[row, axis]) < 1e-5 * size
            change = (force_of(system, term, x - d) - force_of(system, term, x + d))[rows].ravel() / (2.0 * step)
            off.append(np.abs(change - blocks[0][:, column]).max() / np.abs(blocks).max())
    assert touched > 12
    # The tangent jumps where faces begin to share: a state within 1e-6 m of that is seldom among the random ones.
    assert np.quantile(off, 0.98) < 1e-4


# A taut line over an edge

SIZE, STIFFNESS, AXIAL, STRAIN = 0.3, 300.0, 1e3, 0.01
SOFT = 60.0
ENDS, TURNED = (-1.0, -0.25, 0.25, 1.0), [(1.0, 0.0, 1.0), (-1.0, 0.0, 1.0)]


def over_an_edge(press, offset, solve, effects=(), **more):
    """Three lines in a row, the middle one over the edge of a box that is turned by 45° and pressed into it."""
    place = (offset, 0.0, press - SIZE / np.sqrt(2.0))
    box = refweb.Body(name="box", shape="box", size=(SIZE, SIZE, 1.0), axes=TURNED, position=place, fixed=True)
    return refweb.Scene(
        web=refweb.Inline(points=[[x, 0, 0] for x in ENDS], lines=[[0, 1], [1, 2], [2, 3]], supports=[0, 3]),
        cable=refweb.Cable(law="linear", modulus=1e8, area=AXIAL / 1e8, density=1000.0, prestrain=STRAIN),
        effects=[box, refweb.Contact(stiffness=SOFT), *effects],
        solve=solve,
        **more,
    )


def depth_over_edge(first, second):
    """Depth of a point that is so far below the two faces of the edge, by bisection over the term of its surfaces."""
    r = 0.02 * SIZE

    def outside(t):
        past, width = max(t - EXACT * r, 0.0), (1.0 - EXACT) * r
        g = past**2 / (2.0 * width) if past < WIDENING * width else WIDENING * (past - 0.5 * WIDENING * width)
        b = r - np.array([first, second]) + g
        return (np.hypot(*np.maximum(b, 0.0)) if b.max() > 0.0 else b.max()) - (r - t + g)

    return brentq(outside, -1.0, 1.0, xtol=1e-15) if min(first, second) > 0.0 else 0.0


def potential(q, press, offset):
    """Energy of the three lines at the inner nodes' (x, x, z, z) and of the contact, sought along the line."""
    x, z = np.array([ENDS[0], q[0], q[1], ENDS[3]]), np.array([0.0, q[2], q[3], 0.0])
    natural = np.diff(ENDS) / (1.0 + STRAIN)
    stretch = np.hypot(np.diff(x), np.diff(z)) - natural

    def felt(place):
        along, below = x[1] + place * (x[2] - x[1]) - offset, press - z[1] - place * (z[2] - z[1])
        return -place * (1.0 - place) * depth_over_edge(*np.array([below - along, below + along]) / np.sqrt(2.0)) ** 2

    near = min(np.linspace(0.0, 1.0, 51), key=felt)
    bounds = max(near - 0.02, 0.0), min(near + 0.02, 1.0)
    most = -4.0 * minimize_scalar(felt, bounds=bounds, method="bounded", options=dict(xatol=1e-10)).fun
    return 0.5 * (AXIAL / natural * stretch**2).sum() + 0.5 * SOFT * most


@pytest.mark.parametrize("press, offset", [(0.06, 0.0), (0.12, 0.0), (0.12, 0.03), (0.15, -0.04)])
def test_a_line_over_an_edge_rests(press, offset):
    """Three times to fifteen times as deep as edges are round: at the least of an energy that is put together here."""
    energy = refweb.Observe(name="stored", quantity="contact_energy")
    solution = refweb.run(over_an_edge(press, offset, refweb.Static(), observe=[energy]))
    assert solution.status == "solved" and solution.solver["nlu"] < 40
    stored = solution.results["stored"].value
    assert np.sqrt(2.0 * stored / SOFT) > 3.0 * 0.02 * SIZE
    q, rng = solution.positions[1:3, [0, 2]].T.ravel(), np.random.default_rng(0)
    here = potential(q, press, offset)
    slope = [(potential(q + d, press, offset) - potential(q - d, press, offset)) / 2e-5 for d in 1e-5 * np.eye(4)]
    # Differences leave third derivatives times 1e-11 m² beside forces of some newtons.
    assert np.abs(slope).max() < 1e-5
    for size in (1e-3, 1e-2, 3e-2):
        assert min(potential(q + size * rng.standard_normal(4), press, offset) for _ in range(5)) > here


def thrown(count):
    """A net that falls deep over edges and corners of a box askew, in some steps."""
    axes = [(2.0, 1.0, -1.0), (-1.0, 2.0, 0.0)]
    box = dict(shape="box", size=(0.3, 0.4, 0.5), axes=axes, position=(0.02, -0.03, -0.25))
    return nets.thrown(box, count, STIFFNESS)


def test_a_net_over_edges_keeps_its_energy():
    """Far deeper than the rounding; errors of positions and of energy fall at least with the square of the step."""
    counts = np.array([600, 1200, 2400, 4800])
    runs = [thrown(count) for count in counts]
    assert runs[-1][2] > 3.0 * 0.02 * 0.3
    apart = [np.abs(a[0] - b[0]).max() for a, b in zip(runs, runs[1:], strict=False)]
    drift = [run[1] for run in runs]
    assert drift[-1] < 1e-4
    for errors in (apart, drift):
        assert np.polyfit(np.log(1.0 / counts[: len(errors)]), np.log(errors), 1)[0] > 1.8
