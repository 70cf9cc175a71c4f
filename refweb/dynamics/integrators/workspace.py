"""Space that the compiled loop works in: nothing in it stays from step to step.

`central_difference` makes it, with its `records.Model` and `records.Running`. May change: further fields, for which
`Workspace.of` makes an array. Must stay: names and shapes of fields, which kernels of `explicit_loop` and
`dense_output` use; nothing here is needed behind a step: numbers that must stay belong in `explicit_state` and
`records.Running`; public names of `Workspace`, which other files use. Tests:
``tests/dynamics/integrators/test_records.py``, ``tests/dynamics/test_dynamics.py``.
"""

from __future__ import annotations

import numpy as np

from ...kernels import Integers, Matrix, Record, Vector
from .dense_output import Inside


class Workspace(Record):
    """Space for what does not stay from step to step.

    Attributes
    ----------
    where : ndarray of int, shape (2,)
        The place of a value.
    reaction, push : ndarray, shape (3,)
        Force of the supports, and the force that is integrated along the steps [N].
    known : ndarray, shape (6,)
        Values of plain probes, see `refweb.dynamics.integrators.extremes.plain_value`.
    before : ndarray, shape (driven, 7)
        State of rows whose motion is prescribed, ahead of a step.
    aside, extra, half, momenta : ndarray, shape (rows, 3)
        Space for velocities and forces that are not used, velocities at half a step [m/s], and momenta [N s].
    was : ndarray, shape (changing,)
        Natural lengths ahead of a step [m].
    total : ndarray, shape (terms + 3,)
        Energies [J], and the size of a step [s].
    inside : refweb.dynamics.integrators.dense_output.Inside
        Space for looks inside of a step.
    """

    where: Integers
    reaction: Vector
    known: Vector
    push: Vector
    before: Matrix
    aside: Matrix
    extra: Matrix
    half: Matrix
    momenta: Matrix
    was: Vector
    total: Vector
    inside: Inside

    @classmethod
    def of(cls, model, running):
        """Space for the steps of a run."""
        rows, sums, vectors = len(running.x), len(running.work) + 2, (np.zeros((len(running.x), 3)) for _ in range(4))
        losses = [np.empty_like(model.terms.outs[i]) for i in model.implicit_contacts.terms.tolist()]
        return cls(
            where=np.zeros(2, dtype=np.int64),
            reaction=np.zeros(3),
            known=np.zeros(6),
            push=np.zeros(3),
            before=np.empty((len(model.inertia.driven), 7)),
            aside=next(vectors),
            extra=next(vectors),
            half=next(vectors),
            momenta=next(vectors),
            was=np.empty(len(model.lengths.elements)),
            total=np.zeros(sums),
            inside=Inside.of(rows, model.terms.outs[0], running.extremes, sums, losses),
        )
