"""The stage of a picture: the common parts of all pages of a film, and the drawing and labels of a frame.

May change: private functions, colours and sizes here: `paraview` and `pages.space`, which takes `UNITS` as well, have
them from this file, so that all show a field alike. Must stay: their names; fields of `Look` and methods of `Stage`,
which `pictures`, `film` and `gym.images` use; `LARGEST`, which `over_frames` and `line_numbers` know; all names that
`pages.space`, `paraview` and other files import; public names of `Seen`, which other files use. Tests:
``tests/pictures/test_pictures.py``, ``tests/pictures/test_over_frames.py``.
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError
from ..results.units import prefixed
from .camera import MANY, choose, outermost
from .model import Balls, Surface, Tubes

DARK, PALE, BEFORE, SUPPORT, SLACK = "#333333", "#888888", "#999999", (0.25, 0.25, 0.27), (0.80, 0.80, 0.81)
BODIES = ((0.45, 0.55, 0.68), (0.70, 0.55, 0.45), (0.55, 0.62, 0.50))
TWO = {"taut": (0.11, 0.37, 0.55), "slack": (0.90, 0.62, 0.10)}
"""Colours of the field ``slack``."""
BROKEN, THIN = (0.86, 0.36, 0.30), 0.4
"""Colour of broken lines, which are drawn straight between their ends, and their relative radius."""
GREY_WHERE_SLACK = ("tension", "stress", "strain")
UNITS = {"tension": "N", "reaction": "N", "stress": "Pa", "natural_length": "m", "displacement": "m"}
UNITS |= {"velocity": "m/s", "mass": "kg"}
LARGEST = "largest_"
"""Prefix of the names of fields over all frames."""
MASSES, MASS_RADIUS, MASS_SIZES = (0.55, 0.16, 0.42), 5.0, 6
"""Colour of point masses, radius of the largest over that of lines, and number of sizes."""
MOST_UNDEFORMED = 20_000
"""Largest number of undeformed lines drawn by matplotlib; more lines are drawn as pixels."""


class Look(NamedTuple):
    """Options of drawing frames.

    Attributes
    ----------
    field : str
        Field of the colours.
    limits : (low, high)
        Its range [SI].
    scale : float
        Factor on displacements.
    view : str, ndarray of shape (3,) or None
        The only view; None for the best views.
    remark : str
        Remark on the field beside the time.
    missed : bool
        True if the largest value of the run is above the range, since it is between frames.
    """

    field: str
    limits: tuple[Any, ...]
    scale: float = 1.0
    view: object = None
    remark: str = ""
    missed: bool = False


class Seen(NamedTuple):
    """Limits of several frames together.

    Attributes
    ----------
    points, supports : ndarray, shape (n, 3)
        Extreme points of the lines, and of the supports [m].
    bodies : dict of str to ndarray, shape (n, 3)
        Extreme points of each body [m].
    origin : ndarray, shape (lines, points, 3)
        Undeformed lines [m].
    moved : float
        Largest component of a displacement [m].
    tree : bool
        True if the lines form no closed loop.
    slack : bool
        True if a line is drawn as slack.
    broken : bool
        True if a line is broken.
    lower, upper : float
        Least and largest value of lines that are not drawn as slack [SI].
    masses : tuple
        Least and largest point mass [kg]; empty if there is none.
    """

    points: np.ndarray
    supports: np.ndarray
    bodies: dict[str, Any]
    origin: np.ndarray
    moved: float
    tree: bool
    slack: bool
    broken: bool
    lower: float
    upper: float
    masses: tuple[Any, ...] = ()

    @classmethod
    def of(cls, frame, field):
        """Limits of one frame."""
        grey = _grey(frame, field)
        values = frame.fields[field][~grey]
        values = values[np.isfinite(values)]
        lower, upper = (float(values.min()), float(values.max())) if len(values) else (np.inf, -np.inf)
        bodies = {name: body.points for name, body in frame.bodies.items()}
        moved = float(np.abs(frame.paths - frame.origin).max())
        slack = bool(frame.slack.any() if field == "slack" else (grey & ~frame.broken).any())
        points = frame.paths.reshape(-1, 3)
        if len(points) > MANY and frame.paths.shape[1] == 2:  # each node once, not with every line that ends there
            index = np.zeros(frame.ends.max() + 1, dtype=int)
            index[frame.ends.ravel()] = np.arange(len(points))
            points = points[index]
        return cls(
            points,
            frame.supports,
            bodies,
            frame.origin,
            moved,
            frame.tree,
            slack,
            bool(frame.broken.any()),
            lower,
            upper,
            () if frame.masses is None else (float(frame.masses.mass.min()), float(frame.masses.mass.max())),
        )

    def spanned(self):
        """These limits by fewer points, which span all points to two hundredths of their extent."""
        bodies = {name: outermost(points) for name, points in self.bodies.items()}
        return self._replace(points=outermost(self.points), supports=outermost(self.supports), bodies=bodies)

    def joined(self, second):
        """Limits of two together."""
        bodies = {
            name: np.concatenate([*(limits.bodies[name] for limits in (self, second) if name in limits.bodies)])
            for name in {**self.bodies, **second.bodies}
        }
        return self._replace(
            points=np.concatenate([self.points, second.points]),
            supports=np.concatenate([self.supports, second.supports]),
            bodies=bodies,
            moved=max(self.moved, second.moved),
            slack=self.slack or second.slack,
            broken=self.broken or second.broken,
            lower=min(self.lower, second.lower),
            upper=max(self.upper, second.upper),
        )


@dataclass(frozen=True)
class Stage:
    """Common parts of all pages.

    Drawing `options`; the `views` and their `rectangles`; the `radius` of lines; the undeformed lines `origin`, shape
    (lines, points, 3), empty if nothing has moved; the `middle` of the web, shape (3,) [m]; the `limits` of all frames.
    """

    options: Look
    views: list[Any]
    rectangles: list[Any]
    radius: float
    origin: np.ndarray
    middle: np.ndarray
    limits: Seen

    @classmethod
    def of(cls, limits, options, aspect):
        """The stage for some limits, on a page of a given width/height."""
        solid = np.concatenate([np.zeros((0, 3)), *limits.bodies.values()])
        origin = limits.origin
        some = origin[:: 1 + len(origin) // MANY].reshape(-1, 3)
        chosen = choose(some, limits.points, solid, limits.moved, limits.tree, aspect, options.view)
        extent = np.linalg.norm(np.ptp(limits.points, axis=0))
        length = np.median(np.linalg.norm(np.diff(origin, axis=1), axis=2).sum(axis=1))
        thinnest = 0.0018 if len(chosen[0]) == 1 else 0.0008
        radius = np.clip(0.06 * length, thinnest * extent, 0.0025 * extent)
        origin = origin if limits.moved > 0 else origin[:0]
        return cls(options, *chosen, radius, origin, limits.points.mean(axis=0), limits)

    @property
    def beneath(self):
        """True if the undeformed web is drawn below the web, which it would cover in a view from above."""
        return self.options.view is not None

    def pixels(self, size):
        """Width and height of each view on a page of some size [pixel]."""
        return [tuple(round(r * s) for r, s in zip(rect[2:], size, strict=True)) for rect in self.rectangles]

    def model(self, frame):
        """The tubes, surfaces and markers of a frame."""
        if self.options.field == "slack":
            taut, slack = np.array(list(TWO.values()))
            colours, grey = np.where(frame.slack[:, None], slack, taut), np.zeros(len(frame.slack), dtype=bool)
        else:
            grey, (low, high) = _grey(frame, self.options.field), self.options.limits
            colours = colour_map()(np.clip((frame.fields[self.options.field] - low) / (high - low), 0, 1))[:, :3]
        colours[grey], colours[frame.broken] = SLACK, BROKEN
        radius = np.where(frame.broken, THIN, np.where(grey, 0.8, 1.0)) * self.radius
        model: list[Tubes | Surface | Balls] = [Tubes(frame.paths, colours, radius)]
        if len(frame.supports):
            model.append(Balls(frame.supports, SUPPORT, 2.2 * self.radius))
        if frame.masses is not None:
            model += self._dots(frame.masses)
        for i, body in enumerate(frame.bodies.values()):
            model.append(Surface(body.points, body.triangles, BODIES[i % len(BODIES)]))
        return model

    def _dots(self, masses):
        """Balls on nodes with point masses, with volumes in proportion to mass, in `MASS_SIZES` sizes."""
        shares = np.cbrt(masses.mass / masses.mass.max())
        sizes = np.ceil(MASS_SIZES * shares - 1e-9) / MASS_SIZES
        radius = MASS_RADIUS * self.radius
        return [Balls(masses.points[sizes == size], MASSES, float(size) * radius) for size in np.unique(sizes)]

    def annotate(self, axes, view):
        """Label the axes of a parallel view in metres, and draw the undeformed web; in perspective draw a triad."""
        from matplotlib.collections import LineCollection

        if view.perspective:
            axes.axis("off")
            depth = view.project(self.middle)[1]
            length = _round(-0.1 / axes.get_position().width * view.half[0] * depth)
            _triad(axes, view, view.point(-0.88, -0.72, depth), length)
            return
        below, origin = 0.5 if self.beneath else 2, distinct_lines(view.project(self.origin)[0])
        if len(origin) <= MOST_UNDEFORMED:
            axes.add_collection(LineCollection(origin, colors=BEFORE, linewidths=0.8, zorder=below))
        else:
            height, width = np.ceil(axes.get_window_extent().size[::-1]).astype(int)
            drawn = marked_pixels(origin, view.extent, width, height)
            axes.imshow(drawn, extent=view.extent, aspect="auto", interpolation="none", zorder=below)
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(labelsize=12, colors=DARK)
        axes.set_xlabel(f"{_axis_name(view.axes[0])} [m]", size=13, color=DARK)
        axes.set_ylabel(f"{_axis_name(view.axes[1])} [m]", size=13, color=DARK)

    def legend(self, figure):
        """Draw the colour bar, and a legend of slack and broken lines, bodies and masses."""
        from matplotlib.lines import Line2D

        parallel = [view for view in self.views if not view.perspective]
        marks = [Line2D([], [], color=SLACK, lw=4, label="slack")] if self.limits.slack else []
        if self.options.field == "slack":
            marks = [Line2D([], [], color=colour, lw=4, label=name) for name, colour in TWO.items()]
        else:
            self._bar(figure)
        if self.limits.broken:
            marks.append(Line2D([], [], color=BROKEN, lw=2, label="broken"))
        if self._seen_in(self.views, self.limits.supports):
            marks.append(Line2D([], [], color=SUPPORT, marker="o", ls="", ms=7, label="support"))
        if self.limits.masses:
            lowest, highest = (f"{mass:.3g}" for mass in self.limits.masses)
            label = f"{lowest} kg" if lowest == highest else f"{lowest} to {highest} kg"
            marks.append(Line2D([], [], color=MASSES, marker="o", ls="", ms=11, label=label))
        if self._seen_in(parallel, self.origin.reshape(-1, 3)):
            marks.append(Line2D([], [], color=BEFORE, lw=0.8, label="undeformed"))
        for i, (name, points) in enumerate(self.limits.bodies.items()):
            if self._seen_in(self.views, points):
                marks.append(Line2D([], [], color=BODIES[i % len(BODIES)], marker="o", ls="", ms=13, label=_cut(name)))
        style = {"frameon": False, "fontsize": 13, "labelcolor": DARK, "handlelength": 1.6}
        figure.legend(handles=marks, loc="upper left", bbox_to_anchor=(0.876, 0.32), **style)

    @staticmethod
    def _seen_in(views, points):
        return any(view.shows(points) for view in views)

    def _bar(self, figure):
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import Normalize

        low, high = self.options.limits
        factor, unit = scaled_unit(self.options.field, max(abs(low), abs(high)))
        slip = 1e-9 * (high - low)
        beyond = {(0, 0): "neither", (1, 0): "min", (0, 1): "max", (1, 1): "both"}
        beyond = beyond[
            int(self.limits.lower < low - slip), int(self.options.missed or self.limits.upper > high + slip)
        ]
        scale = ScalarMappable(Normalize(factor * low, factor * high), colour_map())
        bar = figure.colorbar(scale, cax=figure.add_axes((0.905, 0.36, 0.014, 0.48)), extend=beyond)
        bar.outline.set_visible(False)
        bar.ax.tick_params(labelsize=13, colors=DARK)
        over, name = "", self.options.field
        if name.startswith(LARGEST):
            over, name = "largest\n", name.removeprefix(LARGEST)
        name = over + _cut(name.replace("_", " "))
        bar.ax.set_title(name + (f" [{unit}]" if unit else ""), size=13 if over else 15, pad=14, color=DARK)


def distinct_lines(lines):
    """The lines on a page, shape (lines, points, 2), that differ by more than a few thousandths of its size.

    A million lines of a flat web seen from its side make a single line.
    """
    if len(lines) <= MOST_UNDEFORMED:
        return lines
    low, size = lines.min(axis=(0, 1)), np.ptp(lines, axis=(0, 1)).max()
    steps = np.floor((lines[:, [0, -1]] - low) / size * (2**12 - 1)).astype(np.int64)
    order = np.array([2**36, 2**24, 2**12, 1])
    return lines[np.unique(steps.reshape(-1, 4) @ order, return_index=True)[1]]


def marked_pixels(lines, extent, width, height):
    """An image, RGBA, shape (height, width, 4), of the pixels of lines on a page, shape (lines, points, 2)."""
    from matplotlib.colors import to_rgb

    left, right, bottom, top = extent
    ends = np.concatenate([np.stack([lines[:, i], lines[:, i + 1]], axis=1) for i in range(lines.shape[1] - 1)])
    ends = (ends - [left, top]) / [right - left, bottom - top] * [width, height]
    image = np.zeros((height, width, 4), dtype=np.uint8)
    longest = np.abs(ends[:, 1] - ends[:, 0]).max(axis=1)
    for share in np.linspace(0, 1, 2 + int(min(longest.max(), 9 * (width + height)))):
        at = np.floor(ends[:, 0] + share * (ends[:, 1] - ends[:, 0])).astype(int)
        column, row = at[((at >= 0) & (at < [width, height])).all(axis=1)].T
        image[row, column] = 255 * np.array([*to_rgb(BEFORE), 1.0])
    return image


def _cut(name):
    return name if len(name) <= 14 else name[:13] + "…"


def _grey(frame, field):
    """Mask of the lines drawn as slack, shape (lines,)."""
    return frame.slack & (field in GREY_WHERE_SLACK)


def _triad(axes, view, corner, length):
    """Arrows along x, y and z from a corner [m], and their length [m]."""
    for arm, name in zip(length * np.eye(3), "xyz", strict=True):
        start, end, tip = view.project(np.array([corner, corner + arm, corner + 1.2 * arm]))[0]
        axes.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": DARK, "lw": 1.4, "shrinkA": 0})
        axes.text(*tip, name, size=14, color=DARK, ha="center", va="center")
    position, _, scale = view.project(corner)
    axes.text(*(position - [0, 0.6 * length * scale]), f"each {length:g} m", size=12, color=DARK, va="top")


def colour_map():
    """The colours of values, from low to high."""
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap

    return ListedColormap(colormaps["viridis"](np.linspace(0.03, 0.95, 256)))


def limits_of(record, field, numbers):
    """Range of a field [SI] in the frames of a record without slack lines; from 0 if that wastes less than half.

    Frames that cannot be read are left out.
    """
    low, high = np.inf, -np.inf
    for number in numbers:
        with contextlib.suppress(InputError, KeyError):
            frame = record.frame(number)
            values = frame.fields[field]
            values = values[np.isfinite(values) & ~_grey(frame, field)]
            low, high = min(low, values.min(initial=np.inf)), max(high, values.max(initial=-np.inf))
    low, high = (float(low), float(high)) if low <= high else (0.0, 1.0)
    low = 0.0 if 0 <= low <= 0.5 * high else low
    return (low, high) if high - low > 1e-9 * abs(high) else (min(0.0, high), max(0.0, high) or 1.0)


def scaled_unit(field, largest):
    """Factor and unit in which the largest value [SI] has one to three digits before the point."""
    field = field.removeprefix(LARGEST)
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
    return "xyz"[close] if axis[close] > 1 - 1e-6 else "along ({:.2g}, {:.2g}, {:.2g})".format(*axis.round(3) + 0.0)
