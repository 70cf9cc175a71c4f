"""The three webs by conic programming.

For a cable that takes no compression the energy is convex in the positions, and the equilibrium of the paper's three
webs under 5 N is a second-order cone program: minimise

    Σ ½ k z² − F u,    |x_j − x_i| ≤ L + z,    z ≥ 0,    k = EA/L

over displacements u and extensions z. Clarabel (P. J. Goulart and Y. Chen 2024, arXiv:2405.12762), an interior-point
solver that knows nothing of cables, solves it. Its own duality gap bounds the error of its tensions by √(2 k gap), and
refweb's bounds those of refweb in the same way: the two answers have to lie within the sum of both.
"""

import clarabel
import numpy as np
import scipy.sparse

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row

WEBS = ("triangle", "square", "hexagon")
LOAD = 5.0
UNIT = 1e-2
"""Unit of the extensions in the program [m]; strains are of 1e-4, and the solver wants numbers of one size."""


def conic(solution):
    """(energy [J], its gap [J], tension [N], deflection [m]) by the conic solver."""
    system = solution.state.system
    net, centre = system.net, system.net.find("centre")[0]
    lines, nodes = net.web.lines, len(net.web.points)
    natural, free = net.web.natural_length, np.setdiff1d(np.arange(nodes), net.web.rim)
    stiffness = solution.scene.cable.modulus * solution.scene.cable.area / natural
    count, row, one = len(lines), np.arange(len(lines)), np.ones(len(lines))
    column = np.full(nodes, -1)
    column[free] = np.arange(len(free))
    incidence = scipy.sparse.coo_array(
        (np.concatenate([-one, one]), (np.tile(row, 2), lines.T.ravel())), (count, nodes)
    ).tocsc()[:, free]
    difference = scipy.sparse.kron(incidence, scipy.sparse.eye_array(3), format="csc")
    extension, unknowns = scipy.sparse.eye_array(count, format="csc"), 3 * len(free)
    # Rows of the cone of each line: L + z, then its vector; before all of them z ≥ 0.
    order = np.argsort(np.concatenate([4 * row, (4 * row[:, None] + [1, 2, 3]).ravel()]))
    cones = scipy.sparse.block_array([[None, UNIT * extension], [difference, None]], format="csr")[order]
    first = scipy.sparse.hstack([scipy.sparse.csc_array((count, unknowns)), extension])
    place = net.web.points.copy()
    place[net.web.rim] = solution.positions[net.web.rim]
    vector = place[lines[:, 1]] - place[lines[:, 0]]
    A = -scipy.sparse.vstack([first, cones], format="csc")
    b = np.concatenate([np.zeros(count), np.concatenate([natural, vector.ravel()])[order]])
    P = scipy.sparse.diags_array(np.concatenate([np.zeros(unknowns), UNIT**2 * stiffness]), format="csc")
    q = np.zeros(unknowns + count)
    q[3 * column[centre] + 2] = -LOAD
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-12
    kinds = [clarabel.NonnegativeConeT(count), *[clarabel.SecondOrderConeT(4)] * count]
    matrices = (scipy.sparse.csc_matrix(P), q, scipy.sparse.csc_matrix(A), b)
    answer = clarabel.DefaultSolver(*matrices, kinds, settings).solve()
    found = np.array(answer.x)
    # It stops where rounding lets it gain no more, with constraints kept to some 1e-10: so much of the energy is added.
    gap = abs(answer.obj_val - answer.obj_val_dual) + 1e-10 * abs(answer.obj_val)
    return answer.obj_val, gap, UNIT * stiffness * found[unknowns:], found[3 * column[centre] + 2]


def case(quick):
    rows, found = [], {}
    for web in WEBS[:2] if quick else WEBS:
        scene = refweb.Scene.load(f"{web}-load")
        solution = refweb.run(scene.replace(solve=refweb.Static(load_steps=[LOAD])))
        energy, gap, tension, deflection = conic(solution)
        own = solution.solver["duality_gap"]
        state = solution.state
        potential = state.energies["strain_energy"] - LOAD * state.x[state.system.net.find("centre")[0], 2]
        stiffness = scene.cable.modulus * scene.cable.area / state.system.net.web.natural_length
        bound = np.sqrt(2 * stiffness * gap) + np.sqrt(2 * stiffness * own)
        worst = np.abs(solution.tension - tension)
        name, reason = f"{web} web", "sum of both proven bounds"
        rows += [
            Row(f"{name}: potential", potential, energy, "conic solver", (gap + own) / abs(energy), reason, "J"),
            Row(
                f"{name}: largest difference of a tension over its bound", (worst / bound).max(), 0.0, "conic solver",
                1.0, reason, scale=1,
            ),
            Row(
                f"{name}: largest tension", solution.tension.max(), tension.max(), "conic solver",
                bound.max() / tension.max(), reason, "N", solution.results["max_stress"].error * scene.cable.area,
            ),
            Row(
                f"{name}: deflection", solution.results["deflection"].value, deflection, "conic solver",
                np.sqrt(2 * (gap + own) / (LOAD * deflection)), "both gaps ½ K δ², with a stiffness K above F/w", "m",
            ),
        ]  # fmt: skip
        found[web] = solution.tension, tension, bound

    def drawn():
        page, plot = plots.axes("tension by the conic solver [N]", "difference of refweb [N]")
        for colour, (web, (own, other, bound)) in zip(plots.COLOURS, found.items(), strict=False):
            taut = own > 0
            plot.loglog(other[taut], np.abs(own - other)[taut], ".", color=colour, markersize=3, label=web)
            order = np.argsort(other[taut])
            plot.loglog(other[taut][order], bound[taut][order], "--", color=colour, linewidth=0.9)
        plot.legend(frameon=False)
        return page

    caption = "Differences of the tensions of all taut lines (dots), and the bound that both solvers prove (dashed)."
    return Case(rows=rows, figures=[Figure(caption, drawn)])
