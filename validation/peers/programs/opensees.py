"""OpenSeesPy: corotational trusses of an elastic material without stiffness under compression."""

import numpy as np
import openseespy.opensees as ops

from ..contact import Contacts
from ..many import by_processes

COMPILES = False


def version():
    return f"OpenSees {ops.version()}"


def net(problem):
    """Nodes stand at the start of a search, so that materials have the strain that lines have there."""
    ops.wipe()
    ops.model("basic", "-ndm", 3, "-ndf", 3)
    start, ends = problem.start, problem.lines.T
    lengths = np.linalg.norm(start[ends[0]] - start[ends[1]], axis=1).tolist()
    for n, point in enumerate(start.tolist()):
        ops.node(n, *point)
    for n in problem.supports.tolist():
        ops.fix(n, 1, 1, 1)
    for c, ((i, j), natural) in enumerate(zip(problem.lines.tolist(), problem.natural.tolist(), strict=True)):
        ops.uniaxialMaterial("Elastic", 2 * c + 1, problem.ea * lengths[c] / natural, 0.0, 0.0)
        ops.uniaxialMaterial("InitStrainMaterial", 2 * c + 2, 2 * c + 1, 1.0 - natural / lengths[c])
        ops.element("corotTruss", c, i, j, 1.0, 2 * c + 2)


def positions(problem):
    return problem.start + [ops.nodeDisp(n) for n in range(len(problem.points))]


def statics(problem, algorithm="Newton", system="UmfPack"):
    net(problem)
    ops.timeSeries("Linear", 1)
    ops.pattern("Plain", 1, 1)
    ops.load(problem.node, 0.0, 0.0, 1.0)
    ops.constraints("Plain")
    ops.numberer("RCM")
    ops.system(system)
    ops.test("NormUnbalance", 1e-9, 100)
    ops.algorithm(algorithm)
    ops.integrator("LoadControl", 1.0)
    ops.analysis("Static")
    for load in problem.loads:
        if (status := ops.analyze(1)) != 0:
            raise RuntimeError(f"analyze returned {status} at {load:g} N")
    return positions(problem)


def moving(problem):
    net(problem)
    for n, mass in enumerate(problem.masses.tolist()):
        ops.mass(n, mass, mass, mass)
    velocities = problem.velocities
    for n, axis in np.argwhere(velocities).tolist():
        ops.setNodeVel(n, axis + 1, float(velocities[n, axis]), "-commit")
    ops.constraints("Plain")
    ops.numberer("RCM")


def explicit():
    ops.system("Diagonal", "lumped")
    ops.algorithm("Linear")
    ops.integrator("ExplicitDifference")
    ops.analysis("Transient")


def impact(problem, steps):
    moving(problem)
    explicit()
    if (status := ops.analyze(steps, problem.duration / steps)) != 0:
        raise RuntimeError(f"analyze returned {status}")
    return positions(problem)


def implicit(problem, steps, integrator=("Newmark", 0.5, 0.25)):
    moving(problem)
    ops.system("SparseSYM")
    ops.test("NormDispIncr", 1e-6, 50)
    ops.algorithm("Newton")
    ops.integrator(*integrator)
    ops.analysis("Transient")
    if (status := ops.analyze(steps, problem.duration / steps)) != 0:
        raise RuntimeError(f"analyze returned {status} at t = {ops.getTime():.4f} s")
    return positions(problem)


def capture(problem, steps):
    """Its contact elements have beams and nodes, not two trusses: loads of each step are those of NumPy.

    They count at the end of the step, which central differences foresee.
    """
    moving(problem)
    contacts = Contacts(problem)
    ops.timeSeries("Constant", 1)
    ops.pattern("Plain", 1, 1)
    for n in range(len(problem.points)):
        ops.load(n, 0.0, 0.0, 0.0)
        for axis in (1, 2, 3):
            ops.parameter(3 * n + axis, "loadPattern", 1, "loadAtNode", n, axis)
    explicit()
    step, x = problem.duration / steps, problem.start
    before = x - step * problem.velocities
    for _ in range(steps):
        ahead = 2.0 * x - before + step**2 * np.array([ops.nodeAccel(n) for n in range(len(x))])
        for k, force in enumerate(contacts.forces(ahead).ravel().tolist(), 1):
            ops.updateParameter(k, force)
        if (status := ops.analyze(1, step)) != 0:
            raise RuntimeError(f"analyze returned {status}")
        before, x = x, positions(problem)
    return x


def draws(problem, steps):
    return by_processes(impact, problem, steps=steps)
