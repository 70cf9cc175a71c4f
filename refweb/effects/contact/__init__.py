"""Contact of lines with bodies, and of bodies with each other: where they touch, how deep, and the forces of penalty, damping and friction."""
