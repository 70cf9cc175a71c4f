"""Kernels: found again on disk, compiled again only where what they do has changed, called by address or linked."""

import json
import os
import subprocess
import sys
import threading
import types

import numba
import numpy as np
import pytest

from refweb.compiled import kernel as kernels
from refweb.compiled import keys, numba_internals, store, watched
from refweb.kernels import Matrix, Vector, kernel

FACTORY = '''
import numpy as np
from refweb.kernels import VECTOR, Vector, kernel
from numba import types

@kernel(apart=())
def outer(values: Vector) -> None:
    """{text}"""
    # a comment
    #{lines}
    for i in range(len(values)):
        values[i] = 2.0 * inner_of(values[i])

from own.one import inner as inner_of
'''
INNER = {
    "linked": "@kernel()\ndef inner(value):\n    return {number} * value\n",
    "apart": "@kernel(apart=())\ndef inner(value: float) -> float:\n    return {number} * value\n",
}
SHOW = """
from numba.core import event
seen = event.RecordingListener()
event.register("numba:compile", seen)
import numpy as np
from own.factory import outer
values = np.ones(1)
outer(values)
names = [e.data["dispatcher"].py_func.__name__ for _, e in seen.buffer if e.is_start]
print(values[0], *names)
"""


@pytest.fixture
def run(tmp_path):
    """Writes a package and runs lines in a process of their own; what they print, in words."""
    own = tmp_path / "own"
    own.mkdir()
    (own / "__init__.py").touch()
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}
    environment |= {"REFWEB_CACHE": str(tmp_path / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}

    def write(kind, number, text="text", lines=""):
        (own / "factory.py").write_text(FACTORY.format(text=text, lines=lines))
        (own / "one.py").write_text("from refweb.kernels import kernel\n\n" + INNER[kind].format(number=number))

    def start(lines=SHOW, arguments="", **more):
        command = [sys.executable, "-c", lines, *arguments]
        done = subprocess.run(command, env=environment | more, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout.split()

    start.write = write
    return start


def test_machine_code_is_found_again_whatever_the_words_around_it(run):
    run.write("linked", 3.0)
    assert run()[:1] == ["6.0"] and run() == ["6.0"]
    run.write("linked", 3.0, text="another docstring", lines="\n\n")
    assert run() == ["6.0"]


def test_a_caller_is_compiled_again_where_what_is_linked_into_it_changes(run):
    run.write("linked", 3.0)
    run()
    run.write("linked", 4.0)
    assert run() == ["8.0", "outer", "inner"]


def test_a_caller_stays_where_what_it_calls_by_address_changes(run):
    run.write("apart", 3.0)
    assert sorted(run()[1:]) == ["entry", "inner", "outer"] and run() == ["6.0"]
    run.write("apart", 4.0)
    assert run() == ["8.0", "inner"]


@pytest.mark.slow
def test_the_public_parts_of_numba_alone_give_the_same(run):
    """Without the cache, the options and the calls of our own."""
    for kind in INNER:
        run.write(kind, 3.0)
        assert run(REFWEB_PLAIN="1")[0] == "6.0"


CLASH = """
import sys
from refweb.kernels import kernel

TEXT = '''
import math
@kernel()
def inner(value, times):
    for _ in range(times):
        {lines}
    return {number} + 0.0 * value

@kernel(apart=())
def outer{number}(value: float, times: int) -> float:
    return inner(value, times) * inner(2.0 * value, times + 1) * inner(3.0 * value, times + 2)
'''
for number in map(int, sys.argv[1:]):
    space = {"kernel": kernel, "__name__": "__main__"}
    lines = "value = math.sin(value) + math.cos(value) / (2.0 + value * value); " * 30  # too many to be inlined
    exec(TEXT.format(number=number, lines=lines), space)
    outer = space[f"outer{number}"]
    print(outer(1.0, 2), end=" ")
"""


def test_a_caller_keeps_its_own_copy_of_a_linked_kernel_whatever_is_loaded_before(run):
    """Two processes give different kernels the same symbol; a third one loads the callers of both."""
    outcomes = [run(CLASH, arguments=numbers) for numbers in ("2", "3", "23", "32")]
    assert outcomes == [["8.0"], ["27.0"], ["8.0", "27.0"], ["27.0", "8.0"]]


def calls(module, text):
    """A function that calls ``part.half`` of a module of a package, whose source is a text."""
    module, space = types.ModuleType(module), {}
    exec(text, vars(module))
    exec("def outer(value):\n    return part.half(value)", {"part": module}, space)
    return keys.of_function(space["outer"])


@pytest.mark.parametrize("module, followed", [("own.part", True), ("refweb.part", True), ("numpy.part", False)])
def test_a_caller_by_the_name_of_a_module_knows_what_it_calls(module, followed):
    """Of any package but of libraries, whose functions numba compiles in its own way."""
    one, other = ("def half(value):\n    return 0.5 * value", "def half(value):\n    return value / 4.0")
    assert calls(module, one) == calls(module, one)
    assert (calls(module, one) != calls(module, other)) == followed


def test_a_damaged_file_is_compiled_again(run, tmp_path):
    run.write("apart", 3.0)
    run()
    for path in (tmp_path / "cache").iterdir():
        path.write_bytes(path.read_bytes()[:100])
    assert sorted(run()) == ["6.0", "entry", "inner", "outer"]


def made_of(number):
    """A kernel that captures a number."""

    @kernel(numba.types.float64(numba.types.float64))
    def times(value):
        return number * value

    return times


def test_kernels_of_one_factory_that_capture_different_numbers_have_names_of_their_own():
    two, three, again = made_of(2.0), made_of(3.0), made_of(2.0)
    assert (two(5.0), three(5.0), again(5.0)) == (10.0, 15.0, 10.0)
    assert two.name == again.name != three.name


@kernel(apart=())
def always(values: Vector) -> float:
    total = 0.0
    for i in range(values.size):
        total += values[i]
    return total


@kernel(apart=("seldom",))
def seldom(values: Vector) -> float:
    return -values[0]


@kernel(apart=())
def chooses(values: Vector, other: bool) -> float:
    return seldom(values) if other else always(values)


def test_only_what_a_run_has_is_prepared():
    assert {one.name for one in kernels.needed([chooses], set())} == {chooses.name, always.name}
    assert {one.name for one in kernels.needed([chooses], {"seldom"})} == {chooses.name, always.name, seldom.name}
    kernels.prepare([chooses], set())
    values = np.arange(1.0, 4.0)
    assert chooses.call(values, False) == 6.0
    with pytest.raises(RuntimeError, match="seldom.* is not compiled"):
        chooses.call(values, True)
    assert chooses(values, True) == -1.0  # a call from outside of the run


def test_progress_counts_what_is_to_be_compiled():
    @kernel(apart=())
    def new(value: float) -> float:
        return value + 0.123456789012345

    seen, known = [], new.known()
    with watched(lambda done, count: seen.append((done, count))):
        kernels.prepare([new])
    assert seen == ([] if known else [(0, 1)])
    assert new(1.0) == 1.123456789012345


@kernel(apart=())
def fails(values: Vector, place: int) -> float:
    if place >= values.size:
        raise ValueError("no such place")
    return values[place]


@kernel(apart=())
def passes_on(values: Vector, place: int) -> float:
    return fails(values, place)


def test_an_error_comes_through_a_call_by_address():
    assert passes_on(np.ones(2), 1) == 1.0
    with pytest.raises(ValueError, match="no such place"):
        passes_on(np.ones(2), 2)


@kernel(leaf=True, apart=())
def takes_matrix(values: Matrix) -> int:
    return values.shape[0]


def test_threads_that_call_a_kernel_for_the_first_time_at_once_compile_it_once(monkeypatch, tmp_path):
    """Two machine codes of one signature would be ambiguous: numba would ask for the types again in each call."""
    monkeypatch.setenv("REFWEB_CACHE", str(tmp_path))

    @kernel()
    def first(values):
        return values[0]

    threads = [threading.Thread(target=first, args=(np.ones(1),)) for _ in range(2)]
    with numba_internals.lock:
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(0.5)  # until both wait for the lock
    for thread in threads:
        thread.join()
    asked = []
    monkeypatch.setattr(first._entry, "_compile_for_args", lambda *arguments: asked.append(arguments), raising=False)
    assert first(np.full(1, 3.0)) == 3.0 and not asked


def test_arguments_of_other_types_are_refused():
    with pytest.raises(TypeError):
        takes_matrix(np.ones(3))
    with pytest.raises(TypeError):
        takes_matrix(np.ones((3, 2))[:, :1])


def test_a_leaf_makes_no_arrays():
    @kernel(leaf=True)
    def makes(count):
        return np.zeros(count).size

    @kernel()
    def call_makes():
        return makes(3)

    with pytest.raises(numba.core.errors.NumbaError):
        call_makes()


WARM = """
from numba.core import event
seen = event.RecordingListener()
event.register("numba:compile", seen)
import refweb
solves = {"square-load": {}, "square-impact": {"solve.duration": 1e-2}, "closing-net": {"solve.duration": 5e-3}}
runs = [refweb.run(refweb.Scene.load(name, values)) for name, values in solves.items()]
runs.append(refweb.run(refweb.Scene.load("square-impact", {"solve.duration": 1e-2, "solve.method": "cvode"})))
print([*(solution.cost["compile_s"] for solution in runs), len(seen.buffer)])
"""


def test_a_warm_process_compiles_nothing():
    """What an earlier process has run is found on disk, tables of kernels and of arrays among it.

    So says each run, and so does numba from before the package is there until the end.
    """
    for _ in range(2):
        told = subprocess.run([sys.executable, "-c", WARM], capture_output=True, text=True, check=True).stdout
    assert json.loads(told) == [0.0, 0.0, 0.0, 0.0, 0]


COMPILED_AGAIN = ("contact", "detect", "within", "deepest", "depth", "meets", "pull_at", "collides", "step_back")
RUBS = """
import hashlib, json, sys
import refweb
solution = refweb.run(refweb.Scene.load("square-impact", {"solve.duration": 1.2e-2, "contact.friction": 0.3}))
digests = {name: hashlib.sha256(values.tobytes()).hexdigest() for name, values in solution.history.items()}
print(json.dumps([solution.cost["compile_s"] > 0.0, digests]))
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="links need rights there")
def test_a_run_that_compiles_has_the_bits_of_one_that_loads(tmp_path):
    """For an impact with friction, of whose machine code that of contact is compiled again."""

    def run_with(**more):
        command = [sys.executable, "-c", RUBS]
        done = subprocess.run(command, capture_output=True, text=True, check=True, env={**os.environ, **more})
        return json.loads(done.stdout)

    run_with()
    for path in store.folder().iterdir():
        if not path.name.startswith(COMPILED_AGAIN):
            (tmp_path / path.name).symlink_to(path.absolute())
    first, second = (run_with(REFWEB_CACHE=str(tmp_path)) for _ in range(2))
    assert (first[0], second[0]) == (True, False)
    assert first[1] == second[1]


QUICK = """
import json, sys
import refweb
refweb.run(refweb.Scene.load("square-impact", {"solve.duration": 1e-2}))
heavy = ("scipy.linalg", "scipy.sparse", "skfem", "numba.typed.typeddict", "meshio", "urllib.request")
print(json.dumps([name for name in heavy if name in sys.modules]))
"""


@pytest.mark.slow
def test_a_warm_process_imports_nothing_that_only_compiling_needs():
    """Reading machine code takes no declarations of functions, and none that it names lies in a module with a BLAS."""
    for _ in ("first", "warm"):
        told = subprocess.run([sys.executable, "-c", QUICK], capture_output=True, text=True, check=True).stdout
    assert json.loads(told) == []


TWO_RUNS = """
import refweb
tables = {
    "web": {"kind": "inline", "points": [[0, 0, 0], [1, 0, 0]], "lines": [[0, 1]]},
    "cable": {"law": "linear", "modulus": 1e6, "area": 1e-5, "density": 1000.0},
    "output": {"interval": 1e-3},
    "accuracy": {"error": "none"},
}
for nodes, method in (([0], "central-difference"), ([], "cvode")):
    solve = {"kind": "dynamic", "duration": 1e-3, "method": method}
    found = refweb.run(refweb.Scene.from_dict(tables | {"supports": {"nodes": nodes}, "solve": solve}))
print(found.solver["angular_momentum_drift"])
"""


@pytest.mark.slow
def test_a_run_has_the_kernels_that_an_earlier_one_left_out():
    """Of a line that is held no angular momentum is kept; of a free one it is, which both methods look at."""
    said = subprocess.run([sys.executable, "-c", TWO_RUNS], capture_output=True, text=True)
    assert said.returncode == 0 and float(said.stdout) < 1e-12, said.stderr


WANTED = """
import sys, time
from numba.core import event
seen = event.RecordingListener()
event.register("numba:compile", seen)
from refweb.kernels import Vector, kernel
import refweb.kernels

@kernel(apart=())
def wanted(values: Vector) -> None:
    for i in range(len(values)):
        values[i] = 2.0 * values[i]

open(sys.argv[1] + ".ready", "w").close()
while not open("go").read():
    time.sleep(0.001)
wanted.address()
print(len([1 for _, e in seen.buffer if e.is_start]))
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no such locks there")
def test_of_processes_that_want_a_kernel_at_once_one_compiles_it(tmp_path):
    (tmp_path / "wanted.py").write_text(WANTED)
    (tmp_path / "go").touch()
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "REFWEB_CACHE": str(tmp_path / "cache")}
    begun = {"cwd": tmp_path, "env": environment, "stdout": subprocess.PIPE, "text": True}
    both = [subprocess.Popen([sys.executable, "wanted.py", name], **begun) for name in "ab"]
    while not all((tmp_path / f"{name}.ready").exists() for name in "ab"):
        assert all(process.poll() is None for process in both)
    (tmp_path / "go").write_text("go")
    assert sorted(process.communicate()[0] for process in both) == ["0\n", "1\n"]


MANY = """
import os, sys, time
from numba.core import event
from refweb.compiled import kernel as kernels
from refweb.compiled.second_process import beside
from refweb.kernels import kernel

def made_of(number):
    @kernel(apart=())
    def one(value: float) -> float:
        return number * value
    return one

seen = event.RecordingListener()
event.register("numba:compile", seen)
many = [made_of(float(n)) for n in range(10)]
try:
    with beside(many):
        while sys.argv[1] == "wait" and not all(one.known() for one in many):
            time.sleep(0.001)
        if sys.argv[1] == "end":
            raise KeyboardInterrupt
except KeyboardInterrupt:
    print("ended")
try:
    os.waitpid(-1, 0)
except ChildProcessError:
    print("alone")
kernels.prepare(many)
print(len([1 for _, e in seen.buffer if e.is_start]), *(one(2.0) for one in many))
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="no second process there")
@pytest.mark.skipif(len(getattr(os, "sched_getaffinity", lambda _: [0])(0)) < 2, reason="one core")
@pytest.mark.parametrize("what, words, most", [("wait", ["alone"], 0), ("end", ["ended", "alone"], 10)])
def test_a_second_process_compiles_the_same_and_none_is_left(tmp_path, what, words, most):
    """A block that waits finds all there, and one that is interrupted ends the second process."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "REFWEB_CACHE": str(tmp_path / "cache")}
    environment.pop("REFWEB_COMPILERS", None)
    done = subprocess.run([sys.executable, "-c", MANY, what], env=environment, capture_output=True, text=True)
    *told, count = done.stdout.split()[:-10]
    assert told == words and int(count) <= most and done.stderr == ""
    assert done.stdout.split()[-10:] == [str(2.0 * n) for n in range(10)]


@pytest.mark.ordinary("comprehension")
@pytest.mark.parametrize("what", ["range(3)", "[k for k in range(3)]"], ids=["plain", "comprehension"])
def test_replacements_in_the_front_end_give_the_code_of_numba(tmp_path, what):
    lines = f"""
import sys
from refweb.compiled import numba_internals
if sys.argv[1] == "numba":
    numba_internals._replacements = ()
    numba_internals._FOR_FUNCTIONS_INSIDE = ()
from refweb.kernels import Indices, Matrix, Vector, kernel
import math, re

@kernel()
def size(x, n):
    return math.sqrt(x[n, 0] ** 2 + x[n, 1] ** 2) if n >= 0 else float(n)

@kernel(apart=())
def force(h: float, x: Matrix, cells: Indices, out: Vector) -> int:
    number = 0
    for k in {what}:
        for c in range(cells.shape[0]):
            first, second = cells[c, 0], cells[c, 1]
            if first != second and not (size(x, first) > 1.0 or k == 2):
                out[c] += h * size(x, second) - 2 * k / 3 + max(h, x[c, 1])
                number += 1 + cells[c, 0] // 2
            x[c, 0] = -x[c, 1] + h
    return number

address = force.address()
code = force._body.overloads[tuple(force.signature.args)].library.get_llvm_str()
print(re.sub(r"(pickle[a-z]+)[.][0-9]+", "", code))  # what an address names
"""
    (tmp_path / "own.py").write_text(lines)
    codes = []
    for way in ("numba", "replaced"):
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "REFWEB_CACHE": str(tmp_path / way)}
        command = [sys.executable, str(tmp_path / "own.py"), way]
        codes.append(subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout)
    assert codes[0] == codes[1] != ""


@pytest.mark.parametrize("index", [np.array([1, -2]), np.array([1, -2], np.int32), np.array([1, 2], np.uint8)], ids=str)
@pytest.mark.parametrize("dtype", [np.float64, np.int32, np.bool_])
def test_numbers_of_arrays_are_those_of_python(index, dtype):
    """Read and written by integers of any kind, also from the end, in arrays of one to three axes and in parts of them.

    Numbers that are written have the type of the array.
    """
    number = numba.from_dtype(np.dtype(dtype))
    arrays = [numba.types.Array(number, n, "C") for n in (1, 2, 3)]

    @kernel(numba.types.void(*arrays, numba.typeof(index)))
    def move(line, plane, cube, index):
        i, j = index[0], index[1]
        line[i] = plane[j, -1]
        plane[i + 1, 1] = 2 * cube[i, j, 2] + 0.5
        cube[j, 0, -2] = line[-2] + plane[2][j]
        part = cube[:, 1]
        part[i, j] = cube[-1, -1, -1]
        plane[i][0] = True

    generator = np.random.default_rng(1)
    given = [generator.integers(0, 9, shape).astype(dtype) for shape in ((4,), (4, 3), (3, 4, 3))]
    found, expected = [x.copy() for x in given], [x.copy() for x in given]
    move(*found, index)
    move.py_func(*expected, index.astype(np.int64))
    for a, b in zip(found, expected, strict=True):
        np.testing.assert_array_equal(a, b)


def test_an_array_without_axes_is_read_and_written():
    @kernel()
    def total(x):
        kept = np.zeros(())
        kept[()] = x.sum()
        return kept[()]

    assert total(np.arange(4.0)) == 6.0
