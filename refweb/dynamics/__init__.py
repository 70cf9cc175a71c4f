"""A scene through time: start, rows, frames, errors; it does not know the command line.

Room: it imports statics, results and `dynamics.integrators`, and runner, solution, studies, sweeps and gym import it;
`ROOMS` in ``tests/test_architecture.py`` has this order. May change: this paragraph. Must stay: the first sentence,
which stands in `ROOMS` as well, and that this file has no code.
"""
