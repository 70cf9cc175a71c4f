"""The word on stability: closed forms, and random nets by eigenvalues of differences of forces of their own."""

from collections import Counter

import numpy as np
import pytest
from scipy.linalg import eigvals
from scipy.optimize import brentq
from scipy.sparse import csr_array

import refweb
from refweb.statics.slowest_vibrations import slowest
from validation.hard_cases.stability import RandomNet, word_on
from validation.paper.example_3 import scene as bars_moved_in

PIN = refweb.Supports(nodes="all", components=["z"])


def words(solution):
    """What is said of stability, one text."""
    return " ".join(text for text in solution.warnings if "saddle" in text or "stable" in text)


def others(solution):
    return any("there may be other equilibria" in text for text in solution.warnings)


# Webs of bars that buckle


@pytest.mark.parametrize("inward, steps", [(0.055, (1.0,)), (0.05, (0.0, 0.25)), (0.03, (0.0, 0.2))])
def test_buckled_bars_do_not_rest_at_a_saddle(inward, steps):
    """Bars whose boundary moves in pass saddles of the energy, where the convex part of the tangent finds no way down.

    The one load step ends at a saddle by this part alone, and the load steps from the moved boundary at none in 400
    factorizations. That the equilibrium is a minimum is the sign of all pivots.
    """
    solution = refweb.run(bars_moved_in(inward, "linear", steps))
    assert solution.solver["smallest_pivot"] == 1 and not words(solution)


# A loop under pressure from outside


def loop(push, **fields):
    """Six lines, longer than their places are apart, held by six tethers, pressed inwards by N/m."""
    angle = np.pi / 3.0 * np.arange(6)
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(6)])
    lines = [[i, (i + 1) % 6] for i in range(6)] + [[i, i + 6] for i in range(6)]
    return refweb.Scene(
        web=refweb.Inline(
            points=np.vstack([ring, 2.0 * ring]).tolist(),
            lines=lines,
            natural_length=[1.2] * 6 + [0.95] * 6,
            supports=list(range(6, 12)),
        ),
        cable=refweb.Cable(law="tension-only", modulus=1e6, area=1e-4, density=100.0),
        support=[PIN],
        effects=[refweb.Pressure(lines=list(range(6)), normal=(0.0, 0.0, 1.0), value=-push)],
        **{"solve": refweb.Static(), **fields},
    )


def stiffness_of_loop(push):
    """Least eigenvalue of the Hessian of p × area and the tethers' energy, at the corners' common radius.

    A corner at r in the plane with a tether to 2 has the stiffness EA/L along it and T/(2 − r) across; the area is
    Σ x_i × x_{i+1}/2, and slack lines add nothing. Waves of i over the corners decouple: 2 × 2 blocks.
    """
    axial, natural = 100.0, 0.95

    def tension(r):
        return axial * ((2.0 - r) / natural - 1.0)

    r = brentq(lambda r: tension(r) - push * r * np.sin(np.pi / 3.0), 0.1, 1.05)
    along, across = axial / natural, tension(r) / (2.0 - r)
    least = np.inf
    for wave in range(6):
        turn, phase = np.pi / 3.0, 2.0 * np.pi * wave / 6.0
        rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        cross = np.array([[0.0, 1.0], [-1.0, 0.0]])
        half = 0.5 * push * cross @ rotation * np.exp(1j * phase)
        block = np.diag([along, across]) + half + half.conj().T
        least = min(least, np.linalg.eigvalsh(block)[0])
    return least


@pytest.mark.parametrize("push, stable", [(5.0, True), (10.0, False), (30.0, False)])
def test_a_loop_that_pressure_pushes_out_of_its_shape(push, stable):
    least = stiffness_of_loop(push)
    assert (least > 0.0) == stable
    solution = refweb.run(loop(push))
    assert ("saddle" in words(solution)) != stable
    assert solution.solver["smallest_pivot"] == (1 if stable else -1)
    assert (words(solution) == "") == stable and 'law = "tension-only"' not in words(solution)


def test_the_load_at_which_the_loop_leaves_its_shape():
    """Within a millionth of the root of its stiffness the word changes."""
    critical = brentq(stiffness_of_loop, 5.0, 10.0, xtol=1e-13)
    for push, said in ((critical * (1.0 - 1e-6), False), (critical * (1.0 + 1e-6), True)):
        assert ("saddle" in words(refweb.run(loop(push)))) == said


@pytest.mark.parametrize("push, said", [(5.0, False), (30.0, True)])
def test_a_motion_says_it_of_the_equilibrium_it_starts_from(push, said):
    brief = refweb.Dynamic(duration=1e-4, start="equilibrium")
    solution = refweb.run(loop(push, solve=brief, accuracy=refweb.Accuracy(error="none")))
    assert ("the equilibrium it starts from is a saddle" in words(solution)) == said


# Two straight lines between two supports


def straight(*effects, law="linear", strain=-0.01, density=100.0, method="newton", **fields):
    """Two lines of 1 m and EA = 1 kN along x, strained alike."""
    return refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0], [2, 0, 0]], lines=[[0, 1], [1, 2]], supports=[0, 2]),
        cable=refweb.Cable(law=law, modulus=1e7, area=1e-4, density=density, prestrain=strain),
        effects=effects,
        solve=refweb.Static(method=method),
        **fields,
    )


BARS = {
    "alone": (),
    "pressed by nothing": (refweb.Pressure(lines="all", normal=(0, 1, 0), value=0.0),),
    "pulled along": (refweb.Thrust(node=1, line=0, force=0.1),),
    "in wind along": (refweb.Drag(density=1.2, wind=(1.0, 0.0, 0.0)),),
}


@pytest.mark.parametrize("method", ["newton", "relaxation"])
@pytest.mark.parametrize("strain", [-0.01, 0.01])
@pytest.mark.parametrize("name", BARS)
def test_straight_bars(name, strain, method):
    """2 T/L = ∓20 N/m across; what acts besides, along them or not at all, changes that by 1 % at most."""
    solution = refweb.run(straight(*BARS[name], strain=strain, method=method))
    assert ("saddle" in words(solution)) == (strain < 0.0), solution.warnings
    assert not others(solution) and solution.solver["smallest_pivot"] == np.sign(strain)


@pytest.mark.parametrize("effect", [(), BARS["in wind along"]], ids=["alone", "in wind"])
@pytest.mark.parametrize("speed", [14.142, 14.143, 20.0])
def test_a_mass_that_turns_on_a_string(speed, effect):
    """A stiffness of 20 N/m across holds 0.1 kg up to √200 rad/s; above, Coriolis forces do, and no damping may act."""
    mass, turning = refweb.PointMass(node=1, mass=0.1), refweb.Frame(angular_velocity=(speed, 0.0, 0.0))
    scene = straight(mass, turning, *effect, law="tension-only", strain=0.01, density=1e-6)
    text = words(refweb.run(scene))
    assert ("saddle" in text) == (speed**2 > 200.0)
    assert ("Coriolis forces hold it" in text) == ("saddle" in text)


@pytest.mark.parametrize("rate", [0.0, 0.01, 10.0])
def test_damping_in_the_frame_lets_it_go(rate):
    """s² + (c + 2iΩ) s + k/m − Ω² of y + iz: held at c = 0, and by no c > 0 (Kelvin, Tait and Chetaev)."""
    stiff, speed = 20.0 / 0.1, 20.0
    grows = np.roots([1.0, rate + 2j * speed, stiff - speed**2]).real.max() > 1e-9
    assert grows == (rate > 0.0)
    mass, turning = refweb.PointMass(node=1, mass=0.1), refweb.Frame(angular_velocity=(speed, 0.0, 0.0))
    effects = (mass, turning, refweb.Damping(rate=rate)) if rate else (mass, turning)
    text = words(refweb.run(straight(*effects, law="tension-only", strain=0.01, density=1e-6)))
    assert "saddle" in text and ("hold it" in text) != grows


@pytest.mark.parametrize("natural, said", [(0.99, ""), (1.0, "is not decided"), (1.01, "is a saddle")])
def test_lines_between_slack_and_taut(natural, said):
    """Two bars push the middle to a side with 20 N/m; two lines that only pull hold it if they are taut, not if slack.

    Where they are as long as they are apart one of them comes taut, which no tangent knows.
    """
    solution = refweb.run(
        straight().replace(
            web=refweb.Inline(
                points=[[0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 1, 0], [1, -1, 0]],
                lines=[[0, 1], [1, 2], [1, 3], [1, 4]],
                groups=["bars", "bars", "", ""],
                natural_length=[1.01, 1.01, natural, natural],
                supports=[0, 2, 3, 4],
            ),
            cable=refweb.Cable(
                law="tension-only",
                modulus=1e7,
                area=1e-4,
                density=100.0,
                groups={"bars": refweb.Group(law="linear")},
            ),
            support=[PIN],
        )
    )
    assert said in words(solution) and bool(words(solution)) == bool(said)


# Three straight lines, whose second node is pulled along the middle one, which turns with the third node


def across(strain, thrust):
    """K of the two free nodes to a side [N/m]: T/l of the lines, and of the thrust F/l of the middle one.

    Along the lines T₁ = T₂ + F and T₃ = T₂, and the supports stay where they are.
    """
    axial, natural = 1e3, 1.0 / (1.0 + strain)
    middle = axial * strain - thrust / 3.0
    first, second, third = middle + thrust, middle, middle
    k1, k2, k3 = (t / (natural * (1.0 + t / axial)) for t in (first, second, third))
    turned = thrust / (natural * (1.0 + second / axial))
    return np.array([[k1 + k2 + turned, -k2 - turned], [-k2, k2 + k3]])


def thrice(strain, thrust, density):
    return straight(refweb.Thrust(node=1, line=1, force=thrust), strain=strain, density=density).replace(
        web=refweb.Inline(
            points=[[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]], lines=[[0, 1], [1, 2], [2, 3]], supports=[0, 3]
        )
    )


@pytest.mark.parametrize("density", [0.0, 100.0])
@pytest.mark.parametrize("strain, thrust", [(-0.01, 0.1), (0.01, 0.1), (0.01, -14.0), (0.01, -16.0)])
def test_a_thrust_that_turns_with_its_line(strain, thrust, density):
    """Bars that push leave their line in two ways, taut ones in one where the thrust outgrows them, of any mass."""
    values = np.linalg.eigvals(across(strain, thrust))
    assert not values.imag.any()
    solution = refweb.run(thrice(strain, thrust, density))
    assert ("saddle" in words(solution)) == (values.min() < 0.0)
    assert ("an eigenvalue of its tangent is negative" in words(solution)) == (values.min() < 0.0)


def test_the_thrust_at_which_they_leave():
    critical = brentq(lambda thrust: np.linalg.det(across(0.01, thrust)), -20.0, -10.0, xtol=1e-13)
    for thrust, said in ((critical * (1.0 - 1e-6), False), (critical * (1.0 + 1e-6), True)):
        assert ("saddle" in words(refweb.run(thrice(0.01, thrust, 100.0)))) == said


@pytest.mark.parametrize("damped, said", [(0.0, True), (1.0 - 1e-6, True), (1.0 + 1e-6, False)])
def test_flutter_of_a_string(damped, said):
    """Pressed at right angles to itself and to its own direction, one half of it drives the middle around.

    K = [k, −p/2; p/2, k] across has the eigenvalues k ± ip/2. Damping c M holds it where c² k/m > (p/2m)².
    """
    push, mass, stiff = 2.0, 100.0 * 1e-4 / 1.01, 20.0
    critical = 0.5 * push / mass / np.sqrt(stiff / mass)
    effects = [refweb.Pressure(lines=[0], normal=(1.0, 0.0, 0.0), value=push)]
    effects += [refweb.Damping(rate=damped * critical)] if damped else []
    text = words(refweb.run(straight(*effects, law="tension-only", strain=0.01)))
    assert ("saddle (flutter" in text) == said == ("saddle" in text)
    if not damped:
        growth = np.sqrt(-(stiff + 0.5j * push) / mass).real
        assert f"by {growth:.2g} 1/s" in text


# A string over a ball


@pytest.mark.parametrize("below, slips", [(-0.1, False), (0.3, True)])
def test_a_string_over_a_ball(below, slips):
    """Its top is 0.2 m above the ball's middle, and it slips to a side where that lies above its ends.

    Pulled down by N = 2 T h/l from h above its ends, the middle has 2 T/l − N/R across, R from the ball's middle.
    """
    ball = refweb.Body(name="ball", shape="sphere", radius=0.2, position=(0.0, 0.0, below), fixed=True)
    top = below + 0.2
    scene = refweb.Scene(
        web=refweb.Inline(
            points=[[-1, 0, 0], [0, 0, top], [1, 0, 0]], lines=[[0, 1], [1, 2]], natural_length=0.9, supports=[0, 2]
        ),
        cable=refweb.Cable(law="tension-only", modulus=1e7, area=1e-4, density=100.0),
        effects=[ball, refweb.Contact(stiffness=1e5)],
        solve=refweb.Static(),
    )
    text = words(refweb.run(scene))
    assert (2.0 - 2.0 * top / 0.2 < 0.0) == slips
    assert ("saddle" in text) == slips


# A truss that snaps


def truss(rise, steps, law="linear", method="newton"):
    """Two bars that lean against each other, the node between them pulled down by 2.5 N times the load step."""
    return refweb.Scene(
        web=refweb.Inline(
            points=[[-1, 0, 0], [0, 0, rise], [1, 0, 0]],
            lines=[[0, 1], [1, 2]],
            natural_length=float(np.hypot(1.0, 0.2)),
            supports=[0, 2],
        ),
        cable=refweb.Cable(law=law, modulus=1e7, area=1e-4, density=100.0),
        support=[refweb.Supports(nodes=[1], components=["y"])],
        effects=[refweb.Load(node=1, force=(0.0, 0.0, -2.5))],
        solve=refweb.Static(load_steps=steps, method=method),
    )


@pytest.mark.parametrize("method", ["newton", "relaxation"])
@pytest.mark.parametrize("rise, steps", [(0.2, (1.0,)), (0.2, (2.0, 1.0)), (-0.2, (1.0,))])
def test_both_sides_of_a_snap_say_that_there_is_another(rise, steps, method):
    """Its limit load is 2.96 N: from 5 N down it hangs below, where bars pull. As built below it never was above."""
    solution = refweb.run(truss(rise, steps, method=method))
    below = solution.positions[1, 2] < 0.0
    assert below == (len(steps) > 1 or rise < 0.0)
    assert others(solution) and not words(solution)
    assert any("none of them lower" in text for text in solution.warnings) == below


def test_lines_that_only_pull_have_no_other_side():
    assert not others(refweb.run(truss(-0.2, (1.0,), law="tension-only")))


# Random nets


def kinds(seeds, **sizes):
    found = {seed: word_on(RandomNet(seed, **sizes)) for seed in seeds}
    assert not [(seed, kind) for seed, kind in found.items() if kind.startswith("wrong")]
    return Counter(found.values())


def test_random_nets():
    """The word is right in all that are found."""
    found = kinds(range(40))
    assert found["stable"] + found["grows"] + found["held"] >= 36 and not found["undecided"]
    assert found["grows"] >= 5 and found["marginal"] <= 2


@pytest.mark.slow
def test_many_random_nets():
    found = kinds(range(40, 3000))
    assert found["grows"] >= 300 and found["held"] >= 20 and not found["undecided"]


@pytest.mark.slow
def test_random_nets_of_more_unknowns_than_are_all_asked():
    """What is said is right, or that it is not decided; of some of either kind it is."""
    found = kinds((2, 4, 5, 8), sizes=(38, 44))
    assert found["grows"] == 2 and found["stable"] >= 1


@pytest.mark.slow
def test_many_random_nets_of_more_unknowns():
    found = kinds(range(300), sizes=(38, 44))
    assert found["grows"] >= 50 and found["stable"] >= 80 and found["undecided"] <= 90


@pytest.mark.parametrize("count, sign", [(6, 1.0), (6, -1.0), (120, 1.0)])
def test_slowest_vibrations_of_matrices(count, sign):
    """Beside all s of (s² M + s C + K) φ = 0 by scipy: the least are found, and those that grow are named."""
    rng = np.random.default_rng(count)
    skew = 0.2 * rng.standard_normal((count, count))
    K = np.diag(1.0 + np.arange(count)) + skew - skew.T
    M, C = np.diag(rng.uniform(0.5, 2.0, count)), sign * np.diag(rng.uniform(0.1, 0.4, count))

    class Solver:
        def solve(self, b, transposed=False):
            return np.linalg.solve(K.T if transposed else K, b)

    found = slowest(Solver(), csr_array(M), csr_array(C))
    zero, one = np.zeros((count, count)), np.eye(count)
    every = eigvals(np.block([[zero, one], [-K, -C]]), np.block([[one, zero], [zero, M]]))
    every = every[np.argsort(abs(every))][: len(found.s)]
    for s, grows in zip(found.s, found.grows, strict=True):
        nearest = every[np.argmin(abs(every - s))]
        assert abs(s - nearest) < 1e-5 * abs(s) and grows == (nearest.real > 0.0)
    assert found.more == (count == 120)
