"""Requirements: the table of a requirements file, with a scene, free numbers, conditions and what is least.

May change: private functions, texts of errors, `MOST_RUNS` and `MOST_WHOLE`. Must stay: keys, defaults and docstring of
`Sizing` (format of requirements files and help; after a change write ``validation/REFERENCE.md`` anew); names in
`METHODS` and `KEYS`; `SCENE_FILE`, a file of the folder; `Free`, `Listed` and `Catalogue`, which `space` reads, and
`problem` the first of them; `load`, which `commands.info`, `commands.size` and `size` import; `is_sizing`, which
`commands.check` and `commands.info` import; `shipped`, which `commands.list` imports; public names of `Sizing`,
`Requirement` and `Free`, which other files use. Tests: ``tests/sizing/test_size.py``,
``tests/sizing/test_shipped_sizings.py``.
"""

from __future__ import annotations

import math
import pathlib
from dataclasses import field as plain_field
from typing import TYPE_CHECKING, Any, NamedTuple

from ..accepted import accepts, any_of, array, by_name
from ..errors import InputError, in_file, refused_at
from ..messages import nearest, quote, short
from ..scene import SHIPPED_SIZINGS
from ..sweeps.study import Distribution, Range, Study, between, is_file_of, plain, refuse_unknown, tables_of
from ..sweeps.study import read_parameters as read_draws
from ..tables import Several, Table, boolean, checked, choice, field, integer, real, table, text

if TYPE_CHECKING:
    from os import PathLike

    from ..scene import Scene

SCENE_FILE = "scene.toml"
"""File of a scene that was given in Python, in the folder of its sizing."""
METHODS = ("auto", "gradients", "enumeration", "evolution", "direct")
"""Ways to find the least design."""
MOST_RUNS = 1_000_000
"""Largest number of runs of a sizing."""
MOST_WHOLE = 1000
"""Largest number of values of a whole number."""
RANGE, LISTED, CATALOGUE = ("from", "to", "start", "spacing", "whole"), ("values",), ("catalogue", "of")
"""Keys of a free number between bounds, of one that has listed values, and of a catalogue."""
KEYS = (*RANGE, *LISTED, *CATALOGUE, "paths")
"""All keys of a free number."""


class Free(NamedTuple):
    """A number at some paths between two bounds; ``log`` for steps of equal ratios, ``whole`` for whole numbers."""

    paths: tuple[str, ...]
    low: float
    high: float
    start: float | None
    log: bool
    whole: bool

    def at(self, share: float) -> float:
        """The number at a fraction of its range, 0 to 1."""
        return between(self.low, self.high, self.log, share)

    def share(self, value: float) -> float:
        """The fraction of its range at which a number is."""
        if self.log:
            return math.log(value / self.low) / math.log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)

    def slope(self, share: float) -> float:
        """Derivative of the number by the fraction of its range."""
        return self.at(share) * math.log(self.high / self.low) if self.log else self.high - self.low


class Listed(NamedTuple):
    """Values, one of which stands at some paths."""

    paths: tuple[str, ...]
    values: tuple[Any, ...]


class Catalogue(NamedTuple):
    """Rows of values that go together: a list of tables, or the path of a CSV file; keys are those of a table."""

    source: Any
    of: str


class Requirement(NamedTuple):
    """A condition on results, and the probability with which it must hold; None where nothing is drawn."""

    condition: str
    probability: float | None


def _read_free(name, given):
    """Free numbers by name."""
    if not isinstance(given, dict) or not given:
        raise InputError(
            f'{name} = {quote(given)} must be a table of free numbers, "cable.area" = {{ from = ..., to = ... }}'
        )
    return {key: _free(f"{name}: {short(key)}", key, value) for key, value in _flat(given)}


def _flat(given, above=""):
    """Pairs of name and value; TOML reads dotted keys without quotes as nested tables."""
    for key, value in given.items():
        path = f"{above}.{key}" if above else str(key)
        nested = isinstance(value, dict) and value and not set(value) & set(KEYS)
        if nested and all(isinstance(item, dict | list) for item in value.values()):
            yield from _flat(value, path)
        else:
            yield path, value


def _free(name, path, value):
    if isinstance(value, Free | Listed | Catalogue):
        return value
    if hasattr(value, "tolist"):
        value = value.tolist()
    value = {"values": value} if isinstance(value, list | tuple) else value
    if not isinstance(value, dict):
        wanted = 'a list of values, { from = 1e-6, to = 1e-4 } or { catalogue = "lines.csv" }'
        raise InputError(f"{name} = {quote(value)} must be {wanted}")
    with refused_at(f"{name}:"):
        kind = next((kind for kind in (CATALOGUE, LISTED) if kind[0] in value), RANGE)
        known = [*kind, *(["paths"] if kind is not CATALOGUE else [])]
        for key in value:
            if key not in known:
                raise InputError(f"{short(key)} = {quote(value[key])}: unknown key, {nearest(key, known)}")
        if kind is CATALOGUE:
            return _catalogue(value)
        paths = value.get("paths", [path])
        if not isinstance(paths, list | tuple) or not paths or not all(isinstance(p, str) for p in paths):
            raise InputError(f'paths = {quote(paths)} must be a list of paths, ["cable.area"]')
        return _listed(tuple(paths), value["values"]) if kind is LISTED else _range(tuple(paths), value)


def _catalogue(value):
    source, of = value["catalogue"], checked("of", value.get("of", "cable"), text())
    if isinstance(source, str):
        return Catalogue(source, of)
    if not isinstance(source, list | tuple) or not all(isinstance(row, dict) and row for row in source):
        raise InputError(
            f"catalogue = {quote(source)} must be a CSV file, or a list of tables such as {{ area = 1e-6 }}"
        )
    if not source:
        raise InputError("catalogue = [] must hold at least one row")
    return Catalogue(tuple(source), of)


def _listed(paths, values):
    if not isinstance(values, list | tuple) or not values:
        raise InputError(f"values = {quote(values)} must be a list of at least one value")
    texts = [quote(item) for item in values]
    if twice := next((item for item in texts if texts.count(item) > 1 and len(item) < 60), None):
        raise InputError(f"{twice} stands there twice")
    return Listed(paths, tuple(values))


def _range(paths, value):
    for key in ("from", "to"):
        if key not in value:
            raise InputError(f"{key} is missing: give {key} = ...")
    whole = checked("whole", value.get("whole", False), boolean())
    number = integer() if whole else real()
    low, high = (checked(key, value[key], number) for key in ("from", "to"))
    start = checked("start", value["start"], number) if value.get("start") is not None else None
    log = checked("spacing", value.get("spacing", "linear"), choice("linear", "log")) == "log"
    if not low < high:
        raise InputError(f"to = {high:g} must be > from = {low:g}")
    if log and (whole or not low > 0.0):
        raise InputError(f'spacing = "log": from = {low:g} must be > 0, and the number not whole')
    if whole and (high - low >= MOST_WHOLE or start is not None):
        raise InputError(f"whole = true: at most {MOST_WHOLE} numbers, {low} … {high}, and no start")
    if start is not None and not low <= start <= high:
        raise InputError(f"start = {start:g} must be from {low:g} to {high:g}")
    return Free(paths, low, high, start, log, whole)


def _free_numbers() -> Any:
    number = {"type": "number"}
    ranged = {"type": "object", "properties": {"from": number, "to": number}, "additionalProperties": True}
    return field(accepts(by_name(any_of(array({}, 1), ranged)))(_read_free))


def _requirements() -> Any:
    """Conditions by name."""
    condition = {"type": "string"}
    drawn = {"type": "object", "properties": {"condition": condition, "probability": {"type": "number"}}}

    @accepts(by_name(any_of(condition, {**drawn, "additionalProperties": False})))
    def read(name, value):
        if not isinstance(value, dict) or not value:
            raise InputError(f'{name} = {quote(value)} must be a table of conditions, strong = "margin > 0.5"')
        return {key: _requirement(f"{name}: {short(key)}", entry) for key, entry in value.items()}

    return field(read)


def _requirement(name, entry):
    if isinstance(entry, Requirement):
        return entry
    given = {"condition": entry} if isinstance(entry, str) else entry
    if not isinstance(given, dict) or not isinstance(given.get("condition"), str) or not given["condition"].strip():
        raise InputError(f'{name} = {quote(entry)} must be a condition, "margin > 0.5"')
    for key in given:
        if key not in Requirement._fields:
            raise InputError(f"{name}: {short(key)}: unknown key, {nearest(key, Requirement._fields)}")
    probability = given.get("probability")
    if probability is not None:
        probability = checked(f"{name}: probability", probability, real(above=0, below=1))
    return Requirement(given["condition"], probability)


def _scenes() -> Any:
    """A scene, or a list of scenes one of which is chosen."""

    @accepts(any_of({"type": "string"}, array({"type": "string"}, 1)))
    def read(name, value):
        if isinstance(value, str) or type(value).__name__ == "Scene":
            return value
        if not isinstance(value, list | tuple) or not value or not all(isinstance(v, str) for v in value):
            raise InputError(f"{name} = {quote(value)} must be a scene, or a list of scenes")
        return tuple(value)

    return field(read)


def _draws() -> Any:
    number = {"type": "number"}

    @accepts(by_name({"type": "object", "properties": {"from": number, "to": number}, "additionalProperties": True}))
    def read(name, value):
        read_values = read_draws(name, value) if value else {}
        for path, drawn in read_values.items():
            if not isinstance(drawn, Range | Distribution):
                raise InputError(f'{name}: {short(path)} must be {{ distribution = "norm", ... }} or {{ from, to }}')
        return read_values

    return field(read, default_factory=dict)


@table
class Sizing(Table):
    """The least design of a scene that meets requirements.

    Parameters
    ----------
    scene : str or sequence of str
        A scene file, relative to the requirements file, or the name of a scene shipped with refweb; of a list of them
        one is chosen. In Python also a `refweb.Scene`.
    parameters : dict
        Free numbers, by the paths of ``--set`` or by a name with ``paths``, which all have the value. A list has the
        values that are possible; ``{ from, to }`` is any number between, with ``spacing = "log"`` searched in equal
        ratios, with ``whole = true`` a whole one, and with ``start`` where the search begins. ``{ catalogue }`` is a
        CSV file, or a list of tables, of which one row is chosen: columns are keys of ``[cable]``, or of the table that
        ``of`` names, and ``name``. ``cable.diameter`` stands for the area of a round line.
    requirements : dict
        Conditions on results and free numbers by name, or ``{ condition, probability }`` where numbers are drawn. A
        design meets a condition if it holds for the whole ±.
    minimise : str
        Objective, which is least: a result or an arithmetic expression. Formulas may name, besides the results of the
        scene, ``cable_mass``, ``net_mass`` with point masses, ``total_mass`` with bodies that move, ``cable_length``,
        ``packed_volume`` of which half is cable, ``margin`` of safety, ``utilisation``, and ``frequency_1`` to
        ``frequency_10``.
    title : str
        Title, by default the name of the file. Results are written to a folder of that name.
    method : {"auto", "gradients", "enumeration", "evolution", "direct"}
        "gradients" is for numbers between bounds in statics, for each combination of the others; it finds an optimum
        near each start, for each side of conditions with ``or``. "enumeration" takes all designs, "evolution" is
        differential evolution, and "direct" divides rectangles. "auto" takes the first of gradients, enumeration,
        direct, for up to three numbers between bounds, and evolution that fits.
    starts : int
        Number of starts of "gradients".
    trade_off : bool
        True for further designs by "gradients" with reserves of 5 to 40 %, for the picture of the trade-off.
    runs : int
        Largest number of runs.
    seed : int
        Seed of the search and of what is drawn.
    draws : dict
        Values of the scene that are drawn, by path: ``{ distribution, ... }`` or ``{ from, to }`` as in a study. Each
        design is run with the same draws.
    count : int, optional
        Number of draws. A requirement without probability must hold in each.
    confidence : float
        Level of the interval of a probability by Clopper and Pearson; its lower end must be above the required one.

    Raises
    ------
    InputError
        For bounds that are reversed, a catalogue without rows, a requirement that is always or never true,
        limits of a result that exclude each other, formulas that never have a value, and a minimum that depends on no
        free number. For draws without a count, and a probability that no number of
        successes in so many draws shows.

    Examples
    --------
        scene = "square-load"
        minimise = "cable_mass"
        [parameters]
        "cable.area" = { from = 1e-6, to = 1e-3, spacing = "log" }
        [requirements]
        strong = "max_stress < 1e5"
    """

    scene: str | Several | Scene = _scenes()
    parameters: dict[str, Any] = _free_numbers()
    requirements: dict[str, Any] = _requirements()
    minimise: str = text()
    title: str = text(default="sizing", limit=200)
    method: str = choice(*METHODS, default="auto")
    starts: int = integer(default=3, at_least=1, at_most=1000)
    trade_off: bool = boolean(default=True)
    runs: int = integer(default=1000, at_least=1, at_most=MOST_RUNS)
    seed: int = integer(default=0, at_least=0, at_most=2**63 - 1)
    draws: dict[str, Any] = _draws()
    count: int | None = integer(default=None, at_least=1, at_most=MOST_RUNS)
    confidence: float = real(default=0.95, above=0, below=1)
    folder: pathlib.Path | None = plain_field(default=None, compare=False, metadata={"read": lambda name, value: value})

    @property
    def scenes(self) -> tuple[str, ...]:
        """Names of its scenes."""
        if isinstance(self.scene, tuple):
            return self.scene
        return (self.scene,) if isinstance(self.scene, str) else (SCENE_FILE,)

    def check(self) -> None:
        """Refuse keys that do not fit together."""
        if bool(self.draws) != (self.count is not None):
            what = (
                "count is missing: give the number of draws" if self.draws else "count has no meaning without [draws]"
            )
            raise InputError(f"{what}")
        for name, requirement in self.requirements.items():
            if requirement.probability is None:
                continue
            if self.count is None:
                raise InputError(f"requirements: {name}: probability has no meaning without [draws]")
            needed = math.ceil(math.log(0.5 * (1.0 - self.confidence)) / math.log(requirement.probability))
            if self.count <= needed:
                raise InputError(
                    f"requirements: {name}: probability = {requirement.probability:g} is not shown by count = "
                    f"{self.count} draws that all succeed: it needs count = {needed + 1} or more"
                )

    def drawn(self) -> list[dict[str, Any]]:
        """Values by path of each draw; one without values where nothing is drawn."""
        if not self.draws:
            return [{}]
        from ..sweeps.design import points

        study = Study(scene="drawn", parameters=self.draws, sample="random", count=self.count, seed=self.seed)
        return [case.values for case in points(study)]

    def to_dict(self) -> dict[str, Any]:
        """The requirements as plain TOML values."""
        given = {key: value for key, value in super().to_dict().items() if key not in ("folder", "draws")}
        given["scene"] = list(self.scene) if isinstance(self.scene, tuple) else self.scenes[0]
        given["parameters"] = {name: _plain(value) for name, value in self.parameters.items()}
        given["requirements"] = {
            name: r.condition if r.probability is None else {"condition": r.condition, "probability": r.probability}
            for name, r in self.requirements.items()
        }
        if self.draws:
            given["draws"] = {path: plain(drawn) for path, drawn in self.draws.items()}
        return given


def _plain(given):
    """A free number as plain values."""
    if isinstance(given, Catalogue):
        source = given.source if isinstance(given.source, str) else [dict(row) for row in given.source]
        return {"catalogue": source, "of": given.of}
    if isinstance(given, Listed):
        return {"paths": list(given.paths), "values": [list(v) if isinstance(v, tuple) else v for v in given.values]}
    plain = {"paths": list(given.paths), "from": given.low, "to": given.high}
    plain |= {"start": given.start} if given.start is not None else {}
    return plain | ({"spacing": "log"} if given.log else {}) | ({"whole": True} if given.whole else {})


def shipped() -> dict[str, pathlib.Path]:
    """Paths of the requirements files shipped with refweb, by name."""
    return {path.stem: path for path in sorted(SHIPPED_SIZINGS.glob("*.toml"))}


def is_sizing(source: Any) -> bool:
    """True for a requirements file, and for the name of a shipped one if no file has that name."""
    return is_file_of(source, shipped(), lambda keys: "web" not in keys and {"scene", "requirements"} <= keys)


def load(source: str | PathLike[str]) -> Sizing:
    """The requirements of a TOML file, or of the name of requirements shipped with refweb.

    Raises
    ------
    InputError
        Where there is no such file or name, or it is wrong.
    """
    path, given = tables_of(source, shipped(), "requirements")
    with in_file(path.name):
        if "requirements" not in given:
            wanted = "a scene, [parameters], [requirements] and what to minimise"
            raise InputError(f"holds no requirements: a requirements file has {wanted}")
        refuse_unknown(given, Sizing)
        return Sizing(**{"title": path.stem, **given, "folder": path.resolve().parent})
