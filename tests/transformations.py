"""The same scene otherwise described: turned, mirrored, renumbered, split up, shuffled, in other units.

Each works on the dict of a scene file and gives one whose results are those of the given scene, times `factor`.
"""

import copy
import random

import numpy as np

POLAR = {
    "gravity": ["acceleration"],
    "load": ["force"],
    "velocity": ["value"],
    "body": ["position", "velocity"],
}
"""Vectors of each table, which turn and are mirrored as places are."""
AXIAL = {"frame": ["angular_velocity"], "body": ["angular_velocity"]}
"""Vectors that a mirror turns around besides."""
LENGTH, TIME, MASS = np.eye(3)
FORCE = MASS + LENGTH - 2 * TIME
PER = {
    "web": {"points": LENGTH, "natural_length": LENGTH},
    "cable": {"modulus": FORCE - 2 * LENGTH, "area": 2 * LENGTH, "density": MASS - 3 * LENGTH},
    "gravity": {"acceleration": LENGTH - 2 * TIME},
    "load": {"force": FORCE},
    "point_mass": {"mass": MASS},
    "velocity": {"value": LENGTH - TIME},
    "body": {
        "radius": LENGTH,
        "mass": MASS,
        "position": LENGTH,
        "velocity": LENGTH - TIME,
        "inertia": MASS + 2 * LENGTH,
    }
    | {"angular_velocity": -TIME},
    "contact": {"stiffness": FORCE - LENGTH, "damping": TIME - LENGTH, "slip_velocity": LENGTH - TIME},
    "damping": {"time": TIME, "rate": -TIME},
    "frame": {"angular_velocity": -TIME},
    "solve": {"duration": TIME},
    "output": {"interval": TIME},
}
"""Exponents of length, time and mass of every key that has a unit; tables of time are `TIMED`."""
TIMED = {"load": ("factor", 0 * LENGTH), "reel": ("factor", 0 * LENGTH), "motion": ("displacement", LENGTH)}
"""Keys that are tables of time, and the unit of their values."""
RESULTS = {
    "m": LENGTH,
    "m/s": LENGTH - TIME,
    "N": FORCE,
    "Pa": FORCE - 2 * LENGTH,
    "J": FORCE + LENGTH,
    "1": 0 * LENGTH,
}
"""Exponents of units of results."""


def each(scene, table):
    """The tables of a name, be there one or several or none."""
    found = scene.get(table, [])
    return found if isinstance(found, list) else [found]


def mapped(scene, matrix):
    """The scene seen along other axes, by an orthogonal matrix."""
    scene, turned = copy.deepcopy(scene), lambda vector: (matrix @ np.array(vector)).tolist()
    scene["web"]["points"] = [turned(point) for point in scene["web"]["points"]]
    for table, keys in POLAR.items():
        for one in each(scene, table):
            one.update({key: turned(one[key]) for key in keys if key in one})
    for table, keys in AXIAL.items():
        for one in each(scene, table):
            one.update({k: (np.linalg.det(matrix) * (matrix @ np.array(one[k]))).tolist() for k in keys if k in one})
    for one in each(scene, "motion"):
        one["displacement"] = [[row[0], *turned(row[1:])] for row in one["displacement"]]
    return scene


def rotated(scene, seed):
    """Turned about the origin at random."""
    matrix = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))[0]
    return mapped(scene, matrix * np.linalg.det(matrix))


def mirrored(scene, seed):
    """Mirrored at a plane through the origin at random."""
    normal = np.random.default_rng(seed).standard_normal(3)
    normal /= np.linalg.norm(normal)
    return mapped(scene, np.eye(3) - 2.0 * np.outer(normal, normal))


def renumbered(scene, seed):
    """Nodes and lines in another order, and lines the other way around."""
    scene, rng, web = copy.deepcopy(scene), np.random.default_rng(seed), scene["web"]
    number, order = rng.permutation(len(web["points"])), rng.permutation(len(web["lines"]))
    points = np.empty((len(number), 3))
    points[number] = web["points"]
    new = scene["web"]
    new["points"] = points.tolist()
    new["lines"] = [[int(number[i]) for i in rng.permutation(web["lines"][k])] for k in order]
    if isinstance(web.get("natural_length"), list):
        new["natural_length"] = [web["natural_length"][k] for k in order]
    new["supports"] = [int(number[i]) for i in web["supports"]]
    place = np.argsort(order)

    def again(given, by):
        if isinstance(given, list):
            return [again(one, by) for one in given]
        return given if isinstance(given, str) else int(by[given])

    for table in ("load", "point_mass", "velocity", "motion", "support", "supports", "observe", "reel"):
        for one in each(scene, table):
            for key, by in (("node", number), ("nodes", number), ("line", place), ("lines", place)):
                if one.get(key) is not None:
                    one[key] = again(one[key], by)
    return scene


def split(scene, seed):
    """Each load and point mass in two parts."""
    scene, rng = copy.deepcopy(scene), np.random.default_rng(seed)
    for table, key in (("load", "force"), ("point_mass", "mass")):
        parts = []
        for one in each(scene, table):
            part = rng.uniform(-1.0, 2.0) if table == "load" else rng.uniform(0.1, 0.9)
            parts += [{**one, key: (share * np.array(one[key])).tolist()} for share in (part, 1.0 - part)]
        if parts:
            scene[table] = parts
    return scene


def shuffled(scene, seed):
    """Tables, their keys and lists of tables in another order, but for observables of results that are compared."""
    rng = random.Random(seed)

    def again(given):
        if isinstance(given, dict):
            keys = list(given)
            rng.shuffle(keys)
            return {key: again(given[key]) for key in keys}
        if isinstance(given, list) and given and isinstance(given[0], dict):
            return rng.sample([again(one) for one in given], len(given))
        return given

    return again(copy.deepcopy(scene))


def sizes(seed):
    """How many of its own units a metre, a second and a kilogram are; powers of two, and not."""
    return np.random.default_rng(seed).choice([1e-3, 0.25, 0.3048, 3.0, 60.0, 1e3], 3)


def in_other_units(scene, seed):
    """Lengths, times and masses in units of their own."""
    scene, unit = copy.deepcopy(scene), sizes(seed)
    for table, keys in PER.items():
        for one in each(scene, table):
            for key in keys.keys() & one.keys():
                if isinstance(one[key], list | float | int):
                    one[key] = (np.prod(unit ** keys[key]) * np.array(one[key])).tolist()
    for table, (key, values) in TIMED.items():
        for one in each(scene, table):
            if key in one:
                one[key] = [[unit[1] * row[0], *(np.prod(unit**values) * v for v in row[1:])] for row in one[key]]
    return scene


def factor(name, seed, unit):
    """What a result of a transformed scene is times that of the given one."""
    return float(np.prod(sizes(seed) ** RESULTS[unit])) if name == "other units" else 1.0


TRANSFORMATIONS = {
    "rotation": rotated,
    "mirror": mirrored,
    "renumbering": renumbered,
    "split loads": split,
    "shuffled tables": shuffled,
    "other units": in_other_units,
}
