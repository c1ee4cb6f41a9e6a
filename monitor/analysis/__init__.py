"""From logs and tables to observations of a structure, and their explanation."""
