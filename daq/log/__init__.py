"""The MCAP log of a run: written, read, repaired and deleted by age. The analysis process is fed by its writer thread."""
