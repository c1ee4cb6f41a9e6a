"""Benchmarks of the paper's method."""
