"""Pre-test planning: expected errors, detectability, record length, sensor placement."""
