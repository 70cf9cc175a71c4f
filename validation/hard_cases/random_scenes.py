"""Scenes at random for the hard cases: nets in statics, and runs near the limit of stability."""

import re

import numpy as np

import refweb

from .balances import unbalanced

LAWS = ("tension-only", "smooth")
REASON = re.compile(r"no equilibrium: a mechanism of \d+ nodes \(\d+.*\) is carried off along [xyz] by \S+ N at step 1")


def random_net(seed):
    """A random graph with slack and stretched lines, supports in some components, loads and mostly gravity."""
    random = np.random.default_rng(seed)
    n, flat = int(random.integers(2, 15)), random.random() < 0.4
    points = random.uniform(-1.0, 1.0, (n, 3)) * [1.0, 1.0, 0.0 if flat else 1.0]
    lines = {(int(random.integers(i)), i) for i in range(1, n) if i < 2 or random.random() > 0.03} or {(0, 1)}
    for _ in range(int(random.integers(0, 2 * n))):
        i, j = sorted(random.choice(n, 2, replace=False).tolist())
        lines.add((i, j))
    used = sorted({i for line in lines for i in line})
    number = {node: i for i, node in enumerate(used)}
    lines = [[number[i], number[j]] for i, j in sorted(lines)]
    points = points[used]
    length = np.linalg.norm(points[[j for _, j in lines]] - points[[i for i, _ in lines]], axis=1)
    natural = length * random.choice([0.95, 1.0, 1.0, 1.0 + 1e-9, 1.05, 1.5], len(lines))
    held = random.choice(len(used), min(len(used), int(random.integers(0, 5))), replace=False).tolist()
    support = [refweb.Supports(nodes=held)] if held else []
    if random.random() < 0.2:
        some = random.choice(["x", "y", "z"], int(random.integers(1, 4)), replace=False).tolist()
        support.append(refweb.Supports(nodes=[int(random.integers(len(used)))], components=some))
    size = 10.0 ** random.uniform(-6, 4)
    effects = [
        refweb.Load(node=int(random.integers(len(used))), force=tuple((size * random.normal(size=3)).tolist()))
        for _ in range(int(random.integers(0, 4)))
    ]
    if random.random() < 0.6:
        effects.append(refweb.Gravity(acceleration=(0.0, 0.0, -9.81)))
    law = LAWS[seed % 2]
    smooth = {"smoothing": float(10.0 ** random.uniform(-8, -3))} if law == "smooth" else {}
    return refweb.Scene(
        web=refweb.Inline(points=points.tolist(), lines=lines, natural_length=natural.tolist()),
        cable=refweb.Cable(law=law, modulus=7e7, area=1e-4, density=200.0, **smooth),
        support=support,
        effects=effects,
        solve=refweb.Static(),
    )


def outcome(scene):
    """ "solved", "relaxed" if only by the method that the refusal names, "carried off", or what is neither, as text.

    "pushed" is refused by both methods, and the message says how hard slack lines push: more than 1 % of the loads.
    """
    found = "solved"
    try:
        with np.errstate(all="ignore"):
            solution = refweb.run(scene)
    except refweb.SolverError as error:
        if REASON.match(str(error)):
            return "carried off"
        if 'method = "relaxation"' not in str(error):
            return str(error)
        try:
            solution, found = refweb.run(scene.replace(solve=refweb.Static(method="relaxation"))), "relaxed"
        except refweb.SolverError as again:
            push = re.search(r"slack lines push with up to (\S+) N", str(error))
            loads = [np.linalg.norm(effect.force) for effect in scene.effects if isinstance(effect, refweb.Load)]
            return "pushed" if push and float(push[1]) > 0.01 * max(loads, default=0.0) else str(again)
    left = unbalanced(solution)
    if not left < 1e-7:
        return f"force left {left:.1e}"
    gap = solution.solver["duality_gap"]
    # the gap is compared with what lines store and loads do; below are forces that are rounding, over a line's length
    stored = sum(abs(value[-1]) for name, value in solution.history.items() if "energy" in name)
    loads = [np.linalg.norm(effect.force) for effect in scene.effects if isinstance(effect, refweb.Load)]
    stored += sum(loads) * np.abs(solution.state.x).max()
    rounding = np.finfo(float).eps * (7e7 * 1e-4 * solution.state.system.net.natural_length).sum()
    if solution.scene.cable.law == "tension-only" and not 0.0 <= gap <= 1e-6 * stored + rounding:
        return f"gap {gap:.1e} J of {stored:.1e} J"
    return found


def near_the_limit(seed):
    """A slack net, thrown about or hit, in steps just below the bound."""
    random = np.random.default_rng(seed)
    n = int(random.integers(3, 6))
    points = [[0.1 * i, 0.1 * j, 0.0] for i in range(n) for j in range(n)]
    lines = [[n * i + j, n * i + j + 1] for i in range(n) for j in range(n - 1)]
    lines += [[n * i + j, n * i + j + n] for i in range(n - 1) for j in range(n)]
    natural = 0.1 * random.choice([0.99, 1.0, 1.0 + 1e-6, 1.05], len(lines))
    effects = [
        refweb.Velocity(node=i, value=tuple((v * random.normal(size=3)).tolist()))
        for i, v in zip(random.choice(n * n, 3, replace=False).tolist(), 10.0 ** random.uniform(-3, 2, 3), strict=True)
    ]
    if random.random() < 0.7:
        place = (*random.uniform(0.0, 0.1 * n, 2).tolist(), -0.06)
        ball = dict(name="ball", radius=0.05, mass=float(10.0 ** random.uniform(-4, 1)), position=place)
        effects.append(refweb.Body(**ball, velocity=(0.0, 0.0, float(10.0 ** random.uniform(-1, 3)))))
        effects.append(refweb.Contact(stiffness=float(10.0 ** random.uniform(2, 8))))
    web = refweb.Inline(points=points, lines=lines, natural_length=natural.tolist())
    cable = refweb.Cable(law="tension-only", modulus=7e7, area=1e-6, density=200.0)
    safety = float(random.uniform(0.7, 1.0))
    duration = 300 * 0.1 / np.sqrt(7e7 / 200.0) / 5.0
    return refweb.Scene(
        web=web,
        cable=cable,
        effects=effects,
        solve=refweb.Dynamic(duration=duration, safety=safety),
        output=refweb.Output(interval=duration / 20, frames=20),
        accuracy=refweb.Accuracy(error="none"),
    )
