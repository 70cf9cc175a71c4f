"""Hard hits of bodies that turn: on edges and corners, flat and fast, with a bad surface, and at rest for long.

A box on an edge or a corner touches a line with what of it is round, of a hundredth of a metre; a line along an edge
touches it at all places at once. A surface from a file may have triangles without an area, and slivers; its body has to
move as that of the same surface without them. A body that rests on a net is to gain no energy there, however long.
"""

import pathlib
import tempfile

import meshio
import numpy as np

import refweb

from ..harness.case import Row

SIDE, ROUND = 0.2, 0.01
ON_EDGE = ((1.0, 0.0, 1.0), (0.0, 1.0, 0.0))
ON_CORNER = ((2.0**0.5, 0.0, 1.0), (-1.0, 3.0**0.5, 2.0**0.5))
"""The first two axes of a cube that stands on an edge along y, and on a corner."""
EDGE = 2.0**0.5 * (0.5 * SIDE - ROUND) + ROUND
CORNER = 3.0**0.5 * (0.5 * SIDE - ROUND) + ROUND
"""From the centre to a rounded edge, and to a rounded corner."""


def onto(axes, low, lines, stiffness=1e5, off=0.0):
    """A cube that comes down at 2 m/s on lines that both ends hold, its lowest point 1 mm above them."""
    points = [point for line in lines for point in line]
    pairs = [[2 * i, 2 * i + 1] for i in range(len(lines))]
    cube = refweb.Body(
        name="cube",
        shape="box",
        size=(SIDE, SIDE, SIDE),
        rounding=ROUND,
        mass=1.0,
        axes=axes,
        position=(0.7 * off, -off, low + 1e-3),
        velocity=(0.0, 0.0, -2.0),
    )
    return dict(
        refused={},
        web=refweb.Inline(points=points, lines=pairs, supports=list(range(len(points)))),
        cable=refweb.Cable(law="tension-only", modulus=1e6, area=1e-4, density=1.0),
        effects=(cube, refweb.Contact(stiffness=stiffness)),
        supports=None,
        solve=lambda method: refweb.Dynamic(method=method, duration=2e-3 + 5.0 * stiffness**-0.5),
    )


def plate(axes, low):
    """A plate of 10 mm that turns and meets a free net at 50 m/s, with the stiffness that refweb chooses."""
    own = refweb.Body(
        name="plate",
        shape="box",
        size=(0.4, 0.4, 0.01),
        rounding=0.004,
        mass=0.5,
        axes=axes,
        position=(0.01, 0.02, low + 1e-3),
        velocity=(0.0, 0.0, -50.0),
        angular_velocity=(1.0, -2.0, 3.0),
    )
    return dict(
        refused={},
        web=refweb.Window(mesh="square", rows=8, columns=8, side=0.15),
        cable=refweb.Cable(law="tension-only", modulus=1e9, area=1e-6, density=1000.0),
        effects=(own, refweb.Contact()),
        supports=refweb.Supports(nodes=[]),
        solve=lambda method: refweb.Dynamic(method=method, duration=2e-3),
    )


ACROSS, ALONG = [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]]
HITS = {
    "an edge across a line": onto(ON_EDGE, EDGE, [ACROSS]),
    "an edge across a line, 1 cm off": onto(ON_EDGE, EDGE, [ACROSS], off=0.01),
    "a line along an edge": onto(ON_EDGE, EDGE, [ALONG]),
    "a line along an edge, 1 mm off": onto(ON_EDGE, EDGE, [ALONG], off=1e-3),
    "a corner on a line": onto(ON_CORNER, CORNER, [ACROSS]),
    "a corner on two lines, 1 cm off": onto(ON_CORNER, CORNER, [ACROSS, ALONG], off=0.01),
    "a thin plate at 50 m/s, flat": plate(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), 0.005),
    "a thin plate at 50 m/s, on its edge": plate(((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)), 0.2),
}


def _box_of_triangles(bad):
    """Points and triangles of a box; with a sliver, and triangles that are an edge or a point, where ``bad``."""
    half = 0.5 * np.array([0.3, 0.2, 0.15])
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = [part for a, b, c, d in faces for part in ([a, b, c], [a, c, d])]
    if bad:
        corners = np.vstack([corners, corners[0] + 1e-4 * (corners[1] - corners[0])])  # on the edge from 0 to 1
        split = []
        for a, b, c in triangles:
            cut = next(((p, q, r) for p, q, r in ((a, b, c), (b, c, a), (c, a, b)) if {p, q} == {0, 1}), None)
            split += [[cut[0], 8, cut[2]], [8, cut[1], cut[2]]] if cut else [[a, b, c]]
        triangles = [*split, [0, 0, 1], [3, 3, 3]]
    return corners, triangles


def bad_surface():
    """Where a box from a file is, with its surface bad, and as it should be, after it has hit a net off its middle."""
    places = []
    with tempfile.TemporaryDirectory() as folder:
        for bad in (False, True):
            points, triangles = _box_of_triangles(bad)
            file = pathlib.Path(folder) / f"box-{bad}.stl"
            with np.errstate(invalid="ignore"):  # of normals
                meshio.Mesh(points, [("triangle", np.array(triangles))]).write(file)
            box = dict(name="box", shape="mesh", file=str(file), mass=0.3, position=[0.35, 0.33, 0.12])
            box |= dict(velocity=[0.0, 0.0, -2.0], angular_velocity=[3.0, -2.0, 1.0])
            scene = refweb.Scene(
                web=refweb.Window(mesh="square", rows=3, columns=3, side=0.2),
                cable=refweb.Cable(law="tension-only", modulus=1e6, area=1e-5, density=1000.0),
                effects=[refweb.Body(**box), refweb.Contact(stiffness=1e3)],
                solve=refweb.Dynamic(duration=0.05),
                output=refweb.Output(interval=0.05),
                accuracy=refweb.Accuracy(error="none"),
            )
            state = refweb.run(scene).state
            (body,) = state.system.net.bodies
            places.append(np.concatenate([state.position[body.row], body.rotation(state.x).ravel()]))
    off = np.abs(places[1] - places[0]).max()
    why = "corners are rounded to 1e-8 m in the file, and hits make 100 times of that"
    return Row("a box of slivers and of triangles without area", off, 0.0, "the same box", 1e-6, why, "m", scale=1.0)


def at_rest(steps):
    """Rows of a box that losses have brought to rest in a net, in many steps without losses, and with friction."""
    box = dict(name="box", shape="box", size=(0.3, 0.25, 0.2), rounding=0.02, mass=1.0, position=(0.0, 0.0, 0.09))
    own = dict(
        web=refweb.Window(mesh="square", rows=5, columns=5, side=0.15),
        cable=refweb.Cable(law="linear", modulus=1e7, area=1e-5, density=1000.0),
        accuracy=refweb.Accuracy(error="none"),
    )
    acting = [refweb.Body(**box), refweb.Gravity(acceleration=(0.0, 0.0, -9.81))]
    losing = [refweb.Damping(time=2e-3, rate=30.0), refweb.Contact(stiffness=2e3, damping=5.0, friction=0.3)]
    with tempfile.TemporaryDirectory() as folder:
        settled = refweb.Scene(effects=[*acting, *losing], solve=refweb.Dynamic(duration=6.0), **own)
        refweb.run(settled, f"{folder}/rest")
        for what, contact in (("friction", {"friction": 0.3}), ("no losses", {})):
            touching = refweb.Contact(stiffness=2e3, **contact)
            solve = refweb.Dynamic(duration=steps * 1e-4, step_size=1e-4, start=f"{folder}/rest")
            scene = refweb.Scene(effects=[*acting, touching], solve=solve, **own)
            solution = refweb.run(scene.replace(output=refweb.Output(interval=0.01 * solve.duration)))
            history = solution.history
            off = np.abs(np.asarray(history["total_energy"]) - history["total_energy"][0])
            name = f"energy that a box at rest gains in {solution.solver['nsteps']} steps, {what}"
            moving = max(np.asarray(history["kinetic_energy"]).max(), 1e-3)
            why = "of what moves, which without losses begins to slide, and of 1 mJ at least"
            yield Row(name, off.max(), 0.0, "conserved", 1e-5, why, "J", scale=moving)
