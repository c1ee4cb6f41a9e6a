"""The monitoring loop: windows, baseline, detector, alarm, explanation, acceptance."""
