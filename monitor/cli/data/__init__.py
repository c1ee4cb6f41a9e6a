"""Commands that work on files: measurements, structures, logs."""
