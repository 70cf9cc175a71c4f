"""Bodies that tables move: closed forms, the same motion seen from elsewhere, methods side by side, books, refusals."""

import nets
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import refweb

LINE = dict(law="linear", modulus=1e9, area=1e-6, density=1000.0)
"""Line of EA = 1000 N."""
EA, RADIUS = 1000.0, 0.1


def solved(method=None, **tables):
    """Run of a scene by a method of `nets.METHODS`; statics without one."""
    solve = {"kind": "static"} if method is None else {"kind": "dynamic", **nets.METHODS[method]}
    solve |= tables.pop("solve", {})
    return refweb.run(refweb.Scene.from_dict({"cable": LINE, **tables, "solve": solve}))


def cable(*points):
    """A web of lines from point to point."""
    return {"kind": "inline", "points": list(points), "lines": [[i, i + 1] for i in range(len(points) - 1)]}


def observed(*quantities, **keys):
    return [{"name": quantity, "quantity": quantity, **keys} for quantity in quantities]


def test_press_takes_the_force_of_the_lines_that_it_pushes():
    """A knot on a body that goes across a line: F = 2 EA (l/L − 1) d/l in each load step, and no other number."""
    observe = observed("support_force", body="press", component="z")
    d, half = 0.3, 1.0
    result = solved(
        web=cable([-half, 0.0, 0.0], [0.0, 0.0, 0.0], [half, 0.0, 0.0]), supports={"nodes": [0, 2]},
        body=[{"name": "press", "radius": RADIUS, "position": [0.0, 0.0, 0.5]}],
        attach=[{"body": "press", "node": 1}],
        motion=[{"body": "press", "displacement": [[0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, -d]]}],
        observe=observe, solve={"load_steps": [0.5, 1.0]},
    )  # fmt: skip
    for share, found in zip((0.5, 1.0), result.history["support_force"], strict=True):
        length = np.hypot(half, share * d)
        assert found == pytest.approx(-2.0 * EA * (length / half - 1.0) * share * d / length, rel=1e-12)


@pytest.mark.parametrize("d", [0.1, 0.6])
def test_press_in_statics_is_the_rim_that_comes_to_it(d):
    """The punch test of a net panel, 11 × 11 nodes: 63967.23152 N at 0.6 m, by moving the rim and by minimisation."""

    def forces(fixed, motion, *more):
        return solved(
            web={"kind": "window", "mesh": "square", "rows": 10, "columns": 10, "side": 0.3},
            cable=dict(law="tension-only", modulus=2e11, area=1e-6, density=1000.0),
            body=[{"name": "press", "radius": 0.5, "position": [0.0, 0.0, 0.5], "fixed": fixed}],
            motion=[motion], contact={"stiffness": 1e6}, solve={"load_steps": [0.25, 0.5, 0.75, 1.0]},
            observe=observed("reaction", *more, body="press", component="z"),
        ).results  # fmt: skip

    def way(sign):
        return [[0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, sign * d]]

    moved = forces(False, {"body": "press", "displacement": way(-1.0)}, "support_force")
    still = forces(True, {"node": "rim", "displacement": way(1.0)})
    assert moved["reaction"].value == pytest.approx(still["reaction"].value, rel=1e-10)
    assert moved["support_force"].value == pytest.approx(-moved["reaction"].value, rel=1e-10)
    if d == 0.6:
        assert moved["reaction"].value == pytest.approx(63967.23152, abs=1e-5)


@pytest.mark.ordinary("shape0")
@pytest.mark.parametrize("shape", [{"radius": RADIUS}, {"shape": "plane", "normal": [0.0, 0.0, 1.0]}])
def test_a_body_that_comes_is_the_web_that_comes_to_it(shape):
    """Galilei: contact of a body at a constant velocity, and of the web with its rim at the negative one."""

    def run(body, motion, velocity):
        return solved(
            "central-difference", web={"kind": "window", "mesh": "square", "rows": 2, "columns": 2, "side": 0.2},
            body=[{"name": "press", **shape, "position": [0.01, 0.0, -0.005 - shape.get("radius", 0.0)], **body}],
            contact={"stiffness": 1e4}, motion=[motion], **velocity, solve={"duration": 0.02, "step_size": 1e-5},
            observe=[
                *observed("reaction", body="press", component="z"),
                {"name": "gap", "quantity": "distance", "node": "centre", "to": "press"},
            ],
        )  # fmt: skip

    came = run({}, {"body": "press", "displacement": [[0, 0, 0, 0], [1, 0, 0, 2.0]]}, {})
    rim = {"node": "rim", "displacement": [[0, 0, 0, 0], [1, 0, 0, -2.0]]}
    met = run({"fixed": True}, rim, {"velocity": [{"node": "centre", "value": [0.0, 0.0, -2.0]}]})
    for name in ("reaction", "gap"):
        scale = np.abs(met.history[name]).max()
        np.testing.assert_allclose(came.history[name], met.history[name], rtol=0, atol=1e-9 * scale)
    assert met.history["reaction"].min() < -1.0


def test_line_winds_onto_a_drum():
    """Without friction a line of length L that a drum winds up by the angle θ has the tension EA R θ/L, and the drum
    takes its moment. Nodes of chords of length h that touch the drum stand out by (h/R)²/8 of R."""
    pieces, L, angle = 60, 1.0, 0.5
    out = (L / pieces / RADIUS) ** 2 / 8.0
    result = solved(
        web=cable(*([RADIUS, 0.0, -L * i / pieces] for i in range(pieces + 1))), supports={"nodes": [pieces]},
        body=[{"name": "drum", "shape": "cylinder", "radius": RADIUS, "length": 0.1, "axis": [0.0, 1.0, 0.0],
               "position": [0.0, 0.0, 0.0], "axle": {"direction": [0.0, 1.0, 0.0]}}],
        attach=[{"body": "drum", "node": 0}], contact={"stiffness": 1e7},
        motion=[{"body": "drum", "rotation": [[0.0, 0.0, 0.0, 0.0], [1.0, 0.0, -angle, 0.0]]}],
        solve={"load_steps": [0.02, 0.25, 0.5, 0.75, 1.0]},
        observe=[{"name": "tension", "quantity": "tension", "line": pieces - 1},
                 *observed("axle_angle", body="drum"), *observed("support_moment", body="drum", component="y")],
    )  # fmt: skip
    values = {name: number.value for name, number in result.results.items()}
    assert values["axle_angle"] == pytest.approx(-angle, abs=1e-15)
    assert values["tension"] == pytest.approx(EA * RADIUS * angle / L, rel=2.0 * out)
    assert values["support_moment"] == pytest.approx(-values["tension"] * RADIUS, rel=2.0 * out)


@pytest.mark.slow
def test_shipped_winch():
    """The mass rises by R θ and by what the rope stretches less, and the moment is R times the weight that hangs."""
    found, angle, h = refweb.run("winch-drum").results, 2.0, 0.02
    hangs = 9.81 * (5.0 + 1150.0 * 7e-6 * (1.0 - RADIUS * angle))
    out = (h / RADIUS) ** 2 / 8.0  # chords on the drum stand out by that of R
    stretched = 1.0 + hangs / (3e9 * 7e-6)
    assert found["height"].value == pytest.approx(RADIUS * angle - stretched, abs=out * RADIUS * angle)
    assert found["moment"].value == pytest.approx(-RADIUS * hangs, rel=out)


TURNS = [[0.0, 0.0, 0.0, 0.0], [0.1, 0.3, -0.2, 0.9], [0.25, 1.4, 0.1, 0.3], [0.4, 0.0, 0.0, 0.0]]
"""Rotation vectors of no common axis."""


def turned(t, table=TURNS):
    """Rotation of the table at a time, by the shorter way from row to row, as scipy has it; angular velocity there."""
    table = np.array(table)
    n = int(np.clip(np.searchsorted(table[:, 0], t, side="right") - 1, 0, len(table) - 2))
    first, last = (Rotation.from_rotvec(row[1:]) for row in table[n : n + 2])
    rate = (last * first.inv()).as_rotvec() / (table[n + 1, 0] - table[n, 0])
    return Rotation.from_rotvec(rate * (t - table[n, 0])) * first, rate


@pytest.mark.ordinary("central-difference", "order 4")
@pytest.mark.parametrize("method", ["central-difference", "order 4", "bdf"])
def test_a_body_turns_as_its_table_says(method):
    """Orientation, angular velocity and a node on it, between rows whose axes differ; a corner's rate is the next's."""
    point, centre = np.array([0.3, -0.1, 0.2]), np.array([0.0, 0.0, 0.4])
    result = solved(
        method, web=cable([0.3, -0.1, 0.6], [1.5, 0.0, 0.6], [2.0, 0.0, 0.6]), supports={"nodes": [2]},
        body=[{"name": "ship", "shape": "box", "size": [0.4, 0.2, 0.1], "position": [0.0, 0.0, 0.4]}],
        attach=[{"body": "ship", "node": 0}], cable=LINE | {"modulus": 1e5},  # slow, which takes few steps
        motion=[{"body": "ship", "rotation": TURNS, "displacement": [[0.0, 0.0, 0.0, 0.0], [0.4, 0.2, 0.0, -0.1]]}],
        solve={"duration": 0.4}, output={"interval": 0.05}, observe=[
            *({"name": f"q{c}", "quantity": "orientation", "body": "ship", "component": c} for c in "xyzw"),
            *({"name": f"w{c}", "quantity": "angular_velocity", "body": "ship", "component": c} for c in "xyz"),
            *({"name": f"p{c}", "quantity": "position", "node": 0, "component": c} for c in "xyz"),
        ],
    )  # fmt: skip
    history = result.history
    for i, t in enumerate(history["time"]):
        rotation, rate = turned(t)
        q = np.array([history[f"q{c}"][i] for c in "xyzw"])
        assert abs(q @ rotation.as_quat()) == pytest.approx(1.0, abs=1e-13)
        if t < 0.4 * (1.0 - 1e-9):
            np.testing.assert_allclose([history[f"w{c}"][i] for c in "xyz"], rate, rtol=0, atol=1e-12 * 20.0)
        place = centre + np.array([0.2, 0.0, -0.1]) * t / 0.4 + rotation.apply(point)
        np.testing.assert_allclose([history[f"p{c}"][i] for c in "xyz"], place, rtol=0, atol=1e-13)


def test_rows_of_one_axis_turn_by_full_turns():
    """A drum of 25.5 turns and back by 0.25: its angle and its angular velocity are those of the table."""
    angle = 2.0 * np.pi * np.array([0.0, 25.5, 25.25])
    table = [[t, 0.0, 0.6 * a, 0.8 * a] for t, a in zip((0.0, 1.0, 1.5), angle, strict=True)]
    result = solved(
        "central-difference", web=cable([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]),
        supports={"nodes": [0, 2]}, motion=[{"body": "drum", "rotation": table}],
        body=[{"name": "drum", "radius": RADIUS, "position": [0.0, 5.0, 0.0], "axle": {"direction": [0.0, 3.0, 4.0]}}],
        solve={"duration": 1.5}, output={"interval": 0.25},
        observe=observed("axle_angle", body="drum") + observed("angular_velocity", body="drum", component="z"),
    ).history  # fmt: skip
    expected = np.interp(result["time"], [0.0, 1.0, 1.5], angle)
    np.testing.assert_allclose(result["axle_angle"], expected, rtol=0, atol=1e-12 * angle[1])
    rates = 0.8 * np.where(result["time"] < 1.0, angle[1], -np.pi)
    np.testing.assert_allclose(result["angular_velocity"][:-1], rates[:-1], rtol=1e-12)


def winding(method, **solve):
    """A drum that turns at a constant rate, and a line on it that is its spring; the work is all there is."""
    quantities = ("support_force", "support_moment")
    return solved(
        method, web=cable([RADIUS, 0.0, 0.0], [RADIUS, 0.0, -0.4], [0.0, 0.0, -0.8]), supports={"nodes": [2]},
        cable=LINE | {"density": 1e4},
        body=[{"name": "drum", "radius": RADIUS, "position": [0.0, 0.0, 0.0], "axle": {"direction": [0.0, 1.0, 0.0]}}],
        attach=[{"body": "drum", "node": 0}],
        motion=[{"body": "drum", "rotation": [[0.0, 0.0, 0.0, 0.0], [0.02, 0.0, -0.3, 0.0]]}],
        solve={"duration": 0.03, **solve},
        observe=[*observed(*quantities, body="drum"), {"name": "done", "quantity": "work"},
                 {"name": "stored", "quantity": "total_energy"},
                 {"name": "z", "quantity": "displacement", "node": 1, "component": "z"}],
    )  # fmt: skip


@pytest.mark.slow
def test_methods_wind_alike_and_book_the_work():
    """Five methods within their ± beside order 6; the work of the motion is what the web has of energy."""
    reference = winding("order 6", safety=0.1)
    for method in nets.METHODS.keys() - {"order 6"}:
        result = winding(method)
        for name, number in result.results.items():
            best = reference.results[name]
            assert abs(number.value - best.value) <= 1.5 * (number.error + best.error), (method, name)
        history = result.history
        np.testing.assert_allclose(history["done"], history["stored"], rtol=0, atol=1e-2 * history["done"].max())


@pytest.mark.parametrize("method, order", [("central-difference", 2), ("order 4", 4)])
def test_orders_hold_with_motion(method, order):
    """Errors of a free node, and of the work, beside a line that a drum winds up: fitted slopes."""
    steps = [1e-4, 5e-5] if order == 2 else [2e-4, 1e-4]
    exact = winding("order 6", step_size=2e-5).results
    errors = [
        {name: abs(winding(method, step_size=h).results[name].value - exact[name].value) for name in ("z", "done")}
        for h in steps
    ]
    for name in ("z", "done"):
        assert np.log2(errors[0][name] / errors[1][name]) == pytest.approx(order, abs=0.3)
        assert errors[1][name] < 1e-2 * abs(exact[name].value)


DRUM = {"name": "drum", "radius": RADIUS, "position": [0.0, 0.0, -1.0]}
STILL = [[0.0, 0.0, 0.0, 0.0]]
HELD = {"body": "drum", "rotation": STILL}
REFUSED = [
    (dict(body=[DRUM]), r'\[\[body\]\] 1 mass is missing: .*fixed = true holds it, and \[\[motion\]\] body = "dr'),
    (dict(body=[DRUM | {"velocity": [1.0, 0.0, 0.0]}]), r"mass is missing: a free body needs mass"),
    (dict(motion=[{"displacement": STILL}]), r"node is missing: give node = ... or body = ..."),
    (dict(motion=[{"body": "drum"}]), r"displacement is missing: .* or rotation = \[\[t, x, y, z\], ...\]"),
    (dict(motion=[{"body": "drum", "node": 0, "displacement": STILL}]), r'node = 0 and body = "drum" exclude'),
    (dict(motion=[{"node": 0, "rotation": STILL}]), r"rotation = .* has no meaning for nodes: it turns a body"),
    (dict(motion=[{"body": "drun", "rotation": STILL}]), r'body = "drun" is not a \[\[body\]\].*"drum"'),
    (dict(body=[DRUM | {"fixed": True}], motion=[HELD]), r"has fixed = true, which holds"),
    (dict(body=[DRUM | {"mass": 2.0}], motion=[HELD]),
     r'body = "drum" has a mass of 2 kg and moves by what acts on it, .*: leave out its mass and density'),
    (dict(motion=[HELD] * 2), r'\[\[motion\]\] body "drum" is moved by two tables: merge'),
    (dict(body=[{"name": "drum", "shape": "plane", "normal": [0, 0, 1], "position": [0, 0, -1]}],
          motion=[HELD]), r"has no meaning for a plane: give displacement alone"),
    (dict(body=[DRUM | {"axle": {"direction": [0, 0, 2]}}], motion=[{"body": "drum", "rotation": [[0, 0, 0.1, 1]]}]),
     r"must be along axle.direction = \[0.0, 0.0, 1.0\]"),
    (dict(body=[DRUM | {"axle": {"direction": [0, 0, 2], "torque": 1.0}}], motion=[HELD]),
     r'body = "drum" has axle.torque, which a motion leaves nothing to'),
    (dict(body=[{"name": "drum", "shape": "plane", "normal": [0, 0, 1], "position": [0, 0, -1]}]),
     r"mass is missing: .*fixed = true holds it"),
    (dict(body=[DRUM | {"fixed": True}], observe=observed("support_force", body="drum")),
     r'body = "drum" is neither moved by \[\[motion\]\] nor on an axle: hold it by .*; the force of contact'),
    (dict(motion=[{"body": "drum", "displacement": STILL}], observe=observed("support_moment", body="drum")),
     r"is not turned by \[\[motion\]\] rotation"),
    (dict(motion=[HELD], observe=observed("axle_angle", body="drum")),
     r"turns about no axle: give axle = { direction = \[...\] }"),
]  # fmt: skip


def test_a_run_begins_where_a_static_one_has_turned_a_body(tmp_path):
    """A wheel that pulls a line keeps its pull where its table begins at that angle; any other table is refused."""
    wheel = {"name": "wheel", "radius": 0.5, "position": [0, 0, 0], "axle": {"direction": [0, 0, 1]}}
    scene = dict(
        web=cable([0.0, 0.5, 0.0], [1.5, 0.5, 0.0], [3.0, 0.5, 0.0]), supports={"nodes": [2]}, body=[wheel],
        attach=[{"body": "wheel", "node": 0}], observe=observed("tension"),
    )  # fmt: skip

    def turned(first, last):
        return [{"body": "wheel", "rotation": [[0.0, 0.0, 0.0, first], [1.0, 0.0, 0.0, last]]}]

    static = refweb.Scene.from_dict({"cable": LINE, **scene, "motion": turned(0.0, 0.5), "solve": {"kind": "static"}})
    pull = refweb.run(static, out=tmp_path / "static").results["tension"].value
    solve = dict(start=str(tmp_path / "static"), duration=0.02)
    still = solved("central-difference", **scene, motion=turned(0.5, 0.5), solve=solve)
    assert not still.warnings
    np.testing.assert_allclose(still.history["tension"], pull, rtol=1e-9)  # the residual of statics
    with pytest.raises(refweb.InputError, match='body "wheel" some 0.* m off the place that .* at t = 0: begin its'):
        solved("central-difference", **scene, motion=turned(0.0, 0.5), solve=solve)


@pytest.mark.parametrize("tables, message", REFUSED)
def test_what_cannot_be_moved_is_refused(tables, message):
    with pytest.raises(refweb.InputError, match=message):
        solved("central-difference", **{
            "web": cable([0.0, 0.0, 0.0], [1.0, 0.0, 0.0]), "supports": {"nodes": [0]}, "body": [DRUM],
            "solve": {"duration": 0.01}, **tables})  # fmt: skip
