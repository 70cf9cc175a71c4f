"""What every effect keeps: forces from energies, tangents from forces, invariance of what is internal, a bound that bounds.

Every class in `refweb.effects` that has ``on``, ``extend`` or ``start`` is found by itself; one without an example here
fails.
"""

import importlib
import inspect
import pkgutil

import numpy as np
import pytest
import scipy.linalg
from nets import LAWS, skew_net

import refweb.effects
from refweb.central_difference import CentralDifference
from refweb.effects import Drive
from refweb.inputs import InputError
from refweb.system import System

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
    ],
    "Contact": [dict(stiffness=1e3), dict(stiffness=1e2, bodies=dict(wall=dict(stiffness=1e4)))],
}
ROLES = ("on", "extend", "start")


def effect_classes():
    found = {}
    for module in pkgutil.iter_modules(refweb.effects.__path__):
        content = importlib.import_module(f"refweb.effects.{module.name}")
        for name, value in inspect.getmembers(content, inspect.isclass):
            if value.__module__ == content.__name__ and any(hasattr(value, role) for role in ROLES):
                found[name] = value
    return found


CLASSES = effect_classes()


def cases(role):
    """(name, number) of each example of the classes that have a role."""
    return [(name, i) for name, c in CLASSES.items() if hasattr(c, role) for i in range(len(EXAMPLES.get(name, [0])))]


CASES = [(*case, law) for case in cases("on") for law in LAWS]


def example(name, i):
    return CLASSES[name](**EXAMPLES[name][i])


def make(name, i, law):
    """(rows' net, system of one effect); a contact has both bodies to touch, which reach 2 and 5 of the lines."""
    net = skew_net(law)
    bodies = [example("Body", 0), example("Body", 1)] if name == "Contact" else []
    system = System(net, [*bodies, example(name, i)], np.zeros((len(net.points), 3), dtype=bool))
    return system.net, system


@pytest.mark.parametrize("name", CLASSES)
def test_every_effect_has_an_example(name):
    assert EXAMPLES.get(name), f"effect {name} has no example in the contract test"


def state(net, seed):
    rng = np.random.default_rng(seed)
    return 0.05 * rng.standard_normal(net.points.shape), rng.standard_normal(net.points.shape)


def slope(errors, steps):
    return np.polyfit(np.log(steps), np.log(errors), 1)[0]


@pytest.mark.parametrize("name, i, law", CASES)
@pytest.mark.parametrize("seed", range(3))
def test_effect(name, i, law, seed):
    net, system = make(name, i, law)
    if system.drives:
        return drive(net, system)
    (family,) = system.families
    assert family.cells.dtype == np.int32 and len(family.cells) == len(family.data)
    x, v = state(net, seed)
    d = np.where(system.supported, 0.0, state(net, seed + 100)[0])
    # Steps that cross no kink: the lines of this net are at least 1e-3 of strain from it at these states.
    steps = np.array([2e-3, 1e-3, 5e-4, 2.5e-4])
    t = 0.7

    if family.energy is not None:
        exact = -np.sum(system.force(t, x, v) * d)
        remainder = [abs(system.energy(t, x + h * d) - system.energy(t, x) - h * exact) for h in steps]
        scale = 1e-13 * abs(system.energy_of(family, t, x)).sum()
        assert max(remainder) <= 10 * scale or abs(slope(remainder, steps) - 2) < 0.1

    force = system.force(t, x, v)
    if family.stiffness is None:
        np.testing.assert_array_equal(system.force(t, x + d, v), force)
    else:
        K = system.pattern.matrix(system.stiffness(t, x, v))
        forces = [system.force(t, x + h * d, v).ravel()[system.free] - force.ravel()[system.free] for h in steps]
        product = K @ d.ravel()[system.free]
        remainder = [np.linalg.norm(f + h * product) for h, f in zip(steps, forces, strict=True)]
        assert abs(slope(remainder, steps) - 2) < 0.1
        if family.energy is not None:
            assert abs(K - K.T).max() <= 1e-13 * abs(K).max()
        values = np.linalg.eigvalsh(system.pattern.matrix(system.stiffness(t, x, v, definite=True)).toarray())
        assert values[0] >= -1e-12 * values[-1]

    if family.internal:
        position = net.points + x
        size = np.abs(force).sum()
        assert np.abs(force.sum(axis=0)).max() <= 1e-14 * size
        assert np.abs(np.cross(position, force).sum(axis=0)).max() <= 1e-14 * size
        turn = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))[0]
        turn *= np.linalg.det(turn)
        moved = position @ turn.T + [3.0, -2.0, 1.0] - net.points
        np.testing.assert_allclose(system.force(t, moved, v @ turn.T), force @ turn.T, atol=1e-12 * size)


def drive(net, system):
    (driven,) = system.drives
    assert isinstance(driven, Drive) and system.supported[driven.cells[:, 0]].all()
    times, steps = (0.3, 1.7), np.array([1e-2, 5e-3])
    for t in times:
        here, there, v = (np.zeros_like(net.points) for _ in range(3))
        system.drive(t, here, v)
        for h in steps:
            system.drive(t + h, there)
            np.testing.assert_allclose(there, here + h * v, atol=1e-15)
        assert not np.delete(here, driven.cells[:, 0], axis=0).any()


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
