"""Kinds of frames and materials that `new structure` writes."""

KINDS = ("cantilever", "beam", "portal", "storeys", "t-frame")
MATERIALS = ("steel", "aluminium", "concrete", "timber")
