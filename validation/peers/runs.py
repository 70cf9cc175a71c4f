"""Runs of programs, each in a process of its own, and what they took."""

from __future__ import annotations

import ast
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time
from typing import NamedTuple

import numpy as np

from refweb.sweeps.threads import ONE_THREAD

ROOT = pathlib.Path(__file__).parents[2]
PROGRAMS = pathlib.Path(__file__).parent / "programs"
COMPLAINT = re.compile(r"(?i)\b(error|warning|fail\w*|singular|diverge\w*|not converge\w*|nan)\b")
ORDER = ("dop853", "mujoco", "opensees", "exudyn", "kratos", "moordyn", "jax_fdm", "warp", "newton", "pyelastica")
"""Peers, in the order of tables."""


class Machine(NamedTuple):
    """Interpreter of the peers, the environment of all programs, and the longest time of a run [s]."""

    python: str
    environment: dict
    limit: float


def machine(python=sys.executable, limit=300.0):
    """A `Machine` whose programs have one thread each.

    OpenSeesPy finds libraries that its wheel brings only where ``LD_LIBRARY_PATH`` names their folder.
    """
    command = [
        python,
        "-c",
        "from importlib.util import find_spec as f; s = f('openseespylinux'); print(s and s.origin)",
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    libraries = pathlib.Path(done.stdout.strip()).parent / "lib"
    environment = {**os.environ, **ONE_THREAD}
    for name, folder in (("PYTHONPATH", ROOT), ("LD_LIBRARY_PATH", libraries)):
        environment[name] = os.pathsep.join(filter(None, (str(folder), os.environ.get(name))))
    return Machine(python, environment, limit)


def run(machine, name, task, problem, settings, python=None):
    """What one run of a program took, and what it returned; refweb runs by this interpreter, unless one is given.

    Returns
    -------
    cost : dict
        As `validation.peers.child` writes it, with ``failure`` and ``words`` of a program that failed.
    result : ndarray or None
    """
    python = python or (sys.executable if name == "refweb" else machine.python)
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        problem.save(folder / "problem.npz")
        command = [python, "-m", "validation.peers.child", name, task, str(folder), json.dumps(settings)]
        with open(folder / "output", "w+", encoding="utf-8", errors="replace") as output:
            begun = time.perf_counter()
            try:
                status = subprocess.run(
                    command, env=machine.environment, cwd=folder, stdout=output, stderr=subprocess.STDOUT,
                    timeout=machine.limit, check=False,
                ).returncode  # fmt: skip
                ended = f"ended by signal {-status}" if status < 0 else f"ended with status {status}"
            except subprocess.TimeoutExpired:
                ended = f"not done after {machine.limit:g} s"
            output.seek(0)
            words = output.read()
        path = folder / "cost.json"
        cost = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {"failure": ended}
        cost["whole_wall"] = time.perf_counter() - begun
        if "failure" in cost:
            cost["words"] = complaint(words)
            return cost, None
        with np.load(folder / "result.npz") as stored:
            return cost, stored["result"]


def complaint(words):
    """First line in which a program complains of something; empty where it does not."""
    lines = (line.strip() for line in words.partition("Traceback (most recent call last)")[0].splitlines())
    return next((line[:200] for line in lines if COMPLAINT.search(line)), "")


def version(machine, name):
    """Version of a program, or None and the reason why it does not run."""
    python = sys.executable if name == "refweb" else machine.python
    command = [python, "-c", f"from validation.peers.programs import {name}; print('\\n' + {name}.version())"]
    done = subprocess.run(command, env=machine.environment, capture_output=True, text=True, check=False)
    if done.returncode:
        told = done.stderr.strip().splitlines()
        errors = [line for line in told if re.match(r"[\w.]*(Error|Exception)\b", line)]
        return None, (errors or told or [f"ended by signal {-done.returncode}"])[-1]
    lines = [line for line in done.stdout.splitlines() if re.search(r"\d+\.\d+", line)]
    return lines[-1] if name != "opensees" else next(line for line in lines if line.startswith("OpenSees")), ""


def tasks(name):
    """Names of the functions of a program, read off its file."""
    return set(definitions(name))


def definitions(name):
    """Statements of a program's file that define a name, by that name."""
    found = {}
    for node in ast.parse((PROGRAMS / f"{name}.py").read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found[node.name] = node
        elif isinstance(node, ast.Assign):
            found |= {target.id: node for target in node.targets if isinstance(target, ast.Name)}
        elif isinstance(node, ast.Import | ast.ImportFrom):
            found |= {(alias.asname or alias.name).partition(".")[0]: node for alias in node.names}
    return found


def lines(name, task):
    """Lines of code of a program that a task needs: its function and all that it calls, without words and gaps."""
    known, needed, waiting = definitions(name), {}, [task]
    while waiting:
        one = waiting.pop()
        if one in known and one not in needed:
            needed[one] = known[one]
            waiting += [node.id for node in ast.walk(known[one]) if isinstance(node, ast.Name)]
    text, count = (PROGRAMS / f"{name}.py").read_text(encoding="utf-8").splitlines(), set()
    for node in needed.values():
        count |= set(range(node.lineno - len(getattr(node, "decorator_list", ())), node.end_lineno + 1))
        first = node.body[0] if isinstance(node, ast.FunctionDef) else None
        if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
            count -= set(range(first.lineno, first.end_lineno + 1))
    return sum(bool(text[n - 1].partition("#")[0].strip()) for n in count)
