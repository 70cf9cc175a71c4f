"""From the parts of a scene to the `refweb.system.system.System`, and what does not fit together.

Every refusal is an `InputError` whose message begins with the table it stands in.

May change: private functions, words of messages, and `MAX_WINDOWS`, a limit of what is accepted, with which `NEAR` of
`integrators.averages` has to stay far below a cell. Must stay: the arguments of `build`, by name, which `Scene` alone
gives; memory is checked before anything large is made; `_acting` puts bodies and threads first, since other effects use
what they add; effects of the lines stand ahead of all others, and `Elasticity` first: its term is number 0, which the
compiled loop takes as that of the lines by position; ``effect`` of `_Placed`, which `dynamics.commands` reads and sets
by name; messages begin with their table. A check of what does not fit together belongs here, one of a single value in
the class of its table. Tests: ``tests/test_build.py``, ``tests/test_scene.py``.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from . import memory
from .effects.base import refuse_found
from .effects.elasticity import Elasticity
from .errors import InputError, refused_at
from .messages import nearest, quote
from .net import discretisation
from .net.web import Web
from .registry import EFFECTS, INTEGRATORS, load, name_of
from .results.columns import taken
from .settings import START_STATES
from .system.system import System

MAX_WINDOWS = 1e4
"""Largest number of windows, of observables that are averaged, that a run is long."""


def build(web, cable, effects, supports, support, solve, output, accuracy, observables, events, folder):
    """The `refweb.system.system.System` of the parts of a `refweb.Scene`, whose fields they are.

    Relative paths start at ``folder``, a `pathlib.Path` or None. Whatever does not fit together is an `InputError`.
    """
    web = _web(web, folder)
    _check_memory(len(web.lines), cable, effects, solve)
    _check_history(solve, output, len(observables))
    static, consistent = solve.kind == "static", solve.mass == "consistent"
    implicit = [name for name, method in INTEGRATORS.items() if "linear_solver" in method.keys]
    explicit = not static and solve.start != "equilibrium" and solve.method not in implicit
    net = discretisation.build(web, cable, quasi_static=static, consistent=consistent, explicit=explicit)
    net = replace(net, end=float(max(solve.load_steps) if net.quasi_static else solve.duration))
    _check_forming(net, solve)
    supported = _supported(net, supports, support)
    system = System(net, [*_of_lines(cable, net), *_acting(effects)], supported, solve.factorization)
    if len(net.web.broken):
        from .system.broken_lines import with_broken_lines
        from .system.static_system import refuse_broken

        with refused_at("[web]"):
            system = with_broken_lines(system)
            if net.quasi_static or solve.start == "equilibrium":
                refuse_broken(system.net)
    if system.net.flows:
        with refused_at("[[winch]]" if all(flow.wound for flow in system.net.flows) else "[[reel]]"):
            _ = system.material_flow
    _check_bare(system)
    _check_carried(system, supported, solve)
    _check_motions(system, effects)
    if system.constraints:
        _check_links(solve)
    _check_start(solve, accuracy)
    if solve.method in INTEGRATORS and INTEGRATORS[solve.method].knob == "rtol":
        refuse_found(system.terms, f'method = "{solve.method}"')
    if getattr(solve, "start", "web") == "equilibrium":
        refuse_found(system.terms, 'start = "equilibrium"')
    system.initial_velocity()
    if system.laid is not None and solve.start != "web":
        raise InputError(f'[solve] start = {quote(solve.start)} must be "web" with [fold], which is a start of its own')
    _check_observables(observables, system, solve)
    _check_names(events, system)
    for i, event in enumerate(events):
        with refused_at(f"[[event]] {i + 1}"):
            _check_event(event, [earlier.name for earlier in events[:i]], observables, system)
    return system


def _of_lines(cable, net):
    """Effects of the cable itself: the law of its lines, and their arms; statics has these in its modulus."""
    of_lines: list = [Elasticity()]
    if net.law_is("plastic").any():
        from .effects.plastic import PlasticLines

        of_lines.append(PlasticLines(cable))
    if cable.viscous is not None and len(of_lines) > 1:
        raise InputError('[cable] viscous cannot stand beside law = "elastic-plastic": leave one of them out')
    if cable.viscous is not None and not net.quasi_static:
        from .effects.viscous import ViscousArms

        of_lines.append(ViscousArms(cable.viscous))
    return of_lines


def _web(web, folder):
    """The web, made where it is a table."""
    if isinstance(web, Web):
        return web
    try:
        with refused_at("[web]"):
            return web.web(folder)
    except OSError as error:
        path = quote(getattr(web, "path", ""))
        raise InputError(f"[web] path = {path}: cannot be read: {error.strerror or error}") from None


def _check_bare(system):
    """Refuse nodes that nothing ties to the web."""
    linked = [constraint.cells.ravel() for constraint in system.constraints]
    linked += [thread.rows for thread in system.net.threads]
    bare = system.net.web.bare
    bare = bare[~np.isin(bare, np.concatenate([[], *linked]))]
    if len(bare):
        more = f" (and {len(bare) - 1} more)" if len(bare) > 1 else ""
        raise InputError(f"[web] node {bare[0]}{more} is used by no line, no [[link]] and no [[thread]]")


def _check_memory(lines, cable, effects, solve):
    """Refuse what does not fit into memory, before it is made."""
    bodies = sum(name_of(EFFECTS, effect) == "body" for effect in effects)
    explicit = solve.method in INTEGRATORS and INTEGRATORS[solve.method].knob == "safety"
    size = memory.needed(lines * cable.subdivide, cable.order, explicit, bodies)
    more = f", {bodies} bodies" * (bodies > 0)
    name = f"[web] {lines} lines with [cable] subdivide = {cable.subdivide}, order = {cable.order}"
    memory.check(size, f"{name}{more}")


def _check_history(solve, output, observables):
    """Refuse a history that does not fit into memory."""
    if solve.kind == "dynamic" and output.interval:
        rows = solve.duration / output.interval
        size = rows * memory.BYTES_PER_ROW * (memory.NUMBERS_PER_ROW + observables)
        memory.check(size, f"[output] interval = {output.interval:g}: {rows:.3g} rows of {observables} observables")


def _check_forming(net, solve):
    """Refuse laws of form finding for what is no form finding."""
    for element in np.flatnonzero(net.forming)[:1]:
        law = f'[cable] law = "{net.laws[net.law_index[element]].name}"'
        if solve.kind != "static":
            raise InputError(
                f'{law} is for form finding, [solve] kind = "static": run what refweb.form makes of that, which has '
                "elastic lines"
            )
        if solve.method == "relaxation" and any(law.name == "constant-force" for law in net.laws):
            law = 'law = "constant-force"'
            raise InputError(
                f'[solve] method = "relaxation" must be "newton" with {law}: no step is short enough for it'
            )


def _supported(net, supports, support):
    """Components that are held, bool, shape (rows, 3)."""
    supported = np.zeros((len(net.points), 3), dtype=bool)
    tables = [(f"[[support]] {i + 1}", table) for i, table in enumerate(support)]
    if supports is None:
        supported[net.web.rim] = True
    else:
        tables.insert(0, ("[supports]", supports))
    for key, table in tables:
        with refused_at(key):
            supported[np.ix_(net.find(table.nodes, "nodes"), table.components)] = True
    return supported


class _Placed:
    """An effect whose refusals begin with its table."""

    def __init__(self, key, effect):
        self.key, self.effect = key, effect

    def __getattr__(self, name):
        method = getattr(self.effect, name)

        def call(*arguments):
            with refused_at(self.key):
                return method(*arguments)

        return call


def _acting(effects):
    """Effects with the names of their tables: bodies, which others act on, threads, whose mass they take, the rest."""
    names = [name_of(EFFECTS, effect) for effect in effects]
    tables = list(dict.fromkeys(["body", "thread", *names]))
    acting, count = [], {}
    for name, effect in sorted(zip(names, effects, strict=True), key=lambda pair: tables.index(pair[0])):
        count[name] = count.get(name, 0) + 1
        for excluded in (excluded for excluded in effect.excludes if excluded in names):
            raise InputError(f"[{name}] has what [{excluded}] would bring: leave out one of them")
        if not effect.several and count[name] > 1:
            raise InputError(f"[{name}] is listed {count[name]} times: a scene has one")
        acting.append(_Placed(f"[[{name}]] {count[name]}" if effect.several else f"[{name}]", effect))
    return acting


def _check_motions(system, effects):
    """Refuse two motions of one node or body, and a body without mass that nothing moves."""
    driven = np.concatenate([d.cells[:, 0] for d in system.drives]) if system.drives else np.zeros(0, dtype=int)
    rows, times = np.unique(driven, return_counts=True)
    if (times > 1).any():
        raise InputError(f"[[motion]] {system.row_name(rows[times > 1][0])} is moved by two tables: merge them")
    bodies = [effect for effect in effects if name_of(EFFECTS, effect) == "body"]
    for number, (body, made) in enumerate(zip(bodies, system.net.bodies, strict=True), 1):
        if made.moved and made.base not in rows:
            raise InputError(f"[[body]] {number} {body.without_mass}")


def _check_carried(system, supported, solve):
    """Refuse nodes on bodies that are held, moved or linked as well, and what cannot follow free bodies with nodes."""
    attached = [node for body in system.net.bodies for node in body.carried]
    linked = np.concatenate([[], *(constraint.cells.ravel() for constraint in system.constraints)])
    for node in attached:
        if supported[node].any():
            raise InputError(f"[[attach]] node {node} is supported as well: leave it out of the supports")
        if sum((drive.cells[:, 0] == node).sum() for drive in system.drives) > (not system.carried[node]):
            raise InputError(f"[[attach]] node {node} is moved by [[motion]] as well: leave out one of them")
        if node in linked:
            raise InputError(f"[[attach]] node {node} has a [[link]] as well: tie the link to a node beside it")
    if system.carried.any() and solve.mass == "consistent":
        raise InputError(
            '[solve] mass = "consistent" must be "lumped" with [[attach]] to a free body, which has the mass of its '
            "nodes as points"
        )


def _takes_links(method):
    """Tell if a method holds lengths exactly; methods of statics do not."""
    return method in INTEGRATORS and getattr(load(INTEGRATORS[method].integrator), "takes_links", False)


def _check_links(solve):
    """Refuse links for what cannot hold them."""
    if solve.method != "auto" and not _takes_links(solve.method):
        method_keys = f'kind = "{solve.kind}" and method = "{solve.method}"'
        able = " or ".join(f'"{method}"' for method in INTEGRATORS if _takes_links(method))
        raise InputError(f'[[link]] needs [solve] kind = "dynamic" and method = {able}, not {method_keys}')
    if solve.start == "equilibrium":
        raise InputError('[solve] start = "equilibrium" knows no [[link]]: it must be "web" or a result folder')


def _check_start(solve, accuracy):
    """Refuse finer elements where the state to start from is that of these."""
    if solve.kind == "dynamic" and solve.start not in START_STATES and accuracy.refine:
        raise InputError(
            f"[accuracy] refine = true must be false with [solve] start = {quote(solve.start)}: the state "
            "in that folder is of these elements, and finer ones have other nodes"
        )


def _check_observables(observables, system, solve):
    """Refuse observables that the system does not have, and columns of one name."""
    columns = _own_columns(system)
    for i, observable in enumerate(observables):
        with refused_at(f"[[observe]] {i + 1}"):
            observable.on(system)
            _check_average(observable.average, solve)
            if (stands := columns.get(observable.name)) is not None:
                name = quote(observable.name)
                raise InputError(f"name = {name} is {stands} of history.csv: names are unique")
        columns[observable.name] = f"the name of [[observe]] {i + 1} and a column"


def _own_columns(system):
    """Tables and columns with reserved names, by name."""
    return dict.fromkeys(taken(system), "a column of its own")


def _check_names(events, system):
    """Refuse an event, a body, a group or a named node of the name of a column."""
    columns, web = _own_columns(system), system.net.web
    named = [(f"[[event]] {i} name = ", event.name) for i, event in enumerate(events, 1)]
    named += [("[[body]] name = ", body.name) for body in system.net.bodies]
    named += [*(("[web] group ", group) for group in web.groups), *(("[web] node ", node) for node in web.names)]
    for key, name in named:
        if name in columns:
            raise InputError(f"{key}{quote(name)} is {columns[name]} of history.csv: names are unique")


def _check_average(average, solve):
    """Refuse a window that is never full in a run, and one that slides through it in too many cells."""
    if average is None:
        return
    if average > solve.duration:
        raise InputError(f"average = {average:g} must be ≤ duration = {solve.duration:g} [s]: no window would be full")
    if average * MAX_WINDOWS < solve.duration:
        raise InputError(
            f"average = {average:g} must be ≥ {solve.duration / MAX_WINDOWS:g} [s], the duration over {MAX_WINDOWS:g}: "
            "a mean over so short a window is the value itself; leave it out"
        )


def _check_event(event, earlier, observables, system):
    """Refuse an event of what the system does not have, and one with the name of an ``earlier`` one."""
    if event.name in earlier:
        raise InputError(f"name = {quote(event.name)} is already used by [[event]] {earlier.index(event.name) + 1}")
    if event.kind == "contact":
        if not system.contact:
            raise InputError('kind = "contact" needs a [contact] in the scene')
        _check_touch(event, system)
    if event.kind == "taut" and event.thread is None:
        _check_taut(event, system.net)
    if event.thread not in (None, *(names := [thread.name for thread in system.net.threads])):
        hint = nearest(event.thread, names) if names else "the scene has no [[thread]]"
        raise InputError(f"thread = {quote(event.thread)} is not a thread, {hint}")
    if event.kind == "threshold" and event.observe not in (names := [o.name for o in observables]):
        raise InputError(f"observe = {quote(event.observe)} is not an observable, {nearest(event.observe, names)}")
    if event.kind == "threshold" and (average := observables[names.index(event.observe)].average) is not None:
        raise InputError(
            f"observe = {quote(event.observe)} is a mean, average = {average:g}, and events are found by values of an "
            "instant: name an observable without average"
        )


def _check_touch(event, system):
    """Refuse bodies that the scene does not have, and such as do not touch each other."""
    bodies = {body.name: body for body in system.net.bodies}
    if event.body is not None and event.body not in bodies:
        raise InputError(f"body = {quote(event.body)} is not a body, {nearest(event.body, bodies)}")
    if event.with_ in (None, "web"):
        return
    if event.with_ not in bodies:
        raise InputError(
            f"with = {quote(event.with_)} is not a body or the web, {nearest(event.with_, ['web', *bodies])}"
        )
    others = [bodies[event.body]] if event.body else list(bodies.values())
    if not system.contact_forces.pair_rows(bodies[event.with_], others):
        what = "another body" if event.body is None else f"body {quote(event.body)}"
        raise InputError(
            f"with = {quote(event.with_)} does not touch {what}: it takes two bodies, one of them free, and "
            "between_bodies = true in [contact]"
        )


def _check_taut(event, net):
    """Refuse lines that the web does not have, and such as do not snap taut at one strain."""
    slackness = net.slackness[np.isin(net.line, net.web.find_lines(event.line, "line"))]
    if np.ptp(slackness) > 0.0:
        raise InputError(
            f"line = {quote(event.line)}: these lines have slackness {slackness.min():g} … {slackness.max():g}, and "
            "snap taut at different strains: name lines of one slackness"
        )
