"""Work and precision of every method on a scene, the command ``refweb cost``, and ``method = "auto"``."""

import csv
import json
import math
import re

import numpy as np
import pytest

import refweb
from refweb import scene as scenes
from refweb.__main__ import main
from refweb.dynamics.integrators.central_difference import CentralDifference
from refweb.dynamics.integrators.integrator import Variant
from refweb.dynamics.method_choice import decided
from refweb.dynamics.simulation import Simulation
from refweb.registry import INTEGRATORS
from refweb.studies import trials
from refweb.studies.budget import TURN, climb
from refweb.studies.cost import COLUMNS, Cost
from refweb.studies.references import compare
from refweb.studies.trials import OverBudget, Trial, dynamic_ladders

TAUT = dict(law="smooth", smoothing=1e-3, modulus=7e7, area=1e-4, density=200.0, prestrain=1e-2)
THROWN = refweb.Velocity(node="centre", value=(0.5, 0.2, 2.0))
SLACK = dict(law="tension-only", modulus=7e7, area=1e-4, density=200.0)
MASSLESS = dict(cable={**SLACK, "density": 0.0, "prestrain": 1e-2}, web=refweb.Window(mesh="square", rows=4, columns=4,
                side=0.2))  # fmt: skip
DAMPED = refweb.Damping(time=2e-3, rate=30.0)


def scene(effects=(THROWN,), duration=0.01, web=None, interval=None, accuracy=None, solve=None, cable=TAUT, **more):
    """A small square web under prestress."""
    return refweb.Scene(
        title="Small",
        web=web or refweb.Window(mesh="square", rows=2, columns=2, side=0.2),
        cable=refweb.Cable(**{**cable, **more}),
        effects=effects,
        observe=(
            refweb.Observe(name="energy", quantity="kinetic_energy"),
            refweb.Observe(name="centre", quantity="displacement", node="centre"),
            refweb.Observe(name="tension", quantity="tension"),
        ),
        output=refweb.Output(interval=None if solve and solve.kind == "static" else interval or min(duration, 1e-3)),
        accuracy=accuracy,
        solve=solve or refweb.Dynamic(duration=duration),
    )


METHODS = set(dynamic_ladders())
ENOUGH = 1e4
"""A budget that nothing comes near [s], whatever else the machine has to do."""


@pytest.fixture
def coarse(monkeypatch):
    """BDF, of thousands of steps at fine tolerances, only to 1e-5."""
    monkeypatch.setitem(trials.SETTINGS, "rtol", (1e-3, 1e-4, 1e-5))


@pytest.fixture(scope="module")
def found():
    """All runs of a small scene, BDF as above."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(trials.SETTINGS, "rtol", (1e-3, 1e-4, 1e-5))
        return refweb.cost(scene(), budget=ENOUGH)


def ladder(found, method):
    return [t for t in found.trials if t.method == method and t.status == "solved"]


@pytest.mark.slow
def test_what_is_compared(found):
    """The first observable that a state alone determines, by every method at every setting."""
    assert found.observable.name == "centre" and found.status == "solved"
    assert {t.method for t in found.trials} == METHODS
    assert all(t.status == "solved" for t in found.trials)


@pytest.mark.slow
def test_references_agree(found):
    """Two kinds of method agree to ten digits on a smooth motion; neither refweb's loop nor scipy can make that up."""
    one, other = found.references
    assert found.independent and one.kind != other.kind
    assert found.trust[0] <= 1e-10 * found.scale and found.trust[1] <= 1e-10 * np.abs(one.x).max()


@pytest.mark.slow
def test_errors_fall_with_the_order(found):
    """Fitted to the observable: 2, 4 and 6 over the step; ±0.5, as the coarsest steps are at 0.9 of the bound."""
    for method, order in (("central-difference", 2), ("explicit-4", 4), ("explicit-6", 6)):
        known = [t for t in ladder(found, method) if t.error_state > 10.0 * found.trust[1]]
        slope = np.polyfit(np.log([1.0 / t.work["nsteps"] for t in known]), np.log([t.error_state for t in known]), 1)[
            0
        ]
        assert len(known) >= 2 and abs(slope - order) < 0.5, (method, slope)
    for method in ("cvode-bdf", "cvode-adams", "ida", "dop853"):
        first, *_, last = ladder(found, method)
        assert last.error_state < 0.1 * first.error_state, method


def test_work_is_counted(found):
    for t in found.trials:
        if t.status == "solved":
            stages = {"central-difference": 1, "explicit-4": 6, "explicit-6": 11}.get(t.method)
            assert stages is None or t.work["nfev"] == stages * t.work["nsteps"] + 1
            assert t.work["nfev"] > 0 and t.cpu_s > 0.0
            assert (t.work["nlu"] > 0) == (t.kind in ("bdf", "cvode-adams"))


def test_price(found):
    """More digits never cost less; digits that the references do not have cost what nobody knows."""
    prices = [found.price(digits).cpu_s for digits in (1, 3, 6, 9)]
    assert prices == sorted(prices)
    assert found.price(17) is None
    assert {found.price(digits).method for digits in range(1, 10)} <= {t.method for t in found.trials} - {"dop853"}
    assert found.price(3, "ida").method == "ida"
    prices = re.findall(r"(\d+) digits (?:cost )?[\d.e-]+ s with ([\w-]+)", found.sentence)
    assert prices and all(found.price(int(digits)).method == method for digits, method in prices), found.sentence
    assert "agree to" in found.sentence


@pytest.mark.slow
def test_folder(found, tmp_path):
    found.save(tmp_path / "cost")
    with open(tmp_path / "cost" / "cost.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert (
        list(rows[0])
        == COLUMNS
        == ("method,setting,error_observable,error_state,cpu_s,nfev,njev,nlu,nsteps,status".split(","))
    )
    assert len(rows) == len(found.trials)
    for row, t in zip(rows, found.trials, strict=True):
        assert row["method"] == t.method and row["status"] == t.status
        assert t.status != "solved" or float(row["error_state"]) == t.error_state
    assert (tmp_path / "cost" / "cost.png").read_bytes().startswith(b"\x89PNG")
    summary = json.loads((tmp_path / "cost" / "run.json").read_text())
    assert summary["kind"] == "cost" and summary["sentence"] == found.sentence
    with pytest.raises(refweb.InputError, match="is not empty"):
        found.save(tmp_path / "cost")
    (tmp_path / "cost" / "mine.txt").write_text("stays")
    found.save(tmp_path / "cost", force=True)
    assert (tmp_path / "cost" / "mine.txt").exists()
    assert refweb.Scene.load(tmp_path / "cost" / "scene.toml").title == "Small"


class Clock:
    """A clock that goes on by what is done, and by ``tick`` each time it is looked at."""

    def __init__(self, monkeypatch, tick=0.0):
        self.now, self.tick = 0.0, tick
        monkeypatch.setattr(trials, "clock", self)

    def __call__(self):
        self.now += self.tick
        return self.now


class Priced:
    """Runs that take what they cost by a clock: the coarsest of a method, at 1, its price, at 1/2 a growth times that.

    ``allowed`` lists what each may take.
    """

    def __init__(self, clock, prices, growth):
        self.clock, self.prices, self.growth, self.allowed = clock, prices, growth, []

    def expected(self, trial):
        return 0.0

    def run(self, trial, deadline):
        price = self.prices[trial.method] * self.growth ** -math.log2(trial.value)
        self.allowed.append(deadline - self.clock.now)
        if price > deadline - self.clock.now:
            self.clock.now = max(deadline, self.clock.now)
            raise OverBudget
        self.clock.now += price
        trial.cpu_s = price


def climbed(monkeypatch, prices, growth=3.0, budget=100.0):
    """Trials of methods of known prices, by method, and what has run them; a tenth of the budget is kept."""
    clock = Clock(monkeypatch)
    ladders = {name: [Trial(name, "rtol", 2.0**-rung) for rung in range(8)] for name in prices}
    runner = Priced(clock, prices, growth)
    climb(ladders, runner, 0.9 * budget, budget, lambda text, share: None)
    return ladders, runner


def test_budget(monkeypatch):
    """What there is no time for is left out, of each method all that is finer; all kinds have come to some digits."""
    ladders, runner = climbed(monkeypatch, {"cheap": 0.5, "dear": 2.0, "dearest": 8.0})
    assert runner.clock.now <= 90.0
    for ladder in ladders.values():
        solved = [t.status == "solved" for t in ladder]
        assert solved[0] and not solved[-1] and solved == sorted(solved, reverse=True)
        assert all("budget" in t.message for t in ladder if t.status == "budget")
    assert 0.0 < max(runner.allowed) <= 30.0
    counts = [sum(t.status == "solved" for t in ladder) for ladder in ladders.values()]
    assert counts == sorted(counts, reverse=True) and counts[0] > counts[-1]


def test_every_method_has_its_turn(monkeypatch):
    """However little the others have left, the coarsest run may take `TURN` of the budget."""
    greedy = {f"greedy {i}": 0.3 * 90.0 * 0.7**i for i in range(7)}
    late = {"small": 99.0 * TURN, "large": 101.0 * TURN}
    ladders, runner = climbed(monkeypatch, {**greedy, **late})
    left = 90.0 * 0.7**7
    assert left / 3.0 < late["small"] and [t.status for t in ladders["small"][:2]] == ["solved", "budget"]
    assert ladders["large"][0].status == "budget" and "took more than its share" in ladders["large"][0].message
    assert runner.clock.now <= 90.0 + 2 * 100.0 * TURN


@pytest.mark.parametrize("method", sorted(METHODS))
def test_a_run_is_ended_at_its_deadline(monkeypatch, method):
    """The clock is looked at within it, of explicit steps after blocks of rows."""
    given, clock = scene(), Clock(monkeypatch, tick=1.0)
    runner = trials.Dynamics(given, given.build(), given.observables[1])
    first = trials.trials_of(given)[method][0]
    runner.compile(first)
    with pytest.raises(OverBudget):
        runner.run(first, clock.now + 3.5)
    assert clock.now < 10.0 and math.isnan(first.cpu_s)
    runner.run(first, math.inf)
    assert first.cpu_s > 3.5


def test_massless_nodes_are_for_ida_alone(coarse):
    """The other methods are listed as refused, with their reasons, and that no other kind confirms it is said."""
    found = refweb.cost(scene([refweb.PointMass(node="centre", mass=1.0), THROWN], **MASSLESS), budget=ENOUGH)
    refused = {t.method for t in found.trials if t.status == "refused"}
    assert refused == METHODS - {"ida"}
    assert all("has no mass" in t.message for t in found.trials if t.status == "refused")
    assert not found.independent and "only one kind of method" in found.sentence
    assert {t.method for t in found.references} == {"ida"}


@pytest.mark.slow
def test_failures_are_listed(monkeypatch):
    """A run whose book of energy is open has failed, and has no error: BDF of a coarse tolerance loses energy."""
    web = refweb.SingleCable(start=(0, 0, 0), end=(1, 0, 0), elements=10, length=1.05)
    given = scene([refweb.PointMass(node="centre", mass=0.1), THROWN], 0.3, web, cable=SLACK)
    monkeypatch.setitem(trials.SETTINGS, "rtol", (1e-3, 1e-4))
    few = {name: dynamic_ladders()[name] for name in ("central-difference", "cvode-bdf")}
    monkeypatch.setattr(trials, "dynamic_ladders", lambda: few)
    found = refweb.cost(given, budget=ENOUGH)
    failed = [t for t in found.trials if t.status == "failed"]
    assert failed and all(math.isnan(t.error_state) and "energy" in t.message for t in failed)


def test_statics():
    """Newton and relaxation agree to the residual of relaxation; the smooth law's error falls with η."""
    load = refweb.Load(node="centre", force=(0.0, 0.0, 1.0))
    given = scene([load], solve=refweb.Static(load_steps=[1, 2]), cable=SLACK)
    given = given.replace(observe=given.observe[1:])
    found = refweb.cost(given, budget=ENOUGH)
    assert found.independent and {t.method for t in found.references} == {"newton", "relaxation"}
    assert found.trust[0] < 1e-7 * found.scale
    smooth = [t.error_observable for t in found.trials if t.method == "newton-smooth"]
    assert all(a > b for a, b in zip(smooth[:-1], smooth[1:], strict=True)) and smooth[-1] < 1e-2 * smooth[0]


def finest(values):
    """A cost of one run per method, each with one value of the observable and of displacement."""
    found = Cost(scene(), scene().observables[1], [], {})
    for method, value in values.items():
        x = np.full((1, 3), value)
        found.trials.append(
            Trial(method, "rtol", 1e-6, "solved", kind=method, cpu_s=1.0, values=np.array([value]), x=x)
        )
    compare(found)
    return found


def test_agreement_by_luck():
    """Where no pair stands out, the median of the differences counts: 2e-4, 1e-3 and 1.2e-3."""
    lucky = finest({"cvode-bdf": 1.0, "cvode-adams": 1.0002, "dop853": 1.0012})
    assert lucky.apart[0] == pytest.approx(2e-4) and lucky.trust[0] == pytest.approx(1e-3)
    assert "agree to 3.7 digits, which may be luck: 3.0 digits" in lucky.sentence
    clear = finest({"cvode-bdf": 1.0, "cvode-adams": 1.0 + 1e-9, "dop853": 1.001})
    assert clear.trust == clear.apart and clear.trust[0] == pytest.approx(1e-9)
    assert "agree to 9.0 digits." in clear.sentence


def test_kinds():
    """Splittings converge alike, and so do BDF of CVODE and IDA with the same tolerance: they confirm nothing."""
    kinds = {name: ladder.kind for name, ladder in dynamic_ladders().items()}
    assert kinds["explicit-6"] == kinds["central-difference"] and kinds["ida"] == kinds["cvode-bdf"]
    assert len(set(kinds.values())) == 4


def test_a_method_of_the_table_is_compared(coarse, monkeypatch):
    """A line in the table of integrators is all that it takes to run a scene with it, and to have it compared."""
    line = INTEGRATORS["central-difference"]._replace(integrator=f"{__name__}:Halved")
    monkeypatch.setitem(INTEGRATORS, "halved", line)
    given = scene(solve=refweb.Dynamic(duration=0.01, method="halved", safety=0.8))
    solution = refweb.run(given)
    assert solution.solver["method"] == "halved"
    plain = refweb.run(scene(solve=refweb.Dynamic(duration=0.01, safety=0.4)))
    assert solution.results["centre"].value == plain.results["centre"].value
    assert trials.label_of(given.solve) == "halved"
    few = {name: ladder for name, ladder in dynamic_ladders().items() if name in ("halved", "explicit-6")}
    assert few["halved"].kind == "halved"
    monkeypatch.setattr(trials, "dynamic_ladders", lambda: few)
    found = refweb.cost(given, budget=ENOUGH)
    assert {t.status for t in found.trials} == {"solved"} and found.independent
    with pytest.raises(refweb.InputError, match='rtol = 0.1 has no meaning with method = "halved"'):
        refweb.Dynamic(duration=0.01, method="halved", rtol=0.1)


class Halved(CentralDifference):
    """Central differences with half the safety that is asked for."""

    method, variants = "halved", {"halved": Variant()}

    def __init__(self, *arguments, safety=0.5, **keys):
        super().__init__(*arguments, safety=0.5 * safety, **keys)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (dict(budget=0.0), "budget = 0"),
        (dict(budget=math.nan), "budget = nan"),
        (dict(observe="centr"), 'observe = "centr" is not an observable of the scene, did you mean "centre"'),
        (dict(observe="energy"), 'is of quantity "kinetic_energy", must be one of'),
    ],
)
def test_bad_input(options, message):
    with pytest.raises(refweb.InputError, match=message):
        refweb.cost(scene(), **options)


def test_command_line(tmp_path, coarse, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    import tomli_w

    (tmp_path / "small.toml").write_text(tomli_w.dumps(scene(duration=1e-3).to_dict()))
    assert main(["cost", "small.toml", "--budget", "3", "--observe", "tension", "--out", "cost"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "what digits cost" in told and "dop853" in told and "diagram in cost/cost.png" in told
    assert main(["info", "cost"]) == 0
    assert "what digits cost" in capsys.readouterr().out
    assert main(["cost", "small.toml", "--budget", "3", "--out", "cost"]) == 2
    assert "is not empty" in capsys.readouterr().err
    assert main(["cost", "small.toml", "--budget", "-1"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert sorted(p.name for p in tmp_path.iterdir()) == ["cost", "small.toml"]


def test_interruption_keeps_what_was_run(tmp_path):
    def tell(text, share):
        assert 0.0 <= share <= 1.0
        if "explicit-4" in text:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        refweb.cost(scene(duration=1e-3), budget=10.0, out=tmp_path / "cost", progress=tell)
    summary = json.loads((tmp_path / "cost" / "run.json").read_text())
    assert summary["status"] == "interrupted"
    assert any(run["status"] == "solved" for run in summary["runs"])


# method = "auto"


def chosen(given):
    solve, reason = decided(given, given.build())
    assert reason
    return solve.method, solve.family, solve


def test_auto_takes_what_takes_the_scene():
    """Masslessness, curved elements and a consistent mass leave one method; digits become its tolerance."""
    assert chosen(scene([refweb.PointMass(node="centre", mass=1.0)], **MASSLESS))[0] == "ida"
    assert chosen(scene(order=2))[:2] == ("cvode", "bdf")
    assert chosen(scene(solve=refweb.Dynamic(duration=0.01, mass="consistent")))[0] == "cvode"
    many = refweb.Accuracy(digits=8)
    assert chosen(scene(order=2, accuracy=many))[:2] == ("cvode", "adams")
    assert chosen(scene(order=2, accuracy=many))[2].rtol == pytest.approx(1e-9)
    link = refweb.Inline(points=[[k, 0, 0] for k in range(4)], lines=[[0, 1], [2, 3]], supports=[0])
    effects = [refweb.Link(nodes=[1, 2]), refweb.PointMass(node=3, mass=1.0)]
    linked = scene(effects, web=link, cable=SLACK, solve=refweb.Dynamic(duration=0.01, method="auto"))
    linked = linked.replace(observe=())
    assert chosen(linked)[0] == "ida"


def test_auto_follows_waves_explicitly_and_steps_over_what_has_none():
    assert chosen(scene())[0] == "central-difference"
    assert chosen(scene(duration=100.0))[0] == "central-difference"
    assert chosen(scene(accuracy=refweb.Accuracy(digits=6)))[0] == "explicit"
    assert chosen(scene([DAMPED], accuracy=refweb.Accuracy(digits=6)))[0] == "central-difference"
    assert chosen(scene([DAMPED], accuracy=refweb.Accuracy(digits=8)))[:2] == ("cvode", "adams")
    assert chosen(scene([DAMPED], 10.0))[:2] == ("cvode", "adams")
    ramp, still = refweb.Load(node="centre", force=(0, 0, 1.0), factor=[(0, 0), (500, 1)]), "equilibrium"
    slow = refweb.Dynamic(duration=500.0, start=still)
    assert chosen(scene([ramp], interval=1.0, solve=slow))[:2] == ("cvode", "bdf")
    assert chosen(scene([ramp, THROWN], interval=1.0, solve=slow))[0] == "central-difference"


def test_auto_does_not_take_friction_for_damping():
    """It shortens steps where and while something is touched, not those of the whole run."""
    ball = refweb.Body(name="ball", radius=0.1, mass=1.0, position=(0, 0, -0.2), velocity=(0, 0, 1.0))
    rough = scene([ball, refweb.Contact(stiffness=1e4, friction=0.5)], 10.0)
    solve, reason = decided(rough, rough.build())
    assert solve.method == "central-difference" and "damping" not in reason


DYNAMIC_SCENES = [path.stem for path in sorted(scenes.SHIPPED_SCENES.glob("*.toml")) if "duration" in path.read_text()]


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(n, marks=[pytest.mark.slow] * (n in ("capture-satellite", "four-satellites")))
        for n in DYNAMIC_SCENES
    ],
)
@pytest.mark.parametrize("digits", [None, 8])
def test_auto_takes_every_shipped_scene(name, digits):
    """The solver that is chosen can be built, which it refuses where it does not take the scene."""
    given = refweb.Scene.load(name)
    solve = refweb.Dynamic(method="auto", duration=given.solve.duration, start=given.solve.start, mass=given.solve.mass)
    given = given.replace(solve=solve, accuracy=refweb.Accuracy(digits=digits))
    simulation = Simulation(given, given.build(), refweb.Solution(given))
    assert simulation.scene.solve.method in INTEGRATORS


def test_auto_runs_and_says_why(tmp_path, capsys):
    """The run is that of the method it names, bit for bit, and run.json has the reason."""
    given = scene(solve=refweb.Dynamic(duration=0.01, method="auto"))
    solution = refweb.run(given, out=tmp_path / "run")
    plain = refweb.run(scene())
    assert solution.solver["method"] == "central-difference"
    assert "explicit steps" in solution.solver["choice"] and "choice" not in plain.solver
    assert solution.results["centre"].value == plain.results["centre"].value
    assert json.loads((tmp_path / "run" / "run.json").read_text())["solver"]["choice"] == solution.solver["choice"]
    assert main(["check", str(tmp_path / "run" / "scene.toml")]) == 0
    assert "central-difference (" in capsys.readouterr().out
    with pytest.raises(refweb.InputError, match='safety = 0.3 has no meaning with method = "auto"'):
        refweb.Dynamic(duration=1.0, method="auto", safety=0.3)
