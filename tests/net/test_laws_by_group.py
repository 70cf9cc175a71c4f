"""Lines of several laws in one web: two springs in closed form, and every kernel against that of each law alone."""

import nets
import numpy as np
import pytest
from scipy.optimize import brentq

import refweb
from refweb.effects.damping import Damping
from refweb.effects.elasticity import length_force, strains
from refweb.errors import InputError
from refweb.net import discretisation

# One node on an axis between two springs of natural length 1 m: a cable behind it, a strut before it.

CABLE, STRUT = 2e3, 5e2
"""EA of the cable and of the strut [N]."""
MASS = 0.5
LAWS = ["tension-only", "smooth"]


def springs(law="tension-only", strut="linear", solve=None, **more):
    group = refweb.Group(law=strut, modulus=STRUT / 1e-4)
    return refweb.Scene(
        web=refweb.Inline(
            points=[[-1, 0, 0], [0, 0, 0], [1, 0, 0]], lines=[[0, 1], [1, 2]], supports=[0, 2], groups=["", "strut"]
        ),
        cable=refweb.Cable(law=law, modulus=CABLE / 1e-4, area=1e-4, density=0.0, groups={"strut": group}),
        support=[refweb.Supports(nodes=[1], components=["y", "z"])],
        solve=solve or refweb.Static(),
        **more,
    )


def smooth(strain, slackness=0.0, smoothing=1e-5):
    """σ/E of the smooth law."""
    s, root = strain - slackness, np.sqrt((strain - slackness) ** 2 + 4 * smoothing**2)
    return 0.5 * (s + root) - 0.5 * (np.sqrt(slackness**2 + 4 * smoothing**2) - slackness)


@pytest.mark.parametrize("method", ["newton", "relaxation"])
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("force", [3.0, -3.0])
def test_statics_of_two_springs(law, method, force):
    """Pushed towards the strut both hold, with forces in proportion to EA; pushed away from it the strut alone does."""
    along = {"tension-only": lambda u: CABLE * max(u, 0.0), "smooth": lambda u: CABLE * smooth(u)}[law]
    exact = brentq(lambda u: along(u) + STRUT * u - force, -0.1, 0.1, xtol=1e-15)
    observe = [
        refweb.Observe(name="u", quantity="displacement", node=1, component="x"),
        refweb.Observe(name="strut", quantity="tension", line="strut"),
        refweb.Observe(name="cable", quantity="tension", line=0),
    ]
    solution = refweb.run(
        springs(
            law,
            solve=refweb.Static(method=method),
            effects=[refweb.Load(node=1, force=(force, 0.0, 0.0))],
            observe=observe,
        )
    )
    results = {name: result.value for name, result in solution.results.items()}
    # relaxation ends at a residual of 1e-9 of the load
    assert results["u"] == pytest.approx(exact, rel=1e-8)
    assert results["strut"] == pytest.approx(-STRUT * exact, rel=1e-8)
    assert results["cable"] == pytest.approx(along(exact), rel=1e-8, abs=1e-8)
    if method == "newton":
        assert abs(results["u"] - exact) <= solution.results["u"].error + 1e-15


def test_a_strut_ends_the_convex_bound_and_the_result_says_so():
    push = [refweb.Load(node=1, force=(3.0, 0.0, 0.0))]
    mixed, alone = refweb.run(springs(effects=push)), refweb.run(springs(strut="tension-only", effects=push))
    assert alone.solver["duality_gap"] is not None and mixed.solver["duality_gap"] is None
    said = 'line 1 can push (law = "linear"): ± are estimates'
    assert any(text.startswith(said) for text in mixed.warnings)
    assert any(text.startswith("bars push: there may be other equilibria") for text in mixed.warnings)
    assert not any("can push" in text or "bars" in text for text in alone.warnings)
    pulled = refweb.run(springs(effects=[refweb.Load(node=1, force=(-3.0, 0.0, 0.0))]))
    assert not any("bars push" in text for text in pulled.warnings)


@pytest.mark.ordinary("central-difference")
@pytest.mark.parametrize(
    "solve",
    nets.some(
        [
            dict(safety=0.01),
            dict(method="explicit", safety=0.1),
            dict(method="cvode", rtol=1e-9),
            dict(method="ida", rtol=1e-9),
        ],
        3,
    ),
    ids=lambda given: given.get("method", "central-difference"),
)
def test_dynamics_of_two_springs(solve):
    """Half a period of √((k₁ + k₂)/m), half one of √(k₂/m): the node is back, as fast as it was."""
    both, one = np.sqrt((CABLE + STRUT) / MASS), np.sqrt(STRUT / MASS)
    observe = [
        refweb.Observe(name=name, quantity="displacement", node=1, component="x", reduce=name)
        for name in ("max", "min")
    ]
    observe.append(refweb.Observe(name="back", quantity="displacement", node=1, component="x"))
    observe.append(refweb.Observe(name="speed", quantity="velocity", node=1, component="x"))
    solution = refweb.run(
        springs(
            solve=refweb.Dynamic(duration=np.pi / both + np.pi / one, **solve),
            effects=[refweb.PointMass(node=1, mass=MASS), refweb.Velocity(node=1, value=(0.1, 0.0, 0.0))],
            observe=observe,
        )
    )
    for name, exact in (("max", 0.1 / both), ("min", -0.1 / one), ("back", 0.0), ("speed", 0.1)):
        result = solution.results[name]
        size = 0.1 if name == "speed" else 0.1 / one
        # The step at which the cable goes slack is one of second order: (h ω)² at safety 0.01, less elsewhere.
        assert abs(result.value - exact) <= 3.0 * result.error + 1e-7 * size and result.error < 1e-2 * size, name


def test_modes_of_two_springs():
    """At the equilibrium of a pull that tightens both, √((k₁ + k₂)/m)/2π; with a slack cable √(k₂/m)/2π."""
    for force, stiffness in ((3.0, CABLE + STRUT), (-3.0, STRUT)):
        given = springs(effects=[refweb.PointMass(node=1, mass=MASS), refweb.Load(node=1, force=(force, 0.0, 0.0))])
        found = refweb.modes(given)
        assert found.frequency == pytest.approx([np.sqrt(stiffness / MASS) / (2.0 * np.pi)], rel=1e-9)


# Kernels

SAME = 1e-14
"""The same sums, but compiled apart: products may or may not be fused into them, a few roundings of 1.1e-16."""


@pytest.mark.slow
@pytest.mark.ordinary("1")
@pytest.mark.parametrize("order", [1, 2])
def test_each_line_has_its_law(order):
    """Tension, energy, stiffness, damping and ∂E/∂L of each element are those of a web that has its law alone."""
    laws = {"edge": "linear", "tie": "tension-only", "": "smooth"}
    web = nets.skew_web()
    own = {"modulus": 1e5, "area": 1e-4, "density": 300.0, "order": order}
    parameters = dict(slackness=2e-3, smoothing=1e-2)
    groups = {name: refweb.Group(law=law, area=2e-4) for name, law in laws.items() if name}
    effects = [Damping(time=1e-3)]

    def made(cable):
        return nets.system(web, cable, effects, quasi_static=False)

    mixed = made(refweb.Cable(**own, **parameters, groups=groups))
    of = np.array(["linear" if i in (1, 3) else "tension-only" if i in (6, 7) else "smooth" for i in range(9)])
    of = of[mixed.net.line]
    assert [mixed.net.laws[number].name for number in mixed.net.law_index] == list(of)
    random = np.random.default_rng(3)
    x, v = 0.05 * random.standard_normal((2, *mixed.net.points.shape))
    lines = mixed.net
    blocks = np.empty((2, len(lines.cells), 3 * (order + 1), 3 * (order + 1)))
    for law in laws.values():
        given = parameters if law == "smooth" else {}
        alone = made(refweb.Cable(law=law, **own, **given, groups={name: refweb.Group(area=2e-4) for name in groups}))
        here = of == law
        assert here.any()
        for there, mine in zip(alone.terms, mixed.terms, strict=True):
            pairs = []
            for term, system in ((there, alone), (mine, mixed)):
                data = system.data_of(term, 0.0)
                for block, kernel in zip(blocks, (term.tangent.stiffness, term.velocity.damping), strict=True):
                    block[:] = 0.0
                    if kernel is not None:
                        kernel(0.0, x, v, block, term.cells, data, False)
                f, out = np.zeros_like(x), np.zeros((len(term.cells), 4))
                term.force(0.0, x, v, f, term.cells, data, out)
                f[:] = 0.0  # then of these lines alone
                some = np.zeros((here.sum(), 4))
                term.force(0.0, x, v, f, term.cells[here], data[here], some)
                pairs.append([out[here], f, *blocks[:, here], system.energy_of(term, 0.0, x)[here]])
            for one, other in zip(*pairs, strict=True):
                np.testing.assert_allclose(one, other, rtol=0, atol=SAME * abs(one).max())
        each = np.empty((2, len(of)))
        for values, system in zip(each, (alone, mixed), strict=True):
            length_force(system.net)(0.0, x, system.net.cells, system.net.line_data.matrix, values)
        np.testing.assert_allclose(*each[:, here], rtol=0, atol=SAME * abs(each).max())
        np.testing.assert_allclose(strains(alone.net, x), strains(mixed.net, x), rtol=SAME)


def test_one_law_by_groups_is_that_law():
    """Where groups leave one law, there is no column of laws and no kernel that reads it."""
    web = nets.skew_web()
    groups = {name: dict(law="linear") for name in ("rim", "anchors", "inner") if name in web.groups}
    by_groups = discretisation.build(web, refweb.Cable(modulus=1e5, area=1e-4, density=1.0, groups=groups))
    plain = discretisation.build(web, refweb.Cable(law="linear", modulus=1e5, area=1e-4, density=1.0))
    assert by_groups.law == plain.law and by_groups.line_data.dtype == plain.line_data.dtype
    np.testing.assert_array_equal(by_groups.line_data, plain.line_data)


def test_parameters_of_the_smooth_law_by_group():
    """A smooth group of another cable has its defaults; what no line of it can have is refused."""
    own = dict(modulus=1e5, area=1e-4, density=1.0)
    cable = refweb.Cable(law="linear", **own, groups=dict(tie=dict(law="smooth", slackness=1e-3)))
    assert (cable.groups["tie"].slackness, cable.groups["tie"].smoothing, cable.smoothing) == (1e-3, 1e-5, None)
    assert refweb.Cable(**cable.to_dict()) == cable
    net = discretisation.build(nets.skew_web(), cable)
    assert net.slackness.tolist() == [0.0] * 6 + [1e-3, 1e-3, 0.0]
    for groups, message in (
        (dict(tie=dict(law="linear", smoothing=1e-3)), 'smoothing = 0.001 has no meaning with law = "linear"'),
        (
            dict(tie=dict(law="linear"), inner=dict(slackness=1e-3)),
            '"inner" gives slackness to line 7, where it has no meaning with law = "linear"',
        ),
    ):
        with pytest.raises(InputError, match=message):
            discretisation.build(nets.skew_web(), refweb.Cable(**own, groups=groups))


def test_smoothing_error_of_a_smooth_group():
    """Beside linear lines the error of smoothing is that of the group: a slack one pushes with up to EA η."""
    given = springs("linear", "smooth", effects=[refweb.Load(node=1, force=(3.0, 0.0, 0.0))])
    observe = [refweb.Observe(name="u", quantity="displacement", node=1, component="x")]
    result = refweb.run(given.replace(observe=observe)).results["u"]
    off = abs(result.value - 3.0 / CABLE)
    assert off > 0.0 and 0.5 * off < result.smoothing < 2.0 * off


def test_a_smooth_spring_beside_one_that_only_pulls():
    """The smooth one is slack and pushes by no more than its floor: how far the lowest state may lie below is known."""
    exact = brentq(lambda u: CABLE * max(u, 0.0) - STRUT * smooth(-u) - 3.0, 0.0, 0.1, xtol=1e-15)
    observe = [refweb.Observe(name="u", quantity="displacement", node=1, component="x")]
    solution = refweb.run(
        springs("tension-only", "smooth", effects=[refweb.Load(node=1, force=(3.0, 0.0, 0.0))], observe=observe)
    )
    assert abs(solution.results["u"].value - exact) <= solution.results["u"].error + 1e-15
    assert any('line 1 can push (law = "smooth")' in text for text in solution.warnings)
    assert not any("there may be other equilibria" in text for text in solution.warnings)
