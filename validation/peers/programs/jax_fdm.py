"""jax_fdm: the equilibrium of force densities."""

import jax_fdm
import numpy as np
from jax_fdm.datastructures import FDNetwork
from jax_fdm.equilibrium import fdm

COMPILES = True


def version():
    return f"jax_fdm {jax_fdm.__version__}"


def form(problem, force_density=7.0):
    network = FDNetwork.from_nodes_and_edges(problem.points.tolist(), problem.lines.tolist())
    network.nodes_supports(problem.supports.tolist())
    network.edges_forcedensities(force_density)
    found = fdm(network)
    return np.array([found.node_coordinates(n) for n in range(len(problem.points))])
