"""Figures of matplotlib, of plain arrays; modes and poles are drawn by the methods of `oma.ModalEstimate`."""

from oma.plots.diagrams import LINE as LINE
from oma.plots.diagrams import MODE as MODE
from oma.plots.diagrams import STABLE as STABLE
from oma.plots.diagrams import complexity_figure as complexity_figure
from oma.plots.diagrams import draw_damping as draw_damping
from oma.plots.diagrams import draw_poles as draw_poles
from oma.plots.diagrams import draw_spectrum_behind as draw_spectrum_behind
from oma.plots.diagrams import highest_shown as highest_shown
from oma.plots.diagrams import mac_figure as mac_figure
from oma.plots.diagrams import mac_with_model_figure as mac_with_model_figure
from oma.plots.diagrams import mark_modes as mark_modes
from oma.plots.diagrams import spectrum_figure as spectrum_figure
from oma.plots.diagrams import stabilization_figure as stabilization_figure
from oma.plots.diagrams import tracks_figure as tracks_figure
from oma.plots.shapes import Skeleton as Skeleton
from oma.plots.shapes import figure_of_modes as figure_of_modes
from oma.plots.shapes import shapes_figure as shapes_figure
from oma.plots.style import ALARM as ALARM
from oma.plots.style import FAINT as FAINT
from oma.plots.style import INK as INK
from oma.plots.style import OK as OK
from oma.plots.style import SOFT as SOFT
from oma.plots.style import WIDTH as WIDTH
from oma.plots.style import new_figure as new_figure
from oma.plots.style import styled as styled
