"""Web files, scene files and folders that are damaged, huge or where they should not be."""

import os
import subprocess
import sys

import meshio
import numpy as np
import pytest

import refweb
from refweb import memory
from refweb.__main__ import main

SCENE = """
[web]
{web}

[cable]
modulus = 7e7
area = 1e-4
density = 200.0

{more}

[solve]
kind = "static"
load_steps = [0.0]
"""
WINDOW = 'kind = "window"\nmesh = "square"\nrows = 3\ncolumns = 3\nside = 0.1'
FILE = 'kind = "file"\npath = "net{}"'


def write(folder, web=WINDOW, more=""):
    (folder / "scene.toml").write_text(SCENE.format(web=web, more=more), encoding="utf-8")
    return str(folder / "scene.toml")


def refused(folder, capsys, *parts, out="out", scene=None):
    """Run the scene of a folder: status 2, one line, and no folder."""
    before = sorted(folder.rglob("*"))
    assert main(["run", scene or str(folder / "scene.toml"), "--out", str(folder / out)]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and len(err) < 1000
    for part in parts:
        assert part in err, err
    assert sorted(folder.rglob("*")) == before
    return err


def net(points=None, cells=None, **data):
    points = np.array([[0, 0, 0], [1, 0, 0], [2, 0.1, 0], [2, 1, 1 / 3]]) if points is None else points
    return meshio.Mesh(points, cells or [("line", [[0, 1], [1, 2], [2, 3]])], **data)


@pytest.mark.ordinary("0-*", "1-*")
@pytest.mark.parametrize("suffix", [".vtu", ".vtk", ".msh"])
@pytest.mark.parametrize("seed", range(5))
def test_spoilt_web_files(tmp_path, capsys, suffix, seed):
    """Cut off anywhere, and with bytes that are others: a message, or the web that is still there."""
    scene, path, random = write(tmp_path, FILE.format(suffix)), tmp_path / f"net{suffix}", np.random.default_rng(seed)
    net().write(path, file_format={".msh": "gmsh22"}.get(suffix))
    whole = path.read_bytes()
    capsys.readouterr()
    for _ in range(20):
        data = bytearray(whole[: random.integers(len(whole))] if random.random() < 0.5 else whole)
        for at in random.integers(len(data), size=random.integers(4)) if data else ():
            data[at] = random.integers(256)
        path.write_bytes(data)
        status = main(["check", scene])
        err = capsys.readouterr().err
        assert status in (0, 2) and err.count("\n") == (status == 2)
        assert status == 0 or err.startswith(f'refweb: scene.toml: [web] path = "net{suffix}": ')


FOUR = np.array([[0, 0, 0], [1, 0, 0], [2, 0.1, 0], [2, 1, 1 / 3]])
WRONG_WEBS = {
    "wrong cells": (net(cells=[("tetra", [[0, 1, 2, 3]])]), "it holds 1 tetra cells: a web has only lines"),
    "not a number": (net(FOUR * [1, np.nan, 1]), "points[0] = [0.0, nan, 0.0] must be finite"),
    "endless": (net(FOUR + [np.inf, 0, 0]), "points[0] = [inf, 0.0, 0.0] must be finite"),
    "coinciding": (net(FOUR[[0, 0, 2, 3]]), "lines[0] = [0, 1] has no length: its nodes coincide"),
    "no lines": (net(cells=[("line", np.zeros((0, 2), dtype=int))]), "meshio cannot read"),
    "no cells": (meshio.Mesh(FOUR, []), "meshio cannot read"),
}


@pytest.mark.parametrize("name", WRONG_WEBS)
def test_files_of_no_web(tmp_path, capsys, name):
    mesh, message = WRONG_WEBS[name]
    write(tmp_path, FILE.format(".vtu"))
    mesh.write(tmp_path / "net.vtu")
    refused(tmp_path, capsys, '[web] path = "net.vtu": ', message)


def test_formats_that_refer_to_others_or_do_not_end(tmp_path, capsys):
    for suffix in (".dat", ".mdpa", ".xdmf", ".inp", ""):
        (tmp_path / f"net{suffix}").write_text("x")
        write(tmp_path, FILE.format(suffix))
        refused(
            tmp_path,
            capsys,
            f'[web] path = "net{suffix}": format "{suffix}" must be one of .vtu, .vtk, .vtp, .msh, .csv',
        )


def test_entities_are_not_read(tmp_path, capsys):
    """Neither files, nor texts that grow tenfold nine times."""
    net().write(tmp_path / "net.vtu")
    text, scene = (tmp_path / "net.vtu").read_text(), write(tmp_path, FILE.format(".vtu"))
    (tmp_path / "secret").write_text("0 0 0")
    bomb = "".join(f'<!ENTITY a{i + 1} "{f"&a{i};" * 10}">' for i in range(9))
    for kind, use in (('<!ENTITY e SYSTEM "secret">', "&e;"), (f'<!ENTITY a0 "x">{bomb}', "&a9;")):
        spoilt = text.replace("<VTKFile", f"<!DOCTYPE V [{kind}]><VTKFile", 1).replace("<Piece", f"{use}<Piece", 1)
        (tmp_path / "net.vtu").write_text(spoilt)
        refused(tmp_path, capsys, "meshio cannot read", scene=scene)


# Memory


def test_estimates_of_memory(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(memory, "available", lambda: 1e9)
    many = 'kind = "window"\nmesh = "square"\nrows = 300\ncolumns = 300\nside = 0.1'
    write(tmp_path, many)
    refused(tmp_path, capsys, "[web] 179400 lines", "need about 1.17 GB of memory, must be ≤ 1 GB")
    write(tmp_path, WINDOW.replace("3", "30"), "[cable.groups]".replace("[cable.groups]", ""))
    text = (tmp_path / "scene.toml").read_text().replace("density = 200.0", "density = 200.0\nsubdivide = 1000")
    (tmp_path / "scene.toml").write_text(text)
    refused(tmp_path, capsys, "subdivide = 1000", "GB of memory")
    net().write(tmp_path / "net.vtu")
    write(tmp_path, FILE.format(".vtu"))
    os.truncate(tmp_path / "net.vtu", 200_000_000)
    refused(tmp_path, capsys, "the 200 MB of net.vtu need about 2 GB of memory")


def test_available_memory_is_that_of_the_process():
    import resource

    code = "from refweb import memory; print(memory.available())"

    def limit():
        resource.setrlimit(resource.RLIMIT_AS, (2**31, 2**31))

    found = subprocess.run([sys.executable, "-c", code], preexec_fn=limit, capture_output=True, text=True, check=True)
    assert 1e6 < float(found.stdout) <= 2**31
    assert memory.available() > 1e7


@pytest.mark.slow
@pytest.mark.skipif(not os.path.exists("/proc/self/status"), reason="Linux says how much memory a process has taken")
def test_an_estimate_is_not_far_off():
    """A square web of 79 600 lines, in a process of its own, beside one of 7080, which loads the same libraries."""
    code = """
import refweb
def peak(size):
    web, cable = refweb.Window(mesh="square", rows=size, columns=size, side=0.1), refweb.Cable(
        law="tension-only", modulus=7e7, area=1e-4, density=200.0)
    refweb.run(refweb.Scene(web=web, cable=cable, effects=[refweb.Load(node="centre", force=(0, 0, 1))]))
    # of this process alone: ru_maxrss begins with what the process has that started it
    with open("/proc/self/status") as lines:
        return 1024 * next(int(line.split()[1]) for line in lines if line.startswith("VmHWM"))
print(-peak(60) + peak(200))
"""
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    estimate = memory.needed(79_600 - 7080, 1, False, 0)
    assert 0.3 * estimate < float(found.stdout) < estimate


# Scene files

BOMBS = {
    "deep lists": "x = " + "[" * 100_000,
    "deep tables": "[" + "a." * 5_000 + "a]",
    "deep inline tables": "x = " + "{a=" * 50_000,
    "long number": "x = " + "9" * 100_000,
    "many keys": "\n".join(f"k{i} = 1" for i in range(100_000)),
    "long text": "title = '" + "x" * 10_000_000 + "'",
    "null": "\x00",
}


@pytest.mark.parametrize("name", BOMBS)
def test_bombs(tmp_path, capsys, name):
    (tmp_path / "scene.toml").write_text(BOMBS[name] + "\n" + SCENE.format(web=WINDOW, more=""), encoding="utf-8")
    refused(tmp_path, capsys, "scene.toml: ")


def test_a_huge_list(tmp_path, capsys):
    nodes = ", ".join(["0"] * 100_000)
    write(tmp_path, more=f"[[load]]\nnode = [{nodes}, 99]\nforce = [0.0, 0.0, 1.0]")
    refused(tmp_path, capsys, "[[load]] 1 node[100000] = 99 must be 0 … ")


@pytest.mark.parametrize("value", ["1e308", "nan", "inf", "-inf", "1e101", "5e-324"])
def test_numbers_without_a_meaning(tmp_path, capsys, value):
    write(tmp_path, WINDOW.replace("0.1", value))
    refused(tmp_path, capsys, "[web] side = ", "must be ")


@pytest.mark.parametrize(
    "given", ["points = [[0.0, 0.0, 1e101], [1.0, 0.0, 0.0]]", "points = [[0, 0, -1e308], [1, 0, 0]]"]
)
def test_places_without_a_meaning(tmp_path, capsys, given):
    write(tmp_path, f'kind = "inline"\n{given}\nlines = [[0, 1]]\nnatural_length = 0.1')
    refused(tmp_path, capsys, "[web] points[0][2] = ", "must be ≤ 1e+100")


@pytest.mark.parametrize("table, shown", [('"" = true', '"" = true: '), ('[""]', '[""]: '), ('[[""]]', '[[""]]: ')])
def test_a_key_without_a_name(tmp_path, capsys, table, shown):
    (tmp_path / "scene.toml").write_text(table + "\n" + SCENE.format(web=WINDOW, more=""))
    refused(tmp_path, capsys, f"scene.toml: {shown}unknown table or key")


NAMES = ["../../b", "..", "/tmp/b", "a/b", "a\\\\b", "CON", ".hidden", "a\\u0000b", "\\u202Egnp", "b" * 300, ""]


@pytest.mark.parametrize("name", NAMES)
def test_bodies_do_not_climb_out_of_the_folder(tmp_path, capsys, name):
    """Files are named by bodies: a name that is no plain name is refused, or stays within the folder."""
    body = f'[[body]]\nname = "{name}"\nradius = 0.1\nposition = [0.0, 0.0, -1.0]\nfixed = true\n'
    write(tmp_path, more=body + "[contact]\nstiffness = 1e3")
    (tmp_path / "deep" / "er").mkdir(parents=True)
    before = set(tmp_path.rglob("*"))
    status = main(["run", str(tmp_path / "scene.toml"), "--out", str(tmp_path / "deep" / "er" / "out")])
    err = capsys.readouterr().err
    made = set(tmp_path.rglob("*")) - before
    assert status in (0, 2) and (status == 0 or "[[body]] 1 name = " in err and not made)
    out = tmp_path / "deep" / "er" / "out"
    assert all(out in (path, *path.parents) for path in made)


@pytest.mark.parametrize("title", ["../../up", "/etc/passwd", "..", "Ω 𝄞", "a" * 200])
def test_titles_do_not_climb_out_either(tmp_path, capsys, monkeypatch, title):
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "scene.toml").write_text(f'title = "{title}"\n' + SCENE.format(web=WINDOW, more=""))
    monkeypatch.chdir(tmp_path / "here")
    assert main(["run", "scene.toml"]) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["here"]
    assert len(list((tmp_path / "here").iterdir())) == 2


# Folders


def test_folders_that_cannot_be_used(tmp_path, capsys):
    write(tmp_path)
    (tmp_path / "file").write_text("mine")
    refused(tmp_path, capsys, "file is a file, not a folder", out="file")
    refused(tmp_path, capsys, "file is a file, not a folder", out="file/below")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine").write_text("mine")
    refused(tmp_path, capsys, "is not empty", out="full")
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    refused(tmp_path, capsys, "link is a file, not a folder", out="link")
    refused(tmp_path, capsys, "cannot be used", out="x" * 300)


@pytest.mark.skipif(os.geteuid() == 0, reason="nothing is read-only to root")
def test_folder_that_is_read_only(tmp_path, capsys):
    write(tmp_path)
    (tmp_path / "kept").mkdir(mode=0o500)
    refused(tmp_path, capsys, "cannot be written", out="kept/out")


def test_nothing_of_a_scene_is_run(tmp_path, capsys):
    """A checkpoint with a pickle in it is refused, unread."""

    class Evil:
        def __reduce__(self):
            return os.mkdir, (str(tmp_path / "evil"),)

    refweb.run(refweb.Scene.load(write(tmp_path)), out=tmp_path / "first")
    with np.load(tmp_path / "first" / "checkpoint.npz") as checkpoint:
        arrays = dict(checkpoint)
    np.savez(tmp_path / "first" / "checkpoint.npz", **{**arrays, "bodies": np.array([Evil()], dtype=object)})
    text, dynamic = (tmp_path / "scene.toml").read_text(), 'kind = "dynamic"\nduration = 1e-3\nstart = "first"'
    text = text.replace('kind = "static"\nload_steps = [0.0]', dynamic)
    (tmp_path / "scene.toml").write_text(text)
    refused(tmp_path, capsys, "checkpoint.npz is not what a run of refweb writes")
    assert not (tmp_path / "evil").exists()
