"""The cases of a study: the values of each case, and its scene, made of the base scene.

May change: private functions and texts of errors. Must stay: the digest by `key_of`, its length `KEY`, and the order of
samples and of cases: with others all cases of stored studies run again. `sizing`, `episodes` and `sweep` call this
file. Must stay as well: all names that `sweep`, `sizing.requirements` and other files import; public names of `Case`,
which other files use. Tests: ``tests/sweeps/test_sweep.py``, ``tests/sweeps/test_chances.py``.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import math
import pathlib
import warnings
from typing import Any, NamedTuple

import numpy as np

from .. import __version__
from ..errors import InputError, in_file
from ..messages import quote, short
from ..reference.paths import with_value
from ..registry import paths_of, with_files
from ..scene import Scene
from .expressions import Expression
from .study import MOST_CASES, Distribution

KEY = 16
"""Number of hexadecimal digits of the key of a case."""


class Case(NamedTuple):
    """Case of a study.

    Attributes
    ----------
    values : dict
        Values by path.
    group : int
        Number of its combination of lists; statistics of samples are computed for each combination.
    draw : int
        Number of its sample, −1 in designs without samples.
    part : str
        Matrix of samples for Sobol's indices: "A", "B", or the path of the column of A that is replaced by that of B.
    key : str
        Digest of its scene; empty for a skipped case.
    given : dict, optional
        Its scene as the dict of a scene file.
    """

    values: dict[str, Any]
    group: int
    draw: int
    part: str = ""
    key: str = ""
    given: dict[str, Any] | None = None


class Base(NamedTuple):
    """The base scene of all cases: the dict of its file, the folder at which relative paths start, and its name."""

    given: dict[str, Any]
    folder: pathlib.Path | None
    file: str

    def name(self, case_values):
        """Name of the scene with some values by path, in messages."""
        text = ", ".join(f"{short(key)} = {quote(value)}" for key, value in case_values.items())
        return f"{self.file} with {text}" if text else self.file

    def scene(self, case_values):
        """The dict of a scene file with some values by path, and its scene."""
        given, name = self.given, self.name(case_values)
        with in_file(name):
            for path, value in case_values.items():
                given = with_value(given, path, value)
            return given, Scene.from_dict(given, self.folder, name)


def points(study):
    """All cases in their order, each a `Case` with values and without scene."""
    lists = study.listed
    combinations = zip(*lists.values(), strict=True) if study.sample == "zip" else itertools.product(*lists.values())
    lengths = [len(values) for values in lists.values()]
    samples = _samples(study)
    count = (lengths[0] if study.sample == "zip" else math.prod(lengths)) * max(len(samples), 1)
    if count > MOST_CASES:
        raise InputError(f"the study has {count} cases, must be at most {MOST_CASES}")
    cases = []
    for group, combination in enumerate(combinations):
        chosen = dict(zip(lists, combination, strict=True))
        for draw, part, drawn in samples or [(-1, "", {})]:
            values = chosen | drawn
            cases.append(Case({path: values[path] for path in study.parameters}, group if samples else 0, draw, part))
    return cases


def groups(study):
    """Values of the lists in each group, as (path, value) pairs; without samples one group without values."""
    if not study.drawn:
        return [{}]
    varied = {path: values for path, values in study.listed.items() if len(values) > 1}
    return [dict(zip(varied, combination, strict=True)) for combination in itertools.product(*varied.values())]


def _samples(study):
    """(Number, part, values by path) of each sample."""
    drawn = study.drawn
    if not drawn:
        return []
    if not study.indices:
        return [(n, "", row) for n, row in enumerate(placed(drawn, _uniform(study, len(drawn))))]
    first, second = np.hsplit(_uniform(study, 2 * len(drawn)), 2)
    parts = {"A": first, "B": second}
    for column, path in enumerate(drawn):
        parts[path] = first.copy()
        parts[path][:, column] = second[:, column]
    return [(n, part, row) for part, shares in parts.items() for n, row in enumerate(placed(drawn, shares))]


def _uniform(study, width):
    """Samples of the unit cube, shape (count, width)."""
    from scipy.stats import qmc

    generator = np.random.default_rng(study.seed)
    if study.sample == "random":
        return generator.random((study.count, width))
    kind = {"sobol": qmc.Sobol, "halton": qmc.Halton, "latin-hypercube": qmc.LatinHypercube}[study.sample]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # a count that is no power of 2 is told with the results
        return kind(width, scramble=True, seed=generator).random(study.count)


def placed(drawn, shares):
    """Values by path, a dict for each sample, from probabilities of the distributions, shape (samples, paths)."""
    columns = []
    for distribution, column in zip(drawn.values(), shares.T, strict=True):
        if isinstance(distribution, Distribution):
            values = distribution.frozen.ppf(column)
            columns.append((values.astype(int) if distribution.discrete else values).tolist())
        else:
            columns.append([distribution.at(share) for share in column.tolist()])
    return [dict(zip(drawn, row, strict=True)) for row in zip(*columns, strict=True)]


def cases_of(study, base):
    """All cases with their scenes; ``given`` of a skipped case is None.

    Raises
    ------
    InputError
        If values do not make a valid scene; the message names the values and a remedy.
    """
    with in_file("skip:"):
        skips = None if study.skip is None else Expression(study.skip, list(study.parameters))
    known, cases = {}, []
    for case in points(study):
        if skips is not None:
            with in_file("skip:"):
                skipped = skips(case.values)
            if skipped:
                cases.append(case)
                continue
        try:
            given, scene = base.scene(case.values)
        except InputError as error:
            hint = '; skip leaves out cases by a condition, such as skip = "mass <= 0"'
            raise InputError(f"{error}{hint if len(cases) or skips else ''}") from None
        cases.append(case._replace(key=key_of(scene, known), given=given))
    return cases


def key_of(scene, known=None):
    """Digest of everything on which the results of a scene depend.

    This is all tables with their defaults, the content of the files that it reads, and the version of refweb. The title
    is not part of it.

    Parameters
    ----------
    scene : refweb.Scene
        The scene.
    known : dict, optional
        Digests of files by path; new ones are added.
    """
    tables = scene.to_dict()
    del tables["title"]
    files = {str(path): _digest(path, {} if known is None else known) for path in files_of(tables)}
    tables = with_files(tables, lambda path: "")
    tables["solve"].pop("start", None) if files and scene.start_folder else None
    text = json.dumps([__version__, tables, list(files.values())], sort_keys=False, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:KEY]


def files_of(given):
    """Files that a scene reads, given as a dict with absolute paths."""
    files, start = paths_of(given), given["solve"].get("start", "web")
    if pathlib.Path(start).is_absolute():
        files += [str(pathlib.Path(start) / name) for name in ("run.json", "scene.toml", "checkpoint.npz")]
    return files


def _digest(path, known):
    if path not in known:
        try:
            known[path] = hashlib.sha256(pathlib.Path(path).read_bytes()).hexdigest()
        except OSError:
            known[path] = ""  # the run says what is missing
    return known[path]
