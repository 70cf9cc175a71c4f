"""Runs about runs: errors of elements, horizons, modes and what digits cost."""
