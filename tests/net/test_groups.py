"""Groups of lines: how many each generator names, in closed form, and what scenes say of them."""

import numpy as np
import pytest

import refweb
from refweb.__main__ import main
from refweb.errors import InputError
from refweb.net.web import Web

# What generators name


def outline(mesh, layers):
    """Sides of the outline of so many layers: of squares in a square, triangles in a triangle, hexagons around one."""
    return {"square": 4 * (2 * layers - 1), "triangle": 3 * (3 * layers - 2), "hexagon": 6 * (2 * layers - 1)}[mesh]


@pytest.mark.parametrize("layers", [1, 2, 3, 4])
@pytest.mark.parametrize("mesh", ["triangle", "square", "hexagon"])
def test_rings_of_layers(mesh, layers):
    web = refweb.Layers(mesh=mesh, layers=layers, cell_area=1.0).web()
    rings = [web.find_lines(f"ring-{k}") for k in range(1, layers + 1)]
    assert list(map(len, rings)) == [outline(mesh, k) for k in range(1, layers + 1)]
    # Each ring is one closed loop, and what is no ring is a spoke.
    for ring in rings:
        assert (np.bincount(web.lines[ring].ravel())[np.unique(web.lines[ring])] == 2).all()
        assert Web(web.points, web.lines[ring]).cells == 1
    spokes = np.setdiff1d(np.arange(len(web.lines)), np.concatenate(rings))
    assert len(spokes) == 0 or web.find_lines("spokes").tolist() == spokes.tolist()
    # A triangle whose corner is cut off has both ends of the cut on its outline.
    cut = 3 if mesh == "triangle" and layers > 1 else 0
    assert len(web.find_lines("rim")) == outline(mesh, layers) + cut
    assert np.isin(rings[-1], web.find_lines("rim")).all()


@pytest.mark.parametrize(("rows", "columns"), [(2, 3), (3, 5), (6, 4)])
def test_links_of_a_window_of_squares(rows, columns):
    """(rows − 1) lines in x of so many columns and the other way round, and a link at each end of each of them."""
    web = refweb.Window(mesh="square", rows=rows, columns=columns, side=0.3).web()
    assert len(web.find_lines("rows")) == (rows - 1) * columns
    assert len(web.find_lines("columns")) == (columns - 1) * rows
    assert len(web.find_lines("anchors")) == 2 * (rows - 1) + 2 * (columns - 1)
    x, y, _ = (web.points[web.lines[:, 1]] - web.points[web.lines[:, 0]]).T
    assert not y[web.find_lines("rows")].any() and not x[web.find_lines("columns")].any()
    assert sorted([*web.find_lines("anchors"), *web.find_lines("inner")]) == list(range(len(web.lines)))
    paper = refweb.Paper(mesh="square", cable_length=201.4).web()
    with pytest.raises(InputError, match="no line of this web joins two nodes of its rim"):
        paper.find_lines("rim")


@pytest.mark.parametrize("mesh", ["triangle", "hexagon"])
@pytest.mark.parametrize("make", [lambda m: refweb.Paper(mesh=m, cable_length=201.4), None])
def test_directions(mesh, make):
    """Of lines at 60° or 30° as many rise as fall in a web that is its own mirror image; each has one direction."""
    web = (make(mesh) if make else refweb.Layers(mesh=mesh, layers=4, cell_area=1.0)).web()
    x, y, _ = (web.points[web.lines[:, 1]] - web.points[web.lines[:, 0]]).T
    slope = {"triangle": np.sqrt(3), "hexagon": np.sqrt(1 / 3)}[mesh]
    for name, sign in (("rising", 1), ("falling", -1)):
        aslant = web.find_lines(name)
        np.testing.assert_allclose(y[aslant] / x[aslant], sign * slope, rtol=1e-9)
    assert len(web.find_lines("rising")) == len(web.find_lines("falling"))
    parts = [web.groups.get(name, []) for name in ("rows", "columns", "diagonals")]
    assert sorted(np.concatenate(parts)) == list(range(len(web.lines)))


def test_a_cable_and_a_web_of_the_user():
    cable = refweb.SingleCable(start=(0, 0, 0), end=(1, 0, 0), elements=5).web()
    assert (cable.find_lines("anchors").tolist(), cable.find_lines("inner").tolist()) == ([0, 4], [1, 2, 3])
    own = refweb.Inline(
        points=[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],
        lines=[[0, 1], [1, 2], [2, 3], [3, 0]],
        supports=[0, 1],
        groups={"inner": [3, 0], "odd": [3, 1]},
    )
    assert refweb.Inline(**own.to_dict()) == own
    found = {name: lines.tolist() for name, lines in own.web().groups.items()}
    assert found == {"inner": [0, 3], "odd": [1, 3], "rim": [0], "anchors": [1, 3]}
    with pytest.raises(InputError, match=r"groups.odd has line 4, must be 0 … 3"):
        own.__class__(**{**own.to_dict(), "groups": {"odd": [4]}}).web()
    assert refweb.Inline(points=own.points, lines=own.lines).web().groups == {}


# What scenes say of them

SCENE = """
[web]
kind = "layers"
mesh = "square"
layers = 2
cell_area = 1.0

[cable]
law = "linear"
modulus = 1e6
area = 1e-4
density = 500.0
{groups}

[gravity]
acceleration = [0.0, 0.0, -9.81]
{more}
[solve]
kind = "static"
"""


def checked(tmp_path, capsys, groups="", more=""):
    """Status and message of ``refweb check`` of a scene."""
    path = tmp_path / "scene.toml"
    path.write_text(SCENE.format(groups=groups, more=more), encoding="utf-8")
    return main(["check", str(path)]), capsys.readouterr().err


def test_a_thicker_rim(tmp_path, capsys):
    """Mass of 12 lines of 3 A and 12 of A, of side 1 m; what is unknown is refused with what is near."""
    status, _ = checked(tmp_path, capsys, "[cable.groups.rim]\narea = 3e-4")
    assert status == 0
    system = refweb.Scene.load(tmp_path / "scene.toml").build()
    assert system.net.cable_mass == pytest.approx(500.0 * 1e-4 * (12 * 3 + 12), rel=1e-14)
    for groups, more, message in (
        ("[cable.groups.rims]\narea = 1.0", "", '[cable.groups] "rims" is not a group of lines, did you mean "rim"?'),
        (
            "[cable.groups.ring-2]\narea = 1e-4\n[cable.groups.columns]\narea = 2e-4",
            "",
            '[cable.groups] "ring-2" and "columns" both give area to line ',
        ),
        (
            "",
            '[[reel]]\nlines = "ankors"\nfactor = [[0, 1]]',
            '[[reel]] 1 lines = "ankors" names no line, did you mean',
        ),
        (
            "",
            '[[observe]]\nname = "a"\nquantity = "stress"\nline = "iner"',
            '[[observe]] 1 line = "iner" names no line',
        ),
        (
            "",
            '[[pressure]]\nlines = ["spokes", "x"]\nvalue = 1.0\nnormal = [0, 0, 1]',
            '1 lines[1] = "x" names no line',
        ),
        (
            "",
            "[temperature]\nexpansion = 1e-5\nchange = 1\n[temperature.groups.ring-1]\nchange = 2\n"
            "[temperature.groups.inner]\nchange = 3",
            'groups "ring-1" and "inner" both give change to line ',
        ),
    ):
        status, err = checked(tmp_path, capsys, groups, more)
        assert status == 2 and message in err, err


def test_observed_over_groups(tmp_path):
    """Cooled bars between fixed ends: T = EA (1/(1 + α ΔT) − 1) of each group, of several lines the largest."""
    web = refweb.SingleCable(start=(0, 0, 0), end=(6, 0, 0), elements=6)
    heat = refweb.Temperature(
        expansion=-1e-3, change=1.0, groups=dict(anchors=dict(change=2.0), inner=dict(expansion=-3e-3))
    )
    lines = {"all": None, "anchors": "anchors", "inner": "inner", "both": ["inner", 5], "apart": [1, 5], "one": 3}
    tension = {name: 1.0 / (1.0 - share) - 1.0 for name, share in (("anchors", 2e-3), ("inner", 3e-3))}
    exact = {name: tension["anchors" if name == "anchors" else "inner"] for name in lines}
    for solve in (refweb.Static(), refweb.Dynamic(duration=1e-4)):
        solution = refweb.run(
            refweb.Scene(
                web=web,
                cable=refweb.Cable(law="linear", modulus=1e4, area=1e-4, density=1e3),
                supports=refweb.Supports(nodes="all"),
                effects=[heat],
                observe=[refweb.Observe(name=k, quantity="tension", line=v, reduce="max") for k, v in lines.items()],
                solve=solve,
            )
        )
        for name, value in exact.items():
            result = solution.results[name]
            assert result.value == pytest.approx(value, rel=1e-12), name
            chosen = {"anchors": {0, 5}, "apart": {1}, "one": {3}}.get(name, {1, 2, 3, 4})
            assert result.where in chosen, name


def test_temperature_of_groups_that_share_lines():
    """α of one group and ΔT of another make the length of a line in both."""
    web = refweb.Inline(
        points=[[k, 0, 0] for k in range(4)],
        lines=[[0, 1], [1, 2], [2, 3]],
        supports=[0, 1, 2, 3],
        groups={"steel": [0, 1], "shade": [1, 2]},
    )
    heat = refweb.Temperature(
        expansion=1e-3, change=10.0, groups=dict(steel=dict(expansion=2e-3), shade=dict(change=-5.0))
    )
    scene = refweb.Scene(
        web=web,
        cable=refweb.Cable(law="linear", modulus=1e6, area=1e-4, density=1.0),
        effects=[heat],
        solve=refweb.Static(),
    )
    np.testing.assert_allclose(scene.build().natural_length(1.0), [1.02, 0.99, 0.995], rtol=1e-15)


def test_strain_is_told_of_all_lines_where_one_is_observed():
    """A stiff line is observed, and another is strained by 0.5: the remark is on that."""
    web = refweb.Inline(
        points=[[0, 0, 0], [1, 0, 0], [0, 1, 0], [1.5, 1, 0]],
        lines=[[0, 1], [2, 3]],
        natural_length=[1.0, 1.0],
        supports=[0, 1, 2, 3],
    )
    scene = refweb.Scene(
        web=web,
        cable=refweb.Cable(modulus=1e4, area=1e-4, density=1e3),
        observe=[refweb.Observe(name="own", quantity="tension", line=0, reduce="max")],
        solve=refweb.Dynamic(duration=1e-4),
    )
    assert any(text.startswith("line 1 is strained by 50 %") for text in refweb.run(scene).warnings)


def test_the_first_line_of_a_group_that_snaps_taut():
    """Two nodes on slack lines of 0.1 and 0.2 m too much fly at 1 m/s: taut after 0.1 and 0.2 s, the first counts."""
    web = refweb.Inline(
        points=[[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]],
        lines=[[0, 1], [2, 3]],
        natural_length=[1.2, 1.1],
        supports=[0, 2],
        groups=["a", "a"],
    )
    events = [refweb.Event(name=str(line), kind="taut", line=line) for line in (0, 1, "a")]

    def scene(**groups):
        return refweb.Scene(
            web=web,
            cable=refweb.Cable(
                law="tension-only" if not groups else "smooth", modulus=1e4, area=1e-4, density=1e3, **groups
            ),
            effects=[refweb.Velocity(node=[1, 3], value=(1.0, 0.0, 0.0))],
            event=events,
            solve=refweb.Dynamic(duration=0.25, step_size=1e-3),
        )

    found = {event["name"]: event for event in refweb.run(scene()).events}
    assert found["a"]["time"] == found["1"]["time"] == pytest.approx(0.1, abs=found["1"]["error"])
    assert found["0"]["time"] == pytest.approx(0.2, abs=found["0"]["error"]) and found["0"]["error"] < 0.01
    different = scene(groups={"a": refweb.Group(slackness=0.0)})
    different.build()
    mixed = refweb.Inline(**{**web.to_dict(), "groups": {"a": [0, 1], "b": [1]}})
    with pytest.raises(InputError, match="these lines have slackness 0 … 0.1, and snap taut at different strains"):
        scene(groups={"b": refweb.Group(slackness=0.1)}).replace(web=mixed).build()


def test_no_groups():
    """None is no groups, as an empty table is, of a cable and of names of nodes."""
    keys = dict(modulus=1.0, area=1.0, density=1.0)
    assert refweb.Cable(groups=None, **keys) == refweb.Cable(groups={}, **keys) == refweb.Cable(**keys)
    assert refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], names=None).web().names == {}


def test_thrust_along_the_line_of_a_group():
    """Of the lines of a group the one that ends at the node is pulled."""
    web = refweb.Window(mesh="square", rows=2, columns=2, side=1.0)
    net = (
        refweb.Scene(web=web, cable=refweb.Cable(modulus=1e4, area=1e-4, density=1.0), solve=refweb.Static())
        .build()
        .net
    )
    end = int(net.web.rim[0])
    (line,) = np.flatnonzero((net.web.lines == end).any(axis=1))
    for name in ("anchors", int(line)):
        term = refweb.Thrust(node=end, line=name, force=1.0).on(net)
        assert sorted(term.cells[0]) == sorted(net.web.lines[line])
    centre = net.web.centre
    with pytest.raises(InputError, match=r'line = "anchors": 4 of its lines end at node \d+, must be one'):
        refweb.Thrust(node=centre, line="anchors", force=1.0).on(net)
