"""Lines that touch lines, and bodies that touch bodies: slow and fast, crossed and along each other, on edges.

Lines that are thrown at each other have the stiffness that refweb chooses. What bodies do is seen beside a web far away
that hangs at rest, for a scene has one.
"""

import numpy as np

import refweb

RADIUS = 5e-3


def of_lines(points, lines, thrown, velocity, duration, **contact):
    """Lines without supports, some nodes of which are thrown at the others."""
    lossy = contact.get("damping") or contact.get("friction")
    return dict(
        refused={"explicit": "takes no [self_contact]"} if lossy else {},
        web=refweb.Inline(points=points, lines=lines, supports=[]),
        cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-6, density=1000.0),
        effects=(
            refweb.SelfContact(radius=RADIUS, **contact),
            refweb.Velocity(node=thrown, value=velocity),
        ),
        supports=refweb.Supports(nodes=[]),
        solve=lambda method: refweb.Dynamic(method=method, duration=duration),
    )


def crossed(speed, angle=90.0, aside=0.0, **contact):
    """Two lines of 1 m, the upper one of which comes down."""
    u = 0.5 * np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle)), 0.0])
    above = np.array([0.1, aside, 3.0 * RADIUS])
    points = [[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0], (above - u).tolist(), (above + u).tolist()]
    return of_lines(points, [[0, 1], [2, 3]], [2, 3], (0.0, 0.0, -speed), 0.05 / speed, **contact)


def layers(side=0.1, size=2, **contact):
    """A small net thrown at another below it, and turned by 20° to it."""
    here = side * np.array([(i, j, 0.0) for i in range(size + 1) for j in range(size + 1)])
    cosine, sine = np.cos(np.radians(20.0)), np.sin(np.radians(20.0))
    there = (here - here.mean(axis=0)) @ np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    there += here.mean(axis=0) + [0.3 * side, 0.2 * side, 3.0 * RADIUS]
    numbers = np.arange(len(here)).reshape(size + 1, size + 1)
    pairs = ((numbers[:-1], numbers[1:]), (numbers[:, :-1], numbers[:, 1:]))
    lines = np.vstack([np.column_stack([a.ravel(), b.ravel()]) for a, b in pairs])
    lines, points = np.vstack([lines, lines + len(here)]).tolist(), np.vstack([here, there]).tolist()
    thrown = list(range(len(here), 2 * len(here)))
    return of_lines(points, lines, thrown, (0.3, 0.1, -1.0), 0.05, **contact)


LINES = {
    "lines thrown at lines at v [m/s]": {v: crossed(v) for v in (0.1, 3.0, 30.0)},
    "lines thrown at lines": {
        "nearly along each other": crossed(1.0, angle=1.0),
        "along each other": crossed(1.0, angle=0.0),
        "past each other": crossed(1.0, aside=0.49),
        "with damping": crossed(1.0, angle=60.0, damping=2.0),
        "with friction": crossed(1.0, angle=60.0, friction=0.5),
        "a net at a net": layers(),
        "a net at a net, with friction": layers(friction=0.3, damping=1.0),
    },
}


def of_bodies(*bodies, duration=0.02, stiffness=1e5, **contact):
    """Bodies that may touch each other, beside a line that both ends hold."""
    lossy = contact.get("damping") or contact.get("friction")
    return dict(
        refused={"explicit": "takes no [contact]"} if lossy else {},
        web=refweb.Inline(points=[[9.0, 0.0, 0.0], [10.0, 0.0, 0.0]], lines=[[0, 1]], supports=[0, 1]),
        cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-6, density=1000.0),
        effects=(*bodies, refweb.Contact(stiffness=stiffness, between_bodies=True, **contact)),
        supports=None,
        solve=lambda method: refweb.Dynamic(method=method, duration=duration),
    )


def ball(name, position, velocity=(0.0, 0.0, 0.0), **more):
    return refweb.Body(**{"name": name, "radius": 0.1, "mass": 1.0, "position": position, "velocity": velocity, **more})


def cube(name, position, velocity=(0.0, 0.0, 0.0), **more):
    own = dict(shape="box", size=(0.2, 0.2, 0.2), rounding=0.01, mass=1.0, position=position, velocity=velocity)
    return refweb.Body(**{"name": name, **own, **more})


FLOOR = cube("floor", (0.0, 0.0, -0.5), fixed=True, size=(2.0, 2.0, 1.0))
ON_EDGE = ((1.0, 0.0, 1.0), (0.0, 1.0, 0.0))
ACROSS = ((0.0, 1.0, 1.0), (-1.0, 0.0, 0.0))
"""The first two axes of a cube that stands on an edge along y, and along x."""
EDGE = 2.0**0.5 * (0.1 - 0.01) + 0.01
"""From the centre of a cube to a rounded edge [m]."""

BODIES = {
    "balls that meet at v [m/s]": {
        v: of_bodies(
            ball("one", (0, 0, 0)), ball("other", (0.21, 0.01, 0.0), (-v, 0.0, 0.0)), duration=0.012 / v + 0.012
        )
        for v in (0.3, 3.0, 10.0)
    },
    "bodies that meet": {
        "a cube on its edge, on a floor": of_bodies(
            FLOOR, cube("cube", (0, 0, EDGE + 1e-3), (0, 0, -2.0), axes=ON_EDGE)
        ),
        "a cube flat on a floor": of_bodies(FLOOR, cube("cube", (0, 0, 0.101), (0.0, 0.0, -2.0))),
        "edges across each other": of_bodies(
            cube("below", (0, 0, 0), axes=ACROSS),
            cube("above", (0.01, 0.02, 2.0 * EDGE + 1e-3), (0.0, 0.0, -2.0), axes=ON_EDGE),
        ),
        "a ball on a corner": of_bodies(
            cube("cube", (0, 0, 0)), ball("ball", (0.17, 0.16, 0.17), (-1.0, -1.0, -1.0)), duration=0.05
        ),
        "a rod across a rod": of_bodies(
            ball("one", (0, 0, 0), shape="capsule", length=0.5, axis=(1, 0, 0)),
            ball("other", (0.05, 0.02, 0.21), (0, 0, -2.0), shape="capsule", length=0.5, axis=(0, 1, 0)),
        ),
        "a cube that slides on a floor": of_bodies(FLOOR, cube("cube", (0, 0, 0.0999), (1.0, 0.0, 0.0)), friction=0.3),
        "a ball that is thrown at a floor aslant": of_bodies(
            FLOOR, ball("ball", (0, 0, 0.101), (1.0, 0.0, -2.0)), friction=0.3, damping=0.1
        ),
    },
}
