"""Spectra and correlations, and the resonances and tones in them."""
