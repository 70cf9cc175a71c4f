"""Numbers as text for readers: values with their ± in readable units, in one notation.

May change: private functions; `PREFIXES`, `FIXED` and `MOST_DIGITS` with the tests that pin the notation alone: no
program reads these texts, ``run.json`` has plain numbers. Must stay: `prefixed`, `scale_of`, `with_error`, `readable`
and their arguments, which the console, pages and pictures call, so that all show a number alike; `other_errors`, which
`pictures.plot_data`, `notebook` and `summary_text` import; `larger`, which `commands.console` and `summary_text`
import; `position_text`, which `notebook` and `summary_text` import. Tests: ``tests/results/test_loaded.py``.
"""

import math

from .solution import OTHER_ERRORS

PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))
_SCALED = ("m", "N", "Pa", "J", "s", "m/s", "W")
"""Units that take prefixes."""
FIXED = 1e-4
"""± below which ± is written with a power of ten."""
MOST_DIGITS = 10
"""Largest number of significant digits of a value with ±; a value without ± has 6."""


def prefixed(size):
    """(factor, prefix) of the largest factor that is not above a size; nano for smaller sizes."""
    return next((pair for pair in PREFIXES if size >= pair[0]), PREFIXES[-1])


def scale_of(size, unit):
    """(factor, name) of the readable unit of a size: ``(1e-3, "mm")``; the name is empty for numbers without a unit."""
    factor, prefix = prefixed(abs(size)) if unit in _SCALED and size else (1.0, "")
    return factor, "" if unit == "1" else f"{prefix}{unit}"


def with_error(value, error):
    """A number with its ±: ``100.66 ± 0.55``, ``2.9972910 ± 1.7e-06``, ``0 ± 90``; without one ``31.4848``.

    ± has two digits; the value ends at the same decimal place.
    """
    if not error or not math.isfinite(error) or not math.isfinite(value):
        return f"{value:.6g} ± {error}" if error else f"{value:.6g}"
    left = 1 - _exponent(error)
    value, error = round(value, left) + 0.0, round(error, left)  # + 0.0 makes 0 of −0
    if error >= 1e4 or abs(value) >= 1e7:
        return f"{value:.{MOST_DIGITS}g} ± {error:.1e}"
    left = max(0, left)
    digits_before = max(1, _exponent(value) + 1) if value else 1
    text = f"{error:.{left}f}" if error >= FIXED else f"{error:.1e}"
    return f"{value:.{min(left, MOST_DIGITS - digits_before)}f} ± {text}"


def readable(value, error, unit, within=None):
    """A value with its error in the unit of the larger of both: ``31.4848 mm``, ``100.66 ± 0.55 mm``, ``0 ± 90 mm``.

    ``within`` has the ends of value ± error if these are cut to possible values.
    """
    factor, name = scale_of(larger(value, error), unit)
    text = f"{with_error(value / factor, error and error / factor)} {name}".rstrip()
    if within is None:
        return text
    lower, upper = (f"{end / factor:.3g}" for end in within)
    return f"{text}, from {lower} to {upper}"


def larger(value, error):
    """The larger of a value and its ±, which selects the unit; ± may be None."""
    return max(abs(value), error or 0.0)


def other_errors(results):
    """Errors besides ±: a text for each kind, for results as in ``run.json``."""
    for key, words in OTHER_ERRORS.items():
        parts = [f"{n} by {readable(r[key], None, r['unit'])}" for n, r in results.items() if r.get(key) is not None]
        if parts:
            yield f"{words} {', '.join(parts)}"


def position_text(where, at):
    """Position of a result as text: ``node 1757``; empty without a position."""
    return "" if where is None else f"{at} {where}"


def _exponent(value):
    return int(f"{value:.1e}".split("e")[1])
