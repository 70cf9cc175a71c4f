"""Angular momentum of web and free bodies about their centre of mass, or the part of nodes or of a body.

May change: how sums are written, in `of` and in the kernel `angular_momentum` together: both have one value. Must stay:
the class docstring (help; after a change write ``validation/REFERENCE.md`` anew), ``keys`` and ``unit``, and the class
name in `registry.OBSERVABLES`. Tests: ``tests/results/test_observable_contract.py``,
``tests/results/test_selections.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...effects.base import refuse_flows
from ...kernels import kernel
from ...messages import quote
from ..probes import PROBE, Probe, component_of
from .nodal import Nodal
from .observable import Value
from .rotation import turned_with

if TYPE_CHECKING:
    from ...system.system import System
    from ..state import State


class TotalAngularMomentum(Nodal):
    """Σ m (r − r_c) × (v − v_c) plus the spin of bodies; r_c and v_c are those of the centre of mass of all.

    By default it is that of web and free bodies together. With ``node`` or ``body`` it is the part of these; ``node =
    "all"`` is the part of the web. Supported nodes count with their masses, at rest or moving, while fixed bodies do
    not count. Consistent mass couples the nodes of an element. The total is constant if no force acts from outside and
    there is no support. In ``[frame]`` and ``[orbit]`` velocities are relative to the rotating axes, and the total is
    not constant.
    """

    unit = "N m s"
    keys: tuple[str, ...] = ("node", "body", "component")
    dynamic = True

    def _parts(self, system):
        """Masses and reference positions of rows (rows, 4), rows that count, and the bodies that turn."""
        net, observe = system.net, self.observe
        refuse_flows(net, f"quantity = {quote(observe.quantity)}")
        linear = system.rows - net.spins
        masses = net.mass[:linear].copy()
        masses[[body.row for body in net.bodies if body.fixed]] = 0.0
        every = observe.node is None and observe.body is None
        counted = np.arange(linear) if every else self.rows(system)
        named = net.bodies if every else self.bodies(net)
        turning = [body for body in named if body.spin is not None and not body.prescribed]
        return np.column_stack([masses, net.points[:linear]]), counted, turning

    def of(self, state: State) -> Value:
        """Value by sums over rows."""
        numbers, counted, turning = self._parts(state.system)
        mass, linear = numbers[:, :1], len(numbers)
        position, speed = (all_of[:linear] - (mass * all_of[:linear]).sum(axis=0) / mass.sum() for all_of in (
            state.position, state.v))  # fmt: skip
        momentum, system = mass * speed, state.system
        if system.net.consistent_minus_lumped is not None:
            momentum += system.mass.passed_on(np.pad(speed, ((0, system.net.spins), (0, 0))))[:linear]
        total = np.cross(position, momentum)[counted].sum(axis=0)
        total += sum((body.spin_about_centre(state.x, state.v) for body in turning), np.zeros(3))
        return Value(float(self.sizes(total[None])[0]), None)

    def position(self, system: System, at: int) -> int | None:
        """None: the value has no position."""
        return None

    def probe(self, system: System) -> Probe:
        """Make the probe of x and v."""
        numbers, counted, turning = self._parts(system)
        spins = [row for body in turning for row in (body.spin, body.turn if body.axle else -1)]
        matrices = [np.pad(body.spin_momentum, ((0, 0), (0, 1))) for body in turning]
        cells, coupled, coupling = self._coupling(system.net, counted)
        rows = [self.component, len(numbers), len(counted), len(turning), coupled, *counted, *spins, *cells]
        return Probe(angular_momentum, rows, np.vstack([numbers, *matrices, coupling]))

    def _coupling(self, net, counted):
        """Rows of the elements one after another, how many each has, and consistent less lumped mass, rows of 4.

        Rows of the mass of nodes that do not count are 0; all are empty where mass is lumped.
        """
        if net.consistent_minus_lumped is None:
            return [], 0, np.zeros((0, 4))
        coupled = net.cells.shape[1]
        mass = np.where(np.isin(net.cells, counted)[:, :, None], net.consistent_minus_lumped, 0.0)
        return net.cells.ravel(), coupled, np.pad(mass.reshape(-1, coupled), ((0, 0), (0, 4 - coupled)))


@kernel(leaf=True)
def add_moment(a, r, u, x, data, c, total):
    """Add (r − r_c) × u of a row to a, with the momentum u and r_c times the mass of all."""
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        a[k] += (data[r, 1 + i] + x[r, i] - c[i] / total) * u[j] - (data[r, 1 + j] + x[r, j] - c[j] / total) * u[i]


@kernel(PROBE)
def angular_momentum(t, x, v, f, lines, rows, data, where):
    """``rows`` is (component, linear rows, count, bodies, nodes of an element or 0, counted rows, two rows of rotation
    of each body, nodes of elements), data (mass, reference position) of all linear rows, three rows of each body: its
    `RigidBody.spin_momentum`, then consistent less lumped mass of the elements, a row for each of their nodes."""
    total, linear, count, bodies, coupled = 0.0, rows[1], rows[2], rows[3], rows[4]
    c, w, a, u = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3)
    for r in range(linear):
        total += data[r, 0]
        for k in range(3):
            c[k] += data[r, 0] * (data[r, 1 + k] + x[r, k])
            w[k] += data[r, 0] * v[r, k]
    for n in range(count):
        r = rows[5 + n]
        for k in range(3):
            u[k] = data[r, 0] * (v[r, k] - w[k] / total)
        add_moment(a, r, u, x, data, c, total)
    for n in range(bodies):
        spin = turned_with(linear + 3 * n, rows[5 + count + 2 * n], rows[6 + count + 2 * n], x, v, data)
        for k in range(3):
            a[k] += spin[k]
    first, at = 5 + count + 2 * bodies, linear + 3 * bodies
    for n in range(rows.size - first):  # row n of the masses of elements, by columns to the nodes of the same element
        begin = first + n - n % coupled
        u[:] = 0.0
        for m in range(coupled):
            for k in range(3):
                u[k] += data[at + n, m] * v[rows[begin + m], k]
        add_moment(a, rows[first + n], u, x, data, c, total)
    return component_of(rows[0], a[0], a[1], a[2])
