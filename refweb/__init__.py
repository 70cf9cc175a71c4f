"""refweb, a reference solver for space webs: equilibrium and dynamics of cable nets.

Names are imported when they are used: ``import refweb`` loads nothing that a scene does not need.
"""

__version__ = "0.1.0"


def __getattr__(name):
    from .registry import exports, load

    names = exports()
    if name == "__all__":
        return sorted(names)
    if name not in names:
        from .messages import nearest

        raise AttributeError(f"module 'refweb' has no attribute {name!r}, {nearest(name, names)}")
    return load(names[name])


def __dir__():
    from .registry import exports

    return sorted(exports())
