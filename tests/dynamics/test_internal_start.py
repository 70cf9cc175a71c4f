"""Internal variables of runs that start from a folder: they go on, or the start is refused."""

import numpy as np
import pytest

import refweb

WEB = {"kind": "inline", "points": [[0, 0, 0], [1, 0, 0.3], [2, 0, 0]], "lines": [[0, 1], [1, 2]], "supports": [0, 2]}
CABLE = {"law": "tension-only", "modulus": 1e6, "area": 1e-5, "density": 1e3, "prestrain": 0.05}
ARMS = {"arms": [[1e6, 0.1]]}
PULLED = {"point_mass": [{"node": 1, "mass": 0.2}], "velocity": [{"node": 1, "value": [-1.0, 0.0, 1.0]}]}
WINCH = {"end": "first", "speed": 0.6}


def scene(start="web", cable=CABLE, **tables):
    """A mass on two lines that is thrown, for 50 ms, with the tensions of lines and of segments with shares."""
    given = {"web": WEB, "cable": cable, **PULLED, **tables, "accuracy": {"error": "none"}}
    if start != "web":
        del given["velocity"]
    observed = [{"name": f"T{i}", "quantity": "tension", "line": i} for i in (0, 1)]
    observed += [
        {"name": f"S{i}", "quantity": "tension", "thread": t["name"], "segment": i}
        for t in tables.get("thread", [])
        for i in (0, 1)
        if "friction" in t
    ]
    solve = {"kind": "dynamic", "duration": 0.05, "start": str(start)}
    return refweb.Scene.from_dict({**given, "observe": observed, "solve": solve})


def rope(winch=WINCH, **changes):
    """Tables of a thread through the nodes, and of its winch."""
    thread = {"name": "rope", "nodes": [0, 1, 2], "modulus": 1e6, "area": 1e-5, "density": 1e3, "friction": 0.3}
    thread = {key: value for key, value in (thread | changes).items() if value is not None}
    return {"thread": [thread]} | ({"winch": [winch | {"thread": thread["name"]}]} if winch else {})


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Folders of runs by what their lines or threads have, and the runs."""
    at, runs = tmp_path_factory.mktemp("ended"), {}
    for name, keys in (
        ("rope", rope()),
        ("still", rope(winch=None, friction=1e3)),
        ("winch", {"winch": [{"lines": [0], "speed": 0.5}]}),
        ("arms", {"cable": CABLE | {"viscous": ARMS}}),
    ):
        runs[name] = refweb.run(scene(**keys), out=at / name)
    return at, runs


@pytest.mark.parametrize(
    "name, keys",
    [
        ("rope", rope()),
        ("winch", {"winch": [{"lines": [0], "speed": 0.5}]}),
        ("winch", {"winch": [{"lines": [0, 1], "speed": 0.5}]}),
        ("arms", {"cable": CABLE | {"viscous": ARMS}}),
    ],
)
def test_tensions_go_on(folders, name, keys):
    """Of all lines and segments, also where another line gets a winch."""
    at, runs = folders
    went_on = refweb.run(scene(at / name, **keys)).history
    for column in (column for column in runs[name].history if column[0] in "TS" and column[1:].isdigit()):
        assert went_on[column][0] == pytest.approx(runs[name].history[column][-1], rel=1e-12, abs=1e-12)


@pytest.mark.parametrize(
    "name, keys, said",
    [
        ("rope", rope(winch=None), 'thread "rope" has slips at 1 ring and a .* first node .* slips at 1 ring in this'),
        ("rope", rope(name="line"), 'thread "rope" .* in this scene thread "line" runs through its nodes'),
        ("rope", rope(WINCH | {"end": "last"}), r"first node there, and .* a \[\[winch\]\] at its last node in this"),
        ("rope", rope(winch=None, friction=None), "and none in this scene"),
        ("rope", rope(nodes=[2, 1, 0]), r"through nodes \[0, 1, 2\] there and \[2, 1, 0\] in this scene"),
        ("rope", {}, 'thread "rope" .* is not in this scene'),
        ("winch", {"winch": [{"lines": [1], "speed": 0.5}]}, r"line 0 has .* of \[\[winch\]\] there and none in this"),
        ("winch", {}, r"line 0 has .* of \[\[winch\]\] there and none in this"),
        ("arms", {"cable": CABLE | {"viscous": ARMS | {"lines": [0]}}}, "line 1 has .* arms of 0.1 s there and none"),
        ("arms", {"cable": CABLE | {"viscous": {"arms": [[1e6, 0.1], [1e6, 0.4]]}}}, "0.1 s there .* of 0.1, 0.4 s in"),
        ("arms", {"cable": CABLE | {"viscous": {"arms": [[1e6, 0.4]]}}}, "0.1 s there .* of 0.4 s in"),
    ],
)
def test_lengths_that_would_be_lost_are_refused(folders, name, keys, said):
    with pytest.raises(refweb.InputError, match=said):
        refweb.run(scene(folders[0] / name, **keys))


def test_a_thread_that_has_not_slipped_goes_on_under_another_name(folders):
    """Nothing is lost: its segments have their shares as built."""
    at, runs = folders
    went_on = refweb.run(scene(at / "still", **rope(winch=None, friction=1e3, name="line"))).history
    assert went_on["S0"][0] == pytest.approx(runs["still"].history["S0"][-1], rel=1e-12)


def test_arms_of_further_lines_begin_at_rest(folders, tmp_path):
    """Those of the line that had them go on: it has its tension, and the other the one that it has without arms."""
    one = CABLE | {"viscous": ARMS | {"lines": [0]}}
    up = [{"node": 1, "value": [0.0, 0.0, 1.0]}]
    before = refweb.run(scene(cable=one, velocity=up), out=tmp_path / "one").history
    after = refweb.run(scene(tmp_path / "one", velocity=[], cable=CABLE | {"viscous": ARMS})).history
    assert min(before["T0"][-1], before["T1"][-1]) > 0.0
    for column in ("T0", "T1"):
        assert after[column][0] == pytest.approx(before[column][-1], rel=1e-12)


def older(folder, path, *names):
    """A copy of a folder whose checkpoint does not have some arrays, as of an older version."""
    path.mkdir()
    with np.load(folder / "checkpoint.npz") as archive:
        np.savez(path / "checkpoint.npz", **{key: archive[key] for key in archive if key not in names})
    return path


def test_older_folders_are_read_where_that_is_safe(folders, tmp_path):
    """They have the numbers alone: what is wound on a line, and how many rows the slips of a thread take."""
    at, runs = folders
    winch, arms, slips = (
        older(at / name, tmp_path / name, "internal_lines", "threads") for name in ("winch", "arms", "rope")
    )
    run = refweb.run(scene(winch, winch=[{"lines": [0], "speed": 0.5}]))
    assert run.history["T0"][0] == pytest.approx(runs["winch"].history["T0"][-1], rel=1e-12)
    with pytest.raises(refweb.InputError, match="line 0 has"):
        refweb.run(scene(winch, winch=[{"lines": [1], "speed": 0.5}]))
    with np.load(arms / "checkpoint.npz") as archive:
        arrays = {**archive, "internal": "[cable.viscous]"}
    np.savez(arms / "checkpoint.npz", **arrays)
    run = refweb.run(scene(arms, cable=CABLE | {"viscous": ARMS}))
    assert run.history["T1"][0] == pytest.approx(runs["arms"].history["T1"][-1], rel=1e-12)
    run = refweb.run(scene(slips, **rope()))
    assert run.history["S0"][0] == pytest.approx(runs["rope"].history["S0"][-1], rel=1e-12)
    with pytest.raises(refweb.InputError, match='thread "rope" has other slips there'):
        refweb.run(scene(slips, **rope(winch=None)))
