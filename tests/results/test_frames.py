"""Frames as files: what other programs read in them, how large they are, and that no run keeps what it has written."""

import gc
import math
import re
import weakref
import zlib

import meshio
import numpy as np
import pytest
import pyvista

import refweb
from refweb import memory
from refweb.errors import InputError
from refweb.pictures.record import of_folder
from refweb.results import vtu_file
from refweb.results.state import State
from refweb.results.vtu import meshes
from refweb.results.vtu_file import Reader, cell_arrays, write

WEB = refweb.Window(mesh="square", rows=12, columns=12, side=0.1)
STEPS = [0.1 * n for n in range(1, 13)]


def pressed(order=1, frames=1, steps=STEPS):
    load = refweb.Load(node="centre", force=(0, 0, 1))
    cable = refweb.Cable(law="tension-only", modulus=7e7, area=1e-4, density=200.0, order=order)
    solve, output = refweb.Static(load_steps=steps), refweb.Output(frames=frames)
    return refweb.Scene(web=WEB, cable=cable, effects=[load], solve=solve, output=output)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_others_read_what_the_state_is(order, tmp_path):
    """VTK, which ParaView is made of, and meshio: all arrays to the last bit, for elements of every order."""
    state = refweb.run(pressed(order, steps=[1.0])).state
    (mesh,) = meshes(state).values()
    path = tmp_path / "web.vtu"
    write(path, mesh)
    by_vtk, others = pyvista.read(path), [meshio.read(path), Reader(path).mesh()]
    corners = order + 1
    np.testing.assert_array_equal(by_vtk.cells.reshape(-1, corners + 1)[:, 1:], state.system.net.cells)
    np.testing.assert_array_equal(by_vtk.cell_data["tension"], state.element_tension)
    if order == 1:
        np.testing.assert_array_equal(by_vtk.points, state.position)
        np.testing.assert_array_equal(by_vtk.point_data["reaction"], state.reaction)
    for other in others:
        np.testing.assert_array_equal(by_vtk.points, other.points)
        np.testing.assert_array_equal(other.cells[0].data, state.system.net.cells)
        for name in mesh.point_data:
            np.testing.assert_array_equal(by_vtk.point_data[name], other.point_data[name])
        for name in mesh.cell_data:
            np.testing.assert_array_equal(by_vtk.cell_data[name], other.cell_data[name][0])


def test_a_file_is_smaller_than_its_numbers(tmp_path):
    """Also where all bits of the displacements are used, as after a solve; raw bytes follow the head."""
    solution = refweb.run(pressed(steps=[1.0]), out=tmp_path / "out")
    path = tmp_path / "out/frames/web_000000.vtu"
    numbers = [solution.positions, *(3 * [solution.positions]), *(5 * [solution.tension]), solution.positions[:, :2]]
    assert path.stat().st_size < 0.8 * sum(array.nbytes for array in numbers)
    assert b'<AppendedData encoding="raw">' in path.read_bytes()


@pytest.mark.parametrize("block", [16, 24, 1 << 18])
@pytest.mark.parametrize("lines", [0, 1, 3, 6])
def test_blocks_of_all_lengths(block, lines, tmp_path, monkeypatch):
    """None, those that end with the data, and a short one at the end."""
    monkeypatch.setattr(vtu_file, "BLOCK", block)
    points = np.random.default_rng(1).normal(size=(7, 3))
    cells = [("line", np.arange(2 * lines).reshape(lines, 2) % 7), ("triangle", np.array([[0, 1, 2]]))]
    values = np.arange(lines + 1.0)
    data = {"tension": [values[:lines], values[lines:]]}
    write(tmp_path / "a.vtu", meshio.Mesh(points, cells, point_data={"velocity": 2 * points}, cell_data=data))
    found, own = pyvista.read(tmp_path / "a.vtu"), Reader(tmp_path / "a.vtu").mesh()
    np.testing.assert_array_equal(found.points, points)
    np.testing.assert_array_equal(found.point_data["velocity"], own.point_data["velocity"])
    np.testing.assert_array_equal(found.cell_data["tension"], values)
    np.testing.assert_array_equal(np.concatenate(own.cell_data["tension"]), values)
    assert found.n_cells == lines + 1 and list(own.cells[-1].data[0]) == [0, 1, 2]
    assert cell_arrays(tmp_path / "a.vtu", ("tension",)) is None  # a triangle is no line


def test_spoilt_frames_are_refused(tmp_path):
    """Wherever a file is cut, or one of its bytes is another."""
    refweb.run(pressed(steps=[1.0]), out=tmp_path / "out")
    path = tmp_path / "out/frames/web_000000.vtu"
    whole = path.read_bytes()
    start = whole.index(vtu_file.MARK) + len(vtu_file.MARK)
    middle = start + 30
    for spoilt in (
        b"",
        whole[:300],
        whole[: start + 3],
        whole[: start + 200],
        whole[:middle] + b"\xff" + whole[middle + 1 :],
    ):
        path.write_bytes(spoilt)
        with pytest.raises(InputError, match="cannot be read"):
            of_folder(tmp_path / "out").frame(0)


def test_a_run_with_a_folder_keeps_one_state(tmp_path, monkeypatch):
    """Counted by weak references while it goes on; without a folder all are kept."""
    alive, begin = weakref.WeakSet(), State.__init__

    def counted(self, *arguments, **named):
        begin(self, *arguments, **named)
        alive.add(self)

    monkeypatch.setattr(State, "__init__", counted)
    gc.freeze()  # what is there before is not looked through again
    most = {}
    for out in (tmp_path / "out", None):
        gc.collect()
        before, counts = len(alive), []

        def note(text, share, counts=counts, before=before):
            gc.collect()
            counts.append(len(alive) - before)

        solution = refweb.run(pressed(), out=out, progress=note)
        most[out] = max(counts)
        if out is not None:
            assert solution.frames == [] and len(list(out.glob("frames/web_*.vtu"))) == len(STEPS)
            np.testing.assert_array_equal(solution.to_pyvista(-1)["web"].cell_data["tension"], solution.tension)
            solution.save(tmp_path / "copy")
            assert len(list((tmp_path / "copy").glob("frames/web_*.vtu"))) == len(STEPS)
        del solution
    gc.unfreeze()
    assert most[tmp_path / "out"] <= 3 and most[None] >= len(STEPS) - 1  # the last, and those being made


def test_frames_that_do_not_fit_are_refused(tmp_path, monkeypatch):
    """Before anything is solved, where no folder takes them; with one, or with fewer, the same scene runs."""
    scene = pressed()
    system = scene.build()
    kept = memory.of_states(len(STEPS), system.rows, len(system.net.cells), read=True)
    monkeypatch.setattr(memory, "needed", lambda *arguments: 0.0)
    monkeypatch.setattr(memory, "available", lambda: 0.5 * kept)
    with pytest.raises(InputError, match=r"frames = 1: 12 frames .* no result folder need about .* must be ≤ "):
        refweb.run(scene)
    refweb.run(scene, out=tmp_path / "out")
    refweb.run(pressed(frames=4))
    moving = scene.replace(solve=refweb.Dynamic(duration=1.0), output=refweb.Output(interval=1e-3, frames=1))
    monkeypatch.setattr(memory, "available", lambda: 2e6)
    with pytest.raises(InputError, match=r"frames = 1: 1001 frames"):
        refweb.run(moving)


@pytest.mark.parametrize("kind", ["static", "dynamic"])
def test_the_estimate_of_states(kind):
    """Against the bytes of all arrays that a kept state holds: not below, and at most twice that."""
    scene = pressed()
    if kind == "dynamic":
        scene = scene.replace(solve=refweb.Dynamic(duration=0.01), output=refweb.Output(interval=1e-3, frames=1))
    solution = refweb.run(scene)
    system = solution.state.system

    def size(value):
        if isinstance(value, np.ndarray):
            return value.nbytes
        held = value.values() if isinstance(value, dict) else value if isinstance(value, tuple) else ()
        return sum(map(size, held))

    held = [size({k: v for k, v in vars(state).items() if k != "system"}) for _, state in solution.frames[:-1]]
    count = len(held)
    told = memory.of_states(count, system.rows, len(system.net.cells), read=kind == "static")
    assert 1.0 <= told / math.fsum(held) <= 2.0


@pytest.mark.parametrize("seed", range(40))
def test_meshio_reads_arrays_of_any_size(tmp_path, seed):
    """It mistakes an offset for another where both are multiples of 4: there is none but the first."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 12))
    names = {name: np.round(rng.standard_normal(n), int(rng.integers(0, 3))) for name in "abcdefgh"}
    lines = rng.integers(0, n, (int(rng.integers(1, 8)), 2))
    written = meshio.Mesh(rng.standard_normal((n, 3)), [("line", lines)], point_data=names)
    vtu_file.write(tmp_path / "one.vtu", written)
    read = meshio.read(tmp_path / "one.vtu")
    np.testing.assert_array_equal(read.points, written.points)
    np.testing.assert_array_equal(read.cells[0].data, lines)
    for name, values in names.items():
        np.testing.assert_array_equal(read.point_data[name], values)
    head = (tmp_path / "one.vtu").read_bytes().split(vtu_file.MARK)[0].decode()
    assert [int(offset) % 4 == 0 for offset in re.findall(r'offset="(\d+)"', head)] == [True] + 11 * [False]


@pytest.mark.parametrize("what", ["digits", "repeated", "zeros", "mixed", "short"])
def test_blocks_are_whole_however_they_are_compressed(what):
    """Numbers whose digits are all their own are stored: some four of their 64 bits repeat, those of the exponent. What
    stores them adds 11 bytes."""
    random = np.random.default_rng(1)
    digits, repeated = random.normal(size=4000), np.tile(random.normal(size=40), 100)
    mixed = np.concatenate([digits, repeated])
    values = {"digits": digits, "repeated": repeated, "zeros": np.zeros(4000), "mixed": mixed, "short": digits[:1]}
    data = values[what].tobytes()
    for cut in (None, 0, 1, 39):
        assert zlib.decompress(vtu_file._compressed(data, cut)) == data
    assert len(vtu_file._compressed(data)) <= 64.0 / 60.0 * len(zlib.compress(data, vtu_file.LEVEL)) + 11
