"""Choices among nodes, bodies and lines, and parts of lines, against chains, flights and triangles of forces."""

import numpy as np
import pytest
from scipy.optimize import root

import refweb
from refweb.pictures.peaks import observed

SPAN, LENGTH, PIECES = 10.0, 12.0, 11
EA, WEIGHT = 1e5, 1000.0 * 1e-4 * 9.81
"""Axial stiffness [N] and weight per natural length [N/m]."""


def chain(rise=0.0):
    """(tension of each piece, heights of its nodes) of a chain of bars that hangs between two points.

    Half of a piece's weight acts at either end, so that the vertical pull of piece k is that of its middle.
    """
    size = LENGTH / PIECES

    def shape(pulls):
        lift = pulls[1] + WEIGHT * size * (np.arange(PIECES) - (PIECES - 1) / 2.0)
        tension = np.hypot(pulls[0], lift)
        stretched = size * (1.0 + tension / EA) / tension
        return tension, pulls[0] * stretched, lift * stretched

    def off(pulls):
        _, along, up = shape(pulls)
        return along.sum() - SPAN, up.sum() - rise

    tension, _, up = shape(root(off, [5.0, rise], tol=1e-14).x)
    return tension, np.append(0.0, np.cumsum(up))


def hanging(observe, rise=0.0, **web):
    """The cable as a scene of statics; by lines, or by one line of as many pieces."""
    one = {
        "web": refweb.Inline(
            points=[[0, 0, 0], [SPAN, 0, rise]], lines=[[0, 1]], natural_length=[LENGTH], supports=[0, 1]
        )
    }
    lines = {"web": refweb.SingleCable(start=(0, 0, 0), end=(SPAN, 0, 0), elements=PIECES, length=LENGTH)}
    cable = dict(law="tension-only", modulus=1e9, area=1e-4, density=1000.0)
    return refweb.Scene(
        **(one if web else lines),
        cable=refweb.Cable(**cable, **web),
        effects=[refweb.Gravity(acceleration=(0.0, 0.0, -9.81))],
        solve=refweb.Static(),
        observe=observe,
    )


def holds(result, expected, place):
    """The value is that of somebody's own program to 1e-9, within ± and rounding, and stands where it should."""
    np.testing.assert_allclose(result.value, expected, rtol=1e-9)
    assert abs(result.value - expected) <= result.error + 1e-12 * abs(expected) and result.where == place


def test_lowest_node_and_slackest_line_of_a_hanging_cable():
    """The middle line is the slackest, an end line the tautest, and a middle node the lowest and the farthest in z."""
    tension, heights = chain()
    asked = {
        "lowest": dict(quantity="position", component="z", select="min"),
        "highest": dict(quantity="position", component="z", select="max"),
        "sag": dict(quantity="position", component="z", select="abs"),
        "slackest": dict(quantity="tension", select="min"),
        "tautest": dict(quantity="tension", select="max"),
        "of three": dict(quantity="tension", line=[0, 1, 3], select="min"),
        "least strain": dict(quantity="strain", select="min"),
        "least stress": dict(quantity="stress", select="min"),
    }
    solution = refweb.run(hanging([refweb.Observe(name=name, **keys) for name, keys in asked.items()]))
    found, middle = solution.results, PIECES // 2
    lowest = found["lowest"]
    assert lowest.where in (middle, middle + 1) and lowest.where == found["sag"].where
    holds(lowest, heights.min(), lowest.where)
    holds(found["sag"], -heights.min(), lowest.where)
    assert found["highest"].value == 0.0 and found["highest"].where == 0
    holds(found["slackest"], tension.min(), middle)
    assert found["tautest"].where in (0, PIECES - 1) and found["slackest"].proven
    holds(found["tautest"], tension.max(), found["tautest"].where)
    holds(found["of three"], tension[3], 3)
    holds(found["least strain"], tension.min() / EA, middle)
    holds(found["least stress"], tension.min() / 1e-4, middle)


def test_tension_at_the_ends_of_a_line():
    """One line in pieces between ends of two heights: that at each end and at the middle are those of the chain."""
    tension, _ = chain(rise=2.0)
    parts = {part: refweb.Observe(name=part, quantity="tension", part=part) for part in ("start", "middle", "end")}
    least = refweb.Observe(name="least", quantity="tension", line=0, select="min")
    solution = refweb.run(hanging([*parts.values(), least], rise=2.0, subdivide=PIECES))
    for name, expected in zip(parts, tension[[0, PIECES // 2, -1]], strict=True):
        holds(solution.results[name], expected, 0)
    holds(solution.results["least"], tension.min(), 0)


def test_largest_and_smallest_force_of_supports():
    """A weight on two ropes: by the triangle of forces in the directions that they have; together they bear it."""
    observe = [
        refweb.Observe(name=str(select), quantity="reaction", node=[0, 1], select=select)
        for select in (None, "max", "min")
    ]
    observe.append(refweb.Observe(name="pull", quantity="reaction", node=[0, 1], component="x", select="abs"))
    scene = refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [3, 0, 0], [1, 0, -1]], lines=[[0, 2], [1, 2]], supports=[0, 1]),
        cable=refweb.Cable(law="tension-only", modulus=1e7, area=1e-4, density=0.0),
        effects=[refweb.Load(node=2, force=(0.0, 0.0, -100.0))],
        solve=refweb.Static(),
        observe=observe,
    )
    solution = refweb.run(scene)
    ways = solution.positions[:2] - solution.positions[2]
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    pulls = np.linalg.solve(ways[:, [0, 2]].T, [0.0, 100.0])
    found = solution.results
    np.testing.assert_allclose(found["None"].value, 100.0, rtol=1e-12)
    assert found["None"].where is None and found["max"].where == pulls.argmax() and found["min"].where == pulls.argmin()
    np.testing.assert_allclose([found["max"].value, found["min"].value], [pulls.max(), pulls.min()], rtol=1e-9)
    np.testing.assert_allclose(found["pull"].value, pulls[0] * abs(ways[0, 0]), rtol=1e-9)


def test_bodies_in_flight():
    """Two balls on parabolas: the higher one, the lower one, the faster one, over time and at the end."""
    balls = [
        refweb.Body(name="a", radius=0.1, mass=1.0, position=(5.0, 0.0, 1.0), velocity=(0.0, 0.0, 2.0)),
        refweb.Body(name="b", radius=0.1, mass=2.0, position=(6.0, 0.0, 1.1), velocity=(1.0, 0.0, -3.0)),
    ]
    asked = {
        "highest": dict(quantity="position", component="z", reduce="max"),
        "lowest": dict(quantity="position", component="z", select="min", reduce="min"),
        "farthest down": dict(quantity="displacement", component="z", select="abs"),
        "slower": dict(quantity="velocity", select="min"),
        "nothing": dict(quantity="reaction", select="max"),
        "together": dict(quantity="reaction"),
    }
    scene = refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0, 1]),
        cable=refweb.Cable(law="tension-only", modulus=1e7, area=1e-4, density=100.0),
        effects=[*balls, refweb.Gravity(acceleration=(0.0, 0.0, -10.0)), refweb.Contact(stiffness=1e4)],
        solve=refweb.Dynamic(duration=0.5),
        observe=[refweb.Observe(name=name, body=["a", "b"], **keys) for name, keys in asked.items()],
    )
    found = refweb.run(scene, progress=False).results
    expected = {
        "highest": (1.0 + 0.5 * 2.0**2 / 10.0, 0.2, 0),
        "lowest": (1.1 - 3.0 * 0.5 - 5.0 * 0.5**2, 0.5, 1),
        "farthest down": (3.0 * 0.5 + 5.0 * 0.5**2, 0.5, 1),
        "slower": (3.0, 0.5, 0),
    }
    for name, (value, time, body) in expected.items():
        result = found[name]
        assert abs(result.value - value) <= result.error + 1e-9 and (result.where, result.at) == (body, "body")
        np.testing.assert_allclose([result.value, result.time], [value, time], rtol=1e-3)  # of a peak between rows
    assert found["nothing"].value == found["together"].value == 0.0 and found["together"].where is None


def test_a_floating_node_may_pass_what_counts():
    """A node on a slack line of 0.5 m reaches neither 2 m above nor 2 m below, but passes what lies between."""
    points = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 0, 0.1], [1, 0, 2], [1, 0, -2]]
    scene = refweb.Scene(
        web=refweb.Inline(
            points=points,
            lines=[[0, 1], [1, 2], [1, 3], [2, 4], [2, 5]],
            supports=[0, 2, 4, 5],
            natural_length=[0.99, 0.99, 0.5, 3, 3],
        ),
        cable=refweb.Cable(law="tension-only", modulus=1e7, area=1e-4, density=0.0),
        solve=refweb.Static(),
        observe=[
            refweb.Observe(name=f"{select} {node}", quantity="position", node=[3, node], component="z", select=select)
            for select in ("max", "min", "abs")
            for node in (0, 4, 5)
        ],
    )
    known = {name for name, result in refweb.run(scene).results.items() if result.error is not None}
    assert known == {"max 4", "min 5", "abs 4", "abs 5"}


def test_strain_of_slack_lines_is_not_unique():
    """Whatever counts: one of two lines is slack, and may be as short as it likes."""
    scene = refweb.Scene(
        web=refweb.Inline(
            points=[[0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 0.3, 0]],
            lines=[[0, 1], [1, 2], [1, 3]],
            natural_length=[0.9, 0.9, 1.0],
            supports=[0, 2],
        ),
        cable=refweb.Cable(law="tension-only", modulus=1e7, area=1e-4, density=0.0),
        solve=refweb.Static(),
        observe=[refweb.Observe(name=select, quantity="strain", select=select) for select in ("max", "min", "abs")],
    )
    found = refweb.run(scene).results
    assert found["max"].error is not None and found["min"].error is None and found["abs"].error is None


@pytest.mark.parametrize(
    "keys, message",
    [
        (dict(quantity="strain_energy", select="min"), 'select = "min" has no meaning for quantity = "strain_energy"'),
        (dict(quantity="displacement", part="end"), 'part = "end" has no meaning for quantity = "displacement"'),
        (dict(quantity="tension", select="smallest"), 'select = "smallest" must be one of "max", "min", "abs"'),
        (dict(quantity="tension", part="end"), 'part = "end" needs .cable. subdivide > 1: a line of one element'),
        (dict(quantity="position", body=["a", "c"]), 'body = "c" is not a body'),
        (dict(quantity="position", body=[]), r"body = \[\] must be at least one body"),
        (dict(quantity="position", body=[3]), r"body\[0\] = 3 must be a printable text"),
        (dict(quantity="distance", node=0, body=["a", "b"]), "exclude each other"),
        (dict(quantity="distance", body=["a", "b"]), 'body names 2 bodies: quantity = "distance" needs one'),
        (
            dict(quantity="angular_velocity", body=["a", "b"]),
            'body names 2 bodies: quantity = "angular_velocity" needs',
        ),
    ],
)
def test_refusals(keys, message):
    balls = [
        {"name": name, "radius": 0.1, "mass": 1.0, "position": [0, 0, height]} for name, height in (("a", 1), ("b", 2))
    ]
    given = {
        "web": {"kind": "inline", "points": [[0, 0, 0], [1, 0, 0]], "lines": [[0, 1]]},
        "cable": {"modulus": 1e7, "area": 1e-4, "density": 100.0},
        "body": balls,
        "solve": {"kind": "dynamic", "duration": 1.0},
        "observe": [{"name": "it", **keys}],
    }
    with pytest.raises(refweb.InputError, match=message):
        refweb.Scene.from_dict(given).build()


def test_pictures_of_the_largest_ask_for_the_largest():
    """The smallest tension, or that of an end, is not taken for the largest of all lines."""
    results = {"it": {"value": 3.0, "error": 0.1, "where": 4, "time": 1.0}}
    for more, known in (({}, True), ({"select": "max"}, True), ({"select": "min"}, False), ({"part": "end"}, False)):
        scene = {"observe": [{"name": "it", "quantity": "tension", "reduce": "max", **more}]}
        assert (observed({"results": results}, scene, "tension") is not None) == known
