"""Tension laws of lines: stress, tangent and energy over strain; they know nothing of nets."""
