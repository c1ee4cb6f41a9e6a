"""Structures with known modes, their signals, and the smallest possible errors."""
