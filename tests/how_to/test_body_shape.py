"""The page in `refweb.net.rigid_body`, word by word, in a package; and a shape with curvature and edges."""

import inspect
from math import sqrt

import meshio
import numpy as np
import packages
import pytest

import refweb
from refweb.kernels import kernel
from refweb.net import rigid_body
from refweb.net.rigid_body import Grown, Shape
from refweb.registry import EFFECTS, SHAPES, load
from refweb.tables import real, table

PAGE = inspect.getdoc(rigid_body)
EXAMPLE, ENTRY = packages.blocks(PAGE)
_, NAME, *_ = packages.entry_point(ENTRY)
NORMAL = np.array([0.6, 0.0, 0.8])


@kernel()
def depth_in_top(p, grown):
    """Depth in a ball of the radius r + w at −h, one of r at h, and the cone about both."""
    r, w = grown.radius, grown.core[0]
    h = grown.core[2] - w
    sine = w / (2.0 * h)
    cosine = sqrt(1.0 - sine * sine)
    out = sqrt(p[0] * p[0] + p[1] * p[1])
    along = cosine * (p[2] + h) - sine * out
    if 0.0 < along < 2.0 * h * cosine:
        e0, e1, around = p[0] / out, p[1] / out, -cosine / out
        bend = around * e1 * e1, -around * e0 * e1, 0.0, around * e0 * e0, 0.0, 0.0
        return r + w - cosine * out - sine * (p[2] + h), (-cosine * e0, -cosine * e1, -sine), bend
    radius, z = (r + w, p[2] + h) if along <= 0.0 else (r, p[2] - h)
    d = sqrt(out * out + z * z)
    g = -p[0] / d, -p[1] / d, -z / d
    bend = (g[0] * g[0] - 1.0) / d, g[0] * g[1] / d, g[0] * g[2] / d
    return radius - d, g, (*bend, (g[1] * g[1] - 1.0) / d, g[1] * g[2] / d, (g[2] * g[2] - 1.0) / d)


@table
class Top(Shape):
    """The hull of a large ball below and a small one above."""

    lower: float = real(above=0, unit="m")
    upper: float = real(above=0, unit="m")
    between: float = real(default=0.4, above=0, unit="m")

    def check(self):
        if not self.upper < self.lower < self.upper + self.between:
            raise refweb.InputError(
                f"lower = {self.lower:g} must be > {self.upper:g} [m], and neither ball in the other"
            )

    def grown(self):
        wider = self.lower - self.upper
        return Grown(self.upper, (wider, wider, 0.5 * self.between + wider))

    def depth(self):
        return depth_in_top

    def farthest(self, normals):
        wider, half = self.lower - self.upper, 0.5 * self.between
        low = (wider - half * normals[:, 2] > half * normals[:, 2])[:, None]
        return np.where(low, wider * normals - [0.0, 0.0, half], [0.0, 0.0, half])


WALL = {"name": "it", "shape": "wall", "normal": [float(x) for x in NORMAL], "fixed": True}
TOP = {"name": "it", "shape": "top", "lower": 0.3, "upper": 0.15, "fixed": True}


@pytest.fixture(autouse=True, scope="module")
def shapes(tmp_path_factory):
    """The example in a package that is installed; the other shape is registered, as a script does."""
    with packages.of_page(tmp_path_factory.mktemp("page"), EXAMPLE, ENTRY):
        refweb.register("shape", "top", Top)
        yield


def test_the_page_is_short_and_names_what_there_is():
    assert 20 <= len(PAGE.splitlines()) <= 46
    for name, reference in SHAPES.items():
        assert issubclass(load(reference), Shape)
        assert reference is Top or reference.startswith(f"refweb.net.shapes.{name}:")


def net_scene(body, *, solve, contact=None, **tables):
    """A small net in the plane z = 0 and a body that it touches."""
    return refweb.Scene.from_dict(
        {
            "web": {"kind": "window", "mesh": "square", "rows": 4, "columns": 4, "side": 0.5},
            "cable": {"law": "linear", "modulus": 1e6, "area": 1e-4, "density": 1000.0},
            "body": [body],
            "contact": {"stiffness": 1e3, **(contact or {})},
            "solve": solve,
            **tables,
        }
    )


STATIC = {"kind": "static"}
PLACES = [
    (WALL, [0.2, 0.1, -0.05]),
    (TOP, [0.05, 0.03, -0.1]),  # its flank
    (TOP, [0.05, -0.03, -0.22]),  # its upper ball
    (TOP, [0.05, 0.03, 0.35]),  # its lower ball
]


@pytest.mark.parametrize("body, place", PLACES)
@pytest.mark.parametrize("exponent", [1, 1.5])
def test_force_is_minus_the_slope_of_energy(body, place, exponent):
    scene = net_scene({**body, "position": place}, solve=STATIC, contact={"exponent": exponent})
    system = scene.build()
    (term,) = [term for term in system.terms if term.contact.with_lines]
    rng = np.random.default_rng(3)
    x, v = 0.03 * rng.standard_normal((2, system.rows, 3))
    force, out = np.zeros_like(x), np.zeros((len(term.cells), term.columns))
    term.force(0.0, x, v, force, term.cells, term.data, out)
    assert (out[:, 0] > 0.0).sum() >= 3
    np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-12 * np.abs(force).sum())
    blocks = np.zeros((len(term.cells), *2 * (3 * term.cells.shape[1],)))
    term.tangent.stiffness(0.0, x, v, blocks, term.cells, term.data, False)
    for _ in range(5):
        d = rng.standard_normal(x.shape)
        step = 1e-6
        ends = [system.energy_of(term, 0.0, x + h * d).sum() for h in (step, -step)]
        assert (ends[1] - ends[0]) / (2.0 * step) == pytest.approx(np.sum(force * d), rel=1e-6)
        product = np.zeros_like(x)
        own = d[term.cells].reshape(len(term.cells), -1)
        np.add.at(product, term.cells, np.einsum("cij,cj->ci", blocks, own).reshape(*term.cells.shape, 3))
        change = np.zeros_like(x)
        for h in (step, -step):
            term.force(0.0, x + h * d, v, moved := np.zeros_like(x), term.cells, term.data, out)
            change += np.sign(h) * moved / (2.0 * step)
        np.testing.assert_allclose(change, -product, rtol=0, atol=2e-6 * np.abs(product).max())


@pytest.mark.slow
@pytest.mark.ordinary("body0")
@pytest.mark.parametrize("body", [WALL, TOP])
def test_a_net_that_flies_into_it_is_thrown_back(body, tmp_path):
    """The book closes, with friction as well; what the web loses in momentum is what the supports and the body took."""
    place = [0.0, 0.0, -0.45] if body is TOP else [0.0, 0.0, -0.1]
    body = {**body, "position": place, **({"normal": [0.0, 0.1, 1.0]} if body is WALL else {})}
    scene = net_scene(
        body,
        contact={"stiffness": 1e4, "friction": 0.3, "slip_velocity": 0.1},
        solve={"kind": "dynamic", "duration": 0.08, "safety": 0.125},
        output={"interval": 0.01, "frames": 4},
        accuracy={"error": "none"},
        velocity=[{"node": "all", "value": [0.5, 0.0, -4.0]}],
        observe=[
            {"name": "deep", "quantity": "contact_energy", "reduce": "max"},
            {"name": "push", "quantity": "reaction", "body": "it", "component": "z", "reduce": "min"},
        ],
    )
    solution = refweb.run(scene, tmp_path / "results")
    assert solution.solver["energy_drift"] < 5e-3  # looked at within contact, where an energy of order 2 oscillates
    assert solution.results["deep"].value > 0.0 and solution.results["push"].value < 0.0
    assert solution.history["dissipated_energy"][-1] > 0.0

    shape, name = scene.build().net.bodies[0].shape, "it_000004.vtu"
    drawn = meshio.read(tmp_path / "results" / "frames" / name)
    local = (drawn.points - place) @ shape.frame().T
    depth = shape.depth()
    np.testing.assert_allclose([depth(tuple(p), shape.grown())[0] for p in local], 0.0, atol=1e-6)
    a, b, c = (drawn.points[drawn.cells_dict["triangle"][:, k]] for k in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    expected = 2.0**2 if isinstance(shape, load(SHAPES["wall"])) else area_of_top(shape)
    assert area == pytest.approx(expected, rel=0.03)


def area_of_top(shape):
    """Two caps and the flank between."""
    lower, upper, between = shape.lower, shape.upper, shape.between
    sine = (lower - upper) / between
    flank = np.pi * (lower + upper) * between * (1.0 - sine * sine)
    return 2.0 * np.pi * (lower**2 * (1.0 + sine) + upper**2 * (1.0 - sine)) + flank


def test_a_heavy_cable_lies_on_it():
    """Supports and wall carry the weight, and friction none of it: a plane that is level, 0.2 below the ends."""
    cable = {"law": "linear", "modulus": 1e6, "area": 1e-4, "density": 1000.0}
    body = {"name": "floor", "shape": "wall", "normal": [0, 0, 1], "position": [0.0, 0.0, -0.2], "fixed": True}
    held = {"name": "held", "quantity": "reaction", "node": "rim", "component": "z"}
    scene = refweb.Scene.from_dict(
        {
            "web": {"kind": "cable", "start": [-1, 0, 0], "end": [1, 0, 0], "elements": 40, "length": 2.3},
            "cable": cable,
            "gravity": {"acceleration": [0.0, 0.0, -9.81]},
            "body": [body],
            "contact": {"stiffness": 1e4},
            "solve": STATIC,
            "observe": [held, {**held, "name": "push", "node": None, "body": "floor"}],
        }
    )
    solution = refweb.run(scene)
    weight, found = 1000.0 * 1e-4 * 2.3 * 9.81, {name: result.value for name, result in solution.results.items()}
    assert found["held"] - found["push"] == pytest.approx(weight, rel=1e-8) and -found["push"] > 0.3 * weight
    # Each element of 0.0575 m presses by its weight with at least an end and its middle.
    assert -0.2 - weight / 40 / 1e4 < solution.positions[:41, 2].min() < -0.2


REFUSED = [
    (dict(WALL, normal=None), 'normal is missing: shape = "wall" needs normal = ...'),
    (dict(WALL, normal=[0, 0, 0]), r"normal = \[0.0, 0.0, 0.0\] must not be zero"),
    (dict(WALL, drawn=-1), r"drawn = -1.0 must be > 0 \[m\]"),
    (dict(WALL, drwan=1), 'drwan = 1: unknown key, did you mean "drawn"'),
    (dict(WALL, radius=0.1), 'radius = 0.1 has no meaning for shape = "wall"'),
    (dict(WALL, shape="sphere", radius=0.1), 'normal = .* has no meaning for shape = "sphere"'),
    (dict(WALL, shape="wal"), 'shape = "wal" must be one of .*"wall".* did you mean "wall"'),
    (dict(WALL, fixed=False, mass=1), 'shape = "wall" must have fixed = true; sphere, .* and mesh may be free'),
    (dict(TOP, lower=0.1), r"lower = 0.1 must be > 0.15 \[m\]"),
]


@pytest.mark.parametrize("given, message", REFUSED)
def test_its_keys_are_checked(given, message):
    given = {key: value for key, value in {**given, "position": [0, 0, 0]}.items() if value is not None}
    with pytest.raises(refweb.InputError, match=message) as error:
        net_scene(given, solve=STATIC)
    assert str(error.value).startswith("[[body]] 1 ") and "\n" not in str(error.value)


def test_a_scene_with_it_is_written_and_read():
    """As a file, and in Python by its keys; a copy keeps them."""
    scene = net_scene({**WALL, "drawn": 3.0, "position": [0, 0, 0]}, solve=STATIC)
    (body,) = scene.to_dict()["body"]
    assert list(body)[:4] == ["name", "shape", "normal", "drawn"] and body["drawn"] == 3.0
    assert refweb.Scene.from_dict(scene.to_dict()).to_dict() == scene.to_dict()
    wall = load(EFFECTS["body"])(**body)
    assert wall.drawn == 3.0 and wall.to_dict() == body
