"""Benchmarks of the service and of detection."""
