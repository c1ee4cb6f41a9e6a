"""The paper's one-step update: lumped masses, increments, their significance and location."""
