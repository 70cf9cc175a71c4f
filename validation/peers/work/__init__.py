"""The works that programs are compared on, one file a work.

A file has ``WORKS``, a tuple of `Work`. What a program does in a work is the function of the work's ``task`` in its
file of `validation.peers.programs`; a program without that function is left out of the work.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass, field

FILES = ("statics", "impact", "implicit", "large", "form", "throw", "capture", "draws")


@dataclass(frozen=True)
class Work:
    """A problem, what is right, and how each program is set up.

    Parameters
    ----------
    name, title : str
        Name on the command line, and in tables.
    said : str
        What is computed.
    task : str
        Name of the function of programs.
    problem : callable
        The `Problem`, of the quick variant or not.
    truth : callable
        The `Truth` of a problem.
    settings : dict
        By program: a list of arguments of its function, from coarse to fine.
    target : float
        Error at which times are compared [m].
    quick : dict
        Settings of the quick variant, where they differ.
    """

    name: str
    title: str
    said: str
    task: str
    problem: Callable
    truth: Callable
    settings: dict
    target: float
    quick: dict = field(default_factory=dict)


def works():
    """All works by name, in the order of `FILES`."""
    modules = (importlib.import_module(f"{__name__}.{name}") for name in FILES)
    return {work.name: work for module in modules for work in module.WORKS}
