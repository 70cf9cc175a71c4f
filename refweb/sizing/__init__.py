"""Sizing: the least design of a scene that meets requirements; it knows studies and gradients, and no command line.

A requirements file names a scene, numbers that are free, conditions on results and what is least
(`refweb.sizing.requirements`). All values that the free numbers may have are the space of designs
(`refweb.sizing.space`). A design is a case of a study: its run is recorded by the digest of its scene, and a sizing
that continues runs only what is not recorded (`refweb.sizing.runs`). In statics continuous numbers follow gradients
(`refweb.sizing.smooth`), everything else is enumerated or searched (`refweb.sizing.search`).

This file has no code. Must stay: its first sentence, which ``tests/test_architecture.py`` compares.
"""
