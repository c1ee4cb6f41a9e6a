"""Comparison of an event with the baseline, and the fit of hypotheses to it."""
