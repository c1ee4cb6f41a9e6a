"""Soak test of the service."""
