"""Rows of long runs: how many are written where no interval is given, and that what is counted is what is written."""

import re

import numpy as np
import pytest

import refweb
from refweb.dynamics.schedule import Counts

HANGING = dict(
    web=refweb.Inline(points=[[0, 0, 0], [0, 0, -1]], lines=[[0, 1]], supports=[0]),
    cable=refweb.Cable(law="tension-only", modulus=1e7, area=1e-5, density=0.0),
    observe=[refweb.Observe(name="low", quantity="position", node=1, component="z", reduce="min")],
)
MASS, WEIGHT = refweb.PointMass(node=1, mass=1.0), refweb.Gravity(acceleration=(0, 0, -9.81))


def scene(output=None, accuracy=None, **solve):
    return refweb.Scene(
        **HANGING,
        effects=[MASS, WEIGHT],
        solve=refweb.Dynamic(**solve),
        output=output or refweb.Output(),
        accuracy=accuracy,
    )


@pytest.mark.parametrize(
    ("solve", "interval"),
    [
        (dict(duration=0.25), 1e-3),
        (dict(duration=1.0), 1e-3),
        (dict(duration=2e-4), 2e-4),
        (dict(duration=6000.0), 6.0),
        (dict(duration=50.0, step_size=0.07), 0.07),
        (dict(duration=50.0, step_size=1e-3), 0.05),
    ],
)
def test_default_interval(solve, interval):
    assert scene(**solve).output.interval == pytest.approx(interval, rel=1e-12)


@pytest.mark.parametrize(
    ("duration", "interval", "frames"),
    [(0.1, 0.01, 3), (0.1, 0.01, 5), (0.1, 0.03, 2), (0.1, 0.03, 3), (0.05, 0.05, 1)],
)
def test_counts_are_what_a_folder_holds(tmp_path, duration, interval, frames):
    given = scene(refweb.Output(interval=interval, frames=frames), duration=duration)
    refweb.run(given, out=tmp_path / "out", progress=False)
    counts = Counts.of(given)
    assert counts.rows == len((tmp_path / "out/history.csv").read_text().splitlines()) - 1
    assert counts.frames == len(list((tmp_path / "out/frames").glob("web_*.vtu")))
    assert counts.refined_rows == counts.rows
    assert Counts.of(given.replace(accuracy=refweb.Accuracy(error="none"))).refined_rows == 0


def test_a_long_run_costs_steps_and_not_rows(tmp_path, capsys):
    """A mass falls on its spring for ten minutes: rows do not shorten its steps, and it comes 2 m g L/EA down."""
    from refweb.__main__ import main

    text = """
[web]
kind = "inline"
points = [[0, 0, 0], [0, 0, -1]]
lines = [[0, 1]]
supports = [0]
[cable]
law = "tension-only"
modulus = 1e7
area = 1e-5
density = 0.0
[[point_mass]]
node = 1
mass = 1.0
[gravity]
acceleration = [0.0, 0.0, -9.81]
[solve]
kind = "dynamic"
duration = 600.0
"""
    (tmp_path / "long.toml").write_text(text)
    assert main(["check", str(tmp_path / "long.toml")]) == 0
    said = " ".join(re.sub("[│\n]", " ", capsys.readouterr().out).split())
    assert "1001 rows, one each 0.6 s; 101 frames, one each 6 s; 1001 rows of the step-refinement run" in said
    expected = float(re.search(r"some (\S+) s of CPU time", said)[1])
    solution = refweb.run(scene(duration=600.0), out=tmp_path / "out", progress=False)
    low = solution.results["low"]
    assert abs(low.value - (-1.0 - 2.0 * 9.81 / 100.0)) <= low.error + 1e-12
    bound = 600.0 / (2.0 / np.sqrt(100.0))  # steps at the limit of stability 2/ω of central differences
    assert bound <= solution.solver["nsteps"] <= 12 * bound  # rows of 1 ms would be 200 times as many
    assert expected > 101 * 1e-3  # frames are part of it
