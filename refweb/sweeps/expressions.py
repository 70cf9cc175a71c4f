"""Conditions such as ``max_stress > 2e8 and speed < 3``: a parser, and their evaluation by intervals.

A condition holds arithmetic, comparisons, ``and``, ``or``, ``not``, the functions `FUNCTIONS`, numbers, texts in quotes
and names. Names may contain dots and numbers, as the paths of scenes do, ``body.0.mass``, and may have an index,
``body.0.velocity[2]``. The value of a name is a number or an `Interval`, a result with its ±. Expressions are evaluated
by interval arithmetic. A comparison is true or false only if it is so for all values in the intervals; otherwise it is
None, undecided (Kleene's logic). A computed interval may be wider than the exact one if a name occurs twice. It is
never narrower, except for rounding. A `Formula` of numbers without ± is compiled, since it is evaluated at each step of
an environment: the compiled code holds what has been read here, and nothing else.

The library simpleeval 1.0, with functions of intervals, evaluates ``and`` by Python's truth values: with y from 1 to 3
and x = 2 it leaves ``y > 2 and x > 3`` undecided, though it is false. Its methods for ``and``, ``or`` and comparisons
are private, and it checks an expression only during evaluation. The library asteval gives a condition access to 387
names.

May change: private functions, texts of errors, `LONGEST` and `DEEPEST` upwards. Must stay: operators and `FUNCTIONS`,
the language of ``skip`` and ``conditions`` in study files and of formulas in requirements files: none is removed;
intervals that are never narrower than the exact ones; that nothing but what was read here is run; `ANY`, which
`sizing.formulas` and `sizing.problem` import; `Expression`, which `sizing.formulas`, `chances` and other files import;
private methods of `Expression`, which `formulas` calls. Tests: ``tests/sweeps/test_expressions.py``.
"""

from __future__ import annotations

import ast
import copy
import math
import operator
import re
from typing import Any, NamedTuple

from ..errors import InputError
from ..messages import nearest, quote, row_of

LONGEST = 2000
"""Largest number of characters of a condition."""
DEEPEST = 50
"""Largest depth of nested expressions."""
_NAME = re.compile(r"""("[^"]*"|'[^']*')|(?<![\w.])([A-Za-z_][\w-]*(?:\.[\w-]+)+|[A-Za-z_]\w*)""")


class Interval(NamedTuple):
    """Numbers from ``low`` to ``high``."""

    low: float
    high: float


ANY = Interval(-math.inf, math.inf)
"""The interval of all numbers."""


def exact(number):
    """The `Interval` of one number."""
    return Interval(number, number)


def _hull(*values):
    return ANY if any(map(math.isnan, values)) else Interval(min(values), max(values))


def _multiplied(factor_a, factor_b):
    return _hull(*(a * b if a and b else 0.0 for a in factor_a for b in factor_b))


def _divided(dividend, divisor):
    if divisor.low <= 0.0 <= divisor.high:
        return ANY
    return _hull(*(a / b for a in dividend for b in divisor))


def _power(base, b):
    if b.low != b.high:
        raise InputError("an exponent must be a number without ±")
    p = b.low
    if base.low < 0.0 and p != int(p):
        return ANY
    if p < 0.0:
        return _divided(exact(1.0), _power(base, exact(-p)))
    try:
        ends = [a**p for a in base]
    except OverflowError:
        return ANY
    inside = [0.0] if base.low < 0.0 < base.high and p % 2 == 0 else []
    return _hull(*ends, *inside)


def _absolute(a):
    ends = [abs(end) for end in a]
    return Interval(0.0 if a.low < 0.0 < a.high else min(ends), max(ends))


def _root(a):
    return ANY if a.low < 0.0 else Interval(math.sqrt(a.low), math.sqrt(a.high))


FUNCTIONS = {
    "abs": _absolute,
    "sqrt": _root,
    "min": lambda *all: Interval(min(value.low for value in all), min(value.high for value in all)),
    "max": lambda *all: Interval(max(value.low for value in all), max(value.high for value in all)),
}
"""Functions that a condition may call."""
_SUMS = {
    ast.Add: lambda a, b: Interval(a.low + b.low, a.high + b.high),
    ast.Sub: lambda a, b: Interval(a.low - b.high, a.high - b.low),
    ast.Mult: _multiplied,
    ast.Div: _divided,
    ast.Pow: _power,
}
_ORDERS = {ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge}


class Expression:
    """A condition that has been read.

    Parameters
    ----------
    text : str
        The condition.
    names : collection of str
        Names that it may use; the last part of a path is an abbreviation of the path if no other path has it.
    compares : bool, optional
        True for a condition, False for a number, such as ``2*speed``, and None for either.

    Raises
    ------
    InputError
        For a text that is no condition, and for an unknown name, with the nearest known one.
    """

    def __init__(self, text, names, compares: bool | None = True):
        self.text, self._aliases = text, {}
        if len(text) > LONGEST:
            raise InputError(f"a condition must have at most {LONGEST} characters, not {len(text)}")
        known = _with_short(names)
        self.used = set()

        def alias(match) -> str:
            quoted, name = match.groups()
            if quoted or name in ("and", "or", "not", "true", "false", *FUNCTIONS):
                return {"true": "True", "false": "False"}.get(name) or match.group()
            if name not in known:
                hint = nearest(name, known)
                if not hint.startswith("known"):
                    hint += f" Known: {row_of(known)}"
                raise InputError(f"{quote(text)}: {quote(name)} is not known here, {hint}")
            self.used.add(known[name])
            key = f"_{len(self._aliases)}"
            self._aliases[key] = known[name]
            return key

        plain = _NAME.sub(alias, text)
        try:
            self.tree = ast.parse(plain.strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise InputError(f"{quote(text)}: is not a condition, such as max_stress > 2e8") from None
        self._check(self.tree, 0)
        condition = isinstance(self.tree, ast.Compare | ast.BoolOp) or (
            isinstance(self.tree, ast.UnaryOp) and isinstance(self.tree.op, ast.Not)
        )
        if condition and compares is False:
            raise InputError(f"{quote(text)}: is a condition, and must be a number, such as total_mass")
        if compares and not condition:
            raise InputError(f"{quote(text)}: compares nothing: a condition is such as max_stress > 2e8")

    def _check(self, node: Any, depth):
        """Refuse parts of Python that a condition must not contain."""
        good = ast.Compare | ast.BoolOp | ast.UnaryOp | ast.BinOp | ast.Name | ast.Constant | ast.Call | ast.Subscript
        fine = isinstance(node, good)
        if isinstance(node, ast.BinOp):
            fine = type(node.op) in _SUMS
        elif isinstance(node, ast.UnaryOp):
            fine = isinstance(node.op, ast.USub | ast.UAdd | ast.Not)
        elif isinstance(node, ast.Compare):
            fine = all(type(op) in (*_ORDERS, ast.Eq, ast.NotEq) for op in node.ops)
        elif isinstance(node, ast.Constant):
            fine = isinstance(node.value, bool | int | float | str)
        elif isinstance(node, ast.Call):
            fine = isinstance(node.func, ast.Name) and node.func.id in FUNCTIONS and node.args and not node.keywords
        elif isinstance(node, ast.Name):
            fine = node.id in self._aliases
        elif isinstance(node, ast.Subscript):
            at = node.slice
            fine = isinstance(node.value, ast.Name) and isinstance(at, ast.Constant) and isinstance(at.value, int)
        if depth > DEEPEST:
            raise InputError(
                f"{quote(self.text)}: its parts are nested deeper than {DEEPEST}, as a sum of more terms is: "
                "put halves of it in brackets"
            )
        if not fine:
            words = f"arithmetic, comparisons, and, or, not, {', '.join(FUNCTIONS)}, numbers, texts and names"
            raise InputError(f"{quote(self.text)}: a condition holds {words} alone")
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.expr) and not (isinstance(node, ast.Call) and child is node.func):
                self._check(child, depth + 1)

    def __call__(self, values):
        """Evaluate with values by name: true, false, or None if intervals leave it undecided.

        Raises
        ------
        InputError
            For a sum of texts, an index out of range, and other operations that cannot be computed.
        """
        try:
            return self._truth(self.tree, values)
        except (TypeError, AttributeError, ValueError, IndexError):
            raise self._refused(values) from None

    def _refused(self, values):
        """The error for values with which the expression cannot be computed."""
        return InputError(f"{quote(self.text)}: cannot be computed of {_values_text(values, self.used)}")

    def _truth(self, node, values):
        if isinstance(node, ast.BoolOp):
            parts = [self._truth(operand, values) for operand in node.values]
            decisive = isinstance(node.op, ast.Or)
            return decisive if decisive in parts else None if None in parts else not decisive
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            inner = self._truth(node.operand, values)
            return None if inner is None else not inner
        if isinstance(node, ast.Compare):
            sides = [self._value(operand, values) for operand in (node.left, *node.comparators)]
            parts = [_compared(op, a, b) for op, a, b in zip(node.ops, sides, sides[1:], strict=False)]
            return False if False in parts else None if None in parts else True
        value = self._value(node, values)
        if not isinstance(value, bool):
            raise TypeError
        return value

    def _value(self, node: Any, values) -> Any:
        if isinstance(node, ast.Constant):
            return _read(node.value)
        if isinstance(node, ast.Name):
            return _read(values[self._aliases[node.id]])
        if isinstance(node, ast.Subscript):
            entries = self._value(node.value, values)
            if not isinstance(entries, list):
                raise TypeError
            return _read(entries[ast.literal_eval(node.slice)])
        if isinstance(node, ast.BinOp):
            left, right = (_number(self._value(operand, values)) for operand in (node.left, node.right))
            return _SUMS[type(node.op)](left, right)
        if isinstance(node, ast.Call):
            return FUNCTIONS[ast.unparse(node.func)](*(_number(self._value(operand, values)) for operand in node.args))
        if isinstance(node, ast.UnaryOp) and not isinstance(node.op, ast.Not):
            inner = _number(self._value(node.operand, values))
            return inner if isinstance(node.op, ast.UAdd) else Interval(-inner.high, -inner.low)
        return self._truth(node, values)


class Formula(Expression):
    """A number or a condition of numbers without ±, compiled; a condition in a sum counts as 1 or 0.

    Parameters
    ----------
    text, names, compares
        See `Expression`.

    Raises
    ------
    InputError
        As `Expression`.
    """

    def __init__(self, text, names, compares: bool | None = True):
        super().__init__(text, names, compares)
        tree = ast.fix_missing_locations(ast.Expression(_Plain().visit(copy.deepcopy(self.tree))))
        self._code = compile(tree, "<formula>", "eval")

    def __call__(self, values):
        """Evaluate with numbers by name; NaN where it has no value, as 1/0, the root of −1, and a comparison of NaN."""
        names = {alias: values[name] for alias, name in self._aliases.items()}
        try:
            value = eval(self._code, dict(_PLAIN), names)  # of what `_check` has let through alone
            if isinstance(value, str):
                raise TypeError
            return float(value)
        except (ArithmeticError, ValueError):
            return math.nan
        except (TypeError, IndexError):
            raise self._refused(values) from None

    def check_types(self, values):
        """Refuse vectors and texts where numbers are needed, in all parts, with values by name that have their types.

        Raises
        ------
        InputError
            For them, and for an index out of range.
        """
        self._refuse_no_number(self.tree, self._kind(self.tree, values))

    def _refuse_no_number(self, node: Any, kind):
        if kind != "a number":
            raise InputError(f"{quote(self.text)}: {self._written(node)} is {kind}, and must be a number")

    def _kind(self, node: Any, values):
        """A number, a text or a vector, in words; its parts are checked."""
        if isinstance(node, ast.Constant | ast.Name):
            value = node.value if isinstance(node, ast.Constant) else values[self._aliases[node.id]]
            return _kind_of(value)
        if isinstance(node, ast.Subscript):
            vector: Any = node.value
            number: Any = node.slice
            entries, index = values[self._aliases[vector.id]], number.value
            if not isinstance(entries, list | tuple) or index >= len(entries):
                raise InputError(
                    f"{quote(self.text)}: {self._written(node.value)} is {_kind_of(entries)}: no [{index}]"
                )
            return _kind_of(entries[index])
        parts = [part for part in ast.iter_child_nodes(node) if isinstance(part, ast.expr)]
        parts = parts[1:] if isinstance(node, ast.Call) else parts
        kinds = [self._kind(part, values) for part in parts]
        equals = isinstance(node, ast.Compare) and all(isinstance(op, ast.Eq | ast.NotEq) for op in node.ops)
        if not (equals and len(set(kinds)) == 1):
            for part, kind in zip(parts, kinds, strict=True):
                self._refuse_no_number(part, kind)
        return "a number"

    def _written(self, node: Any):
        """A part with its names as they are written."""
        return re.sub(r"\b_\d+\b", lambda alias: self._aliases.get(alias[0], alias[0]), ast.unparse(node))


def _kind_of(value):
    if isinstance(value, list | tuple):
        return f"a vector of {len(value)}"
    return "a text" if isinstance(value, str) else "a number"


class _Plain(ast.NodeTransformer):
    """Whole numbers as floats, whose powers stay short; indices stay whole. Parts that have no value raise errors."""

    def visit_BinOp(self, node):
        """Compute a power by `_real_power`."""
        self.generic_visit(node)
        return _call("_power", node.left, node.right) if isinstance(node.op, ast.Pow) else node

    def visit_Compare(self, node):
        """Compare what is not NaN."""
        self.generic_visit(node)
        sides: list[ast.expr] = [_call("_known", side) for side in (node.left, *node.comparators)]
        return ast.Compare(sides[0], node.ops, sides[1:])

    def visit_Subscript(self, node):
        """Leave an index as it is."""
        return node

    def visit_Constant(self, node):
        """Make a whole number a float."""
        return ast.Constant(float(str(node.value))) if type(node.value) is int else node


def _call(name, *arguments):
    return ast.Call(ast.Name(name, ast.Load()), list(arguments), [])


def _known_value(value):
    if value != value:
        raise ArithmeticError
    return value


def _real_power(base, exponent):
    value = base**exponent
    if isinstance(value, complex):
        raise ArithmeticError
    return value


_PLAIN = {"__builtins__": {}, "abs": abs, "sqrt": math.sqrt, "min": min, "max": max}
_PLAIN |= {"_known": _known_value, "_power": _real_power}
"""`FUNCTIONS` of plain numbers, and what `_Plain` calls."""


def _with_short(names):
    """Names and abbreviations, the last parts of paths that only one of them has, by full name."""
    ends = [name.rpartition(".")[2] for name in names]
    short = {end: name for end, name in zip(ends, names, strict=True) if ends.count(end) == 1 and end.isidentifier()}
    return short | {name: name for name in names}


def _read(value):
    """Convert a number to its interval; leave texts, booleans, lists and intervals unchanged."""
    if isinstance(value, tuple) and not isinstance(value, Interval):
        return list(value)
    return exact(float(value)) if isinstance(value, int | float) and not isinstance(value, bool) else value


def _number(value):
    if not isinstance(value, Interval):
        raise TypeError
    return value


def _compared(op, a, b):
    """Result of a comparison: True if it holds for all values, False for none, None for some."""
    if isinstance(op, ast.Eq | ast.NotEq):
        if isinstance(a, Interval) and isinstance(b, Interval):
            same = None if max(a.low, b.low) <= min(a.high, b.high) else False
            same = True if a.low == a.high == b.low == b.high else same
        else:
            same = a == b
        return same if isinstance(op, ast.Eq) or same is None else not same
    a, b = _number(a), _number(b)
    if isinstance(op, ast.Gt | ast.GtE):
        a, b, op = b, a, ast.Lt() if isinstance(op, ast.Gt) else ast.LtE()
    holds = _ORDERS[type(op)]
    if any(map(math.isnan, (*a, *b))):
        return None
    return True if holds(a.high, b.low) else None if holds(a.low, b.high) else False


def _values_text(values, used):
    return ", ".join(f"{name} = {quote(values[name])}" for name in sorted(used) if name in values) or "these values"
