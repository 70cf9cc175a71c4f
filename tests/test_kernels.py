"""Kernels that capture kernels: names that are theirs alone, and machine code that the next process finds."""

import gc
import json
import os
import subprocess
import sys
import weakref

import numba
import numpy as np
import pytest

from refweb import kernels
from refweb.list_items import item

FACTORY = """
import sys
import numpy as np
from refweb.kernels import VECTOR, kernel
from numba import types

def doubled(inner):
    @kernel(types.void(VECTOR))
    def outer(values):
        for i in range(len(values)):
            values[i] = 2.0 * inner(values[i])
    return outer

def show(inner):
    values, outer = np.ones(1), doubled(inner)
    outer(values)
    print(values[0], sum(outer.stats.cache_hits.values()), outer.py_func.__qualname__.rpartition("_")[2])
"""
INNER = """
from refweb.kernels import kernel

@kernel()
def inner(value):
    return {number} * value
"""
MADE = """
from refweb.kernels import kernel

def of(number):
    @kernel()
    def inner(value):
        return number * value
    return inner

made = of({number}), of({number} + 1.0)
"""


@pytest.fixture
def run(tmp_path):
    """Writes a package and runs lines of it in a process; result, hits and name of each kernel that is shown."""
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "__init__.py").touch()
    (tmp_path / "own" / "factory.py").write_text(FACTORY)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}
    environment["NUMBA_CACHE_DIR"] = str(tmp_path / "cache")

    def write(name, text, number):
        (tmp_path / "own" / f"{name}.py").write_text(text.format(number=number))

    def start(lines):
        command = [sys.executable, "-c", lines]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        found = [line.split() for line in done.stdout.splitlines()]
        return [(float(value), int(hits), name) for value, hits, name in found]

    start.write = write
    return start


def test_machine_code_is_found_again_until_what_is_captured_changes(run):
    run.write("one", INNER, 3.0)
    lines = "from own import factory, one; factory.show(one.inner)"
    ((first, hits, name),) = run(lines)
    assert (first, hits) == (6.0, 0) and run(lines) == [(6.0, 1, name)]
    run.write("one", INNER, 4.0)
    ((second, hits, other),) = run(lines)
    assert (second, hits) == (8.0, 0) and other != name


def test_kernels_that_capture_different_kernels_never_share_a_name(run):
    """Those of one name in two files, and two that a factory has made."""
    run.write("one", INNER, 3.0)
    run.write("two", INNER, 4.0)
    run.write("three", MADE, 5.0)
    found = run(
        "from own import factory, one, two, three; [factory.show(k) for k in (one.inner, two.inner, *three.made)]"
    )
    assert [value for value, _, _ in found] == [6.0, 8.0, 10.0, 12.0]
    assert len({name for _, _, name in found}) == 4


def test_machine_code_is_kept_by_the_content_of_all_kernels(tmp_path, monkeypatch):
    """A changed law in one file makes the machine code of a kernel in another stale: the folder has another name."""
    package = tmp_path / "package"
    (package / "laws").mkdir(parents=True)
    (package / "kernels.py").write_text("")
    law, plain = package / "laws" / "law.py", package / "plain.py"
    law.write_text("@kernel()\ndef law(x):\n    return x\n")
    plain.write_text("a = 1\n")
    monkeypatch.setattr(kernels, "__file__", str(package / "kernels.py"))
    monkeypatch.setattr(kernels.numba.config, "CACHE_DIR", "")
    folders = [kernels._cache_folder()]
    plain.write_text("a = 2\n")
    folders.append(kernels._cache_folder())
    law.write_text("@kernel()\ndef law(x):\n    return 2 * x\n")
    folders.append(kernels._cache_folder())
    assert folders[0] == folders[1] != folders[2] and str(package) in folders[0]


WARM = """
from numba.core import event
seen = event.RecordingListener()
event.register("numba:compile", seen)
import refweb
solves = {"square-load": {}, "square-impact": {"solve.duration": 2e-3}, "closing-net": {"solve.duration": 5e-3}}
runs = [refweb.run(refweb.Scene.load(name, values)) for name, values in solves.items()]
runs.append(refweb.run(refweb.Scene.load("square-impact", {"solve.duration": 2e-3, "solve.method": "cvode"})))
print([*(solution.cost["compile_s"] for solution in runs), len(seen.buffer)])
"""


def test_a_warm_process_compiles_nothing():
    """What an earlier process has run is found on disk, lists of kernels and of arrays among it.

    So says each run, and so does numba from before the package is there until the end.
    """
    for _ in range(2):
        told = subprocess.run([sys.executable, "-c", WARM], capture_output=True, text=True, check=True).stdout
    assert json.loads(told) == [0.0, 0.0, 0.0, 0.0, 0]


QUICK = """
import json, sys
import refweb
refweb.run(refweb.Scene.load("square-impact", {"solve.duration": 2e-3}), out=sys.argv[1])
heavy = ("scipy.linalg", "scipy.sparse", "skfem", "numba.typed.typeddict", "meshio", "urllib.request")
print(json.dumps([name for name in heavy if name in sys.modules]))
"""


def test_a_warm_process_imports_nothing_that_only_compiling_needs(tmp_path):
    """Reading machine code takes no declarations of functions, and none that it names lies in a module with a BLAS."""
    for run in ("first", "warm"):
        told = subprocess.run(
            [sys.executable, "-c", QUICK, str(tmp_path / run)], capture_output=True, text=True, check=True
        ).stdout
    assert json.loads(told) == []


WANTED = """
import sys, time
import numpy as np
from refweb.kernels import VECTOR, kernel
from numba import types

open(sys.argv[1] + ".ready", "w").close()
while not open("go").read():
    time.sleep(0.001)

@kernel(types.void(VECTOR))
def wanted(values):
    for i in range(len(values)):
        values[i] = 2.0 * values[i]

print(sum(wanted.stats.cache_misses.values()))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no such locks there")
def test_of_processes_that_want_a_kernel_at_once_one_compiles_it(tmp_path):
    (tmp_path / "wanted.py").write_text(WANTED)
    (tmp_path / "go").touch()
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    begun = {"cwd": tmp_path, "env": environment, "stdout": subprocess.PIPE, "text": True}
    both = [subprocess.Popen([sys.executable, "wanted.py", name], **begun) for name in "ab"]
    while not all((tmp_path / f"{name}.ready").exists() for name in "ab"):
        assert all(process.poll() is None for process in both)
    (tmp_path / "go").write_text("go")
    assert sorted(process.communicate()[0] for process in both) == ["0\n", "1\n"]


@kernels.kernel(leaf=True)
def first_of_all(values):
    total = 0.0
    for i in range(len(values)):
        total += item(values, i)[0, 0]
    return total


@kernels.kernel()
def call_leaf(values):
    return first_of_all(values)


def test_a_leaf_reads_lists_and_leaves_their_arrays_to_them():
    arrays = [np.full((2, 3), 1.0), np.full((1, 1), 5.0)]
    listed = kernels.typed_list(kernels.MATRIX, arrays)
    assert call_leaf(listed) == call_leaf(listed) == 6.0
    assert first_of_all(listed) == first_of_all(listed) == 6.0  # by its entry from Python
    alive = [weakref.ref(array) for array in arrays]
    assert listed[1][0, 0] == 5.0  # a reference given back once too often would have freed it
    del arrays, listed
    gc.collect()
    assert [one() for one in alive] == [None, None]


def test_a_leaf_makes_no_arrays_and_takes_none_from_lists_otherwise():
    @kernels.kernel(leaf=True)
    def makes(count):
        return np.zeros(count).size

    @kernels.kernel(leaf=True)
    def takes(values):
        return values[0].size

    @kernels.kernel()
    def call_makes():
        return makes(3)

    @kernels.kernel()
    def call_takes(values):
        return takes(values)

    with pytest.raises(numba.core.errors.NumbaError):
        call_makes()
    with pytest.raises(numba.core.errors.NumbaError):
        call_takes(kernels.typed_list(kernels.MATRIX, [np.zeros((1, 1))]))
