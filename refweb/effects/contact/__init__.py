"""Contact of lines with bodies, and of bodies with each other: where, how deep, and all its forces.

This file has no code. Must stay: its sentence, which ``tests/test_architecture.py`` compares.
"""
