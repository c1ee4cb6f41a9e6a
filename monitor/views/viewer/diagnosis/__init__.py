"""A diagnosis in the viewer."""
