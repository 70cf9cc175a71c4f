"""Tables of names: what a scene or the command line may call for, and where it lives.

A line is a name and the ``"module:name"`` that brings it, or the ``"module"`` that it is; it is imported when it is
called for and not before. Scene files, checks, messages and help know all that is in a table.

Other packages, scripts and notebooks add to the tables of `KINDS` by `register`. An installed package does so by an
entry point of the groups ``refweb.effects``, ``refweb.shapes``, ``refweb.laws``, ``refweb.observables``,
``refweb.integrators`` and ``refweb.verbs``. Entry points are read when a scene, or the command line, names what no
table has, and for help.

May change: private functions. Must stay: names in these tables, the format of scenes and of the command line; no module
of refweb is imported at the head. A class that moves needs its new ``"module:name"`` here; a further effect, shape,
law, observable, integrator or verb is one line. `LINE_COLUMNS` has the names that no parameter of a law may take: a new
column of lines belongs there. Must stay as well: all names that `scene`, `reference.pages` and other files import;
public names of `Method`, which other files use. Tests: ``tests/test_plugins.py``,
``tests/test_pay_for_what_you_call.py``, ``tests/reference/test_schema.py``.
"""

from __future__ import annotations

import functools
import importlib
import re
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from importlib.metadata import EntryPoint

    from .settings import Dynamic
    from .system.system import System

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
    "thread": "refweb.effects.thread:Thread",
    "frame": "refweb.effects.frame:Frame",
    "orbit": "refweb.effects.orbit:Orbit",
    "pressure": "refweb.effects.pressure:Pressure",
    "thrust": "refweb.effects.thrust:Thrust",
    "damping": "refweb.effects.damping:Damping",
    "drag": "refweb.effects.drag.table:Drag",
    "bending": "refweb.effects.bending:Bending",
    "reel": "refweb.effects.reel:Reel",
    "winch": "refweb.effects.winch:Winch",
    "temperature": "refweb.effects.temperature:Temperature",
    "rupture": "refweb.effects.rupture:Rupture",
    "fold": "refweb.effects.fold:Fold",
}
"""Effects by the name of their table."""
FACTORIZATIONS = ("qdldl", "supernodal", "superlu", "multifrontal", "rslab")
"""Libraries that factorize symmetric matrices."""
SOLVES = {"static": "refweb.settings:Static", "dynamic": "refweb.settings:Dynamic"}
"""Kinds of ``[solve]``."""
PARTS = {
    "cable": "refweb.net.cable:Cable",
    "supports": "refweb.settings:Supports",
    "output": "refweb.settings:Output",
    "accuracy": "refweb.settings:Accuracy",
    "throw": "refweb.results.throw:Throw",
    "gym": "refweb.sweeps.episodes:Gym",
}
"""Tables of a scene besides webs, effects and ``[solve]`` that stand once."""
LISTS = {
    "support": "refweb.settings:Supports",
    "observe": "refweb.results.observables.observe:Observe",
    "event": "refweb.settings:Event",
    "control": "refweb.settings:Control",
}
"""Those that may stand several times."""
STUDY = "refweb.sweeps.study:Study"
"""Class of a file for ``refweb sweep``."""
SIZING = "refweb.sizing.requirements:Sizing"
"""Class of a file for ``refweb size``."""
OBSERVABLES = {
    "displacement": "refweb.results.observables.nodal:Displacement",
    "position": "refweb.results.observables.nodal:Position",
    "velocity": "refweb.results.observables.nodal:Velocity",
    "reaction": "refweb.results.observables.reaction:Reaction",
    "support_force": "refweb.results.observables.support:SupportForce",
    "support_moment": "refweb.results.observables.support:SupportMoment",
    "axle_angle": "refweb.results.observables.support:AxleAngle",
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
    "length": "refweb.results.observables.thread:Length",
    "slip": "refweb.results.observables.thread:Slip",
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
    "plastic_energy": "refweb.results.observables.balances:PlasticEnergy",
    "winch_energy": "refweb.results.observables.balances:WinchEnergy",
    "dissipated_energy": "refweb.results.observables.balances:DissipatedEnergy",
    "total_energy": "refweb.results.observables.balances:TotalEnergy",
    "work": "refweb.results.observables.balances:Work",
    "overlap": "refweb.results.observables.overlap:Overlap",
    "fuel": "refweb.results.observables.fuel:Fuel",
    "delta_v": "refweb.results.observables.fuel:DeltaV",
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
LAWS = {
    "smooth": "refweb.net.laws.smooth:Smooth",
    "tension-only": "refweb.net.laws.straight:TensionOnly",
    "linear": "refweb.net.laws.straight:Linear",
    "force-density": "refweb.net.laws.straight:ForceDensity",
    "constant-force": "refweb.net.laws.straight:ConstantForce",
    "table": "refweb.net.laws.curve:Table",
    "elastic-plastic": "refweb.net.laws.straight:ElasticPlastic",
}
"""Tension laws of lines; how to write one says `refweb.net.laws`."""


class Method(NamedTuple):
    """A method of dynamics: where its integrator lives, and the keys of ``[solve]`` that mean something to it.

    The first key is its knob: what trades accuracy for time.
    """

    integrator: str
    keys: tuple[Any, ...]

    @property
    def knob(self) -> str:
        """Name of the key that trades accuracy for time."""
        return self.keys[0]

    def integrator_of(self, solve: Dynamic, system: System, *looked_at: Any, **keys: Any) -> Any:
        """Make its integrator with the keys that a `refweb.Dynamic` gives; ``keys`` take their place.

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
    "gradient": "refweb.commands.gradient",
    "cost": "refweb.commands.cost",
    "trust": "refweb.commands.trust",
    "sweep": "refweb.commands.sweep",
    "size": "refweb.commands.size",
    "warm": "refweb.commands.warm",
}
"""Verbs of the command line, in the order of its help."""
EXPORTS = (
    "refweb.runner:run",
    "refweb.runner:resume",
    "refweb.dynamics.stepped_run:start",
    "refweb.solution:load",
    "refweb.pictures.pictures:picture",
    "refweb.studies.modes:modes",
    "refweb.studies.modes:Modes",
    "refweb.studies.form:form",
    "refweb.studies.work_precision:cost",
    "refweb.runner:trust",
    "refweb.studies.cost:Cost",
    "refweb.sweeps.sweep:sweep",
    "refweb.sweeps.study_result:Sweep",
    STUDY,
    "refweb.sizing.size:size",
    "refweb.sizing.size:Sized",
    SIZING,
    "refweb.scene:Scene",
    "refweb.settings:Static",
    "refweb.settings:Dynamic",
    "refweb.settings:Supports",
    "refweb.settings:Output",
    "refweb.settings:Accuracy",
    "refweb.settings:Event",
    "refweb.settings:Control",
    "refweb.results.throw:Throw",
    "refweb.sweeps.episodes:Gym",
    "refweb.results.observables.observe:Observe",
    "refweb.solution:Solution",
    "refweb.net.cable:Cable",
    "refweb.net.cable:Group",
    "refweb.net.cable:Viscous",
    "refweb.net.tension_laws:Law",
    "refweb.net.web:Web",
    "refweb.errors:InputError",
    "refweb.errors:SolverError",
    "refweb.registry:register",
)
"""Names that ``refweb.NAME`` offers besides webs and effects."""


def exports() -> dict[str, str]:
    """Modules of the names of the package: classes of webs and effects, and `EXPORTS`."""
    shipped = (*EXPORTS, *WEBS.values(), *EFFECTS.values())
    return {reference.split(":")[1]: reference for reference in shipped if isinstance(reference, str)}


def load(reference: Any) -> Any:
    """Object that a ``"module:name"`` or a ``"module"`` stands for; what is registered stands for itself."""
    if not isinstance(reference, str):
        return reference
    module, _, name = reference.partition(":")
    loaded = importlib.import_module(module)
    return getattr(loaded, name) if name else loaded


def name_of(table: dict[str, Any], value: Any) -> str | None:
    """Name under which the class of a value stands in a table, None where it is not in it."""
    reference = _reference(type(value))
    return next((name for name, known in table.items() if _reference(known) == reference), None)


def _reference(value):
    """``"module:name"`` of a class; any other value as it is."""
    return f"{value.__module__}:{value.__qualname__}" if isinstance(value, type) else value


class Kind(NamedTuple):
    """A table that other packages may add to.

    Attributes
    ----------
    table : dict
        The table.
    base : str
        ``"module:name"`` of the class that classes of this kind derive from; "" of a module with the functions
        ``add_arguments`` and ``run``.
    pattern : str
        Regular expression of its names.
    """

    table: dict[str, Any]
    base: str
    pattern: str


_WORD, _WORDS = "[a-z][a-z0-9_]*", "[a-z][a-z0-9_-]*"
KINDS = {
    "effect": Kind(EFFECTS, "refweb.tables:Table", _WORD),
    "shape": Kind(SHAPES, "refweb.net.rigid_body:Shape", _WORDS),
    "law": Kind(LAWS, "refweb.net.laws.law:TensionLaw", _WORDS),
    "observable": Kind(OBSERVABLES, "refweb.results.observables.observable:Observable", _WORDS),
    "integrator": Kind(INTEGRATORS, "refweb.dynamics.integrators.integrator:Integrator", _WORDS),
    "verb": Kind(COMMANDS, "", _WORDS),
}
"""Kinds that `register` and entry points, of the group ``refweb.`` + kind + ``s``, may add."""
LINE_COLUMNS = (
    *("natural_length", "ea", "slackness", "smoothing", "g0", "r0", "reference", "distance"),
    *("law", "damping_time", "rupture_energy", "curve", "modulus", "area", "density", "strength", "safety_factor"),
    *("knot_factor", "growth"),
)
"""Numbers of a line, as which no parameter of a law may be called."""
OF_EFFECTS = ("arm_", "plastic_")
"""Beginnings of the names of numbers that effects give lines."""
SHIPPED = {kind: frozenset(entry.table) for kind, entry in KINDS.items()}
"""Names of what refweb ships, by kind."""
RESERVED = {"effect": {"schema", "title", "seed", "web", "solve", *PARTS, *LISTS}, "integrator": {"auto"}}
"""Names that scenes use otherwise, by kind."""
PACKAGES: dict[str, str] = {}
"""Versions of the packages whose entry points have been loaded, by name."""


def register(kind: str, name: str, value: Any = None) -> Any:
    """Make an addition of a kind known to scenes, checks, messages and help.

    Parameters
    ----------
    kind : {"effect", "shape", "law", "observable", "integrator", "verb"}
        Kind of the addition.
    name : str
        Its name in scenes: of the table of an effect, and of a value of ``shape``, ``law``, ``quantity`` or ``method``;
        or on the command line. A class that had the name by `register` is replaced.
    value : class or module, optional
        The class; of a verb a module, or what else has ``add_arguments`` and ``run``. Without it, `register` is a
        decorator.

    Returns
    -------
    class or module
        ``value``.

    Raises
    ------
    InputError
        For another kind, a name that refweb ships or that scenes use otherwise, and a value that is not of this kind.

    Notes
    -----
    Names of effects are small letters, digits and ``_``, others may have ``-``. An integrator has ``keys``, those of
    ``[solve]`` that it takes, the one that trades accuracy for time first, and its ``method`` is its name. Fields of a
    law are the ``parameters`` of ``[cable]`` that it takes, and its ``name`` is its name.

    Workers of a study are processes of their own, which do not know what a script has registered: an installed package
    with an entry point is known to them.

    Examples
    --------
        refweb.register("effect", "current", Current)
    """
    from .errors import InputError, refused_at
    from .messages import nearest, quote

    if kind not in KINDS:
        raise InputError(f"register: kind = {quote(kind)}: there is no such kind, {nearest(kind, KINDS)}")
    if value is None:
        return functools.partial(register, kind, name)
    with refused_at(f"register: {kind} {quote(name)}:"):
        KINDS[kind].table[name] = _entry(kind, name, value)
    return value


def _entry(kind, name, value):
    """Entry of a class or module in a table; refuse a name that is taken, and what is not of this kind."""
    from .errors import InputError
    from .messages import quote

    _, base, pattern = KINDS[kind]
    if not isinstance(name, str) or not re.fullmatch(pattern, name):
        marks = "digits and _" if pattern == _WORD else "digits, _ and -"
        raise InputError(f"the name must be small letters, {marks}, a letter first")
    if name in SHIPPED[kind] or name in RESERVED.get(kind, ()):
        raise InputError("refweb has one of this name, choose another")
    if base and load(base) not in getattr(value, "__mro__", ()):
        raise InputError(f"{quote(_reference(value))} must be a class derived from {base.replace(':', '.')}")
    if not base and not (hasattr(value, "add_arguments") and hasattr(value, "run")):
        raise InputError(f"{quote(str(value))} must be a module with the functions add_arguments and run")
    if kind == "law":
        _check_law(name, value)
    return _method(name, value) if kind == "integrator" else value


def _check_law(name, law):
    """Give a class of laws the columns of its parameters; refuse another name of it, and of parameters."""
    from .errors import InputError
    from .messages import quote

    if law.name != name:
        raise InputError(f"name = {quote(law.name)} of the class must be the same name")
    parameters = [*getattr(law, "__dataclass_fields__", ())]
    for parameter in parameters:
        if parameter in LINE_COLUMNS or parameter.startswith(OF_EFFECTS):
            raise InputError(f"the parameter {quote(parameter)} has a name of refweb's own, call it otherwise")
    law.columns = (*law.columns, *(parameter for parameter in parameters if parameter not in law.columns))


def _method(name, integrator):
    """The `Method` of a class of integrators."""
    from .errors import InputError
    from .messages import quote

    known_keys = {key for shipped in SHIPPED["integrator"] for key in INTEGRATORS[shipped].keys}
    keys = tuple(getattr(integrator, "keys", ()))
    if not keys or keys[0] not in ("safety", "rtol") or not known_keys >= set(keys):
        listed = ", ".join(sorted(known_keys))
        raise InputError(f'keys = {quote(list(keys))} must be "safety" or "rtol", and then some of {listed}')
    if integrator.method != name:
        raise InputError(f"method = {quote(integrator.method)} of the class must be the same name")
    return Method(integrator, keys)


@functools.cache
def installed() -> dict[tuple[str, str], tuple[EntryPoint, ...]]:
    """Entry points that installed packages have, a dict of tuples by kind and name."""
    from importlib.metadata import entry_points

    every, entries = entry_points(), {}
    for kind in KINDS:
        for entry in every.select(group=f"refweb.{kind}s"):
            entries[kind, entry.name] = (*entries.get((kind, entry.name), ()), entry)
    return entries


def _kind_of(table):
    """Kind of a table, "" of one that is closed."""
    return next((kind for kind, entry in KINDS.items() if entry.table is table), "")


def known(table: dict[str, Any], name: Any) -> bool:
    """Tell if a name is in a table, or comes into it by an entry point.

    Raises
    ------
    InputError
        Where a package has such an entry point that cannot be loaded, or several packages have one.
    """
    if name not in table and isinstance(name, str) and (entries := installed().get((_kind_of(table), name))):
        _load_entry(_kind_of(table), name, entries)
    return name in table


def knows_class_of(table: dict[str, Any], value: Any) -> bool:
    """Tell if the class of a value is in a table, or comes into it by an entry point of the package that it is from."""
    for (kind, name), entries in installed().items() if name_of(table, value) is None else ():
        package = type(value).__module__.partition(".")[0]
        if kind == _kind_of(table) and any(entry.module.partition(".")[0] == package for entry in entries):
            known(table, name)
    return name_of(table, value) is not None


def _load_entry(kind, name, entries):
    """Register what an entry point stands for."""
    from .errors import InputError, refused_at

    packages = [entry.dist.name if entry.dist else "an unnamed package" for entry in entries]
    with refused_at(f'plug-in {kind} "{name}" of {" and ".join(packages)}:'):
        if len(entries) > 1:
            raise InputError("several packages have one of this name, uninstall all but one")
        try:
            value = entries[0].load()
        except Exception as error:
            reason = f"{type(error).__name__}: {error}"
            raise InputError(f"{entries[0].value} cannot be loaded, {reason}") from error
        KINDS[kind].table[name] = _entry(kind, name, value)
    if entries[0].dist:
        PACKAGES[packages[0]] = entries[0].dist.version


def possible(table: dict[str, Any]) -> list[str]:
    """Names in a table, and those that entry points can bring into it."""
    return [*dict.fromkeys([*table, *(name for kind, name in installed() if kind == _kind_of(table))])]


def registered_packages() -> set[str]:
    """Packages of all that `register` and entry points have added, a set of names."""
    entries = (value for entry in KINDS.values() for value in entry.table.values() if not isinstance(value, str))
    values = (entry.integrator if isinstance(entry, Method) else entry for entry in entries)
    modules = (getattr(value, "__module__", None) or value.__name__ for value in values if not isinstance(value, str))
    return {module.partition(".")[0] for module in modules}


def load_installed(*kinds: str) -> list[str]:
    """Load all entry points of some kinds, by default of all; return a message for each that cannot be."""
    from .errors import InputError

    messages = []
    for (kind, name), entries in installed().items():
        if kind in (kinds or KINDS) and (name in SHIPPED[kind] or name not in KINDS[kind].table):
            try:
                _load_entry(kind, name, entries)
            except InputError as error:
                messages.append(str(error))
    return messages


FILES = {"web": ("path", "lines"), "cable": ("stress", "tension"), "body": ("file", "heights"), "fold": ("file",)}
"""Keys of tables of a scene that are paths of files."""


def with_files(
    given: dict[str, Any], change: Callable[[str], Any], tables: Sequence[str] = tuple(FILES)
) -> dict[str, Any]:
    """A copy of the dict of a scene with ``folder(path)`` for each path of a file in some tables."""

    def placed(table, keys):
        if not isinstance(table, dict):
            return table
        groups = table.get("groups")
        if isinstance(groups, dict):
            table = {**table, "groups": {name: placed(group, keys) for name, group in groups.items()}}
        return {k: change(value) if k in keys and isinstance(value, str) else value for k, value in table.items()}

    given, changed = with_fold(given), {}
    for name in tables:
        if isinstance(values := given.get(name), list):
            changed[name] = [placed(entry, FILES[name]) for entry in values]
        elif isinstance(values, dict):
            changed[name] = placed(values, FILES[name])
    return {**given, **changed}


def with_fold(given: dict[str, Any]) -> dict[str, Any]:
    """The dict of a scene in which what ``[web]`` says of a fold, ``fold`` or ``positions``, is the table of a fold."""
    web: Any = given.get("web")
    said = [key for key in ("fold", "positions") if isinstance(web, dict) and key in web]
    if not said:
        return given
    if "fold" in given or len(said) > 1:
        from .errors import InputError

        raise InputError(f"[web] {said[0]}: the web is folded twice, leave one out")
    fold = {"kind": "positions", "file": web["positions"]} if said == ["positions"] else web["fold"]
    rest = {key: value for key, value in web.items() if key not in said}
    return {**given, "web": rest, "fold": fold if isinstance(fold, dict) else {"kind": fold}}


def paths_of(given: dict[str, Any]) -> list[str]:
    """Paths of the files that the dict of a scene names."""
    paths = []
    with_files(given, paths.append)
    return paths
