"""Modes in the viewer: shapes, auto-MAC, trends."""
