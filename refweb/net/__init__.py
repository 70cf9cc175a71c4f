"""The model: nodes, lines, lengths, laws, elements, mass, bodies; it knows no forces, time or solvers.

This file has no code. Must stay: its sentence, which ``tests/test_architecture.py`` compares.
"""
