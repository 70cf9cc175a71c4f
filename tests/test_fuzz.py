"""Scene files that a person might write, and worse ones: exit status 0, 1 or 2, one line, and nothing left behind.

Hypothesis draws scenes that are valid but for their numbers, and changes a key, a table or the text of one.
"""

import contextlib
import copy
import io
import json
import math
import os
import pathlib
import re
import shutil
import signal
import tempfile

import hypothesis.strategies as st
import numpy as np
import pytest
import tomli_w
from hypothesis import HealthCheck, given, settings

import refweb
from refweb.__main__ import main
from refweb.dynamics.integrators.central_difference import CentralDifference

LONGEST = 150
"""Time that a small scene may take [s]: some milliseconds, or that to compile what it calls for first."""

# Scenes

PLAIN = st.sampled_from([0.1, 0.5, 1.0, 2.0, 10.0])
FEW = st.one_of(st.sampled_from([0.0, 1e-12, 1e-6, 1e4, 1e12, 1e50, 1e100]), st.floats(1e-9, 1e3))
ANY = st.one_of(PLAIN, PLAIN, PLAIN, FEW)
SIGNED = st.builds(lambda sign, value: sign * value, st.sampled_from([-1.0, 1.0]), st.one_of(PLAIN, PLAIN, ANY))
PLACE = st.sampled_from([-1.0, 0.0, 0.5, 1.0, 3.0])
VECTOR = st.lists(st.one_of(st.just(0.0), SIGNED), min_size=3, max_size=3)
NUMBER = st.sampled_from([0, 0, 1, 1, 1, 2, 5])
NUMBERS = st.lists(NUMBER, min_size=1, max_size=3)
NODE = st.one_of(NUMBER, st.sampled_from(["centre", "all", "rim"]), NUMBERS)
LINES = st.one_of(NUMBER, st.just("all"), NUMBERS)
TABLE = st.lists(PLAIN, min_size=1, max_size=3, unique=True).flatmap(
    lambda times: st.tuples(*(st.tuples(st.just(t), PLAIN).map(list) for t in sorted(times))).map(list)
)


def table(optional=None, **keys):
    return st.fixed_dictionaries(keys, optional=optional or {})


@st.composite
def inline(draw):
    """A few points, each with a line to one before it, and some lines more."""
    points = draw(st.lists(st.tuples(PLACE, PLACE, PLACE).map(list), min_size=2, max_size=7, unique_by=tuple))
    node = st.integers(0, len(points) - 1)
    tree = [(draw(st.integers(0, i - 1)), i) for i in range(1, len(points))]
    more = draw(st.lists(st.tuples(node, node), max_size=5))
    lines = dict.fromkeys(tuple(sorted(line)) for line in [*tree, *more] if line[0] != line[1])
    web = {"kind": "inline", "points": points, "lines": [list(line) for line in lines]}
    web |= draw(st.fixed_dictionaries({}, optional={"natural_length": ANY}))
    return {**web, "supports": draw(st.lists(node, max_size=3))}


WEB = st.one_of(
    table(
        kind=st.just("window"),
        mesh=st.sampled_from(["triangle", "square", "hexagon"]),
        rows=st.integers(3, 4),
        columns=st.integers(3, 4),
        side=PLAIN,
    ),
    table(
        kind=st.just("layers"),
        mesh=st.sampled_from(["triangle", "square", "hexagon"]),
        layers=st.integers(1, 2),
        cell_area=PLAIN,
    ),
    table(
        kind=st.just("cable"),
        start=st.just([0.0, 0.0, 0.0]),
        end=st.sampled_from([[1.0, 0.0, 0.0], [0.0, 0.0, -2.0], [0.3, 0.4, 0.5], [1e-3, 0.0, 0.0]]),
        elements=st.integers(1, 6),
        optional={"length": ANY, "sag": VECTOR},
    ),
    inline(),
)
CABLE = table(
    law=st.sampled_from(["smooth", "tension-only", "linear"]),
    modulus=st.one_of(st.just(7e7), st.just(7e7), ANY),
    area=st.one_of(st.just(1e-4), ANY),
    density=st.one_of(st.just(200.0), ANY),
    optional={
        "prestrain": st.sampled_from([0.0, -0.1, 0.01, 1e-9]),
        "strength": ANY,
        "order": st.sampled_from([1, 1, 1, 2, 3]),
        "subdivide": st.integers(1, 2),
    },
)
FORMED = [{"pretension": 1.0}, {"sag": 0.1}, {"law": "constant-force", "pretension": 10.0}]
FORMED += [{"law": "force-density", "force_density": density} for density in (2.0, -2.0)]
CABLE = st.builds(lambda cable, more: cable | more, CABLE, st.sampled_from([{}] * 8 + FORMED))
SHAPES = st.one_of(
    table(shape=st.just("sphere"), radius=PLAIN),
    table(shape=st.just("ring"), radius=PLAIN, normal=VECTOR),
    table(shape=st.just("box"), size=st.lists(PLAIN, min_size=3, max_size=3), fixed=st.just(True)),
    table(shape=st.just("cylinder"), radius=PLAIN, length=PLAIN, axis=VECTOR, fixed=st.just(True)),
)
BODY = st.builds(
    lambda shape, name, position, velocity, mass: {
        "name": name,
        "position": position,
        **({} if shape.get("fixed") else {"velocity": velocity, "mass": mass}),
        **shape,
    },
    SHAPES,
    st.sampled_from(["ball", "b", "Ω"]),
    VECTOR,
    VECTOR,
    ANY,
)
CONTACT = table(
    stiffness=st.one_of(st.just(1e4), ANY),
    optional={"friction": ANY, "damping": ANY, "exponent": st.sampled_from([1, 1.5]), "slip_velocity": ANY},
)
EFFECTS = {
    "gravity": table(acceleration=VECTOR),
    "load": st.lists(table(node=NODE, force=VECTOR, optional={"factor": TABLE}), min_size=1, max_size=2),
    "point_mass": st.lists(table(node=NODE, mass=ANY), min_size=1, max_size=2),
    "velocity": st.lists(table(node=NODE, value=VECTOR), min_size=1, max_size=2),
    "motion": st.lists(
        table(node=NODE, displacement=st.tuples(st.just(0.0), SIGNED, SIGNED, SIGNED).map(lambda row: [list(row)])),
        min_size=1,
        max_size=2,
    ),
    "body": st.lists(BODY, min_size=1, max_size=2),
    "contact": CONTACT,
    "attach": st.lists(
        table(body=st.sampled_from(["ball", "b"]), node=NODE, optional={"point": VECTOR}), min_size=1, max_size=1
    ),
    "link": st.lists(table(nodes=NUMBERS), min_size=1, max_size=1),
    "thread": st.lists(
        table(
            name=st.just("rope"),
            nodes=NUMBERS | st.just([0, "ball", 1]),
            modulus=ANY,
            area=ANY,
            density=ANY,
            optional={
                "prestrain": SIGNED,
                "friction": ANY,
                "around": st.lists(
                    table(body=st.just("ball"), optional={"side": VECTOR, "turns": st.integers(-1, 3)}), max_size=1
                ),
            },
        ),
        min_size=1,
        max_size=1,
    ),
    "winch": st.lists(
        table(
            optional={
                "thread": st.just("rope"),
                "lines": LINES,
                "end": st.sampled_from(["first", "last"]),
                "at": NODE,
                "speed": SIGNED,
                "limit": ANY,
                "tension": ANY,
                "power": SIGNED,
                "speed_limit": ANY,
                "mass": st.sampled_from(["stays", "follows"]),
                "drum": NODE,
            },
        ),
        min_size=1,
        max_size=1,
    ),
    "damping": table(optional={"time": ANY, "rate": ANY}),
    "bending": table(stiffness=ANY, optional={"clamp": NODE}),
    "self_contact": table(radius=ANY, optional={"stiffness": ANY, "damping": ANY}),
    "frame": table(angular_velocity=VECTOR),
    "drag": table(density=ANY, optional={"wind": VECTOR, "normal": ANY}),
    "orbit": table(mean_motion=ANY),
    "rupture": table(strength=ANY),
    "fold": table(ratio=ANY, optional={"turns": SIGNED, "gap": ANY}),
    "pressure": st.lists(table(lines=LINES, normal=VECTOR, value=SIGNED), min_size=1, max_size=1),
    "thrust": st.lists(
        table(node=NUMBER, line=NUMBER, force=SIGNED, optional={"factor": TABLE}),
        min_size=1,
        max_size=1,
    ),
    "reel": st.lists(
        table(
            lines=LINES,
            factor=TABLE,
            optional={"mass": st.sampled_from(["stays", "follows"]), "drum": NUMBER},
        ),
        min_size=1,
        max_size=2,
    ),
    "temperature": table(expansion=SIGNED, change=SIGNED),
    "support": table(nodes=NODE, components=st.lists(st.sampled_from("xyz"), min_size=1)).map(lambda one: [one]),
    "supports": table(nodes=NODE),
    "output": table(frames=st.integers(1, 3)),
    "accuracy": table(error=st.sampled_from(["twin", "none"])),
    "observe": st.lists(
        table(
            name=st.sampled_from(["a", "b", "tension of all"]),
            quantity=st.sampled_from(["displacement", "tension", "strain", "reaction", "strain_energy", "velocity"]),
            optional={"reduce": st.sampled_from(["max", "min"])},
        ),
        min_size=1,
        max_size=2,
    ),
    "event": st.lists(
        table(name=st.just("e"), kind=st.sampled_from(["contact", "taut"]), optional={"line": NUMBER}),
        min_size=1,
        max_size=1,
    ),
}
STATIC = table(
    kind=st.just("static"),
    optional={
        "method": st.sampled_from(["newton", "relaxation"]),
        "load_steps": st.lists(SIGNED, min_size=1, max_size=2),
    },
)
DYNAMIC = table(
    kind=st.just("dynamic"),
    duration=PLAIN,
    method=st.sampled_from(["central-difference", "central-difference", "explicit", "cvode", "ida"]),
    optional={"start": st.sampled_from(["web", "equilibrium"]), "mass": st.sampled_from(["lumped", "consistent"])},
)
USUAL = ("gravity", "load", "body", "contact", "velocity", "point_mass")


def shortened(own):
    """A dynamic scene that takes some 500 steps at most, as far as a bound on its step is known."""
    if own["solve"]["kind"] != "dynamic":
        return own
    steps = 500 if own["solve"]["method"] == "central-difference" else 20
    with contextlib.suppress(refweb.InputError, refweb.SolverError):
        plain = {**own, "solve": {"kind": "dynamic", "duration": 1.0}, "cable": {**own["cable"], "order": 1}}
        plain.pop("link", None)
        plain.pop("event", None)
        bound = CentralDifference(refweb.Scene.from_dict(plain).build()).bound(reach=1e3)
        own["solve"]["duration"] = min(own["solve"]["duration"], max(steps * bound, 1e-100))
    own["output"] = {**own.get("output", {}), "interval": own["solve"]["duration"] / 3.0}
    return own


@st.composite
def scenes(draw):
    """A scene that is valid but for its numbers, and for what of it goes together."""
    own = {"web": draw(WEB), "cable": draw(CABLE), "solve": draw(st.one_of(STATIC, DYNAMIC))}
    few = st.one_of(st.sampled_from(USUAL), st.sampled_from(sorted(EFFECTS)))
    for name in draw(st.lists(few, max_size=4, unique=True)):
        own[name] = draw(EFFECTS[name])
    if "contact" in own and "body" not in own:
        own["body"] = draw(EFFECTS["body"])
    if own["solve"]["kind"] == "static":
        own = {name: value for name, value in own.items() if name not in ("velocity", "event")}
    return shortened(own)


# What makes them wrong

WRONG = st.one_of(
    st.sampled_from(
        [True, "", "x", "centre", "Ω𝄞", "../..", "a\tb", 0, -1, 7, 2**63, 10**400, 1e308, -1e308, 5e-324]
        + [math.nan, math.inf, -math.inf, [], {}, [[]], [{}], {"x": 1}, [1.0], [math.nan] * 3, [[0.0, 0.0]] * 2]
    ),
    st.text(max_size=5),
)


ENDLESS = st.sampled_from([True, "1", 0.0, -1.0, 1e308, math.nan, math.inf, []])
"""Wrong values of what decides how long a run takes: valid ones would only make it longer."""


def places(given, way=()):
    """Ways to everything in a scene."""
    pairs = given.items() if isinstance(given, dict) else enumerate(given) if isinstance(given, list) else ()
    for key, value in pairs:
        yield (*way, key)
        yield from places(value, (*way, key))


@st.composite
def wrong_scenes(draw):
    """A scene with a few changes, as text."""

    def wrong(values=WRONG):
        return copy.deepcopy(draw(values))  # a list may be changed in its turn

    own = copy.deepcopy(draw(scenes()))
    for _ in range(draw(st.integers(1, 2))):
        *way, last = draw(st.sampled_from(sorted(places(own), key=str)))
        table = own
        for key in way:
            table = table[key]
        change = draw(st.sampled_from(["set", "set", "set", "remove", "add", "rename", "repeat"]))
        if change == "set":
            table[last] = wrong(ENDLESS if last in ("duration", "interval") else WRONG)
        elif change == "remove":
            del table[last]
        elif change == "repeat":
            table[last] = [table[last]] * draw(st.integers(0, 3))
        elif isinstance(table, list):
            table.append(wrong())
        elif change == "add":
            name = draw(st.sampled_from(["kind", "nodes", "unknown", "", "Ω", "a b", "..", *EFFECTS]))
            table[name] = wrong()
        else:
            table[f"{last}x"] = table.pop(last)
        if not own:
            break
    return tomli_w.dumps(own)


@st.composite
def wrong_texts(draw):
    """The text of a scene with something in it that does not belong there."""
    text = tomli_w.dumps(draw(scenes()))
    at = draw(st.integers(0, len(text)))
    rest = draw(st.sampled_from([text[at:], text[at + 1 :], "", text]))
    between = st.one_of(st.text(max_size=3), st.sampled_from(["[", "[[", "\x00", '"""', "{", "="]))
    return text[:at] + draw(between) + rest


# What must come of them


@contextlib.contextmanager
def limited(seconds):
    """Raise where something takes too long."""

    def late(*_):
        raise AssertionError(f"takes more than {seconds} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def no_constant(name):
    raise AssertionError(f"{name} in run.json")


def check_files(out):
    """No number in any file is missing or endless."""
    json.loads((out / "run.json").read_text(encoding="utf-8"), parse_constant=no_constant)
    rows = (out / "history.csv").read_text().splitlines()
    assert all(np.isfinite([float(value) for value in row.split(",")]).all() for row in rows[1:])
    for path in [*out.glob("frames/*.vtu"), out / "web.pvd"]:
        data = path.read_bytes()
        assert data.endswith(b"</VTKFile>\n") or data.endswith(b"</VTKFile>"), path
    with np.load(out / "checkpoint.npz") if (out / "checkpoint.npz").exists() else contextlib.nullcontext({}) as kept:
        for key in set(kept) & {"time", "positions", "displacements", "velocities"}:
            assert np.isfinite(kept[key]).all(), key
    import meshio

    for path in out.glob("frames/*.vtu"):
        mesh = meshio.read(path)
        assert np.isfinite(mesh.points).all(), path
        for name, values in (*mesh.point_data.items(), *((n, v[0]) for n, v in mesh.cell_data.items())):
            assert np.isfinite(values).all(), (path, name)


def check_run(text):
    """Run the text of a scene; returns the exit status and the message."""
    folder = pathlib.Path(tempfile.mkdtemp(prefix="refweb-fuzz-"))
    try:
        path, out = folder / "scene.toml", folder / "out"
        path.write_bytes(text.encode("utf-8", errors="surrogatepass"))
        said = io.StringIO()
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(said), limited(LONGEST):
            status = main(["run", str(path), "--out", str(out)])
        err = said.getvalue()
        assert status in (0, 1, 2) and "internal error" not in err and "Traceback" not in err, err
        if status == 0:
            assert err == ""
        else:
            assert err.startswith("refweb: ") and err.count("\n") == 1 and len(err) < 1000, err
        if status == 2:
            assert os.listdir(folder) == ["scene.toml"]
            assert err.startswith("refweb: scene.toml: "), err
            assert re.match(r"refweb: scene.toml: (\[\[?[^\]]+\]|cannot be read: |.* = |node |line |body )", err), err
        else:
            check_files(out)
        return status, err
    finally:
        shutil.rmtree(folder)


SOME = dict(deadline=None, suppress_health_check=list(HealthCheck), database=None, derandomize=True)
counted = {}


def note(kind, status):
    counted[kind, status] = counted.get((kind, status), 0) + 1


def fuzz(count):
    share = count // 5

    @settings(max_examples=share, **SOME)
    @given(own=scenes())
    def valid(own):
        note("valid", check_run(tomli_w.dumps(own))[0])

    @settings(max_examples=3 * share, **SOME)
    @given(text=wrong_scenes())
    def wrong(text):
        note("wrong", check_run(text)[0])

    @settings(max_examples=share, **SOME)
    @given(text=wrong_texts())
    def garbled(text):
        note("garbled", check_run(text)[0])

    return valid, wrong, garbled


@pytest.mark.parametrize("kind", range(3), ids=["valid", "changed", "garbled"])
def test_some_scenes(kind):
    fuzz(100)[kind]()


@pytest.mark.slow
@pytest.mark.parametrize("kind", range(3), ids=["valid", "changed", "garbled"])
def test_many_scenes(kind):
    fuzz(20_000)[kind]()
