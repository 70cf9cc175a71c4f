"""Dynamic relaxation against Newton's method: two ways to one equilibrium that share the forces and nothing else."""

import nets
import numpy as np
import pytest

import refweb
from refweb.statics import dynamic_relaxation as relaxation
from refweb.statics import load_steps
from refweb.statics.equilibrium import NotFound

MODULUS, AREA = 7e7, 1e-4
LOAD = refweb.Load(node="centre", force=(0.0, 0.0, 1.0))


def cable(law, **changes):
    return refweb.Cable(law=law, modulus=MODULUS, area=AREA, density=200.0, **changes)


def paper(mesh, law, **changes):
    """One of the paper's three webs under 1 N at its centre."""
    web = refweb.Paper(mesh=mesh, cable_length=201.4).web()
    return nets.system(web, cable(law, **changes), [LOAD])


MESHES = ["triangle", "square", pytest.param("hexagon", marks=pytest.mark.slow)]


def both(system, steps=(1.0,)):
    return list(load_steps.solve(system, steps)), list(relaxation.solve(system, steps))


def residual(system, state):
    """Largest force on a free node over the largest of load and tension."""
    force = np.where(system.supported, 0.0, system.force(state.step, state.x))
    return np.linalg.norm(force, axis=1).max() / max(1.0, state.tension.max())


@pytest.mark.ordinary("triangle")
@pytest.mark.parametrize("mesh", MESHES)
def test_tensions_agree_within_both_certificates(mesh):
    """Each certificate bounds the distance to the one exact tension, so that their sum bounds the difference."""
    system = paper(mesh, "tension-only")
    (newton,), (relaxed,) = both(system)
    assert residual(system, relaxed) <= 1e-9 and relaxed.stats["residual"] <= 1e-9
    bound = newton.duality_bound.tension + relaxed.duality_bound.tension
    assert (np.abs(relaxed.tension - newton.tension) <= bound).all()
    # The certificates say something: a thousandth of the largest tension, in the worst line.
    assert bound.max() < 1e-3 * newton.tension.max()


@pytest.mark.slow
@pytest.mark.parametrize("mesh", ["triangle", pytest.param("square", marks=pytest.mark.slow), MESHES[2]])
def test_the_smooth_law_has_one_minimum(mesh):
    """Where all pivots of the tangent are positive the equilibrium is isolated, and both find it."""
    system = paper(mesh, "smooth", smoothing=1e-4)
    (newton,), (relaxed,) = both(system)
    assert newton.stats["smallest_pivot"] == 1 and residual(system, relaxed) <= 1e-9
    np.testing.assert_allclose(relaxed.tension, newton.tension, rtol=0, atol=1e-6 * newton.tension.max())


BALL = dict(name="ball", radius=0.1, position=(0.01, 0.02, -0.06), fixed=True)
CASES = {
    "weight": [refweb.Gravity(acceleration=(0.0, 0.3, -9.81)), LOAD],
    "moved supports": [refweb.Motion(node="rim", displacement=[(0, 0, 0, 0), (2.0, 0.02, 0.0, 0.1)]), LOAD],
    "fixed ball": [LOAD, refweb.Body(**BALL), refweb.Contact(stiffness=1e5)],
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("law", nets.LAWS)
def test_other_effects_in_load_steps(case, law):
    """Also where the path over the load steps is not straight; taut webs have one equilibrium for every law."""
    web = refweb.Window(mesh="square", rows=4, columns=4, side=0.2).web()
    system = nets.system(web, cable(law, prestrain=0.01), CASES[case])
    for newton, relaxed in zip(*both(system, (0.5, 2.0, 1.0)), strict=True):
        assert relaxed.step == newton.step and residual(system, relaxed) <= 1e-9
        np.testing.assert_allclose(relaxed.tension, newton.tension, rtol=0, atol=1e-8 * newton.tension.max())
        np.testing.assert_allclose(relaxed.x, newton.x, rtol=0, atol=1e-8 * np.abs(newton.x).max())
    touching = [system.energy_of(f, 1.0, relaxed.x).sum() for f in system.terms if f.contact.with_lines]
    assert (case == "fixed ball") == bool(touching) and all(energy > 0.0 for energy in touching)


def scene(**changes):
    given = dict(
        web=refweb.SingleCable(start=(-1, 0, 0), end=(1, 0, 0), elements=20, length=2.2),
        cable=cable("tension-only"),
        effects=[refweb.Gravity(acceleration=(0.0, 0.0, -9.81))],
        solve=refweb.Static(method="relaxation"),
    )
    return refweb.Scene(**{**given, **changes})


def test_scene_key():
    """method = "relaxation" in a scene: a slack cable hangs as Newton's method has it, with the certificate's error."""
    relaxed, newton = refweb.run(scene()), refweb.run(scene(solve=refweb.Static()))
    assert relaxed.status == "solved" and relaxed.solver["method"] == "relaxation"
    assert relaxed.solver["nsteps"] > 0 and relaxed.solver["residual"] <= 1e-9
    assert relaxed.solver["nlu"] == 1  # of the certificate alone
    tension, other = relaxed.results["max_tension"], newton.results["max_tension"]
    assert abs(tension.value - other.value) <= tension.error + other.error < 1e-3 * other.value
    # Weight is exact: the supports carry it.
    np.testing.assert_allclose(relaxed.reaction[:, 2].sum(), 200.0 * AREA * 2.2 * 9.81, rtol=1e-9)


def test_scene_is_read_and_written():
    text = scene().to_dict()
    assert text["solve"]["method"] == "relaxation" and refweb.Scene.from_dict(text).to_dict() == text
    with pytest.raises(refweb.InputError, match='method = "relax" must be one of .* did you mean "relaxation"'):
        refweb.Static(method="relax")


def test_nothing_to_do():
    """A web that nothing pulls, and one whose nodes are all held, are in equilibrium as they are."""
    for changes in (dict(effects=()), dict(supports=refweb.Supports(nodes="all"))):
        solution = refweb.run(scene(web=refweb.Window(mesh="square", rows=3, columns=3, side=0.5), **changes))
        assert solution.solver["nsteps"] == 0 and not solution.displacement.any()


def test_no_equilibrium():
    """A web that is carried off is refused at once, one that is not there yet says how far it came."""
    with pytest.raises(refweb.SolverError, match="no equilibrium: a mechanism of 21 nodes"):
        refweb.run(scene(supports=refweb.Supports(nodes=[])))
    system, told = scene().build(), []
    with pytest.raises(NotFound, match='4000 steps of relaxation: residual .*use method = "newton"') as error:
        list(relaxation.solve(system, [1.0], progress=told.append, limit=4000))
    assert error.value.stats == {"nsteps": 4000} and len(told) == 2 and told[0].startswith("step 1, residual")
