"""Equilibria and their bounds; it knows no time and no events."""
