"""Reference of scene files: values by path, its tables in words and as a schema; it knows no scene.

This file has no code. Must stay: its sentence, which ``tests/test_architecture.py`` compares.
"""
