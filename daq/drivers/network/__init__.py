"""Devices on a network."""
