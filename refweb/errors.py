"""Errors: refused input, and failures of solvers.

May change: docstrings. Must stay: names of classes, which users catch, and their bases; ``code``, a key of
`refweb.findings.CODES`; ``stiffness``, which `runner` reads to repeat a run, and ``drift``, which `accuracy_loop`
reads. The command line shows errors of refweb's classes without their type; of others it says "internal error". Must
stay as well: all names that `gym.environment`, `integrators.central_difference` and other files import. Tests:
``tests/test_findings.py``, ``tests/commands/test_cli.py``.
"""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING

from .messages import one_line

if TYPE_CHECKING:
    from collections.abc import Iterator
    from contextlib import AbstractContextManager


class InputError(ValueError):
    """Input that refweb refuses; the message is one line with the value, the limit and the remedy."""

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message))


class SolverError(RuntimeError):
    """A solver that found no answer; the message says what, where and when, ``code`` which kind of finding it is."""

    code = "solver"


class IntegrationError(SolverError):
    """A method of dynamics cannot finish a scene; another method may."""

    code = "integration"


class EnergyDriftError(IntegrationError):
    """The energy of a run drifted away from the work done on it, or its momentum from the impulses that it was given.

    ``drift`` says how far, over the largest energy or momentum.
    """

    code = "balance-drift"

    def __init__(self, message: str, drift: float = float("inf")) -> None:
        super().__init__(message)
        self.drift = drift


class PenetrationError(SolverError):
    """A run whose contact, of a stiffness that refweb chose, lets lines too deep into bodies.

    ``stiffness`` is what each of these bodies is to have instead [N/m^p], by name.
    """

    code = "deep-contact"

    def __init__(self, message: str, stiffness: dict[str, float]) -> None:
        super().__init__(message)
        self.stiffness = stiffness


@contextlib.contextmanager
def refused_at(location: str) -> Iterator[None]:
    """Begin what is refused inside with its place, such as ``[web]`` or ``net.toml:``."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{location} {error}") from None


def in_file(name: str) -> AbstractContextManager[None]:
    """Begin what is refused inside with the name of the scene file; ``name`` is empty where there is none."""
    return refused_at(f"{name}:" if name else "")
