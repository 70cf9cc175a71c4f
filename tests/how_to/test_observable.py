"""The page "How to write an observable", followed word by word in a package that is installed for it."""

import tomllib

import numpy as np
import packages
import pytest

import refweb
import refweb.results.observables

STIFFNESS, LENGTH, DENSITY, SPEED = 1e4, 0.5, 100.0, 0.8
AREA = 1e-4
MASS = DENSITY * AREA * LENGTH / 2.0
"""Of the node that a line of that length ends at [kg]."""


@pytest.fixture
def page(tmp_path):
    """The tables of a scene that the page ends with, when all it says before has been done."""
    source, entry, scene = packages.blocks(refweb.results.observables.__doc__)
    with packages.of_page(tmp_path, source, entry):
        yield tomllib.loads(scene)


def scene(page, **changes):
    """A line along y from a support at the origin, seen by what the page asks for."""
    given = {
        "web": {"kind": "inline", "points": [[0, 0, 0], [0, LENGTH, 0]], "lines": [[0, 1]]},
        "cable": {"law": "linear", "modulus": STIFFNESS * LENGTH / AREA, "area": AREA, "density": DENSITY},
        "supports": {"nodes": [0]},
        **page,
    }
    return refweb.Scene.from_dict({**given, **changes})


def test_in_statics(page):
    """A line drawn along its axis, and the sum m r² of where it ends; the residual's error is known without asking."""
    load = {"node": 1, "force": [0.0, 30.0, 0.0]}
    axis = {"name": "along it", "quantity": "moment_of_inertia", "component": "y"}
    origin = {"name": "polar", "quantity": "moment_of_inertia"}
    page["observe"] += [axis, origin]
    solution = refweb.run(scene(page, load=[load], solve={"kind": "static", "load_steps": [0.5, 1.0]}))
    for step in solution.steps:
        found, length = step["results"]["inertia"], LENGTH + step["step"] * 30.0 / STIFFNESS
        assert found.unit == "kg m²" and found.where is None
        assert found.value == pytest.approx(MASS * length**2, rel=1e-12) and found.error < 1e-9 * found.value
        assert step["results"]["along it"].value == 0.0 and step["results"]["polar"].value == found.value
    assert solution.columns[1] == "inertia [kg m²]"


def test_in_dynamics(page):
    """A mass on a spring swings along y: the largest moment of inertia is where it turns, between two rows."""
    swing = {"solve": {"kind": "dynamic", "duration": 0.015, "safety": 0.02}, "output": {"interval": 0.004}}
    throw = [{"node": 1, "value": [0.0, SPEED, 0.0]}]
    masses = [{"node": 1, "mass": 0.1}]
    solution = refweb.run(scene(page, velocity=throw, point_mass=masses, **swing))
    mass, found = MASS + 0.1, solution.results["inertia"]
    rate = np.sqrt(STIFFNESS / mass)
    reach = LENGTH + SPEED / rate
    quarter = 0.5 * np.pi / rate
    assert found.value == pytest.approx(mass * reach**2, abs=found.error) and found.error < 1e-3 * found.value
    assert found.time == pytest.approx(quarter, rel=1e-2) and found.where is None
    ahead = LENGTH + SPEED / rate * np.sin(rate * solution.history["time"])
    np.testing.assert_allclose(solution.history["inertia"], mass * ahead**2, rtol=1e-3)
    last = mass * (solution.positions[1, 0] ** 2 + solution.positions[1, 1] ** 2)
    assert solution.history["inertia"][-1] == pytest.approx(last, rel=1e-14)
    assert solution.history["inertia"].max() < found.value


def test_messages_know_it(page):
    with pytest.raises(refweb.InputError, match='did you mean "moment_of_inertia"'):
        refweb.Observe(name="i", quantity="moment_of_inerta")
    with pytest.raises(refweb.InputError, match='node = 1 has no meaning for quantity = "moment_of_inertia"'):
        refweb.Observe(name="i", quantity="moment_of_inertia", node=1)
