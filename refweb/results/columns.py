"""Columns of ``history.csv`` beside the observables, by the effects of a system.

Statics and dynamics write these columns. No observable, event, body or group may have the name of one.

May change: only with the file format of ``history.csv``. Must stay: names of columns, `FIRST`, `VECTORS` and `AXES`
among them, some of which `dynamics.history`, `results.state` and `pictures.balances` repeat; vectors as the last;
`taken`, by which `build` refuses the same name of an observable; `components`, which `dynamics.history` and
`integrators.integrator` import; `dynamic_energies`, which `dynamics.history` imports; `static_energies`, which `state`
and `statics.simulation` import. Tests: ``tests/test_build.py``, ``tests/results/test_results.py``.
"""

from __future__ import annotations

AXES = "xyz"
VECTORS = ("momentum", "support_impulse", "outer_impulse")
"""Vectors of the momentum balance of a dynamic run; the last exists where external forces act."""
FIRST = {"static": "step [1]", "dynamic": "time [s]"}
"""First column, by kind of run."""


def static_energies(system):
    """Names of the energies of an equilibrium; work is left out if loads that are not dead act."""
    stored = dict.fromkeys(term.balance.column for term in system.terms if term.energy is not None)
    works = [term for term in system.terms if term.balance.column == "work"]
    known = works and all(term.energy is not None for term in works)
    return [*(book for book in stored if book != "work"), "total_energy", *(["work"] if known else [])]


def dynamic_energies(system):
    """Names of the energies of a motion."""
    books = dict.fromkeys(term.balance.column for term in system.terms)
    works = "work" in books or system.works
    return ["kinetic_energy", *(book for book in books if book != "work"), *(["work"] if works else []), "total_energy"]


def vectors(system):
    """Names of the vectors of the momentum balance."""
    closed = not system.net.flows and all(term.balance.internal for term in system.terms)
    return VECTORS[: len(VECTORS) - closed]


def components(names):
    """Names of the components of vectors."""
    return [f"{name}_{axis}" for name in names for axis in AXES]


def taken(system):
    """Names of columns of static and dynamic runs of a system."""
    first = [column.rsplit(" [", 1)[0] for column in FIRST.values()]
    return [*first, *static_energies(system), *dynamic_energies(system), *components(VECTORS)]
