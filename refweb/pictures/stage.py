"""The stage of a picture: what all pages of a film share, and how a frame is drawn and labelled on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..results.units import prefixed
from .camera import choose
from .render import Balls, Surface, Tubes

DARK, PALE, BEFORE, SUPPORT, SLACK = "#333333", "#888888", "#999999", (0.25, 0.25, 0.27), (0.80, 0.80, 0.81)
BODIES = ((0.45, 0.55, 0.68), (0.70, 0.55, 0.45), (0.55, 0.62, 0.50))
GREY_WHERE_SLACK = ("tension", "stress", "strain")
UNITS = {"tension": "N", "reaction": "N", "stress": "Pa", "natural_length": "m", "displacement": "m"}
UNITS |= {"velocity": "m/s", "mass": "kg"}


@dataclass(frozen=True)
class Stage:
    """What all pages share.

    `views` and their `rectangles`; the `field` and its `limits` [SI]; the `radius` of lines, the undeformed lines
    `origin`, shape (lines, points, 3), empty where nothing has moved, the `middle` of the web, shape (3,), and its
    `supports`, shape (n, 3) [m].
    """

    views: list
    rectangles: list
    field: str
    limits: tuple
    radius: float
    origin: np.ndarray
    middle: np.ndarray
    supports: np.ndarray

    @classmethod
    def of(cls, frames, field, size, supports):
        """The stage that shows all of the frames on a page of this size [pixel]."""
        points = np.concatenate([frame.paths.reshape(-1, 3) for frame in frames])
        solid = np.concatenate([np.zeros((0, 3)), *(body.points for frame in frames for body in frame.bodies.values())])
        moved = max(np.abs(frame.paths - frame.origin).max() for frame in frames)
        origin = frames[0].origin
        chosen = choose(origin.reshape(-1, 3), points, solid, moved, frames[0].tree, size[0] / size[1])
        extent = np.linalg.norm(np.ptp(points, axis=0))
        length = np.median(np.linalg.norm(np.diff(origin, axis=1), axis=2).sum(axis=1))
        thinnest = 0.0018 if len(chosen[0]) == 1 else 0.0008
        radius = np.clip(0.06 * length, thinnest * extent, 0.0025 * extent)
        origin = origin if moved > 0 else origin[:0]
        return cls(*chosen, field, _limits(frames, field), radius, origin, points.mean(axis=0), supports)

    def grey(self, frame):
        """Which lines are drawn as slack, shape (lines,)."""
        return frame.slack & (self.field in GREY_WHERE_SLACK)

    def model(self, frame):
        """The tubes, surfaces and markers of a frame."""
        grey, low, high = self.grey(frame), *self.limits
        colours = colour_map()(np.clip((frame.fields[self.field] - low) / (high - low), 0, 1))[:, :3]
        model: list[Tubes | Surface | Balls] = [Tubes(frame.paths[~grey], colours[~grey], self.radius)]
        model.append(Tubes(frame.paths[grey], np.tile(SLACK, (grey.sum(), 1)), 0.8 * self.radius))
        if len(self.supports):
            model.append(Balls(self.supports, SUPPORT, 2.2 * self.radius))
        for i, (points, triangles) in enumerate(frame.bodies.values()):
            model.append(Surface(points, triangles, BODIES[i % len(BODIES)]))
        return model

    def annotate(self, axes, view):
        """Metres along the axes of a parallel view, and the undeformed web; a triad of known length in perspective."""
        from matplotlib.collections import LineCollection

        if view.perspective:
            axes.axis("off")
            depth = view.project(self.middle)[1]
            _triad(axes, view, view.point(-0.88, -0.72, depth), _round(-0.12 * view.half[0] * depth))
            return
        axes.add_collection(LineCollection(view.project(self.origin)[0], colors=BEFORE, linewidths=0.8))
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(labelsize=12, colors=DARK)
        axes.set_xlabel(f"{_axis_name(view.axes[0])} [m]", size=13, color=DARK)
        axes.set_ylabel(f"{_axis_name(view.axes[1])} [m]", size=13, color=DARK)

    def legend(self, figure, frame):
        """Colour bar, and names for what is not on it."""
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import Normalize
        from matplotlib.lines import Line2D

        factor, unit = scaled_unit(self.field, max(map(abs, self.limits)))
        norm = Normalize(*(factor * limit for limit in self.limits))
        bar = figure.colorbar(ScalarMappable(norm, colour_map()), cax=figure.add_axes((0.905, 0.36, 0.014, 0.48)))
        bar.outline.set_visible(False)
        bar.ax.tick_params(labelsize=13, colors=DARK)
        bar.ax.set_title(self.field.replace("_", " ") + (f" [{unit}]" if unit else ""), size=15, pad=14, color=DARK)
        marks = [Line2D([], [], color=SLACK, lw=4, label="slack")] if self.grey(frame).any() else []
        marks += [Line2D([], [], color=SUPPORT, marker="o", ls="", ms=7, label="support")] if len(self.supports) else []
        marks += [Line2D([], [], color=BEFORE, lw=0.8, label="undeformed")] if len(self.origin) else []
        for i, name in enumerate(frame.bodies):
            marks.append(Line2D([], [], color=BODIES[i % len(BODIES)], marker="o", ls="", ms=13, label=name))
        look = {"frameon": False, "fontsize": 13, "labelcolor": DARK, "handlelength": 1.6}
        figure.legend(handles=marks, loc="upper left", bbox_to_anchor=(0.885, 0.32), **look)


def _triad(axes, view, corner, length):
    """Arrows along x, y and z from a corner [m], as long as the note below them says [m]."""
    for arm, name in zip(length * np.eye(3), "xyz", strict=True):
        start, end, tip = view.project(np.array([corner, corner + arm, corner + 1.2 * arm]))[0]
        axes.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": DARK, "lw": 1.4, "shrinkA": 0})
        axes.text(*tip, name, size=14, color=DARK, ha="center", va="center")
    place, _, scale = view.project(corner)
    axes.text(*(place - [0, 0.6 * length * scale]), f"each {length:g} m", size=12, color=DARK, va="top")


def colour_map():
    """The colours of values, from low to high."""
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap

    return ListedColormap(colormaps["viridis"](np.linspace(0.03, 0.95, 256)))


def palette():
    """The colours of a film, shape (colours, 3), 0…255: those of the lines and bodies in their shades, and greys."""
    colours = colour_map()(np.linspace(0, 1, 48))[:, :3]
    shades = [colours, 0.8 * colours[::2], 0.6 * colours[::2], 0.5 + 0.5 * colours[::2], 0.75 + 0.25 * colours[::3]]
    shades += [np.clip(np.linspace(0.4, 1.5, 16)[:, None] * body, 0, 1) for body in BODIES]
    shades.append(np.linspace(0, 1, 17)[:, None] * np.ones(3))
    return np.round(255 * np.concatenate(shades)).astype(int)


def _limits(frames, field):
    """Range of the colours [SI]: that of the taut lines, from 0 where this does not waste half of it."""
    values = np.concatenate([frame.fields[field][~(frame.slack & (field in GREY_WHERE_SLACK))] for frame in frames])
    values = values[np.isfinite(values)]
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
    low = 0.0 if 0 <= low <= 0.5 * high else low
    return (low, high) if high - low > 1e-9 * abs(high) else (min(0.0, high), max(0.0, high) or 1.0)


def scaled_unit(field, largest):
    """Factor and unit that make the largest value [SI] a number of one to three digits."""
    unit = UNITS.get(field, "")
    if field == "strain":
        return (100.0, "%") if largest >= 1e-4 else (1e6, "10⁻⁶")
    if not unit or largest == 0:
        return 1.0, unit
    scale, unit = (1e3, "g") if unit == "kg" else (1.0, unit)
    value, prefix = prefixed(largest * scale / 0.9999)
    return scale / value, prefix + unit


def _round(length):
    """The largest 1, 2 or 5 times a power of ten that is not longer [m]."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(max(m * power for m in (1, 2, 5) if m * power <= length * (1 + 1e-9)))


def _axis_name(axis):
    close = np.argmax(axis)
    return "xyz"[close] if axis[close] > 1 - 1e-6 else "along ({:.2g}, {:.2g}, {:.2g})".format(*axis)
