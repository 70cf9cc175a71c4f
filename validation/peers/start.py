"""The time from nothing to a first result: an environment of Python, what ``pip install`` brings, and one small run.

The index and the network that pip uses are those of the machine; nothing is taken from a cache, and what a program
compiles, it compiles.
"""

from __future__ import annotations

import json
import pathlib
import re
import subprocess
import sys
import tempfile
import time

from . import runs
from .work import works

PACKAGES = {
    "refweb": [str(runs.ROOT)],
    "dop853": ["scipy"],
    "mujoco": ["mujoco"],
    "opensees": ["numpy", "openseespy"],
    "exudyn": ["exudyn"],
    "kratos": ["numpy", "KratosMultiphysics", "KratosStructuralMechanicsApplication"],
    "moordyn": ["numpy", "moordyn"],
    "jax_fdm": ["jax_fdm"],
    "warp": ["warp-lang"],
    "newton": ["newton"],
    "pyelastica": ["pyelastica"],
}
"""What a user installs for a program."""
UNREACHED = re.compile(r"Retrying|ConnectionError|ConnectTimeout|ProxyError|resolve host|name resolution|refused")
"""What pip writes where it does not reach the index."""
FIRST = ("impact-error", "form")
"""Works whose quick variant is a first result: the first one that a program takes."""


def reason(words):
    """Reason of a failed installation: the index that is not reached, or the last line of what pip says."""
    lines = words.splitlines()
    unreached = next((line for line in lines if UNREACHED.search(line)), None)
    return f"the package index is not reachable: {unreached.strip()[:200]}" if unreached else lines[-1]


def measured(name):
    """Times [s] and size [MB] of a first result of a program; ``failure`` where there is none."""
    work = next(work for work in map(works().get, FIRST) if work.task in runs.tasks(name))
    found, steps = {"program": name}, {}
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        python = str(folder / "venv" / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python"))
        caches = {"XDG_CACHE_HOME": str(folder / "cache"), "REFWEB_CACHE": str(folder / "cache" / "refweb")}
        for step, command in {
            "venv": [sys.executable, "-m", "venv", str(folder / "venv")],
            "install": [python, "-m", "pip", "install", "--quiet", "--no-cache-dir", *PACKAGES[name]],
        }.items():
            begun = time.perf_counter()
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            steps[step] = time.perf_counter() - begun
            if done.returncode:
                return found | {"failure": reason(done.stderr.strip() or step)}
        machine = runs.machine(python)
        machine = machine._replace(environment=machine.environment | caches)
        problem, settings = work.problem(True), (work.quick or work.settings)[name][0]
        cost, _ = runs.run(machine, name, work.task, problem, settings, python)
        if "failure" in cost:
            return found | {"failure": cost["failure"]}
        size = sum(path.stat().st_size for path in (folder / "venv").rglob("*") if path.is_file())
    return found | {**steps, "first": cost["whole_wall"], "size_mb": 1e-6 * size}


def compare(names, folder, announce=print):
    """What is measured of each program, kept in ``start.json`` of a folder."""
    path = folder / "start.json"
    stored = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    for name in names:
        if name not in stored:
            stored[name] = measured(name)
            path.write_text(json.dumps(stored, indent=1), encoding="utf-8")
            one = stored[name]
            told = one.get("failure") or f"{one['venv'] + one['install']:.0f} s, then {one['first']:.0f} s"
            announce(f"start: {name}: {told}")
    return stored
