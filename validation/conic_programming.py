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

from . import Case, Figure, Row, plots

WEBS = ("triangle", "square", "hexagon")
LOAD = 5.0


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
    cones = scipy.sparse.block_array([[None, extension], [difference, None]], format="csr")[order]
    first = scipy.sparse.hstack([scipy.sparse.csc_array((count, unknowns)), extension])
    vector = net.web.points[lines[:, 1]] - net.web.points[lines[:, 0]]
    A = -scipy.sparse.vstack([first, cones], format="csc")
    b = np.concatenate([np.zeros(count), np.concatenate([natural, vector.ravel()])[order]])
    P = scipy.sparse.diags_array(np.concatenate([np.zeros(unknowns), stiffness]), format="csc")
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
    return answer.obj_val, gap, stiffness * found[unknowns:], found[3 * column[centre] + 2]


def case(quick):
    rows, found = [], {}
    for web in ("square",) if quick else WEBS:
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
                f"{name}: deflection", solution.results["deflection"].value, deflection, "conic solver", 1e-6,
                "its feasibility of 1e-10 of lengths, over strains of 1e-4", "m",
            ),
        ]  # fmt: skip
        found[web] = solution.tension, tension, bound

    def drawn():
        page, plot = plots.axes("tension by the conic solver [N]", "difference of refweb [N]")
        for web, (own, other, bound) in found.items():
            order = np.argsort(other)
            plot.loglog(other[order], np.maximum(np.abs(own - other)[order], 1e-17), ".", markersize=3, label=web)
            plot.loglog(other[order], bound[order], "--", linewidth=0.8)
        plot.set_xlim(left=1e-9)
        plot.legend(frameon=False)
        return page

    caption = "Differences of the tensions of all lines (dots), and the bound that both solvers prove (dashed)."
    return Case(rows=rows, figures=[Figure(caption, drawn)])
