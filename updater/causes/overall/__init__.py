"""Causes that act on all modes alike, and damping."""
