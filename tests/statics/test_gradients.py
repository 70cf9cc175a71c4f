"""Gradients of statics: closed forms, Taylor remainders, forward solutions, ± that covers, kinks and refusals."""

import json

import numpy as np
import pytest

import refweb
from refweb.__main__ import main
from refweb.errors import InputError
from refweb.reference.paths import with_value
from refweb.results.state import State
from refweb.statics.gradients import BY_LINE, Gradients
from refweb.system.factorization import Factor

POINTS = [[0, 0, 0], [2, 0, 0.1], [2, 2, 0], [0, 2, 0.2], [0.7, 0.8, 0.1], [1.3, 0.9, -0.1], [1.1, 1.4, 0.1]]
LINES = [[0, 4], [1, 5], [2, 6], [3, 4], [4, 5], [5, 6], [4, 6], [1, 6], [3, 6]]
OBSERVE = [
    refweb.Observe(name="tension", quantity="tension", line=4),
    refweb.Observe(name="stress", quantity="stress", line=1),
    refweb.Observe(name="strain", quantity="strain", line=0),
    refweb.Observe(name="moved", quantity="displacement", node=5),
    refweb.Observe(name="height", quantity="position", node=6, component="z"),
    refweb.Observe(name="reaction", quantity="reaction", node=[0, 3]),
    refweb.Observe(name="apart", quantity="distance", node=[4, 6]),
    refweb.Observe(name="stored", quantity="strain_energy"),
    refweb.Observe(name="total", quantity="total_energy"),
]
LOAD = refweb.Load(node=[4, 5], force=(1.0, 0.5, -4.0))
CURVE = [(0.0, 0.0), (0.02, 4e4), (0.05, 2e5), (0.2, 1.2e6)]
LAWS = {
    "tension-only": {},
    "smooth": dict(slackness=1e-3, smoothing=2e-3),
    "linear": {},
    "elastic-plastic": dict(yield_stress=1e9),
    "table": dict(modulus=None, stress=CURVE),
}


def net(law="tension-only", effects=(LOAD,), **keys):
    """A net of nine lines in space, all in tension, with a group of other modulus and area."""
    web = refweb.Inline(points=POINTS, lines=LINES, supports=[0, 1, 2, 3], groups={"tie": [4, 5, 6]})
    group = {} if law == "table" else dict(modulus=4e6)
    given = dict(modulus=8e6, area=1e-5, density=500.0, prestrain=0.03, groups={"tie": dict(area=2e-5, **group)})
    return refweb.Scene(
        web=web,
        cable=refweb.Cable(**{**given, "law": law, **LAWS[law], **keys}),
        effects=effects,
        observe=keys.pop("observe", OBSERVE),
        solve=refweb.Static(),
        accuracy=refweb.Accuracy(error="none"),
    )


def remainders(scene, path, names, steps=(0.02, 0.01)):
    """|J(p + h) − J(p) − h dJ/dp| of results over the size of J, for steps over the size of a number."""
    solution, given = refweb.run(scene), scene.to_dict()
    gradients = {name: solution.gradient(name, path) for name in names}
    number = gradients[names[0]].number
    size, left = abs(number) or 1.0, {name: [] for name in names}
    for step in steps:
        there = refweb.run(refweb.Scene.from_dict(with_value(given, path, number + step * size))).results
        for name, gradient in gradients.items():
            before = solution.results[name].value
            change = there[name].value - before - step * size * float(gradient)
            left[name].append(abs(change) / abs(before))
    return left


def check_slopes(left):
    """Remainders fall with the square of the step, at least, or are below a part of a first order of 1e-5."""
    for name, (wide, narrow) in left.items():
        assert max(wide, narrow) < 1e-7 or np.log2(wide / narrow) > 1.8, (name, wide, narrow)


NAMES = [o.name for o in OBSERVE]


@pytest.mark.ordinary("tension-only", "linear")
@pytest.mark.parametrize("law", LAWS)
def test_taylor_of_laws(law):
    """Of every result by modulus, area, density, prestrain and a load; a table has no modulus."""
    weight = refweb.Gravity(acceleration=(0.0, 0.0, -9.81))
    paths = ["cable.groups.tie.area", "cable.density", "cable.prestrain", "load.0.force.2"]
    for path in [*paths, *(["cable.modulus"] if law != "table" else [])]:
        check_slopes(remainders(net(law, (LOAD, weight)), path, NAMES))


YIELDS = dict(yield_stress=1e5, hardening=2e6)


@pytest.mark.slow
def test_taylor_of_lines_that_yield():
    """Some of them beyond their yield stress: by yield stress, hardening, modulus, area by group, and a load."""
    scene = net("elastic-plastic", **YIELDS)
    assert 0 < np.count_nonzero(refweb.run(scene).state.plastic_strain) < len(LINES)
    names = [name for name in NAMES if name != "stored"]
    for path in ("cable.yield_stress", "cable.hardening", "cable.modulus", "cable.groups.tie.area", "load.0.force.2"):
        check_slopes(remainders(scene, path, names))
    solution = refweb.run(scene)
    by_group = solution.gradient("tension", "cable.area", "group")
    tie = solution.gradient("tension", "cable.groups.tie.area")
    assert abs(by_group.value[by_group.names.index("tie")] - float(tie)) <= by_group.error.sum() + 3.0 * tie.error[0]


def two_that_yield(*effects, observe=(), **keys):
    """Two lines from supports to a loaded node between, both far beyond their yield stress."""
    web = refweb.Inline(points=[[0, 0, 0], [1, 0.1, 0], [2, 0, 0]], lines=[[0, 1], [1, 2]], supports=[0, 2])
    cable = refweb.Cable(
        law="elastic-plastic", modulus=7e7, area=1e-4, density=200.0, yield_stress=3e5, hardening=7e6, **keys
    )
    return refweb.Scene(
        web=web, cable=cable, effects=[refweb.Load(node=1, force=(1.0, 30.0, 20.0)), *effects],
        observe=[refweb.Observe(name="T", quantity="tension", line=0), *observe], solve=refweb.Static(),
        accuracy=refweb.Accuracy(error="none"),
    )  # fmt: skip


YIELD_BESIDE = {
    "temperature": ([refweb.Temperature(expansion=1e-5, change=-300.0)], "temperature.change"),
    "reel": ([refweb.Reel(lines=0, factor=[(0.0, 1.0), (1.0, 0.99)])], "reel.0.factor.1.1"),
    "contact": (
        [
            refweb.Body(name="b", shape="sphere", radius=0.2, fixed=True, position=(0.5, 0.2, 0.25)),
            refweb.Contact(stiffness=1e5),
        ],
        "body.0.radius",
    ),
    "attach": (
        [
            refweb.Body(name="b", shape="sphere", radius=0.1, mass=1.0, position=(1.0, 0.1, -0.1)),
            refweb.Attach(body="b", node=1),
            refweb.Gravity(acceleration=(0.0, 0.0, -1.0)),
        ],
        "body.0.mass",
    ),
}


@pytest.mark.ordinary("reel", "contact", "attach")
@pytest.mark.parametrize("name", YIELD_BESIDE)
def test_lines_that_yield_beside_other_effects(name):
    """Natural lengths that change, contact and bodies that carry nodes, with the curve in place of yield."""
    effects, path = YIELD_BESIDE[name]
    for one in (path, "cable.yield_stress"):
        check_slopes(remainders(two_that_yield(*effects), one, ["T"], (0.004, 0.002)))


def test_total_energy_of_lines_that_yield_by_their_lengths():
    """One line under a dead load F: L (F²/2EA + ∫ Y dp), Y = 30 N + 700 N p up to F; and by runs of two lines."""
    web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0])
    cable = refweb.Cable(law="elastic-plastic", modulus=7e7, area=1e-4, density=0.0, yield_stress=3e5, hardening=7e6)
    observe = [refweb.Observe(name="total", quantity="total_energy")]
    load = refweb.Load(node=1, force=(50.0, 0.0, 0.0))
    one = refweb.run(refweb.Scene(web=web, cable=cable, effects=[load], observe=observe, solve=refweb.Static()))
    exact = 0.5 * 50.0**2 / 7e3 + 0.5 * (30.0 + 50.0) * 20.0 / 700.0
    assert one.results["total"].value == pytest.approx(exact, rel=1e-9)
    np.testing.assert_allclose(one.gradient("total", "natural_length", "line").value, [exact], rtol=1e-9)
    np.testing.assert_allclose(one.gradient("total", "cable.prestrain").value, [-exact], rtol=1e-9)
    check_slopes(remainders(two_that_yield(observe=observe, prestrain=0.01), "cable.prestrain", ["total"]))
    wound = refweb.run(two_that_yield(*YIELD_BESIDE["reel"][0], observe=observe))
    with pytest.raises(InputError, match="beside .*reel.* the energy depends on the path"):
        wound.gradient("total", "cable.area")


def test_load_steps():
    """By the last load step loads grow with it, F·dT/dF; where a table has a corner there, it has no derivative."""
    solution = refweb.run(net())
    for name in ("tension", "moved"):
        by_force = solution.gradient(name, "force").value
        found = solution.gradient(name, "solve.load_steps.0")
        np.testing.assert_allclose(found.value, (by_force[[4, 5]] @ LOAD.force).sum(), rtol=1e-8)
    with pytest.raises(InputError, match="a table of a load or motion has a corner near t = 1"):
        refweb.run(net(effects=(LOAD, *EFFECTS["reel"][0]))).gradient("tension", "solve.load_steps.0")


EFFECTS = {
    "frame": ([refweb.Frame(angular_velocity=(0.0, 0.2, 1.5))], "frame.angular_velocity.2"),
    "orbit": ([refweb.Orbit(mean_motion=2.0)], "orbit.mean_motion"),
    "motion": (
        [refweb.Motion(node=0, displacement=[(0, 0, 0, 0), (1, -0.02, 0.0, 0.05)])],
        "motion.0.displacement.1.3",
    ),
    "reel": ([refweb.Reel(lines=[0], factor=[(0, 1.0), (1, 0.98)])], "reel.0.factor.1.1"),
    "temperature": ([refweb.Temperature(expansion=1e-4, change=-50.0)], "temperature.change"),
    "pressure": ([refweb.Pressure(lines="all", normal=(0.0, 0.0, 1.0), value=0.3)], "pressure.0.value"),
    "contact": (
        [
            refweb.Body(name="ball", shape="sphere", radius=0.4, position=(1.0, 0.9, -0.45), fixed=True),
            refweb.Contact(stiffness=500.0),
        ],
        "contact.stiffness",
    ),
    "bending": ([refweb.Bending(stiffness=1e-3)], "bending.stiffness"),
}


@pytest.mark.ordinary("temperature", "pressure", "contact", "bending")
@pytest.mark.parametrize("name", EFFECTS)
def test_taylor_of_effects(name):
    effects, path = EFFECTS[name]
    for other in (path, "cable.area"):
        check_slopes(remainders(net(effects=(LOAD, *effects)), other, ["tension", "moved", "reaction", "stored"]))


def test_bodies_that_are_free():
    """A platform that hangs on ropes: by its mass, its place, and area and modulus of the ropes; by line as well."""
    scene = refweb.Scene.load("platform-on-ropes")
    names = ["height", "largest", "tilt"]
    for path in ("body.0.mass", "body.0.position.0", "gravity.acceleration.1", "cable.area"):
        check_slopes(remainders(scene, path, names))
    solution = refweb.run(scene)
    for name in names:
        by_line, whole = (solution.gradient(name, "cable.modulus", by) for by in ("line", None))
        assert abs(by_line.value.sum() - float(whole)) <= by_line.error.sum() + 3.0 * whole.error[0]
    with pytest.raises(InputError, match=r"mass beside \[\[attach\]\] is not taken"):
        solution.gradient("height", "cable.area", "line")


@pytest.mark.parametrize("point", [(0.0, 0.0, 0.0), (0.2, -0.1, 0.15)])
def test_a_body_on_an_axle(point):
    """A box on its axle, or off it, on two ropes and with a torque: by its torque and mass, and by the modulus."""
    axle = {"point": point, "direction": (0.3, 1.0, -0.2), "torque": [(0.0, 0.0), (1.0, 0.7)]}
    web = refweb.Inline(
        points=[[0.5, 0.3, 2.0], [-0.4, -0.2, 1.8], [0.3, 0.1, 0.05], [-0.25, -0.1, 0.1]],
        lines=[[0, 2], [1, 3]], supports=[0, 1],
    )  # fmt: skip
    observe = [
        refweb.Observe(name="angle", quantity="axle_angle", body="flap"),
        refweb.Observe(name="T", quantity="tension"),
        refweb.Observe(name="stored", quantity="strain_energy"),
    ]
    effects = [
        refweb.Gravity(acceleration=(0.0, 0.0, -9.81)),
        refweb.Body(name="flap", shape="box", size=(0.4, 0.3, 0.2), mass=2.0, position=(0.0, 0.0, 0.0), axle=axle),
        refweb.Attach(body="flap", node=[2, 3]),
    ]
    scene = refweb.Scene(
        web=web, cable=refweb.Cable(law="tension-only", modulus=1e6, area=1e-4, density=1000.0, prestrain=0.1),
        effects=effects, observe=observe, solve=refweb.Static(), accuracy=refweb.Accuracy(error="none"),
    )  # fmt: skip
    for path in ("body.0.axle.torque.1.1", "body.0.mass", "cable.modulus"):
        check_slopes(remainders(scene, path, ["angle", "T", "stored"]))


def test_a_ring_on_a_thread():
    """Its tension and its length, beside a line that pulls at the ring."""
    web = refweb.Inline(
        points=[[0, 0, 0], [1, 0, 0], [0.4, 0, -0.6], [0.4, 0.5, -1.2]], lines=[[2, 3]], supports=[0, 1, 3]
    )
    thread = refweb.Thread(name="rope", nodes=[0, 2, 1], modulus=1e7, area=1e-5, density=0.0, prestrain=0.01)
    observe = [refweb.Observe(name=name, quantity=name, thread="rope") for name in ("tension", "length")]
    cable = refweb.Cable(law="tension-only", modulus=1e6, area=1e-5, density=0.0, prestrain=0.02)
    load = refweb.Load(node=2, force=(0.5, 0.0, -3.0))
    ring = refweb.Scene(
        web=web, cable=cable, effects=[thread, load], observe=observe, solve=refweb.Static(),
        accuracy=refweb.Accuracy(error="none"),
    )  # fmt: skip
    for path in ("cable.area", "load.0.force.0", "thread.0.modulus"):
        check_slopes(remainders(ring, path, ["tension", "length"]))


def test_a_ball_that_lies_in_a_net():
    """Free, in contact with some lines: its height by its mass, by the modulus and by the stiffness of contact."""
    scene = refweb.Scene(
        web=refweb.Window(mesh="square", rows=3, columns=3, side=0.1),
        cable=refweb.Cable(law="tension-only", modulus=1e6, area=1e-6, density=500.0, prestrain=0.02),
        effects=[
            refweb.Gravity(acceleration=(0.0, 0.0, -9.81)),
            refweb.Body(name="ball", shape="sphere", radius=0.08, mass=0.05, position=(0.011, 0.007, 0.08)),
            refweb.Contact(stiffness=1e3),
        ],
        observe=[refweb.Observe(name="height", quantity="position", body="ball", component="z")],
        solve=refweb.Static(),
        accuracy=refweb.Accuracy(error="none"),
    )
    for path in ("body.0.mass", "cable.modulus", "contact.stiffness"):
        check_slopes(remainders(scene, path, ["height"], (0.004, 0.002)))


# Closed forms


def by_hand(law="tension-only", force=(0.0, 0.0, -5.0), **keys):
    """Two lines from supports to a node below, and one that hangs slack."""
    web = refweb.Inline(
        points=[[-1, 0, 0], [1, 0, 0], [0, 0, -0.5], [0, 0, -1.0]],
        lines=[[0, 2], [1, 2], [2, 3]],
        supports=[0, 1, 3],
        groups={"spare": [2]},
    )
    cable = dict(modulus=1e7, area=1e-5, density=0.0, groups={"spare": dict(prestrain=-0.5)})
    observe = [
        refweb.Observe(name="tension", quantity="tension"),
        refweb.Observe(name="stress", quantity="stress"),
        refweb.Observe(name="sag", quantity="position", node=2, component="z"),
        refweb.Observe(name="first", quantity="tension", line=0),
    ]
    return refweb.Scene(
        web=web, cable=refweb.Cable(law=law, **{**cable, **keys}), effects=[refweb.Load(node=2, force=force)],
        observe=observe, solve=refweb.Static(), accuracy=refweb.Accuracy(error="none"),
    )  # fmt: skip


def test_two_bars_in_closed_form():
    """2 EA (l/L − 1) s/l = F with l² = 1 + s²: derivatives of the sag s by EA, L and F, and of tension and stress."""
    solution = refweb.run(by_hand())
    axial, natural, sag, force = 100.0, np.sqrt(1.25), -solution.results["sag"].value, 5.0
    length, tension = np.hypot(1.0, sag), solution.results["tension"].value
    slope = 2.0 * axial * (1.0 / natural - 1.0 / length + sag**2 / length**3)  # dF/ds
    by_axial = -force / axial / slope
    by_natural = 2.0 * axial * sag / natural**2 / slope  # of both lines
    stretched = axial * sag / length / natural  # dT/ds
    exact = {
        ("sag", "cable.modulus"): -1e-5 * by_axial,
        ("sag", "cable.prestrain"): natural * by_natural,
        ("sag", "load.0.force.2"): 1.0 / slope,
        ("tension", "cable.area"): 1e7 * (tension / axial + stretched * by_axial),
        ("stress", "cable.area"): 1e12 * (tension / axial + stretched * by_axial) - tension / 1e-10,
        ("tension", "load.0.force.2"): -stretched / slope,
    }
    for (result, path), value in exact.items():
        gradient = solution.gradient(result, path)
        assert abs(float(gradient) - value) <= gradient.error[0] + 1e-12 * abs(value)
        assert gradient.error[0] < 1e-8 * abs(value) and gradient.left is None
    by_line = solution.gradient("sag", "natural_length", "line")
    np.testing.assert_allclose(by_line.value, [-0.5 * by_natural, -0.5 * by_natural, 0.0], rtol=1e-9)
    by_group = solution.gradient("sag", "natural_length", "group")
    assert dict(zip(by_group.names, by_group.value, strict=True))["spare"] == 0.0
    np.testing.assert_allclose(solution.gradient("sag", "force").value[2], [0.0, 0.0, 1.0 / slope], atol=1e-12)


def test_one_side_and_the_other():
    """Both lines have the largest tension: by a force to the side, and by the area of one, it has two derivatives."""
    solution = refweb.run(by_hand())
    for path, by, at in (("load.0.force.0", None, 0), ("cable.area", "line", 0), ("cable.area", "line", 1)):
        gradient = solution.gradient("tension", path, by)
        single = solution.gradient("first", path, by)
        assert gradient.left is not None and gradient.left[at] < gradient.value[at]
        assert min(abs(side[at] - single.value[at]) for side in (gradient.value, gradient.left)) < 1e-9 * np.abs(
            single.value[at]
        )
    for step in (1e-3, -1e-3):
        moved = refweb.run(by_hand(force=(step, 0.0, -5.0))).results["tension"].value
        sideways = solution.gradient("tension", "load.0.force.0")
        slope = sideways.value[0] if step > 0.0 else sideways.left[0]
        change = moved - solution.results["tension"].value
        np.testing.assert_allclose(change, step * slope, rtol=1e-3)


def test_all_lines_and_results_take_one_factorization(monkeypatch):
    """A gradient by each of 112 lines, and those of further results, as a solution takes a dozen."""
    scene = refweb.Scene(
        web=refweb.Window(mesh="square", rows=8, columns=8, side=0.25),
        cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-4, density=200.0, prestrain=0.01),
        effects=[refweb.Load(node="centre", force=(0.0, 0.0, 5.0))],
        solve=refweb.Static(),
    )
    count, update = [], Factor.update
    monkeypatch.setattr(Factor, "update", lambda *given: count.append(1) or update(*given))
    solution = refweb.run(scene, progress=False)
    assert len(count) > 3
    count.clear()
    for name in ("max_stress", "deflection"):
        for path in ("cable.area", "natural_length"):
            assert solution.gradient(name, path, "line").value.size == 112
    assert len(count) == 1


# Lines, nodes and supports, by forward solutions


@pytest.mark.parametrize("keys", [{}, dict(order=2, subdivide=2), dict(law="smooth")])
def test_adjoint_and_forward_solutions_agree(keys):
    """dx = K⁻¹ ∂f/∂p dp of each line by dense matrices, ∂f/∂p by the tension that is in proportion to EA."""
    solution = refweb.run(net(keys.pop("law", "tension-only"), **keys))
    gradients = Gradients(solution)
    linear, net_ = gradients.linear, gradients.linear.net
    system, free = linear.system, linear.system.free
    stiffness = system.pattern.matrix(system.stiffness(linear.t, linear.x)).toarray()
    for name, observed in (("height", 6), ("moved", 5)):
        gradient = solution.gradient(name, "cable.modulus", "line").value
        forward = []
        for line in range(len(LINES)):
            numbers = net_.line_data.copy()
            numbers.ea[net_.line != line] = 0.0
            alone = system.with_line_data(numbers)
            modulus = numbers.ea[net_.line == line][0] / net_.area[net_.line == line][0]
            force = alone.force_of(system.lines, linear.t, linear.x).ravel()[free] / modulus
            moved = system.rows_of(np.linalg.solve(stiffness, force))[observed]
            along = [0.0, 0.0, 1.0] if name == "height" else linear.x[observed] / np.linalg.norm(linear.x[observed])
            forward.append(moved @ along)
        np.testing.assert_allclose(gradient, forward, rtol=1e-10, atol=1e-10 * np.abs(forward).max())


def test_forces_on_nodes_and_positions_of_supports():
    """By runs with one more load, and a support that a motion takes along."""
    scene = net()
    solution = refweb.run(scene)
    for name in ("tension", "moved", "reaction"):
        forces, places = (solution.gradient(name, path) for path in ("force", "position"))
        value, step = solution.results[name].value, 1e-4
        direction = np.array([0.3, -0.2, 0.9])
        ends = []
        for sign in (-1.0, 1.0):
            more = refweb.Load(node=6, force=tuple(sign * step * direction))
            moved = refweb.Motion(node=1, displacement=[(0, 0, 0, 0), (1, *(sign * step * direction))])
            ends.append([refweb.run(net(effects=(LOAD, e))).results[name].value for e in (more, moved)])
        found = np.array([forces.value[6], places.value[1]]) @ direction
        np.testing.assert_allclose(found, (np.array(ends[1]) - ends[0]) / (2.0 * step), rtol=1e-6, atol=1e-6 * value)
    assert not solution.gradient("moved", "position").value[4:].any()


@pytest.mark.parametrize("quantity", ["distance", "mouth_perimeter", "mouth_area", "work"])
def test_what_forces_and_supports_change_beside_the_equilibrium(quantity):
    """Mouths and distances from a support that moves, and the work of one more load, by runs."""
    nodes = {"distance": [1, 5], "work": None}.get(quantity, [0, 1, 6])
    observe = [refweb.Observe(name="r", quantity=quantity, **({} if nodes is None else {"node": nodes}))]
    step, direction, ends = 1e-4, np.array([0.3, -0.2, 0.9]), []
    solution = refweb.run(net().replace(observe=observe))
    for sign in (-1.0, 1.0):
        move = sign * step * direction
        more = refweb.Load(node=6, force=tuple(move))
        if quantity != "work":
            more = refweb.Motion(node=1, displacement=[(0, 0, 0, 0), (1, *move)])
        ends.append(refweb.run(net(effects=(LOAD, more)).replace(observe=observe)).results["r"].value)
    path, node = ("force", 6) if quantity == "work" else ("position", 1)
    found = solution.gradient("r", path).value[node] @ direction
    np.testing.assert_allclose(found, (ends[1] - ends[0]) / (2.0 * step), rtol=1e-6)


@pytest.mark.parametrize("path", [*BY_LINE])
def test_lines_together_are_the_number_of_all(path):
    """The sum over lines is the derivative by the number of the cable, by systems that are built with others."""
    weight = refweb.Gravity(acceleration=(0.0, 1.0, -9.81))
    scene = net(effects=(LOAD, weight), order=2, groups={})
    solution = refweb.run(scene)
    for name in ("stress", "reaction", "total"):
        every = solution.gradient(name, path, "line")
        if path == "natural_length":
            by_strain = solution.gradient(name, "cable.prestrain", "line").value
            length = np.linalg.norm(np.diff(np.array(POINTS)[np.array(LINES)], axis=1)[:, 0], axis=1) / 1.03
            np.testing.assert_allclose(every.value, -by_strain * 1.03 / length, rtol=1e-9)
            continue
        whole = Gradients(solution)._by_number(name, path)
        assert abs(every.value.sum() - whole[0][0][0]) <= 3.0 * whole[0][1][0] + every.error.sum()


@pytest.mark.parametrize("law", ["tension-only", "smooth", "table"])
def test_errors_cover_what_an_error_of_the_equilibrium_changes(law):
    """Gradients at displacements that are off by 1e-9 to 1e-6 m: 97 of 100 are within ± of those of the equilibrium."""
    solution, inside = refweb.run(net(law)), []
    exact = Gradients(solution)
    state, rng = solution.state, np.random.default_rng(0)
    for size in (1e-9, 1e-7, 1e-6):
        x = state.x.copy()
        x.ravel()[state.system.free] += size * rng.standard_normal(len(state.system.free))
        off = Gradients(solution)
        off.state = State(off.state.system, state.time, x)
        for name in ("tension", "moved", "stored"):
            for path in ("cable.area", "natural_length"):
                true, found = (g.gradient(name, path, "line") for g in (exact, off))
                inside += (np.abs(found.value - true.value) <= found.error + true.error).tolist()
                assert np.abs(found.error).max() < 1e4 * size * np.abs(true.value).max() + 1e-9
    assert np.mean(inside) >= 0.97


def test_slack_parts():
    """What is slack does not count; where a node hangs loose, results of it have no gradient, others have."""
    web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0], [0.5, 0.5, 0]], lines=[[0, 1], [1, 2], [0, 2]], supports=[0])
    cable = refweb.Cable(law="tension-only", modulus=1e6, area=1e-5, density=0.0, groups={})
    observe = [
        refweb.Observe(name="T", quantity="tension"),
        refweb.Observe(name="loose", quantity="position", node=2, component="x"),
        refweb.Observe(name="end", quantity="position", node=1, component="x"),
    ]
    loose = refweb.Scene(
        web=web.replace(supports=[0]) if hasattr(web, "replace") else web, cable=cable, observe=observe,
        effects=[refweb.Load(node=1, force=(0.5, 0.0, 0.0)), refweb.Reel(lines=[1, 2], factor=[(0, 1.5), (1, 1.5)])],
        solve=refweb.Static(),
    )  # fmt: skip
    solution = refweb.run(loose)
    np.testing.assert_allclose(
        solution.gradient("end", "cable.area", "line").value, [-0.5 / 10.0 / 1e-5, 0, 0], rtol=1e-9
    )
    with pytest.raises(InputError, match='gradient of "loose": it depends on parts of the web that move without'):
        solution.gradient("loose", "cable.area", "line")


# Kinks and refusals


def test_a_line_between_yielding_and_not_is_named():
    """A load to the yield force of two lines in a row: where they begin to yield the end moves by another slope."""
    web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0])
    cable = refweb.Cable(law="elastic-plastic", modulus=1e6, area=1e-5, density=0.0, yield_stress=1e5, hardening=1e5)
    observe = [refweb.Observe(name="u", quantity="displacement", node=1, component="x")]
    for force, slope in ((0.9, 1.0 / 10.0), (1.0, None), (1.1, 1.0 / 10.0 + 1.0)):
        load = refweb.Load(node=1, force=(force, 0.0, 0.0))
        scene = refweb.Scene(web=web, cable=cable, effects=[load], observe=observe, solve=refweb.Static())
        solution = refweb.run(scene)
        if slope is None:
            with pytest.raises(InputError, match="line 0 is between yielding and not, where the result has a kink"):
                solution.gradient("u", "load.0.force.0")
        else:
            np.testing.assert_allclose(solution.gradient("u", "load.0.force.0").value, slope, rtol=1e-9)


def test_kinks_are_named():
    """A line that is neither slack nor taut; the size of a displacement that is 0; not where the result is another."""
    web = refweb.Inline(
        points=[[-1, 0, 0], [1, 0, 0], [0, 0, 0], [0, 1, 0]], lines=[[0, 2], [1, 2], [2, 3]], supports=[0, 1, 3]
    )
    cable = refweb.Cable(law="tension-only", modulus=1e6, area=1e-5, density=0.0, prestrain=0.01, groups={})
    observe = [
        refweb.Observe(name="T", quantity="tension", line=0),
        refweb.Observe(name="u", quantity="displacement", node=2),
        refweb.Observe(name="y", quantity="displacement", node=2, component="y"),
    ]
    reel = refweb.Reel(lines=[2], factor=[(0, 1.01), (1, 1.01)])  # to the length that it has
    scene = refweb.Scene(web=web, cable=cable, effects=[reel], observe=observe, solve=refweb.Static())
    solution = refweb.run(scene)
    with pytest.raises(InputError, match='gradient of "u": the size of a vector has a kink at 0: name a component'):
        solution.gradient("u", "cable.area")
    with pytest.raises(InputError, match='gradient of "y": line 2 is neither slack nor taut, where the result has a k'):
        solution.gradient("y", "cable.area")
    assert solution.gradient("T", "cable.area", "line").value[2] == 0.0


def test_refusals(tmp_path):
    solution = refweb.run(net())
    for arguments, words in (
        ((1, "cable.area"), "result = 1 must be the name of a result: tension, stress, "),
        (("tension", ["cable.area"]), r"path = \['cable.area'\] must be the path of a number: .*cable.area, "),
        (("tensoin", "cable.area"), 'result "tensoin" is none of this scene, did you mean "tension"'),
        (("tension", "cable.aera"), r'path "cable.aera" is no number of this scene, did you mean "cable.area"'),
        (("tension", "observe.97.node"), r'path "observe.97.node" is no number of this scene, observe has 0 … \d+$'),
        (("tension", "cable.knot_factor"), r"cable.knot_factor = 1 cannot be changed to both sides: .* must be ≤ 1"),
        (("tension", "cable.aera", "line"), r'by line there is no "cable.aera", did you mean "cable.area"'),
        (("tension", "cable.area", "node"), r"by node there is no"),
        (("tension", "cable.area", "lines"), 'by = "lines" must be "line", "group" or "node"'),
        (("tension", "natural_length"), 'natural_length is a number of each line: give by = "line" or "group"'),
        (("tension", "cable.subdivide"), "subdivide"),
    ):
        with pytest.raises(InputError, match=words):
            solution.gradient(*arguments)
    with pytest.raises(InputError, match="is not taken: name one number of the scene"):
        bent = refweb.run(net(effects=(LOAD, refweb.Bending(stiffness=1e-3))))
        bent.gradient("tension", "cable.area", "line")
    loads = [(0.0, 0.0), (1.0, 1.0), (2.0, 0.0)]
    back = net("elastic-plastic", [refweb.Load(node=5, force=(1.0, 0.5, -4.0), factor=loads)], **YIELDS)
    yields = refweb.run(back.replace(solve=refweb.Static(load_steps=[1.0, 2.0])))
    with pytest.raises(InputError, match="gradients take no line that has yielded and turned back"):
        yields.gradient("tension", "cable.area")
    share = refweb.run(net().replace(observe=[refweb.Observe(name="slack", quantity="slack_fraction")]))
    with pytest.raises(InputError, match='quantity = "slack_fraction" has no gradient'):
        share.gradient("slack", "cable.area")


def test_command(tmp_path, capsys):
    """The table of all numbers, by line as JSON, and a picture."""
    import tomli_w

    path = tmp_path / "net.toml"
    path.write_text(tomli_w.dumps(net().to_dict()), encoding="utf-8")
    assert main(["gradient", str(path), "--of", "tension"]) in (0, None)
    out = capsys.readouterr().out
    assert "cable.groups.tie.area" in out and "load.0.force.2" in out and "no effect" in out
    assert main(["gradient", str(path), "--of", "tension", "--path", "force"]) in (0, None)
    assert " 4 z " in capsys.readouterr().out
    assert main(["gradient", "hexagon-impact", "--by", "line"]) == 2
    assert 'by line or group, and their picture, need [solve] kind = "static"' in capsys.readouterr().err
    picture = tmp_path / "web.png"
    words = ["gradient", str(path), "--of", "tension", "--by", "line", "--picture", str(picture)]
    assert main(words) in (0, None) and picture.stat().st_size > 1000
    assert main(["gradient", str(path), "--by", "group", "--path", "cable.density", "--json"]) in (0, None)
    (entry,) = json.loads(capsys.readouterr().out.partition("\n[")[2].join(["[", ""]))
    assert entry["names"][0] == "tie" and entry["unit"] == "N per kg/m³"
