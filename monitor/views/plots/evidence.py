"""Evidence of the causes of a diagnosis, in the style of the report."""

from matplotlib.figure import Figure

from monitor.results.comparison import DiagnosisAnswer
from monitor.views.report.evidence_figures import evidence_figure
from monitor.views.report.svg import styled


def plot_evidence(diagnosis: DiagnosisAnswer) -> Figure:
    """Draw the log evidence of each cause relative to the best explanation.

    Raises
    ------
    ValueError
        If the diagnosis weighed no cause.
    """
    with styled():
        figure = evidence_figure(diagnosis)
        if figure is None:
            raise ValueError("diagnosis: expected weighed causes, found none")
        figure.draw_without_rendering()  # ticks take the style when they are first drawn
    return figure
