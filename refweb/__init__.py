"""refweb, a reference solver for space webs: equilibrium and dynamics of cable nets.

Names are imported when they are used: ``import refweb`` loads nothing that a scene does not need.
"""

__version__ = "0.1.0"

_HOME = {
    "run": "runner",
    "resume": "runner",
    "modes": "vibration",
    "Modes": "vibration",
    "cost": "work_precision",
    "Cost": "work_precision",
    "Scene": "scene",
    "Static": "settings",
    "Dynamic": "settings",
    "Supports": "settings",
    "Output": "settings",
    "Observe": "observables",
    "Solution": "solution",
    "Cable": "cables",
    "Group": "cables",
    "Law": "laws",
    "Web": "webs",
    "SingleCable": "single_cable",
    "Inline": "given_webs",
    "File": "given_webs",
    "Paper": "lattices",
    "Window": "lattices",
    "Layers": "lattices",
    "Gravity": "effects.gravity",
    "Load": "effects.load",
    "Motion": "effects.motion",
    "PointMass": "effects.point_mass",
    "Velocity": "effects.velocity",
    "Body": "effects.body",
    "Contact": "effects.contact",
    "Link": "effects.link",
    "Frame": "effects.frame",
    "Pressure": "effects.pressure",
    "Thrust": "effects.thrust",
    "Damping": "effects.damping",
    "Bending": "effects.bending",
    "Reel": "effects.reel",
    "Temperature": "effects.temperature",
    "Accuracy": "settings",
    "Event": "settings",
    "InputError": "inputs",
    "SolverError": "errors",
}
__all__ = sorted(_HOME)


def __getattr__(name):
    import importlib

    if name not in _HOME:
        from .inputs import nearest

        raise AttributeError(f"module 'refweb' has no attribute {name!r}, {nearest(name, _HOME)}")
    return getattr(importlib.import_module(f"{__name__}.{_HOME[name]}"), name)


def __dir__():
    return __all__
