"""A scene through time: start, rows, frames, errors; it does not know the command line.

Room: it imports statics, results and `dynamics.integrators`, and runner, solution, studies, sweeps and gym import it;
`ROOMS` in ``tests/test_architecture.py`` has this order and the first sentence above. This file stays without code.
"""
