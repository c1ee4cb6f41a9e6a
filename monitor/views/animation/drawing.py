"""Drawing of an animation: members, ribs that show torsion, sensors, and their motion."""

import numpy as np

from daq import FloatArray
from daq.notebook import number_text
from monitor.views.geometry import RIB, RIBS_APART, ribs, side
from oma import ComplexArray, ModalEstimate
from updater.validation import ExpandedShapes

SWAY = 0.12  #: largest displacement drawn, of the structure's size
_SIDE = (32.0, 22.0)  # degrees: azimuth and elevation of the viewer


class Drawing:
    """Points at rest, their motion in each mode, and the lines between them.

    Parameters
    ----------
    estimate : measured modes
    shapes : their shapes at all nodes
    """

    def __init__(self, estimate: ModalEstimate, shapes: ExpandedShapes) -> None:
        model, nodes = shapes.model, shapes.model.nodes
        extent = np.ptp(nodes, axis=0)
        self.name = model.structure.name
        self.size = float(np.linalg.norm(extent))
        self.centre: FloatArray = (nodes.min(0) + nodes.max(0)) / 2
        self.towards: FloatArray = side(extent, *_SIDE)  #: (3,) towards the viewer
        self.labels = [_label(estimate, k) for k in range(estimate.n_modes)]
        at, way = ribs(nodes, model.spans, self.towards, RIBS_APART * self.size)
        arms = RIB * self.size * np.concatenate([way, -way])
        owner = np.concatenate([at, at])
        turned = np.cross(shapes.rotation[:, owner], arms)
        self.points: FloatArray = np.concatenate([nodes, nodes[owner] + arms])  #: (n, 3) at rest [m]
        moved = np.concatenate([shapes.translation, shapes.translation[:, owner] + turned], axis=1)
        self.motion: ComplexArray = (SWAY * self.size * moved).astype(np.complex128)  #: (n_modes, n, 3) [m]
        self.spans = [(int(a), int(b)) for a, b in model.spans]  #: pairs of points: members
        self.ribs = [(len(nodes) + i, len(nodes) + len(at) + i) for i in range(len(at))]  #: pairs of points
        places = {s.at for s in model.structure.corrected_sensors if s.channel in estimate.channels}
        self.sensors = sorted({int(np.argmin(np.linalg.norm(nodes - place, axis=1))) for place in places})  #: points

    @property
    def reach(self) -> float:
        """Radius about the centre that holds all motions [m]."""
        farthest = np.linalg.norm(self.points - self.centre, axis=1).max()
        return float(farthest + SWAY * self.size)


def _label(estimate: ModalEstimate, k: int) -> str:
    frequency = number_text(float(estimate.frequency[k]), float(estimate.frequency_std[k]))
    damping = number_text(100 * float(estimate.damping[k]), 100 * float(estimate.damping_std[k]))
    return f"Mode {k + 1}\n{frequency} Hz, {damping} %"
