"""Solids that a surface of triangles bounds: read, checked, weighed, and how deep a point is in them.

This file has no code. Must stay: its sentence, which ``tests/test_architecture.py`` compares.
"""
