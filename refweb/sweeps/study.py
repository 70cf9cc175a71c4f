"""Studies: the table of a study file, with a scene, its varying values, their sampling and conditions on results.

May change: private functions, texts of errors and `MOST_CASES`. Must stay: keys, defaults and docstring of `Study`
(format of study files and help; after a change write ``validation/REFERENCE.md`` anew); names in `DESIGNS`, `SAMPLES`
and of distributions; `Range`, `Distribution` and `read_parameters`, which `sizing.requirements`, `episodes` and `gym`
use; all names that `sizing.requirements`, `episodes` and other files import; public names of `Study` and
`Distribution`, which other files use. Tests: ``tests/sweeps/test_sweep.py``, ``tests/sweeps/test_study_pages.py``.
"""

from __future__ import annotations

import functools
import math
import os
import pathlib
import tomllib
from collections import Counter
from dataclasses import field as plain_field
from typing import TYPE_CHECKING, Any, NamedTuple

from ..accepted import accepts, any_of, array, by_name
from ..errors import InputError, in_file, refused_at
from ..messages import nearest, quote, short
from ..scene import SHIPPED_STUDIES
from ..tables import Several, Table, boolean, checked, choice, field, integer, numbers_list, real, table, text

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator
    from os import PathLike

DESIGNS = ("grid", "zip")
"""Ways to combine lists and ranges."""
SAMPLES = ("random", "sobol", "halton", "latin-hypercube")
"""Ways to take samples of ranges and distributions."""
MOST_CASES = 1_000_000
"""Largest number of cases."""


def between(low: float, high: float, log: bool, share: float) -> float:
    """The number at a fraction of a range, 0 to 1: in equal steps, or with ``log`` in equal ratios."""
    if share in (0.0, 1.0):
        return high if share else low
    if log:
        return math.exp(math.log(low) * (1.0 - share) + math.log(high) * share)
    return low + (high - low) * share


class Range(NamedTuple):
    """``count`` numbers from ``low`` to ``high`` (None: one for each sample), equally far apart or in equal ratios."""

    low: float
    high: float
    count: int | None
    log: bool

    def at(self, share: float) -> float:
        """The number at a fraction of the range, 0 to 1."""
        return between(self.low, self.high, self.log, share)


class Distribution(NamedTuple):
    """A distribution of scipy, by name, and its parameters."""

    name: str
    keys: tuple[Any, ...]

    @property
    def frozen(self) -> Any:
        """Frozen distribution of `scipy.stats`, with its parameters."""
        return _frozen(self)

    @property
    def discrete(self) -> bool:
        """True if its values are whole numbers."""
        from scipy import stats

        return isinstance(getattr(stats, self.name), stats.rv_discrete)


@functools.lru_cache
def _frozen(distribution):
    from scipy import stats

    return getattr(stats, distribution.name)(**dict(distribution.keys))


def read_parameters(name: str, given: Any, repeats: bool = False) -> dict[str, Any]:
    """Parameters of a study by path: a list of cases, a `Range` or a `Distribution`.

    A list with an equal value twice is refused unless it may have ``repeats``, as in a "zip".
    """
    if not isinstance(given, dict) or not given:
        raise InputError(f'{name} = {quote(given)} must be a table of values by path, "solve.duration" = [0.1, 0.2]')
    parameters = {path: _parameter(f"{name}: {short(path)}", value) for path, value in by_path(given)}
    if not repeats:
        _refuse_equal_values(name, _lists(parameters))
    return parameters


def _lists(parameters):
    """Lists of values among parameters, by path."""
    return {path: values for path, values in parameters.items() if not isinstance(values, Range | Distribution)}


def _refuse_equal_values(name, lists):
    """Refuse an equal value twice of one list."""
    for path, values in lists.items():
        _refuse_repeats(f"{name}: {short(path)}", [values])


def _refuse_repeats(name, lists):
    """Refuse a case that stands there twice, in lists of values side by side; long values are not told apart."""
    cases = Counter(zip(*([quote(value) for value in values] for values in lists), strict=True))
    for case, count in cases.items():
        if count > 1 and all(len(text) < 60 for text in case):
            raise InputError(f"{name}: {', '.join(case)} stands there twice: each case is run once")


_KEYS = {"from", "to", "count", "spacing", "distribution"}


def by_path(given: dict[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Pairs of path and value; TOML reads dotted keys without quotes as nested tables."""
    for key, value in given.items():
        path = f"{above}.{key}" if above else str(key)
        if isinstance(value, dict) and value and all(isinstance(item, dict | list) for item in value.values()):
            yield from by_path(value, path)
        else:
            yield path, value


def _parameter(name, value):
    if isinstance(value, Range | Distribution):
        return value
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, list | tuple):
        if not value:
            raise InputError(f"{name} = [] must hold at least one case")
        return tuple(value)
    if not isinstance(value, dict):
        wanted = 'a list of cases, { from = 0, to = 1, count = 5 } or { distribution = "norm", loc = 0, scale = 1 }'
        raise InputError(f"{name} = {quote(value)} must be {wanted}")
    with refused_at(f"{name}:"):
        if "distribution" in value:
            return _distribution(value)
        return _range(value)


def _range(value):
    known = ["from", "to", "count", "spacing"]
    for key in value:
        if key not in known:
            hint = nearest(key, [*known, "distribution"])
            raise InputError(f"{short(key)} = {quote(value[key])}: unknown key, {hint}")
    for key in ("from", "to"):
        if key not in value:
            raise InputError(f"{key} is missing: give {key} = ...")
    low, high = (checked(key, value[key], real()) for key in ("from", "to"))
    count = checked("count", value["count"], integer(at_least=1, at_most=MOST_CASES)) if "count" in value else None
    log = checked("spacing", value.get("spacing", "linear"), choice("linear", "log")) == "log"
    if low == high:
        raise InputError(f"to = {high:g} must differ from from = {low:g}")
    if log and not (low > 0.0 and high > 0.0):
        raise InputError(f'spacing = "log": from = {low:g} and to = {high:g} must be > 0')
    return Range(low, high, count, log)


def _distribution(value):
    from scipy import stats

    known = [n for n in dir(stats) if isinstance(getattr(stats, n), stats.rv_continuous | stats.rv_discrete)]
    name = value["distribution"]
    if name not in known:
        raise InputError(f"distribution = {quote(name)} is none of scipy.stats, {nearest(name, known)}")
    kind = getattr(stats, name)
    shapes = [shape.strip() for shape in (kind.shapes or "").split(",") if shape.strip()]
    keys = [*shapes, "loc", *(["scale"] if isinstance(kind, stats.rv_continuous) else [])]
    for key in value:
        if key not in keys and key != "distribution":
            raise InputError(f"{short(key)} = {quote(value[key])}: {name} has no such parameter, {nearest(key, keys)}")
    for key in shapes:
        if key not in value:
            raise InputError(f"{key} is missing: {name} needs {key} = ...")
    distribution = Distribution(name, tuple((key, checked(key, value[key], real())) for key in keys if key in value))
    if not all(math.isfinite(x) for x in (distribution.frozen.ppf(0.3), distribution.frozen.ppf(0.7))):
        raise InputError(f"{name} does not exist with {', '.join(f'{k} = {v:g}' for k, v in distribution.keys)}")
    return distribution


def parameters() -> Any:
    """Values that vary, by path."""
    number = {"type": "number"}
    ranged = {"type": "object", "properties": {"from": number, "to": number}, "additionalProperties": True}

    @accepts(by_name(any_of(array({}, 1), ranged)))
    def read(name, value):
        return read_parameters(name, value, repeats=True)

    return field(read)


def texts_by_name() -> Any:
    """Texts by name."""

    @accepts(by_name({"type": "string"}))
    def read(name, value):
        if not isinstance(value, dict):
            raise InputError(f'{name} = {quote(value)} must be a table of texts, safe = "max_stress < 2e8"')
        for key, entry in value.items():
            if not isinstance(entry, str) or not entry.strip():
                raise InputError(f'{name}: {short(key)} = {quote(entry)} must be a text, such as "max_stress < 2e8"')
        return dict(value)

    return field(read, default_factory=dict)


@table
class Study(Table):
    """Many runs of one scene.

    Parameters
    ----------
    scene : str
        A scene file, relative to the study, or the name of a scene shipped with refweb.
    parameters : dict
        Values that vary, by the paths of ``--set``: a list of values, also of vectors; ``{ from, to, count, spacing
        }``, with equal ratios for ``spacing = "log"``; or ``{ distribution, ... }`` with the names of scipy.stats for
        distributions and their parameters.
    title : str
        Title, by default the name of the file. Results are written to a folder of that name.
    sample : {"grid", "zip", "random", "sobol", "halton", "latin-hypercube"}
        "grid" combines every value with every other; "zip" the first values of all parameters, then the second ones.
        The others take samples of all ranges and distributions together, independent or evenly spread, for every
        combination of the lists.
    count : int, optional
        Number of samples.
    seed : int
        Seed of the samples.
    skip : str, optional
        A condition on the parameters; a case for which it is true is not run.
    keep : {"none", "json", "all"}
        Data of each run to keep: its row only, also its ``run.json``, or its whole result folder.
    conditions : dict
        Conditions on results and parameters by name. The result is the share of cases for which a condition is true,
        for samples its probability. ± is taken through the arithmetic of a condition. A case that ± leaves undecided is
        neither true nor false: such cases are counted apart, and the share has a lower and an upper value.
    quantiles : sequence of float
        Quantiles of each result, for samples.
    confidence : float
        Level of the confidence intervals.
    indices : bool
        True to compute Sobol's indices, the parts of the spread due to each parameter, for samples by "sobol". This
        takes count × (number of ranges and distributions + 2) cases instead of count.

    Raises
    ------
    InputError
        For wrong parameters, samples without a count or without a distribution or range, and distributions on a grid.
        For lists of different lengths in a zip. For indices with other samples than "sobol", or with a count that is no
        power of 2.

    Examples
    --------
        scene = "square-impact"
        sample = "random"
        count = 64
        [parameters]
        "body.0.velocity.2" = { distribution = "norm", loc = 1, scale = 0.1 }
        [conditions]
        safe = "max_stress < 2e8"
    """

    scene: str = text()
    parameters: dict[str, Any] = parameters()
    title: str = text(default="study", limit=200)
    sample: str = choice(*DESIGNS, *SAMPLES, default="grid")
    count: int | None = integer(default=None, at_least=1, at_most=MOST_CASES)
    seed: int = integer(default=0, at_least=0, at_most=2**63 - 1)
    skip: str | None = text(default=None)
    keep: str = choice("none", "json", "all", default="none")
    conditions: dict[str, Any] = texts_by_name()
    quantiles: Several = numbers_list(default=(0.05, 0.5, 0.95))
    confidence: float = real(default=0.95, above=0, below=1)
    indices: bool = boolean(default=False)
    folder: pathlib.Path | None = plain_field(default=None, compare=False, metadata={"read": lambda name, value: value})

    @property
    def listed(self) -> dict[str, list[Any]]:
        """Parameters with a list of values, and in "grid" and "zip" ranges, with all values."""
        return {path: _values(values) for path, values in self.parameters.items() if path not in self.drawn}

    @property
    def drawn(self) -> dict[str, Range | Distribution]:
        """Parameters that are sampled."""
        sampled = self.sample in SAMPLES
        pairs = self.parameters.items() if sampled else ()
        return {path: values for path, values in pairs if isinstance(values, Range | Distribution)}

    def check(self) -> None:
        """Refuse keys that do not fit together."""
        for q in self.quantiles:
            if not 0.0 < q < 1.0:
                raise InputError(f"quantiles = {q:g} must be between 0 and 1")
        if self.sample in SAMPLES:
            self._check_samples()
        else:
            self._check_design()
        self._refuse_equal_cases()

    def _check_samples(self):
        if not self.drawn:
            raise InputError(f'sample = "{self.sample}" needs a range or a distribution among the parameters')
        if self.count is None:
            raise InputError(f'count is missing: sample = "{self.sample}" needs the number of samples, count = 64')
        for path, parameter in self.drawn.items():
            if isinstance(parameter, Range) and parameter.count is not None:
                raise InputError(
                    f"parameters: {path}: count = {parameter.count} has no meaning with sample = {quote(self.sample)}, "
                    "whose count is that of all samples: leave it out"
                )
        if self.indices and self.sample != "sobol":
            raise InputError(f'indices = true needs sample = "sobol", not {quote(self.sample)}')
        if self.indices and self.count & (self.count - 1):
            raise InputError(f"count = {self.count} must be a power of 2 for indices, such as 64")

    def _check_design(self):
        for path, parameter in self.parameters.items():
            if isinstance(parameter, Distribution):
                known = ", ".join(f'"{name}"' for name in SAMPLES)
                raise InputError(f"parameters: {path}: a distribution needs sample = one of {known}, and a count")
            if isinstance(parameter, Range) and parameter.count is None:
                raise InputError(f"parameters: {path}: count is missing: give the number of values, count = 5")
        for key, given in (("count", self.count), ("indices", self.indices)):
            if given:
                raise InputError(f'{key} = {quote(given)} has no meaning with sample = "{self.sample}": leave it out')
        lengths = {path: len(values) for path, values in self.listed.items()}
        if self.sample == "zip" and len(set(lengths.values())) > 1:
            text = ", ".join(f"{path} has {number}" for path, number in lengths.items())
            raise InputError(f'sample = "zip" needs as many values of each parameter: {text}')

    def _refuse_equal_cases(self):
        """Refuse an equal value twice of one list; of a "zip", equal values of all lists together.

        A range has no equal values, so that a zip with one has no equal cases.
        """
        lists = _lists(self.parameters)
        if self.sample != "zip":
            _refuse_equal_values("parameters", lists)
        elif len(lists) == len(self.parameters):
            _refuse_repeats(f"parameters: {short(' and '.join(lists))}", lists.values())

    def to_dict(self) -> dict[str, Any]:
        """The study as plain TOML values."""
        given = {key: value for key, value in super().to_dict().items() if key not in ("folder", "parameters")}
        return {key: value for key, value in given.items() if value != {}} | {
            "parameters": {path: plain(parameter) for path, parameter in self.parameters.items()}
        }


def _values(parameter: Any):
    """All values of a list or a range."""
    if not isinstance(parameter, Range):
        return list(parameter)
    count = parameter.count or 1
    return [parameter.at(n / max(count - 1, 1)) for n in range(count)]


def plain(parameter):
    """A parameter as plain TOML values."""
    if isinstance(parameter, Range):
        count = {"count": parameter.count} if parameter.count else {}
        return {"from": parameter.low, "to": parameter.high} | count | ({"spacing": "log"} if parameter.log else {})
    if isinstance(parameter, Distribution):
        return {"distribution": parameter.name, **dict(parameter.keys)}
    return [list(x) if isinstance(x, tuple) else x for x in parameter]


def shipped() -> dict[str, pathlib.Path]:
    """Paths of the studies shipped with refweb, by name."""
    return {path.stem: path for path in sorted(SHIPPED_STUDIES.glob("*.toml"))}


def is_file_of(source: Any, shipped: Collection[str], fits: Callable[[Any], bool]) -> bool:
    """True for a TOML file whose keys fit a kind, and for a name that is ``shipped`` if no file has it."""
    path = pathlib.Path(source)
    if not os.path.isfile(path):  # False of a name that no file can have
        return path.name.removesuffix(".toml") in shipped and len(path.parts) == 1
    try:
        return fits(tomllib.loads(path.read_bytes().decode("utf-8-sig")).keys())
    except (ValueError, OSError, RecursionError):
        return False


def tables_of(
    source: str | PathLike[str], shipped: dict[str, pathlib.Path], kind: str
) -> tuple[pathlib.Path, dict[str, Any]]:
    """The path of a TOML file, or of a name that is ``shipped``, and its tables; ``kind`` names it in messages.

    Raises
    ------
    InputError
        Where there is no such file or name, and where it cannot be read.
    """
    path = pathlib.Path(source)
    if not path.is_file():
        if (name := str(path).removesuffix(".toml")) not in shipped:
            hint = nearest(path.stem, shipped)
            raise InputError(f"{short(str(source))}: no such file and no shipped {kind}, {hint}")
        path = shipped[name]
    try:
        return path, tomllib.loads(path.read_bytes().decode("utf-8-sig"))
    except (ValueError, OSError, RecursionError) as error:
        raise InputError(f"{path.name}: cannot be read: {error}") from None


def refuse_unknown(given: dict[str, Any], kind: type[Table]) -> None:
    """Refuse a table or key of a file that its kind does not have; `InputError`."""
    known = [key for key in kind.keys({}) if key != "folder"]
    for key in given:
        if key not in known:
            raise InputError(f"{short(key)} = {quote(given[key])}: unknown table or key, {nearest(key, known)}")


def is_study(source: Any) -> bool:
    """True for a study file, and for the name of a shipped study if no file and no shipped scene has that name."""
    return is_file_of(
        source, shipped(), lambda keys: not keys & {"web", "requirements"} and {"scene", "parameters"} <= keys
    )


def load(source: str | PathLike[str]) -> Study:
    """The study of a TOML file, or of the name of a study shipped with refweb.

    Raises
    ------
    InputError
        Where there is no such file or study, or it is wrong.
    """
    path, given = tables_of(source, shipped(), "study")
    with in_file(path.name):
        if "web" in given and "parameters" not in given:
            raise InputError("is a scene, not a study, which has a scene and [parameters]: use refweb run")
        if "requirements" in given:
            raise InputError("holds requirements, and is no study: use refweb size")
        refuse_unknown(given, Study)
        return Study(**{"title": path.stem, **given, "folder": path.resolve().parent})
