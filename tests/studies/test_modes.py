"""Natural frequencies against closed forms, their bounds, and what has no frequency.

Where a closed form belongs to the very chain or lattice of masses that is solved, it has to lie within the ± of each
frequency, which is itself asked to be small. `CLOSED` is for the rounding of the closed form.
"""

import json
from dataclasses import replace

import meshio
import numpy as np
import pytest
import scipy.special
from commands.test_cli import SCENE, files, refused

import refweb
from refweb.__main__ import main
from refweb.studies import pencil
from refweb.studies.spectrum import spectrum

CLOSED = 1e-15
"""Sines, products and a root: a few roundings of 1.1e-16 each."""
EA, STRAIN = 1000.0, 1e-3
TENSION = EA * STRAIN


def cable(**more):
    given = dict(law="tension-only", modulus=1e7, area=1e-4, density=0.0)
    return refweb.Cable(**{**given, **more})


def inline(points, lines, **more):
    return refweb.Inline(points=np.asarray(points, float).tolist(), lines=np.asarray(lines).tolist(), **more)


def hertz(squared):
    return np.sqrt(np.sort(np.ravel(squared))) / (2.0 * np.pi)


def assert_within(found, expected, relative=1e-9):
    """Every frequency is the expected one within its ±, and that is small."""
    assert len(found.frequency) == len(expected)
    assert (abs(found.frequency - expected) <= found.error + CLOSED * expected).all()
    assert (found.error <= relative * expected).all()


# The square lattice: point masses m on massless lines of tension T, natural length L, stretched to a, with fixed rim.
# With s = sin²(πp/2N) along the lines and across them, ω² = (4/m) [k sᵖ + (T/a) s^q], where k is the stiffness EA/L for
# a motion along x or y, and T/a for the one across the plane.


def lattice(cells, number, mass=0.02, side=0.125, strain=STRAIN, law="tension-only"):
    i, j = np.divmod(np.arange((cells + 1) ** 2), cells + 1)
    rim = (i % cells == 0) | (j % cells == 0)
    used = (i % cells > 0) | (j % cells > 0)  # not the corners
    node = np.where(used, np.cumsum(used) - 1, -1).reshape(cells + 1, cells + 1)
    along_x = np.column_stack([node[:-1, 1:-1].ravel(), node[1:, 1:-1].ravel()])
    along_y = np.column_stack([node[1:-1, :-1].ravel(), node[1:-1, 1:].ravel()])
    points = side * np.column_stack([i, j, 0 * i])[used]
    web = inline(points, np.vstack([along_x, along_y]), supports=np.flatnonzero(rim[used]).tolist())
    masses = refweb.PointMass(node=np.flatnonzero(~rim[used]).tolist(), mass=mass)
    scene = refweb.Scene(web=web, cable=cable(prestrain=strain, law=law), effects=[masses])
    s = np.sin(np.pi * np.arange(1, cells) / (2 * cells)) ** 2
    stiffness, tension = EA * (1.0 + strain) / side, EA * strain / side
    x = 4.0 / mass * (stiffness * s[:, None] + tension * s)
    z = 4.0 / mass * tension * (s[:, None] + s)
    return refweb.modes(scene, number), x, z


@pytest.mark.parametrize("cells", [3, 6])
def test_square_lattice_has_all_its_frequencies(cells):
    """All modes of a small lattice, two thirds of them in its plane and, with T/EA = 1e-3, far above the others."""
    found, x, z = lattice(cells, 1000)
    assert_within(found, hertz([x, x, z]))
    across = found.spectra[0].shares[: z.size, 2]
    np.testing.assert_allclose(across, 1.0, atol=1e-12)
    assert x.min() > z.max() or cells > 3


def test_square_lattice_misses_none_of_its_double_frequencies():
    """The lowest twelve of 675, p ≠ q all double, by Lanczos iteration."""
    found, x, z = lattice(16, 12)
    assert 3 * x.size > pencil.DENSE
    assert_within(found, hertz(z)[:12])
    assert found.spectra[0].unstable == found.spectra[0].zero == 0
    again = lattice(16, 12)[0]
    np.testing.assert_array_equal(found.shapes, again.shapes)
    np.testing.assert_array_equal(found.frequency, again.frequency)


def test_shapes_are_sines_of_unit_largest_displacement():
    """The shape of p = q = 1 is a product of sines; 8 cells have a node in the middle, where it is 1."""
    found, _, z = lattice(8, 1)
    sine = np.sin(np.pi * found.state.system.net.points[:, :2])
    expected = np.column_stack([np.zeros((77, 2)), sine.prod(axis=1)])
    # The error of the shape is ‖Kφ − ω²Mφ‖ over the gap to the next ω², which is more than ω² itself.
    here = found.spectra[0]
    assert here.residual[0] < 1e-11
    np.testing.assert_allclose(found.shapes[0], expected, atol=1e-10)
    np.testing.assert_allclose(here.modal_mass, 0.02 * 16.0, rtol=1e-10)  # Σ sin² of 7 inner nodes is 8/2
    # Σ sin⁴ of 7 inner nodes is 3: (m 4²)²/(49 m · m 3²)
    np.testing.assert_allclose(here.moving, 16.0**2 / (49.0 * 9.0), rtol=1e-10)
    assert found.state.position[here.nodes].tolist() == [[0.5, 0.5, 0.0]]


# The taut string: n elements of mass μ L and length a under tension T.


def string(elements, number, length=2.0, **options):
    mass = options.pop("mass", "lumped")
    scene = refweb.Scene(
        web=refweb.SingleCable(start=(0, 0, 0), end=(length, 0, 0), elements=elements),
        cable=cable(prestrain=STRAIN, density=300.0, **options),
        solve=refweb.Static(mass=mass),
    )
    return refweb.modes(scene, number)


@pytest.mark.parametrize("mass", ["lumped", "consistent"])
@pytest.mark.parametrize("elements", [12, 150])
def test_taut_string_of_elements(mass, elements):
    """Transverse frequencies of the discrete chain, each twice, along y and z."""
    side = 2.0 / elements
    share = 300.0 * 1e-4 * side / (1.0 + STRAIN)
    angle = np.pi * np.arange(1, 6) / elements
    squared = 4.0 * TENSION / (share * side) * np.sin(angle / 2.0) ** 2
    if mass == "consistent":
        squared *= 3.0 / (2.0 + np.cos(angle))
    found = string(elements, 10, mass=mass)
    assert_within(found, np.repeat(hertz(squared), 2))
    # Near-degenerate pairs are mixed, but none of them moves along x.
    assert found.spectra[0].shares[:, 0].max() < 1e-12


@pytest.mark.ordinary("1-lumped", "1-consistent", "3-lumped", "3-consistent")
@pytest.mark.parametrize("mass", ["lumped", "consistent"])
@pytest.mark.parametrize("order", [1, 2, 3])
def test_taut_string_converges_with_twice_its_order(mass, order):
    """Errors of the second frequency against k/2l √(T/μ) fall with h^2p: fitted slopes, ± 5 %."""
    exact = 2.0 / (2.0 * 2.0) * np.sqrt(TENSION / (300.0 * 1e-4 / (1.0 + STRAIN)))
    elements = np.array([4, 8, 16] if order < 3 else [3, 6, 12])
    found = [string(n, 4, mass=mass, order=order) for n in elements]
    errors = np.array([abs(f.frequency[2] / exact - 1.0) for f in found])
    assert errors.min() > 10 * max(f.error[2] for f in found) / exact  # no rounding in the fit
    slope = -np.polyfit(np.log(elements), np.log(errors), 1)[0]
    assert slope == pytest.approx(2 * order, rel=0.05)
    # subdivide cuts lines into the same elements
    divided = string(int(elements[0]), 4, mass=mass, order=order, subdivide=2)
    assert divided.frequency[2] == pytest.approx(found[1].frequency[2], rel=1e-9)


# The hanging chain, in the limit of no stretch.


def test_hanging_beads_are_zeros_of_laguerre():
    """N beads on a massless thread: ω² = (g/a) x with L_N(x) = 0, the pendulum for N = 1.

    The thread stretches by 1e-9 at most, which changes tensions and lengths by as much, and frequencies by half of it.
    """
    count, side, mass, gravity = 7, 0.5, 0.1, 9.81
    axial = 1e9 * count * mass * gravity
    points = np.column_stack([0 * np.arange(count + 1), 0 * np.arange(count + 1), -side * np.arange(count + 1)])
    lines = np.column_stack([np.arange(count), np.arange(1, count + 1)])
    scene = refweb.Scene(
        web=inline(points, lines, supports=[0]),
        cable=cable(modulus=axial / 1e-4),
        effects=[
            refweb.PointMass(node=list(range(1, count + 1)), mass=mass),
            refweb.Gravity(acceleration=(0, 0, -gravity)),
        ],
    )
    found = refweb.modes(scene, 2 * count)
    expected = np.repeat(hertz(gravity / side * scipy.special.roots_laguerre(count)[0]), 2)
    np.testing.assert_allclose(found.frequency, expected, rtol=1e-9)
    assert (found.error < 1e-5 * found.frequency).all()


def hanging(elements, order, mass):
    """The first four pendulum modes of a chain of 2 m that stretches by 1e-10 at most."""
    length, density, gravity = 2.0, 300.0, 9.81
    scene = refweb.Scene(
        web=refweb.SingleCable(start=(0, 0, 0), end=(0, 0, -length), elements=elements),
        cable=cable(modulus=1e10 * density * gravity * length, density=density, order=order),
        supports=refweb.Supports(nodes=[0]),
        effects=[refweb.Gravity(acceleration=(0, 0, -gravity))],
        solve=refweb.Static(mass=mass),
    )
    exact = scipy.special.jn_zeros(0, 2) / 2.0 * np.sqrt(gravity / length) / (2.0 * np.pi)
    return refweb.modes(scene, 4).frequency[::2] / exact - 1.0


@pytest.mark.parametrize("mass", ["lumped", "consistent"])
@pytest.mark.parametrize("order, elements", [(1, (8, 16, 32)), (2, (3, 6, 12)), (3, (2, 4))])
def test_hanging_chain_is_bessels(mass, order, elements):
    """ω = (j₀ₖ/2) √(g/L), with the order of the elements; 1e-10 of stretch is below all errors in the fit."""
    errors = abs(np.array([hanging(n, order, mass)[1] for n in elements]))
    assert errors.min() > 2e-9
    slope = -np.polyfit(np.log(elements), np.log(errors), 1)[0]
    assert slope == pytest.approx(2 * order, rel=0.1)


# What is free, slack, unstable or without mass.

TETRAHEDRON = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / 8
NOTHING = refweb.Gravity(acceleration=(0, 0, 0))
EDGES = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])


@pytest.mark.parametrize("count", [1, 20])
def test_free_tetrahedron_of_bars(count):
    """Six motions without strain; ω² m/k is 1 twice, 2 three times and 4 once, as of a molecule P₄.

    Twenty of them that do not touch: 120 directions without stiffness, frequencies that are fortyfold.
    """
    points = np.vstack([TETRAHEDRON + [n, 0, 0] for n in range(count)])
    lines = np.vstack([EDGES + 4 * n for n in range(count)])
    scene = refweb.Scene(
        web=inline(points, lines),
        cable=cable(law="linear"),
        supports=refweb.Supports(nodes=[]),
        effects=[refweb.PointMass(node="all", mass=0.5), NOTHING],
    )
    stiffness = EA / np.sqrt(8.0 / 64.0)
    expected = np.repeat([1.0, 2.0, 4.0], np.array([2, 3, 1]) * count)
    found = refweb.modes(scene, 50)
    assert found.spectra[0].zero == 6 * count and found.spectra[0].unstable == 0
    # Frequencies of forty directions each: how well a cluster is solved changes with the order of sums in BLAS.
    assert_within(found, hertz(stiffness / 0.5 * expected)[:50], relative=1e-9)
    assert any(f"{6 * count} directions have no stiffness" in text for text in found.warnings)


def test_free_line():
    """One line with its mass at two free ends: ω² = 2k/m, and five motions without strain."""
    web = inline([[0, 0, 0], [0.3, 0.4, 1.2]], [[0, 1]])
    scene = refweb.Scene(web=web, cable=cable(density=500.0), supports=refweb.Supports(nodes=[]), effects=[NOTHING])
    found = refweb.modes(scene)
    assert_within(found, hertz([2.0 * EA / 1.3 / (500.0 * 1e-4 * 1.3 / 2.0)]), relative=1e-12)
    assert found.spectra[0].zero == 5


def test_compressed_bars_are_unstable():
    """Two bars pressed by T between fixed ends: across them ω² = −2T/(a m), e-folds in 1/|ω|, along them 2k/m."""
    scene = refweb.Scene(
        web=inline([[0, 0, 0], [0.5, 0, 0], [1, 0, 0]], [[0, 1], [1, 2]], supports=[0, 2]),
        cable=cable(law="linear", prestrain=-STRAIN),
        effects=[refweb.PointMass(node=1, mass=0.25)],
    )
    found = refweb.modes(scene)
    slow, fast = hertz([2.0 * TENSION / (0.5 * 0.25), 2.0 * EA * (1.0 - STRAIN) / (0.5 * 0.25)])
    expected = np.array([-slow, -slow, fast])
    assert (abs(found.frequency - expected) <= found.error + CLOSED * abs(expected)).all()
    assert (found.error <= 1e-9 * abs(expected)).all()
    here = found.spectra[0]
    assert here.unstable == 2 and here.zero == 0 and (here.squared[:2] < 0.0).all()
    assert any("2 modes have ω² < 0" in text for text in found.warnings)
    assert found.solver["smallest_pivot"] == -1
    assert refweb.modes(scene, 1).frequency == pytest.approx([-slow])


def test_compressed_lattice_is_unstable_in_all_its_modes_across():
    """225 unstable modes, the fastest p = q = 15 with ω² = −(8|T|/ma) sin²(15π/32), then double ones."""
    found, _, z = lattice(16, 8, strain=-STRAIN, law="linear")
    expected = -hertz(-z)[::-1][:8]
    assert found.spectra[0].unstable == z.size
    assert (abs(found.frequency - expected) <= found.error - CLOSED * expected).all()


def massless(density=0.0, prestrain=STRAIN, **more):
    """A mass in the middle of a string of eight elements."""
    return refweb.Scene(
        web=refweb.SingleCable(start=(0, 0, 0), end=(2, 0, 0), elements=8),
        cable=cable(prestrain=prestrain, density=density, **more),
        effects=[refweb.PointMass(node="centre", mass=0.5)],
    )


@pytest.mark.parametrize("options", [{}, dict(order=3), dict(subdivide=20), dict(order=2, subdivide=2)])
def test_nodes_without_mass_follow(options):
    """ω² = 4T/(ml) across and 4EA/(mL) along: three modes in all, however many nodes have no mass."""
    found = refweb.modes(massless(**options))
    length = 2.0 / (1.0 + STRAIN)
    assert_within(found, hertz([4.0 * TENSION / (0.5 * 2.0)] * 2 + [4.0 * EA / (0.5 * length)]))
    triangle = 1.0 - abs(found.state.system.net.points[:, 0] - 1.0)
    np.testing.assert_allclose(np.linalg.norm(found.shapes[:2], axis=2), [triangle, triangle], atol=1e-9)


def test_nearly_massless_nodes_follow_as_well():
    """Lines of 1e-9 of the mass: the same frequencies but for half of that, and no direction counts as stiff as EA."""
    light = refweb.modes(massless(density=1e-9 * 0.5 / (1e-4 * 2.0)), 2)
    np.testing.assert_allclose(light.frequency, refweb.modes(massless(), 2).frequency, rtol=1e-9)


def test_neither_mass_nor_stiffness():
    with pytest.raises(refweb.SolverError, match="of 18 unknowns without mass some have no stiffness either, such as"):
        refweb.modes(massless(prestrain=0.0))
    scene = massless().replace(effects=())
    with pytest.raises(refweb.SolverError, match="no free node has mass"):
        refweb.modes(scene)
    scene = massless(prestrain=-STRAIN, density=100.0)
    with pytest.raises(refweb.SolverError, match="none of the 21 unknowns that have mass has stiffness"):
        refweb.modes(scene)


def test_slack_nodes_are_counted_and_left_out():
    """A slack line between two nodes of a taut string: the nodes in it have a mass that nothing moves."""
    taut = np.column_stack([np.linspace(0, 1, 5), np.zeros(5), np.zeros(5)])
    web = inline(
        np.vstack([taut, [[0.4, 0, -0.1], [0.6, 0, -0.1]]]),
        [[0, 1], [1, 2], [2, 3], [3, 4], [1, 5], [5, 6], [6, 3]],
        natural_length=[0.25 / (1 + STRAIN)] * 4 + [0.3] * 3,
        supports=[0, 4],
    )
    scene = refweb.Scene(web=web, cable=cable(), effects=[refweb.PointMass(node=[1, 2, 3, 5, 6], mass=0.1)])
    found = refweb.modes(scene)
    assert found.spectra[0].zero == 6
    assert [text.split(":")[0].split(",")[0] for text in found.warnings] == [
        "6 directions have no stiffness",
        "2 nodes hang on slack lines only",
    ]
    s = np.sin(np.pi * np.arange(1, 4) / 8) ** 2
    squared = [4 * TENSION / (0.1 * 0.25) * s] * 2 + [4 * EA * (1 + STRAIN) / (0.1 * 0.25) * s]
    assert_within(found, hertz(squared))
    assert not found.shapes[:, 5:].any()


def test_line_at_the_kink_is_told():
    """Lines at exactly their natural length pull but do not push: no vibration along them is linear."""
    found = refweb.modes(massless(prestrain=0.0, density=100.0))
    assert any("8 elements are between slack and taut" in text for text in found.warnings)
    assert found.spectra[0].zero == 14


def test_modes_that_are_not_found_are_missed(monkeypatch):
    """The count of eigenvalues notices pairs that the iteration passes over."""
    whole = pencil.eigsh

    def careless(matrix, size, *more, **options):
        squared, vectors = whole(matrix, size + 1, *more, **options)
        keep = np.argsort(squared)[np.arange(size + 1) != 1]
        return squared[keep], vectors[:, keep]

    monkeypatch.setattr(pencil, "eigsh", careless)
    with pytest.raises(refweb.SolverError, match="some modes are not found"):
        lattice(16, 6)


# Equilibria.


def small(**changes):
    return refweb.Scene(
        web=refweb.Window(mesh="triangle", rows=5, columns=4, side=0.2),
        cable=cable(law="smooth", smoothing=1e-5, density=200.0),
        effects=[refweb.Load(node="centre", force=(0, 0, 2.0))],
        **changes,
    )


@pytest.mark.parametrize("size", [1e-10, 1e-8])
def test_error_of_the_equilibrium_is_in_the_error(size):
    """Off the equilibrium by 1e-8 m frequencies are off by no more than their ±, to first order, nor by much less."""
    exact = refweb.modes(small(), 6)
    off = exact.state.x.copy()
    free = exact.state.system.free
    off.ravel()[free] += size * np.random.default_rng(5).uniform(-1.0, 1.0, len(free))
    here = spectrum(exact.state.system, 1.0, off, 6)
    change = abs(here.frequency - exact.frequency)
    assert (change <= 1.01 * here.error + exact.error).all()
    assert change.max() > 100.0 * exact.error.max() and change.max() > 0.5 * here.error.max()


def test_every_load_step_and_the_start_of_dynamics():
    """A dynamic scene vibrates about the equilibrium at t = 0, where a ball that flies is held."""
    found = refweb.modes(small(solve=refweb.Static(load_steps=[0.5, 1])), 3)
    assert [here.step for here in found.spectra] == [0.5, 1.0]
    assert found.history["step"].tolist() == [0.5] * 3 + [1.0] * 3
    assert found.history["frequency"][3:].tolist() == found.frequency.tolist()
    assert (found.spectra[0].frequency < found.frequency).all()
    ball = refweb.Body(name="ball", radius=0.1, mass=1.0, position=(0, 0, -0.5), velocity=(0, 0, 1))
    still = small(solve=refweb.Dynamic(duration=1.0))
    moving = still.replace(effects=(*still.effects, ball, refweb.Contact(stiffness=1e5)))
    for scene in (still, moving):
        dynamic = refweb.modes(scene, 3)
        assert (abs(dynamic.frequency - found.frequency) <= dynamic.error + found.error).all()
        assert dynamic.spectra[0].step == 0.0
    assert any("are held, and the web does not feel them: ball" in text for text in dynamic.warnings)


def test_wrong_input(monkeypatch):
    for number, limit in [(0, "must be ≥ 1"), (1001, "must be ≤ 1000"), (2.5, "must be a whole number")]:
        with pytest.raises(refweb.InputError, match=f"number = {number} {limit}"):
            refweb.modes(small(), number)
    held = small(supports=refweb.Supports(nodes="all"))
    with pytest.raises(refweb.InputError, match="no node is free"):
        refweb.modes(held)
    linked = refweb.Dynamic(duration=1.0, method="ida")
    with pytest.raises(refweb.InputError, match=r"\[\[link\]\]: modes cannot hold lengths"):
        refweb.modes(small(solve=linked).replace(effects=[refweb.Link(nodes=[0, 1])]))
    monkeypatch.setattr("refweb.studies.modes.at_rest", _follower)
    with pytest.raises(refweb.InputError, match="elasticity has no potential"):
        refweb.modes(small())


def _follower(system):
    lines = system.terms[0]
    system.terms[0] = replace(lines, tangent=lines.tangent._replace(symmetric=False))
    return system


# Folders and the command line.


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder to work in, with one scene file beside it."""
    (tmp_path / "web.toml").write_text(SCENE, encoding="utf-8")
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path / "work")
    return tmp_path / "work"


@pytest.mark.parametrize("order", [1, 3])
def test_frames_are_shapes_on_the_equilibrium(tmp_path, order):
    scene = small()
    found = refweb.modes(scene.replace(cable=cable(law="smooth", smoothing=1e-5, density=200.0, order=order)), 2)
    found.save(tmp_path / "out")
    net = found.state.system.net
    for number, shape in enumerate(found.shapes, start=1):
        mesh = meshio.read(tmp_path / "out" / "frames" / f"web_00000{number}.vtu")
        own = slice(0, len(net.web.points))
        np.testing.assert_array_equal(mesh.point_data["shape"][own], shape[own])
        np.testing.assert_allclose((mesh.points - mesh.point_data["displacement"])[own], net.web.points, atol=1e-15)
        moved = mesh.points[own] - found.positions[own]
        diagonal = np.linalg.norm(np.ptp(found.positions, axis=0))
        np.testing.assert_allclose(moved, 0.05 * diagonal * shape[own], atol=1e-14)
        np.testing.assert_array_equal(mesh.cell_data["tension"][0], found.state.element_tension)
    listed = (tmp_path / "out" / "web.pvd").read_text()
    assert 'timestep="1.0"' in listed and 'timestep="2.0"' in listed and "web_000002.vtu" in listed


@pytest.mark.slow
def test_command(folder, capsys):
    assert main(["modes", "../web.toml", "-n", "4"]) == 0
    out = capsys.readouterr().out
    assert "Small web, modes: solved" in out and "modes in small-web-modes" in out and "frequency" in out
    frames = [f"small-web-modes/frames/web_00000{i}.vtu" for i in range(1, 5)]
    rest = ["checkpoint.npz", *("modes.csv", "run.json", "scene.toml", "web.pvd")]
    assert files(folder) == sorted([*frames, *(f"small-web-modes/{name}" for name in rest)])
    run = json.loads((folder / "small-web-modes" / "run.json").read_text())
    assert run["kind"] == "modes" and run["status"] == "solved" and [s["step"] for s in run["steps"]] == [1, 2, 3]
    assert run["results"]["frequency_1"]["error"] > 0.0 and run["results"]["frequency_1"]["unit"] == "Hz"
    table = np.loadtxt(folder / "small-web-modes" / "modes.csv", delimiter=",", skiprows=1)
    assert table.shape == (12, 12) and table[8, 2] == run["results"]["frequency_1"]["value"]
    assert main(["info", "small-web-modes"]) == 0
    assert "Small web, modes: solved" in capsys.readouterr().out
    assert main(["picture", "small-web-modes", "--frame", "2", "--field", "shape"]) == 0
    assert (folder / "small-web-modes" / "web.png").stat().st_size > 10_000
    assert main(["modes", "../web.toml"]) == 2
    assert "is not empty" in capsys.readouterr().err
    (folder / "small-web-modes" / "mine.txt").write_text("mine")
    assert main(["modes", "../web.toml", "-n", "1", "--force"]) == 0
    kept = [frames[0], *(f"small-web-modes/{name}" for name in (*rest, "mine.txt"))]
    assert files(folder) == sorted(kept)
    capsys.readouterr()
    assert main(["run", "../web.toml", "--out", "small-web-modes", "--force"]) == 0
    assert "small-web-modes/modes.csv" not in files(folder)


def test_command_that_fails(folder, capsys):
    assert main(["modes", "../web.toml", "-n", "0"]) == 2
    refused(capsys, "number = 0 must be ≥ 1")
    free = SCENE.replace("[solve]", "[supports]\nnodes = []\n\n[solve]")
    (folder.parent / "free.toml").write_text(free, encoding="utf-8")
    assert main(["modes", "../free.toml", "--out", "out"]) == 1
    err = capsys.readouterr().err
    assert err.startswith("refweb: no equilibrium: ") and err.count("\n") == 1
    run = json.loads((folder / "out" / "run.json").read_text())
    assert run["status"] == "failed" and run["message"] in err and run["steps"] == []
    assert main(["info", "out"]) == 0 and "carried off" in capsys.readouterr().out
