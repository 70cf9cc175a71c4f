"""M v' = f assembled: force, tangent, mass, links and factorizations; it knows no scene, method or file."""
