"""Hard cases: each either right by an invariant, or refused with a reason.

Small webs under what breaks solvers: no tension at all and a million newtons, moduli from 1 to 1e12 Pa, elements of 1 :
1e6, mechanisms, lines that were broken before, everything slack, a snap of all lines at once, impacts up to 7 km/s,
contact from soft to hard, bodies that start inside of the web, edges that lines press deeper than they are round, boxes
that tumble onto edges and corners, plates at 50 m/s, surfaces with slivers, a body at rest on a net for 1e5 steps,
lines and bodies that touch their like, pulses and peaks between steps, hammer blows, tables with more corners than
steps.
Each is solved by every method that takes it; a number proves each result:

- statics: the largest force that is left at a free node, over the largest of loads and tensions. Tensions come from
  positions and natural lengths by the law alone, assembled with numpy line by line.
- dynamics: the balance of energy of the last state, over the largest energy there was. Kinetic and strain energy come
  from positions, velocities and the law alone; what contact stores, what is lost and the work done are the run's. With
  it the balance of momentum: that of all masses, less that at the start, less the impulse of the supports, of dead
  loads, of gravity and of damping in proportion to mass, over the largest momentum; of a free web that of angular
  momentum as well.

What is no result is a refusal, and its reason is listed. Which method refuses which case, and why, is foreseen in the
table of cases: a method that refuses another, or takes one that it should refuse, fails the row of its group. What
resolves how a line comes to stick at 1e-9 m/s, as CVODE and IDA do, does not end within minutes, and is left out.

The table of random trials counts nets of random lines, slack, supports and loads, runs of slack nets that are thrown
about and hit in steps just below the bound of stability, and nets under pressure, thrust, wind and turning frames, of
whose equilibria it is said whether they are stable. ``python -m pytest -m slow tests/test_hard_cases.py
tests/test_fuzz.py tests/test_faults.py`` tries more of them, and worse: 2000 nets, 10 000 runs, 20 000 scene files,
valid, changed and garbled, and 200 kills of a running process, each of which leaves a folder that opens and goes on to
the same bytes. What such trials find has a test of its own, among them:

- chains that hang slack under 1e-10 of EA, which no damped Newton step leads out of: softer nets do;
- forces of contact that are what is left of all forces: drag, frames and lines that a body holds are none;
- dynamic relaxation that comes to rest after every other step and hardly moves, where its steps are near the bound;
- web files with entities, that refer to other files, or whose numbers are none; names of bodies that lead out of the
  folder; checkpoints with pickles in them; scenes that need more memory than there is.
"""

import contextlib
import tempfile
from collections import Counter

import numpy as np

import refweb
from refweb.dynamics.integrators.energy_balance import DRIFT
from refweb.errors import EnergyDriftError

from ..harness.case import Case, Row, Table
from .balances import energy_left, momentum_left, turning_left, unbalanced
from .overlaps import outcome as hit_of
from .overlaps import random_hit
from .random_scenes import near_the_limit, outcome, random_net
from .stability import RandomNet, word_on
from .touching import BODIES, LINES
from .tumbling_hits import HITS, at_rest, bad_surface

STATIC = ("newton", "relaxation")
DYNAMIC = ("central-difference", "explicit", "cvode", "ida")
UP = (0.0, 0.0, 1.0)

# What is foreseen to be refused: methods, and words of their reasons.
CARRIED_OFF = dict.fromkeys(STATIC, "no equilibrium: a mechanism of 12 nodes")
MASSLESS = dict.fromkeys(("central-difference", "explicit", "cvode"), "has no mass, which")
ADRIFT = {**MASSLESS, "ida": "it has no mass, and no tension holds it"}


def not_explicit(effect):
    """Steps of high order refuse an effect that depends on velocity."""
    return {"explicit": f"takes no [{effect}]"}


def cable(law="tension-only", **changes):
    return refweb.Cable(**{"law": law, "modulus": 7e7, "area": 1e-4, "density": 200.0, **changes})


def window(size=3):
    return refweb.Window(mesh="square", rows=size, columns=size, side=0.2)


def inline(points, lines, supports, **more):
    return refweb.Inline(points=points, lines=lines, supports=supports, **more)


def pull(force, node="centre"):
    return refweb.Load(node=node, force=tuple(float(f) for f in np.multiply(force, UP)))


EDGE = inline([[-1, 0, 0], [-0.25, 0, 0], [0.25, 0, 0], [1, 0, 0]], [[0, 1], [1, 2], [2, 3]], [0, 3])


def box(top, offset=0.0, **changes):
    """A fixed box of 0.3 m that stands on an edge, the edge above at a height and beside the middle."""
    axes = [(1.0, 0.0, 1.0), (-1.0, 0.0, 1.0)]
    place = (offset, 0.0, top - 0.15 * 2.0**0.5)
    own = dict(name="box", shape="box", size=(0.3, 0.3, 1.0), axes=axes, position=place, fixed=True)
    return refweb.Body(**{**own, **changes})


# Statics


def static(*effects, web=None, steps=(1.0,), supports=None, refused=None, **law):
    return dict(
        refused=refused or {},
        web=web or window(),
        cable=cable(**law),
        effects=effects,
        supports=supports,
        solve=lambda method: refweb.Static(method=method, load_steps=steps),
    )


def uneven(ratio):
    """A web with lines of two stiffnesses, too long and too short ones in turn."""
    web = window(6).web()
    length = np.linalg.norm(web.points[web.lines[:, 0]] - web.points[web.lines[:, 1]], axis=1)
    length = (length * np.resize([0.99, 1.05, 1.01], len(length))).tolist()
    group = np.resize(["stiff", "soft", "soft", "stiff", "stiff"], len(length)).tolist()
    rim = web.find("rim").tolist()
    given = inline(web.points.tolist(), web.lines.tolist(), rim, natural_length=length, groups=group)
    loaded = pull(1.0, int(web.centre)), pull(-3.0, int(web.centre) + 1)
    return static(*loaded, web=given, groups={"soft": refweb.Group(modulus=7e7 / ratio)})


SPOKES = 200
ANGLES = 2 * np.pi * np.arange(SPOKES) / SPOKES
WHEEL = inline(
    [[0.0, 0.0, 0.0], *np.column_stack([np.cos(ANGLES), np.sin(ANGLES), 0 * ANGLES]).tolist()],
    [[0, i + 1] for i in range(SPOKES)],
    list(range(1, SPOKES + 1)),
)
TRIANGLES = refweb.Window(mesh="triangle", rows=7, columns=5, side=0.2)
ROW = [[float(i), 0.0, 0.0] for i in range(4)]
SHORT = inline([[0, 0, 0], [1, 0, 0], [1 + 1e-6, 0, 0], [2, 0, 0]], [[0, 1], [1, 2], [2, 3]], [0, 3])
SLACK = inline(ROW, [[0, 1], [1, 2], [2, 3]], [0, 3], natural_length=1.5)
TAUT = inline(ROW, [[0, 1], [1, 2], [2, 3]], [0, 3], natural_length=[1.5, 0.9, 1.5])
MET = inline([*ROW, ROW[1]], [[0, 1], [1, 2], [2, 3], [1, 4], [2, 4]], [0, 3], natural_length=[1.0] * 3 + [0.5] * 2)
CROSSED = inline(
    [[-1, 0, 0], [0, 0, 0], [1, 0, 0], [0, -1, -0.1], [0, 0, -0.1], [0, 1, -0.1]],
    [[0, 1], [1, 2], [3, 4], [4, 5]],
    [0, 2, 3, 5],
)
DANGLING = inline([*ROW, [1.0, 1.0, 0.0]], [[0, 1], [1, 2], [2, 3], [1, 4]], [0, 3])
APART = inline([*ROW, [0, 1, 0], [1, 1, 0]], [[0, 1], [1, 2], [2, 3], [4, 5]], [0, 3, 4])
TETHERED = inline(ROW, [[0, 1], [1, 2], [2, 3]], [0, 3], natural_length=[1.3, 0.9, 1.3])
APART_BY = [refweb.Load(node=1, force=(-1.0, 0.0, 0.0)), refweb.Load(node=2, force=(1.0, 0.0, 0.0))]
ARCH = inline([[-1, 0, 0], [1, 0, 0], [0, 0, 0.1]], [[0, 2], [1, 2]], [0, 1])
BESIDE = inline(ROW, [[0, 1], [1, 0], [1, 2], [2, 3], [2, 3]], [0, 3], natural_length=[0.98, 0.99, 0.97, 0.99, 0.98])
RIM = refweb.Supports(nodes=["rim"])
HANGING = refweb.Gravity(acceleration=(0.0, 0.0, -9.81))
CORNER = refweb.Supports(nodes=["corners"])
SOFT = refweb.Contact(stiffness=60.0)


def over_edge(press, offset=0.0):
    """A taut line over the edge of a box, deeper in it than the edge is round."""
    return static(box(press, offset), SOFT, web=EDGE, modulus=1e8, area=1e-5, prestrain=0.01)


STATICS = {
    "a line over the edge of a box, pressed by [m]": {p: over_edge(p) for p in (0.01, 0.03, 0.06, 0.1, 0.15)},
    "a line beside the edge of a box, by [m]": {o: over_edge(0.1, o) for o in (1e-9, 1e-3, 0.02)},
    "flat web under F [N]": {f: static(pull(f)) for f in (1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6)},
    "smoothing η, 1 N": {e: static(pull(1.0), law="smooth", smoothing=e) for e in (1e-1, 1e-3, 1e-6, 1e-9, 1e-12, 0.0)},
    "slackness ε0, 1 N": {
        e: static(pull(1.0), law="smooth", smoothing=1e-6, slackness=e) for e in (0.0, 1e-6, 1e-3, 1e-2, 0.1)
    },
    "curves of points": {
        name: static(pull(10.0), law="table", modulus=None, stress=points, prestrain=prestrain)
        for name, points, prestrain in (
            ("soft at first", ((0.0, 0.0), (0.02, 1e4), (0.05, 4e5), (0.2, 1e7)), 0.0),
            ("soft at first, slack", ((0.0, 0.0), (0.02, 1e4), (0.05, 4e5), (0.2, 1e7)), -0.02),
            ("stiff at first, slack", ((0.01, 0.0), (0.011, 1e5), (0.1, 2e5), (0.3, 1e6)), -0.02),
            ("steps of 1 : 1e4", ((0.0, 0.0), (0.01, 1e2), (0.011, 1e5), (0.1, 1.001e5), (0.2, 1e7)), 0.0),
        )
    },
    "modulus [Pa], 1 N": {e: static(pull(1.0), modulus=e) for e in (1.0, 1e3, 1e6, 1e9, 1e12)},
    "density [kg/m³] under gravity": {
        d: static(HANGING, pull(1e-3), density=d) for d in (0.0, 1e-6, 1e-3, 200.0, 1e4)
    },
    "lengths": {"1 : 1e6": static(pull(1.0, 1), web=SHORT)},
    "nets": {
        "node of 200 lines": static(pull(1.0, 0), web=WHEEL),
        "dangling end": static(HANGING, pull(-1.0, 1), web=DANGLING),
        "two components": static(HANGING, web=APART),
        "a slack line of no length": static(HANGING, web=MET),
        "two lines between two nodes": static(HANGING, pull(1.0, 1), web=BESIDE),
        "a line through its neighbour": static(pull(-3e3, 1), web=CROSSED),
        "all slack": static(HANGING, web=SLACK),
        "slack without load": static(web=SLACK),
        "one line taut": static(HANGING, web=TAUT),
        "hung from one corner": static(HANGING, supports=refweb.Supports(nodes=[0])),
        "triangles hung from one corner": static(HANGING, web=TRIANGLES, supports=refweb.Supports(nodes=[0])),
        "hung from two nodes": static(HANGING, supports=refweb.Supports(nodes=[0, 1])),
        "hung from its corners": static(HANGING, supports=CORNER),
        "1 % too long": static(HANGING, prestrain=-0.01),
        "5 % too long, smooth": static(HANGING, prestrain=-0.05, law="smooth", smoothing=1e-6),
        "prestress with a mechanism": static(pull(1e-3, 1), web=inline(ROW, [[0, 1], [1, 2], [2, 3]], [0, 3],
                                             natural_length=0.99)),
        "pushed along, a mechanism": static(refweb.Load(node=1, force=(1.0, 0.0, 0.0)),
                                            web=inline(ROW, [[0, 1], [1, 2], [2, 3]], [0])),
        "without supports": static(pull(1.0), supports=refweb.Supports(nodes=[]), refused=CARRIED_OFF),
    },
    "lines of stiffness 1 : r, slack and taut": {r: uneven(r) for r in (1e2, 1e4, 1e6)},
    "positions that are open": {
        "two nodes pulled apart between slack tethers": static(*APART_BY, web=TETHERED),
        "an arch that may hang": static(pull(-0.1, 2), web=ARCH, law="smooth", smoothing=1e-2),
        "a line that both ends hold": static(pull(1.0, 1), web=inline([*ROW[:2], [0, 1, 0], ROW[3]],
                                             [[0, 1], [1, 2], [2, 3]], [0, 2, 3], natural_length=[1.0, 1.4, 3.0])),
    },
    "loads": {
        "in the plane": static(refweb.Load(node="centre", force=(1.0, 0.3, 0.0))),
        "sheared": static(refweb.Motion(node=[0, 1, 2], displacement=[[0, 0, 0, 0], [1, 0.05, 0.02, 0]])),
        "reversed through flat": static(pull(1.0), steps=(1.0, 1e-3, 0.0, -1e-3, -1.0)),
        "1 N to 1 MN in a step": static(pull(1.0), steps=(1.0, 1e6)),
    },
}  # fmt: skip


BALL = dict(name="ball", radius=0.1, position=(1.0, 0.0, -0.101), fixed=True)
STATICS["a body that a net goes through"] = {
    "at once": static(refweb.Body(**BALL), refweb.Contact(stiffness=100.0), pull(-1e3, 1),
                      web=inline(ROW[:3], [[0, 1], [1, 2]], [0, 2]), refused=dict.fromkeys(STATIC, "passes the core")),
}  # fmt: skip


# Dynamics


NODE = window().web().points[window().web().centre]


def ball(position=(0.01, 0.003, -0.101), velocity=(0.0, 0.0, 2.0), **changes):
    """A ball at a position from the node in the centre."""
    place = tuple(float(x) for x in NODE + position)
    own = {"name": "ball", "radius": 0.1, "mass": 1.0, "position": place, "velocity": velocity}
    return refweb.Body(**{**own, **changes})


def hit(*effects, stiffness=1e4, duration=0.02, web=None, contact=None, supports=None, refused=None, **law):
    bodies = effects or (ball(),)
    return dict(
        refused=refused or {},
        web=web or window(),
        cable=cable(**law),
        effects=(*bodies, refweb.Contact(stiffness=stiffness, **(contact or {}))),
        supports=supports,
        solve=lambda method: refweb.Dynamic(method=method, duration=duration),
    )


def free(*effects, web=None, duration=0.02, supports=None, refused=None, **law):
    return dict(
        refused=refused or {},
        web=web or window(),
        cable=cable(**law),
        effects=effects,
        supports=supports or refweb.Supports(nodes=[]),
        solve=lambda method: refweb.Dynamic(method=method, duration=duration),
    )


def pulse(width, impulse=0.02):
    """A web that is given an impulse [N s] within a time, most of them far below a step."""
    factor = [(0.0051, 0.0), (0.0051 + width / 2, 2.0 / width), (0.0051 + width, 0.0)]
    load = refweb.Load(node="centre", force=(0.0, 0.0, impulse), factor=factor)
    return free(load, supports=RIM)


def hammered(width, force=500.0):
    """Two taut lines with a mass between them that is hit within a few steps."""
    factor = [(0.0, 0.0), (width / 2, 1.0), (width, 0.0)]
    web = inline([[-1, 0, 0], [1, 0, 0], [0, 0, 0]], [[0, 2], [1, 2]], [0, 1])
    effects = refweb.PointMass(node=2, mass=0.05), refweb.Load(node=2, force=(0.0, 0.0, force), factor=factor)
    held = refweb.Supports(nodes=[0, 1])
    return free(*effects, web=web, supports=held, modulus=7e9, area=1e-6, prestrain=1e-3)


def trembling(corners, refused=None):
    """A web under a load whose table has so many corners, at random: where they are many, less than a step apart.

    Its work is then a small sum of large terms of either sign, which central differences book to second order.
    """
    times = np.sort(np.random.default_rng(corners).uniform(0.0, 0.02, corners))
    load = refweb.Load(node="centre", force=(0.0, 0.0, 1.0), factor=[(t, (-1.0) ** n) for n, t in enumerate(times)])
    return free(load, supports=RIM, refused=refused)


HELD = inline([[-1, 0, 0], [1, 0, 0]], [[0, 1]], [0, 1])
DEPTH, STIFFNESS, MASS_OF_BALL = 2e-3, 1e4, 1.0


def oscillating(phase):
    """A ball on a line that is held at both ends, an oscillator: at phase 0 it is deepest, before that it goes in."""
    speed = (STIFFNESS / MASS_OF_BALL) ** 0.5 * DEPTH
    place, velocity = (0.0, 0.0, DEPTH * np.cos(phase) - 0.1), (0.0, 0.0, -speed * np.sin(phase))
    ball = refweb.Body(name="ball", radius=0.1, mass=MASS_OF_BALL, position=place, velocity=velocity)
    return hit(ball, web=HELD, stiffness=STIFFNESS, duration=0.017)


def teeth(count, width=1e-9, impulse=0.02):
    """A web that is given an impulse [N s] in so many parts, each far below a step and at no multiple of one."""
    factor = [(0.0, 0.0)]
    for begin in 0.001 + 0.018 * np.sqrt(np.arange(1, count + 1) / (count + 1.0)):
        factor += [(begin, 0.0), (begin + width, 1.0 / (count * width)), (begin + 2.0 * width, 0.0)]
    load = refweb.Load(node="centre", force=(0.0, 0.0, impulse), factor=[tuple(map(float, row)) for row in factor])
    return free(load, supports=RIM)


def stepped(width, force=20.0):
    """A load that is there within a time, and gone as fast, on a web without supports."""
    factor = [(0.0051, 0.0), (0.0051 + width, 1.0), (0.0082, 1.0), (0.0082 + width, 0.0)]
    return free(refweb.Load(node="centre", force=(3.0, 0.0, force), factor=factor))


def thrown(web, supports, velocity=UP, node=1, **more):
    """Nodes of a web held, one of the others thrown."""
    held = refweb.Supports(nodes=list(supports))
    return free(refweb.Velocity(node=node, value=velocity), web=web, supports=held, **more)


def rubbing(*effects, **contact):
    """An oblique hit with friction."""
    contact = {"friction": 0.3, **contact}
    return hit(ball(velocity=(1.0, 0.0, 2.0)), *effects, contact=contact, refused=not_explicit("contact"))


THROWN = refweb.Velocity(node="centre", value=UP)
WHOLE = window(4).web()
HOLES = np.flatnonzero((WHOLE.lines == WHOLE.centre).any(axis=1))[:2].tolist() + [5, 11]
HOLED = refweb.Web(WHOLE.points, WHOLE.lines, rim=WHOLE.rim, broken=HOLES)
MASS = refweb.PointMass(node="centre", mass=1.0), THROWN
CRITICAL = 0.2 / (7e7 / 200.0) ** 0.5
"""Time constant of damping that is critical for the highest frequency 2c/L of lines of 0.2 m [s]."""
LOSSES = refweb.Damping(time=0.1 * CRITICAL, rate=10.0)
LIGHT = ball(position=(0.013, 0.003, -0.36), radius=0.35, mass=1e-3, velocity=(2.0, 0.5, 5.0))
HUB = tuple(float(x) for x in -NODE + [0.0, 0.0, -0.101])
OUTWARD = [refweb.Velocity(node=i, value=(5.0 * (i - 1.5), 0.0, 0.0)) for i in range(4)]
TURNING = [refweb.Velocity(node=0, value=(1.0, -0.5, 0.3)), refweb.Velocity(node=7, value=(0.2, 2.0, -1.0))]
HELD_MIDDLE = -NODE + [0.0, 0.0, -0.101]
THROUGH = dict.fromkeys(DYNAMIC, "passes the core of a body")
RING = ball(
    shape="ring",
    normal=UP,
    position=(float(window().web().points[:, 0].min() - NODE[0]) - 0.101, 0.05, 0.0),
    velocity=(2.0, 0.5, 0.0),
)
JUMP = refweb.Motion(node=[0], displacement=[[0.0, 0.0, 0.0, 0.0], [1e-5, 0.0, 0.0, 1e-3], [1.0, 0.0, 0.0, 1e-3]])
FALLING = refweb.Velocity(node="all", value=(0.0, 0.0, -4.0))
ASKEW = dict(size=(0.3, 0.4, 0.5), axes=[(2.0, 1.0, -1.0), (-1.0, 2.0, 0.0)], position=(0.02, -0.03, -0.33))
DRUM = refweb.Body(
    name="drum",
    shape="cylinder",
    radius=0.2,
    length=0.4,
    axis=(1.0, 0.5, 1.0),
    fixed=True,
    position=(0.02, -0.03, -0.29),
)
MOTIONS = {
    "thrown over edges, deeper than they are round": {
        "of a box": free(box(0.0, **ASKEW), SOFT, FALLING, supports=RIM, duration=0.05, modulus=1e6, area=1e-5),
        "of a box of sharp edges": free(box(0.0, **ASKEW, rounding=1e-4), SOFT, FALLING, supports=RIM, duration=0.05,
                                        modulus=1e6, area=1e-5),
        "of a drum": free(DRUM, SOFT, FALLING, supports=RIM, duration=0.05, modulus=1e6, area=1e-5),
    },
    "bodies that turn, on edges and corners, and flat": HITS,
    "impact at v [m/s]": {
        v: hit(ball(velocity=(0.0, 0.0, v), mass=1e-3), stiffness=max(1e4, 0.4 * v * v), duration=2.0 / max(v, 100.0))
        for v in (2.0, 100.0, 1000.0, 7000.0)
    },
    "lines that break under a ball at v [m/s]": {
        v: hit(
            refweb.Rupture(strength=2e4 * v),
            ball(velocity=(0.0, 0.0, v), mass=1e-2),
            stiffness=max(1e4, 4.0 * v * v),
            duration=0.3 / v,
        )
        for v in (10.0, 100.0, 1000.0)
    },
    "lines that were broken before": {
        "four of a web, thrown": free(THROWN, web=HOLED, supports=RIM),
        "one of them breaks again": free(THROWN, refweb.Rupture(at=[[HOLES[0], 0.0], [HOLES[1], 0.005], [0, 0.01]]),
                                         web=HOLED, supports=RIM),
        "under a ball": hit(ball(position=(0.05, 0.1, -0.32), radius=0.3), web=HOLED),
    },
    "contact stiffness [N/m]": {
        k: hit(stiffness=k, duration=0.02 if k < 1e8 else 2e-3) for k in (1e2, 1e4, 1e6, 1e8, 1e10)
    },
    "stiffness of contact left out": {
        "a line that is held": hit(ball(position=tuple(HELD_MIDDLE)), stiffness=None, web=HELD),
        "a web": hit(stiffness=None),
        "a push of power 1.5": hit(stiffness=None, contact=dict(exponent=1.5)),
        "a slack web": hit(stiffness=None, prestrain=-0.05),
        "a free web": hit(stiffness=None, supports=refweb.Supports(nodes=[])),
    },
    "a body that goes through": {
        "a line that is held": hit(ball(position=tuple(HELD_MIDDLE)), stiffness=50.0, web=HELD, duration=0.1,
                                   refused=THROUGH),
        "a web": hit(stiffness=1.0, duration=0.1, refused=THROUGH),
    },
    "mass of the ball [kg]": {
        m: hit(ball(mass=m), duration=0.02 if m > 1e-3 else 1e-3) for m in (1e-6, 1e-3, 1.0, 1e3, 1e6)
    },
    "where it hits": {
        "a node": hit(ball(position=(0.0, 0.0, -0.101))),
        "a line": hit(ball(position=(0.1, 0.0, -0.101))),
        "a cell": hit(ball(position=(0.1, 0.1, -0.101), radius=0.15)),
        "the edge": hit(ball(position=(0.25, 0.01, -0.101))),
        "from inside": hit(ball(position=(0.0, 0.0, -0.06))),
        "from its middle": hit(ball(position=(1e-3, 2e-3, 1e-4)),
                               refused=dict.fromkeys(DYNAMIC, "starts in the core of a body")),
        "two balls": hit(ball(), ball(name="other", position=(0.2, 0.1, 0.101), velocity=(0.0, 0.3, -2.0))),
        "a slack web": hit(prestrain=-0.05),
        "a free web": hit(supports=refweb.Supports(nodes=[])),
        "a node of 200 lines": hit(ball(position=HUB, mass=0.1), web=WHEEL, duration=2e-3),
    },
    "friction": {
        m: hit(ball(velocity=(1.0, 0.0, 2.0)), contact=dict(friction=m), refused=m and not_explicit("contact"))
        for m in (0.0, 0.1, 1.0, 10.0)
    },
    "friction and what shares it": {
        "slip velocity 1e-4 m/s": rubbing(slip_velocity=1e-4),
        "slip velocity 1e-9 m/s": rubbing(slip_velocity=1e-9) | {"unfinished": ("cvode", "ida")},
        "many lines on a light ball": hit(LIGHT, contact=dict(friction=1.0), refused=not_explicit("contact")),
        "with losses of contact and of lines": rubbing(LOSSES, damping=1.0) | {"refused": not_explicit("damping")},
    },
    "damping of contact [s/m]": {
        d: hit(contact=dict(damping=d), refused=d and not_explicit("contact")) for d in (0.0, 0.1, 10.0)
    },
    "damping of lines over critical": {
        z: free(refweb.Damping(time=z * CRITICAL), THROWN, supports=RIM, refused=not_explicit("damping"))
        for z in (1e-3, 0.1, 1.0, 10.0)
    },
    "modulus [Pa]": {
        e: hit(modulus=e, duration=0.02 if e < 1e9 else 1e-3) for e in (1.0, 1e6, 1e9, 1e12)
    },
    "pulse of a load, length [s]": {w: pulse(w) for w in (1e-2, 1e-4, 1e-6, 1e-8)},
    "hammer blow on two lines, length [s]": {w: hammered(w) for w in (1e-3, 1.5e-3, 2e-3)},
    "corners of a table, number": {
        30.0: trembling(30),
        300.0: trembling(300, refused={"central-difference": "energy drift"}),
    },
    "peak between steps, phase ahead of it": {p: oscillating(-p) for p in (1.4, 0.7, 0.1, 0.01)},
    "given from outside": {
        "a load in 40 teeth of 1 ns": teeth(40),
        "a load for 3 ms, at once": stepped(1e-9),
        "a web that falls and turns": free(HANGING, *TURNING),
        "a web that is dragged as it falls": free(HANGING, *TURNING, refweb.Damping(rate=100.0),
                                                  refused=not_explicit("damping")),
        "a ring that rubs along a free web": hit(RING, contact=dict(friction=0.3), supports=refweb.Supports(nodes=[]),
                                                 refused=not_explicit("contact")),
    },
    "motion": {
        "all lines snap taut": free(*OUTWARD, web=inline(ROW, [[0, 1], [1, 2], [2, 3]], [], natural_length=1.1),
                                    duration=0.2),
        "an end that jumps": free(JUMP, supports=RIM),
        "lengths 1 : 1e6": thrown(SHORT, (0, 3), duration=1e-4),
        "a slack line of no length": thrown(MET, (0, 3)),
        "two lines between two nodes": thrown(BESIDE, (0, 3)),
        "a line through its neighbour": thrown(CROSSED, (0, 2, 3, 5), (0.0, 0.0, -10.0)),
        "a dangling end": thrown(DANGLING, (0, 3), node=4),
        "two components": thrown(APART, (0, 3, 4)),
        "density 1e-6 kg/m³": thrown(window(), ("rim",), node="centre", density=1e-6, duration=1e-6),
        "no density, loaded": free(pull(1.0), density=0.0, prestrain=0.01, supports=RIM,
                                   refused=MASSLESS),
        "no density, a mass thrown": free(*MASS, density=0.0, prestrain=0.01, supports=RIM, refused=MASSLESS),
        "no density, without tension": free(*MASS, density=0.0, supports=RIM, refused=ADRIFT),
    },
    **LINES,
    **BODIES,
}  # fmt: skip


def scene_of(fields, method):
    """The scene of a case by a method."""
    fields = {name: value for name, value in fields.items() if name not in ("refused", "unfinished")}
    solve = fields.pop("solve")(method)
    if solve.kind == "dynamic":
        fields["output"] = refweb.Output(interval=solve.duration / 20, frames=20)
        fields["accuracy"] = refweb.Accuracy(error="none")
    return refweb.Scene(**fields, solve=solve)


def attempt(fields, method):
    """The solution of a case by a method, or the reason why there is none."""
    try:
        with np.errstate(all="ignore"):
            return refweb.run(scene_of(fields, method)), ""
    except (refweb.InputError, refweb.SolverError) as error:
        return None, str(error)


def struck():
    """The momentum that a ball of 7 km/s leaves in the web: steps that miss the contact would make it nothing."""
    given = []
    for method in ("central-difference", "cvode"):
        solution, _ = attempt(MOTIONS["impact at v [m/s]"][7000.0], method)
        given.append(1e-3 * (7000.0 - solution.state.v[-1, 2]))
    why = "10 steps while the ball moves by its radius, of order 2"
    return Row("momentum that a ball of 7 km/s loses", given[0], given[1], "CVODE", 1e-2, why, "N s")


def untouched():
    """Contact on a ball that nothing touches, while all else acts on it: its largest force, and touches that are told.

    With it the time at which two balls meet far from the web, which is no touch of that.
    """
    far, force, told = ball((0.0, 0.0, 5.0), (0.0, 1.0, -1.0)), 0.0, 0
    fluid = refweb.Drag(density=10.0, bodies={"ball": {"coefficient": 0.5, "area": 0.03}})
    gravity, turning = refweb.Gravity(acceleration=(0.0, 0.0, -9.81)), refweb.Frame(angular_velocity=(0.3, 0.0, 1.0))
    observe = [refweb.Observe(name="force", quantity="reaction", body="ball", reduce="max")]
    for effects in ((fluid, gravity), (turning,), (refweb.Orbit(mean_motion=1.0),)):
        for method in ("central-difference", "cvode", "ida"):
            event = [refweb.Event(name="touch", kind="contact")]
            scene = scene_of(hit(far, *effects, duration=0.1), method).replace(observe=observe, event=event)
            solution = refweb.run(scene)
            force, told = max(force, solution.results["force"].value), told + (solution.events[0]["time"] is not None)
    pair = ball((0.0, 0.0, 5.0), (0.0, 0.0, 0.0)), ball((0.0, 0.0, 5.3), (0.0, 0.0, -2.0), name="other")
    scene = scene_of(hit(*pair, duration=0.1, contact={"between_bodies": True}), "cvode")
    events = [refweb.Event(name="web", kind="contact", body="ball")]
    events.append(refweb.Event(name="meet", kind="contact", body="ball", with_="other"))
    web, meet = (event["time"] for event in refweb.run(scene.replace(event=events)).events)
    told += web is not None
    return [
        Row("contact force where nothing touches", force, 0.0, "nothing touches", 0.0, "none", "N", scale=1.0),
        Row("touches that are none", float(told), 0.0, "distances", 0.0, "none", scale=1.0),
        Row("time at which two balls meet", meet, 0.05, "(0.3 − 0.2) m / 2 m/s", 1e-9, "straight ways", "s"),
    ]


def ends():
    """How far two nodes go that are pulled apart between slack tethers: until one of these is straight."""
    observe = [refweb.Observe(name="x", quantity="position", node=1, component="x")]
    scene = scene_of(STATICS["positions that are open"]["two nodes pulled apart between slack tethers"], "newton")
    least, most = refweb.run(scene.replace(observe=observe)).results["x"].interval
    between = 0.9 * (1.0 + 1.0 / (7e7 * 1e-4))
    off = max(abs(least - (3.0 - 1.3 - between)), abs(most - 1.3))
    return Row("ends of what floats", off, 0.0, "straight tethers", 1e-8, "1e-10 of the lengths", "m", scale=1.0)


def peaks():
    """The largest force of a ball on a held line, k √(d² + v²/ω²), at phases ahead of it: its ± holds it."""
    worst = 0.0
    for fields in MOTIONS["peak between steps, phase ahead of it"].values():
        for method in DYNAMIC:
            observe = [refweb.Observe(name="force", quantity="reaction", body="ball", reduce="max")]
            scene = scene_of(fields, method).replace(accuracy=refweb.Accuracy(), observe=observe)
            force = refweb.run(scene).results["force"]
            worst = max(worst, abs(force.value - STIFFNESS * DEPTH) / force.error)
    return Row("error over ± of peaks between steps", worst, 0.0, "k √(d² + v²/ω²)", 1.0, "what ± says", scale=1.0)


def overlaps():
    """How deep a ball gets into a held line, v √(m/k), at stiffnesses that are given and that refweb chooses."""
    worst = 0.0
    for stiffness in (None, 2e4, 1e6):
        for method in DYNAMIC:
            fields = hit(ball(position=tuple(HELD_MIDDLE)), stiffness=stiffness, web=HELD)
            observe = [refweb.Observe(name="deep", quantity="overlap", body="ball", reduce="max")]
            solution = refweb.run(scene_of(fields, method).replace(accuracy=refweb.Accuracy(), observe=observe))
            told, deep = solution.bodies["ball"], solution.results["deep"]
            worst = max(worst, abs(deep.value - 2.0 * told["stiffness"] ** -0.5) / deep.error)
    return Row("error over ± of the deepest overlap", worst, 0.0, "v √(m/k)", 1.0, "what ± says", scale=1.0)


def random_hits(count):
    """Rows and cells of random hits, their contact chosen by refweb, and as soft as it comes."""
    rows, cells = [], []
    for given, what in ((False, "hits, stiffness left out"), (True, "hits, any stiffness")):
        found = Counter(hit_of(random_hit(seed, given)) for seed in range(count))
        silent = count - sum(found[kind] for kind in ("held", "said", "refused")[: 3 if given else 2])
        rows.append(Row(f"{what}: silent, or through", silent, 0.0, "own distances", 0.0, "none", scale=1.0))
        cells.append([what, str(count), str(found["held"] + found["said"]), str(found["refused"]), str(silent)])
    return rows, cells


def words_on_stability(count):
    """A row and cells of random nets whose equilibria are stable or not: the word on that is right."""
    found = Counter(word_on(RandomNet(seed)).partition(":")[0] for seed in range(count))
    row = Row("words on stability: wrong", found["wrong"], 0.0, "own eigenvalues", 0.0, "none", scale=1.0)
    solved = count - found["refused"] - found["wrong"]
    return row, ["words on stability", str(count), str(solved), str(found["refused"]), str(found["wrong"])]


def matrix(groups, methods, prove, tolerance, reason, quick):
    """Rows, cells and reasons of a matrix of cases and methods; a group's row fails where a refusal is not foreseen."""
    rows, cells, refusals = [], [], {}
    for group, members in groups.items():
        worst, unforeseen = 0.0, []
        names = list(members)
        ends = names[:: max(len(names) - 1, 1)]
        for name in ends if quick and isinstance(names[0], float) else names:
            line = [f"{group}: {name:g}" if isinstance(name, float) else name]
            for method in methods:
                if method in members[name].get("unfinished", ()):
                    line.append("left out")
                    continue
                solution, why = attempt(members[name], method)
                expected = members[name]["refused"].get(method)
                as_foreseen = expected in why if expected else not why
                if not as_foreseen:
                    unforeseen.append(f"{name} by {method}")
                if solution is None:
                    number = refusals.setdefault(why, len(refusals) + 1)
                    line.append(f"refused ({number})")
                    continue
                proof = prove(solution)
                worst = max(worst, proof if np.isfinite(proof) else np.inf)
                line.append(f"{proof:.1e}")
            cells.append(line)
        if unforeseen:
            group, worst = f"{group}, refused or solved against the table: {'; '.join(unforeseen)}", np.inf
        rows.append(Row(group, worst, 0.0, "own balance of the state", tolerance, reason, scale=1.0))
    reasons = [[str(number), why] for why, number in refusals.items()]
    return rows, cells, reasons


KICKS = (refweb.Velocity(node=0, value=(0.3, -0.2, 1.0)), refweb.Velocity(node=5, value=(-0.5, 0.1, 0.4)))
LAWS = {"smooth, η = 1e-4": dict(law="smooth", smoothing=1e-4), "tension-only": dict(law="tension-only")}


def long_run(steps, law):
    """A free web that was thrown, after many steps: solution or reason, what momentum, turning and energy have lost."""
    short, _ = attempt(free(*KICKS, duration=0.1, **law), "central-difference")
    duration = steps * 0.1 / short.solver["nsteps"]
    solution, why = attempt(free(*KICKS, duration=duration, **law), "central-difference")
    if solution is None:
        return [why], None
    state = solution.state
    mass, start = state.system.net.mass[:, None], state.system.initial_velocity()
    turning = np.cross(state.position, mass * state.v).sum(axis=0)
    turned = np.cross(state.system.net.points, mass * start).sum(axis=0)
    moving = np.linalg.norm(np.cross(state.position, mass * state.v), axis=1).sum()
    lost = momentum_left(solution), np.linalg.norm(turning - turned) / moving, energy_left(solution)
    return lost, solution.solver["nsteps"]


def restarted(method):
    """Largest difference that an interruption in the middle makes to where a web is, over how far it has moved."""
    scene = scene_of(hit(duration=0.01), method)
    scene = scene.replace(output=refweb.Output(interval=5e-4, frames=4))

    def stop(text, share):
        if share > 0.5:
            raise KeyboardInterrupt

    with tempfile.TemporaryDirectory() as folder:
        with contextlib.suppress(KeyboardInterrupt):
            refweb.run(scene, out=f"{folder}/run", progress=stop)
        solution = refweb.resume(f"{folder}/run")
    undisturbed = refweb.run(scene)
    difference = np.abs(solution.state.x - undisturbed.state.x).max()
    return difference / np.abs(undisturbed.state.x).max()


def random_trials(nets, runs):
    """Rows and a table of random nets, and of random runs near the limit of stability."""
    kinds, tried = (
        ("solved", "relaxed", "carried off", "pushed"),
        Counter(outcome(random_net(seed)) for seed in range(nets)),
    )
    wrong = nets - sum(tried[kind] for kind in kinds)
    proven, refused, worst = tried["solved"] + tried["relaxed"], 0, 0.0
    for seed in range(runs):
        try:
            with np.errstate(all="ignore"):
                worst = max(worst, energy_left(refweb.run(near_the_limit(seed))))
        except refweb.SolverError as error:
            if not isinstance(error, EnergyDriftError) and "passes the core of a body" not in str(error):
                raise
            refused += 1
    rows = [
        Row("random nets without a proof or a reason", wrong, 0.0, "forces, gap of duality", 0.0, "none", scale=1.0),
        Row("energy of random runs near the limit", worst, 0.0, "own balance", DRIFT, "the budget of a run", scale=1.0),
    ]
    cells = [
        ["nets in statics", str(nets), str(proven), str(nets - proven - wrong), str(wrong)],
        ["runs near the limit", str(runs), str(runs - refused), str(refused), str(int(worst > DRIFT))],
    ]
    return rows, Table("Random trials", ["what", "tried", "solved", "refused with a reason", "wrong"], cells)


def case(quick):
    tolerance, reason = 1e-7, "Newton and relaxation end below 1e-9 of their own scale, which may be 100 times larger"
    rows, cells, reasons = matrix(STATICS, STATIC, unbalanced, tolerance, reason, quick)
    tables = [Table("Statics: force left over scale", ["case", *STATIC], cells)]
    tables.append(Table("Statics: reasons of refusals", ["number", "reason"], reasons))

    def prove(solution):
        return max(energy_left(solution), momentum_left(solution), turning_left(solution))

    reason = "the budget of energy of a run"
    more, cells, reasons = matrix(MOTIONS, DYNAMIC, prove, DRIFT, reason, quick)
    rows += more
    tables.append(Table("Dynamics: energy, momentum or angular momentum left", ["case", *DYNAMIC], cells))
    tables.append(Table("Dynamics: reasons of refusals", ["number", "reason"], reasons))
    rows += [struck(), peaks(), overlaps(), *untouched(), bad_surface(), *at_rest(1e4 if quick else 1e5)]
    for method in ("central-difference",) if quick else ("central-difference", "cvode", "ida"):
        exact = method == "central-difference"
        within = (0.0, "bit for bit") if exact else (1e-3, "rtol 1e-6, and what slackness adds")
        name = f"restart in the middle, {method}"
        rows.append(Row(name, restarted(method), 0.0, "the undisturbed run", *within, scale=1.0))
    long = []
    for name, law in LAWS.items():
        lost, steps = long_run(1e4 if quick else 1e6, law)
        if steps is None:
            long.append([name, "refused", *3 * ["none"], *lost])
            continue
        long.append([name, str(steps), *(f"{value:.1e}" for value in lost), "none"])
        bound, why = 4e-16 * steps, "2 roundings in every step, all of one sign"
        bounds = (bound, why), (bound, why), (DRIFT, "the budget of energy of a run")
        for what, value, within in zip(("momentum", "angular momentum", "energy"), lost, bounds, strict=True):
            rows.append(Row(f"{what} of a free web, {name}", value, 0.0, "conserved", *within, scale=1.0))
    more, table = random_trials(*((30, 30) if quick else (300, 1000)))
    hits, cells = random_hits(20 if quick else 200)
    row, words = words_on_stability(20 if quick else 200)
    more, table = [*more, *hits, row], Table(table.title, table.columns, [*table.rows, *cells, words])
    columns = ["law", "steps", "momentum lost", "angular momentum lost", "energy lost", "reason of refusal"]
    tables.append(Table("A free web, thrown, in many steps", columns, long))
    return Case(rows=rows + more, tables=[*tables, table])
