"""Two measured structures."""
