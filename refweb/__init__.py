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
    "Accuracy": "settings",
    "Event": "settings",
    "InputError": "errors",
    "SolverError": "errors",
}


def _homes():
    """Module of each exported name; effects stand in the table of all effects."""
    from .registry import EFFECTS

    effects = (reference.removeprefix("refweb.").split(":") for reference in EFFECTS.values())
    return {**_HOME, **{name: module for module, name in effects}}


def __getattr__(name):
    import importlib

    homes = _homes()
    if name == "__all__":
        return sorted(homes)
    if name not in homes:
        from .tables import nearest

        raise AttributeError(f"module 'refweb' has no attribute {name!r}, {nearest(name, homes)}")
    return getattr(importlib.import_module(f"{__name__}.{homes[name]}"), name)


def __dir__():
    return sorted(_homes())
