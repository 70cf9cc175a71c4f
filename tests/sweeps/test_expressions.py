"""Conditions: true, false or left open by intervals as they are of all values inside; read safely."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import refweb
from refweb.sweeps.expressions import FUNCTIONS, Expression, Formula, Interval

NAMES = ("a", "b", "c")
NUMBERS = st.floats(-4.0, 4.0, allow_nan=False).map(lambda x: round(x, 2))
TERMS = st.recursive(
    st.one_of(st.sampled_from(NAMES), NUMBERS.map(lambda x: f"({x!r})")),
    lambda t: st.one_of(
        st.tuples(t, st.sampled_from("+-*/"), t).map(lambda p: f"({p[0]} {p[1]} {p[2]})"),
        st.tuples(t, st.sampled_from(["2", "3"])).map(lambda p: f"({p[0]}) ** {p[1]}"),
        t.map(lambda x: f"abs({x})"),
        st.tuples(st.sampled_from(["min", "max"]), t, t).map(lambda p: f"{p[0]}({p[1]}, {p[2]})"),
    ),
    max_leaves=4,
)
COMPARED = st.tuples(TERMS, st.sampled_from(["<", "<=", ">", ">="]), TERMS).map(" ".join)
CONDITIONS = st.recursive(
    COMPARED,
    lambda c: st.one_of(
        st.tuples(c, st.sampled_from(["and", "or"]), c).map(lambda p: f"({p[0]}) {p[1]} ({p[2]})"),
        c.map(lambda x: f"not ({x})"),
    ),
    max_leaves=3,
)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(CONDITIONS, st.lists(st.tuples(NUMBERS, st.floats(0.0, 1.0)), min_size=3, max_size=3), st.data())
def test_what_is_decided_holds_of_all_values_inside(text, ends, data):
    """Against Python's own evaluation at points of the intervals, not quite at their ends, which rounding moves."""
    values = {name: Interval(low, low + width) for name, (low, width) in zip(NAMES, ends, strict=True)}
    verdict = Expression(text, NAMES)(values)
    shares = data.draw(st.lists(st.floats(0.05, 0.95), min_size=3, max_size=3))
    inside = {
        name: one.low + share * (one.high - one.low) for (name, one), share in zip(values.items(), shares, strict=True)
    }
    try:
        found = eval(text, {"__builtins__": {}, "abs": abs, "min": min, "max": max}, inside)
    except ZeroDivisionError:
        return
    exact = Expression(text, NAMES)(inside)
    assert exact in (found, None)
    if verdict is not None and exact is not None and all(width > 1e-6 for _, width in ends):
        assert verdict == found


POINTS = {"x": 2.0, "y": Interval(1.0, 3.0), "mesh": "square", "body.0.velocity": [0.0, 0.0, 2.5], "body.0.mass": 4}
SAID = {
    "x < 3": True,
    "x > 2 or x >= 2": True,
    "1 < x < 2": False,
    "y > 0.5": True,
    "y > 3.5": False,
    "y > 2": None,
    "y > 2 and x > 3": False,
    "y > 2 or x < 3": True,
    "not y > 2": None,
    "y == 2": None,
    "y != 5": True,
    "x == 2 and 2 == x": True,
    'mesh == "square" and mass == 4': True,
    'mesh != "hexagon"': True,
    "body.0.velocity[2] > 2 and velocity[0] == 0": True,
    "sqrt(body.0.mass) == x": True,
    "1 / (y - 2) < 1000": None,
    "(y - 2) ** 2 >= 0": True,
    "y ** -1 <= 1": True,
    "-y < 0": True,
    "(y - 2) ** 0.5 > -1": None,
    "1e300 ** 2 > 1": None,
    "x * y - y > -5": True,
}


@pytest.mark.parametrize("text", SAID)
def test_verdicts(text):
    assert Expression(text, list(POINTS))(POINTS) is SAID[text]


def test_what_is_not_a_number_decides_nothing():
    assert Expression("a < 1", ["a"])({"a": math.nan}) is None


@pytest.mark.parametrize(
    "text, message",
    [
        ("__import__('os').system('true') > 0", '"__import__" is not known here'),
        ("max_stres > 1", 'did you mean "max_stress"?'),
        ("max_stress", "compares nothing"),
        ("max_stress + 1", "compares nothing"),
        ("max_stress >", "is not a condition"),
        ("max_stress > [1][0]", "alone"),
        ("(lambda: 1)() > 0", "is not known here"),
        ("max_stress.real > 0", '"max_stress.real" is not known'),
        ("max_stress if 1 else 2", "is not known here"),
        ("max_stress > 1 .__class__", "alone"),
        ("abs(max_stress, key=1) > 0", "is not known here"),
        ("max_stress % 2 > 0", "alone"),
        ("max_stress is 1", "is not known here"),
        ("0 < " + "-" * 60 + "max_stress", "nested deeper than 50"),
        ("1 < " * 900 + "max_stress", "at most 2000 characters"),
        ("f'{max_stress}' == 'a'", "is not"),
    ],
)
def test_refusals(text, message):
    with pytest.raises(refweb.InputError, match=r"^[^\n]*$") as refused:
        Expression(text, ["max_stress", "deflection"])
    assert message in str(refused.value)


@pytest.mark.parametrize("text", ["mesh + 1 > 0", "mesh > 1", "velocity > 1", "velocity[3] > 1", "x[0] > 1", "x and y"])
def test_what_cannot_be_computed(text):
    with pytest.raises(refweb.InputError, match="cannot be computed|compares"):
        Expression(text, list(POINTS))(POINTS)


def test_known_names_stand_beside_the_nearest():
    with pytest.raises(refweb.InputError, match='did you mean "stress"[?] Known: stress, depth$'):
        Expression("stres > 1", ["stress", "depth"])
    with pytest.raises(refweb.InputError, match="is not known here, known: stress, depth$"):
        Expression("qqq > 1", ["stress", "depth"])


def test_a_short_name_of_two_paths_is_none():
    with pytest.raises(refweb.InputError, match='"mass" is not known here'):
        Expression("mass > 1", ["body.0.mass", "body.1.mass"])
    assert sorted(FUNCTIONS) == ["abs", "max", "min", "sqrt"]


@settings(max_examples=200, deadline=None)
@given(st.one_of(TERMS, CONDITIONS), st.tuples(NUMBERS, NUMBERS, NUMBERS))
def test_a_formula_has_the_value_of_its_text(text, numbers):
    """As Python computes it; where intervals of no width are finite they agree, but for the sum of rounding."""
    values = dict(zip(NAMES, numbers, strict=True))
    try:
        expected = float(eval(text, {}, dict(values)))
    except ArithmeticError:
        expected = math.nan
    found = Formula(text, NAMES, compares=None)(values)
    compares = "<" in text or ">" in text
    assert found == expected or math.isnan(found) and (math.isnan(expected) or compares)
    if compares:
        verdict = Expression(text, NAMES)({name: Interval(value, value) for name, value in values.items()})
        assert verdict is None or math.isnan(expected) or bool(found) == verdict


@pytest.mark.parametrize(
    "text, value",
    [
        ("1/a", math.nan),
        ("sqrt(a - 1)", math.nan),
        ("(a - 8)**0.5", math.nan),
        ("10**400", math.nan),
        ("2*(a < 1)", 2.0),
        ("abs((a - 8)**0.5)", math.nan),
        ("min(1, (a - 8)**0.5)", math.nan),
        ("1e308*10 - 1e308*10 < 1", math.nan),
        ("not 1 > 1e308*10 - 1e308*10 > 0", math.nan),
        ("a < 1 or 1e308*10 - 1e308*10 < 1", 1.0),
    ],
)
def test_formulas_without_a_value(text, value):
    """NaN, also of a complex root and beyond the largest number: whole numbers are floats."""
    found = Formula(text, ("a",), compares=None)({"a": 0.0})
    assert found == value or math.isnan(found) and math.isnan(value)


def test_formulas_are_read_as_conditions_are():
    assert (
        Formula("force[1] + x.before", ("force", "x.before"), compares=None)({"force": [1.0, 2.0], "x.before": 3.0})
        == 5.0
    )
    for text in ("a.__class__", "__import__('os')", "[a][0]", "(lambda: a)()", "a if a else a", "a + b"):
        with pytest.raises(refweb.InputError):
            Formula(text, ("a",), compares=None)
    with pytest.raises(refweb.InputError, match="compares nothing"):
        Formula("a + 1", ("a",))
    with pytest.raises(refweb.InputError, match="cannot be computed"):
        Formula("a[3]", ("a",), compares=None)({"a": [1.0]})


def test_types_of_a_long_sum_are_looked_at_once():
    """A sum of 48 terms nests as deep; a look at each part for each part that has it would never end."""
    formula = Formula(" + ".join(["force[1]"] * 48), ("force",), compares=None)
    formula.check_types({"force": [1.0, 2.0]})
    with pytest.raises(refweb.InputError, match=r"force\[1\] is a text, and must be a number"):
        formula.check_types({"force": [1.0, "x"]})
    with pytest.raises(refweb.InputError, match="nested deeper than 50, .* put halves of it in brackets"):
        Formula(" + ".join(["force[1]"] * 60), ("force",), compares=None)
    halves = " + ".join(["force[1]"] * 30)
    assert Formula(f"({halves}) + ({halves})", ("force",), compares=None)({"force": [0.0, 0.5]}) == 30.0
