"""Scenes of threads that several tests use."""

import refweb

G, EA = 9.81, 1e4
ROPE = {"name": "rope", "modulus": 1e9, "area": 1e-5, "density": 0.0}
"""A thread of `EA`."""
FAR = [[50.0, 0.0, 0.0], [51.0, 0.0, 0.0]]
"""Ends of the one line that a web has, away from all else; both are supported, and stand behind the other points."""
FALLING = {"gravity": {"acceleration": [0.0, 0.0, -G]}}
PULL = {"observe": [{"name": "pull", "quantity": "tension", "thread": "rope"}]}


def scene(points, supports, rope, solve, masses=(), **tables):
    """A scene of points, some of them supported, with a thread and point masses by node, and with more tables."""
    far = len(points)
    given = {
        "web": {"kind": "inline", "points": [*points, *FAR], "lines": [[far, far + 1]]},
        "supports": {"nodes": [*supports, far, far + 1]},
        "cable": {"law": "tension-only", "modulus": 1e9, "area": 1e-5, "density": 0.0},
        "thread": [{**ROPE, **rope}],
        "point_mass": [{"node": node, "mass": mass} for node, mass in dict(masses).items()],
        "solve": solve,
    }
    return refweb.Scene.from_dict({name: value for name, value in {**given, **tables}.items() if value != []})
