"""Tables and keys that give lines and threads internal variables, for a run that starts from a folder with these.

May change: private functions. Must stay: keys and contents of `kept`, with the title `WOUND`, which `results.folder`
writes to ``checkpoint.npz`` and `dynamics.internal_start` compares with a scene: other titles or words refuse folders
of users; `of_lines` and `of_threads`, which `dynamics.internal_start` imports. Tests:
``tests/dynamics/test_internal_start.py``.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .system import System

WOUND = "[[winch]]"
"""Title of the lengths that winches wind of lines."""


def of_lines(system: System) -> tuple[str, NDArray[np.int64]]:
    """(Table or key that gives lines internal variables, with the times of arms; lines that have them)."""
    net, title = system.net, system.internal_of_lines
    if not title:
        return "", np.zeros(0, dtype=np.int64)
    if net.wound:
        elements = np.concatenate([elements for elements, _ in net.wound])
    elif net.law_is("plastic").any():
        elements = net.law_is("plastic")
    else:
        times = [net.line_data[name] for name in net.line_data.dtype.names or () if name.startswith("arm_time_")]
        title += f" arms of {', '.join(f'{time[0]:.6g}' for time in times)} s"
        elements = net.line_data["arm_ea_0"] > 0.0
    return title, np.unique(net.line[elements])


def of_threads(system: System) -> dict[str, dict[str, Any]]:
    """Nodes in order, slips in words, and the number of slips of each thread by name."""
    return {
        thread.name: {"nodes": thread.rows.tolist(), "slips": _slips(thread), "rings": thread.rings}
        for thread in system.net.threads
    }


def _slips(thread):
    """Slips of a thread in words; empty without any."""
    count, end = len(thread.friction), "last" if thread.at_last else "first"
    rings = [f"slips at {count} ring{'s' if count > 1 else ''}"] if count else []
    return " and ".join(rings + ([f"a [[winch]] at its {end} node"] if thread.winch else []))


def kept(system: System) -> dict[str, NDArray[Any]]:
    """Arrays of a checkpoint by name, of a system with internal variables."""
    arrays = {}
    if system.net.rows_of_elements:
        title, lines = of_lines(system)
        arrays = {"internal": np.array(title), "internal_lines": lines}
    if system.net.threads:
        arrays["threads"] = np.array(json.dumps(of_threads(system)))
    return arrays
