"""Command `structure`: picture of a structure, modes, detectability, parameters."""
