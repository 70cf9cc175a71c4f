"""Energies over time of a net that catches a ball, one above the other, and how far their sum drifts.

python energies.py [DIR]
"""

import pathlib
import sys

import matplotlib

matplotlib.use("Agg")  # draws to files; leave it out to see windows
import matplotlib.pyplot as plt

import refweb

PARTS = ("kinetic_energy", "strain_energy", "contact_energy", "dissipated_energy")


def scene(duration=0.2):
    """A square net held at its rim and hit by a ball; damping turns energy to heat."""
    return refweb.Scene(
        title="Ball in a damped net",
        web=refweb.Window(mesh="square", rows=10, columns=10, side=0.1),
        cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-5, density=1000.0),
        effects=[
            refweb.Body(name="ball", radius=0.1, mass=0.2, position=(0.02, 0.03, -0.11), velocity=(0, 0, 5)),
            refweb.Contact(stiffness=1e4),
            refweb.Damping(time=1e-4),
        ],
        solve=refweb.Dynamic(duration=duration),
    )


def main(folder=".", **sizes):
    """Run it and draw its history."""
    solution = refweb.run(scene(**sizes))
    history, drift = solution.history, solution.solver["energy_drift"]
    figure, axes = plt.subplots(figsize=(8, 5), layout="constrained")
    labels = [name.replace("_energy", "") for name in PARTS]
    axes.stackplot(1e3 * history["time"], [history[name] for name in PARTS], labels=labels, alpha=0.85)
    # The total is kinetic, strain and contact energy; with what is dissipated it is what the ball brought.
    axes.plot(1e3 * history["time"], history["total_energy"], "k-", lw=1, label="total")
    axes.set(xlabel="time [ms]", ylabel="energy [J]", title=f"{solution.scene.title}: energy drift {drift:.1e}")
    axes.margins(x=0)
    axes.legend(loc="lower right", ncols=len(labels) + 1)
    figure.savefig(pathlib.Path(folder) / "energies.png", dpi=150)
    plt.close(figure)
    print(f"energy drift: {drift:.1e} of the largest energy of the run")


if __name__ == "__main__":
    main(*sys.argv[1:])
