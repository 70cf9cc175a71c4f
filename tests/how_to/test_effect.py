"""The page "How to write an effect", followed word by word in a package that is installed for it."""

import importlib
import tomllib

import nets
import numpy as np
import packages
import pytest
from scipy.optimize import brentq
from test_contract import agrees, check_term, state

import refweb
import refweb.effects
from refweb.net import discretisation
from refweb.system.system import System

AXIAL, DENSITY = 7e3, 200.0
CABLE = {"law": "tension-only", "modulus": AXIAL / 1e-4, "area": 1e-4, "density": DENSITY}
COUNT = 16
"""Elements of a cable."""


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """The tables of a scene that the page ends with, when all it says before has been done."""
    source, entry, scene = packages.blocks(refweb.effects.__doc__)
    with packages.of_page(tmp_path_factory.mktemp("page"), source, entry):
        yield tomllib.loads(scene)


@pytest.fixture(scope="module")
def current(page):
    """The class of the page."""
    return importlib.import_module("my_webs.current").Current


def scene(page, **changes):
    """A straight cable of 1 m along x, between two supports, with what the page asks for."""
    x = np.linspace(0.0, 1.0, COUNT + 1)
    web = {"kind": "inline", "points": [[place, 0.0, 0.0] for place in x], "supports": [0, COUNT]}
    web["lines"] = [[i, i + 1] for i in range(COUNT)]
    return refweb.Scene.from_dict({"web": web, "cable": CABLE, **page, **changes})


def arc(push):
    """Tension of a cable of equal elements on an arc, pushed by so much per length [N/m], and its sag [m].

    A corner that turns by φ has 2 T sin φ/2 = p l cos φ/2; elements are l = sin(φ/2)/sin(nφ/2), T = EA (l/L − 1).
    """

    def tension(half):
        return push * np.sin(half) / np.sin(COUNT * half) / (2.0 * np.tan(half))

    def apart(half):
        return tension(half) - AXIAL * (COUNT * np.sin(half) / np.sin(COUNT * half) - 1.0)

    half = brentq(apart, 1e-9, 0.4 * np.pi / COUNT, xtol=1e-18, rtol=1e-15)
    return tension(half), 0.5 * np.tan(0.5 * COUNT * half)


def test_in_statics(page):
    """An arc, to the side of its direction that I dl × B says, whatever the field along the cable."""
    solution = refweb.run(scene(page, solve={"kind": "static", "load_steps": [1.0]}))
    tension, sag = arc(20.0 * 0.5)
    np.testing.assert_allclose(solution.tension, tension, rtol=1e-9)
    assert solution.positions[COUNT // 2] == pytest.approx([0.5, -sag, 0.0], abs=1e-9 * sag)
    twice = [{**page["current"][0], "current": 8.0}, {**page["current"][0], "current": 12.0}]
    other = refweb.run(scene({"current": twice}, solve={"kind": "static", "load_steps": [1.0]}))
    np.testing.assert_allclose(other.tension, tension, rtol=1e-9)


@pytest.mark.parametrize("method", ["central-difference", "cvode"])
def test_in_dynamics(page, method):
    """The cable is thrown out of its rest; what it has of energy is the work of the field."""
    keys = {"safety": 0.25} if method == "central-difference" else {"rtol": 1e-6}
    solve = {"kind": "dynamic", "method": method, "duration": 0.05, **keys}
    observe = [{"name": "work", "quantity": "work"}, {"name": "sag", "quantity": "displacement", "reduce": "max"}]
    given = dict(solve=solve, output={"interval": 0.005}, accuracy={"error": "none"})
    history = refweb.run(scene(page, observe=[{**observe[0], "name": "gained"}, observe[1]], **given)).history
    assert history["gained"][-1] > 0.0 and history["sag"][-1] > 1e-3
    np.testing.assert_allclose(history["total_energy"], history["gained"], atol=1e-3 * history["gained"].max())


@pytest.mark.parametrize("seed", range(3))
def test_it_keeps_what_every_effect_keeps(current, seed):
    """As `tests/test_contract.py` asks of those that refweb ships; its bound is above the row sums of its stiffness."""
    net, free = nets.skew_net("linear"), np.zeros((6, 3), dtype=bool)
    system = System(net, [current(lines=[0, "tie"], current=3.0, field=(1.0, -2.0, 0.5))], free)
    (term,) = system.terms
    check_term(net, system, term, seed)
    (x, v), d = state(net, seed), state(net, seed + 100)[0]
    product = system.pattern.matrix(system.stiffness(0.0, x, v)) @ d.ravel()
    assert np.abs(product).max() > 0.1
    assert agrees(lambda h: (system.force(0.0, x + h * d) - system.force(0.0, x - h * d)).ravel(), -2.0 * product)
    rates = np.zeros(len(net.points))
    term.tangent.bound(np.inf, 0.0, x, net.mass, rates, term.cells, term.data)
    sums = np.abs(system.pattern.matrix(system.stiffness(0.0, x, v)).toarray()).sum(axis=1).reshape(-1, 3).max(axis=1)
    assert (sums <= rates * (1.0 + 1e-15)).all()


def test_a_closed_loop_feels_no_force(current):
    """∮ dl × B = 0, of any loop in a uniform field."""
    net = nets.skew_net("linear")
    system = System(
        net, [current(lines=[0, 1, 2, 3], current=3.0, field=(1.0, -2.0, 0.5))], np.zeros((6, 3), dtype=bool)
    )
    force = system.force(0.0, state(net, 1)[0])
    assert np.abs(force.sum(axis=0)).max() <= 1e-14 * np.abs(force).sum()


def test_messages_know_it(page, current):
    static = {"kind": "static"}
    with pytest.raises(refweb.InputError, match=r'did you mean "current"'):
        scene({"curent": page["current"]}, solve=static)
    with pytest.raises(refweb.InputError, match=r"\[\[current\]\] 1 lines = 99 must be 0 … 15"):
        scene({"current": [{**page["current"][0], "lines": 99}]}, solve=static).build()
    with pytest.raises(refweb.InputError, match=r"\[\[current\]\] 1 \[cable\] order = 2 must be 1"):
        scene(page, cable={**CABLE, "order": 2}, solve=static).build()
    assert scene(page, solve=static).to_dict()["current"][0]["field"] == [0.0, 0.0, 0.5]
    web = discretisation.build(nets.skew_web(), nets.skew_cable("linear"))
    assert len(current(lines="all", current=1.0, field=(0.0, 0.0, 1.0)).on(web).cells) == len(web.cells)
