"""A sweep: a shipped scene at eight speeds of its ball, as CSV and as a picture with error bars.

python sweep.py [DIR]
"""

import csv
import pathlib
import sys

import matplotlib

matplotlib.use("Agg")  # draws to files; leave it out to see windows
import matplotlib.pyplot as plt

import refweb

SPEEDS = [0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0]  # m/s
FOLLOWED = {"deflection": 1e3, "force_mean_10ms": 1.0}  # results, and what they are drawn times


def main(folder=".", duration=0.1):
    """Run the scene at each speed; every value has its own ±."""
    rows = []
    for speed in SPEEDS:
        # Any value of a scene file can be set by its path, as with `refweb run --set`.
        scene = refweb.Scene.load("square-impact", {"body.0.velocity": [0, 0, speed], "solve.duration": duration})
        solution = refweb.run(scene)
        rows.append([speed, *(n for name in FOLLOWED for n in solution.results[name][:2])])  # value, error
        print(f"{speed} m/s", *(f"{name} = {solution.results[name].value:.4g}" for name in FOLLOWED))
    folder = pathlib.Path(folder)
    with open(folder / "sweep.csv", "w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(["speed [m/s]", "deflection [m]", "±", "force_mean_10ms [N]", "±"])
        table.writerows(rows)
    figure, panels = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
    for n, (axes, label) in enumerate(zip(panels, ["deflection [mm]", "mean contact force in 10 ms [N]"], strict=True)):
        scale = list(FOLLOWED.values())[n]
        values, errors = ([scale * row[k] for row in rows] for k in (1 + 2 * n, 2 + 2 * n))
        axes.errorbar(SPEEDS, values, yerr=errors, fmt="o-", capsize=3, lw=1)
        axes.set(xlabel="speed of the ball [m/s]", ylabel=f"largest {label}", ylim=(0, None))
        axes.grid(alpha=0.3)
    figure.savefig(folder / "sweep.png", dpi=150)
    plt.close(figure)


if __name__ == "__main__":
    main(*sys.argv[1:])
