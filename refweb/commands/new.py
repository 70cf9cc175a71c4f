"""Write a commented scene file to start from."""

# This docstring is the help of the verb. May change: comments in `START`. Must stay: `add_arguments` and `run`, which
# `refweb.__main__` calls; keys in `START`, all of which tests/commands/test_new.py uncomments and runs; in `KEYS` all
# keys of scenes and studies that hold paths: a new one goes there.

import json
import os
import pathlib
import re
import shutil
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
law = "tension-only"        # smooth | tension-only | linear | force-density | constant-force
modulus = 7e7               # E [Pa]
area = 1e-4                 # A [m²]
density = 200.0             # [kg/m³]
# prestrain = 1e-3          # natural length = distance/(1 + prestrain); or pretension [N], or sag
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

KEYS = ("path", "lines", "positions", "file", "start", "scene")
"""Keys whose texts may be paths, which start at the folder of the scene."""


def add_arguments(parser):
    """Declare the name of the file, and the scene or study that it begins as a copy of."""
    parser.add_argument("name", metavar="NAME", help="the scene file is NAME.toml")
    parser.add_argument(
        "--from", dest="source", metavar="SCENE", help="begin with a copy of this scene or study, file or name"
    )
    parser.add_argument("--force", action="store_true", help="replace the file if it exists")


def run(arguments):
    """Refuse to overwrite, write the file, say how to run it."""
    from ..sweeps.study import is_study

    target = pathlib.Path(arguments.name.removesuffix(".toml") + ".toml")
    if not target.parent.is_dir():
        raise InputError(f"{short(str(target))}: there is no folder {short(str(target.parent))}")
    if target.is_dir() or (target.exists() and not arguments.force):
        force = "" if target.is_dir() else ", or use --force to replace it"
        raise InputError(f"{short(str(target))}: already exists: choose another name{force}")
    text, copies = scene_text(target, arguments.source)
    for source, copy in copies.items():
        if copy.exists() and not arguments.force and (copy.is_dir() or copy.read_bytes() != source.read_bytes()):
            raise InputError(
                f"{short(str(copy))}: already exists, and is another file than that of the scene: choose another "
                "folder, or use --force to replace it"
            )
    from ..results.files import write_atomically, write_text

    for source, copy in copies.items():
        write_atomically(copy, lambda name, source=source: shutil.copyfile(source, name))
    write_text(target, text)
    beside = f", with {', '.join(copy.name for copy in copies.values())}" if copies else ""
    if arguments.source is not None and is_study(arguments.source):
        print(f"{target} is written: refweb check {target}, refweb sweep {target}")
        return
    print(f"{target} is written{beside}: refweb check {target}, refweb run {target}")


def scene_text(target, source=None):
    """Text of a scene file ``target``, and the copies that it needs, of files by their paths.

    The text is that of another scene or study with the title of this, or `START`. Files of a shipped scene come along;
    those of other scenes stay where they are, and their paths lead there.
    """
    from ..scene import SHIPPED_SCENES, Scene, file_of
    from ..sweeps.study import Study, is_study, load

    study = source is not None and is_study(source)
    if source is None:
        path, text = target, START
    elif study:
        path = pathlib.Path(load(source).folder or ".") / f"{pathlib.Path(source).stem}.toml"
        text = path.read_bytes().decode("utf-8-sig")
    else:
        path = file_of(source)
        Scene.load(path)
        text = path.read_bytes().decode("utf-8-sig")
    given = tomllib.loads(text)
    copied = path.parent == SHIPPED_SCENES
    changes = {} if copied or source is None else _moved(given, path.parent, target.parent)
    wanted = _with_paths(given, lambda name: changes.get(name, name))
    if "title" in given:
        wanted["title"] = target.stem
        text = _with_text(text, ("title",), given["title"], target.stem)
    for old, new in changes.items():
        text = _with_text(text, KEYS, old, new)
    with in_file(target.name):
        if _with_paths(tomllib.loads(text), lambda name: name) != wanted:
            keys = " and ".join([*_keys_of(given, changes), *(["title"] if "title" in given else [])])
            raise InputError(f"{keys} of {path.name} cannot be changed in place: copy the file by hand")
        if study:
            Study(**{"title": target.stem, **wanted, "folder": target.parent})
            return text, {}
        Scene.from_dict({"title": target.stem, **wanted}, target.parent)
    return text, {path.parent / name: target.parent / name for name in _paths(given)} if copied else {}


def _with_paths(given, change):
    """The dict of a scene or a study with ``change(path)`` of each path in it."""
    from ..registry import with_files
    from ..settings import START_STATES

    given = with_files(given, change)
    solve = given.get("solve", {})
    if isinstance(start := solve.get("start"), str) and start not in START_STATES:
        given["solve"] = {**solve, "start": change(start)}
    if "parameters" in given and given["scene"].endswith(".toml"):
        given["scene"] = change(given["scene"])
    return given


def _paths(given):
    """Relative paths of files in the dict of a scene."""
    paths = []
    _with_paths(given, lambda name: paths.append(name) or name)
    return [name for name in dict.fromkeys(paths) if not os.path.isabs(name)]


def _keys_of(given, names):
    """Keys of tables of a scene that have one of some texts, ``web.path``."""
    for table, content in given.items():
        for entry in content if isinstance(content, list) else [content]:
            if isinstance(entry, dict):
                yield from (f"{table}.{key}" for key, value in entry.items() if key in KEYS and str(value) in names)


def _moved(given, folder, target):
    """Relative paths in the dict of a scene by those that lead to the same files from another folder."""
    if folder.resolve() == target.resolve():
        return {}
    return {name: pathlib.Path(os.path.relpath(folder / name, target)).as_posix() for name in _paths(given)}


def _with_text(text, keys, old, new):
    """A scene file with another text in place of an old one, of keys that begin a line or follow a brace or a comma."""
    words = re.compile(rf"""(?m)((?:^|[{{,])[ \t]*(?:{"|".join(keys)})[ \t]*=[ \t]*)("(?:[^"\\\n]|\\.)*"|'[^'\n]*')""")

    def change(match):
        same = tomllib.loads(f"value = {match[2]}")["value"] == old
        return match[1] + json.dumps(new, ensure_ascii=False) if same else match[0]

    return words.sub(change, text)
