"""Lines against lines: derivatives and closed forms of a pair, which pairs are found, and what runs keep."""

import itertools
import json
import re
import shutil

import numpy as np
import pytest
from scipy.optimize import brentq, lsq_linear

import refweb
from refweb.compiled.rows import matrix_of, records_of
from refweb.dynamics import schedule
from refweb.dynamics.integrators.crossings import BESIDE, checks_of
from refweb.effects.self_contact import line_line_damping, line_line_friction, line_line_penalty, search, table
from refweb.effects.self_contact.pair import PAIR, numbers_of
from refweb.errors import InputError, SolverError
from refweb.kernels import ALL_DUE, DUE
from refweb.net import discretisation
from refweb.net.web import Web
from refweb.registry import INTEGRATORS
from refweb.results.summary_text import on_run
from validation.methods import trust

RADIUS, STIFFNESS = 0.1, 100.0
REST = np.zeros((4, 3))
ONE = np.array([[0, 1, 2, 3]], dtype=np.int32)


class Pair:
    """Two elements by the places of their four nodes, of natural lengths as they are there."""

    def __init__(self, points, damping=0.3, rolling=True):
        self.points = np.array(points, dtype=float)
        p, touch = self.points, 2.0 * RADIUS
        self.pair = np.zeros(1, PAIR)
        self.pair["touch"], self.pair["scale"] = touch, STIFFNESS / (np.sqrt(12.0) * touch**3)
        self.pair["length"], self.pair["second"] = np.linalg.norm(p[1] - p[0]), np.linalg.norm(p[3] - p[2])
        self.pair["vectors"], self.pair["damping"], self.pair["rolls"] = p[1:] - p[0], damping, rolling
        self.pair["friction"], self.pair["slip_velocity"] = 0.4, 0.02
        self.data = matrix_of(self.pair)

    def energy(self, x=REST):
        out = np.zeros(1)
        line_line_penalty.energy(0.0, x, ONE, self.data, out)
        return out[0]

    def force(self, x=REST):
        f, out = np.zeros((4, 3)), np.zeros((1, 1))
        line_line_penalty.force(0.0, x, 0.0 * x, f, ONE, self.data, out)
        return f, out[0, 0]

    def loss(self, x, v):
        f, out = np.zeros((4, 3)), np.zeros((1, 1))
        line_line_damping.force(0.0, x, v, f, ONE, self.data, out)
        return f, out[0, 0]

    def rub(self, x, v):
        f, out = np.zeros((4, 3)), np.zeros((1, 1))
        line_line_friction.force(0.0, x, v, f, ONE, self.data, out)
        return f, out[0, 0]

    def tangent(self, kernel, x, v, definite=False):
        block = np.zeros((1, 12, 12))
        kernel(0.0, x, v, block, ONE, self.data, definite)
        return block[0]


def by_differences(function, x, step=1e-5):
    """Derivative of a function by each component, last axis, by central differences."""
    columns = []
    for n in range(12):
        e = np.zeros(12)
        e[n] = step
        columns.append((function(x + e.reshape(4, 3)) - function(x - e.reshape(4, 3))) / (2.0 * step))
    return np.stack(columns, axis=-1)


def lines(angle, height, along=0.0, across=0.0, offset=0.0, length=1.0):
    """Places of a line of length 1 along x, and of one above it that crosses it there at an angle."""
    u = np.array([np.cos(angle), np.sin(angle), 0.0])
    middle = np.array([along, across, height]) + offset * u
    return [[-0.5, 0, 0], [0.5, 0, 0], middle - 0.5 * length * u, middle + 0.5 * length * u]


def some_pairs(count=60):
    """Pairs that overlap: crossed, nearly parallel, parallel, one at the end of the other, and at random."""
    rng, found = np.random.default_rng(3), []
    for n in itertools.count():
        kind, height = n % 5, rng.uniform(0.02, 0.19)
        angle = [rng.uniform(0.1, 3.0), rng.uniform(-1e-3, 1e-3), 0.0, rng.uniform(0.3, 2.5), rng.uniform(0, 3)][kind]
        along = rng.choice([-0.5, 0.5]) + rng.uniform(-0.1, 0.1) if kind == 3 else rng.uniform(-0.8, 0.8)
        pair = Pair(lines(angle, height, along, rng.uniform(-0.05, 0.05), rng.uniform(-0.6, 0.6), rng.uniform(0.3, 2)))
        x = np.zeros((4, 3)) if kind == 2 else 1e-2 * rng.standard_normal((4, 3))
        if pair.force(x)[1] > 0.0:
            found.append((pair, x, rng.standard_normal((4, 3))))
        if len(found) == count:
            return found


# One pair


def test_forces_are_the_gradient_and_keep_momenta():
    """Central differences of 1e-5 are good to some 1e-9 of what they are of, and to 1e-5 at the kinks of K."""
    for pair, x, _ in some_pairs():
        force, deep = pair.force(x)
        size, energy = np.abs(force).max(), pair.energy(x)
        assert 0.0 < deep <= 2.0 * RADIUS and energy > 0.0
        np.testing.assert_allclose(by_differences(pair.energy, x), -force.ravel(), atol=1e-5 * size + 1e-9 * energy)
        assert np.abs(force.sum(axis=0)).max() <= 1e-14 * size
        assert np.abs(np.cross(pair.points + x, force).sum(axis=0)).max() <= 1e-14 * size


def test_stretched_lines_push_with_the_mean_of_their_stretches():
    """Of lines that cross: times k h (4 r² − h²)^(3/2)/(√27 r³), up to (c/L)² of lines 1000 radii long."""
    height, lengths = 0.13, (80.0, 125.0)
    pair = Pair(1000.0 * RADIUS * np.array(lines(1.1, 0.0)) + [[0, 0, 0], [0, 0, 0], [0, 0, height], [0, 0, height]])
    pair.pair["length"], pair.pair["second"] = lengths
    force, _ = pair.force()
    push = STIFFNESS * height * (4.0 * RADIUS**2 - height**2) ** 1.5 / (np.sqrt(27.0) * RADIUS**3)
    stretches = 1000.0 * RADIUS / np.array(lengths)
    assert force[2:, 2].sum() == pytest.approx(push * stretches.mean(), rel=1e-5)


def test_what_only_contact_could_carry_is_named_in_statics():
    """A line that is free to fall on another, and does not touch it yet."""
    scene = refweb.Scene(
        web=Web([[-0.5, 0, 0], [0.5, 0, 0], [0, -0.5, 0.03], [0, 0.5, 0.03]], [[0, 1], [2, 3]], rim=[0, 1]),
        support=[refweb.Supports(nodes=[2, 3], components=["x", "y"])],
        cable=refweb.Cable(law="linear", modulus=1e7, area=1e-4, density=1000.0),
        effects=[refweb.Load(node=[2, 3], force=(0, 0, -5)), refweb.SelfContact(radius=0.01, stiffness=1000.0)],
        solve=refweb.Static(),
    )
    with pytest.raises(refweb.SolverError, match=r"while it touches nothing, a mechanism of 2 nodes \(2, 3\)"):
        refweb.run(scene)


@pytest.mark.parametrize("beyond, height", [(0.25, 0.05), (0.12, 0.17), (0.15, 0.19), (0.19, 0.19)])
def test_what_reaches_past_an_end_pushes_further_than_lines_are_thick(beyond, height):
    """Segments that are apart by up to √2 of the distance of touch have an energy; differences of 1e-6 as above."""
    pair = Pair(lines(1.3, height, 0.5 + beyond))
    force, deep = pair.force()
    assert deep == 0.0 and pair.energy() > 0.0
    found = by_differences(pair.energy, REST, 1e-6)
    np.testing.assert_allclose(found, -force.ravel(), atol=1e-5 * np.abs(force).max())


def test_tangents_are_those_of_the_forces():
    for pair, x, v in some_pairs():
        stiffness = pair.tangent(line_line_penalty.stiffness, x, v)
        size = np.abs(stiffness).max()
        change = by_differences(lambda y, pair=pair: pair.force(y)[0].ravel(), x)
        np.testing.assert_allclose(-change, stiffness, atol=1e-4 * size)
        assert np.abs(stiffness - stiffness.T).max() <= 1e-13 * size
        part = np.linalg.eigvalsh(pair.tangent(line_line_penalty.stiffness, x, v, True))
        assert part[0] >= -1e-12 * part[-1]
        own = pair.tangent(line_line_damping.stiffness, x, v)
        change = by_differences(lambda y, pair=pair, v=v: pair.loss(y, v)[0].ravel(), x)
        np.testing.assert_allclose(-change, own, atol=1e-3 * np.abs(own).max() + 1e-12)


def test_losses_take_energy_and_keep_momenta():
    for pair, x, v in some_pairs():
        force, power = pair.loss(x, v)
        size = np.abs(force).max()
        assert power <= 0.0 and power == pytest.approx((force * v).sum(), rel=1e-12, abs=1e-15)
        assert np.abs(force.sum(axis=0)).max() <= 1e-14 * size
        assert np.abs(np.cross(pair.points + x, force).sum(axis=0)).max() <= 1e-14 * size
        turning = np.cross([0.3, -0.7, 0.4], pair.points + x) + [1.0, 2.0, 3.0]
        assert np.abs(pair.loss(x, turning)[0]).max() <= 1e-12 * np.abs(pair.force(x)[0]).max()


def test_friction_takes_energy_and_keeps_momenta():
    """What moves as a whole feels none; tangents are those of the forces, to the kinks of the push."""
    for pair, x, v in some_pairs():
        force, power = pair.rub(x, v)
        pushed = pair.force(x)[0]
        normal, size = np.linalg.norm(pushed[:2].sum(axis=0)), np.abs(force).max()
        assert power < 0.0 and power == pytest.approx((force * v).sum(), rel=1e-11)
        assert np.abs(force.sum(axis=0)).max() <= 1e-13 * size
        # a lever is up to a metre, and forces of nearly parallel lines nearly cancel
        assert np.abs(np.cross(pair.points + x, force).sum(axis=0)).max() <= 1e-12 * size
        turning = np.cross([0.3, -0.7, 0.4], pair.points + x) + [1.0, 2.0, 3.0]
        assert np.abs(pair.rub(x, turning)[0]).max() <= 1e-10 * 0.4 * normal
        for kernel, change in (
            (line_line_friction.damping, by_differences(lambda u, pair=pair, x=x: pair.rub(x, u)[0].ravel(), v)),
            (line_line_friction.stiffness, by_differences(lambda y, pair=pair, v=v: pair.rub(y, v)[0].ravel(), x)),
        ):
            own = pair.tangent(kernel, x, v)
            np.testing.assert_allclose(-change, own, atol=2e-3 * np.abs(own).max() + 1e-9)


@pytest.mark.parametrize("angle", [np.pi / 2, 0.4])
def test_friction_of_crossed_lines(angle):
    """μ N against the slip: μ N v/√(v² + v_s²) along it, less the share that tells lines along each other apart.

    That is some 0.01 c²/(L L') over the sine squared; lines are 1 and 2 m long, and 0.2 m thick.
    """
    pair = Pair(lines(angle, 0.15, length=2.0))
    normal, direction = pair.force()[0][2:].sum(axis=0)[2], np.array([np.cos(0.7), np.sin(0.7), 0.0])
    for speed in (0.01, 3.0):
        force, _ = pair.rub(REST, speed * np.array([0 * direction, 0 * direction, direction, direction]))
        drag = 0.4 * normal * speed / np.hypot(speed, 0.02)
        np.testing.assert_allclose(force[2:].sum(axis=0), -drag * direction, atol=drag * 4e-4 / np.sin(angle) ** 2)


def test_friction_of_lines_that_do_not_roll():
    """It is μ N against how fast the other centre line goes past, spread as the push is; it keeps momentum, has a
    moment of 2r times itself, and takes energy. Tangents are those of the forces, to the kinks of the push."""
    for pair, x, v in some_pairs(40):
        pair.pair["rolls"] = 0.0
        force, power = pair.rub(x, v)
        size = np.abs(force).max()
        assert power < 0.0 and power == pytest.approx((force * v).sum(), rel=1e-11)
        assert np.abs(force.sum(axis=0)).max() <= 1e-13 * size
        assert np.abs(pair.rub(x, v + [1.0, 2.0, 3.0])[0] - force).max() <= 1e-10 * size
        for kernel, change in (
            (line_line_friction.damping, by_differences(lambda u, pair=pair, x=x: pair.rub(x, u)[0].ravel(), v)),
            (line_line_friction.stiffness, by_differences(lambda y, pair=pair, v=v: pair.rub(y, v)[0].ravel(), x)),
        ):
            own = pair.tangent(kernel, x, v)
            np.testing.assert_allclose(-change, own, atol=2e-3 * np.abs(own).max() + 1e-9)
    pair = Pair(lines(1.1, 0.15, length=2.0), rolling=False)
    normal = pair.force()[0][2:].sum(axis=0)[2]
    for angle in (0.0, 0.7, 2.0):
        speed = 0.03 * np.array([np.cos(angle), np.sin(angle), 1.0])  # of which the last is along the push
        force, _ = pair.rub(REST, np.array([0 * speed, 0 * speed, speed, speed]))
        drag = -0.4 * normal * speed * [1.0, 1.0, 0.0] / np.hypot(0.03, 0.02)
        np.testing.assert_allclose(force[2:].sum(axis=0), drag, atol=1e-12 * normal)
        moment = np.cross(pair.points, force).sum(axis=0)
        np.testing.assert_allclose(moment, np.cross([0.0, 0.0, 0.15], drag), atol=1e-12 * normal)
    along = np.array([np.cos(1.1), np.sin(1.1), 0.0])  # which crosses at 0.35 of one line and at 0.25 of the other
    ends = [[-0.7, 0.0, 0.0], [1.3, 0.0, 0.0], *([0.0, 0.0, 0.15] + np.outer([-0.5, 1.5], along))]
    pair, speed = Pair(np.array(ends), rolling=False), np.array([0.03, 0.01, 0.0])
    force, _ = pair.rub(REST, np.array([0 * speed, 0 * speed, speed, speed]))
    shares = force @ force[2:].sum(axis=0) / np.sum(force[2:].sum(axis=0) ** 2)
    np.testing.assert_allclose(shares, [-0.65, -0.35, 0.75, 0.25], atol=1e-12)


@pytest.mark.parametrize("angle", [np.pi / 2, 1.0, 2.5])
def test_push_of_crossed_lines(angle):
    """k h (4 r² − h²)^(3/2)/(√27 r³) f/sin, where the overlap ends more than 2r from all ends: to rounding."""
    for height in (0.02, RADIUS, 0.15, 0.199):
        longer = lines(angle, height, 0.02, length=1.9)
        longer[0][0], longer[1][0] = -1.0, 1.0
        force, deep = Pair(longer).force()
        factor = np.sqrt(np.sin(angle) ** 2 + 4.0 * RADIUS**2 / (2.0 * 1.9)) / np.sin(angle)
        push = STIFFNESS * height * (4.0 * RADIUS**2 - height**2) ** 1.5 / (np.sqrt(27.0) * RADIUS**3) * factor
        np.testing.assert_allclose(force[2:].sum(axis=0), [0.0, 0.0, push], rtol=1e-10, atol=1e-10 * push)
        assert deep == pytest.approx(2.0 * RADIUS - height, rel=1e-12)


def test_overlap_is_that_of_centre_lines():
    """Twice the radius less the distance of both segments, by least squares with bounds, whatever reaches beyond."""
    pairs = [(Pair(lines(1.3, 0.02, 0.5 + beyond)), REST) for beyond in (0.05, 0.12, 0.25)]  # past the end of the other
    for pair, x in pairs + [(pair, x) for pair, x, _ in some_pairs(20)]:
        (a, b), (c, d) = (pair.points + x).reshape(2, 2, 3)
        nearest = lsq_linear(np.column_stack([b - a, c - d]), c - a, (0.0, 1.0), tol=1e-14)
        deep = max(2.0 * RADIUS - np.sqrt(2.0 * nearest.cost), 0.0)
        assert pair.energy(x) > 0.0 and pair.force(x)[1] == pytest.approx(deep, abs=1e-6 * RADIUS)


def test_what_slides_along_a_line_feels_no_joint():
    """The energies of the elements of a straight line with one that crosses it add up to the same at any place."""
    ends = np.array([-1.0, -0.3, -0.15, 0.4, 1.0])
    energies = []
    for along in np.linspace(-0.7, 0.7, 29):
        other = lines(1.2, 0.13, along, length=1.9)[2:]
        total = 0.0
        for first, last in itertools.pairwise(ends):
            pair = Pair([[first, 0, 0], [last, 0, 0], *other])
            factor = np.sqrt(np.sin(1.2) ** 2 + 4.0 * RADIUS**2 / (pair.pair["length"][0] * 1.9))
            total += pair.energy() / factor
        energies.append(total)
    np.testing.assert_allclose(energies, energies[0], rtol=1e-12)


def test_bound_is_above_row_sums():
    """Rows of blocks, whose sums bound the largest eigenvalue."""
    for pair, x, v in some_pairs(200):
        blocks = pair.tangent(line_line_penalty.stiffness, x, v).reshape(4, 3, 4, 3).transpose(0, 2, 1, 3)
        rows, rates = np.linalg.norm(blocks, 2, axis=(2, 3)).sum(axis=1), np.zeros(4)
        line_line_penalty.bound(0.0, 0.0, x, np.ones(4), rates, ONE, pair.data)
        assert rows.max() <= rates.max()


def any_pairs(count):
    """(rows, data, places) of pairs that are 1 thick and up to 60 long, crossed or along each other, slack or taut."""
    rng = np.random.default_rng(1)
    natural = np.exp(rng.uniform(np.log(1.2), np.log(60.0), (2, count)))
    natural[1] = np.where(rng.random(count) < 0.5, natural[0], natural[1])
    length = natural * rng.choice([1.0, 1.01, 1.05, 0.8, 0.5], (2, count))
    angle, height = np.arcsin(np.exp(rng.uniform(np.log(3e-3), 0.0, count))), np.sqrt(1.0 - rng.random(count) ** 2)
    s = rng.choice([0.0, 1.0], count) + rng.choice([0.0, 0.02, 0.3], count) * rng.standard_normal(count)
    t, still = rng.uniform(-0.1, 1.1, count), np.zeros(count)
    u = np.stack([length[0], still, still], axis=1)
    w = length[1][:, None] * np.stack([np.cos(angle), np.sin(angle), still], axis=1)
    first = s[:, None] * u - t[:, None] * w + np.stack([still, still, height], axis=1)
    data = np.zeros(count, PAIR)
    data["touch"] = data["scale"] = 1.0
    data["length"], data["second"] = natural
    data["approach"] = data["speed"] = data["closing"] = np.inf
    places = np.stack([0.0 * u, u, first, first + w], axis=1)
    return np.arange(4 * count, dtype=np.int32).reshape(count, 4), matrix_of(data), places


def test_no_row_of_a_pair_is_above_its_bound():
    """Whatever the angle, where c² − D is at most what the nearest points, or both axes, leave; and some come close."""
    cells, data, places = any_pairs(6000)
    x, blocks, highest = places.reshape(-1, 3), np.zeros((len(cells), 12, 12)), [0.0, 0.0]
    line_line_penalty.stiffness(0.0, x, x, blocks, cells, data, False)
    rows = (
        np.linalg.norm(blocks.reshape(-1, 4, 3, 4, 3).transpose(0, 1, 3, 2, 4), 2, axis=(3, 4)).sum(axis=2).max(axis=1)
    )
    apart = search.distances(x, cells, data)
    for c in np.flatnonzero(rows > 0.0):
        (a, b, d, e), of = places[c], numbers_of(data, c)
        axes = search.axes_apart(tuple(a - d), tuple(b - a), tuple(e - d), 1.0, 0.0)
        depth = min(1.0, 2.0 - apart[c] ** 2, 1.0 - axes**2)
        deep = int(depth > line_line_penalty.SHALLOW)
        highest[deep] = max(highest[deep], rows[c] / line_line_penalty.row_sum(of, depth))
    assert 0.85 < min(highest) and max(highest) < 1.0


def test_a_span_counts_all_pairs_that_touch_and_one_that_may():
    """Of a row with several; no more than the middle of an element takes from another like it."""
    data, x = np.zeros(3, PAIR), np.zeros((14, 3))
    data["touch"], data["scale"], data["length"], data["second"] = 0.1, 1.0, 1.0, 1.0
    data["approach"] = data["closing"] = 0.2
    data["speed"] = 1e3
    cells = np.array([(0, 1, 2 + 2 * n, 3 + 2 * n) for n in range(3)], dtype=np.int32)
    x[:2] = (-0.5, 0.0, 0.0), (0.5, 0.0, 0.0)

    def rate(*heights):
        for n, height in enumerate(heights):
            x[2 + 2 * n], x[3 + 2 * n] = (0.1 * n, -0.5, height), (0.1 * n, 0.5, height)
        rates = np.zeros(14)
        line_line_penalty.bound(
            np.inf, 0.0, x, np.ones(14), rates, cells[: len(heights)], matrix_of(data[: len(heights)])
        )
        return rates[0]

    of = numbers_of(matrix_of(data), 0)
    alone, most = line_line_penalty.row_sum(of, 0.01), line_line_penalty.steepest(of, 0.01)
    assert alone < most < 2.0 * alone
    assert rate(0.2) == rate(0.05) == rate(0.2, 0.2, 0.2) == rate(0.05, 0.2) == alone
    assert rate(0.05, 0.05) == rate(0.05, 0.05, 0.05) == most
    assert rate(0.5) == 0.0


def test_distances_fall_by_no_more_than_what_is_foreseen():
    """Of pairs whose velocities change by half; those that move apart may come near by that half alone."""
    cells, data, places = any_pairs(300)
    rng, x, still, span = np.random.default_rng(2), places.reshape(-1, 3), np.zeros((1200, 3)), 0.1
    v = rng.standard_normal(x.shape)
    before, numbers = search.distances(x, cells, data), records_of(PAIR, data)
    search.foresee(span, 0.0, x, v, still, still, cells, data)
    falls = np.max([before - search.distances(x + span * share * v, cells, data) for share in (0.5, 1.0, 1.5)], axis=0)
    assert (falls <= numbers["closing"] + 1e-12).all() and (numbers["closing"] <= numbers["approach"] + 1e-12).all()
    assert (falls > 0.8 * numbers["closing"]).any() and (numbers["closing"] < 0.5 * numbers["approach"]).any()


# Which pairs


def distance(p, q):
    """Smallest distance of two segments, by a look at ends and at where both lines are nearest."""
    (a, b), (c, d) = p, q
    u, w, r = b - a, d - c, a - c
    best = []
    for s, t in itertools.product((0.0, 1.0), repeat=2):
        best.append(np.linalg.norm(r + s * u - t * w))
    for s in (0.0, 1.0):
        t = np.clip((r + s * u) @ w / (w @ w), 0.0, 1.0)
        best.append(np.linalg.norm(r + s * u - t * w))
    for t in (0.0, 1.0):
        s = np.clip((t * w - r) @ u / (u @ u), 0.0, 1.0)
        best.append(np.linalg.norm(r + s * u - t * w))
    s, t = np.linalg.lstsq(np.column_stack([u, -w]), -r, rcond=None)[0]
    if 0.0 <= s <= 1.0 and 0.0 <= t <= 1.0:
        best.append(np.linalg.norm(r + s * u - t * w))
    return min(best)


@pytest.mark.parametrize("roomy", [False, True])
@pytest.mark.parametrize("flat, skin", [(1.0, 0.0), (1.0, 0.2), (0.0, 0.1), (1e3, 0.5)])
def test_search_finds_all_pairs(flat, skin, roomy):
    """Within a skin and the rooms of both elements, in the order of elements."""
    rng = np.random.default_rng(5)
    points = rng.uniform(-1.0, 1.0, (60, 3)) * [1.0, 1.0, flat]
    rows = np.array([(n, n + 1) for n in range(59) if n % 5 != 4])
    lengths = np.linalg.norm(points[rows[:, 1]] - points[rows[:, 0]], axis=1)
    web = Web(points=points, lines=rows, natural_length=lengths, rim=np.array([0]))
    net = discretisation.build(web, refweb.Cable(law="linear", modulus=1e5, area=1e-6, density=1e3))
    touch = refweb.SelfContact(radius=1e-4)
    cells, data = touch.elements_of(net, np.zeros((len(rows), 0)))
    x = 0.3 * rng.standard_normal((60, 3))
    place = (points + x)[rows]
    marks = rng.exponential(0.1, (60 * roomy, 4))
    rooms = marks[rows, 3].max(axis=1) if roomy else np.zeros(len(rows))
    near = search.REACH * 2e-4 + skin
    expected = [
        (a, b)
        for a, b in itertools.combinations(range(len(rows)), 2)
        if not set(rows[a]) & set(rows[b]) and distance(place[a], place[b]) < near + rooms[a] + rooms[b]
    ]
    assert [tuple(pair) for pair in search.pairs_within(skin, marks, x, cells, data).tolist()] == expected
    assert expected or not skin


def test_what_is_near_along_the_net_does_not_touch():
    """A chain whose elements are shorter than its line is thick pushes nothing where it is straight."""
    points = np.column_stack([np.arange(12) * 0.03, np.zeros(12), np.zeros(12)])
    web = refweb.Inline(points=points.tolist(), lines=[(n, n + 1) for n in range(11)]).web(None)
    net = discretisation.build(web, refweb.Cable(law="linear", modulus=1e5, area=1e-6, density=1e3))
    beside = table.near_along(net, 0.1)
    apart = [sorted(int(e) for e in row if e >= 0) for row in beside]
    gap = lambda a, b: 0.03 * (abs(a - b) - 1)  # noqa: E731
    assert apart == [[b for b in range(11) if abs(a - b) > 1 and gap(a, b) <= 0.1] for a in range(11)]
    term = refweb.SelfContact(radius=0.05, stiffness=10.0).on(net)
    f = np.zeros((12, 3))
    term.force(0.0, 0.0 * f, 0.0 * f, f, term.cells, term.data, np.zeros((len(term.cells), 1)))
    assert len(term.cells) and not f.any()


@pytest.mark.parametrize("radius, least, most", [(1e9, 2**0.5, 2**0.5), (1.0, 0.5**0.5 - 0.1, 1.0), (0.3, 0.1, 0.3)])
def test_a_radius_is_refused_before_pairs_are_searched(monkeypatch, radius, least, most):
    """By half the diagonal of a square net of 2 m; or by lines 2r apart along the net, and 2r/√2 or more in space."""
    monkeypatch.setattr(table, "near_along", None)
    web = refweb.Window(mesh="square", rows=20, columns=20, side=0.1)
    scene = refweb.Scene(
        web=web,
        cable=refweb.Cable(law="linear", modulus=1e5, area=1e-6, density=1e3),
        effects=[refweb.SelfContact(radius=radius)],
        solve=refweb.Dynamic(duration=0.1),
    )
    with pytest.raises(InputError, match=r"must be (<|≤) [\d.]+ \[m\]") as refused:
        scene.build()
    limit = float(re.search(r"must be . ([\d.]+) \[m\]", str(refused.value))[1])
    assert 0.999 * least < limit < 1.001 * most


def test_refusals():
    crossed = refweb.Inline(points=[(-1, 0, 0), (1, 0, 0), (0, -1, 0.1), (0, 1, 0.1)], lines=[(0, 1), (2, 3)])

    def scene(radius, web=crossed, method="central-difference", **cable):
        cable = refweb.Cable(law="linear", modulus=1e5, area=1e-6, density=1e3, **cable)
        solve = refweb.Dynamic(duration=0.1, method=method)
        return refweb.Scene(web=web, cable=cable, effects=[refweb.SelfContact(radius=radius)], solve=solve)

    scene(0.0499).build()
    with pytest.raises(InputError, match=r"lines 0 and 1 overlap by 0\.02 m .* must be ≤ 0\.05 \[m\]"):
        scene(0.06).build()
    with pytest.raises(InputError, match=r"needs \[cable\] order = 1, not 2"):
        scene(0.01, method="cvode", order=2).build()
    large = refweb.Window(mesh="square", rows=14, columns=14, side=0.1)
    scene(0.01, large).build()
    for method in ("cvode", "ida"):
        with pytest.raises(InputError, match="more pairs of elements than a tangent may hold"):
            scene(0.01, large, method).build()


# Runs


def strings(method="central-difference", pieces=4, damping=0.0, held=True, duration=0.02, **solve):
    """Two strings that cross without touching."""
    points = [(-0.5, 0.03, 0), (0.5, 0.03, 0), (0.02, -0.5, 0.004), (0.02, 0.5, 0.004)]
    web = refweb.Inline(points=points, lines=[(0, 1), (2, 3)], supports=[0, 1, 2, 3] if held else [])
    return refweb.Scene(
        web=web,
        cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-6, density=1000.0, subdivide=pieces),
        effects=[refweb.SelfContact(radius=1e-3, stiffness=1e4, damping=damping)],
        solve=refweb.Dynamic(duration=duration, method=method, **solve),
        accuracy=refweb.Accuracy(error="none"),
    )


def thrown(scene, rows=40, **keys):
    """(system, course, history) of one string thrown at the other at 3 m/s."""
    system = scene.build()
    solver = INTEGRATORS[scene.solve.method].integrator_of(scene.solve, system, (), (), (), **keys)
    v, first = np.zeros((system.rows, 3)), np.abs(system.net.points[:, 2]) < 1e-9
    v[first & ~system.supported.all(axis=1)] = 0.0, 0.0, 3.0
    course = solver.start(None, v)
    history = solver.advance(course, np.linspace(0.0, scene.solve.duration, rows + 1)[1:])
    return system, course, history


def test_pairs_that_are_found_give_the_same_run(monkeypatch):
    runs = []
    for limit in (20_000, 0):
        monkeypatch.setattr(table, "LISTED", limit)
        system, course, history = thrown(strings(damping=2.0, step_size=1e-5))
        assert [term.contact.finder is None for term in system.terms][-1] == bool(limit)
        runs.append((course.x, course.v, history.energies.sum(axis=1), course.work))
    for one, other in zip(*runs, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-13, atol=1e-15)


@pytest.mark.slow
def test_more_pairs_than_elements_are_remembered(monkeypatch):
    """Twelve lines slide over twelve others, which make 144 pairs of 24 elements, as CVODE says they do.

    CVODE has all pairs in its list, of which each remembers one force: an element remembers eight.
    """
    spots = 0.05 * np.arange(12)
    below = [((-0.1, y, 0.0), (0.65, y, 0.0)) for y in spots]
    above = [((x, -0.1, 0.0021), (x, 0.65, 0.0021)) for x in spots]
    ends = [end for line in (*below, *above) for end in line]
    runs = []
    for limit, method, keys in (
        (0, "central-difference", {"safety": 0.05}),
        (0, "central-difference", {"safety": 0.025}),
        (20_000, "cvode", {"rtol": 1e-9}),
    ):
        monkeypatch.setattr(table, "LISTED", limit)
        scene = refweb.Scene(
            web=refweb.Inline(points=ends, lines=[(2 * n, 2 * n + 1) for n in range(24)], supports=[]),
            cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-6, density=1000.0),
            effects=[refweb.SelfContact(radius=1e-3, stiffness=1e3, friction=0.3)],
            solve=refweb.Dynamic(duration=0.01, method=method),
        )
        system = scene.build()
        solver = INTEGRATORS[method].integrator_of(scene.solve, system, (), (), (), **keys)
        course = solver.start(None, np.where(np.arange(system.rows)[:, None] >= 24, [0.5, 0.2, -0.05], 0.0))
        solver.advance(course, np.linspace(0.0, 0.01, 11)[1:])
        runs.append(course.x)
    errors = [np.abs(x - runs[-1]).max() for x in runs[:-1]]
    assert np.abs(runs[-1][:24]).max() > 3e-4  # what rests is pushed and dragged along
    assert errors[0] < 5e-8 and 3.0 < errors[0] / errors[1] < 9.0  # order 2, with kinks where lines begin to touch


def test_free_strings_keep_energy_and_momenta():
    """Drift of energy falls with the square of the step; momentum is kept to rounding of some 1e3 steps."""
    drifts = []
    for finer in (1, 2, 4):
        system, course, history = thrown(strings(held=False, duration=0.008), safety=0.2 / finer)
        stored = [term.balance.column for term in system.terms].index("self_contact_energy")
        assert history.energies[:, stored].max() > 1e-5
        drifts.append(course.drift)
        mass, place = system.net.mass[:, None], system.net.points
        first, middle = np.abs(place[:, 2]) < 1e-9, place + course.x
        momentum = (mass * course.v).sum(axis=0)
        np.testing.assert_allclose(momentum, [0.0, 0.0, 3.0 * mass[first].sum()], atol=1e-12)
        start = np.cross(place, mass * np.where(first[:, None], [0.0, 0.0, 3.0], 0.0)).sum(axis=0)
        np.testing.assert_allclose(np.cross(middle, mass * course.v).sum(axis=0), start, atol=1e-12)
    assert 2.5 < drifts[0] / drifts[1] < 6.0 and 2.5 < drifts[1] / drifts[2] < 6.0


@pytest.mark.slow
@pytest.mark.ordinary("2.0")
@pytest.mark.parametrize("damping", [0.0, 2.0])
def test_explicit_against_cvode(damping):
    """Two methods, of which the explicit one has an error of order 2: seen to be 2e-7 m at these steps."""
    explicit = thrown(strings(damping=damping), safety=0.04)[1]
    implicit = thrown(strings("cvode", damping=damping), rtol=1e-9)[1]
    assert np.abs(explicit.x).max() > 1e-2
    np.testing.assert_allclose(explicit.x, implicit.x, atol=5e-7)


def test_taut_strings_pressed_together():
    """Two strings whose ends are moved past each other: of five elements each the middle ones touch at their middles.

    These stay straight, so that the push of the overlap is that of both kinks, to what Newton's method leaves.
    """
    height, shift, radius, stiff, natural = 0.01, -0.02, 1e-3, 70.0, 0.2 / 1.1
    points = [(-0.5, 0, 0), (0.5, 0, 0), (0, -0.5, height), (0, 0.5, height)]
    scene = refweb.Scene(
        web=refweb.Inline(points=points, lines=[(0, 1), (2, 3)], supports=[0, 1, 2, 3]),
        cable=refweb.Cable(law="linear", modulus=7e7, area=1e-6, density=1e3, subdivide=5, prestrain=0.1),
        effects=[
            refweb.SelfContact(radius=radius, stiffness=250.0),
            refweb.Motion(node=[2, 3], displacement=[(0, 0, 0, 0), (1, 0, 0, shift)]),
        ],
        solve=refweb.Static(load_steps=np.linspace(0.4, 1.0, 25).tolist()),
    )
    solution = refweb.run(scene, progress=False)

    def push(h, middle):
        """Of elements that are longer than their natural length, to which the energy goes."""
        f, wide = np.hypot((middle / natural) ** 2, 2.0 * radius / natural), 4.0 * radius**2 - h**2
        return 250.0 * f * natural / middle * h * wide**1.5 / (np.sqrt(27.0) * radius**3)

    def state(h):
        """(tension of the outer elements, of the middle one, its length, push of the kinks)."""
        down, level = 0.5 * (h - height - shift), lambda length: stiff * (length / natural - 1.0)

        def along(middle):
            outer = np.hypot(0.5 * (1.0 - middle), down) / 2.0
            return level(outer) * 0.25 * (1.0 - middle) / outer - level(middle)

        middle = brentq(along, 0.15, 0.25)
        outer = np.hypot(0.5 * (1.0 - middle), down) / 2.0
        return level(outer), level(middle), middle, 2.0 * level(outer) * 0.5 * down / outer

    h = brentq(lambda h: state(h)[3] - push(h, state(h)[2]), radius, 2.0 * radius)
    outer, inner, middle, pressed = state(h)
    assert pressed > 0.1
    place = solution.positions[:, 2]
    assert place[8:].max() - place[4:8].min() == pytest.approx(h, abs=1e-3 * radius)
    np.testing.assert_allclose(sorted(solution.tension), [outer] * 2, rtol=1e-4)


# Nothing passes


def linking_number(one, other):
    """That of two closed polygons: half the sum of the signs of crossings, seen from a direction at random."""
    axes = np.linalg.qr(np.random.default_rng(11).standard_normal((3, 3)))[0]
    total = 0
    a, b = one @ axes, other @ axes
    for p, q in zip(a, np.roll(a, -1, axis=0), strict=True):
        for r, s in zip(b, np.roll(b, -1, axis=0), strict=True):
            u, w, d = q - p, s - r, r - p
            area = u[0] * w[1] - u[1] * w[0]
            i, j = (d[0] * w[1] - d[1] * w[0]) / area, (d[0] * u[1] - d[1] * u[0]) / area
            if 0.0 < i < 1.0 and 0.0 < j < 1.0:
                total += int(np.sign(area)) * (1 if (p + i * u)[2] > (r + j * w)[2] else -1)
    return total // 2


def loops(places, parts=12, **contact):
    """(scene, nodes of each loop) of closed polygons of radius 0.3 m, by centres and two axes of their planes."""
    angle = 2.0 * np.pi * np.arange(parts) / parts
    points = [np.array(c) + 0.3 * (np.outer(np.cos(angle), a) + np.outer(np.sin(angle), b)) for c, a, b in places]
    rings = [parts * n + np.arange(parts) for n in range(len(places))]
    web = refweb.Inline(
        points=np.concatenate(points).tolist(),
        lines=[(int(a), int(b)) for ring in rings for a, b in zip(ring, np.roll(ring, -1), strict=True)],
        supports=[],
    )
    scene = refweb.Scene(
        web=web,
        cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-6, density=1000.0),
        effects=[refweb.SelfContact(radius=5e-3, **contact)],
        solve=refweb.Dynamic(duration=0.3),
        output=refweb.Output(interval=2e-3, frames=10),
        accuracy=refweb.Accuracy(error="none"),
    )
    return scene, rings


def pulled(scene, rings, speed):
    own = [refweb.Velocity(node=rings[n].tolist(), value=(s * speed, 0.0, 0.0)) for n, s in ((0, -1.0), (1, 1.0))]
    return scene.replace(effects=(*scene.effects, *own))


HOPF = [((0.0, 0, 0), (1, 0, 0), (0, 1, 0)), ((0.3, 0, 0), (1, 0, 0), (0, 0, 1))]


@pytest.mark.parametrize("damping", [0.0, 1.0])
def test_linked_loops_do_not_separate(damping):
    scene, rings = loops(HOPF, damping=damping)
    solution = refweb.run(pulled(scene, rings, 1.0), progress=False)
    told = dict(on_run(solution.summary()))
    assert solution.passage["lines"] == "certified"
    assert told["passage"] == "lines: no penetration: certified"
    linked = {linking_number(*(state.system.net.points[r] + state.x[r] for r in rings)) for _, state in solution.frames}
    assert len(linked) == 1 and abs(linked.pop()) == 1 and len(solution.frames) > 10
    assert np.abs(solution.state.v).max() < 100.0


def test_what_is_too_soft_is_refused():
    scene, rings = loops(HOPF, stiffness=1.0)
    told = r"overlap by .* more than their radius 0\.005, .* stiffness = .* may be enough .*, or leave it"
    with pytest.raises(SolverError, match=told):
        refweb.run(pulled(scene, rings, 1.0), progress=False)


def test_lines_that_are_moved_through_each_other_are_refused_without_a_stiffness():
    scene = free_lines(speed=0.0, duration=0.01)
    moved = refweb.Motion(node=[2, 3], displacement=[(0, 0, 0, 0), (0.01, 0, 0, -0.1)])
    held = scene.replace(effects=(scene.effects[0], moved), supports=refweb.Supports(nodes=[0, 1]))
    for one in (held, held.replace(effects=(refweb.SelfContact(radius=5e-3), moved))):
        with pytest.raises(SolverError, match="lines 0 and 1 .* motion of both is prescribed, and no stiffness"):
            refweb.run(one, progress=False)


def on_boxes(bodies, speed, stiffness):
    """A line of a box that comes down on that of another box, which is crossed and lies 20 mm below."""
    points = [(-0.5, 0, 0), (0.5, 0, 0), (0, -0.5, 0.02), (0, 0.5, 0.02)]
    lower = {"name": "lower", "position": [-0.52, 0, 0], **bodies}
    upper = {"name": "upper", "position": [0, -0.52, 0.02], "velocity": [0, 0, -speed], **bodies}
    boxes = [{"shape": "box", "size": [0.01] * 3, **body} for body in (lower, upper)]
    return refweb.Scene.from_dict(
        dict(
            web={"kind": "inline", "points": points, "lines": [[0, 1], [2, 3]]},
            cable={"law": "tension-only", "modulus": 7e7, "area": 1e-6, "density": 1000.0},
            body=boxes,
            attach=[{"body": "lower", "node": [0, 1]}, {"body": "upper", "node": [2, 3]}],
            self_contact={"radius": 5e-3, "stiffness": stiffness},
            solve={"kind": "dynamic", "duration": 0.1},
            output={"interval": 2e-3},
            accuracy={"error": "none"},
        )
    )


def test_lines_that_free_bodies_carry_have_the_mass_of_these():
    """They are no supports: two boxes of 2 kg that come at 1 m/s have the energy ½ (2·2/(2 + 2)) 1² = 0.5 J."""
    with pytest.raises(SolverError, match="lines 0 and 1 overlap") as caught:
        refweb.run(on_boxes({"mass": 2.0}, 1.0, 10.0), progress=False)
    assert "prescribed" not in str(caught.value)
    enough = float(re.search(r"stiffness = (\S+)", str(caught.value))[1])
    refweb.run(on_boxes({"mass": 2.0}, 1.0, 2.0 * enough), progress=False)


@pytest.mark.parametrize("seed", range(4))
def test_certified_runs_keep_linking_numbers(seed):
    """Four loops of random planes about one place, thrown at random: linked or not, they stay so.

    A stiffness that is refused is replaced by that of the message: within a few runs it holds.
    """
    rng = np.random.default_rng(seed)
    while True:
        places = []
        for _ in range(4):
            a, b = np.linalg.qr(rng.standard_normal((3, 2)))[0].T
            places.append((rng.uniform(-0.25, 0.25, 3), a, b))
        scene, rings = loops(places)
        try:
            scene.build()
            break
        except InputError:
            continue
    own = [refweb.Velocity(node=ring.tolist(), value=tuple(rng.uniform(-2, 2, 3).tolist())) for ring in rings]
    touching = scene.effects[0].with_stiffness(1e4)
    for _ in range(4):
        try:
            solution = refweb.run(scene.replace(effects=(touching, *own)), progress=False)
            break
        except SolverError as error:
            touching = touching.with_stiffness(float(re.search(r"stiffness = (\S+) may be", str(error))[1]))
    assert solution.passage["lines"] == "certified"
    numbers = []
    for _, state in solution.frames:
        at = [state.system.net.points[ring] + state.x[ring] for ring in rings]
        numbers.append([linking_number(p, q) for p, q in itertools.combinations(at, 2)])
    assert all(n == numbers[0] for n in numbers)


def swept(third=True, velocity=(0.0, -1.0, 0.0), **solve):
    """Line 0-2 swings about node 0 towards line 0-1, with a third line far away, or without: then no pair can touch."""
    points = [[0, 0, 0], [1, 0, 0], [0.99, 0.14, 0], [0, 0, 1], [1, 0, 1]]
    lines = [[0, 1], [0, 2], [3, 4]] if third else [[0, 1], [0, 2]]
    return refweb.Scene(
        web=refweb.Inline(points=points[: 5 if third else 3], lines=lines, supports=[0, 1, 3, 4] if third else [0, 1]),
        cable=refweb.Cable(law="tension-only", modulus=1e7, area=1e-6, density=1000.0),
        effects=[refweb.SelfContact(radius=0.005, stiffness=1e3), refweb.Velocity(node=2, value=velocity)],
        solve=refweb.Dynamic(duration=0.2, **solve),
        accuracy=refweb.Accuracy(error="none"),
    )


@pytest.mark.parametrize("method", ["central-difference", "explicit", "cvode", "ida"])
@pytest.mark.parametrize("third", [True, False])
def test_neighbours_that_swing_through_each_other_are_named(method, third):
    """Node 2 is at y = 0.14 m - 1 m/s t, at 0.99 m of a line of 1 m: they meet at 0.14 s, told to a step of some 2 ms.

    The same with a velocity out of the plane, at 0.1 m/s, passes by at 14 mm and is certified.
    """
    told = refweb.run(swept(third, method=method), progress=False)
    found = re.fullmatch(
        r"certified but for neighbours along the net: lines 0 and 1 came to lie on each other at t = (\S+) s",
        told.passage["lines"],
    )
    assert 0.136 < float(found[1]) <= 0.1401
    assert any(told.passage["lines"] in text for text in told.warnings)
    clear = refweb.run(swept(third, (0.0, -1.0, 0.1), method=method), progress=False)
    assert clear.passage["lines"] == "certified" and not clear.warnings


def test_a_list_of_what_is_due_tells_the_same_as_all_cells():
    """Six lines from one node on random ways in a plane: of 400 drifts, some lead through others; few need checks."""
    angle, rng = np.arange(6), np.random.default_rng(4)
    points = np.vstack([np.zeros(3), np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)])
    fan = refweb.Inline(points=points.tolist(), lines=[(0, n) for n in range(1, 7)], supports=[0])
    system = swept().replace(web=fan, effects=(refweb.SelfContact(radius=0.005, stiffness=1e3),)).build()
    (check,) = (check for check in checks_of(system) if check.kind == BESIDE)
    still, count, looks, told = np.zeros((system.rows, 3)), len(check.cells), 0, 0
    due, met = np.zeros(count + 3, dtype=DUE), np.zeros(4, dtype=np.int64)
    x = still.copy()
    for _ in range(400):
        way = 0.04 * rng.standard_normal((system.rows, 3)) * (1.0, 1.0, 0.0) - 4e-3 * x
        path = 2.0 * float(np.linalg.norm(way, axis=1).max())
        drift = 0.0, path, 0.0, 1.0, x, way, still, still, check.cells, check.data
        looks += int((due["path"][:count] <= due["path"][count] + path).sum())
        listed, found = check.kernel(*drift, due, met), met.copy()
        assert check.kernel(*drift, ALL_DUE, met) == listed and (not listed or (found == met).all())
        due["path"][count], x, told = due["path"][count] + path, x + way, told + listed
    assert told > 10 and count == 15 and looks < 200 * count


@pytest.mark.parametrize("velocity", [0.75, 0.8, 0.9, 1.0])
def test_neighbours_are_looked_at_when_their_turn_comes(velocity):
    """Where a look at lines does for many small steps, neighbours that meet in one of them are told of in that one."""
    told = refweb.run(swept(True, (0.0, -velocity, 0.0), safety=0.05), progress=False)
    step = 0.2 / told.solver["nsteps"]
    time = float(re.search(r"lines 0 and 1 came to lie on each other at t = (\S+) s", told.passage["lines"])[1])
    assert 0.14 / velocity - 2.0 * step < time <= 0.14 / velocity + step and step < 2e-4


def free_lines(method="central-difference", speed=1.0, gap=0.05, stiffness=1e4, duration=0.1, **solve):
    """Two lines of 1 m that float, crossed, of which the upper one comes down."""
    points = [(-0.5, 0, 0), (0.5, 0, 0), (0, -0.5, gap), (0, 0.5, gap)]
    return refweb.Scene(
        web=refweb.Inline(points=points, lines=[(0, 1), (2, 3)], supports=[]),
        cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-6, density=1000.0),
        effects=[
            refweb.SelfContact(radius=5e-3, stiffness=stiffness),
            refweb.Velocity(node=[2, 3], value=(0, 0, -speed)),
        ],
        solve=refweb.Dynamic(duration=duration, method=method, **solve),
        output=refweb.Output(interval=min(2e-3, duration)),
        accuracy=refweb.Accuracy(error="none"),
    )


@pytest.mark.parametrize("method, keys", [("cvode", {}), ("cvode", {"family": "adams"}), ("ida", {})])
def test_lines_that_fly_towards_each_other_meet_in_every_method(method, keys):
    """In free flight any step is accurate, and one of seconds would carry a line through the other.

    Equal rigid lines exchange their speeds: momentum and energy leave nothing else.
    """
    solution = refweb.run(free_lines(method, rtol=1e-8, **keys), progress=False)
    assert solution.passage["lines"] == "certified"
    assert solution.solver["energy_drift"] < 1e-4  # 5e-5 is seen: Simpson's rule of the push in the steps
    speeds = solution.state.v[:, 2]
    np.testing.assert_allclose(speeds, [-1.0, -1.0, 0.0, 0.0], atol=2e-4)
    assert 0.0 < solution.lines["overlap"] < 5e-3


def test_a_step_in_which_lines_would_pass_is_cut():
    """At 50 m/s a stable step of 5 ms is 0.2 m of way, through a line 10 mm thick.

    Cut to less than that, steps see a push that is too weak, and the run is refused by its overlap; at 1e5 m/s the step
    would have to be less than a thousandth of the stable one, and the run ends in front of it.
    """
    with pytest.raises(SolverError, match=r"lines 0 and 1 overlap by .* more than their radius 0\.005"):
        refweb.run(free_lines(speed=50.0, stiffness=1.0, duration=2e-3), progress=False)
    with pytest.raises(SolverError, match=r"lines 0 and 1 would pass through each other: .* stiffness = (\S+) would"):
        refweb.run(free_lines(speed=1e5, stiffness=1.0, duration=1e-5), progress=False)


def test_a_look_leaves_no_more_open_than_lines_are_apart():
    """Drifts take up what a look finds, so that it does for some; what is left is not above the distance of lines."""
    system, times = free_lines(speed=0.1, gap=0.03, stiffness=0.1).build(), np.linspace(0.0, 0.5, 26)[1:]
    solver = INTEGRATORS["central-difference"].integrator_of(
        refweb.Dynamic(duration=0.5, safety=0.1), system, (), (), ()
    )
    left, apart = np.zeros((2, len(times)))
    for n, time in enumerate(times):
        course = solver.start()
        solver.advance(course, [time])
        ends = (system.net.points + course.x)[system.net.cells]
        left[n], apart[n] = solver.model.ccd.paths[0]["free"], distance(*ends)
    assert (left <= apart).all() and (left > 0.0).all() and apart.min() < 9e-3 and course.nsteps > 500


@pytest.mark.parametrize("seed", range(8))
def test_lines_that_are_parallel_to_rounding_push_each_other(seed):
    """u × w is what rounding leaves, in any direction: no plane tells such lines apart. Equal lines exchange speeds."""
    rng = np.random.default_rng(seed)
    along, aside = np.linalg.qr(rng.normal(size=(3, 2)))[0].T
    points = [0.0 * along, along, 0.3 * along - 0.02 * aside, 1.3 * along - 0.02 * aside]
    scene = free_lines(stiffness=20.0, duration=0.2, safety=0.1)
    lines = refweb.Inline(points=[p.tolist() for p in points], lines=[(0, 1), (2, 3)], supports=[])
    speed = refweb.Velocity(node=[2, 3], value=tuple((0.3 * aside).tolist()))
    solution = refweb.run(scene.replace(web=lines, effects=(scene.effects[0], speed)), progress=False)
    assert solution.passage["lines"] == "certified" and solution.lines["overlap"] > 1e-4
    ends = np.array(points) + solution.state.x
    assert ((ends[2:] - ends[0]) @ aside < 0.0).all()  # where they came from


def moved_down(way, stiffness=1e4):
    """Two strings, of which the ends of the upper one are moved down in one load step."""
    return strings().replace(
        effects=(
            refweb.SelfContact(radius=1e-3, stiffness=stiffness),
            refweb.Motion(node=[2, 3], displacement=[(0, 0, 0, 0), (1, 0, 0, -way)]),
        ),
        solve=refweb.Static(),
        output=refweb.Output(),
    )


@pytest.mark.parametrize(
    "way, why",
    [
        (0.003, "what moves between load steps is not followed"),
        (0.1, "lines 0 and 1 meet on their straight ways to load step 1;"),
    ],
)
def test_load_steps_are_not_certified(way, why):
    """Nor where lines touch behind a step that is short; those that pass by are named."""
    solution = refweb.run(moved_down(way), progress=False)
    assert solution.passage["lines"].startswith(f"not certified: {why}")
    assert any(f"lines may have passed through lines: {why}" in warning for warning in solution.warnings)
    assert (solution.lines["overlap"] > 0.0) == (way < 0.1) and solution.lines["overlap"] <= 1e-3


def test_lines_that_lie_deep_in_lines_at_a_load_step_are_refused():
    """Strings of 1 m in one plane are pushed apart by 2 (k r/(8 EA))^(1/3) at most, 0.2 mm: it takes 1 mm and more."""
    with pytest.raises(
        SolverError, match=r"lines 0 and 1 overlap by \S+ m at load step 1, more than their radius 0\.001"
    ):
        refweb.run(moved_down(0.004, 1e-6), progress=False)
    held = refweb.run(moved_down(0.004, None), progress=False)
    assert held.lines["chosen"] and 0.0 < held.lines["overlap"] <= held.lines["radius"]


@pytest.mark.parametrize(
    "shorter",
    [
        refweb.Reel(lines=[0], factor=[(0.0, 1.0), (1.0, 0.55)]),
        refweb.Temperature(expansion=1e-3, change=[(0.0, 0.0), (1.0, -450.0)]),
    ],
)
def test_a_straight_line_that_becomes_shorter_does_not_push_itself(shorter):
    """Elements of 0.1 m that become 0.055 m: every second one is within two radii of 0.03 m. It bears what it holds."""
    scene = refweb.Scene(
        web=refweb.Inline(points=[(0, 0, 0), (1, 0, 0)], lines=[(0, 1)], supports=[0]),
        cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-6, density=1000.0, subdivide=10),
        effects=[refweb.SelfContact(radius=0.03), shorter, refweb.Load(node=1, force=(2.0, 0.0, 0.0))],
        solve=refweb.Static(load_steps=[0.5, 1.0]),
    )
    solution = refweb.run(scene, progress=False)
    np.testing.assert_allclose(solution.state.element_tension, 2.0, rtol=1e-9)  # to the residual of Newton's method
    assert solution.lines["overlap"] == 0.0


@pytest.mark.parametrize(
    "reels, pushed",
    [
        ([[(0.0, 1.0), (1000.0, 0.02)]], True),  # as short as that long after the end of the run
        ([[(-1.0, 0.02), (-0.5, 1.0)]], True),  # and before its start
        ([[(0.0, 1.0), (0.06, 0.02), (0.12, 1.0)]], False),
        ([[(0.0, 0.1), (0.06, 1.0)], [(0.06, 1.0), (0.12, 0.1)]], True),  # never both at once
    ],
)
def test_near_along_the_net_is_what_is_so_in_the_run(reels, pushed):
    """Two lines that cross 0.4 m from a slack third one of 0.3 m, which joins them: 2 r is 0.01 m."""
    points = [(-0.4, 0, 0), (0.4, 0, 0), (-0.4, -0.2, 0.05), (0.4, 0.2, 0.05)]
    effects = [refweb.Velocity(node=[2, 3], value=(0, 0, -1.0)), refweb.SelfContact(radius=5e-3, stiffness=1e4)]
    scene = refweb.Scene(
        web=refweb.Inline(
            points=points,
            lines=[(0, 1), (2, 3), (0, 2)],
            supports=[],
            natural_length=[0.8, float(np.hypot(0.8, 0.4)), 0.3],
        ),
        cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-6, density=1000.0),
        effects=[*effects, *(refweb.Reel(lines=[2], factor=factor) for factor in reels)],
        solve=refweb.Dynamic(duration=0.12),
        accuracy=refweb.Accuracy(error="none"),
    )
    term = next(term for term in scene.build().terms if term.contact.crossing is not None)
    assert ([0, 1] in term.elements.numbers.tolist()) == pushed


# Friction


def excess_at_a_kink(half):
    """By what share the friction of a line that slides over another, its kink above that, is more than that of
    T₂/T₁ = (1 + μ tan θ/2)/(1 − μ tan θ/2); what both elements push and rub with is borne by tensions along them."""
    cosine, sine = np.cos(half), np.sin(half)
    apex, arms = np.array([0.0, 0.0, 0.15 / cosine]), ([-cosine, 0.0, -sine], [cosine, 0.0, -sine])
    total, rubbed = np.zeros(3), np.zeros(3)
    for arm, way in zip(arms, (-1.0, 1.0), strict=True):
        pair = Pair([apex, apex + 2.0 * np.array(arm), [0.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
        speed = way * 1e3 * np.array(arm)
        total += pair.force()[0][:2].sum(axis=0)
        rubbed += pair.rub(REST, np.array([speed, speed, 0 * speed, 0 * speed]))[0][:2].sum(axis=0)
    assert abs(total[0]) < 1e-12 * total[2] and abs(rubbed[2]) < 1e-12 * total[2]
    mean, half_difference = 0.5 * total[2] / sine, -0.5 * rubbed[0] / cosine
    ratio = (mean + half_difference) / (mean - half_difference)
    return (ratio - 1.0) / (ratio + 1.0) / (0.4 * np.tan(half)) - 1.0


def test_tensions_at_a_kink():
    """A joint is pushed along its elements as well, which bears a share of θ/2 of what is not pressed: order 1 in θ.

    The share that tells lines along each other apart, 0.01 (2r)²/(2 L L') = 5e-5, is what the last is off the half by.
    """
    excess = np.array([excess_at_a_kink(half) for half in (0.1, 0.05, 0.025)])
    assert (excess > 0.0).all() and (excess < 0.25 * np.tan([0.1, 0.05, 0.025])).all()
    np.testing.assert_allclose(excess[:-1] / excess[1:], 2.0, rtol=0.1)


def test_a_line_that_is_wound_around_a_straight_one_turns_it_like_a_pulley():
    """Friction has no moment about the axis of either element: neither can take one. Rounding leaves 1e-12 of F 2r."""
    count = 0
    for pair, x, v in some_pairs(40):
        force, power = pair.rub(x, v)
        places, size = pair.points + x, np.linalg.norm(force, axis=1).sum()
        for own, other in ((slice(0, 2), slice(2, 4)), (slice(2, 4), slice(0, 2))):
            axis = np.diff(places[other], axis=0)[0]
            moment = np.cross(places[own] - places[other][0], force[own]).sum(axis=0)
            assert abs(moment @ axis) <= 1e-12 * size * np.linalg.norm(axis)
        count += power < 0.0
    assert count > 20  # the others are pressed along themselves alone


@pytest.mark.parametrize("rolling", [True, False])
def test_angular_momentum_is_booked_where_lines_roll(rolling):
    scene = refweb.Scene(
        web=refweb.Inline(points=[(0, 0, 0), (1, 0, 0), (0, 0, 0.1), (0, 1, 0.1)], lines=[(0, 1), (2, 3)], supports=[]),
        cable=refweb.Cable(law="linear", modulus=1e8, area=1e-6, density=1e3),
        effects=[refweb.SelfContact(radius=1e-3, friction=0.1, rolling=rolling)],
        solve=refweb.Dynamic(duration=1e-3),
        accuracy=refweb.Accuracy(error="none"),
    )
    drift = refweb.run(scene, progress=False).solver["angular_momentum_drift"]
    assert (drift is not None) == rolling


PARTS, LEAN = 8, np.arctan2(3.0, 4.0 * np.pi)
"""Elements of a turn, and the angle of a helix that climbs by three radii in a turn at two radii from its axis."""


def ratio_of_chain(turns, friction, parts=PARTS, lean=LEAN):
    """T₂/T₁ that elements in a helix hold by friction in their middles, by the balance of each joint in its plane.

    Elements pull with T, press with N and rub with μ N, of which each of their two nodes has a half; at a joint they
    turn by θ, and by half of that where the line comes and goes straight. It tends to e^(2π n μ cos α) with θ².
    """
    half = 0.5 * np.arccos(np.sin(lean) ** 2 + np.cos(lean) ** 2 * np.cos(2.0 * np.pi / parts))
    c, s = np.cos(half), np.sin(half)
    tension, push = c + friction * s, 2.0 * s
    for _ in range(turns * parts - 1):
        left = [[c, 0.5 * (s - friction * c)], [-s, 0.5 * (c - friction * s)]]
        right = [tension * c + 0.5 * push * (s + friction * c), tension * s - 0.5 * push * (c + friction * s)]
        tension, push = np.linalg.solve(left, right)
    return (tension + 0.5 * friction * push) / c


def wound(turns, share, rolling, method="central-difference", friction=0.2, radius=0.05):
    """Speed of a line wound n turns around a straight one that is held, both equally thick, 0.15 s after one end is
    pulled with 1 N and the other with a share of what the `ratio_of_chain` says [m/s]."""
    angle = 2.0 * np.pi / PARTS * np.arange(turns * PARTS + 1)
    out = 2.0 * radius / np.cos(np.pi / PARTS)
    climb = 2.0 * radius * np.tan(LEAN) * (angle - angle.mean())
    arc = np.stack([out * np.cos(angle), climb, out * np.sin(angle)], axis=1)
    way = np.array([0.0, np.sin(LEAN), np.cos(LEAN)])
    far = np.linalg.norm(arc[1] - arc[0]) * np.array([[1.0], [2.0]])
    points = np.vstack([[[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]], arc[0] - far[::-1] * way, arc, arc[-1] + far * way])
    last, begin, most = len(points) - 1, [(0.0, 0.0), (0.02, 1.0)], share * ratio_of_chain(turns, friction)
    contact = refweb.SelfContact(
        radius=radius * (1.0 - 1e-6), stiffness=1e5, damping=1.0, friction=friction, rolling=rolling
    )
    solution = refweb.run(
        refweb.Scene(
            web=refweb.Inline(
                points=points.tolist(), lines=[(0, 1), *((i, i + 1) for i in range(2, last))], supports=[0, 1]
            ),
            cable=refweb.Cable(law="linear", modulus=1e9, area=1e-6, density=1e4),
            effects=[
                contact,
                refweb.Damping(rate=50.0),
                refweb.Load(node=2, force=tuple(-way), factor=begin),
                refweb.Load(node=last, force=tuple(way), factor=[*begin, (0.05, 1.0), (0.15, most)]),
            ],
            solve=refweb.Dynamic(duration=0.3, method=method),
            accuracy=refweb.Accuracy(error="none"),
        ),
        progress=False,
    )
    assert solution.passage["lines"] == "certified"
    return solution.state.v[last] @ way


@pytest.mark.slow
@pytest.mark.parametrize("turns", [1, 2])
def test_a_line_that_is_wound_around_a_line_holds_by_its_turns(turns):
    """It holds if and only if 2π n μ > ln(T₂/T₁), where lines do not roll: below, it creeps, within ten slip velocities
    of 1 mm/s, above it slides. Lines that roll do not hold it at any share: they speed up to metres a second.

    Of eight elements in a turn the chain holds sin θ/θ of the exponent, and more elements more, with the order 2; the
    climb of three radii in a turn takes its cos α, 0.973. At 1.04 4 % of T₂ speed up some 20 g.
    """
    off = np.array([np.log(ratio_of_chain(turns, 0.2, parts, 0.0)) for parts in (8, 16, 32, 64)])
    off = np.abs(off / (0.4 * np.pi * turns) - 1.0)
    np.testing.assert_allclose(np.log2(off[:-1] / off[1:]), 2.0, atol=0.3)
    assert 0.0 < wound(turns, 0.96, rolling=False) < 0.01
    assert wound(turns, 1.04, rolling=False) > 0.03
    if turns == 1:  # more turns take longer, and hold no more
        assert wound(turns, 0.7, rolling=True) > 1.0


def dragged(share, method="central-difference", **solve):
    """(displacement of a line along itself, speed) of one that is pressed with 10 N onto another that crosses it, and
    pulled along itself with a share of μ N, in 50 ms."""
    points = [(0, -0.5, 0), (0, 0.5, 0), (-0.5, 0, 0.01), (0.5, 0, 0.01)]
    rise = [(0.0, 0.0), (0.01, 1.0)]
    loads = [
        refweb.Load(node=[2, 3], force=(0, 0, -5.0)),
        refweb.Load(node=[2, 3], force=(0.5 * share * 0.4 * 10.0, 0, 0), factor=[(0.0, 0.0), (0.02, 0.0), (0.03, 1.0)]),
    ]
    loads[0] = refweb.Load(node=[2, 3], force=(0, 0, -5.0), factor=rise)
    solution = refweb.run(
        refweb.Scene(
            web=refweb.Inline(points=points, lines=[(0, 1), (2, 3)], supports=[0, 1]),
            cable=refweb.Cable(law="linear", modulus=1e8, area=1e-5, density=1e3),
            effects=[
                refweb.SelfContact(radius=5e-3, stiffness=1e5, damping=10.0, friction=0.4, slip_velocity=1e-4),
                *loads,
            ],
            solve=refweb.Dynamic(duration=0.05, method=method, **solve),
            accuracy=refweb.Accuracy(error="none"),
        ),
        progress=False,
    )
    assert solution.passage["lines"] == "certified"
    return solution.state.x[2:, 0].mean(), solution.state.v[2:, 0].mean(), solution


@pytest.mark.parametrize("method", ["central-difference", "cvode"])
def test_a_line_that_crosses_another_holds_up_to_friction(method):
    """Below μ N it creeps, as fast as the push still swings by; above it is accelerated by the rest.

    Without friction it would have 9 m/s below. A line of 10 g that rubs at its middle tilts as that leaves it: 5 % of
    the speed are allowed for that.
    """
    _, speed, _ = dragged(0.9, method)
    assert 5e-5 < speed < 5e-3
    _, speed, solution = dragged(1.5, method)
    # from where the load passes μ N: 2/3 of its rise
    gained = 4.0 / 0.01 * (0.5 * 0.02 + 0.5 * 0.5 * (0.01 / 3.0))
    assert speed == pytest.approx(gained, rel=0.05)
    book = solution.history["dissipated_energy"]
    assert (np.diff(book) >= -1e-9).all() and book[-1] > 0.9 * 4.0 * solution.state.x[2, 0]


# Stiffness and rows


def test_a_scene_that_cannot_be_built_names_its_file_once():
    for wrong, said in (({"body": False}, "there is no [[body]]"), ({"velocity.0.node": 9999}, "must be 0 … 575")):
        with pytest.raises(InputError, match=re.escape(said)) as refusal:
            refweb.Scene.load("capture-stage", wrong).settled()
        assert str(refusal.value).count("capture-stage.toml") == 1


def test_a_stiffness_that_is_left_out_follows_from_the_motion():
    """½ μ v² of both lines is stored at 0.8 of the radius: where they come as they start, overlaps are about that.

    What a load speeds up on the way is found too deep, and the run is repeated until it is not.
    """
    solution = refweb.run(free_lines(speed=3.0, stiffness=None, duration=0.03), progress=False)
    assert solution.lines["chosen"] and solution.lines["stiffness"] == 220.0  # 0.5 · 5e-4 · 9/(0.4037 · 25e-6), rounded
    assert 0.7 < solution.lines["overlap"] / 5e-3 < 0.85 and solution.passage["lines"] == "certified"
    ball = refweb.Body(name="ball", radius=0.01, mass=1.0, position=(0.0, 0.0, 1.0), velocity=(0.0, 0.0, 3.0))
    still = free_lines(speed=0.0, stiffness=None)  # what comes at a body folds there as fast
    thrown = still.replace(effects=(*still.effects, ball, refweb.Contact(stiffness=1.0))).settled()
    assert thrown.effects[0].stiffness == 220.0 and still.settled().effects[0].stiffness == 70.0  # the latter EA/L
    scene = free_lines(speed=1e-3, stiffness=None, duration=3e-3)
    pulled = refweb.Load(node=[2, 3], force=(0.0, 0.0, -20.0))
    solution = refweb.run(scene.replace(effects=(*scene.effects, pulled)), progress=False)
    assert any("repeated with stiffness" in text for text in solution.warnings)
    assert solution.lines["chosen"] and solution.lines["overlap"] <= 5e-3


def pushed_together(**contact):
    """A straight cable that a load moves onto another, from nearly at rest."""
    points = [(-1, 0, 0), (0, 0, 0), (1, 0, 0), (0.3, -1, 0.1), (0.3, 0, 0.1), (0.3, 1, 0.1)]
    return refweb.Scene(
        web=refweb.Inline(points=points, lines=[(0, 1), (1, 2), (3, 4), (4, 5)]),
        cable=refweb.Cable(law="linear", modulus=1e6, area=1e-5, density=1e3),
        effects=[
            refweb.SelfContact(radius=0.01, **contact),
            refweb.Velocity(node=[3, 4, 5], value=(0, 0, -0.01)),
            refweb.Load(node=[3, 4, 5], force=(0, 0, -1.0)),
        ],
        solve=refweb.Dynamic(duration=0.05),
        output=refweb.Output(interval=5e-4, frames=1),
        accuracy=refweb.Accuracy(error="none"),
    )


@pytest.mark.slow
def test_a_killed_run_may_choose_its_stiffness_anew(tmp_path):
    """What a kill leaves in the first of several attempts goes on to what the whole run comes to."""
    out, killed = tmp_path / "whole", tmp_path / "killed"

    def copy(text, share):
        if share > 0.5 and not killed.exists():
            shutil.copytree(out, killed)

    whole = refweb.run(pushed_together(), out=out, progress=copy)
    assert any("repeated with stiffness" in text for text in whole.warnings) and whole.lines["chosen"]
    assert json.loads((killed / "run.json").read_text(encoding="utf-8"))["status"] == "running"
    resumed = refweb.resume(killed)
    assert resumed.lines == whole.lines
    np.testing.assert_array_equal(resumed.state.x, whole.state.x)


def test_advice_on_lines_that_come_fast_counts_their_energy():
    """Lines far too soft hardly brake what comes: their overlap says nothing of what would hold it."""
    fast = pushed_together(stiffness=10.0)
    fast = fast.replace(effects=(fast.effects[0], refweb.Velocity(node=[3, 4, 5], value=(0, 0, -60.0))))
    with pytest.raises(SolverError, match="or leave it out") as refusal:
        refweb.run(fast, progress=False)
    advised = float(re.search(r"stiffness = (\S+) may be", str(refusal.value))[1])
    held = refweb.run(fast.replace(effects=(fast.effects[0].with_stiffness(advised), fast.effects[1])), progress=False)
    assert held.passage["lines"] == "certified"


def test_rows_one_by_one_are_the_rows_of_one_call(monkeypatch):
    """Pairs are found anew in each call: what they push does not depend on it but by rounding, nor do steps.

    Who goes on from a checkpoint knows no list, and its bounds look at all elements.
    """
    monkeypatch.setattr(table, "LISTED", 0)
    system, course, _ = thrown(strings(damping=2.0), rows=20)
    solver = INTEGRATORS["central-difference"].integrator_of(refweb.Dynamic(duration=0.02), system, (), (), ())
    v, first = np.zeros((system.rows, 3)), np.abs(system.net.points[:, 2]) < 1e-9
    v[first & ~system.supported.all(axis=1)] = 0.0, 0.0, 3.0
    other = solver.start(None, v)
    loaded = solver.start(None, v)
    for time in np.linspace(0.0, 0.02, 21)[1:]:
        solver.advance(other, [time])
        loaded = solver.load(solver.save(loaded))
        solver.advance(loaded, [time])
        assert loaded.nsteps == other.nsteps
    assert other.nsteps == course.nsteps and np.abs(course.x).max() > 1e-2
    for one in (other, loaded):
        np.testing.assert_allclose(one.x, course.x, atol=1e-12)


def test_a_chosen_stiffness_does_not_depend_on_the_machine(monkeypatch):
    """A contact that is too soft is found at the end of a block, whose rows are as many as the machine is fast."""
    _, scene = next(trust.scenes("capture", 6))
    scene = scene.replace(accuracy=refweb.Accuracy(error="none"))
    monkeypatch.setattr(schedule, "BLOCK", 1e9)
    found = []
    for most in (1, 3, 1000):
        monkeypatch.setattr(schedule, "MOST_ROWS", most)
        solution = refweb.run(scene)
        assert any("repeated with stiffness" in text for text in solution.warnings)
        found.append((solution.lines["stiffness"], *(result.value for result in solution.results.values())))
    assert found[0] == found[1] == found[2]


def test_no_point_that_may_touch_comes_nearer_to_an_axis_than_its_bound():
    """Random pairs of elements whose nodes move by half of the approach; ends reach out by the distance of touch."""
    rng, near = np.random.default_rng(0), 0
    for _ in range(300):
        (p, u, w), touch, approach = rng.standard_normal((3, 3)), 0.1, 0.3 * rng.random()
        bound = search.axes_apart(tuple(p), tuple(u), tuple(w), touch, approach)
        places = np.array([p, p + u, 0.0 * p, w])
        for _ in range(40):
            way = rng.standard_normal((4, 3))
            a, b, c, d = places + 0.5 * approach * way / np.linalg.norm(way, axis=1)[:, None]
            for begin, end, first, last in ((a, b, c, d), (c, d, a, b)):
                points, axis = begin + np.linspace(0.0, 1.0, 50)[:, None] * (end - begin), (last - first)
                length = np.linalg.norm(axis)
                along = (points - first) @ axis / length
                apart = np.linalg.norm(points - first - along[:, None] * axis / length, axis=1)
                apart = apart[(along >= -touch) & (along <= length + touch)].min(initial=np.inf)
                assert apart >= bound * (1.0 - 1e-12)
                near += apart < bound + approach
    assert near > 100  # so that the bound is near what happens
