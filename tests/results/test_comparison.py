"""Results side by side: agreement is by ±, and differences of scenes are those of their keys."""

import json

import pytest

import refweb
from refweb.__main__ import main
from refweb.results.comparison import compare


def result(value, error=0.1, unit="m", **more):
    return {"value": value, "error": error, "unit": unit, "time": None, "where": None, **more}


def folder(path, results, steps=(), scene="a = 1\n", **more):
    """A result folder of some results."""
    path.mkdir()
    run = {"status": "solved", "results": results, "steps": list(steps), "versions": {"refweb": "0"}, **more}
    (path / "run.json").write_text(json.dumps(run), encoding="utf-8")
    (path / "scene.toml").write_text(scene, encoding="utf-8")
    return path


def agreement(tmp_path, *results):
    """What `compare` says of one result in some folders."""
    number = len(list(tmp_path.iterdir()))
    folders = [folder(tmp_path / f"{number + i}", {"d": one}) for i, one in enumerate(results)]
    found = compare(folders)
    assert found["agree"] is found["results"][0]["agree"]
    assert compare(folders[::-1])["agree"] is found["agree"]
    return found["agree"]


@pytest.mark.parametrize(
    "agree, results",
    [
        (True, [result(1.0), result(1.15)]),
        (False, [result(1.0), result(1.25)]),
        (True, [result(1.0, 0.5), result(-1.0, 1.5)]),  # apart by the sum of ±, which are exact here
        (False, [result(1.0), result(1.15), result(1.3)]),  # the first and the last
        (False, [result(1.0), result(1.15, None)]),  # nothing is shown where ± is unknown,
        (True, [result(1.0), result(1.0, None)]),  # but of equal values
        (True, [result(1.0, 0.0), result(1.0, 0.0)]),
        (False, [result(1.0, 0.0), result(1.0 + 1e-15, 0.0)]),
        (False, [result(1.0), result(1.0, unit="N")]),
        (True, [result(1.0, None, interval=[0.0, 2.0]), result(2.05)]),
        (True, [result(1.0, None, interval=[None, 2.0]), result(-1e9, 0.0)]),
        (False, [result(1.0, None, interval=[0.0, None]), result(-1.0)]),
    ],
)
def test_results_agree_where_their_intervals_meet(tmp_path, agree, results):
    assert agreement(tmp_path, *results) is agree


def test_what_only_one_has_is_listed_and_does_not_count(tmp_path):
    one = folder(tmp_path / "one", {"d": result(1.0), "e": result(5.0)})
    other = folder(tmp_path / "other", {"f": result(6.0), "d": result(1.1)})
    found = compare([one, other])
    assert found["agree"] and [row["name"] for row in found["results"]] == ["d", "e", "f"]
    assert [row["agree"] for row in found["results"]] == [True, None, None]
    d, e, f = found["results"]
    assert d["differences"] == [0.0, pytest.approx(0.1)] and e["values"][1] is f["values"][0] is None


def test_load_steps_are_compared_one_by_one(tmp_path):
    """A difference in a step that is not the last one is seen; a step that only one has is listed."""
    first = [{"step": s, "results": {"d": result(v)}} for s, v in [(1.0, 1.0), (2.0, 2.0), (3.0, 3.0)]]
    second = [{"step": s, "results": {"d": result(v)}} for s, v in [(1.0, 1.5), (3.0, 3.0)]]
    one = folder(tmp_path / "one", first[-1]["results"], first)
    other = folder(tmp_path / "other", second[-1]["results"], second)
    assert {row["step"]: row["agree"] for row in compare([one, other])["results"]} == {1.0: False, 2.0: None, 3.0: True}


def test_differences_of_scenes_are_keys(tmp_path):
    scenes = [
        'x = 1\n[web]\nrows = 3\n[[body]]\nname = "a"\nmass = 1\n[[body]]\nname = "b"\nv = [0, 1]\n[[load]]\nf = 1\n',
        'x = 1\n[web]\nrows = 4\n[[body]]\nname = "b"\nv = [0, 2]\n[[load]]\nf = 1\n[[load]]\nf = 2\n',
    ]
    folders = [folder(tmp_path / str(i), {"d": result(1.0)}, scene=scene) for i, scene in enumerate(scenes)]
    differ = {row["path"]: row["values"] for row in compare(folders)["scene"]}
    assert differ == {
        "web.rows": [3, 4],
        "body.a.name": ["a", None],
        "body.a.mass": [1, None],
        "body.b.v": [[0, 1], [0, 2]],
        "load.1.f": [None, 2],
    }
    assert compare([folders[0], folders[0]])["scene"] == []


def test_command(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder(tmp_path / "a", {"d": result(1.0), "e": result(2.0)}, scene="x = 1\n")
    folder(tmp_path / "b", {"d": result(1.1), "e": result(2.0, None)}, scene="x = 2\n")
    folder(tmp_path / "c", {"d": result(1.3), "g": result(1.0)}, scene="x = 2\n", status="failed")
    assert main(["compare", "a", "b"]) == 0
    out = capsys.readouterr().out
    assert "the results agree" in out and "1.00 ± 0.10 m" in out and "1.10 ± 0.10 m" in out and "100 mm" in out
    assert "x" in out.split("scenes")[1] and "no known error" in out
    assert main(["compare", "a", "b", "c"]) == 1
    out = capsys.readouterr().out
    assert "the results differ" in out and "only in c" in out and "is the run in c" in out and "300 mm" in out
    assert main(["compare", "a", "c", "--json"]) == 1
    assert json.loads(capsys.readouterr().out) == compare(["a", "c"])


@pytest.mark.parametrize(
    ("verdicts", "words"),
    [
        (("no limit", "wide"), ["no limit", "finer mesh"]),
        (("determined", "statistical"), ["statistical", "one draw of many"]),
        (("statistical", "no limit"), ["statistical", "no limit"]),
        (("wide", "depends on the model"), []),
        ((None, None), []),
    ],
)
def test_a_comparison_that_means_nothing_says_so_and_counts_as_before(tmp_path, capsys, verdicts, words):
    for number, near in enumerate((1.1, 1.3)):  # within ± of both, and beyond
        folders = [
            folder(tmp_path / f"{number}{i}", {"d": result(v, verdict=verdict, verdict_text="", parts={})})
            for i, (v, verdict) in enumerate(zip((1.0, near), verdicts, strict=True))
        ]
        (row,) = compare(folders)["results"]
        assert (row["meaningless"] is not None) == bool(words)
        assert all(word in row["meaningless"] for word in words)
        assert [value["verdict"] for value in row["values"]] == list(verdicts)
        assert main(["compare", *map(str, folders)]) == number
        assert ("d: the comparison means nothing: verdict" in " ".join(capsys.readouterr().out.split())) == bool(words)


def test_what_only_one_run_has_is_not_compared(tmp_path):
    one = folder(tmp_path / "a", {"d": result(1.0), "e": result(1.0, verdict="no limit", parts={})})
    found = compare([one, folder(tmp_path / "b", {"d": result(1.0)})])
    assert [row["meaningless"] for row in found["results"]] == [None, None]


def test_what_cannot_be_compared(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder(tmp_path / "a", {"d": result(1.0)})
    folder(tmp_path / "other", {"e": result(1.0)})
    folder(tmp_path / "broken", {"d": result(1.0)}, scene="x = ")
    folder(tmp_path / "strange", {"d": 1.0})
    folder(tmp_path / "cost", None)
    folder(tmp_path / "failed", {}, status="failed")
    (tmp_path / "empty").mkdir()
    for second, message in [
        ([], "needs two result folders or more"),
        (["empty"], "empty: holds no run.json of refweb"),
        (["nowhere"], "nowhere: holds no run.json of refweb"),
        (["broken"], "broken/scene.toml: cannot be read"),
        (["strange"], "strange/run.json: is not what a run of refweb writes"),
        (["cost"], "cost: its run.json holds no results"),
        (["other"], "no two folders have a result in common: a has d; other has e"),
        (["failed"], "no two folders have a result in common: a has d; the run in failed is failed and has none"),
    ]:
        assert main(["compare", "a", *second]) == 2
        out, err = capsys.readouterr()
        assert out == "" and message in err and err.count("\n") == 1


def test_runs_of_the_catenary(tmp_path):
    """Coarser elements move the sag by more than its ±, which is that of solving; the same scene agrees with itself."""
    for name, elements in [("a", 10), ("b", 10), ("c", 12)]:
        refweb.run(refweb.Scene.load("catenary", {"web.elements": elements}), out=tmp_path / name)
    assert compare([tmp_path / "a", tmp_path / "b"])["agree"] and not compare([tmp_path / "a", tmp_path / "c"])["agree"]
    assert [row["path"] for row in compare([tmp_path / "a", tmp_path / "c"])["scene"]] == ["web.elements"]


def test_units_that_differ_have_no_difference(tmp_path, capsys):
    one, other = (folder(tmp_path / unit, {"d": result(1.0, unit=unit)}) for unit in ("m", "N"))
    assert compare([one, other])["results"][0]["differences"] == [0.0, None]
    assert main(["compare", str(one), str(other)]) == 1
    row = next(line for line in capsys.readouterr().out.splitlines() if " d " in line)
    assert "differ" in row and row.split("N", 1)[1].split() == ["differ", "│"]
