"""Frames, references and records for tests."""
