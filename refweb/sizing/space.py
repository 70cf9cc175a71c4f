"""Space of designs: all values that the free numbers of a requirements file may have, and the scene of each design.

A design is a fraction of its range for each number between bounds, and the number of an option for everything else:
listed values, whole numbers, rows of a catalogue and scenes.

May change: private functions and texts of errors. Must stay: the order of free numbers and options in a `Design`, which
`problem`, `runs`, `search` and `smooth` count by; `SCENE`, a name in conditions, and the paths of `DIAMETER`; the
starts for a seed, by which a sizing that continues finds its runs again; `setting`, which `problem` imports; public
names of `Space` and `Option`, which other files use. Tests: ``tests/sizing/test_size.py``,
``tests/sizing/test_shipped_sizings.py``.
"""

from __future__ import annotations

import csv
import itertools
import json
import math
import pathlib
import re
from typing import Any, NamedTuple

from ..errors import InputError, in_file, refused_at
from ..messages import quote, short
from ..sweeps.design import Base
from ..sweeps.sweep import base_of
from .requirements import Catalogue, Free

DIAMETER = re.compile(r"(cable(?:\.groups\.[^.]+)?)\.diameter")
"""Paths of a diameter, which stands for the area of round lines."""
SCENE = "scene"
"""Name of the choice among several scenes."""


class Option(NamedTuple):
    """Possible value: its value or name in conditions and tables, and values by path."""

    label: Any
    settings: dict[str, Any]


class Design(NamedTuple):
    """Fractions of ranges, 0 to 1, and numbers of options."""

    shares: tuple[float, ...]
    options: tuple[int, ...]


class Space:
    """All designs of a requirements file.

    Parameters
    ----------
    sizing : refweb.Sizing
        The requirements.

    Attributes
    ----------
    free : dict of str to refweb.sizing.requirements.Free
        Numbers between bounds, by name.
    listed : dict of str to tuple of Option
        Everything else.
    bases : dict of str to refweb.sweeps.design.Base
        Scenes by name.
    """

    def __init__(self, sizing):
        self.bases = {name: _base(sizing, name) for name in sizing.scenes}
        self.free = {name: f for name, f in sizing.parameters.items() if isinstance(f, Free) and not f.whole}
        self.listed = {}
        if len(sizing.scenes) > 1:
            if SCENE in sizing.parameters:
                raise InputError(f'parameters: "{SCENE}" is the choice among the scenes: name it otherwise')
            self.listed[SCENE] = tuple(Option(pathlib.Path(name).stem, {SCENE: name}) for name in sizing.scenes)
        for name, given in sizing.parameters.items():
            if name not in self.free:
                with refused_at(f"parameters: {short(name)}:"):
                    self.listed[name] = _options(given, sizing.folder)
        self.first = next(iter(self.bases))

    @property
    def names(self):
        """Names of all free numbers, those of options last."""
        return [*self.free, *self.listed]

    @property
    def paths(self):
        """Paths of the scene that numbers between bounds set, in order."""
        return [setting(path, 1.0)[0] for given in self.free.values() for path in given.paths]

    @property
    def combinations(self):
        """Number of combinations of options."""
        return math.prod(len(options) for options in self.listed.values())

    def choices(self):
        """All combinations of options, each a tuple of numbers."""
        return itertools.product(*(range(len(options)) for options in self.listed.values()))

    def starts(self, count, seed):
        """Fractions to start from: the given start or the middle first, then points of Halton's sequence."""
        from scipy.stats import qmc

        first = [0.5 if f.start is None else f.share(f.start) for f in self.free.values()]
        more = qmc.Halton(len(self.free), seed=seed).random(count - 1) if count > 1 else []
        return [tuple(first), *(tuple(map(float, row)) for row in more)]

    def values(self, design):
        """Values by name."""
        values = {name: f.at(share) for (name, f), share in zip(self.free.items(), design.shares, strict=True)}
        for (name, options), number in zip(self.listed.items(), design.options, strict=True):
            values[name] = options[number].label
        return values

    def settings(self, design):
        """Values by path of the scene, and "scene" where there are several."""
        pairs = [
            setting(path, f.at(share))[:2]
            for f, share in zip(self.free.values(), design.shares, strict=True)
            for path in f.paths
        ]
        for options, number in zip(self.listed.values(), design.options, strict=True):
            pairs += options[number].settings.items()
        return dict(pairs)

    def slopes(self, design):
        """(Path, number of the free number, derivative of the value at the path by its fraction), in order."""
        rows = []
        for n, (f, share) in enumerate(zip(self.free.values(), design.shares, strict=True)):
            for path in f.paths:
                at, _, slope = setting(path, f.at(share))
                rows.append((at, n, slope * f.slope(share)))
        return rows

    def scene(self, design, more=None):
        """(Base, settings, dict of a scene file, scene) of a design; ``more`` are further values by path."""
        settings = self.settings(design) | (more or {})
        base = self.bases[settings.pop(SCENE, self.first)]
        return base, settings, *base.scene(settings)


def _base(sizing, name):
    """The scene of a requirements file by its name there."""
    if not isinstance(sizing.scene, str | tuple):
        return Base(sizing.scene.to_dict(), sizing.scene.folder, sizing.scene.file or "scene")
    path = sizing.folder / name if sizing.folder is not None else pathlib.Path(name)
    return base_of(path if path.is_file() else name)


def setting(path, value):
    """(Path of the scene, value there, its derivative by the given value)."""
    if match := DIAMETER.fullmatch(path):
        if isinstance(value, bool) or not isinstance(value, int | float) or not value > 0.0:
            raise InputError(f"{path} = {quote(value)} must be a number > 0 [m]")
        return f"{match[1]}.area", 0.25 * math.pi * value**2, 0.5 * math.pi * value
    return path, value, 1.0


def _options(given, folder):
    """The options of a free number that is not any number between two bounds."""
    if isinstance(given, Free):
        return tuple(Option(n, _all(given.paths, n)) for n in range(int(given.low), int(given.high) + 1))
    if not isinstance(given, Catalogue):
        return tuple(Option(value, _all(given.paths, value)) for value in given.values)
    rows = _rows_of(given.source, folder) if isinstance(given.source, str) else given.source
    options = []
    for number, row in enumerate(rows):
        with refused_at(f"row {number + 1}:"):
            pairs = [setting(f"{given.of}.{key}", value)[:2] for key, value in row.items() if key != "name"]
        options.append(Option(str(row.get("name", f"row {number + 1}")), dict(pairs)))
    labels = [option.label for option in options]
    if twice := next((label for label in labels if labels.count(label) > 1), None):
        raise InputError(f"the name {quote(twice)} stands there twice")
    return tuple(options)


def _all(paths, value):
    return dict(setting(path, value)[:2] for path in paths)


def _rows_of(source, folder):
    """Rows of a catalogue in a CSV file."""
    path = pathlib.Path(source) if folder is None else folder / source
    with in_file(source):
        try:
            with open(path, encoding="utf-8-sig", newline="") as file:
                rows = list(csv.DictReader(file))
        except (OSError, ValueError, csv.Error) as error:
            raise InputError(f"cannot be read: {getattr(error, 'strerror', None) or error}") from None
        if not rows:
            raise InputError("holds no row: the first line names columns, and each other line is a row")
        if any(None in row or None in row.values() for row in rows):
            raise InputError("each row must have as many cells as the first line")
        return [{key.strip(): _cell(key, cell.strip()) for key, cell in row.items() if cell.strip()} for row in rows]


def _cell(key, cell):
    if key.strip() == "name":
        return cell
    try:
        return json.loads(cell)
    except ValueError:
        return cell
