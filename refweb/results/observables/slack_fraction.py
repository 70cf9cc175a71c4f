"""The share of elements that are slack.

May change: the class docstring, which is help: then write ``validation/REFERENCE.md`` anew. Must stay: one value with
`probes.slack_fraction`, the kernel of dynamics; the class name in `registry.OBSERVABLES`; `SlackFraction`, which
`dynamics.gradients` imports. Tests: ``tests/results/test_observable_contract.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .observable import Observable, Value

if TYPE_CHECKING:
    from ...statics.equilibrium import Equilibrium
    from ...system.system import System
    from ..probes import Probe
    from ..state import State


class SlackFraction(Observable):
    """Slack elements over all elements."""

    def of(self, state: State) -> Value:
        """Share of the elements that are slack at all quadrature points."""
        return Value(float(state.element_slack.mean()), None)

    def bounds(self, system: System | None) -> tuple[float, float]:
        """Bounds of the value: those of a share."""
        return 0.0, 1.0

    def probe(self, system: System) -> Probe:
        """Make the probe that counts strains up to the slackness; lines that yield are slack without tension."""
        from ..probes import Probe, slack_fraction

        net = system.net
        return Probe(
            slack_fraction, [system.tension_column], np.where(net.law_is("plastic"), np.nan, net.slackness)[:, None]
        )

    def error(self, state: State, equilibrium: Equilibrium) -> float | None:
        """None, since the value jumps."""
        return None
