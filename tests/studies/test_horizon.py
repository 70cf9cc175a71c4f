"""How long a motion is determined: a linear oscillator for ever, an unstable one for a time that is known."""

import json
from dataclasses import replace

import numpy as np
import pytest

import refweb
from refweb.__main__ import main
from refweb.dynamics.initial_state import Start
from refweb.errors import InputError
from refweb.studies import predictability
from refweb.studies.predictability import PERTURBATION


def oscillator(prestrain, duration, **accuracy):
    """A mass between two lines along x, which may move along y only: stable under tension, not under pressure."""
    return refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0], [2, 0, 0]], lines=[[0, 1], [1, 2]], supports=[0, 2]),
        cable=refweb.Cable(law="linear", modulus=7e7, area=1e-4, density=0.0, prestrain=prestrain),
        effects=[refweb.PointMass(node=1, mass=1.0)],
        support=[refweb.Supports(nodes=1, components=["x", "z"])],
        observe=[
            refweb.Observe(name="early", quantity="velocity", node=1, component="y", reduce="min"),
            refweb.Observe(name="last", quantity="displacement", node=1, component="y"),
        ],
        solve=refweb.Dynamic(duration=duration),
        output=refweb.Output(interval=duration / 200),
        accuracy=refweb.Accuracy(horizon=True, **accuracy),
    )


def test_growth_of_an_unstable_equilibrium():
    """Pressed lines: y'' = κ² y with κ² = 2 |T|/(L m), so that differences grow with κ e-folds per second."""
    prestrain = -1e-3
    tension = 7e3 * prestrain  # distance over natural length is 1 + prestrain
    rate = np.sqrt(2.0 * abs(tension))
    scene = oscillator(prestrain, 12.0 / rate)
    # Slow enough to stay near the equilibrium: at the end at 2e-3 m, of 0.045 m to where the lines have no force.
    scene = scene.replace(effects=[*scene.effects, refweb.Velocity(node=1, value=(0.0, 1e-7, 0.0))])
    found = refweb.run(scene).horizon
    # At the start half of the difference decays: of 12 e-folds 0.7 are lost, of which the fit sees a part.
    assert found["growth"] == pytest.approx(rate, rel=0.05)
    assert found["perturbation"] == pytest.approx(PERTURBATION / (1.0 + prestrain))
    times = [time for _, time in found["digits"] if time is not None]
    assert times == sorted(times) and [k for k, _ in found["digits"]] == list(range(12, 0, -1))


def test_a_regular_motion_stays_determined(tmp_path):
    """Of a taut oscillator ten digits are left at the end, and nothing is statistical."""
    scene = oscillator(1e-3, 5.0)
    scene = scene.replace(effects=[*scene.effects, refweb.Velocity(node=1, value=(0.0, 1.0, 0.0))])
    solution = refweb.run(scene, out=tmp_path / "out")
    found = json.loads((tmp_path / "out" / "run.json").read_text(encoding="utf-8"))["horizon"]
    assert found["statistical"] == [] and dict(map(tuple, found["digits"]))[10] is None
    assert found["digits"] == [list(pair) for pair in solution.horizon["digits"]]


def test_an_ensemble_of_what_is_not_determined():
    """A mass at rest on pressed lines leaves to either side: mean and spread say so, and it is called statistical."""
    rate = np.sqrt(2.0 * 7e3 * 1e-3)
    scene = oscillator(-1e-3, 45.0 / rate, ensemble=8)
    found = refweb.run(scene).horizon
    last = found["ensemble"]["last"]
    assert "last" in found["statistical"]
    assert last["deviation"] > abs(last["mean"]) > 0.0


def test_mean_and_deviation_of_an_ensemble(monkeypatch):
    """Of runs that begin at known places y beside an unstable equilibrium, which end at y cosh κt.

    The deviation is that of a sample: (n − 1) of its squares are the sum of those of the distances from the mean. The
    time in which y grows ends before lines turn; steps of the default bound keep cosh κt to 1 %, alike in all runs.
    """
    rate, beside = np.sqrt(2.0 * 7e3 * 1e-3), np.array([3.0, -1.0, 4.0, 1.0, -5.0]) * 1e-9

    def start(simulation, seed, size=None):
        x = np.zeros((simulation.system.rows, 3))
        x[1, 1] = beside[seed - 1]
        return Start(x, None)

    monkeypatch.setattr(predictability, "_beside", start)
    found = refweb.run(oscillator(-1e-3, 8.0 / rate, ensemble=len(beside))).horizon["ensemble"]
    grown, mean = np.cosh(8.0), beside.mean()
    deviation = np.sqrt(((beside - mean) ** 2).sum() / (len(beside) - 1))
    assert found["last"]["mean"] == pytest.approx(grown * mean, rel=0.01)
    assert found["last"]["deviation"] == pytest.approx(grown * deviation, rel=0.01)
    assert found["last"]["deviation"] / found["last"]["mean"] == pytest.approx(deviation / mean, rel=1e-6)


def test_the_utilisation_of_an_ensemble_is_written(tmp_path):
    """A bar with a strength: its utilisation stands beside the results, whose names are texts, in ``run.json``."""
    scene = oscillator(-1e-3, 1.0, ensemble=2)
    solution = refweb.run(scene.replace(cable=replace(scene.cable, strength=1e6)), out=tmp_path / "out")
    found = json.loads((tmp_path / "out" / "run.json").read_text(encoding="utf-8"))["horizon"]
    assert list(found["ensemble"]) == list(solution.results)
    # Starts differ by 1e-12 of the length, and 1 s is far before the horizon.
    assert found["utilisation"]["mean"] == pytest.approx(solution.utilisation.value, rel=1e-6)


def test_only_what_lies_beyond_the_horizon_is_statistical():
    """A peak of a time at which all digits are left is none, beside an end at which none is."""
    rate = np.sqrt(2.0 * 7e3 * 1e-3)
    scene = oscillator(-1e-3, 45.0 / rate)
    early = refweb.Observe(name="early", quantity="velocity", body="ball", component="z", reduce="max")
    ball = refweb.Body(name="ball", radius=0.1, mass=1.0, position=(1.0, 9.0, 0.0), velocity=(0.0, 0.0, 1e-6))
    # Drawn down from the start on: its largest velocity upwards is the first.
    down = refweb.Gravity(acceleration=(0.0, 0.0, -1e-6))
    scene = scene.replace(effects=[*scene.effects, ball, down], observe=[early, *scene.observe[1:]])
    solution = refweb.run(scene)
    assert solution.results["early"].time == 0.0 and solution.horizon["statistical"] == ["last"]


def test_command_line(tmp_path, capsys):
    assert main(["run", "square-load", "--horizon", "--out", str(tmp_path / "out")]) == 2
    assert "--horizon has no meaning for square-load: it is static" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
    path = tmp_path / "hit.toml"
    path.write_text(
        'schema = 1\n[web]\nkind = "cable"\nstart = [0,0,0]\nend = [1,0,0]\nelements = 4\nlength = 1.1\n'
        '[cable]\nlaw = "tension-only"\nmodulus = 7e5\narea = 1e-4\ndensity = 200.0\n'
        '[gravity]\nacceleration = [0.0, 0.0, -9.81]\n[solve]\nkind = "dynamic"\nduration = 0.05\n'
    )
    assert main(["run", str(path), "--horizon", "--out", str(tmp_path / "out")]) == 0
    assert "Lyapunov exponent" in capsys.readouterr().out
    assert main(["info", str(tmp_path / "out")]) == 0
    assert "Lyapunov exponent" in capsys.readouterr().out


def test_bad_input():
    with pytest.raises(InputError, match="ensemble = 16 needs horizon = true"):
        refweb.Accuracy(ensemble=16)
    with pytest.raises(InputError, match=r"\[accuracy\] horizon = true has no meaning in statics"):
        refweb.Scene.load("square-load").replace(accuracy=refweb.Accuracy(horizon=True)).build()
