"""Hits of a ball on a web whose cells are smaller than the ball: how deep lines get, and whether it goes through.

Neither is asked of refweb: depth is the radius less the distance of a line from the centre, and the ball is through
where a free node that it came to from one side is on its other side, within four fifths of its radius of the way it
flies. Lines that a ball has pushed aside are further from its way than that, and what holds the web stays where it is.
"""

import numpy as np

import refweb

ACROSS = 0.8
"""Distance from the way of a ball within which a node behind it shows that it went through, over its radius."""


def random_hit(seed, given=False):
    """A ball thrown at a web held at its rim, its contact left to refweb or, ``given``, as soft as it comes."""
    random = np.random.default_rng(seed)
    mesh, side = str(random.choice(["square", "triangle", "hexagon"])), 0.1
    web = refweb.Window(mesh=mesh, rows=5, columns=4 if mesh == "hexagon" else 5, side=side)
    radius = float(side * random.uniform(2.0, 3.0) * (1.8 if mesh == "hexagon" else 1.0))
    points = web.web().points
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0)) + [*random.uniform(-0.5 * side, 0.5 * side, 2), 0.0]
    gap, speed = float(random.uniform(1e-3, 0.5 * radius)), float(10.0 ** random.uniform(-0.5, 1.5))
    mass, exponent = float(10.0 ** random.uniform(-2.0, 1.0)), float(random.choice([1.0, 1.5]))
    stiffness = float(10.0 ** random.uniform(0.0, 5.0)) if given else None
    ball = refweb.Body(
        name="ball",
        radius=radius,
        mass=mass,
        position=tuple((middle - [0.0, 0.0, radius + gap]).tolist()),
        velocity=(0.0, 0.0, speed),
    )
    prestrain = float(random.choice([0.0, 1e-3, -0.02]))
    duration = (gap + 3.0 * radius) / speed
    return refweb.Scene(
        web=web,
        cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-5, density=200.0, prestrain=prestrain),
        effects=[ball, refweb.Contact(stiffness=stiffness, exponent=exponent)],
        solve=refweb.Dynamic(duration=duration),
        output=refweb.Output(interval=duration / 60, frames=1),
        accuracy=refweb.Accuracy(error="none"),
    )


def depths(state, body):
    """Depth of each line in a ball [m], shape (lines,): the radius less the distance of the segment from the centre."""
    net = state.system.net
    first, last = (state.position[net.web.lines[:, k]] - state.position[body.row] for k in range(2))
    along = last - first
    square = np.maximum((along**2).sum(axis=1), 1e-300)
    place = np.clip(-(first * along).sum(axis=1) / square, 0.0, 1.0)
    return body.radius - np.linalg.norm(first + place[:, None] * along, axis=1)


def through(state, body):
    """Whether a ball that came from below has a free node that stood in its way behind it, and near its way."""
    net, free = state.system.net, ~state.system.supported.all(axis=1)
    before, away = (points[: net.nodes] - points[body.row] for points in (net.points, state.position))
    met = free[: net.nodes] & (np.linalg.norm(before[:, :2], axis=1) < body.radius)
    near = met & (np.linalg.norm(away[:, :2], axis=1) < ACROSS * body.radius)
    return bool((away[near, 2] < 0.0).any())


def outcome(scene):
    """What became of a hit: "held", "said", "refused", or what is wrong."""
    try:
        with np.errstate(all="ignore"):
            solution = refweb.run(scene)
    except refweb.SolverError as error:
        return "refused" if "passes the core of a body" in str(error) else str(error)
    body, allowed = solution.state.system.net.bodies[0], 0.1 * solution.state.system.net.bodies[0].radius
    told, own = solution.bodies["ball"], max(float(depths(state, body).max()) for _, state in solution.frames)
    if own > told["overlap"] * (1.0 + 1e-9):
        return f"{own:.4g} m deep in a row, {told['overlap']:.4g} m are told"
    if any(through(state, body) for _, state in solution.frames):
        return "went through"
    said = any("should be enough" in text for text in solution.warnings)
    if said != (told["overlap"] > allowed):
        return f"{told['overlap']:.4g} m of {allowed:.4g} m: {'said' if said else 'silent'}"
    return "said" if said else "held"
