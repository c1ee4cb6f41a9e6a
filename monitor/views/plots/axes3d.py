"""Three-dimensional axes with equal scales."""

import numpy as np
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.art3d import Line3DCollection
from mpl_toolkits.mplot3d.axes3d import Axes3D

from daq import FloatArray
from updater import Model

_TICKS = 4  # along the longest side
SWAY = 0.12  #: largest displacement drawn, as a share of the structure's size


def size(model: Model) -> float:
    """Return the structure's largest extent [m]."""
    return float(np.ptp(model.nodes, axis=0).max())


def frame_axes(axes: Axes3D, model: Model, zoom: float) -> Axes3D:
    """Give all three axes the same scale, with room for the motion."""
    low, high = model.nodes.min(axis=0), model.nodes.max(axis=0)
    margin = 1.3 * SWAY * size(model)
    low, high = low - margin, high + margin
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_xlabel("x [m]", labelpad=8)
    axes.set_ylabel("y [m]", labelpad=8)
    axes.set_zlabel("z [m]", labelpad=4)
    axes.set_box_aspect(high - low, zoom=zoom)
    axes.tick_params(labelsize=7)
    axes.view_init(elev=18, azim=-55)
    for axis, extent in zip((axes.xaxis, axes.yaxis, axes.zaxis), high - low, strict=True):
        axis.set_major_locator(MaxNLocator(max(1, round(_TICKS * extent / (high - low).max()))))
    return axes


def lines(axes: Axes3D, nodes: FloatArray, spans: list[tuple[int, int]], colour: str, width: float) -> None:
    """Draw the elements between nodes (n_nodes, 3)."""
    axes.add_collection3d(Line3DCollection([nodes[[a, b]] for a, b in spans], colors=colour, linewidths=width))
