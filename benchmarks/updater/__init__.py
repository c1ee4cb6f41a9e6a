"""Benchmarks of updating, localization and diagnosis."""
