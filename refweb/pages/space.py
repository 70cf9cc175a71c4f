"""Data of the three-dimensional view of a page: some frames of a record in few bytes, and their error.

Points with the same position in all frames are merged. The position of a point is its undeformed position, in single
precision, plus a displacement in 65 534 steps of the range of each axis over all frames. Values have 254 steps of the
range of their field in their frame, the resolution of the colour scale. A body is stored as one surface, with its
translation and rotation in each frame.

pyvista's ``export_html`` puts 1.0 MB of vtk.js, by trame-vtk 2.11, into each page, and shows one instant without a
colour bar.

May change: private functions, `LARGEST`, `MOST`, `HIDDEN`, `LEFT_OUT` and `FIRST`, which decide how many frames and
which fields come first. Must stay: keys of `head`, and names and types of arrays, which ``model.js`` and ``view.js``
read, and to which `drawings.space` adds keys; `places` and `values`, by which tests read them back; `space_of`, which
`drawings` imports. Tests: ``tests/pages/test_page.py``, ``tests/pages/test_browser.py``.
"""

from __future__ import annotations

import warnings
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError
from ..pictures.camera import choose, nearby
from ..pictures.stage import BODIES, BROKEN, GREY_WHERE_SLACK, SLACK, SUPPORT, TWO, UNITS, colour_map
from .packed import PLACES, VALUES, differences, levels, pack

LARGEST = 2_400_000
"""Largest size of the frames as text, if no number of frames is given [byte]."""
MOST = 400
"""Largest number of frames, if no number is given."""
HIDDEN = ("slack", "broken", "support", "line", "natural_length", "mass")
"""Fields at the end of the menu, since they change little or are marked in another way."""
LEFT_OUT = ("support", "line")
FIRST = ("shape", "stress", "tension", "strain", "displacement", "velocity", "reaction")


class Space(NamedTuple):
    """Frames in few bytes.

    Attributes
    ----------
    head : dict
        Data for the page, plain values for JSON; its key ``arrays`` lists the arrays in `text`.
    text : str
        Arrays in the form of `refweb.pages.packed.pack`.
    error : float
        Largest distance of a point from its position in the record [m].
    extent : float
        Diagonal of the box around the web in all frames [m].
    numbers, missing : list of int
        Numbers of the frames in the data, and of frames that cannot be read.
    """

    head: dict[str, Any]
    text: str
    error: float
    extent: float
    numbers: list[Any]
    missing: list[Any]


def space_of(record, peak=None, limit=None, progress=None):
    """The frames of a record.

    Parameters
    ----------
    record : refweb.pictures.record.Record
        Record of the run.
    peak : int, optional
        Number of a frame that is shown in any case, as are the first and the last.
    limit : int, optional
        Largest number of frames, ≥ 1; by default as many as stay below `LARGEST` bytes, and `MOST`.
    progress : callable, optional
        Called with a line of text and the share that is done, 0 to 1.

    Returns
    -------
    Space or None
        None if no frame can be read.
    """
    if limit is not None and limit < 1:
        raise InputError(f"frames = {limit} must be ≥ 1 [1]")
    numbers, kept, missing = list(record.times), {}, []
    count = min(limit or MOST, len(numbers))
    while True:
        chosen = chosen_of(numbers, count, peak)
        for i, number in enumerate(chosen):
            if number not in kept and number not in missing:
                try:
                    kept[number] = record.frame(number)
                except InputError:
                    missing.append(number)
            if progress is not None:
                progress("reading frames", 0.8 * (i + 1) / len(chosen))
        frames_kept = [kept[number] for number in chosen if number in kept]
        if not frames_kept:
            return None
        space = _space(record, frames_kept, missing)
        if limit is not None or len(space.text) <= LARGEST or len(frames_kept) <= 3:
            return space
        count = max(3, min(count - 1, int(0.95 * count * LARGEST / len(space.text))))


def chosen_of(numbers, count, peak=None):
    """Numbers of the frames to show: the first, the last, the frame ``peak``, and others evenly between them.

    The result has ``count`` frames, or all if there are fewer. For ``count`` 1 or 2 the peak is chosen before the first
    and the last.
    """
    if count >= len(numbers):
        return list(numbers)
    if count < 3:
        wanted = dict.fromkeys([*([peak] if peak in numbers else []), numbers[0], numbers[-1]])
        return sorted(list(wanted)[:count], key=numbers.index)
    places = set(np.rint(np.linspace(0, len(numbers) - 1, count)).astype(int).tolist())
    if peak in numbers and (at := numbers.index(peak)) not in places:
        places.discard(min(places - {0, len(numbers) - 1}, key=lambda index: abs(index - at)))
        places.add(at)
    return [numbers[index] for index in sorted(places)]


def _space(record, frames, missing):
    """The data of some frames."""
    first = frames[0]
    if any(frame.paths.shape != first.paths.shape for frame in frames):
        raise InputError(f"{record.name}: its frames have webs of different lines, which one page cannot show")
    rest = first.origin if first.swing is None else first.paths - first.swing
    origin, along = rest.reshape(-1, 3), first.paths.shape[1]
    moved = np.array([frame.paths.reshape(-1, 3) for frame in frames]) - origin
    extent = float(np.linalg.norm(np.ptp((origin + moved).reshape(-1, 3), axis=0))) or 1.0
    steps, ranges = np.empty(moved.shape, dtype=int), []
    for axis in range(3):
        steps[..., axis], low, high = levels(moved[..., axis], PLACES)
        ranges.append((low, (high - low) / PLACES))
    single = origin.astype(np.float32)
    points, order = _once(single, steps)
    written = single.astype(float) + [low for low, _ in ranges] + steps * [step for _, step in ranges]
    error = float(np.linalg.norm(written - (origin + moved), axis=-1).max())
    segments = order.reshape(-1, along)
    segments = np.stack([segments[:, :-1], segments[:, 1:]], axis=-1).reshape(-1, 2)
    arrays = {
        "origin": single[points],
        "moves": differences(steps[:, points].transpose(0, 2, 1)),
        "segments": segments.astype(np.uint32),
        "slack": np.array([np.where(frame.broken, 2, frame.slack) for frame in frames]).astype(np.uint8),
        "supports": order[_supports(frames)].astype(np.uint32),
        "colours": np.rint(255 * colour_map()(np.linspace(0, 1, 256))[:, :3]).astype(np.uint8),
    }
    head = {
        "kind": record.kind,
        "numbers": [frame.number for frame in frames],
        "times": [frame.time for frame in frames],
        "along": along - 1,
        "moves": ranges,
        "fields": _fields(frames, arrays),
        "bodies": _bodies(frames, arrays),
        "two": [[round(255 * share) for share in colour] for colour in TWO.values()],
        "grey": [round(255 * share) for share in SLACK],
        "broken": [round(255 * share) for share in BROKEN] if any(frame.broken.any() for frame in frames) else None,
        "support": [round(255 * share) for share in SUPPORT],
        **_camera(frames, origin, moved),
    }
    text, head["arrays"] = pack(arrays)
    return Space(head, text, error, extent, [frame.number for frame in frames], sorted(missing))


def _once(origin, steps):
    """Numbers of the different points, and the index of each point among them, in the order of the lines."""
    rows = np.hstack([origin.view(np.int32).astype(int), steps.transpose(1, 0, 2).reshape(len(origin), -1)])
    _, first, inverse_order = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty(len(order), dtype=int)
    rank[order] = np.arange(len(order))
    return first[order], rank[inverse_order.ravel()]


def _supports(frames):
    """Numbers of the path points nearest to the supports, from the frame with the most supports."""
    from scipy.spatial import cKDTree

    frame = max(frames, key=lambda frame: len(frame.supports))
    if not len(frame.supports):
        return np.zeros(0, dtype=int)
    return np.atleast_1d(cKDTree(frame.paths.reshape(-1, 3)).query(frame.supports)[1])


def _fields(frames, arrays):
    """Data of each field, in the order of the menu; its levels become one of the arrays."""
    names = [name for name in frames[0].fields if name not in LEFT_OUT and all(name in f.fields for f in frames)]
    order = [name for name in FIRST if name in names]
    order += [name for name in names if name not in FIRST and name not in HIDDEN]
    order += [name for name in HIDDEN if name in names]
    fields, known = [], {}
    for name in order:
        levels_of = [levels(frame.fields[name], VALUES) for frame in frames]
        ranges = [[low, high] for _, low, high in levels_of]
        values = np.array([level for level, *_ in levels_of]).astype(np.uint8)
        constant = bool((values == values[0]).all()) and all(limits == ranges[0] for limits in ranges)
        values = values[:1] if constant else values
        array = known.setdefault(values.tobytes(), f"field {name}")
        arrays.setdefault(array, values)
        grey = name in GREY_WHERE_SLACK
        taut = [_range(frame.fields[name][~(frame.slack & grey)]) for frame in frames]
        fields.append(
            {
                "name": name,
                "unit": {"strain": "1"}.get(name, UNITS.get(name, "")),
                "array": array,
                "constant": constant,
                "ranges": ranges,
                "taut": taut,
                "grey": grey,
                "two": name == "slack",
            }
        )
    return fields


def _range(values):
    """Least and largest finite value; None if there is none."""
    values = values[np.isfinite(values)]
    return [float(values.min()), float(values.max())] if len(values) else None


def _bodies(frames, arrays):
    """Data of each body: its name, its colour and its rotation and position in each frame."""
    rows = []
    for i, (name, body) in enumerate(frames[0].bodies.items()):
        points_of = [frame.bodies[name].points for frame in frames if name in frame.bodies]
        alike = len(points_of) == len(frames) and all(points.shape == body.points.shape for points in points_of)
        if not alike or not len(body.triangles):
            continue
        middle = body.points.mean(axis=0)
        arrays[f"points of body {i}"] = (body.points - middle).astype(np.float32)
        arrays[f"triangles of body {i}"] = body.triangles.astype(np.uint32)
        turns = [rotation_between(body.points - middle, points - points.mean(axis=0)) for points in points_of]
        rows.append(
            {
                "name": name,
                "colour": list(BODIES[i % len(BODIES)]),
                "number": i,
                "places": [points.mean(axis=0).tolist() for points in points_of],
                "turns": [turn.ravel().tolist() for turn in turns],
            }
        )
    return rows


def rotation_between(before, after):
    """The rotation that maps points, shape (n, 3), best to other points, both about the origin."""
    from scipy.spatial.transform import Rotation

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of points on one line, any that fits
        return Rotation.align_vectors(after, before)[0].as_matrix()


def _camera(frames, origin, moved):
    """Axes of the first view, as in a picture, the box that it shows, and the thickness of lines [m]."""
    points = (origin + moved).reshape(-1, 3)
    solid = np.concatenate([np.zeros((0, 3)), *(body.points for f in frames for body in f.bodies.values())])
    views, _ = choose(origin, points, solid, float(np.abs(moved).max()), frames[0].tree, 1.6)
    extent = np.linalg.norm(np.ptp(points, axis=0))
    if frames[0].swing is not None:
        points = np.concatenate([points, (origin - moved).reshape(-1, 3)])
    near = nearby(points, solid, extent)
    length = np.median(np.linalg.norm(np.diff(frames[0].origin, axis=1), axis=2).sum(axis=1))
    radius = np.clip(0.06 * length, 0.0006 * extent, 0.002 * extent)
    box = [near.min(axis=0).tolist(), near.max(axis=0).tolist()]
    return {"axes": views[0].axes.tolist(), "box": box, "radius": float(radius)}
