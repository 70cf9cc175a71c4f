"""Parts that effects give to a system, and refusals of those that compiled kernels could not read.

A kernel reads arrays without checks: a row out of range would be memory of others. Each part is checked once here.

`System` and `statics.adjoint` call `parts_of`. May change: the order of checks. Must stay: no check is left out, and
parts keep the order of effects. A new class of parts belongs in `PARTS`, and `System` must sort it. Messages are quoted
by ``tests/test_plugins.py`` and ``tests/how_to/test_law.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..effects.base import BreakLimits, Constraint, ForceTerm, PrescribedMotion, Tangent, VelocityForce
from ..errors import InputError
from ..messages import quote
from ..registry import EFFECTS, name_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..net.net import Net

PARTS = (ForceTerm, PrescribedMotion, Constraint, BreakLimits)
"""Classes of parts."""


def parts_of(effects: Sequence[Any], net: Net) -> list[Any]:
    """Terms, motions, constraints and limits of effects on a net, in their order, a list.

    Raises
    ------
    InputError
        For a part that a system cannot take: the message names the effect, the value and the remedy.
    """
    parts = []
    for effect in effects:
        if hasattr(effect, "on"):
            given = effect.on(net)
            title = f'effect "{_name_of(effect)}"'
            for part in given if isinstance(given, list) else [given]:
                _check(part, net, title)
                if isinstance(part, ForceTerm) and _is_foreign(effect):
                    for kernel in _kernels_of(part).values():
                        if kernel is not None:
                            kernel.renew()
                    from .kernel_trial import refuse_overruns

                    refuse_overruns(part, net, title)
                parts.append(part)
    return parts


def _name_of(effect):
    """Name of an effect in scenes, else that of its class."""
    effect = getattr(effect, "effect", effect)  # of a table among several, see `refweb.build`
    return name_of(EFFECTS, effect) or type(effect).__name__


def _is_foreign(effect):
    """True for an effect whose class is not one of refweb."""
    return not type(getattr(effect, "effect", effect)).__module__.startswith("refweb.")


def _check(part, net, title):
    """Refuse a part by its class, rows, numbers and kernels; ``title`` begins the message."""
    if not isinstance(part, PARTS):
        wanted = "a ForceTerm, a PrescribedMotion, a Constraint, a BreakLimits, or a list of them"
        raise InputError(f"{title}: on(net) returns {quote(part)} and must return {wanted}")
    if isinstance(part, BreakLimits):
        return
    _check_array(part, "cells", np.int32, title)
    cells = part.cells
    if cells.size and not (0 <= cells.min() and cells.max() < len(net.points)):
        outside = (cells < 0) | (cells >= len(net.points))
        raise InputError(
            f"{title}: row {int(cells[outside][0])} of cell {int(outside.any(axis=1).argmax())} must be 0 to "
            f"{len(net.points) - 1}: net.find(nodes) finds rows, and net.cells has those of elements"
        )
    if isinstance(part, ForceTerm) and part.data is None:
        if len(cells) != len(net.cells):
            raise InputError(
                f"{title}: data = None means that cells are the {len(net.cells)} elements of the net, and there are "
                f"{len(cells)} cells: give data, one row a cell"
            )
    else:
        _check_array(part, "data", np.float64, title)
        data: Any = part.data
        if len(data) != len(cells):
            raise InputError(f"{title}: data has {len(data)} rows for {len(cells)} cells: give one row a cell")
    if isinstance(part, ForceTerm):
        _check_kernels(part, title)


def _check_array(part, name, dtype, title):
    """Refuse cells or data that are no array in rows of the type that kernels take."""
    array, wanted = getattr(part, name), np.dtype(dtype)
    if not isinstance(array, np.ndarray) or array.dtype != wanted or array.ndim != 2 or not array.flags.c_contiguous:
        of = f"{array.dtype}, shape {array.shape}" if isinstance(array, np.ndarray) else type(array).__name__
        if isinstance(array, np.ndarray) and not array.flags.c_contiguous:
            of += ", not contiguous"
        raise InputError(
            f"{title}: {name} ({of}) must be a contiguous array of {wanted} with a row a cell: "
            f"np.ascontiguousarray({name}, dtype=np.{wanted}) makes it"
        )


def _kernels_of(term):
    """Kernels of a term by name, None for those that it does not have."""
    kernels = {"force": term.force, "energy": term.energy, "tangent.stiffness": term.tangent.stiffness}
    return kernels | {"tangent.bound": term.tangent.bound, "velocity.damping": term.velocity.damping}


def _check_kernels(term, title):
    """Refuse parts that are None in place of left out, and Python functions in place of kernels."""
    for name, kind in (("tangent", Tangent), ("velocity", VelocityForce)):
        if not isinstance(getattr(term, name), kind):
            value = quote(getattr(term, name))
            raise InputError(f"{title}: {name} = {value} must be a {kind.__name__}: leave it out for one without")
    for name, function in _kernels_of(term).items():
        if not hasattr(function, "signature") and (function is not None or name == "force"):
            of = "None" if function is None else f"a {type(function).__name__}"
            raise InputError(f"{title}: {name} is {of} and must be a kernel: decorate it with refweb.kernels.kernel")
