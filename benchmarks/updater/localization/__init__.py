"""Benchmarks of localization."""
