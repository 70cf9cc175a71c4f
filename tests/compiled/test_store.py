"""Files of machine code: only own files are removed, others may read them, and nothing waits or fails for them."""

import os
import pathlib
import subprocess
import sys
import time

import platformdirs
import pytest

from refweb.compiled import second_process, store

NAME = f"force-{'0' * 24}"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder of machine code, in which nothing has been pruned yet."""
    monkeypatch.setattr(store, "folder", lambda: tmp_path)
    store.prune.cache_clear()
    return tmp_path


def test_only_own_files_are_removed(folder):
    names = [NAME, f"{NAME}.lock", "refweb-1.part", "thesis.txt", "force-1"]
    for name in names:
        (folder / name).touch()
        os.utime(folder / name, (0.0, time.time() - 2.0 * store.UNUSED))
    (folder / f"energy-{'1' * 24}").touch()
    store.prune()
    assert sorted(path.name for path in folder.iterdir()) == [f"energy-{'1' * 24}", "force-1", "thesis.txt"]


@pytest.mark.skipif(sys.platform == "win32", reason="no such modes there")
def test_others_may_read_what_is_written(folder):
    before = os.umask(0o022)
    try:
        store.write(NAME, b"code")
    finally:
        os.umask(before)
    assert (folder / NAME).stat().st_mode & 0o777 == 0o644 and store.read(folder / NAME) == b"code"


def test_a_full_disk_leaves_no_part(folder, monkeypatch):
    def full(path, content):
        path.touch()
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(pathlib.Path, "write_bytes", full)
    store.write(NAME, b"code")
    assert not list(folder.iterdir())


@pytest.mark.skipif(sys.platform == "win32", reason="no such locks there")
def test_a_process_that_is_stopped_holds_up_no_other(folder, monkeypatch):
    """Its lock is waited for `PATIENCE`."""
    monkeypatch.setattr(store, "PATIENCE", 0.05)
    hold = "import fcntl, sys, time; f = open(sys.argv[1], 'w'); fcntl.flock(f, 2); print('held', flush=True); input()"
    command = [sys.executable, "-c", hold, str(folder / f"{NAME}.lock")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout.readline() == "held\n"
        with store.alone(NAME):
            assert other.poll() is None
        other.communicate("\n")


def test_a_user_without_home_has_no_folder(monkeypatch):
    def homeless(*_, **__):
        raise RuntimeError("could not determine the home directory")

    monkeypatch.delenv("REFWEB_CACHE", raising=False)
    monkeypatch.setattr(platformdirs, "user_cache_dir", homeless)
    none = store.folder.__wrapped__()
    monkeypatch.setattr(store, "folder", lambda: none)
    store.write(NAME, b"code")
    assert store.read(none / NAME) is None and not (none / NAME).exists()
    with store.alone(NAME):
        pass


@pytest.mark.skipif(sys.platform != "linux", reason="no second process there")
def test_a_caller_may_ignore_the_end_of_its_processes(monkeypatch):
    def gone(*_):
        raise ChildProcessError

    monkeypatch.setattr(second_process, "_copy", lambda kernels: 0)
    monkeypatch.setattr(second_process, "allowed", lambda: True)
    monkeypatch.setattr(os, "waitpid", gone)
    with second_process.beside([None] * second_process.LEAST):
        pass


def test_a_class_of_an_argument_may_move_to_another_module(tmp_path):
    """Machine code names the classes of its arguments: where one is not found any more, it is compiled again."""
    line = "from typing import NamedTuple\n\nclass Line(NamedTuple):\n    ea: float\n"
    pull = "from {0} import Line\nfrom refweb.kernels import kernel\n\n\n@kernel()\ndef doubled(line):\n"
    pull += (
        "    return 2.0 * line.ea\n\n\n@kernel()\ndef outer(a):\n    return doubled(Line(a))\n\n\nprint(outer(3.0))\n"
    )
    environment = {**os.environ, "REFWEB_CACHE": str(tmp_path / "cache")}
    for name, before in (("here", None), ("there", "here")):
        (tmp_path / f"{name}.py").write_text(line, encoding="utf-8")
        (tmp_path / "pull.py").write_text(pull.format(name), encoding="utf-8")
        if before:
            (tmp_path / f"{before}.py").unlink()
        done = subprocess.run(
            [sys.executable, "pull.py"], env=environment, cwd=tmp_path, capture_output=True, text=True, timeout=300
        )
        assert done.returncode == 0 and done.stdout == "6.0\n", done.stderr
