"""Keys of ``[cable]`` and its groups that some laws alone have: points of a curve, and parameters of other packages.

May change: private functions and texts of errors. Must stay: keys of `CURVES`, which are fields of `Cable`, `Group` and
`effects.thread.Thread` and heads of CSV files; names of parameters, which are columns that compiled laws read. `cable`
calls all functions of this file. Tests: ``tests/net/test_curves.py``, ``tests/how_to/test_law.py``.
"""

from __future__ import annotations

import pathlib
from typing import Any

import numpy as np

from ..accepted import accepts, any_of
from ..errors import InputError, refused_at
from ..messages import quote, short
from ..tables import Table, field, rows, text
from .tension_laws import law_of, names_in

CURVES = {"stress": "Pa", "tension": "N"}
"""Keys of a curve over strain, and their units."""
EITHER = (("modulus", "density"), ("material",), ("stress", "density"), ("tension", "density"))
"""Sets of keys of which a cable or a thread has one at least."""


def points(*, unit) -> Any:
    """Points of a curve over strain: a list of rows of two numbers, or the path of a CSV file; None by default."""
    listed, path = (kind.metadata["read"] for kind in (rows(2), text()))

    @accepts(any_of(listed.accepts, path.accepts))
    def read(name, value):
        return path(name, value) if isinstance(value, str) else listed(name, value)

    return field(read, default=None, unit=unit)


def curve_key(table):
    """Key of the curve of a cable or a group, None where it has none; refuses two."""
    keys = [key for key in CURVES if getattr(table, key) is not None]
    if len(keys) > 1:
        raise InputError("stress and tension both give the curve of the law: leave one of them out")
    return keys[0] if keys else None


def check(cable, own_modulus):
    """Refuse keys of a cable or its groups that their law does not have, and a law "table" without a curve.

    ``own_modulus`` is the modulus of the cable that no material gives.
    """
    tables = {"": cable, **{f"groups.{short(name)}: ": group for name, group in cable.groups.items()}}
    inherits = any((group.law or cable.law) != "table" and group.modulus is None for group in cable.groups.values())
    for where, table in tables.items():
        law, key = table.law or cable.law, curve_key(table)
        if key and law != "table":
            raise InputError(f'{where}{key} has no meaning with law = "{law}": leave it out, or give law = "table"')
        if law != "table":
            continue
        if not any(map(curve_key, tables.values())):
            raise InputError(f'{where}law = "table" needs stress = [[strain, Pa], ...] or tension = [[strain, N], ...]')
        modulus = own_modulus if table is cable else None if table.material else table.modulus
        if modulus is not None and not (table is cable and inherits):
            raise InputError(
                f'{where}modulus = {modulus:g} has no meaning with law = "table", whose curve gives it: leave it out'
            )
        if table is not cable or not inherits:
            object.__setattr__(table, "modulus", None)


def curves_of(cable, laws, given):
    """The `refweb.net.laws.curve.Curve` of each line of the law "table", None of others, an array of objects.

    ``laws`` are names, shape (lines,), and ``given`` is the number of the group that gives each key of a line, see
    `refweb.net.groups.givers`.
    """
    curves, tables = np.full(len(laws), None), [cable, *cable.groups.values()]
    names = ["", *(f".groups.{short(name)}" for name in cable.groups)]
    none = np.full(len(laws), -1)
    by_stress, by_tension = (given.get(key, none) for key in CURVES)
    for line in np.flatnonzero((by_stress >= 0) & (by_tension >= 0))[:1]:
        raise InputError(f"[cable.groups] line {line} has both stress and tension: give it one of them")
    owner = 1 + np.maximum(by_stress, by_tension)
    for number, (name, table) in enumerate(zip(names, tables, strict=True)):
        key, lines = curve_key(table), np.flatnonzero(owner == number)
        if key is None or not len(lines):
            continue
        for line in lines[laws[lines] != "table"][:1] if number else ():
            raise InputError(f'[cable{name}] {key} has no meaning with law = "{laws[line]}" of line {line}')
        with refused_at(f"[cable{name}]"):
            curve = _curve(getattr(table, key), key)
        for line in lines[laws[lines] == "table"]:
            curves[line] = curve
    for line in np.flatnonzero((laws == "table") & (curves == None))[:1]:  # noqa: E711
        raise InputError(f'[cable] law = "table" of line {line} needs stress = [[strain, Pa], ...] or tension = ...')
    return curves


def _curve(given, key):
    """The curve of points, or of a file of them."""
    from .laws.curve import curve_of

    if not isinstance(given, str):
        return curve_of(given, CURVES[key])
    from .csv_files import columns_of

    path = pathlib.Path(given)
    with refused_at(f"{key} = {quote(given)}:"):
        try:
            columns = columns_of(path, ("strain", key))
        except OSError as error:
            raise InputError(f"cannot be read: {error.strerror or error}") from None
        return curve_of(tuple(map(tuple, columns.tolist())), CURVES[key])


def with_springs(values, modulus):
    """Moduli [Pa] and curves of lines with springs of a ``modulus`` [Pa] beside them, by key of ``values``."""
    both = {"modulus": values["modulus"] + modulus}
    if "curve" in values and np.any(modulus):
        from .laws.curve import beside

        both["curve"] = curves = values["curve"].copy()
        for line in np.flatnonzero((values["law"] == "table") & (modulus > 0.0)):
            area = values["area"][line] if curves[line].unit == "N" else 1.0
            curves[line] = beside(curves[line], float(modulus[line] * area))
    return both


def parameters_of(cable, laws, given):
    """Numbers of lines by the columns of laws of other packages, a dict of arrays of shape (lines,).

    A parameter that the law of a line does not have, needs, or takes no such value of, is refused.
    """
    columns, owner = {}, given.get("parameters", np.full(len(laws), -1))
    tables = [("[cable]", cable), *((f"[cable.groups.{short(key)}]", group) for key, group in cable.groups.items())]
    for law in names_in(laws):
        kind, of_law = law_of(law), laws == law
        for number in np.unique(owner[of_law]) if "parameters" in given else (-1,):
            where, table = tables[number + 1]
            values = dict(cable.parameters or {}) if law == cable.law else {}
            values |= table.parameters if number >= 0 else {}
            with refused_at(f"{where} parameters:"):
                if issubclass(kind, Table):
                    for key, value in vars(kind(**values)).items():
                        columns.setdefault(key, np.zeros(len(laws)))[of_law & (owner == number)] = value
                for key in values if not issubclass(kind, Table) else ():
                    raise InputError(f'{short(key)} has no meaning with law = "{law}", which has no parameters')
    return columns
