"""M v' = f of a net: forces, tangent, mass, links and factorizations; it knows no scene, method or file.

Room: it imports net, effects and the files below them, and results, statics and dynamics import it; `ROOMS` in
``tests/test_architecture.py`` has this order. May change: this paragraph. Must stay: the first sentence, which stands
in `ROOMS` as well, and that this file has no code.
"""
