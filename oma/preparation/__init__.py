"""Signals before identification: conditioning, channel faults, gaps, sampling rates, quality."""
