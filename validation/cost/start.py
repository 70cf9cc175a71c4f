"""What a short run costs: CPU time of whole warm processes, from the command to its end, files included.

    python -m validation.cost.start

A static scene of one line, beside a process that imports the same modules and does nothing else, and the square web hit
by a ball, as shipped, with its twin and its frames. All kernels are on disk. CPU time, minimum of several processes
that alternate; the status is 1 where the ratio is above its limit.
"""

from __future__ import annotations

import os
import pathlib
import statistics
import subprocess
import sys
import tempfile

LIMIT = 1.3
"""Largest ratio of the one line to its imports."""
LINE = """
title = "one line"
web = {kind = "inline", points = [[0, 0, 0], [1, 0, 0]], lines = [[0, 1]], supports = [0]}
cable = {law = "linear", modulus = 7e7, area = 1e-4, density = 200.0}
load = [{node = 1, force = [1.0, 0.0, 0.0]}]
support = [{nodes = [1], components = ["y", "z"]}]
solve = {kind = "static", load_steps = [1.0]}
"""
RUN = "from refweb.__main__ import alone; import sys; alone(); "
LIST = "print('\\n'.join(name for name in sys.modules if name != '__main__'))"
IMPORT = """
import importlib, sys
for name in sys.argv[1:]:
    try:
        importlib.import_module(name)
    except ImportError:  # a module that another makes without a file
        pass
"""


def cpu_time(*command):
    """CPU time of a process [s], and what it prints."""
    before = os.times()
    done = subprocess.run([sys.executable, *map(str, command)], capture_output=True, text=True, check=True)
    after = os.times()
    spent = after.children_user + after.children_system - before.children_user - before.children_system
    return spent, done.stdout


def measure(repeats=9):
    """CPU times of each kind of process by name [s]."""
    with tempfile.TemporaryDirectory() as folder:
        scene, out = pathlib.Path(folder) / "line.toml", pathlib.Path(folder) / "out"
        scene.write_text(LINE, encoding="utf-8")
        line = ("run", scene, "--out", out, "--force")
        modules = cpu_time("-c", RUN + LIST, *line)[1].splitlines()
        modules = modules[modules.index("sys") :]
        commands = {
            "one line": ("-m", "refweb", *line),
            "its imports": ("-c", IMPORT, *modules),
            "impact": ("-m", "refweb", "run", "square-impact", "--out", pathlib.Path(folder) / "impact", "--force"),
        }
        cpu_time(*commands["impact"])
        times = {name: [] for name in commands}
        for _ in range(repeats):
            for name, command in commands.items():
                times[name].append(cpu_time(*command)[0])
    return times


def main():
    """Print the times and the ratio."""
    times = measure()
    for name, spent in times.items():
        print(f"{name:12} {min(spent):.3f} s, median {statistics.median(spent):.3f} s")
    ratios = [one / other for one, other in zip(times["one line"], times["its imports"], strict=True)]
    ratio = min(times["one line"]) / min(times["its imports"])
    print(f"ratio of one line to its imports {ratio:.2f}, median {statistics.median(ratios):.2f}, limit {LIMIT}")
    return 0 if ratio <= LIMIT else 1


if __name__ == "__main__":
    sys.exit(main())
