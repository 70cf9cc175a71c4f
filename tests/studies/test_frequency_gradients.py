"""Gradients of natural frequencies: closed forms, Taylor remainders, forward solutions, equal ones, ± that covers."""

import json
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
import tomli_w
from statics.test_gradients import EFFECTS, LINES, LOAD, check_slopes, net

import refweb
from refweb.__main__ import main
from refweb.errors import InputError
from refweb.reference.paths import with_value
from refweb.results.state import State
from refweb.statics.gradients import BY_LINE
from refweb.studies.frequency_gradients import FrequencyGradients
from refweb.studies.turning import coriolis

EA, STRAIN, SPAN, ELEMENTS, DENSITY, AREA = 1000.0, 1e-2, 2.0, 4, 300.0, 1e-4
TENSION = EA * STRAIN


def modes(scene, number=4):
    return refweb.modes(scene, number, progress=False)


def within(gradient, exact, relative=1e-9):
    """The derivative is the exact one within ± and roundings of the closed form, and ± is small."""
    assert gradient.left is None
    assert abs(float(gradient) - exact) <= gradient.error[0] + 1e-12 * abs(exact)
    assert gradient.error[0] <= relative * abs(exact)


# Closed forms


def string(**keys):
    """A string of elements between supports."""
    given = dict(law="tension-only", modulus=EA / AREA, area=AREA, density=DENSITY, prestrain=STRAIN)
    scene = refweb.Scene(
        web=refweb.SingleCable(start=(0, 0, 0), end=(SPAN, 0, 0), elements=ELEMENTS),
        cable=refweb.Cable(**given),
        solve=refweb.Static(),
        accuracy=refweb.Accuracy(error="none"),
    )
    return scene.replace(**keys)


@pytest.mark.parametrize("mass", ["lumped", "consistent"])
def test_a_string(mass):
    """f² ~ T/(m a), T = EA (ℓ/L − 1), the mass m = ρ A L/n, the distance a = ℓ/n: twofold, along y and z."""
    found = modes(string(solve=refweb.Static(mass=mass)))
    f = found.frequency[0]
    for result in ("frequency_1", "frequency_2"):
        within(found.gradient(result, "cable.density"), -0.5 * f / DENSITY)
        within(found.gradient(result, "cable.prestrain"), 0.5 * f * (1.0 / STRAIN + 1.0 / (1.0 + STRAIN)))
        by_area = found.gradient(result, "cable.area")  # of tension and mass alike
        assert abs(float(by_area)) <= by_area.error[0] + 1e-12 * f / AREA
        assert by_area.equal == ("frequency_1", "frequency_2")
        natural, every = SPAN / (1.0 + STRAIN), found.gradient(result, "natural_length", "line")
        exact = 0.5 * f * (-EA * SPAN / natural**2 / TENSION - 1.0 / natural)
        np.testing.assert_allclose(every.value.sum(), ELEMENTS * exact, rtol=1e-9)  # of all lines in the row
        by_end = found.gradient(result, "position").value
        exact = 0.5 * f * (EA / natural / TENSION - 1.0 / SPAN)
        np.testing.assert_allclose(by_end[[0, ELEMENTS]], [[-exact, 0, 0], [exact, 0, 0]], rtol=1e-9, atol=1e-9 * exact)
    third = found.gradient("frequency_3", "cable.density")
    within(third, -0.5 * found.frequency[2] / DENSITY)


def test_a_string_that_a_force_pulls():
    """T = F, a = a₀ (1 + T/EA): the tension by a load, through the equilibrium."""
    scene = string(
        supports=refweb.Supports(nodes=[0]),
        support=[refweb.Supports(nodes=ELEMENTS, components=("y", "z"))],
        effects=[refweb.Load(node=ELEMENTS, force=(TENSION, 0.0, 0.0))],
        cable=refweb.Cable(law="tension-only", modulus=EA / AREA, area=AREA, density=DENSITY),
    )
    found = modes(scene)
    f = found.frequency[0]
    within(found.gradient("frequency_1", "load.0.force.0"), 0.5 * f * (1.0 / TENSION - 1.0 / (EA + TENSION)))
    within(found.gradient("frequency_1", "cable.modulus"), 0.5 * f * AREA * TENSION / EA / (EA + TENSION))


def test_two_masses_on_springs():
    """K = [[k₁ + k₂, −k₂], [−k₂, k₂ + k₃]]: dω²/dk of each spring by the shapes of the two by two matrix."""
    modulus, mass, areas = 1e6, 0.5, np.array([1e-4, 2e-4, 3e-4])
    web = refweb.Inline(
        points=[[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]], lines=[[0, 1], [1, 2], [2, 3]], supports=[0, 3],
        groups={"b": [1], "c": [2]},
    )  # fmt: skip
    cable = refweb.Cable(
        law="linear", modulus=modulus, area=areas[0], density=0.0, groups={"b": dict(area=2e-4), "c": dict(area=3e-4)}
    )
    masses = [refweb.PointMass(node=1, mass=mass), refweb.PointMass(node=2, mass=2.0 * mass)]
    found = modes(refweb.Scene(web=web, cable=cable, effects=masses, solve=refweb.Static()), 2)
    a, b, c = k = modulus * areas
    M = np.diag([mass, 2.0 * mass])
    squared, shapes = scipy.linalg.eigh([[a + b, -b], [-b, b + c]], M)
    for n in range(2):
        u, v = shapes[:, n]
        scale = 1.0 / (4.0 * np.pi * np.sqrt(squared[n]))
        by_line = found.gradient(f"frequency_{n + 1}", "cable.modulus", "line")
        np.testing.assert_allclose(by_line.value, scale * areas * [u**2, (u - v) ** 2, v**2], rtol=1e-10)
        within(found.gradient(f"frequency_{n + 1}", "point_mass.1.mass"), -scale * squared[n] * v**2)
    assert k.sum() > 0.0


def arm(speed, hub=0.5, length=1.0, axial=200.0, mass=0.3):
    """(Square of the circular frequencies of a mass on a line at a hub that turns: along z, and in its plane)."""
    stretched = length * (1.0 + mass * speed**2 * hub / axial) / (1.0 - length * mass * speed**2 / axial)
    radial = axial / length - mass * speed**2
    around = mass * speed**2 * hub / stretched
    half = 0.5 * (mass * (radial + around) + 4.0 * mass**2 * speed**2) / mass**2
    root = np.sqrt(half**2 - radial * around / mass**2)
    return np.array([speed**2 * (hub + stretched) / stretched, half - root, half + root])


def test_a_spinning_arm():
    """A mass on a massless line at a hub: it flaps across the plane, and in the plane Coriolis forces act."""
    given = dict(speed=4.0, hub=0.5, length=1.0, axial=200.0, mass=0.3)
    scene = refweb.Scene(
        web=refweb.Inline(points=[[0.5, 0, 0], [1.5, 0, 0]], lines=[[0, 1]], supports=[0]),
        cable=refweb.Cable(law="tension-only", modulus=2e6, area=1e-4, density=0.0),
        effects=[refweb.PointMass(node=1, mass=0.3), refweb.Frame(angular_velocity=(0.0, 0.0, 4.0))],
        solve=refweb.Static(),
    )
    found = modes(scene, 3)
    order = np.argsort(arm(**given))
    np.testing.assert_allclose(found.frequency, np.sqrt(np.sort(arm(**given))) / (2.0 * np.pi), rtol=1e-9)
    paths = {"speed": ("frame.angular_velocity.2", 1.0), "mass": ("point_mass.0.mass", 1.0)}
    for name, (path, factor) in {**paths, "axial": ("cable.modulus", 1e-4)}.items():
        turned = arm(**{**given, name: given[name] + 1e-30j})  # exact to rounding
        exact = factor * (np.sqrt(turned).imag / 1e-30 / (2.0 * np.pi))[order]
        for n, value in enumerate(exact):
            gradient = found.gradient(f"frequency_{n + 1}", path)
            assert abs(float(gradient) - value) <= gradient.error[0] + 1e-11 * np.abs(exact).max()


# Frequencies that are equal


def cross(speed=None, **keys):
    """A mass on four lines along the axes, with a group along y."""
    points = [[-1, 0, 0], [0, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0]]
    web = refweb.Inline(
        points=points, lines=[[0, 1], [1, 2], [3, 1], [1, 4]], supports=[0, 2, 3, 4], groups=["x", "x", "y", "y"]
    )
    groups = {"y": dict(area=1e-4)}
    cable = refweb.Cable(law="linear", modulus=1e6, area=1e-4, density=0.0, prestrain=STRAIN, groups=groups, **keys)
    turning = [] if speed is None else [refweb.Frame(angular_velocity=(0.0, 0.0, speed))]
    effects = [refweb.PointMass(node=1, mass=2.0), *turning]
    return refweb.Scene(web=web, cable=cable, effects=effects, solve=refweb.Static())


def test_a_mass_on_crossing_strings():
    """k = 2 EA/L + 2 T/a along x and y: the area of the strings along y changes each by another part of it.

    The lower frequency takes the smaller derivative of a number that rises, and the larger of one that falls; the mass
    changes both alike.
    """
    found = modes(cross(), 3)
    scale = 1.0 / (8.0 * np.pi**2 * found.frequency[1] * 2.0)
    along_y, along_x = scale * 2.0 * 1e6 * (1.0 + STRAIN), scale * 2.0 * 1e6 * STRAIN
    for path, by in (("cable.groups.y.area", None), ("cable.area", "group")):
        lower, upper = (found.gradient(f"frequency_{n}", path, by) for n in (2, 3))
        at = lower.names.index("y" if by else "")
        np.testing.assert_allclose([lower.value[at], upper.value[at]], [along_x, along_y], rtol=1e-9)
        np.testing.assert_allclose([lower.left[at], upper.left[at]], [along_y, along_x], rtol=1e-9)
        assert lower.equal == upper.equal == ("frequency_2", "frequency_3")
    for n in (2, 3):
        within(found.gradient(f"frequency_{n}", "point_mass.0.mass"), -0.25 * found.frequency[1])
    assert found.gradient("frequency_1", "cable.area").equal == ()
    given = found.scene.to_dict()
    for step in (1e-3, -1e-3):
        split = modes(refweb.Scene.from_dict(with_value(given, "cable.groups.y.area", 1e-4 * (1.0 + step))), 3)
        side = along_x if step > 0.0 else along_y
        change = split.frequency[1] - found.frequency[1]
        assert change == pytest.approx(1e-4 * step * side, rel=2e-3)  # by a step of 1e-3 of a root


@pytest.mark.parametrize("speed", [0.0, 3.0, 12.0])
def test_a_mass_on_crossing_strings_that_turn(speed):
    """Seen from axes that turn, frequencies are √(k/m) ± Ω; at 12 rad/s Coriolis forces alone hold the mass.

    At rest both are equal, and Ω parts them to both sides.
    """
    found = modes(cross(speed), 3)
    fast = 2.0 * np.pi * modes(cross(), 3).frequency[2]
    by_speed = {"frequency_3": 1.0, "frequency_2": 1.0 if speed > fast else -1.0}
    for name, sign in by_speed.items():
        gradient = found.gradient(name, "frame.angular_velocity.2")
        np.testing.assert_allclose(gradient.value, sign / (2.0 * np.pi), rtol=1e-9)
        if speed == 0.0:
            np.testing.assert_allclose(gradient.left, -sign / (2.0 * np.pi), rtol=1e-9)
        else:
            assert gradient.left is None
        shift = -1.0 if speed > fast and name != "frequency_3" else 1.0
        np.testing.assert_allclose(
            found.gradient(name, "point_mass.0.mass").value, -shift * fast / 4.0 / (2.0 * np.pi), rtol=1e-9
        )


def test_any_mixture_of_shapes_has_the_same_derivatives():
    """Shapes of equal frequencies that a unitary matrix mixes, whose products are complex."""
    found = modes(cross(0.0), 3)
    (c, s), spectrum = np.array([0.6, 0.8]), found.spectra[-1]
    mixed = spectrum.shapes.astype(complex)
    mixed[1:] = np.einsum("ij,jrk->irk", [[c, s * np.exp(0.7j)], [-s * np.exp(-0.7j), c]], mixed[1:])
    by_mixture = FrequencyGradients(found)
    by_mixture._spectrum = replace(spectrum, shapes=mixed.real, later=-mixed.imag)
    by_mixture._groups = {2: (1, 3), 3: (1, 3)}  # so that the shapes are not computed again
    for name in ("frequency_2", "frequency_3"):
        for path in ("cable.groups.y.area", "frame.angular_velocity.2"):
            exact, gradient = found.gradient(name, path), by_mixture.gradient(name, path)
            np.testing.assert_allclose(gradient.value, exact.value, rtol=1e-9)
            np.testing.assert_allclose(gradient.left, exact.left, rtol=1e-9)


# Taylor remainders, forward solutions, ±


def remainders(scene, path, numbers=(1, 3), steps=(4e-3, 2e-3)):
    """|f(p + h) − f(p) − h df/dp| of frequencies over f, for steps over the size of a number."""
    found, given = modes(scene, 5), scene.to_dict()
    gradients = {n: found.gradient(f"frequency_{n}", path) for n in numbers}
    number, left = gradients[numbers[0]].number, {n: [] for n in numbers}
    for step in steps:
        h = step * (abs(number) or 1.0)
        there = modes(refweb.Scene.from_dict(with_value(given, path, number + h)), 5).frequency
        for n, gradient in gradients.items():
            before = found.frequency[n - 1]
            assert not gradient.equal
            left[n].append(abs(there[n - 1] - before - h * float(gradient)) / abs(before))
    return left


WEIGHT = refweb.Gravity(acceleration=(0.0, 0.0, -9.81))


@pytest.mark.ordinary("table")
@pytest.mark.parametrize("law", ["tension-only", "smooth", "table", "elastic-plastic", "linear"])
def test_taylor_of_laws(law):
    for path in ("cable.groups.tie.area", "cable.density", "cable.prestrain", "load.0.force.2"):
        check_slopes(remainders(net(law, (LOAD, WEIGHT)), path))


EVERY = {name: value for name, value in EFFECTS.items() if name != "pressure"}  # which has no potential


@pytest.mark.ordinary("frame", "contact", "bending")
@pytest.mark.parametrize("name", EVERY)
def test_taylor_of_effects(name):
    effects, path = EVERY[name]
    for other in (path, "cable.area"):
        check_slopes(remainders(net(effects=(LOAD, *effects)), other))


def test_bodies():
    """A platform on ropes: by its mass and place, by moduli of ropes as numbers of the scene and of each line."""
    scene = refweb.Scene.load("platform-on-ropes")
    check_slopes(remainders(scene, "body.0.position.0"))
    found = modes(scene, 6)
    for n in (1, 5):
        by_line, whole = (found.gradient(f"frequency_{n}", "cable.modulus", by) for by in ("line", None))
        margin = by_line.error.sum() + whole.error[0] + 1e-10 * abs(float(whole))
        assert abs(by_line.value.sum() - float(whole)) <= margin
    with pytest.raises(InputError, match=r"mass beside \[\[attach\]\] is not taken"):
        found.gradient("frequency_1", "cable.density", "line")
    with pytest.raises(InputError, match="no position of supports beside bodies that turn"):
        found.gradient("frequency_1", "position")


@pytest.mark.slow
def test_a_scene_of_dynamics():
    """About its equilibrium at the start, by a load and a modulus, with a thread whose friction is 0."""
    thread = refweb.Thread(
        name="rope", nodes=[0, 2, 1], modulus=1e7, area=1e-5, density=0.0, prestrain=0.01, friction=0.0
    )
    scene = refweb.Scene(
        web=refweb.Inline(
            points=[[0, 0, 0], [1, 0, 0], [0.4, 0, -0.6], [0.4, 0.5, -1.2]], lines=[[2, 3]], supports=[0, 1, 3]
        ),
        cable=refweb.Cable(law="tension-only", modulus=1e6, area=1e-5, density=0.0, prestrain=0.02),
        effects=[thread, refweb.Load(node=2, force=(0.5, 0.0, -3.0)), refweb.PointMass(node=2, mass=0.3)],
        solve=refweb.Dynamic(duration=1.0),
    )
    for path in ("load.0.force.0", "thread.0.modulus", "cable.area"):
        check_slopes(remainders(scene, path, (1, 2, 3)))


@pytest.mark.ordinary("keys0-cable.area", "keys1-cable.modulus", "keys1-cable.density", "keys1-cable.prestrain")
@pytest.mark.parametrize("path", BY_LINE)
@pytest.mark.parametrize("keys", [dict(order=2), dict(solve=refweb.Static(mass="consistent"), order=2)])
def test_lines_together_are_the_number_of_all(path, keys):
    """The sum over lines is the derivative by the number of the cable, by systems that are built with others."""
    solve = keys.get("solve", refweb.Static())
    turning = [] if "solve" in keys else [refweb.Frame(angular_velocity=(0.0, 0.3, 1.5))]
    scene = net("smooth", (LOAD, WEIGHT, *turning), order=2, groups={}).replace(solve=solve)
    found = modes(scene, 3)
    for name in ("frequency_1", "frequency_2"):
        every = found.gradient(name, path, "line")
        if path == "natural_length":
            by_strain = found.gradient(name, "cable.prestrain", "line").value
            points = np.array(scene.web.points)
            length = np.linalg.norm(np.diff(points[np.array(LINES)], axis=1)[:, 0], axis=1) / 1.03
            np.testing.assert_allclose(every.value, -by_strain * 1.03 / length, rtol=1e-9)
            continue
        ((whole, error),) = FrequencyGradients(found)._by_number(name, path)
        assert abs(every.value.sum() - whole[0]) <= 3.0 * error[0] + every.error.sum()


@pytest.mark.parametrize("effects", [(LOAD,), (LOAD, *EFFECTS["frame"][0]), (LOAD, *EFFECTS["bending"][0])])
def test_adjoint_and_forward_solutions_agree(effects):
    """dx = K⁻¹ ∂f/∂F of a force on each node, and K at displacements beside the equilibrium along it."""
    found = modes(net("smooth", effects), 4)
    gradients = FrequencyGradients(found)
    linear, free = gradients.linear, gradients.linear.system.free
    system, t, x = linear.system, linear.t, linear.x
    stiffness = system.pattern.matrix(system.stiffness(t, x)).toarray()
    spectrum = found.spectra[-1]
    v = (spectrum.shapes[1] - 1j * (0.0 if spectrum.later is None else spectrum.later[1])).ravel()[free]
    forms = lambda matrix: np.vdot(v, matrix @ v).real  # noqa: E731
    omega = 2.0 * np.pi * found.frequency[1]
    turning, mass = coriolis(system, x), system.pattern.matrix(system.mass_at(x))
    slope = 2.0 * omega * forms(mass) - (0.0 if turning is None else forms(1j * turning))
    by_force = found.gradient("frequency_2", "force").value
    forward = np.zeros_like(by_force)
    for row, axis in np.argwhere(~system.supported[:7]):
        force = np.zeros_like(x)
        force[row, axis] = 1.0
        moved = system.rows_of(np.linalg.solve(stiffness, force.ravel()[free]))
        h = 2e-4 / np.abs(moved).max()
        by_step = [forms(system.pattern.matrix(system.stiffness(t, x + k * h * moved))) for k in (-2, -1, 1, 2)]
        change = (8.0 * (by_step[2] - by_step[1]) - (by_step[3] - by_step[0])) / (12.0 * h)
        wide = [forms(system.pattern.matrix(system.stiffness(t, x + k * h * moved))) for k in (-4, 4)]
        coarse = (8.0 * (by_step[3] - by_step[0]) - (wide[1] - wide[0])) / (24.0 * h)
        forward[row, axis] = (16.0 * change - coarse) / 15.0 / slope / (2.0 * np.pi)
    np.testing.assert_allclose(by_force, forward, rtol=1e-10, atol=1e-10 * np.abs(forward).max())


@pytest.mark.parametrize("effects", [(LOAD,), (LOAD, *EFFECTS["frame"][0])])
def test_errors_cover_what_an_error_of_the_equilibrium_changes(effects):
    """Gradients at displacements and shapes that are off: 97 of 100 are within ± of those of the equilibrium."""
    found, inside, rng = modes(net("smooth", effects), 4), [], np.random.default_rng(0)
    exact, spectrum = FrequencyGradients(found), found.spectra[-1]
    for size in (1e-10, 1e-8, 1e-6):
        x = found.state.x.copy()
        x.ravel()[found.state.system.free] += size * rng.standard_normal(len(found.state.system.free))
        off = FrequencyGradients(found)
        off.state = State(off.state.system, found.state.time, x)
        shapes = spectrum.shapes + size * np.where(off.state.system.supported, 0.0, rng.standard_normal(x.shape))
        off._spectrum = replace(spectrum, shapes=shapes)
        for name in ("frequency_1", "frequency_3"):
            for path in ("cable.area", "natural_length"):
                true, moved = (g.gradient(name, path, "line") for g in (exact, off))
                inside += (np.abs(moved.value - true.value) <= moved.error + true.error).tolist()
                assert np.abs(moved.error).max() < 1e4 * size * np.abs(true.value).max()
    assert np.mean(inside) >= 0.97


# Texts


def test_refusals():
    found = modes(net(), 3)
    for result, words in (
        ("frequency", 'result "frequency" is none of these modes, did you mean "frequency_'),
        ("frequency_99", "there are 9 modes"),
    ):
        with pytest.raises(InputError, match=words):
            found.gradient(result, "cable.area")
    assert found.gradient("tension", "cable.area").unit == "N per m²"
    assert found.gradient("frequency_9", "cable.area").unit == "Hz per m²"  # more than were computed
    with pytest.raises(InputError, match="frequencies are results of refweb.modes"):
        refweb.run(net(), progress=False).gradient("frequency_1", "cable.area")
    slack = cross().replace(cable=refweb.Cable(law="tension-only", modulus=1e6, area=1e-4, density=0.0))
    with pytest.raises(InputError, match="is neither slack nor taut, where the result has a kink"):
        modes(slack, 1).gradient("frequency_1", "cable.area")
    driven = cross(8.0)
    groups = {"y": dict(area=2e-5)}
    driven = driven.replace(
        cable=refweb.Cable(law="linear", modulus=1e6, area=1e-4, density=0.0, prestrain=STRAIN, groups=groups)
    )
    found = modes(driven, 3)
    assert found.frequency[0] < 0.0
    with pytest.raises(InputError, match="a mode that grows in axes that turn"):
        found.gradient("frequency_1", "cable.area")


def test_command(tmp_path, capsys):
    """The table of frequencies that are equal says so; by line as JSON; a scene of dynamics."""
    path = tmp_path / "cross.toml"
    path.write_text(tomli_w.dumps(cross().to_dict()), encoding="utf-8")
    assert main(["gradient", str(path), "--of", "frequency_2", "--path", "cable.groups.y.area"]) in (0, None)
    out = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert "where it falls" in out and "frequency_2, frequency_3 are equal within ±" in out
    assert main(["gradient", str(path), "--of", "frequency_1", "--by", "line", "--json"]) in (0, None)
    out = capsys.readouterr().out
    (entry,) = json.loads(out[out.index("[") :])
    assert entry["unit"] == "Hz per m²" and entry["equal"] == []
    path.write_text(tomli_w.dumps(cross().replace(solve=refweb.Dynamic(duration=1.0)).to_dict()), encoding="utf-8")
    assert main(["gradient", str(path), "--of", "frequency_1"]) in (0, None)
    assert "point_mass.0.mass" in capsys.readouterr().out
    assert main(["gradient", str(path), "--of", "frequencies"]) == 2
