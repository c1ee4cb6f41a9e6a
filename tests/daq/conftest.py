"""Hypothesis without deadlines: a busy machine is not an error."""

from hypothesis import settings

settings.register_profile("busy", deadline=None, max_examples=50)
settings.load_profile("busy")
