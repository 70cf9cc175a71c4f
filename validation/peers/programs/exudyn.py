"""Exudyn: mass points, and spring-dampers whose force is a symbolic function, which needs no Python while it runs."""

import exudyn as exu
import numpy as np
from exudyn.advancedUtilities import CreateSymbolicUserFunction
from exudyn.itemInterface import (
    LoadForceVector,
    MarkerNodePosition,
    NodePoint,
    NodePointGround,
    ObjectConnectorSpringDamper,
    ObjectGenericODE2,
    ObjectMassPoint,
)

from ..contact import Contacts
from ..many import by_processes

COMPILES = False


def version():
    return f"Exudyn {exu.__version__}"


def tension(mbs, t, item, stretch, rate, stiffness, damping, force):
    return exu.symbolic.max(0.0, stiffness * stretch)


def system(problem):
    """The system, its nodes and markers, and the law, which has to live as long as the system does."""
    mbs = exu.SystemContainer().AddSystem()
    velocity, moved, masses, nodes, markers = problem.velocities, problem.start - problem.points, problem.masses, [], []
    for n, (point, free) in enumerate(zip(problem.points, problem.free, strict=True)):
        if free:
            nodes.append(
                mbs.AddNode(
                    NodePoint(referenceCoordinates=point, initialCoordinates=moved[n], initialVelocities=velocity[n])
                )
            )
            mbs.AddObject(ObjectMassPoint(mass=masses[n], nodeNumber=nodes[n]))
        else:
            nodes.append(mbs.AddNode(NodePointGround(referenceCoordinates=point)))
        markers.append(mbs.AddMarker(MarkerNodePosition(nodeNumber=nodes[n])))
    law = CreateSymbolicUserFunction(
        mbs, tension, "springForceUserFunction", itemTypeName="ObjectConnectorSpringDamper"
    )
    for (i, j), length in zip(problem.lines, problem.natural, strict=True):
        mbs.AddObject(
            ObjectConnectorSpringDamper(
                markerNumbers=[markers[i], markers[j]],
                referenceLength=length,
                stiffness=problem.ea / length,
                springForceUserFunction=law,
            )
        )
    return mbs, nodes, markers, law


def positions(mbs, nodes):
    return np.array([mbs.GetNodeOutput(n, exu.OutputVariableType.Position) for n in nodes])


def settings_of(problem, steps):
    settings = exu.SimulationSettings()
    settings.timeIntegration.numberOfSteps, settings.timeIntegration.endTime = steps, problem.duration
    settings.timeIntegration.verboseMode = 0
    settings.solutionSettings.writeSolutionToFile = False
    settings.linearSolverType = exu.LinearSolverType.EigenSparse
    return settings


def impact(problem, steps):
    mbs, nodes, _, law = system(problem)
    mbs.Assemble()
    mbs.SolveDynamic(settings_of(problem, steps), solverType=exu.DynamicSolverType.VelocityVerlet)
    return positions(mbs, nodes)


def implicit(problem, steps):
    mbs, nodes, _, law = system(problem)
    mbs.Assemble()
    mbs.SolveDynamic(settings_of(problem, steps), solverType=exu.DynamicSolverType.TrapezoidalIndex2)
    return positions(mbs, nodes)


def statics(problem):
    mbs, nodes, markers, law = system(problem)
    mbs.AddLoad(LoadForceVector(markerNumber=markers[problem.node], loadVector=[0.0, 0.0, problem.loads[-1]]))
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.staticSolver.numberOfLoadSteps = len(problem.loads)
    settings.staticSolver.verboseMode = 0
    settings.solutionSettings.writeSolutionToFile = False
    settings.linearSolverType = exu.LinearSolverType.EigenSparse
    mbs.SolveStatic(settings)
    return positions(mbs, nodes)


def capture(problem, steps):
    """Exudyn has no contact of lines with each other: an object of all nodes has that of NumPy as its force."""
    mbs, nodes, _, law = system(problem)
    contacts, none = Contacts(problem), exu.MatrixContainer()
    size = problem.points.size
    none.SetWithSparseMatrix(np.empty((0, 3)), size, size)

    def force(mbs, t, item, q, v):
        return contacts.forces(problem.points + np.reshape(q, (-1, 3))).ravel()

    mbs.AddObject(ObjectGenericODE2(nodeNumbers=nodes, massMatrix=none, forceUserFunction=force))
    mbs.Assemble()
    mbs.SolveDynamic(settings_of(problem, steps), solverType=exu.DynamicSolverType.VelocityVerlet)
    return positions(mbs, nodes)


def draws(problem, steps):
    return by_processes(impact, problem, steps=steps)
