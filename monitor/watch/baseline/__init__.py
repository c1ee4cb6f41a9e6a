"""Baseline of a watch: windows collected, checked, and learned from."""
