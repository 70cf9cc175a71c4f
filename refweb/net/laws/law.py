"""Base of tension laws, and the one law that lines of several have together in compiled kernels.

A law is a class of scalar kernels that take a strain and the numbers of a line by name: those of
`refweb.net.laws.line_data.FIELDS` and the columns of the law. In place of stress and modulus kernels have the tension
and EA of the line, ``line.ea``.

May change: private functions; how `Mixed` chooses, and `DOUBLED` and `HALVED`, limits of the search of a strain. Must
stay: names of kernels and attributes of `TensionLaw`, which laws of users give (a new one needs a default here, and an
entry in `Mixed`), and which `Net.law_is`, `cable` and `statics` read by name; the signature ``(strain, line)``; `LINE`,
the dtype of `line_data.FIELDS`; `evaluate`, which `net.tension_laws`, `statics.adjoint` and other files import;
`record_of`, which `net.net` imports; `zero`, which `straight` imports. Tests: ``tests/net/test_laws.py``,
``tests/net/test_laws_by_group.py``, ``tests/how_to/test_law.py``.
"""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ...compiled.rows import narrowed, record_at
from ...kernels import Matrix, Vector, kernel
from .line_data import FIELDS

if TYPE_CHECKING:
    from numpy.typing import NDArray

LINE = np.dtype(FIELDS)
"""Numbers of a line that every law may read."""


@kernel()
def zero(strain, line):
    """0."""
    return 0.0


@kernel()
def infinite(strain, line):
    """∞."""
    return math.inf


class TensionLaw:
    """Base of tension laws; see `refweb.net.laws` for how to write one.

    A subclass gives the kernels, of the signature ``(strain, line)``, and what is true of it. Tension must not fall
    with strain, its slope must not exceed ``line.ea``, and both must be in proportion to ``line.ea``, which is 0 of a
    line that is broken.

    Attributes
    ----------
    name : str
        Its name in scenes.
    stress : refweb.compiled.kernel.Kernel
        Tension [N].
    tangent : refweb.compiled.kernel.Kernel
        Slope of tension over strain [N]; at a kink that of the taut side.
    energy_density : refweb.compiled.kernel.Kernel
        Energy per natural length, ∫ T dε from 0 [N].
    curvature : refweb.compiled.kernel.Kernel
        Slope of the tangent [N], for the tangents of damping; 0 by default.
    above_floor : refweb.compiled.kernel.Kernel
        Tension above that of the shortest line [N]: damping pushes no more than this. By default the tension of a law
        that goes slack, and infinite of others.
    columns : tuple of str
        Numbers of a line that kernels read besides `refweb.net.laws.line_data.FIELDS`.
    bar : bool
        True if lines resist compression like bars, and never go slack.
    forming : bool
        True of laws of form finding, whose tension does not depend on natural length.
    pushes : bool
        True if tension may be below 0.
    convex : bool
        True if tension is 0 up to some strain ≥ 0 and rises from there on: errors of statics are then proven.
    cone : bool
        True if it is, apart from smoothing, EA (ε − ε0) of taut and 0 of slack lines, ε0 the ``slackness``.
    plastic : bool
        True if lines yield, see `refweb.effects.plastic`: the law is what is elastic of them.
    smoothed : bool
        True if ``smoothing`` has a meaning.
    """

    name: ClassVar[str] = ""
    stress: ClassVar[Any]
    tangent: ClassVar[Any]
    energy_density: ClassVar[Any]
    curvature: ClassVar[Any] = zero
    above_floor: ClassVar[Any]
    columns: ClassVar[tuple[str, ...]] = ()
    bar: ClassVar[bool] = False
    forming: ClassVar[bool] = False
    pushes: ClassVar[bool] = False
    convex: ClassVar[bool] = False
    cone: ClassVar[bool] = False
    smoothed: ClassVar[bool] = False
    plastic: ClassVar[bool] = False

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if "stress" in vars(cls) and "above_floor" not in vars(cls):
            cls.above_floor = infinite if cls.bar or cls.forming else cls.stress

    @classmethod
    def numbers(cls, values: dict[str, Any]) -> dict[str, NDArray[Any]]:
        """Numbers of lines by column, from their properties, see `refweb.net.cable.Cable.properties`."""
        return {name: values[name] for name in cls.columns}

    @classmethod
    def strain_of(cls, tension: NDArray[np.float64], lines: Any) -> NDArray[np.float64]:
        """Strain at a tension.

        Parameters
        ----------
        tension : ndarray, shape (lines,)
            Tensions [N], > 0.
        lines : refweb.net.laws.line_data.LineData
            Numbers of the lines.

        Returns
        -------
        ndarray, shape (lines,)
            Strains [1], infinite where no strain has this tension.
        """
        low = lines.slackness + tension / lines.ea  # its slope is at most EA
        step, high = np.maximum(low, np.finfo(float).tiny), low.copy()
        for _ in range(DOUBLED):
            short = evaluate(cls.stress, high, lines, cls.columns) < tension
            if not short.any():
                break
            low, high = np.where(short, high, low), np.where(short, high + step, high)
            step = np.where(short, 2.0 * step, step)
        endless = evaluate(cls.stress, high, lines, cls.columns) < tension
        for _ in range(HALVED):
            middle = 0.5 * (low + high)
            short = evaluate(cls.stress, middle, lines, cls.columns) < tension
            low, high = np.where(short, middle, low), np.where(short, high, middle)
        return np.where(endless, np.inf, high)

    @classmethod
    def floor(cls, lines: Any) -> NDArray[np.float64]:
        """Largest push of each of some lines [N], 0 of a law that only pulls, shape (lines,)."""
        return np.full(len(lines), math.inf if cls.pushes else 0.0)


DOUBLED, HALVED = 60, 64
"""Largest number of doublings of a strain, and number of halvings of the interval that it is in."""


class Mixed:
    """Law of lines that have several: each kernel calls that of the law whose number stands in the column ``law``.

    Parameters
    ----------
    laws : tuple of type
        Classes of laws, in the order of their numbers.
    numbers : numpy.dtype
        That of the `LineData` of the lines.
    """

    columns = ("law",)

    def __init__(self, laws, numbers):
        records = [record_of(law.columns, numbers) for law in laws]
        for name in ("stress", "tangent", "energy_density", "curvature", "above_floor"):
            setattr(self, name, _chosen([getattr(law, name) for law in laws], records))


def _chosen(kernels, records, number=0):
    """A kernel that calls one of some, that of the number of the line, counted from ``number``."""
    first, record = kernels[0], records[0]
    rest: Any = _chosen(kernels[1:], records[1:], number + 1) if len(kernels) > 1 else None

    @kernel()
    def last(strain, line):
        return first(strain, narrowed(record, line))

    @kernel()
    def choose(strain, line):
        if line.law == number:
            return first(strain, narrowed(record, line))
        return rest(strain, line)

    return choose if rest else last


@functools.cache
def together(laws, numbers):
    """The law of lines that have some laws, with numbers of a dtype: the one law, or a `Mixed`."""
    return laws[0] if len(laws) == 1 else Mixed(laws, numbers)


@functools.cache
def record_of(columns, numbers):
    """Dtype by which kernels read some columns besides `FIELDS` from rows of a dtype, that of a `LineData`."""
    if not columns:
        return LINE
    fixed: Any = LINE.names
    names = [*fixed, *columns]
    formats = [LINE[name] for name in fixed] + [np.dtype(float)] * len(columns)
    fields: Any = numbers.fields
    offsets = [fields[name][1] for name in names]
    return np.dtype({"names": names, "formats": formats, "offsets": offsets})


@functools.cache
def _over_lines(scalar, record):
    """A kernel that writes the values of a scalar kernel for each strain and line."""

    @kernel(leaf=True, apart=())
    def over_lines(strain: Vector, data: Matrix, out: Vector) -> None:
        for i in range(out.size):
            out[i] = scalar(strain[i], record_at(record, data, i, 0))

    return over_lines


def evaluate(scalar, strain, lines, columns=()):
    """A scalar kernel of a law with some columns at the strain of each line [1], shape (lines,).

    ``lines`` is a `refweb.net.laws.line_data.LineData`.
    """
    strain, out = np.ascontiguousarray(strain, dtype=float), np.empty(len(lines))
    if len(lines):
        _over_lines(scalar, record_of(columns, lines.dtype))(strain, lines.matrix, out)
    return out
