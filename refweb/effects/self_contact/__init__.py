"""Lines against lines: which are near, how they push each other apart, and what that takes from their motion.

This file has no code. Must stay: its sentence, which ``tests/test_architecture.py`` compares.
"""
