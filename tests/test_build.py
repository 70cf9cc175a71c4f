"""Assembly from parts: it needs no scene, and methods are what the tables say, also one that refweb does not ship."""

import sys
from types import ModuleType

import numpy as np
import pytest

import refweb
from refweb import memory
from refweb.__main__ import main
from refweb.build import build
from refweb.errors import InputError
from refweb.registry import INTEGRATORS, Method
from refweb.results.files import as_toml

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


def test_names_are_unique(tmp_path, capsys):
    """Whatever columns a history has, no observable, event, body, group or node may have the name of one."""
    hub = refweb.Body(name="hub", radius=0.1, mass=1.0, position=(0.0, 0.0, -0.5))
    contact = refweb.Contact(stiffness=100.0, damping=0.1)
    effects = (
        hub,
        contact,
        refweb.Gravity(acceleration=(0, 0, -9.81)),
        refweb.Reel(lines=[0], factor=[(0, 1), (1, 1)]),
    )
    scene = refweb.Scene(web=WEB, cable=CABLE, effects=effects, solve=refweb.Dynamic(duration=2e-3))
    still = scene.replace(solve=refweb.Static(), output=refweb.Output(), effects=effects[2:3])
    observed = [o.name for o in scene.observables]
    own = [name for name in (*refweb.run(scene).history, *refweb.run(still).history) if name not in observed]
    assert {"time", "step", "work", "total_energy", "momentum_x", "outer_impulse_z"} <= set(own)
    for name in [*own, "all"]:
        grouped = {**WEB.to_dict(), "groups": {name: [0]}}
        wrong = [scene.replace(web=refweb.Inline(**grouped))]
        if name != "all":
            wrong += [
                scene.replace(web=refweb.Inline(**{**WEB.to_dict(), "names": {name: [1]}})),
                scene.replace(observe=[refweb.Observe(name=name, quantity="displacement")]),
                scene.replace(event=[refweb.Event(name=name, kind="contact")]),
                scene.replace(effects=(refweb.Body(**{**hub.to_dict(), "name": name}), *effects[1:])),
            ]
        for one in wrong:
            with pytest.raises(InputError, match=f'"{name}" is .*: names are unique'):
                one.build()
    file = tmp_path / "named.toml"
    wrong = scene.replace(observe=[refweb.Observe(name="momentum_x", quantity="displacement")])
    file.write_text(as_toml(wrong.to_dict()))
    assert main(["run", str(file), "--out", str(tmp_path / "out")]) == 2
    assert '"momentum_x" is a column of its own of history.csv' in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
