"""Small nets that several tests use."""

from dataclasses import replace

import numpy as np
import pytest

import refweb
from refweb.dynamics.integrators.central_difference import CentralDifference
from refweb.effects.elasticity import Elasticity
from refweb.net import discretisation
from refweb.net.cable import Cable
from refweb.net.web import Web
from refweb.system.system import System

LAWS = {
    "smooth": dict(law="smooth", slackness=2e-3, smoothing=1e-2),
    "tension-only": dict(law="tension-only"),
    "linear": dict(law="linear"),
}

METHODS = {
    "central-difference": {},
    "order 4": dict(method="explicit", order=4),
    "order 6": dict(method="explicit", order=6),
    "bdf": dict(method="cvode"),
    "adams": dict(method="cvode", family="adams"),
    "ida": dict(method="ida"),
}
"""Every kind of steps, as keys of ``[solve]``."""


SLACK_LINE = {
    "web": {
        "kind": "inline",
        "points": [[0, 0, 0], [0.5, 0, 0]],
        "lines": [[0, 1]],
        "natural_length": [50.0],
        "supports": [0],
    },
    "cable": {"law": "tension-only", "modulus": 1e6, "area": 1e-4, "density": 100.0},
}
"""Web and cable of one line that stays slack: its node and all bodies move as if it were not there."""

SMALL = """
title = "Small web"

[web]
kind = "window"
mesh = "square"
rows = 3
columns = 3
side = 0.5

[cable]
law = "tension-only"
modulus = 1e5
area = 1e-4
density = 100.0
strength = 1e6

[[load]]
node = "centre"
force = [0.0, 0.0, 1.0]

[solve]
kind = "static"
load_steps = [1, 2, 3]
"""
"""A scene file."""


def some(cases, every):
    """Cases of a parametrized test, of which the ordinary run takes one of ``every``, and the slow one the others."""
    slow = pytest.mark.slow
    apart = [case if isinstance(case, tuple) else (case,) for case in cases]
    return [pytest.param(*case, marks=slow if number % every else ()) for number, case in enumerate(apart)]


def interrupt(scene, folder):
    """Run a scene into a folder, and interrupt it when half of it is done."""

    def stop(text, share):
        if share > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        refweb.run(scene, out=folder, progress=stop)


def whole_and_resumed(scene, folder):
    """Solutions of a scene without a stop, and of one that is interrupted and resumed; in folders of a folder."""
    whole = refweb.run(scene, folder / "whole")
    interrupt(scene, folder / "part")
    return whole, refweb.resume(folder / "part")


def hit_web(title):
    """A small web that a ball hits: eleven frames, some lines slack."""
    return refweb.Scene(
        title=title,
        web=refweb.Window(mesh="square", rows=6, columns=6, side=0.2),
        cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-4, density=200.0),
        effects=[
            refweb.Body(name="ball", radius=0.1, mass=0.2, position=(0, 0, -0.11), velocity=(0, 0, 2.0)),
            refweb.Contact(stiffness=1e5),
        ],
        solve=refweb.Dynamic(duration=0.05),
        output=refweb.Output(interval=1e-3, frames=5),
        accuracy=refweb.Accuracy(error="none"),
    )


def skew_web():
    """A branching, closed net in space with a group, a stub and prestressed and slack lines."""
    points = [[0, 0, 0], [1, 0.1, 0], [1.1, 1, 0.2], [-0.1, 0.9, 0], [0.5, 0.5, 0.3], [0.6, 0.4, -0.5]]
    pairs = [[0, 1], [1, 2], [2, 3], [3, 0], [0, 4], [1, 4], [2, 4], [3, 4], [5, 4]]
    points, pairs = np.array(points, dtype=float), np.array(pairs)
    distance = np.linalg.norm(points[pairs[:, 1]] - points[pairs[:, 0]], axis=1)
    factor = np.array([0.99, 1.05, 1.0, 0.9, 0.97, 0.95, 1.2, 0.98, 0.96])
    groups = ("", "edge", "", "edge", "", "", "tie", "tie", "")
    return Web(points=points, lines=pairs, natural_length=factor * distance, rim=np.array([0, 2]), groups=groups)


def crossed_web():
    """Four lines of two chains and two alone that cross, lie along each other and end at each other, 0.21 m apart."""
    points = [[0, 0, 0], [0.6, 0, 0], [1.2, 0.1, 0], [0.5, -0.6, 0.21], [0.5, 0.5, 0.22], [0.1, 0.3, 0.43]]
    points += [[0.7, 0, -0.21], [1.3, 0.12, -0.22], [0.2, 0.95, 0.2], [0.52, 0.76, 0.2]]
    pairs = np.array([[0, 1], [1, 2], [3, 4], [4, 5], [6, 7], [8, 9]])
    points = np.array(points, dtype=float)
    distance = np.linalg.norm(points[pairs[:, 1]] - points[pairs[:, 0]], axis=1)
    factor, groups = np.array([0.99, 1.05, 1.0, 0.9, 1.02, 0.97]), ("edge", "", "tie", "", "", "tie")
    return Web(points=points, lines=pairs, natural_length=factor * distance, rim=np.array([0, 2]), groups=groups)


def skew_cable(law="smooth"):
    """A cable whose groups differ in everything."""
    groups = {"edge": dict(modulus=2e5, area=3e-4, density=900.0), "tie": dict(area=2e-4)}
    return Cable(modulus=1e5, area=1e-4, density=300.0, groups=groups, **LAWS[law])


def skew_net(law="smooth", pieces=1, **options):
    return discretisation.build(skew_web(), replace(skew_cable(law), subdivide=pieces), **options)


def system(web, cable, effects=(), quasi_static=True, supported=None):
    """The system of a web with its rim supported."""
    net = discretisation.build(web, cable, quasi_static=quasi_static)
    if supported is None:
        supported = np.zeros((len(net.points), 3), dtype=bool)
        supported[web.rim] = True
    return System(net, [Elasticity(), *effects], supported)


def thrown(body, count, stiffness, duration=0.05):
    """A net that falls on a fixed body, in some equal steps: (displacement, drift of energy, depth)."""
    web = refweb.Window(mesh="square", rows=3, columns=3, side=0.15).web()
    cable = refweb.Cable(law="linear", modulus=1e6, area=1e-5, density=1000.0)
    body = refweb.Body(**{"name": "it", "fixed": True, **body})
    falling = system(web, cable, [body, refweb.Contact(stiffness=stiffness)], False)
    v = np.zeros((falling.rows, 3))
    v[: len(web.points)] = (0.0, 0.0, -4.0)
    v[falling.supported] = 0.0
    method = CentralDifference(falling, step_size=duration / count * (1.0 + 1e-12))
    run, stored = method.start(None, v), []
    term = next(term for term in falling.terms if term.contact.with_lines)
    for row in np.linspace(0.0, duration, 11)[1:]:
        method.advance(run, np.array([row]))
        stored.append(falling.energy_of(term, row, run.x).max())
    assert run.nsteps == count
    return run.x.copy(), run.drift, np.sqrt(2.0 * max(stored) / stiffness)
