"""What to solve, what to hold and what to write: the tables of a scene that are neither web, cable nor effect."""

from __future__ import annotations

from dataclasses import dataclass

from .inputs import InputError, Table, choice, components, integer, nodes, numbers_list, real, text


@dataclass(frozen=True, kw_only=True)
class Supports(Table):
    """Nodes whose displacement is held at zero in some components."""

    nodes: object = nodes(empty=True)
    components: tuple = components(("x", "y", "z"))


@dataclass(frozen=True, kw_only=True)
class Static(Table):
    """Static solution at a list of load steps.

    Parameters
    ----------
    method : {"newton", "relaxation"}
        Newton's method or, independent of any tangent, dynamic relaxation.
    load_steps : sequence of float
        Values of t.
    mass : {"lumped", "consistent"}
        The weight is the same with either; the modes at the equilibrium are not.
    """

    kind: str = choice("static", default="static")
    method: str = choice("newton", "relaxation", default="newton")
    load_steps: tuple = numbers_list((1.0,))
    mass: str = choice("lumped", "consistent", default="lumped")

    def check(self):
        if len(self.load_steps) > 100_000:
            raise InputError(f"load_steps has {len(self.load_steps)} numbers, must be at most 100000")


@dataclass(frozen=True, kw_only=True)
class Dynamic(Table):
    """Motion over a time, by explicit central differences.

    Parameters
    ----------
    duration : float
        Time to simulate [s].
    safety : float
        Share of the bound of stability that a step is, 0 < safety ≤ 1.
    step_size : float, optional
        Largest step instead [s]; the step used is the largest below it that divides a history row.
    mass : {"lumped", "consistent"}
        Mass of the lines at their nodes: row sums of the consistent matrix, or the matrix itself.
    start : {"web", "equilibrium"} or path
        State at t = 0: the web as it is, its equilibrium under what acts at t = 0 (free bodies do not), or the last
        state in a result folder.
    """

    kind: str = choice("dynamic", default="dynamic")
    method: str = choice("central-difference", default="central-difference")
    duration: float = real(above=0, unit="s")
    safety: float = real(0.5, above=0, at_most=1)
    step_size: float | None = real(None, above=0, unit="s")
    mass: str = choice("lumped", "consistent", default="lumped")
    start: str = text("web")


@dataclass(frozen=True, kw_only=True)
class Output(Table):
    """What a result folder holds.

    Parameters
    ----------
    interval : float, optional
        Time between history rows [s], 1e-3 by default; in statics the load steps are the rows.
    frames : int, optional
        A VTU every this many rows, the first and the last state always; 10 by default, in statics 1.
    """

    interval: float | None = real(None, above=0, unit="s")
    frames: int | None = integer(None, at_least=1)


@dataclass(frozen=True, kw_only=True)
class Accuracy(Table):
    """How the error of dynamic results is found: by a twin of half the error, or not at all."""

    error: str = choice("twin", "none", default="twin")
