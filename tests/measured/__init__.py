"""Measured structures, and tests on them."""
