"""Where dynamics starts from: the web, its equilibrium, or the last state of another run."""

import json
import zipfile

import nets
import numpy as np
import pytest
import tomli_w
from scipy.integrate import solve_ivp

import refweb
from refweb.__main__ import main
from refweb.dynamics.initial_state import fields_of, record_of, stored

GRAVITY = refweb.Gravity(acceleration=(0.0, 0.0, -9.81))
PULL = (0.3, 0.0, -2.0)
CALM = refweb.Gravity(acceleration=(0.0, 0.0, 0.0))
PULLED = (GRAVITY, refweb.Load(node="centre", force=PULL))
NEAR = 1e-9
"""Of a deflection: Newton's method ends at a residual of 1e-10 of the load or below, which moves a taut web by as much
or, where it stiffens, less; a motion that the residual starts swings to twice that."""


def cable(**changes):
    given = dict(law="tension-only", modulus=7e7, area=1e-4, density=200.0)
    return refweb.Cable(**{**given, **changes})


def scene(start="web", effects=(), duration=0.02, solve=None, **changes):
    """A small square web that is pulled down at its centre."""
    given = dict(
        title="Started",
        web=refweb.Window(mesh="square", rows=4, columns=4, side=0.2),
        cable=cable(),
        effects=effects or PULLED,
        solve=solve or refweb.Dynamic(duration=duration, start=str(start)),
        accuracy=None if solve else refweb.Accuracy(error="none"),
        output=refweb.Output() if solve else refweb.Output(interval=1e-3, frames=1),
    )
    return refweb.Scene(**{**given, **changes})


def static(effects, t=1.0, **changes):
    """Displacement of the web's nodes in the equilibrium of a static scene at a load step."""
    return refweb.run(scene(effects=effects, solve=refweb.Static(load_steps=[t]), **changes)).displacement


def first(solution):
    """(displacement, velocity) of the nodes in the first frame."""
    state = solution.frames[0][1]
    assert state.time == 0.0
    return state.x[: state.system.net.nodes], state.v[: state.system.net.nodes]


def ball(**changes):
    given = dict(name="ball", radius=0.1, mass=1.0, position=(0.03, 0.02, -0.115), velocity=(0.0, 0.0, 2.0))
    return refweb.Body(**{**given, **changes})


CONTACT = refweb.Contact(stiffness=1e5)


# Equilibrium


@pytest.mark.parametrize("subdivide", [1, 2])
def test_equilibrium_stays_where_it_is(subdivide):
    """It is a fixed point of the integrator for some hundred steps, in which a start from the web swings about it."""
    divided = cable(subdivide=subdivide)
    still, moving = (refweb.run(scene(start, cable=divided)) for start in ("equilibrium", "web"))
    x, v = first(still)
    assert not v.any() and still.warnings == [] and still.solver["nsteps"] > 100
    deflection, speed = np.abs(x).max(), np.abs(moving.frames[-1][1].v).max()
    for _, state in still.frames:
        np.testing.assert_allclose(state.x, x, rtol=0, atol=NEAR * deflection)
        np.testing.assert_allclose(state.v, 0.0, rtol=0, atol=NEAR * speed)
    assert max(np.abs(state.x - x).max() for _, state in moving.frames) > 0.5 * deflection
    np.testing.assert_allclose(x, static(still.scene.effects, cable=divided), rtol=0, atol=NEAR * deflection)
    np.testing.assert_allclose(still.history["total_energy"], still.history["total_energy"][0], rtol=NEAR)
    assert np.abs(still.history["work"]).max() <= NEAR * np.abs(still.history["strain_energy"]).max()


def test_equilibrium_is_that_of_the_loads_at_the_start():
    """A table's value at t = 0, and in full where there is none; what the table says later moves the web."""
    table = refweb.Load(node="centre", force=PULL, factor=[(-1.0, 0.0), (0.0, 0.4), (0.01, 3.0)])
    full = refweb.Load(node=3, force=(0.0, 0.5, 0.5))
    solution = refweb.run(scene("equilibrium", effects=(GRAVITY, table, full)))
    share = refweb.Load(node="centre", force=0.4 * np.array(PULL))
    expected = static((GRAVITY, share, full))
    np.testing.assert_allclose(first(solution)[0], expected, rtol=0, atol=NEAR * np.abs(expected).max())
    assert np.abs(solution.displacement - expected).max() > 0.05 * np.abs(expected).max()


def test_equilibrium_has_the_motion_of_the_start():
    """Nodes that are elsewhere at t = 0 pull the web with them, and it does not start with a jump."""
    rise = refweb.Motion(node=[0, 1], displacement=[(0.0, 0.0, 0.01, 0.05), (1.0, 0.0, 0.01, 0.05)])
    load = refweb.Load(node="centre", force=PULL, factor=[(0.0, 1.0)])
    solution = refweb.run(scene("equilibrium", effects=(GRAVITY, load, rise)))
    expected = static((GRAVITY, load, rise), t=0.0)
    np.testing.assert_array_equal(expected[[0, 1]], 2 * [[0.0, 0.01, 0.05]])
    deflection = np.abs(expected).max()
    np.testing.assert_allclose(first(solution)[0], expected, rtol=0, atol=NEAR * deflection)
    np.testing.assert_allclose(solution.displacement, expected, rtol=0, atol=NEAR * deflection)
    assert solution.warnings == []
    assert any("has moved node 0 at t = 0" in text for text in refweb.run(scene(effects=(rise,))).warnings)


def test_free_bodies_wait_and_fixed_ones_act():
    """A free ball in the web's way is where its table says and moves as it says; the web does not feel it before."""
    plain, wall = PULLED, ball(fixed=True, mass=None, velocity=(0, 0, 0))
    expected = static(plain)
    solution = refweb.run(scene("equilibrium", effects=(*plain, ball(), CONTACT), duration=5e-3))
    np.testing.assert_allclose(first(solution)[0], expected, rtol=0, atol=NEAR * np.abs(expected).max())
    state = solution.frames[0][1]
    np.testing.assert_array_equal(state.position[-1], [0.03, 0.02, -0.115])
    np.testing.assert_array_equal(state.v[-1], [0.0, 0.0, 2.0])
    assert solution.frames[-1][1].v[-1, 2] < 1.9  # gravity takes 0.05 m/s from it, the web more
    assert any("overlaps the web at the start" in text for text in solution.warnings)
    held = refweb.run(scene("equilibrium", effects=(*plain, wall, CONTACT), duration=5e-3))
    lifted = static((*plain, wall, CONTACT))
    assert np.abs(lifted - expected).max() > 0.1 * np.abs(expected).max()
    # Contact is stiff and its tangent is not that of a taut web alone; the residual is the same.
    np.testing.assert_allclose(first(held)[0], lifted, rtol=0, atol=10 * NEAR * np.abs(lifted).max())
    np.testing.assert_allclose(held.displacement, lifted, rtol=0, atol=10 * NEAR * np.abs(lifted).max())


def test_velocities_apply_in_the_equilibrium():
    kick = refweb.Velocity(node="centre", value=(0.0, 0.1, 1.0))
    solution = refweb.run(scene("equilibrium", effects=(GRAVITY, kick), duration=5e-3))
    x, v = first(solution)
    centre = solution.state.system.net.web.centre
    np.testing.assert_array_equal(v[centre], [0.0, 0.1, 1.0])
    assert not np.delete(v, centre, axis=0).any()
    np.testing.assert_allclose(x, static((GRAVITY,)), rtol=0, atol=NEAR * np.abs(x).max())


def test_no_equilibrium_to_start_from(tmp_path, capsys):
    """A web that nothing holds falls: the run fails, says why, and is marked."""
    free = scene("equilibrium", effects=(GRAVITY,), supports=refweb.Supports(nodes=[]))
    with pytest.raises(refweb.SolverError, match="no equilibrium: .* carried off along z by"):
        refweb.run(free, out=tmp_path / "out")
    (tmp_path / "free.toml").write_text(tomli_w.dumps(free.to_dict()), encoding="utf-8")
    assert main(["run", str(tmp_path / "free.toml"), "--out", str(tmp_path / "other")]) == 1
    assert capsys.readouterr().err.count("\n") == 1
    for name in ("out", "other"):
        run = json.loads((tmp_path / name / "run.json").read_text(encoding="utf-8"))
        assert run["status"] == "failed" and "carried off along z" in run["message"]
        assert not list((tmp_path / name / "frames").iterdir())


def test_saddle_to_start_from_is_named():
    """A straight chain of compressed bars is in equilibrium, and would buckle."""
    chain = refweb.Inline(points=[[i, 0, 0] for i in range(4)], lines=[[0, 1], [1, 2], [2, 3]], supports=[0, 3])
    bars = cable(law="linear", prestrain=-0.1)
    solution = refweb.run(scene("equilibrium", web=chain, cable=bars, effects=(CALM,), duration=1e-3))
    assert any("saddle" in text and "starts from" in text for text in solution.warnings)


# The last state of another run

H, END = 5e-5, 0.01
"""A step that all of these scenes have, below the bound of each; a time at which the ball is in the web [s]."""


def hit(start="web", duration=END, bodies=None, **changes):
    """The web, pulled and hit by a ball; nothing depends on time."""
    bodies = (ball(),) if bodies is None else bodies
    solve = refweb.Dynamic(duration=duration, start=str(start), step_size=H)
    effects = (GRAVITY, refweb.Load(node="centre", force=PULL), *bodies, refweb.Contact(stiffness=1e3))
    return scene(
        effects=effects,
        solve=solve,
        accuracy=refweb.Accuracy(error="none"),
        output=refweb.Output(interval=1e-3, frames=5),
        **changes,
    )


@pytest.fixture(scope="module")
def ended(tmp_path_factory):
    """(folder, solution) of a run in which the ball is in the web at the end."""
    folder = tmp_path_factory.mktemp("starts") / "first"
    return folder, refweb.run(hit(), out=folder)


def files(folder):
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_a_run_goes_on_where_another_ended(ended, tmp_path):
    """The state is the same to the last bit; from there on only the rounding of times, and so of steps, differs.

    Contact is soft enough for 400 steps to amplify that by less than 1e4.
    """
    folder, before = ended
    went_on = refweb.run(hit(folder))
    state = went_on.frames[0][1]
    for name in ("x", "v"):
        np.testing.assert_array_equal(getattr(state, name), getattr(before.state, name))
    assert state.time == 0.0 and before.state.time == END and before.history["contact_energy"][-1] > 0.0
    for axis in "xyz":
        assert went_on.history[f"momentum_{axis}"][0] == before.history[f"momentum_{axis}"][-1]
        assert went_on.history[f"support_impulse_{axis}"][0] == 0.0
    whole = refweb.run(hit(duration=2 * END))
    assert whole.solver["nsteps"] == before.solver["nsteps"] + went_on.solver["nsteps"]
    for name in ("x", "v"):
        expected = getattr(whole.state, name)
        np.testing.assert_allclose(getattr(went_on.state, name), expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    rows = len(went_on.history["time"])
    np.testing.assert_allclose(went_on.history["time"] + END, whole.history["time"][-rows:], rtol=1e-14)
    for name in ("kinetic_energy", "strain_energy", "contact_energy"):
        scale = np.abs(whole.history[name]).max()
        np.testing.assert_allclose(went_on.history[name], whole.history[name][-rows:], rtol=0, atol=1e-11 * scale)
    assert went_on.solver["energy_drift"] < 1e-2 and went_on.history["work"][0] == 0.0


def test_a_folder_can_start_from_itself(ended, tmp_path):
    """With --force: its checkpoint is read before anything is removed; a relative path is one from the scene's file."""
    folder, before = ended
    refweb.run(hit(), out=tmp_path / "run")
    given = hit("run").to_dict()
    given["solve"]["start"] = "run"
    (tmp_path / "again.toml").write_text(tomli_w.dumps(given), encoding="utf-8")
    scene_file = str(tmp_path / "again.toml")
    assert main(["run", scene_file, "--out", str(tmp_path / "run")]) == 2  # not empty
    assert files(tmp_path / "run").keys() == files(folder).keys()
    assert main(["run", scene_file, "--out", str(tmp_path / "run"), "--force"]) == 0
    went_on = refweb.run(hit(folder))
    with np.load(tmp_path / "run" / "checkpoint.npz") as checkpoint:
        np.testing.assert_array_equal(checkpoint["displacements"], went_on.state.x)
        np.testing.assert_array_equal(checkpoint["velocities"], went_on.state.v)
    assert refweb.Scene.load(tmp_path / "run" / "scene.toml").solve.start == str(tmp_path / "run")
    assert not np.array_equal(went_on.state.x, before.state.x)


def test_the_last_state_of_statics_is_a_start_as_well(tmp_path):
    found = refweb.run(scene(solve=refweb.Static()), out=tmp_path / "static")
    solution = refweb.run(scene(tmp_path / "static"))
    np.testing.assert_array_equal(first(solution)[0], found.displacement)
    deflection = np.abs(found.displacement).max()
    np.testing.assert_allclose(solution.displacement, found.displacement, rtol=0, atol=NEAR * deflection)


def test_bodies_are_matched_by_name(ended, tmp_path):
    """Wherever they stand in the scene; those that the folder does not have, and fixed ones, are as in their tables."""
    far = ball(name="far", position=(0.0, 0.0, 3.0), velocity=(0.0, 0.5, 0.0))
    other = ball(name="other", position=(0.0, 0.0, -2.0), velocity=(1.0, 0.0, 0.0))
    folder = tmp_path / "two"
    before = refweb.run(hit(bodies=(far, ball())), out=folder)
    row = {body.name: body.row for body in before.state.system.net.bodies}
    moved = ball(position=(0.5, 0.5, 0.5), velocity=(9.0, 9.0, 9.0))
    state = refweb.run(hit(folder, duration=1e-3, bodies=(moved, other, far))).frames[0][1]
    here = {body.name: body.row for body in state.system.net.bodies}
    nodes = state.system.net.nodes
    np.testing.assert_array_equal(state.x[:nodes], before.state.x[:nodes])
    for name in ("ball", "far"):
        # The table's position differs, and with it the displacement: one rounding of a position of 3 m.
        np.testing.assert_allclose(state.position[here[name]], before.state.position[row[name]], rtol=0, atol=5e-16)
        np.testing.assert_array_equal(state.v[here[name]], before.state.v[row[name]])
    np.testing.assert_array_equal(state.position[here["other"]], [0.0, 0.0, -2.0])
    np.testing.assert_array_equal(state.v[here["other"]], [1.0, 0.0, 0.0])
    fixed = ball(name="far", fixed=True, mass=None, position=(0.0, 0.0, 5.0), velocity=(0.0, 0.0, 0.0))
    state = refweb.run(hit(folder, duration=1e-3, bodies=(fixed,))).frames[0][1]
    np.testing.assert_array_equal(state.position[-1], [0.0, 0.0, 5.0])
    assert not state.v[-1].any()


def test_statics_leaves_velocities_to_the_scene(tmp_path):
    """Of bodies as of nodes; ω of a box that has turned meanwhile is that of its table along x, y and z."""
    box = dict(name="box", shape="box", size=(0.3, 0.2, 0.1), mass=1.0, position=(0.0, 0.0, 0.1))
    attached = [refweb.Attach(body="box", node=node) for node in (9, 10, 15)]

    def bodies(**motion):
        return (refweb.Body(**box, **motion), *attached)

    web = refweb.Window(mesh="square", rows=4, columns=4, side=0.2)
    push = (GRAVITY, refweb.Load(node=11, force=PULL))
    refweb.run(scene(effects=(*push, *bodies()), solve=refweb.Static(), web=web), out=tmp_path / "static")
    motion = dict(velocity=(0.1, 0.2, 3.0), angular_velocity=(1.0, 5.0, -2.0))
    output = refweb.Output(interval=1e-4, frames=1)
    given = scene(tmp_path / "static", (*push, *bodies(**motion)), 1e-4, web=web, output=output)
    solution = refweb.run(given)
    state, (body,) = solution.frames[0][1], solution.state.system.net.bodies
    R = body.rotation(state.x)
    assert np.abs(R - np.eye(3)).max() > 1e-3
    speed = state.v[body.row] + np.cross(motion["angular_velocity"], R @ (body.offset @ body.axes))
    np.testing.assert_allclose(speed, motion["velocity"], rtol=1e-13)
    np.testing.assert_allclose(body.turning(state.x, state.v), motion["angular_velocity"], rtol=1e-13)
    assert "left-out" not in [finding.code for finding in solution.findings]


def test_a_velocity_that_a_folder_replaces_is_told(ended):
    """Not one that it has as well, and not that of a body that it does not have."""
    folder, before = ended
    own = tuple(before.state.v[before.state.system.net.bodies[0].row].tolist())
    other = ball(name="other", position=(0.0, 0.0, -2.0), velocity=(1.0, 0.0, 0.0))
    for velocity, texts in ((own, []), ((9.0, 0.0, 0.0), ['velocity of body "ball" has no effect'])):
        solution = refweb.run(hit(folder, duration=1e-3, bodies=(ball(velocity=velocity), other)))
        found = [finding.text for finding in solution.findings if finding.code == "left-out"]
        assert [text[:37] for text in found] == texts


def test_lines_that_have_yielded_keep_their_law(tmp_path):
    """Without their plastic strains lines would be too short, and as strains of arms they would be wrong."""
    law = dict(law="elastic-plastic", yield_stress=1e5)
    chain = refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0])
    pull = [refweb.PointMass(node=1, mass=1.0), refweb.Load(node=1, force=(15.0, 0.0, 0.0))]

    def pulled(start="web", **keys):
        damping = [refweb.Damping(rate=10.0)] if start == "web" else []
        return scene(start, [*pull, *damping], 0.05, web=chain, cable=cable(**keys))

    refweb.run(pulled(**law), out=tmp_path / "yielded")
    for keys in ({}, {"viscous": refweb.Viscous(arms=[(1e6, 1.0)])}):
        with pytest.raises(refweb.InputError, match='internal variables of law = "elastic-plastic" .* same law'):
            refweb.run(pulled(tmp_path / "yielded", **keys))
    solution = refweb.run(pulled(tmp_path / "yielded", **law))
    plastic = solution.frames[0][1].x[-1]
    assert plastic.any()
    np.testing.assert_array_equal(plastic, refweb.load(tmp_path / "yielded").state.x[-1])


def test_natural_lengths_that_jump_are_said(tmp_path):
    """Not where the table goes on; else by the factor at t = 0 over that at the end of the folder."""

    def reeled(start, *factors):
        reel = [refweb.Reel(lines=[3], factor=[(0.0, factors[0]), (0.02, factors[1])])] if factors else []
        return refweb.run(scene(start, [*PULLED, *reel], duration=1e-3))

    refweb.run(scene(effects=[*PULLED, refweb.Reel(lines=[3], factor=[(0.0, 1.0), (0.02, 0.9)])]), out=tmp_path / "cut")
    for factors, ratio in (((0.9, 0.9), None), ((1.0, 0.9), 1.0 / 0.9), ((), 1.0 / 0.9), ((0.45, 0.9), 0.5)):
        said = [f.text for f in reeled(tmp_path / "cut", *factors).findings if f.code == "moved-at-start"]
        expected = [] if ratio is None else [f"the natural length of line 3 is {ratio:.6g} times that at the end"]
        assert [text[: len(begins)] for text, begins in zip(said, expected, strict=True)] == expected


def test_a_body_that_is_fixed_elsewhere_than_before_is_named(tmp_path):
    """Its node jumps with it, which no `[[motion]]` of the scene does."""
    chain = refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0])
    box = dict(name="box", shape="box", size=(0.2, 0.2, 0.2), position=(1.1, 0.0, 0.0))
    carries = refweb.Attach(body="box", node=1)
    free = refweb.Body(mass=1.0, velocity=(-1.0, 0.0, 0.0), **box)
    refweb.run(scene(web=chain, effects=[free, carries], duration=5e-3), out=tmp_path / "free")
    fixed = scene(tmp_path / "free", web=chain, effects=[refweb.Body(fixed=True, **box), carries], duration=1e-3)
    said = [finding.text for finding in refweb.run(fixed).findings if finding.code == "moved-at-start"]
    assert len(said) == 1 and said[0].startswith('body "box" is fixed, and its node 1 jumps by 0.005 m to it at t = 0')


def test_an_axle_takes_what_turns_about_it(tmp_path):
    """A box that turns about x goes on at its speed, on an axle along x and free again; other axles refuse it."""
    chain = refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0, 1])
    observed = [refweb.Observe(name="speed", quantity="angular_velocity", body="box", component="x")]
    observed += [refweb.Observe(name="turned", quantity="orientation", body="box", component="x")]

    def turned(name, start, duration=0.1, **keys):
        box = dict(name="box", shape="box", size=(0.3, 0.2, 0.1), position=(0.0, 0.0, 5.0), mass=1.0)
        body = refweb.Body(**{**box, "angular_velocity": (2.0, 0.0, 0.0), **keys})
        given = scene(start, [CALM, body], duration, web=chain, observe=observed)
        return refweb.run(given, out=tmp_path / name).history

    turned("free", "web")
    along = turned("axle", tmp_path / "free", axle={"direction": (1.0, 0.0, 0.0)})
    again = turned("again", tmp_path / "axle")
    for history, begin in ((along, 0.1), (again, 0.2)):
        np.testing.assert_allclose(history["speed"], 2.0, rtol=1e-9)
        np.testing.assert_allclose(history["turned"], np.sin(begin + history["time"]), rtol=1e-9)
    for axle, why in (
        ({"direction": (0.0, 1.0, 0.0)}, "is tilted by 0.2 rad from the axle"),
        ({"direction": (1.0, 0.0, 0.0), "point": (0.0, 0.1, 5.0)}, "moves away from|stands .* off"),
    ):
        with pytest.raises(refweb.InputError, match=f'body "box" ({why})'):
            turned("refused", tmp_path / "free", 1e-3, axle=axle, angular_velocity=(0.0, 0.0, 0.0))
    swung = {"axle": {"direction": (1.0, 0.0, 0.0), "point": (0.0, 0.1, 5.0)}}  # beside the centre
    turned("swung", "web", **swung)
    heavier = dict(inertia=(0.01, 0.02, 0.02), angular_velocity=(0.0, 0.0, 0.0), **swung)
    np.testing.assert_allclose(turned("heavier", tmp_path / "swung", **heavier)["speed"], 2.0, rtol=1e-9)
    turned("tumbling", "web", 1e-3, angular_velocity=(2.0, 0.0, 1e-4))
    with pytest.raises(refweb.InputError, match="turns about an axis"):
        turned("refused", tmp_path / "tumbling", 1e-3, axle={"direction": (1.0, 0.0, 0.0)})


def test_a_velocity_of_the_scene_comes_instead(ended):
    """Of its nodes; the others go on as they did."""
    folder, before = ended
    kick = refweb.Velocity(node="centre", value=(0.0, 0.0, 7.0))
    centre, changed = before.state.system.net.web.centre, hit(folder, duration=1e-3)
    state = refweb.run(changed.replace(effects=(*changed.effects, kick))).frames[0][1]
    expected = before.state.v.copy()
    expected[centre] = [0.0, 0.0, 7.0]
    np.testing.assert_array_equal(state.v, expected)
    np.testing.assert_array_equal(state.x, before.state.x)


def rewritten(**changes):
    """What writes a checkpoint with some arrays changed, or left out where they are None."""

    def write(path):
        with np.load(path) as checkpoint:
            arrays = {key: checkpoint[key] for key in checkpoint}
        for key, change in changes.items():
            arrays[key] = None if change is None else change(arrays[key])
        np.savez(path, **{key: value for key, value in arrays.items() if value is not None})

    return write


def flipped(path):
    """One bit of the stored numbers is wrong; the archive has a checksum of them."""
    content = bytearray(path.read_bytes())
    with zipfile.ZipFile(path) as archive:
        one = archive.getinfo("velocities.npy")
    content[one.header_offset + 30 + len(one.filename) + one.file_size // 2] ^= 1  # behind 30 bytes and the name
    path.write_bytes(content)


def not_a_number(array):
    array[3, 1] = np.nan
    return array


SPOILT = {
    "gone": (lambda path: path.unlink(), "checkpoint.npz cannot be read: No such file"),
    "a folder": (lambda path: (path.unlink(), path.mkdir()), "checkpoint.npz cannot be read: Is a directory"),
    "empty": (lambda path: path.write_bytes(b""), "checkpoint.npz is not what a run of refweb writes"),
    "cut short": (lambda path: path.write_bytes(path.read_bytes()[:-30]), "is not what a run of refweb writes"),
    "half": (lambda path: path.write_bytes(path.read_bytes()[:700]), "is not what a run of refweb writes"),
    "a bit": (flipped, "is not what a run of refweb writes"),
    "text": (lambda path: path.write_text("positions = 3"), "is not what a run of refweb writes"),
    "an array": (lambda path: np.save(path.open("wb"), np.zeros((3, 3))), "is not what a run of refweb writes"),
    "without velocities": (rewritten(velocities=None), "is not what a run of refweb writes"),
    "without bodies": (rewritten(bodies=lambda names: names[:0]), "holds 22 nodes, must be those of this scene, 21"),
    "too few": (rewritten(velocities=lambda v: v[:-1]), "not three for each node"),
    "flat": (rewritten(positions=lambda x: x[:, :2]), "not three for each node"),
    "one number": (rewritten(positions=lambda x: np.float64(3.0)), "not three for each node"),
    "texts": (rewritten(velocities=lambda v: v.astype(str)), "not three for each node"),
    "not finite": (rewritten(velocities=not_a_number), "holds numbers that are not finite"),
}


@pytest.mark.parametrize("case", SPOILT)
def test_spoilt_checkpoints_are_refused(ended, tmp_path, capsys, case):
    spoil, message = SPOILT[case]
    folder = tmp_path / "first"
    folder.mkdir()
    (folder / "checkpoint.npz").write_bytes((ended[0] / "checkpoint.npz").read_bytes())
    spoil(folder / "checkpoint.npz")
    (tmp_path / "next.toml").write_text(tomli_w.dumps(hit(folder).to_dict()), encoding="utf-8")
    for command in (["run", "--out", str(tmp_path / "out")], ["check"]):
        assert main([command[0], str(tmp_path / "next.toml"), *command[1:]]) == 2
        err = capsys.readouterr().err
        assert err.count("\n") == 1 and "[solve] start = " in err and message in err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["first", "next.toml"]


@pytest.mark.parametrize(
    "changes, nodes",
    [
        (dict(cable=cable(subdivide=2)), 45),
        (dict(web=refweb.Window(mesh="square", rows=5, columns=4, side=0.2)), 26),
    ],
)
def test_another_net_is_refused(ended, tmp_path, changes, nodes):
    folder, _ = ended
    with pytest.raises(refweb.InputError, match="same web, order and subdivide") as error:
        refweb.run(hit(folder, **changes), out=tmp_path / "out")
    assert f"holds 21 nodes, must be those of this scene, {nodes}" in str(error.value)
    assert not (tmp_path / "out").exists()


def chain(points, lines, supports, start="web", **solve):
    """A chain of lines, in statics under 1 N or in dynamics from a folder."""
    solve = refweb.Dynamic(duration=1e-3, start=str(start)) if start != "web" else refweb.Static()
    loads = [refweb.Load(node=1, force=(1.0, 0.0, 0.0))] if start == "web" else []
    web = refweb.Inline(points=points, lines=lines, supports=supports)
    return refweb.Scene(web=web, cable=cable(law="linear"), effects=loads, solve=solve)


def test_other_lines_between_the_same_nodes_are_refused(tmp_path):
    points = [[0, 0, 0], [1, 0, 0], [2, 0, 0]]
    refweb.run(chain(points, [[0, 1], [1, 2]], [0, 2]), out=tmp_path / "run")
    with pytest.raises(refweb.InputError, match="holds other lines between its nodes than this scene"):
        refweb.run(chain(points, [[0, 1], [0, 2]], [0, 2], tmp_path / "run"))


def test_a_support_off_its_place_is_told(tmp_path):
    """Of the same lines between nodes elsewhere: the start has the node at 2 m, this scene at 3 m."""
    lines = [[0, 1], [1, 2]]
    refweb.run(chain([[0, 0, 0], [1, 0, 0], [2, 0, 0]], lines, [0, 2]), out=tmp_path / "run")
    same = refweb.run(chain([[0, 0, 0], [1, 0, 0], [2, 0, 0]], lines, [0, 2], tmp_path / "run"))
    assert not same.warnings
    moved = refweb.run(chain([[0, 0, 0], [1.5, 0, 0], [3, 0, 0]], lines, [0, 2], tmp_path / "run"))
    assert "node 2 is held where the start has it, 1 m off its place in this scene" in moved.warnings


def swing(duration, start="web", error="twin", **changes):
    """A mass on a linear line, thrown along it at 1 m/s: x = sin(ωt)/ω with ω = √(EA/Lm) = 200/s."""
    return refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0]),
        cable=refweb.Cable(law="linear", modulus=8e8, area=1e-4, density=0.0),
        effects=[refweb.PointMass(node=1, mass=2.0)]
        + [refweb.Velocity(node=1, value=(1.0, 0.0, 0.0))] * (start == "web"),
        solve=refweb.Dynamic(duration=duration, start=start, **changes),
        accuracy=refweb.Accuracy(error=error),
        observe=[refweb.Observe(name="x", quantity="displacement", node=1, component="x")],
    )


@pytest.mark.ordinary("keys0")
@pytest.mark.parametrize("keys", [{"method": "central-difference"}, {"method": "cvode", "rtol": 1e-4}])
def test_errors_go_on_with_the_state(keys, tmp_path):
    """30 periods, then a sixth of one: what the first leg is off counts in the second, whose own part is far less."""
    rate, first, second = np.sqrt(8e4 / 2.0), 0.95, 0.005
    refweb.run(swing(first, **keys), out=tmp_path / "first")
    went_on = refweb.run(swing(second, start=str(tmp_path / "first"), **keys), out=tmp_path / "second")
    third = refweb.run(swing(second, start=str(tmp_path / "second"), **keys))
    for solution, end in ((went_on, first + second), (third, first + 2 * second)):
        value, error = solution.results["x"][:2]
        off = abs(value - np.sin(rate * end) / rate)
        assert off <= error < 20.0 * off and solution.warnings == []
    own = refweb.run(swing(second, **keys)).results["x"].error
    assert went_on.results["x"].error > 5.0 * own


def test_errors_go_on_where_the_second_leg_is_resumed(tmp_path):
    """They are those of a leg that was not interrupted, which what the first leg is off by is most of."""
    refweb.run(swing(0.95), out=tmp_path / "first")
    whole, resumed = nets.whole_and_resumed(swing(0.01, start=str(tmp_path / "first")), tmp_path)
    assert resumed.results["x"]._replace(verdict_text="") == whole.results["x"]._replace(verdict_text="")
    assert resumed.results["x"].error > 5.0 * refweb.run(swing(0.01)).results["x"].error


def test_a_state_without_errors_says_so(tmp_path):
    refweb.run(swing(0.01, error="none"), out=tmp_path / "first")
    (warning,) = refweb.run(swing(0.01, start=str(tmp_path / "first"))).warnings
    assert warning.startswith("the run that it starts from had no step-refinement run")


def test_errors_are_three_times_what_is_off():
    """Where a run is of order 2 and no chance is in it: at the end of 30 periods, where its lag moves the mass most."""
    end = 30.0 * 2.0 * np.pi / np.sqrt(8e4 / 2.0)
    value, error = refweb.run(swing(end, safety=0.1)).results["x"][:2]
    assert 2.8 < error / abs(value) < 3.2


def tumbler(start="web", nodes=(), **changes):
    """A box that tumbles, or a ball, alone but for nodes that it carries, beside a web that is held."""
    given = dict(name="box", shape="box", size=(0.3, 0.2, 0.1), mass=1.0, position=(0.0, 0.0, 1.0))
    given |= dict(velocity=(0.1, 0.2, 0.3), angular_velocity=(1.0, 5.0, -2.0), inertia=(0.01, 0.02, 0.025))
    given |= changes
    effects = [refweb.Body(**{key: value for key, value in given.items() if value is not None})]
    effects += [refweb.Attach(body="box", node=node, point=(0.1 * node - 0.4, 0.1, 0.05)) for node in nodes]
    points = [[0, 0, 0], [1, 0, 0], [5, 0, 1], [5, 1, 1]]
    web = refweb.Inline(points=points, lines=[[0, 1], [2, 3]], supports=[0, 1])
    law = refweb.Cable(law="tension-only", modulus=1e-9, area=1e-4, density=1000.0)  # next to no force
    return scene(start, effects, 0.1, web=web, cable=law, supports=refweb.Supports(nodes=[0, 1]))


def standing(solution):
    """(axes, angular velocity, place and velocity of the centre of the shape) at the end."""
    state, (body,) = solution.state, solution.state.system.net.bodies
    R, omega = body.rotation(state.x), body.turning(state.x, state.v)
    arm = R @ (body.offset @ body.axes)
    place, speed = state.position[body.row] + arm, state.v[body.row] + np.cross(omega, arm)
    return body.axes @ R.T, omega, place, speed


def test_bodies_that_tumble_go_on_whatever_axes_their_tables_have(tmp_path):
    """They stand and turn as they did there: by other axes to begin with, and by none given."""
    refweb.run(tumbler(), out=tmp_path / "half")
    turned = dict(orientation=(1.0, 2.0, -3.0, 0.5), angular_velocity=(9.0, 9.0, 9.0))
    ends = [standing(refweb.run(tumbler(tmp_path / "half", **changes))) for changes in ({}, turned)]
    whole = standing(refweb.run(tumbler().replace(solve=refweb.Dynamic(duration=0.2))))
    for end in ends:
        for one, other in zip(end, whole, strict=True):
            np.testing.assert_allclose(one, other, rtol=0, atol=1e-11)


@pytest.mark.slow
def test_bodies_go_on_where_they_lose_or_take_nodes(tmp_path):
    """Centre, axes and their motion are those there, though the row is another centre of mass; of a ball as well."""
    for own in ({}, dict(shape="sphere", size=None, radius=0.2, inertia=None)):
        for before, after in (((2, 3), ()), ((), (2, 3)), ((2,), (2, 3))):
            folder = tmp_path / f"{len(own)}-{len(before)}-{len(after)}"
            was = standing(refweb.run(tumbler("web", before, **own), out=folder))
            system = tumbler("web", after, **own).build()
            start = stored(system, folder)[0]
            (body,) = system.net.bodies
            R, omega = body.rotation(start.x), body.turning(start.x, start.v)
            arm = R @ (body.offset @ body.axes)
            place = system.net.points[body.row] + start.x[body.row] + arm
            np.testing.assert_allclose(place, was[2], rtol=0, atol=1e-13)
            np.testing.assert_allclose(omega, was[1], rtol=0, atol=1e-12)
            np.testing.assert_allclose(start.v[body.row] + np.cross(omega, arm), was[3], rtol=0, atol=1e-12)
            if not own:
                np.testing.assert_allclose(body.axes @ R.T, was[0], rtol=0, atol=1e-12)


def test_a_folder_that_does_not_say_how_bodies_stood_is_refused(tmp_path):
    refweb.run(tumbler(), out=tmp_path / "old")
    path = tmp_path / "old" / "checkpoint.npz"
    with np.load(path) as archive:
        arrays = {key: archive[key] for key in archive if key != "body_axes"}
    np.savez(path, **arrays)
    with pytest.raises(refweb.InputError, match='does not say which axes body "box" began with: run that again'):
        refweb.run(tumbler(tmp_path / "old"))


def test_a_record_of_arrays_gives_them_back(tmp_path):
    """Of any type and shape, without entries, of no dimension and of records, through a file without pickles."""
    event = np.zeros(2, dtype=[("time", float), ("slot", int)])
    event["time"] = np.inf, -0.0
    given = {"x": np.arange(6.0).reshape(2, 3), "none": np.zeros((0, 1025)), "name": np.array("run"), "event": event}
    given |= {"count": np.array(7), "held": np.array([True, False]), "few": event[:0]}
    np.savez(tmp_path / "kept.npz", run=record_of(given))
    with np.load(tmp_path / "kept.npz") as kept:
        found = fields_of(kept["run"])
    assert list(found) == list(given)
    for name, array in given.items():
        assert found[name].dtype == array.dtype and found[name].shape == array.shape
        assert found[name].tobytes() == array.tobytes()


# The end of the twin


def test_what_python_saves_has_the_end_of_the_twin(tmp_path):
    """± of a run that starts from it is that of the command line, and holds the motion that DOP853 finds.

    A mass on two lines, of which one breaks at 20 ms; the run that follows begins at 50 ms.
    """
    area, modulus, density, prestrain, force = 1e-4, 1e7, 100.0, 0.01, 5.0
    supports = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]])

    def whole(at, **solve):
        return refweb.Scene(
            web=refweb.Inline(
                points=[supports[0], [1.0, 0.0, 0.0], supports[1]], lines=[[0, 1], [1, 2]], supports=[0, 2]
            ),
            cable=cable(modulus=modulus, area=area, density=density, prestrain=prestrain),
            effects=[refweb.Load(node=1, force=(0.0, 0.0, force)), refweb.Rupture(**at)],
            solve=refweb.Dynamic(duration=0.05, **solve),
            observe=[refweb.Observe(name="z", quantity="position", node=1, component=2)],
        )

    def rate(t, y, lines):
        toward = supports[:lines] - y[:3]
        far = np.linalg.norm(toward, axis=1)
        pull = modulus * area * np.maximum(far * (1.0 + prestrain) - 1.0, 0.0) / far
        return np.append(y[3:], (pull @ toward + [0.0, 0.0, force]) * (1.0 + prestrain) / (density * area))

    y = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    for lines, begin, end in ((2, 0.0, 0.02), (1, 0.02, 0.1)):
        y = solve_ivp(rate, (begin, end), y, "DOP853", args=(lines,), max_step=1e-3, rtol=1e-10, atol=1e-12).y[:, -1]
    first = whole(dict(at=[[1, 0.02]]))
    refweb.run(first).save(tmp_path / "saved")
    refweb.run(first, out=tmp_path / "written")
    saved, written = (
        refweb.run(whole(dict(strength=1e9), start=str(tmp_path / name))) for name in ("saved", "written")
    )
    assert saved.results == written.results and saved.warnings == written.warnings
    result = saved.results["z"]
    assert abs(result.value - y[2]) < result.error < 0.02 * y[2]
