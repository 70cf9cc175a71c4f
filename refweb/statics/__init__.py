"""Equilibria and their bounds; it knows no time and no events.

Room: it imports results, system and what stands below them; solution, studies and, for starts and gradients, dynamics
import it; `ROOMS` in ``tests/test_architecture.py`` has this order. May change: this paragraph. Must stay: the first
sentence, which stands in `ROOMS` as well, and that this file has no code.
"""
