"""Commands on logs: summary, export, repair, repeated analysis."""
