"""Results: an instant, its observables, the solution and the folder; they do not know how they were computed.

This file has no code. Must stay: its sentence, which ``tests/test_architecture.py`` compares.
"""
