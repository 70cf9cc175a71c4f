"""Drag of a fluid on lines and bodies: its table, its force, and how explicit kicks solve for it."""
