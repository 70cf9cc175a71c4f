"""Shapes of rigid bodies, one file a shape; they know nothing of contact.

`refweb.net.rigid_body` describes how to write one. This file has no code. Must stay: its first sentence, which
``tests/test_architecture.py`` compares.
"""
