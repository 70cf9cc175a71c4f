"""The system as a whole: views of it, and what it refuses."""

import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import nets
import numpy as np
import pytest

import refweb
from refweb.effects.base import DAMPED_TENSION
from refweb.effects.damping import Damping
from refweb.effects.elasticity import Elasticity
from refweb.system.system import System

FREE = np.zeros((6, 3), dtype=bool)


def displaced(seed=0):
    rng = np.random.default_rng(seed)
    return 0.05 * rng.standard_normal((6, 3)), rng.standard_normal((6, 3))


def reeled(net):
    """A net whose lines have other lengths at every time, with damping on them."""
    reels = (
        refweb.Reel(lines=[0, "tie"], factor=[(0.0, 1.0), (2.0, 0.8)]),
        refweb.Reel(lines="all", factor=[(1.0, 0.99)]),
    )
    return System(net, [Elasticity(), Damping(time=0.02), *reels], FREE)


def test_a_view_stands_at_its_time():
    """Lengths of a time are those that every force at that time sees; the net stays as it is built."""
    net = nets.skew_net("tension-only")
    built, system, (x, v) = net.natural_length.copy(), reeled(net), displaced()
    view = system.at(0.7)
    factor = 0.99 * np.where(np.isin(net.line, [0, 6, 7]), 1.0 - 0.1 * 0.7, 1.0)
    np.testing.assert_allclose(view.net.natural_length, built * factor, rtol=1e-15)
    np.testing.assert_array_equal(view.net.natural_length, system.natural_length(0.7))
    here, there = system.force(0.7, x, v), system.force(1.4, x, v)
    assert (here != there).any()
    for t in (0.7, 1.4, 0.0):  # of a view lengths stay
        np.testing.assert_array_equal(view.force(t, x, v), here)
        np.testing.assert_array_equal(view.stiffness(t, x, v), system.stiffness(0.7, x, v))
        np.testing.assert_array_equal(view.energy(t, x), system.energy(0.7, x))
    np.testing.assert_array_equal(system.force(1.4, x, v), there)
    np.testing.assert_array_equal(view.at(1.4).net.natural_length, view.net.natural_length)
    np.testing.assert_array_equal(system.net.natural_length, built)
    still = System(net, [Elasticity()], FREE)
    assert still.at(0.7) is still and still.line_data(0.7) is net.line_data


def test_other_numbers_of_the_lines():
    """Forces of twice the stiffness are twice as large, whatever natural lengths do."""
    system, (x, _) = reeled(nets.skew_net("linear")), displaced()
    stiffer = system.net.line_data.copy()
    stiffer.ea *= 2.0
    for t in (0.0, 0.7):
        force = system.force(t, x)
        np.testing.assert_array_equal(system.with_line_data(stiffer).force(t, x), 2.0 * force)
        np.testing.assert_array_equal(system.force(t, x), force)


def test_lines_by_name():
    """Their term, and what they show per cell, wherever they stand among the effects."""
    net, (x, v) = nets.skew_net("linear"), displaced()
    weight = refweb.Gravity(acceleration=(0.0, 0.0, -9.81))
    for effects in ([Elasticity(), Damping(time=0.02), weight], [weight, Elasticity(), Damping(time=0.02)]):
        system = System(net, effects, FREE)
        assert system.lines.name == "elasticity" and system.lines.cells is net.cells
        seen = system.forces(0.0, x, v).per_cell
        place = effects.index(next(effect for effect in effects if isinstance(effect, Elasticity)))
        assert seen[place] is seen.lines and np.shares_memory(seen.tension, seen.lines)
        np.testing.assert_array_equal(seen.tension, seen.lines[:, DAMPED_TENSION])
    assert System(net, [weight], FREE).lines is None


def test_columns_of_two_effects():
    """A column that another effect has added before leaves damping its own."""
    net, (x, v) = nets.skew_net("linear"), displaced()
    other = net.with_column("other", np.arange(9.0))
    assert other.line_data.dtype.names[-1] == "other" and other.line_data.other.tolist() == list(range(9))
    plain, beside = (System(one, [Elasticity(), Damping(time=0.02)], FREE) for one in (net, other))
    np.testing.assert_array_equal(beside.force(0.0, x, v), plain.force(0.0, x, v))
    assert beside.net.line_data.column("damping_time") == plain.net.line_data.column("damping_time") + 1
    with pytest.raises(ValueError, match="column other"):
        other.with_column("other", 1.0)


def test_one_power_of_the_lines():
    """Two terms that would write their power to the same column of what the lines show."""

    class Again(Damping):
        def extend(self, net):
            return net

        def on(self, net):
            (term,) = super().on(net)
            return [replace(term, name="again")]

    with pytest.raises(ValueError, match="one column for a power"):
        System(nets.skew_net(), [Elasticity(), Damping(time=0.02), Again(time=0.02)], FREE)


def test_threads_share_a_system():
    """Two ask for the same at other states, and neither is answered before both have computed.

    A line of 1 m along x and along y that is reeled in: its tension is T = EA (ε + τ ε̇), ε̇ = −l L'/L² of ends at
    rest, K = ∂T/∂l e⊗e + T/l (1 − e⊗e), C = τ EA/L e⊗e.
    """
    stiffness, time = 1e3, 0.02
    scene = refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0]),
        cable=refweb.Cable(law="linear", modulus=1e7, area=1e-4, density=100.0),
        effects=[refweb.Damping(time=time), refweb.Reel(lines="all", factor=[(0.0, 1.0), (1.0, 0.5)])],
        solve=refweb.Dynamic(duration=1.0, method="cvode"),
    )
    system, together = scene.build(), threading.Barrier(2, timeout=10.0)
    _ = system.pattern

    def meeting(kernel):
        def call(*numbers):
            kernel(*numbers)
            together.wait()

        return None if kernel is None else call

    for n, term in enumerate(system.terms):
        tangent = term.tangent._replace(stiffness=meeting(term.tangent.stiffness))
        velocity = term.velocity._replace(damping=meeting(term.velocity.damping))
        system.terms[n] = replace(term, force=meeting(term.force), tangent=tangent, velocity=velocity)

    def found(t, place):
        x = np.array([[0.0, 0.0, 0.0], np.subtract(place, [1.0, 0.0, 0.0])])
        length = system.natural_length(t)[0]
        force, per_cell = system.forces(t, x)
        values = [system.stiffness(t, x), system.damping(t, x, np.zeros_like(x))]
        matrices = [system.pattern.matrix(one).toarray() for one in values]
        return length, force[1], per_cell.tension.copy(), *matrices

    states = [(0.2, [1.1, 0.0, 0.0]), (0.6, [0.0, 1.3, 0.0])]
    with ThreadPoolExecutor(2) as threads:
        answers = list(threads.map(found, *zip(*states, strict=True)))
    for (t, place), (length, force, tension, K, C) in zip(states, answers, strict=True):
        far, natural = np.linalg.norm(place), 1.0 - 0.5 * t
        along, slope = np.outer(place, place) / far**2, stiffness * time * 0.5 / natural**2
        pull = stiffness * (far / natural - 1.0) + slope * far
        rates = stiffness / natural * along
        np.testing.assert_allclose([length, tension[0]], [natural, pull], rtol=1e-12)
        np.testing.assert_allclose(force, -pull * np.array(place) / far, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(K, rates + slope * along + pull / far * (np.eye(3) - along), rtol=1e-12, atol=1e-9)
        np.testing.assert_allclose(C, time * rates, rtol=1e-12, atol=1e-9)


def test_consistent_mass_of_one_line():
    """M = m/6 (2 1; 1 2): momenta of both ends, and half of a jump of one end that the free other takes back."""
    scene = refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]]),
        cable=refweb.Cable(law="linear", modulus=1e6, area=1e-4, density=6e4),
        effects=[refweb.Motion(node=0, displacement=[(0.0, 0.0, 0.0, 0.0), (1.0, 0.1, 0.2, 0.3)])],
        solve=refweb.Dynamic(duration=1.0, method="cvode", mass="consistent"),
    )
    mass, v = scene.build().mass, np.array([[1.0, -2.0, 3.0], [0.5, 0.0, -1.0]])
    np.testing.assert_allclose(mass.momentum(v), np.array([[2.0, 1.0], [1.0, 2.0]]) @ v, rtol=1e-14)
    jump = np.array([[0.1, 0.2, 0.3], [0.0, 0.0, 0.0]])
    np.testing.assert_allclose(mass.kick(jump), [jump[0], -0.5 * jump[0]], rtol=1e-14)
