"""Tables of time that are shorter than a step: a pulse of any width gives its impulse, in every method.

Each scene has one mass that flies off, at rest until a pulse at `BEGIN`, so that its speed is impulse over mass.
"""

import math
import re

import numpy as np
import pytest

import refweb
from refweb.dynamics import method_choice
from refweb.dynamics.breakpoints import remarks_on_corners
from refweb.findings import texts
from refweb.results.files import as_toml

BEGIN = 0.0123
"""Start of a pulse [s], at no multiple of steps or rows."""
EA, MASS, LENGTH = 200.0, 0.5, 1.0
METHODS = {
    "central-difference": dict(method="central-difference"),
    "auto": dict(method="auto"),
    "cvode": dict(method="cvode", rtol=1e-8),
    "ida": dict(method="ida", rtol=1e-8),
}
WITHIN = {"central-difference": 0.0, "explicit": 0.0, "auto": 0.0, "cvode": 1e-3, "ida": 1e-3}
"""Error of a speed over itself: the implicit methods' sum of a hundred steps inside the pulse at their tolerance."""


def triangle(width, height, base=0.0):
    """Rows of a table: up and down within twice the width."""
    return [(BEGIN, base), (BEGIN + width, base + height), (BEGIN + 2.0 * width, base)]


def flight(method, effects, observe=(), points=((0, 0, 0), (LENGTH, 0, 0)), **changes):
    """A line from a support to a free mass, stressless and without mass of its own that counts."""
    web = refweb.Inline(points=[list(p) for p in points], lines=[[0, 1]], supports=[0])
    return refweb.run(
        refweb.Scene(
            web=web,
            cable=refweb.Cable(law="tension-only", modulus=EA / 1e-4, area=1e-4, density=1e-6),
            effects=[refweb.PointMass(node=1, mass=MASS), *effects],
            solve=refweb.Dynamic(duration=0.03, **METHODS.get(method, dict(method=method)), **changes),
            output=refweb.Output(interval=0.01),
            observe=[refweb.Observe(name="speed", quantity="velocity", node=1, reduce="final"), *observe],
        )
    )


def speed_is(solution, truth, method, width, more=0.0):
    """± contains the truth, and the error is that of the method and of the rounding of the table's times."""
    result = solution.reduced["speed"]
    rounding = 4.0 * np.spacing(BEGIN) / width
    off = abs(result.value - truth)
    assert off <= (WITHIN[method] + rounding + 1e-9 + more) * truth, (result, truth)
    assert off <= result.error + (rounding + 1e-9 + more) * truth, (result, truth)
    assert result.error <= 5e-3 * truth + 1e3 * rounding * truth


@pytest.mark.parametrize("width", [1e-5, 1e-8])
@pytest.mark.parametrize("method", [*METHODS, "explicit"])
def test_a_load(method, width):
    """∫F dt/m, towards the support, where the line is slack."""
    load = refweb.Load(node=1, force=(-1.0, 0.0, 0.0), factor=triangle(width, 0.1 * MASS / width))
    speed_is(flight(method, [load]), 0.1, method, width, 1e-6)


@pytest.mark.parametrize("width", [1e-5, 1e-8])
@pytest.mark.parametrize("method", METHODS)
def test_a_motion(method, width):
    """The support pulls at the line for a moment: EA/L ∫u dt/m; what the mass moves meanwhile is (ωw)² of it."""
    height = 0.01 * LENGTH * MASS / (EA * width) * (1e-3 if width > 1e-6 else 1e-6)
    motion = refweb.Motion(node=0, displacement=[(t, -u, 0.0, 0.0) for t, u in triangle(width, height)])
    atol = {} if METHODS[method]["method"] in ("auto", "central-difference") else dict(atol_velocity=1e-13)
    truth = EA / LENGTH * height * width / MASS
    speed_is(flight(method, [motion], **atol), truth, method, width, EA / MASS * width**2)


@pytest.mark.parametrize("width", [1e-5, 1e-8])
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("kind", ["reel", "temperature"])
def test_natural_lengths(method, kind, width):
    """EA ∫(1/n − 1) dt/m of the factor n = 1 − a s: 2 w (−ln(1 − a)/a − 1)."""
    a = 1e-3
    factor = triangle(width, -a, 1.0)
    if kind == "reel":
        effect = refweb.Reel(lines="all", factor=factor)
    else:
        effect = refweb.Temperature(expansion=1e-3, change=[(t, 1e3 * (n - 1.0)) for t, n in factor])
    truth = EA * 2.0 * width * (-math.log(1.0 - a) / a - 1.0) / MASS
    atol = {} if METHODS[method]["method"] in ("auto", "central-difference") else dict(atol_velocity=1e-6 * truth)
    speed_is(flight(method, [effect], **atol), truth, method, width, EA / MASS * width**2 / a + a)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("kind", ["pressure", "thrust"])
def test_follower_loads(method, kind):
    """Of a line that has not yet turned: half of p L, and the thrust along it, times the time."""
    width, speed = 1e-8, 0.1
    factor = triangle(width, speed * MASS / width)
    if kind == "pressure":
        effect = refweb.Pressure(lines="all", normal=(0.0, 0.0, 1.0), value=2.0 / LENGTH, factor=factor)
    else:
        effect = refweb.Thrust(node=1, line=0, force=1.0, factor=factor)
    # It then turns with speed/L, or flies to the support, where the slack line does not feel it.
    solution = flight(method, [effect])
    stretch = (speed * 0.02) ** 4 * EA / MASS if kind == "pressure" else 0.0
    speed_is(solution, speed, method, width, 1e-6 + stretch / speed**2)


@pytest.mark.parametrize("method", METHODS)
def test_pressure_in_a_closed_line(method):
    """Of a regular polygon of n masses: each gets p R sin(2π/n) outwards for a moment, and all of them no momentum.

    It then flies apart, its lines slack: they are longer than their distance.
    """
    n, radius, width, speed = 12, 1.0, 1e-6, 0.1
    turn = 2.0 * np.pi * np.arange(n) / n
    points = radius * np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn])
    factor = triangle(width, speed * MASS / (width * radius * math.sin(2.0 * math.pi / n)))
    solution = refweb.run(
        refweb.Scene(
            web=refweb.Inline(
                points=points.tolist(), lines=[[i, (i + 1) % n] for i in range(n)], natural_length=[1.0] * n
            ),
            cable=refweb.Cable(law="tension-only", modulus=1e6, area=1e-4, density=1e-6),
            effects=[
                refweb.PointMass(node="all", mass=MASS),
                refweb.Pressure(lines="all", normal=(0.0, 0.0, 1.0), value=1.0, factor=factor),
            ],
            solve=refweb.Dynamic(duration=0.03, **METHODS[method]),
            output=refweb.Output(interval=0.01),
            observe=[refweb.Observe(name="speed", quantity="velocity", node=0, reduce="final")],
        )
    )
    speed_is(solution, speed, method, width, 1e-6)
    outwards = (solution.velocities * points).sum(axis=1) / radius
    assert outwards == pytest.approx(np.full(n, speed), rel=2e-3)
    assert np.abs(solution.velocities.sum(axis=0)).max() < 1e-9 * speed


def moved_and_loaded(method, **changes):
    """Energy drift where a node that carries a constant load is moved, with corners between rows and between steps."""
    table = [(0.0, 0.0, 0.0, 0.0), (0.01013, 0.0, 0.0, 0.2), (0.01771, 0.0, 0.0, 0.05), (0.05, 0.0, 0.0, 0.05)]
    effects = [refweb.Motion(node=0, displacement=table), refweb.Load(node=0, force=(0.0, 0.0, 30.0))]
    return flight(method, effects, **changes).solver["energy_drift"]


@pytest.mark.slow
def test_work_on_a_loaded_node_that_is_moved():
    """Work is force times displacement, whatever the velocity does at a corner: the book closes to the order, 2."""
    coarse, fine = (moved_and_loaded("central-difference", step_size=step) for step in (2e-4, 1e-4))
    assert 3.0 < coarse / fine < 5.0 and fine < 1e-3
    assert all(moved_and_loaded(method) < 1e-5 for method in ("cvode", "ida"))


def hammered(width, error="twin", **solve):
    """Two taut lines with a mass between them, hit within a few steps of central differences; its place 20 ms later."""
    return refweb.run(
        refweb.Scene(
            web=refweb.Inline(points=[[-1, 0, 0], [1, 0, 0], [0, 0, 0]], lines=[[0, 2], [1, 2]], supports=[0, 1]),
            cable=refweb.Cable(law="tension-only", modulus=7e9, area=1e-6, density=200.0, prestrain=1e-3),
            effects=[
                refweb.PointMass(node=2, mass=0.05),
                refweb.Load(node=2, force=(0.0, 0.0, 500.0), factor=[(0.0, 0.0), (width / 2, 1.0), (width, 0.0)]),
            ],
            solve=refweb.Dynamic(duration=0.02, **solve),
            accuracy=refweb.Accuracy(error=error),
            observe=[refweb.Observe(name="z", quantity="displacement", node=2, component="z")],
        )
    )


@pytest.mark.parametrize("width", [1e-3, 2e-3])
@pytest.mark.parametrize("method", ["central-difference", "auto"])
def test_a_hammer_blow(method, width):
    """Halving goes on as long as the book closes faster than that; against Adams at 1e-10."""
    truth = hammered(width, "none", method="cvode", family="adams", rtol=1e-10).results["z"].value
    result = hammered(width, method=method).results["z"]
    assert abs(result.value - truth) <= result.error < 0.05 * abs(truth)


def trembling(corners, **solve):
    """A line that is hit, and pushed by a load whose table has so many corners, apart by chance, in 0.02 s."""
    times = np.sort(np.random.default_rng(1).uniform(0.0, 0.02, corners))
    load = refweb.Load(node=2, force=(0.0, 0.0, 1.0), factor=[(t, n % 2) for n, t in enumerate(times)])
    return refweb.Scene(
        web=refweb.Inline(points=[[-1, 0, 0], [1, 0, 0], [0, 0, 0]], lines=[[0, 2], [1, 2]], supports=[0, 1]),
        cable=refweb.Cable(law="linear", modulus=7e9, area=1e-6, density=200.0, prestrain=1e-3),
        effects=[load],
        solve=refweb.Dynamic(duration=0.02, **solve),
        accuracy=refweb.Accuracy(error="none"),
        observe=[refweb.Observe(name="z", quantity="displacement", node=2, component="z")],
    )


@pytest.mark.parametrize("solve", [dict(), dict(safety=0.2), dict(method="explicit"), dict(step_size=5e-5)])
def test_more_corners_than_steps_are_told(solve):
    """The steps told are those taken, and those without the table; it is a warning of the run as well."""
    given, plain = trembling(1500, **solve), trembling(1500, **solve).replace(effects=())
    (told,) = texts(remarks_on_corners(given, given.build()))
    solution, without = refweb.run(given), refweb.run(plain)
    taken, asked = solution.solver["nsteps"], without.solver["nsteps"]
    found = re.fullmatch(
        r"steps end at 1500 corners of time tables, 1.33e-05 s apart on average: (\S+) steps, where stability and "
        r"rows need (\S+), (\S+) times the work",
        told,
    )
    assert told in solution.warnings and not any("corners" in text for text in without.warnings)
    # The bound at the start stands for that of every row, which a linear law with its shifts changes by some strains.
    steps, least, times = map(float, found.groups())
    assert steps == pytest.approx(taken, rel=0.02) and least == pytest.approx(asked, rel=0.02)
    assert times == pytest.approx(taken / asked, rel=0.05) and taken >= 1500


def test_few_corners_are_not_told(capsys, tmp_path):
    """A table costs nothing to speak of where its corners are few; ``check`` says where they are many."""
    from refweb.__main__ import main

    for corners, said in ((15, False), (60, False), (1500, True)):
        given = trembling(corners)
        (tmp_path / "scene.toml").write_text(as_toml(given.to_dict()), encoding="utf-8")
        assert main(["check", str(tmp_path / "scene.toml")]) in (None, 0)
        out = capsys.readouterr().out
        assert ("corners" in out) == said and bool(remarks_on_corners(given, given.build())) == said
    implicit = trembling(1500, method="cvode")
    assert remarks_on_corners(implicit, implicit.build())[0].text.endswith(
        "on average: cvode takes at least as many steps"
    )


def test_auto_counts_corners(monkeypatch):
    """What tables alone move is given to BDF, but not where each of many corners asks for a step of it."""
    monkeypatch.setattr(method_choice, "QUICK_RUN", 0.0)
    for corners, method in ((2, "cvode"), (1500, "central-difference")):
        given = trembling(corners, method="auto", start="equilibrium")
        assert method_choice.decided(given, given.build()).solve.method == method


@pytest.mark.parametrize("method", ["central-difference", "cvode"])
def test_a_line_that_is_pulled_just_taut(method):
    """Work of the support is that of forces by rounding: they are no drift of energy, and the mass stays."""
    rows = [(0.0, 0.0, 0.0, 0.0), (0.05, -0.1, 0.0, 0.0), (0.2, -0.1, 0.0, 0.0)]
    solution = refweb.run(
        refweb.Scene(
            web=refweb.Inline(points=[[0, 0, 0], [0.9, 0, 0]], lines=[[0, 1]], supports=[0], natural_length=1.0),
            cable=refweb.Cable(law="tension-only", modulus=1e7, area=1e-4, density=0.0),
            effects=[
                refweb.PointMass(node=1, mass=1.0),
                refweb.Damping(rate=0.1),
                refweb.Motion(node=[0], displacement=rows),
            ],
            observe=[refweb.Observe(name="fast", quantity="velocity", node=1, reduce="max")],
            solve=refweb.Dynamic(duration=0.1, **METHODS[method]),
        )
    )
    assert 0.0 <= solution.results["fast"].value < 1e-12  # EA times rounding over 1 kg, for 0.1 s
