"""Provenance of a result: sizes of the web, versions of the libraries that solved it.

May change: private functions; `LIBRARIES`, `OPTIONAL` and `PLOTTING`, the libraries whose versions are noted. Must
stay: keys of `web_of` and `versions`, which stand in ``run.json``; ``refweb`` among the versions, without which
`folder.read_summary` takes a file for foreign. Tests: ``tests/results/test_results.py``.
"""

from __future__ import annotations

import functools
import importlib.metadata
import sys

from .. import __version__
from ..registry import PACKAGES

LIBRARIES = ("numpy", "scipy", "scikit-fem", "scikit-sundae", "numba", "meshio", "qdldl")
"""Libraries that solve, and read webs."""
OPTIONAL = ("rslab",)
"""Those that are taken where they are installed."""
PLOTTING = ("pyvista", "matplotlib")
"""Libraries of pictures."""


def web_of(system):
    """Sizes of the web, as in `run.json`.

    ``extent`` is the size of the initial web along x, y and z [m]. ``diameter`` has the least and the largest diameter
    of round cables of the same area [m]. ``volume`` is that of the cable [m³]. ``total_mass`` is the mass of cable,
    point masses and free bodies [kg].
    """
    import numpy as np  # `refweb --version` does without

    web, net = system.net.web, system.net
    fixed_mass = sum(net.mass[body.row] for body in net.bodies if body.fixed)
    return {
        "nodes": len(web.points),
        "lines": len(web.lines),
        "cells": int(web.cells),
        "cable_length": float(np.sum(net.natural_length)),
        "area": float(web.area),
        "mass": net.cable_mass,
        "extent": np.ptp(web.points, axis=0).tolist(),
        "diameter": np.sqrt(4.0 / np.pi * np.array([net.area.min(), net.area.max()])).tolist(),
        "volume": float(net.area @ net.natural_length),
        "total_mass": float(net.mass[: len(net.mass) - net.spins].sum() - fixed_mass),
    }


def versions(libraries=LIBRARIES):
    """Versions of refweb, Python, some libraries and the packages of plug-ins, by name; nothing is imported."""
    versions_by_name = {"refweb": __version__, "python": sys.version.split()[0]}
    numbers = {name: _version_of(name) for name in (*libraries, *OPTIONAL)}
    return versions_by_name | {name: number for name, number in numbers.items() if number} | PACKAGES


@functools.cache
def _version_of(name):
    """Version of an installed library, "" where there is none."""
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return ""
