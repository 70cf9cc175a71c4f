"""States that dynamics starts from: the web as it is, its equilibrium, or the last state of another run."""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from ..messages import short
from ..net.rigid_body import row_names


def equilibrium(system, progress=None):
    """The `refweb.statics.equilibrium.Equilibrium` at t = 0 under gravity, loads, motion and fixed bodies.

    Free bodies wait.

    Raises
    ------
    SolverError
        Where there is no equilibrium, or none is found.
    """
    from ..statics.load_steps import solve

    (found,) = solve(system.at_rest(), [0.0], progress)
    return found


def checkpoint(folder, name, remedy=""):
    """The arrays of the checkpoint in a result folder, by name; ``name`` begins the message that refuses it."""
    try:
        with np.load(folder / "checkpoint.npz") as archive:
            return {key: archive[key] for key in archive}
    except OSError as error:
        reason = "is no folder" if not folder.is_dir() else f"checkpoint.npz cannot be read: {error.strerror or error}"
        raise InputError(f"{name} {reason};{remedy}".removesuffix(";")) from None
    except Exception as error:  # whatever an archive that is spoilt leads to
        reason = short(str(error) or type(error).__name__)
        raise InputError(f"{name} checkpoint.npz is not what a run of refweb writes ({reason})") from None


_STATE = ("positions", "displacements", "velocities", "bodies")


def stored(system, folder):
    """Displacement and velocity of the rows from the checkpoint in a result folder.

    Nodes are matched by number, bodies by name; a body that the folder does not have stays as its table says.

    Returns
    -------
    x, v : ndarray, shape (rows, 3)
        Displacement from the web's position [m], velocity [m/s].

    Raises
    ------
    InputError
        Where there is no checkpoint, or it is that of another net.
    """
    path = str(folder)
    net, name = system.net, f'[solve] start = "{path if len(path) <= 60 else "..." + path[-57:]}":'
    arrays = checkpoint(folder, name, ' it must be "web", "equilibrium" or a result folder')
    try:
        positions, displacements, velocities, bodies = map(arrays.__getitem__, _STATE)
    except KeyError as error:
        raise InputError(f"{name} checkpoint.npz is not what a run of refweb writes (it has no {error})") from None
    arrays = (positions, displacements, velocities)
    fits = all(a.shape == positions.shape and a.shape[1:] == (3,) and a.dtype.kind == "f" for a in arrays)
    if not fits or bodies.ndim != 1 or not all(np.isfinite(a).all() for a in arrays):
        raise InputError(f"{name} checkpoint.npz holds numbers that are not finite, or not three for each node")
    nodes = len(positions) - len(bodies)
    if nodes != net.nodes:
        raise InputError(
            f"{name} holds {nodes} nodes, must be those of this scene, {net.nodes}: same web, order and subdivide"
        )
    x, v = np.zeros((system.rows, 3)), system.initial_velocity()
    row = {str(body): nodes + i for i, body in enumerate(bodies)}
    own = zip(row_names(net.bodies), range(net.nodes, system.rows), strict=True)
    held = [body.name for body in net.bodies if body.fixed]
    pairs = [(here, row[name]) for name, here in own if name in row and name not in held]
    here, there = np.array([*((i, i) for i in range(nodes)), *pairs]).T
    reference = positions - displacements
    same = np.isclose(reference[there], net.points[here], rtol=0, atol=1e-15 * np.abs(positions).max(initial=0.0))
    x[here] = np.where(same, displacements[there], positions[there] - net.points[here])
    given = v.copy()
    v[here] = velocities[there]
    told = given.any(axis=1) & (np.arange(len(v)) < nodes)  # a [[velocity]] of this scene
    v[told] = given[told]
    return x, v
