"""refweb, a reference solver for space webs: equilibrium and dynamics of cable nets.

Names are imported when they are used: ``import refweb`` loads nothing that a scene does not need.
"""

__version__ = "0.1.0"

_HOME = {
    "run": "runner",
    "resume": "runner",
    "modes": "studies.modes",
    "Modes": "studies.modes",
    "cost": "studies.work_precision",
    "Cost": "studies.work_precision",
    "Scene": "scene",
    "Static": "settings",
    "Dynamic": "settings",
    "Supports": "settings",
    "Output": "settings",
    "Observe": "results.observables",
    "Solution": "results.solution",
    "Cable": "net.cable",
    "Group": "net.cable",
    "Law": "net.tension_laws",
    "Web": "net.web",
    "SingleCable": "net.single_cable",
    "Inline": "net.inline",
    "File": "net.inline",
    "Paper": "net.lattices",
    "Window": "net.lattices",
    "Layers": "net.lattices",
    "Gravity": "effects.gravity",
    "Load": "effects.load",
    "Motion": "effects.motion",
    "PointMass": "effects.point_mass",
    "Velocity": "effects.velocity",
    "Body": "effects.body",
    "Contact": "effects.contact.table",
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
    "InputError": "errors",
    "SolverError": "errors",
}
__all__ = sorted(_HOME)


def __getattr__(name):
    import importlib

    if name not in _HOME:
        from .tables import nearest

        raise AttributeError(f"module 'refweb' has no attribute {name!r}, {nearest(name, _HOME)}")
    return getattr(importlib.import_module(f"{__name__}.{_HOME[name]}"), name)


def __dir__():
    return __all__
