"""Pages of a run: its scene, results and pictures; they know records, and nothing of what made them.

This file has no code. Must stay: its sentence, which ``tests/test_architecture.py`` compares.
"""
