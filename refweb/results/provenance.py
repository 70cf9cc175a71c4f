"""Provenance of a result: sizes of the web, versions of the libraries that solved it."""

from __future__ import annotations

import contextlib
import importlib.metadata
import sys

import numpy as np

from .. import __version__


def web_of(system):
    """Sizes of the web, as `run.json` holds them."""
    web, net = system.net.web, system.net
    return {
        "nodes": len(web.points),
        "lines": len(web.lines),
        "cells": int(web.cells),
        "cable_length": float(np.sum(net.natural_length)),
        "area": float(web.area),
        "mass": net.cable_mass,
    }


def versions():
    """Versions of refweb, Python and the libraries that solve, by name."""
    names = ("numpy", "scipy", "scikit-fem", "scikit-sundae", "numba", "meshio", "qdldl")
    base = {"refweb": __version__, "python": sys.version.split()[0]}
    versions_found = {**base, **{name: importlib.metadata.version(name) for name in names}}
    with contextlib.suppress(importlib.metadata.PackageNotFoundError):
        versions_found["rslab"] = importlib.metadata.version("rslab")
    return versions_found
