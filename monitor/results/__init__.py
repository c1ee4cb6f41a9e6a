"""Results as plain values: schemas of the log and of the files for other programs."""
