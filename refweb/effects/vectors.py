"""Products of vectors of three numbers, as compiled kernels.

May change: nothing: kernels of the whole room call these functions, and another order of sums changes the last digits
of all results. Must stay: vectors as tuples of three numbers. A new product is a new function. Must stay as well:
`cross`, which `bending`, `body_load` and other files import; `dot`, which `bending`, `contact_solver` and other files
import; `solve`, which `contact_solver` and `drag.implicit_drag` import; `add`, which `drag.implicit_drag` imports.
Tests, of the kernels that call them: ``tests/test_contract.py``, ``tests/effects/test_bending.py``,
``tests/effects/test_contact_losses.py``, ``tests/effects/test_drag.py``.
"""

from __future__ import annotations

from ..kernels import kernel


@kernel()
def cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel()
def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel()
def add(a, b):
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@kernel()
def solve(a, b, c, r):
    """Numbers p, q, s with p a + q b + s c = r, by Cramer's rule."""
    bc = cross(b, c)
    inverse = 1.0 / dot(a, bc)
    return inverse * dot(r, bc), inverse * dot(r, cross(c, a)), inverse * dot(r, cross(a, b))
