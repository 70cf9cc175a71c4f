"""Steps whose last kick waits for the first of the next one: the same motion, and velocities wherever they are read."""

import numpy as np
import pytest

import refweb

DEFLECTION = dict(name="deflection", quantity="displacement", reduce="max")
SPEED = dict(name="speed", quantity="velocity", node=17, reduce="max")
"""Of a node beside the mass, which is at rest at first."""

ENERGY = dict(name="energy", quantity="kinetic_energy", reduce="max")


def run(observe, interval=2e-3, effects=()):
    """A mass that leaves the centre of a taut web, in equal steps of 2e-5 s."""
    thrown = refweb.PointMass(node="centre", mass=0.05), refweb.Velocity(node="centre", value=(0.0, 0.0, 3.0))
    scene = refweb.Scene(
        web=refweb.Window(mesh="square", rows=6, columns=6, side=0.2),
        cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-4, density=200.0, prestrain=0.002),
        effects=[*thrown, *effects],
        solve=refweb.Dynamic(duration=0.02, step_size=2e-5),
        observe=[refweb.Observe(**table) for table in observe],
        output=refweb.Output(interval=interval, frames=3),
        accuracy=refweb.Accuracy(error="none"),
    )
    return refweb.run(scene, progress=False)


def test_the_motion_has_the_same_bits():
    """A velocity that is followed is read at the end of each step; without one kicks are joined."""
    joined, apart = run([DEFLECTION]), run([DEFLECTION, SPEED])
    assert joined.solver["nsteps"] == apart.solver["nsteps"] == 1000
    for name, values in joined.history.items():
        np.testing.assert_array_equal(values, apart.history[name], err_msg=name)
    np.testing.assert_array_equal(joined.positions, apart.positions)
    assert joined.results["deflection"].value == apart.results["deflection"].value


@pytest.mark.parametrize("observe", [[SPEED], [DEFLECTION, SPEED], [SPEED, DEFLECTION]])
def test_velocities_are_those_at_the_end_of_steps(observe):
    """The largest has the bits of a run whose kicks are never joined, since it follows the kinetic energy.

    It is that of a run with a row at each step, too. Steps of both end at times that differ by rounding, 1e-16 of
    0.02 s over 2e-5 s, and a thousand of them add up to 1e-10.
    """
    speed, rows = run(observe).results["speed"].value, run([SPEED], interval=2e-5)
    assert speed == run([*observe, ENERGY]).results["speed"].value
    assert len(rows.history["time"]) == 1001
    np.testing.assert_allclose(speed, rows.results["speed"].value, rtol=1e-9)
