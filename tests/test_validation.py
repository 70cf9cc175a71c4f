"""Every validation case passes at its quick setting, draws its figures, and stands in a report that is complete."""

import re

import pytest

from validation.__main__ import main
from validation.harness import case as cases
from validation.harness import page, plots
from validation.harness.case import Case, Figure, Row, Table, Verdict

LONG = (
    "webs_hit",
    "webs_under_load",
    "hard_cases",
    "work_precision",
    "example_2",
    "example_3",
    "cross_validation",
    "open_parameters",
    "capture_satellite",
    "capture",
    "capture_in_orbit",
    "published_throw",
    "falling_net",
    "odds_of_capture",
    "spin_deployment",
    "spun_tight",
    "tethered_web",
    "coverage",
    "trust",
    "rupture",
    "frequencies",
    "drag_and_link",
    "cable_law",
    "conic_programming",
    "hanging_chain",
    "winches",
    "materials",
    "threads",
    "feedback",
    "drawstrings",
    "free_net",
    "price_of_modelling",
    "falling_chain",
    "figures_with_a_limit",
    "spinning_arm",
    "spin_up",
    "tumbling",
    "elastic_catenary",
    "three_cables",
    "two_links",
)
"""Cases that take more than a second with ``--quick``; what they show has tests of its own beside them."""


@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] * (n in LONG)) for n in cases.names()])
def test_case(name):
    """Numbers of publications, closed forms and other programs beside those of whole runs: no other test has them."""
    title, body = cases.text(name)
    assert title and body, f"{name} does not say what it is"
    case = cases.run(name, quick=True)
    assert case.failures == []
    for figure in case.figures:
        assert figure.caption and plots.image(figure.draw()).png.startswith(b"\x89PNG")


def sample():
    def curve():
        page, plot = plots.axes("x [m]", "y [m]")
        plot.plot([0, 1], [0, 1])
        return page

    return Case(
        rows=[
            Row("within", 1.0 + 1e-10, 1.0, "closed form", 1e-9, "rounding", "m", 1e-10),
            Row("printed", -18.4603, "-18.460", "a paper", unit="ft"),
        ],
        verdicts=[Verdict("a < b & c", "holds", "by 3 %", True)],
        figures=[Figure("A line.", curve)],
        tables=[Table("Parameters", ["name", "value"], [["η", "1e-5"]])],
    )


def row(value, reference, **options):
    return Row("a", value, reference, "b", reason="c", **options)


def test_rows():
    """Agreement to the last printed digit, tolerances relative and absolute, ± that covers; no number never agrees."""
    assert row(-18.4604, "-18.460").passes and not row(-18.4606, "-18.460").passes
    assert row(-0.8595, "-0.859").passes and row(12.4, "12").passes and not row(12.6, "12").passes
    assert row(2.001, 2.0, tolerance=1e-3).passes and not row(2.003, 2.0, tolerance=1e-3).passes
    assert row(1e-3, 0.0, tolerance=0.1, scale=0.02).passes and not row(3e-3, 0.0, tolerance=0.1, scale=0.02).passes
    assert not row(float("nan"), 1.0, tolerance=1.0).passes
    assert row(1.1, 1.0, tolerance=1.0, error=0.2, covered=True).passes
    assert not row(1.1, 1.0, tolerance=1.0, error=0.05, covered=True).passes
    for wrong in (dict(reference=0.0, tolerance=1.0), dict(reference=1.0)):
        with pytest.raises(ValueError, match="a: "):
            row(1.0, **wrong)


def test_failures():
    assert Case().failures == ["the case asserts nothing"]
    assert Case(rows=[row(2.0, 1.0, tolerance=0.5)]).failures[0].startswith("a: 2 for 1.0 1, difference 1.00e+00")
    assert Case(verdicts=[Verdict("x", "holds", "y", False)]).failures == ["x: no longer holds"]
    with pytest.raises(ValueError, match="empty"):
        Table("t", ["a", "b"], [["1", ""]])


def test_report(tmp_path, monkeypatch, capsys):
    """No cell is empty, the page loads nothing, Markdown's pictures are there, and the status tells of a failure."""
    monkeypatch.setattr(cases, "CASES", {"Part": ("one", "two")})
    monkeypatch.setattr(page, "CASES", cases.CASES)
    described = "Words, doi:10.1000/182.\n\n    F = m a\n\n- item"
    monkeypatch.setattr(page, "text", lambda name: (f"Title {name}", described))
    monkeypatch.setattr("validation.__main__.run", lambda name, quick: sample() if name == "one" else 1 / 0)
    assert main(["--quick", "--out", str(tmp_path)]) == 1
    assert "ZeroDivisionError" in capsys.readouterr().out
    shown, words = ((tmp_path / name).read_text(encoding="utf-8") for name in ("index.html", "report.md"))
    cells = re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", shown, re.DOTALL)
    assert len(cells) > 20 and all(re.sub(r"<.*?>", "", cell).strip() for cell in cells)
    assert not re.search(r"<(script|link|iframe)|@import|url\(", shown)
    assert all(source.startswith("data:image/png;base64,") for source in re.findall(r'src="(.*?)"', shown))
    assert (
        'href="https://doi.org/10.1000/182"' in shown and "a &lt; b &amp; c" in shown and "<pre>F = m a</pre>" in shown
    )
    (picture,) = re.findall(r"!\[.*?\]\((.*?)\)", words)
    assert (tmp_path / picture).read_bytes().startswith(b"\x89PNG")
    assert "fails: ZeroDivisionError" in shown and "fails: ZeroDivisionError" in words
    assert "1 of 2 cases fail: [Title two](#two)" in words and shown.count('class="badge no"') == 1
    targets = set(re.findall(r'id="(.*?)"', shown))
    links = set(re.findall(r'href="#(.*?)"', shown))
    assert links == {"contents", "part", "one", "two"} <= targets
    assert main(["one", "--quick", "--out", str(tmp_path)]) == 0
    assert '<p class="result yes">The case agrees</p>' in (tmp_path / "index.html").read_text(encoding="utf-8")


def test_letters_of_figures_can_be_read():
    """9 pixels high, 72 points an inch: letters of 6 pt on a figure of 8 inches ask for 8 · 72 · 9/6 pixels."""
    page, plot = plots.axes("x", "y")
    page.set_size_inches(8, 3)
    plot.set_title("small", fontsize=6)
    image = plots.image(page)
    assert image.png.startswith(b"\x89PNG") and image.width == 864
