"""Outputs of a run that may fail: history and notices, with what is kept on disk until delivered."""
