"""The paper's three webs in pictures: beside each other, at one scale and with one bar of colours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from refweb.pictures import model, render
from refweb.pictures.camera import View
from refweb.pictures.polygons import polygons

from ..harness import plots

WEBS = ("triangle", "square", "hexagon")
COLOUR = dict(zip(WEBS, plots.COLOURS, strict=False))
MARK = dict(zip(WEBS, "^sh", strict=True))
SLACK, PUSHES = (0.80, 0.80, 0.81), (0.78, 0.33, 0.24)
BALL = (0.45, 0.55, 0.68)
WIDTH, HEIGHT = 1060, 342
"""Of each view in perspective [pixel]."""
THICKNESS = 0.004
"""Radius of lines in perspective [m]; a round cable of 1e-4 m² has 5.6 mm."""


@dataclass(frozen=True)
class Shown:
    """One web: nodes [m], shape (nodes, 3); lines; their stress [Pa] and slackness; surfaces of bodies."""

    title: str
    points: np.ndarray
    lines: np.ndarray
    stress: np.ndarray
    slack: np.ndarray
    bodies: list

    @classmethod
    def of(cls, title, solution, state=None):
        """The web of a solution, in its last state or another."""
        state = state or solution.state
        net = state.system.net
        bodies = [body.surface(state.position[body.row]) for body in net.bodies]
        return cls(title, state.position[: len(net.web.points)], net.web.lines, state.stress, state.slack, bodies)


def _scale(shown):
    """Colours from 0 to the largest stress of all, by its square root so that small ones can be told apart."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, PowerNorm

    colours = ListedColormap(colormaps["viridis"](np.linspace(0.03, 0.95, 256)))
    return ScalarMappable(PowerNorm(0.5, 0.0, 1e-3 * max(one.stress.max() for one in shown)), colours)


def _colours(scale, one):
    """Colours of the lines of a web, shape (lines, 3)."""
    colours = scale.to_rgba(1e-3 * one.stress)[:, :3]
    colours[one.slack], colours[one.stress < 0.0] = SLACK, PUSHES
    return colours


def _bar(page, scale, axes, shown):
    from matplotlib.lines import Line2D

    bar = page.colorbar(scale, ax=axes, shrink=0.7, aspect=30, label="stress [kPa]")
    bar.outline.set_visible(False)
    found = {
        "slack": (SLACK, any((one.slack & (one.stress >= 0.0)).any() for one in shown)),
        "pushes": (PUSHES, any((one.stress < 0.0).any() for one in shown)),
    }
    marks = [Line2D([], [], color=colour, linewidth=3, label=name) for name, (colour, here) in found.items() if here]
    if marks:
        page.legend(handles=marks, loc="lower right", frameon=False, fontsize="small")


def perspective(shown):
    """Webs in true perspective, all by one camera; lines in the colours of their stress, slack grey, pushing red.

    Returns
    -------
    matplotlib.figure.Figure
    """
    from matplotlib.figure import Figure

    scale, aspect = _scale(shown), WIDTH / HEIGHT
    azimuth, elevation = np.radians((28.0, 15.0))
    right = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    near = np.array([right[1] * np.cos(elevation), -right[0] * np.cos(elevation), np.sin(elevation)])
    axes = np.array([right, np.cross(near, right), near])
    view = View.fit(axes, np.concatenate([one.points for one in shown]), aspect, np.tan(np.radians(9.0)))
    models = [
        [
            model.Tubes(one.points[one.lines], _colours(scale, one), THICKNESS),
            *(model.Surface(*body, BALL) for body in one.bodies),
        ]
        for one in shown
    ]
    images = render.images(models, [view], [(WIDTH, HEIGHT)])
    page = Figure(figsize=(7.0, (6.4 / aspect + 0.3) * len(shown)), dpi=160, layout="constrained")
    plot = np.atleast_1d(page.subplots(len(shown)))
    for number, (one, web) in enumerate(zip(plot, shown, strict=True)):
        one.axis("off")
        if images:
            one.imshow(images[number][0], extent=view.extent, interpolation="antialiased")
        else:
            polygons(one, models[number], view, HEIGHT)
            one.set(xlim=view.extent[:2], ylim=view.extent[2:], aspect="equal")
        one.set_title(web.title, fontsize="medium", loc="left")
    _ruler(plot[0], view)
    _bar(page, scale, list(plot), shown)
    return page


def _ruler(plot, view, length=0.5):
    """Half a metre along x along the edge that is nearest."""
    ends = view.project(np.array([[-1.2, -1.45, 0.0], [-1.2 + length, -1.45, 0.0]]))[0]
    plot.plot(*ends.T, color="#333333", linewidth=1.5)
    plot.text(*ends.mean(axis=0) - [0.0, 0.012], f"{length:g} m", ha="center", va="top", fontsize="small")
    plot.set(xlim=view.extent[:2], ylim=view.extent[2:])


def plan(shown):
    """Webs seen along z, at one scale; lines in the colours of their stress, slack grey, pushing red."""
    from matplotlib.collections import LineCollection

    scale = _scale(shown)
    page, plot = plots.axes("x [m]", ["y [m]", "", ""], columns=3, height=2.9, sharex=True, sharey=True)
    for one, web in zip(plot, shown, strict=True):
        colours = _colours(scale, web)
        order = np.argsort(np.where(web.slack, -1.0, web.stress), kind="stable")
        ends = web.points[web.lines][order][:, :, :2]
        one.add_collection(LineCollection(ends, colors=colours[order], linewidths=0.7))
        one.set(aspect="equal", xlim=(-1.4, 1.4), ylim=(-1.4, 1.4))
        one.set_title(web.title, fontsize="medium")
        one.grid(False)
    _bar(page, scale, list(plot), shown)
    return page
