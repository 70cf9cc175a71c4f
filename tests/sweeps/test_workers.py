"""Cases in processes of their own, here and on a cluster, some of which are killed: none is lost, none is twice."""

import json
import os
import pathlib
import signal
import subprocess
import sys
import time

import pytest
import tomli_w
from sweeps.test_sweep import ARMS, FORCE, TWELVE, Here, MadeUp, arms, rows_of

import refweb
from refweb.__main__ import main
from refweb.sweeps.workers import Given, Processes

SCRIPT = f"""
import refweb, sys
arms = {ARMS!r}
found = refweb.sweep(refweb.Scene.from_dict(arms), {{{FORCE!r}: [1.0, 2.0]}}, sys.argv[1], workers=1)
print(found.count, refweb.sweeps.workers.cores() > 0)
"""


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Rows of the undisturbed study, run in this process."""
    folder = tmp_path_factory.mktemp("whole")
    refweb.sweep(arms(), TWELVE, folder / "s", Here())
    return rows_of(folder / "s")


@pytest.mark.slow
def test_processes_of_which_one_is_killed(tmp_path, whole):
    """The same rows bit for bit, in processes of one thread."""

    class Killed(Processes):
        ended = 0

        def submit(self, job):
            future = super().submit(job)
            future.add_done_callback(lambda _: self.kill())
            return future

        def kill(self):
            Killed.ended += 1
            if Killed.ended == 3 and self.pool is not None:
                os.kill(next(iter(self.pool._processes.values())).pid, signal.SIGKILL)

    crew = Killed(2)
    found = refweb.sweep(arms(), TWELVE, tmp_path / "s", crew)
    assert rows_of(tmp_path / "s") == whole and found.count == {"solved": 12} and Killed.ended > 12
    assert crew.pool is None and "OMP_NUM_THREADS" not in os.environ or os.environ["OMP_NUM_THREADS"] == "1"


@pytest.mark.slow
def test_a_script_needs_no_guard(tmp_path):
    """The script is not run again by its workers."""
    (tmp_path / "script.py").write_text(SCRIPT)
    command = [sys.executable, str(tmp_path / "script.py"), str(tmp_path / "s")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert done.stdout == "{'solved': 2} True\n", done.stderr


def processes_below(parent):
    """Numbers of the processes that one has started, and these, as Linux has them."""
    found = []
    for task in pathlib.Path(f"/proc/{parent}/task").glob("*/children"):
        for child in task.read_text().split():
            found += [int(child), *processes_below(child)]
    return found


def is_there(process):
    try:
        return "\nState:\tZ" not in pathlib.Path(f"/proc/{process}/status").read_text()
    except OSError:
        return False


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks at /proc")
@pytest.mark.parametrize(
    "sent, status", [(signal.SIGINT, 130), pytest.param(signal.SIGKILL, -9, marks=pytest.mark.slow)]
)
def test_whatever_ends_a_study_ends_its_workers(tmp_path, whole, sent, status):
    """Ctrl-C goes to all processes of a terminal; a kill to one. The folder is whole, and the study goes on."""
    (tmp_path / "arms.toml").write_text(tomli_w.dumps(ARMS))
    given = {"scene": "arms.toml", "parameters": {FORCE: [1.0 + n for n in range(400)]}}
    (tmp_path / "study.toml").write_text(tomli_w.dumps(given))
    command = [sys.executable, "-m", "refweb", "sweep", "study.toml", "--out", "s", "--workers", "1"]
    begun = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True, "start_new_session": True}
    # What a shell starts in the background ignores Ctrl-C, and so does what that starts.
    begun["preexec_fn"] = lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)
    process = subprocess.Popen(command, cwd=tmp_path, **begun)
    table = tmp_path / "s" / "results.csv"
    while not (table.exists() and table.read_bytes().count(b"\n") > 3):
        assert process.poll() is None
        time.sleep(0.01)
    below = processes_below(process.pid)
    assert below
    os.killpg(process.pid, sent) if sent == signal.SIGINT else process.send_signal(sent)
    _, err = process.communicate(timeout=60)
    assert process.returncode == status and "Traceback" not in err
    while any(map(is_there, below)):
        time.sleep(0.01)
    _, rows = rows_of(tmp_path / "s")
    assert 3 <= len(rows) < 400 and len({row["case"] for row in rows}) == len(rows)
    told = json.loads((tmp_path / "s" / "run.json").read_text())["status"]
    assert told == ("interrupted" if sent == signal.SIGINT else "running")
    here = MadeUp()
    refweb.sweep(tmp_path / "study.toml", out=tmp_path / "s", executor=here)
    assert len(here.ran) == 400 - len(rows) and not {row["case"] for row in rows} & set(here.ran)


def test_no_scheduler_is_one_line(tmp_path, capsys, monkeypatch):
    (tmp_path / "arms.toml").write_text(tomli_w.dumps(ARMS))
    (tmp_path / "study.toml").write_text(tomli_w.dumps({"scene": "arms.toml", "parameters": {FORCE: [1.0]}}))
    monkeypatch.setitem(sys.modules, "distributed", None)
    monkeypatch.chdir(tmp_path)
    assert main(["sweep", "study.toml", "--scheduler", "tcp://127.0.0.1:1"]) == 2
    assert 'pip install "refweb[cluster]"' in capsys.readouterr().err
    assert main(["sweep", "study.toml", "--scheduler", "tcp://127.0.0.1:1", "--workers", "2"]) == 2
    assert "has no meaning with --scheduler" in capsys.readouterr().err and not (tmp_path / "study").exists()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_cluster_of_which_a_worker_is_killed(tmp_path, whole):
    """Separate processes that Dask has started; one dies when three rows are there."""
    distributed = pytest.importorskip("distributed")
    from refweb.sweeps.workers import cluster

    options = {"n_workers": 2, "threads_per_worker": 1, "processes": True, "dashboard_address": None}
    with distributed.LocalCluster(**options, silence_logs=50) as there:
        with cluster(there.scheduler_address) as crew:
            own, killed = crew.submit, []

            def submit(job):
                future = own(job)
                future.add_done_callback(end)
                return future

            def end(_):
                killed.append(None)
                if len(killed) == 3:
                    os.kill(next(iter(there.workers.values())).pid, signal.SIGKILL)

            crew.submit = submit
            assert isinstance(crew, Given) and crew.parallel == 2
            found = refweb.sweep(arms(), TWELVE, tmp_path / "s", crew)
    assert rows_of(tmp_path / "s") == whole and found.count == {"solved": 12} and len(killed) >= 12
