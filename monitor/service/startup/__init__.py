"""Checks and repairs before a run starts."""
