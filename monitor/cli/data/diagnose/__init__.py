"""Command `diagnose`: changes since reference logs, or errors of a structure file."""
