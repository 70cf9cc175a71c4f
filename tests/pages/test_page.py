"""Pages of runs: whole HTML that needs nothing from outside, runs nothing but its own script, and says what is there.

What a browser makes of one is in `test_browser.py`.
"""

import base64
import dataclasses
import hashlib
import html.parser
import json
import os
import pathlib
import re
import shutil
import subprocess
import tomllib

import nets
import numpy as np
import pytest
from unpacked import positions, summed, unpack, values

import refweb
from refweb.__main__ import main
from refweb.errors import InputError
from refweb.pages import drawings, page, sections, space
from refweb.pages.markup import data, table, tag
from refweb.pages.markup import html as as_html
from refweb.pages.packed import PLACES, VALUES, differences, levels, pack
from refweb.pictures.record import of_folder
from refweb.registry import EFFECTS

ALWAYS = {"sheet", "results", "warnings", "space", "simulated", "plots", "pictures", "cost", "scene", "versions"}
VOID = {"meta", "img", "input", "br", "link"}
HOSTILE = "</script><script>alert(1)</script> \"'&\u2028<!--"


class Reader(html.parser.HTMLParser):
    """Tags that close in their order, ids, addresses, alternative texts, and what stands in each script."""

    def __init__(self, text):
        super().__init__()
        self.open, self.ids, self.addresses, self.images, self.scripts = [], [], [], [], {}
        self.labelled, self.controls, self.policy, self.words = 0, 0, "", []
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, tag, attrs):
        attrs = dict(attrs)
        assert not any(name.startswith("on") for name in attrs)
        self.addresses += [attrs[name] for name in ("src", "href", "action", "data", "srcset") if name in attrs]
        self.ids += [attrs["id"]] if "id" in attrs else []
        if tag == "img":
            self.images.append(attrs["alt"])
        if tag in ("input", "select"):
            self.controls += 1
            self.labelled += "label" in self.open
        if attrs.get("http-equiv") == "Content-Security-Policy":
            self.policy = attrs["content"]
        if tag not in VOID:
            self.open.append(tag)
        if tag == "script":
            self.script = attrs.get("id", "")
            assert self.script not in self.scripts
            self.scripts[self.script] = ""

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] == "script":
            self.scripts[self.script] += data
        else:
            self.words.append(data)


@pytest.fixture(scope="module")
def hit(tmp_path_factory):
    """The folder of a small web that a ball hits: eleven frames, some slack."""
    folder = tmp_path_factory.mktemp("pages") / "hit"
    refweb.run(nets.hit_web("Small web hit by a ball"), out=folder)
    return folder


@pytest.fixture(scope="module")
def drawn(hit):
    """Its page, with the pictures as they come."""
    out = page.report(hit)
    assert out == hit / "report.html"
    return out.read_text(encoding="utf-8")


@pytest.fixture
def quick(monkeypatch):
    """Pages without pictures and plots, which take their time."""
    monkeypatch.setattr(drawings, "pictures", lambda record: "")
    monkeypatch.setattr(drawings, "plots", lambda record: "")


def test_all_parts_are_there(drawn):
    found = Reader(drawn)
    assert ALWAYS <= set(found.ids) and len(found.ids) == len(set(found.ids))
    assert found.controls == found.labelled >= 5
    assert len(found.images) >= 5 and all(found.images)
    assert {address for address in found.addresses if address.startswith("#")} == {f"#{name}" for name in ALWAYS}


def test_nothing_comes_from_outside(drawn):
    found = Reader(drawn)
    assert all(address.startswith(("#", "data:image/")) for address in found.addresses)
    style = re.search("<style>(.*?)</style>", drawn, re.DOTALL)[1]
    assert "url(" not in style and "@import" not in style
    script = found.scripts[""]
    assert not re.search(r"https?:|fetch\(|XMLHttpRequest|WebSocket|import\(|eval\(", script)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    rules = dict(rule.split(" ", 1) for rule in found.policy.split("; "))
    assert rules["default-src"] == "'none'" and rules["script-src"] == f"'sha256-{digest}'"
    assert rules["img-src"] == "data:" and "connect-src" not in rules
    for coded in re.findall(r"data:image/svg\+xml;base64,([^\"]*)", drawn):
        drawing = base64.b64decode(coded).decode()
        assert not re.search(r"(href|src)=\"(?!#|data:)|url\((?!#)|<script", drawing)


@pytest.mark.parametrize("name", page.SCRIPTS)
def test_scripts_are_valid(name):
    node = shutil.which("node")
    if node is None:
        pytest.skip("there is no node, which checks scripts")
    script = pathlib.Path(page.__file__).with_name(name)
    done = subprocess.run([node, "--check", str(script)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_effects_that_are_there_and_that_are_not(hit):
    words = Reader(sections.simulated(of_folder(hit))).words
    assert words[words.index("present: ") + 1] == "body, contact"
    (absent,) = (text.removeprefix("absent: ").split(", ") for text in words if text.startswith("absent: "))
    assert set(absent) == set(EFFECTS) - {"body", "contact"}


def test_results_are_those_of_the_run(hit):
    summary = json.loads((hit / "run.json").read_text())
    words = Reader(sections.results(of_folder(hit))).words
    assert summary["results"].keys() <= set(words)
    assert f"{summary['results']['deflection']['value'] * 1e3:.6g} mm" in words
    assert "a value without ± has no known error" in words


def test_the_scene_stands_there_as_it_is(hit):
    text = "".join(Reader(sections.scene(of_folder(hit))).words).partition("filled in")[2]
    assert tomllib.loads(text) == tomllib.loads((hit / "scene.toml").read_text())


@pytest.mark.parametrize("shape", [(4, 1), (3, 50, 3)])
def test_packed_arrays_come_back(shape):
    rng = np.random.default_rng(1)
    frames = rng.integers(0, 65536, shape)
    arrays = {"a": rng.random(shape).astype(np.float32), "b": np.arange(5, dtype=np.uint8), "c": differences(frames)}
    text, table = pack(arrays)
    assert all(entry["start"] % 4 == 0 for entry in table.values()), "browsers read numbers of four bytes there alone"
    found = unpack(text, json.loads(json.dumps(table)))
    for name, array in arrays.items():
        np.testing.assert_array_equal(found[name], array.ravel())
    np.testing.assert_array_equal(summed(found["c"], shape), frames)


@pytest.mark.parametrize("steps", [PLACES, VALUES])
@pytest.mark.parametrize("values", [[0.0, 1.0, 0.3], [-1e300, 1e300, 7.0], [5.0, 5.0], [np.nan, 2.0, 1.0], [np.nan]])
def test_levels_are_within_half_a_step(values, steps):
    values = np.array(values)
    found, low, high = levels(values, steps)
    finite = np.isfinite(values)
    assert (found[~finite] == steps + 1).all() and (found[finite] <= steps).all() and (found >= 0).all()
    back = low + 2 * (high / 2 - low / 2) * (found[finite] / steps)
    half = (high / 2 - low / 2) / steps
    assert (np.abs(back / 2 - values[finite] / 2) <= half / 2 * (1 + 1e-9)).all()


def test_places_and_values_are_within_the_errors_it_states(hit):
    record = of_folder(hit)
    found = space.space_of(record)
    arrays = unpack(found.text, found.head["arrays"])
    assert found.error < 1e-4 * found.extent and found.numbers == list(record.times) and not found.missing
    segments = arrays["segments"].reshape(-1, 2)
    for i, number in enumerate(found.numbers):
        frame, points = record.frame(number), positions(arrays, found.head, i)
        assert np.linalg.norm(points[segments] - frame.paths, axis=-1).max() <= found.error * (1 + 1e-6)
        for field in found.head["fields"]:
            low, high = field["ranges"][i]
            off = np.abs(values(arrays, field, i) - frame.fields[field["name"]]).max()
            assert off <= (high - low) / (2 * VALUES) * (1 + 1e-6) < 0.0021 * (high - low) or high == low
        held = points[arrays["supports"]]
        assert np.abs(held[np.lexsort(held.T)] - frame.supports[np.lexsort(frame.supports.T)]).max() <= found.error
    assert len(points) == len(np.unique(frame.origin.reshape(-1, 3), axis=0)), "a node is one point, however many lines"


def test_a_body_is_where_it_was(hit):
    record = of_folder(hit)
    found = space.space_of(record)
    arrays = unpack(found.text, found.head["arrays"])
    (body,) = found.head["bodies"]
    surface = arrays["points of body 0"].reshape(-1, 3)
    for i, number in enumerate(found.numbers):
        turn = np.reshape(body["turns"][i], (3, 3))
        there = surface @ turn.T + body["places"][i]
        assert np.abs(there - record.frame(number).bodies["ball"].points).max() < 1e-6 * 0.1


def test_a_rotation_is_found():
    rng = np.random.default_rng(2)
    before = rng.normal(size=(20, 3))
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    np.testing.assert_allclose(space.rotation_between(before, before @ turn.T), turn, atol=1e-12)
    flat = before * [1, 1, 0]
    found = space.rotation_between(flat, flat @ turn.T)
    assert np.linalg.det(found) == pytest.approx(1.0) and found == pytest.approx(turn)


@pytest.mark.parametrize(
    "count, peak, expected",
    [
        (20, 3, list(range(11))),
        (3, 3, [0, 3, 10]),
        (5, 5, [0, 2, 5, 8, 10]),
        (4, 9, [0, 3, 9, 10]),
        (2, 4, [0, 4]),
        (1, 4, [4]),
        (1, None, [0]),
        (3, None, [0, 5, 10]),
    ],
)
def test_frames_that_are_kept(count, peak, expected):
    assert space.chosen_of(list(range(11)), count, peak) == expected


def test_frames_that_are_left_out_are_told(hit, quick, tmp_path):
    found = Reader(page.report(hit, out=tmp_path / "few.html", frames=3).read_text())
    assert len(json.loads(found.scripts["head"])["numbers"]) == 3
    left = len(of_folder(hit).times) - 3
    assert any(f"{left} are left out" in words for words in found.words)


def test_a_page_that_would_be_heavy_has_fewer_frames(hit, monkeypatch):
    record = of_folder(hit)
    whole = space.space_of(record)
    monkeypatch.setattr(space, "LARGEST", 0.7 * len(whole.text))
    part = space.space_of(record, peak=15)
    assert len(part.text) <= 0.7 * len(whole.text) and 3 <= len(part.numbers) < len(whole.numbers)
    assert {0, 15, 50} <= set(part.numbers)


def test_what_users_write_is_text(hit, quick):
    record = of_folder(hit)
    results = {HOSTILE: {**record.summary["results"]["deflection"], "unit": HOSTILE}}
    more = {"scene": HOSTILE, "warnings": [HOSTILE], "message": HOSTILE, "status": HOSTILE, "results": results}
    frame = record.frame

    def named(number):
        found = frame(number)
        return found._replace(bodies={HOSTILE: found.bodies["ball"]}, fields={HOSTILE: found.fields["stress"]})

    scene = record.scene | {"title": HOSTILE, "observe": [{"name": HOSTILE}], "body": [{"name": HOSTILE}]}
    text = page.page_of(record._replace(summary=record.summary | more, scene=scene, frame=named))
    found = Reader(text)
    assert set(found.scripts) == {"", "head", "data"} and "alert" not in found.scripts[""]
    head = json.loads(found.scripts["head"])
    assert head["bodies"][0]["name"] == HOSTILE and head["fields"][0]["name"] == HOSTILE
    assert sum(words.count("<script>alert(1)</script>") for words in found.words) >= 6


def test_markup_escapes_once():
    assert tag("b", "a < b", title='"') == '<b title="&quot;">a &lt; b</b>'
    assert as_html([tag("i", "x"), "&"]) == "<i>x</i>&amp;"
    assert json.loads(Reader(data("head", {"a": HOSTILE})).scripts["head"]) == {"a": HOSTILE}


def killed(folder):
    summary = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps(summary | {"status": "running", "results": {}}))


def failed(folder):
    summary = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps(summary | {"status": "failed", "message": "line 7 broke"}))


def spoilt(folder):
    (folder / "frames/web_000020.vtu").write_text("<VTKFile>")


def without_frames(folder):
    shutil.rmtree(folder / "frames")
    (folder / "web.pvd").unlink()


def half_a_summary(folder):
    text = (folder / "run.json").read_text()
    (folder / "run.json").write_text(text[: len(text) // 2])


def a_list(folder):
    (folder / "run.json").write_text("[1,2]")


def without_rows(folder):
    (folder / "history.csv").write_text((folder / "history.csv").read_text().partition("\n")[0] + "\n")


def without_history(folder):
    (folder / "history.csv").unlink()


def bare(folder):
    for name in ("run.json", "scene.toml", "checkpoint.npz", "history.csv"):
        (folder / name).unlink()


@pytest.mark.parametrize(
    "harm, words",
    [
        (killed, "its process is dead"),
        (failed, "line 7 broke"),
        (spoilt, "Not to be read: 20."),
        (without_frames, "No frame of this run can be drawn."),
        (bare, "there is no run.json"),
        (half_a_summary, "run.json cannot be read: "),
        (a_list, "run.json cannot be read: it is not what a run of refweb writes"),
        (without_rows, "The history has no rows."),
        (without_history, "The history cannot be read."),
    ],
)
def test_folders_of_runs_that_are_not_whole(hit, quick, tmp_path, harm, words):
    folder = tmp_path / "out"
    shutil.copytree(hit, folder)
    harm(folder)
    assert words in " ".join(Reader(page.report(folder).read_text()).words)


def parts_of(path):
    """Words of the line on how the run ended, and of the warnings."""
    text = path.read_text()
    status = re.search(r'<span class="status.*?(?=</p>)', text)[0]
    return [" ".join(Reader(part).words) for part in (status, re.search('<section id="warnings">.*', text)[0])]


@pytest.mark.parametrize("harm", [half_a_summary, a_list, bare, without_rows, without_history, without_frames])
def test_what_a_folder_lacks_is_no_absence_of_warnings(hit, quick, tmp_path, harm):
    shutil.copytree(hit, tmp_path / "out")
    summary = json.loads((hit / "run.json").read_text()) | {"warnings": []}
    (tmp_path / "out/run.json").write_text(json.dumps(summary))
    _, whole = parts_of(page.report(tmp_path / "out"))
    assert "None." in whole, "nothing is missing, and the run has no warning"
    harm(tmp_path / "out")
    assert "None." not in parts_of(page.report(tmp_path / "out"))[1]


@pytest.mark.parametrize("harm, known", [(half_a_summary, "dynamics"), (a_list, "dynamics"), (bare, "")])
def test_what_is_not_known_is_left_out(hit, quick, tmp_path, harm, known):
    shutil.copytree(hit, tmp_path / "out")
    harm(tmp_path / "out")
    status, _ = parts_of(page.report(tmp_path / "out"))
    assert "run.json" in status and "unknown" not in status and "solved" not in status
    assert re.findall("dynamics|statics|modes", status) == ([known] if known else [])


def test_what_is_not_a_run_has_no_page(tmp_path, capsys):
    """A folder of measured costs, whose diagram stands there already."""
    (tmp_path / "run.json").write_text(json.dumps({"kind": "cost", "versions": {"refweb": "1"}}))
    assert main(["report", str(tmp_path)]) == 2
    assert "cost.png" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["run.json"]


def test_every_cell_has_the_name_of_its_column():
    text = table(["result", "value", "place"], [["a", "1 mm", "node 8"], ["b", "2 mm", ""]], ["", "", "at line 3"])
    cells = re.findall('<t[hd][^>]* data-label="([^"]*)"[^>]*>(?:<span>(.*?)</span>)?</t[hd]>', text)
    assert cells == [
        ("result", "a"),
        ("value", "1 mm"),
        ("place", "node 8"),
        ("result", "b"),
        ("value", "2 mm"),
        ("place", ""),
        ("result", ""),
        ("value", ""),
        ("place", "at line 3"),
    ]


def test_a_solution_goes_where_its_folder_is(hit, quick, tmp_path):
    folder = tmp_path / "out"
    shutil.copytree(hit, folder, ignore=shutil.ignore_patterns("report.html"))
    solution = refweb.load(folder)
    assert solution.report() == folder / "report.html" and (folder / "report.html").exists()
    with pytest.raises(InputError, match="out is missing"):
        dataclasses.replace(solution, path=None).report()


def test_statics_modes_and_a_single_frame(quick, tmp_path):
    scene = refweb.Scene(
        title="Cable",
        web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0], [2, 0, 0]], lines=[[0, 1], [1, 2]], supports=[0, 2]),
        cable=refweb.Cable(law="linear", modulus=1e6, area=1e-4, density=1e3, prestrain=1e-2, order=2),
        effects=[refweb.Gravity(acceleration=(0.0, 0.0, -9.81))],
        solve=refweb.Static(load_steps=[0.5, 1.0]),
    )
    solution = refweb.run(scene)
    found = Reader(solution.report(tmp_path / "memory.html").read_text())
    head = json.loads(found.scripts["head"])
    assert head["kind"] == "static" and head["labels"][-1] == "step 1"
    modes = refweb.modes(scene, out=tmp_path / "modes", number=2)
    found = Reader(page.report(tmp_path / "modes").read_text())
    head = json.loads(found.scripts["head"])
    assert head["kind"] == "modes" and head["labels"][0].startswith("mode 1, ") and head["labels"][0].endswith("Hz")
    assert f"{modes.frequency[0]:.3g}"[:3] in head["labels"][0]


@pytest.mark.parametrize(
    "options, words",
    [
        ({"frames": 0}, "frames = 0 must be ≥ 1"),
        ({"out": "x.txt"}, "must end in .html"),
        ({"out": "no/x.html"}, "no folder"),
    ],
)
def test_refusals(hit, tmp_path, monkeypatch, options, words):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=words):
        page.report(hit, **options)


def test_what_is_no_result_folder_is_refused(tmp_path):
    with pytest.raises(InputError, match="not a result folder"):
        page.report(tmp_path)


def test_the_verbs(hit, quick, tmp_path, monkeypatch, capsys):
    """`report` writes where it is told; `view` writes where there is no page, or an older one, and opens it."""
    opened = []
    monkeypatch.setattr("webbrowser.open", lambda address: opened.append(address) or True)
    folder = tmp_path / 'a "run" of mine'
    shutil.copytree(hit, folder)
    (folder / "report.html").unlink(missing_ok=True)
    assert main(["report", str(folder), "--out", str(tmp_path / "x.html"), "--frames", "2"]) == 0
    assert (tmp_path / "x.html").exists() and not (folder / "report.html").exists()
    assert main(["view", str(folder)]) == 0
    written = (folder / "report.html").stat().st_mtime_ns
    assert main(["view", str(folder)]) == 0 and (folder / "report.html").stat().st_mtime_ns == written
    os.utime(folder / "report.html", (1, 1))
    assert main(["view", str(folder)]) == 0 and (folder / "report.html").stat().st_mtime > 1
    assert opened == [(folder / "report.html").as_uri()] * 3
    monkeypatch.setattr("webbrowser.open", lambda address: False)
    capsys.readouterr()
    assert main(["view", str(folder)]) == 0
    said = capsys.readouterr()
    assert said.out.strip() == str(folder / "report.html") and "no browser" in said.err


def test_force_removes_the_page(hit, tmp_path):
    from refweb.results.folder import clear

    folder = tmp_path / "out"
    shutil.copytree(hit, folder)
    (folder / "report.html").write_text("a page")
    (folder / "notes.html").write_text("mine")
    clear(folder)
    assert not (folder / "report.html").exists() and (folder / "notes.html").exists()


def test_the_package_brings_what_pages_are_made_of():
    """What a wheel holds is what ``pyproject.toml`` lists."""
    folder = pathlib.Path(page.__file__).parent
    listed = tomllib.loads((folder.parents[1] / "pyproject.toml").read_text())
    patterns = listed["tool"]["setuptools"]["package-data"]["refweb.pages"]
    there = {path.name for path in folder.iterdir() if path.suffix in (".js", ".css", ".html")}
    assert there == {path.name for pattern in patterns for path in folder.glob(pattern)}
    assert there == {*page.SCRIPTS, "page.css", "page.html"}


@pytest.mark.slow
def test_the_page_of_a_shipped_impact_is_light(tmp_path):
    """All frames of 5 165 lines, with pictures and plots, in less than 4 MB."""
    refweb.run("hexagon-impact", out=tmp_path / "hexagon")
    out = page.report(tmp_path / "hexagon")
    found = Reader(out.read_text())
    assert out.stat().st_size < 4e6 and len(json.loads(found.scripts["head"])["numbers"]) == 26
