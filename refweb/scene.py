"""A scene: one web, one cable, the effects on it, and what to solve and observe.

`Scene` is frozen and one to one with a TOML file. A table that is present is an effect that is present; the module of an
effect is imported when its table is.
"""

from __future__ import annotations

import importlib
import pathlib
import re
import tomllib
from dataclasses import dataclass, field, replace

import numpy as np

from .inputs import InputError, Table, choice, components, integer, nearest, nodes, numbers_list, shown, text

WEBS = {
    "paper": "refweb.lattices:Paper",
    "window": "refweb.lattices:Window",
    "layers": "refweb.lattices:Layers",
    "cable": "refweb.webs:SingleCable",
    "inline": "refweb.webs:Inline",
    "file": "refweb.webs:File",
}
EFFECTS = {
    "gravity": "refweb.effects.gravity:Gravity",
    "load": "refweb.effects.load:Load",
    "motion": "refweb.effects.motion:Motion",
}
LISTS = ("load", "motion")
"""Effects whose table may stand several times, ``[[load]]``."""
SHIPPED = pathlib.Path(__file__).parent / "scenes"


def _load(reference):
    module, name = reference.split(":")
    return getattr(importlib.import_module(module), name)


@dataclass(frozen=True, kw_only=True)
class Supports(Table):
    """Nodes whose displacement is held at zero in some components."""

    nodes: object = nodes()
    components: tuple = components(("x", "y", "z"))


@dataclass(frozen=True, kw_only=True)
class Static(Table):
    """Static solution at a list of load steps."""

    kind: str = choice("static", default="static")
    method: str = choice("newton", default="newton")
    load_steps: tuple = numbers_list((1.0,))


@dataclass(frozen=True, kw_only=True)
class Output(Table):
    """What a result folder holds: a VTU every ``frames`` history rows; the first and the last state always."""

    frames: int = integer(1, at_least=1)


@dataclass(frozen=True, kw_only=True)
class Scene:
    """What refweb computes.

    Parameters
    ----------
    web : refweb.webs.Web or a table that makes one
        Nodes, lines and natural lengths.
    cable : refweb.Cable
        Material and section.
    effects : sequence
        Effects as values, such as ``Gravity(acceleration=(0, 0, -9.81))``.
    supports : Supports, optional
        Replaces the web's own supports; no nodes frees all.
    support : sequence of Supports
        Supports in addition.
    solve : Static
        What to solve and how.
    output : Output
        What a result folder holds.
    observe : sequence of refweb.Observe
        Numbers to follow; `refweb.observables.DEFAULT` without any.
    title : str
        Title; for a file without one the file's name.
    seed : int
        Seed of whatever is random.
    """

    web: object
    cable: object
    effects: tuple = ()
    supports: Supports | None = None
    support: tuple = ()
    solve: Static = field(default_factory=Static)
    output: Output = field(default_factory=Output)
    observe: tuple = ()
    title: str = "scene"
    seed: int = 0
    folder: pathlib.Path | None = field(default=None, compare=False)

    @staticmethod
    def load(source):
        """The scene of a TOML file, or of the name of a scene shipped with refweb.

        Raises
        ------
        InputError
            Where there is no such file or scene, or it is wrong.
        """
        path = pathlib.Path(source)
        if not path.is_file():
            shipped = SHIPPED / f"{path.name.removesuffix('.toml')}.toml"
            if len(path.parts) != 1 or not shipped.is_file():
                known = sorted(p.stem for p in SHIPPED.glob("*.toml"))
                raise InputError(f"{shown(str(source))[1:-1]}: no such file and no shipped scene, {nearest(path.stem, known)}")
            path = shipped
        try:
            given = tomllib.loads(path.read_text(encoding="utf-8"))
        except (tomllib.TOMLDecodeError, UnicodeDecodeError, OSError, RecursionError) as error:
            raise InputError(f"{path.name}: cannot be read: {' '.join(str(error).split())}") from None
        try:
            return Scene.from_dict({"title": path.stem, **given}, path.resolve().parent)
        except InputError as error:
            raise InputError(f"{path.name}: {error}") from None

    @staticmethod
    def from_dict(given, folder=None):
        """The scene of the dict that a TOML file is read to; relative paths start at ``folder``."""
        plain = {"schema": 1, "title": "scene", "seed": 0}
        single = {"cable": "refweb.cables:Cable", "supports": Supports, "output": Output}
        several = {"support": Supports, "observe": "refweb.observables:Observe"}
        known = [*plain, "web", "solve", *single, *several, *EFFECTS]
        for key in given:
            if key not in known:
                raise InputError(f"[{shown(key)[1:-1]}]: unknown table or key, {nearest(key, known)}")
        top = {**plain, **given}
        for key, check in (
            ("schema", choice(1)),
            ("title", text()),
            ("seed", integer(at_least=0, at_most=2**63 - 1)),
        ):
            top[key] = check.metadata["read"](key, top[key])
        parts = {"title": top["title"], "seed": top["seed"], "folder": folder}
        for key in ("web", "cable", "solve"):
            if key not in given:
                raise InputError(f"[{key}] is missing: every scene has one")
        parts["web"] = _by_kind("web", given["web"], WEBS)
        parts["solve"] = _by_kind("solve", given["solve"], {"static": Static})
        for key, table in single.items():
            if key in given:
                parts[key] = _resolve(table).read(f"[{key}]", given[key])
        for key, table in several.items():
            parts[key] = _each(key, _resolve(table), given.get(key, []))
        effects = []
        for key in given:
            if key in EFFECTS:
                table = _load(EFFECTS[key])
                effects += _each(key, table, given[key]) if key in LISTS else [table.read(f"[{key}]", given[key])]
        return Scene(**parts, effects=tuple(effects))

    def to_dict(self):
        """The scene as the dict of its TOML file, defaults filled in and paths absolute."""
        if not isinstance(self.web, Table):
            raise InputError("[web] is a Web made in Python: a scene file cannot hold it; use refweb.Inline")
        web = self.web.to_dict()
        if "path" in web:
            web["path"] = str((self.folder or pathlib.Path()).joinpath(web["path"]).resolve())
        given = {"schema": 1, "title": self.title, "seed": self.seed, "web": web, "cable": self.cable.to_dict()}
        if self.supports is not None:
            given["supports"] = _axes(self.supports.to_dict())
        if self.support:
            given["support"] = [_axes(s.to_dict()) for s in self.support]
        for effect in self.effects:
            key = table_of(effect)
            if key in LISTS:
                given.setdefault(key, []).append(effect.to_dict())
            else:
                given[key] = effect.to_dict()
        given["solve"] = self.solve.to_dict()
        given["output"] = self.output.to_dict()
        given["observe"] = [o.to_dict() for o in self.observables]
        return given

    @property
    def observables(self):
        """The observables, or the default ones."""
        from .observables import DEFAULT

        return tuple(self.observe) or DEFAULT

    def replace(self, **changes):
        """A scene that differs in some fields."""
        return replace(self, **changes)

    def build(self):
        """The `refweb.system.System` of this scene.

        Raises
        ------
        InputError
            For whatever does not fit together; the message names the table.
        """
        from . import lines
        from .effects.elasticity import Elasticity
        from .system import System

        web = self.web
        if isinstance(web, Table):
            web = _in("[web]", web.web, self.folder)
        net = _in("", lines.build, web, self.cable, quasi_static=self.solve.kind == "static")
        supported = np.zeros((len(net.points), 3), dtype=bool)
        if self.supports is None:
            supported[web.rim] = True
        where = [("[supports]", self.supports)] if self.supports is not None else []
        where += [(f"[[support]] {i + 1}", s) for i, s in enumerate(self.support)]
        for name, table in where:
            found = _in(name, web.find, table.nodes, "nodes")
            supported[np.ix_(found, table.components)] = True
        acting, count = [Elasticity()], {}
        for effect in self.effects:
            key = table_of(effect)
            count[key] = count.get(key, 0) + 1
            acting.append(_Named(f"[[{key}]] {count[key]}" if key in LISTS else f"[{key}]", effect))
            if key not in LISTS and count[key] > 1:
                raise InputError(f"[{key}] stands {count[key]} times: a scene has one")
        system = System(net, acting, supported)
        _distinct_motions(system)
        names = set()
        for i, observable in enumerate(self.observables):
            _in(f"[[observe]] {i + 1}", observable.on, system)
            if observable.name in names:
                raise InputError(f'[[observe]] {i + 1} name = "{observable.name}" stands twice: names are unique')
            names.add(observable.name)
        return system


class _Named:
    """An effect whose refusals name its table."""

    def __init__(self, where, effect):
        self.where, self.effect = where, effect

    def on(self, net):
        return _in(self.where, self.effect.on, net)


def table_of(effect):
    """Name of the table of an effect."""
    own = f"{type(effect).__module__}:{type(effect).__qualname__}"
    for key, reference in EFFECTS.items():
        if reference == own:
            return key
    raise InputError(f"{type(effect).__name__} is no effect, {nearest(type(effect).__name__, EFFECTS)}")


def slug(title):
    """A title as the name of a folder."""
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-") or "result"


def _resolve(table):
    return _load(table) if isinstance(table, str) else table


def _in(where, call, *arguments, **named):
    try:
        return call(*arguments, **named)
    except InputError as error:
        raise InputError(f"{where} {error}".strip()) from None


def _each(key, table, given):
    if not isinstance(given, (list, tuple)):
        raise InputError(f"[{key}] must be a list of tables: write [[{key}]]")
    return tuple(table.read(f"[[{key}]] {i + 1}", one) for i, one in enumerate(given))


def _by_kind(key, given, kinds):
    if not isinstance(given, dict):
        raise InputError(f"{key} = {shown(given)} must be a table: write [{key}]")
    kind = given.get("kind")
    if kind is None:
        raise InputError(f'[{key}] kind is missing: one of {", ".join(kinds)}')
    if not isinstance(kind, str) or kind not in kinds:
        raise InputError(f"[{key}] kind = {shown(kind)}: unknown kind, {nearest(kind, kinds)}")
    return _resolve(kinds[kind]).read(f"[{key}]", given)


def _axes(table):
    return {**table, "components": ["xyz"[c] for c in table["components"]]}


def _distinct_motions(system):
    driven = np.concatenate([d.cells[:, 0] for d in system.drives]) if system.drives else np.zeros(0, dtype=int)
    numbers, times = np.unique(driven, return_counts=True)
    if (times > 1).any():
        raise InputError(f"[[motion]] node = {numbers[times > 1][0]} is moved by two tables: merge them")
