"""Bodies of files with faults in contact: nets move as over the box that the file means."""

import numpy as np
import pytest
import solids

import refweb

SIZE = np.array([0.3, 0.4, 0.24])
POINTS, TRIANGLES = solids.box(SIZE)


def joined(*surfaces):
    first = np.cumsum([0, *(len(points) for points, _ in surfaces)])
    return np.vstack([p for p, _ in surfaces]), np.vstack([t + k for (_, t), k in zip(surfaces, first, strict=False)])


def part(share, middle):
    return solids.box(SIZE * [share, 1.0, 1.0])[0] + SIZE * [middle, 0.0, 0.0], TRIANGLES


SURFACES = {
    "hole": (POINTS, np.delete(TRIANGLES, 11, axis=0)),
    "flipped": (POINTS, np.vstack([TRIANGLES[:4, ::-1], TRIANGLES[4:]])),
    "doubled": (POINTS, np.vstack([TRIANGLES, TRIANGLES[:2]])),
    "overlapping": joined(part(0.7, -0.15), part(0.6, 0.2)),
    "touching": joined(part(0.5, -0.25), part(0.5, 0.25)),
}


def caught(**body):
    """A net that a free body of 1 kg falls into, flat side first, as it turns a little."""
    return refweb.Scene.from_dict({
        "web": {"kind": "window", "mesh": "square", "rows": 6, "columns": 6, "side": 0.15},
        "cable": {"law": "tension-only", "modulus": 1e7, "area": 1e-5, "density": 1000.0},
        "body": [{"name": "it", "mass": 1.0, "position": [0.02, -0.03, 0.13], "velocity": [0.0, 0.0, -4.0],
                  "angular_velocity": [0.5, -0.3, 0.0], **body}],
        "contact": {"stiffness": 3e3},
        "solve": {"kind": "dynamic", "duration": 0.06},
        "output": {"interval": 0.005, "frames": 4},
        "observe": [
            {"name": "height", "quantity": "position", "body": "it", "component": "z"},
            {"name": "speed", "quantity": "velocity", "body": "it", "component": "z"},
        ],
    })  # fmt: skip


@pytest.fixture(scope="module")
def exact(tmp_path_factory):
    """The same of the shape "box", and of a file of it without faults."""
    file = solids.write(tmp_path_factory.mktemp("clean") / "it.obj", POINTS, TRIANGLES)
    return refweb.run(caught(shape="box", size=SIZE.tolist())), refweb.run(caught(shape="mesh", file=file))


@pytest.mark.slow
@pytest.mark.parametrize("name", SURFACES)
def test_a_faulty_box_hits_a_net_as_the_box_does(name, exact, tmp_path):
    """Within ± of both runs and the error of the surface, and as the file without faults by six digits."""
    file = solids.write(tmp_path / "it.obj", *SURFACES[name])
    solution = refweb.run(caught(shape="mesh", file=file))
    assert any(text.startswith('body "it": ') for text in solution.warnings)
    assert "surface" in {finding.code for finding in solution.findings}
    assert solution.passage["bodies"] == "certified"
    assert solution.solver["energy_drift"] < 1e-3 and solution.solver["momentum_drift"] < 1e-9
    error, found = solution.bodies["it"]["surface_error"], solution.results
    box, clean = (run.results for run in exact)
    assert error < 3e-3 and box["speed"].value > -3.0
    assert abs(found["height"].value - box["height"].value) < found["height"].error + box["height"].error + error
    for key in found:
        assert found[key].value == pytest.approx(clean[key].value, rel=1e-6)


@pytest.mark.slow
def test_a_net_wraps_around_parts_that_overlap(tmp_path):
    """A cross of two bars, which a net with heavy corners meets: nothing passes, what is lost is the momentum given."""
    bar, across = solids.box([0.5, 0.12, 0.1]), solids.box([0.12, 0.5, 0.1])
    file = solids.write(tmp_path / "cross.obj", *joined(bar, (across[0] + [0.0, 0.0, 0.02], across[1])))
    scene = refweb.Scene.from_dict({
        "web": {"kind": "window", "mesh": "square", "rows": 8, "columns": 8, "side": 0.1},
        "cable": {"law": "tension-only", "modulus": 1e7, "area": 1e-6, "density": 1000.0},
        "supports": {"nodes": []},
        "point_mass": [{"node": "corners", "mass": 0.01}],
        "body": [{"name": "cross", "shape": "mesh", "file": file, "mass": 2.0, "position": [0.013, 0.007, 0.1],
                  "angular_velocity": [0.0, 0.0, 0.5]}],
        "contact": {"stiffness": 300.0, "friction": 0.2},
        "velocity": [{"node": "all", "value": [0.0, 0.0, 3.0]}],
        "solve": {"kind": "dynamic", "duration": 0.15},
        "accuracy": {"error": "none"},
    })  # fmt: skip
    solution = refweb.run(scene)
    assert solution.passage["bodies"] == "certified"
    assert solution.solver["momentum_drift"] < 1e-9 and solution.solver["energy_drift"] < 5e-3
    assert solution.bodies["cross"]["overlap"] > 0.0
    net, state = solution.state.system.net, solution.state
    given = 3.0 * net.mass[: net.nodes].sum()
    assert (net.mass[: net.nodes + 1] * state.v[: net.nodes + 1, 2]).sum() == pytest.approx(given, rel=1e-9)
    assert 0.0 < state.v[net.bodies[0].row, 2] < 3.0
