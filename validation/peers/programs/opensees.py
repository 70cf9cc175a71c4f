"""OpenSeesPy: corotational trusses of an elastic material without stiffness under compression."""

import numpy as np
import openseespy.opensees as ops

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
    ops.setNodeVel(problem.node, 3, problem.speed, "-commit")
    ops.constraints("Plain")
    ops.numberer("RCM")


def impact(problem, steps):
    moving(problem)
    ops.system("Diagonal", "lumped")
    ops.algorithm("Linear")
    ops.integrator("ExplicitDifference")
    ops.analysis("Transient")
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
