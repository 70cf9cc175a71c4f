"""Glossary: the words that scene files, results, messages and code share.

A new word stands here before it stands anywhere else. Each entry is a term of structural mechanics, contact mechanics,
numerical analysis or orbital mechanics, with the meaning that it has in this package.

May change: private functions, entries and meanings; ``python -m refweb help --markdown > validation/REFERENCE.md`` then
writes the reference anew. Must stay: the form of `GLOSSARY`; `explained` and `as_markdown`, which `commands.help`,
`words` and the site call. Tests: ``tests/reference/test_help.py``, ``tests/reference/test_site.py``.
"""

from __future__ import annotations

import textwrap

from ..findings import CODES

GLOSSARY = {
    "Web and lines": {
        "web": "The cable net: nodes, lines, cells, supports and groups.",
        "node": "Point where lines meet; it has three displacements.",
        "line": "Straight cable between two nodes, divided into one or more elements.",
        "element": "Finite element of a line, of order 1 to 3.",
        "cell": "Face of a web that lines enclose; in code also one item of a force term.",
        "group": "Named set of lines or of nodes.",
        "support": "Node, or component of a node, that is fixed or moves as prescribed.",
        "rim": "Supported nodes at the edge of a web.",
        "order": "Degree of the shape functions of an element; order of convergence of a method.",
        "subdivision": "Number of elements of a line.",
        "natural length": "Length of a line without tension [m].",
        "slackness": "Strain up to which a line stays without tension.",
        "smoothing": "Width η of the transition from slack to taut in the smooth cable law.",
        "prestrain": "Strain of the lines in the initial geometry.",
        "pretension": "Tension of the lines in the initial geometry [N].",
        "sag": "Depth of the middle of a hanging line below the chord between its ends.",
        "cable law": "Relation of stress and strain of a line: smooth, tension-only or linear.",
        "form finding": "Search for a shape in which given forces of the lines balance.",
        "force density": "Tension of a line over its length [N/m].",
        "axial stiffness": "Product E A of modulus and area of the section [N].",
        "slack": "Without tension; the distance of the ends is below the natural length.",
        "taut": "Under tension.",
        "utilisation": "Stress over strength.",
        "strength": "Stress at which a line breaks [Pa].",
        "margin of safety": "Strength × knot factor / (safety factor × largest stress of a line), less 1.",
        "bar": "Line of the linear law, which carries compression as well.",
        "lumped mass": "Mass of an element divided among its nodes.",
        "consistent mass": "Mass matrix of the shape functions of the elements.",
        "point mass": "Additional mass of a node [kg].",
        "folding": "Initial geometry in which the web is packed.",
    },
    "Bodies and contact": {
        "body": "Rigid body: sphere, ring, box, cylinder, capsule or closed surface.",
        "free body": "Body that moves under the forces on it.",
        "attached node": "Node that is fixed to a body and moves with it.",
        "contact": "Push of a body or a line on what has penetrated it.",
        "contact point": "Point of a line, or of a body, with the largest penetration.",
        "penetration": "Depth δ of a contact [m]; the observable is called overlap.",
        "contact stiffness": "Factor k of the force k δ^p of a contact [N/m^p].",
        "penalty": "Contact force that follows from penetration and contact stiffness.",
        "contact damping": "Share of the contact force that grows with the rate of penetration.",
        "friction coefficient": "Ratio μ of the friction force to the normal force while sliding.",
        "slip": "Tangential velocity of two surfaces in contact [m/s].",
        "slip velocity": "Velocity below which regularised friction grows linearly [m/s].",
        "self-contact": "Contact of lines with lines.",
        "core": "Middle of a body, which no line may reach.",
        "continuous collision detection": "Search for a penetration within a step, between its ends; short: ccd.",
        "certified": "Proven: no line has passed through a line or a body in the run.",
        "neighbour list": "Pairs that are close enough to touch within some steps.",
        "implicit contacts": "Contacts with losses, solved for within a kick by Gauss–Seidel sweeps.",
        "Delassus matrix": "Change of relative velocities at contacts by unit impulses there.",
        "Gauss–Seidel sweep": "One pass over all contacts, each solved with the latest forces of the others.",
        "warm start": "Start of an iteration from the forces of the step before.",
        "Hertzian contact": "Contact force with the exponent p = 3/2.",
        "skeleton": "Points, segments and arcs that, with a thickness, represent a body against another.",
        "moment of inertia": "Resistance of a body to angular acceleration [kg m²].",
        "quaternion": "Four numbers that represent a rotation.",
    },
    "Loads and effects": {
        "effect": "Table of a scene that adds forces, masses, motions or bodies.",
        "force term": "Forces of one kind on one set of cells, with energy, tangent and bounds.",
        "dead load": "Force that keeps its direction and size.",
        "follower load": "Force that turns with the web: pressure, thrust.",
        "pressure": "Force per area along the normal of cells [Pa].",
        "thrust": "Force of a thruster along a line or axis [N].",
        "drag": "Force of a fluid, quadratic in the relative velocity.",
        "reel": "Device that changes the natural length of lines over time.",
        "link": "Rigid bar between two nodes, an algebraic constraint.",
        "thread": "Line that slides through several nodes, with one tension unless there is friction at them.",
        "winch": "Device at an end of a thread or line that hauls it in and pays it out: at a speed, tension or power.",
        "brake": "Winch that stands still up to a tension, from which on it pays out.",
        "ring": "Node over which a thread slides.",
        "slip of a thread": "Length of it that has gone over a ring [m].",
        "rupture": "Break of a line at its strength, or at a given time.",
        "rotating frame": "Axes that turn at a constant angular velocity; adds centrifugal and Coriolis forces.",
        "centrifugal force": "Inertia force m ω²r away from the axis of a rotating frame [N].",
        "Coriolis force": "Inertia force 2 m v × ω in a rotating frame [N].",
        "mean motion": "Angular velocity of a circular orbit [rad/s].",
        "gravity gradient": "Change of the pull of a planet over the size of the web.",
        "bending stiffness": "Moment between lines that continue each other, over their curvature [N m²].",
        "clamp": "Node at which lines keep their direction in space.",
        "Rayleigh damping": "Forces proportional to velocity, by mass and by stiffness.",
        "Kelvin–Voigt damping": "Stress proportional to the rate of strain.",
        "plastic strain": "Elongation over natural length that a line keeps when it has yielded.",
        "Maxwell arm": "Spring and dashpot in series beside a line; its tension fades while the line is held.",
    },
    "Statics": {
        "equilibrium": "State in which forces on all free nodes sum to zero.",
        "residual": "Largest unbalanced force over the largest force.",
        "tangent stiffness": "Matrix K = −∂f/∂x of a system [N/m].",
        "Newton's method": "Iteration with the tangent stiffness at the last state.",
        "load step": "Factor of the loads at which an equilibrium is sought.",
        "dynamic relaxation": "Search for an equilibrium by damped motion with artificial masses.",
        "duality gap": "Upper bound of the energy above its minimum, from a dual problem [J].",
        "proven bound": "± that contains the exact value of the model for certain.",
        "floating part": "Part of a web whose position the equilibrium leaves open.",
        "singular tangent": "Tangent stiffness with directions of zero stiffness.",
        "saddle": "Equilibrium with a direction of negative stiffness.",
        "stability": "Whether small disturbances of an equilibrium stay small.",
        "flutter": "Instability by growing vibration under follower loads or flow.",
        "snap-through": "Jump from one equilibrium to a distant one.",
        "interior-point method": "Solver of convex problems with inequality constraints.",
        "conjugate gradients": "Iterative solver of symmetric linear systems.",
        "factorization": "Decomposition of a matrix into triangular factors.",
        "pivot": "Diagonal entry of a factorization; the signs count negative eigenvalues.",
    },
    "Dynamics": {
        "explicit method": "Method whose step needs no solution of equations: central differences, splittings.",
        "central differences": "Explicit method of order 2, also called leapfrog or Störmer–Verlet.",
        "splitting": "Composition of kicks (velocities) and drifts (positions), of order 2, 4 or 6.",
        "kick": "Change of velocities by forces at fixed positions.",
        "drift": "Change of positions at fixed velocities.",
        "critical time step": "Largest stable step 2/ω of an explicit method [s].",
        "safety": "Step size as a fraction of the critical time step.",
        "CVODE": "Solver of SUNDIALS for ordinary differential equations (Adams, BDF).",
        "IDA": "Solver of SUNDIALS for differential-algebraic equations (BDF).",
        "integrator": "Method that advances a system in time.",
        "integrator state": "Time, displacements, velocities and balances of a run.",
        "dense output": "State between the ends of a step, by an interpolant.",
        "monitor": "Object that inspects each step: extremes, events, averages, balances.",
        "probe": "Compiled function of a state whose extremes are followed.",
        "extreme": "Largest or smallest value over all steps and between them.",
        "event": "Time of a first contact, of a line becoming taut, of a threshold, or of rest.",
        "energy balance": "Energies plus losses minus work; a run that does not close it is not returned.",
        "energy drift": "Error of the energy balance over the largest energy.",
        "momentum balance": "Momentum minus impulses of loads and supports.",
        "work": "Energy that loads, motions and reels have given [J].",
        "impulse": "Integral of a force over time [N s].",
        "step refinement": "Second run with other steps or a tighter tolerance that yields ±; short: twin.",
        "breakpoint": "Time at which a table over time has a corner; steps end there.",
        "row": "Line of the history, one each output interval.",
        "frame": "State that is written as VTU files; also the axes of `[frame]`.",
        "horizon": "Time up to which a chaotic motion is determined [s].",
        "Lyapunov exponent": "Rate at which neighbouring motions separate [1/s].",
    },
    "Results and studies": {
        "observable": "Quantity that a scene asks for by `[[observe]]`.",
        "result": "Value of an observable, with ±, time and position.",
        "±": "Error of a result; its kind says what it covers.",
        "undecided": "Neither true nor false: the limit lies within ± of what is compared with it.",
        "error budget": "Parts of the error of a result: time steps, elements, contact, smoothing, chance, rounding.",
        "verdict": "Worth of a result: determined, wide, statistical, depends on the model, no limit.",
        "determined": "Verdict: all parts of the error are known, and ± is at most a tenth of the value.",
        "wide": "Verdict: ± is above a tenth of the value, most of it by time steps.",
        "statistical": "Verdict: the motion is chaotic; runs have a mean and a spread, and no run has more.",
        "depends on the model": "Verdict: most of ± is that of elements, stiffness of contact or smoothing.",
        "no limit": "Verdict: the number changes with every finer mesh, as the first touch of a rigid body does.",
        "chance": "Part of the error of a chaotic motion: what runs from starts side by side differ by.",
        "trust": "`refweb trust`: further runs of a scene that find all parts of the error of each result.",
        "discretisation error": "Change of a result when every line gets more elements.",
        "work–precision diagram": "Error over CPU time for several methods on one scene.",
        "history": "Values of all columns at every row, in `history.csv`.",
        "summary": "Text of a run: scene, results, solver, cost, warnings.",
        "mode": "Natural vibration about an equilibrium: frequency and shape.",
        "modal mass": "Mass of a mode when its largest displacement is 1 [kg].",
        "critical speed": "Angular velocity at which centrifugal forces exceed the stiffness [rad/s].",
        "study": "Runs of one scene over values that vary; also called sweep.",
        "case": "One run of a study.",
        "sizing": "Search for the design of the least mass, or least of another number, that meets requirements.",
        "reserve": "Distance of a result to the limit of a requirement, over the limit.",
        "ensemble": "Runs with small random changes of the initial state.",
        "confidence interval": "Range that contains a probability with stated confidence, by Clopper and Pearson.",
        "Sobol index": "Share of the variance of a result that one input explains: first-order or total-effect.",
        "machine code": "Compiled kernels, kept in the user's cache folder.",
        "kernel": "Function compiled by numba.",
    },
    "Codes of findings": CODES,
}
"""Terms with their meanings, by subject; codes are those of ``findings`` in ``run.json``."""


def explained(name):
    """The whole glossary for the name "glossary", the meaning of a term for its name, None for any other name."""
    if name == "glossary":
        return "\n\n".join(map(_section, GLOSSARY))
    terms = {term.lower(): (term, meaning) for entries in GLOSSARY.values() for term, meaning in entries.items()}
    if name.lower() not in terms:
        return None
    term, meaning = terms[name.lower()]
    return f"{term}: {meaning}"


def _section(subject):
    wrap: dict = {"width": 100, "initial_indent": "  ", "subsequent_indent": "      "}
    return "\n".join([subject, *(textwrap.fill(f"{term}: {text}", **wrap) for term, text in GLOSSARY[subject].items())])


def as_markdown():
    """The glossary as Markdown."""
    parts = ["## Glossary"]
    for subject, entries in GLOSSARY.items():
        rows = [f"| {term} | {meaning.replace('|', chr(92) + '|')} |" for term, meaning in entries.items()]
        parts += [f"### {subject}", "\n".join(["| term | meaning |", "| --- | --- |", *rows])]
    return "\n\n".join(parts)
