"""Steps in which blocks of lines show their largest values: the same motion, peaks and places as with each line."""

import functools

import numpy as np
import pytest

import refweb
from refweb.dynamics.simulation import Simulation
from refweb.effects import line_blocks
from refweb.solution import Solution

SQUARE = refweb.Window(mesh="square", rows=20, columns=20, side=0.1)
LAYERS = refweb.Layers(mesh="triangle", layers=8, cell_area=0.01)
DEFLECTION = dict(name="deflection", quantity="displacement", reduce="max")
STRESS, STRAIN = (dict(name=name, quantity=name, reduce="max") for name in ("stress", "strain"))
LEAST = dict(name="least", quantity="tension", reduce="min")
ENERGY = dict(name="energy", quantity="kinetic_energy", reduce="max")


def advanced(scene):
    """Integrator of a scene and its course at the end, row by row."""
    simulation = Simulation(scene, scene.build(), Solution(scene))
    integrator = simulation.integrator
    course = integrator.start()
    for time in simulation.schedule.times[1:]:
        integrator.advance(course, [time])
    return integrator, course


def run(observe, effects=(), prestrain=0.0):
    """Steps of a web of 760 lines that a mass leaves, from rest on, and their end."""
    thrown = refweb.PointMass(node=90, mass=0.05), refweb.Velocity(node=90, value=(0.3, 0.0, 3.0))
    scene = refweb.Scene(
        web=SQUARE,
        cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-4, density=200.0, prestrain=prestrain),
        effects=[*thrown, *effects],
        solve=refweb.Dynamic(duration=0.02, step_size=2e-5),
        observe=[refweb.Observe(**table) for table in observe],
        output=refweb.Output(interval=4e-3, frames=3),
        accuracy=refweb.Accuracy(error="none"),
    )
    return advanced(scene)


def without_blocks(law, cells, lines, made):
    """The kernel of lines, which is not told that blocks can show what they have."""
    force, taken, numbers, _, places = made(law, cells, lines)
    return force, taken, numbers, 0, places


@pytest.mark.parametrize("prestrain", [0.0, 0.002])
@pytest.mark.parametrize(
    "observe",
    [[DEFLECTION, STRESS], [STRAIN, DEFLECTION], [STRESS, STRAIN], [DEFLECTION], [STRESS, LEAST], [STRESS, ENERGY]],
    ids=lambda observe: " ".join(table["name"] for table in observe),
)
def test_steps_with_blocks_have_the_same_bits(monkeypatch, observe, prestrain):
    """Each peak, when and where it is, and what lines show at the end, beside steps that show each line."""
    (few, shown), made = run(observe, prestrain=prestrain), line_blocks.by_blocks
    monkeypatch.setattr(line_blocks, "by_blocks", functools.partial(without_blocks, made=made))
    each, plain = run(observe, prestrain=prestrain)
    assert len(few.model.terms.blocks) == 4 and not len(each.model.terms.blocks)
    assert few.model.terms.blocks[:3, 0].any() == (observe[-1] not in (LEAST, ENERGY))
    assert shown.nsteps == plain.nsteps == 1000
    for name in ("x", "v", "force"):
        np.testing.assert_array_equal(getattr(shown, name), getattr(plain, name))
    for name in ("values", "times", "places", "corrections", "recent"):
        found, expected = (getattr(course.extremes, name) for course in (shown, plain))
        np.testing.assert_array_equal(found, expected, err_msg=name)
    np.testing.assert_array_equal(few._outs[0], each._outs[0])
    assert shown.extremes.times.any() and (shown.extremes.places >= 0).any()


@pytest.mark.parametrize("web, runs", [(SQUARE, True), (LAYERS, False)])
def test_lengths_that_change_have_the_same_bits(monkeypatch, web, runs):
    """Every third line is reeled in, half of these by a second reel, beside the kernel that takes line after line."""

    def reeled():
        third = [*range(0, 300, 3)]
        scene = refweb.Scene(
            web=web,
            cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-4, density=200.0),
            effects=[
                refweb.Velocity(node=90, value=(0.3, 0.0, 3.0)),
                refweb.Reel(lines=third, factor=[(0.0, 1.0), (0.004, 0.97), (0.007, 1.01)]),
                refweb.Reel(lines=third[:50], factor=[(0.0, 1.0), (0.005, 1.02)]),
            ],
            solve=refweb.Dynamic(duration=0.01, step_size=2e-5),
            observe=[refweb.Observe(**table) for table in (DEFLECTION, STRESS)],
            accuracy=refweb.Accuracy(error="none"),
        )
        return advanced(scene)

    def by_lines(law, cells, lines):
        places = np.arange(len(cells)) * lines.shape[1]
        return force, cells, lines, 0, places

    together, shown = reeled()
    terms = together.model.terms
    assert len(terms.natural) == 100 and (len(terms.elements) < len(terms.cells[0])) == runs
    assert terms.numbers is not terms.data[0] and not len(terms.blocks)
    force = together.system.terms[0].force
    monkeypatch.setattr(line_blocks, "by_blocks", by_lines)
    each, plain = reeled()
    assert each.model.terms.numbers is each.model.terms.data[0]
    for name in ("x", "v", "force", "work"):
        np.testing.assert_array_equal(getattr(shown, name), getattr(plain, name))
    np.testing.assert_array_equal(shown.extremes.values, plain.extremes.values)
    assert shown.work[-1] != 0.0 and shown.extremes.values.all()
