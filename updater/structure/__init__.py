"""The structure file: entries, checks, reading, writing."""
