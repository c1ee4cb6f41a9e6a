"""Plots by matplotlib; each `plot_` function returns its figure and shows nothing."""

from monitor.views.plots.identification import plot_mac as plot_mac
from monitor.views.plots.identification import plot_spectrum as plot_spectrum
from monitor.views.plots.identification import plot_stabilization as plot_stabilization
from monitor.views.plots.identification import plot_tracks as plot_tracks
from monitor.views.plots.mode_shapes import plot_shapes as plot_shapes
from monitor.views.report.fit_figures import plot_evidence as plot_evidence
