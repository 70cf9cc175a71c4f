"""The page in `refweb.dynamics.integrators`, followed word by word: its own example, and a generalised-α method.

Neither is part of refweb: each is a file in a package that is installed. What stands as exact is scipy's
DOP853 at a tolerance of 1e-12 on the forces of the same system.
"""

import inspect
import json
import re

import numpy as np
import packages
import pytest
import tomli_w
from scipy.integrate import solve_ivp

import refweb
import refweb.dynamics.integrators
from refweb import registry
from refweb.__main__ import main

PAGE = inspect.getdoc(refweb.dynamics.integrators)
HEUN, ENTRY = packages.blocks(PAGE)
ALPHA = '''
"""Generalised-α: J. Chung, G. M. Hulbert, J. Appl. Mech. 60 (1993) 371–375, doi:10.1115/1.2900803.

M a and f are balanced at shares 1 − α_m and 1 − α_f of a step, between whose ends Newmark's formulas stand. ρ is the
amplification of what is far above the frequencies that steps follow. The error of a step is taken from the jump of its
acceleration, as O. C. Zienkiewicz and Y. M. Xie do, doi:10.1002/eqe.4290200902.
"""

import numpy as np
from scipy.sparse.linalg import splu

from refweb.dynamics.integrators.step_observer import StepObserver, Stopped

RHO = 0.8
ALPHA_M, ALPHA_F = (2.0 * RHO - 1.0) / (RHO + 1.0), RHO / (RHO + 1.0)
GAMMA, BETA = 0.5 - ALPHA_M + ALPHA_F, 0.25 * (1.0 - ALPHA_M + ALPHA_F) ** 2


class GeneralisedAlpha(StepObserver):
    method, order = "generalised-alpha", 2

    def begin(self, t, x, v):
        self.now, self.h = (t, x, v, self.acceleration(t, x, v)), 1e-9
        self.mass = self.system.mass.matrix

    def step(self, stop, end):
        (t, x, v, a), share = self.now, 2.0
        while share > 1.0:
            h = min(self.h, stop - t)
            y, w, b = self.solved(h)
            off = h * h * abs(BETA - 1.0 / 6.0) * (b - a)
            share = self.over_tolerance(off, 0.0 * off, y, w)
            if share > 1.0 or share < 0.3:  # steps of one size as long as they can be
                self.h = h * min(2.0, 0.8 * (share + 1e-3) ** (-1.0 / 3.0))
        self.before, self.now = self.now, (t + h, y, w, b)
        return t + h

    def solved(self, h):
        """Displacement, velocity and acceleration at the end of a step, by Newton's method."""
        (t, x, v, a), system = self.now, self.system
        t, b = t + (1.0 - ALPHA_F) * h, a.copy()
        for _ in range(20):
            y = x + h * v + h * h * ((0.5 - BETA) * a + BETA * b)
            w = v + h * ((1.0 - GAMMA) * a + GAMMA * b)
            middle = t, ALPHA_F * x + (1.0 - ALPHA_F) * y, ALPHA_F * v + (1.0 - ALPHA_F) * w
            left = self.force(*middle) - self.mass @ (ALPHA_M * a + (1.0 - ALPHA_M) * b)
            tangent = (1.0 - ALPHA_M) * self.mass
            for slope, factor in ((system.stiffness, BETA * h * h), (system.damping, GAMMA * h)):
                values = slope(t, *self.state(*middle))
                if values is not None:
                    tangent = tangent + (1.0 - ALPHA_F) * factor * system.pattern.matrix(values)
            change = splu(tangent.tocsc()).solve(left)
            b = b + change
            if self.over_tolerance(BETA * h * h * change, GAMMA * h * change, y, w) < 1e-3:
                return y, w, b
        raise Stopped("Newton's method does not come to an end")

    def interpolated(self, t):
        (start, x, v, _), (end, y, w, _) = self.before, self.now
        h, s = end - start, (t - start) / (end - start)
        way = (y - x) / h
        bend, twist = 3.0 * way - 2.0 * v - w, v + w - 2.0 * way
        return x + h * s * (v + s * (bend + s * twist)), v + s * (2.0 * bend + 3.0 * s * twist)
'''
FILES = {"heun": HEUN, "generalised-alpha": ALPHA}
ENTRIES = {
    "heun": ENTRY,
    "generalised-alpha": ENTRY.replace("heun = ", "generalised-alpha = ").replace(
        "heun:Heun", "alpha:GeneralisedAlpha"
    ),
}
END, CENTRE = 0.005, 10
TOLERANCES = {"heun": (1e-2, 1e-3, 1e-4, 1e-5), "generalised-alpha": (1e-3, 1e-4, 1e-5, 1e-6)}
"""Heun's method takes the correction of a step for its error, and so has smaller ones for more steps."""


@pytest.fixture(params=FILES)
def method(request, tmp_path):
    """Its name, when all is done that the page says."""
    with packages.of_page(tmp_path, FILES[request.param], ENTRIES[request.param]):
        yield request.param


def test_the_page_is_short_and_names_what_there_is():
    assert PAGE.count("\n") < 65 and len(HEUN.splitlines()) <= 35
    for place in re.findall(r"`(refweb\.[\w.]+)`", PAGE):
        module, _, name = place.rpartition(".")
        assert hasattr(__import__(module, fromlist=[name]), name)
    assert not FILES.keys() & registry.INTEGRATORS.keys()


def scene(method, duration=END, interval=None, rtol=1e-6, **changes):
    """A taut web that is thrown by its centre, and pushed by a load with a corner."""
    push = {"node": "centre", "force": [0.0, 2.0, 30.0], "factor": [[0.0, 0.0], [0.002, 1.0], [0.004, -1.0]]}
    given = {
        "web": {"kind": "window", "mesh": "square", "rows": 4, "columns": 4, "side": 0.2},
        "cable": {"law": "tension-only", "modulus": 7e7, "area": 1e-4, "density": 200.0, "prestrain": 0.05},
        "load": [push],
        "velocity": [{"node": "centre", "value": [0.5, -1.0, 5.0]}],
        "observe": [{"name": "far", "quantity": "displacement", "node": "centre", "component": "z", "reduce": "final"}],
        "solve": {"kind": "dynamic", "duration": duration, "method": method, "rtol": rtol},
        "output": {"interval": interval or duration / 5.0},
        "accuracy": {"error": "none"},
    }
    return {key: value for key, value in {**given, **changes}.items() if value is not None}


def ran(*arguments, **changes):
    return refweb.run(refweb.Scene.from_dict(scene(*arguments, **changes)))


def exact(given):
    """Displacement of what is free at the end of a scene."""
    system = refweb.Scene.from_dict(given).build()
    free, n = system.free, len(system.free)
    mass = np.repeat(system.net.mass, 3)[free]

    def rate(t, y):
        x, v = np.zeros((system.rows, 3)), np.zeros((system.rows, 3))
        x.ravel()[free], v.ravel()[free] = y[:n], y[n:]
        return np.concatenate([y[n:], system.force(t, x, v).ravel()[free] / mass])

    y = np.concatenate([np.zeros(n), system.initial_velocity().ravel()[free]])
    corners = [t for t, _ in given["load"][0]["factor"]][:-1]
    for begin, end in zip(corners, [*corners[1:], END], strict=True):
        y = solve_ivp(rate, (begin, end), y, "DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
    return free, y[:n]


@pytest.mark.ordinary("heun")
def test_order_and_books(method):
    """Errors fall with the square of the number of steps, where nothing goes slack, and the books close as well."""
    free, x = exact(scene(method))
    steps, errors, drifts = [], [], []
    for rtol in TOLERANCES[method]:
        solution = ran(method, rtol=rtol)
        assert solution.state.element_strain.min() > 0.0 and solution.warnings == []
        steps.append(solution.solver["nsteps"])
        errors.append(np.abs(solution.state.x.ravel()[free] - x).max())
        drifts.append(solution.solver["energy_drift"])
    fits = [np.polyfit(np.log(steps), np.log(fallen), 1)[0] for fallen in (errors, drifts)]
    # Steps are of one size but for corners and a few changes; Heun's method keeps energy to order 3 by itself.
    assert abs(fits[0] + 2.0) < 0.2 and -3.2 < fits[1] < -1.8
    assert errors[-1] < 1e-4 * np.abs(x).max() and drifts[-1] < 1e-5
    history = solution.history
    book = history["momentum_z"] - history["support_impulse_z"]
    # The factor of the load integrates to 1 ms at 2 ms, to as much at 4 ms, and to nothing at the end.
    assert book[-1] == pytest.approx(book[0], abs=1e-4 * np.abs(history["momentum_z"]).max())
    assert book[2] - book[0] == pytest.approx(30.0 * 1e-3, rel=1e-4)


def test_errors_are_those_of_a_twin(method):
    """± holds the truth, and is not a hundred times too large."""
    free, x = exact(scene(method))
    result = ran(method, accuracy={"error": "twin"}, rtol=1e-4).results["far"]
    off = abs(result.value - x[list(free).index(3 * CENTRE + 2)])
    assert off <= result.error < 100.0 * max(off, 1e-9)


@pytest.mark.ordinary("generalised-alpha")
def test_extremes_and_events(method):
    """A mass on a spring, thrown along it: v/ω at t = π/2ω, half of it at t = π/6ω; the run ends where a level says.

    Phases are off by some (ωh)² of a tenth, for steps of 1e-2/ω and less.
    """
    rate, speed = 20.0, 0.3
    given = {
        "web": {"kind": "inline", "points": [[0, 0, 0], [1, 0, 0]], "lines": [[0, 1]], "supports": [0]},
        "cable": {"law": "linear", "modulus": rate**2, "area": 1.0, "density": 0.0},
        "load": None,
        "point_mass": [{"node": 1, "mass": 1.0}],
        "velocity": [{"node": 1, "value": [speed, 0.0, 0.0]}],
        "observe": [
            {"name": "far", "quantity": "displacement", "node": 1, "component": "x", "reduce": "max"},
            {"name": "here", "quantity": "displacement", "node": 1, "component": "x", "reduce": "final"},
        ],
        "event": [
            {"name": "half", "kind": "threshold", "observe": "far", "value": 0.5 * speed / rate},
            {"name": "back", "kind": "threshold", "observe": "here", "value": -0.5 * speed / rate, "stop": True},
        ],
    }
    solution = ran(method, 1.0, 0.01, 1e-7, **given)
    far = solution.results["far"]
    assert far.value == pytest.approx(speed / rate, rel=1e-5)
    assert far.time == pytest.approx(np.pi / (2.0 * rate), rel=1e-3)
    half, back = (event["time"] for event in solution.events)
    assert half == pytest.approx(np.pi / (6.0 * rate), rel=3e-5)
    assert back == solution.history["time"][-1] == pytest.approx(7.0 * np.pi / (6.0 * rate), rel=3e-5)


@pytest.mark.ordinary("heun")
def test_a_body_and_friction(method):
    """What depends on velocity, and a contact that no step passes over: the books close."""
    ball = {"name": "ball", "radius": 0.1, "mass": 1.0, "position": [0.01, 0.02, -0.105], "velocity": [0.0, 0.5, 3.0]}
    contact = {"stiffness": 1e4, "damping": 0.1, "friction": 0.3, "slip_velocity": 0.1}
    solution = ran(method, 0.02, rtol=1e-4, body=[ball], contact=contact)
    assert solution.state.v[-1, 2] < 2.5 and solution.solver["energy_drift"] < 1e-3
    assert solution.history["dissipated_energy"][-1] > 0.01


def test_it_is_known(method, tmp_path, monkeypatch, capsys):
    """To the command line, to messages and to what refuses keys of other methods."""
    monkeypatch.chdir(tmp_path)
    with open("thrown.toml", "wb") as file:
        tomli_w.dump(scene(method, rtol=1e-4), file)
    assert main(["check", "thrown.toml"]) == 0 and method in capsys.readouterr().out
    assert main(["run", "thrown.toml", "--out", "out"]) == 0
    summary = json.loads((tmp_path / "out" / "run.json").read_text(encoding="utf-8"))
    assert summary["status"] == "solved" and summary["solver"]["method"] == method and summary["solver"]["nfev"] > 100
    with pytest.raises(refweb.InputError, match=f'did you mean "{method}"'):
        refweb.Dynamic(method=method[:-1], duration=1.0)
    with pytest.raises(refweb.InputError, match=f'safety = 0.5 has no meaning with method = "{method}"'):
        refweb.Dynamic(method=method, duration=1.0, safety=0.5)


def test_what_it_does_not_take(method):
    """Nodes without mass, and links: a message of one line, from the contract and not from the file."""
    cable = {"law": "linear", "modulus": 7e7, "area": 1e-4, "density": 0.0}
    with pytest.raises(refweb.InputError, match=rf"^node \d+ has no mass, which {method} needs"):
        ran(method, cable=cable)
    with pytest.raises(refweb.InputError, match=r'^\[\[link\]\] needs .*method = "ida"'):
        ran(method, link=[{"nodes": [9, 10]}])


def test_a_force_without_value(method, monkeypatch):
    """Ends the run with node and time, as with the methods that refweb ships."""
    from refweb.system.system import System

    own = System.forces

    def forces(self, t, x, v=None, per_cell=None):
        found = own(self, t, x, v, per_cell)
        found.force[CENTRE] += np.nan if t > 0.3 * END else 0.0
        return found

    monkeypatch.setattr(System, "forces", forces)
    with pytest.raises(
        refweb.SolverError, match=r"^number not finite at node 10, t = 0\.001\S* s: use a smaller rtol$"
    ):
        ran(method)
