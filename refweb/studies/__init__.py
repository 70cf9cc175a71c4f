"""Runs about runs: errors of elements, horizons, modes and what digits cost.

This file has no code. Must stay: its sentence, which ``tests/test_architecture.py`` compares.
"""
