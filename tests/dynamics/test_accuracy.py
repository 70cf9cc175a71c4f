"""± of static results, of smoothing and of elements, and digits that are asked for."""

import json

import mpmath
import pytest

import refweb
from refweb.errors import InputError

EA = 7e3
SPAN, NATURAL = 1.0, 0.9


def bars(law="linear", **changes):
    return refweb.Cable(law=law, modulus=7e7, area=1e-4, density=200.0, **changes)


def arms(load, sag, observe=(), **changes):
    """Two lines from (±1, 0, 0) to a loaded node."""
    return refweb.Scene(
        web=refweb.Inline(
            points=[[-SPAN, 0, 0], [SPAN, 0, 0], [0, 0, -sag]], lines=[[0, 2], [1, 2]], natural_length=NATURAL,
            supports=[0, 1],
        ),
        effects=[refweb.Load(node=2, force=(0.0, 0.0, -load))],
        observe=observe,
        **{"cable": bars(), **changes},
    )  # fmt: skip


def depth(load, sag):
    """Depth of the node [m], to 30 digits: P = 2 EA (l/L − 1) d/l."""
    with mpmath.workdps(30):

        def miss(d):
            length = mpmath.sqrt(SPAN**2 + d * d)
            return 2 * EA * (length / mpmath.mpf(str(NATURAL)) - 1) * d / length - load

        return float(mpmath.findroot(miss, sag + load / 2e3))


OBSERVE = [
    refweb.Observe(name="depth", quantity="position", node=2, component="z"),
    refweb.Observe(name="reaction", quantity="reaction", node=0, component="z"),
]


@pytest.mark.parametrize("load", [1e-3, 1.0, 37.0, 900.0])
@pytest.mark.parametrize("sag", [0.0, 0.3])
def test_deviations_cover_what_is_off(load, sag):
    """Closed forms; ± is at the same time no more than 1e3 of the rounding of what the value is the difference of."""
    solution = refweb.run(arms(load, sag, OBSERVE))
    result, reaction = solution.results["depth"], solution.results["reaction"]
    assert abs(result.value + depth(load, sag)) <= result.error
    assert abs(reaction.value - 0.5 * load) <= reaction.error
    assert result.error < 1e3 * 2.2e-16 and reaction.error < 1e3 * 2.2e-16 * EA


def test_a_looser_residual_has_a_larger_error(monkeypatch):
    """An equilibrium that Newton's method leaves early says how far off it is."""
    monkeypatch.setattr(refweb.statics.newton, "TOLERANCE", 1e-4)
    monkeypatch.setattr(refweb.statics.newton.Newton, "_polished", lambda self, t, here, *more: here)
    result = refweb.run(arms(37.0, 0.0, OBSERVE)).results["depth"]
    off = abs(result.value + depth(37.0, 0.0))
    assert 1e-12 < off <= result.error * (1.0 + 1e-6) < 1.1 * off


def test_places_of_slack_nodes_have_no_error():
    web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0], [1.1, 0, 0]], lines=[[0, 1], [1, 2]], natural_length=[1.0, 0.5])
    observe = [refweb.Observe(name=f"x{i}", quantity="position", node=i, component="x") for i in (1, 2)]
    scene = refweb.Scene(
        web=web,
        supports=refweb.Supports(nodes=[0]),
        support=[refweb.Supports(nodes="all", components=["z"])],
        cable=bars("tension-only"),
        effects=[refweb.Load(node=1, force=(1.0, 0.0, 0.0))],
        observe=observe,
    )
    results = refweb.run(scene).results
    assert results["x1"].error is not None and results["x2"].error is None


# Smoothing


@pytest.mark.parametrize("smoothing", [1e-3, 1e-5])
def test_smoothing(smoothing):
    """What η changes is what the tension-only law says, but for terms of the next order in η."""
    window = dict(web=refweb.Window(mesh="square", rows=6, columns=6, side=0.2), solve=refweb.Static(load_steps=[1, 5]))
    pulled = dict(effects=[refweb.Load(node="centre", force=(0.0, 0.0, 1.0))], **window)
    smooth = refweb.run(refweb.Scene(cable=bars("smooth", smoothing=smoothing), **pulled))
    exact = refweb.run(refweb.Scene(cable=bars("tension-only"), **pulled))
    for step, other in zip(smooth.steps, exact.steps, strict=True):
        for name, result in step["results"].items():
            off = abs(result.value - other["results"][name].value)
            assert 0.5 * off < result.smoothing < 2.0 * off, name
    assert all(result.smoothing is None for result in exact.results.values())
    without = refweb.run(
        refweb.Scene(cable=bars("smooth", smoothing=smoothing), accuracy=refweb.Accuracy(error="none"), **pulled)
    )
    assert all(result.smoothing is None for result in without.results.values())
    assert {n: r.value for n, r in without.results.items()} == {n: r.value for n, r in smooth.results.items()}


@pytest.mark.parametrize("ratio", [1e-3, 1e-2, 0.1, 0.3])
def test_smoothing_of_one_line(ratio):
    """A line of natural length L under EA e: by the smooth law it is strained by e + ηe/(e + η), and 0 is the limit.

    A tenth of η has another curve: the estimate is short of what η changes by 0.1 η/(e + 0.1 η) of it, and by nothing
    else but the rounding of positions.
    """
    load = 70.0
    smoothing = ratio * load / EA
    scene = refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0]),
        cable=bars("smooth", smoothing=smoothing),
        effects=[refweb.Load(node=1, force=(load, 0.0, 0.0))],
        observe=[
            refweb.Observe(name="far", quantity="displacement", node=1, component="x"),
            refweb.Observe(name="tension", quantity="tension"),
        ],
    )
    results, strain = refweb.run(scene).results, load / EA
    off = smoothing * strain / (strain + smoothing)
    assert results["far"].value == pytest.approx(strain + off, rel=1e-9)
    assert results["far"].smoothing == pytest.approx(off / (1.0 + 0.1 * ratio), rel=1e-8)
    assert abs(results["tension"].value - load) <= 1e-8 * load and results["tension"].smoothing <= 1e-8 * load


# Elements


def catenary(elements, **changes):
    return refweb.Scene(
        web=refweb.SingleCable(start=(0, 0, 0), end=(3, 0, 0), length=4.0, elements=elements),
        cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-4, density=500.0),
        effects=[refweb.Gravity(acceleration=(0.0, 0.0, -9.81))],
        observe=[refweb.Observe(name="sag", quantity="position", node="centre", component="z")],
        **changes,
    )


def elastic_sag():
    """Irvine's elastic catenary at its middle, with H from the span."""
    weight, length, span = 500.0 * 1e-4 * 9.81, mpmath.mpf(4), mpmath.mpf(3)

    def miss(h):
        return h * length / EA + 2 * h / weight * mpmath.asinh(weight * length / (2 * h)) - span

    h = mpmath.findroot(miss, 0.8)
    v = weight * length / 2
    half = length / 2
    return -float(weight * half**2 / (2 * EA) + (mpmath.sqrt(h * h + v * v) - h) / weight)


def test_error_of_elements():
    """Order 2 towards the elastic catenary: the estimate is 1.25 times what is off, within 5 %, at 8 elements."""
    solution = refweb.run(catenary(8, accuracy=refweb.Accuracy(refine=True)))
    result = solution.results["sag"]
    assert result.discretisation == pytest.approx(1.25 * abs(result.value - elastic_sag()), rel=0.05)
    assert solution.summary()["results"]["sag"]["discretisation"] == result.discretisation
    assert "discretisation" not in refweb.run(catenary(8)).summary()["results"]["sag"]


@pytest.mark.slow
def test_error_of_elements_in_motion(tmp_path):
    """A taut string that is plucked in its fundamental: its phase, which elements of order 1 and lumped mass delay."""
    count, end = 8, 0.1
    scene = refweb.Scene(
        web=refweb.SingleCable(start=(0, 0, 0), end=(1, 0, 0), elements=count),
        cable=refweb.Cable(law="linear", modulus=7e7, area=1e-4, density=200.0, prestrain=0.01),
        effects=[refweb.Load(node="all", force=(0.0, 0.0, 1e-4))],
        observe=[refweb.Observe(name="z", quantity="displacement", node="centre", component="z")],
        solve=refweb.Dynamic(duration=end, safety=0.2),
        accuracy=refweb.Accuracy(refine=True),
    )
    solution = refweb.run(scene, out=tmp_path / "out")
    fine = refweb.run(scene.replace(cable=scene.cable.__class__(**{**scene.cable.to_dict(), "subdivide": 16})))
    off = abs(solution.results["z"].value - fine.results["z"].value)
    assert 0.5 * off < solution.results["z"].discretisation < 3.0 * off
    summary = json.loads((tmp_path / "out" / "run.json").read_text(encoding="utf-8"))
    assert summary["results"]["z"]["discretisation"] == solution.results["z"].discretisation


# Digits


def thrown(digits, **keys):
    return refweb.Scene(
        web=refweb.Window(mesh="square", rows=4, columns=4, side=0.2),
        cable=refweb.Cable(law="smooth", smoothing=1e-3, modulus=7e7, area=1e-4, density=200.0, prestrain=0.01),
        effects=[refweb.Velocity(node="centre", value=(0.0, 0.0, 2.0))],
        observe=[
            refweb.Observe(name="z", quantity="displacement", node="centre", component="z"),
            refweb.Observe(name="kinetic", quantity="kinetic_energy"),
        ],
        solve=refweb.Dynamic(**{"duration": 0.02, **keys}),
        accuracy=refweb.Accuracy(digits=digits),
    )


METHODS = [
    dict(),
    dict(method="explicit"),
    dict(method="cvode", family="adams", rtol=1e-3),
]


@pytest.mark.parametrize("keys", METHODS, ids=["central-difference", "explicit", "adams"])
def test_digits_are_reached(keys):
    """As many as asked for, by the ± and against explicit steps of order 6 that are far more accurate."""
    reference = refweb.run(thrown(None, method="explicit", safety=0.05)).results
    solution = refweb.run(thrown(5, **keys))
    for name, result in solution.results.items():
        assert result.error <= 0.5e-5 * abs(result.value)
        assert abs(result.value - reference[name].value) <= 0.5e-5 * abs(result.value)
    assert not any("digits" in text for text in solution.warnings)


def test_digits_that_cannot_be_had():
    """A displacement that is zero by symmetry has none, and the reason is given; the rest of the results stays."""
    scene = thrown(3).replace(observe=[refweb.Observe(name="x", quantity="displacement", node="centre", component="x")])
    solution = refweb.run(scene)
    assert solution.status == "solved"
    (text,) = (text for text in solution.warnings if "digits" in text)
    assert text.startswith("x does not have the 3 digits asked for") and "not determined" in text


def test_bad_input():
    with pytest.raises(InputError, match='digits = 3 needs error = "twin"'):
        refweb.Accuracy(digits=3, error="none")
    with pytest.raises(InputError, match="digits = 13 must be"):
        refweb.Accuracy(digits=13)
    with pytest.raises(InputError, match=r"\[accuracy\] digits = 3 has no meaning in statics"):
        catenary(8, accuracy=refweb.Accuracy(digits=3)).build()
