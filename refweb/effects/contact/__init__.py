"""Contact of lines with bodies, and of bodies with each other: where, how deep, the forces of penalty and losses."""
