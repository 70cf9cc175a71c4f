"""Distances, and the mouth of a net."""

import numpy as np
import pytest

import refweb

CORNERS = [0, 1, 2, 3]


def square(observe, points=((0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0)), effects=(), solve=None):
    """A frame of four lines in a plane, all of it held, or what its effects make of it."""
    return refweb.Scene(
        web=refweb.Inline(points=[list(point) for point in points], lines=[[0, 1], [1, 2], [2, 3], [3, 0]]),
        cable=refweb.Cable(law="linear", modulus=1e6, area=1e-4, density=100.0),
        supports=refweb.Supports(nodes="all" if not effects else []),
        effects=list(effects),
        solve=solve or refweb.Static(),
        observe=[refweb.Observe(**{"name": one["quantity"], **one}) for one in observe],
    )


def values(observe, **scene):
    return {name: result.value for name, result in refweb.run(square(observe, **scene)).results.items()}


def test_rectangle():
    found = values(
        [
            dict(quantity="mouth_area", node=CORNERS),
            dict(quantity="mouth_perimeter", node=CORNERS),
            dict(quantity="distance", node=[0, 2]),
            dict(name="up", quantity="mouth_area", node=CORNERS, component="z"),
            dict(name="down", quantity="mouth_area", node=CORNERS[::-1], component="z"),
            dict(name="aside", quantity="mouth_area", node=CORNERS, component="x"),
        ]
    )
    np.testing.assert_allclose([found["mouth_area"], found["mouth_perimeter"]], [2.0, 6.0], rtol=1e-15)
    np.testing.assert_allclose(found["distance"], np.sqrt(5.0), rtol=1e-15)
    assert found["up"] == 2.0 and found["down"] == -2.0 and found["aside"] == 0.0


@pytest.mark.parametrize("node", ["corners", "rim"])
def test_nodes_of_a_name_go_round(node):
    """A window of 2 m without its corners, whose nodes have numbers row by row; counterclockwise seen from +z."""
    whole = square(
        [
            dict(quantity="mouth_area", node=node),
            dict(quantity="mouth_perimeter", node=node),
            dict(name="up", quantity="mouth_area", node=node, component="z"),
        ]
    ).replace(web=refweb.Window(mesh="square", rows=4, columns=4, side=0.5))
    found = {name: result.value for name, result in refweb.run(whole).results.items()}
    np.testing.assert_allclose([*found.values()], [3.5, 4.0 + 2.0 * np.sqrt(2.0), 3.5], rtol=1e-14)


def test_mouth_that_is_not_plane():
    """Opposite corners lifted by h: the area vector keeps its length along z, and each side grows to √(s² + h²)."""
    points = [(0, 0, 0.5), (2, 0, 0), (2, 1, 0.5), (0, 1, 0)]
    asked = [dict(quantity="mouth_area", node=CORNERS), dict(quantity="mouth_perimeter", node=CORNERS)]
    found = values(asked, points=points)
    np.testing.assert_allclose(found["mouth_area"], 2.0, rtol=1e-15)
    np.testing.assert_allclose(found["mouth_perimeter"], 2.0 * np.sqrt(4.25) + 2.0 * np.sqrt(1.25), rtol=1e-15)


@pytest.mark.ordinary("central-difference", "ida")
@pytest.mark.parametrize("method", ["central-difference", "cvode", "ida"])
def test_closing_mouth(method):
    """Corners that move inwards in a straight line, past slack lines: sides shrink with time, the area with its square;
    its least is where they meet."""
    points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    thrown = [refweb.Velocity(node=i, value=tuple(-0.5 * np.array(p))) for i, p in enumerate(points)]
    ball = refweb.Body(name="ball", radius=0.1, mass=1.0, position=(0, 0, 4), velocity=(0, 0, 1.0))
    other = refweb.Body(name="other", radius=0.1, mass=1.0, position=(3, 0, 4))
    asked = [
        dict(quantity="mouth_area", node=CORNERS, reduce="min"),
        dict(quantity="mouth_perimeter", node=CORNERS),
        dict(name="across", quantity="distance", node=[0, 2]),
        dict(name="to ball", quantity="distance", node=0, to="ball"),
        dict(name="bodies", quantity="distance", body="ball", to="other"),
    ]
    scene = square(asked, points, [*thrown, ball, other], refweb.Dynamic(duration=1.0, method=method))
    scene = scene.replace(cable=refweb.Cable(law="tension-only", modulus=1e6, area=1e-4, density=100.0))
    found = {name: result.value for name, result in refweb.run(scene).results.items()}
    side = 2.0 * 0.5
    exact = [side**2, 4.0 * side, np.sqrt(2.0) * side, np.sqrt(0.5**2 + 0.5**2 + 25.0), np.sqrt(9.0 + 1.0)]
    # Explicit steps are exact for straight paths, the others within their tolerances.
    np.testing.assert_allclose(list(found.values()), exact, rtol=1e-12 if method == "central-difference" else 1e-4)


@pytest.mark.parametrize(
    "one, message",
    [
        (dict(quantity="distance", node=[0, 1, 2]), 'quantity = "distance" is of 3 places, must be 2'),
        (dict(quantity="distance", node=0, to="ball"), 'body = "ball" is not a body, the scene has no'),
        (dict(quantity="mouth_area", node=[0, 1]), 'quantity = "mouth_area" is of 2 nodes, must be at least 3'),
        (dict(quantity="mouth_perimeter"), "is of 0 nodes"),
        (dict(quantity="tension", to="ball"), 'to = "ball" has no meaning for quantity = "tension"'),
    ],
)
def test_what_is_refused(one, message):
    with pytest.raises(refweb.InputError, match=message):
        square([one]).build()


@pytest.mark.ordinary("central-difference")
@pytest.mark.parametrize("method", ["central-difference", "cvode"])
def test_angular_momentum_of_all_is_kept(method):
    """Of a net that spins and a ball that passes by, whatever the net does; web and ball are its parts."""
    spin = refweb.Velocity(node="all", value=(1.0, 0.0, 0.0), spin=(0.3, -0.2, 2.0))
    ball = refweb.Body(name="ball", radius=0.1, mass=1.5, position=(0, 3, 4), velocity=(0, 0, 1.0))
    asked = [
        dict(name="all", quantity="total_angular_momentum"),
        *(dict(name=f"all {axis}", quantity="total_angular_momentum", component=axis) for axis in "xyz"),
        *(dict(name=f"web {axis}", quantity="total_angular_momentum", node="all", component=axis) for axis in "xyz"),
        *(dict(name=f"ball {axis}", quantity="total_angular_momentum", body="ball", component=axis) for axis in "xyz"),
    ]
    scene = square(asked, effects=[spin, ball], solve=refweb.Dynamic(duration=0.5, method=method))
    system = scene.build()
    mass, place, v = system.net.mass, system.net.points, system.initial_velocity()
    centre, drift = mass @ place / mass.sum(), mass @ v / mass.sum()
    start = (mass[:, None] * np.cross(place - centre, v - drift)).sum(axis=0)
    history = refweb.run(scene).history
    found = {part: np.column_stack([history[f"{part} {axis}"] for axis in "xyz"]) for part in ("all", "web", "ball")}
    size = np.linalg.norm(start)
    np.testing.assert_allclose(found["all"], np.tile(start, (len(found["all"]), 1)), rtol=0, atol=1e-6 * size)
    np.testing.assert_allclose(found["web"] + found["ball"], found["all"], rtol=0, atol=1e-13 * size)
    np.testing.assert_allclose(history["all"], size, rtol=1e-6)
