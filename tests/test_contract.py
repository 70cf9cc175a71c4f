"""What every effect keeps: forces from energies, tangents from forces, invariance of what is internal, and the bound.

Every class in `refweb.effects` that has ``on``, ``extend`` or ``start`` is found by itself; one without an example here
fails.
"""

import importlib
import inspect
import pkgutil
from dataclasses import replace
from types import SimpleNamespace

import nets
import numpy as np
import pytest
import scipy.linalg
from nets import LAWS, skew_net

import refweb
import refweb.effects
from refweb.dynamics.integrators.central_difference import CentralDifference
from refweb.effects import elasticity
from refweb.effects.base import PrescribedMotion, no_force
from refweb.effects.plastic import ROW
from refweb.errors import InputError
from refweb.net import discretisation
from refweb.net.laws.law import LINE
from refweb.net.laws.smooth import Smooth
from refweb.net.laws.straight import Linear, TensionOnly
from refweb.system.system import System

PLASTIC = dict(law="elastic-plastic", modulus=1e5, area=1e-4, density=300.0)
EXAMPLES = {
    "Elasticity": [{}],
    "Gravity": [dict(acceleration=(1.0, -2.0, 3.0))],
    "Load": [
        dict(node=[1, 4], force=(1.0, 2.0, -3.0)),
        dict(node=3, force=(1.0, 0.5, 2.0), factor=[(0.0, 0.0), (1.0, 2.0), (3.0, -1.0)]),
    ],
    "Motion": [dict(node=[1, 3], displacement=[(0.0, 0.0, 0.0, 0.0), (1.0, 0.1, 0.2, -0.3), (2.0, 0.0, 0.0, 1.0)])],
    "PointMass": [dict(node=[1, 4], mass=0.7)],
    "Velocity": [dict(node="all", value=(1.0, -2.0, 3.0))],
    "Body": [
        dict(name="ball", radius=0.3, mass=0.5, position=(0.6, 0.3, 0.2), velocity=(1.0, 2.0, 3.0)),
        dict(name="wall", radius=0.4, position=(0.2, 0.9, -0.1), fixed=True),
        dict(name="hoop", shape="ring", radius=0.3, normal=(0.1, 1.0, 0.2), mass=0.5, position=(0.5, 0.2, 0.25)),
        dict(name="chest", shape="box", size=(0.6, 0.5, 0.7), axes=[(3.0, 1.0, 0.0), (-1.0, 3.0, 0.0)], rounding=0.2)
        | dict(position=(0.9, 0.7, -0.2), fixed=True),
        dict(name="drum", shape="cylinder", radius=0.3, length=0.8, axis=(1.0, -1.0, 0.2), rounding=0.2)
        | dict(position=(0.2, 0.7, -0.15), fixed=True),
    ],
    "Contact": [
        dict(stiffness=1e3),
        dict(stiffness=1e2, bodies=dict(wall=dict(stiffness=1e4))),
        dict(stiffness=1e3, exponent=1.5),
        dict(stiffness=1e3, damping=0.3),
        dict(stiffness=1e3, exponent=1.5, damping=0.1, slip_velocity=2.0, bodies=dict(ball=dict(friction=0.4))),
        dict(stiffness=1e3, friction=0.4, slip_velocity=0.5),
        dict(stiffness=1e3),
        dict(stiffness=1e3, exponent=1.5, damping=0.1, friction=0.4, slip_velocity=2.0),
    ],
    "SelfContact": [dict(radius=0.1, stiffness=50.0), dict(radius=0.1, stiffness=50.0, damping=0.5)],
    "Frame": [dict(angular_velocity=(1.0, -2.0, 3.0))],
    "Drag": [
        dict(density=20.0, normal=1.1, tangential=0.3),
        dict(density=20.0, diameter=0.05, wind=(1.0, 2.0, -3.0)),
    ],
    "Orbit": [dict(mean_motion=2.0)],
    "Pressure": [
        dict(lines="all", normal=(1.0, 2.0, -2.0), value=30.0),
        dict(lines=[0, 4], normal=(0.0, 0.0, 1.0), value=20.0, factor=[(0.0, 0.0), (1.0, 2.0), (3.0, -1.0)]),
        dict(lines="edge", normal=(0.0, 0.0, 2.0), value=-7.0, away_from=(0.5, 0.5, 0.0)),
    ],
    "Thrust": [
        dict(node=4, line=5, force=-3.0),
        dict(node=0, line=0, force=2.0, factor=[(0.0, 0.0), (1.0, 2.0), (3.0, -1.0)]),
    ],
    "Damping": [dict(time=0.02), dict(rate=3.0), dict(rate=1.0, bodies=2.0)],
    "Bending": [dict(stiffness=2.0), dict(stiffness=2.0, clamp=[1, 4])],
    "Attach": [dict(body="wall", node=[1, 3]), dict(body="wall", node=2, point=(0.1, 0.2, -0.3))],
    "Link": [dict(nodes=[0, 4]), dict(nodes=[5, 4, 2, 3])],
    "Thread": [
        dict(name="rope", nodes=[0, 4, 2, 3], modulus=1e5, area=2e-4, density=0.0, prestrain=-0.05),
        dict(name="rope", nodes=[5, 1, 4, 1, 3], closed=True, modulus=1e5, area=2e-4, density=0.0, prestrain=0.3),
        dict(name="rope", nodes=[0, 2, 5], area=1e-4, density=0.0, prestrain=0.2, law="smooth", modulus=1e5),
        dict(name="rope", nodes=[0, 2, 5], area=1e-4, density=0.0, length=2.5, law="table")
        | dict(stress=[[0.01, 0.0], [0.1, 1e4], [0.5, 1e5]]),
        dict(name="rope", nodes=[0, "ball", 2, 5], around=[dict(body="ball")], modulus=1e5, area=2e-4, density=0.0),
        dict(name="rope", nodes=[1, 0, "wall", 2], around=[dict(body="wall")], closed=True, prestrain=0.2)
        | dict(modulus=1e5, area=2e-4, density=0.0),
        dict(name="rope", nodes=[0, "drum", 5, "hoop", 2], modulus=1e5, area=2e-4, density=0.0, prestrain=0.1)
        | dict(around=[dict(body="drum", side=(0.0, 0.0, 1.0), turns=1), dict(body="hoop", side=(-1.0, 0.0, 0.0))]),
        dict(name="rope", nodes=[0, 4, 2, 3], modulus=1e5, area=2e-4, density=0.0, prestrain=0.3, friction=[0.05, 0.2]),
        dict(name="rope", nodes=[5, 1, 4, 1, 3], closed=True, modulus=1e5, area=2e-4, density=0.0, friction=0.1)
        | dict(prestrain=0.2),
    ],
    "Winch": [
        dict(thread="rope", end="first", tension=10.0, speed_limit=0.02),
        dict(thread="rope", end="last", speed=[(0.0, 0.1), (1.0, 0.05)], limit=4.0),
        dict(thread="rope", at=4, tension=10.0, speed_limit=0.02),
        dict(thread="rope", end="last", power=0.1, speed_limit=0.05),
        dict(thread="rope", at=4, power=-0.3, speed_limit=0.02),
        dict(lines=[1, "tie"], tension=10.0, speed_limit=0.02),
        dict(lines="all", speed=[(0.0, 0.1), (1.0, 0.05)], limit=4.0),
        dict(lines=[1, "tie"], power=0.2, speed_limit=0.05),
        dict(thread="rope", end="last", tension=10.0, mass="follows"),
        dict(lines="all", speed=0.1, mass="follows", drum=0),
    ],
    "Reel": [
        dict(lines=[2, "tie"], factor=[(0.0, 1.0), (1.0, 0.9)]),
        dict(lines="all", factor=[(0.5, 1.0), (0.9, 1.1)]),
        dict(lines=[2, "tie"], factor=[(0.0, 1.0), (1.0, 0.9)], mass="follows", drum=2),
    ],
    "Temperature": [
        dict(expansion=1e-4, change=[(0.0, 0.0), (1.0, -100.0)]),
        dict(expansion=1e-4, change=30.0, groups=dict(tie=dict(change=[(0.0, 0.0), (2.0, 200.0)]))),
    ],
    "Rupture": [dict(strength=1e9)],
    "PlasticLines": [
        dict(cable=refweb.Cable(**{**PLASTIC, "yield_stress": 2e3, "hardening": 3e4})),
        dict(cable=refweb.Cable(**PLASTIC, hardening=[(0.0, 1.1e3), (0.012, 3e3), (0.05, 4e3)])),
    ],
    "ViscousArms": [dict(viscous=refweb.Viscous(arms=[(5e4, 0.02), (2e4, 0.5)], lines=["edge", 5, 7, 8]))],
    "Fold": [dict(ratio=0.5)],
}
ROLES = ("on", "extend", "start")


def effect_classes():
    found = {}
    for module in pkgutil.walk_packages(refweb.effects.__path__, "refweb.effects."):
        content = importlib.import_module(module.name)
        for name, value in inspect.getmembers(content, inspect.isclass):
            if value.__module__ == content.__name__ and any(hasattr(value, role) for role in ROLES):
                found[name] = value
    return found


CLASSES = effect_classes()


def cases(role):
    """(name, number) of each example of the classes that have a role."""
    return [(name, i) for name, c in CLASSES.items() if hasattr(c, role) for i in range(len(EXAMPLES.get(name, [0])))]


OF_ONE_LAW = ("PlasticLines", "ViscousArms")
"""Effects whose kernels are made for each law: each of their examples has one."""


def on_lines(name, i):
    """Tell if an example is a winch on lines, which do not push."""
    return name == "Winch" and "lines" in EXAMPLES[name][i]


CASES = [
    (name, i, law)
    for name, i in cases("on")
    for n, law in enumerate(LAWS)
    if (n == i % len(LAWS) if name in OF_ONE_LAW else law == "tension-only" or not on_lines(name, i))
]
IN_TURN = [
    pytest.param(
        name, i, law, marks=pytest.mark.slow if not on_lines(name, i) and law != [*LAWS][i % len(LAWS)] else ()
    )
    for name, i, law in CASES
]
"""Examples with their laws, of which the ordinary run takes one for each, in turn."""


def example(name, i):
    return CLASSES[name](**EXAMPLES[name][i])


def make(name, i, law, tensionless=False):
    """(net, system of one effect); contact has bodies to touch, with ends of lines and with their middles."""
    web = nets.crossed_web() if name == "SelfContact" else nets.skew_web()
    web = replace(web, natural_length=None) if tensionless else web
    pieces = 3 if name == "Bending" else 1  # no line of it continues another
    net = discretisation.build(web, replace(nets.skew_cable(law), subdivide=pieces))
    touched = name in ("Contact", "Attach", "Damping") or "around" in EXAMPLES[name][i]
    bodies = [example("Body", k) for k in ((0, 1) if i < 6 else (2, 3, 4))] if touched else []
    threads = [example("Thread", 8 if "at" in EXAMPLES[name][i] else 7)] if name == "Winch" else []
    system = System(net, [*bodies, *threads, example(name, i)], np.zeros((len(net.points), 3), dtype=bool))
    return system.net, system


@pytest.mark.parametrize("name", CLASSES)
def test_every_effect_has_an_example(name):
    assert EXAMPLES.get(name), f"effect {name} has no example in the contract test"


def state(net, seed):
    rng = np.random.default_rng(seed)
    return 0.05 * rng.standard_normal(net.points.shape), rng.standard_normal(net.points.shape)


def set_internal(net, x, numbers):
    """Give internal variables some numbers, and lines that yield their length: the energy of a step of that is kept."""
    x[len(x) - net.internal :] = numbers
    if ROW in net.line_data.dtype.names:
        last = 2 * len(net.weights)
        x[net.line_data[ROW].astype(int) + last // 3, last % 3] = net.natural_length


def slope(errors, steps):
    return np.polyfit(np.log(steps), np.log(errors), 1)[0]


@pytest.mark.parametrize("name, i, law", CASES)
@pytest.mark.parametrize("seed", range(3))
def test_effect(name, i, law, seed):
    net, system = make(name, i, law)
    if system.drives:
        return drive(net, system)
    if system.constraints:
        return constraint(net, system, seed)
    assert system.terms
    for terms in potentials(system):
        check_term(net, alone(system, terms), terms[0], seed)


def alone(system, terms):
    """The system of some terms of another one, with its internal variables."""
    net = system.net
    one = System(net, [SimpleNamespace(on=lambda _: terms)], np.zeros(net.points.shape, dtype=bool))
    first = len(net.points) - net.internal
    one.supported[first:] = system.supported[first:]
    one.arrange()
    return one


def potentials(system):
    """Lists of terms whose forces are the gradient of their energies: each alone, and energy without force with one."""
    lists = []
    for term in system.terms:
        if term.force is no_force and term.energy is not None:
            lists[-1].append(term)
        else:
            lists.append([term])
    return lists


def check_term(net, system, term, seed):
    """A term alone in its system."""
    assert term.cells.dtype == np.int32 and len(term.cells) == len(system.data_of(term, 0.0))
    x, v = state(net, seed)
    set_internal(net, x, np.abs(x[len(x) - net.internal :]))
    d = np.where(system.supported, 0.0, state(net, seed + 100)[0])
    # Steps that cross no kink: the lines of this net are at least 1e-3 of strain from it at these states.
    steps = np.array([2e-3, 1e-3, 5e-4, 2.5e-4])
    t = 0.7

    if term.energy is not None:
        exact = -np.sum(system.force(t, x, v) * d)
        remainder = [abs(system.energy(t, x + h * d) - system.energy(t, x) - h * exact) for h in steps]
        scale = 1e-13 * abs(system.energy_of(term, t, x)).sum()
        assert max(remainder) <= 10 * scale or abs(slope(remainder, steps) - 2) < 0.1

    force = system.force(t, x, v)
    if term.tangent.stiffness is None:
        np.testing.assert_array_equal(system.force(t, x + d, v), force)
    else:
        K = system.pattern.matrix(system.stiffness(t, x, v))
        forces = [system.force(t, x + h * d, v).ravel()[system.free] - force.ravel()[system.free] for h in steps]
        product = K @ d.ravel()[system.free]
        remainder = [np.linalg.norm(f + h * product) for h, f in zip(steps, forces, strict=True)]
        assert max(remainder) <= 1e-13 * np.abs(force).sum() or abs(slope(remainder, steps) - 2) < 0.1
        if term.energy is not None:
            assert abs(K - K.T).max() <= 1e-13 * abs(K).max()
        values = np.linalg.eigvalsh(system.pattern.matrix(system.stiffness(t, x, v, definite=True)).toarray())
        assert values[0] >= -1e-12 * values[-1]

    if term.velocity.damping is not None:
        C = system.pattern.matrix(system.damping(t, x, v))
        forces = [system.force(t, x, v + h * d).ravel()[system.free] - force.ravel()[system.free] for h in steps]
        product = C @ d.ravel()[system.free]
        remainder = [np.linalg.norm(f + h * product) for h, f in zip(steps, forces, strict=True)]
        assert max(remainder) <= 1e-13 * np.abs(force).sum() or abs(slope(remainder, steps) - 2) < 0.1
        values = np.linalg.eigvalsh((C + C.T).toarray())
        assert values[0] >= -1e-12 * values[-1] and (values[-1] > 0.0 or term.balance.power is None)

    if term.balance.power is not None:
        (out,) = system.forces(t, x, v)[1]
        if term.elements.internal is None:  # else by what internal variables do
            np.testing.assert_allclose(out[:, term.balance.power].sum(), np.sum(force * v), rtol=1e-12)
        assert term.balance.column == "work" or out[:, term.balance.power].max() <= 0.0

    if term.balance.internal:
        position, moment, internal = net.points + x, len(net.points) - net.spins, len(net.points) - net.internal
        size = np.abs(force).sum()
        assert np.abs(force[:moment].sum(axis=0)).max() <= 1e-14 * size
        felt = [body for body in net.bodies if body.row in term.cells]
        if term.balance.twists or any(not body.shape.once for body in felt):
            return  # what holds directions in space, and bodies with axes, which do not turn
        moments = np.vstack([np.cross(position, force)[:moment], force[moment:internal]])
        if term.velocity.damping is None or all(
            body.spin is not None for body in felt
        ):  # else the supports have a moment
            assert np.abs(moments.sum(axis=0)).max() <= 1e-14 * size
        turn = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))[0]
        turn *= np.linalg.det(turn)
        moved, turned = position @ turn.T + [3.0, -2.0, 1.0] - net.points, force @ turn.T
        moved[internal:], turned[internal:] = x[internal:], force[internal:]
        np.testing.assert_allclose(system.force(t, moved, v @ turn.T), turned, atol=1e-12 * size)


# States in which the generic steps above are too long, or forces too large or too small


def flat(points, noise):
    """A nanometre from where nothing is taut."""
    return 1e-9 * noise, noise


def stretched(points, noise):
    """Every line at ten times its length, thrown about at 1 km/s."""
    return 9.0 * (points - points.mean(axis=0)) + 0.05 * noise, 1e3 * noise


def crumpled(points, noise):
    """The whole web in a millimetre, at rest."""
    return -0.999 * (points - points.mean(axis=0)) + 1e-4 * noise, 0.0 * noise


def far(points, noise):
    """Carried a kilometre away, where contact ends."""
    return 0.05 * noise + [1e3, 0.0, 0.0], noise


def agrees(change, product):
    """Whether for one step length at least the change of something is that of its derivative, to five digits.

    Too long steps cross kinks and see curvature, of too short ones rounding is left: of a wrong derivative none agrees.
    """
    errors = []
    for h in 10.0 ** -np.arange(14.0):
        exact = h * product
        errors.append(np.linalg.norm(change(h) - exact) / (np.linalg.norm(exact) or 1.0))
    return min(errors) < 1e-5


@pytest.mark.parametrize("name, i, law", IN_TURN)
def test_derivatives_in_hard_states(name, i, law):
    for place in (flat, stretched, crumpled, far):
        check_derivatives(name, i, law, place)


def check_derivatives(name, i, law, place):
    net, system = make(name, i, law, tensionless=place is flat)
    noise = np.random.default_rng(7).standard_normal((2, len(net.points), 3))
    x, v = np.zeros((2, *net.points.shape))
    x[: net.nodes], v[: net.nodes] = place(net.points[: net.nodes], noise[0, : net.nodes])
    set_internal(net, x, 0.02)  # arms that have crept: without, all are at their kink
    d, t = noise[1], 0.7
    for terms in potentials(system):
        one, term = alone(system, terms), terms[0]
        d = np.where(one.supported, 0.0, d)
        force = one.force(t, x, v)
        assert np.isfinite(force).all()
        if term.energy is not None:

            def gain(h):
                there, here = x + h * d, x - h * d  # noqa: B023
                return sum(np.sum(one.energy_of(f, t, there) - one.energy_of(f, t, here)) for f in terms)  # noqa: B023

            assert agrees(gain, -2.0 * np.sum(force * d))
        for part, dx, dv in ((term.tangent.stiffness, d, 0.0 * d), (term.velocity.damping, 0.0 * d, d)):
            if part is None:
                continue
            values = one.stiffness(t, x, v) if part is term.tangent.stiffness else one.damping(t, x, v)
            assert np.isfinite(values).all()

            def change(h, dx=dx, dv=dv):
                there, here = (one.force(t, x + s * dx, v + s * dv) for s in (h, -h))  # noqa: B023
                return (there - here).ravel()[one.free]  # noqa: B023

            assert agrees(change, -2.0 * (one.pattern.matrix(values) @ d.ravel()[one.free]))


@pytest.mark.parametrize("name, i", cases("extend"))
def test_extension(name, i):
    """Rows and mass are added, what was there stays, and the given net is left alone."""
    net = skew_net("tension-only" if on_lines(name, i) else "smooth")
    for number in range(5) if "around" in EXAMPLES[name][i] else [1] if name == "Attach" else []:
        net = example("Body", number).extend(net)
    net = example("Thread", 8 if "at" in EXAMPLES[name][i] else 0).extend(net) if name == "Winch" else net
    before = net.points.copy(), net.mass.copy()
    effect = example(name, i)
    longer = effect.extend(net)
    rows = len(net.points)
    np.testing.assert_array_equal(net.points, before[0])
    np.testing.assert_array_equal(net.mass, before[1])
    np.testing.assert_array_equal(longer.points[:rows], net.points)
    assert (longer.mass[:rows] >= net.mass).all() and len(longer.mass) == len(longer.points) >= rows
    assert longer.web is net.web and longer.cells is net.cells
    np.testing.assert_array_equal(longer.line_data.matrix[:, : net.line_data.matrix.shape[1]], net.line_data.matrix)
    added = 0.0 if name in ("Reel", "Winch") else getattr(effect, "mass", 0.0) or 0.0
    times = len(effect.node) if added and hasattr(effect, "node") else 1
    np.testing.assert_allclose(longer.mass.sum() - net.mass.sum(), times * added, rtol=1e-14)


@pytest.mark.parametrize("name, i", cases("start"))
def test_start(name, i):
    """Velocities are written to what is free, and to nothing else."""
    net, effect = skew_net(), example(name, i)
    supported = np.random.default_rng(i).random(net.points.shape) < 0.5
    v = np.full_like(net.points, np.nan)
    effect.start(net, supported, v)
    assert np.isnan(v[supported]).all() and np.isfinite(v[~supported]).all()


def test_a_body_is_a_row():
    ball = example("Body", 0)
    net = ball.extend(skew_net())
    (body,) = net.bodies
    assert (body.name, body.row, body.radius, body.velocity) == ("ball", 6, ball.radius, ball.velocity)
    assert tuple(net.points[6]) == ball.position and net.mass[6] == ball.mass
    system = System(net, [example("Body", 1)], np.zeros((6, 3), dtype=bool))
    assert system.supported[7].all() and not system.supported[:7].any()
    np.testing.assert_array_equal(system.initial_velocity(), [[0.0] * 3] * 6 + [list(ball.velocity), [0.0] * 3])


def test_point_masses_add_up():
    mass = CLASSES["PointMass"]
    net = mass(node=4, mass=0.25).extend(mass(node=[4, 1], mass=0.5).extend(skew_net()))
    np.testing.assert_allclose(net.mass - skew_net().mass, [0, 0.5, 0, 0, 0.75, 0], atol=1e-15)


def test_contact_is_per_body():
    """The table of a body replaces the stiffness for that body alone."""
    (term,) = make("Contact", 1, "linear")[1].terms
    assert len(term.cells) == 18 and set(term.data[:9, 1]) == {1e2} and set(term.data[9:, 1]) == {1e4}
    with pytest.raises(InputError, match='bodies."walls" is not a body, did you mean "wall"'):
        CLASSES["Contact"](stiffness=1.0, bodies=dict(walls=dict(stiffness=1.0))).on(make("Contact", 0, "linear")[0])


def largest_frequency(system, x):
    """Of M⁻¹K over all that is free [1/s²]."""
    K = system.pattern.matrix(system.stiffness(0.0, x)).toarray()
    M = np.diag(np.repeat(system.net.mass, 3)[system.free])
    return scipy.linalg.eigvalsh(K, M)[-1]


@pytest.mark.parametrize("effects", [["Elasticity"], ["Contact"], ["Elasticity", "Contact"]])
@pytest.mark.parametrize("mass", [1e-6, 1e-3, 1.0, 1e3])
@pytest.mark.parametrize("law", LAWS)
def test_bound_bounds(effects, mass, law):
    """2/ω of the tangent is never below it: bodies light and heavy, deep touches, supports without mass."""
    bodies = [CLASSES["Body"](**{**EXAMPLES["Body"][0], "mass": mass}), example("Body", 1)]
    acting = [*bodies, *(example(name, 0) for name in effects)]
    for seed in range(5):
        rng = np.random.default_rng(seed)
        supported = rng.random(6) < 0.4
        net = replace(skew_net(law), mass=np.where(supported, 0.0, 10.0 ** rng.uniform(-3, 0, 6)))
        system = System(net, acting, np.repeat(supported[:, None], 3, axis=1))
        x = state(system.net, seed)[0]
        limit = CentralDifference(system).bound(x, reach=0.0)
        assert limit <= 2.0 / np.sqrt(max(largest_frequency(system, x), 0.0) or 1e-300) * (1.0 + 1e-12)


@pytest.mark.parametrize("mass", [1e-4, 1e-2, 1.0, 100.0])
@pytest.mark.parametrize(
    "length, place, height", [(1.0, 1.1, 0.2), (1.0, 0.5, 0.2), (0.1, 0.05, 0.2), (0.02, 0.015, 0.15)]
)
@pytest.mark.parametrize("held", [0, 1, 2])
def test_bound_bounds_one_line(mass, length, place, height, held):
    """A ball of 0.3 m far into a line, at its end or over a short one that it turns; ends held without a mass."""
    web = refweb.SingleCable(start=(0, 0, 0), end=(length, 0, 0), elements=1).web()
    net = discretisation.build(web, refweb.Cable(law="linear", modulus=1.0, area=1.0, density=0.0))
    supported = np.arange(2) < held
    net = replace(net, mass=np.where(supported, 0.0, 1e-2))
    ball = CLASSES["Body"](name="ball", radius=0.3, mass=mass, position=(place, 0.0, height))
    effects = [ball, CLASSES["Contact"](stiffness=1e4)]
    system = System(net, effects, np.repeat(supported[:, None], 3, axis=1))
    x = np.zeros((3, 3))
    limit = CentralDifference(system).bound(x, reach=0.0)
    assert limit <= 2.0 / np.sqrt(largest_frequency(system, x)) * (1.0 + 1e-12)


@pytest.mark.parametrize("law", LAWS)
def test_bound_of_a_uniform_cable_is_the_time_of_sound(law):
    """L/c of one element, whatever the strain."""
    web = refweb.SingleCable(start=(0, 0, 0), end=(2, 0, 0), elements=20).web()
    cable = refweb.Cable(modulus=7e7, area=1e-4, density=200.0, prestrain=0.1, **LAWS[law])
    length, sound = 0.1 / 1.1, np.sqrt(7e7 / 200.0)
    bound = CentralDifference(nets.system(web, cable)).bound()
    np.testing.assert_allclose(bound, length / sound, rtol=1e-14)


def test_bound_sees_only_bodies_within_reach():
    """A wall 0.5 m above a line that is 1 m long does not count before something comes that far."""
    web = refweb.SingleCable(start=(0, 0, 0), end=(1, 0, 0), elements=2).web()
    cable = refweb.Cable(law="linear", modulus=1e3, area=1e-4, density=100.0)
    wall = CLASSES["Body"](name="wall", radius=0.1, position=(0.5, 0.0, 0.6), fixed=True)
    system = nets.system(web, cable, [wall, CLASSES["Contact"](stiffness=1e6)])
    far, near = (CentralDifference(system).bound(reach=reach) for reach in (0.49, 0.51))
    mass = 100.0 * 1e-4 * 0.5
    np.testing.assert_allclose(far, 2.0 / np.sqrt(4 * 1e3 * 1e-4 / 0.5 / mass), rtol=1e-14)
    # Both lines may push on the node between them with all of the penalty.
    np.testing.assert_allclose(near, 2.0 / np.sqrt((4 * 1e3 * 1e-4 / 0.5 + 2e6) / mass), rtol=1e-14)


def test_bound_sees_only_boxes_within_reach():
    """A box that is 0.5 m above the middle of a line, and further from both of its ends."""
    web = refweb.SingleCable(start=(0, 0, 0), end=(1, 0, 0), elements=2).web()
    cable = refweb.Cable(law="linear", modulus=1e3, area=1e-4, density=100.0)
    box = CLASSES["Body"](name="box", shape="box", size=(0.1, 0.1, 0.2), position=(0.25, 0.0, 0.6), fixed=True)
    system = nets.system(web, cable, [box, CLASSES["Contact"](stiffness=1e6)])
    far, near = (CentralDifference(system).bound(reach=reach) for reach in (0.49, 0.51))
    mass = 100.0 * 1e-4 * 0.5
    np.testing.assert_allclose(far, 2.0 / np.sqrt(4 * 1e3 * 1e-4 / 0.5 / mass), rtol=1e-14)
    np.testing.assert_allclose(near, 2.0 / np.sqrt((4 * 1e3 * 1e-4 / 0.5 + 2.5e6) / mass), rtol=1e-14)


def drive(net, system):
    (driven,) = system.drives
    assert isinstance(driven, PrescribedMotion) and system.supported[driven.cells[:, 0]].all()
    times, steps = (0.3, 1.7), np.array([1e-2, 5e-3])
    for t in times:
        here, there, v = (np.zeros_like(net.points) for _ in range(3))
        system.drive(t, here, v)
        for h in steps:
            system.drive(t + h, there)
            np.testing.assert_allclose(there, here + h * v, atol=1e-15)
        assert not np.delete(here, driven.cells[:, 0], axis=0).any()


def constraint(net, system, seed):
    """Lengths, their two derivatives in time, and forces that do no work on what keeps them."""
    (links,) = system.constraints
    x, v = state(net, seed)
    ends = net.points[links.cells]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    np.testing.assert_allclose(links.length, length, rtol=1e-15)
    assert not links.excess(np.zeros_like(x)).any()
    ends = (net.points + x)[links.cells]
    now = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    np.testing.assert_allclose(links.excess(x), (now**2 - length**2) / (2.0 * length), atol=1e-15)
    for h in (1.0, 1e-2):  # g is quadratic, so that its Taylor series ends
        series = links.excess(x) + h * links.speed(x, v) + 0.5 * h * h * links.turning(v)
        np.testing.assert_allclose(links.excess(x + h * v), series, atol=1e-14)
    multipliers = np.random.default_rng(seed).standard_normal(len(length))
    force = links.pull(x, multipliers)
    np.testing.assert_allclose(np.sum(force * v), multipliers @ links.speed(x, v), rtol=1e-13)
    size = np.abs(force).sum()
    assert np.abs(force.sum(axis=0)).max() <= 1e-15 * size
    assert np.abs(np.cross(net.points + x, force).sum(axis=0)).max() <= 1e-15 * size


@pytest.mark.parametrize("name, i", [case for case in cases("extend") if case[0] in ("Reel", "Temperature")])
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("seed", range(3))
def test_natural_lengths(name, i, law, seed):
    """Lengths are a factor times what they are otherwise, in any order of times; ∂E/∂L is the slope of energy."""
    net, effect = skew_net(law), example(name, i)
    own, free = net.natural_length.copy(), np.zeros((len(net.points), 3), dtype=bool)
    system = System(net, [CLASSES["Elasticity"](), effect, CLASSES["Reel"](lines=[0], factor=[(0.0, 0.95)])], free)
    x, steps, t = state(net, seed)[0], np.array([2e-3, 1e-3, 5e-4, 2.5e-4]), 0.7
    alone = System(skew_net(law), [CLASSES["Elasticity"](), effect], free)
    for time in (t, 9.0, -1.0, t):
        lengths, others = system.natural_length(time), alone.natural_length(time)
        assert (lengths > 0.0).all()
        np.testing.assert_allclose(lengths, others * np.where(net.line == 0, 0.95, 1.0), rtol=1e-15)
    driven = np.concatenate([elements for elements, _ in system.net.factors])
    np.testing.assert_array_equal(np.delete(lengths, driven), np.delete(own, driven))
    np.testing.assert_array_equal(system.net.natural_length, own)
    energy, lengths, slopes = system.energy(t, x), system.natural_length(t), system.length_force(t, x)
    changes = [system.natural_length(t + h) - lengths for h in steps]
    remainder = [abs(system.energy(t + h, x) - energy - slopes @ d) for h, d in zip(steps, changes, strict=True)]
    assert max(remainder) <= 1e-13 * energy or abs(slope(remainder, steps) - 2) < 0.1  # slack lines have no slope


def test_load_with_a_table_and_in_load_steps():
    load = CLASSES["Load"]
    still = np.zeros((6, 3))
    for quasi_static, t, factor in [(True, 0.25, 0.25), (False, 0.25, 1.0), (True, 4.0, 4.0)]:
        net = skew_net(quasi_static=quasi_static)
        system = System(net, [load(node=4, force=(1.0, 2.0, 3.0))], np.zeros((6, 3), dtype=bool))
        np.testing.assert_array_equal(system.force(t, still)[4], factor * np.array([1.0, 2.0, 3.0]))
        table = load(node=4, force=(1.0, 2.0, 3.0), factor=[(1.0, 5.0), (2.0, 7.0)])
        system = System(net, [table], np.zeros((6, 3), dtype=bool))
        for time, value in [(-1.0, 5.0), (1.0, 5.0), (1.5, 6.0), (2.0, 7.0), (9.0, 7.0)]:
            np.testing.assert_array_equal(system.force(time, still)[4], value * np.array([1.0, 2.0, 3.0]))


def test_weight_is_the_whole_mass():
    net = skew_net()
    gravity = System(net, [CLASSES["Gravity"](acceleration=(0.0, 0.0, -9.81))], np.zeros((6, 3), dtype=bool))
    values = 300 * 1e-4 * np.ones(9)
    values[[1, 3]], values[[6, 7]] = 900 * 3e-4, 300 * 2e-4
    weight = -9.81 * (values * net.web.natural_length).sum()
    np.testing.assert_allclose(gravity.force(0.0, np.zeros((6, 3))).sum(axis=0), [0, 0, weight], rtol=1e-15)


def test_kernels_of_one_factory_have_names_of_their_own():
    """Kernels that differ in what they capture: machine code is found on disk by what they capture."""
    forces = [elasticity.kernels(law, LINE, ((-1.0, 1.0),), (1.0,))[0] for law in (Smooth, TensionOnly, Linear)]
    assert len({(f.py_func.__module__, f.py_func.__qualname__) for f in forces}) == 3
