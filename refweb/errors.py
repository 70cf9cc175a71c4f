"""Errors: refused input, and failures of solvers."""

import contextlib

from .messages import one_line


class InputError(ValueError):
    """Input that refweb refuses; the message is one line with the value, the limit and the remedy."""

    def __init__(self, message):
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

    def __init__(self, message, drift=float("inf")):
        super().__init__(message)
        self.drift = drift


class PenetrationError(SolverError):
    """A run whose contact, of a stiffness that refweb chose, lets lines too deep into bodies.

    ``stiffness`` is what each of these bodies is to have instead [N/m^p], by name.
    """

    code = "deep-contact"

    def __init__(self, message, stiffness):
        super().__init__(message)
        self.stiffness = stiffness


@contextlib.contextmanager
def refused_at(location):
    """Begin what is refused inside with its place, such as ``[web]`` or ``net.toml:``."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{location} {error}") from None


def in_file(name):
    """Begin what is refused inside with the name of the scene file; ``name`` is empty where there is none."""
    return refused_at(f"{name}:" if name else "")
