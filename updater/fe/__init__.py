"""Finite elements of a frame: elements, assembly, modes and response."""
