"""A window of pyvista and a script for ParaView: what they show, off screen where there is what it takes."""

import os
import pathlib
import runpy
import shutil
import subprocess
import sys

import meshio
import numpy as np
import pytest
from PIL import Image

from refweb.__main__ import main
from refweb.errors import InputError
from refweb.pictures.paraview import script
from refweb.pictures.record import of_folder
from refweb.pictures.stage import SLACK, limits_of
from refweb.pictures.window import window

STRESS = ([3e6, 0.0, 1e6], [9e6, 2e6, 0.0])
"""Of three lines in two frames [Pa]; a line at zero is slack."""


@pytest.fixture
def folder(tmp_path):
    """Three lines beside each other, between two supports and above a body, in a folder with an awkward name."""
    where = tmp_path / 'a "run" o\'mine'
    (where / "frames").mkdir(parents=True)
    points = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]], dtype=float)
    listed = []
    for number, stress in enumerate(STRESS):
        moved = np.outer([0, 1, 1, 0], [0.0, 0.2, 0.4 * (1 + number)])
        data = {"displacement": moved, "support": np.array([1.0, 0, 0, 1])}
        cells = {"stress": [np.array(stress)], "slack": [(np.array(stress) == 0) * 1.0]}
        lines = [("line", [[0, 1], [1, 2], [2, 3]])]
        meshio.Mesh(points + moved, lines, data, cells).write(where / f"frames/web_{number:06d}.vtu")
        body = meshio.Mesh([[1, -1, -1], [2, -1, -1], [1, 0, -1.0]], [("triangle", [[0, 1, 2]])])
        body.write(where / f"frames/the plate_{number:06d}.vtu")
        for part, name in enumerate(("web", "the plate")):
            file = f"frames/{name}_{number:06d}.vtu"
            listed.append(f'<DataSet timestep="{0.5 * number}" group="" part="{part}" name="{name}" file="{file}"/>')
    sets = "".join(listed)
    text = f'<VTKFile type="Collection" version="0.1"><Collection>{sets}</Collection></VTKFile>'
    (where / "web.pvd").write_text(f'<?xml version="1.0"?>{text}')
    return where


def given(path):
    """What a script for ParaView says of its run, read without ParaView."""
    head = path.read_text().partition("try:\n    folder")[0].replace("from paraview import simple", "")
    head = "\n".join(line for line in head.splitlines() if "vtkmodules" not in line)
    path.with_suffix(".head.py").write_text(head)
    return runpy.run_path(str(path.with_suffix(".head.py")))["GIVEN"]


def test_a_script_says_what_is_shown(folder, tmp_path):
    path = script(folder)
    assert path == folder / "web_in_paraview.py"
    compile(path.read_text(), str(path), "exec")
    known = given(path)
    assert known["folder"] == str(folder.resolve()) and known["beside"]
    assert known["limits"] == list(limits_of(of_folder(folder), "stress", [0, 1])) == [0.0, 9e6]
    assert known["label"] == "stress [MPa]" and known["factor"] == pytest.approx(1e-6)
    assert known["bodies"] == ["the plate"] and known["grey"] and known["of_cells"] and known["supports"]
    known = given(script(folder, "displacement", tmp_path / "other.py"))
    assert known["vector"] and not known["of_cells"] and not known["beside"] and not known["grey"]
    assert not given(script(folder, "support", tmp_path / "number.py"))["vector"]


def test_the_verb(folder, tmp_path, capsys, monkeypatch):
    assert main(["view", str(folder), "--paraview", "--out", str(tmp_path / "x.py")]) == 0
    assert capsys.readouterr().out == f"{tmp_path / 'x.py'}\n"
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    refused = {
        ("--out", "x.py"): "belongs to --paraview",
        ("--field", "stress"): "the page shows all fields",
        ("--paraview", "--field", "stres"): 'did you mean "stress"',
        ("--paraview", "--out", "x.txt"): 'unknown format "txt"',
    }
    refused |= {("--window",): "DISPLAY is not set"} if sys.platform.startswith("linux") else {}
    for options, words in refused.items():
        assert main(["view", str(folder), *options]) == 2
        assert words in capsys.readouterr().err


def test_a_window_needs_a_result_folder(tmp_path):
    with pytest.raises(InputError, match="not a result folder"):
        window(tmp_path)


def pictured(command, picture, reason):
    """A picture that a command draws under a display of its own, RGB, and what it says; skipped where there is none."""
    if shutil.which("xvfb-run") is None:
        pytest.skip("there is no xvfb-run, which gives programs a display")
    environment = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "DISPLAY")}
    environment |= {"PYTHONPATH": str(pathlib.Path(main.__code__.co_filename).parents[1])} if "-c" in command else {}
    for _ in range(3):  # two displays that start at once may take the same number
        done = subprocess.run(
            ["xvfb-run", "-a", *command], capture_output=True, text=True, timeout=300, env=environment
        )
        if picture.exists():
            return np.asarray(Image.open(picture).convert("RGB")).astype(int), done.stdout
    assert done.returncode < 0 or "Abort" in done.stderr or "GLX" in done.stderr, done.stderr
    pytest.skip(reason)


def colourful(image):
    """Pixels of the lines' scale of colours: neither grey nor bluish grey, as slack lines, letters and bodies are."""
    return int((np.ptp(image, axis=-1) > 90).sum())


def greyish(image):
    """Pixels that are slack lines in some light: grey, neither black nor white."""
    level = image.mean(axis=-1)
    return int(((np.ptp(image, axis=-1) < 6) & (level > 110) & (level < 255 * SLACK[0] + 12)).sum())


@pytest.mark.slow
def test_paraview_runs_the_script(folder, tmp_path):
    """In a folder that has moved since: tubes in colours, the slack one grey, at the time with the largest value."""
    if shutil.which("pvpython") is None:
        pytest.skip("there is no pvpython, which is ParaView without a window")
    path = script(folder)
    moved = tmp_path / 'elsewhere "too"'
    folder.rename(moved)
    command = ["pvpython", str(moved / path.name), str(tmp_path / "view.png")]
    image, said = pictured(command, tmp_path / "view.png", "ParaView finds no OpenGL here")
    assert image.shape == (1000, 1600, 3) and "colours from 0.0 to 9.0" in said, "the range of all times"
    middle = image[150:850, 200:1350]  # without the title, the axes and the colour bar
    assert colourful(middle) > 1000 and greyish(middle) > 300


@pytest.mark.slow
def test_a_window_shows_frames(folder, tmp_path):
    code = (
        "import sys\nfrom refweb.pictures.record import of_folder\nfrom refweb.pictures.window import prepared\n"
        "plotter, show = prepared(of_folder(sys.argv[1]), off_screen=True)\nshow(0)\nshow(1)\n"
        "plotter.screenshot(sys.argv[2])\n"
    )
    command = [sys.executable, "-c", code, str(folder), str(tmp_path / "view.png")]
    image, _ = pictured(command, tmp_path / "view.png", "pyvista finds no OpenGL here")
    middle = image[150:650, 200:1150]
    assert colourful(middle) > 1000 and greyish(middle) > 300
