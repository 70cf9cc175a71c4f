"""Explicit runs of a scene: what is looked at in every step, history rows, peaks and their errors."""

from __future__ import annotations

import math
import time

import numpy as np

from . import probes
from .central_difference import CentralDifference
from .laws import SMOOTH
from .lines import SLACKNESS
from .observables import LINE, NODAL, Result
from .state import State

ENERGIES = ("kinetic_energy", "strain_energy", "potential_energy", "contact_energy", "work", "total_energy")
_VECTORS = ("momentum", "support_impulse")


def _weights(system, quantity):
    """Weights of (each family, kinetic energy, work) that make an energy of the book."""
    families = [f.book for f in system.families]
    weights = np.zeros(len(families) + 2)
    weights[:-2] = [book != "work" if quantity == "total_energy" else book == quantity for book in families]
    weights[-2] = quantity in ("kinetic_energy", "total_energy")
    weights[-1] = quantity == "work"
    if quantity == "work":
        weights[:-2] = 0.0
    return weights


def probe_of(observable, system):
    """An observable as a probe: (kernel, rows, data)."""
    net, quantity = system.net, observable.quantity
    if quantity == "slack_fraction":
        margin = net.line_data[:, SLACKNESS] if net.law.number == SMOOTH else np.zeros(len(net.cells))
        return probes.slack_fraction, [0], margin[:, None]
    if quantity in LINE:
        one = -1 if observable.line is None else int(np.flatnonzero(net.line == observable.line)[0])
        scale = 1.0 / net.area if quantity == "stress" else np.ones(len(net.cells))
        return probes.line, [1 if quantity == "strain" else 0, one], scale[:, None]
    component = probes.MAGNITUDE if observable.component is None else observable.component
    rows = observable.rows(system)
    numbers = [component, *rows]
    if quantity == "reaction":
        weight = np.where(system.supported[rows], 1.0, 0.0)
        rest = np.zeros((len(rows), 3))
        if observable.body is not None:
            weight[:] = -1.0
            still = np.zeros((system.rows, 3))
            for family in system.families:
                if family.book == "potential_energy":
                    rest += system.force_of(family, 0.0, still)[rows]
        return probes.reaction, numbers, np.hstack([weight, rest])
    kernel = probes.velocity if quantity == "velocity" else probes.displacement
    data = net.points[rows] if quantity == "position" else np.zeros((len(rows), 3))
    return kernel, numbers, data


class Recorder:
    """Follows one explicit run: the columns of its history, and its results.

    Parameters
    ----------
    scene : refweb.Scene
        What is observed, how often, and how it is solved.
    system : refweb.system.System
        What acts.
    """

    def __init__(self, scene, system):
        self.scene, self.system = scene, system
        self.probed = [o for o in scene.observables if o.quantity in (*NODAL, *LINE, "slack_fraction")]
        self.watched = [o for o in scene.observables if o.quantity in ENERGIES and o.reduce != "final"]
        books = {f.book for f in system.families}
        moved = bool(system.drives)
        present = lambda name: name in ("kinetic_energy", "total_energy") or name in books or (name == "work" and moved)
        self.energies = [name for name in ENERGIES if present(name)]
        self.columns = [f"time [s]", *(f"{o.name} [{o.unit}]" for o in scene.observables)]
        self.columns += [f"{name} [J]" for name in self.energies]
        self.columns += [f"{name}_{axis} [N s]" for name in _VECTORS for axis in "xyz"]
        self._book = np.array([_weights(system, name) for name in self.energies])

    def solver(self, safety):
        """The `CentralDifference` of the scene at a share of the step bound."""
        signs = {"max": 1, "min": -1, "final": 0}
        return CentralDifference(
            self.system,
            probes=[(*probe_of(o, self.system), signs[o.reduce]) for o in self.probed],
            watch=[(_weights(self.system, o.quantity), signs[o.reduce]) for o in self.watched],
            safety=safety,
            step_size=self.scene.solve.step_size,
        )

    def rows(self, history, run):
        """Rows of the solver as rows of ``history.csv``."""
        count, families = len(self.probed), len(self.system.families) + 2
        energies = history[:, 1 + count : 1 + count + families]
        table = [history[:, 0]]
        for o in self.scene.observables:
            if o in self.probed:
                table.append(history[:, 1 + self.probed.index(o)])
            elif o.quantity == "step_size":
                table.append(np.full(len(history), run.state[2]))
            else:
                table.append(energies @ _weights(self.system, o.quantity))
        return np.column_stack([*table, energies @ self._book.T, history[:, 1 + count + families :]])

    def results(self, run, last):
        """Results by name, without errors; ``last`` is the last row of ``history.csv``."""
        results, net = {}, self.system.net
        for i, o in enumerate(self.scene.observables):
            value, when, where = float(last[1 + i]), run.time, None
            if o in self.probed:
                at = self.probed.index(o)
                if o.reduce != "final":
                    value, when, where = float(run.peaks[at]), float(run.times[at]), int(run.places[at])
                elif o.quantity != "slack_fraction":
                    where = o.value(State(self.system, run.time, run.x, run.v)).where
                if o.quantity in LINE and o.reduce != "final":
                    where = int(net.line[where])
                if o.quantity == "slack_fraction" or o.body is not None or (o.quantity == "reaction" and o.node is None):
                    where = None
            elif o in self.watched:
                at = len(self.probed) + self.watched.index(o)
                value, when = float(run.peaks[at]), float(run.times[at])
            results[o.name] = Result(value, None, o.unit, when, where)
        return results


def row_times(scene):
    """Times of the history rows [s]: multiples of the interval, and the end."""
    interval, duration = scene.output.interval, scene.solve.duration
    count = int(math.floor(duration / interval * (1.0 + 1e-12)))
    times = interval * np.arange(count + 1)
    if duration - times[-1] > 1e-9 * interval:
        return np.append(times, duration)
    times[-1] = duration
    return times


def blocks(solver, run, times, stops):
    """Advance through ``times`` in blocks that last about a tenth of a second and end at each of ``stops``.

    Yields
    ------
    (first row, rows of the solver)
    """
    first, size = 0, 1
    while first < len(times):
        stop = stops[np.searchsorted(stops, first)]
        count = min(size, stop + 1 - first)
        began = time.perf_counter()
        yield first, solver.rows(run, times[first : first + count])
        first += count
        spent = time.perf_counter() - began
        size = max(1, min(2 * size if spent < 0.05 else int(size * 0.1 / spent), 10000))


def with_errors(results, twin):
    """Results with the difference to a run of half the error as ±.

    Central differences are of order 2, so that a run at 1/√2 of the step has half the error, and the error is twice the
    difference.
    """
    errors = {n: 2.0 * abs(r.value - twin[n].value) + 4e-16 * abs(r.value) for n, r in results.items()}
    return {n: r._replace(error=errors[n]) for n, r in results.items()}
