"""The recipes run whole, and what they write is there and as they say."""

import ast
import csv
import json
import os
import pathlib
import subprocess
import sys

import matplotlib
import numpy as np
import pytest

import refweb
from refweb.pictures import render
from validation import recipes
from validation.recipes import energies, gmsh_net, own_net, sweep

FOLDER = pathlib.Path(recipes.__file__).parent
SCRIPTS = sorted(path.stem for path in FOLDER.glob("*.py") if path.stem != "__init__")


@pytest.fixture(autouse=True)
def off_screen(monkeypatch):
    """Pictures to files; those of refweb by matplotlib, as OpenGL has its own tests and takes longer."""
    monkeypatch.setattr(render, "images", lambda *job: None)
    backend = matplotlib.get_backend()
    matplotlib.use("Agg")
    yield
    matplotlib.pyplot.close("all")
    matplotlib.use(backend)


def is_drawn(path):
    """Whether a picture has something on it: one that is white, or of one colour, has not."""
    image = matplotlib.image.imread(path)
    return min(image.shape[:2]) > 300 and len(np.unique(image[::2, ::2, :3].sum(axis=2))) > 20


def test_recipes_are_short_and_listed():
    for name in SCRIPTS:
        text = (FOLDER / f"{name}.py").read_text(encoding="utf-8")
        assert f"``{name}``" in recipes.__doc__ and len(text.splitlines()) <= 70
        sources = {node.module for node in ast.walk(ast.parse(text)) if isinstance(node, ast.ImportFrom)}
        assert all(source.split(".")[0] == "refweb" for source in sources), "copied away from here it runs as well"


def test_own_net(tmp_path):
    """The net is 12 × 12 m; its mass is that of rim, inside and corners, and so is that of the frames."""
    own_net.main(tmp_path, duration=0.1)
    solution = refweb.load(tmp_path / "own-net")
    web = solution.scene.web.web()
    assert np.ptp(web.points, axis=0) == pytest.approx([12.0, 12.0, 0.0]) and is_drawn(tmp_path / "own-net" / "web.png")
    rim = web.natural_length[web.groups["rim"]].sum()
    assert rim == pytest.approx(4 * 12.0)
    cables = 970.0 * (8e-6 * rim + 2e-6 * (web.natural_length.sum() - rim))
    mass = solution.to_pyvista(0)["web"]["mass"]
    assert mass.sum() == pytest.approx(cables + 4 * 0.5, rel=1e-12) and mass[web.corners].min() > 0.5
    assert solution.results["contact_force"].value > 0.0 and not any(
        solution.state.system.supported[: len(web.points)].flat
    )


def test_gmsh_net(tmp_path):
    """Spokes carry the weight that stands on the middle: 4 T sin α = 50 N, by the positions of both nodes."""
    gmsh_net.main(tmp_path)
    solution = refweb.load(tmp_path / "gmsh-net")
    web = solution.scene.web.web()
    assert list(web.names) == ["middle"] and len(web.rim) == 4
    assert {name: len(web.groups[name]) for name in ("spokes", "ring")} == {"spokes": 8, "ring": 4}
    middle = web.names["middle"][0]
    lift = 0.0
    for line in web.groups["spokes"]:
        if middle in web.lines[line]:
            (other,) = set(web.lines[line].tolist()) - {middle}
            along = solution.positions[other] - solution.positions[middle]
            lift += solution.tension[line] * along[2] / np.linalg.norm(along)
    assert lift == pytest.approx(50.0, rel=1e-6) and solution.results["ring"].value > 0.0
    assert is_drawn(tmp_path / "gmsh-net" / "web.png")


@pytest.mark.slow
def test_sweep(tmp_path):
    sweep.main(tmp_path, duration=0.03)
    with open(tmp_path / "sweep.csv", encoding="utf-8") as file:
        head, *rows = csv.reader(file)
    rows = np.array(rows, dtype=float)
    assert head[0] == "speed [m/s]" and rows[:, 0].tolist() == sweep.SPEEDS and len(rows) == 8
    assert (rows[:, 1:] > 0.0).all() and (rows[:, 2] < 0.1 * rows[:, 1]).all()
    assert (rows[:, 1] < 0.03 * rows[:, 0]).all(), "nothing is pushed faster than the ball is"
    assert (np.diff(rows[:, 1]) > 0.0).all() and is_drawn(tmp_path / "sweep.png")


def test_energies(tmp_path, capsys):
    """The parts of the picture are all that the ball brings, m v²/2, within the drift that is named."""
    energies.main(tmp_path, duration=0.02)
    drift = float(capsys.readouterr().out.split()[2])
    assert drift < 1e-2 and is_drawn(tmp_path / "energies.png")
    history = refweb.run(energies.scene(duration=0.02)).history
    whole = sum(history[name] for name in energies.PARTS)
    assert whole == pytest.approx(0.5 * 0.2 * 5.0**2, rel=1.01 * drift) and history["dissipated_energy"][-1] > 0.0


@pytest.mark.slow
def test_pandas_and_pyvista(tmp_path):
    """In a process of its own, as OpenGL that is broken ends the one that it is in."""
    pandas = pytest.importorskip("pandas")
    script = [sys.executable, str(FOLDER / "pandas_and_pyvista.py"), str(tmp_path), "0.01"]
    environment = os.environ | {"VTK_DEFAULT_OPENGL_WINDOW": render.windows()[0][0] or ""}
    done = subprocess.run(script, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    table = pandas.read_csv(tmp_path / "history.csv", index_col=0)
    assert table.index[-1] == pytest.approx(0.01) and "ball_speed" in table
    assert is_drawn(tmp_path / "speed.png") and is_drawn(tmp_path / "tension.png")


def test_notebook(tmp_path, monkeypatch):
    """The cells of code run in their order; the file holds no outputs."""
    monkeypatch.chdir(tmp_path)
    book = json.loads((FOLDER / "notebook.ipynb").read_text(encoding="utf-8"))
    assert (book["nbformat"], book["nbformat_minor"]) == (4, 5) and len({cell["id"] for cell in book["cells"]}) == len(
        book["cells"]
    )
    names = {}
    for cell in book["cells"]:
        if cell["cell_type"] == "code":
            assert cell["outputs"] == [] and cell["execution_count"] is None
            exec(compile("".join(cell["source"]), cell["id"], "exec"), names)
    assert "±" in names["solution"]._repr_html_() and "Net in a notebook" in names["scene"]._repr_html_()
    assert names["page"]._repr_png_().startswith(b"\x89PNG") and len(names["axes"].lines[0].get_xdata()) == 51
