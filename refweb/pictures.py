"""Pictures and films of a result folder: the web at true scale, its lines coloured by a field.

A web is seen twice: in perspective and, below, from the side, with metres along the axes. What lies in a plane, such as
a hanging cable, is seen once, along the normal of the plane. Slack lines are grey where the field is a tension, stress
or strain. Nothing needs a display: `refweb.drawing` renders by OpenGL off screen, and by matplotlib where it cannot.
"""

from __future__ import annotations

import io
import json
import re
import tomllib
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from . import drawing
from .drawing import Balls, Surface, Tubes, View
from .inputs import InputError, nearest

SIZE, FILM_SIZE = (1600, 1000), (1200, 750)
GREY, DARK, BODY = (0.80, 0.80, 0.81), "#333333", ((0.45, 0.55, 0.68), (0.70, 0.55, 0.45), (0.55, 0.62, 0.50))
SUPPORT, BEFORE = (0.25, 0.25, 0.27), "#999999"
TANGENT = np.tan(np.radians(10.0))
UNITS = {"tension": "N", "reaction": "N", "stress": "Pa", "natural_length": "m", "displacement": "m"}
UNITS |= {"velocity": "m/s", "mass": "kg", "strain": "", "slack": ""}
PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))
CELLS = {"line": 2, "line3": 3, "line4": 4}


def picture(folder, frame=None, field=None, out=None):
    """Draw one frame of a result folder.

    Parameters
    ----------
    folder : path
        A result folder: ``web.pvd``, ``frames/`` and, for the title, ``run.json`` and ``scene.toml``.
    frame : int, optional
        The number in the file's name; default the last.
    field : str, optional
        Cell data, or point data (of vectors the magnitude; lines show the mean over their nodes). Default ``stress``,
        or the first there is.
    out : path, optional
        Any format matplotlib writes; default ``folder/web.png``.

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    InputError
        No result folder, no such frame or field, no such format; names the nearest valid one.
    """
    out = _target(out, Path(folder) / "web.png", None)
    index = _index(folder)
    number = max(index) if frame is None else frame
    if number not in index:
        close = min(index, key=lambda n: abs(n - number))
        raise InputError(f"frame = {number}: no such frame in {folder}, the nearest is {close}, the last {max(index)}")
    shot = _read(folder, index, number)
    field = _field(shot, field)
    pins = shot.pins if len(shot.pins) else _read(folder, index, max(index)).pins
    for figure in _figures([shot], field, pins, _heading(folder), SIZE):
        figure.savefig(out)
    return out


def animate(folder, field=None, out=None, fps=10):
    """Draw all frames of a result folder as a GIF: one camera and one colour range.

    Parameters
    ----------
    folder, field
        As for `picture`.
    out : path, optional
        A ``.gif``; default ``folder/web.gif``.
    fps : float
        Frames per second [1/s], > 0.

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    InputError
        As for `picture`.
    """
    from PIL import Image

    out = _target(out, Path(folder) / "web.gif", ["gif"])
    if not 0 < fps <= 50:
        raise InputError(f"fps = {fps} must be > 0 and ≤ 50 [1/s]")
    index = _index(folder)
    shots = [_read(folder, index, number) for number in sorted(index)]
    field = _field(shots[-1], field)
    pins = next((shot.pins for shot in reversed(shots) if len(shot.pins)), shots[-1].pins)
    film = []
    for figure in _figures(shots, field, pins, _heading(folder), FILM_SIZE):
        page = io.BytesIO()
        figure.savefig(page, format="png")
        film.append(Image.open(page).convert("RGB").quantize(256))
    film[0].save(out, save_all=True, append_images=film[1:], duration=round(1000 / fps), loop=0, disposal=1)
    return out


# reading


@dataclass(frozen=True)
class Shot:
    """One frame of a result folder.

    `paths` and `origin` [m], shape (lines, points, 3), are the lines now and undeformed; `tree` says that they close no
    loop; `fields` are values per line [SI], shape (lines,); `slack` flags, shape (lines,); `pins` where a reaction acts
    [m], shape (n, 3); `bodies` their points [m], shape (points, 3), and triangles, shape (triangles, 3), by name.
    """

    number: int
    time: float
    paths: np.ndarray
    origin: np.ndarray
    tree: bool
    fields: dict
    slack: np.ndarray
    pins: np.ndarray
    bodies: dict


def _target(out, default, endings):
    from matplotlib.figure import Figure

    out = Path(default if out is None else out)
    endings = endings or sorted(Figure().canvas.get_supported_filetypes())
    ending = out.suffix[1:].lower()
    if ending not in endings:
        raise InputError(f'out = "{out}": unknown format "{ending}", {nearest(ending, endings)}')
    if not out.parent.is_dir():
        raise InputError(f'out = "{out}": there is no folder "{out.parent}"')
    return out


def _index(folder):
    """{frame number: (time, {name: path})} of the collection."""
    pvd = Path(folder) / "web.pvd"
    try:
        sets = list(ElementTree.parse(pvd).iter("DataSet"))
    except (OSError, ElementTree.ParseError) as error:
        raise InputError(f'"{folder}" is not a result folder: web.pvd cannot be read ({error})') from None
    index = {}
    for item in sets:
        match = re.fullmatch(r"(.*)_(\d+)\.vtu", Path(item.get("file", "")).name)
        if match:
            frame = index.setdefault(int(match[2]), (float(item.get("timestep", 0)), {}))
            frame[1][match[1]] = Path(folder) / item.get("file")
    index = {number: frame for number, frame in index.items() if "web" in frame[1]}
    if not index:
        raise InputError(f'"{folder}" has no frames: web.pvd names no file such as frames/web_000000.vtu')
    return index


def _mesh(path):
    import meshio

    try:
        return meshio.read(path)
    except (OSError, SystemExit, ElementTree.ParseError, meshio.ReadError) as error:
        raise InputError(f'"{path}" cannot be read: {error}') from None


def _read(folder, index, number):
    time, files = index[number]
    mesh = _mesh(files["web"])
    points = mesh.points
    origin = points - mesh.point_data.get("displacement", np.zeros_like(points))
    parts = [(i, block.data) for i, block in enumerate(mesh.cells) if block.type in CELLS]
    if not parts:
        raise InputError(f'"{files["web"]}" has no lines')
    fields = {name: np.concatenate([data[i] for i, _ in parts]) for name, data in mesh.cell_data.items()}
    for name, data in mesh.point_data.items():
        size = np.linalg.norm(data.reshape(len(points), -1), axis=1) if data.ndim > 1 else data
        fields.setdefault(name, np.concatenate([size[cells].mean(axis=1) for _, cells in parts]))
    samples = 2 if all(cells.shape[1] == 2 for _, cells in parts) else 9
    paths, start = (np.concatenate([_curve(x[cells], samples) for _, cells in parts]) for x in (points, origin))
    slack = np.asarray(fields.get("slack", np.zeros(len(paths)))) > 0.5
    reaction = mesh.point_data.get("reaction", np.zeros_like(points)).reshape(len(points), -1)
    bodies = {name: _mesh(path) for name, path in files.items() if name != "web"}
    bodies = {name: (body.points, _triangles(body)) for name, body in bodies.items()}
    tree = sum(cells.shape[0] * (cells.shape[1] - 1) for _, cells in parts) < len(points)
    return Shot(number, time, paths, start, tree, fields, slack, points[np.any(reaction != 0, axis=1)], bodies)


def _curve(nodes, samples):
    """Points along elements of any order, shape (elements, samples, 3); the two end nodes come first."""
    count = nodes.shape[1]
    where = np.array([0.0, 1.0, *np.arange(1, count - 1) / (count - 1)])
    powers = np.arange(count)
    weights = np.linspace(0, 1, samples)[:, None] ** powers @ np.linalg.inv(where[:, None] ** powers)
    return np.einsum("sn,enx->esx", weights, nodes)


def _triangles(mesh):
    blocks = [(block.type, block.data) for block in mesh.cells]
    corners = [data for kind, data in blocks if kind == "triangle"]
    for kind, data in blocks:
        corners += [data[:, [0, 1, 2]], data[:, [0, 2, 3]]] if kind == "quad" else []
    return np.concatenate(corners) if corners else np.zeros((0, 3), dtype=int)


def _field(shot, name):
    """The field to show: the one asked for, else stress, else the first."""
    if name is None:
        name = "stress" if "stress" in shot.fields or not shot.fields else next(iter(shot.fields))
    if name not in shot.fields:
        raise InputError(f'field = "{name}": no such field, {nearest(name, shot.fields)}')
    return name


def _heading(folder):
    """Title, what the pvd's timestep is called, and a word on a run that is not solved."""
    try:
        run = json.loads((Path(folder) / "run.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        run = {}
    try:
        solve = tomllib.loads((Path(folder) / "scene.toml").read_text(encoding="utf-8"))["solve"]["kind"]
    except (OSError, ValueError, KeyError, TypeError):
        solve = "dynamic"
    status = run.get("status", "solved")
    note = "" if status == "solved" else f"  —  run {status}"
    title = str(run.get("scene") or Path(folder).resolve().name)
    title = title if len(title) <= 80 else title[:79] + "…"
    return title, "step {:g}" if solve == "static" else "t = {:.6g} s", note


# composing


def _figures(shots, field, pins, heading, size):
    """The pages of the shots, one figure each, which the caller has done with before it asks for the next."""
    from matplotlib.figure import Figure

    stage = Stage.of(shots, field, size)
    models = [stage.model(shot, pins) for shot in shots]
    sizes = [tuple(round(r * s) for r, s in zip(rect[2:], size, strict=True)) for rect in stage.rects]
    drawn = drawing.images(models, stage.views, sizes)
    for i, (shot, model) in enumerate(zip(shots, models, strict=True)):
        figure = Figure(figsize=(16, 10), dpi=size[0] / 16)
        for j, (view, rect) in enumerate(zip(stage.views, stage.rects, strict=True)):
            axes = figure.add_axes(rect)
            if drawn:
                axes.imshow(drawn[i][j], extent=view.extent, aspect="auto", interpolation="none", zorder=0)
            else:
                drawing.polygons(axes, model, view, sizes[j][1])
            axes.set(xlim=view.extent[:2], ylim=view.extent[2:])
            stage.annotate(axes, view)
        stage.legend(figure, shot, pins)
        title, clock, note = heading
        figure.text(0.03, 0.945, title, size=23, weight="bold", color="#111111", parse_math=False)
        figure.text(0.03, 0.905, clock.format(shot.time) + note, size=16, color=DARK, parse_math=False)
        figure.text(0.985, 0.015, f"frame {shot.number}", size=11, color="#888888", ha="right")
        yield figure


@dataclass(frozen=True)
class Stage:
    """What all frames of a picture or film share: views and their places on the page, colours, thickness [m]."""

    views: list
    rects: list
    triad: tuple
    field: str
    limits: tuple
    radius: float
    origin: np.ndarray

    @classmethod
    def of(cls, shots, field, size):
        """The stage that shows all of the shots on a page of this size [pixel]."""
        points = np.concatenate([shot.paths.reshape(-1, 3) for shot in shots])
        origin = shots[0].origin
        extent = np.linalg.norm(np.ptp(points, axis=0))
        solid = np.concatenate([points, *(body[0] for shot in shots for body in shot.bodies.values())])
        low, high = points.min(axis=0) - 0.3 * extent, points.max(axis=0) + 0.3 * extent
        near = solid[np.all((solid >= low) & (solid <= high), axis=1)]
        moved = max(np.abs(shot.paths - shot.origin).max() for shot in shots)
        normal = _plane(np.concatenate([origin.reshape(-1, 3), points]), extent)
        flat = normal is not None and (abs(normal[2]) < 0.9 or shots[0].tree or moved > 1e-3 * extent)
        length = np.median(np.linalg.norm(np.diff(origin, axis=1), axis=2).sum(axis=1))
        radius = np.clip(0.07 * length, (0.0018 if flat else 0.0008) * extent, 0.0025 * extent)
        aspect = size[0] / size[1]
        views = _facing(normal, near, aspect) if flat else _two_views(origin.reshape(-1, 3), near, aspect)
        return cls(*views, field, _limits(shots, field), radius, origin if moved > 0 else origin[:0])

    def model(self, shot, pins):
        """The tubes, surfaces and markers of a shot."""
        grey = self.grey(shot)
        colours = _colour_map()(np.clip((shot.fields[self.field] - self.limits[0]) / np.ptp(self.limits), 0, 1))
        model = [Tubes(shot.paths[~grey], colours[~grey, :3], self.radius)]
        model.append(Tubes(shot.paths[grey], np.tile(GREY, (grey.sum(), 1)), 0.8 * self.radius))
        if len(pins):
            model.append(Balls(pins, SUPPORT, 2.2 * self.radius))
        for i, (points, triangles) in enumerate(shot.bodies.values()):
            model.append(Surface(points, triangles, BODY[i % len(BODY)]))
        return model

    def grey(self, shot):
        """Which lines are drawn as slack, shape (lines,)."""
        return shot.slack & (self.field in ("tension", "stress", "strain"))

    def annotate(self, axes, view):
        """Axes in metres of a parallel view, with the web's own place; axes of known length in perspective."""
        from matplotlib.collections import LineCollection

        if not view.perspective:
            axes.add_collection(LineCollection(view.project(self.origin)[0], colors=BEFORE, linewidths=0.8))
            axes.spines[["top", "right"]].set_visible(False)
            axes.tick_params(labelsize=12, colors=DARK)
            across, up = (_axis_name(a) for a in view.axes[:2])
            axes.set_xlabel(f"{across} [m]", size=13, color=DARK)
            axes.set_ylabel(f"{up} [m]", size=13, color=DARK)
            return
        axes.axis("off")
        corner, step = self.triad
        for arm, name in zip(step * np.eye(3), "xyz", strict=True):
            start, end, tip = view.project(np.array([corner, corner + arm, corner + 1.18 * arm]))[0]
            axes.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": DARK, "lw": 1.4, "shrinkA": 0})
            axes.text(*tip, f"{name}", size=14, color=DARK, ha="center", va="center")
        place, _, scale = view.project(corner)
        axes.text(*(place - [0, 0.55 * step * scale]), f"axes {step:g} m", size=12, color=DARK, ha="left", va="top")

    def legend(self, figure, shot, pins):
        """Colour bar, and names for what is not on it."""
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import Normalize
        from matplotlib.lines import Line2D

        factor, unit = _scaled_unit(self.field, max(map(abs, self.limits)))
        norm = Normalize(*(factor * np.array(self.limits)))
        bar = figure.colorbar(ScalarMappable(norm, _colour_map()), cax=figure.add_axes((0.905, 0.36, 0.014, 0.48)))
        bar.outline.set_visible(False)
        bar.ax.tick_params(labelsize=13, colors=DARK)
        bar.ax.set_title(self.field.replace("_", " ") + (f" [{unit}]" if unit else ""), size=15, pad=14, color=DARK)
        marks = []
        if self.grey(shot).any():
            marks.append(Line2D([], [], color=GREY, lw=4, label="slack"))
        if len(pins):
            marks.append(Line2D([], [], color=SUPPORT, marker="o", ls="", ms=7, label="support"))
        if len(self.origin):
            marks.append(Line2D([], [], color=BEFORE, lw=0.8, label="undeformed"))
        for i, name in enumerate(shot.bodies):
            marks.append(Line2D([], [], color=BODY[i % len(BODY)], marker="o", ls="", ms=13, label=name))
        if marks:
            figure.legend(handles=marks, loc="upper left", bbox_to_anchor=(0.888, 0.32), frameon=False, fontsize=13)


def _facing(normal, points, aspect):
    """Views, their rectangles and no triad for what lies in a plane."""
    up = np.array([0.0, 0.0, 1.0]) if abs(normal[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
    right = _unit(np.cross(up, normal))
    right *= np.sign(right[np.argmax(abs(right))])
    axes = np.array([right, _unit(up - (up @ normal) * normal), np.zeros(3)])
    axes[2] = np.cross(axes[0], axes[1])
    rect = (0.07, 0.08, 0.79, 0.78)
    return [View.fit(axes, points, aspect * rect[2] / rect[3], margin=1.12)], [rect], None


def _two_views(origin, points, aspect):
    """Views in perspective and from the side, their rectangles, and the triad: its corner and length [m]."""
    side = _side(origin)
    large, below = (0.02, 0.30, 0.85, 0.60), (0.07, 0.06, 0.79, 0.22)
    views = [
        View.fit(_oblique(side), points, aspect * large[2] / large[3], TANGENT),
        View.fit(side, points, aspect * below[2] / below[3], margin=1.15),
    ]
    corner = views[0].point(-0.88, -0.72, views[0].project(points.mean(axis=0))[1])
    return views, [large, below], (corner, _round(0.16 * max(np.ptp(points, axis=0))))


def _principal(points):
    """Centre and principal axes of points, longest first, shape (3, 3), and the extents along them, shape (3,)."""
    offset = points - points.mean(axis=0)
    axes = np.linalg.eigh(offset.T @ offset)[1].T[::-1]
    return axes, np.ptp(offset @ axes.T, axis=0)


def _plane(points, extent):
    """Unit normal of the plane that holds all points (of a straight line: the vertical plane), or None."""
    axes, extents = _principal(points)
    if extents[2] > 1e-6 * extent:
        return None
    if extents[1] > 1e-6 * extent:
        return axes[2]
    normal = np.cross(axes[0], [0.0, 0.0, 1.0])
    return _unit(normal) if np.linalg.norm(normal) > 0.1 else np.array([0.0, 1.0, 0.0])


def _side(origin):
    """Axes of the view from the side: along the web, along its normal (z if it is not flat), towards the viewer."""
    axes, extents = _principal(origin)
    normal = axes[2] if extents[2] < 0.05 * extents[0] and extents[1] > 0.05 * extents[0] else np.array([0.0, 0.0, 1.0])
    normal = normal * np.sign(normal[np.argmax(abs(normal))])
    along = np.eye(3)[np.argmax(np.where(abs(normal) < 0.7, np.ptp(origin, axis=0), -1.0))]
    along = _unit(along - (along @ normal) * normal)
    return np.array([along, normal, np.cross(along, normal)])


def _oblique(side):
    """Axes of the view in perspective: a lying web from its front and above, a standing one well from its side."""
    front, azimuth, elevation = (side[2], 28.0, 24.0)
    if abs(side[1, 2]) < 0.7:
        front, azimuth, elevation = side[1] * (-1 if np.argmax(abs(side[1])) == 1 else 1), 50.0, 14.0
    up = np.array([0.0, 0.0, 1.0])
    front = _unit(front - front[2] * up)
    a, e = np.radians((azimuth, elevation))
    near = np.cos(e) * (np.cos(a) * front + np.sin(a) * np.cross(up, front)) + np.sin(e) * up
    right = _unit(np.cross(up, near))
    return np.array([right, np.cross(near, right), near])


def _unit(vector):
    return vector / np.linalg.norm(vector)


def _round(length):
    """The largest 1, 2 or 5 times a power of ten that is not longer."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(max(m * power for m in (1, 2, 5) if m * power <= length * (1 + 1e-9)))


def _axis_name(axis):
    close = np.argmax(axis)
    return "xyz"[close] if axis[close] > 1 - 1e-6 else "along ({:.2g}, {:.2g}, {:.2g})".format(*axis)


def _colour_map():
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap

    return ListedColormap(colormaps["viridis"](np.linspace(0.03, 0.95, 256)))


def _limits(shots, field):
    """Range of the colours: of the taut lines, from 0 where that does not waste half of it."""
    values = [shot.fields[field][~shot.slack if field in ("tension", "stress", "strain") else ...] for shot in shots]
    values = np.concatenate(values)
    values = values[np.isfinite(values)]
    low, high = (values.min(), values.max()) if len(values) else (0.0, 1.0)
    low = 0.0 if 0 <= low <= 0.5 * high else low
    return (low, high) if high - low > 1e-9 * abs(high) else (min(0.0, high), max(0.0, high) or 1.0)


def _scaled_unit(field, largest):
    """Factor and unit that make the largest value [SI] a number of one to three digits."""
    unit = UNITS.get(field, "")
    if field == "strain":
        return (100.0, "%") if largest >= 1e-4 else (1e6, "10⁻⁶")
    if not unit or largest == 0:
        return 1.0, unit
    scale, unit = (1e3, "g") if unit == "kg" else (1.0, unit)
    value, prefix = next((p for p in PREFIXES if largest * scale >= 0.9999 * p[0]), PREFIXES[-1])
    return scale / value, prefix + unit
