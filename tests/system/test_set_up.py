"""The set-up of a net runs over arrays: the number of calls, of Python and of its libraries, does not grow with it.

From the command to the compiled loop it comes through few functions.
"""

import gc
import sys
import traceback

import pytest
from nets import some

import refweb
from refweb.__main__ import main
from refweb.dynamics.integrators.central_difference import advance_rows


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


@pytest.mark.slow
@pytest.mark.parametrize("mesh", some(["hexagon", "triangle", "square"], 3))
def test_no_loop_over_lines_or_nodes(mesh):
    """Nine times the lines, thousands more, take a few calls for each further row of cells."""
    calls(mesh, 8)
    assert calls(mesh, 36) - calls(mesh, 12) < 20 * (36 - 12)


def test_a_run_comes_to_its_first_step_through_few_functions(monkeypatch, tmp_path):
    """At most 7 stand between that of the command and the compiled loop."""
    depths, entry = [], advance_rows.call

    def noted(*arguments):
        names = [frame.filename.replace("\\", "/") for frame in traceback.extract_stack()]
        depths.extend(len(names) - 2 - n for n, name in enumerate(names) if name.endswith("refweb/commands/run.py"))
        return entry(*arguments)

    monkeypatch.setitem(vars(advance_rows), "_entry", noted)
    assert main(["run", "square-impact", "--set", "solve.duration=0.02", "--out", str(tmp_path / "out")]) == 0
    assert min(depths) <= 7  # without the command and what is put in the place of the loop
