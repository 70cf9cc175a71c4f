"""Which of the paper's three webs has the highest fundamental frequency?

    python -m validation.paper.fundamental_frequencies

"The triangle-mesh web has high equivalent stiffness and low equivalent strength; therefore, its fundamental frequence
is the highest among the three" (*Dynamic modelling and analysis of space webs*, section 4; it gives no number). The
webs are those of `triangle-load`, `square-load` and `hexagon-load`, 201.4 m of one cable each and so of one mass, with
a tension-only cable that owes all its stiffness across the web to the load: 1 N or 5 N at the centre. Frequencies are
those of small vibrations about that equilibrium.

Every line is one element, as in the paper, or several. Beside the fundamental stands the lowest mode that matters to
the loaded node: one that brings at least a twentieth of the displacement that a small further load makes there,
φ²/(m ω²) of its flexibility.

What comes out (the table has the numbers; ``validation/paper/open_parameters.py`` asserts the order of the three webs):

- With one element per line the hexagon web is the highest: slack lines of the triangle web burden their ends with their
  mass. In several elements they hang loose, and the triangle web is the highest. The claim is true of the cables, by
  little, and not of the paper's own elements.
- Both of these fundamentals move much of the web up and down, the loaded node with it.
- That of the square web is the lowest and of another kind: it stays in the four corners, where there is little tension.
  The load hangs on two cables that cross, and the lowest mode that moves it lies above the other two webs.
- It does not follow from stiffness: at the load the triangle web is the stiffest of the three, the hexagon web the
  softest. All frequencies rise with the cube root of the load.
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np

import refweb

WEBS = ("triangle", "square", "hexagon")
LOADS = (1.0, 5.0)
ELEMENTS = ((1, "lumped"), (1, "consistent"), (2, "lumped"), (4, "lumped"))
NUMBER, SHARE = 16, 0.05


def modes_of(web, load, subdivide=1, mass="lumped", number=NUMBER):
    """The `refweb.Modes` of one of the paper's webs under a load [N]."""
    scene = refweb.Scene.load(f"{web}-load")
    cable, solve = replace(scene.cable, subdivide=subdivide), refweb.Static(load_steps=[load], mass=mass)
    return refweb.modes(scene.replace(cable=cable, solve=solve), number)


def flexibility(web, load):
    """Displacement that a small further load makes at the loaded node of a web, per newton [m/N]."""
    scene = refweb.Scene.load(f"{web}-load")
    further = 1e-4
    solution = refweb.run(scene.replace(solve=refweb.Static(load_steps=[load, (1.0 + further) * load])))
    before, after = (step["results"]["deflection"].value for step in solution.steps)
    return (after - before) / (further * load)


def of_the_load(found, whole):
    """Number of the lowest mode with at least `SHARE` of the flexibility ``whole`` [m/N] of the loaded node, or None.

    Also the share of every mode, shape (modes,).
    """
    here = found.spectra[-1]
    centre = found.state.system.net.find("centre")[0]
    shares = here.shapes[:, centre, 2] ** 2 / (here.modal_mass * here.squared) / whole
    large = np.flatnonzero(shares >= SHARE)
    return (int(large[0]) if len(large) else None), shares


def row(web, load, elements, found, whole):
    """One line of the table."""
    here, (mode, shares) = found.spectra[-1], of_the_load(found, whole)
    x, y, _ = found.state.system.net.points[here.nodes[0]]
    text = f"{web:9s} {load:g} N   {elements[0]} {elements[1]:11s} {found.frequency[0]:.10f} ± {found.error[0]:.0e} "
    text += f"{100.0 * here.moving[0]:6.1f} %   ({x:5.2f}, {y:5.2f})"
    if mode is not None:
        text += f"   mode {mode + 1}, {found.frequency[mode]:.4f} Hz, {100.0 * shares[mode]:.0f} %"
    return text


def main():
    """Print the table, and which web is highest."""
    print("web       load  elements      fundamental [Hz]      mass moving   most at [m]      of the load")
    for load in LOADS:
        whole = {web: flexibility(web, load) for web in WEBS}
        order = {elements: [] for elements in ELEMENTS}
        for web in WEBS:
            for elements in ELEMENTS:
                found = modes_of(web, load, *elements)
                print(row(web, load, elements, found, whole[web]), flush=True)
                order[elements].append((found.frequency[0], web))
        given = ", ".join(f"{web} {1e3 * whole[web]:.2f}" for web in WEBS)
        print(f"  {load:g} N: flexibility of the loaded node {given} mm/N")
        for (subdivide, mass), found in order.items():
            falling = " > ".join(f"{web} {frequency:.4f}" for frequency, web in sorted(found, reverse=True))
            print(f"  {load:g} N, {subdivide} {mass}: {falling} Hz")
    return 0


if __name__ == "__main__":
    sys.exit(main())
