"""The cases of a study: which values each of them has, and the scene that they make of the base."""

from __future__ import annotations

import hashlib
import itertools
import json
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
"""Number of hexadecimal digits that a case is known by."""


class Case(NamedTuple):
    """Case of a study.

    Attributes
    ----------
    values : dict
        Values by path.
    group : int
        Number of the combination of lists that it belongs to: its samples have a distribution of their own.
    draw : int
        Number of its sample, −1 in designs without samples.
    part : str
        Of Sobol's indices, which matrix of samples it is of: "A", "B", or the path in which A has a column of B.
    key : str
        Key of the content of its scene; empty for a skipped case.
    given : dict, optional
        Its scene as a file would have it.
    """

    values: dict[str, Any]
    group: int
    draw: int
    part: str = ""
    key: str = ""
    given: dict[str, Any] | None = None


class Base(NamedTuple):
    """The scene that cases differ from: what a file says, the folder that paths in it start at, and its name."""

    given: dict[str, Any]
    folder: pathlib.Path | None
    file: str

    def scene(self, case_values):
        """(What a file would say, scene) of some values by path."""
        given, name = self.given, self.file
        text = ", ".join(f"{short(key)} = {quote(value)}" for key, value in case_values.items())
        with in_file(f"{name} with {text}" if text else name):
            for path, value in case_values.items():
                given = with_value(given, path, value)
            return given, Scene.from_dict(given, self.folder, f"{name} with {text}" if text else name)


def points(study):
    """Values of all cases, each a `Case` without its scene, in their order."""
    lists = study.listed
    combinations = list(zip(*lists.values(), strict=True)) if study.sample == "zip" else None
    count = (
        len(combinations) if combinations is not None else int(np.prod([len(v) for v in lists.values()], dtype=float))
    )
    samples = _samples(study)
    if count * max(len(samples), 1) > MOST_CASES:
        raise InputError(f"the study has {count * max(len(samples), 1)} cases, must be at most {MOST_CASES}")
    combinations = combinations or list(itertools.product(*lists.values()))
    cases = []
    for group, combination in enumerate(combinations):
        chosen = dict(zip(lists, combination, strict=True))
        for draw, part, drawn in samples or [(-1, "", {})]:
            values = chosen | drawn
            cases.append(Case({path: values[path] for path in study.parameters}, group if samples else 0, draw, part))
    return cases


def groups(study):
    """Values of the lists in each group, as (path, value) pairs; one group without any where there are no samples."""
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
        return [(n, "", row) for n, row in enumerate(_placed(drawn, _uniform(study, len(drawn))))]
    both = _uniform(study, 2 * len(drawn))
    first, second = both[:, : len(drawn)], both[:, len(drawn) :]
    parts = {"A": first, "B": second}
    for column, path in enumerate(drawn):
        parts[path] = first.copy()
        parts[path][:, column] = second[:, column]
    return [(n, part, row) for part, shares in parts.items() for n, row in enumerate(_placed(drawn, shares))]


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


def _placed(drawn, shares):
    """Values by path, a dict for each sample, at shares of their distributions, shape (samples, paths)."""
    columns = []
    for distribution, column in zip(drawn.values(), shares.T, strict=True):
        if isinstance(distribution, Distribution):
            values = distribution.frozen.ppf(column)
            columns.append((values.astype(int) if distribution.discrete else values).tolist())
        else:
            columns.append([distribution.at(share) for share in column.tolist()])
    return [dict(zip(drawn, row, strict=True)) for row in zip(*columns, strict=True)]


def cases_of(study, base):
    """All cases with their scenes; of those that are skipped ``given`` is None.

    Raises
    ------
    InputError
        Where values do not make a scene: names them, and what may be done.
    """
    skips = None
    if study.skip is not None:
        with in_file("skip:"):
            skips = Expression(study.skip, list(study.parameters))
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
    """Key that tells a scene apart from all others, by whatever its results depend on.

    That is all of its tables with their defaults, the content of files that it reads, and the version of refweb; not
    its title, which a page or plot has and no result.

    Parameters
    ----------
    scene : refweb.Scene
        The scene.
    known : dict, optional
        Digests of files that have been read, by path; filled.
    """
    tables = scene.to_dict()
    del tables["title"]
    files = {str(path): _digest(path, {} if known is None else known) for path in files_of(tables)}
    tables = with_files(tables, lambda path: "")
    tables["solve"].pop("start", None) if files and scene.start_folder else None
    text = json.dumps([__version__, tables, list(files.values())], sort_keys=False, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:KEY]


def files_of(given):
    """Files that the scene of a dict with absolute paths reads."""
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
