"""Command `identify`: modes of logs."""
