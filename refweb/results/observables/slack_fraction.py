"""The share of elements that are slack."""

from __future__ import annotations

from .observable import Observable, Value


class SlackFraction(Observable):
    """Slack elements over all elements."""

    def of(self, state):
        """Share of the elements that are slack all along."""
        return Value(float(state.element_slack.mean()), None)

    def bounds(self, system):
        """A share."""
        return 0.0, 1.0

    def probe(self, system):
        """Counts strains up to the slackness."""
        from ..probes import Probe, slack_fraction

        return Probe(slack_fraction, [], system.net.slackness[:, None])

    def error(self, state, equilibrium):
        """None: it jumps."""
        return None
