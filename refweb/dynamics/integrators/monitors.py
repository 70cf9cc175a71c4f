"""Monitors of a run: probes and sums as a record, and their extremes, means and events where no step has been taken.

May change: how `Observed.of` fills the record. Must stay: names of the fields of `Observed`, which kernels of
`extremes`, `averages`, `events` and `rows` read; the order of probes, then sums, in ``signs`` and ``sums``;
`measurements` puts other arrays into ``data`` for probes that read a term; `begin_monitors`, which `central_difference`
and `measurements` import. Tests: ``tests/dynamics/test_averages.py``, ``tests/results/test_observable_contract.py``.
"""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np

from ...effects.base import CONTACT
from ...kernels import (
    INTEGERS,
    MATRIX,
    Arrays,
    Functions,
    IntegerMatrix,
    Integers,
    IntegerTable,
    Matrix,
    MatrixTable,
    Record,
    Vector,
)
from ...results.probes import PROBE, plain_of, reads_each_line
from .averages import Windows, begin_averages
from .events import starts_above

ProbeTable = Annotated[Functions, PROBE]


class Observed(Record):
    """Probes and sums that are inspected.

    Attributes
    ----------
    probes, rows, data : table
        Kernel of each probe and its numbers.
    sums : ndarray, shape (sums, terms + 3)
        Weights of each sum.
    signs : ndarray, shape (probes + sums,)
        1 for the largest value, −1 for the smallest, 0 for neither, as for probes that have a window.
    followed : ndarray of int
        Probes whose sign is not 0.
    windows : refweb.dynamics.integrators.averages.Windows
        Windows of the probes that are averaged.
    terms : ndarray of int
        Terms whose values per cell are the data of probes.
    plain : ndarray of int, shape (probes, 4)
        Quantities that the loop evaluates without a kernel, see `refweb.results.probes.plain_of`.
    scales : ndarray, shape (probes,)
        Factor on each of these.
    each_line : int
        1 if probes that are followed read more of the lines than the largest tension or strain of all, else 0.
    """

    probes: ProbeTable
    rows: IntegerTable
    data: MatrixTable
    sums: Matrix
    signs: Vector
    followed: Integers
    windows: Windows
    terms: Integers
    plain: IntegerMatrix
    scales: Vector
    each_line: int

    @classmethod
    def of(cls, probes, sums, terms, outs=(), contacts=None):
        """Probes and sums of a system of some ``terms``, where these write ``outs`` and bodies feel ``contacts``."""
        shared = dict(enumerate(outs)) | ({CONTACT: contacts.felt} if contacts else {})
        numbers = [shared.get(p.term, np.ascontiguousarray(p.data, dtype=float)) for p in probes]
        terms_seen = [probe.term for probe in probes if probe.term >= 0]
        if contacts and any(probe.term == CONTACT for probe in probes):
            terms_seen += contacts.terms["number"].tolist()
        windows, signs = Windows.of(probes), np.array([float(item.sign) for item in (*probes, *sums)])
        signs[windows.slots] = 0.0
        plain = [plain_of(probe) for probe in probes]
        return cls(
            probes=Functions(PROBE, [probe.kernel for probe in probes]),
            rows=Arrays(INTEGERS, [np.array(probe.rows, dtype=np.int64) for probe in probes]),
            data=Arrays(MATRIX, numbers),
            sums=np.array([item.weights for item in sums], dtype=float).reshape(len(sums), terms + 3),
            signs=signs,
            followed=np.flatnonzero(signs[: len(probes)]),
            windows=windows,
            terms=np.unique(terms_seen).astype(np.int64),
            plain=np.array([numbers for numbers, _ in plain], dtype=np.int64).reshape(len(probes), 4),
            scales=np.array([scale for _, scale in plain], dtype=float),
            each_line=int(any(reads_each_line(p, len(outs[0]) if outs else 0) for p in probes if p.sign)),
        )


def begin_monitors(observed, extremes, energies, events) -> dict[str, Any]:
    """Make a dict of the ``extremes``, ``events`` and ``averages`` at t = 0 of extremes that hold values of probes."""
    signs, first, events = observed.signs, len(observed.probes), events.copy()
    extremes.values[first:] = observed.sums @ energies
    for event in events:
        starts_above(event, extremes.values[event["slot"]])
    stepping = first + np.flatnonzero(observed.sums[:, -1])
    extremes.values[stepping] = -np.inf * signs[stepping]  # no step has been taken
    averages = begin_averages(observed.windows, extremes)
    extremes.recent[:, 2] = extremes.values
    return dict(extremes=extremes, events=events, averages=averages)
