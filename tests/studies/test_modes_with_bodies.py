"""Modes of free bodies on ropes beside closed forms: sway, bifilar torsion, bounce, pendulum, librations."""

import numpy as np
import pytest

import refweb
from refweb.pictures.frames import frame_of
from refweb.pictures.record import of_folder
from refweb.results.summary_text import rows_of_modes
from refweb.results.vtu import meshes
from refweb.studies.turning import coriolis
from refweb.system.static_system import at_rest

G, LENGTH, ALONG, ACROSS, MASS, STIFFNESS = 9.81, 2.0, 0.5, 0.3, 50.0, 1e7
INERTIA = [2.0, 5.0, 6.0]
PLATE = {"name": "plate", "shape": "box", "size": [1.0, 0.6, 0.2], "mass": MASS, "inertia": INERTIA}


def platform(position, **tables):
    """A plate on four vertical ropes without mass, of a weight off their middle by its ``position``."""
    corners = [[x * ALONG, y * ACROSS] for x in (-1, 1) for y in (-1, 1)]
    points = [[*corner, z] for z in (LENGTH, 0.0) for corner in corners]
    web = {"kind": "inline", "points": points, "lines": [[i, 4 + i] for i in range(4)], "supports": [0, 1, 2, 3]}
    return refweb.Scene.from_dict(
        {
            "web": {**web, "natural_length": 4 * [LENGTH]},
            "cable": {"law": "tension-only", "modulus": 1e11, "area": STIFFNESS / 1e11, "density": 0.0},
            "gravity": {"acceleration": [0.0, 0.0, -G]},
            "body": [{**PLATE, "position": position}],
            "attach": [{"body": "plate", "node": [4, 5, 6, 7]}],
            "solve": {"kind": "static"},
            **tables,
        }
    )


def test_a_plate_on_four_ropes():
    """All six: sway √(g/l) twice, torsion of the bifilar kind √(m g r²/J l), bounce, and two rockings."""
    found = refweb.modes(platform([0.0, 0.0, 0.0]), 10)
    along = STIFFNESS / LENGTH  # k of a rope
    length = LENGTH + MASS * G / 4 / along
    torsion = MASS * G * (ALONG**2 + ACROSS**2) / (INERTIA[2] * length)
    rocking = [4 * along * reach**2 / J for reach, J in zip((ACROSS, ALONG), INERTIA[:2], strict=True)]
    squared = np.sort([G / length, G / length, torsion, 4 * along / MASS, *rocking])
    np.testing.assert_allclose(found.frequency, np.sqrt(squared) / (2 * np.pi), rtol=1e-8)
    assert len(found.frequency) == 6 and (found.error < 1e-8 * found.frequency).all()
    assert not any("held" in text or "stiffness" in text for text in found.warnings)
    shapes = found.shapes  # nodes that the plate carries go with it
    np.testing.assert_allclose(np.linalg.norm(shapes[2, 4:], axis=1), 1.0, rtol=1e-9)
    assert found.spectra[0].shares[2].sum() < 1e-9  # all of its energy is rotation


def test_a_body_is_drawn_where_its_mode_takes_it():
    """In each mode the drawn plate moves as the rigid body whose four corners the drawn ends of the ropes are."""
    found = refweb.modes(platform([0.1, 0.05, -0.2]), 6)
    state, (body,) = found.state, found.state.system.net.bodies
    still = meshes(state)
    for shape in found.spectra[-1].shapes:
        drawn = meshes(state, shape)
        moved = {name: drawn[name].points - still[name].points for name in still}
        arms = still["web"].points[4:] - state.position[body.row]
        matrix = np.vstack([np.hstack([np.eye(3), [[0, z, -y], [-z, 0, x], [y, -x, 0]]]) for x, y, z in arms])
        motion, left, *_ = np.linalg.lstsq(matrix, moved["web"][4:].ravel(), rcond=None)
        expected = motion[:3] + np.cross(motion[3:], still["plate"].points - state.position[body.row])
        np.testing.assert_allclose(moved["plate"], expected, rtol=0, atol=1e-9)
        frame = frame_of(1, 1.0, drawn, state.system.fixed[:8].any(axis=1)).posed(phase=0.0)
        np.testing.assert_allclose(frame.bodies["plate"].points, still["plate"].points, rtol=0, atol=1e-9)


def test_a_weight_off_the_middle_beside_the_tangent_by_differences():
    """ω² of M, assembled by hand, and a stiffness that is all differences of energy, about the tilted equilibrium."""
    rubber = {"law": "tension-only", "modulus": 1e8, "area": 1e-4, "density": 0.0}
    scene = platform([0.2, 0.1, -0.3], cable=rubber)
    found = refweb.modes(scene, 6)
    system = at_rest(scene.build())
    x, body = found.state.x, system.net.bodies[0]
    size, h = len(system.free), 2e-4
    K = np.zeros((size, size))
    steps = [system.rows_of(e) for e in h * np.eye(size)]
    for i in range(size):
        for j in range(size):
            ends = [
                system.energy(1.0, system.moved(x, a * steps[i] + b * steps[j])) * a * b
                for a in (-1, 1)
                for b in (-1, 1)
            ]
            K[i, j] = sum(ends) / (4 * h * h)
    axes = body.axes @ body.rotation(x).T
    M = np.zeros((size, size))
    M[:3, :3], M[3:, 3:] = MASS * np.eye(3), axes.T @ body.inertia @ axes
    squared = np.sort(np.linalg.eigvals(np.linalg.solve(M, K)).real)
    np.testing.assert_allclose((2 * np.pi * found.frequency) ** 2, squared, rtol=1e-5)  # h²


def test_a_physical_pendulum():
    """A box on one short rope: a double pendulum in either plane, and it spins at no cost."""
    inertia, arm, length, mass = [0.5, 0.9, 0.7], 0.3, 0.4, 3.0
    web = {"kind": "inline", "points": [[0, 0, length], [0, 0, 0]], "lines": [[0, 1]], "supports": [0]}
    tables = {"web": {**web, "natural_length": [length]}, "attach": [{"body": "plate", "node": 1}]}
    body = {**PLATE, "mass": mass, "inertia": inertia, "position": [0.0, 0.0, -arm]}
    found = refweb.modes(platform([0, 0, 0], body=[body], **tables), 10)
    long = length * (1 + mass * G / STIFFNESS)
    expected = [np.sqrt(STIFFNESS / length / mass)]
    for J in inertia[:2]:  # of the rope's angle and the box's
        M = mass * np.array([[long**2, long * arm], [long * arm, arm**2 + J / mass]])
        K = mass * G * np.diag([long, arm])
        expected += np.sqrt(np.linalg.eigvals(np.linalg.solve(M, K))).tolist()
    np.testing.assert_allclose(found.frequency, np.sort(expected) / (2 * np.pi), rtol=1e-7)
    assert any("1 directions have no stiffness" in text for text in found.warnings)
    assert any('body "plate" can turn at no cost' in text for text in found.warnings)


def test_librations_in_an_orbit():
    """A body that ropes hold at its centre librates: pitch √3 n √((B−A)/C), roll and yaw of the linear equations."""
    n, (A, B, C) = 0.8, (2.0, 6.0, 5.0)  # about x, away from the Earth, y, along the track, z, across
    outer = [[2, 0, 0], [-1, 2, 0], [-1, -1, 2], [-1, -1, -2.0]]
    web = {"kind": "inline", "points": [*outer, [0, 0, 0]], "lines": [[i, 4] for i in range(4)]}
    lengths = [0.9 * float(np.linalg.norm(point)) for point in outer]
    body = {**PLATE, "inertia": [A, B, C], "position": [0.0, 0.0, 0.0]}
    scene = platform([0, 0, 0]).to_dict()
    del scene["gravity"]
    scene |= {"web": {**web, "natural_length": lengths, "supports": [0, 1, 2, 3]}, "orbit": {"mean_motion": n}}
    scene |= {"body": [body], "attach": [{"body": "plate", "node": 4, "point": [0.0, 0.0, 0.0]}]}
    found = refweb.modes(refweb.Scene.from_dict(scene), 3)
    pitch = 3 * n * n * (B - A) / C
    # With roll a about the track and yaw b about the vertical: Hughes, Spacecraft Attitude Dynamics, 1986, section 9.2.
    K = n * n * np.diag([C - B, 4 * (C - A)])
    gyro = n * (A + B - C) * np.array([[0.0, -1.0], [1.0, 0.0]])
    inverse = np.diag([1 / A, 1 / B])
    states = np.block([[np.zeros((2, 2)), np.eye(2)], [-inverse @ K, -inverse @ gyro]])
    rates = np.linalg.eigvals(states)
    assert (C - B) * (C - A) < 0  # one of them leaves
    still = np.sort(abs(rates.imag[rates.imag > 1e-9]))
    expected = np.sort([*still, np.sqrt(pitch)]) / (2 * np.pi)
    positive = found.frequency[found.frequency > 0]
    np.testing.assert_allclose(positive[: len(expected)], expected, rtol=1e-6)


def test_gyroscopic_matrix_is_that_of_the_moments():
    """−∂f/∂ω by the program of the frame, at a body that is turned; antisymmetric."""
    scene = platform([0.2, 0.1, -0.3]).to_dict()
    del scene["gravity"]
    system = refweb.Scene.from_dict({**scene, "frame": {"angular_velocity": [0.3, -0.2, 0.5]}}).build()
    rest, (body,) = at_rest(system), system.net.bodies
    x = rest.moved(np.zeros((system.rows, 3)), rest.rows_of([0.1, 0.0, 0.2, 0.7, -0.4, 0.9]))
    G_matrix, omega = coriolis(rest, x).toarray(), np.array([0.5, 0.6, -0.7])
    np.testing.assert_allclose(G_matrix, -G_matrix.T, atol=1e-12)
    axes = body.axes @ body.rotation(x).T
    v = np.zeros_like(x)
    v[body.row], v[body.spin] = [1.0, 2.0, 3.0], axes.T @ (body.inertia @ (axes @ omega)) / body.moment
    felt = (system.force(1.0, x, v) - system.force(1.0, x)).ravel()[rest.free]
    np.testing.assert_allclose(G_matrix @ [1.0, 2.0, 3.0, *omega], -felt, atol=1e-12)


def spinning(moments):
    """A hub with four masses around on taut lines, that turns with its frame and that nothing supports."""
    ends = [[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]]
    lines = [[0, 4], [1, 5], [2, 6], [3, 7], [4, 6], [6, 5], [5, 7], [7, 4]]
    scene = platform([0, 0, 0]).to_dict()
    del scene["gravity"]
    hub = {**PLATE, "size": [0.2, 0.2, 0.1], "mass": 5.0, "inertia": moments, "position": [0.0, 0.0, 0.0]}
    return refweb.Scene.from_dict(
        {
            **scene,
            "web": {"kind": "inline", "points": [*(0.1 * np.array(ends)).tolist(), *ends], "lines": lines},
            "cable": {"law": "tension-only", "modulus": 1e9, "area": 1e-6, "density": 1000.0},
            "supports": {"nodes": []},
            "frame": {"angular_velocity": [0.0, 0.0, 2.0]},
            "point_mass": [{"node": [4, 5, 6, 7], "mass": 0.2}],
            "body": [hub],
            "attach": [{"body": "plate", "node": [0, 1, 2, 3]}],
        }
    )


def test_a_hub_that_spins_with_its_web():
    """A flat one is stable; a long one is held by Coriolis forces alone. Seen from outside it moves on straight."""
    flat, long = (refweb.run(spinning(moments)) for moments in ([1.0, 1.0, 1.5], [1.5, 1.5, 0.5]))
    assert flat.solver["smallest_pivot"] == 1 and long.solver["smallest_pivot"] == -1
    assert any("Coriolis forces hold it" in text for text in long.warnings)
    found = refweb.modes(spinning([1.0, 1.0, 1.5]), 6).frequency
    np.testing.assert_allclose(found[np.argsort(abs(found - 1 / np.pi))[:3]], 1 / np.pi, rtol=1e-6)  # Ω/2π, thrice


def test_table_names_a_body_that_moves_most(tmp_path):
    """A pendulum beside a web: its name stands in the table and in the file, which plots and pages read."""
    axle = {"point": [0.0, 0.0, 0.0], "direction": [0.0, 1.0, 0.0]}
    arm = {"name": "arm", "shape": "box", "size": [0.5, 0.2, 0.2], "mass": 2.0, "position": [0.5, 0.0, 0.0]}
    arm |= {"inertia": [0.01, 0.05, 0.05]}
    web = {"kind": "inline", "points": [[-1, 0, 1], [1, 0, 1]], "lines": [[0, 1]], "supports": [0, 1]}
    scene = {
        "web": web,
        "body": [{**arm, "axle": axle}],
        "cable": {"law": "linear", "modulus": 1e9, "area": 1e-6, "density": 0},
    }
    gravity, solve = {"acceleration": [0.0, 0.0, -G]}, {"kind": "static"}
    found = refweb.modes(refweb.Scene.from_dict({**scene, "gravity": gravity, "solve": solve}), out=tmp_path / "out")
    squared = 2.0 * G * 0.5 / (0.05 + 2.0 * 0.5**2)
    np.testing.assert_allclose(found.frequency, np.sqrt(squared) / (2.0 * np.pi), rtol=1e-9)
    assert (tmp_path / "out" / "modes.csv").read_text().rstrip().endswith(",arm")
    assert rows_of_modes(found.summary()["steps"][0]).rows[0][4] == "arm" and np.isnan(found.history["node"]).all()
    _, table = of_folder(tmp_path / "out").table()
    np.testing.assert_array_equal(table["frequency"], found.frequency)


def on_an_axle(direction):
    """A pendulum of a box on an axle, beside a node of 1e-5 kg in the middle of a stiff line in tension."""
    arm = {"name": "arm", "shape": "box", "size": [0.5, 0.2, 0.2], "mass": 2.0, "position": [0.5, 0.0, 0.0]}
    arm |= {"inertia": [0.01, 0.05, 0.05], "axle": {"point": [0.0, 0.0, 0.0], "direction": direction}}
    points = [[-1, 0, 1], [0, 0, 1], [1, 0, 1]]
    return refweb.Scene.from_dict(
        {
            "web": {"kind": "inline", "points": points, "lines": [[0, 1], [1, 2]], "supports": [0, 2]},
            "body": [arm],
            "point_mass": [{"node": 1, "mass": 1e-5}],
            "cable": {"law": "linear", "modulus": 1e9, "area": 1e-3, "density": 0, "prestrain": 1e-3},
            "gravity": {"acceleration": [0.0, 0.0, -G]},
            "solve": {"kind": "static"},
        }
    )


@pytest.mark.parametrize("direction", [[1.0, 1.0, 0.0], [1.0, 2.0, 3.0]])
def test_all_modes_beside_an_axle_across_all_axes(direction):
    """ω² = m g r/(I + m r²), with what is across the axle n of arm and gravity; a node has T and EA, 2/L m of it each.

    That along the line is faster than what would turn the body across its axle, which is no mode.
    """
    n = np.array(direction) / np.linalg.norm(direction)
    r, g = 0.5 * np.sqrt(1.0 - n[0] ** 2), G * np.sqrt(1.0 - n[2] ** 2)
    pendulum = 2.0 * g * r / (n @ np.diag([0.01, 0.05, 0.05]) @ n + 2.0 * r**2)
    length = 1.0 / (1.0 + 1e-3)  # the tension is EA ε, and the line is 1 m long in it
    tension, stiff = 1e6 * 1e-3, 1e6 / length
    exact = np.sqrt([pendulum, 2.0 * tension / 1e-5, 2.0 * tension / 1e-5, 2.0 * stiff / 1e-5]) / (2.0 * np.pi)
    for number in (3, 10):
        found = refweb.modes(on_an_axle(direction), number, progress=False)
        np.testing.assert_allclose(found.frequency, exact[:number], rtol=1e-4)  # the weight of the node


def test_a_body_on_an_axle_that_nothing_turns():
    """A box alone that hangs from a vertical axle has no mode, which an error says."""
    scene = on_an_axle([0.0, 0.0, 1.0]).to_dict()
    alone = {"kind": "inline", "points": [[-1, 0, 1], [1, 0, 1]], "lines": [[0, 1]], "supports": [0, 1]}
    del scene["point_mass"]
    scene = refweb.Scene.from_dict({**scene, "web": alone})
    with pytest.raises(refweb.SolverError, match="no mode at step 1: none of the 1 unknowns that have mass has stiff"):
        refweb.modes(scene, 3, progress=False)
