"""Gymnasium environments of scenes: spaces, episodes, images; they know stepped runs, and no command line.

Importing this package registers the shipped environments, so that ``gymnasium.make("refweb/CornerControl-v0")`` works;
``gymnasium.make("refweb.gym:refweb/CornerControl-v0")`` imports it by itself. ``refweb/Scene-v0`` is the environment of
any scene with a table ``[gym]``, ``gymnasium.make("refweb/Scene-v0", scene="my-net.toml")``. It needs the library
Gymnasium, ``pip install "refweb[gym]"``.

May change: the text on installation. Must stay: ids and names of scenes in `SHIPPED`, which users write: a scene that
changes what an agent sees or gets needs an id with the next number; the error that names Gymnasium where it is missing.
Tests: ``tests/gym/test_environment.py``.
"""

try:
    import gymnasium
except ImportError as error:
    raise ImportError(f'refweb.gym needs Gymnasium ({error}): pip install "refweb[gym]"') from None

from .environment import SceneEnv as SceneEnv

SHIPPED = {
    "refweb/NetCapture-v0": "net-capture",
    "refweb/SpinDeployment-v0": "hub-deployment",
    "refweb/CornerControl-v0": "corner-control",
}
"""Scenes of the environments by id."""

for _id, _name in SHIPPED.items():
    gymnasium.register(_id, "refweb.gym:SceneEnv", kwargs={"scene": _name})
gymnasium.register("refweb/Scene-v0", "refweb.gym:SceneEnv")
