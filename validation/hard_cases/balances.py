"""Balances of forces, energy and momentum of a solution, from its positions and velocities and the law alone."""

import numpy as np
from scipy.integrate import trapezoid
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

import refweb


def tensions(solution):
    """Tensions of the lines by the law alone, their directions, and the energy that the lines store."""
    net, state = solution.state.system.net, solution.state
    tail, head = net.cells[:, 0], net.cells[:, 1]
    reach = net.points[head] - net.points[tail]
    moved = state.x[head] - state.x[tail]
    natural = net.natural_length
    vector = reach + moved
    length = np.linalg.norm(vector, axis=1)
    first = np.linalg.norm(reach, axis=1)
    # (l² − l0²)/(l + l0) keeps the digits of strains that the difference of lengths loses
    strain = ((2 * reach + moved) * moved).sum(axis=1) / (length + first) / natural + (first - natural) / natural
    own = solution.scene.cable
    groups = solution.scene.web.groups if own.groups else None
    moduli = [own.groups[name].modulus if name in own.groups else own.modulus for name in groups or ()]
    stiffness = own.area * np.array(moduli or own.modulus, dtype=float)
    if own.law == "table":
        curve = measured(own.stress)
        force = own.area * np.where(strain > curve.x[0], curve(strain), 0.0)
        stored = own.area * np.array([max(curve.integrate(curve.x[0], one), 0.0) for one in strain])
    elif own.law == "tension-only" or own.smoothing == 0.0:
        taut = np.maximum(strain - (own.slackness or 0.0), 0.0)
        force, stored = stiffness * taut, 0.5 * stiffness * taut**2
    else:
        eta, slackness = own.smoothing, own.slackness

        def ramp(s):
            root = np.sqrt(s * s + 4 * eta * eta)
            return np.where(s >= 0, 0.5 * (s + root), 2 * eta * eta / (root - np.minimum(s, 0.0)))

        def integral(s):
            return 0.25 * s * (s + np.sqrt(s * s + 4 * eta * eta)) + eta * eta * np.arcsinh(0.5 * s / eta)

        force = stiffness * (ramp(strain - slackness) - ramp(-slackness))
        stored = stiffness * (integral(strain - slackness) - integral(-slackness) - ramp(-slackness) * strain)
    broken = [one["element"] for one in solution.breaks or ()]
    if isinstance(solution.scene.web, refweb.Web):  # of lines that are elements
        broken += solution.scene.web.broken.tolist()
    force[broken] = stored[broken] = 0.0
    return force, vector / np.where(length > 0, length, 1.0)[:, None], (stored * natural).sum()


def measured(points):
    """Stress [Pa] over strain through points, by the slopes of PCHIP, at an end never below half that of the chord.

    Beyond the last point the last slope goes on.
    """
    strain, stress = np.array(points, dtype=float).T
    slope = PchipInterpolator(strain, stress).derivative()(strain)
    chord = np.diff(stress) / np.diff(strain)
    slope[[0, -1]] = np.where(slope[[0, -1]] > 0.0, slope[[0, -1]], 0.5 * chord[[0, -1]])
    far = 1.0 + strain[-1]
    return CubicHermiteSpline(
        [*strain, far], [*stress, stress[-1] + slope[-1] * (far - strain[-1])], [*slope, slope[-1]]
    )


STEP = 1e-6
"""Displacement of a node by which the energy of contact is differenced [m]."""


def pushes(state):
    """Force of contact on every row, by differences of its energy: what the force should be, whatever it is [N]."""
    system, force = state.system, np.zeros_like(state.x)
    for term in (term for term in system.terms if term.contact.with_lines and term.energy is not None):
        for row in np.unique(term.cells):
            for axis in range(3):
                moved = np.zeros_like(state.x)
                moved[row, axis] = STEP
                ends = [system.energy_of(term, state.time, state.x + sign * moved).sum() for sign in (1.0, -1.0)]
                force[row, axis] -= (ends[0] - ends[1]) / (2.0 * STEP)
    return force


def unbalanced(solution):
    """Largest force at a free node, over the largest of loads and tensions."""
    state, (force, direction, _) = solution.state, tensions(solution)
    system, net = state.system, state.system.net
    pulls = np.zeros((system.rows, 3))
    np.add.at(pulls, net.cells[:, 0], force[:, None] * direction)
    np.add.at(pulls, net.cells[:, 1], -force[:, None] * direction)
    outer = np.zeros_like(pulls)
    for effect in solution.scene.effects:
        if isinstance(effect, refweb.Load):
            outer[net.find(effect.node)] += state.time * np.array(effect.force)
        if isinstance(effect, refweb.Gravity):
            outer += net.mass[:, None] * np.array(effect.acceleration)
    rest = np.where(system.supported, 0.0, pulls + outer + pushes(state))
    # displacements are rounded to 2e-16 of themselves, so is the distance that a natural length of its own is taken
    # from, and lines of EA/L = k make a force of that
    first = np.linalg.norm(net.points[net.cells[:, 1]] - net.points[net.cells[:, 0]], axis=1)
    given = np.where(first == net.natural_length, 0.0, first)
    stiffness = net.line_data.ea / net.natural_length
    rounding = 1e7 * np.finfo(float).eps * (stiffness * (np.abs(state.x).max() + given)).max()
    scale = max(np.linalg.norm(outer, axis=1).max(), np.abs(force).max(), rounding)
    return np.linalg.norm(rest, axis=1).max() / scale if scale > 0 else 0.0


def energy_left(solution):
    """Energy of the last state less that of the first and the work, over the largest there was."""
    state, history = solution.state, solution.history
    kinetic = 0.5 * (state.system.net.mass[:, None] * state.v**2).sum()
    for body in (body for body in state.system.net.bodies if body.turn is not None):  # ½ ω·L in place of ½ |L|²/I
        turns, own = body.turning(state.x, state.v), state.v[body.spin]
        kinetic += 0.5 * body.moment * (turns - own) @ own
    stored = tensions(solution)[2]
    booked = "contact_energy", "body_contact_energy", "self_contact_energy", "dissipated_energy", "rupture_energy"
    others = sum(history.get(name, [0.0])[-1] for name in booked)
    for effect in solution.scene.effects:
        if isinstance(effect, refweb.Gravity):
            net = state.system.net
            others -= net.mass[net.heavy] @ state.x[net.heavy] @ np.array(effect.acceleration)
    work = history["work"][-1] if "work" in history else 0.0
    start = history["total_energy"][0]
    largest = max(np.abs(history[name]).max() for name in history if name.endswith("energy"))
    left = kinetic + stored + others - start - work
    return abs(left) / largest if largest > 0 else abs(left)


def momentum_left(solution):
    """Momentum of all that is free less what it was and what was given to it, over the largest.

    Given by supports, dead loads, gravity and damping in proportion to mass, which is that of displacements.
    """
    history, state, worst = solution.history, solution.state, 0.0
    system, end = state.system, state.time
    linear = slice(system.rows - system.net.spins)  # turning bodies have a row of their own for that
    mass, v = system.net.mass[linear], state.v[linear]
    given = np.zeros(3)
    for effect in solution.scene.effects:
        if isinstance(effect, refweb.Load):
            times, factors = np.transpose(effect.factor) if effect.factor else ([0.0], [1.0])
            within = np.unique([0.0, *np.clip(times, 0.0, end), end])
            nodes = len(system.net.web.find(effect.node))
            given += nodes * trapezoid(np.interp(within, times, factors), within) * np.array(effect.force)
        if isinstance(effect, refweb.Gravity):
            given += end * mass.sum() * np.array(effect.acceleration)
        if isinstance(effect, refweb.Damping):
            given -= effect.rate * mass[: system.net.nodes] @ state.x[: system.net.nodes]
    largest = max((mass * np.linalg.norm(v, axis=1)).sum(), np.linalg.norm(given))
    for k, axis in enumerate("xyz"):
        now = (mass * np.where(system.supported[linear, k], 0.0, v[:, k])).sum()
        start, pushed = history[f"momentum_{axis}"][0], history[f"support_impulse_{axis}"]
        largest = max(largest, np.abs(history[f"momentum_{axis}"]).max(), np.abs(pushed).max())
        worst = max(worst, abs(now - start - pushed[-1] - given[k]))
    return worst / largest if largest > 0 else worst


def turning_left(solution):
    """Angular momentum about the centre of mass less what it was, over that of its parts; along what rings leave free.

    It is kept where nothing is held and no force from outside but gravity acts; elsewhere nothing is left.
    """
    effects, state = solution.scene.effects, solution.state
    system = state.system
    outer = [effect for effect in effects if isinstance(effect, refweb.Load | refweb.Damping)]
    if system.supported.any() or any(not isinstance(effect, refweb.Damping) or effect.rate for effect in outer):
        return 0.0
    net, linear = system.net, system.rows - system.net.spins
    normals = [body.shape.normal for body in net.bodies if body.shape.planar]

    def turning(places, v):
        mass, centre = net.mass[:linear, None], net.mass[:linear] @ places / net.mass[:linear].sum()
        around = np.cross(places - centre, mass * v[:linear])
        spun = net.mass[linear:, None] * v[linear:]
        return around.sum(axis=0) + spun.sum(axis=0), np.linalg.norm(around, axis=1).sum()

    first, _ = turning(net.points[:linear], system.initial_velocity())
    last, size = turning(net.points[:linear] + state.x[:linear], state.v)
    left = last - first if not normals else np.array([(last - first) @ normals[0] / np.linalg.norm(normals[0])])
    return np.abs(left).max() / size if size > 0 else 0.0
