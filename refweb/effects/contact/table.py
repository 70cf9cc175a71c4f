"""Penalty contact of lines with rigid bodies, with optional damping and friction.

The kernels for spheres are in `refweb.effects.contact.sphere`, those for other shapes and exponents in
`refweb.effects.contact.penalty`, and those of damping and friction in `refweb.effects.contact.friction`. Explicit steps
use the solver in `refweb.effects.contact_solver`. Bodies with the same kernels make one term.

May change: private functions, `OUT_OF_REACH` and messages. Must stay: the name "contact" of all terms, by which
`system.unsupported_parts`, `dynamics.kinks` and `integrators.splitting` know them, and which `statics.gradients.KNOWN`
has; keys and docstring of `Contact` (scene format and help; after a change write ``validation/REFERENCE.md`` anew); the
order of `KEYS`, which is that of `pair.pair_data` and of contact between bodies; names in `Balance`, columns of
``history.csv``; `law_of`, `left_out`, `with_stiffness` and `friction_of`, which `scene`, `overlap` and `pair_overlap`
call; public names of `Contact`, which other files use. Tests: ``tests/effects/test_contact.py``,
``tests/test_contract.py``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...accepted import accepts
from ...errors import InputError
from ...messages import nearest, quote
from ...tables import Table, boolean, by_group, field, real, table
from ..base import OWN, Balance, CellElements, ContactForce, ForceTerm, Tangent, Timing, VelocityForce
from .line_body_ccd import passing
from .nearest_point import in_sphere, near
from .pair import AWAY, pair_data

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ...net.net import Net
    from ...net.rigid_body import RigidBody

KEYS = "stiffness", "exponent", "damping", "friction", "slip_velocity"
"""Keys of the law of a contact."""
OUT_OF_REACH = 1e6, 7e5, 4e5
"""Offset of broken elements from every body [m], so that they touch nothing."""


@accepts({"enum": [1, 1.5]})
def _exponent(name, value):
    if isinstance(value, bool) or value not in (1, 1.5):
        raise InputError(f"{name} = {quote(value)} must be 1 or 1.5")
    return float(value)


@table
class BodyContact(Table):
    """Keys of `Contact` with other values for one body.

    Examples
    --------
        [contact.bodies.ball]
        stiffness = 1e4
        friction = 0.5
    """

    stiffness: float | None = real(default=None, above=0, unit="N/m")
    exponent: float | None = field(_exponent, default=None)
    damping: float | None = real(default=None, at_least=0, unit="s/m")
    friction: float | None = real(default=None, at_least=0)
    slip_velocity: float | None = real(default=None, above=0, unit="m/s")


def rotations(body):
    """Number of rows of rotation of a body."""
    return (body.spin is not None) + (body.turn is not None)


@table
class Contact(Table):
    """Contact of the web with all bodies, and optionally of bodies with each other.

    A sphere has one contact with a line, at the deepest of its elements. Where several are as deep, statics finds their
    shares of the push, and dynamics goes to and fro between them. Other shapes have a contact with each element at both
    ends, and one in between. The latter, at ξ of the length, has the energy W k δ^(p + 1)/(p + 1) with W = 4 ξ (1 − ξ),
    so that no force jumps as a line slides. The window W also causes a push along the line, in alternating directions.
    On average it is some 0.3 (δ²/(L r))^⅓ of the push, for an element of length L and a surface of radius r along it. ±
    does not contain this error: a finding reports it if it is above 5 % and above friction. More elements,
    ``subdivide``, and a larger stiffness reduce it.

    Straight elements cannot bend round an edge. Where a line turns by an angle θ round one of radius r, contact pushes
    along the line by θ/4 (1 − r θ/(2 L))² of the push on average, and by twice this at most, if r θ < 2 L. No stiffness
    reduces this, but a larger ``rounding`` of the body, or elements that are shorter than r θ/2. Statics has a finding
    that reports it as above.

    A line can only pass through a body by its middle, where the push changes its direction. The penetration check
    follows the depth of every line from the start of a run: before each drift of an explicit step, and on the
    interpolants of cvode and ida. ``passage`` of ``run.json`` is "certified" for ``bodies`` if no line has reached the
    middle of a body. An explicit step is cut if a line would reach it. A step of order 4 or 6 is cut if a step of order
    2 would be; a line that passes nevertheless is reported. Load steps of statics and curved elements are not checked.
    A warning reports bodies that are not certified. ``pairs`` is for bodies that touch each other.

    Parameters
    ----------
    stiffness : float, optional
        Penalty k of each contact [N/m], or [N/m^1.5] with that exponent. If it is left out, here and for a body, refweb
        chooses it from velocities, masses and forces. It chooses a larger one if lines penetrate the body deeper than a
        tenth of its size, see `refweb.effects.contact.overlap`.
    exponent : {1, 1.5}
        p of the push k δ^p at the depth δ.
    damping : float
        d of Hunt and Crossley [s/m]: a push of k δ^p (1 + d δ̇), never a pull. A body with a small velocity v rebounds
        with 1 − 2/3 d v of it.
    friction : float
        Coefficient of friction μ. Friction rotates free bodies; a push rotates all free bodies but spheres and rings.
        Statics has no friction.
    slip_velocity : float
        Slip velocity v_s [m/s] at which friction is 1/√2 of its limit; below it, friction is viscous. Explicit steps do
        not depend on it.
    between_bodies : bool
        True for contact of bodies with each other as well, for all pairs but two fixed bodies. Contacts are at each
        corner, between the ends of each edge and of the axis of a capsule, and on rims; a sphere has one contact. Each
        contact has the push k δ^p. The contact of an edge has that of a line, k W δ^p, which vanishes towards the ends;
        edges that cross have one each. Stiffness, damping, friction and slip velocity of a pair are the larger ones of
        both bodies.
    bodies : dict of str to BodyContact
        Keys with other values for a body.

    Raises
    ------
    InputError
        For a stiffness or a slip velocity that is not > 0, damping or friction < 0, and another exponent. From ``on``,
        without a body, and for a name in ``bodies`` that no body has.

    Examples
    --------
        [contact]
        stiffness = 1e5
        damping = 0.1
        friction = 0.2
    """

    stiffness: float | None = real(default=None, above=0, unit="N/m")
    exponent: float = field(_exponent, default=1.0)
    damping: float = real(default=0.0, at_least=0, unit="s/m")
    friction: float = real(default=0.0, at_least=0)
    slip_velocity: float = real(default=1e-2, above=0, unit="m/s")
    between_bodies: bool = boolean(default=False)
    bodies: dict[str, Any] = by_group(BodyContact, "contact", members="bodies", default_factory=dict)

    def _of(self, body, key):
        given = getattr(self.bodies.get(body.name), key, None)
        return getattr(self, key) if given is None else given

    def law_of(self, body: RigidBody) -> tuple[float | None, float]:
        """(Stiffness, exponent) of a body; the stiffness is None if it is left out."""
        return self._of(body, "stiffness"), self._of(body, "exponent")

    def friction_of(self, body: RigidBody) -> float:
        """Coefficient of friction of a body."""
        return self._of(body, "friction")

    def left_out(self, bodies: Sequence[Any]) -> tuple[str, ...]:
        """Names of bodies whose stiffness is left out."""
        return tuple(body.name for body in bodies if self._of(body, "stiffness") is None)

    def with_stiffness(self, stiffness: dict[str, float]) -> Contact:
        """The table with a stiffness for some bodies, by name."""
        by_body = {name: replace(self.bodies.get(name, BodyContact()), stiffness=k) for name, k in stiffness.items()}
        return replace(self, bodies={**self.bodies, **by_body})

    def extend(self, net: Net) -> Net:
        """The net with rows of rotation for free bodies that friction rotates."""

        def turns(body):
            return body.turns or not body.prescribed and self._of(body, "friction") > 0.0

        return replace(net, bodies=tuple(replace(body, turns=turns(body)) for body in net.bodies))

    def on(self, net: Net) -> list[ForceTerm]:
        """The terms of lines on bodies; ``out`` has depth [m] or lost power [W], and the force on the body [N]."""
        names = [body.name for body in net.bodies]
        if not names:
            raise InputError("there is no [[body]] that the web could touch: add one")
        for name in self.bodies:
            if name not in names:
                raise InputError(f'bodies."{name}" is not a body, {nearest(name, names)}')
        for name in self.left_out(net.bodies):
            raise InputError(f'stiffness is missing for body "{name}": a Scene chooses it, a System does not')
        functions = np.linalg.inv(np.vander(np.sort(net.places), increasing=True))
        element = net.subdivide, net.order + 1, tuple(functions.ravel().tolist())
        pressed, losing = {}, {}
        for body in net.bodies:
            ball, spins = body.shape.once and not body.offset.any(), rotations(body)  # whose push is no moment
            depth = None if ball and self._of(body, "exponent") == 1.0 else body.shape.depth()
            pressed.setdefault((depth, 2 if spins == 2 and not ball else 0), []).append(body)
            if self._loses(body):
                losing.setdefault((body.shape.depth(), spins), []).append(body)
        terms = [self._penalty(net, element, depth, spins, bodies) for (depth, spins), bodies in pressed.items()]
        lost = [self._friction(net, element, depth, spins, bodies) for (depth, spins), bodies in losing.items()]
        if self.between_bodies:
            from .bodies import force_terms as between

            return terms + lost + between(net, self.law_between)
        return terms + lost

    def law_between(self, first: RigidBody, second: RigidBody) -> tuple[float, ...]:
        """(stiffness, exponent, damping, friction, slip velocity) of two bodies."""
        laws = [[self._of(body, key) for key in KEYS] for body in (first, second)]
        if laws[0][1] != laws[1][1]:
            raise InputError(
                f'exponent = {laws[0][1]:g} of body "{first.name}" and {laws[1][1]:g} of "{second.name}" must be equal '
                "where between_bodies = true"
            )
        return tuple(map(max, *laws))

    def _pairs(self, net, bodies, spins=0) -> dict:
        """Common arguments of a `ForceTerm` of elements and some bodies, with ``spins`` rows of rotation."""
        along = net.cells[:, net.along]
        rows = [[body.row, body.spin, body.turn][: 1 + spins] for body in bodies]
        cells = [np.hstack([along, np.tile(row, (len(along), 1))]) for row in rows]
        laws = [tuple(self._of(body, key) for key in KEYS) for body in bodies]
        data = [pair_data(body, along, net.points, law, spins == 2) for body, law in zip(bodies, laws, strict=True)]
        nodes = along.shape[1]

        vectors = slice(AWAY, AWAY + 3 * nodes)

        def disable(numbers):
            numbers[:, vectors] += np.tile(OUT_OF_REACH, nodes)

        return dict(
            name="contact",
            contact=ContactForce((nodes,)),
            cells=np.ascontiguousarray(np.vstack(cells), dtype=np.int32),
            data=np.ascontiguousarray(np.vstack(data)),
            elements=CellElements(np.tile(np.arange(len(along)), len(bodies)), disable),
        )

    def _penalty(self, net, element, depth, spins, bodies):
        """The term of bodies of one depth, or without one of spheres alone; with ``spins`` of 2 they turn."""
        pairs = self._pairs(net, bodies, spins)
        if depth is None:
            from .sphere import kernels

            columns = AWAY + 3 * element[1]
            pairs["data"] = np.ascontiguousarray(pairs["data"][:, :columns])
            (force, energy, stiffness, bound), within = kernels(*element), in_sphere
        else:
            from .contact_points import in_reach
            from .penalty import kernels

            (force, energy, stiffness, bound), within = kernels(depth, *element, spins), in_reach(depth, spins)
        if net.order == 1:  # explicit steps take no other elements
            passes = None if net.quasi_static else passing(depth, *element[1:], spins)
            places = 2 if depth is not None and self._rubs(bodies) else 0
            contact = pairs["contact"]._replace(near=near(*element, within), passing=passes, places=places)
            pairs["contact"] = contact
        return ForceTerm(
            **pairs,
            force=force,
            energy=energy,
            tangent=Tangent(stiffness, bound, symmetric=spins == 0 or all(body.prescribed for body in bodies)),
            balance=Balance("contact_energy", internal=True),
        )

    def _rubs(self, bodies):
        """True if friction of lines may read where they touch bodies: any has losses, and all are convex."""
        convex = all(getattr(body.shape.depth(), "convex", True) and not body.shape.once for body in bodies)
        return convex and any(map(self._loses, bodies))

    def _loses(self, body):
        """True if contact with a body has damping or friction."""
        return self._of(body, "damping") > 0.0 or self._of(body, "friction") > 0.0

    def _friction(self, net, element, depth, spins, bodies):
        from .friction import kernels

        force, stiffness, bound, damping = kernels(depth, *element, spins)
        implicit = None
        if net.order == 1:  # explicit steps take no other elements
            from . import line_body_friction

            implicit = line_body_friction.kernels(depth, net.subdivide, element[2], spins)
        return ForceTerm(
            **self._pairs(net, bodies, spins),
            force=force,
            tangent=Tangent(stiffness, bound, symmetric=False),
            velocity=VelocityForce(damping, implicit=implicit),
            balance=Balance("dissipated_energy", OWN, internal=True),
            timing=Timing(at_rest=False),
        )
