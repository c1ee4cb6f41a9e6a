"""Outputs of a run that may fail: history and notices, with their spools."""
