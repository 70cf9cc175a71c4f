"""The cable a web is made of: material, section, slackness and natural length of every line, by group.

May change: private functions, texts of errors, and `DEEPEST`, a limit of what is accepted; `SMOOTH_LAW` changes results
of scenes with default numbers of that law. Must stay: keys, defaults and docstrings of `Cable`, `Group` and `Viscous`
(scene format and help; after a change write ``validation/REFERENCE.md`` anew); fields of `Group`, which repeat those of
`Cable`, as `_values` reads both by name; names of the properties that `Cable.properties` returns, which
`discretisation`, laws and `studies.form` read; public names of `Viscous`, which other files use. Tests:
``tests/net/test_laws_by_group.py``, ``tests/test_scene.py``.
"""

from __future__ import annotations

from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ..errors import InputError, refused_at
from ..messages import quote
from ..registry import LAWS
from ..tables import LARGEST, Several, Table, by_group, choice, integer, nodes, numbers_by_name, part, real, rows, table
from . import law_keys
from .groups import givers
from .law_keys import EITHER, points
from .materials import FILLED, MATERIALS
from .plastic_keys import LAW, check_yield, hardening_key, yield_curves
from .tension_laws import law_of, names_in, strains_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .web import Web

SMOOTH_LAW = {"slackness": 0.0, "smoothing": 1e-5}
"""Parameters of the smooth law where none are given."""
_DENSE: dict[str, Any] = dict(at_least=0, unit="kg/m³")
LENGTHS = ("prestrain", "pretension", "sag")
"""Keys that say what natural length a line has."""
DENSITY = "force_density"
DEEPEST = 100.0
"""Largest sag over the distance of the ends of a line."""


@table
class Group(Table):
    """Keys that may differ from `Cable` on the lines of one group; None keeps the cable's value.

    Parameters
    ----------
    law : {"smooth", "tension-only", "linear", "force-density", "constant-force", "table", "elastic-plastic"}, optional
        Tension law; of the smooth one ε0 = 0 and η = 1e-5 where the cable has another and the group none of its own.
    material : str, optional
        As for `Cable`: modulus, density and strength of the group where it has none of its own.
    modulus : float, optional
        Asymptotic modulus E [Pa], > 0.
    area : float, optional
        Cross section A [m²], > 0.
    density : float, optional
        ρ [kg/m³], ≥ 0.
    slackness, smoothing : float, optional
        Of the smooth law: the strain ε0 at which lines become taut, and the width η of the passage from slack to taut
        [1], ≥ 0.
    prestrain, pretension, sag : float, optional
        Natural length, see `Cable`; one of them takes the place of what the cable gives.
    force_density : float, optional
        Of the law "force-density" [N/m], not 0.
    stress, tension : list of list of float or str, optional
        Of the law "table", see `Cable`; one of them takes the place of what the cable gives.
    yield_stress, hardening : float or list of list of float, optional
        Of the law "elastic-plastic", see `Cable`.
    parameters : dict of str to float, optional
        Of a law of another package, see `Cable`; a number takes the place of that of the cable.
    strength : float, optional
        Stress at which a line breaks [Pa], > 0.
    safety_factor, knot_factor : float, optional
        Of the margin of safety, see `Cable`.

    Raises
    ------
    InputError
        For a number that is not finite or out of these bounds, and for two keys of natural length.

    Examples
    --------
        [cable.groups.rim]
        area = 2e-4
        prestrain = 1e-3
    """

    law: str | None = choice(LAWS, default=None)
    material: str | None = choice(*MATERIALS, default=None)
    modulus: float | None = real(default=None, above=0, unit="Pa")
    area: float | None = real(default=None, above=0, unit="m²")
    density: float | None = real(default=None, **_DENSE)
    slackness: float | None = real(default=None, at_least=0, unit="1")
    smoothing: float | None = real(default=None, at_least=0, unit="1")
    prestrain: float | None = real(default=None, above=-1, unit="1")
    pretension: float | None = real(default=None, unit="N")
    sag: float | None = real(default=None, at_least=0, at_most=DEEPEST, unit="1")
    force_density: float | None = real(default=None, unit="N/m")
    stress: Any = points(unit="Pa")
    tension: Any = points(unit="N")
    yield_stress: float | None = real(default=None, above=0, unit="Pa")
    hardening: Any = hardening_key()
    parameters: dict[str, Any] | None = numbers_by_name()
    strength: float | None = real(default=None, above=0, unit="Pa")
    safety_factor: float | None = real(default=None, above=0, unit="1")
    knot_factor: float | None = real(default=None, above=0, at_most=1, unit="1")

    def check(self) -> None:
        """Fill in what the material gives; refuse two keys of one thing, and a force density that is none."""
        _fill(self)
        _check_lengths(self)
        law_keys.curve_key(self)

    def filled(self) -> Group:
        """The group with the smooth law's parameters where it has none."""
        return replace(self, **{k: v for k, v in SMOOTH_LAW.items() if getattr(self, k) is None})


@table
class Viscous(Table):
    """Viscoelastic lines: Maxwell arms, each a spring and a dashpot in series, beside the law of the cable.

    One arm is the standard linear solid. A line that is strained at once has the modulus of its law and of all arms;
    what an arm bears fades with its time, and after all time the law alone is left. A slack line does not push: its
    material is free of tension, and creeps back while the line hangs loose. Lines with the linear law push, and so do
    their arms.

    Parameters
    ----------
    arms : list of (modulus, time)
        Modulus [Pa] and relaxation time [s] of each arm, both > 0, any number of arms; their viscosity is the product
        of both.
    lines : int, str or list
        Lines that have the arms, by number or group, or "all".
    statics : {"long", "short"}
        Limit that statics takes, and the state in which a run starts: "long" has arms that have relaxed, so that the
        law alone bears loads and pretension; with "short" all arms act as springs. In statics the smoothing of the
        smooth law is then that of the sum of both.

    Raises
    ------
    InputError
        For a modulus or a time that is not > 0. From a scene, for lines that the web does not have or with a law of
        form finding, a ``[damping] time``, and methods of orders 4 and 6.

    References
    ----------
    The generalized Maxwell model: J. D. Ferry, *Viscoelastic Properties of Polymers*, 3rd ed., Wiley 1980, ch. 1. The
    exact step for strain that is linear in time: R. L. Taylor, K. S. Pister, G. L. Goudreau, "Thermomechanical analysis
    of viscoelastic solids", Int. J. Numer. Methods Eng. 2 (1970) 45–59.

    Examples
    --------
        [cable.viscous]
        arms = [[2e9, 0.01], [5e8, 1.0]]
    """

    arms: Several = rows(2)
    lines: Several = nodes(default="all", what="line")
    statics: str = choice("long", "short", default="long")

    def check(self) -> None:
        """Refuse arms whose modulus or time is not > 0."""
        for i, arm in enumerate(self.arms):
            for j, (name, unit) in enumerate((("modulus", "Pa"), ("time", "s"))):
                if not arm[j] > 0.0:
                    raise InputError(f"arms[{i}][{j}] = {arm[j]:g} must be > 0: it is a {name} [{unit}]")

    def at_once(self, web: Web) -> NDArray[np.float64]:
        """Modulus that the arms add where they act as springs [Pa], shape (lines,); 0 where they have relaxed."""
        total = sum(modulus for modulus, _ in self.arms) if self.statics == "short" else 0.0
        return np.where(np.isin(np.arange(len(web.lines)), self.chosen(web)), total, 0.0)

    def chosen(self, web: Web) -> NDArray[np.int64]:
        """Numbers of the lines that have arms, shape (k,)."""
        return web.find_lines(self.lines)


@table
class Cable(Table):
    """Material and section of the lines.

    Parameters
    ----------
    law : {"smooth", "tension-only", "linear", "force-density", "constant-force", "table", "elastic-plastic"}
        Tension law, see `refweb.net.laws`. Groups may have others: struts beside cables. Lines that can push end the
        proven bound that statics has where all lines are tension-only or have a curve, the law "table". The laws
        "force-density" and "constant-force" are those of form finding, for statics: the tension of a line is
        ``force_density`` times its length, or ``pretension``, whatever its natural length is, and `refweb.form` makes a
        net of elastic lines of the shape.
    material : str, optional
        Gives the modulus, the density and the strength where these keys are absent: typical values of a fibre or rope,
        which ``refweb help materials`` lists with their sources. A braid is softer and weaker than its fibre.
    modulus : float
        Asymptotic modulus E [Pa], > 0; of the laws of form finding that of the lines that `refweb.form` makes. It may
        be left out beside a material, and the law "table" has none.
    area : float
        Cross section A [m²], > 0.
    density : float
        ρ [kg/m³], ≥ 0; mass follows natural length. May be left out beside a material.
    slackness, smoothing : float
        Of the smooth law: the strain ε0 at which lines become taut, and the width η of the passage from slack to taut
        [1]; 0 and 1e-5 by default.
    prestrain : float
        Natural length = distance/(1 + prestrain) [1], > −1; negative is slack.
    pretension : float, optional
        Natural length such that this is the tension of each line in the web's position [N]; below 0 with the linear law
        alone. With the law "constant-force" it is that force, not 0; negative pushes.
    sag : float, optional
        Natural length of a line that hangs by this share of the distance of its ends [1], as an inextensible rope under
        its weight does between ends of one height; 0 to 100. It shows with ``subdivide`` above 1.
    force_density : float, optional
        Of the law "force-density": tension over length of a line, or of its chord where it is in several elements
        [N/m], not 0; negative pushes. Where it is above 0 on all lines, beside lines of the law "tension-only", the
        equilibrium under dead loads is the only one and its errors are proven; where it is negative they are estimates.
    stress : list of list of float or str, optional
        Of the law "table": points of a measured curve, [[strain, stress in Pa], ...], or a CSV file with the columns
        ``strain`` [1] and ``stress`` [Pa]. Both increase from a strain ≥ 0 and a stress of 0 on, and below lines are
        slack. Between points the curve is smooth and rises (PCHIP); beyond the last point its last slope goes on, and
        results that lie there get a warning. Its modulus is its largest slope.
    tension : list of list of float or str, optional
        The same as tension, [[strain, tension in N], ...], or a file with ``strain`` and ``tension`` [N]: of a rope
        that is sold without a section, whose area then counts for mass and stress alone.
    yield_stress : float, optional
        Of the law "elastic-plastic": stress at which a line yields [Pa], > 0. It keeps its elongation: unloaded, it is
        slack below it. Statics takes plastic strains on at each load step, and what happens between two of them does
        not show. ± of tension, strain and energy are proven under dead loads, beside lines of convex laws, as long as
        no line has turned back and all that yield harden; else they are estimates.
    hardening : float or list of list of float, optional
        Of the same law: the slope of the yield stress over plastic strain [Pa], ≥ 0 and 0 by default, which is a brake
        that pays out at constant force; or points of that curve, [[plastic strain, stress in Pa], ...], from a plastic
        strain of 0 on in place of ``yield_stress``. Its last slope goes on.
    parameters : dict of str to float, optional
        Numbers that a law of another package asks for, by name.
    strength : float, optional
        Stress at which a line breaks [Pa]; utilisation is reported against it.
    safety_factor : float
        Factor on the largest stress in the margin of safety [1], > 0. The margin of a line is
        strength × knot_factor / (safety_factor × largest stress) − 1, and ``refweb report`` gives the smallest of all
        lines; nothing else depends on the two factors.
    knot_factor : float
        Share of the strength that is left at knots [1], > 0 and ≤ 1.
    order : {1, 2, 3}
        Order of the elements: straight, quadratic, cubic.
    subdivide : int
        Elements per line.
    viscous : Viscous, optional
        Arms of viscoelastic lines.
    groups : dict of str to Group
        Values that differ by group of lines; groups that share lines give them different keys.

    Raises
    ------
    InputError
        For an unknown law or order, a number out of these bounds, slackness or smoothing, of a group as well, with
        another law than the smooth one, and two of prestrain, pretension and sag; from ``properties``, the same of a
        line in several groups, for a group that no line has, two groups that give one key to the same line, a key that
        the law of a line does not take or does not have, prestrain, pretension or sag of a web whose natural lengths
        are given, and a line whose stiffness or mass is above `refweb.tables.LARGEST`.

    Examples
    --------
        [cable]
        law = "tension-only"
        modulus = 7e7
        area = 1e-4
        density = 200.0
    """

    either: ClassVar[tuple[tuple[str, ...], ...]] = EITHER

    law: str = choice(LAWS, default="smooth")
    material: str | None = choice(*MATERIALS, default=None)
    modulus: Any = real(default=None, above=0, unit="Pa")
    area: float = real(above=0, unit="m²")
    density: Any = real(default=None, **_DENSE)
    slackness: float | None = real(default=None, at_least=0, unit="1")
    smoothing: float | None = real(default=None, at_least=0, unit="1")
    prestrain: float = real(default=0.0, above=-1, unit="1")
    pretension: float | None = real(default=None, unit="N")
    sag: float | None = real(default=None, at_least=0, at_most=DEEPEST, unit="1")
    force_density: float | None = real(default=None, unit="N/m")
    stress: Any = points(unit="Pa")
    tension: Any = points(unit="N")
    yield_stress: float | None = real(default=None, above=0, unit="Pa")
    hardening: Any = hardening_key()
    parameters: dict[str, Any] | None = numbers_by_name()
    strength: float | None = real(default=None, above=0, unit="Pa")
    safety_factor: float = real(default=1.0, above=0, unit="1")
    knot_factor: float = real(default=1.0, above=0, at_most=1, unit="1")
    order: int = choice(1, 2, 3, default=1)
    subdivide: int = integer(default=1, at_least=1, at_most=1000)
    viscous: Viscous | None = part(Viscous)
    groups: dict[str, Group] = by_group(Group, "cable", default_factory=dict)

    def check(self) -> None:
        """Fill in what the material gives and the smooth law's parameters; refuse what does not fit together."""
        own_modulus = self.modulus
        _fill(self)
        _check_lengths(self)
        law_keys.check(self, own_modulus)
        check_yield(self)
        tables = (self, *self.groups.values())
        needs = any((table.law or self.law) != "table" and table.modulus is None for table in tables)
        for key, unit in (("modulus", "Pa"), ("density", "kg/m³")):
            if getattr(self, key) is None and (needs or key != "modulus"):
                raise InputError(
                    f"{key} is missing: give {key} = ... [{unit}] or a material, see refweb help materials"
                )
        for owner in (self, *self.groups.values()):
            for key in SMOOTH_LAW:
                law, value = owner.law or self.law, getattr(owner, key)
                if law != "smooth" and value is not None:
                    raise InputError(f'{key} = {value:g} has no meaning with law = "{law}": leave it out')
        if self.law == "smooth":
            for key, default in SMOOTH_LAW.items():
                if getattr(self, key) is None:
                    object.__setattr__(self, key, default)
            return
        groups = {name: group.filled() if group.law == "smooth" else group for name, group in self.groups.items()}
        object.__setattr__(self, "groups", groups)

    def with_smoothing(self, share: float) -> Cable:
        """The cable with a share of its smoothing and of that of its groups."""
        groups = {name: _smoothed(group, share) for name, group in self.groups.items()}
        return replace(_smoothed(self, share), groups=groups)

    def properties(self, web: Web, quasi_static: bool = False) -> dict[str, NDArray[Any]]:
        """Values for each line of a web; ``quasi_static`` with the modulus of arms that act in statics.

        Returns
        -------
        dict of str to ndarray
            ``law`` (its name), ``modulus``, ``area``, ``density``, ``slackness``, ``smoothing``, ``strength``
            (infinite where none is given), ``safety_factor``, ``knot_factor`` and ``natural_length``, each of shape
            (lines,).

        Raises
        ------
        InputError
            For a group that no line has, two groups that give the same key to one line, a key that the law of a line
            does not take or does not have, or one of natural length beside given natural lengths.
        """
        values = self._values(web)
        _check_laws(values)
        if "curve" in values:
            lines = values["law"] == "table"
            steepest = np.array([curve.steepest for curve in values["curve"][lines]])
            by_tension = np.array([curve.unit == "N" for curve in values["curve"][lines]])
            values["modulus"][lines] = steepest / np.where(by_tension, values["area"][lines], 1.0)
        alone = {key: values[key] for key in ("modulus", "curve") if key in values}
        values |= law_keys.with_springs(values, self._at_once(web, values["law"]))
        if (values["law"] == LAW).any():
            values["yield_curve"] = np.fromiter(yield_curves(self, web), dtype=object)
        values["natural_length"] = _natural_lengths(web, values)
        values |= {} if quasi_static else alone
        forming, area = _forming(values["law"]), values["area"]
        density, force = values.pop("force_density"), values.pop("pretension")
        with np.errstate(over="ignore"):
            size = np.where(values["law"] == "force-density", density * values["natural_length"], force)
            values["modulus"] = np.where(forming, size / area, values["modulus"])
            stiffness = np.abs(values["modulus"]) * area / values["natural_length"]
            mass = values["density"] * values["area"] * values["natural_length"]
        for name, value, unit in (("stiffness modulus × area / length", stiffness, "N/m"), ("mass", mass, "kg")):
            bad = np.flatnonzero(~(value <= LARGEST))
            if len(bad):
                raise InputError(f"[cable] line {bad[0]}: {name} = {value[bad[0]]:g} must be ≤ {LARGEST:g} [{unit}]")
        return values

    def _at_once(self, web, law):
        """Modulus that the arms add at rest [Pa]; refuses arms of lines that they do not fit."""
        if self.viscous is None:
            return 0.0
        with refused_at("[cable] viscous"):
            chosen = self.viscous.chosen(web)
            for line in chosen[_forming(law)[chosen]][:1]:
                raise InputError(f'line {line} has law = "{law[line]}" of form finding: leave it out')
            known = np.array([law_of(name).cone or law_of(name).bar or name == "table" for name in law])
            for line in chosen[~known[chosen]][:1] if self.viscous.statics == "short" else ():
                raise InputError(
                    f'statics = "short" must be "long" with law = "{law[line]}", which line {line} has: with arms that '
                    "act as springs it is another law"
                )
            return self.viscous.at_once(web)

    def _values(self, web):
        """Values that the cable and its groups give to each line, by key."""
        given, values = givers(web.groups, self.groups, len(web.lines), "[cable.groups]"), {}
        widest = np.array([self.law, *(group.law or "" for group in self.groups.values())]).dtype
        missing = {
            "strength": np.inf,
            "modulus": np.nan,
            "yield_stress": np.nan,
            "slackness": 0.0,
            "smoothing": 0.0,
            **dict.fromkeys((*LENGTHS[1:], DENSITY), np.nan),
        }
        without = ("material", "parameters", "hardening", *law_keys.CURVES)
        for key in (f.name for f in fields(Group) if f.name not in without):
            values[key] = np.full(len(web.lines), _number(self, key, missing), widest if key == "law" else float)
            for number, group in enumerate(self.groups.values()):
                if key in given and getattr(group, key) is not None:
                    values[key][given[key] == number] = _number(group, key, missing)
        _replace_lengths(values, given)
        by_group, forming = given.get("law", np.full(len(web.lines), -1)) >= 0, _forming(values["law"])
        left_out = {  # of what the cable gives to lines of its own law
            DENSITY: values["law"] != "force-density",
            "pretension": values["law"] == "force-density",
            "prestrain": forming,
            "sag": forming,
        }
        for key, lines in left_out.items():
            by_key = given.get(key, np.full(len(by_group), -1)) >= 0
            values[key][lines & by_group & ~by_key] = 0.0 if key == "prestrain" else np.nan
        plain = values["law"] != "smooth"
        for key in SMOOTH_LAW:
            for line in np.flatnonzero(plain & (given.get(key, np.full(len(plain), -1)) >= 0))[:1]:
                group, law = list(self.groups)[given[key][line]], values["law"][line]
                raise InputError(
                    f"[cable.groups] {quote(group)} gives {key} to line {line}, where it has no meaning with law = "
                    f'"{law}"'
                )
            values[key][plain] = 0.0
        if (values["law"] == "table").any() or any(key in given for key in law_keys.CURVES):
            values["curve"] = law_keys.curves_of(self, values["law"], given)
        return values | law_keys.parameters_of(self, values["law"], given)


def _forming(laws):
    """True for each law by name that is one of form finding, an array."""
    forming = [name for name in names_in(laws) if law_of(name).forming]
    return np.isin(laws, forming) if forming else np.zeros(len(laws), dtype=bool)


def _fill(table):
    """Set the keys of a cable or a group that are absent to the values of its material."""
    for key in FILLED if table.material else ():
        if getattr(table, key) is None:
            object.__setattr__(table, key, getattr(MATERIALS[table.material], key))


def _check_lengths(table):
    """Refuse two keys of natural length in one table, and a force density that is none."""
    keys = [key for key in LENGTHS if getattr(table, key) not in (None, 0.0 if key == "prestrain" else None)]
    if len(keys) > 1:
        first, second = (f"{key} = {getattr(table, key):g}" for key in keys[:2])
        raise InputError(f"{first} and {second} both say what the natural length is: leave one of them out")
    if table.force_density == 0.0:
        raise InputError("force_density = 0 must not be 0 [N/m]: leave the line out of the web")


def _replace_lengths(values, given):
    """Leave to lines whose natural length groups give nothing of what the cable gives of it."""
    by = [given[key] >= 0 for key in LENGTHS if key in given]
    if not by:
        return
    for line in np.flatnonzero(np.sum(by, axis=0) > 1)[:1]:
        raise InputError(f"[cable.groups] line {line} has two of {', '.join(LENGTHS)}: give it one of them")
    for key, none in zip(LENGTHS, (0.0, np.nan, np.nan), strict=True):
        values[key][np.any(by, axis=0) & ~(given.get(key, np.full(len(by[0]), -1)) >= 0)] = none


def _check_laws(values):
    """Refuse what the law of a line does not take, and what it does not have."""
    law, density, force = values["law"], values[DENSITY], values["pretension"]
    forming, needs = _forming(law), {"force-density": density, "constant-force": force}
    taken = [
        (DENSITY, ~np.isnan(density) & (law != "force-density")),
        ("pretension", ~np.isnan(force) & (law == "force-density")),
        ("prestrain", forming & (values["prestrain"] != 0.0)),
        ("sag", forming & ~np.isnan(values["sag"])),
    ]
    for key, wrong in taken:
        for line in np.flatnonzero(wrong)[:1]:
            raise InputError(
                f'[cable] {key} = {values[key][line]:g} has no meaning with law = "{law[line]}", which line {line} has'
                ": leave it out"
            )
    for name, key in (("force-density", DENSITY), ("constant-force", "pretension")):
        missing = np.isnan(needs[name]) | (needs[name] == 0.0)
        for line in np.flatnonzero((law == name) & missing)[:1]:
            unit = "N/m" if key == DENSITY else "N"
            raise InputError(f'[cable] law = "{name}" of line {line} needs {key} = ..., not 0 [{unit}]')


def _natural_lengths(web, values):
    """Natural length of each line [m], shape (lines,); takes the keys that say so out of the values."""
    prestrain, sag = values.pop("prestrain"), values.pop("sag")
    tension, forming = values["pretension"], _forming(values["law"])
    tense, hangs = ~np.isnan(tension) & ~forming, ~np.isnan(sag)
    for key, given, value in (
        ("prestrain", prestrain != 0.0, prestrain),
        ("pretension", tense, tension),
        ("sag", hangs, sag),
    ):
        for line in np.flatnonzero(given)[:1] if web.length_given else ():
            raise InputError(f"[cable] {key} = {value[line]:g} cannot be used: the web's natural lengths are given")
    strain = prestrain.copy()
    if tense.any():
        with refused_at("[cable] pretension:"):
            strain += strains_of(values, np.where(tense, tension, 0.0))
    length = web.natural_length / (1.0 + strain)
    if hangs.any():
        from .sag import over_chord

        length[hangs] *= over_chord(sag[hangs])
    return length


def _smoothed(table, share):
    """A cable or a group of it with a share of its smoothing, where it has one."""
    return table if table.smoothing is None else replace(table, smoothing=share * table.smoothing)


def _number(table, key, missing):
    """A value of a cable or a group, that of ``missing`` where it has none."""
    value = getattr(table, key)
    return missing[key] if value is None else value
