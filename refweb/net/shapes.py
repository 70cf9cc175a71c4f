"""Kinds of rigid shapes; what each is says `refweb.effects.contact.signed_distance`."""

SPHERE, RING, BOX, CYLINDER = range(4)
"""A ring is as its web sees it along its normal: no end to it along that axis."""
KINDS = {"sphere": SPHERE, "ring": RING, "box": BOX, "cylinder": CYLINDER}
