"""A net of 12 × 12 m with a thicker rim and a mass at each corner, hit by a sphere. Nothing holds it.

python own_net.py [DIR]
"""

import pathlib
import sys

import refweb

SIDE = 12.0  # of the net [m]
LAYERS = 8  # a square net of N layers has 2 N - 1 meshes along a side


def scene(layers=LAYERS, duration=0.6):
    """The net lies in z = 0, its middle at the origin; the sphere comes from below."""
    mesh = SIDE / (2 * layers - 1)
    return refweb.Scene(
        title="Own net hit by a sphere",
        web=refweb.Layers(mesh="square", layers=layers, cell_area=mesh**2),
        # Such a net has the groups "rim", "anchors", "inner" and more: see `refweb help web.layers`.
        cable=refweb.Cable(
            law="tension-only",
            modulus=1e9,  # Pa
            area=2e-6,  # m²
            density=970.0,  # kg/m³
            groups={"rim": refweb.Group(area=8e-6)},
        ),
        supports=refweb.Supports(nodes=[]),  # such a net is held at its rim: here nothing holds it
        effects=[
            refweb.PointMass(node="corners", mass=0.5),  # kg on each corner
            refweb.Body(name="sphere", radius=0.5, mass=5.0, position=(0, 0, -0.51), velocity=(0, 0, 10)),
            refweb.Contact(),  # refweb chooses the stiffness of contact
        ],
        solve=refweb.Dynamic(duration=duration),
        output=refweb.Output(interval=2e-3, frames=20),
        observe=[
            # The mean over 20 ms: where waves meet, the peak of an instant has few digits.
            refweb.Observe(name="rim_tension", quantity="tension", line="rim", reduce="max", average=0.02),
            refweb.Observe(
                name="net_tension", quantity="tension", line=["anchors", "inner"], reduce="max", average=0.02
            ),
            refweb.Observe(name="contact_force", quantity="reaction", body="sphere", reduce="max"),
            refweb.Observe(name="sphere_speed", quantity="velocity", body="sphere", component="z"),
        ],
    )


def main(folder=".", **sizes):
    """Run it, print the results with their errors, and write the folder ``own-net`` with a picture in it."""
    solution = refweb.run(scene(**sizes))
    for name, result in solution.results.items():
        print(f"{name}: {result.value:.4g} ± {result.error:.2g} {result.unit}")
    out = pathlib.Path(folder) / "own-net"
    solution.save(out, force=True)  # `web.pvd` in it opens in ParaView
    solution.picture(field="tension", out=out / "web.png")


if __name__ == "__main__":
    main(*sys.argv[1:])
