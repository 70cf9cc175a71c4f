"""Tables of names: what a scene or the command line may call for, and where it lives.

A line is a name and the ``"module:name"`` that brings it, or the ``"module"`` that it is; it is imported when it is
called for and not before. Scene files, checks, messages and help know all lines of a table; nothing else needs to be
changed.
"""

from __future__ import annotations

import importlib
from typing import Any, NamedTuple

WEBS = {
    "paper": "refweb.net.lattices:Paper",
    "window": "refweb.net.lattices:Window",
    "layers": "refweb.net.lattices:Layers",
    "cable": "refweb.net.single_cable:SingleCable",
    "inline": "refweb.net.inline:Inline",
    "file": "refweb.net.mesh_file:File",
}
"""Kinds of ``[web]``."""
EFFECTS = {
    "gravity": "refweb.effects.gravity:Gravity",
    "load": "refweb.effects.load:Load",
    "motion": "refweb.effects.motion:Motion",
    "point_mass": "refweb.effects.point_mass:PointMass",
    "velocity": "refweb.effects.velocity:Velocity",
    "body": "refweb.effects.body:Body",
    "contact": "refweb.effects.contact.table:Contact",
    "self_contact": "refweb.effects.self_contact.table:SelfContact",
    "attach": "refweb.effects.attach:Attach",
    "link": "refweb.effects.link:Link",
    "frame": "refweb.effects.frame:Frame",
    "orbit": "refweb.effects.orbit:Orbit",
    "pressure": "refweb.effects.pressure:Pressure",
    "thrust": "refweb.effects.thrust:Thrust",
    "damping": "refweb.effects.damping:Damping",
    "drag": "refweb.effects.drag.table:Drag",
    "bending": "refweb.effects.bending:Bending",
    "reel": "refweb.effects.reel:Reel",
    "temperature": "refweb.effects.temperature:Temperature",
    "rupture": "refweb.effects.rupture:Rupture",
    "fold": "refweb.effects.fold:Fold",
}
"""Effects by the name of their table."""
FACTORIZATIONS = ("qdldl", "superlu", "rslab")
"""Libraries that factorize symmetric matrices."""
SOLVES = {"static": "refweb.settings:Static", "dynamic": "refweb.settings:Dynamic"}
"""Kinds of ``[solve]``."""
PARTS = {
    "cable": "refweb.net.cable:Cable",
    "supports": "refweb.settings:Supports",
    "output": "refweb.settings:Output",
    "accuracy": "refweb.settings:Accuracy",
    "throw": "refweb.results.throw:Throw",
}
"""Tables of a scene besides webs, effects and ``[solve]`` that stand once."""
LISTS = {
    "support": "refweb.settings:Supports",
    "observe": "refweb.results.observables.observe:Observe",
    "event": "refweb.settings:Event",
}
"""Those that may stand several times."""
STUDY = "refweb.sweeps.study:Study"
"""Class of a file for ``refweb sweep``."""
OBSERVABLES = {
    "displacement": "refweb.results.observables.nodal:Displacement",
    "position": "refweb.results.observables.nodal:Position",
    "velocity": "refweb.results.observables.nodal:Velocity",
    "reaction": "refweb.results.observables.reaction:Reaction",
    "orientation": "refweb.results.observables.rotation:Orientation",
    "angular_velocity": "refweb.results.observables.rotation:AngularVelocity",
    "angular_momentum": "refweb.results.observables.rotation:AngularMomentum",
    "total_angular_momentum": "refweb.results.observables.angular_momentum:TotalAngularMomentum",
    "distance": "refweb.results.observables.distances:Distance",
    "mouth_area": "refweb.results.observables.distances:MouthArea",
    "mouth_perimeter": "refweb.results.observables.distances:MouthPerimeter",
    "tension": "refweb.results.observables.line:Tension",
    "stress": "refweb.results.observables.line:Stress",
    "strain": "refweb.results.observables.line:Strain",
    "kinetic_energy": "refweb.results.observables.balances:KineticEnergy",
    "strain_energy": "refweb.results.observables.balances:StrainEnergy",
    "potential_energy": "refweb.results.observables.balances:PotentialEnergy",
    "contact_energy": "refweb.results.observables.balances:ContactEnergy",
    "body_contact_energy": "refweb.results.observables.balances:BodyContactEnergy",
    "self_contact_energy": "refweb.results.observables.balances:SelfContactEnergy",
    "bending_energy": "refweb.results.observables.balances:BendingEnergy",
    "frame_energy": "refweb.results.observables.balances:FrameEnergy",
    "orbit_energy": "refweb.results.observables.balances:OrbitEnergy",
    "rupture_energy": "refweb.results.observables.balances:RuptureEnergy",
    "dissipated_energy": "refweb.results.observables.balances:DissipatedEnergy",
    "total_energy": "refweb.results.observables.balances:TotalEnergy",
    "work": "refweb.results.observables.balances:Work",
    "overlap": "refweb.results.observables.overlap:Overlap",
    "slack_fraction": "refweb.results.observables.slack_fraction:SlackFraction",
    "step_size": "refweb.results.observables.balances:StepSize",
}
"""Quantities of ``[[observe]]``."""

SHAPES = {
    "sphere": "refweb.net.shapes.sphere:Sphere",
    "ring": "refweb.net.shapes.ring:Ring",
    "box": "refweb.net.shapes.box:Box",
    "cylinder": "refweb.net.shapes.cylinder:Cylinder",
    "capsule": "refweb.net.shapes.capsule:Capsule",
    "mesh": "refweb.net.shapes.mesh:Mesh",
    "plane": "refweb.net.shapes.plane:Plane",
    "terrain": "refweb.net.shapes.terrain:Terrain",
}
"""Shapes of ``[[body]]``; how to write one says `refweb.net.rigid_body`."""


class Method(NamedTuple):
    """A method of dynamics: where its integrator lives, and the keys of ``[solve]`` that mean something to it.

    The first key is its knob: what trades accuracy for time.
    """

    integrator: str
    keys: tuple

    @property
    def knob(self):
        """Name of the key that trades accuracy for time."""
        return self.keys[0]

    def integrator_of(self, solve, system, *looked_at, **keys):
        """Its integrator with those of its keys that a `refweb.Dynamic` gives, or with others in their place.

        ``looked_at`` are probes, sums and events, see `refweb.dynamics.integrators.integrator.Integrator`.
        """
        given = {key: value for key in self.keys if (value := getattr(solve, key)) is not None}

        def make(system, *looked_at):
            return load(self.integrator)(system, *looked_at, **(given | keys))

        if system.weakness is None:
            return make(system, *looked_at)
        return load("refweb.dynamics.integrators.rupture:Rupturing")(make, system, *looked_at)


_STEPS, _TOLERANCES = ("safety", "step_size"), ("rtol", "atol_position", "atol_velocity")
INTEGRATORS = {
    "central-difference": Method("refweb.dynamics.integrators.central_difference:CentralDifference", _STEPS),
    "explicit": Method("refweb.dynamics.integrators.splitting:Splitting", (*_STEPS, "order")),
    "cvode": Method("refweb.dynamics.integrators.cvode:Cvode", (*_TOLERANCES, "family", "max_order", "linear_solver")),
    "ida": Method("refweb.dynamics.integrators.ida:Ida", (*_TOLERANCES, "max_order", "linear_solver")),
}
"""Methods of dynamics."""
STATICS = {
    "newton": "refweb.statics.load_steps:solve",
    "relaxation": "refweb.statics.dynamic_relaxation:solve",
}
"""Methods of statics: functions of a system, load steps and progress that yield an equilibrium at each."""
COMMANDS = {
    "run": "refweb.commands.run",
    "resume": "refweb.commands.resume",
    "check": "refweb.commands.check",
    "list": "refweb.commands.list",
    "new": "refweb.commands.new",
    "help": "refweb.commands.help",
    "schema": "refweb.commands.schema",
    "info": "refweb.commands.info",
    "compare": "refweb.commands.compare",
    "picture": "refweb.commands.picture",
    "plot": "refweb.commands.plot",
    "report": "refweb.commands.report",
    "view": "refweb.commands.view",
    "modes": "refweb.commands.modes",
    "cost": "refweb.commands.cost",
    "trust": "refweb.commands.trust",
    "sweep": "refweb.commands.sweep",
    "warm": "refweb.commands.warm",
}
"""Verbs of the command line, in the order of its help."""
EXPORTS = (
    "refweb.runner:run",
    "refweb.runner:resume",
    "refweb.solution:load",
    "refweb.pictures.pictures:picture",
    "refweb.studies.modes:modes",
    "refweb.studies.modes:Modes",
    "refweb.studies.work_precision:cost",
    "refweb.runner:trust",
    "refweb.studies.cost:Cost",
    "refweb.sweeps.sweep:sweep",
    "refweb.sweeps.study_result:Sweep",
    STUDY,
    "refweb.scene:Scene",
    "refweb.settings:Static",
    "refweb.settings:Dynamic",
    "refweb.settings:Supports",
    "refweb.settings:Output",
    "refweb.settings:Accuracy",
    "refweb.settings:Event",
    "refweb.results.throw:Throw",
    "refweb.results.observables.observe:Observe",
    "refweb.solution:Solution",
    "refweb.net.cable:Cable",
    "refweb.net.cable:Group",
    "refweb.net.tension_laws:Law",
    "refweb.net.web:Web",
    "refweb.errors:InputError",
    "refweb.errors:SolverError",
)
"""Names that ``refweb.NAME`` offers besides webs and effects."""


def exports():
    """Modules of the names of the package: classes of webs and effects, and `EXPORTS`."""
    return {reference.split(":")[1]: reference for reference in (*EXPORTS, *WEBS.values(), *EFFECTS.values())}


def load(reference) -> Any:
    """Object that a ``"module:name"`` or a ``"module"`` stands for."""
    module, _, name = reference.partition(":")
    loaded = importlib.import_module(module)
    return getattr(loaded, name) if name else loaded


def name_of(table, value):
    """Name under which the class of a value stands in a table, None where it is not in it."""
    own_reference = f"{type(value).__module__}:{type(value).__qualname__}"
    return next((name for name, reference in table.items() if reference == own_reference), None)


FILES = {"web": ("path", "lines"), "body": ("file", "heights"), "fold": ("file",)}
"""Keys of tables of a scene that are paths of files."""


def with_files(given, change, tables=tuple(FILES)):
    """A copy of the dict of a scene with ``folder(path)`` for each path of a file in some tables."""

    def placed(table, keys):
        if not isinstance(table, dict):
            return table
        return {k: change(value) if k in keys and isinstance(value, str) else value for k, value in table.items()}

    given, changed = with_fold(given), {}
    for name in tables:
        if isinstance(values := given.get(name), list):
            changed[name] = [placed(entry, FILES[name]) for entry in values]
        elif isinstance(values, dict):
            changed[name] = placed(values, FILES[name])
    return {**given, **changed}


def with_fold(given):
    """The dict of a scene in which what ``[web]`` says of a fold, ``fold`` or ``positions``, is the table of a fold."""
    web = given.get("web")
    said = [key for key in ("fold", "positions") if isinstance(web, dict) and key in web]
    if not said:
        return given
    if "fold" in given or len(said) > 1:
        from .errors import InputError

        raise InputError(f"[web] {said[0]}: the web is folded twice, leave one out")
    fold = {"kind": "positions", "file": web["positions"]} if said == ["positions"] else web["fold"]
    rest = {key: value for key, value in web.items() if key not in said}
    return {**given, "web": rest, "fold": fold if isinstance(fold, dict) else {"kind": fold}}


def paths_of(given):
    """Paths of the files that the dict of a scene names."""
    paths = []
    with_files(given, paths.append)
    return paths
