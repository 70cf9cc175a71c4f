"""The frame that turns: closed forms, the limit of its speed, what is conserved, and the same web seen from outside."""

import functools

import nets
import numpy as np
import pytest
import scipy.linalg
from scipy.spatial.transform import Rotation

import refweb
from refweb.dynamics.integrators.central_difference import CentralDifference
from refweb.dynamics.integrators.cvode import Cvode
from refweb.dynamics.integrators.ida import Ida
from refweb.effects.elasticity import Elasticity
from refweb.net import discretisation
from refweb.net.web import Web
from refweb.scene import SHIPPED_SCENES
from refweb.statics import dynamic_relaxation as relaxation
from refweb.statics import load_steps
from refweb.system.system import System

MODULUS, AREA, DENSITY = 7e7, 1e-4, 200.0
EA = MODULUS * AREA
ALONG_Z = np.array([0.0, 0.0, 1.0])


def cable(law="linear", **changes):
    return refweb.Cable(**{**dict(law=law, modulus=MODULUS, area=AREA, density=DENSITY), **changes})


def turning(web, cable, speed, effects=(), supports=(), axis=ALONG_Z, quasi_static=True, consistent=False):
    """A system in a frame that turns at a speed [rad/s] about an axis; nodes of ``supports`` are held."""
    net = discretisation.build(web, cable, quasi_static=quasi_static, consistent=consistent)
    supported = np.zeros((len(net.points), 3), dtype=bool)
    supported[list(supports)] = True
    frame = refweb.Frame(angular_velocity=speed * np.array(axis))
    return System(net, [Elasticity(), frame, *effects], supported)


def arm(count=1, hub=0.0):
    """Equal lines of 1 m together on the x axis from x = ``hub``."""
    x = hub + np.linspace(0.0, 1.0, count + 1)
    return Web(np.column_stack([x, 0 * x, 0 * x]), np.column_stack([np.arange(count), np.arange(1, count + 1)]))


def slope(errors, steps):
    return np.polyfit(np.log(steps), np.log(errors), 1)[0]


# Statics


@pytest.mark.parametrize("law", ["linear", "tension-only"])
@pytest.mark.parametrize("share", [0.01, 0.1, 0.5, 0.99])
def test_arm_with_a_tip_mass(law, share):
    """(EA/L)(l − L) = m Ω² l: l = L/(1 − share²) at a share of the limit √(EA/mL)."""
    speed = share * np.sqrt(EA / 2.0)
    system = turning(arm(), cable(law, density=0.0), speed, [refweb.PointMass(node=1, mass=2.0)], [0])
    (found,) = load_steps.solve(system, [1.0])
    # Relative errors of 1e-15 in EA and mΩ² grow by 1/(1 − share²), 50 at most.
    np.testing.assert_allclose(1.0 + found.x[1, 0], 1.0 / (1.0 - share**2), rtol=1e-12)
    assert not found.x[1, 1:].any() and found.stats["smallest_pivot"] == 0  # it turns about the hub for nothing


@functools.cache
def nodal_errors(order, consistent):
    """Numbers of elements, and largest errors of the ends of elements of a heavy arm [m].

    EA x″ + ρA Ω² x = 0 over natural arc length, x(0) = a at the hub, x′(1) = 1 at the end without tension: with
    k = Ω √(ρ/E), x = a cos ks + B sin ks, B = (1 + a k sin k)/(k cos k).
    """
    hub, k, counts = 0.3, 0.7, (4, 6, 8, 12)
    speed, errors = k * np.sqrt(MODULUS / DENSITY), []
    for count in counts:
        system = turning(arm(count, hub), cable(order=order), speed, supports=[0], consistent=consistent)
        (found,) = load_steps.solve(system, [1.0])
        s = np.linspace(0.0, 1.0, count + 1)
        exact = hub * np.cos(k * s) + (1.0 + hub * k * np.sin(k)) / (k * np.cos(k)) * np.sin(k * s)
        errors.append(np.abs((system.net.points + found.x)[: count + 1, 0] - exact).max())
    return np.array(counts), np.array(errors)


@pytest.mark.ordinary("1-False", "1-True", "2-False", "2-True")
@pytest.mark.parametrize("consistent", [False, True])
@pytest.mark.parametrize("order", [1, 2, 3])
def test_heavy_arm_converges_with_twice_the_order(order, consistent):
    """2p at the ends of elements, with lumped masses as well; the smallest error, 1e-13 m, is a hundred roundings."""
    counts, errors = nodal_errors(order, consistent)
    assert abs(slope(errors, 1.0 / counts) - 2 * order) < 0.15


def test_consistent_mass_feels_the_position_between_nodes():
    """Of straight elements both errors are of order 2, the consistent one is a fraction of the other."""
    (_, lumped), (_, consistent) = nodal_errors(1, False), nodal_errors(1, True)
    assert (consistent < 0.5 * lumped).all()


def refused_at(system, solve=load_steps.solve):
    """The limit that the refusal names [rad/s]."""
    with pytest.raises(refweb.SolverError, match=r"\[frame\] turns at .*must be below .* lower angular_velocity") as e:
        list(solve(system, [1.0]))
    return float(str(e.value).split("must be below ")[1].split(" rad/s")[0])


@pytest.mark.parametrize("solve", [load_steps.solve, relaxation.solve])
@pytest.mark.parametrize("law", nets.LAWS)
def test_limit_of_an_arm_with_a_tip_mass(law, solve):
    """√(EA/mL) for every law: far out all of them are linear. 1e-6 above it is refused, 1e-4 below it is solved."""
    limit, laws = np.sqrt(EA / 2.0), nets.LAWS[law]
    mass = refweb.PointMass(node=1, mass=2.0)

    def system(speed):
        return turning(arm(), cable(**laws, density=0.0), speed, [mass], [0])

    for share in (1.0 + 1e-6, 2.0, 1e3):
        assert abs(refused_at(system(share * limit), solve) - limit) < 1e-6 * limit
    if solve is load_steps.solve:
        (found,) = solve(system((1.0 - 1e-4) * limit), [1.0])
        assert found.stats["residual"] <= 1e-9 and found.x[1, 0] > 4e3


def test_limit_of_two_free_masses():
    """Each is half as far from the axis as from the other: (EA/L)(l − L) = m Ω² l/2."""
    web = Web([[-0.5, 0, 0], [0.5, 0, 0]], [[0, 1]])
    mass, limit = refweb.PointMass(node="all", mass=2.0), np.sqrt(2.0 * EA / 2.0)
    system = turning(web, cable(density=0.0), 1.01 * limit, [mass])
    assert abs(refused_at(system) - limit) < 1e-6 * limit
    (found,) = load_steps.solve(turning(web, cable(density=0.0), 0.5 * limit, [mass]), [1.0])
    np.testing.assert_allclose(found.x[:, 0], [-1.0 / 6.0, 1.0 / 6.0], rtol=1e-12)


def test_limit_of_a_net():
    """Against the generalised eigenvalue of dense matrices, put together line by line: skew axis, two nodes held."""
    axis, web = np.array([1.0, -2.0, 3.0]), nets.skew_web()
    cable = nets.skew_cable("tension-only")
    net = discretisation.build(web, cable)
    across = (axis @ axis) * np.eye(3) - np.outer(axis, axis)
    stiff, free = np.zeros((6, 6)), [1, 3, 4, 5]
    for (i, j), axial, length in zip(web.lines, net.line_data.ea, web.natural_length, strict=True):
        stiff[np.ix_([i, j], [i, j])] += axial / length * np.array([[1, -1], [-1, 1]])
    held = np.kron(stiff[np.ix_(free, free)], np.eye(3))
    taken = np.kron(np.diag(net.mass[free]), across)
    share = 1.0 / np.sqrt(scipy.linalg.eigh(taken, held, eigvals_only=True)[-1])
    system = turning(web, cable, 10.0 * share, supports=[0, 2], axis=axis)
    assert abs(refused_at(system) - share * np.linalg.norm(axis)) < 1e-6 * share * np.linalg.norm(axis)


def test_limit_of_a_heavy_arm():
    """k = π/2, where its closed form has no end, from below with lumped masses and with order 2."""
    speed, counts, limits = np.sqrt(MODULUS / DENSITY), (4, 8, 16, 32), []
    for count in counts:
        limits.append(refused_at(turning(arm(count), cable(), 5.0 * speed, supports=[0])) / speed)
    errors = np.pi / 2.0 - np.array(limits)
    assert abs(slope(errors, 1.0 / np.array(counts)) - 2.0) < 0.02


def free_net(mesh, speed, law="tension-only", corner=1.0):
    web = refweb.Layers(mesh=mesh, layers=3, cell_area=0.04).web()
    masses = [refweb.PointMass(node="corners", mass=corner)]
    return turning(web, cable(law, smoothing=1e-6) if law == "smooth" else cable(law), speed, masses)


@pytest.mark.parametrize("law", nets.LAWS)
@pytest.mark.parametrize("mesh", ["square", "hexagon"])
def test_free_net_turns_steadily(mesh, law):
    """Nothing holds it; every line's tension and the force on every mass, put together here, balance."""
    system = free_net(mesh, 10.0, law)
    (found,) = load_steps.solve(system, [1.0])
    net, position = system.net, system.net.points + found.x
    ends = net.web.lines
    along = position[ends[:, 1]] - position[ends[:, 0]]
    pull = found.tension[:, None] * along / np.linalg.norm(along, axis=1)[:, None]
    force = 10.0**2 * net.mass[:, None] * position * [1.0, 1.0, 0.0]
    np.add.at(force, ends[:, 0], pull)
    np.subtract.at(force, ends[:, 1], pull)
    assert np.abs(force).max() < 1e-9 * found.tension.max()
    assert found.tension.min() > 0.0 and found.stats["smallest_pivot"] >= 0


def test_free_net_off_the_axis_is_carried_off():
    system = free_net("triangle", 10.0)
    with pytest.raises(refweb.SolverError, match=r"carried off along y .* centre of mass is on the axis of \[frame\]"):
        list(load_steps.solve(system, [1.0]))


def test_newton_and_relaxation_agree():
    """A web held at its frame, with a mass in its middle off the axis, gravity and a ball to lean on."""
    web = refweb.Window(mesh="square", rows=4, columns=4, side=0.2).web()
    ball = refweb.Body(name="ball", radius=0.1, position=(0.01, 0.02, -0.06), fixed=True)
    effects = [refweb.PointMass(node=7, mass=0.5), refweb.Gravity(acceleration=(0.0, 0.0, -9.81))]
    net_system = turning(web, cable("tension-only", prestrain=0.01), 8.0, effects, web.rim, axis=(0.2, 0.0, 1.0))
    (newton,), (relaxed,) = (solve(net_system, [1.0]) for solve in (load_steps.solve, relaxation.solve))
    np.testing.assert_allclose(relaxed.tension, newton.tension, rtol=0, atol=1e-8 * newton.tension.max())
    with_ball = turning(web, cable("tension-only"), 8.0, [*effects, ball, refweb.Contact(stiffness=1e5)], web.rim)
    (newton,), (relaxed,) = (solve(with_ball, [1.0]) for solve in (load_steps.solve, relaxation.solve))
    assert sum(with_ball.energy_of(f, 1.0, newton.x).sum() for f in with_ball.terms if f.contact.with_lines) > 0.0
    np.testing.assert_allclose(relaxed.tension, newton.tension, rtol=0, atol=1e-8 * newton.tension.max())


def test_saddle_is_named():
    """A slack rope along the axis stays there, like a skipping rope at rest, and would not."""
    web = refweb.Inline(points=[[-1, 0, 0], [0, 0, 0], [1, 0, 0]], lines=[[0, 1], [1, 2]], natural_length=1.1)
    scene = refweb.Scene(
        web=web,
        cable=cable("tension-only"),
        supports=refweb.Supports(nodes=[0, 2]),
        effects=[refweb.Frame(angular_velocity=(5.0, 0.0, 0.0))],
    )
    solution = refweb.run(scene)
    assert solution.solver["smallest_pivot"] == -1
    assert any("saddle" in text and "start from a web that is deflected" in text for text in solution.warnings)


# Dynamics


def at_time(system, end, solver, x=None, v=None, **options):
    """Displacement and velocity at a time, and the run."""
    method = solver(system, **options)
    run = method.start(x, v)
    method.advance(run, np.linspace(0.0, end, 5)[1:])
    return run.x, run.v, run


SOLVERS = {
    "cvode": (Cvode, dict(linear_solver="dense")),
    "cvode block": (Cvode, dict(linear_solver="block")),
    "cvode sparse": (Cvode, dict(linear_solver="sparse")),
    "cvode adams": (Cvode, dict(family="adams", linear_solver="fixed-point")),
    "ida": (Ida, dict(linear_solver="dense")),
    "ida block": (Ida, dict(linear_solver="block")),
}
TOLERANCE = 1e-6
"""Relative tolerance of SUNDIALS here."""
LEFT = 1e-3
"""Error of all steps together: a thousand of 1e-6 at most, of BDF mostly of one sign."""


def free_particles():
    """Two nodes of 2 kg that a line far too long does not hold, their velocities, and their path in the frame.

    Seen from outside each goes straight on with v + Ω × r; the frame turns under it.
    """
    axis = np.array([1.0, -2.0, 2.0])
    web = Web([[1.0, 0.5, -0.3], [1.2, 0.5, -0.3]], [[0, 1]], natural_length=[100.0])
    system = turning(web, cable("tension-only", density=0.0), 2.0, [refweb.PointMass(node="all", mass=2.0)], axis=axis)
    v, points = np.array([[1.0, -2.0, 0.5], [0.3, 0.2, 0.1]]), system.net.points

    def path(t):
        return Rotation.from_rotvec(-2.0 * axis * t).apply(points + t * (v + np.cross(2.0 * axis, points))) - points

    return system, v, path


def test_free_particle_order_two():
    """The Foucault path of a free mass, and its Jacobi integral ½ m v² − ½ m |Ω × r|², of which only drift is left."""
    system, v, path = free_particles()
    counts, errors = np.array([48, 96, 192, 384]), []
    for count in counts:
        x, _, run = at_time(system, 1.0, CentralDifference, v=v, step_size=1.0 / count * (1.0 + 1e-12))
        assert run.nsteps == count
        errors.append([np.abs(x - path(1.0)).max(), run.drift])
    position, drift = np.array(errors).T
    # The next term of the error is (Ωh)² = 0.015 of this one in the coarsest step.
    assert abs(slope(position, 1.0 / counts) - 2.0) < 0.05 and abs(slope(drift, 1.0 / counts) - 2.0) < 0.05


@pytest.mark.ordinary("cvode", "cvode adams", "cvode block", "ida", "ida block")
@pytest.mark.parametrize("solver", SOLVERS)
def test_free_particle(solver):
    system, v, path = free_particles()
    method, options = SOLVERS[solver]
    x, _, run = at_time(system, 1.0, method, v=v, rtol=TOLERANCE, **options)
    assert np.abs(x).max() > 1.0
    np.testing.assert_allclose(x, path(1.0), rtol=0, atol=LEFT)
    assert run.drift < LEFT


def test_radial_arm_and_the_force_on_its_rail():
    """A tip mass on a rail, from rest at the natural length: with ω² = EA/mL − Ω² it is at l + (L − l) cos ωt.

    l is its length in equilibrium. The rail gives it the Coriolis force, 2 m Ω times its speed.
    """
    mass, speed = 2.0, 30.0
    net = discretisation.build(arm(), cable(density=0.0))
    supported = np.array([[True] * 3, [False, True, True]])
    effects = [Elasticity(), refweb.Frame(angular_velocity=(0, 0, speed)), refweb.PointMass(node=1, mass=mass)]
    system = System(net, effects, supported)
    omega, length = np.sqrt(EA / mass - speed**2), 1.0 / (1.0 - mass * speed**2 / EA)
    end, counts, errors = 0.1, np.array([48, 96, 192, 384]), []
    for count in counts:
        x, v, _ = at_time(system, end, CentralDifference, step_size=end / count * (1.0 + 1e-12))
        rail = -system.force(end, x, v)[1, 1]
        moving = omega * (length - 1.0) * np.sin(omega * end)
        exact = (length - 1.0) * (1.0 - np.cos(omega * end)), 2.0 * mass * speed * moving
        errors.append([abs(x[1, 0] - exact[0]), abs(rail - exact[1])])
    for error in np.array(errors).T:
        assert abs(slope(error, 1.0 / counts) - 2.0) < 0.05


def test_a_ring_keeps_turning_about_its_normal():
    """It keeps its plane in the frame, whose gyroscopic moment changes the plane alone; a sphere's spin turns back."""
    normal = np.array([1.0, 0.0, 0.0])
    for shape, expected in (("ring", lambda t: 5.0 * normal), ("sphere", None)):
        body = dict(normal=normal) if shape == "ring" else {}
        body = refweb.Body(
            name="b", shape=shape, radius=0.05, mass=1.0, position=(0, 0, 0.5), angular_velocity=5.0 * normal, **body
        )
        net = discretisation.build(arm(), cable())
        effects = [Elasticity(), body, refweb.Contact(stiffness=1e4, friction=0.3)]
        system = System(net, [*effects, refweb.Frame(angular_velocity=(0, 0, 1.0))], np.ones((2, 3), dtype=bool))
        _, v, _ = at_time(system, 0.5, CentralDifference)
        spin = v[system.net.bodies[0].spin]
        if expected is None:
            # Of order 2 in steps of ... of the turn.
            np.testing.assert_allclose(spin, 5.0 * np.array([np.cos(0.5), -np.sin(0.5), 0.0]), atol=5e-3)
        else:
            np.testing.assert_array_equal(spin, expected(0.5))


def wheel(speed, frame, consistent=False):
    """A free taut web of 0.8 m with a kick, seen from the frame it turns in or from outside: system, x and v."""
    web = refweb.Layers(mesh="hexagon", layers=2, cell_area=0.04).web()
    axis = np.array([0.3, 0.0, 1.0])
    net = discretisation.build(web, cable("tension-only", modulus=1e5, prestrain=0.05), False, consistent)
    effects = [refweb.Frame(angular_velocity=speed * axis)] if frame else []
    system = System(net, [Elasticity(), *effects], np.zeros(net.points.shape, dtype=bool))
    x, y, _ = net.points.T
    v = np.column_stack([0.2 * y, 0.1 * x, np.exp(-10.0 * (x**2 + y**2)) - 0.3 * y])
    return system, v if frame else v + np.cross(speed * axis, net.points), speed * axis


def seen_from_the_frame(system, x, axis, t):
    return Rotation.from_rotvec(-axis * t).apply(system.net.points + x) - system.net.points


def test_spinning_web_from_inside_and_from_outside():
    """Central differences inside and outside: two methods of order 2 for one motion, whose difference falls so."""
    end, counts, errors = 0.2, np.array([200, 400, 800, 1600]), []
    for count in counts:
        found = []
        for frame in (True, False):
            system, v, axis = wheel(3.0, frame)
            x, _, _ = at_time(system, end, CentralDifference, v=v, step_size=end / count * (1.0 + 1e-12))
            found.append(x if frame else seen_from_the_frame(system, x, axis, end))
        errors.append(np.abs(found[0] - found[1]).max())
    assert np.abs(found[0]).max() > 0.05 and abs(slope(errors, 1.0 / counts) - 2.0) < 0.1


@pytest.mark.slow
@pytest.mark.ordinary("cvode block")
@pytest.mark.parametrize("solver", ["cvode block", "ida block"])
def test_spinning_web_with_consistent_mass(solver):
    """Centrifugal and Coriolis forces are those of the consistent mass matrix: the motion is the same from outside."""
    end, found = 0.1, []
    method, options = SOLVERS[solver]
    for frame in (True, False):
        system, v, axis = wheel(3.0, frame, consistent=True)
        x, _, run = at_time(system, end, method, v=v, rtol=TOLERANCE, **options)
        assert run.drift < LEFT
        found.append(x if frame else seen_from_the_frame(system, x, axis, end))
    np.testing.assert_allclose(found[0], found[1], rtol=0, atol=LEFT * np.abs(x).max())
    system, v, _ = wheel(3.0, True)
    lumped, _, _ = at_time(system, end, method, v=v, rtol=TOLERANCE, **options)
    assert np.abs(lumped - found[0]).max() > 3.0 * LEFT * np.abs(x).max()  # the other mass makes another motion


def test_preconditioner_inverts_the_whole_jacobian():
    """Coriolis makes it unsymmetric: against the dense matrix I − γJ, J by differences of the right-hand side."""
    system, v, _ = wheel(3.0, True)
    solver, gamma = Cvode(system, linear_solver="block"), 1e-3
    run = solver.start(v=v)
    n = solver.unknowns
    y = np.concatenate([run.x.ravel()[system.free] + 1e-3 * np.arange(n) / n, run.v.ravel()[system.free]])

    def rate(y):
        result = np.empty(2 * n)
        solver.right_side(0.0, y, result)
        return result

    # The right-hand side is linear in v; in x differences of 1e-6 m leave 1e-9 of it.
    jacobian = np.column_stack([(rate(y + 1e-6 * e) - rate(y - 1e-6 * e)) / 2e-6 for e in np.eye(2 * n)])
    solver.set_up(0.0, y, rate(y), False, np.zeros(1), gamma)
    r, z = np.sin(np.arange(2.0 * n)), np.empty(2 * n)
    solver.precondition(0.0, y, rate(y), r, z, gamma, 0.0, 0)
    np.testing.assert_allclose(z - gamma * jacobian @ z, r, rtol=0, atol=1e-6)


def test_shipped_scene():
    """The ball's momentum goes over into the web, which nothing holds: along the axis it is conserved."""
    solution = refweb.run(SHIPPED_SCENES / "spinning-web.toml")
    assert solution.status == "solved" and not solution.warnings
    assert solution.results["ball_speed"].value < 0.0  # it is thrown back
    assert 0.1 < solution.results["deflection"].value < 0.5 and solution.slack.mean() > 0.1
    np.testing.assert_allclose(solution.history["momentum_z"], 1.0, rtol=1e-9)
    energy = solution.history["total_energy"]
    assert np.abs(energy - energy[0]).max() < 1e-2 * solution.history["kinetic_energy"].max()
    assert solution.columns.count("frame_energy [J]") == 1


def test_scene_is_read_and_written():
    text = refweb.Scene.load("spinning-web").to_dict()
    assert text["frame"] == {"angular_velocity": [0.0, 0.0, 6.283185307179586]}
    assert refweb.Scene.from_dict(text).to_dict() == text
    with pytest.raises(refweb.InputError, match=r"\[frame\] angular_velocity is missing.*rad/s"):
        refweb.Scene.from_dict({**text, "frame": {}})
