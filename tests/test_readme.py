"""What the README shows works as it stands there."""

import ast
import contextlib
import io
import pathlib
import re
import tomllib

import numpy as np
import pytest

import refweb
from refweb.dynamics.integrators.energy_balance import DRIFT
from refweb.registry import COMMANDS
from refweb.scene import SHIPPED_SCENES

ROOT = pathlib.Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
HOW = " ".join(ast.get_docstring(ast.parse((ROOT / "validation" / "how_it_works.py").read_text("utf-8"))).split())


def block(language):
    return re.search(rf"```{language}\n(.*?)```", README, re.DOTALL).group(1)


@pytest.fixture(scope="module")
def example(tmp_path_factory):
    """Names of the example of Python, what it printed as ``printed``, and where it ran as ``folder``."""
    folder, names = tmp_path_factory.mktemp("readme"), {}
    with contextlib.chdir(folder), contextlib.redirect_stdout(io.StringIO()) as printed:
        exec(compile(block("python"), "README", "exec"), names)
    return names | {"printed": printed.getvalue(), "folder": folder}


def test_python_example(example):
    assert example["printed"].startswith("Result(value=") and "unit='N'" in example["printed"]
    assert (example["folder"] / "net" / "web.pvd").is_file()
    again = refweb.load(example["folder"] / "net")
    assert again.results == example["solution"].results and again.to_pyvista().keys() == ["web"]


def test_the_limit_of_the_drift():
    assert f"energy drifts by more than {100 * DRIFT:g} % is repeated" in HOW


def test_scene_example(example):
    """The same scene as that of Python."""
    solution = refweb.run(refweb.Scene.from_dict(tomllib.loads(block("toml"))))
    assert solution.status == "solved" and solution.results == example["solution"].results


def test_every_verb_is_named():
    for name in COMMANDS:
        assert f"refweb {name}" in README


def test_what_is_linked_is_there():
    links = re.findall(r"\]\(([^)#]+)\)", README)
    assert len(links) > 10
    for link in links:
        assert (ROOT / link).is_file(), link


def test_the_version_stands_in_one_place():
    """In the package; that of the citation is the same, and the build reads it."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert project["project"]["dynamic"] == ["version"]
    assert project["tool"]["setuptools"]["dynamic"]["version"] == {"attr": "refweb.__version__"}
    assert f"\nversion: {refweb.__version__}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")


def test_it_is_short():
    assert README.count("\n") <= 150


@pytest.mark.parametrize("marker, words", [("main job", "refweb run hexagon-impact"), ("test command", "-m pytest")])
def test_two_commands_are_one_line_each(marker, words):
    lines = README.split(f"<!-- {marker} -->\n```sh\n")[1].split("```")[0].strip().splitlines()
    assert len(lines) == 1 and lines[0].startswith("python3 -m venv") and words in lines[0]


UNITS = {"mm": 1e-3, "kPa": 1e3, "N": 1.0, "mm/s": 1e-3}
PRINTED = re.compile(r"(\w+) +(-?[\d.]+) ± ([\d.]+) (\S+) \(time only\) +t = ([\d.]+) s")


def check_what_it_prints(solution):
    """Values are those of the run to a quarter of ±, ± to its order of magnitude, steps and drift to all digits.

    A difference of 1e-10 m in where the ball starts moves values by a fourteenth of ± and less, and makes another
    difference of run and twin count, five times as small; peaks are elsewhere where others are as high within ±.
    """
    box = README.split("## What it prints")[1].split("```")[1]
    rows = {name: found for name, *found in PRINTED.findall(box)}
    assert rows.keys() == solution.results.keys() and f": {solution.status} ─" in box and solution.scene.title in box
    for name, (value, error, unit, when) in rows.items():
        result, scale = solution.results[name], UNITS[unit]
        assert abs(float(value) * scale - result.value) <= 0.25 * float(error) * scale, (name, result)
        assert 0.1 < float(error) * scale / result.error < 10.0, (name, result)
        if result.error < 0.02 * abs(result.value):
            assert float(when) == pytest.approx(result.time, rel=0.01), (name, result)
    steps, drift = re.search(r"(\w\S*): (\d+) steps, energy drift ([^\s,]+)", box).group(2, 3)
    assert int(steps) == solution.solver["nsteps"] and drift == f"{solution.solver['energy_drift']:.1e}"


def test_impacts_run_by_name(tmp_path):
    for path in SHIPPED_SCENES.glob("*impact.toml"):
        solution = refweb.run(path.stem)
        assert solution.status == "solved" and not solution.warnings
        assert all(result.error is not None for result in solution.results.values())
        if path.stem == "hexagon-impact":
            check_what_it_prints(solution)


def numbers(pattern, text=README):
    """Numbers in the groups of what a pattern finds, which is to be found once."""
    (found,) = re.findall(pattern, text)
    return [float(one) for one in ([found] if isinstance(found, str) else found)]


def test_numbers_of_the_papers_webs():
    """Length, elements and areas, and the formulas of layers, by webs that are made and counted."""
    (length,) = numbers(r"a hexagon web of (\S+) m of cable")
    webs = {mesh: refweb.Paper(mesh=mesh, cable_length=length).web() for mesh in ("triangle", "square", "hexagon")}
    areas = numbers(r"of one cable length have (\S+), (\S+) and (\S+) m², not one area", HOW)
    assert areas == [round(float(np.prod(np.ptp(web.points[:, :2], axis=0))), 2) for web in webs.values()]
    assert numbers(r"its hexagon web has (\d+) elements", HOW) == [len(webs["hexagon"].lines)]
    for web in webs.values():
        assert web.natural_length.sum() == pytest.approx(length, rel=1e-12)
    pattern = r"N layers of hexagons have (\d)N² − (\d)N \+ (\d) cells and (\d)N² − (\d)N elements"
    a, b, c, d, e = numbers(pattern, HOW)
    for n in range(1, 6):
        web = refweb.Layers(mesh="hexagon", layers=n, cell_area=1.0).web()
        ends = np.unique(web.lines)
        assert a * n * n - b * n + c == len(web.lines) - len(ends) + 1 and d * n * n - e * n == len(web.lines)


# Comments of the shipped scenes


def comment(name):
    """The comments of a shipped scene as running text."""
    lines = (SHIPPED_SCENES / f"{name}.toml").read_text(encoding="utf-8").splitlines()
    return " ".join(line.removeprefix("# ") for line in lines if line.startswith("#"))


def body_of(scene):
    return next(effect for effect in scene.effects if isinstance(effect, refweb.Body))


@pytest.mark.parametrize("mesh", ["triangle", "square", "hexagon"])
def test_comments_of_the_papers_webs(mesh):
    """Of loads: 2014 elements of 0.1 m make the length; of impacts: momenta, and the stiffness of the lines."""
    length, elements, size = numbers(
        r"(\S+) m of cable for each web is (\d+) elements of (\S+) m", comment(f"{mesh}-load")
    )
    scene = refweb.Scene.load(f"{mesh}-load")
    assert scene.web.cable_length == length == pytest.approx(elements * size, rel=1e-14)
    first, last = numbers(r"under (\d) to (\d) N", comment(f"{mesh}-load"))
    assert scene.solve.load_steps[0] == first and scene.solve.load_steps[-1] == last
    assert len(refweb.Paper(mesh="triangle", cable_length=length).web().lines) == elements
    said, scene = comment(f"{mesh}-impact"), refweb.Scene.load(f"{mesh}-impact")
    ball = body_of(scene)
    least, most, mass, speed = numbers(r"momenta of (\S+) to (\S+) kg m/s: (\S+) kg at (\S+) m/s is one", said)
    assert (ball.mass, np.linalg.norm(ball.velocity)) == (mass, speed) and least <= mass * speed <= most
    stiff, low, high = numbers(r"A line is (\S+) kN/\(element length\), (\S+) to (\S+) N/m, stiff", said)
    axial = scene.cable.modulus * scene.cable.area
    assert axial == pytest.approx(1e3 * stiff, rel=1e-14)
    lines = {
        m: refweb.Paper(mesh=m, cable_length=length).web().natural_length for m in ("triangle", "square", "hexagon")
    }
    stiffness = axial / np.concatenate(list(lines.values()))
    assert [float(f"{k:.1e}") for k in (stiffness.min(), stiffness.max())] == [low, high]


def test_comments_of_other_scenes():
    """A turn in a second, 30°, where the arc and the ring are, when the net touches, and how far it is reeled in."""
    spinning = refweb.Scene.load("spinning-web")
    frame = next(effect for effect in spinning.effects if isinstance(effect, refweb.Frame))
    assert "One turn in a second" in comment("spinning-web")
    assert np.linalg.norm(frame.angular_velocity) == pytest.approx(2.0 * np.pi, rel=1e-15)
    velocity = np.array(body_of(refweb.Scene.load("square-oblique-impact")).velocity)
    (angle,) = numbers(r"at (\d+)° to its normal", comment("square-oblique-impact"))
    assert np.degrees(np.arccos(velocity[2] / np.linalg.norm(velocity))) == pytest.approx(angle, rel=1e-12)
    scene, said = refweb.Scene.load("ring-on-slack-cable"), comment("ring-on-slack-cable")
    lowest, below = numbers(r"lowest point of the arc is at z = (\S+) m, (\d+) mm below the ring", said)
    ring, depth = body_of(scene), scene.web.web().points[:, 2].min()
    assert round(depth, 3) == lowest and round(1e3 * (ring.position[2] - ring.radius - depth)) == below
    (apart,) = numbers(r"\(here (\S+) m, and an arc\)", said)
    assert np.linalg.norm(np.subtract(scene.web.end, scene.web.start)) == pytest.approx(apart, rel=1e-15)
    (push,) = numbers(r"\(here (\S+) kN/m at each contact", said)
    assert next(e for e in scene.effects if isinstance(e, refweb.Contact)).stiffness == 1e3 * push
    scene, said = refweb.Scene.load("closing-net"), comment("closing-net")
    thread, winch = (next(e for e in scene.effects if isinstance(e, k)) for k in (refweb.Thread, refweb.Winch))
    thrown = next(effect for effect in scene.effects if isinstance(effect, refweb.Velocity))
    debris = body_of(scene)
    assert numbers(r"at (\d+) m/s with up to (\d+) N", said) == [winch.speed[-1][1], winch.limit]
    web, rings = scene.build().net.web, set(thread.nodes)
    assert "eight rings" in said and len(rings) == 8 and set(web.corners) < rings < set(web.rim)
    assert "touches the debris before the winch starts" in said
    assert (debris.position[2] - debris.radius) / thrown.value[2] < winch.speed[0][0]
    assert numbers(r"with (\d+) layers", said) == [scene.web.layers]
    assert numbers(r"Example 1: (\d) m, (\d+) elements", comment("catenary")) == [
        refweb.Scene.load("catenary").web.length,
        refweb.Scene.load("catenary").web.elements,
    ]
