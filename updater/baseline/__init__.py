"""References learned from baseline windows, or taken from the structure file."""
