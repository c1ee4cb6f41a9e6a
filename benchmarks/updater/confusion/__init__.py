"""Confusion matrices of the diagnosis."""
