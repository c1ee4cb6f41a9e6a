"""States of a structure within logs: changes of frequencies, and the diagnosis of the last state."""
