"""Kratos: its cable elements, which carry no compression, with central differences and Newton's method."""

import importlib.metadata

import KratosMultiphysics as Kratos
import KratosMultiphysics.StructuralMechanicsApplication as Structural
import numpy as np
from KratosMultiphysics.python_linear_solver_factory import ConstructSolver

from ..contact import Contacts
from ..many import by_processes

COMPILES = False
VARIABLES = (
    *(Kratos.DISPLACEMENT, Kratos.REACTION, Kratos.VELOCITY, Kratos.ACCELERATION, Kratos.VOLUME_ACCELERATION),
    Structural.POINT_LOAD,
)
EXPLICIT = (
    *(Structural.MIDDLE_VELOCITY, Structural.FRACTIONAL_ACCELERATION, Structural.FRACTIONAL_ANGULAR_ACCELERATION),
    *(Structural.MIDDLE_ANGULAR_VELOCITY, Structural.NODAL_INERTIA, Kratos.NODAL_MASS, Kratos.FORCE_RESIDUAL),
    *(Kratos.RESIDUAL_VECTOR, Kratos.MOMENT_RESIDUAL),
)
Kratos.Logger.GetDefaultOutput().SetSeverity(Kratos.Logger.Severity.WARNING)


def version():
    return f"Kratos {importlib.metadata.version('KratosMultiphysics')}"


def net(problem, variables=VARIABLES):
    part = Kratos.Model().CreateModelPart("net")
    part.ProcessInfo.SetValue(Kratos.DOMAIN_SIZE, 3)
    part.ProcessInfo.SetValue(Kratos.COMPUTE_LUMPED_MASS_MATRIX, True)
    for variable in variables:
        part.AddNodalSolutionStepVariable(variable)
    part.SetBufferSize(2)
    properties = part.CreateNewProperties(1)
    for variable, value in (
        (Kratos.YOUNG_MODULUS, problem.ea),
        (Kratos.DENSITY, problem.density),
        (Structural.CROSS_AREA, 1.0),
        (Structural.TRUSS_PRESTRESS_PK2, 0.0),
        (Kratos.CONSTITUTIVE_LAW, Structural.TrussConstitutiveLaw()),
    ):
        properties.SetValue(variable, value)
    for n, point in enumerate(problem.points.tolist(), 1):
        part.CreateNewNode(n, *point)
    for c, (i, j) in enumerate(problem.lines.tolist(), 1):
        part.CreateNewElement("CableElement3D2N", c, [i + 1, j + 1], properties)
    utilities = Kratos.VariableUtils()
    for axis in "XYZ":
        displacement, reaction = (getattr(Kratos, f"{name}_{axis}") for name in ("DISPLACEMENT", "REACTION"))
        utilities.AddDof(displacement, reaction, part)
        for n in problem.supports.tolist():
            part.Nodes[n + 1].Fix(displacement)
    for c, n in enumerate(np.flatnonzero(problem.point_masses).tolist(), len(problem.lines) + 1):
        mass = part.CreateNewElement("NodalConcentratedElement3D1N", c, [n + 1], part.CreateNewProperties(c))
        mass.SetValue(Kratos.NODAL_MASS, problem.point_masses[n])
    displace(problem, part)
    for node, velocity in zip(part.Nodes, problem.velocities.tolist(), strict=True):
        node.SetSolutionStepValue(Kratos.VELOCITY, 0, velocity)
        node.SetSolutionStepValue(Kratos.VELOCITY, 1, velocity)
    return part


def displace(problem, part):
    for node, moved in zip(part.Nodes, problem.start - problem.points, strict=True):
        node.SetSolutionStepValue(Kratos.DISPLACEMENT, 0, Kratos.Array3(moved.tolist()))
        node.SetSolutionStepValue(Kratos.DISPLACEMENT, 1, Kratos.Array3(moved.tolist()))
        node.X, node.Y, node.Z = node.X0 + moved[0], node.Y0 + moved[1], node.Z0 + moved[2]


def positions(problem, part):
    return problem.points + [list(node.GetSolutionStepValue(Kratos.DISPLACEMENT)) for node in part.Nodes]


def newton(part, scheme, relative=1e-10, absolute=1e-9):
    solver = ConstructSolver(Kratos.Parameters('{"solver_type": "LinearSolversApplication.sparse_lu"}'))
    criterion = Kratos.ResidualCriteria(relative, absolute)
    builder = Kratos.ResidualBasedBlockBuilderAndSolver(solver)
    strategy = Kratos.ResidualBasedNewtonRaphsonStrategy(part, scheme, criterion, builder, 100, False, False, True)
    strategy.SetEchoLevel(0)
    strategy.Initialize()
    return strategy


def step(part, strategy, time):
    part.CloneTimeStep(time)
    part.ProcessInfo[Kratos.STEP] += 1
    strategy.InitializeSolutionStep()
    strategy.Predict()
    if not strategy.SolveSolutionStep():
        raise RuntimeError(f"Newton-Raphson has not converged at {time:g}")
    strategy.FinalizeSolutionStep()


def statics(problem):
    part = net(problem)
    part.CreateNewCondition("PointLoadCondition3D1N", 1, [problem.node + 1], part.GetProperties(1))
    strategy = newton(part, Kratos.ResidualBasedIncrementalUpdateStaticScheme())
    for load in problem.loads.tolist():
        part.Nodes[problem.node + 1].SetSolutionStepValue(Structural.POINT_LOAD_Z, load)
        step(part, strategy, load)
    return positions(problem, part)


def implicit(problem, steps):
    part = net(problem)
    strategy = newton(part, Kratos.ResidualBasedNewmarkDisplacementScheme(), 1e-8, 1e-8)
    for time in np.linspace(0.0, problem.duration, steps + 1)[1:].tolist():
        step(part, strategy, time)
    return positions(problem, part)


def impact(problem, steps, push=lambda part: None):
    part = net(problem, (*VARIABLES, *EXPLICIT))
    scheme = Structural.ExplicitCentralDifferencesScheme(0.0, 0.0, 0.0)
    strategy = Structural.MechanicalExplicitStrategy(part, scheme, False, False, True)
    strategy.SetEchoLevel(0)
    step = problem.duration / steps
    part.ProcessInfo.SetValue(Kratos.DELTA_TIME, step)
    for node, velocity in zip(part.Nodes, problem.velocities.tolist(), strict=True):
        node.SetSolutionStepValue(Structural.MIDDLE_VELOCITY, 0, velocity)
    for time in (step * np.arange(1, steps + 1)).tolist():
        part.CloneTimeStep(time)
        push(part)
        strategy.Solve()
    return positions(problem, part)


def capture(problem, steps):
    """Its contact applications have surfaces and grains, not lines: loads of each step are those of NumPy."""
    contacts, utilities = Contacts(problem), Kratos.VariableUtils()

    def push(part):
        if not part.NumberOfConditions():
            for n in range(1, len(problem.points) + 1):
                part.CreateNewCondition("PointLoadCondition3D1N", n, [n], part.GetProperties(1))
        x = problem.points + np.reshape(
            utilities.GetSolutionStepValuesVector(part.Nodes, Kratos.DISPLACEMENT, 1, 3), (-1, 3)
        )
        pushed = Kratos.Vector(contacts.forces(x).ravel())
        utilities.SetSolutionStepValuesVector(part.Nodes, Structural.POINT_LOAD, pushed, 0)

    return impact(problem, steps, push)


def draws(problem, steps):
    return by_processes(impact, problem, steps=steps)
