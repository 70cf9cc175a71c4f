"""An observable has two faces, and they are of one thing: its value in a state, and what its probe finds there.

Every entry of the table is found by itself, and looked at in random states of nets with bodies, supports, a frame that
turns, and several elements a line.
"""

import itertools
import re

import numpy as np
import pytest
from nets import LAWS, skew_net

import refweb
from refweb.effects.base import CONTACT, STRAIN
from refweb.effects.elasticity import Elasticity
from refweb.errors import InputError
from refweb.registry import OBSERVABLES
from refweb.results.probes import PLACE
from refweb.results.state import State
from refweb.statics.equilibrium import Equilibrium
from refweb.system.system import System

BODIES = (
    refweb.Body(name="ball", radius=0.3, mass=0.5, position=(0.6, 0.3, 0.2)),
    refweb.Body(name="wall", radius=0.4, position=(0.2, 0.9, -0.1), fixed=True),
)
EFFECTS = (
    refweb.Gravity(acceleration=(1.0, -2.0, 3.0)),
    refweb.Load(node=[1, 4], force=(1.0, 2.0, -3.0)),
    refweb.PointMass(node=[1, 4], mass=0.7),
    refweb.Contact(stiffness=1e3, damping=0.2),
    refweb.Bending(stiffness=0.02),
    refweb.Damping(time=1e-3, rate=0.5),
    refweb.Thread(name="rope", nodes=[0, 4, 2, 3], modulus=1e5, area=2e-4, density=10.0, prestrain=0.02),
)
FRAME = refweb.Frame(angular_velocity=(0.3, -0.5, 0.7))
WHERE = {
    "node": [{}, {"node": 3}, {"node": [1, 2, 4]}, {"node": [5, 0, 3]}],
    "body": [{"body": "ball"}, {"body": "wall"}, {"body": ["wall", "ball"]}],
    "line": [{}, {"line": 0}, {"line": 7}],
    "thread": [{"thread": "rope"}],
    "ring": [{"ring": 4}],
    "control": [{"control": "hold"}],
    "component": [{}, *({"component": axis} for axis in "xyz")],
    "to": [{"to": "ball"}],
    "select": [{}, *({"select": choice} for choice in ("max", "min", "abs"))],
    "part": [{}, *({"part": part} for part in ("start", "middle", "end"))],
}
"""What each key of ``[[observe]]`` is given as; a quantity is looked at for every mixture of those it takes."""
OWN = {
    "distance": [{"node": [5, 0]}, {"node": 3, "to": "ball"}, {"body": "ball", "to": "wall"}],
    "length": WHERE["thread"],
    **dict.fromkeys(("mouth_area", "mouth_perimeter"), WHERE["node"][2:]),
}
"""Places of quantities that are of a few of them together."""
ONE_BODY = ("orientation", "angular_velocity", "angular_momentum")


def tables(name):
    """All that may ask for a quantity."""
    keys = refweb.Observe(name="_", quantity=name).observable.keys
    places = [place for key in ("node", "body", "line") if key in keys for place in WHERE[key]] or [{}]
    places = OWN.get(name, places)
    if name in ONE_BODY:
        places = [place for place in places if not isinstance(place.get("body"), list)]
    mixed = [places, *(WHERE[key] for key in ("component", "select", "part") if key in keys)]
    mixed = [{key: value for given in parts for key, value in given.items()} for parts in itertools.product(*mixed)]
    mixed += WHERE["thread"] if "thread" in keys and name not in OWN else []  # in place of lines
    return [refweb.Observe(name="_", quantity=name, **given) for given in mixed]


def random_state(law, seed, pieces=2, turning=False):
    """A net of lines taut and slack, in which a ball touches, half of its nodes' components supported."""
    rng = np.random.default_rng(seed)
    net = skew_net(law, pieces)
    supported = rng.random(net.points.shape) < 0.5
    system = System(net, [Elasticity(), *BODIES, *EFFECTS, *([FRAME] if turning else [])], supported)
    x, v = 0.1 * rng.standard_normal((2, system.rows, 3))
    return State(system, 0.0, x, v)


STATES = [random_state(law, seed) for law in LAWS for seed in range(3)]
STATES += [random_state("smooth", 3, pieces=3), random_state("tension-only", 4, turning=True)]
BY_PROBE = ("support_force", "support_moment", "axle_angle", "slip")
"""Quantities whose value in a state is that of their probe, of bodies and rings that these scenes do not have."""
BOOKED = [name for name in OBSERVABLES if refweb.Observe(name="_", quantity=name).observable.booked]
BY_CONTROL = ("fuel", "delta_v")
"""Quantities of a control, which no state has and whose probe a control writes; see ``dynamics/test_control.py``."""
PROBED = [name for name in OBSERVABLES if name not in (*BOOKED, *BY_PROBE, *BY_CONTROL)]


def probed(observe, state):
    """(value, place) that the probe of an observable finds in a state."""
    system, found = state.system, observe.probe(state.system)
    force, shown = system.forces(0.0, state.x, state.v)
    strained = np.zeros((len(system.net.cells), 4))
    strained[:, system.tension_column], strained[:, STRAIN] = state.element_tension, state.element_strain
    shared = {CONTACT: system.contact_forces.of(shown), **dict(enumerate(shown))}
    rows, data = np.array(found.rows, dtype=np.int64), shared.get(found.term, found.data)
    where = np.array([-1, PLACE])
    data = np.ascontiguousarray(data, dtype=float)
    value = found.kernel(0.0, state.x, state.v, force, strained, rows, data, where)
    return value, observe.observable.position(system, int(where[0]))


@pytest.mark.parametrize("name", PROBED)
def test_both_faces_agree(name):
    """The value in a state and that of the probe, of every quantity in every state."""
    for state in STATES:
        for observe in tables(name):
            observe.on(state.system)
            value, (expected, where) = probed(observe, state), observe.value(state)
            scale = np.abs(state.reaction).sum() if name == "reaction" else abs(expected)
            np.testing.assert_allclose(value[0], expected, rtol=0, atol=1e-13 * scale, err_msg=str(observe))
            assert value[1] == where, observe


def test_angular_momentum_of_a_body_in_a_state():
    """I ω about each principal axis, by the sum over rows and by the kernel."""
    box = refweb.Body(
        name="box", shape="box", size=(0.2, 0.3, 0.4), mass=3.0, position=(2.0, 0.0, 1.0), inertia=(0.11, 0.13, 0.17),
        angular_velocity=(5.0, -7.0, 11.0),
    )  # fmt: skip
    system = System(skew_net("linear"), [Elasticity(), box], np.zeros((6, 3), dtype=bool))
    (body,), (x, v) = system.net.bodies, np.zeros((2, system.rows, 3))
    v[body.spin] = body.start_spin
    state = State(system, 0.0, x, v)
    for axis, expected in zip("xyz", (0.11 * 5.0, -0.13 * 7.0, 0.17 * 11.0), strict=True):
        observe = refweb.Observe(name="_", quantity="total_angular_momentum", body="box", component=axis)
        observe.on(system)
        assert observe.value(state)[0] == pytest.approx(expected, rel=1e-14)
        assert probed(observe, state)[0] == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_angular_momentum_of_consistent_mass(order):
    """A bar of 2 m and 0.6 kg that turns about its middle has m l²/12 ω; parts of it agree in both faces."""
    scene = refweb.Scene(
        web=refweb.Inline(points=[[-1, 0, 0], [0, 0, 0], [1, 0, 0]], lines=[[0, 1], [1, 2]]),
        cable=refweb.Cable(law="linear", modulus=1e6, area=3e-4, density=1e3, order=order),
        solve=refweb.Dynamic(duration=1.0, method="cvode", mass="consistent"),
    )
    system, omega = scene.build(), 5.0
    v = np.zeros((system.rows, 3))
    v[:, 1] = omega * system.net.points[:, 0]
    state, whole = State(system, 0.0, np.zeros_like(v), v), 0.6 * 2.0**2 / 12.0 * omega
    for nodes in (None, 2, [0, 1]):
        observe = refweb.Observe(name="_", quantity="total_angular_momentum", node=nodes, component="z")
        value = observe.value(state)[0]
        assert probed(observe, state)[0] == pytest.approx(value, rel=1e-12)
        assert nodes is not None or value == pytest.approx(whole, rel=1e-12)


UNKNOWN = (
    "kinetic_energy",
    "dissipated_energy",
    "frame_energy",
    "orbit_energy",
    "rupture_energy",
    "body_contact_energy",
    "self_contact_energy",
    "plastic_energy",
    "winch_energy",
)
"""Energies that a state of these scenes does not know."""


@pytest.mark.parametrize("name", [name for name in BOOKED if name.endswith("_energy")])
def test_weights_make_the_energy_of_a_state_at_rest(name):
    for state in STATES[:-1]:
        system = state.system
        energies = [0.0 if f.energy is None else system.energy_of(f, 0.0, state.x).sum() for f in system.terms]
        (observe,) = tables(name)
        unknown = name in UNKNOWN
        expected = 0.0 if unknown else observe.value(state).value
        found = observe.observable.weights(system) @ [*energies, 0.0, 5.0, 7.0]
        np.testing.assert_allclose(found, expected, rtol=1e-14)


def test_weights_pick_columns():
    system = STATES[0].system
    for name, place in {"kinetic_energy": -3, "work": -2, "step_size": -1}.items():
        (observe,) = tables(name)
        weights = observe.observable.weights(system)
        assert weights[place] == weights.sum() == 1.0


@pytest.mark.parametrize("name", OBSERVABLES)
def test_what_an_entry_says(name):
    """A unit, keys that `Observe` has, one of a probe and weights; what it does not take is refused."""
    entry = refweb.Observe(name="_", quantity=name).observable
    assert re.fullmatch(r"1|(m|s|kg|N|Pa|J|W|Hz|K|rad)[²³]?([ /](m|s|kg|rad)[²³]?)*", entry.unit)
    assert set(entry.keys) <= WHERE.keys() and hasattr(entry, "weights") == entry.booked
    for key in WHERE.keys() - set(entry.keys):
        given = WHERE[key][-1]
        with pytest.raises(InputError, match=f'{key} = .* has no meaning for quantity = "{name}"'):
            refweb.Observe(name="_", quantity=name, **given)


@pytest.mark.parametrize("sizes, expected", [((2.0, 0.0, 0.0), 2.0), ((0.0, 3.0, 1.0), 9.0), ((2.0, 1.0, 3.0), 11.0)])
def test_error_adds_what_the_residual_and_rounding_may_change(sizes, expected):
    """Deviations of a displacement: that by the residual once, the largest by rounding of forces three times."""
    system = System(skew_net("linear"), [Elasticity()], np.zeros((6, 3), dtype=bool))
    observe, unit = refweb.Observe(name="_", quantity="displacement", node=2, component="x"), np.zeros((6, 3))
    unit[2, 0] = 1e-6
    deviations = np.array([size * unit for size in sizes])
    rest = Equilibrium(1.0, np.zeros((6, 3)), np.zeros(9), np.zeros((6, 3)), deviations=deviations)
    error = observe.observable.error(State(system, 0.0, rest.x, rest.x), rest)
    assert error == pytest.approx(expected * 1e-6, rel=1e-9)
