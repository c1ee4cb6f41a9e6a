"""Signals in the viewer: traces, spectra, spectrogram, and figures of channels over time."""
