"""The set-up of a net runs over arrays: the number of calls, of Python and of its libraries, does not grow with it."""

import gc
import sys

import pytest

import refweb


def calls(mesh, cells):
    """Number of calls that a scene's system and pattern take.

    The collector of what other tests have left does not run meanwhile.
    The search for an optional library asks each folder of the path, so its calls are left out.
    """
    count = 0

    def note(frame, event, argument):
        nonlocal count
        if not frame.f_code.co_filename.startswith("<frozen importlib"):
            count += event in ("call", "c_call")

    scene = refweb.Scene(
        web=refweb.Window(mesh=mesh, rows=cells, columns=cells, side=0.1),
        cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-4, density=200.0),
        effects=[refweb.Gravity(acceleration=(0.0, 0.0, -9.81)), refweb.Load(node="centre", force=(0.0, 0.0, 1.0))],
        solve=refweb.Static(load_steps=[1.0]),
    )
    gc.collect()
    gc.disable()
    before = sys.getprofile()
    sys.setprofile(note)
    try:
        assert scene.build().pattern.size > 0
    finally:
        sys.setprofile(before)
        gc.enable()
    return count


@pytest.mark.parametrize("mesh", ["square", "triangle", "hexagon"])
def test_no_loop_over_lines_or_nodes(mesh):
    """Nine times the lines, thousands more, take a few calls for each further row of cells."""
    calls(mesh, 8)
    assert calls(mesh, 36) - calls(mesh, 12) < 20 * (36 - 12)
