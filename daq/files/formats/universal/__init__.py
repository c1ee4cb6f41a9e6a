"""Universal files: datasets, geometry, frequency responses."""
