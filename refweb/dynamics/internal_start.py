"""Internal variables of a start from a folder: those that go on, and a refusal of those that the scene would lose.

May change: words of refusals. Must stay: `known_variables`, which `initial_state` calls; what it compares are the keys
``internal``, ``internal_lines`` and ``threads`` of `system.internal_rows.kept`, and folders without the last two are
still read; names of rows in ``bodies`` of a checkpoint, read here by pattern, as `Net.internal_names` makes them: with
others every variable begins as new, and nothing is refused. Tests: ``tests/dynamics/test_internal_start.py``.
"""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np

from ..errors import InputError
from ..system.internal_rows import WOUND, of_lines, of_threads


def known_variables(system, given, name):
    """Names of the rows of internal variables of a system that go on as a checkpoint has them, a set.

    Others begin as new. Parameters are those of `refweb.dynamics.initial_state.stored`, and the arrays of the
    checkpoint by name.

    Raises
    ------
    InputError
        Where natural lengths of the checkpoint would be lost: a line or thread has no such variables in the scene, or
        others.
    """
    return _of_lines(system, given, name) | _of_threads(system, given, name)


def _rows(given, pattern):
    """Names of the rows of a checkpoint that match, and their numbers."""
    nodes = len(given["displacements"]) - len(given["bodies"])
    matching = [i for i, row in enumerate(given["bodies"].tolist()) if re.fullmatch(pattern, str(row))]
    return given["bodies"][matching].tolist(), given["displacements"][[nodes + i for i in matching]]


def _of_lines(system, given, name):
    """Names of rows of lines that have the same law, arms or winch in a checkpoint and in the scene."""
    net, (title, lines) = system.net, of_lines(system)
    names, numbers = _rows(given, r"\.\d+\.\d+")
    if not names:
        return set()
    numbers = numbers.reshape(len(names) // int(names[0].split(".")[1]), -1)
    before, alike = str(given.get("internal", title)), names == net.internal_names[: net.rows_of_elements]
    used = (numbers[:, :1] if before == WOUND else numbers).any(axis=1)
    of_element = np.repeat(np.arange(len(net.web.lines)), len(numbers) // len(net.web.lines))
    lines_before = given.get("internal_lines", of_element[used])
    if "internal_lines" not in given and alike and title.startswith(before):
        lines_before = lines if title != before else lines_before  # that folder does not say which arms it has
        before = title
    kept = lines_before[np.isin(lines_before, lines) & (alike and title == before)]
    for line in of_element[used & np.isin(of_element, np.setdiff1d(lines_before, kept))][:1]:
        raise InputError(
            f"{name} line {line} has internal variables of {before} there and "
            f"{f'those of {title}' if line in lines else 'none'} in this scene: without them its natural length would "
            "be wrong; give it the same law, arms or winch"
        )
    rows = np.array(names).reshape(len(numbers), -1)
    return set(rows[np.isin(of_element, kept)].ravel().tolist())


def _of_threads(system, given, name):
    """Names of rows of threads that have the same nodes, rings and winch in a checkpoint and in the scene."""
    of_scene, known = of_threads(system), set()
    of_folder: dict[str, Any] = json.loads(str(given["threads"])) if "threads" in given else {}
    for thread in sorted({row[7:].rpartition(".")[0] for row in _rows(given, r"\.slips\..*")[0]}):
        names, numbers = _rows(given, rf"\.slips\.{re.escape(thread)}\.\d+")
        now: Any = of_scene.get(thread)
        before: Any = of_folder.get(thread)
        if before is None:  # an older folder has the number of rows alone
            rows = next((line.rows_of_slips for line in system.net.threads if line.name == thread), 0)
            before = now if len(names) == rows else {"slips": "other slips", "rings": numbers.size}
        if before == now:
            known.update(names)
        elif numbers.ravel()[: before["rings"]].any():
            raise InputError(
                f'{name} thread "{thread}" has {before["slips"]} there, and {_instead(before, thread, of_scene)}: its '
                "natural lengths would be wrong; give it the same name, nodes, friction (0 is one too) and winch"
            )
    return known


def _instead(before, thread, of_scene):
    """Words for what a scene has in place of a thread of a checkpoint."""
    if thread in of_scene:
        now = of_scene[thread]
        if now["nodes"] != before.get("nodes", now["nodes"]):
            return f"runs through nodes {before['nodes']} there and {now['nodes']} in this scene"
        return f"{now['slips'] or 'none'} in this scene"
    same = [title for title, now in of_scene.items() if now["nodes"] == before.get("nodes")]
    return f'in this scene thread "{same[0]}" runs through its nodes' if same else "is not in this scene"
