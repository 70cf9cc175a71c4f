"""Proven bounds of lines that yield, as long as none turns back."""

import nets
import numpy as np
import pytest
from scipy import sparse

import refweb
from refweb.effects.plastic import PlasticLines
from refweb.results.state import State
from refweb.statics.load_steps import solve

AXIAL, YIELD, HARDENING = 100.0, 4.0, np.array([10.0, 20.0])
"""EA [N], yield force [N], and hardening times area [N] of lines without a group and of the group "edge"."""


def loaded(seed, *steps, hardening=None):
    """(System, equilibria) of a net of lines that yield, and of a group that does not, under random loads."""
    rng, web = np.random.default_rng(seed), nets.skew_web()
    groups = {"tie": dict(law="tension-only"), "edge": dict(hardening=HARDENING[1] / 1e-3)}
    hardening = HARDENING[0] / 1e-3 if hardening is None else hardening
    stress = {} if isinstance(hardening, list) else {"yield_stress": YIELD / 1e-3}
    if isinstance(hardening, list):
        groups["edge"] = {}
    cable = refweb.Cable(
        law="elastic-plastic",
        modulus=AXIAL / 1e-3,
        area=1e-3,
        density=1.0,
        hardening=hardening,
        groups=groups,
        **stress,
    )
    factor = [(0.0, 0.0), (1.0, 1.0), (2.0, 0.0)]
    effects = [
        refweb.Load(node=int(node), force=tuple(rng.normal(scale=3.0, size=3)), factor=factor) for node in (1, 3, 4, 5)
    ]
    system = nets.system(web, cable, [PlasticLines(cable), *effects])
    return system, list(solve(system, steps))


def by_conic_program(system, found):
    """(Tension, energy kept, energy lost, gap) by clarabel, which knows nothing of load steps.

    min Σ L (½ EA e² + F p + ½ H p²) − f·u with |d| ≤ L (1 + e + p), e, p ≥ 0. Its gap bounds its tensions as ours does;
    it keeps constraints to some 1e-10, which makes 1e-9 of the energy.
    """
    clarabel, net, free = pytest.importorskip("clarabel"), system.net, np.array([1, 3, 4, 5])
    web, (edge, tie) = net.web, (np.isin(np.arange(9), net.web.groups[name]) for name in ("edge", "tie"))
    vector, lines, length = (
        web.points[web.lines[:, 1]] - web.points[web.lines[:, 0]],
        len(web.lines),
        web.natural_length,
    )
    load = sum(system.force_of(f, found.step, found.x) for f in system.terms if not f.balance.internal)[free]
    ends = np.tile([1.0, -1.0], lines), (np.repeat(np.arange(lines), 2), web.lines[:, ::-1].ravel())
    move = sparse.kron(sparse.coo_array(ends, (lines, 6)).tocsc()[:, free], sparse.eye_array(3))
    order = np.argsort(np.concatenate([4 * np.arange(lines), (4 * np.arange(lines)[:, None] + [1, 2, 3]).ravel()]))
    stretch, none = sparse.diags_array(length), sparse.coo_array((lines, 12))
    cone = sparse.block_array([[none, stretch, stretch], [move, None, None]], format="csr")[order]
    one = sparse.eye_array(lines)
    positive = sparse.block_array([[none, one, None], [none, None, one]])
    A = -sparse.vstack([positive, cone], format="csc")
    b = np.concatenate([np.zeros(2 * lines), np.concatenate([length, vector.ravel()])[order]])
    P = sparse.diags_array(np.concatenate([np.zeros(12), AXIAL * length, HARDENING[edge * 1] * length]))
    q = np.concatenate([-load.ravel(), np.zeros(lines), np.where(tie, 1e6, YIELD) * length])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-12
    kinds = [clarabel.NonnegativeConeT(2 * lines), *[clarabel.SecondOrderConeT(4)] * lines]
    matrices = (sparse.csc_matrix(P), q, sparse.csc_matrix(A), b)
    answer = clarabel.DefaultSolver(*matrices, kinds, settings).solve()
    assert "Solved" in str(answer.status)
    elastic, plastic = np.array(answer.x)[12:].reshape(2, lines)
    kept = 0.5 * AXIAL * (length * elastic**2).sum()
    lost = (length * plastic * (YIELD + 0.5 * HARDENING[edge * 1] * plastic))[~tie].sum()
    return AXIAL * elastic, kept, lost, abs(answer.obj_val - answer.obj_val_dual) + 1e-9 * abs(answer.obj_val)


@pytest.mark.parametrize("seed", nets.some(range(20), 5))
def test_bounds_contain_the_answer_of_a_conic_program(seed):
    """In one load step, and in the second of two if no line turns back; energies kept and lost as well."""
    bounded = 0
    for steps in ((1.0,), (0.5, 1.0)):
        system, (*_, found) = loaded(seed, *steps)
        tension, kept, lost, gap = by_conic_program(system, found)
        if found.duality_bound is None:
            continue
        bounded += 1
        proven, energies = found.duality_bound, State(system, found.step, found.x).energies
        room = np.sqrt(2.0 * AXIAL / system.net.natural_length * gap)
        assert (np.abs(found.tension - tension) <= proven.tension + room).all()
        assert proven.tension.max() < 1e-4 * found.tension.max()
        room = (room * tension * system.net.natural_length / HARDENING[0]).sum()
        assert abs(energies["strain_energy"] - kept) <= proven.strain_energy + room
        assert abs(energies["plastic_energy"] - lost) <= proven.strain_energy + room
        assert lost > 0.0
    assert bounded >= 1


def test_bounds_hold_away_from_the_equilibrium():
    """They bound the error of whatever positions they are given: of a step of half the load for the whole one."""
    from refweb.statics.equilibrium import Equilibrium
    from refweb.statics.monotone_loading import add_bounds

    system, (best,) = loaded(0, 1.0)
    for size in (1e-6, 1e-3, 1e-1):
        x = best.x.copy()
        x.ravel()[system.free] += size * np.random.default_rng(1).standard_normal(len(system.free))
        x[len(system.net.web.points) :] = 0.0  # new lines
        force, per_cell = system.forces(1.0, x)
        moved = Equilibrium(1.0, x, per_cell.tension.copy(), force)
        add_bounds(system, moved)
        apart = np.abs(moved.tension - best.tension)
        assert (apart <= moved.duality_bound.tension + best.duality_bound.tension).all()
        assert apart.max() > 1e3 * best.duality_bound.tension.max() or size < 1e-3


def test_what_is_not_proven():
    """Lines that turn back, and those that yield without hardening; before they yield all is proven."""
    _, (small, large, back) = loaded(0, 0.1, 1.0, 1.5)
    assert small.duality_bound is not None and large.duality_bound is not None and back.duality_bound is None
    _, found = loaded(0, 0.05, 1.0, hardening=[[0.0, YIELD / 1e-3], [0.001, YIELD / 1e-3], [1.0, 8e3]])
    assert found[0].duality_bound is not None and found[1].duality_bound is not None
    web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0], [2, 0, 0]], lines=[[0, 1], [1, 2]], supports=[0, 2])
    for hardening, code in ((0.0, "not-proven"), (1e4, "monotone-loading")):
        cable = refweb.Cable(law="elastic-plastic", modulus=1e5, area=1e-3, density=1.0, yield_stress=4e3,
                             hardening=hardening, prestrain=0.035)  # fmt: skip
        load = refweb.Load(node=1, force=(1.5, 0.0, 0.0))
        observe = [refweb.Observe(name="T", quantity="tension", line=0)]
        scene = refweb.Scene(web=web, cable=cable, effects=[load], observe=observe, solve=refweb.Static())
        run = refweb.run(scene)
        assert [finding.code for finding in run.findings] == [code]
        assert run.results["T"].proven == (code != "not-proven")
