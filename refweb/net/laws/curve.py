"""A law by a curve of points: stress or tension over strain, as it is measured.

Between points the curve is the cubic of each interval with the slopes of PCHIP (Fritsch and Butland, SIAM J. Sci. Stat.
Comput. 5 (1984) 300–304), which is monotone and has a continuous tangent. A slope that PCHIP leaves at 0 at an end is
half that of the last chord, so that the tangent is above 0 throughout. Below the first point lines are slack, and
beyond the last one the last slope goes on. The energy is the exact integral.

Kernels read the pieces of a curve from an array at an address that stands among the numbers of a line. The net keeps
these arrays, `refweb.net.net.Net.kept`.

May change: private functions and how pieces are found. Must stay: numbers of a piece in the order of `WIDTH`, which
kernels here and `statics.monotone_loading` read by position; the arrays, which `Net.kept` keeps alive; ``last_strain``,
which `Net` and `results.state` read by name; stress, tangent, curvature and energy of one curve; `curve_of` and
`beside`, which `net.law_keys` imports; `Table`, which `statics.monotone_loading` imports; public names of `Curve`,
which other files use. Tests: ``tests/net/test_curves.py``.
"""

from __future__ import annotations

import copy
import functools

import numpy as np

from ...compiled.rows import number_at
from ...errors import InputError
from ...kernels import kernel
from .law import HALVED, TensionLaw, evaluate

WIDTH = 6
"""Numbers of a piece: the strain where it begins, three coefficients behind the value there, and its energy there."""


class Curve:
    """A curve that rises, as kernels read it.

    Parameters
    ----------
    points : tuple of tuple of float
        Pairs of a strain [1] and a stress [Pa] or a tension [N].
    unit : {"Pa", "N"}
        Unit of the second numbers.

    Attributes
    ----------
    pieces : ndarray, shape (points, WIDTH)
        Of each interval, and of what is beyond the last point: the strain at which it begins, the coefficients of the
        powers 0 to 3 of the strain from there on, and the energy there; all but the strains over ``steepest``.
    steepest : float
        Largest slope [``unit``].
    first, last : float
        Strains of the first and of the last point.

    Raises
    ------
    InputError
        For fewer than two points, a first point below a strain of 0 or not of a stress of 0, and points that do not
        rise.
    """

    def __init__(self, points, unit):
        _check(points, unit)
        self.points, self.unit = points, unit
        strain, value = np.array(points).T
        step, chord = np.diff(strain), np.diff(value) / np.diff(strain)
        slope = _slopes(strain, value, chord)
        second = (3.0 * chord - 2.0 * slope[:-1] - slope[1:]) / step
        third = (slope[:-1] + slope[1:] - 2.0 * chord) / step**2
        with np.errstate(divide="ignore", invalid="ignore"):
            at = np.where(third < 0.0, -second / (3.0 * third), 0.0)  # where the slope of an interval is largest
        inner = slope[:-1] + at * (2.0 * second + 3.0 * at * third)
        self.steepest = float(max(slope.max(), inner[(at > 0.0) & (at < step)].max(initial=0.0)))
        energy = step * (value[:-1] + step * (slope[:-1] / 2.0 + step * (second / 3.0 + step * third / 4.0)))
        self.pieces = np.zeros((len(strain), WIDTH))
        self.pieces[:, :3] = np.column_stack([strain, value / self.steepest, slope / self.steepest])
        self.pieces[:-1, 3], self.pieces[:-1, 4] = second / self.steepest, third / self.steepest
        self.pieces[1:, 5] = np.cumsum(energy) / self.steepest
        self.first, self.last = float(strain[0]), float(strain[-1])

    @property
    def address(self):
        """Address of the pieces, which live as long as the curve."""
        return self.pieces.ctypes.data


@functools.lru_cache(maxsize=64)
def curve_of(points, unit):
    """The `Curve` of some points."""
    return Curve(points, unit)


@functools.lru_cache(maxsize=64)
def beside(curve, slope):
    """The `Curve` of a line and a spring beside it, which bears ``slope`` [its unit] times the strain."""
    both, pieces = copy.copy(curve), curve.pieces.copy()
    pieces[:, 1:] *= curve.steepest
    if curve.first > 0.0:
        pieces = np.vstack([np.zeros(WIDTH), pieces])
    begin = pieces[:, 0]
    pieces[:, [1, 2, 5]] += slope * np.column_stack([begin, np.ones(len(begin)), 0.5 * begin**2])
    both.first, both.steepest = 0.0, curve.steepest + slope
    pieces[:, 1:] /= both.steepest
    both.pieces = pieces
    return both


def _check(points, unit):
    """Refuse fewer than two points, a first one that is not slack, and a curve that does not rise."""
    kind = "stress" if unit == "Pa" else "tension"
    if len(points) < 2:
        raise InputError(f"{kind} has {len(points)} point, a curve has two or more: [[strain, {unit}], ...]")
    (strain, value), *_ = points
    if strain < 0.0 or value != 0.0:
        raise InputError(
            f"{kind}: the first point is ({strain:g}, {value:g} {unit}), must have a strain ≥ 0 and a {kind} of 0: "
            "begin where the line becomes taut"
        )
    for number, ((before, low), (after, high)) in enumerate(zip(points, points[1:], strict=False)):
        if not (after > before and high > low):
            raise InputError(
                f"{kind}: the curve must rise, but does not from point {number} ({before:g}, {low:g} {unit}) to point "
                f"{number + 1} ({after:g}, {high:g} {unit}): strain and {kind} must both increase"
            )


def _slopes(strain, value, chord):
    """Slopes at the points, by PCHIP."""
    if len(chord) == 1:
        return np.repeat(chord, 2)
    from scipy.interpolate import PchipInterpolator

    slope = PchipInterpolator(strain, value).derivative()(strain)
    for end in (0, -1):
        if slope[end] <= 0.0:
            slope[end] = 0.5 * chord[end]
    return slope


@kernel(forceinline=True)
def piece_at(strain, line):
    """Index of the first number of the piece that a strain is on."""
    curve, low, high = np.int64(line.curve), 0, np.int64(line.pieces)
    while high - low > 1:
        middle = (low + high) // 2
        if strain < number_at(curve, WIDTH * middle):
            high = middle
        else:
            low = middle
    return WIDTH * low


@kernel(forceinline=True)
def read(strain, line):
    """(strain from where its piece begins, the coefficients of the powers 0 to 3, energy where it begins)."""
    curve, at = np.int64(line.curve), piece_at(strain, line)
    h = strain - number_at(curve, at)
    numbers = (number_at(curve, at + 1), number_at(curve, at + 2), number_at(curve, at + 3), number_at(curve, at + 4))
    return h, numbers, number_at(curve, at + 5)


class Table(TensionLaw):
    """A curve of points, slack below the first one."""

    name = "table"
    convex = True
    columns = ("curve", "pieces", "last_strain")

    @kernel()
    def stress(strain, line):
        if strain <= line.slackness:
            return 0.0
        h, c, _ = read(strain, line)
        return line.ea * (c[0] + h * (c[1] + h * (c[2] + h * c[3])))

    @kernel()
    def tangent(strain, line):
        if strain < line.slackness:
            return 0.0
        h, c, _ = read(strain, line)
        return line.ea * (c[1] + h * (2.0 * c[2] + h * 3.0 * c[3]))

    @kernel()
    def curvature(strain, line):
        if strain < line.slackness:
            return 0.0
        h, c, _ = read(strain, line)
        return line.ea * (2.0 * c[2] + h * 6.0 * c[3])

    @kernel()
    def energy_density(strain, line):
        if strain <= line.slackness:
            return 0.0
        h, c, energy = read(strain, line)
        return line.ea * (energy + h * (c[0] + h * (c[1] / 2.0 + h * (c[2] / 3.0 + h * c[3] / 4.0))))

    @classmethod
    def numbers(cls, values):
        """Slackness is the strain of the first point."""
        curves = values["curve"]
        return {
            "slackness": np.array([curve.first for curve in curves], dtype=float),
            "curve": np.array(
                [curve.address for curve in curves], dtype=float
            ),  # exact: below 2⁵³, or a multiple of 16
            "pieces": np.array([len(curve.pieces) for curve in curves], dtype=float),
            "last_strain": np.array([curve.last for curve in curves], dtype=float),
        }

    @kernel()
    def inverse(share, line):
        """Strain at a tension over EA, above 0."""
        curve, low, high = np.int64(line.curve), 0, np.int64(line.pieces)
        while high - low > 1:
            middle = (low + high) // 2
            if share < number_at(curve, WIDTH * middle + 1):
                high = middle
            else:
                low = middle
        begin = number_at(curve, WIDTH * low)
        h, c, _ = read(begin, line)
        if low == np.int64(line.pieces) - 1:
            return begin + (share - c[0]) / c[1]
        left, right = 0.0, number_at(curve, WIDTH * (low + 1)) - begin
        h = (share - c[0]) / (number_at(curve, WIDTH * (low + 1) + 1) - c[0]) * right
        for _ in range(HALVED):  # by Newton's method, within an interval that holds the root
            beyond = c[0] + h * (c[1] + h * (c[2] + h * c[3])) - share
            if beyond > 0.0:
                right = h
            else:
                left = h
            moved = h - beyond / (c[1] + h * (2.0 * c[2] + h * 3.0 * c[3]))
            moved = moved if left <= moved <= right else 0.5 * (left + right)
            if moved == h:
                break
            h = moved
        return begin + h

    @classmethod
    def strain_of(cls, tension, lines):
        """Invert the cubic of the interval of each tension."""
        return evaluate(cls.inverse, tension / lines.ea, lines, cls.columns)
