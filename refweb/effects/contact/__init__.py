"""Contact of lines with bodies: where they touch, how deep, and the forces of penalty, damping and friction."""
