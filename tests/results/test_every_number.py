"""Every observable with every effect by every method, beside the same number made of the files of the last frame.

The list of effects and that of observables are those of the registry, so that none can be missing. A net is hit by a
ball, and a box tumbles far from it, which nothing ever touches. What the numbers should be is computed here from the
VTU files and the scene alone: places, velocities, natural lengths and masses are read, all else follows by the law.
Contact, tautness and thresholds are looked for in the same runs: what touches nothing has no contact, a line that stays
slack is not taut, and what is not pushed passes no threshold, whatever acts.

Each effect is run by one method, in turn; all pairs are run with ``-m slow``.
"""

import itertools

import meshio
import numpy as np
import pytest

import refweb
from refweb.registry import EFFECTS, OBSERVABLES

EA, STRAIN, STIFFNESS, DURATION = 1e3, 0.01, 1e4, 0.015
LAW = dict(damping=0.2, friction=0.3, slip_velocity=0.05)
SIDE = 0.2
PLACES = [[SIDE * i, SIDE * j, 0.0] for i in range(4) for j in range(4)]
GRID = [[4 * i + j, 4 * i + j + 1] for i in range(4) for j in range(3)]
GRID += [[4 * i + j, 4 * i + j + 4] for i in range(3) for j in range(4)]
RIM = [n for n, (x, y, _) in enumerate(PLACES) if x in (0.0, 3 * SIDE) or y in (0.0, 3 * SIDE)]
TAIL, SLACK = len(GRID), len(GRID) + 1
"""A line above the box, whose lower end moves, and one that is too long for what holds it."""
TOP, END, HELD, HELD_TOO = range(16, 20)
POINTS = [*PLACES, [2.0, 0.0, 1.0], [2.0, 0.0, 0.2], [3.0, 0.0, 0.0], [3.5, 0.0, 0.0]]
LINES = [*GRID, [TOP, END], [HELD, HELD_TOO]]
LENGTHS = [*[SIDE / (1.0 + STRAIN)] * len(GRID), 0.8 / (1.0 + STRAIN), 0.6]
TIED = 0.5 * 100.0 * 1e-4 * LENGTHS[TAIL]
"""Mass of half of the line above the box [kg]."""
RADIUS, BALL, BOX = 0.12, np.array([0.23, 0.24, -0.125]), np.array([2.0, 0.0, 0.0])
SIDES, BOX_MASS, BALL_MASS = [0.2, 0.2, 0.2], 1.0, 0.3
MOMENT = BOX_MASS * 0.2**2 / 6.0
SPIN = (1.0, 2.0, 3.0)

MORE = {
    "gravity": {"gravity": {"acceleration": [0.5, -1.0, -9.81]}},
    "load": {"load": [{"node": 5, "force": [0.0, 0.0, 3.0]}]},
    "motion": {
        "motion": [
            {"node": 1, "displacement": [[0.0, 0.0, 0.0, 0.0], [DURATION, 0.0, 0.0, 0.02]]},
            {"body": "door", "rotation": [[0.0, 0.0, 0.0, 0.0], [DURATION, 0.0, 0.0, 0.3]]},
        ],
        "body": [
            {
                "name": "door",
                "shape": "box",
                "size": SIDES,
                "position": [2.0, 2.0, 0.0],
                "axle": {"direction": [0.0, 0.0, 1.0]},
            }
        ],
    },
    "point_mass": {"point_mass": [{"node": 6, "mass": 0.05}]},
    "velocity": {"velocity": [{"node": 10, "value": [0.0, 0.0, 1.0]}]},
    "body": {"body": [{"name": "third", "radius": 0.1, "fixed": True, "position": [2.0, 2.0, 0.0]}]},
    "contact": {"contact": LAW},
    "self_contact": {"self_contact": {"radius": 1e-3, "stiffness": 1e3}},
    "attach": {"attach": [{"body": "box", "node": END}]},
    "link": {"link": [{"nodes": [5, 6]}]},
    "thread": {
        "thread": [
            {"name": "rope", "nodes": [5, 6, 10, 9], "closed": True, "modulus": 1e6, "area": 1e-5, "density": 100.0},
        ],
    },
    "winch": {
        "thread": [{"name": "rope", "nodes": [5, 6, 10, 9], "modulus": 1e6, "area": 1e-5, "density": 100.0}],
        "winch": [{"thread": "rope", "end": "last", "speed": 0.0}],
    },
    "frame": {"frame": {"angular_velocity": [0.1, 0.2, 1.0]}},
    "orbit": {"orbit": {"mean_motion": 0.5}},
    "pressure": {"pressure": [{"lines": [8, 9], "normal": [0.0, 0.0, 1.0], "value": 3.0}]},
    "thrust": {"thrust": [{"node": 10, "line": 22, "force": 2.0}]},
    "damping": {"damping": {"time": 1e-4, "rate": 2.0}},
    "drag": {"drag": {"density": 5.0, "bodies": {"box": {"coefficient": 1.0, "area": 0.04}}}},
    "bending": {"bending": {"stiffness": 1e-3}},
    "reel": {"reel": [{"lines": [TAIL, SLACK], "factor": [[0.0, 1.0], [DURATION, 0.99]]}]},
    "temperature": {"temperature": {"expansion": 1e-4, "change": [[0.0, 0.0], [DURATION, -20.0]]}},
    "rupture": {"rupture": {"at": [[18, 0.005]]}},
    "fold": {"fold": {"kind": "positions", "file": "folded.csv"}},
}
"""What each effect adds to the scene."""
ROPE = 1e6 * 1e-5
"""EA of the thread [N]."""
METHODS = {
    "static": {"kind": "static"},
    "central-difference": {"kind": "dynamic", "duration": DURATION},
    "cvode": {"kind": "dynamic", "duration": DURATION, "method": "cvode", "rtol": 1e-4},
    "ida": {"kind": "dynamic", "duration": DURATION, "method": "ida", "rtol": 1e-4},
}
REFUSED = {
    **{("link", method): "needs .*ida" for method in ("static", "central-difference", "cvode")},
    ("velocity", "static"): "a velocity cannot be used in statics",
    ("drag", "static"): "is not a free body",
    ("rupture", "static"): "would break",
    ("fold", "static"): "a start that is folded cannot be used in statics",
}
"""What is refused, with words of the reason."""
RUNS = [pair for pair in itertools.product(MORE, METHODS) if pair not in REFUSED]
KINDS = [quantity for quantity in OBSERVABLES if quantity.endswith("_energy")]
CORNERS = [0, 3, 15, 12]
LOOKED_AT = {
    "displacement": [{}, {"node": 5, "component": 2}, {"component": 2, "select": "abs"}],
    "position": [{"node": 10, "component": 2}, {"body": "ball", "component": 0}, {"component": 2, "select": "min"}],
    "velocity": [{}, {"body": "ball"}, {"body": ["ball", "box"], "select": "min"}],
    "reaction": [
        *({"body": "ball", "component": k} for k in range(3)),
        {"body": "box"},
        {"node": 0},
        {"select": "max"},
    ],
    **{quantity: [{"body": "door"}] for quantity in ("support_force", "support_moment", "axle_angle")},
    "orientation": [{"body": "box"}],
    "angular_velocity": [*({"body": "ball", "component": k} for k in range(3)), {"body": "box"}],
    "angular_momentum": [{"body": "box"}],
    "total_angular_momentum": [{"body": "box"}],
    "distance": [{"body": "ball", "to": "box"}],
    "mouth_area": [{"node": CORNERS}],
    "mouth_perimeter": [{"node": CORNERS}],
    "tension": [{}, {"select": "min"}],
    "stress": [{}],
    "strain": [{}, {"select": "min"}, {"line": [3, 20], "select": "abs"}],
    "length": [{"thread": "rope"}],
    "slip": [{"thread": "rope", "ring": 9}],
    **{quantity: [{}] for quantity in KINDS},
    "work": [{}],
    "overlap": [{"body": "ball"}, {"body": "box"}],
    "slack_fraction": [{}],
    "step_size": [{}],
    **{quantity: [] for quantity in ("fuel", "delta_v")},
}
"""Where each observable is looked at; those of a control in ``dynamics/test_control.py``."""
EVENTS = [
    {"name": "any", "kind": "contact"},
    {"name": "ball", "kind": "contact", "body": "ball", "with": "web"},
    {"name": "box", "kind": "contact", "body": "box"},
    {"name": "taut", "kind": "taut", "line": SLACK},
    {"name": "pushed", "kind": "threshold", "observe": "reaction 3", "value": 1e-9},
    {"name": "deep", "kind": "threshold", "observe": "overlap 0", "value": 5e-4},
]
MEETING = [{"name": "each other", "kind": "contact", "body": "ball", "with": "box"}]


def test_no_effect_and_no_observable_is_missing():
    assert MORE.keys() == EFFECTS.keys() and LOOKED_AT.keys() == OBSERVABLES.keys()


def asked(system):
    """Observables with names of their own that a system does not refuse, by name."""
    found = {}
    for quantity, places in LOOKED_AT.items():
        for n, place in enumerate(places):
            one = refweb.Observe(name=f"{quantity} {n}", quantity=quantity, **place)
            try:
                one.on(system)
            except refweb.InputError:
                continue
            found[one.name] = one
    return found


def scene_of(effect, method, folder):
    """The scene, with all that may be asked of it."""
    static, fold = method == "static", effect == "fold"
    held = [] if fold else [*RIM, TOP, HELD, HELD_TOO, *([] if effect == "attach" else [END])]
    flying = {"fixed": True} if static else {"mass": BALL_MASS, "velocity": [0.3, 0.1, 2.0]}
    ball = {"name": "ball", "radius": RADIUS, "position": (BALL + [0.0, 0.0, 0.02 * static]).tolist(), **flying}
    flying = {"fixed": True} if static else {"mass": BOX_MASS, "velocity": [0.1, 0, 0], "angular_velocity": list(SPIN)}
    box = {"name": "box", "shape": "box", "size": SIDES, "rounding": 1e-6, "position": BOX.tolist(), **flying}
    web = {"kind": "inline", "points": POINTS, "lines": LINES, "supports": held, "natural_length": LENGTHS}
    own = {"stiffness": STIFFNESS} | ({"between_bodies": True} if effect == "contact" and not static else {})
    cable = {"law": "tension-only", "modulus": 1e7, "area": 1e-4, "density": 100.0}
    given = dict(web=web, cable=cable, body=[ball, box], contact=own, solve=METHODS[method])
    for table, more in MORE[effect].items():
        if table == "body":
            given["body"] = [*given["body"], *more]
        else:
            given[table] = {**given.get(table, {}), **more} if isinstance(more, dict) else more
    if fold:
        middle = np.mean(PLACES, axis=0)
        folded = [*(middle + 0.9 * (np.array(PLACES) - middle)), *np.array(POINTS[16:]) * [1.0, 1.0, 0.9]]
        np.savetxt(folder / "folded.csv", folded, delimiter=",", header="x,y,z", comments="")
        given["fold"] = {"kind": "positions", "file": str(folder / "folded.csv")}
    if not static:
        given |= {"output": {"interval": DURATION / 5, "frames": 1}, "accuracy": {"error": "none"}}
        given["event"] = EVENTS + (MEETING if effect == "contact" else [])
    looked = [{"name": name, "quantity": name[:-2]} for name in ("reaction 3", "overlap 0")]
    looked[0] |= {"body": "box"}
    looked[1] |= {"body": "ball"}
    plain = refweb.Scene.from_dict(given | {"observe": looked})
    return plain.replace(observe=tuple(asked(plain.build()).values()))


class Frame:
    """A frame as its files have it, and what follows from it by the law.

    Parameters
    ----------
    folder : pathlib.Path
        The result folder.
    number : int
        Number of the frame.
    losing : bool
        Whether contact damps and rubs.
    spin : ndarray, shape (3,)
        Angular velocity of the ball [rad/s], which its files do not have.
    """

    def __init__(self, folder, number, losing=False, spin=(0.0, 0.0, 0.0)):
        web = meshio.read(folder / "frames" / f"web_{number:06d}.vtu")
        self.x, self.u, self.v = web.points, web.point_data["displacement"], web.point_data["velocity"]
        self.mass, self.reaction = web.point_data["mass"].ravel(), web.point_data["reaction"]
        cells = {name: values[0].ravel()[: len(LINES)] for name, values in web.cell_data.items()}
        self.tail, self.head = np.array(LINES).T
        self.way = self.x[self.head] - self.x[self.tail]
        self.length, self.natural = np.linalg.norm(self.way, axis=1), cells["natural_length"]
        whole = 1.0 - cells.get("broken", np.zeros(len(LINES)))
        self.strain = whole * (self.length / self.natural - 1.0)
        self.tension = whole * EA * np.maximum(self.strain, 0.0)
        self.pull, self.energy = cells["tension"], 0.5 * (self.tension * np.maximum(self.strain, 0.0) * self.natural)
        self.rope, self.stretched = 0.0, 0.0
        for i, j in np.vstack([block.data for block in web.cells])[len(LINES) :]:
            self.rope += np.linalg.norm(self.x[j] - self.x[i])
            self.stretched += np.linalg.norm(self.x[j] - self.x[i]) - np.linalg.norm(np.subtract(POINTS[j], POINTS[i]))
        self.ball, self.box = (meshio.read(folder / "frames" / f"{name}_{number:06d}.vtu") for name in ("ball", "box"))
        self.places, self.speeds = [self.ball.points.mean(axis=0)], [self.ball.point_data["velocity"].mean(axis=0)]
        self.follow_box()
        self.depth, self.push = np.zeros(len(LINES)), np.zeros(3)
        for line in range(len(LINES)):
            self.touch(line, losing, np.array(spin))

    def follow_box(self):
        """How the box lies and moves, by the points of its surface, which are known before it has moved."""
        points, velocities = self.box.points, self.box.point_data["velocity"]
        start = points - self.box.point_data["displacement"] - BOX
        left, _, right = np.linalg.svd((start - start.mean(axis=0)).T @ (points - points.mean(axis=0)))
        self.turn = (left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right).T
        self.places.append((points - start @ self.turn.T).mean(axis=0))
        arms = points - self.places[1]
        matrix = np.vstack([np.hstack([np.eye(3), np.cross(np.eye(3), arm).T]) for arm in arms])  # of v + ω × arm
        found = np.linalg.lstsq(matrix, velocities.ravel(), rcond=None)[0]
        self.speeds.append(found[:3])
        self.turning = found[3:]

    def touch(self, line, losing, spin):
        """Contact of a line with the ball: a sphere touches it once, where it is nearest to its centre."""
        a, b = self.tail[line], self.head[line]
        place = np.clip((self.places[0] - self.x[a]) @ self.way[line] / self.length[line] ** 2, 0.0, 1.0)
        away = self.x[a] + place * self.way[line] - self.places[0]
        self.depth[line] = max(RADIUS - np.linalg.norm(away), 0.0)
        normal, push = away / np.linalg.norm(away), STIFFNESS * self.depth[line]
        if losing:
            slip = (1.0 - place) * self.v[a] + place * self.v[b] - self.speeds[0] - np.cross(spin, away)
            rate = normal @ slip
            slip = slip - rate * normal
            push *= 1.0 + max(-LAW["damping"] * rate, -1.0)
            slow = np.sqrt(slip @ slip + LAW["slip_velocity"] ** 2)
            self.push += LAW["friction"] * push * slip / slow
        self.push -= push * normal

    def moving(self, spin):
        """Kinetic energy [J], of a solid ball and a solid box."""
        motion = 0.5 * (self.mass * (self.v**2).sum(axis=1)).sum()
        motion += 0.5 * BALL_MASS * self.speeds[0] @ self.speeds[0] + 0.5 * BOX_MASS * self.speeds[1] @ self.speeds[1]
        return motion + 0.5 * MOMENT * self.turning @ self.turning + 0.2 * BALL_MASS * RADIUS**2 * spin @ spin

    @property
    def rope_energy(self):
        """Strain energy of the thread [J]."""
        return 0.5 * ROPE * max(self.stretched, 0.0) ** 2 / (self.rope - self.stretched) if self.rope else 0.0

    @property
    def angle(self):
        """By which the box has turned [rad]."""
        turn = self.turn
        skew = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
        return np.arctan2(np.linalg.norm(skew), np.trace(turn) - 1.0)


def numbers(frame, spin, effect, static):
    """What observables should be, by name, where the files tell."""
    sizes = lambda vectors: np.linalg.norm(vectors, axis=1).max()  # noqa: E731
    mouth = frame.x[CORNERS]
    area = 0.5 * np.cross(mouth - mouth[0], np.roll(mouth, -1, axis=0) - mouth[0]).sum(axis=0)
    pull = frame.pull if effect == "damping" else frame.tension
    places, speeds = list(frame.places), list(frame.speeds)
    if effect == "attach" and not static:  # the box is where the centre of mass of it and of half of its line is
        share = TIED / (BOX_MASS + TIED)
        places[1], speeds[1] = (
            (1.0 - share) * of_box + share * of_node
            for of_box, of_node in ((places[1], frame.x[END]), (speeds[1], frame.v[END]))
        )
    found = {
        "displacement 0": sizes(frame.u),
        "winch_energy 0": 0.0,
        "displacement 1": frame.x[5, 2] - POINTS[5][2],
        "position 0": frame.x[10, 2],
        "position 1": frame.places[0][0],
        "velocity 0": sizes(frame.v),
        "displacement 2": np.abs(frame.u[:, 2]).max(),
        "position 2": frame.x[:, 2].min(),
        "velocity 1": np.linalg.norm(frame.speeds[0]),
        "velocity 2": min(np.linalg.norm(speeds[0]), np.linalg.norm(speeds[1])),
        "reaction 5": sizes(frame.reaction),
        **{f"reaction {k}": frame.push[k] for k in range(3)},
        "reaction 3": 0.0,
        "distance 0": np.linalg.norm(places[1] - places[0]),
        "mouth_area 0": np.linalg.norm(area),
        "mouth_perimeter 0": np.linalg.norm(mouth - np.roll(mouth, -1, axis=0), axis=1).sum(),
        "tension 0": pull.max(),
        "tension 1": pull.min(),
        "stress 0": pull.max() / 1e-4,
        "strain 0": frame.strain.max(),
        "strain 1": frame.strain.min(),
        "strain 2": np.abs(frame.strain[[3, 20]]).max(),
        "strain_energy 0": frame.energy.sum() + frame.rope_energy,
        "length 0": frame.rope,
        "contact_energy 0": 0.5 * STIFFNESS * (frame.depth**2).sum(),
        "self_contact_energy 0": 0.0,
        "body_contact_energy 0": 0.0,
        "overlap 0": frame.depth.max(),
        "overlap 1": 0.0,
        "slack_fraction 0": (frame.strain <= 0.0).mean(),
        **{f"angular_velocity {k}": spin[k] for k in range(3)},
    }
    held = -sum(
        side * pull[line] * frame.way[line] / frame.length[line]
        for line in range(len(LINES))
        for side, node in ((1.0, frame.tail[line]), (-1.0, frame.head[line]))
        if node == 0
    )
    if effect == "gravity":
        acceleration = np.array(MORE["gravity"]["gravity"]["acceleration"])
        held = held - frame.mass[0] * acceleration
        moved = frame.mass @ frame.u
        if not static:
            moved = moved + BALL_MASS * (frame.places[0] - BALL) + BOX_MASS * (frame.places[1] - BOX)
        found["potential_energy 0"] = -acceleration @ moved
    if effect == "motion":  # nothing touches the door
        found |= {"support_force 0": 0.0, "support_moment 0": 0.0, "axle_angle 0": 0.3}
    if effect == "fold":
        held = np.zeros(3)
    bent = effect == "bending"  # its springs push on supports as well
    found["reaction 4"] = np.linalg.norm(frame.reaction[0] if bent else held)
    found["orientation 0"] = frame.angle
    if not static:
        found["angular_velocity 3"] = np.linalg.norm(frame.turning)
        found["angular_momentum 0"] = MOMENT * np.linalg.norm(frame.turning)
        found["kinetic_energy 0"] = frame.moving(spin)
        mass = np.array([BALL_MASS, BOX_MASS, *frame.mass])
        place, speed = np.vstack([*frame.places, *frame.x]), np.vstack([*frame.speeds, *frame.v])
        place, speed = (place[1] - mass @ place / mass.sum()), (speed[1] - mass @ speed / mass.sum())
        turning = np.cross(place, BOX_MASS * speed) + MOMENT * frame.turning
        found["total_angular_momentum 0"] = np.linalg.norm(turning)
    return found


BALANCED = {"dissipated_energy", "work", "rupture_energy", "frame_energy", "orbit_energy", "bending_energy"}
"""Depend on the way, or on more than files have: together they are what the files' energies have gained."""
STORED = ("frame_energy 0", "orbit_energy 0", "bending_energy 0")
TURN = itertools.cycle(("static", "central-difference", "cvode", "static", "central-difference", "ida"))
CUT = [
    (effect, method if (effect, method) not in REFUSED else "ida") for effect, method in zip(MORE, TURN, strict=False)
]
"""Each effect by one method, in turn; less often by those that take a second a run."""
ALL = [pytest.param(*pair, marks=[] if pair in CUT else pytest.mark.slow) for pair in RUNS]


@pytest.mark.parametrize("effect, method", ALL)
def test_every_number_is_that_of_the_files(effect, method, tmp_path):
    """To rounding; with losses, which explicit kicks solve for at another share of a step, to a hundredth."""
    static, losing = method == "static", effect == "contact"
    solution = refweb.run(scene_of(effect, method, tmp_path), out=tmp_path / "run", progress=False)
    results = {name: result.value for name, result in solution.results.items()}
    spin = np.array([results.get(f"angular_velocity {k}", 0.0) for k in range(3)])
    files = sorted(int(path.stem.rpartition("_")[2]) for path in (tmp_path / "run" / "frames").glob("web_*.vtu"))
    frames = [Frame(tmp_path / "run", n, losing and not static, spin) for n in files]
    expected, held = numbers(frames[-1], spin, effect, static), ()
    if effect == "attach":  # mass and moments of the box are those with what it holds
        held = "angular_momentum 0", "kinetic_energy 0", "total_angular_momentum 0"
    others = {*held, "total_energy 0", "step_size 0", *(f"{quantity} 0" for quantity in BALANCED)}
    assert results.keys() - others <= expected.keys()
    for name in results.keys() - others:
        within = 1e-9 * max(abs(expected[name]), 10.0 if name.startswith("reaction") else 1e-3)
        if losing and method == "central-difference" and name in ("reaction 0", "reaction 1", "reaction 2"):
            within = 0.01 * np.linalg.norm(frames[-1].push)
        assert abs(results[name] - expected[name]) <= within, (name, results[name], expected[name])
    if not static:
        check_energies(solution, results, frames, effect, spin)
        check_events(solution, frames)


def check_energies(solution, results, frames, effect, spin):
    """What the files' energies have gained is what came in, less what is lost and stored otherwise."""
    history, ends = solution.history, []
    for frame, row, own in ((frames[0], 0, np.zeros(3)), (frames[-1], -1, spin)):
        found = numbers(frame, own, effect, False)
        names = "strain_energy 0", "contact_energy 0", "potential_energy 0", "kinetic_energy 0"
        energy = sum(found.get(name, 0.0) for name in names)
        if effect == "attach":
            energy += history["kinetic_energy 0"][row] - found["kinetic_energy 0"]
        ends.append(energy + sum(history[name][row] for name in STORED if name in history))
    assert abs(results["total_energy 0"] - ends[1]) <= 1e-9 * ends[1] or effect == "rupture"
    signs = {"work 0": 1.0, "dissipated_energy 0": -1.0, "rupture_energy 0": -1.0}
    came = sum(sign * (history[name][-1] - history[name][0]) for name, sign in signs.items() if name in history)
    assert abs(ends[1] - ends[0] - came) <= 0.01 * max(ends)
    assert 0.0 < results["step_size 0"] <= DURATION / 5.0


def check_events(solution, frames):
    """No event without what it says, and none too late."""
    found, times = {one["name"]: one["time"] for one in solution.events}, solution.history["time"]
    assert found["box"] is None and found["pushed"] is None and found.get("each other") is None
    assert found["any"] == found["ball"]
    assert found["taut"] is None and all(frame.strain[SLACK] < -0.1 for frame in frames)
    for name, least in (("ball", 0.0), ("deep", 5e-4)):
        at = np.inf if found[name] is None else found[name]
        deep = [frame.depth.max() > least for frame in frames]
        assert not any(one for one, time in zip(deep, times, strict=True) if time < at)
        assert np.isinf(at) == (solution.bodies["ball"]["overlap"] <= least)


@pytest.mark.parametrize("effect, method", REFUSED)
def test_what_is_refused(effect, method, tmp_path):
    with pytest.raises((refweb.InputError, refweb.SolverError), match=REFUSED[effect, method]):
        refweb.run(scene_of(effect, method, tmp_path), progress=False)
