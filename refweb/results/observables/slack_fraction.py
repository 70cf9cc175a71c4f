"""The share of elements that are slack."""

from __future__ import annotations

from .observable import Observable, Value


class SlackFraction(Observable):
    """Slack elements over all elements."""

    def of(self, state):
        """Share of the elements that are slack at all quadrature points."""
        return Value(float(state.element_slack.mean()), None)

    def bounds(self, system):
        """Bounds of the value: those of a share."""
        return 0.0, 1.0

    def probe(self, system):
        """Make the probe that counts strains up to the slackness."""
        from ..probes import Probe, slack_fraction

        return Probe(slack_fraction, [], system.net.slackness[:, None])

    def error(self, state, equilibrium):
        """None, since the value jumps."""
        return None
