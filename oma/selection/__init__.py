"""Selection of modes among the poles of all model orders."""
