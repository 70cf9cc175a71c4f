"""Spectra of histories with equal intervals: amplitude over frequency.

May change: private functions, the drawing and its texts, `DECADES` among it; `STANDS_OUT` and `WIDTH_OF_A_LINE`, by
which peaks are named; `EVEN`, up to which rows count as even. Must stay: `FEWEST`, from which on `plots` offers a
spectrum; amplitudes and frequencies of `spectrum_of`; `_peak`, which a test calls. Tests:
``tests/pictures/test_plots.py``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..results.units import scale_of, with_error
from .plot_data import unit_of
from .sheet import DARK, Panel, curve, label, legend

FEWEST = 32
"""Least number of rows; with fewer a spectrum would have a dozen frequencies."""
EVEN = 1e-6
"""Largest deviation of the time of a row, over the interval."""
WIDTH_OF_A_LINE = 2.0
"""Resolution of the window over 1/duration: two equal sines farther apart make two peaks."""
STANDS_OUT = 2.0
"""Ratio of a peak to the minima on both sides above which it stands out."""
DECADES = 5
"""Number of decades below the largest amplitude that are drawn."""


class Spectrum(NamedTuple):
    """Amplitudes of a history.

    Attributes
    ----------
    frequency : ndarray
        Frequencies from 0 to half the number of rows in a second [Hz].
    amplitude : ndarray
        Amplitude of a sine of that frequency [unit of the history].
    resolution : float
        Least distance of two frequencies that are resolved [Hz].
    peak : int, optional
        Index of the highest peak at or above the resolution that stands out by `STANDS_OUT` from the minima on both
        sides; None if there is none, as in a history that only grows.
    """

    frequency: np.ndarray
    amplitude: np.ndarray
    resolution: float
    peak: int | None


def spectrum_of(time, values, name="history"):
    """The spectrum of a history about its mean, by a Hann window; ``time (rows,)`` is in s.

    The last row, at the end or at an event, may have a shorter interval and is then left out. Fewer rows than `FEWEST`,
    unequal intervals and values that are not finite are refused.
    """
    if len(time) > 2 and time[-1] - time[-2] < (1.0 - EVEN) * (time[1] - time[0]):
        time, values = time[:-1], values[:-1]
    if len(time) < FEWEST:
        raise InputError(
            f"spectrum of {name}: has {len(time)} rows, needs {FEWEST} at least: give [output] a shorter interval"
        )
    step = (time[-1] - time[0]) / (len(time) - 1)
    if not np.abs(np.diff(time) - step).max() <= EVEN * step:
        raise InputError(f"spectrum of {name}: its rows are not equally far apart")
    if not np.isfinite(values).all():
        raise InputError(f"spectrum of {name}: it has values that are not finite")
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(len(time)) / len(time))
    mean = np.average(values, weights=window)
    amplitude = 2.0 * np.abs(np.fft.rfft(window * (values - mean))) / window.sum()
    frequency = np.fft.rfftfreq(len(time), step)
    resolution = WIDTH_OF_A_LINE / (step * len(time))
    high = peaks_of(amplitude)
    high = high[frequency[high] >= resolution]
    peak = int(high[amplitude[high].argmax()]) if len(high) else None
    return Spectrum(frequency, amplitude, resolution, peak)


def peaks_of(amplitude):
    """Indices of the peaks that stand out; frequency 0, which lacks the mean, is no valley beside them."""
    from scipy.signal import find_peaks

    height = np.log(np.maximum(amplitude[1:], np.finfo(float).tiny))
    return 1 + find_peaks(height, prominence=np.log(STANDS_OUT) * (1.0 - 1e-12))[0]


def spectrum(runs, name):
    """The panel of the spectrum of a column of the history."""
    having = [s for s in runs if name in s.units]
    spectra = [spectrum_of(s.along, s.history[name], name) for s in having]
    factor, called = unit_of(having[0].units[name], *(item.amplitude for item in spectra))
    cycle, hertz = scale_of(max(float(item.frequency[-1]) for item in spectra), "Hz")

    def draw(axes):
        entries = []
        largest = max(float(item.amplitude.max()) for item in spectra) / factor
        for s, item in zip(having, spectra, strict=True):
            line = curve(axes, s.ink, item.frequency / cycle, item.amplitude / factor, 1.2)
            if item.peak is not None:
                point_style = {"color": s.ink.colour, "marker": "v", "markeredgecolor": DARK, "markersize": 8}
                axes.plot(item.frequency[item.peak] / cycle, item.amplitude[item.peak] / factor, **point_style)
            entries.append((line, s.said(_peak(item, s.units[name]))))
        if largest > 0.0:
            axes.set_yscale("log")
            axes.set_ylim(10.0**-DECADES * largest, 2.0 * largest)
        axes.set_xlim(left=0.0)
        label(axes, f"amplitude of {name}", called)
        legend(axes, entries)

    finest = max(item.resolution for item in spectra)
    remark = f"Frequencies that are {finest:.2g} Hz apart are told apart, by a Hann window on the mean."
    return [Panel(draw, f"frequency [{hertz}]", 3.0, (remark,))]


def _peak(spectrum_, unit):
    """Text on the peak of a spectrum, and on its largest amplitude if that is at another frequency."""
    if spectrum_.peak is None:
        return "no peak stands out"
    error = 0.5 * spectrum_.resolution
    words = f"highest peak that stands out at {_near(spectrum_, spectrum_.peak, unit, error)}"
    top = int(spectrum_.amplitude.argmax())
    return words if top == spectrum_.peak else f"{words}; most of all at {_near(spectrum_, top, unit, error)}"


def _near(spectrum_, number, unit, error):
    """Text of a frequency with ± and its amplitude."""
    height = float(spectrum_.amplitude[number])
    factor, name = scale_of(height, unit)
    return f"{with_error(float(spectrum_.frequency[number]), error)} Hz: {height / factor:.3g} {name}".rstrip()
