"""States of a structure within a record: steps, drifts, and whether windows are of one state."""
