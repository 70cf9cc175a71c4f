"""A result folder drawn; it knows folders, and nothing of what made them.

This file has no code. Must stay: its sentence, which ``tests/test_architecture.py`` compares.
"""
