"""Losses of contact as explicit kicks solve for them: equations, energy and momentum of a kick, order, and rest."""

from dataclasses import replace

import nets
import numpy as np
import pytest
from contact_kicks import Solved
from scipy.optimize import brentq

import refweb
from refweb.dynamics.integrators.central_difference import CentralDifference
from refweb.effects.base import CONTACT_COLUMNS
from refweb.effects.contact_solver import fitted

GRAVITY = 9.81
SLIPS = (1e-9, 1e-4, 1e-2, 1.0)
SHAPES = {
    "sphere": dict(radius=0.3),
    "ring": dict(radius=0.3, normal=(0.0, 0.6, 0.8)),
    "box": dict(size=(0.6, 0.8, 1.0), rounding=0.1),
    "cylinder": dict(radius=0.3, length=0.8, axis=(0.0, 0.6, 0.8), rounding=0.1),
}


class Kick:
    """One kick of a web that a body overlaps, from velocities at random.

    Parameters
    ----------
    shape : str
        One of `SHAPES`; boxes and cylinders are fixed.
    seed : int
        Of positions, velocities, masses, forces and the size of the kick.
    loaded : bool
        Whether other forces act.
    contact
        Keys of the contact.

    Attributes
    ----------
    v, after : ndarray, shape (rows, 3)
        Velocity ahead of it and behind it [m/s].
    f, own : ndarray, shape (rows, 3)
        Other forces, and those of contact [N].
    power : float
        What is booked of them [W].
    """

    def __init__(self, shape, seed, loaded=True, **contact):
        rng = np.random.default_rng(seed)
        own = dict(fixed=True) if shape in ("box", "cylinder") else dict(mass=float(10.0 ** rng.uniform(-4, 2)))
        web = nets.skew_web()
        where = tuple(map(float, web.points[4] + rng.uniform(-0.2, 0.2, 3)))
        body = refweb.Body(name="it", shape=shape, position=where, **SHAPES[shape], **own)
        cable = refweb.Cable(law="linear", modulus=1.0, area=1e-6, density=1.0)
        held = np.zeros((6, 3), dtype=bool)
        held[0], held[1, 0] = True, True
        touching = refweb.Contact(stiffness=1e3, exponent=1.5, **contact)
        system = nets.system(web, cable, [body, touching], False, held)
        net = replace(system.net, mass=np.concatenate([10.0 ** rng.uniform(-3, 0, 6), system.net.mass[6:]]))
        self.system, self.mass = system, net.mass
        self.inverse = np.where(system.supported, 0.0, 1.0 / np.where(net.mass > 0.0, net.mass, 1.0)[:, None])
        self.x, shown = np.zeros((system.rows, 3)), (system.rows, 3)
        self.x[:6] = 0.02 * rng.standard_normal((6, 3))
        self.v = np.where(system.supported, 0.0, 10.0 ** rng.uniform(-3, 1) * rng.standard_normal(shown))
        self.h = float(10.0 ** rng.uniform(-5, -1))
        self.f = loaded * 10.0 * rng.standard_normal(shown)
        (self.term,) = (one for one in system.terms if one.velocity.implicit is not None)
        solved = Solved(system, self.x, self.v, self.h, self.f, self.mass)
        self.contacts, self.rows, self.sweeps = solved.contacts, solved.rows, solved.sweeps
        self.own, self.after, self.mean = solved.forces, solved.after, solved.mean
        self.power, self.felt = solved.power, solved.felt

    def by_law(self, column):
        """The forces of all contacts as the law has them at the velocities that each sees, with its own θ."""
        total = np.zeros_like(self.f)
        for n, rows in enumerate(self.term.cells):
            own = self.contacts["cell"] == n
            at_node = [
                self.rows(contact)[1] == rows[2] and self.rows(contact)[0] in rows[:2] for contact in self.contacts
            ]
            for contact in self.contacts[own if own.any() else at_node]:  # lines that end at a node touch there as one
                theta = contact["theta"][column]
                seen = (1.0 - theta) * self.v + theta * self.after
                one = self.term.cells[n : n + 1], self.term.data[n : n + 1], np.zeros((1, CONTACT_COLUMNS))
                self.term.force(0.0, self.x, seen, total, *one)
        return total


def kicks(shape, slip, **more):
    """Kicks of 25 random states, half of them under other forces, that touch."""
    made = [Kick(shape, seed, seed % 2 == 0, slip_velocity=slip, **more) for seed in range(25)]
    made = [kick for kick in made if len(kick.contacts)]
    assert len(made) > 20 and max(len(kick.contacts) for kick in made) > 4  # some share a node, all a body
    return made


@pytest.mark.ordinary("sphere-1e-09", "box-1e-09", "ring-0.01", "cylinder-0.01")
@pytest.mark.parametrize("slip", SLIPS)
@pytest.mark.parametrize("shape", SHAPES)
def test_energy_is_never_gained(shape, slip):
    """By kinetic energies from masses alone; what is booked is what they lose, to rounding, settled or not."""
    for kick in kicks(shape, slip, friction=0.5, damping=0.3):
        mass, free = kick.mass[:, None], kick.inverse > 0.0
        before, after = (0.5 * (mass * np.where(free, v, 0.0) ** 2).sum() for v in (kick.v, kick.after))
        gained = after - before - kick.h * (kick.f * kick.mean)[free].sum()
        rounding = 1e-13 * (before + after)
        assert gained <= rounding
        assert abs(gained - kick.h * kick.power) <= rounding


@pytest.mark.parametrize("shape", ["sphere", "ring"])
def test_momenta_are_kept(shape):
    """Contact has no resultant, and no moment, of a ring about its normal, with that on the rotation of the body.

    What its cells show as felt is the force on the body.
    """
    for kick in kicks(shape, 1e-3, friction=0.5, damping=0.3):
        linear, place = kick.system.rows - 1, kick.system.net.points + kick.x
        most = np.abs(kick.own).max()
        assert np.abs(kick.own[:linear].sum(axis=0)).max() <= 1e-12 * most
        (body,) = kick.system.net.bodies
        assert np.abs(kick.felt - kick.own[body.row]).max() <= 1e-12 * most
        moment = np.cross(place[:linear], kick.own[:linear]).sum(axis=0) + kick.own[-1]
        axes = np.eye(3) if shape == "sphere" else np.array([SHAPES["ring"]["normal"]])
        assert np.abs(axes @ moment).max() <= 1e-11 * most


@pytest.mark.parametrize("column, loss", [(1, dict(friction=0.5)), (0, dict(damping=0.3))])
def test_forces_are_those_of_the_law(column, loss):
    """All at once, with the velocities that contacts see, of which θ says the share of those behind the kick."""
    found = [kick for kick in kicks("sphere", 1.0, **loss) if kick.sweeps < 500]
    assert len(found) > 10
    for kick in found:
        theta = kick.contacts["theta"][:, column]
        assert (theta >= 0.5).all() and (theta <= 1.0).all()
        np.testing.assert_allclose(kick.by_law(column), kick.own, rtol=0, atol=1e-8 * np.abs(kick.own).max())
    assert sum((found[0].contacts[name] > 0.0).any() for name in ("damping", "friction")) == 1


def test_a_loss_alone_is_exact():
    """A kick by θ takes e^−z of a velocity that is lost in proportion to itself."""
    for z in np.geomspace(1e-9, 600.0, 200):
        theta = fitted(z)
        np.testing.assert_allclose((1.0 - (1.0 - theta) * z) / (1.0 + theta * z), np.exp(-z), rtol=1e-9, atol=1e-13)


# A block: four nodes and lines of a square that move alike


NODE, STIFFNESS, FRICTION_OF_BLOCK = 1000.0 * 1e-4 * 0.2, 1e4, 0.3
SUNK = NODE * GRAVITY / (3.0 * STIFFNESS)
"""Depth at which it rests [m]: of the two lines at a node each pushes with k δ at its end and half of k δ between."""


def block(slip, duration, *, speed=0.0, along=0.0, interval=None, **solve):
    """A square of lines on the top of a box that slides, or is pulled along x by a share of its weight."""
    points = [[0, 0, -SUNK], [0.2, 0, -SUNK], [0.2, 0.2, -SUNK], [0, 0.2, -SUNK]]
    box = refweb.Body(name="box", shape="box", size=(4.0, 4.0, 1.0), position=(0.0, 0.0, -0.5), fixed=True)
    observed = dict(
        v=dict(quantity="velocity", node=0, component="x"),
        way=dict(quantity="displacement", node=0, component="x"),
        held=dict(quantity="reaction", body="box", component="x"),
        most=dict(quantity="reaction", body="box", component="x", reduce="max"),
    )
    thrown = [refweb.Velocity(node="all", value=(speed, 0.0, 0.0))] if speed else []
    return refweb.run(
        refweb.Scene(
            web=refweb.Inline(points=points, lines=[[0, 1], [1, 2], [2, 3], [3, 0]], supports=[]),
            cable=refweb.Cable(law="linear", modulus=1e6, area=1e-4, density=1000.0),
            supports=refweb.Supports(nodes=[]),
            effects=[
                box,
                refweb.Gravity(acceleration=(along * GRAVITY, 0.0, -GRAVITY)),
                refweb.Contact(stiffness=STIFFNESS, friction=FRICTION_OF_BLOCK, slip_velocity=slip),
                *thrown,
            ],
            solve=refweb.Dynamic(duration=duration, **solve),
            output=refweb.Output(interval=interval or duration),
            accuracy=refweb.Accuracy(error="none"),
            observe=[refweb.Observe(name=name, **keys) for name, keys in observed.items()],
        )
    )


def test_a_slide_is_of_order_two():
    """v' = −μ g v/√(v² + v_s²), whose time is √(v² + v_s²) − v_s arcsinh(v_s/v) at v₀ less that at v, over μ g."""
    slip, speed, duration, steps = 0.2, 0.5, 0.15, np.array([1e-3, 5e-4, 2.5e-4, 1.25e-4])
    time = lambda v: np.hypot(v, slip) - slip * np.arcsinh(slip / v)  # noqa: E731
    end = brentq(lambda v: time(speed) - time(v) - FRICTION_OF_BLOCK * GRAVITY * duration, 1e-3, speed)
    errors = [abs(block(slip, duration, speed=speed, step_size=h).results["v"].value - end) for h in steps]
    assert errors[-1] < 1e-6 * speed and abs(np.polyfit(np.log(steps), np.log(errors), 1)[0] - 2.0) < 0.1


@pytest.mark.parametrize("slip", [1e-3, 1e-9])
def test_what_sticks_creeps_as_the_law_has_it(slip):
    """At v_s q/√(1 − q²), q = a/(μ g), with friction that is the pull: no ripple, no way of a share of h a in a step.

    At 1e-9 m/s sweeps leave the creep of twelve contacts that hold four nodes at some times v_s, 1e-5 of what a step
    gives; in the first step of a row, which begins without forces, at more: the way is below 1e-5 of the free one.
    """
    pull = 0.2
    found = block(slip, 0.3, along=pull, interval=0.01).results
    q = pull / FRICTION_OF_BLOCK
    creep = slip * q / np.sqrt(1.0 - q * q)
    near = 1e-6 * creep if slip > 1e-6 else 1e-7
    np.testing.assert_allclose(found["v"].value, creep, rtol=0, atol=near)
    assert abs(found["way"].value) <= creep * 0.3 * (1.0 + 1e-6) + (slip < 1e-6) * 1e-5 * 0.5 * pull * GRAVITY * 0.3**2
    weight = 4.0 * NODE * GRAVITY
    np.testing.assert_allclose(found["held"].value, pull * weight, rtol=1e-6)
    assert found["most"].value <= FRICTION_OF_BLOCK * weight * (1.0 + 1e-9)


def test_steps_do_not_depend_on_the_slip_velocity():
    """Neither their number nor, below what is resolved, the way of a block that stops at v²/(2 μ g)."""
    slips, speed = (1e-1, 1e-3, 1e-6, 1e-9), 0.5
    found = [block(slip, 0.25, speed=speed) for slip in slips]
    assert len({one.solver["nsteps"] for one in found}) == 1
    bounds = [CentralDifference(one.state.system).bound() for one in found]
    assert len(set(bounds)) == 1
    way = speed**2 / (2.0 * FRICTION_OF_BLOCK * GRAVITY)
    h = 0.25 / found[0].solver["nsteps"]
    # It stops within a step, whose end is off by less than μ g h²; below v_s it comes to rest by v_s² ln(v/v_s)/(μ g).
    for one in found[2:]:
        np.testing.assert_allclose(one.results["way"].value, way, rtol=0, atol=FRICTION_OF_BLOCK * GRAVITY * h * h)
