"""Equilibria and their bounds; no module here knows time or events."""
