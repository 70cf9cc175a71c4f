"""Lines that touch a sphere with several elements alike: their shares of its push, and why they have no other rest.

See `refweb.statics.shared_push` for the equilibria in which they share it.

May change: `ALIKE`, `APART` and words of texts. Must stay: arguments of the functions that `equilibrium`, `remarks`,
`dynamics.simulation` and `studies.modes` call; keys (body, line) of `shared_by`. No number of a result depends on this
file. Must stay as well: `jumps`, which `dynamics.simulation` imports; `no_modes`, which `studies.modes` imports;
`kink_remark`, which `equilibrium` imports; `sharing_remark`, which `remarks` imports. Tests:
``tests/statics/test_contact_kinks.py``.
"""

from __future__ import annotations

import numpy as np

from ..errors import SolverError
from ..findings import Finding
from ..system.contact_shares import sharing_terms, with_shares

ALIKE = 1e-2
"""Largest difference of two depths, over the larger one, that counts as none: iterations go to and fro about a kink."""
APART = 1e-2
"""Least distance of the two points, over the radius, that are not the node between two elements."""


def shared_by(system, t, x):
    """Shares of the elements of each line that share the push of a body, a dict by (`RigidBody`, line)."""
    begin, shared_by = 0, {}
    for number in sharing_terms(system):
        term = system.terms[number]
        shares = system.contact_shares[begin : begin + len(term.cells)]
        begin += len(term.cells)
        pressed = system.energy_of(term, t, x) > 0.0
        for body in system.net.bodies:
            of_it = pressed & (shares < 1.0) & (term.cells[:, term.contact.felt[0]] == body.row)
            lines = system.net.line[term.elements.numbers[of_it]]
            shared_by |= {(body, int(line)): shares[of_it][lines == line] for line in np.unique(lines)}
    return shared_by


def sharing_remark(state, stability):
    """Find lines of which elements share the push of a sphere in a `refweb.results.state.State`."""
    stable = ", in which the rest is stable" if stability is not None and stability.sign == 1 else ""
    lines = shared_by(state.system, state.time, state.x)
    for body in {body: None for body, _ in lines}:
        numbers = [line for touched, line in lines if touched is body]
        parts = ", ".join(f"{100.0 * share:.3g} %" for share in lines[body, numbers[0]])
        more = f" and {len(numbers) - 1} more" if len(numbers) > 1 else ""
        yield Finding(
            "shared-push",
            f'body "{body.name}" touches line {numbers[0]}{more} with several elements alike, which share its push '
            f"(line {numbers[0]}: {parts}): contact with a sphere acts once a line, and its energy has a valley "
            f"there{stable}; in dynamics the push goes to and fro between these elements",
            "contact",
        )


def no_modes(system, equilibrium):
    """The error of natural frequencies about an equilibrium in which elements share a push."""
    body, line = next(iter(shared_by(equilibrium.system_of(system), equilibrium.step, equilibrium.x)))
    return SolverError(
        f'no natural frequencies at step {equilibrium.step:g}: body "{body.name}" touches line {line} with several '
        "elements alike, and the push jumps between these, so that vibrations are not linear; give it a shape that "
        f"every element touches, {_capsule(body)}"
    )


def jumps(system, shares, x):
    """Text on dynamics that starts at x, an equilibrium in which elements share a push; None where none do."""
    first = next(iter(shared_by(with_shares(system, shares), 0.0, x)), None)
    if first is None:
        return None
    body, line = first
    return (
        f'body "{body.name}" touches line {line} with several elements alike in the equilibrium it starts from: '
        "contact with a sphere acts once a line, and the push goes to and fro between these elements, by the way of a "
        "step"
    )


def kink_remark(system, x, remedy=""):
    """Text that names a line with such a contact at displacement x, and the remedy; None where there is none."""
    net = system.net
    if net.order > 1:
        return (
            f"curved elements may touch a body at two places alike, and order = {net.order} jumps between these; take "
            f"order = 1 and subdivide = {net.order * net.subdivide}"
        )
    if net.subdivide == 1:
        return None
    for term in system.terms:
        if not term.contact.with_lines or term.energy is None:
            continue
        rows = term.cells[:, term.contact.felt[0]]
        for body in net.bodies:
            if body.shape.once and (line := _kinked(net, x, body)) is not None and (rows == body.row).any():
                return (
                    f'body "{body.name}" touches line {line} with two elements alike, and contact with a sphere acts '
                    f"once a line; {remedy}give it a shape that every element touches, {_capsule(body)}"
                )
    return None


def _capsule(body):
    """Keys of a body that is nearly this sphere."""
    return f'shape = "capsule", axis = [0, 0, 1], length = {1e-3 * body.radius:.2g}'


def _kinked(net, x, body):
    """The first line with two elements in a sphere that are as deep; None where there is none."""
    positions = net.points + x
    start, end = (positions[net.cells[:, side]] - positions[body.row] for side in (0, 1))
    along = end - start
    share = np.clip(-(start * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-300), 0.0, 1.0)
    nearest = start + share[:, None] * along
    depth = body.radius - np.linalg.norm(nearest, axis=1)
    for line in np.unique(net.line[depth > 0.0]):
        elements = np.flatnonzero(net.line == line)
        deepest = elements[depth[elements].argmax()]
        others = elements[np.linalg.norm(nearest[elements] - nearest[deepest], axis=1) > APART * body.radius]
        if len(others) and depth[others].max() > (1.0 - ALIKE) * depth[deepest]:
            return int(line)
    return None
