"""Benchmarks of acquisition."""
