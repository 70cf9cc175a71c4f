"""Drag of a fluid on lines and bodies: its table, its force, and how explicit kicks solve for it.

This file has no code. Must stay: its sentence, which ``tests/test_architecture.py`` compares.
"""
