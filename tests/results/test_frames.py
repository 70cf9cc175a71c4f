"""Frames as files: what other programs read in them, how large they are, and that no run keeps what it has written."""

import gc
import math
import weakref

import meshio
import numpy as np
import pytest
import pyvista

import refweb
from refweb import memory
from refweb.errors import InputError
from refweb.pictures.record import of_folder
from refweb.results.state import State
from refweb.results.vtu import meshes, write_mesh

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
    write_mesh(path, mesh)
    by_vtk, by_meshio = pyvista.read(path), meshio.read(path)
    corners = order + 1
    np.testing.assert_array_equal(by_vtk.cells.reshape(-1, corners + 1)[:, 1:], state.system.net.cells)
    np.testing.assert_array_equal(by_vtk.cell_data["tension"], state.element_tension)
    if order == 1:
        np.testing.assert_array_equal(by_vtk.points, state.position)
        np.testing.assert_array_equal(by_vtk.point_data["reaction"], state.reaction)
    np.testing.assert_array_equal(by_vtk.points, by_meshio.points)
    np.testing.assert_array_equal(by_meshio.cells[0].data, state.system.net.cells)
    for name in mesh.point_data:
        np.testing.assert_array_equal(by_vtk.point_data[name], by_meshio.point_data[name])
    for name in mesh.cell_data:
        np.testing.assert_array_equal(by_vtk.cell_data[name], by_meshio.cell_data[name][0])


def test_a_file_is_smaller_than_its_numbers(tmp_path):
    """Also where all bits of the displacements are used, as after a solve, and though base64 takes a third more."""
    solution = refweb.run(pressed(steps=[1.0]), out=tmp_path / "out")
    path = tmp_path / "out/frames/web_000000.vtu"
    numbers = [solution.positions, *(3 * [solution.positions]), *(5 * [solution.tension]), solution.positions[:, :2]]
    assert path.stat().st_size < 0.8 * sum(array.nbytes for array in numbers)


def test_spoilt_frames_are_refused(tmp_path):
    """Wherever a file is cut, or one of its bytes is another."""
    refweb.run(pressed(steps=[1.0]), out=tmp_path / "out")
    path = tmp_path / "out/frames/web_000000.vtu"
    whole = path.read_bytes()
    start = whole.index(b'Name="Points"')
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
