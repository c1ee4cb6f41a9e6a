"""Causes that change the mass."""
