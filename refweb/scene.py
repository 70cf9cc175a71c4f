"""A scene: one web, one cable, the effects on it, and what to solve and observe.

`Scene` is frozen and one to one with a TOML file. A table that is present is an effect that is present; the module of
an effect is imported when its table is.

May change: private functions, words of messages, and `MAX_HISTORY_ROWS`, a limit of what is accepted. Must stay:
fields, which are tables of scene files and arguments in scripts of users; `from_dict` reads the same scene from what
`to_dict` writes, since result folders keep that as ``scene.toml``; `SHORTEST_INTERVAL` and `ROWS_OF_LONG_RUNS`, the
default interval (``tests/dynamics/test_default_rows.py``). A new table stands in `registry` as well, and the reference
is written anew (CONTRIBUTING). Must stay as well: all names that `commands.new`, `sizing.requirements` and other files
import. Tests: ``tests/test_scene.py``, ``tests/reference/test_schema.py``.
"""

from __future__ import annotations

import os
import pathlib
import re
import tomllib
from dataclasses import field, fields, replace
from typing import TYPE_CHECKING, Any

from .errors import InputError, in_file, refused_at
from .messages import nearest, quote, short
from .registry import (
    EFFECTS,
    LISTS,
    PARTS,
    SOLVES,
    WEBS,
    known,
    knows_class_of,
    load,
    name_of,
    possible,
    with_files,
    with_fold,
)
from .settings import START_STATES, Accuracy, Dynamic, Head, Output, Static, Supports
from .tables import Several, Table, table

if TYPE_CHECKING:
    from collections.abc import Callable
    from os import PathLike

    from .net.cable import Cable
    from .net.web import Web
    from .results.observables.observe import Observe
    from .results.throw import Throw
    from .solution import Solution
    from .sweeps.episodes import Gym
    from .system.system import System

CLASSES_OF_PARTS = {
    "cable": ("Cable",),
    "supports": ("Supports", "NoneType"),
    "support": ("Supports",),
    "solve": ("Static", "Dynamic"),
    "output": ("Output",),
    "accuracy": ("Accuracy", "NoneType"),
    "throw": ("Throw", "NoneType"),
    "gym": ("Gym", "NoneType"),
    "observe": ("Observe",),
    "event": ("Event",),
    "control": ("Control",),
}
"""Classes of the other parts of a scene."""
SHIPPED_SCENES = pathlib.Path(__file__).parent / "scenes"
"""Folder of the scenes shipped with refweb."""
SHIPPED_STUDIES = pathlib.Path(__file__).parent / "sweeps" / "shipped"
"""Folder of the studies shipped with refweb."""
SHIPPED_SIZINGS = pathlib.Path(__file__).parent / "sizing" / "shipped"
"""Folder of the requirements files shipped with refweb."""
HAS_REQUIREMENTS = "holds requirements, and is not a scene: refweb size {0} finds the least design that meets them"
IS_STUDY = (
    "is a study, many runs of one scene, and not a scene: refweb sweep {0} runs it, refweb info {0} says what it varies"
)
MAX_HISTORY_ROWS = 10_000_000
"""Largest number of history rows."""
SHORTEST_INTERVAL, ROWS_OF_LONG_RUNS = 1e-3, 1000
"""Time between history rows of short runs [s], and number of rows of long ones, where no interval is given."""


@table
class Scene:
    """Scene: the web, its material, all effects, the solver and the output.

    Parameters
    ----------
    web : refweb.net.web.Web or a table that makes one
        Nodes, lines and natural lengths.
    cable : refweb.Cable
        Material and section.
    effects : sequence
        Effects as values, such as ``Gravity(acceleration=(0, 0, -9.81))``.
    supports : Supports, optional
        Replaces the web's own supports; no nodes frees all.
    support : sequence of Supports
        Supports in addition.
    solve : Static or Dynamic
        Kind of solution and method.
    output : Output
        Output interval and frames of the result folder.
    accuracy : Accuracy, optional
        How errors are found.
    throw : refweb.Throw, optional
        Numbers that a throw is judged by.
    gym : refweb.Gym, optional
        Learning environment, in dynamics.
    observe : sequence of refweb.Observe
        Numbers to follow; `refweb.results.observables.observe.default` without any.
    event : sequence of Event
        Moments to find, in dynamics.
    control : sequence of refweb.Control
        Feedback controls, in dynamics.
    title : str
        Title; for a file without one the file's name.
    seed : int
        Seed of whatever is random.

    Raises
    ------
    InputError
        For an empty title or one above 200 characters, a negative seed, what is not a list, and what is not an effect
        in it; in statics for an interval, digits, a horizon and events; in dynamics for an interval above the duration,
        or one that makes more than `MAX_HISTORY_ROWS` rows. `build` refuses what does not fit the web or together.
    """

    web: Web | Table
    cable: Cable
    effects: Several = ()
    supports: Supports | None = None
    support: Several = ()
    solve: Static | Dynamic = field(default_factory=Static)
    output: Output = field(default_factory=Output)
    accuracy: Accuracy = field(default_factory=Accuracy)
    throw: Throw | None = None
    gym: Gym | None = None
    observe: Several = ()
    event: Several = ()
    control: Several = ()
    title: str = "scene"
    seed: int = 0
    folder: pathlib.Path | None = field(default=None, compare=False)
    file: str = field(default="", compare=False)
    chosen: tuple[str, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        head = Head(title=self.title, seed=self.seed)
        for key in ("title", "seed"):
            object.__setattr__(self, key, getattr(head, key))
        for key in ("effects", "support", "observe", "event", "control"):
            if not isinstance(getattr(self, key), (list, tuple)):
                raise InputError(f"{key} = {quote(getattr(self, key))} must be a list")
            object.__setattr__(self, key, tuple(getattr(self, key)))
        for effect in self.effects:
            if not knows_class_of(EFFECTS, effect):
                kind = type(effect).__name__
                hint = f'refweb.register("effect", NAME, {kind}) makes it one' if isinstance(effect, Table) else ""
                raise InputError(f"{kind} is not an effect, {hint or nearest(kind, possible(EFFECTS))}")
        for key, kinds in CLASSES_OF_PARTS.items():
            value = getattr(self, key)
            for item in value if isinstance(value, tuple) else [value]:
                if type(item).__name__ not in kinds:
                    names = " or ".join(f"refweb.{kind}" for kind in kinds if kind != "NoneType")
                    several = f"{names}: a list of them is support" if key == "supports" else names
                    raise InputError(f"{key} = {quote(item)} must be {several}")
        if type(self.web).__name__ != "Web" and not (isinstance(self.web, Table) and hasattr(self.web, "web")):
            raise InputError(f"web = {quote(self.web)} must be a refweb.Web, or one of the tables that make one")
        self._fill()

    def _fill(self):
        """Fill in the defaults that depend on what is solved."""
        output, solve = self.output, self.solve
        dynamic = isinstance(solve, Dynamic)
        if not dynamic and output.interval is not None:
            raise InputError(f"[output] interval = {output.interval:g} has no meaning in statics: leave it out")
        for key in ("digits", "horizon") if not dynamic and self.accuracy is not None else ():
            if value := getattr(self.accuracy, key):
                raise InputError(f"[accuracy] {key} = {quote(value)} has no meaning in statics: leave it out")
        for key, given in (("event", self.event), ("control", self.control)):
            if not dynamic and given:
                raise InputError(f"[[{key}]] {quote(given[0].name)} has no meaning in statics: leave it out")
        acting = [*self.control, *([self.gym] if self.gym else [])]
        if not dynamic and acting:
            raise InputError("[gym] has no meaning in statics: leave it out")
        controls = [control.name for control in self.control]
        for observe in self.observe:
            if observe.control is not None and observe.control not in controls:
                hint = nearest(observe.control, controls) if controls else "the scene has none"
                raise InputError(
                    f"[[observe]] {quote(observe.name)} control = {quote(observe.control)} is not a [[control]], {hint}"
                )
        interval = output.interval or min((part.period for part in acting), default=None)
        interval = (interval or default_interval(solve)) if dynamic else None
        frames = output.frames or (10 if dynamic else 1)
        object.__setattr__(self, "output", Output(interval=interval, frames=frames))
        object.__setattr__(self, "accuracy", self.accuracy or Accuracy())
        if not dynamic or interval is None:
            return
        if interval > solve.duration:
            raise InputError(f"[output] interval = {interval:g} must be ≤ duration = {solve.duration:g} [s]")
        if solve.duration / interval > MAX_HISTORY_ROWS:
            rows = f"{solve.duration / interval:.3g} history rows"
            raise InputError(f"[output] interval = {interval:g} makes {rows}, at most {MAX_HISTORY_ROWS}")

    @staticmethod
    def load(source: str | PathLike[str], values: dict[str, Any] | None = None) -> Scene:
        """The scene of a TOML file, or of the name of a scene shipped with refweb.

        Parameters
        ----------
        source : path-like or str
            The file, or the name.
        values : dict, optional
            Values by path, ``{"solve.duration": 0.5}``, in place of what the file says, see `refweb.reference.paths`.

        Raises
        ------
        InputError
            Where there is no such file or scene, or it is wrong.
        """
        path = file_of(source)
        try:
            given = {"title": path.stem, **tomllib.loads(path.read_bytes().decode("utf-8-sig"))}
        except UnicodeDecodeError as error:
            where = f"byte {error.start} is not UTF-8"
            raise InputError(f"{path.name}: is not a scene, a text in UTF-8 ({where}): name a TOML file") from None
        except (ValueError, OSError, RecursionError) as error:  # a ValueError also for a number of thousands of digits
            raise InputError(f"{path.name}: cannot be read: {error}") from None
        name = path.name
        if values:
            from .reference.paths import with_value

            with in_file(name):
                for key, value in values.items():
                    given = with_value(given, key, value)
            name += " with " + ", ".join(f"{short(key)} = {quote(value)}" for key, value in values.items())
        with in_file(name):
            return Scene.from_dict(given, path.resolve().parent, name)

    @staticmethod
    def from_dict(given: dict[str, Any], folder: str | PathLike[str] | None = None, file: str = "") -> Scene:
        """The scene of the dict that a TOML file is read to; relative paths start at ``folder``.

        ``file`` is the name that begins the messages of `build`.
        """
        given = with_fold(given)
        if folder is not None:
            given = with_files(given, lambda path: str(pathlib.Path(folder, path)), ["body", "fold", "cable"])
        tables = [*(f.name for f in fields(Head)), "web", "solve", *PARTS, *LISTS]
        if "web" not in given and {"scene", "requirements"} <= given.keys():
            raise InputError(HAS_REQUIREMENTS.format(file or "REQUIREMENTS"))
        if "web" not in given and {"scene", "parameters"} <= given.keys():
            raise InputError(IS_STUDY.format(file or "STUDY"))
        for key in given:
            if key not in tables and not known(EFFECTS, key):
                hint = nearest(key, [*tables, *possible(EFFECTS)])
                of = ", or of a plug-in that is not installed" if isinstance(given[key], dict | list) else ""
                raise InputError(f"{_as_given(key, given[key])}: unknown table or key{of}, {hint}")
        Head(schema=given.get("schema", 1))
        parts = {key: given[key] for key in ("title", "seed") if key in given}
        parts |= {"folder": None if folder is None else pathlib.Path(folder), "file": file}
        for key in ("web", "cable", "solve"):
            if key not in given:
                raise InputError(f"[{key}] is missing: every scene has one")
        parts["web"] = _by_kind("web", given["web"], WEBS)
        parts["solve"] = _by_kind("solve", given["solve"], SOLVES)
        for key in PARTS:
            if key in given:
                parts[key] = load(PARTS[key]).read(f"[{key}]", given[key])
        for key in LISTS:
            if key in given:
                parts[key] = _each(key, load(LISTS[key]), given[key])
        effects = []
        for key in given:
            if key in EFFECTS:
                kind = load(EFFECTS[key])
                effects += _each(key, kind, given[key]) if kind.several else [kind.read(f"[{key}]", given[key])]
        return Scene(**parts, effects=tuple(effects))

    def to_dict(self) -> dict[str, Any]:
        """The scene as the dict of its TOML file, defaults filled in and paths absolute."""
        if not isinstance(self.web, Table):
            raise InputError("[web] is a Web made in Python: a scene file cannot hold it; use refweb.Inline")
        given = {"schema": 1, "title": self.title, "seed": self.seed, "web": self.web.to_dict(), **self._tables()}
        return with_files(given, lambda path: str((self.folder or pathlib.Path()).joinpath(path).resolve()))

    def _tables(self):
        """All tables of the scene but the web."""
        given: dict = {"cable": self.cable.to_dict()}
        if self.supports is not None:
            given["supports"] = _axes(self.supports.to_dict())
        if self.support:
            given["support"] = [_axes(s.to_dict()) for s in self.support]
        for effect in self.effects:
            key = name_of(EFFECTS, effect)
            if effect.several:
                given.setdefault(key, []).append(effect.to_dict())
            else:
                given[key] = effect.to_dict()
        given["solve"] = self.solve.to_dict()
        if (folder := self.start_folder) is not None:
            given["solve"]["start"] = str(folder)
        parts = {key: getattr(self, key) for key in ("output", "accuracy", "throw", "gym")}
        given |= {key: part.to_dict() for key, part in parts.items() if part is not None}
        given["observe"] = [o.to_dict() for o in self.observables]
        if self.event:
            given["event"] = [event.to_dict() for event in self.event]
        if self.control:
            given["control"] = [self._placed(control.to_dict()) for control in self.control]
        return given

    def _placed(self, control):
        """The dict of a control, the file of its law absolute."""
        file, sign, name = control["law"].rpartition(":")
        if not sign:
            return control
        return {**control, "law": f"{(self.folder or pathlib.Path()).joinpath(file).resolve()}:{name}"}

    def _repr_html_(self):
        from .results.notebook import of_scene

        web = self.web
        content = web.to_dict() if isinstance(web, Table) else {"nodes": len(web.points), "lines": len(web.lines)}
        return of_scene({"web": content, **self._tables()}, self.title)

    @property
    def observables(self) -> tuple[Observe, ...]:
        """The observables, or the default ones."""
        from .results.observables.observe import default

        return tuple(self.observe) or default([e.name for e in self.effects if type(e).__name__ == "Thread"])

    @property
    def start_folder(self) -> pathlib.Path | None:
        """The result folder that a dynamic scene starts from, None where it starts from none."""
        start = getattr(self.solve, "start", "web")
        return None if start in START_STATES else (self.folder or pathlib.Path()).joinpath(start).resolve()

    def replace(self, **changes: Any) -> Scene:
        """A scene that differs in some fields."""
        return replace(self, **changes)

    @property
    def contact(self) -> Any:
        """The ``[contact]`` of the scene, None without one."""
        return next((effect for effect in self.effects if name_of(EFFECTS, effect) == "contact"), None)

    def with_stiffness(self, stiffness: dict[str, float]) -> Scene:
        """The scene with another stiffness of contact for some bodies, by name, or "self_contact", as its choice."""
        bodies = {name: value for name, value in stiffness.items() if name != "self_contact"}
        tables = {"contact": bodies, "self_contact": stiffness.get("self_contact")}
        given = ((tables.get(str(name_of(EFFECTS, effect))), effect) for effect in self.effects)
        effects = tuple(effect.with_stiffness(value) if value else effect for value, effect in given)
        return self.replace(effects=effects, chosen=tuple(dict.fromkeys([*self.chosen, *stiffness])))

    def settled(self) -> Scene:
        """The scene with the stiffness of contact that it leaves out; itself where it leaves out none.

        Names of the bodies that it is chosen for, and "self_contact", stand in ``chosen``.
        """
        return self.settle()[0] if self.left_out() else self

    def build(self) -> System:
        """The `refweb.system.system.System` of this scene, with the stiffness of contact that it leaves out chosen.

        Raises
        ------
        InputError
            For whatever does not fit together; the message names file and table.
        """
        return self.settle()[1]

    def left_out(self) -> list[str]:
        """Names of the bodies, and "self_contact", whose stiffness is left out, a list."""
        lines = [e for e in self.effects if name_of(EFFECTS, e) == "self_contact" and e.stiffness is None]
        bodies = [effect for effect in self.effects if name_of(EFFECTS, effect) == "body"] if self.contact else []
        return ["self_contact" for _ in lines] + [*(self.contact.left_out(bodies) if bodies else ())]

    def settle(self) -> tuple[Scene, System]:
        """(`settled`, `build`) of it: it is built once, with any stiffness, and contact again with those chosen."""
        missing, chosen = self.left_out(), {}
        if not missing:
            return self, self._built()
        system = self.with_stiffness(dict.fromkeys(missing, 1.0))._built()
        with in_file(self.file):
            if "self_contact" in missing:
                from .effects.self_contact.penetration import first_stiffness as first_of_lines

                chosen["self_contact"] = first_of_lines(system)
            if bodies := [body for body in system.net.bodies if body.name in missing]:
                from .effects.contact.overlap import first_stiffness

                law, steps = self.contact.law_of, getattr(self.solve, "load_steps", ())
                with refused_at("[contact]"):
                    chosen |= {b.name: first_stiffness(system, b, law(b)[1], steps) for b in bodies}
        scene = self.with_stiffness(chosen)
        if len(system.net.web.broken):  # whose contact is not that of the tables
            return scene, scene._built()
        tables = {"self_contact" if name == "self_contact" else "contact" for name in chosen}
        effects = {name_of(EFFECTS, effect): effect for effect in scene.effects}
        return scene, system.with_effects({name: effects[name] for name in tables})

    def _built(self):
        """The system of a scene that leaves out no stiffness."""
        from .build import build

        scene = load("refweb.dynamics.commands:widened")(self) if self.control or self.gym else self
        with in_file(self.file):
            system = build(
                web=self.web,
                cable=self.cable,
                effects=scene.effects,
                supports=self.supports,
                support=self.support,
                solve=self.solve,
                output=self.output,
                accuracy=self.accuracy,
                observables=self.observables,
                events=self.event,
                folder=self.folder,
            )
            if self.control:
                load("refweb.dynamics.controllers:check")(self, system)
            if self.gym is not None:
                with refused_at("[gym]"):
                    self.gym.check_in(self, system)
            if self.throw is not None:
                with refused_at("[throw]"):
                    self.throw.on(self.observables, system, self.solve)
            return system

    def trust(
        self,
        budget: float | None = None,
        out: str | PathLike[str] | None = None,
        force: bool = False,
        progress: bool | Callable[[str, float], object] | None = True,
    ) -> Solution:
        """Find all parts of the error of each result, and its verdict, see `refweb.trust`."""
        return load("refweb.runner:trust")(self, budget, out, force, progress)


def default_interval(solve: Dynamic) -> float:
    """Time between history rows where none is given [s]: 1 ms, of runs above 1 s a thousandth of the duration.

    It is not shorter than a step that is given, as steps end at rows, and not longer than the duration.
    """
    return min(max(SHORTEST_INTERVAL, solve.duration / ROWS_OF_LONG_RUNS, solve.step_size or 0.0), solve.duration)


def file_of(source: Any) -> pathlib.Path:
    """Path of a scene file, or of a scene shipped with refweb by its name; refused where there is neither."""
    if not isinstance(source, (str, os.PathLike)):
        raise InputError(f"scene = {quote(source)} must be a Scene, a scene file or the name of a shipped scene")
    path, known = pathlib.Path(source), shipped()
    if os.path.isfile(path):
        return path
    if (name := str(path).removesuffix(".toml")) in known:
        return known[name]
    if os.path.isdir(source):
        hint = f": name {short(str(path))}/scene.toml" if os.path.isfile(path / "scene.toml") else ""
        raise InputError(f"{short(str(source))}: is a folder, not a scene file{hint}")
    if path.stem in (study.stem for study in SHIPPED_STUDIES.glob("*.toml")):
        raise InputError(f"{short(str(source))}: {IS_STUDY.format(path.stem)}")
    if path.stem in (sizing.stem for sizing in SHIPPED_SIZINGS.glob("*.toml")):
        raise InputError(f"{short(str(source))}: {HAS_REQUIREMENTS.format(path.stem)}")
    raise InputError(f"{short(str(source))}: no such file and no shipped scene, {nearest(path.stem, known)}")


def shipped() -> dict[str, pathlib.Path]:
    """Paths of the scenes shipped with refweb, by name."""
    return {path.stem: path for path in sorted(SHIPPED_SCENES.glob("*.toml"))}


def slug(title: str) -> str:
    """A title as the name of a folder, of at most 80 characters."""
    return re.sub(r"[\W_]+", "-", title.lower()).strip("-")[:80].strip("-") or "result"


def _as_given(key, value):
    """A top-level key as it stands in the file: [table], [[table]] or key = value."""
    name = short(key) or '""'
    if isinstance(value, dict):
        return f"[{name}]"
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return f"[[{name}]]"
    return f"{name} = {quote(value)}"


def _each(key, table, given):
    if not isinstance(given, (list, tuple)):
        raise InputError(f"[{key}] = {quote(given)} must be a list of tables: write [[{key}]]")
    if not given:
        raise InputError(f"{key} = [] must hold at least one table: write [[{key}]] or leave it out")
    return tuple(table.read(f"[[{key}]] {i + 1}", entry) for i, entry in enumerate(given))


def _by_kind(key, given, kinds):
    if not isinstance(given, dict):
        raise InputError(f"{key} = {quote(given)} must be a table: write [{key}]")
    kind = given.get("kind")
    if kind is None:
        raise InputError(f"[{key}] kind is missing: one of {', '.join(kinds)}")
    if not isinstance(kind, str) or kind not in kinds:
        raise InputError(f"[{key}] kind = {quote(kind)}: unknown kind, {nearest(kind, kinds)}")
    return load(kinds[kind]).read(f"[{key}]", given)


def _axes(table):
    return {**table, "components": ["xyz"[c] for c in table["components"]]}
