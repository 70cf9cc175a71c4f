"""Results as tables of pandas and meshes of pyvista, read from a result folder.

python pandas_and_pyvista.py [DIR]     (needs pandas: pip install pandas)
"""

import pathlib
import sys

import matplotlib

matplotlib.use("Agg")  # draws to files; leave it out to see windows
import pyvista

import refweb


def main(folder=".", duration=0.1):
    """Run a shipped scene to a folder, read it again, and write a table and two pictures."""
    folder = pathlib.Path(folder)
    scene = refweb.Scene.load("square-impact", {"solve.duration": float(duration)})
    refweb.run(scene, out=folder / "impact", force=True)

    solution = refweb.load(folder / "impact")  # any result folder, also of `refweb run`
    print(solution.to_pandas("results"))  # value, error, unit, time, where
    history = solution.to_pandas()  # a column for each quantity, by time
    units = history.attrs["units"]
    history.to_csv(folder / "history.csv")
    axes = history["ball_speed"].plot(xlabel=f"time [{units['time']}]", grid=True)
    axes.set_ylabel(f"speed of the ball [{units['ball_speed']}]")
    axes.figure.savefig(folder / "speed.png", dpi=150, bbox_inches="tight")
    matplotlib.pyplot.close(axes.figure)

    blocks = solution.to_pyvista(frame=-1)  # the last; frames have numbers, as files of the folder
    web, ball = blocks["web"], blocks["ball"]
    print(web.cell_data.keys(), web.point_data.keys())
    print(
        "largest displacement:", abs(web["displacement"]).max(), "m at", float(blocks.field_data["TimeValue"][0]), "s"
    )
    plotter = pyvista.Plotter(off_screen=True, window_size=(1400, 900))
    bar = {"title": "tension [N]", "vertical": True, "position_x": 0.9, "position_y": 0.25, "height": 0.5}
    plotter.add_mesh(web, scalars="tension", render_lines_as_tubes=True, line_width=4, scalar_bar_args=bar)
    plotter.add_mesh(ball, color="tomato", smooth_shading=True)
    plotter.camera_position = [(2.2, -3.8, 2.0), (0.1, 0, -0.1), (0, 0, 1)]
    plotter.screenshot(folder / "tension.png")
    plotter.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
