"""The nets that programs are compared on, as arrays; refweb lays out their nodes and lines, and nothing else."""

from __future__ import annotations

import numpy as np

import refweb

from .problem import Problem

CABLE = refweb.Cable(law="tension-only", modulus=7e7, area=1e-4, density=200.0)
"""Of the paper "Dynamic modelling and analysis of space webs"."""


def problem(web, **done):
    """A web of refweb's as a `Problem`."""
    system = refweb.Scene(web=web, cable=CABLE).build()
    net = system.net
    return Problem(
        points=net.points,
        lines=net.cells,
        natural=net.natural_length,
        supports=np.flatnonzero(system.supported[: net.nodes].all(axis=1)),
        ea=CABLE.modulus * CABLE.area,
        density=CABLE.density * CABLE.area,
        node=int(net.web.centre),
        **done,
    )


def paper(quick=False):
    """The square web of 3120 lines; a window of 8 × 8 cells where it has to be quick."""
    return refweb.Window(mesh="square", rows=8, columns=8, side=0.0646) if quick else refweb.Paper(
        mesh="square", cable_length=201.4
    )  # fmt: skip


def large(cells):
    """A square window of so many cells a side."""
    return refweb.Window(mesh="square", rows=cells, columns=cells, side=0.1)


LOADS = np.arange(1.0, 6.0)
"""Of statics [N]."""
