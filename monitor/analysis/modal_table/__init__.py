"""Tables of modes from other programs."""
