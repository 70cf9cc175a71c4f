"""Rupture: closed forms of what is left behind a break, books, orders, agreement of methods, and what goes on."""

import shutil

import nets
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import refweb
import validation.dynamics.rupture as three
from refweb.dynamics.integrators.central_difference import CentralDifference
from refweb.dynamics.integrators.rupture import with_breaks
from refweb.dynamics.integrators.splitting import Splitting
from refweb.effects.elasticity import Elasticity
from refweb.effects.rupture import GroupRupture, Rupture
from refweb.net import discretisation
from refweb.net.web import Web
from refweb.results.state import State
from refweb.results.summary_text import on_run
from refweb.system.system import System

METHODS = ["central-difference", "cvode", "ida"]
FINER = {"central-difference": {"safety": 0.1}}
E, AREA, MASS, SPEED = 1e9, 1e-6, 1.0, 2.0
STIFF = E * AREA
"""Stiffness of a line of 1 m [N/m]."""


def thrown(lines, effects, speed=SPEED, method="central-difference", strength=None, **parts):
    """A mass thrown downwards at `SPEED`, on weightless lines of 1 m or more side by side: their natural lengths."""
    names = [f"line {i}" for i in range(len(lines))]
    web = Web([[0.0, 0.0, 0.0], [0.0, 0.0, -1.0]], [[0, 1]] * len(lines), lines, rim=[0], groups=names)
    return refweb.Scene(
        web=web,
        cable=refweb.Cable(law="tension-only", modulus=E, area=AREA, density=0.0, strength=strength),
        effects=[
            refweb.PointMass(node=1, mass=MASS),
            refweb.Velocity(node=1, value=(0.0, 0.0, -speed)),
            *effects,
        ],
        **dict(
            solve=refweb.Dynamic(duration=0.1, method=method, **FINER.get(method, {})),
            output=refweb.Output(interval=5e-3),
            observe=[
                refweb.Observe(name="speed", quantity="velocity", node=1, component="z", reduce="final"),
                refweb.Observe(name="stress", quantity="stress", reduce="max"),
                refweb.Observe(name="strain", quantity="strain", line=0, reduce="final"),
                refweb.Observe(name="strained", quantity="strain", reduce="max"),
                refweb.Observe(name="slack", quantity="slack_fraction", reduce="min"),
                refweb.Observe(name="held", quantity="rupture_energy", reduce="final"),
            ],
        )
        | parts,
    )


STRENGTH = 5e7
HELD = 0.5 * STRENGTH**2 / E * AREA
"""Energy of a line of 1 m at its strength [J]."""
RATE = np.sqrt(STIFF / MASS)


def close_books(solution):
    assert solution.solver["energy_drift"] < 1e-3 and solution.solver["momentum_drift"] < 1e-4


@pytest.mark.parametrize("method", [*METHODS, "explicit"])
def test_mass_on_a_line_that_breaks(method):
    """It leaves with v² = v₀² − 2 W/m at the time at which k v₀/ω sin ωt is the strength times the area."""
    solution = refweb.run(thrown([1.0], [Rupture(strength=STRENGTH)], method=method))
    (broken,) = solution.breaks
    found, moment = solution.results, np.arcsin(STRENGTH * AREA / (STIFF * SPEED) * RATE) / RATE
    assert abs(found["speed"].value + np.sqrt(SPEED**2 - 2.0 * HELD / MASS)) < found["speed"].error
    assert abs(broken["time"] - moment) < broken["error"] < 1e-3 * moment
    np.testing.assert_allclose(broken["energy"], HELD, rtol=1e-9)
    np.testing.assert_allclose(broken["place"], [0.0, 0.0, -0.5 - 0.5 * STRENGTH / E], rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose([found["stress"].value, found["held"].value], [STRENGTH, HELD], rtol=1e-6)
    np.testing.assert_allclose(found["strained"].value, STRENGTH / E, rtol=1e-6)  # and none of what is broken
    assert found["slack"].value == 0.0 and solution.history["slack"][-1] == 1.0
    assert found["strain"].value == 0.0 and solution.state.tension[0] == 0.0 and solution.state.strain[0] == 0.0
    close_books(solution)
    assert np.ptp(solution.history["total_energy"]) < 1e-3 * solution.history["total_energy"][0]


def breaking():
    """The system of that mass."""
    web = Web([[0.0, 0.0, 0.0], [0.0, 0.0, -1.0]], [[0, 1]])
    net = discretisation.build(web, refweb.Cable(law="linear", modulus=E, area=AREA, density=0.0))
    velocity = refweb.Velocity(node=1, value=(0.0, 0.0, -SPEED))
    effects = [Elasticity(), refweb.PointMass(node=1, mass=MASS), velocity, Rupture(strength=STRENGTH)]
    return System(net, effects, np.array([[True] * 3, [False] * 3]))


def oscillator(solver, **options):
    """(Time of the break, speed at 0.1 s) of that mass by an integrator."""
    method = with_breaks(lambda *parts: solver(*parts, **options), breaking(), [])
    course = method.start()
    method.advance(course, [0.1])
    return course.breaks.times[0], course.v[1, 2]


def test_a_break_leaves_what_the_system_shows():
    """A run and its twin are of one system at once: a break of the one is not found with tensions of the other."""
    system = breaking()
    taut = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -2.0 * STRENGTH / E]])
    shown = system.forces(0.0, taut).per_cell.tension
    method = with_breaks(lambda *parts: CentralDifference(*parts, step_size=1e-3), system, [])
    course = method.start()
    assert shown[0] == pytest.approx(2.0 * STRENGTH * AREA) and not len(course.breaks.elements)
    method.advance(course, [0.1])
    assert shown[0] == pytest.approx(2.0 * STRENGTH * AREA) and len(course.breaks.elements) == 1


@pytest.mark.parametrize("order, counts", [(2, (34, 48, 68, 96)), (4, (10, 12, 17, 24)), (6, (10, 12, 17, 24))])
def test_order_across_a_break(order, counts):
    """Steps end where it breaks, so that a break costs no method its order."""
    solver, options = (Splitting, {"order": order}) if order > 2 else (CentralDifference, {})
    steps = 0.1 / np.array(counts)
    found = np.array([oscillator(solver, step_size=step, **options) for step in steps])
    exact = np.arcsin(STRENGTH * AREA / (STIFF * SPEED) * RATE) / RATE, -np.sqrt(SPEED**2 - 2.0 * HELD / MASS)
    for errors in np.abs(found - exact).T:
        slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
        assert abs(slope - order) < 0.35  # of few steps, of which the last before the break is of any length


@pytest.mark.ordinary("central-difference", "cvode")
@pytest.mark.parametrize("method", METHODS)
def test_cascade_of_three_lines(method):
    """Lines side by side of other lengths and strengths: one after another is taut and breaks; in closed form."""
    solution = refweb.run(three.thrown(three.LENGTHS, three.STRENGTHS, method))
    times, speed = three.cascade()
    assert [one["line"] for one in solution.breaks] == [0, 1, 2]
    for one, moment in zip(solution.breaks, times, strict=True):
        assert abs(one["time"] - moment) < one["error"]
    assert abs(solution.results["speed"].value + speed) < solution.results["speed"].error
    held = sum(map(three.held, three.LENGTHS, three.STRENGTHS))
    np.testing.assert_allclose(0.5 * MASS * (SPEED**2 - speed**2), held, rtol=1e-12)  # the closed form by energies
    np.testing.assert_allclose(solution.results["held"].value, held, rtol=1e-8)
    close_books(solution)


def test_lines_alike_break_together():
    """And what one of two holds is half of what both do."""
    solution = refweb.run(thrown([1.0, 1.0], [Rupture()], strength=0.5 * STRENGTH))
    assert [one["line"] for one in solution.breaks] == [0, 1]
    assert solution.breaks[0]["time"] == solution.breaks[1]["time"]
    np.testing.assert_allclose([one["energy"] for one in solution.breaks], 0.25 * HELD, rtol=1e-9)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("moment", [0.02, 0.0123])
def test_a_line_that_breaks_at_a_time(method, moment):
    """On a row and between rows; v = v₀ cos ωt from then on."""
    solution = refweb.run(thrown([1.0], [Rupture(at=[[0, moment]])], method=method))
    (broken,) = solution.breaks
    assert broken["time"] == moment and broken["error"] < 1e-15
    result = solution.results["speed"]
    assert abs(result.value + SPEED * np.cos(RATE * moment)) < result.error
    row = np.flatnonzero(solution.history["time"] == 0.02)[0]
    assert solution.history["rupture_energy"][row] > 0.0
    close_books(solution)


def test_what_breaks_at_the_start():
    solution = refweb.run(thrown([0.9], [Rupture(strength=1e6)]))
    assert solution.breaks[0]["time"] == 0.0
    np.testing.assert_allclose(solution.history["kinetic_energy"], 0.5 * MASS * SPEED**2, rtol=1e-12)
    np.testing.assert_allclose(solution.results["held"].value, 0.5 * STIFF / 0.9 * 0.01, rtol=1e-9)


def test_a_web_that_holds_moves_as_without():
    one, other = (
        refweb.run(thrown([1.0], [Rupture(strength=1e12)])),
        refweb.run(thrown([1.0], [Rupture(at=[[0, 9.0]])])),
    )
    observe = [o for o in thrown([1.0], []).observe if o.name != "held"]
    plain = refweb.run(thrown([1.0], [], observe=observe))
    assert one.breaks == other.breaks == [] and plain.breaks is None
    for name in ("speed", "stress"):
        assert one.results[name] == other.results[name] == plain.results[name]


def hanging(force, steps=(1.0,), **rupture):
    web = Web([[0, 0, 0], [0, 0, -1.0], [0, 0, -2.0]], [[0, 1], [1, 2]], rim=[0], groups=["upper", "lower"])
    return refweb.Scene(
        web=web,
        cable=refweb.Cable(law="tension-only", modulus=E, area=AREA, density=0.0),
        effects=[refweb.Load(node=2, force=(0.0, 0.0, -force)), *([Rupture(**rupture)] if rupture else [])],
        solve=refweb.Static(load_steps=steps),
    )


@pytest.mark.parametrize(
    "steps, rupture, line, step",
    [
        ((1.0,), dict(strength=1.5e7, groups={"upper": {"strength": 1e9}}), 1, 0.75),
        ((0.25, 0.5, 1.0), dict(strength=1e9, groups={"upper": GroupRupture(strength=1.2e7)}), 0, 0.6),
        ((0.25, 0.5, 1.0), dict(at=[[1, 0.4]]), 1, 0.4),
        ((1.0,), dict(strength=1e7, at=[[0, 0.6]]), 0, 0.5),
    ],
)
def test_statics_ends_at_the_first_break(steps, rupture, line, step):
    """The tension is 20 N times the load step."""
    with pytest.raises(refweb.SolverError, match=f"line {line} would break at load step {step:g},"):
        refweb.run(hanging(20.0, steps, **rupture))


def test_statics_without_a_break():
    """Proven as ever."""
    with_it, plain = (refweb.run(hanging(20.0, **rupture)) for rupture in (dict(strength=3e7), {}))
    assert with_it.results == plain.results and with_it.results["max_tension"].error is not None
    np.testing.assert_allclose(with_it.state.utilisation, 20.0 / AREA / 3e7, rtol=1e-9)


def struck(effects=(), rows=4, **parts):
    """A square net with strong rim, hit by a ball that tears it."""
    return refweb.Scene(
        web=refweb.Window(mesh="square", rows=rows, columns=rows, side=0.1),
        cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-6, density=1000.0, **parts.pop("cable", {})),
        effects=[
            refweb.Body(name="ball", radius=0.08, mass=0.1, position=(0.013, 0.007, 0.081), velocity=(0.0, 0.0, -16.0)),
            refweb.Contact(stiffness=2e4),
            Rupture(strength=8e6),
            *effects,
        ],
        **dict(solve=refweb.Dynamic(duration=5e-3), output=refweb.Output(interval=2.5e-4, frames=2)) | parts,
    )


LOSING = [refweb.Damping(time=1e-5, rate=0.1), refweb.Drag(density=1.2)]


@pytest.mark.slow
@pytest.mark.parametrize("effects", nets.some([([],), (LOSING,)], 2))
def test_two_methods_tear_a_net_alike(effects):
    """A ball breaks the first lines of a net in the same order, at times that differ by no more than both ±."""
    found = [refweb.run(struck(effects, solve=refweb.Dynamic(duration=5e-3, method=m))) for m in METHODS[:2]]
    known = [[one for one in solution.breaks if one["error"] is not None] for solution in found]
    assert min(map(len, known)) >= 2
    for one, other in zip(*known, strict=False):
        assert one["element"] == other["element"]
        assert abs(one["time"] - other["time"]) < one["error"] + other["error"]
    for solution in found:
        assert solution.solver["energy_drift"] < 1e-2 and solution.solver["momentum_drift"] < 1e-2
        assert (solution.history["rupture_energy"][1:] >= solution.history["rupture_energy"][:-1]).all()
        broken = [one["line"] for one in solution.breaks]
        assert (
            not solution.state.tension[broken].any()
            and not solution.state.overlap(solution.state.system.net.bodies[0])[broken].any()
        )


@pytest.mark.parametrize("method", nets.some(METHODS[:2], 2))
def test_a_torn_run_resumes(tmp_path, method):
    """A run that is killed goes on with what was broken: explicit steps bit for bit."""
    scene = struck(solve=refweb.Dynamic(duration=5e-3, method=method))
    whole, killed = tmp_path / "whole", tmp_path / "killed"

    full = refweb.run(scene, out=whole)

    def stop(text, share):
        if share > 0.8:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        refweb.run(scene, out=killed, progress=stop)
    with np.load(killed / "checkpoint.npz") as kept:
        assert len(kept["broken"]) and len(kept["run"]["broken_elements"]) == len(kept["broken"])
    resumed = refweb.resume(killed)
    if method == "central-difference":
        assert (
            resumed.breaks == full.breaks
            and (killed / "history.csv").read_text() == (whole / "history.csv").read_text()
        )
    else:
        assert [one["element"] for one in resumed.breaks] == [one["element"] for one in full.breaks]
    read = refweb.load(whole)
    assert read.breaks == full.breaks
    np.testing.assert_array_equal(read.state.tension, full.state.tension)
    assert not read.state.tension[[one["line"] for one in full.breaks]].any()


def test_another_run_starts_from_the_torn_web(tmp_path):
    first = refweb.run(struck(solve=refweb.Dynamic(duration=5e-3)), out=tmp_path / "first")
    lines = sorted(one["line"] for one in first.breaks)
    start = dict(start=str(tmp_path / "first"), duration=1e-3)
    scene = struck(solve=refweb.Dynamic(**start))
    second = refweb.run(scene, out=tmp_path / "second")
    assert lines and set(second.state.system.net.broken) >= set(lines)
    assert not second.state.tension[lines].any() and second.history["rupture_energy"][0] == 0.0
    np.testing.assert_array_equal(refweb.load(tmp_path / "second").state.tension, second.state.tension)
    without = refweb.run(scene.replace(effects=[e for e in scene.effects if not isinstance(e, Rupture)]))
    assert without.broken_before == second.broken_before == lines and without.breaks == []
    assert not without.state.tension[lines].any() and not without.state.strain[lines].any()


PRESTRAIN, WEIGHT = 0.01, 5.0
HELD_AT = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]])


def pulled(at=(), web=None, duration=0.05, interval=None, **solve):
    """A mass on two taut lines of 1 m that is pulled aside, of which the second breaks at some times."""
    whole = refweb.Inline(points=[HELD_AT[0], [1, 0, 0], HELD_AT[1]], lines=[[0, 1], [1, 2]], supports=[0, 2])
    return refweb.Scene(
        web=web or whole,
        cable=refweb.Cable(
            law="tension-only", modulus=1e7, area=1e-4, density=100.0, prestrain=0.0 if web else PRESTRAIN
        ),
        effects=[refweb.Load(node=1, force=(0.0, 0.0, WEIGHT)), *([Rupture(at=[[1, t] for t in at])] if at else [])],
        solve=refweb.Dynamic(duration=duration, **solve),
        output=refweb.Output(interval=interval),
        observe=[
            refweb.Observe(name="z", quantity="position", node=1, component="z"),
            *(refweb.Observe(name=name, quantity=name, line=1, reduce="max") for name in ("tension", "strain")),
        ],
    )


def place(*spans):
    """z of that mass by DOP853, on so many lines for so long (lines, end) one after the other."""

    def rate(t, y, lines):
        toward = HELD_AT[:lines] - y[:3]
        far = np.linalg.norm(toward, axis=1)
        pull = 1e3 * np.maximum(far * (1.0 + PRESTRAIN) - 1.0, 0.0) / far
        return np.append(y[3:], (pull @ toward + [0.0, 0.0, WEIGHT]) * (1.0 + PRESTRAIN) / 1e-2)

    y, begin = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0]), 0.0
    for lines, end in spans:
        y, begin = (
            solve_ivp(rate, (begin, end), y, "DOP853", args=(lines,), max_step=1e-3, rtol=1e-10, atol=1e-12).y[:, -1],
            end,
        )
    return y[2]


@pytest.mark.parametrize("method", METHODS)
def test_a_frame_keeps_its_broken_lines(tmp_path, method):
    """As a web it moves on the line that is left: z of DOP853 on one line, not on two; and its own frames do so."""
    refweb.run(pulled([0.02]), out=tmp_path / "torn")
    web = refweb.File(path=str(sorted((tmp_path / "torn" / "frames").glob("web_*.vtu"))[-1]))
    found = refweb.run(pulled(web=web, duration=0.01, method=method), out=tmp_path / "again")
    z, one, two = found.results["z"], place((1, 0.01)), place((2, 0.01))
    assert abs(z.value - one) < max(z.error, 1e-6 * one) < 0.01 * abs(two - one)
    assert found.results["tension"].value == 0.0 and found.results["strain"].value <= 0.0
    assert found.state.tension[1] == found.state.strain[1] == 0.0
    assert found.breaks == [] and found.broken_before == [1]
    again = refweb.run(pulled([0.005], web=web, duration=0.01, method=method))
    assert again.breaks == [] and again.results["z"].value == z.value  # what is broken does not break at a time
    assert "1 line before the run began: 1" in dict(on_run(found.summary()))["broken"]
    read = refweb.load(tmp_path / "again")
    assert read.broken_before == [1] and read.state.tension[1] == 0.0
    last = refweb.File(path=str(sorted((tmp_path / "again" / "frames").glob("web_*.vtu"))[-1]))
    assert last.web().broken.tolist() == [1]


def test_statics_refuses_a_frame_with_broken_lines(tmp_path):
    refweb.run(pulled([0.0], duration=0.01)).save(tmp_path / "torn")
    web = refweb.File(path=str(tmp_path / "torn" / "frames" / "web_000000.vtu"))
    words = r"\[web\] line 1 is broken, and statics takes no broken lines"
    still = pulled(web=web).replace(solve=refweb.Static(), output=refweb.Output())
    for scene in (still, pulled(web=web, start="equilibrium")):
        with pytest.raises(refweb.InputError, match=words):
            refweb.run(scene)
    with pytest.raises(refweb.InputError, match="line 1 is broken, and statics takes"):
        refweb.modes(pulled(web=web))
    with pytest.raises(refweb.InputError, match="ties the ends of a line together that breaks"):
        refweb.run(pulled(web=web, method="cvode", mass="consistent"))


@pytest.mark.ordinary("central-difference-at0")
@pytest.mark.parametrize("method, at", nets.some([(method, at) for method in METHODS for at in ((), (0.02,))], 3))
def test_a_line_breaks_once(tmp_path, method, at):
    """A run that starts behind a break has the same line broken, with a [rupture] that names it again or without."""
    first = refweb.run(pulled([0.02], method=method))
    first.save(tmp_path / "torn")
    found = refweb.run(pulled(at, start=str(tmp_path / "torn"), method=method))
    z = found.results["z"]
    assert len(first.breaks) == 1 and found.breaks == [] and found.broken_before == [1] == [first.breaks[0]["line"]]
    assert abs(z.value - place((2, 0.02), (1, 0.1))) < z.error
    assert found.results["tension"].value == 0.0 and found.results["strain"].value == 0.0


def test_a_killed_run_goes_on_with_what_was_broken_before(tmp_path):
    """Bit for bit, and without the folder that it started from."""
    refweb.run(pulled([0.02])).save(tmp_path / "torn")
    scene = pulled(start=str(tmp_path / "torn"), interval=0.005)
    whole = refweb.run(scene, out=tmp_path / "whole")

    def stop(text, share):
        if share > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        refweb.run(scene, out=tmp_path / "killed", progress=stop)
    shutil.rmtree(tmp_path / "torn")
    resumed = refweb.resume(tmp_path / "killed")
    assert resumed.results == whole.results and resumed.broken_before == [1]
    assert (tmp_path / "killed" / "history.csv").read_text() == (tmp_path / "whole" / "history.csv").read_text()


def test_what_is_drawn(tmp_path):
    """Frames say what is broken; a web of which nothing may break has no such field."""
    import meshio

    solution = refweb.run(struck(), out=tmp_path / "torn")
    last = meshio.read(sorted((tmp_path / "torn" / "frames").glob("web_*.vtu"))[-1])
    assert np.flatnonzero(last.cell_data["broken"][0]).tolist() == sorted(one["line"] for one in solution.breaks)
    from refweb.results.vtu import frame_data

    plain = nets.system(nets.skew_web(), nets.skew_cable())
    assert "broken" not in frame_data(State(plain, 0.0, np.zeros((plain.rows, 3))))[2]


@pytest.mark.parametrize("method, order, subdivide", [("central-difference", 1, 4), ("cvode", 1, 3), ("ida", 2, 2)])
def test_what_hangs_below_a_break_falls(method, order, subdivide):
    """One element breaks, behind the middle of its line; the rest of the line hangs on. What is below falls freely."""
    web = Web([[0, 0, 0], [0, 0, -1.0], [0, 0, -2.0]], [[0, 1], [1, 2]], rim=[0])
    scene = refweb.Scene(
        web=web,
        cable=refweb.Cable(law="tension-only", modulus=1e8, area=1e-5, density=1e4, order=order, subdivide=subdivide),
        effects=[
            refweb.PointMass(node=2, mass=0.5),
            refweb.Gravity(acceleration=(0.0, 0.0, -9.81)),
            Rupture(at=[[0, 0.01]]),
        ],
        solve=refweb.Dynamic(duration=0.05, method=method, start="equilibrium", **FINER.get(method, {})),
        output=refweb.Output(interval=0.01, frames=1),
    )
    solution = refweb.run(scene)
    net = solution.state.system.net
    (broken,) = solution.breaks
    assert broken["line"] == 0 and broken["element"] == subdivide // 2 and net.broken.tolist() == [broken["element"]]
    below = net.points[:, 2] < net.points[net.cells[broken["element"]], 2].min() + 1e-9
    for _, state in solution.frames[1:]:
        middle, speed = (net.mass[below] @ a[below, 2] / net.mass[below].sum() for a in (state.x, state.v))
        start = net.mass[below] @ solution.frames[0][1].x[below, 2] / net.mass[below].sum()
        fallen = state.time - broken["time"]
        # BDF at 1e-6, and 0.2 m/s at the end.
        np.testing.assert_allclose([middle - start, speed], [-0.5 * 9.81 * fallen**2, -9.81 * fallen], atol=2e-5)
    assert solution.state.element_tension[1 + broken["element"]] >= 0.0
    close_books(solution)


def test_what_ends_with_an_element():
    """Whatever acts through a broken element ends: it adds no force, and the energy of all is kept."""
    from refweb.system.broken_lines import tear

    effects = [
        refweb.Body(name="ball", radius=0.3, mass=1.0, position=(0.5, 0.0, 0.25)),
        refweb.Body(name="box", shape="box", size=(0.2, 0.2, 0.2), mass=1.0, position=(0.5, 0.5, 0.05)),
        refweb.Contact(stiffness=1e3, damping=0.1, friction=0.2),
        refweb.Bending(stiffness=1e-2),
        refweb.Drag(density=1.2, bodies={"box": dict(coefficient=1.0, area=0.04)}),
        refweb.Damping(time=1e-3),
        refweb.Pressure(lines="all", normal=(0, 0, 1), value=0.3),
        refweb.Thrust(node=0, line=0, force=1.0),
        Rupture(strength=1e9),
    ]
    web = Web([[0, 0, 0], [1, 0, 0], [2, 0.1, 0], [0.5, 0.5, 0], [1.0, 0.9, 0.0]], [[0, 1], [1, 2], [1, 3], [3, 4]])
    net = discretisation.build(web, refweb.Cable(law="linear", modulus=1e6, area=1e-4, density=100.0))
    whole = System(net, [Elasticity(), *effects], np.zeros((5, 3), dtype=bool))
    rng = np.random.default_rng(0)
    x, v = 0.02 * rng.uniform(-1, 1, (whole.rows, 3)), rng.uniform(-1, 1, (whole.rows, 3))
    x[-2:], v[-2:] = 0.0, 0.0
    torn, held = tear(whole, 0.0, x, v, np.arange(4))
    acting = {term.name for term in whole.terms if np.abs(whole.force_of(term, 0.0, x, v)).max() > 0.0}
    assert acting == {"elasticity", "contact", "bending", "drag", "damping", "pressure", "thrust"}
    for term in torn.terms:
        if term.name != "drag" or term.cells.shape[1] > 1:  # of bodies it stays
            assert not torn.force_of(term, 0.0, x, v)[: net.nodes].any(), term.name
        cells = torn.stiffness(0.0, x, v, only=[term])
        assert not np.abs(cells).max(initial=0.0) > 0.0 or term.name == "drag", term.name
    before, after = (sum(s.energy_of(f, 0.0, x).sum() for f in s.terms) for s in (whole, torn))
    np.testing.assert_allclose(after, before, rtol=1e-12)
    assert held.sum() == pytest.approx(before, rel=1e-12)


def test_order_beyond_the_horizon():
    """Where run and twin break other lines, what is found from the earlier of both on has no ±, and it is said."""
    from refweb.dynamics.break_errors import add_errors_of_breaks
    from refweb.results.solution import Result
    from refweb.system.broken_lines import Breaks

    def breaks(elements, times):
        count = len(elements)
        zeros = np.zeros(count)
        return Breaks(np.array(elements), np.array(times), zeros, np.zeros((count, 3)), zeros)

    solution = refweb.run(thrown([1.0, 1.0, 1.0], [Rupture(at=[[0, 0.01]])]))
    own, other = breaks([0, 1, 2], [0.01, 0.02, 0.03]), breaks([0, 2, 1], [0.011, 0.019, 0.03])
    solution.breaks = [{"line": n, "time": float(t), "error": None} for n, t in enumerate(own.times)]
    solution.reduced = {name: Result(1.0, 0.1, "m", time, None) for name, time in (("early", 0.015), ("late", 0.025))}
    solution.events = [{"name": "one", "time": 0.03, "error": 1e-3}]
    add_errors_of_breaks(solution, own, other, 2.0)
    assert (
        solution.breaks[0]["error"] == pytest.approx(2e-3) and [b["error"] for b in solution.breaks[1:]] == [None] * 2
    )
    assert solution.results["early"].error == 0.1 and solution.results["late"].error is None
    assert solution.events[0]["error"] is None
    assert "beyond the horizon from t = 0.019 s on: break 2 is of line 1 at t = 0.02 s" in solution.warnings[-1]
    solution.breaks, solution.reduced["early"] = [], Result(1.0, 0.1, "m", 0.015, None)
    add_errors_of_breaks(solution, breaks([], []), breaks([1], [0.01]), 2.0)
    assert "break 1 is none" in solution.warnings[-1] and solution.results["early"].error is None
    solution.breaks = [{"line": n, "time": t, "error": None} for n, t in enumerate((0.01, 0.0102))]
    add_errors_of_breaks(solution, breaks([0, 1], [0.01, 0.0102]), breaks([0, 1], [0.0101, 0.0103]), 2.0)
    assert "lines 0 and 1 break within ± of each other" in solution.warnings[-1]


@pytest.mark.parametrize(
    "change, words",
    [
        (dict(effects=[Rupture(strength=1e7)]), "needs mass at every node that moves: node 1 has none"),
        (dict(effects=[Rupture()]), "strength is missing"),
        (dict(effects=[Rupture(at=[[3, 0.1]])]), r"at\[0\]\[0\] = 3 is not a line, must be 0 … 0"),
        (dict(effects=[Rupture(strength=1e7, groups={"rims": {}})]), "is not a group of lines"),
        (dict(solve=dict(mass="consistent")), '"consistent", which ties the ends'),
    ],
)
def test_refusals(change, words):
    effects = change.pop("effects", None)
    scene = thrown([1.0], effects or [Rupture(strength=1e7)])
    if "solve" in change:
        scene = scene.replace(solve=refweb.Dynamic(duration=0.1, method="cvode", **change["solve"]))
    if "mass" in words:
        scene = scene.replace(effects=effects, solve=refweb.Dynamic(duration=0.1, method="ida"))
    with pytest.raises(refweb.InputError, match=words):
        refweb.run(scene)


@pytest.mark.parametrize("at", [[[0.5, 0.1]], [[0, -1.0]], [[0, 0.1], [0, 0.2]]])
def test_breaks_that_are_none(at):
    with pytest.raises(refweb.InputError, match=r"at\[\d\]\[\d\] = "):
        Rupture(at=at)


@pytest.mark.slow
def test_auto_and_cost():
    """Breaks are found by whatever method is chosen, and by all that ``refweb cost`` compares but DOP853."""
    scene = thrown([1.0], [Rupture(strength=STRENGTH)])
    solution = refweb.run(scene.replace(solve=refweb.Dynamic(duration=0.1)))
    assert len(solution.breaks) == 1
    found = refweb.cost(scene, budget=5.0)
    ends = {t.method: t.values[-1] for t in found.trials if t.status == "solved"}
    assert {"central-difference", "cvode-bdf", "ida"} <= set(ends) and "dop853" not in ends
    speed = np.sqrt(SPEED**2 - 2.0 * HELD / MASS)
    np.testing.assert_allclose(np.abs(list(ends.values())), speed, rtol=1e-4)


def test_the_summary_tells_of_breaks():
    solution = refweb.run(struck())
    words = [text for name, text in on_run(solution.summary()) if text.startswith("line")]
    assert len(words) == len(solution.breaks) and words[0].startswith(f"line {solution.breaks[0]['line']} at t = ")


@pytest.mark.slow
def test_pictures_of_broken_lines(tmp_path):
    """Frames and pages mark broken lines, with a colour of their own."""
    from refweb.pictures.record import of_folder
    from refweb.pictures.stage import BROKEN, Seen

    solution = refweb.run(struck(), out=tmp_path / "torn")
    record = of_folder(tmp_path / "torn")
    frame = record.frame(max(record.times))
    assert np.flatnonzero(frame.broken).tolist() == sorted(one["line"] for one in solution.breaks)
    assert Seen.of(frame, "tension").broken and not Seen.of(record.frame(0), "tension").broken
    solution.report(tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text()
    assert f"--mark:rgb({','.join(str(round(255 * c)) for c in BROKEN)})" in text
