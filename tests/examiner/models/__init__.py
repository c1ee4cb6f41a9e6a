"""Structural models of the examiner."""
