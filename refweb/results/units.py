"""Prefixes of units, for numbers that people read."""

PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))


def prefixed(size):
    """(factor, prefix) of the largest factor that is not above a size; nano for what is smaller."""
    return next((pair for pair in PREFIXES if size >= pair[0]), PREFIXES[-1])
