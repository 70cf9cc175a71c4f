"""Shapes of rigid bodies, one file a shape; they know nothing of contact.

`refweb.net.rigid_body` describes how to write one.
"""
