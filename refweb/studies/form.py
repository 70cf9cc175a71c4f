"""Form finding: a scene of elastic lines that are in equilibrium as they stand.

Lines with a force density, T = q l, or a constant force find a shape whatever they are made of. Lines of a material
have these tensions in that shape where their natural lengths are L = l/(1 + ε(T)). The mass of a line follows its
natural length: where weight acts, shape and natural lengths are found in turn.

May change: private functions, `ROUNDS`, `SETTLED` and `STAYS`, limits of the iteration. Must stay: `form`, its
arguments and result, which `refweb` exports; `SELECTED`, which holds all keys that select nodes: a new one goes there.
Tests: ``tests/studies/test_form.py``.

References
----------
H.-J. Schek, "The force density method for form finding and computation of general networks", Comput. Methods Appl.
Mech. Eng. 3 (1974) 115–134, doi:10.1016/0045-7825(74)90045-0.
"""

from __future__ import annotations

from dataclasses import fields, replace
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError, SolverError, in_file
from ..net.inline import Inline
from ..net.tension_laws import law_of, strains_of
from ..registry import EFFECTS, STATICS, load, name_of
from ..scene import Scene
from ..statics.equilibrium import LIMIT, force_scale, residual
from ..system.static_system import at_rest

if TYPE_CHECKING:
    from os import PathLike

    from ..net.cable import Cable

ROUNDS = 100
"""Largest number of shapes that are found in turn with natural lengths."""
SETTLED, STAYS = 1e-14, 1e-10
"""Change of natural lengths over the longest at which they are found, and from which on they are where it stays."""
SELECTED = ("node", "nodes", "clamp")
"""Keys of tables that select nodes."""


def form(scene: Scene | str | PathLike[str], cable: Cable | None = None) -> Scene:
    """Make a scene of elastic lines whose equilibrium is the shape that a scene finds.

    Parameters
    ----------
    scene : Scene, path-like or str
        A static scene, a scene file or the name of a scene shipped with refweb, with lines of the law "force-density"
        or "constant-force"; lines of other laws may stand beside them. The shape is that of its last load step.
    cable : Cable, optional
        Material of all lines of the scene that is made. By default the one of ``scene``, where lines of form finding
        that pull are "tension-only" and those that push are "linear", of its modulus.

    Returns
    -------
    Scene
        A web of the shape, as `refweb.Inline`, whose natural lengths hold the tensions that were found; supports,
        effects and observables are those of ``scene``, and its load step is the last. `refweb.run` finds no
        displacement but rounding.

    Raises
    ------
    InputError
        For a dynamic scene, lines of several elements, [[motion]], which would move the shape once more, a material
        with a law of form finding, with natural lengths of its own or that is heavier or lighter than that of the
        scene, and a line that pushes and whose law does not.
    SolverError
        Where there is no equilibrium or none is found, and where effects see the shape otherwise than it was found.

    Examples
    --------
        made = refweb.form("tent.toml", refweb.Cable(law="tension-only", modulus=1e11, area=1e-5, density=7850))
        solution = refweb.run(made)
    """
    scene = (scene if isinstance(scene, Scene) else Scene.load(scene)).settled()
    with in_file(scene.file):
        web = _web_of(scene)
        made = _formed(scene, web, _material(scene.cable) if cable is None else cable, keeps=cable is None)
        _check_at_rest(made)
    return made


def _web_of(scene):
    """The web of a scene; refuses what form finding does not take."""
    if scene.solve.kind != "static":
        raise InputError('[solve] kind = "dynamic" must be "static" for form finding')
    if scene.cable.subdivide > 1 or scene.cable.order > 1:
        raise InputError(
            f"[cable] subdivide = {scene.cable.subdivide}, order = {scene.cable.order} must be 1 for form finding, "
            "whose lines are straight: give the web more lines"
        )
    if any(name_of(EFFECTS, effect) == "motion" for effect in scene.effects):
        raise InputError("[[motion]] cannot be used in form finding: give the web the positions that it leads to")
    return scene.build().net.web


def _material(cable):
    """The cable with elastic laws in place of those of form finding, and natural lengths that are given."""
    groups = {name: _elastic(group, cable) for name, group in cable.groups.items()}
    return replace(_elastic(cable, cable), groups=groups)


def _elastic(table, cable):
    """A cable or a group as `_material` has it."""
    law, changes = table.law or cable.law, {"prestrain": 0.0 if table is cable else None, "sag": None}
    if law_of(law).forming:
        force = table.force_density if law == "force-density" else table.pretension
        if table.law is not None or force is not None:
            changes["law"] = "linear" if force is not None and force < 0.0 else "tension-only"
    return replace(table, force_density=None, pretension=None, **changes)


def _formed(scene, web, material, keeps):
    """The scene of the shape; ``keeps`` says that lines that are elastic already keep their natural lengths."""
    made = material.properties(replace(web, length_given=False))
    lengths, before = web.natural_length, np.inf
    for _ in range(ROUNDS):
        system = scene.replace(web=replace(web, natural_length=lengths, length_given=web.length_given)).build()
        *_, state = load(STATICS[scene.solve.method])(at_rest(system), scene.solve.load_steps, None)
        net = system.at(state.step).net
        points = (net.points + state.x)[: net.nodes]
        elastic = ~net.forming & ((state.tension == 0.0) | keeps)
        found_lengths = _natural_lengths(web, points, np.where(elastic, 0.0, state.tension), made)
        natural = np.where(elastic, net.natural_length, found_lengths)
        change = np.abs(natural - lengths)[net.forming].max(initial=0.0) / natural.max()
        if change <= SETTLED or 0.5 * before <= change <= STAYS:
            break
        lengths, before = np.where(net.forming, natural, web.natural_length), change
    else:
        raise SolverError(f"natural lengths still change by {change:.1e} after {ROUNDS} shapes: lower the density")
    inline = Inline(
        points=points,
        lines=web.lines,
        natural_length=natural,
        supports=web.rim,
        names=web.names,
        groups={name: members.tolist() for name, members in web.groups.items()},
    )
    return scene.replace(
        web=inline,
        cable=material,
        effects=tuple(_with_numbers(effect, web) for effect in scene.effects),
        supports=None if scene.supports is None else _with_numbers(scene.supports, web),
        support=tuple(_with_numbers(support, web) for support in scene.support),
        observe=tuple(_with_numbers(observe, web) for observe in scene.observe),
        solve=replace(scene.solve, load_steps=(state.step,)),
        title=f"{scene.title}, formed",
    )


def _natural_lengths(web, points, tension, made):
    """Natural length of each line that has its tension at these points [m]; of one without any its length."""
    length = np.linalg.norm(points[web.lines[:, 1]] - points[web.lines[:, 0]], axis=1)
    return length / (1.0 + strains_of(made, tension))


def _with_numbers(table, web):
    """A table with numbers of nodes in place of names that the place of nodes gives."""
    changes = {}
    for key in (f.name for f in fields(table) if f.name in SELECTED):
        names = value if isinstance(value := getattr(table, key), tuple) else (value,)
        if any(name in ("centre", "corners") and name not in web.names for name in names):
            changes[key] = tuple(web.find_around(value).tolist())
    return replace(table, **changes) if changes else table


def _check_at_rest(scene):
    """Refuse a scene that is in no equilibrium as it stands."""
    system, step = at_rest(scene.build()), scene.solve.load_steps[-1]
    none = np.zeros((system.rows, 3))
    force, per_cell = system.forces(step, none)
    error = residual(system, force, force_scale(system, step, none, per_cell.tension))
    if error > LIMIT:
        node = int(np.linalg.norm(np.where(system.supported, 0.0, force), axis=1).argmax())
        raise SolverError(
            f"the shape is no equilibrium of the scene that is made, residual {error:.1e} at {system.row_name(node)}: "
            "give its cable the density and the area that the shape was found with, and leave out effects that see "
            "the web as it was before"
        )
