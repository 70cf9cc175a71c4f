"""PyElastica: a thin Cosserat rod for each straight string of lines, joined at crossings, which bend, push and pull."""

import importlib.metadata
from itertools import combinations

import elastica
import numpy as np

COMPILES = True


def version():
    return f"PyElastica {importlib.metadata.version('pyelastica')}"


class Net(elastica.BaseSystemCollection, elastica.Constraints, elastica.Connections, elastica.Contact):
    pass


def strings(problem):
    """Nodes of the straight strings that lines make, one list a string."""
    across = problem.points[problem.lines[:, 1]] - problem.points[problem.lines[:, 0]]
    after = {}
    for (i, j), way in zip(problem.lines.tolist(), across / np.linalg.norm(across, axis=1)[:, None], strict=True):
        way = tuple((np.round(way, 6) + 0.0).tolist())
        backwards = next(k for k in way if k) < 0.0
        after[(j, tuple(-k + 0.0 for k in way)) if backwards else (i, way)] = i if backwards else j
    first = set(after) - {(j, way) for (_, way), j in after.items()}
    found = []
    for node, way in sorted(first):
        found.append([node])
        while (node, way) in after:
            node = after[node, way]
            found[-1].append(node)
    return found


def rods(problem, radius):
    """The system, and the rod of each string."""
    net, found, start, velocities = Net(), [], problem.start, problem.velocities
    masses, area, carried = problem.point_masses, np.pi * radius**2, {}
    for nodes in strings(problem):
        across = problem.points[nodes[-1]] - problem.points[nodes[0]]
        length = np.linalg.norm(across)
        rod = elastica.CosseratRod.straight_rod(
            len(nodes) - 1,
            problem.points[nodes[0]],
            across / length,
            np.array([0.0, 0.0, 1.0]),
            length,
            radius,
            problem.density / area,
            youngs_modulus=problem.ea / area,
        )
        rod.position_collection[:], rod.velocity_collection[:] = start[nodes].T, velocities[nodes].T
        net.append(rod)
        found.append((rod, nodes))
        for k, n in enumerate(nodes):
            if n in carried:
                other, m = carried[n]
                stiffness = problem.ea / problem.natural.min()  # ten and a hundred times that change nothing
                net.connect(other, rod, m, k).using(elastica.FreeJoint, k=stiffness, nu=0.0)
            else:
                carried[n] = rod, k
                rod.mass[k] += masses[n]
        if fixed := [k for k, n in enumerate(nodes) if not problem.free[n]]:
            net.constrain(rod).using(
                elastica.FixedConstraint, constrained_position_idx=tuple(fixed), constrained_director_idx=()
            )
    return net, found


def moved(problem, net, found, steps):
    """Positions of nodes at the end; a node of two rods is where the first has it."""
    net.finalize()
    elastica.integrate(elastica.PositionVerlet(), net, problem.duration, steps, progress_bar=False)
    positions = problem.start
    for rod, nodes in reversed(found):
        positions[nodes] = rod.position_collection.T
    return positions


def impact(problem, steps, radius):
    """The error of bending falls with the radius squared, and so does the longest stable step with the radius."""
    return moved(problem, *rods(problem, radius), steps)


def capture(problem, steps):
    """Contact is linear in the overlap, and shares the push between the nodes of an element by halves."""
    net, found = rods(problem, problem.line_radius)
    radius = problem.ball_radius - problem.line_radius
    density = problem.masses[problem.ball] / (4.0 / 3.0 * np.pi * radius**3)
    ball = elastica.Sphere(problem.start[problem.ball], radius, density)
    net.append(ball)
    for rod, _ in found:
        net.detect_contact_between(rod, ball).using(elastica.RodSphereContact, k=problem.ball_stiffness, nu=0.0)
    for (one, _), (other, _) in combinations(found, 2):
        net.detect_contact_between(one, other).using(elastica.RodRodContact, k=problem.line_stiffness, nu=0.0)
    positions = moved(problem, net, found, steps)
    positions[problem.ball] = ball.position_collection[:, 0]
    return positions
