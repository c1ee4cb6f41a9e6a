"""Plots by matplotlib; each `plot_` function returns its figure and shows nothing."""

from monitor.views.plots.evidence import plot_evidence
from monitor.views.plots.identification import plot_mac, plot_spectrum, plot_stabilization, plot_tracks
from monitor.views.plots.mode_shapes import plot_shapes

__all__ = ["plot_evidence", "plot_mac", "plot_shapes", "plot_spectrum", "plot_stabilization", "plot_tracks"]
