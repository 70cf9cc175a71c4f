"""``refweb list`` and ``refweb new``: what is listed is there, and what is written passes the check."""

import re
import tomllib

import pytest

import refweb
from refweb.__main__ import main
from refweb.commands.new import START
from refweb.scene import SHIPPED_SCENES
from refweb.sizing.requirements import shipped as sizings
from refweb.sweeps.study import shipped as studies

SHIPPED = {path.stem: path.read_text(encoding="utf-8") for path in sorted(SHIPPED_SCENES.glob("*.toml"))}


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty folder to work in."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_list_has_a_line_for_each_shipped_scene_study_and_sizing(capsys):
    assert main(["list"]) == 0
    lines, empty, after = capsys.readouterr().out.splitlines(), len(SHIPPED), len(SHIPPED) + 2 + len(studies())
    assert lines[empty : empty + 2] == ["", "For refweb sweep:"] and lines[after : after + 2] == [
        "",
        "For refweb size:",
    ]
    files = studies() | sizings()
    texts = SHIPPED | {name: path.read_text(encoding="utf-8") for name, path in files.items()}
    listed = lines[:empty] + lines[empty + 2 : after] + lines[after + 2 :]
    for line, (name, text) in zip(listed, texts.items(), strict=True):
        title = tomllib.loads(text)["title"]
        assert line.split("  ")[0] == name and title in line and len(line) <= 140
        said = line.split(title)[1].strip()
        assert said == text.splitlines()[0].removeprefix("# ") and re.fullmatch(r"[A-Z].{20,100}[.?]", said)


def test_new_writes_a_scene_that_passes_the_check(here, capsys):
    assert main(["new", "my-net"]) == 0
    assert capsys.readouterr().out == "my-net.toml is written: refweb check my-net.toml, refweb run my-net.toml\n"
    assert (here / "my-net.toml").read_text(encoding="utf-8") == START.replace('"Start"', '"my-net"')
    assert main(["check", "my-net.toml"]) == 0 and "my-net" in capsys.readouterr().out
    assert [path.name for path in here.iterdir()] == ["my-net.toml"]


def test_what_is_commented_out_passes_the_check_as_well(here):
    """Each line of a new scene file that a user may uncomment is a scene that runs."""
    text = re.sub(r"(?m)^# (\[|\w+ = )", r"\1", START)
    assert len([line for line in text.splitlines() if line.startswith("# ")]) == 5
    (here / "all.toml").write_text(text, encoding="utf-8")
    scene = refweb.Scene.load("all.toml")
    assert scene.supports and scene.accuracy.digits == 2 and len(scene.effects) == 5 and scene.cable.prestrain > 0.0
    assert main(["check", "all.toml"]) == 0


@pytest.mark.parametrize("name", ["catenary", "spinning-web"])
def test_a_copy_has_another_title_and_nothing_else(here, name):
    assert main(["new", "copy.toml", "--from", name]) == 0
    text = (here / "copy.toml").read_text(encoding="utf-8")
    title = tomllib.loads(SHIPPED[name])["title"]
    assert text == SHIPPED[name].replace(f'title = "{title}"', 'title = "copy"') != SHIPPED[name]


def test_a_copy_of_a_file_finds_its_mesh(here, capsys):
    """Relative paths lead to the same file from another folder; comments on the same line stay."""
    given = """title = 'a "title"' # mine
[web]
kind = "file" # path = "here.vtu"
path = "net.vtu"
[cable]
modulus = 1.0
area = 1.0
density = 1.0
[solve]
kind = "static"
"""
    (here / "meshes").mkdir()
    (here / "meshes" / "net.toml").write_text(given, encoding="utf-8")
    assert main(["new", "сеть", "--from", "meshes/net.toml"]) == 0
    text = (here / "сеть.toml").read_text(encoding="utf-8")
    changed = given.replace("""'a "title"'""", '"сеть"').replace('\npath = "net', '\npath = "meshes/net')
    assert text == changed
    assert main(["new", "meshes/other", "--from", "meshes/net.toml"]) == 0
    assert (here / "meshes" / "other.toml").read_text(encoding="utf-8") == given.replace("""'a "title"'""", '"other"')
    (here / "meshes" / "net.toml").write_text(
        "web.path = 'net.vtu'\nweb.kind = 'file'\n" + given[given.index("[cab") :]
    )
    capsys.readouterr()
    assert main(["new", "third", "--from", "meshes/net.toml"]) == 2
    assert "third.toml: web.path of net.toml cannot be changed in place" in capsys.readouterr().err
    assert not (here / "third.toml").exists()


@pytest.mark.parametrize("name", ["capture-satellite", "spin-deployment", "falling-net", "catenary"])
def test_files_of_a_shipped_scene_come_along(here, capsys, name):
    """All files that it names, byte for byte, and its text with another title alone: the copy passes the check."""
    named = set(re.findall(r'"([\w-]+\.(?:obj|csv))"', SHIPPED[name]))
    assert main(["new", "mine", "--from", name]) == 0
    assert {path.name for path in here.iterdir()} == {"mine.toml", *named}
    assert all((here / file).read_bytes() == (SHIPPED_SCENES / file).read_bytes() for file in named)
    title = tomllib.loads(SHIPPED[name])["title"]
    assert (here / "mine.toml").read_text(encoding="utf-8") == SHIPPED[name].replace(f'"{title}"', '"mine"')
    assert all(file in capsys.readouterr().out for file in sorted(named)[:1])
    refweb.Scene.load("mine.toml").build()


def test_files_that_come_along_replace_no_others(here, capsys):
    (here / "satellite.obj").write_text("mine")
    assert main(["new", "mine", "--from", "capture-satellite"]) == 2
    assert "satellite.obj: already exists, and is another file" in capsys.readouterr().err
    assert [path.name for path in here.iterdir()] == ["satellite.obj"] and (
        here / "satellite.obj"
    ).read_text() == "mine"
    assert main(["new", "mine", "--from", "capture-satellite", "--force"]) == 0
    assert main(["new", "again", "--from", "capture-satellite"]) == 0  # the same file is there


def test_a_copy_of_a_scene_with_bodies_from_files_leads_to_them(here):
    """Of two bodies with files of their own each path leads where it led."""
    (here / "there").mkdir()
    body = '[[body]]\nname = "{0}"\nshape = "mesh"\nfile = "{0}.obj"\nposition = [0, 0, {1}]\nfixed = true\n'
    text = START.partition("[[body]]")[0] + body.format("near", 1) + body.format("far", 2)
    text += "[contact]\nstiffness = 1e4\n[solve]\nkind = 'static'\n"
    (here / "there" / "two.toml").write_text(text, encoding="utf-8")
    assert main(["new", "copy", "--from", "there/two.toml"]) == 0
    bodies = tomllib.loads((here / "copy.toml").read_text(encoding="utf-8"))["body"]
    assert [body["file"] for body in bodies] == ["there/near.obj", "there/far.obj"]


# Studies


@pytest.mark.ordinary("price-of-safety", "safest-mesh")
@pytest.mark.parametrize("name", sorted(studies()))
def test_info_check_and_new_know_studies(here, capsys, name):
    """Number of cases, by the lists and counts of the file; a copy is a study of the same cases."""
    given = tomllib.loads(studies()[name].read_text(encoding="utf-8"))
    for arguments in (["info", name], ["check", name]):
        assert main(arguments) == 0
        out = capsys.readouterr().out
        assert given["title"] in out and f"refweb sweep {name} runs it" in out
        assert all(path in " ".join(out.split()) for path in given["parameters"])
    assert main(["info", name, "--json"]) == 0
    assert '"parameters"' in capsys.readouterr().out
    assert main(["new", "odds", "--from", name]) == 0
    assert "refweb check odds.toml, refweb sweep odds.toml" in capsys.readouterr().out
    assert tomllib.loads((here / "odds.toml").read_text(encoding="utf-8")) == {**given, "title": "odds"}
    assert main(["check", "odds.toml"]) == 0


def test_a_study_is_not_run_as_a_scene(here, capsys):
    assert main(["run", "odds-of-capture"]) == 2
    assert "odds-of-capture: is a study, many runs of one scene" in capsys.readouterr().err
    (here / "mine.toml").write_text('scene = "square-impact"\n[parameters]\n"solve.safety" = [0.5, 0.4]\n')
    assert main(["modes", "mine.toml"]) == 2
    assert "mine.toml: is a study" in (said := capsys.readouterr().err) and "refweb sweep mine.toml runs it" in said
    assert main(["check", "odds-of-capture", "--set", "solve.duration=1"]) == 2
    assert "--set has no meaning for odds-of-capture" in capsys.readouterr().err
    assert main(["info", "odds-of-captur"]) == 2 and "no such file" in capsys.readouterr().err


def test_new_does_not_overwrite(here, capsys):
    (here / "net.toml").write_text("mine")
    (here / "folder.toml").mkdir()
    (here / "wrong.toml").write_text("[web]\nkind = 'paper'\n")
    for arguments, message in [
        (["net"], "net.toml: already exists: choose another name, or use --force to replace it"),
        (["folder", "--force"], "folder.toml: already exists: choose another name\n"),
        (["no/net"], "no/net.toml: there is no folder no"),
        (["other", "--from", "catenari"], 'catenari: no such file and no shipped scene, did you mean "catenary"?'),
        (["other", "--from", "wrong.toml"], "wrong.toml: [cable] is missing"),
        (["x" * 201], "title = "),
    ]:
        assert main(["new", *arguments]) == 2
        out, err = capsys.readouterr()
        assert out == "" and message in err and err.count("\n") == 1
    assert sorted(path.name for path in here.iterdir()) == ["folder.toml", "net.toml", "wrong.toml"]
    assert (here / "net.toml").read_text() == "mine"
    assert main(["new", "net", "--force"]) == 0 and (here / "net.toml").read_text(encoding="utf-8") != "mine"
