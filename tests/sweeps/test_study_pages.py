"""Plots and the page of a study, the studies that are shipped, and what is said of a study that is not at its end."""

import html.parser
import json

import numpy as np
import pytest
from sweeps.test_sweep import FORCE, Here, arms

import refweb
from refweb.__main__ import main
from refweb.commands import console
from refweb.pictures.studies import draw, of_folder
from refweb.results.study_text import Rows
from refweb.scene import Scene
from refweb.sweeps.design import Base, cases_of
from refweb.sweeps.study import load, shipped

AT_RANDOM = {
    FORCE: {"from": 0.5, "to": 4.0},
    "cable.law": ["tension-only", "smooth"],
    "cable.density": [100.0],
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A study of 16 cases in two groups; its title is none that HTML takes as it is."""
    path = tmp_path_factory.mktemp("study") / "s"
    keys = {"sample": "sobol", "count": 8, "seed": 2, "conditions": {"stiff": "deflection < 0.25"}}
    refweb.sweep(arms(title="Arms <b> & more"), AT_RANDOM, path, Here(), **keys)
    return path


class Tags(html.parser.HTMLParser):
    """Tags that are open, what has been seen of them, and the text between."""

    def __init__(self):
        super().__init__()
        self.open, self.seen, self.text = [], [], ""

    def handle_starttag(self, tag, attrs):
        self.seen.append((tag, dict(attrs)))
        if tag not in ("meta", "img", "link", "input"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


def test_the_page(folder, capsys):
    assert main(["report", str(folder)]) == 0
    assert capsys.readouterr().out == f"{folder / 'report.html'}\n"
    tags = Tags()
    tags.feed((folder / "report.html").read_text(encoding="utf-8"))
    assert not tags.open and "Arms <b> & more" in tags.text
    sections = [given.get("id") for tag, given in tags.seen if tag == "section"]
    assert sections == ["results", "warnings", "plots", "rows", "study", "versions"]
    assert sum(tag == "img" for tag, _ in tags.seen) == 3 and "16 solved" in tags.text
    assert 'law = "smooth"' in tags.text and "deflection < 0.25" in tags.text
    keys = [row["case"] for row in of_folder(folder).rows]
    assert len(set(keys)) == 16 and all(key in tags.text for key in keys)
    assert main(["report", str(folder), "--frames", "3"]) == 2
    assert "has no meaning for a study" in capsys.readouterr().err


def test_plots_show_every_case(folder):
    """Points stand where the rows say, group by group; shares rise to one."""
    study = of_folder(folder)
    figure = draw(study, study.results[0])
    over, shares = figure.axes
    points = [container.lines[0].get_xydata() for container in over.containers]
    assert len(points) == 2 and over.get_xlabel() == FORCE
    for (_, rows), found in zip(study.groups, points, strict=True):
        assert found[:, 0].tolist() == [row[FORCE] for row in rows]
        assert found[:, 1] == pytest.approx([1e3 * row["deflection [m]"] for row in rows])  # mm
    steps = shares.lines[0].get_ydata()
    assert steps[-1] == 1.0 and (np.diff(steps) > 0.0).all() and len(steps) == 8
    assert [line.get_xdata()[0] for line in shares.lines[2:]] == [pytest.approx(250.0)]


def test_other_folders_are_refused(folder, tmp_path, capsys):
    with pytest.raises(refweb.InputError, match="holds no study"):
        of_folder(tmp_path)
    assert main(["plot", str(folder)]) == 2
    assert "holds sweep, not a run: its plots are there already" in capsys.readouterr().err


def test_a_killed_study_says_so(folder, capsys):
    summary = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps({**summary, "status": "running"}))
    assert main(["info", str(folder), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    (folder / "run.json").write_text(json.dumps(summary))
    assert told["status"] == "killed" and "it has written 16 rows" in told["message"]
    assert "refweb sweep with the same study" in told["message"]


BRIEF = [name for name in shipped() if name not in ("odds-of-capture", "attitudes-of-envisat")]
"""Shipped studies of seconds; those of captures take minutes, and cases of the validation run such ones."""


@pytest.mark.parametrize("name", shipped())
def test_shipped_studies_are_studies(name):
    """Every case is a scene of its own, and there are few of them, or they are samples."""
    study = load(name)
    scene = Scene.load(study.scene)
    found = cases_of(study, Base({**scene.to_dict(), "observe": scene.to_dict()["observe"]}, scene.folder, scene.file))
    assert 3 <= len({case.key for case in found}) == len(found) <= (24 if name in BRIEF else study.count or 24)
    longest = 0.05 if name in BRIEF else scene.solve.duration
    assert all(refweb.Scene.from_dict(case.given).solve.duration <= longest for case in found)


@pytest.mark.slow
@pytest.mark.parametrize("name", BRIEF)
def test_shipped_studies_run(name, tmp_path):
    found = refweb.sweep(name, out=tmp_path / "s")
    assert found.count == {"solved": len(found.cases)} and all((found.values("deflection ±".split()[0]) > 0.0).tolist())
    if name == "price-of-safety":
        errors = [row["deflection ±"] for row in found.rows]
        assert errors[-1] < 0.1 * errors[0], "of order 2: sixteen times the steps"


def test_a_wide_table_leaves_out_columns_and_no_digits(capsys):
    """Where the output is no terminal a box is 110 wide: quantiles are left out, and named; numbers are whole."""
    columns = ["result", "mean", "its ±", "by samples ±", "spread", "5 %", "50 %", "95 %", "± at most", "verdict"]
    cells = ["tension [N]", "-146.5", "1.3e+02", "9", "-25.41 ± 1.5e+02", "-118.71", "-138.31", "-184.32", "2.3e+02"]
    rows = Rows(columns, [[*cells, "8 undetermined, 2 statistical"]], [])
    console._box("T", [("results", console._columns(rows))])
    printed = capsys.readouterr().out
    assert "…" not in printed and "left out, see results.csv: 5 %, 50 %" in printed
    assert all(word in printed for word in ("-146.5", "1.5e+02", "2.3e+02", "undetermined"))
    console._box("T", [("results", console._columns(Rows(columns[:3], [cells[:3]], [])))])
    assert "left out" not in capsys.readouterr().out
