"""Assembly from parts: it needs no scene, and methods are what the tables say, also one that refweb does not ship."""

import sys
from types import ModuleType

import numpy as np
import pytest

import refweb
from refweb import memory
from refweb.build import build
from refweb.errors import InputError
from refweb.registry import INTEGRATORS, Method

WEB = refweb.Inline(points=[[0, 0, 0], [1, 0, 0], [2, 0, 0]], lines=[[0, 1], [1, 2]], supports=[0])
CABLE = refweb.Cable(law="linear", modulus=1e3, area=1e-2, density=2.0)
PARTS = {
    "web": WEB,
    "cable": CABLE,
    "effects": (refweb.Load(node=1, force=(0.0, 0.0, 1.0)),),
    "supports": None,
    "support": (),
    "solve": refweb.Static(),
    "output": refweb.Output(frames=1),
    "accuracy": refweb.Accuracy(),
    "observables": (),
    "events": (),
    "folder": None,
}


class Able:
    """Stands for an integrator that holds lengths exactly."""

    takes_links = True


@pytest.fixture
def method(monkeypatch):
    """Puts "able" into the table of methods, with some keys."""
    scratch = ModuleType("scratch_method")
    scratch.Able = Able
    monkeypatch.setitem(sys.modules, "scratch_method", scratch)
    return lambda *keys: monkeypatch.setitem(INTEGRATORS, "able", Method("scratch_method:Able", keys))


def test_parts_are_enough():
    system = build(**PARTS)
    assert len(system.net.web.lines) == 2 and np.flatnonzero(system.supported.all(axis=1)).tolist() == [0]
    force = system.force(1.0, np.zeros((3, 3)))  # load step 1
    np.testing.assert_array_equal(force, [[0, 0, 0], [0, 0, 1], [0, 0, 0]])


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"effects": (refweb.Load(node=3, force=(0, 0, 1)),)}, r"^\[\[load\]\] 1 node = 3 must be 0 … 2"),
        ({"support": (refweb.Supports(nodes=7),)}, r"^\[\[support\]\] 1 nodes = 7 must be 0 … 2"),
        ({"effects": (refweb.Gravity(acceleration=(0, 0, 1)),) * 2}, r"^\[gravity\] is listed 2 times"),
    ],
)
def test_refusals_begin_with_their_table(changes, message):
    with pytest.raises(InputError, match=message):
        build(**{**PARTS, **changes})


def test_links_by_whatever_takes_them(method):
    link = {"effects": (refweb.Link(nodes=(1, 2)),)}
    with pytest.raises(InputError, match='method = "ida", not kind = "static"'):
        build(**{**PARTS, **link})
    method("rtol")
    with pytest.raises(InputError, match='method = "ida" or "able", not kind = "static"'):
        build(**{**PARTS, **link})
    solve = refweb.Dynamic(method="able", duration=1.0)
    assert len(build(**{**PARTS, **link, "solve": solve}).constraints) == 1


def test_a_method_of_the_table_has_its_keys(method):
    method("rtol", "order")
    with pytest.raises(InputError, match='order = 4 has no meaning .*, only with "explicit" or "able"$'):
        refweb.Dynamic(method="cvode", duration=1.0, order=4)
    solve = refweb.Dynamic(method="able", duration=1.0, order=4)
    assert (solve.order, solve.rtol, solve.safety) == (4, 1e-6, None)
    with pytest.raises(InputError, match='did you mean "able"'):
        refweb.Dynamic(method="abel", duration=1.0)


@pytest.mark.parametrize("knob, explicit", [("safety", True), ("rtol", False)])
def test_memory_by_the_knob(method, monkeypatch, knob, explicit):
    """What trades step sizes for time makes no matrices."""
    method(knob)
    seen = []
    monkeypatch.setattr(memory, "needed", lambda lines, order, explicit, *rest: seen.append(explicit) or 0.0)
    build(**{**PARTS, "solve": refweb.Dynamic(method="able", duration=1.0)})
    assert seen == [explicit]


def test_a_history_that_does_not_fit_is_refused(monkeypatch):
    """Before anything is computed: nine million rows of 25 numbers are 1.8 GB, for the run and for its twin."""
    scene = refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0]),
        cable=refweb.Cable(law="tension-only", modulus=1e6, area=1e-4, density=1e3),
        solve=refweb.Dynamic(duration=9e3),
        output=refweb.Output(interval=1e-3),
    )
    monkeypatch.setattr(memory, "available", lambda: 2e9)
    with pytest.raises(InputError, match=r"interval = 0.001: 9e\+06 rows .* must be ≤ 2 GB"):
        scene.build()
    scene.replace(output=refweb.Output(interval=0.1)).build()
