"""Rounded edges of boxes and cylinders.

May change: texts of errors. Must stay: what `edge_radius` and `shrunk` return, which `box` and `cylinder` call.
`ROUNDING` stands in docstrings of both, and changes results of all scenes without the key ``rounding``. Must stay as
well: `check_rounding`, which `box` and `cylinder` import. Tests: ``tests/effects/test_contact.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

ROUNDING = 0.02
"""Default radius of edges over the smallest size."""


def edge_radius(rounding, sizes):
    """Radius of edges [m] of a body of some sizes [m]; ``rounding`` is the given radius or None."""
    return rounding or ROUNDING * min(sizes)


def shrunk(sizes: Sequence[float], edge: float) -> tuple[float, float, float]:
    """Half sizes of the core [m] of a body of some sizes with edges of a radius [m]."""
    x, y, z = (max(0.5 * size - edge, 0.0) for size in sizes)
    return x, y, z


def check_rounding(rounding, sizes):
    """Refuse edges of more than half the smallest size."""
    if rounding is not None and rounding > 0.5 * min(sizes):
        raise InputError(f"rounding = {rounding:g} must be ≤ {0.5 * min(sizes):g} [m], half the size")
