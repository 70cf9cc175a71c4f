"""The page "How to write a law", followed word by word in a package that is installed for it."""

import importlib
import math
import tomllib

import nets
import numpy as np
import packages
import pytest
from scipy.optimize import minimize
from test_contract import check_term, largest_frequency, state

import refweb
import refweb.net.laws.straight
import refweb.registry
from refweb.dynamics.integrators.central_difference import CentralDifference
from refweb.effects.elasticity import Elasticity
from refweb.kernels import kernel
from refweb.net import discretisation
from refweb.net.cable import Cable
from refweb.statics.duality_bound import duality_bound
from refweb.statics.newton import Newton
from refweb.system.system import System
from refweb.tables import Table, real, table

RESERVED = {"slackness": real(default=0.0), "__annotations__": {"slackness": float}}
"""A parameter with a name of refweb's own."""
AXIAL, LIMIT = 7e3, 0.01
"""EA [N] and the strain a of the page."""


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """The tables of a scene that the page ends with, when all it says before has been done."""
    source, entry, scene = packages.blocks(refweb.net.laws.__doc__)
    with packages.of_page(tmp_path_factory.mktemp("page"), source, entry):
        yield tomllib.loads(scene)


def scene(page, web, **tables):
    return refweb.Scene.from_dict({"web": {"kind": "inline", **web}, **page, **tables})


def strain_of(tension):
    """Strain at a tension [N]: with s = T/(EA a), ε = a s/√(1 − s²)."""
    share = tension / (AXIAL * LIMIT)
    return LIMIT * share / np.sqrt(1.0 - share**2)


def test_in_statics(page):
    """Lines in a row under 0.9 of the limit: their tension is proven, their strain and energy are those by hand."""
    web = {"points": [[0, 0, 0], [1, 0, 0], [2, 0, 0]], "lines": [[0, 1], [1, 2]], "supports": [0]}
    web["groups"] = ["", "stiff"]
    force = 0.9 * AXIAL * LIMIT
    cable = {**page["cable"], "groups": {"stiff": {"parameters": {"limit_strain": 2.0 * LIMIT}}}}
    observe = [{"name": "energy", "quantity": "strain_energy"}, {"name": "tension", "quantity": "tension"}]
    load = [{"node": 2, "force": [force, 0.0, 0.0]}]
    made = scene(page, web, cable=cable, load=load, observe=observe, solve={"kind": "static"})
    solution = refweb.run(made)
    share = 0.5 * force / (AXIAL * LIMIT)
    strain = [strain_of(force), 2.0 * LIMIT * share / np.sqrt(1.0 - share**2)]
    np.testing.assert_allclose(solution.tension, force, rtol=1e-12)
    np.testing.assert_allclose(solution.strain, strain, rtol=1e-11)
    scales = np.array([LIMIT, 2.0 * LIMIT])
    energy = (AXIAL * scales**2 * (np.sqrt(1.0 + (strain / scales) ** 2) - 1.0)).sum()
    assert solution.results["tension"].proven and solution.results["tension"].error < 1e-4 * force
    result = solution.results["energy"]
    assert abs(result.value - energy) <= result.error < 1e-4 * energy
    assert refweb.Scene.from_dict(made.to_dict()).to_dict() == made.to_dict()


def test_a_net_has_the_least_energy_that_scipy_finds(page):
    """Slack lines and lines near their limit; every tension is proven."""
    web = nets.skew_web()
    cable, free = Cable(**{**page["cable"], "parameters": {"limit_strain": 0.05}}), np.array([1, 3, 4, 5])
    load = np.zeros((6, 3))
    load[free] = np.random.default_rng(2).normal(scale=60.0, size=(4, 3))
    loads = [refweb.Load(node=int(node), force=tuple(load[node])) for node in free]
    rest = nets.system(web, cable, loads)

    def potential(u):
        x = web.points.copy()
        x[free] += u.reshape(-1, 3)
        length = np.linalg.norm(x[web.lines[:, 1]] - x[web.lines[:, 0]], axis=1)
        strain = np.maximum(length / web.natural_length - 1.0, 0.0)
        stored = AXIAL * 0.05**2 * (np.sqrt(1.0 + (strain / 0.05) ** 2) - 1.0)
        return (web.natural_length * stored).sum() - (load[free] * u.reshape(-1, 3)).sum()

    found = Newton(rest).solve(1.0, np.zeros((6, 3)))
    assert (found.tension == 0.0).any() and found.tension.max() > 0.4 * AXIAL * 0.05
    bound = duality_bound(rest, found)
    other = minimize(potential, np.zeros(12), method="BFGS", options={"gtol": 1e-6})
    # Energies, of which BFGS by differences of potentials knows eight digits, and none below the proven gap.
    potential_found = potential(found.x[free].ravel())
    assert other.fun == pytest.approx(potential_found, rel=1e-7)
    assert other.fun >= potential_found - bound.gap
    assert bound.tension.max() < 1e-4 * found.tension.max()


@pytest.mark.parametrize("method", ["central-difference", "cvode"])
def test_in_dynamics(page, method):
    """A mass that a line stops: m v²/2 = EA L a² (√(1 + (ε/a)²) − 1) where it is longest."""
    web = {"points": [[0, 0, 0], [0, 0, -1.0]], "lines": [[0, 1]], "supports": [0]}
    mass, speed = 2.0, 1.5
    keys = {"safety": 0.02} if method == "central-difference" else {"rtol": 1e-7}
    made = scene(
        page,
        web,
        point_mass=[{"node": 1, "mass": mass}],
        velocity=[{"node": 1, "value": [0.0, 0.0, -speed]}],
        observe=[{"name": "tension", "quantity": "tension", "reduce": "max"}],
        solve={"kind": "dynamic", "method": method, "duration": 0.1, **keys},
        output={"interval": 0.002},
    )
    solution = refweb.run(made)
    energy = 0.5 * (mass + 0.5 * 200.0 * 1e-4) * speed**2 / (AXIAL * LIMIT**2)
    share = np.sqrt((1.0 + energy) ** 2 - 1.0)
    result, exact = solution.results["tension"], AXIAL * LIMIT * share / np.sqrt(1.0 + share**2)
    assert share > 1.5  # well beyond what is straight
    assert abs(result.value - exact) <= max(result.error, 1e-6 * exact) and result.error < 1e-3 * exact
    assert solution.solver["energy_drift"] < 1e-3


@pytest.mark.parametrize("seed", range(3))
def test_it_keeps_what_every_law_keeps(page, seed):
    """As `tests/test_contract.py` asks of those that refweb ships, beside bars; its bound, and its inverse."""
    groups = {"edge": {"law": "linear"}, "tie": {"parameters": {"limit_strain": 0.5}}}
    cable = Cable(**{**page["cable"], "parameters": {"limit_strain": 0.2}, "groups": groups})
    net, free = discretisation.build(nets.skew_web(), cable), np.zeros((6, 3), dtype=bool)
    for effect in (Elasticity(), refweb.Damping(time=0.02)):
        one = System(net, [effect], free)
        check_term(one.net, one, one.terms[0], seed)
    one = System(net, [Elasticity()], free)
    x = state(net, seed)[0]
    limit = CentralDifference(one).bound(x, reach=0.0)
    assert limit <= 2.0 / np.sqrt(largest_frequency(one, x)) * (1.0 + 1e-12)
    law = importlib.import_module("my_webs.limited").Limited
    lines = net.line_data[net.law_index == net.laws.index(law)]
    tension = np.random.default_rng(seed).uniform(0.0, 0.99, len(lines)) * lines.ea * lines.limit_strain
    share = tension / (lines.ea * lines.limit_strain)
    expected = lines.limit_strain * share / np.sqrt(1.0 - share**2)
    np.testing.assert_allclose(law.strain_of(tension, lines), expected, rtol=1e-12)
    assert np.isinf(law.strain_of(1.001 * lines.ea * lines.limit_strain, lines)).all()


def test_messages_know_it(page):
    web = {"points": [[0, 0, 0], [1, 0, 0]], "lines": [[0, 1]], "supports": [0]}
    static = {"kind": "static"}

    def refused(match, **changes):
        with pytest.raises(refweb.InputError, match=match):
            scene(page, web, cable={**page["cable"], **changes}, solve=static).build()

    refused('law = "limitted" .* did you mean "limited"', law="limitted")
    refused(r"parameters: limit_strian = 1.0: unknown key, did you mean", parameters={"limit_strian": 1.0})
    refused(r"parameters: limit_strain = 0.0 must be > 0", parameters={"limit_strain": 0.0})
    refused(r"parameters: limit_strain is missing", parameters={})
    refused(r"parameters.limit_strain = .* must be a number", parameters={"limit_strain": "much"})
    refused(r'parameters: limit_strain has no meaning with law = "linear"', law="linear")
    refused(r"cannot have a tension of 71 N: .* has none so large", pretension=71.0)
    refused(r"slackness = 0.1 has no meaning", slackness=0.1)


def test_laws_that_are_none_are_refused():
    def law(**attributes):
        return type("One", (refweb.net.laws.law.TensionLaw,), attributes)

    with pytest.raises(refweb.InputError, match='name = "other" of the class must be the same name'):
        refweb.register("law", "one", law(name="other"))
    with pytest.raises(refweb.InputError, match="refweb has one of this name"):
        refweb.register("law", "linear", law(name="linear"))
    with pytest.raises(refweb.InputError, match="must be a class derived from refweb.net.laws.law.TensionLaw"):
        refweb.register("law", "one", dict)
    reserved = table(type("One", (refweb.net.laws.law.TensionLaw, Table), {"name": "one", **RESERVED}))
    with pytest.raises(refweb.InputError, match='the parameter "slackness" has a name of refweb\'s own'):
        refweb.register("law", "one", reserved)


@kernel()
def _twice(strain, line):
    return line.ea * strain * strain if strain > 0.0 else 0.0


@kernel()
def _far(strain, line):
    return line.ea * (0.3 if 0.0301 < strain < 0.09 else 1.0) if strain >= 0.0 else 0.0


@kernel()
def _hole(strain, line):
    return math.nan if 0.04 < strain < 0.09 else line.ea * max(strain, 0.0)


@kernel()
def _text(strain, line):
    return "much"


@kernel()
def _tripled(strain, line):
    return 3.0 * line.ea * max(strain, 0.0)


@kernel()
def _tripled_slope(strain, line):
    return 3.0 * line.ea if strain >= 0.0 else 0.0


@kernel()
def _tripled_energy(strain, line):
    return 1.5 * line.ea * max(strain, 0.0) ** 2


@kernel()
def _waves(strain, line):
    return 0.25 * line.ea * (strain + 0.006 * math.sin(strain / 0.002)) if strain > 0.0 else 0.0


@kernel()
def _slope_of_waves(strain, line):
    return 0.25 * line.ea * (1.0 + 3.0 * math.cos(strain / 0.002)) if strain >= 0.0 else 0.0


@kernel()
def _energy_of_waves(strain, line):
    return 0.25 * line.ea * (0.5 * strain**2 + 1.2e-5 * (1.0 - math.cos(strain / 0.002))) if strain > 0.0 else 0.0


TRIPLED = {"stress": _tripled, "tangent": _tripled_slope, "energy_density": _tripled_energy}
WAVES = {"stress": _waves, "tangent": _slope_of_waves, "energy_density": _energy_of_waves}


@kernel()
def _falls(strain, line):
    return 0.9 * line.ea if strain >= 0.0 else 0.0


@pytest.mark.parametrize(
    "kernels, words",
    [
        ({"energy_density": _twice}, r"at a strain of 1e-05 energy_density rises by 0.14 N .* stress is 0.07 N"),
        ({"tangent": _falls}, r"at a strain of 1e-05 stress rises by 7000 N .* tangent is 6300 N"),
        ({"tangent": _far}, r"at a strain of 0.0301\d* stress rises by 7000 N .* tangent is 2100 N"),
        ({"stress": _hole}, r"at a strain of 0.04\d* stress is no finite number"),
        ({"stress": _text}, r"stress cannot be compiled, it must return a number of \(strain, line\)"),
        (TRIPLED, r"at a strain of 1e-05 tangent is 21000 N, must be at most EA = 7000 N: raise the modulus"),
        (WAVES, r"at a strain of 0.0038\d* stress falls, by [\d.]+ N per strain, and convex = True"),
    ],
)
def test_a_law_that_contradicts_itself_is_refused(page, kernels, words, monkeypatch):
    """Twice the energy, nine tenths of the tangent, and so on; the message has the law, the strain and the numbers.

    The waves fall where cos(ε/a) < −1/3, a = 0.002, from 1.9106 a on; a law that is not said to rise may have them.
    """
    own = type("Wrong", (refweb.net.laws.straight.TensionOnly,), {"name": "wrong", "__module__": __name__, **kernels})
    monkeypatch.setitem(refweb.registry.LAWS, "wrong", own)
    web = {"points": [[0, 0, 0], [1, 0, 0]], "lines": [[0, 1]], "supports": [0]}
    cable = {key: value for key, value in page["cable"].items() if key != "parameters"} | {"law": "wrong"}
    with pytest.raises(refweb.InputError, match='law = "wrong" of line 0: ' + words):
        scene(page, web, cable=cable, solve={"kind": "static"}).build()
    monkeypatch.setitem(
        refweb.registry.LAWS, "wrong", type("Right", (refweb.net.laws.straight.TensionOnly,), {"name": "wrong"})
    )
    scene(page, web, cable=cable, solve={"kind": "static"}).build()
