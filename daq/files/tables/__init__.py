"""Tables of text: where they begin, and their columns."""
