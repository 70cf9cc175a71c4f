"""Records of the compiled loop: what they hold is free behind a run, and states begin with a line of the cache."""

import gc
import tomllib
import weakref
from pathlib import Path

import numpy as np
import pytest

import refweb
from refweb.dynamics.integrators.records import LINE, aligned
from refweb.dynamics.simulation import Simulation
from refweb.solution import Solution

SCENES = Path(refweb.__file__).parent / "scenes"


@pytest.mark.ordinary("square-impact-changes0")
@pytest.mark.parametrize(
    "name, changes",
    [
        ("square-impact", {}),
        ("square-impact", {"method": "explicit"}),
        ("spin-deployment", {}),
        ("published-throw", {}),
        ("capture-stage", {}),
    ],
)
def test_what_a_run_has_used_is_free_behind_it(name, changes):
    """Leaves count no references, and blocks of records hold addresses: what keeps an array for ever would show."""
    given = tomllib.loads((SCENES / f"{name}.toml").read_text())
    given["solve"].update(changes)
    scene = refweb.Scene.load(name) if not changes else refweb.Scene.from_dict(given)
    simulation = Simulation(scene, scene.build(), Solution(scene))
    integrator, times = simulation.integrator, simulation.schedule.times
    course = integrator.start(*simulation.begin.motion)
    for end in (times[1], 1.01 * times[1]):
        integrator.advance(course, [end])
    model = integrator.model
    used = [course.x, course.v, course.force, course.before, course.work, course.extremes.values, *model.terms.outs]
    used += [model.inertia.inverse, model.inertia.rates, model.terms.still]
    alive = [weakref.ref(array) for array in used]
    del simulation, integrator, course, model, used
    gc.collect()
    assert [one() for one in alive] == [None] * len(alive)


@pytest.mark.parametrize("shape", [(), (0, 3), (1, 3), (101, 3), (5000, 3)])
def test_aligned_copies_begin_with_a_line_of_the_cache(shape):
    """Wherever what they copy begins, and they own what they stand in."""
    whole = np.arange(2.0 + np.prod(shape, dtype=int))
    for first in range(3):
        values = whole[first : first + np.prod(shape, dtype=int)].reshape(shape)
        copy = aligned(values)
        assert not copy.size or copy.ctypes.data % LINE == 0
        assert copy.dtype == values.dtype and copy.flags.c_contiguous
        np.testing.assert_array_equal(copy, values)
        assert not np.shares_memory(copy, whole)
