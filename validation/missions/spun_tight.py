"""Which web can be spun tight.

A web that spins about its middle is pulled tight by masses at its corners. G. Tibert and M. Gärdsback (Space webs, ESA
Ariadna study 05/4109, 2006) say that only square meshes can be prestressed so: lines of triangular meshes are
compressed, and hexagonal meshes distort. Here are webs of the three meshes, of 0.01 m² a mesh, the nodes of whose
middle mesh are held in axes that turn once a second, with 4, 3 and 6 masses of 0.5 kg at their corners, in equilibrium:
by the linear law, whose lines push, and by the tension-only law; ``refweb run spun-tight`` is the square one.

What lies beyond a straight cut is held by the lines across it alone: their tensions carry its centrifugal force along
the normal of the cut, Σ m Ω² x.
"""

import numpy as np

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row, Table, Verdict

RATE, MASS = 2.0 * np.pi, 0.5
MESHES = {"square": 4, "triangle": 3, "hexagon": 6}
"""Shape of the meshes, and how many masses at corners there are."""


def spun(mesh, layers, law):
    """(Scene, held nodes) of a web, its middle in the axis."""
    web = refweb.Layers(mesh=mesh, layers=layers, cell_area=0.01).web()
    count = MESHES[mesh]
    corners = web.corners
    if mesh == "hexagon":  # of two in each corner the first
        angle = np.arctan2(*web.points[corners, 1::-1].T)
        corners = corners[np.argsort(angle)][::2]
    middle = web.points[corners].mean(axis=0) if mesh == "triangle" else np.zeros(3)
    held = np.argsort(np.linalg.norm(web.points - middle, axis=1).round(9), kind="stable")[:count]
    return refweb.Scene(
        title=f"{mesh.capitalize()} web spun tight",
        web=refweb.Inline(points=(web.points - middle).tolist(), lines=web.lines.tolist()),
        cable=refweb.Cable(law=law, modulus=7e7, area=1e-4, density=200.0),
        supports=refweb.Supports(nodes=held.tolist()),
        effects=[
            refweb.PointMass(node=corners.tolist(), mass=MASS),
            refweb.Frame(angular_velocity=(0.0, 0.0, RATE)),
        ],
        solve=refweb.Static(),
        observe=[
            refweb.Observe(name="max_tension", quantity="tension", reduce="max"),
            refweb.Observe(name="distortion", quantity="displacement", reduce="max"),
        ],
    ), held


def across(solution, held):
    """(Tension, centrifugal force) along x across a cut beside what is held [N]."""
    net, x = solution.state.system.net, solution.positions
    right = x[:, 0] > x[held, 0].max() + 1e-3
    i, j = net.cells[right[net.cells].sum(axis=1) == 1].T
    cut = right[net.cells].sum(axis=1) == 1
    d = x[j] - x[i]
    return solution.tension[cut] @ (np.abs(d[:, 0]) / np.linalg.norm(d, axis=1)), net.mass[right] @ x[
        right, 0
    ] * RATE**2


def case(quick):
    sizes = dict.fromkeys(MESHES, 3) if quick else {"square": 6, "triangle": 5, "hexagon": 5}
    rows, told, shares, taut = [], [], {}, {}
    for mesh, layers in sizes.items():
        for law in ("linear", "tension-only"):
            scene, held = spun(mesh, layers, law)
            solution = refweb.run(scene)
            taut[mesh] = solution
            net = solution.state.system.net
            outer = solution.tension[~np.isin(net.cells, held).all(axis=1)]  # lines between held nodes do nothing
            pushed, slack = (outer < -1e-9 * outer.max()).mean(), (np.abs(outer) <= 1e-9 * outer.max()).mean()
            size = np.ptp(net.points, axis=0).max()
            shares[mesh, law] = pushed, slack, solution.results["distortion"].value / size
            pull, force = across(solution, held)
            name = f"{mesh}, {law}: tension across a cut"
            rows.append(Row(name, pull, force, "Σ m Ω² x of what is beyond it", 1e-9, "residual 1e-10", "N"))
            moved, ends = solution.results["distortion"], f"{outer.min():.2f} … {outer.max():.2f}"
            far = f"{1e3 * moved.value:.3f} ± {1e3 * moved.error:.0e}", f"{shares[mesh, law][2]:.2%}"
            told.append([mesh, law, ends, f"{pushed:.0%}", f"{slack:.0%}", *far])
    table = Table(
        "Webs that spin once a second",
        ["mesh", "law", "tension [N]", "lines that push", "slack lines", "distortion [mm]", "of the size"],
        told,
    )
    square, triangle, hexagon = (shares[mesh, "linear"] for mesh in MESHES)
    verdicts = [
        Verdict(
            "Square meshes can be prestressed by spinning.",
            "holds",
            f"no line is slack, and no node moves by more than {square[2]:.2%} of the size of the web",
            square[:2] == (0.0, 0.0) and square[2] < 0.01,
        ),
        Verdict(
            "Triangular meshes get compressed lines.",
            "holds",
            f"{triangle[0]:.0%} of the lines push by the linear law; by the tension-only law "
            f"{shares['triangle', 'tension-only'][1]:.0%} are slack",
            triangle[0] > 0.05 and shares["triangle", "tension-only"][1] > 0.05,
        ),
        Verdict(
            "Hexagonal meshes distort.",
            "holds",
            f"all lines are taut, and nodes move by up to {hexagon[2]:.1%} of the size, {hexagon[2] / square[2]:.0f} "
            "times as far as those of the square web",
            hexagon[0] == 0.0 and hexagon[2] > 10.0 * square[2],
        ),
    ]
    caption = "The {} web by the tension-only law: tension, slack lines in grey."
    figures = [
        Figure(caption.format(mesh), lambda one=one: plots.picture(one, "tension")) for mesh, one in taut.items()
    ]
    return Case(rows=rows, verdicts=verdicts, figures=figures, tables=[table])
