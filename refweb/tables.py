"""Conversion of a table of a scene to a checked value.

A table is a class with `table` above it, whose fields say what they accept: ``area: float = real(above=0, unit="m²")``.
The same class is the Python value, the TOML table and, for effects, the effect itself. Every refusal is an `InputError`
of one line that names the value, the limit and, for a misspelt name, the nearest valid one. Editors know the keys as
well: `table` is a ``dataclass_transform`` (PEP 681), which wants defaults by name, ``real(default=1.0)``.

May change: private functions; `LARGEST` and `SMALLEST` as far as products of three stay finite and above 0:
`reference.words` has `LARGEST` in words, and both stand in the schema and the reference, which are then written anew
(CONTRIBUTING). Must stay: names and arguments of readers and of `Table`, which plug-ins use; messages name value, limit
and nearest name, and tests quote them; ``accepts`` says what a reader checks, since `refweb.reference` makes the schema
of it: change both together; all names that `settings`, `effects.body` and other files import. Tests:
``tests/test_tables.py``, ``tests/test_scene.py``, ``tests/reference/test_schema.py``.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import numbers
from dataclasses import MISSING
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar, dataclass_transform

from .accepted import accepts, any_of, array, by_name, limits
from .errors import InputError, refused_at
from .messages import closest, nearest, quote, short
from .registry import known, load, possible

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from dataclasses import Field

T = TypeVar("T")
LARGEST = 1e100
"""Largest value of a number with a unit: products of three stay finite."""
SMALLEST = 1e-100
"""Smallest value of a number that must not be negative, unless it is 0."""
_WHOLE = 2**63 - 1
Several = Any
"""Type, for editors, of a field that is read as a tuple: a list, a tuple or an array may be given."""


def _refuse(name, value, limit):
    raise InputError(f"{name} = {quote(value)} must be {limit}")


def _at_once(kinds, lowest, highest):
    """Give a reader ``at_once``, which reads a list at once if all values are of some types and within bounds.

    It returns them as the first type, or None if a value needs the reader itself. A net has thousands of numbers.
    """

    def at_once(values):
        if not set(map(type, values)) <= set(kinds) or not lowest <= min(values) <= max(values) <= highest:
            return None
        finite = math.isfinite(sum(values))  # comparisons may miss what is not a number
        return list(map(kinds[0], values)) if finite else None

    def attach(read):
        read.at_once = at_once
        return read

    return attach


@_at_once((float, int), -LARGEST, LARGEST)
@accepts(limits("number", at_least=-LARGEST, at_most=LARGEST))
def _number(name, value, unit=""):
    unit = f" [{unit}]" if unit else ""
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        _refuse(name, value, f"a number{unit}")
    try:
        number = float(value)
    except OverflowError:
        _refuse(name, value, f"a finite number{unit}")
    if not abs(number) < math.inf:
        _refuse(name, value, f"a finite number{unit}")
    if abs(number) > LARGEST:
        _refuse(name, number, f"≤ {LARGEST:g}{' in size' if number < 0 else ''}{unit}")
    return number


def _integer(name, value, what="a whole number"):
    if isinstance(value, bool) or not isinstance(value, numbers.Integral):
        _refuse(name, value, what)
    number = int(value)
    if abs(number) > _WHOLE:
        _refuse(name, value, f"{what} below 2⁶³")
    return number


def _bounded(name, value, unit, above, at_least, below, at_most):
    for bound, bad, sign in (
        (above, above is not None and not value > above, ">"),
        (at_least, at_least is not None and not value >= at_least, "≥"),
        (below, below is not None and not value < below, "<"),
        (at_most, at_most is not None and not value <= at_most, "≤"),
    ):
        if bad:
            written = f"{bound:g}" if f"{bound:g}" != f"{value:g}" else f"{bound:.12g}"
            _refuse(name, value, f"{sign} {written}" + (f" [{unit}]" if unit else ""))
    if 0.0 in (above, at_least) and 0 < value < SMALLEST:
        lower = f"≥ {SMALLEST:g}" if above == 0.0 else f"0 or ≥ {SMALLEST:g}"
        _refuse(name, value, lower + (f" [{unit}]" if unit else ""))
    return value


def read_all(name: str, values: Sequence[Any], number: Callable[..., Any]) -> list[Any]:
    """Read values of a list, each as ``number(f"{name}[{i}]", value)`` does."""
    at_once = getattr(number, "at_once", None)
    result = at_once(values) if at_once and values else None
    return [number(f"{name}[{i}]", x) for i, x in enumerate(values)] if result is None else result


def _rows_at_once(given, width, number):
    """Rows of numbers that are read at once; an empty list if they need to be read one by one."""
    at_once = getattr(number, "at_once", None)
    if at_once is None or not set(map(type, given)) <= {list, tuple} or set(map(len, given)) != {width}:
        return []
    flat = iter(at_once([x for row in given for x in row]) or [])
    return list(zip(*[flat] * width, strict=True))


def is_listed(value: Any) -> bool:
    """Tell if a value is a list, a tuple or an array of one or more dimensions, and no single number."""
    return isinstance(value, (list, tuple)) or getattr(value, "ndim", 0) > 0


def _list(name, value, what):
    if hasattr(value, "tolist"):
        value = value.tolist()
    if not isinstance(value, (list, tuple)):
        _refuse(name, value, what)
    return value


def field(read: Callable[..., Any], *, default: Any = MISSING, default_factory: Any = MISSING, unit: str = "") -> Any:
    """A dataclass field whose values pass through ``read(name, value)``; None passes where it is the default."""
    made: dict = {"default": default} if default_factory is MISSING else {"default_factory": default_factory}
    return dataclasses.field(metadata={"read": read, "unit": unit}, **made)


def checked(name: str, value: Any, kind: Any) -> Any:
    """A value as a field reads it: ``checked("seed", 3, integer(at_least=0))``."""
    return kind.metadata["read"](name, value)


def accepted_by(kind: Any) -> Any:
    """Schema of the values that a field reads, see `refweb.accepted`."""
    return kind.metadata["read"].accepts


def real(
    default: Any = MISSING,
    *,
    above: float | None = None,
    at_least: float | None = None,
    below: float | None = None,
    at_most: float | None = LARGEST,
    unit: str = "",
) -> Any:
    """A finite real number within bounds."""

    lower = [SMALLEST if 0.0 in (above, at_least) else -LARGEST, *(b for b in (above, at_least) if b is not None)]
    upper = [LARGEST, *(b for b in (below, at_most) if b is not None)]

    @_at_once((float, int), math.nextafter(max(lower), math.inf), math.nextafter(min(upper), -math.inf))
    @accepts(limits("number", above, -LARGEST if at_least is None else at_least, below, at_most))
    def read(name, value):
        return _bounded(name, _number(name, value, unit), unit, above, at_least, below, at_most)

    return field(read, default=default, unit=unit)


def integer(default: Any = MISSING, *, at_least: int | None = None, at_most: int | None = None) -> Any:
    """A whole number within bounds."""

    @accepts(limits("integer", at_least=at_least, at_most=at_most))
    def read(name, value):
        return _bounded(name, _integer(name, value), "", None, at_least, None, at_most)

    return field(read, default=default)


def choice(*values: Any, default: Any = MISSING) -> Any:
    """Accept one of a few values; a table of `refweb.registry` among them stands for its names."""
    registered = [given for given in values if isinstance(given, dict)]

    def valid(names_of=lambda given: given):
        return [value for given in values for value in (names_of(given) if isinstance(given, dict) else [given])]

    @accepts(lambda: {"type": "string" if isinstance(valid()[0], str) else "integer", "enum": valid()})
    def read(name, value):
        for allowed in valid():
            if type(value) is type(allowed) and value == allowed:
                return allowed
        if isinstance(value, str) and any(known(given, value) for given in registered):
            return value
        choices = valid(possible)
        close = closest(value, [n for n in choices if isinstance(n, str)]) if isinstance(value, str) else None
        hint = f' — did you mean "{close}"?' if close else ""
        _refuse(name, value, ("one of " if len(choices) > 1 else "") + ", ".join(map(quote, choices)) + hint)

    return field(read, default=default)


def boolean(default: Any = MISSING) -> Any:
    """True or false."""

    @accepts({"type": "boolean"})
    def read(name, value):
        if not isinstance(value, bool):
            _refuse(name, value, "true or false")
        return value

    return field(read, default=default)


def text(default: Any = MISSING, *, limit: int = 4096) -> Any:
    """A string that is not empty, stands on one line and has at most ``limit`` characters."""

    @accepts({"type": "string", "pattern": r"\S", "maxLength": limit})
    def read(name, value):
        if not isinstance(value, str) or not value.strip() or not value.isprintable():
            _refuse(name, value, "a printable text on one line")
        if len(value) > limit:
            _refuse(name, value, f"a text of at most {limit} characters, not {len(value)}")
        return value

    return field(read, default=default)


def vector(default: Any = MISSING, unit: str = "") -> Any:
    """Three finite numbers."""

    @accepts(array(_number.accepts, 3, 3))
    def read(name, value):
        value = _list(name, value, "a vector [x, y, z]" + (f" [{unit}]" if unit else ""))
        if len(value) != 3:
            _refuse(name, value, f"a vector of 3 numbers, not {len(value)}" + (f" [{unit}]" if unit else ""))
        return tuple(_number(f"{name}[{i}]", x, unit) for i, x in enumerate(value))

    return field(read, default=default, unit=unit)


def rows(width: int, default: Any = MISSING, *, unit: str = "", increasing: bool = False, number: Any = _number) -> Any:
    """A list of rows of ``width`` numbers; ``increasing`` asks that of the first column (a table over time)."""

    @accepts(array(array(number.accepts, width, width), 1))
    def read(name, value):
        value = _list(name, value, f"a list of rows of {width} numbers")
        if not value:
            _refuse(name, value, f"at least one row of {width} numbers")
        result = _rows_at_once(value, width, number)
        for i, row in enumerate([] if result else value):
            row = _list(f"{name}[{i}]", row, f"a row of {width} numbers")
            if len(row) != width:
                _refuse(f"{name}[{i}]", row, f"a row of {width} numbers, not {len(row)}")
            result.append(tuple(number(f"{name}[{i}][{j}]", x) for j, x in enumerate(row)))
        if increasing:
            for i in range(1, len(result)):
                if not result[i][0] > result[i - 1][0]:
                    _refuse(f"{name}[{i}][0]", result[i][0], f"> {result[i - 1][0]:g}: the first column increases")
        return tuple(result)

    return field(read, default=default, unit=unit)


def real_or_rows(default: Any = MISSING, *, unit: str = "", **bounds: Any) -> Any:
    """A number within bounds, as `real`, or points of a curve, such as a table over time: rows of two, increasing."""
    number, points = real(unit=unit, **bounds), rows(2, increasing=True)

    @accepts(any_of(accepted_by(number), accepted_by(points)))
    def read(name, value):
        return checked(name, value, points if is_listed(value) else number)

    return field(read, default=default, unit=unit)


@_at_once((int,), 0, _WHOLE)
@accepts({"type": "integer", "minimum": 0})
def node_number(name: str, value: Any) -> int:
    """Read one whole number ≥ 0."""
    return _bounded(name, _integer(name, value, "a whole number ≥ 0"), "", None, 0, None, None)


def numbers_list(default: Any = MISSING, *, number: Any = _number, empty: bool = False) -> Any:
    """A list of numbers; ``number=node_number`` for whole numbers ≥ 0."""

    @accepts(array(number.accepts, 1 - empty))
    def read(name, value):
        value = _list(name, value, "a list of numbers")
        if not value and not empty:
            _refuse(name, value, "a list with at least one number")
        return tuple(read_all(name, value, number))

    return field(read, default=default)


def texts(default: Any = MISSING) -> Any:
    """A list of strings."""

    @accepts(array({"type": "string"}))
    def read(name, value):
        value = _list(name, value, "a list of texts")
        for i, x in enumerate(value):
            if not isinstance(x, str):
                _refuse(f"{name}[{i}]", x, "a text")
        return tuple(value)

    return field(read, default=default)


def nodes(default: Any = MISSING, *, empty: bool = False, what: str = "node") -> Any:
    """A number of a node (or a line), a name, or a list of them; `refweb.net.web.Web.find` turns it into numbers."""

    either = [node_number.accepts, {"type": "string"}]

    @accepts(any_of(*either, array(any_of(*either), 1 - empty)))
    def read(name, value):
        if hasattr(value, "tolist"):
            value = value.tolist()
        if isinstance(value, (list, tuple)):
            if not value and not empty:
                _refuse(name, value, f"at least one {what}")
            return tuple(find(f"{name}[{i}]", x) for i, x in enumerate(value))
        return find(name, value)

    def find(name, value):
        if isinstance(value, str):
            return value
        return _bounded(name, _integer(name, value, f"a {what} number or a name"), "", None, 0, None, None)

    return field(read, default=default)


def component(default: Any = MISSING, *, axes: str = "xyz") -> Any:
    """An axis: 0, 1, 2 or "x", "y", "z"; read as 0, 1 or 2."""
    known = [*range(len(axes)), *axes]

    @accepts({"type": ["integer", "string"], "enum": known})
    def read(name, value):
        if isinstance(value, str) and value in known:
            return axes.index(value)
        if isinstance(value, bool) or not isinstance(value, numbers.Integral) or int(value) not in known:
            _refuse(name, value, "one of " + ", ".join(map(quote, known)))
        return int(value)

    return field(read, default=default)


def components(default: Any = MISSING) -> Any:
    """A list of axes; read as a sorted tuple of 0, 1, 2."""

    @accepts(array(component().metadata["read"].accepts, 1))
    def read(name, value):
        value = _list(name, value, 'a list of "x", "y", "z"')
        if not value:
            _refuse(name, value, 'a list with at least one of "x", "y", "z"')
        return tuple(sorted({checked(f"{name}[{i}]", x, component()) for i, x in enumerate(value)}))

    return field(read, default=default)


def by_group(
    kind: type[Table], where: str, *, members: str = "groups", default_factory: Callable[[], dict[str, Any]] = dict
) -> Any:
    """Tables of a class by group of lines, in the scene ``[where.groups.NAME]``, or by name of other ``members``."""

    @accepts(by_name(kind))
    def read(name, value):
        if not isinstance(value, dict):
            raise InputError(f"{name} = {quote(value)} must be a table of {members}, [{where}.{members}.NAME]")
        return {
            key: group if isinstance(group, kind) else kind.read(f"{name}.{short(key)}", group)
            for key, group in value.items()
        }

    return field(read, default_factory=default_factory)


def numbers_by_name() -> Any:
    """Numbers by name, a table; None by default."""
    number = real()

    @accepts(by_name({"type": "number"}))
    def read(name, value):
        if not isinstance(value, dict):
            raise InputError(f"{name} = {quote(value)} must be a table of numbers, {name} = {{NAME = 1.0}}")
        return {key: checked(f"{name}.{short(key)}", given, number) for key, given in value.items()}

    return field(read, default=None)


def part(kind: type[Any] | str) -> Any:
    """A table of a class, or of the ``"module:name"`` of one, below another one; None without it."""

    @accepts((lambda: load(kind)) if isinstance(kind, str) else kind)
    def read(name, value):
        made = load(kind)
        return value if isinstance(value, made) else made.read(name, value)

    return field(read, default=None)


def key_of(f: Field[Any]) -> str:
    """Key of a field in scenes: its name, without the ``_`` behind a word of Python's own."""
    return f.name.removesuffix("_")


def refuse_keys(cls: type, given: dict[str, Any]) -> None:
    """Refuse what is no key of a class of `table`, with the nearest that is, and a key that is missing."""
    known = cls.keys(given) if issubclass(cls, Table) else [key_of(f) for f in dataclasses.fields(cls)]
    for key in given:
        if key not in known:
            raise InputError(f"{short(key)} = {quote(given[key])}: unknown key, {nearest(key, known)}")
    for f in dataclasses.fields(cls):
        if f.default is MISSING and f.default_factory is MISSING and key_of(f) not in given:
            unit = f" [{f.metadata['unit']}]" if f.metadata.get("unit") else ""
            raise InputError(f"{key_of(f)} is missing: give {key_of(f)} = ...{unit}")


@dataclass_transform(
    kw_only_default=True,
    frozen_default=True,
    field_specifiers=(
        field,
        real,
        integer,
        choice,
        boolean,
        text,
        vector,
        rows,
        real_or_rows,
        numbers_list,
        texts,
        nodes,
        component,
        components,
        by_group,
        dataclasses.field,
    ),
)
def table(cls: type[T]) -> type[T]:
    """Make a frozen dataclass of keywords alone, which names the nearest key where one is misspelt.

    Raises
    ------
    InputError
        From the class, where a key is unknown or missing.
    """
    described = cls.__doc__
    made: Any = dataclasses.dataclass(frozen=True, kw_only=True)(cls)
    made.__doc__ = described or ""  # not the signature that a dataclass has in place of one
    initial, keys = made.__init__, {f.name: key_of(f) for f in dataclasses.fields(made)}

    @functools.wraps(initial)
    def __init__(self, **given):
        given = {keys.get(name, name): value for name, value in given.items()}
        refuse_keys(made, given)
        initial(self, **{f"{key}_" if f"{key}_" in keys else key: value for key, value in given.items()})

    made.__init__ = __init__
    return made


class Table:
    """Base of all tables: checks its fields when made, and reads itself from a dict.

    Subclasses have `table` above them and fields made by the functions above. ``check`` may refuse combinations of
    values; ``several`` says whether a scene may have more than one, ``[[load]]``, ``excludes`` names tables that it
    does not stand beside, and ``either`` lists sets of keys of which one must be there.
    """

    several = False
    excludes: ClassVar[tuple[str, ...]] = ()
    either: ClassVar[tuple[tuple[str, ...], ...]] = ()
    __dataclass_fields__: ClassVar[dict[str, Any]]

    def __post_init__(self) -> None:
        for f in dataclasses.fields(self):
            value = getattr(self, f.name)
            if value is None and f.default is None:
                continue
            if value is None and f.default_factory is not MISSING:
                value = f.default_factory()
            object.__setattr__(self, f.name, checked(key_of(f), value, f))
        self.check()

    def with_value(self, key: str, value: Any) -> Self:
        """A copy with another value of one field, which alone is read; it costs less than `dataclasses.replace`."""
        changed = object.__new__(type(self))
        changed.__dict__.update(self.__dict__)
        object.__setattr__(changed, key, checked(key, value, self.__dataclass_fields__[key]))
        changed.check()
        return changed

    def check(self) -> None:
        """Refuse impossible combinations of values; the default refuses none."""

    @classmethod
    def keys(cls, given: dict[str, Any]) -> list[str]:
        """Names of the keys that the table may have when it is read from a dict."""
        return [key_of(f) for f in dataclasses.fields(cls)]

    @classmethod
    def read(cls, where: str, given: Any) -> Self:
        """The table from a dict; ``where`` (such as ``[gravity]``) begins every message."""
        if not isinstance(given, dict):
            raise InputError(f"{where} = {quote(given)} must be a table")
        with refused_at(where):
            return cls(**given)

    def to_dict(self) -> dict[str, Any]:
        """The table as plain TOML values, defaults filled in, absent values left out."""

        def plain(value):
            if isinstance(value, Table):
                return value.to_dict()
            if isinstance(value, (tuple, list)):
                return [plain(x) for x in value]
            if isinstance(value, dict):
                return {k: plain(x) for k, x in value.items()}
            return value

        return {key_of(f): plain(v) for f in dataclasses.fields(self) if (v := getattr(self, f.name)) is not None}
