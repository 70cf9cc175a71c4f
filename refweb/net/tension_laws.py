"""Tension laws by name: stress, tangent and energy density of a cable against its engineering strain.

Each law is a class of `refweb.net.laws`; `Law` evaluates one of them over arrays, without a net.

May change: texts of errors. Must stay: `Law` with its arguments and methods, which `refweb` exports and
`system.weak_form` takes; `law_of` and `names_in`, by which `cable`, `discretisation`, `law_keys`, `effects.thread`,
`studies.form` and `results.observables.line` find laws; `strains_of`, which `cable` and `studies.form` call. Tests:
``tests/net/test_laws.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError
from ..messages import nearest
from ..registry import LAWS, known, load, possible
from .laws.law import evaluate
from .laws.line_data import LineData
from .plastic_keys import plastic_strain_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Numbers = float | NDArray[np.float64]


def law_of(name) -> Any:
    """Class of a law by its name; refuses an unknown one."""
    if not known(LAWS, name):
        raise InputError(f'law = "{name}" is unknown, {nearest(name, possible(LAWS))}')
    return load(LAWS[name])


def names_in(laws):
    """Names among those of the laws of some lines, an array of texts, each once and sorted."""
    names, left = [], np.ones(len(laws), dtype=bool)
    while left.any():
        names.append(str(laws[left.argmax()]))
        left &= laws != names[-1]
    return sorted(names)


@dataclass(frozen=True)
class Law:
    """A tension law by name, vectorised over strain and parameters.

    Parameters
    ----------
    name : {"smooth", "tension-only", "linear", "force-density", "constant-force"}
        ``smooth`` has slackness ε0 ≥ 0 and smoothing η ≥ 0; ``tension-only`` is its limit η → 0 at ε0 = 0, of convex
        energy; ``linear`` resists compression like a bar; the others are those of form finding.

    Raises
    ------
    InputError
        For an unknown name, and a law with numbers of its own, such as a curve.

    Notes
    -----
    All methods take engineering strain [1], modulus E [Pa], slackness ε0 [1] and smoothing η [1], which broadcast.
    """

    name: str = "smooth"

    def __post_init__(self) -> None:
        if law_of(self.name).columns:
            raise InputError(f'law = "{self.name}" has numbers of its own: evaluate it by a net of lines')

    def _evaluate(self, which, *numbers):
        strain, *numbers = np.broadcast_arrays(*numbers)
        law = law_of(self.name)
        out = evaluate(getattr(law, which), strain.ravel(), LineData.of_law(*numbers), law.columns)
        return out.reshape(strain.shape)[()]

    def stress(
        self, strain: Numbers, modulus: Numbers = 1.0, slackness: Numbers = 0.0, smoothing: Numbers = 0.0
    ) -> Any:
        """Stress σ = T/A [Pa]."""
        return self._evaluate("stress", strain, modulus, slackness, smoothing)

    def strain(
        self, stress: Numbers, modulus: Numbers = 1.0, slackness: Numbers = 0.0, smoothing: Numbers = 0.0
    ) -> Any:
        """Strain of a tension, stress σ > 0 [Pa]; of the linear law of any σ."""
        stress, *numbers = np.broadcast_arrays(stress, modulus, slackness, smoothing)
        return law_of(self.name).strain_of(stress.ravel(), LineData.of_law(*numbers)).reshape(stress.shape)[()]

    def tangent(
        self, strain: Numbers, modulus: Numbers = 1.0, slackness: Numbers = 0.0, smoothing: Numbers = 0.0
    ) -> Any:
        """Tangent modulus dσ/dε [Pa]."""
        return self._evaluate("tangent", strain, modulus, slackness, smoothing)

    def energy_density(
        self, strain: Numbers, modulus: Numbers = 1.0, slackness: Numbers = 0.0, smoothing: Numbers = 0.0
    ) -> Any:
        """Energy per natural volume ∫σ dε, zero at ε = 0 [J/m³]."""
        return self._evaluate("energy_density", strain, modulus, slackness, smoothing)

    def floor(self, modulus: Numbers = 1.0, slackness: Numbers = 0.0, smoothing: Numbers = 0.0) -> Any:
        """Largest stress under compression, αE [Pa]; 0 for tension-only, infinite for laws without a floor."""
        numbers = np.broadcast_arrays(modulus, slackness, smoothing)
        return law_of(self.name).floor(LineData.of_law(*numbers)).reshape(numbers[0].shape)[()]


def strains_of(values, tension):
    """Strain of each line that has a tension [N], 0 of none; shape (lines,).

    Parameters
    ----------
    values : dict of str to ndarray
        Properties of the lines, see `refweb.net.cable.Cable.properties`.
    tension : ndarray, shape (lines,)
        Their tensions [N].

    Raises
    ------
    InputError
        For a law of form finding, a line that pushes and whose law does not, one that pushes with more than its EA, and
        a tension that is too large for the law.
    """
    strain = np.zeros(len(tension))
    for name in names_in(values["law"]):
        law, lines = law_of(name), (values["law"] == name) & (tension != 0.0)
        if not lines.any():
            continue
        if law.forming:
            raise InputError(f'law = "{name}" is for form finding: give "tension-only", "linear" or "smooth"')
        for line in np.flatnonzero(lines & (tension < 0.0))[:1] if not law.bar else ():
            raise InputError(f'line {line} pushes with {-tension[line]:g} N, and law = "{name}" does not: use "linear"')
        own_values = {key: value[lines] for key, value in values.items()}
        axial, smooth = own_values["modulus"] * own_values["area"], ("slackness", "smoothing")
        numbers = {key: own_values[key] for key in smooth} | law.numbers(own_values)
        strain[lines] = law.strain_of(tension[lines], LineData.of_law(axial, **numbers))
        if law.plastic:
            strain += plastic_strain_of(np.where(lines, tension / values["area"], 0.0), values["yield_curve"])
        for line in np.flatnonzero(lines & ~np.isfinite(strain))[:1]:
            raise InputError(
                f'line {line} cannot have a tension of {tension[line]:g} N: law = "{name}" has none so large'
            )
    for line in np.flatnonzero(strain <= -1.0)[:1]:
        raise InputError(f"line {line} pushes with {-tension[line]:g} N, more than its EA: give it a larger area")
    return strain
