"""Causes in the measuring chain."""
