"""Balances of energy and momentum of a run as panels of a plot, with their errors.

May change: private functions and all of the drawing, `HATCHES` and `SMALL` among it. Must stay: names of columns that
are read (`FLOATING`, `STORED`, `LOST`, `GIVEN`, `TOTAL`), those of `results.columns`, and of drifts, those of
``run.json``; `energy`, `has_momentum` and `momentum`, which `plots` calls. Tests: ``tests/pictures/test_plots.py``.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..results.units import readable
from .histories import bounds_of, clock_of, tick_steps
from .limits import limit
from .plot_data import unit_of
from .sheet import COLOURS, DARK, LOW, STYLES, TALL, Ink, Panel, curve, dot, label, legend, telling

AXES = "xyz"
FLOATING = ("potential_energy", "frame_energy", "orbit_energy")
"""Energies without a natural zero."""
HATCHES = ("", "//", "..", "\\\\", "xx", "--", "++", "oo")
SMALL = 1e-3
"""Share of the largest momentum below which an axis has no panel."""
STORED, LOST, GIVEN, TOTAL = "stored", "dissipated_energy", "work", "total_energy"


class EnergyBalance(NamedTuple):
    """The energy balance of a plot.

    Attributes
    ----------
    parts : dict of str to ndarray
        Stacked energies by name [J], shape (rows,); energies without a natural zero count from their smallest value.
    smallest : dict of str to float
        Smallest value that was subtracted from each [J].
    top : ndarray
        Their sum [J].
    given : ndarray
        Energy at the start plus work [J]; it equals ``top`` if the energy balance closes.
    """

    parts: dict[str, Any]
    smallest: dict[str, Any]
    top: np.ndarray
    given: np.ndarray

    @property
    def drift(self):
        """Error of the energy balance [J]: energy minus energy at the start and work."""
        return self.top - self.given


def energy_book(runs):
    """The `EnergyBalance` of a run.

    The total is the sum of stored and kinetic energy. The energy dissipated by damping and friction is stacked on it,
    so that the sum changes by work only.
    """
    table, names = runs.history, [name for name in runs.energies if name not in (GIVEN, TOTAL)]
    names.sort(key=lambda name: (name == LOST, name == "kinetic_energy"))
    smallest = {}
    for name in names:
        low = float(np.nanmin(table[name])) if np.isfinite(table[name]).any() else 0.0
        smallest[name] = low if name in FLOATING or low < 0.0 else 0.0
    parts = {name: table[name] - smallest[name] for name in names}
    top = np.sum(list(parts.values()), axis=0)
    work = table[GIVEN] if GIVEN in runs.energies else np.zeros_like(top)
    return EnergyBalance(parts, smallest, top, top[:1] + work - work[:1])


def energy(runs):
    """Panels of the energy balance: stacked for one run, one for each energy of several runs; and its error."""
    if len(runs) > 1:
        return _energies_beside(runs)
    (s,) = runs
    book, dynamic = energy_book(s), s.record.kind == "dynamic"
    second, clock = clock_of(runs) if dynamic else (1.0, "")
    along = f"time [{clock}]" if dynamic else "load step"
    factor, unit = unit_of("J", book.top, book.given)
    mask = telling(*book.parts.values(), limit=300)
    at = s.along[mask] / second
    if len(mask) == 1 and not dynamic:  # of one load step a column as broad as half a step
        mask, at = np.repeat(mask, 2), at + np.array([-0.25, 0.25])

    def stack(axes):
        entries, below = [], np.zeros(len(mask))
        for number, (name, values) in enumerate(book.parts.items()):
            above = below + values[mask] / factor
            fill = {"facecolor": COLOURS[number % 7], "edgecolor": (1.0, 1.0, 1.0, 0.5), "linewidth": 0.0}
            area = axes.fill_between(at, below, above, hatch=HATCHES[number % len(HATCHES)], **fill)
            if len(mask) == 1:  # an instant has no breadth
                axes.vlines(at, below, above, color=COLOURS[number % 7], linewidth=12.0)
            entries.append((area, _called(name, book.smallest[name])))
            below = above
        (line,) = axes.plot(at, below, color=DARK, linewidth=1.6, marker=dot(mask))
        entries.append((line, _called("sum", sum(book.smallest.values()))))
        if dynamic:
            start = "at the start" + (" + work" if GIVEN in s.energies else "")
            (line,) = axes.plot(at, book.given[mask] / factor, color="white", linestyle=(0, (2, 2)), linewidth=1.6)
            entries.append((line, start))
        axes.set_ylim(bottom=0.0)
        if not dynamic:
            tick_steps(axes, s.along.tolist())
        label(axes, "energy", unit)
        legend(axes, entries, columns=2)
        if dynamic:
            _white_on_dark(axes)

    panels = [Panel(stack, along, 1.3 * TALL)]
    if dynamic:
        panels.append(_drifts(runs, "energy", second, clock))
    return panels


def _white_on_dark(axes):
    """Draw the last entry of a legend, a white line, on a dark line."""
    from matplotlib.patheffects import Normal, Stroke

    for line in (axes.get_legend().get_lines()[-1], axes.get_lines()[-1]):
        line.set_path_effects([Stroke(linewidth=3.0, foreground=DARK), Normal()])


def _called(name, smallest):
    """Name of an energy in a legend."""
    name = name.removesuffix("_energy").replace("_", " ")
    return f"{name} above {readable(smallest, None, 'J')}" if smallest else name


def _drifts(runs, what, second, clock):
    """The panel of the error of the energy balance."""
    drifts = [energy_book(s).drift for s in runs]
    factor, unit = unit_of("J", *drifts)

    def draw(axes):
        entries = []
        for s, drift in zip(runs, drifts, strict=True):
            line = curve(axes, s.ink, s.along / second, drift / factor, 1.2)
            said = s.said(_share(s, "energy_drift", what))
            entries += [(line, said)] if said else []
        label(axes, "drift", unit)
        legend(axes, entries)

    return Panel(draw, f"time [{clock}]", LOW)


def _share(s, key, what):
    """Text of the error of a balance from the ``run.json`` of a run that has ended."""
    error = None if s.record.status == "running" else (s.record.summary.get("solver") or {}).get(key)
    return "" if error is None else f"{what} drift {error:.1e} of the largest {what}"


def _energies_beside(runs):
    """A panel for each energy of several runs, and one for the errors of their balances."""
    names = dict.fromkeys(name for s in runs for name in s.energies)
    dynamic = runs[0].record.kind == "dynamic"
    second, clock = clock_of(runs) if dynamic else (1.0, "")
    along = f"time [{clock}]" if dynamic else "load step"

    def panel(name, first):
        having = [s for s in runs if name in s.energies]
        factor, unit = unit_of("J", *(s.history[name] for s in having))

        def draw(axes):
            for s in having:
                curve(axes, s.ink, s.along / second, s.history[name] / factor)
            values = np.concatenate([s.history[name] for s in having]) / factor
            limit(axes, values, bounds=bounds_of(having, name, factor))
            label(axes, name.removesuffix("_energy").replace("_", " "), unit)
            if first:
                legend(axes, names_of(axes, runs))

        return Panel(draw, along, LOW)

    panels = [panel(name, not number) for number, name in enumerate(names)]
    return [*panels, _drifts(runs, "energy", second, clock)] if dynamic else panels


def names_of(axes, runs):
    """Entries of a legend with the names of runs."""
    return [
        (axes.plot([], [], color=s.ink.colour, linestyle=s.ink.style, linewidth=1.4)[0], s.name) for s in runs if s.name
    ]


class MomentumBalancePlot(NamedTuple):
    """The momentum balance along one axis [N s], all of shape (rows,): momentum, and impulses by name.

    Attributes
    ----------
    momentum : ndarray
        Momentum of all free nodes and bodies.
    impulses : dict of str to ndarray
        Impulses since the start, by name.
    """

    momentum: np.ndarray
    impulses: dict[str, Any]

    @property
    def given(self):
        """Momentum at the start plus all impulses."""
        return self.momentum[:1] + np.sum(list(self.impulses.values()), axis=0)

    @property
    def drift(self):
        """Error of the balance: momentum minus ``given``."""
        return self.momentum - self.given


def momentum_book(runs):
    """The `MomentumBalancePlot` along each axis."""
    names = {"impulse of supports": "support_impulse", "impulse of loads and all else": "outer_impulse"}
    names = {words: name for words, name in names.items() if f"{name}_x" in runs.history}
    return {
        axis: MomentumBalancePlot(
            runs.history[f"momentum_{axis}"],
            {words: runs.history[f"{name}_{axis}"] for words, name in names.items()},
        )
        for axis in AXES
    }


def has_momentum(runs):
    """Tell if a run has a momentum balance."""
    return all(f"momentum_{axis}" in runs.units for axis in AXES)


def momentum(runs):
    """Panels of the momentum balance: for each axis momentum and impulses, and its error."""
    books = [momentum_book(s) for s in runs]
    sizes = {axis: max(_size(b[axis]) for b in books) for axis in AXES}
    drawn = [axis for axis in AXES if sizes[axis] > SMALL * max(sizes.values())] or ["z"]
    small = [axis for axis in AXES if axis not in drawn]
    notes = (f"Along {' and '.join(small)} all momenta are below {SMALL:g} of the largest.",) if small else ()
    largest = np.array(max(sizes.values()))
    factor, unit = unit_of("N s", largest)
    second, clock = clock_of(runs)
    low, high = _ends([b[axis] for b in books for axis in drawn])

    def panel(axis, first):
        def draw(axes):
            for s, book in zip(runs, books, strict=True):
                entries = _momenta(axes, s, book[axis], second, factor, len(runs) > 1)
            axes.set_ylim(low / factor, high / factor)
            label(axes, f"along {axis}", unit)
            if first:
                legend(axes, names_of(axes, runs) + entries)

        return Panel(draw, f"time [{clock}]", LOW, notes)

    panels = [panel(axis, not number) for number, axis in enumerate(drawn)]
    return [*panels, _momentum_drifts(runs, books, second, clock)]


def _size(book):
    return max(float(np.nanmax(np.abs(v), initial=0.0)) for v in (book.momentum, *book.impulses.values()))


def _ends(books):
    """Limits of an axis that contain all momenta and impulses."""
    values = np.concatenate([v for book in books for v in (book.momentum, *book.impulses.values())])
    values = values[np.isfinite(values)]
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
    margin = 0.06 * (high - low) or 1.0
    return low - margin, high + margin


def _momenta(axes, s, book, second, factor, several):
    """Draw momentum and impulses along one axis, impulses of several runs thin; returns the entries of the legend."""
    at, entries = s.along / second, []
    curves = {"momentum of all that is free": book.momentum, **book.impulses}
    for number, (words, values) in enumerate(curves.items()):
        ink, colour = Ink.of(number), s.ink.colour if several else Ink.of(number).colour
        line = curve(axes, ink, at, values / factor, 1.6 if number == 0 else 1.1, color=colour)
        handle = line if not several else axes.plot([], [], color=DARK, linestyle=ink.style)[0]
        entries.append((handle, words))
    line = curve(axes, Ink(DARK, STYLES[3], ""), at, book.given / factor, 2.2, marker="", zorder=3)
    return [*entries, (line, "at the start + impulses")]


def _momentum_drifts(runs, books, second, clock):
    """The panel of the error of the momentum balance."""
    drifts = [(s, axis, book[axis].drift) for s, book in zip(runs, books, strict=True) for axis in AXES]
    factor, unit = unit_of("N s", *(drift for _, _, drift in drifts))

    def draw(axes):
        entries = []
        for s, axis, drift in drifts:
            ink = Ink.of(AXES.index(axis))
            colour = s.ink.colour if s.name else ink.colour
            line = curve(axes, ink, s.along / second, drift / factor, 1.2, color=colour)
            if s is runs[0]:
                handle = line if not s.name else axes.plot([], [], color=DARK, linestyle=ink.style)[0]
                entries.append((handle, f"along {axis}"))
        label(axes, "drift", unit)
        legend(axes, entries, columns=3)

    shares = [(s, _share(s, "momentum_drift", "momentum")) for s in runs]
    said = tuple(s.said(words if s.name else words.capitalize()) for s, words in shares if words)
    return Panel(draw, f"time [{clock}]", LOW, said)
