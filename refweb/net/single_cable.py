"""Single cables, straight or hanging on an arc.

May change: private functions, texts of errors, and `_PARALLEL`, a tolerance. Must stay: keys and docstring of
`SingleCable` (scene format and help; after a change write ``validation/REFERENCE.md`` anew); the order of nodes from
end to end; the class name in `registry.WEBS`. Tests: ``tests/net/test_webs.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

import numpy as np

from ..errors import InputError
from ..tables import Several, Table, choice, integer, real, table, vector
from .web import Web

if TYPE_CHECKING:
    from os import PathLike

_PARALLEL = 1e-9
"""Sine of the angle below which two directions are parallel."""


@table
class SingleCable(Table):
    """Single cable with both ends fixed, divided into lines of equal natural length.

    Groups of lines: ``anchors``, the first and the last; ``inner``, all others; one line alone is ``rim``, see
    `refweb.net.groups`.

    Parameters
    ----------
    start, end : tuple of 3 floats
        Positions of the ends [m].
    elements : int
        Number of lines.
    length : float, optional
        Natural length of the whole cable [m], by default the distance of the ends. A longer cable lies on a circular
        arc with chords of exactly length/elements, a shorter one is straight and stretched.
    sag : tuple of 3 floats, optional
        Direction of the arc seen from the chord; by default −z, for a vertical cable −x.

    Raises
    ------
    InputError
        If the ends coincide, ``sag`` is parallel to the chord, or one line would be longer than the distance.

    Examples
    --------
        [web]
        kind = "cable"
        start = [-1.5, 0.0, 0.0]
        end = [1.5, 0.0, 0.0]
        elements = 100
        length = 4.0
    """

    kind: str = choice("cable", default="cable")
    start: Several = vector(unit="m")
    end: Several = vector(unit="m")
    elements: int = integer(at_least=1, at_most=1_000_000)
    length: float | None = real(default=None, above=0, unit="m")
    sag: Several = vector(default=None)

    def check(self) -> None:
        """Refuse equal ends, an invalid direction, and a single line that is longer than the distance."""
        with np.errstate(over="ignore"):
            distance = np.linalg.norm(np.subtract(self.end, self.start))
        if not 0 < distance < np.inf:
            raise InputError(f"end = {list(self.end)} must be apart from start by a finite distance > 0 [m]")
        if self.sag is not None and self._aside(self.sag) is None:
            raise InputError(f"sag = {list(self.sag)} must not be zero or parallel to the cable, from start to end")
        if self.elements == 1 and self.length is not None and self.length > distance:
            raise InputError(f"elements = 1 must be ≥ 2: length = {self.length:g} m > distance = {distance:g} m")

    def _aside(self, direction):
        """Unit vector of the part of a direction that is normal to the chord; None if there is none."""
        chord = np.subtract(self.end, self.start)
        chord = chord / np.linalg.norm(chord)
        direction = np.divide(direction, np.linalg.norm(direction) or 1.0)
        aside = direction - (direction @ chord) * chord
        size = np.linalg.norm(aside)
        return aside / size if size > _PARALLEL else None

    def web(self, base: str | PathLike[str] | None = None) -> Web:
        """The `Web`, nodes numbered from start to end."""
        n, start, end = self.elements, np.array(self.start), np.array(self.end)
        distance = np.linalg.norm(end - start)
        length = distance if self.length is None else self.length
        points = np.linspace(start, end, n + 1)
        if length > distance:
            along, aside = _arc(n, distance, length)
            for down in (self.sag, (0.0, 0.0, -1.0), (-1.0, 0.0, 0.0)):
                if down is not None and (down := self._aside(down)) is not None:
                    break
            points[1:-1] = start + along[:, None] * ((end - start) / distance) + aside[:, None] * down
        lines = np.stack([np.arange(n), np.arange(1, n + 1)], axis=1)
        each = np.full(n, length / n)
        return Web(points, lines, each, rim=(0, n), kind="cable", length_given=self.length is not None)


def _arc(n, distance, length):
    """Inner vertices of n equal chords on a circular arc: coordinates along and across the line of its ends [m].

    Half the angle φ of a chord solves sin nφ/sin φ = n·distance/length, which decreases from n to 0 on (0, π/n).
    """
    from scipy.optimize import brentq

    chord = length / n
    excess = (length - distance) / chord

    def mismatch(phi):
        return excess - (n - np.sin(n * phi) / np.sin(phi)) if phi > 0 else excess

    phi = np.pi / n  # a circle, where the distance is lost beside the length
    if mismatch(phi) < 0.0:
        angle = brentq(mismatch, 0.0, phi, xtol=1e-300, rtol=4 * np.finfo(float).eps, maxiter=1000)
        phi = cast(float, angle)  # it may be told to give more
    k = np.arange(1, n)
    if phi == 0:
        return k * chord, 0.0 * k
    scale = chord / np.sin(phi) * np.sin(k * phi)
    return scale * np.cos((n - k) * phi), scale * np.sin((n - k) * phi)
