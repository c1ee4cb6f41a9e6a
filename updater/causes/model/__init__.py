"""Causes that are errors of the model."""
