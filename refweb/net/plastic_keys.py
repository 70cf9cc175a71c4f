"""Keys of lines that yield: yield stress, and hardening, a number or a curve of stress over plastic strain.

May change: private functions and texts of errors. Must stay: names in `KEYS`, which are fields of `Cable` and `Group`;
equally many points in the curves of all lines, which `effects.plastic` needs; `LAW`, a name in `registry.LAWS`;
`yield_curves`, which `effects.plastic` and `cable` import; `check_yield` and `hardening_key`, which `cable` imports;
`plastic_strain_of`, which `tension_laws` imports. Tests: ``tests/effects/test_plastic.py``.
"""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from ..messages import short
from ..tables import LARGEST, real_or_rows
from .groups import givers

LAW = "elastic-plastic"
KEYS = ("yield_stress", "hardening")


def hardening_key():
    """A modulus of hardening, or points (plastic strain, stress); None by default."""
    return real_or_rows(default=None, at_least=0, unit="Pa")


def _check_points(points, where):
    """Refuse a curve of hardening that is none."""
    if len(points) < 2 or points[0][0] != 0.0 or not points[0][1] > 0.0:
        raise InputError(f"{where}hardening must have two points or more, the first [0, yield stress], > 0 [Pa]")
    for i in range(1, len(points)):
        if points[i][1] < points[i - 1][1]:
            raise InputError(
                f"{where}hardening[{i}][1] = {points[i][1]:g} must be ≥ {points[i - 1][1]:g} [Pa]: lines do not soften"
            )


def check_yield(cable):
    """Refuse keys of yield where the law has none, and a law that needs them without."""
    tables = {"": cable, **{f"groups.{short(name)}: ": group for name, group in cable.groups.items()}}
    for where, table in tables.items():
        law = table.law or cable.law
        for key in KEYS:
            if law != LAW and getattr(table, key) is not None:
                raise InputError(f'{where}{key} has no meaning with law = "{law}": leave it out, or give law = "{LAW}"')
        if law != LAW:
            continue
        inherits = cable if cable.law == LAW else table
        hardening = inherits.hardening if table.hardening is None else table.hardening
        stress = inherits.yield_stress if table.yield_stress is None else table.yield_stress
        if isinstance(table.hardening, tuple):
            _check_points(table.hardening, where)
        if isinstance(hardening, tuple) and (stress if table is cable else table.yield_stress) is not None:
            remedy = "leave one out" if table.hardening is not None else "give hardening of this group as well"
            raise InputError(f"{where}yield_stress = {stress:g} and the points of hardening both say it: {remedy}")
        if not isinstance(hardening, tuple) and stress is None:
            raise InputError(f'{where}law = "{LAW}" needs yield_stress = ... [Pa], or hardening = [[0, stress], ...]')


def plastic_strain_of(stress, curves):
    """Plastic strain at which each line yields at a stress [Pa], 0 below its yield stress; shape (lines,).

    ``curves`` are those of `yield_curves`. A stress that no hardening reaches is refused.
    """
    strain = np.zeros(len(stress))
    for line in np.flatnonzero([value > curve[0, 1] for value, curve in zip(stress, curves, strict=True)]):
        (p0, y0), (p1, y1) = curves[line][-2:]
        if stress[line] <= y1:
            strain[line] = np.interp(stress[line], curves[line][:, 1], curves[line][:, 0])
        elif y1 > y0:
            strain[line] = p0 + (stress[line] - y0) * (p1 - p0) / (y1 - y0)
        else:
            raise InputError(
                f"line {line} cannot have a stress of {stress[line]:g} Pa: it yields at {y1:g} Pa at most, raise "
                "yield_stress or hardening, or lower the tension"
            )
    return strain


def yield_curves(cable, web):
    """Yield stress over plastic strain of each line, shape (lines, points, 2); of lines that do not yield without end.

    Shorter curves go on along their last slope.
    """
    given, tables = givers(web.groups, cable.groups, len(web.lines)), [cable, *cable.groups.values()]
    none = np.full(len(web.lines), -1)
    of_keys = [given.get(key, none) for key in ("law", *KEYS)]
    curves = []
    for numbers in zip(*of_keys, strict=True):
        law, stress, hardening = (
            getattr(tables[1 + number], key) for number, key in zip(numbers, ("law", *KEYS), strict=True)
        )
        if law != LAW:
            curves.append(((0.0, LARGEST), (1.0, LARGEST)))
        elif isinstance(hardening, tuple):
            curves.append(hardening)
        else:
            curves.append(((0.0, stress), (1.0, stress + (hardening or 0.0))))
    count, made = max(map(len, curves)), []
    for curve in curves:
        (p0, y0), (p1, y1) = curve[-2:]
        more = [(p1 + k * (p1 - p0), y1 + k * (y1 - y0)) for k in range(1, 1 + count - len(curve))]
        made.append([*curve, *more])
    return np.array(made)
