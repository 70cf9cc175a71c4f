"""Shapes of rigid bodies, one file a shape; they know nothing of contact.

How to write one says `refweb.net.rigid_body`.
"""
