"""Several equilibria of the smooth law: the lower of two starts, and how far it may be from the lowest."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import minimize_scalar, root_scalar

import refweb
from refweb.statics.lowest import _above, _forces, _without_smoothing
from refweb.statics.newton import Newton
from refweb.system.static_system import at_rest

AXIAL, RISE = 1e3, 0.1


def scene(force, smoothing, rise=RISE):
    """Two lines that lean against each other, of their natural lengths; a force pushes the node between them down."""
    return refweb.Scene(
        web=refweb.Inline(points=[[-1, 0, 0], [1, 0, 0], [0, 0, rise]], lines=[[0, 2], [1, 2]], supports=[0, 1]),
        cable=refweb.Cable(law="smooth", smoothing=smoothing, modulus=AXIAL / 1e-4, area=1e-4, density=0.0),
        support=[refweb.Supports(nodes=2, components=["x", "y"])],
        effects=[refweb.Load(node=2, force=(0.0, 0.0, -force))],
        observe=[refweb.Observe(name="z", quantity="position", node=2, component="z")],
        solve=refweb.Static(),
    )


def stress(strain, smoothing):
    """(ε + √(ε² + 4η²))/2 − η, over the modulus: eq. (2) of the paper at ε0 = 0."""
    return 0.5 * (strain + np.hypot(strain, 2.0 * smoothing)) - smoothing


def potential(z, force, smoothing):
    """Of the two lines and the force [J], by quadrature of the law."""
    natural = np.hypot(1.0, RISE)
    strain = np.hypot(1.0, z) / natural - 1.0
    return 2.0 * AXIAL * natural * quad(stress, 0.0, strain, args=(smoothing,), epsabs=1e-15)[0] + force * z


@pytest.mark.parametrize("smoothing", [1e-2, 1e-1])
def test_an_arch_that_could_snap_through(smoothing):
    """Newton's method ends in the arch; the state that hangs is lower, and comes back with its remark."""
    force = 0.1
    solution = refweb.run(scene(force, smoothing))
    wells = [minimize_scalar(potential, args=(force, smoothing), bounds=b, method="bounded",
                             options={"xatol": 1e-12}) for b in ((-0.2, 0.0), (0.08, 0.11))]  # fmt: skip
    assert wells[0].fun < wells[1].fun - 1e-3
    assert solution.results["z"].value == pytest.approx(wells[0].x, abs=1e-7)
    assert any(f"{wells[1].fun - wells[0].fun:.3g} J apart" in text for text in solution.warnings)
    assert solution.solver["above_lowest"] >= 0.0


def test_the_bound_holds_from_the_arch():
    """The arch lies above the state that hangs by less than the bound, which is not ten times that."""
    force, smoothing = 0.1, 1e-2
    system = at_rest(scene(force, smoothing).build())
    newton = Newton(system)
    arch = newton.solve(1.0, np.zeros((3, 3)))
    assert (arch.tension < 0.0).all()
    hanging = minimize_scalar(potential, args=(force, smoothing), bounds=(-0.2, 0.0), method="bounded")
    apart = potential(RISE + arch.x[2, 2], force, smoothing) - hanging.fun
    plain = _without_smoothing(newton, arch)
    assert apart <= _above(system, arch, _forces(system, plain)) < 1.5 * apart


@pytest.mark.parametrize("force", [-5.0, 0.0])
def test_a_state_in_which_no_line_pushes_is_the_lowest(force):
    """Pulled up, the lines are taut; without a force they are as long as they are. No second start is made."""
    solution = refweb.run(scene(force, 1e-3))
    assert solution.solver["above_lowest"] == 0.0
    natural = np.hypot(1.0, RISE)

    def left(z):
        length = np.hypot(1.0, z)
        return 2.0 * AXIAL * stress(length / natural - 1.0, 1e-3) * z / length + force

    z = root_scalar(left, bracket=(RISE - 1e-9, 1.0), xtol=1e-15).root
    assert solution.results["z"].value == pytest.approx(z, abs=1e-9)


def test_bars_that_push_are_bounded_by_nothing():
    given = scene(0.1, 0.0).replace(cable=refweb.Cable(law="linear", modulus=AXIAL / 1e-4, area=1e-4, density=0.0))
    assert refweb.run(given).solver["above_lowest"] is None
