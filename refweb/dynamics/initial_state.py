"""Initial states of dynamics: the initial web, its equilibrium, or the last state of another run.

May change: private functions, words of messages, and `OFF`, `JUMP` and `SAME`, which decide what is reported or
refused. Must stay: fields of `Start`, keys ``begin_…`` of ``checkpoint.npz``; the keys in `_STATE` and ``body_…``,
which `results.folder` writes: a renamed one breaks folders of users. `simulation`, `runner` and `studies` call the
public functions. Must stay as well: all names that `simulation` and `studies.trials` import. Tests:
``tests/dynamics/test_starts.py``, ``test_internal_start.py``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..findings import NOTE, Finding
from ..messages import short
from ..net.rigid_body import matrix_of, row_names
from ..net.rotation import quaternion_of

OFF = 1e-9
"""Distance of a support from its position in the web, over the size of the web, that a finding reports."""

JUMP = 1e-6
"""The same of a body that tables move: a larger one would throw the web at the start."""

SAME = 1e-9
"""Difference of two velocities of a body, over their size, within which both are the same."""


class Start(NamedTuple):
    """Initial state of a run.

    Attributes
    ----------
    x : ndarray, shape (rows, 3), optional
        Displacement [m], None for the initial web.
    v : ndarray, shape (rows, 3), optional
        Velocity [m/s], None for those of the scene.
    broken : ndarray of int, optional
        Broken elements, None if there are none.
    contact_shares : ndarray, optional
        Shares of elements in the push of a body, see `refweb.statics.shared_push`.
    """

    x: np.ndarray | None = None
    v: np.ndarray | None = None
    broken: np.ndarray | None = None
    contact_shares: np.ndarray | None = None

    @property
    def motion(self):
        """(x, v) at the start of an integrator."""
        return self.x, self.v

    def torn(self, system):
        """The system with the broken elements of this state."""
        if self.broken is None:
            return system
        from ..system.broken_lines import torn

        return torn(system, self.broken, np.zeros(len(self.broken)))


def start_of(scene, system):
    """The `Start` of a scene."""
    if scene.start_folder is not None:
        return stored(system, scene.start_folder)[0]
    return Start(system.settled(equilibrium(system).x if scene.solve.start == "equilibrium" else system.laid))


def remarks_on(start, system):
    """Remarks on a start: jumps of motion, and bodies inside of the web."""
    before = np.zeros((system.rows, 3)) if start.x is None else start.x
    driven = before.copy()
    system.drive(0.0, driven)
    inner = [term for term in system.terms if term.balance.internal]
    size = np.ptp(system.net.points, axis=0).max()
    rounding = 1e-14 * max(size, np.abs(before).max())
    moved = np.flatnonzero((np.abs(driven - before) > rounding).any(axis=1))
    if len(moved):
        stored = sum(system.energy_of(term, 0.0, driven).sum() for term in inner)
        by = "[[motion]]" if system.drives and not system.carried[moved[0]] else "[[attach]]"
        text = f"{by} has moved {system.row_name(moved[0])} at t = 0 already"
        for body in (body for body in system.net.bodies if body.fixed and moved[0] in body.carried):
            away = np.linalg.norm((driven - before)[moved[0]])
            by = "body"
            text = f'body "{body.name}" is fixed, and its node {moved[0]} jumps by {away:.4g} m to it at t = 0'
        yield Finding("moved-at-start", f"{text}: the web starts with {stored:.4g} J", by.strip("[]"))
    off = np.linalg.norm(np.where(system.fixed, driven, 0.0), axis=1)
    off[np.unique([row for drive in system.drives for row in drive.cells.ravel()]).astype(int)] = 0.0
    if off.max() > OFF * size:
        worst = int(off.argmax())
        text = f"node {worst} is held where the start has it, {off[worst]:.4g} m off its place in this scene"
        yield Finding("moved-at-start", text, "supports")
    touching = [term for term in inner if term.contact.with_lines]
    pushed = np.concatenate([np.zeros(0), *(system.energy_of(term, 0.0, driven) for term in touching)])
    if pushed.max(initial=0.0) > 0.0:
        line = system.net.line[int(pushed.argmax()) % len(system.net.line)]
        text = f"a body overlaps the web at the start, most at line {line}: contact starts with {pushed.sum():.4g} J"
        yield Finding("starts-in-body", text, "body")


def equilibrium(system, progress=None):
    """The `refweb.statics.equilibrium.Equilibrium` at t = 0 under gravity, loads, motion and fixed bodies.

    Free bodies do not act.

    Raises
    ------
    SolverError
        Where there is no equilibrium, or none is found.
    """
    from ..statics.load_steps import solve

    (equilibrium,) = solve(system, [0.0], progress)
    return equilibrium


def checkpoint(folder, name, remedy=""):
    """The arrays of the checkpoint in a result folder, by name; error messages begin with ``name``."""
    try:
        with np.load(folder / "checkpoint.npz") as archive:
            return {key: archive[key] for key in archive}
    except OSError as error:
        reason = (
            "is not a folder" if not folder.is_dir() else f"checkpoint.npz cannot be read: {error.strerror or error}"
        )
        raise InputError(f"{name} {reason};{remedy}".removesuffix(";")) from None
    except Exception as error:  # whatever an archive that is spoilt leads to
        reason = short(str(error) or type(error).__name__)
        raise InputError(f"{name} checkpoint.npz is not what a run of refweb writes ({reason})") from None


def record_of(arrays):
    """Arrays by name as one array, a record with a field for each, since a file takes some 0.05 ms for each array."""
    record = np.zeros((), [(name, array.dtype, array.shape) for name, array in arrays.items()])
    for name, array in arrays.items():
        record[name] = array
    return record


def fields_of(record):
    """The arrays of a record of `record_of`; numbers are arrays without dimension."""
    return {name: np.array(record[name]) for name in record.dtype.names}


_STATE = ("positions", "displacements", "velocities", "bodies")


def stored(system, folder):
    """The `Start` of the checkpoint in a result folder, and that of its step refinement (None if there was none).

    Nodes are matched by number, bodies by name; a body that is not in the folder starts as in its table. Orientations
    and rotations of bodies are those of the checkpoint, for any axes in their tables. Where nothing moves in it, as in
    statics, velocities are those of the scene.

    Raises
    ------
    InputError
        Where there is no checkpoint, or it is that of another net or of lines with other internal variables, or bodies
        that tables move are elsewhere in it.
    """
    path = str(folder)
    net, name = system.net, f'[solve] start = "{path if len(path) <= 60 else "..." + path[-57:]}":'
    given = checkpoint(folder, name, ' it must be "web", "equilibrium" or a result folder')
    try:
        positions, displacements, velocities, bodies = map(given.__getitem__, _STATE)
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
    if "lines" in given and not np.array_equal(given["lines"], net.web.lines):
        raise InputError(f"{name} holds other lines between its nodes than this scene: it must be the same web")
    known = _known_variables(system, given, name)
    broken = given.get("broken", np.zeros(0, dtype=np.int64))
    bearings = _bearings(system, given, bodies, name)
    start = _start_at(system, positions, displacements, velocities, bodies, bearings, known)
    start = start._replace(broken=broken if len(broken) else None, contact_shares=given.get("contact_shares"))
    _refuse_jumps(system, start.x, name)
    _refuse_off_axles(system, start, name)
    if not velocities.any():  # statics has no steps
        return start, start
    x, v = (given.get(f"twin_{key}") for key in ("displacements", "velocities"))
    if any(a is None or a.shape != positions.shape or not np.isfinite(a).all() for a in (x, v)):
        return start, None
    return start, _start_at(system, positions - displacements + x, x, v, bodies, bearings, known)


def unused_velocities(system, start):
    """Findings on bodies that a `Start` of a folder gives another velocity than their tables."""
    for body in system.net.bodies:
        if body.fixed or body.moved:
            continue
        omega, arm = body.turning(start.x, start.v), body.offset @ body.axes
        given_speed = body.velocity + np.cross(body.angular_velocity, arm)
        speed = start.v[body.row] + np.cross(omega, body.rotation(start.x) @ arm)
        turns = ("angular_velocity", np.array(body.angular_velocity), omega)
        moves = (("velocity", given_speed, speed), turns)
        for key, given, now in moves:
            if given.any() and not np.allclose(given, now, rtol=SAME, atol=SAME * np.abs(given).max()):
                text = f'{key} of body "{body.name}" has no effect: the folder that the run starts from has its motion'
                yield Finding("left-out", text, "body", NOTE)


def remarks_on_lengths(system, folder):
    """Findings on natural lengths that tables of a scene have otherwise at t = 0 than the end of a folder."""
    net, given = system.net, checkpoint(folder, "")
    lengths = system.natural_length(0.0) / net.natural_length
    before = given.get("length_factors", np.ones(len(lengths)))
    if before.shape == lengths.shape and not np.allclose(lengths, before, rtol=SAME, atol=0.0):
        ratio = lengths / before
        worst = int(np.abs(ratio - 1.0).argmax())
        text = (
            f"the natural length of line {net.line[worst]} is {ratio[worst]:.6g} times that at the end of the folder: "
            "[[reel]] and [temperature] are those of this scene alone; begin their tables where that run ended"
        )
        yield Finding("moved-at-start", text, "solve")


def _refuse_jumps(system, x, name):
    """Refuse a start at x from which bodies that tables move would jump to where these have them at t = 0."""
    driven = x.copy()
    system.drive(0.0, driven)
    size = np.ptp(system.net.points, axis=0).max()
    for body in system.net.bodies:
        if not body.moved:
            continue
        away = np.linalg.norm((driven - x)[[body.row, *body.carried]], axis=1).max()
        if body.spin is not None:
            away = max(away, body.extent * float(np.linalg.norm(body.rotation(driven) - body.rotation(x))))
        if away > JUMP * size:
            raise InputError(
                f'{name} has body "{body.name}" some {away:.3g} m off the place that [[motion]] has for it at t = 0: '
                "begin its tables where that run ended"
            )


def _refuse_off_axles(system, start, name):
    """Refuse a start in which a body on an axle has a place, an orientation or a motion that the axle does not let."""
    size = np.ptp(system.net.points, axis=0).max()
    for body in (body for body in system.net.bodies if body.axle and not body.prescribed):
        turned, along = body.rotation(start.x), body.axle.direction
        spin, speed = start.v[body.spin], start.v[body.row]
        off = np.linalg.norm(start.x[body.row] - (turned @ body.arm - body.arm)) / size
        tilt = float(np.linalg.norm(turned @ along - along))
        across = np.linalg.norm(spin - along * (along @ spin)) / max(np.linalg.norm(spin), 1e-300)
        moves = np.linalg.norm(speed - np.cross(spin, turned @ body.arm)) / max(np.linalg.norm(speed), 1e-300)
        for share, why in (
            (off, f"stands {off * size:.3g} m off"),
            (tilt, f"is tilted by {tilt:.3g} rad from"),
            (across, f"turns about an axis {across:.3g} rad from"),
            (moves, "moves away from"),
        ):
            if share > JUMP:
                raise InputError(
                    f'{name} body "{body.name}" {why} the axle that it has in this scene: give it the axle in that run '
                    "too, or none here"
                )


def _bearings(system, given, bodies, name):
    """(Axes, inertia, offset, direction of an axle) of rotating bodies where the run of a checkpoint began, by name."""
    known, bearings = [str(body) for body in bodies], {}
    for body in system.net.bodies:
        spins = body.spin is not None and f"{body.name}.spin" in known
        if not spins or body.turn is None and f"{body.name}.turn" not in known:
            continue
        try:
            arrays = (given[f"body_{key}"][known.index(body.name)] for key in ("axes", "inertia", "offset"))
            axles = given.get("body_axle")  # older folders have none: as in this scene
            axle = _axle_of(body) if axles is None else axles[known.index(body.name)]
            bearings[body.name] = (*arrays, axle)
        except (KeyError, IndexError):
            raise InputError(
                f'{name} checkpoint.npz does not say which axes body "{body.name}" began with: run that again'
            ) from None
    return bearings


def _axle_of(body):
    """Direction of the axle of a body, 0 without one."""
    return body.axle.direction if body.axle else np.zeros(3)


def _turn(body, bearing, rows, x, v):
    """Write orientation and rotation of a body: axes, centre of the shape and their motion in another start.

    ``rows`` has (displacement, velocity) of the rows of rotation of that start; x and v of the row of the body are set
    already.
    """
    axes, inertia, offset, axle = bearing
    (vector, spin), *last = rows
    if last:
        now = axes @ matrix_of((1.0 + last[0][0][0], *vector)).T
        omega = spin if axle.any() else now.T @ np.linalg.solve(inertia, now @ spin) * np.linalg.eigvalsh(inertia)[-1]
    else:
        now, omega = axes, spin
    if body.turn is None:  # a sphere looks the same
        x[body.spin], v[body.spin] = 0.0, omega
    else:
        quaternion = quaternion_of(now.T @ body.axes)
        x[body.turn, 0], x[body.spin] = quaternion[0] - 1.0, quaternion[1:]
        v[body.turn], v[body.spin] = 0.0, _spin(body, now, omega)
        if not axle.any() or not body.axle:
            x[body.turn, 1] = 2.0 * np.arctan2(quaternion[1:] @ _axle_of(body), quaternion[0])
    shift = (offset - body.offset) @ now
    x[body.row] += shift
    v[body.row] += np.cross(omega, shift)


def _spin(body, now, omega):
    """Velocity of the row of rotation of a body with axes ``now``, see `refweb.net.rotation`."""
    return omega if body.axle else now.T @ (body.inertia @ (now @ omega)) / body.moment


def _start_turning(body, x, v):
    """Write the rotation of the table of a body that may stand turned in a start at x."""
    omega, built = np.array(body.angular_velocity), body.offset @ body.axes
    v[body.spin] = omega
    if body.turn is not None:
        now = body.axes @ body.rotation(x).T
        v[body.turn], v[body.spin] = 0.0, _spin(body, now, omega)
        v[body.row] += np.cross(omega, built - body.offset @ now)


def _known_variables(system, given, name):
    """Names of rows of internal variables that go on, see `refweb.dynamics.internal_start`."""
    if not any(str(row).startswith(".") for row in given["bodies"]):
        return set()
    from .internal_start import known_variables

    return known_variables(system, given, name)


def _start_at(system, positions, displacements, velocities, bodies, bearings, known):
    """The `Start` of a system from the nodes of a checkpoint and, after them, from the rows with their names.

    ``known`` are the names of internal variables that go on.
    """
    net, nodes = system.net, len(positions) - len(bodies)
    x, v = np.zeros((system.rows, 3)), system.initial_velocity()
    names = [*row_names(net.bodies), *net.internal_names]
    row = {str(body): nodes + i for i, body in enumerate(bodies)}
    numbered = zip(names, range(net.nodes, system.rows), strict=True)
    fixed_names = [body.name for body in net.bodies if body.fixed]
    new = {*fixed_names, *net.internal_names} - known
    pairs = [(row_here, row[name]) for name, row_here in numbered if name in row and name not in new]
    row_here, rows_there = np.array([*((i, i) for i in range(nodes)), *pairs]).T
    reference = positions - displacements
    same = np.isclose(
        reference[rows_there], net.points[row_here], rtol=0, atol=1e-15 * np.abs(positions).max(initial=0.0)
    )
    x[row_here] = np.where(same, displacements[rows_there], positions[rows_there] - net.points[row_here])
    own_velocity, moving = v.copy(), bool(velocities.any())
    if moving:
        v[row_here] = velocities[rows_there]
    given_velocity = own_velocity.any(axis=1) & (np.arange(len(v)) < nodes)  # a [[velocity]] of this scene
    v[given_velocity] = own_velocity[given_velocity]
    for body in net.bodies:
        if body.name not in bearings:
            continue
        numbered, rows = (
            (body.axes, body.inertia, body.offset, _axle_of(body)),
            (f"{body.name}.spin", f"{body.name}.turn"),
        )
        rows_there = [(displacements[row[name]], velocities[row[name]]) for name in rows if name in row]
        alike = (
            np.array_equal(array, array_before)
            for array, array_before in zip(bearings[body.name], numbered, strict=True)
        )
        if (len(rows_there) == 2) != (body.turn is not None) or not all(alike):
            _turn(body, bearings[body.name], rows_there, x, v)
        if not moving:
            _start_turning(body, x, v)
        if body.pivot is not None and not moving:
            v[body.row] = np.cross(v[body.spin], body.rotation(x) @ body.arm)
    for thread in net.threads:
        thread.rewind(x)
    if net.wound:
        from ..effects.wound_lines import rewind

        rewind(net, x)
    if not set(net.internal_names) <= known:
        going_on = [row_here for row_here, _ in pairs if row_here >= system.rows - net.internal]
        before, x = x[going_on], system.settled(x)
        x[going_on] = before
    return Start(x, v)
