"""Contact of lines with bodies, and of bodies with each other: where, how deep, and all its forces."""
