"""Emulated nodes on a CAN bus, and their adapter."""
