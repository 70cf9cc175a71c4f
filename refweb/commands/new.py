"""Write a commented scene file to start from."""

import json
import os
import pathlib
import re
import tomllib

from ..errors import InputError, in_file
from ..messages import short

START = """# What this scene shows, in a line.
#
# Units are SI. A table that is present is an effect that is present; remove the # from what you want.
# `refweb help` lists all tables, `refweb help web` says what [web] may hold. For an editor that completes keys write
# `refweb schema > refweb.schema.json`, and begin this file with the line `#:schema ./refweb.schema.json`.
schema = 1
title = "Start"

[web]
kind = "window"             # paper | window | layers | cable | inline | file
mesh = "square"             # triangle | square | hexagon
rows = 12                   # of cells
columns = 12
side = 0.1                  # length of each line [m]

[cable]
law = "tension-only"        # smooth | tension-only | linear
modulus = 7e7               # E [Pa]
area = 1e-4                 # A [m²]
density = 200.0             # [kg/m³]
# prestrain = 1e-3          # natural length = distance/(1 + prestrain)
# strength = 2e8            # [Pa], for the utilisation

# In place of the web's own supports: node numbers, "rim", "corners", "centre", "all", or none, [].
# [supports]
# nodes = "rim"
# components = ["x", "y", "z"]

# [gravity]
# acceleration = [0.0, 0.0, -9.81]

# [[point_mass]]
# node = "centre"
# mass = 0.5                # [kg]

# [[load]]
# node = "centre"
# force = [0.0, 0.0, 1.0]   # [N]

[[body]]
name = "ball"
shape = "sphere"            # sphere | ring | box | cylinder | capsule | mesh | plane | terrain
radius = 0.1                # [m]
mass = 1.0                  # [kg]
position = [0.0, 0.0, -0.11]
velocity = [0.0, 0.0, 1.0]  # [m/s]

[contact]                   # its stiffness is chosen where it is left out
# friction = 0.2

[solve]
kind = "dynamic"            # static | dynamic
duration = 0.25             # [s]
# method = "auto"           # central-difference | explicit | cvode | ida | auto

[output]
interval = 1e-3             # a history row every so many seconds
frames = 10                 # a frame every so many rows

# [accuracy]
# digits = 2                # accuracy is raised until every result has so many

[[observe]]
name = "deflection"
quantity = "displacement"   # position, velocity, reaction, tension, stress, strain, energies, ...
reduce = "max"              # max | min | final

[[observe]]
name = "force_on_ball"
quantity = "reaction"
body = "ball"
reduce = "max"
"""
PATHS = ("web.path", "web.lines", "solve.start")
"""Keys whose texts may be paths, which start at the folder of the scene."""


def add_arguments(parser):
    """The name, and what it begins with."""
    parser.add_argument("name", metavar="NAME", help="the scene file is NAME.toml")
    parser.add_argument("--from", dest="source", metavar="SCENE", help="begin with a copy of this scene, file or name")
    parser.add_argument("--force", action="store_true", help="replace the file if it exists")


def run(arguments):
    """Refuse to overwrite, write the file, say how to run it."""
    target = pathlib.Path(arguments.name.removesuffix(".toml") + ".toml")
    if not target.parent.is_dir():
        raise InputError(f"{short(str(target))}: there is no folder {short(str(target.parent))}")
    if target.is_dir() or (target.exists() and not arguments.force):
        force = "" if target.is_dir() else ", or use --force to replace it"
        raise InputError(f"{short(str(target))}: already exists: choose another name{force}")
    from ..results.files import write_text

    write_text(target, scene_text(target, arguments.source))
    print(f"{target} is written: refweb check {target}, refweb run {target}")


def scene_text(target, source=None):
    """The text of a scene file ``target``: that of another one with the title of this, or `START`."""
    from ..reference.paths import with_value
    from ..scene import Scene, file_of

    if source is None:
        text, folder, name = START, target.parent, target.name
    else:
        path = file_of(source)
        Scene.load(path)
        text, folder, name = path.read_bytes().decode("utf-8-sig"), path.parent, path.name
    given = wanted = tomllib.loads(text)
    changes = _moved(given, folder, target.parent)
    if "title" in given:
        changes["title"] = target.stem
    for path, value in changes.items():
        wanted, text = with_value(wanted, path, value), _with_text(text, path, value)
    with in_file(target.name):
        if tomllib.loads(text) != wanted:
            keys = " and ".join(changes)
            raise InputError(f"{keys} of {name} cannot be changed in place: copy the file by hand")
        Scene.from_dict({"title": target.stem, **wanted}, target.parent)
    return text


def _moved(given, folder, target):
    """Values by path of what is a relative path from one folder, as seen from another."""
    from ..settings import START_STATES

    moved = {}
    for path in PATHS:
        table, key = path.split(".")
        value = given[table].get(key)
        if isinstance(value, str) and value not in START_STATES and folder.resolve() != target.resolve():
            if not os.path.isabs(value):
                moved[path] = pathlib.Path(os.path.relpath(folder / value, target)).as_posix()
    return moved


def _with_text(text, path, value):
    """A scene file with another text at a path, where the key begins a line and its text ends on it; else as it is."""
    key = path.rpartition(".")[2]
    pattern = rf"""(?m)^([ \t]*{key}[ \t]*=[ \t]*)("(?:[^"\\\n]|\\.)*"|'[^'\n]*')"""
    return re.sub(pattern, lambda line: line[1] + json.dumps(value, ensure_ascii=False), text)
