"""The force of contact on a body is what its contacts push and rub it with, and nothing else.

Truth comes from outside: a free body that nothing but contact acts on gains the momentum that contact gives it; a net
at rest on a body has its weight on that and on its supports; balls meet at a time of their own. Where nothing touches a
body the force is 0, to the last bit, whatever else acts on it.
"""

import numpy as np
import pytest
from nets import some

import refweb

METHODS = {
    "central-difference": {},
    "order 4": {"method": "explicit", "order": 4},
    "cvode": {"method": "cvode", "rtol": 1e-7},
    "ida": {"method": "ida", "rtol": 1e-7},
}
CABLE = {"law": "tension-only", "modulus": 1e7, "area": 1e-4, "density": 100.0, "prestrain": 0.01}
STRING = {"kind": "inline", "points": [[0, 0, 0], [1, 0, 0], [2, 0, 0]], "lines": [[0, 1], [1, 2]]}
MASS, SPEED = 0.4, 2.0


def scene(**tables):
    given = {"cable": CABLE, "contact": {"stiffness": 1e4}, "accuracy": {"error": "none"}}
    return refweb.Scene.from_dict(given | tables)


def ball(name="ball", **keys):
    return {"name": name, "radius": 0.1, "mass": MASS, "position": [0, 0, 0]} | keys


def observe(name, **keys):
    return {"name": name, "quantity": "reaction"} | keys


def event(name="touch", **keys):
    return {"name": name, "kind": "contact"} | keys


def dynamic(method, duration):
    return {"kind": "dynamic", "duration": duration, **METHODS[method]}


# What does not touch feels nothing

WINDOW = {"kind": "window", "mesh": "square", "rows": 2, "columns": 2, "side": 0.2}
ALONE = {
    "drag": {"drag": {"density": 1.2, "bodies": {"ball": {"coefficient": 0.5, "area": 7.85e-3}}}},
    "gravity": {"gravity": {"acceleration": [1.0, 2.0, -9.81]}},
    "frame": {"frame": {"angular_velocity": [0.0, 0.3, 1.0]}},
    "orbit": {"orbit": {"mean_motion": 0.5}},
}


FLYING = [(effect, method) for effect in ALONE for method in METHODS if method != "order 4" or effect == "gravity"]
"""Steps of high order take nothing that depends on velocity."""


@pytest.mark.ordinary("gravity-central-difference", "frame-*", "orbit-*", "drag-*")
@pytest.mark.parametrize("effect, method", FLYING)
def test_a_body_that_touches_nothing_feels_no_contact(effect, method):
    """A ball flies above a web; forces on it are 9.4 mN of drag, newtons of weight, and change their sign."""
    flying = ball(position=[0.1, 0.1, 1.0], velocity=[0.0, 1.0, -2.0])
    own = dict(web=WINDOW, body=[flying], event=[event(), event("at", body="ball", **{"with": "web"})])
    own |= dict(observe=[observe("F", body="ball", reduce="max")], solve=dynamic(method, 0.2))
    solution = refweb.run(scene(**own, output={"interval": 0.01}, **ALONE[effect]))
    state = solution.state
    assert np.abs(state.system.force(state.time, state.x, state.v)[state.system.net.bodies[0].row]).max() > 1e-3
    assert solution.results["F"].value == 0.0 and not solution.history["F"].any()
    assert not state.reaction[state.system.net.bodies[0].row].any()
    assert [one["time"] for one in solution.events] == [None, None]


PULL = 1e7 * 1e-4 * 0.01
"""Of a string that is strained by 1 % [N]."""


HOLDING = [(None, True), *((method, fixed) for method in METHODS for fixed in (True, False))]


@pytest.mark.parametrize("method, fixed", HOLDING)
def test_lines_that_a_body_holds_are_no_contact(method, fixed):
    """A string pulls on what holds its end with 10 N; that is the reaction of its node, there and at its support."""
    hub = {"name": "hub", "shape": "box", "size": [0.2, 0.2, 0.2], "position": [2.1, 0, 0]}
    hub |= {"fixed": True} if fixed else {"mass": 1e6}
    looked = [observe(name, body="hub", component=axis) for axis, name in enumerate("xyz")]
    looked += [observe("held", node=2, component=0), observe("end", node=0, component=0)]
    own = dict(web=STRING | {"supports": [0]}, body=[hub], attach=[{"body": "hub", "node": 2}], observe=looked)
    if method is None:
        solution = refweb.run(scene(**own, solve={"kind": "static"}))
    else:
        solution = refweb.run(scene(**own, solve=dynamic(method, 2e-3), event=[event()]))
        assert solution.events[0]["time"] is None
    found = {name: result.value for name, result in solution.results.items()}
    assert (found["x"], found["y"], found["z"]) == (0.0, 0.0, 0.0)
    np.testing.assert_allclose([found["held"], found["end"]], [PULL, -PULL], rtol=1e-6)


def test_a_threshold_on_a_body_that_holds_a_string_waits_for_a_touch():
    """A ball hits the string of a hub, which feels none of that: 12 N of contact on it never come."""
    hub = {"name": "hub", "shape": "box", "size": [0.2, 0.2, 0.2], "fixed": True, "position": [2.1, 0, 0]}
    thrown = ball(mass=1.0, position=[1.0, 0.0, -0.3], velocity=[0.0, 0.0, 2.0])
    own = dict(web=STRING | {"supports": [0]}, body=[hub, thrown], attach=[{"body": "hub", "node": 2}])
    own |= dict(observe=[observe("hub", body="hub", reduce="max"), observe("ball", body="ball", reduce="max")])
    events = [event(body="hub"), {"name": "pushed", "kind": "threshold", "observe": "hub", "value": 12.0}]
    solution = refweb.run(scene(**own, solve={"kind": "dynamic", "duration": 0.13}, event=events))
    assert [one["time"] for one in solution.events] == [None, None]
    assert solution.results["hub"].value == 0.0 and solution.results["ball"].value > 12.0


# What touches gains the momentum that contact gives


def gained(solution, name, body, duration):
    """(mean force of contact × time, change of momentum) of a body [N s]."""
    impulse = np.array([solution.results[f"{name} {axis}"].value for axis in "xyz"]) * duration
    net = solution.state.system.net
    return impulse, net.mass[body.row] * (solution.state.v[body.row] - body.velocity)


def means(name, duration):
    return [observe(f"{name} {axis}", body=name, component=axis, average=duration) for axis in "xyz"]


LAWS = {"linear": {}, "losses": {"friction": 0.3, "damping": 0.1}, "of Hertz": {"exponent": 1.5}}


GRAZED = [(law, method) for law in LAWS for method in METHODS if (law, method) != ("losses", "order 4")]


@pytest.mark.ordinary("linear-central-difference", "of Hertz-cvode")
@pytest.mark.parametrize("law, method", some(GRAZED, 3))
def test_impulse_of_contact_is_momentum(method, law):
    """A ball grazes a string: nothing else acts on it.

    The integral of a mean has an error of its own, of the steps.
    """
    thrown = ball(position=[0.9, 0.02, -0.11], velocity=[0.5, 0.3, SPEED])
    own = dict(web=STRING | {"supports": [0, 2]}, body=[thrown], contact={"stiffness": 1e4, **LAWS[law]})
    duration = 0.03
    solution = refweb.run(scene(**own, solve=dynamic(method, duration), observe=means("ball", duration)))
    (body,) = solution.state.system.net.bodies
    impulse, momentum = gained(solution, "ball", body, duration)
    assert np.linalg.norm(momentum) > 0.05 * MASS * SPEED
    np.testing.assert_allclose(impulse, momentum, rtol=0, atol=2e-3 * np.linalg.norm(momentum))


@pytest.mark.ordinary("central-difference")
@pytest.mark.parametrize("method", [name for name in METHODS if name != "order 4"])
def test_impulse_of_bodies_on_each_other_is_momentum(method):
    """Two balls of unlike mass meet beside a web, and rub: each gains what the other loses."""
    one = ball("one", mass=1.0)
    other = ball("other", mass=0.5, position=[0.15, 0.02, 0.15], velocity=[-1.0, 0.5, -1.0])
    own = dict(web=STRING | {"supports": [0, 2], "points": [[0, 5, 0], [1, 5, 0], [2, 5, 0]]}, body=[one, other])
    own |= dict(contact={"stiffness": 1e4, "between_bodies": True, "friction": 0.3, "damping": 0.05})
    duration = 0.05
    looked = means("one", duration) + means("other", duration)
    solution = refweb.run(scene(**own, solve=dynamic(method, duration), observe=looked))
    found = [gained(solution, body.name, body, duration) for body in solution.state.system.net.bodies]
    assert np.linalg.norm(found[0][1]) > 0.3
    for impulse, momentum in found:
        np.testing.assert_allclose(impulse, momentum, rtol=0, atol=2e-3 * np.linalg.norm(momentum))
    np.testing.assert_allclose(found[0][0], -found[1][0], rtol=1e-12)


@pytest.mark.parametrize("shape", [{"radius": 0.3}, {"shape": "box", "size": [0.4, 0.4, 0.4], "rounding": 0.02}])
def test_a_net_at_rest_on_a_body_has_its_weight_there_and_on_its_supports(shape):
    """In statics; the VTU's body has what the observable says."""
    web = {"kind": "window", "mesh": "square", "rows": 6, "columns": 6, "side": 0.1}
    rest = {"name": "rest", "fixed": True, "position": [0.02, 0.01, -0.2], **shape}
    own = dict(web=web, body=[rest], gravity={"acceleration": [0.3, -0.2, -9.81]}, solve={"kind": "static"})
    looked = [observe(f"{who} {axis}", component=axis, **{key: name}) for axis in "xyz"
              for who, key, name in (("rest", "body", "rest"), ("rim", "node", "rim"))]  # fmt: skip
    solution = refweb.run(scene(**own, observe=looked, cable=CABLE | {"prestrain": 0.0, "density": 1e4}))
    found = {who: np.array([solution.results[f"{who} {axis}"].value for axis in "xyz"]) for who in ("rest", "rim")}
    net = solution.state.system.net
    weight = net.mass[: net.nodes].sum() * np.array([0.3, -0.2, -9.81])
    assert found["rest"][2] < -0.05 * abs(weight[2])
    np.testing.assert_allclose(found["rim"] - found["rest"], -weight, rtol=0, atol=1e-7 * np.linalg.norm(weight))


@pytest.mark.parametrize("method", METHODS)
def test_where_a_body_is_touched_most(method):
    """At the line that it is thrown at, of ten in a row, of which few are near."""
    web = {"kind": "inline", "points": [[k, 0, 0] for k in range(11)], "lines": [[k, k + 1] for k in range(10)]}
    thrown = ball(position=[7.45, 0.0, -0.1001], velocity=[0.0, 0.0, 1.0])
    looked = [{"name": "deep", "quantity": "overlap", "reduce": "max"}]
    own = dict(web=web | {"supports": list(range(11))}, body=[thrown], observe=looked, solve=dynamic(method, 1e-3))
    solution = refweb.run(scene(**own))
    assert solution.bodies["ball"]["line"] == solution.results["deep"].where == 7


# Whom an event means


@pytest.mark.ordinary("central-difference", "order 4")
@pytest.mark.parametrize("method", METHODS)
def test_what_a_body_touches(method):
    """Two balls meet at (0.3 − 0.2)/2 s far from the web, and the third one falls on it at (0.15 − 0.1)/1 s."""
    balls = [ball("one"), ball("other", position=[0, 0, 0.3], velocity=[0, 0, -2.0])]
    balls.append(ball("third", position=[0.5, 5.0, 0.13], velocity=[0, 0, -1.0]))
    web = STRING | {"points": [[0, 5, 0], [1, 5, 0], [2, 5, 0]], "supports": [0, 2]}
    asked = [
        ("", ""), ("", "web"), ("one", ""), ("third", ""), ("third", "web"), ("", "one"), ("one", "other"),
        ("other", "one"), ("one", "third"),
    ]  # fmt: skip
    keys = [{key: name for key, name in zip(("body", "with"), pair, strict=True) if name} for pair in asked]
    events = [event("-".join(pair), **own) for pair, own in zip(asked, keys, strict=True)]
    own = dict(web=web, body=balls, contact={"stiffness": 1e4, "between_bodies": True}, event=events)
    solve = {"kind": "dynamic", "duration": 0.06, **METHODS[method]}
    solve |= {} if "rtol" in solve else {"step_size": 5e-5}
    solution = refweb.run(scene(**own, solve=solve))
    found = {one["name"]: one["time"] for one in solution.events}
    exact = dict.fromkeys(["-", "-web", "third-", "third-web"], 0.03)
    exact |= dict.fromkeys(["-one", "one-other", "other-one"], 0.05)
    assert found["one-"] is None and found["one-third"] is None
    assert all(abs(found[name] - time) <= 6e-5 for name, time in exact.items())


def test_a_contact_that_is_there_at_once_with_another_body():
    own = dict(web=STRING | {"supports": [0, 2], "points": [[0, 5, 0], [1, 5, 0], [2, 5, 0]]})
    own |= dict(body=[ball("one"), ball("other", position=[0, 0, 0.1999])])
    own |= dict(contact={"stiffness": 1e4, "between_bodies": True}, solve={"kind": "dynamic", "duration": 1e-3})
    solution = refweb.run(scene(**own, event=[event(body="one", **{"with": "other"}), event("web", body="one")]))
    assert [one["time"] for one in solution.events] == [0.0, None]


REFUSED = {
    "no body": ({"with": "othr"}, 'with = "othr" is not a body or the web, did you mean "other"'),
    "itself": ({"body": "one", "with": "one"}, 'with = "one" does not touch body "one": it takes two bodies'),
    "both fixed": ({"body": "wall", "with": "floor"}, 'with = "floor" does not touch body "wall"'),
    "of a line": ({"kind": "taut", "line": 0, "with": "web"}, 'with = "web" has no meaning for kind = "taut"'),
    "misspelt": ({"wiht": "web"}, 'wiht = "web": unknown key, did you mean "with"?'),
}


@pytest.mark.parametrize("name", REFUSED)
def test_wrong_others(name):
    keys, message = REFUSED[name]
    bodies = [ball("one"), ball("other", position=[0, 0, 1.0])]
    bodies += [
        {"name": name, "radius": 0.1, "fixed": True, "position": [k, 0, 2]} for k, name in enumerate(("wall", "floor"))
    ]
    own = dict(web=STRING | {"supports": [0, 2]}, body=bodies, contact={"stiffness": 1e4, "between_bodies": True})
    with pytest.raises(refweb.InputError) as caught:
        scene(**own, solve={"kind": "dynamic", "duration": 0.1}, event=[event() | keys]).build()
    assert message in str(caught.value) and "\n" not in str(caught.value)


def test_a_body_that_touches_no_bodies():
    own = dict(web=STRING | {"supports": [0, 2]}, body=[ball("one"), ball("other", position=[0, 0, 1.0])])
    given = scene(**own, solve={"kind": "dynamic", "duration": 0.1}, event=[event(**{"with": "other"})])
    with pytest.raises(refweb.InputError, match='with = "other" does not touch another body: .* between_bodies = true'):
        given.build()


def test_python_has_a_name_for_it():
    made = refweb.Event(name="touch", kind="contact", body="one", with_="other")
    assert made.to_dict() == {"name": "touch", "kind": "contact", "body": "one", "with": "other", "stop": False}
    assert made == refweb.Event(**made.to_dict())
