"""M v' = f of a net: forces, tangent, mass, links and factorizations; it knows no scene, method or file."""
