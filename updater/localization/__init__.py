"""Location of one or several masses."""
