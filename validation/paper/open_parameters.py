"""What the paper leaves open, and the frequencies of its three webs.

*Dynamic modelling and analysis of space webs* does not state all that its figures depend on. The table lists what it
leaves open, the value chosen here, and what depends on it, with the case that shows it.

The conclusions rest on a fundamental frequency and a damping that no figure shows. A flat web without tension has
neither: frequencies are those of small vibrations about the web under a load at its centre, and their scale is the
load's. For small slopes they grow with its cube root, as the stress grows with the load's power 2/3.

Damping of a mode φ of the frequency f, as the logarithmic decrement by which it decays from swing to swing:

    drag −r m v:                    δ = r/(2 f)
    Kelvin–Voigt, σ + τ E ε̇:        δ = 2 π² τ f s,      s = Σ (EA/L) (t·Δφ)² / φᵀKφ

where s is the share of the stiffness that stretches lines (Δφ the difference of the shape along a line in direction t);
the rest is that of the tension, and is not damped.
"""

import numpy as np

from ..harness import plots
from ..harness.case import Case, Figure, Row, Table, Verdict, slope
from .fundamental_frequencies import modes_of
from .three_webs import COLOUR, MARK, WEBS

OPEN = (
    (
        "ε0 and η of the cable law",
        "0 and the limit 0 (tension-only)",
        "no floor under compression, convex, tensions with a proven bound",
        "much: ε0 = 1e-3 turns both static rankings ([webs](#webs_under_load)); η up to 1e-2 turns none, but "
        "pushes in slack webs ([Example 3](#example_3), [law](#cable_law))",
    ),
    (
        "length of the elements of the three webs",
        "201.4 m of cable each",
        '2014 elements of 0.1 m in Example 3, and "the same length of cable"',
        "none of the static rankings, and little else: equal areas instead ([webs](#webs_under_load))",
    ),
    (
        "E, A and ρ of the three webs",
        "70 MPa, 1e-4 m², 200 kg/m³",
        "those of Examples 1 and 3",
        "none of the static rankings, of which scales alone change ([webs](#webs_under_load)); ρ sets the share of "
        "the web's mass in an impact, as the ball's mass does",
    ),
    (
        "how the webs are held",
        "every outermost node by a link to a fixed end",
        "the figures, and the numbers of nodes and elements, which this rule gives",
        "little, and none of the static rankings: held without links ([webs](#webs_under_load))",
    ),
    (
        "load point of the hexagon web",
        "the node next to the middle",
        "a load acts on a node, and the middle of that web is none",
        "stresses, but none of the static rankings: shared by the nodes of a mesh ([webs](#webs_under_load))",
    ),
    (
        "mass and speed of the ball",
        "0.1 to 2 kg of one momentum",
        "only the momentum is stated",
        "all of figure 17: the stresses, the crossing of square and triangle web, the place of the hexagon web "
        "([impact](#webs_hit))",
    ),
    (
        "radius of the ball",
        "0.1 m",
        "one element of the triangle web",
        "the hexagon web's stress; for 0.1 kg, which web is highest ([impact](#webs_hit))",
    ),
    (
        "contact of ball and web",
        "penalty of 1e5 N/m per line, without loss or friction; sticking beside it",
        "as stiff as a line, gives way by a millimetre",
        "the hexagon web's stress; for 0.1 kg, whether it is the lowest ([impact](#webs_hit))",
    ),
    (
        "elements per line in impacts",
        "1, and 2, 4 and 8 beside it",
        'the paper has "the size equal to the mesh"',
        "stress peaks, the more the lighter the ball ([impact](#webs_hit))",
    ),
    (
        "damping C of eq. 1",
        "none",
        "not stated",
        "all that is said of damping (below); energy left in the web ([impact](#webs_hit))",
    ),
    (
        "span, gravity and torsion springs of Example 1",
        "3 m, 9.81 m/s², EI of a rod and of bundles",
        "a deep sag; the range that E and A allow",
        "whether bending can be ignored on narrow spans ([Example 1](#example_1))",
    ),
    (
        "ends, shape and place of the hit of Example 2",
        "1.6 m apart, an arc, its middle from inside",
        "a slack cable that the ring meets at right angles",
        "the shapes of figure 6, of which few digits exist ([Example 2](#example_2))",
    ),
    (
        "load and displacement of Example 3",
        "5 N, edges 50 to 100 mm in",
        "the largest load of figures 14 and 15",
        "how far the linear law is wrong ([Example 3](#example_3))",
    ),
)


def stretching(found):
    """Share of a fundamental's stiffness that stretches lines [1]."""
    here, state = found.spectra[-1], found.state
    net = state.system.net
    ends, axial = net.cells[:, :2], 7e3 / net.natural_length
    along = np.diff(state.position[ends], axis=1)[:, 0]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    strain = np.sum(along * np.diff(here.shapes[0][ends], axis=1)[:, 0], axis=1)
    taut = ~state.element_slack
    return float(np.sum((axial * strain**2)[taut]) / (here.squared[0] * here.modal_mass[0]))


def case(quick):
    counts, loads = (1, 2) if quick else (1, 2, 4), (1.0, 5.0) if quick else (1.0, 2.0, 5.0)
    found = {(mesh, 1.0, n): modes_of(mesh, 1.0, n, number=2) for mesh in WEBS for n in counts}
    found |= {(mesh, load, 1): modes_of(mesh, load, number=2) for mesh in WEBS for load in loads[1:]}
    frequency = {key: float(one.frequency[0]) for key, one in found.items()}
    error = {key: float(one.error[0]) for key, one in found.items()}
    share = {mesh: stretching(found[mesh, 1.0, counts[-1]]) for mesh in WEBS}
    rows, reason = [], "slopes of 0.1 change the next term by their square; the hexagon web shears at any slope"
    for mesh in WEBS:
        power = slope(loads, [frequency[mesh, load, 1] for load in loads])
        text = f"{mesh}: power of the load in the fundamental frequency"
        rows.append(Row(text, power, 1 / 3, "small slopes", 0.03, reason, scale=1))

    n = counts[-1]
    tri, sq, hexa = (frequency[mesh, 1.0, n] for mesh in WEBS)
    paper = [frequency[mesh, 1.0, 1] for mesh in WEBS]
    drag = {mesh: frequency["triangle", 1.0, n] / frequency[mesh, 1.0, n] for mesh in WEBS}
    viscous = {mesh: frequency[mesh, 1.0, n] * share[mesh] / (tri * share["triangle"]) for mesh in WEBS}
    columns = ["web", *(f"{k} element{'s' * (k > 1)} a line" for k in counts)]
    columns += [
        "stiffness that stretches lines [%]",
        "decrement under drag, triangle = 1",
        "Kelvin–Voigt, triangle = 1",
    ]
    table = [
        [mesh, *(f"{frequency[mesh, 1.0, k]:.4f} ± {error[mesh, 1.0, k]:.0e}" for k in counts)]
        + [f"{100 * share[mesh]:.1f}", f"{drag[mesh]:.2f}", f"{viscous[mesh]:.2f}"]
        for mesh in WEBS
    ]
    verdicts = [
        Verdict(
            '"The triangle-mesh web has high equivalent stiffness and low equivalent strength; therefore, its '
            'fundamental frequence is the highest among the three" (section 4)',
            "holds only when",
            f"the slack lines of the triangle web are free to hang loose, in several elements: {tri:.4f} Hz against "
            f"{hexa:.4f} (hexagon) and {sq:.4f} Hz (square) with {n} elements a line under 1 N. With the paper's one "
            f"element a line they burden the nodes with their mass, and it is {paper[0]:.4f} Hz, below the hexagon's "
            f"{paper[2]:.4f} Hz. It does not follow from stiffness: the hexagon web is the softest of the three, and "
            "the square web the lowest",
            tri > hexa > sq and paper[2] > paper[0] > paper[1],
        ),
        Verdict(
            '"... which leads to a good damping characteristic" (section 4, triangle web)',
            "cannot be decided",
            "the paper states no damping. Under a drag the highest frequency decays least from swing to swing: "
            f"square and hexagon web by {drag['square']:.2f} and {drag['hexagon']:.2f} times the triangle's "
            f"decrement. Under Kelvin–Voigt damping it is {viscous['square']:.2f} and {viscous['hexagon']:.2f} times, "
            f"since that damps stretching alone, which is {100 * share['triangle']:.0f}, {100 * share['square']:.0f} "
            f"and {100 * share['hexagon']:.0f} % of the stiffness of the three modes",
            drag["square"] > 1
            and drag["hexagon"] > 1
            and len({np.argmax(list(d.values())) for d in (drag, viscous)}) == 2,
        ),
    ]
    names = ["open", "chosen", "why", "what depends on it"]
    return Case(
        rows=rows,
        verdicts=verdicts,
        tables=[
            Table("What the paper leaves open", names, [list(row) for row in OPEN]),
            Table("Fundamental frequencies under 1 N [Hz], and how they are damped", columns, table),
        ],
        figures=[
            Figure(
                "Fundamental frequencies over the load, one element a line; lines grow with its cube root.",
                lambda: _drawn(loads, frequency),
            )
        ],
    )


def _drawn(loads, frequency):
    page, plot = plots.axes("load [N]", "fundamental frequency [Hz]")
    fine = np.linspace(0.8, 5.2, 50)
    for mesh in WEBS:
        plot.plot(fine, frequency[mesh, 1.0, 1] * np.cbrt(fine), color=COLOUR[mesh], linewidth=0.8)
        plot.plot(loads, [frequency[mesh, load, 1] for load in loads], MARK[mesh], color=COLOUR[mesh], label=mesh)
    plot.set_ylim(bottom=0)
    plot.legend(frameon=False)
    return page
