"""Signals between the windows: residuals of channels, and innovations of the modes."""
