"""Formulas: what is least and what is required, as intervals, and with their derivatives.

A requirement ``a > b`` has the reserve (a − b)/|b| where b is a number that is not 0, else a − b: it holds where its
reserve is above 0. Parts of ``and`` have a reserve each, of ``or`` the largest one counts. A condition holds as well
where all parts of one of its sides do, each without ``or``: its disjunctive normal form.

May change: private functions and how trees are walked; `FALSE` and `TRUE`, of which only the sign counts. Must stay:
the sign and scale of a reserve, on which `problem`, `runs` and `smooth` rest; value and gradient of one formula;
intervals that are never narrower than the exact ones; `MOST_SIDES`, which `problem` and `size` import; `Criterion` with
its public names, which `problem` imports. Tests: ``tests/sizing/test_size.py``.
"""

from __future__ import annotations

import ast
import copy
import itertools
import math

import numpy as np

from ..errors import InputError
from ..messages import quote
from ..sweeps.expressions import ANY, Expression, Interval, exact

MOST_SIDES = 16
"""Largest number of sides that are told apart."""
MOST_POWER = 100
"""Largest size of an exponent."""
FALSE, TRUE = exact(-1.0), exact(1.0)
"""Reserves of what has no number, such as an equation."""


class Criterion(Expression):
    """An arithmetic expression, or a condition with its reserve.

    Parameters
    ----------
    text : str
        The expression.
    names : collection of str
        Names that it may use.
    compares : bool
        True for a condition.
    """

    def __init__(self, text, names, compares):
        super().__init__(text, names, compares)
        self.compares = compares
        _refuse_powers(self)
        self.parts = list(_parts(self.tree)) if compares else [self.tree]
        self._sides = _sides_of(self.tree) if compares else [self.parts]

    @property
    def count(self):
        """Number of sides, one of which is enough."""
        return len(self._sides)

    def side(self, number):
        """The criterion with the parts and names of a side alone, for reserves and slopes."""
        alone = copy.copy(self)
        alone.parts = self._sides[number]
        names = [node.id for part in alone.parts for node in ast.walk(part) if isinstance(node, ast.Name)]
        alone.used = {self._aliases[name] for name in names if name in self._aliases}
        return alone

    @property
    def limits(self):
        """Limits of names by numbers on each side, a list of dicts of (low, high) by name; both ends are left out."""
        return [_limits_of(parts, self._aliases) for parts in self._sides] if self.compares else [{}]

    def is_decided(self, values):
        """Tell if it has a value, or is true or false, with numbers by name; True where these are no numbers."""
        try:
            if self.compares:
                return self(values) is not None
            return self.number(values) != ANY
        except InputError:
            return True

    def number(self, values):
        """The `refweb.sweeps.expressions.Interval` of an arithmetic expression, with values by name."""
        try:
            value = self._value(self.tree, values)
            if isinstance(value, Interval):
                return value
        except (TypeError, AttributeError, ValueError, IndexError):
            pass
        raise self._refused(values)

    def reserves(self, values):
        """`refweb.sweeps.expressions.Interval` of the reserve of each part of a condition, a list."""
        self(values)
        return [self._reserve(part, values) for part in self.parts]

    def _reserve(self, node, values):
        if isinstance(node, ast.BoolOp):
            inner = [self._reserve(operand, values) for operand in node.values]
            among = min if isinstance(node.op, ast.And) else max
            return Interval(among(r.low for r in inner), among(r.high for r in inner))
        if isinstance(node, ast.UnaryOp):
            inner = self._reserve(node.operand, values)
            return Interval(-inner.high, -inner.low)
        if isinstance(node, ast.Compare) and isinstance(node.ops[0], ast.Lt | ast.LtE | ast.Gt | ast.GtE):
            upper, lower, scale = _compared(node)
            a, b = (self._value(side, values) for side in (upper, lower))
            return Interval(_less(a.low, b.high) / scale, _less(a.high, b.low) / scale)
        truth = self._truth(node, values)
        return TRUE if truth else FALSE if truth is not None else Interval(-1.0, 1.0)

    def slopes(self, values, slopes):
        """(Value, gradient) of each part, of a condition those of its reserve, a list.

        Parameters
        ----------
        values : dict of str to float
            Values by name.
        slopes : dict of str to ndarray
            Gradient of each name that is not constant.
        """
        return [self._dual(part, values, slopes) for part in self.parts]

    def _dual(self, node, values, slopes):
        dual = lambda inner: self._dual(inner, values, slopes)  # noqa: E731
        if isinstance(node, ast.Compare) and isinstance(node.ops[0], ast.Lt | ast.LtE | ast.Gt | ast.GtE):
            (a, da), (b, db) = (dual(side) for side in _compared(node)[:2])
            scale = _compared(node)[2]
            return (a - b) / scale, (da - db) / scale
        if isinstance(node, ast.BoolOp):
            among = min if isinstance(node.op, ast.And) else max
            return among((dual(operand) for operand in node.values), key=lambda pair: pair[0])
        if isinstance(node, ast.UnaryOp):
            value, slope = dual(node.operand)
            return (value, slope) if isinstance(node.op, ast.UAdd) else (-value, -slope)
        if isinstance(node, ast.BinOp):
            return _combined(node.op, *dual(node.left), *dual(node.right))
        if isinstance(node, ast.Call):
            return _called(ast.unparse(node.func), [dual(operand) for operand in node.args])
        if isinstance(node, ast.Name):
            name = self._aliases[node.id]
            return float(values[name]), np.asarray(slopes.get(name, 0.0), float)
        number = isinstance(node, ast.Constant | ast.Subscript)
        return (self._value(node, values) if number else self._reserve(node, values)).low, np.array(0.0)


def _less(a, b):
    """Difference of two numbers, of which infinite ones may be equal."""
    return 0.0 if a == b else a - b


def _parts(node):
    """Conditions that must all hold."""
    if isinstance(node, ast.BoolOp) and isinstance(node.op, ast.And):
        for operand in node.values:
            yield from _parts(operand)
    elif isinstance(node, ast.Compare) and len(node.ops) > 1:
        sides = [node.left, *node.comparators]
        for left, op, right in zip(sides, node.ops, sides[1:], strict=False):
            yield ast.Compare(left, [op], [right])
    else:
        yield node


def _sides_of(node, false=False):
    """Lists of conditions of which all of one list must hold; with ``false`` those under which a node does not."""
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        return _sides_of(node.operand, not false)
    if isinstance(node, ast.BoolOp):
        inner = [_sides_of(operand, false) for operand in node.values]
        if isinstance(node.op, ast.Or) is not false:
            return list(itertools.chain(*inner))
        return [
            list(itertools.chain(*chosen)) for chosen in itertools.islice(itertools.product(*inner), MOST_SIDES + 1)
        ]
    parts = list(_parts(node))
    if false:
        return [[ast.UnaryOp(ast.Not(), part)] for part in parts]
    return [parts]


def _limits_of(parts, aliases):
    """Intervals of names that are compared with a number, by name."""
    limits = {}
    for part in parts:
        if isinstance(part, ast.Compare) and isinstance(part.ops[0], ast.Lt | ast.LtE | ast.Gt | ast.GtE):
            upper, lower, _ = _compared(part)
            for node, number, above in ((upper, lower, True), (lower, upper, False)):
                if isinstance(node, ast.Name) and _is_number(number):
                    low, high = limits.get(name := aliases[node.id], ANY)
                    value = float(ast.literal_eval(number))
                    limits[name] = Interval(max(low, value), high) if above else Interval(low, min(high, value))
    return limits


def _refuse_powers(criterion):
    """Refuse an exponent of numbers that is beyond `MOST_POWER`."""
    for node in ast.walk(criterion.tree):
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
            named = any(isinstance(part, ast.Name) for part in ast.walk(node.right))
            if not named and not abs(criterion._value(node.right, {}).low) <= MOST_POWER:
                raise InputError(f"{quote(criterion.text)}: an exponent must be from -{MOST_POWER} to {MOST_POWER}")


def _compared(node):
    """(Side that must be larger, smaller side, scale) of a comparison."""
    left, right = node.left, node.comparators[0]
    scales = [abs(ast.literal_eval(side)) for side in (right, left) if _is_number(side)]
    scale = next((scale for scale in scales if scale > 0.0), 1.0)
    return (left, right, scale) if isinstance(node.ops[0], ast.Gt | ast.GtE) else (right, left, scale)


def _is_number(node):
    return isinstance(node, ast.Constant) or isinstance(node, ast.UnaryOp) and isinstance(node.operand, ast.Constant)


def _combined(op, a, da, b, db):
    """Value and gradient of an operation on two numbers."""
    if isinstance(op, ast.Add):
        return a + b, da + db
    if isinstance(op, ast.Sub):
        return a - b, da - db
    if isinstance(op, ast.Mult):
        return a * b, a * db + b * da
    if isinstance(op, ast.Div):
        return a / b, (da - a / b * db) / b
    return a**b, b * a ** (b - 1.0) * da


def _called(name, operands):
    """Value and gradient of a function of some numbers."""
    value, slope = operands[0]
    if name == "abs":
        return abs(value), math.copysign(1.0, value) * slope
    if name == "sqrt":
        return math.sqrt(value), slope / (2.0 * math.sqrt(value))
    return (min if name == "min" else max)(operands, key=lambda pair: pair[0])
