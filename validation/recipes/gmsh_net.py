"""A net from a Gmsh file: physical curves are groups of lines, physical points are names of nodes.

python gmsh_net.py [DIR]

The file is written here as text. In Gmsh itself give the curves and points physical groups and mesh with
`gmsh -1 net.geo`; with Mesh.SaveAll = 0 only what has a physical group is saved.
"""

import pathlib
import sys

import refweb

POINTS = [(-1, -1), (1, -1), (1, 1), (-1, 1), (0, 0), (-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
SPOKES = [(1, 6), (6, 5), (2, 7), (7, 5), (3, 8), (8, 5), (4, 9), (9, 5)]  # Gmsh counts nodes from 1
RING = [(6, 7), (7, 8), (8, 9), (9, 6)]
PHYSICAL = ["$PhysicalNames", "4", '0 1 "support"', '0 2 "middle"', '1 3 "spokes"', '1 4 "ring"', "$EndPhysicalNames"]


def gmsh_text():
    """The net as Gmsh 4.1 has it: points 1 to 4 are "support", 5 is "middle", curves 1 and 2 "spokes" and "ring"."""
    points = [f"{n + 1} {x} {y} 0 1 {1 if n < 4 else 2}" for n, (x, y) in enumerate(POINTS[:5])]
    curves = [f"{n} -1 -1 0 1 1 0 1 {physical} 0" for n, physical in ((1, 3), (2, 4))]
    text = ["$MeshFormat", "4.1 0 8", "$EndMeshFormat", *PHYSICAL]
    text += ["$Entities", "5 2 0 0", *points, *curves, "$EndEntities"]
    text += ["$Nodes", "1 9 1 9", "1 1 0 9", *map(str, range(1, 10)), *(f"{x} {y} 0" for x, y in POINTS), "$EndNodes"]
    text += ["$Elements", "7 17 1 17"]  # 5 points and 2 curves with 12 lines
    for n in range(1, 6):
        text += [f"0 {n} 15 1", f"{n} {n}"]
    for curve, lines, first in ((1, SPOKES, 6), (2, RING, 14)):
        text += [f"1 {curve} 1 {len(lines)}", *(f"{first + n} {i} {j}" for n, (i, j) in enumerate(lines))]
    return "\n".join([*text, "$EndElements", ""])


def main(folder="."):
    """Write the file, solve the net under a weight at its middle, and draw it."""
    folder = pathlib.Path(folder)
    (folder / "net.msh").write_text(gmsh_text())
    scene = refweb.Scene(
        title="Net from Gmsh",
        web=refweb.File(path=str(folder / "net.msh")),  # points named "support" are held
        cable=refweb.Cable(
            law="tension-only",
            modulus=1e9,  # Pa
            area=2e-6,  # m²
            density=970.0,  # kg/m³
            groups={"ring": refweb.Group(prestrain=0.01)},  # cut 1 % shorter than its place
        ),
        effects=[refweb.Load(node="middle", force=(0, 0, -50))],
        solve=refweb.Static(load_steps=[0.5, 1]),
        observe=[refweb.Observe(name=group, quantity="tension", line=group) for group in ("spokes", "ring")],
    )
    solution = refweb.run(scene)
    for name, result in solution.results.items():
        print(f"largest tension of {name}: {result.value:.6f} ± {result.error:.2g} {result.unit}")
    solution.save(folder / "gmsh-net", force=True)
    solution.picture(field="tension", out=folder / "gmsh-net" / "web.png")


if __name__ == "__main__":
    main(*sys.argv[1:])
