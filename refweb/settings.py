"""Settings of a scene: solver, supports and output, the tables that are neither web, cable nor effect.

May change: words of docstrings, which are the text of ``refweb help`` and of the schema: the reference is written anew
with them (CONTRIBUTING). Must stay: names, defaults and values (`START_STATES`) of keys, the format of scenes; keys of
`Dynamic` are also arguments of integrators, listed in `registry.INTEGRATORS`. A new key needs its docstring, a check of
its range and a line in CHANGELOG. Must stay as well: all names that `refweb`, `scene` and other files import; public
names of `Dynamic`, `Accuracy`, `Static`, `Event` and `Control`, which other files use. Tests: ``tests/test_scene.py``,
``tests/reference/test_schema.py``.
"""

from __future__ import annotations

import math
from typing import Any, Literal

from .accepted import accepts, any_of, array
from .errors import InputError
from .messages import quote
from .registry import FACTORIZATIONS, INTEGRATORS, STATICS
from .tables import (
    Several,
    Table,
    boolean,
    checked,
    choice,
    components,
    field,
    integer,
    nodes,
    numbers_by_name,
    numbers_list,
    real,
    rows,
    table,
    text,
    texts,
    vector,
)

START_STATES = ("web", "equilibrium")
"""Values of ``start`` besides a result folder."""


@table
class Head(Table):
    """The first lines of a scene file, before its tables.

    Parameters
    ----------
    schema : {1}
        Version of the format.
    title : str
        Title, by default the name of the file, and in Python "scene". Results of a run go to a folder of that name.
    seed : int
        Seed of whatever is random.

    Raises
    ------
    InputError
        For another schema, an empty title or one above 200 characters, and a negative seed.
    """

    schema: int = choice(1, default=1)
    title: str = text(default="scene", limit=200)
    seed: int = integer(default=0, at_least=0, at_most=2**63 - 1)


@table
class Supports(Table):
    """Nodes whose displacement is held at zero in some components.

    Parameters
    ----------
    nodes : int, str or list
        Nodes, by number or name; an empty list holds none.
    components : sequence of {0, 1, 2, "x", "y", "z"}
        Axes along which they are held, by default all three.

    Raises
    ------
    InputError
        For a negative number of a node, what is not an axis, and an empty list of axes; from `Scene.build`, for a node
        that the web does not have.

    Examples
    --------
        [supports]
        nodes = "corners"

        [[support]]
        nodes = "all"
        components = ["z"]
    """

    nodes: Several = nodes(empty=True)
    components: Several = components(default=("x", "y", "z"))


@table
class Static(Table):
    """Static solution at a list of load steps.

    Parameters
    ----------
    method : {"newton", "relaxation"}
        Newton's method or, independent of any tangent, dynamic relaxation, with which only results with a proven bound
        have ±.
    load_steps : sequence of float
        Values of t.
    mass : {"lumped", "consistent"}
        The weight is the same with either; the modes at the equilibrium and the centrifugal forces are not.
    factorization : {"auto", "qdldl", "supernodal", "superlu", "multifrontal", "rslab"}
        Library that factorizes the tangent, see `refweb.system.factorization`; "auto" takes qdldl for small nets,
        "supernodal" for larger ones, and for still larger ones rslab where it is installed and else "multifrontal".

    Raises
    ------
    InputError
        For an unknown method or mass, and a list of load steps that is empty, not finite or longer than 100 000.

    Examples
    --------
        [solve]
        kind = "static"
        load_steps = [1, 2, 3]
    """

    kind: Literal["static"] = choice("static", default="static")
    method: str = choice(STATICS, default="newton")
    load_steps: Several = numbers_list(default=(1.0,))
    mass: str = choice("lumped", "consistent", default="lumped")
    factorization: str = choice("auto", *FACTORIZATIONS, default="auto")

    def check(self) -> None:
        """Refuse more load steps than 100 000."""
        if len(self.load_steps) > 100_000:
            raise InputError(f"load_steps has {len(self.load_steps)} numbers, must be at most 100000")


@table
class Dynamic(Table):
    """Motion over a time.

    Parameters
    ----------
    method : {"central-difference", "explicit", "cvode", "ida", "auto"}
        Explicit central differences, explicit steps of higher order, or CVODE or IDA of SUNDIALS with steps that follow
        from the error; "auto" chooses by what the scene is, see `refweb.dynamics.method_choice`, and tries
        others where its choice cannot finish, see `refweb.dynamics.method_fallback`.
    duration : float
        Time to simulate [s].
    safety : float
        Of explicit steps: share of the bound of stability that a step is, 0 < safety ≤ 1; 0.5 by default.
    step_size : float, optional
        Instead: largest step [s]; the step used is the largest below it that divides a history row.
    order : {4, 6}
        Of "explicit": order of the steps, 6 by default, see `refweb.dynamics.integrators.splitting`.
    rtol : float
        Of CVODE and IDA: relative tolerance of displacements and velocities, 1e-6 by default.
    atol_position, atol_velocity : float, optional
        Absolute tolerances [m], [m/s]; by default rtol × 1e-3 of the shortest element, and rtol × 1e-3 of the speed of
        sound in the fastest.
    family : {"bdf", "adams"}
        Of CVODE: kind of multistep method, BDF by default.
    max_order : int, optional
        Highest order: 2 by default, of Adams methods 12.
    linear_solver : {"auto", "block", "sparse", "dense", "fixed-point"}
        How linear systems are solved, see `refweb.dynamics.integrators.sundials`.
    mass : {"lumped", "consistent"}
        Mass of the lines at their nodes: row sums of the consistent matrix, or the matrix itself.
    factorization : {"auto", "qdldl", "supernodal", "superlu", "multifrontal", "rslab"}
        Of CVODE, IDA and a start at an equilibrium: library that factorizes the tangent, as of `Static`.
    start : {"web", "equilibrium"} or path
        State at t = 0: the web as it is, its equilibrium under what acts at t = 0, or the last state in a result
        folder. Bodies of that folder go on with its velocities, those of statics with the velocities of their tables; a
        ``[[velocity]]`` comes in place of that of its nodes. Lines that have yielded, have Maxwell arms or are on
        winches need the same law, arms or winch, and threads that have slipped or are wound the same name, nodes,
        rings with friction and winch; others begin as new. A free body takes part in the equilibrium where it has no
        velocity, and carries nodes or touches a line where its table has it; others are held there meanwhile and feel
        nothing.

    Raises
    ------
    InputError
        For a duration, step or tolerance that is not > 0, a safety above 1 and an rtol that is not 1e-13 … 0.1; for a
        key of another method, order 5, and a BDF method of an order above 5.

    Examples
    --------
        [solve]
        kind = "dynamic"
        duration = 0.25
        method = "auto"
    """

    kind: Literal["dynamic"] = choice("dynamic", default="dynamic")
    method: str = choice(INTEGRATORS, "auto", default="central-difference")
    duration: float = real(above=0, unit="s")
    safety: float | None = real(default=None, above=0, at_most=1)
    step_size: float | None = real(default=None, above=0, unit="s")
    order: int | None = integer(default=None, at_least=4, at_most=6)
    rtol: float | None = real(default=None, at_least=1e-13, at_most=0.1)
    atol_position: float | None = real(default=None, above=0, unit="m")
    atol_velocity: float | None = real(default=None, above=0, unit="m/s")
    family: str | None = choice("bdf", "adams", default=None)
    max_order: int | None = integer(default=None, at_least=1, at_most=12)
    linear_solver: str | None = choice("auto", "block", "sparse", "dense", "fixed-point", default=None)
    mass: str = choice("lumped", "consistent", default="lumped")
    factorization: str = choice("auto", *FACTORIZATIONS, default="auto")
    start: str = text(default="web")

    def check(self) -> None:
        """Refuse keys of another method, and fill in the defaults of this one."""
        keys = () if self.method == "auto" else INTEGRATORS[self.method].keys
        for key in dict.fromkeys(key for method in INTEGRATORS.values() for key in method.keys):
            if getattr(self, key) is not None and key not in keys:
                methods = " or ".join(f'"{name}"' for name, method in INTEGRATORS.items() if key in method.keys)
                value = quote(getattr(self, key))
                raise InputError(f'{key} = {value} has no meaning with method = "{self.method}", only with {methods}')
        if self.order == 5:
            raise InputError("order = 5 must be 4 or 6")
        defaults = {"safety": 0.5, "order": 6, "rtol": 1e-6, "family": "bdf", "linear_solver": "auto"}
        defaults["max_order"] = 12 if self.family == "adams" else 2
        for key, value in defaults.items():
            if getattr(self, key) is None and key in keys:
                object.__setattr__(self, key, value)
        if self.family != "adams" and (self.max_order or 0) > 5:
            raise InputError(f"max_order = {self.max_order} must be ≤ 5 for BDF")


@table
class Event(Table):
    """The time at which something first happens in a dynamic scene.

    Parameters
    ----------
    name : str
        Its name.
    kind : {"contact", "taut", "threshold", "rest"}
        A body first touches the web, or another body; a line that is slack snaps taut, of several slack ones the
        first, or a thread does; an observable passes a value, either way: one that comes back within the same step may
        not be seen; the scene has come to rest.
    body : str, optional
        Body of a contact, by default any.
    with : str, optional
        Other side of a contact: "web", which is the default, or the name of another body, with ``between_bodies =
        true`` in ``[contact]``. A contact begins with an overlap, at t = 0 if there is one at the start.
    line : int, str or list, optional
        Lines, by number or group, see `refweb.net.groups`, of which the first to become taut counts.
    thread : str, optional
        Thread that becomes taut, in place of lines.
    observe : str, optional
        Name of the observable of a threshold.
    value : float, optional
        Its threshold, in the observable's unit.
    share : float, optional
        Share of the largest kinetic energy so far below which the scene is at rest, 1e-6 by default.
    during : float, optional
        How long the energy is to stay there [s], by default a hundredth of the duration: a pendulum is not at rest
        where it turns back. The time of the event is the end of that.
    stop : bool
        True if the event ends the run.

    Raises
    ------
    InputError
        If the line or thread of "taut", or the observable or value of "threshold", is missing, and for a key of another
        kind. From `Scene.build`, for a body, line, thread or observable that the scene does not have, for lines of
        different slackness, for "contact" without a contact or with a body that does not touch this one, and for two
        events of one name.

    Examples
    --------
        [[event]]
        name = "first-touch"
        kind = "contact"
        body = "ball"
        stop = true
    """

    name: str = text(limit=80)
    kind: str = choice("contact", "taut", "threshold", "rest")
    body: str | None = text(default=None)
    with_: str | None = text(default=None)
    line: Several = nodes(default=None, what="line")
    thread: str | None = text(default=None, limit=80)
    observe: str | None = text(default=None)
    value: float | None = real(default=None)
    share: float | None = real(default=None, above=0, below=1)
    during: float | None = real(default=None, above=0, unit="s")
    stop: bool = boolean(default=False)

    def check(self) -> None:
        """Refuse keys of another kind, and what a kind lacks."""
        needed: dict[str, tuple[str, ...]] = {"threshold": ("observe", "value")}
        possible: dict[str, tuple[str, ...]] = {"contact": ("body", "with"), "rest": ("share", "during")}
        if self.kind == "taut":
            needed["taut"] = ("thread",) if self.thread is not None else ("line",)
        needs = needed.get(self.kind, ())
        may = possible.get(self.kind, needs)
        for key in ("body", "with", "line", "thread", "observe", "value", "share", "during"):
            value = self.with_ if key == "with" else getattr(self, key)
            if value is None and key in needs:
                raise InputError(f'{key} is missing: kind = "{self.kind}" needs {key} = ...')
            if value is not None and key not in may:
                raise InputError(f'{key} = {quote(value)} has no meaning for kind = "{self.kind}": leave it out')


@table
class Output(Table):
    """Content of a result folder.

    Parameters
    ----------
    interval : float, optional
        Time between history rows [s]; by default 1e-3, of runs longer than 1 s a thousandth of the duration, but not
        below a ``step_size`` that is given nor above the duration. In statics the load steps are the rows.
    frames : int, optional
        A VTU every this many rows, the first and the last state always; 10 by default, in statics 1.

    Raises
    ------
    InputError
        For an interval that is not > 0 and frames < 1; from `Scene`, for an interval in statics, one above the duration
        or one that makes more than `refweb.scene.MAX_HISTORY_ROWS` rows.

    Examples
    --------
        [output]
        interval = 1e-3
        frames = 10
    """

    interval: float | None = real(default=None, above=0, unit="s")
    frames: int | None = integer(default=None, at_least=1)


@table
class Accuracy(Table):
    """Method that finds the errors of results.

    Parameters
    ----------
    error : {"twin", "none"}
        In dynamics by a twin, a second run with other steps, or not at all. In statics "none" leaves out the error
        of smoothing; the other errors follow from the solution itself and cost next to nothing.
    digits : int, optional
        Of dynamics: significant digits that the ± of every observable has to leave. Accuracy is raised until that is
        so, or until it shows which observables cannot have them.
    budget : float, optional
        With ``digits`` and with ``level = "full"``: CPU time that all runs may take together [s]; by default 600, or 20
        times what the first takes if that is longer. The first run goes to its end. A later one is not begun where it
        is expected to take more than what is left, and is ended where it is on its way to twice that; then the run
        before, which is made again where it has been given up, is the result, with a warning that says what the digits
        would cost.
    refine : bool
        True to find the discretisation error, by two more runs with two and four times the elements.
    horizon : bool
        Of dynamics: whether to find the horizon, the time until which the motion is determined. Later than that the
        smallest difference at the start leaves no digit of it, see `refweb.studies.predictability`.
    ensemble : int, optional
        With ``horizon``: number of runs from which mean and spread of the results are taken.
    level : {"time", "full"}
        "full" finds all parts of the error of each result by further runs, within the ``budget``: with finer elements,
        stiffer contact and less smoothing, and from starts side by side, see `refweb.studies.further_runs`. ``refweb
        trust`` does the same.

    Raises
    ------
    InputError
        For digits that are not 1 … 12, and an ensemble that is not 2 … 10 000 or without horizon. For a budget that is
        not above 0, or without digits and level = "full". For digits and level = "full" without step refinement. From
        `Scene`, for digits and horizon in statics.

    Examples
    --------
        [accuracy]
        digits = 3
        refine = true
    """

    error: str = choice("twin", "none", default="twin")
    digits: int | None = integer(default=None, at_least=1, at_most=12)
    budget: float | None = real(default=None, above=0.0, unit="s")
    refine: bool = boolean(default=False)
    horizon: bool = boolean(default=False)
    ensemble: int | None = integer(default=None, at_least=2, at_most=10_000)
    level: str = choice("time", "full", default="time")

    def check(self) -> None:
        """Refuse what needs something else."""
        if self.ensemble is not None and not self.horizon:
            raise InputError(f"ensemble = {self.ensemble} needs horizon = true")
        if self.budget is not None and self.digits is None and self.level == "time":
            raise InputError(f'budget = {self.budget:g} needs digits = ... or level = "full"')
        if self.digits is not None and self.error == "none":
            raise InputError(f'digits = {self.digits} needs error = "twin"')
        if self.level == "full" and self.error == "none":
            raise InputError('level = "full" needs error = "twin"')


_number, _numbers, _names = real(), numbers_list(), texts()
_rows = {width: rows(width, increasing=True) for width in (2, 4, 5)}
_kinds = [kind.metadata["read"].accepts for kind in (_number, _numbers, *_rows.values())]


@accepts(any_of({"type": "string"}, array({"type": "string"}, 1), *_kinds))
def _target(name, value):
    """Read a target: a number, numbers, names of observables, or a table over time."""
    if isinstance(value, str):
        return checked(name, [value], _names)
    if not isinstance(value, (list, tuple)):
        return checked(name, value, _number)
    if value and isinstance(value[0], str):
        return checked(name, value, _names)
    if value and isinstance(value[0], (list, tuple)):
        return checked(name, value, _rows.get(len(value[0]), _rows[4 if len(value[0]) > 2 else 2]))
    return checked(name, value, _numbers)


@table
class Control(Table):
    """Feedback control of a dynamic scene.

    At each multiple of its period a control measures observables of the scene, and its law gives a value to a load, a
    torque or a rate. The value stays until the next period. The step-refinement run has the same law with its own
    measurements, so that ± holds its effect as well. A run with controls goes on after it was stopped.

    The control sets what a scene has: ``load.N.force`` and ``load.N.torque``, ``thrust.N.force``, ``pressure.N.value``,
    ``gravity.acceleration``, ``body.NAME.axle.torque``, of a winch ``winch.N.speed``, ``limit``, ``tension`` or
    ``power``, whichever the scene gives, or the rate of a table, ``reel.N.rate`` of the factor [1/s],
    ``motion.N.velocity``, ``motion.N.angular_velocity``. N counts from 0. Laws give vectors along x, y and z; a load
    with ``axes = "body"`` has the same vector at the measurement, and turns with its body until the next. A tension
    below 0 is set to 0, which counts as a limit.

    The run says the integral over time of the size of the value; for a load it is that of the force on one node.
    ``quantity = "fuel"`` and ``"delta_v"`` of ``[[observe]]`` have it over time. A reel stops at a hundredth of its
    factor.

    Four measures are an attitude: the components w, x, y, z of the orientation of a body. Its error e is the vector of
    the shortest rotation to the target, and its rate is an angular velocity; laws get ``value`` = 0 and ``target`` = e.

    With the error e = target − measured and its rate e', "pid" gives proportional · e + integral · ∫e dt + derivative
    · e'; the integral waits while a limit acts. "sliding-mode" gives strength · s/width, at most strength, with the
    surface s = e' + slope · e. "bang-bang" gives strength with the sign of e + e' abs(e') mass/(2 strength), which
    brings a mass to its target in least time. "spin-up" gives strength · (1 − measured/target), the torque of a hub.
    "station-keeping" gives proportional · e + derivative · e' where the size of e is above ``dead_band``, else 0.

    A law of one's own is "FILE.py:CLASS", a class with ``reset()`` and ``act(measurement, time)``, which runs as Python
    code. ``measurement`` has the arrays ``value``, ``rate``, ``target`` and ``target_rate``, and ``period`` and
    ``limited``. With ``save()``, a list of numbers, and ``restore(numbers)`` a run of it can be resumed.

    Parameters
    ----------
    name : str
        Its name.
    law : str
        Law, see above.
    parameters : dict of str to float, optional
        Parameters of the law, by their names above.
    period : float
        Time between two values [s], a multiple of ``[output] interval``, which is by default the shortest period.
    sets : str
        Path of the value that it sets.
    measures : list of str
        Names of the observables that it measures: one, three for a vector, or four for an attitude.
    rates : list of str, optional
        Names of the observables of their rates; by default the difference over the period before, 0 at the start. The
        rate of a target is that difference, too. Those of an attitude are the three components of an angular velocity.
    direction : sequence of 3 float, optional
        Direction of a vector that is set by one observable, of length 1; or the axis of a cone.
    angle : float, optional
        Half angle of a cone [rad], at most π/2: of a vector the nearest one in the cone about ``direction`` is set. The
        cone is along the axes of the load, so that with ``axes = "body"`` it turns with the body.
    target : float, list or table
        Number, numbers, names of observables, such as those of the place of another body; or a table over time,
        [[t, ...], ...], linear in between. 0 by default. Of an attitude a quaternion [w, x, y, z] of any length but 0,
        four names, or a table of quaternions, with constant angular velocities in between.
    limit : float, optional
        Largest size of the value; a larger vector keeps its direction.
    delay : float
        Time from a measurement to its effect [s], a multiple of the period. Until the first measurement is so old, it
        acts at once.
    noise : float
        Standard deviation of what is added to each measurement; it follows from the seed of the scene. An attitude is
        turned by so much about each axis [rad].

    Raises
    ------
    InputError
        For numbers of measures, rates and targets that differ, a direction or a quaternion that is zero, and an angle
        without direction. From `Scene.build`, for names that the scene does not have, four that are no orientation,
        what cannot be set, periods that are no multiples, and parameters that the law does not have.

    Examples
    --------
        [[control]]
        name = "hover"
        law = "pid"
        parameters = { proportional = 40.0, derivative = 6.0 }
        period = 0.05
        sets = "load.0.force"
        measures = ["height"]
        direction = [0.0, 0.0, 1.0]
    """

    several = True

    name: str = text(limit=80)
    law: str = text()
    parameters: dict[str, Any] | None = numbers_by_name()
    period: float = real(above=0, unit="s")
    sets: str = text()
    measures: Several = texts()
    rates: Several = texts(default=())
    direction: Several = vector(default=None)
    angle: float | None = real(default=None, above=0, at_most=0.5 * math.pi, unit="rad")
    target: Several = field(_target, default=0.0)
    limit: float | None = real(default=None, above=0)
    delay: float = real(default=0.0, at_least=0, unit="s")
    noise: float = real(default=0.0, at_least=0)

    def check(self) -> None:
        """Refuse numbers of measures, rates and targets that do not fit, and a direction beside several measures."""
        count = len(self.measures)
        if count not in (1, 3, 4):
            raise InputError(
                f"measures = {quote(self.measures)} must be one name, three of a vector, or four of an attitude"
            )
        if self.rates and len(self.rates) != min(count, 3):
            raise InputError(f"rates = {quote(self.rates)} must be {min(count, 3)}, by the number of measures")
        target = self.target
        if isinstance(target, tuple):
            width = len(target[0]) - 1 if isinstance(target[0], tuple) else len(target)
            if width != count:
                raise InputError(f"target = {quote(target)} has {width} values, and measures has {count}")
        if count == 4:
            self._refuse_no_attitude()
        if self.direction is not None and not any(self.direction):
            raise InputError(f"direction = {quote(self.direction)} must not be zero")
        if self.direction is not None and count > 1 and self.angle is None:
            raise InputError(f"direction = {quote(self.direction)} is for one measure, or needs the angle of a cone")
        if self.angle is not None and self.direction is None:
            raise InputError(f"angle = {self.angle:g} needs a direction, the axis of its cone")

    def _refuse_no_attitude(self):
        """Refuse targets that are no quaternions, and a law that has no meaning for an attitude."""
        if self.law == "spin-up":
            raise InputError(f'law = "spin-up" leads to a speed, and measures = {quote(self.measures)} is an attitude')
        if not isinstance(self.target, tuple):
            raise InputError("target is missing: an attitude needs a quaternion [w, x, y, z], names or a table")
        rows = self.target if isinstance(self.target[0], tuple) else (("", *self.target),)
        if not all(any(row[1:]) for row in rows):
            raise InputError(f"target = {quote(self.target)} must not be a quaternion of zeros")
