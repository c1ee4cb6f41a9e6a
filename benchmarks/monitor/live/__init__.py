"""Statistics of blocks of signals, before a window is complete."""
