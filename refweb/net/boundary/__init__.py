"""Solids that a surface of triangles bounds: read, checked, weighed, and how deep a point is in them."""
