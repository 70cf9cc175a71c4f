"""Problem of a sizing: the space of designs with the formulas of what is least and what is required, checked.

May change: private functions, texts of errors, and `ALIKE`. Must stay: names in formulas, which are those of results,
of free numbers and of `refweb.sizing.case.QUANTITIES`; attributes of `Problem`, which `size`, `runs`, `search` and
`smooth` read; that all of the file is checked before the first run. Tests: ``tests/sizing/test_size.py``.
"""

from __future__ import annotations

import ast
import itertools
import math
from typing import Any

from ..errors import InputError, in_file
from ..messages import quote, short
from ..results.observables.observe import bounds_by_name
from ..sweeps.expressions import ANY, Interval, exact
from .case import QUANTITIES, SIZES, sizes_of
from .formulas import MOST_SIDES, Criterion
from .requirements import Free
from .space import Design, Space, setting

ALIKE = 1e-12
"""Relative difference of sizes up to which a free number has no effect on them."""
TRIED = 8
"""Number of values of names with which a formula must have a value once."""


class Problem:
    """A requirements file with its scenes and formulas.

    Parameters
    ----------
    sizing : refweb.Sizing
        The requirements.

    Attributes
    ----------
    space : refweb.sizing.space.Space
        Space of designs.
    objective : refweb.sizing.formulas.Criterion
        Formula of the objective.
    requirements : dict of str to refweb.sizing.formulas.Criterion
        Conditions by name.
    used : set of str
        Names that formulas use, without free numbers.
    static : bool
        True if all scenes are of statics.
    drawn : list of dict
        Values by path of each draw.

    Raises
    ------
    InputError
        For unknown names and paths, values that make no scene, a requirement that is always or never true,
        limits that exclude each other, formulas that never have a value, and a minimum that depends on no free number.
    """

    def __init__(self, sizing):
        self.sizing, self.space = sizing, Space(sizing)
        self.drawn = sizing.drawn()
        first = Design(tuple(self.space.starts(1, 0)[0]) if self.space.free else (), (0,) * len(self.space.listed))
        for design in self._beside(first):
            self.space.scene(design, self.drawn[0])  # each end and option makes a scene
        names: Any = None
        scenes = []
        for design in self._each_scene(first):
            *_, scene = self.space.scene(design, self.drawn[0])
            scene.build()
            scenes.append(scene)
            of_throw = [] if scene.throw is None else scene.throw.numbers
            named = [*(o.name for o in scene.observables), *of_throw]
            names = named if names is None else [name for name in names if name in named]
        self.static = all(scene.solve.kind == "static" for scene in scenes)
        known = [*names, *(name for name in QUANTITIES if name not in names)]
        for name in self.space.names:
            if name in known:
                raise InputError(f"parameters: {short(name)} is the name of a result: choose another, with paths")
        self._refuse_twice()
        with in_file("minimise"):
            self.objective = Criterion(sizing.minimise, [*self.space.names, *known], False)
        self.requirements, within = {}, self._within(scenes)
        for name, requirement in sizing.requirements.items():
            with in_file(f"requirements: {short(name)}"):
                self.requirements[name] = Criterion(requirement.condition, [*self.space.names, *known], True)
                self._refuse_undecided(self.requirements[name], within)
                self._refuse_certain(self.requirements[name], within)
                self._refuse_equations(self.requirements[name], {*names, *QUANTITIES, *self.space.free} - {*of_throw})
        formulas = [self.objective, *self.requirements.values()]
        self.used = {name for formula in formulas for name in formula.used} - set(self.space.names)
        self.quantities = tuple(name for name in QUANTITIES if name in self.used)
        self.results = tuple(name for name in (*names, *QUANTITIES) if name in self.used)
        with in_file("minimise"):
            self._refuse_undecided(self.objective, within)
            self._refuse_constant(first)
        self._refuse_contradictions()

    def sides(self):
        """Requirements by name for each choice of the sides of conditions with ``or``; none where they are too many."""
        names, counts = list(self.requirements), [range(f.count) for f in self.requirements.values()]
        if math.prod(map(len, counts)) > MOST_SIDES:
            return []
        return [
            {name: self.requirements[name].side(n) for name, n in zip(names, chosen, strict=True)}
            for chosen in itertools.product(*counts)
        ]

    def _each_scene(self, first):
        """The first design with each of the scenes."""
        yield first
        for number in range(1, len(self.space.bases)):
            yield Design(first.shares, (number, *first.options[1:]))

    def _beside(self, first):
        """The first design with each end of each number between bounds, and with each other option."""
        for n in range(len(first.shares)):
            for end in (0.0, 1.0):
                yield Design((*first.shares[:n], end, *first.shares[n + 1 :]), first.options)
        for n, options in enumerate(self.space.listed.values()):
            for number in range(1, len(options)):
                yield Design(first.shares, (*first.options[:n], number, *first.options[n + 1 :]))

    def _refuse_twice(self):
        """Refuse two free numbers at one path."""
        at = {}
        for name, given in self.sizing.parameters.items():
            options = self.space.listed.get(name, ())
            of_free = [setting(path, 1.0)[0] for path in given.paths] if isinstance(given, Free) else []
            for path in dict.fromkeys([*of_free, *(path for option in options for path in option.settings)]):
                if path in at:
                    raise InputError(f"parameters: {short(name)} and {short(at[path])} both set {path}: leave one out")
                at[path] = name

    def _within(self, scenes):
        """Interval of each name over all designs; values of options that are no numbers are left out."""
        values = {}
        for scene in scenes:
            for name, (low, high) in bounds_by_name(scene.to_dict()).items():
                before = values.get(name, Interval(math.inf, -math.inf))
                values[name] = Interval(min(low, before.low), max(high, before.high))
        values |= dict.fromkeys((*SIZES, "utilisation"), Interval(0.0, math.inf)) | {"margin": Interval(-1.0, math.inf)}
        values |= {name: Interval(f.low, f.high) for name, f in self.space.free.items()}
        for name, options in self.space.listed.items():
            labels = [option.label for option in options]
            if all(isinstance(label, int | float) and not isinstance(label, bool) for label in labels):
                values[name] = Interval(min(labels), max(labels))
        return values

    def _refuse_certain(self, formula, within):
        """Refuse a requirement that holds for all designs, or for none, of `_within`."""
        values = dict.fromkeys(formula.used - set(self.space.listed), ANY) | within
        if formula.used <= values.keys() and (verdict := formula(values)) is not None:
            always = "is true of every design within bounds" if verdict else "is true of no design within bounds"
            raise InputError(f"{quote(formula.text)} {always}: leave it out or change its limit")

    def _refuse_undecided(self, formula, within):
        """Refuse a formula that has no value, whatever numbers names have: of `TRIED` ones within bounds."""
        values = {}
        for number in range(TRIED):
            for n, name in enumerate(sorted(formula.used)):
                low, high = within.get(name, ANY)
                values[name] = exact(min(max((1.0 + 0.37 * n) * 10.0 ** (2 * number - TRIED), low), high))
            if formula.is_decided(values):
                return
        raise InputError(
            f"{quote(formula.text)} has no value, whatever its names are, as a division by 0: check its divisors and "
            "roots"
        )

    def _refuse_contradictions(self):
        """Refuse limits of one name that exclude each other: in a requirement, and in all without a probability."""
        sure = {name: f for name, f in self.requirements.items() if self.sizing.requirements[name].probability is None}
        for group in [{name: f} for name, f in self.requirements.items()] + [sure]:
            sides = [f.limits for f in group.values()]
            if not group or math.prod(map(len, sides)) > MOST_SIDES:
                continue
            empty = [_excluded(chosen) for chosen in itertools.product(*sides)]
            if all(empty):
                raise InputError(f"requirements: {', '.join(map(short, group))}: {empty[0]}: change one of them")

    def _refuse_equations(self, formula, measured):
        """Refuse a condition that results or numbers between bounds are equal to something."""
        if any(isinstance(node, ast.Eq) for node in ast.walk(formula.tree)) and (of := sorted(formula.used & measured)):
            remedy = f"give a range, abs({of[0]} - value) < width"
            raise InputError(f"{quote(formula.text)}: an equation holds for no whole ± of {of[0]}: {remedy}")

    def _refuse_constant(self, first):
        """Refuse a minimum of sizes that are the same for all designs, or of nothing that depends on the design."""
        used = self.objective.used
        if not used:
            raise InputError(f"{quote(self.sizing.minimise)} depends on no free number, such as cable_mass does")
        if not used <= set(SIZES):
            return
        before = self._sizes(first, used)
        if any(_differ(before, self._sizes(design, used)) for design in self._beside(first)):
            return
        numbers = ", ".join(self.space.names)
        raise InputError(f"{quote(self.sizing.minimise)} does not depend on {numbers}: every design is as good")

    def _sizes(self, design, used):
        *_, scene = self.space.scene(design, self.drawn[0])
        sizes = sizes_of(scene.build())
        return [sizes[name] for name in sorted(used)]


def _excluded(limits):
    """Text of limits of a name, dicts by name, that exclude each other; None where there are none."""
    together = {}
    for name, (low, high) in itertools.chain(*(part.items() for part in limits)):
        below, above = together.get(name, ANY)
        together[name] = below, above = max(low, below), min(high, above)
        if below > above:
            return f"no {short(name)} is above {below:g} and below {above:g}"
    return None


def _differ(before, after):
    return any(abs(a - b) > ALIKE * max(abs(a), abs(b)) for a, b in zip(before, after, strict=True))
